(* obsdesign: What the storage functions of the time that is left do between two measurements, and at one. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign ObsTrajectory ObsPlant ObsBernstein ObsInstants ObsClock.
Import ListNotations.
Open Scope R_scope.

(* Parts of a list, and what a program reads of it *)
Lemma read_first a b k : length a = k -> eval (Part 0 k) (a ++ b) = a.
Proof. intros <-. cbn [eval skipn]. apply firstn_app_exact. Qed.
Lemma read_next a b c j k : length a = j -> length b = k -> eval (Part j k) (a ++ b ++ c) = b.
Proof. intros <- <-. cbn [eval]. rewrite skipn_app_exact. apply firstn_app_exact. Qed.
Lemma read_after a b c j k : length (a ++ b) = j -> length c = k -> eval (Part j k) (a ++ b ++ c) = c.
Proof. intros <- <-. cbn [eval]. rewrite app_assoc, skipn_app_exact. apply firstn_all. Qed.

(* A list of checks that holds is one inequality for each control value *)
Lemma everywhere_holds N form segs : forall T, everywhere N form segs T = true ->
  forall s, In s segs -> forall k, (k <= degree s)%nat -> forall x, length x = N -> 0 <= quad (form s k) x.
Proof.
 induction segs as [|s0 segs IH]; intros T E s Hs k Hk x Hx; [destruct Hs|].
 cbn [everywhere] in E. apply andb_true_iff in E. destruct E as [E1 E2].
 destruct Hs as [<-|Hs]; [|now apply (IH (tl T))].
 rewrite forallb_forall in E1. eapply nonnegative; [apply E1|exact Hx]. apply in_seq. lia. Qed.
Lemma same_eq M N : same M N = true -> M = N.
Proof. unfold same. destruct (list_eq_dec _ M N); congruence. Qed.
Lemma positive_R q : negb (Qle_bool q 0) = true -> 0 < Q2R q.
Proof.
 intros E. apply negb_true_iff in E. destruct (Rle_or_lt (Q2R q) 0) as [Hq|Hq]; auto.
 rewrite <- Q2R_zero in Hq. apply Rle_Qle in Hq. apply Qle_bool_iff in Hq. congruence. Qed.
Lemma number_R k : Q2R (number k) = INR k.
Proof. unfold number, Q2R, inject_Z. cbn [Qnum Qden]. rewrite INR_IZR_INZ. field. Qed.

(* Signals: sum of two lists, and their joint state *)
Definition plus_signals := vadd (R -> R) (fun g h s => g s + h s).
Lemma at_plus xs : forall ys t, at_ (plus_signals xs ys) t = vaddR (at_ xs t) (at_ ys t).
Proof.
 unfold plus_signals. induction xs as [|g xs IH]; intros [|h ys] t; cbn [vadd at_ map]; auto. f_equal. apply IH. Qed.
Lemma plus_moves xs t dx : moves xs t dx -> forall ys dy, moves ys t dy -> moves (plus_signals xs ys) t (vaddR dx dy).
Proof.
 unfold plus_signals. intros M. induction M as [|g a xs dx D M IH]; intros ys dy N; [exact N|].
 destruct N as [|h b ys dy E N]; cbn [vadd]; constructor; auto; [|now apply IH].
 exact (is_derive_plus g h t a b D E). Qed.

Section Parts.
Variables (o : observer) (c : witness).
Definition joint_signals (es ths : list (R -> R)) := plus_signals (rows (rmat (Se o)) es) (rows (rmat (St o)) ths).
Lemma joint_at es ths t : at_ (joint_signals es ths) t = joint o (at_ es t) (at_ ths t).
Proof. unfold joint_signals. now rewrite at_plus, !at_rows. Qed.
Lemma joint_moves es ths t de dth : moves es t de -> moves ths t dth -> moves (joint_signals es ths) t (joint o de dth).
Proof. intros M N. apply plus_moves; now apply moves_rows. Qed.
(* x' M x along signals x *)
Lemma value_moves M xs t dx : moves xs t dx ->
  is_derive (fun s => value M (at_ xs s)) t (value_dot M (at_ xs t) dx).
Proof.
 intros D. assert (E := moves_dot xs (rows (rmat M) xs) t _ D _ (moves_rows (rmat M) xs t _ D)).
 rewrite at_rows in E. unfold value, value_dot. eapply is_derive_ext; [|exact E]. intros s. simpl.
 now rewrite at_rows. Qed.

(* The forms, read as inequalities *)
Section Sizes.
Variables (e th : list R).
Hypothesis (size_e : length e = n o) (size_th : length th = nt o).
Let x := joint o e th.
Lemma below_reads s k : 0 <= quad (below o c s k) (e ++ th) -> value (control s k) x <= Q2R (roof c) * sq x.
Proof.
 unfold quad, below, lx. cbn [bil bil1 eval]. fold (eval (Part 0 (n o)) (e ++ th)).
 assert (E := read_first e th _ size_e). assert (F := read_next e th [] _ _ size_e size_th). rewrite app_nil_r in F.
 unfold le, lt. rewrite E, F. fold (joint o e th). rewrite Q2R_opp, Q2R_one. fold x. unfold value, sq. lra. Qed.
Lemma above_reads floor s k : 0 <= quad (above o floor s k) (e ++ th) -> Q2R floor * sq x <= value (control s k) x.
Proof.
 unfold quad, above, lx. cbn [bil bil1 eval].
 assert (E := read_first e th _ size_e). assert (F := read_next e th [] _ _ size_e size_th). rewrite app_nil_r in F.
 unfold le, lt. rewrite E, F. fold (joint o e th). rewrite Q2R_opp, Q2R_one. fold x. unfold value, sq. lra. Qed.
(* (J) and (N): at a measurement with the noise eta *)
Lemma jump_reads s k eta : length eta = entries (noisy c) (ny o) -> 0 <= quad (jump o c s k) (e ++ th ++ eta) ->
  value (control s k) (joint o (err_after o e eta) (hold_after o e eta)) <= value (first c) x + Q2R (kappa c) * sq eta.
Proof.
 intros He. unfold quad, jump, lxa, lx, lr. cbn [bil bil1 eval]. unfold le, lt, ln.
 rewrite (read_first e _ _ size_e), (read_next e th eta _ _ size_e size_th).
 rewrite (read_after e th eta) by (rewrite ?app_length; lia).
 fold (seen o e eta). fold (err_after o e eta). fold (hold_after o e eta). fold (joint o e th).
 fold (joint o (err_after o e eta) (hold_after o e eta)). rewrite Q2R_opp, Q2R_one. fold x. unfold value, sq. lra. Qed.
(* (F): in between *)
Lemma flow_reads s k f w : 0 < Q2R (width s) -> length f = nf o -> length w = entries (driven c) (nw o) ->
  let dx := joint o (err_dot o e th f w) (hold_dot o th) in
  quad (flow o c s k) (e ++ th ++ f ++ w) =
  slopes (degree s) (fun j => value (control s j) x) k / Q2R (width s)
  - (value_dot (control s k) x dx + 2 * Q2R (rate c) * value (control s k) x
     + (Q2R (weight c) * sq (zed o e) - Q2R (mu c) * sq w))
  - fold_right Rplus 0 (map (fun sm => Q2R (fst sm) * sigma (snd sm) (err_arg o e f w) f)
      (combine (nth k (scales s) []) (multipliers o))).
Proof.

 intros Hh Hf Hw dx. set (z := e ++ th ++ f ++ w).
 assert (Ee : eval (le o) z = e) by (now apply read_first).
 assert (Et : eval (lt o) z = th) by (now apply read_next).
 assert (Ef : eval (lf o) z = f).
 { unfold lf, z. rewrite (app_assoc e th). apply read_next; auto. rewrite app_length; lia. }
 assert (Ew : eval (lw o c) z = w).
 { unfold lw, z. rewrite (app_assoc e th). apply read_after; auto. rewrite !app_length; lia. }
 assert (Ed : eval (led o c) z = err_dot o e th f w) by (unfold led; cbn [eval]; now rewrite Ee, Et, Ef, Ew).
 assert (Eq : eval (lq o c) z = err_arg o e f w) by (unfold lq; cbn [eval]; now rewrite Ee, Ef, Ew).
 assert (Ex : eval (lx o) z = x) by (unfold lx; cbn [eval]; now rewrite Ee, Et).
 assert (Edx : eval (ldx o c) z = dx) by (unfold ldx; cbn [eval]; now rewrite Ed, Et).
 unfold flow. rewrite quad_app.
 assert (M : forall sms, quad (flat_map (minus_sigma o c) sms) z =
   - fold_right Rplus 0 (map (fun sm => Q2R (fst sm) * sigma (snd sm) (err_arg o e f w) f) sms)).
 { induction sms as [|[t m] sms IH]; [unfold quad; simpl; ring|]. cbn [flat_map map fold_right fst snd].
   rewrite quad_app, IH. unfold quad, minus_sigma. cbn [bil bil1 eval].
   rewrite Eq, Ef, !Q2R_opp, Q2R_mult, Q2R_two. unfold sigma. ring. }
 rewrite M. unfold quad. cbn [bil bil1 eval]. unfold lz. cbn [eval]. rewrite Ex, Edx, Ee, Ew.
 assert (Hq : ~ (width s == 0)%Q).
 { intros E. apply Qeq_eqR in E. rewrite Q2R_zero in E. lra. }
 rewrite !Q2R_opp, !Q2R_minus, !Q2R_div, !Q2R_minus, !number_R, Q2R_mult, Q2R_two, Q2R_one by exact Hq.
 unfold slopes, value, value_dot, sq, zed. field. lra. Qed.
Lemma flow_holds s k f w : 0 < Q2R (width s) -> length f = nf o -> length w = entries (driven c) (nw o) ->
  forallb (forallb (Qle_bool 0)) (scales s) = true -> 0 <= quad (flow o c s k) (e ++ th ++ f ++ w) ->
  (forall m, In m (multipliers o) -> 0 <= sigma m (err_arg o e f w) f) ->
  value_dot (control s k) x (joint o (err_dot o e th f w) (hold_dot o th))
    - slopes (degree s) (fun j => value (control s j) x) k / Q2R (width s)
    + 2 * Q2R (rate c) * value (control s k) x + (Q2R (weight c) * sq (zed o e) - Q2R (mu c) * sq w) <= 0.
Proof.
 intros Hh Hf Hw Hs Hn Hm. rewrite flow_reads in Hn by auto.
 assert (S : forall ts ms, forallb (Qle_bool 0) ts = true -> (forall m, In m ms -> 0 <= sigma m (err_arg o e f w) f) ->
   0 <= fold_right Rplus 0 (map (fun sm => Q2R (fst sm) * sigma (snd sm) (err_arg o e f w) f) (combine ts ms))).
 { induction ts as [|t ts IH]; intros [|m ms] Ht Hms; cbn [combine map fold_right fst snd]; try lra.
   cbn [forallb] in Ht. apply andb_true_iff in Ht. destruct Ht as [Ht Hts].
   assert (0 <= Q2R t * sigma m (err_arg o e f w) f) by (apply Rmult_le_pos; [now apply Qle_R|apply Hms; now left]).
   assert (J := IH ms Hts ltac:(intros; apply Hms; now right)). lra. }
 assert (N : forallb (Qle_bool 0) (nth k (scales s) []) = true).
 { destruct (nth_in_or_default k (scales s) []) as [Hk| ->]; [|reflexivity].
   rewrite forallb_forall in Hs. now apply Hs. }
 specialize (S _ _ N Hm). lra. Qed.
End Sizes.

(* The certificate between two measurements, or at one: what it rests on *)
Variables TF TJ TR : list (list (list (list Z))).
Hypothesis cert : certified o c TF TJ TR = true.
Lemma certified_parts : sound o c = true
  /\ everywhere (n o + nt o + nf o + entries (driven c) (nw o)) (flow o c) (segments c) TF = true
  /\ settles o c (n o + nt o + entries (noisy c) (ny o)) 0 (segments c) TJ = true
  /\ everywhere (n o + nt o) (below o c) (segments c) TR = true.
Proof. unfold certified in cert. rewrite !andb_true_iff in cert. tauto. Qed.
Lemma sound_parts : 0 < Q2R (whole (segments c)) /\ 0 <= Q2R (T1 o) /\ Q2R (T2 o) = Q2R (whole (segments c))
  /\ 0 <= Q2R (rate c) /\ joined (segments c) = true
  /\ forall s, In s (segments c) -> 0 < Q2R (width s) /\ forallb (forallb (Qle_bool 0)) (scales s) = true.
Proof.
 destruct certified_parts as [S _]. unfold sound in S. rewrite !andb_true_iff in S.
 destruct S as (((((S1 & S2) & S3) & S4) & S5) & S6). repeat split; auto using Qle_R, positive_R.
 - now apply Qeq_eqR, Qeq_bool_iff.
 - rewrite forallb_forall in S6. specialize (S6 s H). apply andb_true_iff in S6. apply positive_R, S6.
 - rewrite forallb_forall in S6. specialize (S6 s H). apply andb_true_iff in S6. apply S6. Qed.

(* The storage function lies between what bounds its control values *)
Lemma poly_place s tau : 0 < Q2R (width s) -> 0 <= tau <= Q2R (width s) -> 0 <= tau / Q2R (width s) <= 1.
Proof.
 intros Hs Ht. split.
 - apply Rmult_le_pos; [lra|]. apply Rlt_le, Rinv_0_lt_compat. lra.
 - apply Rle_div_l; lra. Qed.
Lemma storage_keeps x (keeps : R -> Prop) segs : segs <> [] -> (forall s, In s segs -> 0 < Q2R (width s)) ->
  (forall d a s, 0 <= s <= 1 -> (forall k, (k <= d)%nat -> keeps (a k)) -> keeps (bez d a s)) ->
  (forall s, In s segs -> forall k, (k <= degree s)%nat -> keeps (value (control s k) x)) ->
  forall tau, 0 <= tau <= Q2R (whole segs) -> keeps (storage segs tau x).
Proof.
 intros Ne Hw Hc. revert Ne Hw. induction segs as [|s segs IH]; intros Ne Hw Hb tau Ht; [congruence|].
 assert (B : tau <= Q2R (width s) -> keeps (poly s tau x)).
 { intros Hs. apply Hc; [|intros k Hk; now apply Hb; [left|]]. apply poly_place; [apply Hw; now left|lra]. }
 destruct segs as [|s' segs].
 - cbn [storage]. apply B. cbn [whole] in Ht. rewrite Q2R_plus, Q2R_zero in Ht. lra.
 - change (storage (s :: s' :: segs) tau x) with
     (if Rlt_dec tau (Q2R (width s)) then poly s tau x else storage (s' :: segs) (tau - Q2R (width s)) x).
   destruct (Rlt_dec tau (Q2R (width s))); [apply B; lra|].
   change (whole (s :: s' :: segs)) with (width s + whole (s' :: segs))%Q in Ht. rewrite Q2R_plus in Ht.
   apply IH; [congruence|intros; apply Hw; now right|intros; apply Hb; auto; now right|lra]. Qed.
Lemma storage_start x segs s : (forall t, In t (s :: segs) -> 0 < Q2R (width t)) ->
  storage (s :: segs) 0 x = value (control s 0) x.
Proof.
 intros Hw. assert (E : poly s 0 x = value (control s 0) x).
 { unfold poly. replace (0 / Q2R (width s)) with 0; [apply bez_start|]. field.
   specialize (Hw s (or_introl eq_refl)). lra. }
 cbn [storage]. destruct segs; [exact E|]. destruct (Rlt_dec 0 (Q2R (width s))) as [|N]; [exact E|].
 specialize (Hw s (or_introl eq_refl)). lra. Qed.
Lemma storage_next x s s' segs : (forall t, In t (s :: s' :: segs) -> 0 < Q2R (width t)) ->
  control s (degree s) = control s' 0 -> poly s (Q2R (width s)) x = storage (s' :: segs) 0 x.
Proof.
 intros Hw E. rewrite storage_start by (intros; apply Hw; now right). unfold poly.
 replace (Q2R (width s) / Q2R (width s)) with 1; [now rewrite bez_end, E|]. field.
 specialize (Hw s (or_introl eq_refl)). lra. Qed.

(* A measurement, with the interval g that comes *)
Lemma settles_holds N x b : (forall s k, (exists T, check false N (jump o c s k) T = true) ->
  value (control s k) x <= b) ->
  forall segs from T tau, segs <> [] -> settles o c N from segs T = true ->
  (forall s, In s segs -> 0 < Q2R (width s)) -> Q2R (T2 o) = Q2R from + Q2R (whole segs) ->
  0 <= tau -> Q2R (T1 o) <= Q2R from + tau <= Q2R (T2 o) -> storage segs tau x <= b.
Proof.
 intros V. induction segs as [|s segs IH]; intros from T tau Ne S Hw He Hp Ht; [congruence|].
 cbn [settles] in S. apply andb_true_iff in S. destruct S as [S1 S2]. rewrite forallb_forall in S1.
 assert (Hs := Hw s (or_introl eq_refl)).
 assert (Kk : forall k, (k <= degree s)%nat -> ends_early o from s segs = false ->
   only_last o segs = false \/ k = degree s -> value (control s k) x <= b).
 { intros k Hk E1 E2. specialize (S1 k ltac:(apply in_seq; lia)). rewrite E1 in S1. cbn [orb] in S1.
   apply V. exists (nth k (hd [] T) []). destruct E2 as [E2|E2].
   - rewrite E2 in S1. exact S1.
   - subst k. rewrite Nat.eqb_refl in S1. cbn [negb] in S1. rewrite andb_false_r in S1. exact S1. }
 destruct segs as [|s' segs].
 - cbn [storage whole] in *. rewrite Q2R_plus, Q2R_zero in He. unfold poly.
   destruct (only_last o []) eqn:E.
   + cbn [only_last] in E. apply Qle_bool_iff, Qle_Rle in E.
     replace (tau / Q2R (width s)) with 1; [rewrite bez_end; now apply Kk; [lia| |right]|].
     replace tau with (Q2R (width s)) by lra. field. lra.
   + apply bez_le; [apply poly_place; lra|]. intros k Hk. now apply Kk; [|reflexivity|left].
 - change (storage (s :: s' :: segs) tau x) with
     (if Rlt_dec tau (Q2R (width s)) then poly s tau x else storage (s' :: segs) (tau - Q2R (width s)) x).
   change (whole (s :: s' :: segs)) with (width s + whole (s' :: segs))%Q in He. rewrite Q2R_plus in He.
   destruct (Rlt_dec tau (Q2R (width s))) as [Lt|Ge].
   + unfold poly. apply bez_le; [apply poly_place; lra|]. intros k Hk. apply Kk; auto.
     unfold ends_early. destruct (Qle_bool (from + width s) (T1 o)) eqn:E; auto.
     apply Qle_bool_iff, Qle_Rle in E. rewrite Q2R_plus in E. lra.
   + apply (IH (from + width s)%Q (tl T)); auto; try congruence; rewrite ?Q2R_plus; try lra.
     intros; apply Hw; now right. Qed.

(* One interval between two measurements, or a part of it: signals e, th, f~, w on [lo, hi] *)
Section Gap.
Variables (es ths : list (R -> R)) (f w : R -> list R) (lo hi : R).
Hypothesis (size_e : length es = n o) (size_th : length ths = nt o).
Hypothesis (size_f : forall t, length (f t) = nf o) (size_w : forall t, length (w t) = entries (driven c) (nw o)).
Hypothesis e_moves : forall t, lo <= t <= hi -> moves es t (err_dot o (at_ es t) (at_ ths t) (f t) (w t)).
Hypothesis th_moves : forall t, lo <= t <= hi -> moves ths t (hold_dot o (at_ ths t)).
Hypothesis w_continuous : continuous_on (fun s => sq (w s)) lo hi.
Hypothesis class : forall t, lo <= t <= hi -> forall m, In m (multipliers o) ->
  0 <= sigma m (err_arg o (at_ es t) (f t) (w t)) (f t).
Definition x_at t := joint o (at_ es t) (at_ ths t).
Definition weighed t := exp (2 * Q2R (rate c) * t) * (Q2R (weight c) * sq (zed o (at_ es t)) - Q2R (mu c) * sq (w t)).
Definition grown segs te tau := exp (2 * Q2R (rate c) * (te - tau)) * storage segs tau (x_at (te - tau)).

Lemma weighed_continuous : continuous_on weighed lo hi.
Proof.
 intros s Hs. apply (continuous_mult (fun t => exp (2 * Q2R (rate c) * t))).
 - apply (ex_derive_continuous (K := R_AbsRing) (V := R_NormedModule)). auto_derive. auto.
 - apply (continuous_minus (fun t => Q2R (weight c) * sq (zed o (at_ es t))) (fun t => Q2R (mu c) * sq (w t))).
   + apply (continuous_mult (fun _ => Q2R (weight c))); [apply continuous_const|].
     eapply continuous_ext; [|apply (steady_sq (rows (rmat (Cp o)) es) s)].
     * intros r. simpl. unfold zed. now rewrite at_rows.
     * apply (moves_steady _ _ _ (moves_rows _ _ _ _ (e_moves s Hs))).
   + apply (continuous_mult (fun _ => Q2R (mu c))); [apply continuous_const|]. now apply w_continuous. Qed.

(* exp(2 rate t) V falls by no less than the integral, on one segment *)
Lemma on_segment s te tau1 tau2 : In s (segments c) -> 0 <= tau1 <= tau2 -> tau2 <= Q2R (width s) ->
  lo <= te - tau2 -> te - tau1 <= hi ->
  exp (2 * Q2R (rate c) * (te - tau1)) * poly s tau1 (x_at (te - tau1)) + RInt weighed (te - tau2) (te - tau1)
  <= exp (2 * Q2R (rate c) * (te - tau2)) * poly s tau2 (x_at (te - tau2)).
Proof.
 intros Hs Ht Hw Hl Hh. destruct sound_parts as (_ & _ & _ & _ & _ & W). destruct (W s Hs) as [Pw Ps].
 destruct certified_parts as (_ & F & _). set (h := Q2R (width s)) in *. set (k2 := 2 * Q2R (rate c)) in *.
 set (xs := joint_signals es ths).
 set (dx := fun t => joint o (err_dot o (at_ es t) (at_ ths t) (f t) (w t)) (hold_dot o (at_ ths t))).
 set (a := fun k t => value (control s k) (at_ xs t)).
 set (da := fun t k => value_dot (control s k) (at_ xs t) (dx t)).
 set (u := fun t => (te - t) / h).
 assert (Xm : forall t, lo <= t <= hi -> moves xs t (dx t)) by (intros; apply joint_moves; auto).
 set (U := fun r => exp (k2 * r) * bez (degree s) (fun k => a k r) (u r)).
 assert (D : forall t, lo <= t <= hi -> is_derive U t
   (k2 * exp (k2 * t) * bez (degree s) (fun k => a k t) (u t)
    + exp (k2 * t) * (bez (degree s) (da t) (u t)
      + (-1 / h) * bez (degree s) (slopes (degree s) (fun k => a k t)) (u t)))).
 { intros t Hx. assert (De : is_derive (fun r => exp (k2 * r)) t (k2 * exp (k2 * t))) by (auto_derive; auto; ring).
   assert (Du : is_derive u t (-1 / h)) by (unfold u; auto_derive; [lra|field; lra]).
   exact (is_derive_mult _ _ t _ _ De (bez_moves (degree s) a (da t) u _ t
     (fun k => value_moves _ _ _ _ (Xm t Hx)) Du) Rmult_comm). }
 assert (E : forall tau, exp (k2 * (te - tau)) * poly s tau (x_at (te - tau)) = U (te - tau)).
 { intros tau. unfold poly, U, u. fold h. replace (te - (te - tau)) with tau by ring. unfold a, xs, x_at.
   now rewrite joint_at. }
 rewrite !E. eapply (falls_by U); [lra| | |].
 - intros t Hx. apply weighed_continuous. lra.
 - intros t Hx. apply D. lra.
 - intros t Hx. simpl. set (phi := Q2R (weight c) * sq (zed o (at_ es t)) - Q2R (mu c) * sq (w t)).
   assert (B : bez (degree s) (fun k => (da t k + -1 / h * slopes (degree s) (fun j => a j t) k) +
     (k2 * a k t + phi)) (u t) <= 0).
   { apply bez_le.
     - unfold u. apply poly_place; auto. fold h. lra.
     - intros k Hk. assert (N := everywhere_holds _ _ _ _ F s Hs k Hk (at_ es t ++ at_ ths t ++ f t ++ w t)).
       assert (I := flow_holds (at_ es t) (at_ ths t) ltac:(unfold at_; rewrite map_length; exact size_e)
         ltac:(unfold at_; rewrite map_length; exact size_th) s k (f t) (w t) Pw (size_f t) (size_w t) Ps).
       specialize (N ltac:(rewrite !app_length; unfold at_; rewrite !map_length, size_e, size_th, size_f, size_w; lia)).
       specialize (I N (class t ltac:(lra))). unfold a, da, xs. rewrite joint_at. fold h k2 phi in I.
       fold (dx t) in I. lra. }
   rewrite bez_add, bez_add, bez_scale, bez_add, bez_scale, bez_const in B. unfold weighed. fold k2 phi.
   set (p := bez (degree s) (fun k => a k t) (u t)) in *. set (q := bez (degree s) (da t) (u t)) in *.
   set (r := bez (degree s) (slopes _ _) (u t)) in *. assert (Ep := exp_pos (k2 * t)).
   replace (k2 * exp (k2 * t) * p + exp (k2 * t) * (q + -1 / h * r) + exp (k2 * t) * phi)
     with (- (exp (k2 * t) * - (q + -1 / h * r + (k2 * p + phi)))) by ring.
   assert (0 <= exp (k2 * t) * - (q + -1 / h * r + (k2 * p + phi))) by (apply Rmult_le_pos; lra). lra. Qed.

(* and on the whole interval *)
Lemma along segs : incl segs (segments c) -> joined segs = true -> forall te tau1 tau2, 0 <= tau1 <= tau2 ->
  tau2 <= Q2R (whole segs) -> lo <= te - tau2 -> te - tau1 <= hi ->
  grown segs te tau1 + RInt weighed (te - tau2) (te - tau1) <= grown segs te tau2.
Proof.
 unfold grown. induction segs as [|s segs IH]; intros Hi Hj te tau1 tau2 Ht Hw Hl Hh.
 - cbn [whole] in Hw. rewrite Q2R_zero in Hw. replace tau2 with tau1 by lra. rewrite RInt_point.
   unfold zero. simpl. lra.
 - assert (Hs : In s (segments c)) by (apply Hi; now left). destruct sound_parts as (_ & _ & _ & _ & _ & W).
   assert (Pw := proj1 (W s Hs)). destruct segs as [|s' segs].
   + cbn [storage whole] in *. rewrite Q2R_plus, Q2R_zero in Hw. apply on_segment; auto; lra.
   + assert (U : forall tau x, storage (s :: s' :: segs) tau x =
       if Rlt_dec tau (Q2R (width s)) then poly s tau x else storage (s' :: segs) (tau - Q2R (width s)) x)
       by reflexivity.
     rewrite !U. change (whole (s :: s' :: segs)) with (width s + whole (s' :: segs))%Q in Hw. rewrite Q2R_plus in Hw.
     change (joined (s :: s' :: segs)) with (same (control s (degree s)) (control s' 0) && joined (s' :: segs)) in Hj.
     apply andb_true_iff in Hj. destruct Hj as [Hj1 Hj2]. apply same_eq in Hj1.
     set (h := Q2R (width s)) in *.
     assert (Hi' : incl (s' :: segs) (segments c)) by (intros t Hx; apply Hi; now right).
     assert (Sh : forall tau, te - h - (tau - h) = te - tau) by (intros; ring).
     destruct (Rlt_dec tau1 h) as [L1|G1], (Rlt_dec tau2 h) as [L2|G2].
     * apply on_segment; auto; fold h; lra.
     * assert (S := on_segment s te tau1 h Hs ltac:(lra) ltac:(fold h; lra) ltac:(lra) Hh).
       assert (J := IH Hi' Hj2 (te - h) 0 (tau2 - h) ltac:(lra) ltac:(lra) ltac:(lra) ltac:(lra)).
       rewrite Sh, !Rminus_0_r in J. unfold h in S at 3.
       rewrite (storage_next _ s s' segs) in S; auto; [|intros t Hx; now apply W, Hi].
       rewrite (integral_joins weighed (te - tau2) (te - h) (te - tau1)); [lra|lra|].
       intros r Hr. apply weighed_continuous. lra.
     * lra.
     * assert (J := IH Hi' Hj2 (te - h) (tau1 - h) (tau2 - h) ltac:(lra) ltac:(lra) ltac:(lra) ltac:(lra)).
       rewrite !Sh in J. exact J. Qed.
End Gap.
End Parts.
