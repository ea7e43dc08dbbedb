(* obsdesign: V along all trajectories with measurements at instants: first of errors,
  then of plant and observer with one f. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign ObsTrajectory ObsPlant ObsBernstein ObsInstants ObsClock ObsGap.
Import ListNotations.
Open Scope R_scope.

(* Errors in pieces, up to s in the last one: V and the weighed integral stay below what the beginning and eta give *)
Section Run.
Variables (o : observer) (c : witness) (TF TJ TR : list (list (list (list Z)))).
Hypothesis cert : certified o c TF TJ TR = true.
Variables (t : nat -> R) (es ths : nat -> list (R -> R)) (f u : nat -> R -> list R) (v : nat -> list R).
Variables (last : nat) (s : R).
Hypothesis inside : t last <= s <= t (S last).
Hypothesis (t_start : t 0%nat = 0) (t_first : 0 <= t 1%nat <= Q2R (T2 o)).
Hypothesis t_next : forall j, Q2R (T1 o) <= t (S (S j)) - t (S j) <= Q2R (T2 o).
Hypothesis (size_e : forall j, length (es j) = n o) (size_th : forall j, length (ths j) = nt o).
Hypothesis size_f : forall j r, length (f j r) = nf o.
Hypothesis size_u : forall j r, length (u j r) = entries (driven c) (nw o).
Hypothesis size_v : forall j, length (v j) = entries (noisy c) (ny o).
Let now := past t last s.
Let e j := at_ (es j).
Let th j := at_ (ths j).
Let x j r := joint o (e j r) (th j r).
Hypothesis e_moves : forall j r, now j r -> moves (es j) r (err_dot o (e j r) (th j r) (f j r) (u j r)).
Hypothesis th_moves : forall j r, now j r -> moves (ths j) r (hold_dot o (th j r)).
Hypothesis u_continuous : forall j r, now j r -> continuous (fun r => sq (u j r)) r.
Hypothesis class : forall j r, now j r -> forall m, In m (multipliers o) ->
  0 <= sigma m (err_arg o (e j r) (f j r) (u j r)) (f j r).
Hypothesis e_jumps : forall j, (j < last)%nat -> e (S j) (t (S j)) = err_after o (e j (t (S j))) (v (S j)).
Hypothesis th_jumps : forall j, (j < last)%nat -> th (S j) (t (S j)) = hold_after o (e j (t (S j))) (v (S j)).
Let k2 := 2 * Q2R (rate c).
Let phi j := weighed o c (es j) (u j).
Let noise j := exp (k2 * t j) * sq (v j).
Let V tau y := storage (segments c) tau y.

Lemma e_size j r : length (e j r) = n o. Proof. unfold e, at_. now rewrite map_length. Qed.
Lemma th_size j r : length (th j r) = nt o. Proof. unfold th, at_. now rewrite map_length. Qed.
Lemma some_segments : segments c <> [].
Proof.
 destruct (sound_parts o c TF TJ TR cert) as (W & _). intros E. rewrite E in W. cbn [whole] in W.
 rewrite Q2R_zero in W. lra. Qed.
Lemma V_start y : V 0 y = value (first c) y.
Proof.
 destruct (sound_parts o c TF TJ TR cert) as (_ & _ & _ & _ & _ & W). unfold V, first.
 assert (N := some_segments). destruct (segments c) as [|a l]; [congruence|]. apply storage_start. intros b Hb.
 now apply W. Qed.
Lemma gap_length j : 0 <= t (S j) - t j <= Q2R (whole (segments c)).
Proof.
 destruct (sound_parts o c TF TJ TR cert) as (_ & W1 & W2 & _). rewrite <- W2.
 destruct j; [rewrite t_start|specialize (t_next j)]; lra. Qed.
Lemma V_below j r tau : 0 <= tau <= Q2R (whole (segments c)) -> V tau (x j r) <= Q2R (roof c) * sq (x j r).
Proof.
 destruct (sound_parts o c TF TJ TR cert) as (_ & _ & _ & _ & _ & W).
 destruct (certified_parts o c TF TJ TR cert) as (_ & _ & _ & B).
 apply (storage_keeps (x j r) (fun a => a <= Q2R (roof c) * sq (x j r))).
 - apply some_segments.
 - intros a Ha. now apply W.
 - intros d a q Hq Ha. now apply bez_le.
 - intros a Ha k Hk. apply (below_reads o c (e j r) (th j r)); auto using e_size, th_size.
   apply (everywhere_holds _ _ _ _ B a Ha k Hk). rewrite app_length, e_size, th_size. reflexivity. Qed.
(* at a measurement V grows by no more than kappa |eta|^2 *)
Lemma V_jumps j : (j < last)%nat ->
  V (t (S (S j)) - t (S j)) (x (S j) (t (S j))) <= V 0 (x j (t (S j))) + Q2R (kappa c) * sq (v (S j)).
Proof.
 intros Hj. rewrite V_start. destruct (sound_parts o c TF TJ TR cert) as (_ & W1 & W2 & _ & _ & W).
 destruct (certified_parts o c TF TJ TR cert) as (_ & _ & Sj & _). assert (G := gap_length (S j)).
 eapply (settles_holds o c _ _ _ _ _ 0 TJ); [apply some_segments|exact Sj| | |apply G|].
 - intros a Ha. now apply W.
 - rewrite Q2R_zero. lra.
 - rewrite Q2R_zero. specialize (t_next j). lra.
 Unshelve.
 intros a k [T Hc]. unfold x at 1. rewrite e_jumps, th_jumps by exact Hj. apply jump_reads; auto using e_size, th_size.
 apply (nonnegative _ _ _ Hc). rewrite !app_length, e_size, th_size, size_v. lia. Qed.
(* within piece j, up to r *)
Lemma V_flows j r : t j <= r <= t (S j) -> (forall q, t j <= q <= r -> now j q) ->
  exp (k2 * r) * V (t (S j) - r) (x j r) + RInt (phi j) (t j) r <= exp (k2 * t j) * V (t (S j) - t j) (x j (t j)).
Proof.
 intros Hr Hn. destruct (sound_parts o c TF TJ TR cert) as (_ & _ & _ & _ & J & _). assert (G := gap_length j).
 assert (A := along o c TF TJ TR cert (es j) (ths j) (f j) (u j) (t j) r (size_e j) (size_th j) (size_f j) (size_u j)
   (fun q Hq => e_moves j q (Hn q Hq)) (fun q Hq => th_moves j q (Hn q Hq)) (fun q Hq => u_continuous j q (Hn q Hq))
   (fun q Hq => class j q (Hn q Hq)) (segments c) (incl_refl _) J
   (t (S j)) (t (S j) - r) (t (S j) - t j) ltac:(lra) ltac:(lra) ltac:(lra) ltac:(lra)).
 unfold grown, x_at in A. replace (t (S j) - (t (S j) - r)) with r in A by ring.
 replace (t (S j) - (t (S j) - t j)) with (t j) in A by ring. exact A. Qed.
Lemma earlier j : (j < last)%nat -> forall q, t j <= q <= t (S j) -> now j q.
Proof. intros Hj q Hq. left. auto. Qed.
Lemma V_before j : (j <= last)%nat ->
  exp (k2 * t j) * V (t (S j) - t j) (x j (t j)) + total phi t j
  <= Q2R (roof c) * sq (x 0%nat 0) + Q2R (kappa c) * summed noise j.
Proof.
 induction j as [|j IH]; intros Hj.
 - cbn [total summed]. assert (G := gap_length 0). rewrite t_start in *. rewrite Rmult_0_r, exp_0.
   assert (B := V_below 0 0 (t 1%nat - 0) G). lra.
 - specialize (IH ltac:(lia)). cbn [total summed]. assert (J := V_jumps j ltac:(lia)). assert (G := gap_length j).
   assert (F := V_flows j (t (S j)) ltac:(lra) (earlier j ltac:(lia))). rewrite Rminus_diag_eq in F by reflexivity.
   assert (E := exp_pos (k2 * t (S j))). apply (Rmult_le_compat_l (exp (k2 * t (S j)))) in J; [|lra].
   unfold noise at 2. lra. Qed.
Theorem run : exp (k2 * s) * V (t (S last) - s) (x last s) + (total phi t last + RInt (phi last) (t last) s)
  <= Q2R (roof c) * sq (x 0%nat 0) + Q2R (kappa c) * summed noise last.
Proof.
 assert (B := V_before last ltac:(lia)). assert (F := V_flows last s inside).
 assert (forall q, t last <= q <= s -> now last q) by (intros q Hq; right; auto). specialize (F H). lra. Qed.
End Run.

(* A signal that is zero acts like none *)
Lemma sq_zero x : sq x = 0 -> List.Forall (fun a => a = 0) x.
Proof.
 induction x as [|a x IH]; intros E; constructor; unfold sq in E; cbn [dot] in E; fold (sq x) in E;
  assert (S := sq_nonneg x); assert (0 <= a * a) by apply Rle_0_sqr.
 - apply Rsqr_0_uniq. unfold Rsqr. lra.
 - apply IH. lra. Qed.
Lemma dot_zero x : List.Forall (fun a => a = 0) x -> forall r, dotR r x = 0.
Proof. intros F. induction F as [|a x Ha F IH]; intros [|b r]; cbn [dot]; auto. rewrite Ha, IH. ring. Qed.
Lemma zero_input M w : sq w = 0 -> M ** w = M ** [].
Proof.
 intros E. apply sq_zero in E. unfold mv. apply map_ext. intros r. rewrite dot_nil_r. now apply dot_zero. Qed.
Lemma zero_added x : forall y, length y = length x -> sq y = 0 -> x ++++ y = x ++++ [].
Proof.
 intros y Hl E. apply sq_zero in E. rewrite vadd_nil_r. revert x Hl. induction E as [|b y Hb E IH]; intros [|a x] Hl;
  cbn [vadd] in *; auto; try discriminate. rewrite Hb, IH by (injection Hl; auto). f_equal. ring. Qed.

(* The same for plant and observer with one f, up to the instant s of piece j *)
Section Observed.
Variables (o : observer) (c : witness) (TF TJ TR : list (list (list (list Z)))).
Hypothesis siz : sized o = true.
Hypothesis cert : certified o c TF TJ TR = true.
Variables (f : R -> list R -> list R) (t : nat -> R) (x xh th w : nat -> list (R -> R)).
Variables (q qh g gq : nat -> R -> list R) (y gy eta : nat -> list R).
Hypothesis class : of_class o f.
Hypothesis given : trajectories o f t x xh th w q qh g gq y gy eta.
Definition acting (i : nat) (r : R) := if driven c then at_ (w i) r else [].
Definition sensed (i : nat) := if noisy c then eta i else [].
Definition pieces (i : nat) := diff (x i) (xh i).
Variables (j : nat) (s : R).
Hypothesis inside : t j <= s <= t (S j).
Hypothesis quiet_w : driven c = true \/ forall i r, past t j s i r -> sq (at_ (w i) r) = 0.
Hypothesis quiet_eta : noisy c = true \/ forall i, (i < j)%nat -> sq (eta (S i)) = 0.

Lemma past_inside i r : past t j s i r -> t i <= r <= t (S i).
Proof. intros [[_ Hr]|[-> Hr]]; lra. Qed.
Lemma pieces_at i r : at_ (pieces i) r = error_at x xh i r.
Proof. destruct given. apply at_diff. now rewrite size_xh, size_x. Qed.
Lemma length_at (zs : list (R -> R)) r : length (at_ zs r) = length zs.
Proof. apply map_length. Qed.
(* err_dot, err_arg and the jump with the signals that act *)
Lemma input_acts M i r : past t j s i r -> M ** at_ (w i) r = M ** acting i r.
Proof. intros Hp. unfold acting. destruct (driven c); auto. destruct quiet_w as [E|E]; [discriminate|].
 now apply zero_input, E. Qed.
Lemma noise_acts M e i : length M = ny o -> (i < j)%nat -> M ** e ++++ eta (S i) = M ** e ++++ sensed (S i).
Proof.
 intros Hm Hi. unfold sensed. destruct (noisy c); auto. destruct quiet_eta as [E|E]; [discriminate|].
 apply zero_added; [|now apply E]. destruct given. now rewrite mv_length, size_eta. Qed.
Lemma pieces_move i r : past t j s i r ->
  moves (pieces i) r (err_dot o (at_ (pieces i) r) (at_ (th i) r) (vsubR (f r (q i r)) (f r (qh i r))) (acting i r)).
Proof.
 intros Hp. assert (Hi := past_inside i r Hp). rewrite pieces_at. destruct given. unfold error_at.
 unfold err_dot. rewrite <- input_acts by exact Hp. fold (err_dot o (vsubR (at_ (x i) r) (at_ (xh i) r)) (at_ (th i) r)
   (vsubR (f r (q i r)) (f r (qh i r))) (at_ (w i) r)).
 rewrite <- (dot_difference o siz (at_ (x i) r) (at_ (xh i) r) (at_ (th i) r) (at_ (w i) r) (f r (q i r)) (f r (qh i r))
   (g i r) (gq i r) (gy i) (eta i)); auto; try (rewrite length_at; auto).
 apply diff_moves; auto. now rewrite size_x, size_xh. Qed.
Lemma pieces_class i r : past t j s i r -> forall m, In m (multipliers o) ->
  0 <= sigma m (err_arg o (at_ (pieces i) r) (vsubR (f r (q i r)) (f r (qh i r))) (acting i r))
    (vsubR (f r (q i r)) (f r (qh i r))).
Proof.
 intros Hp m Hm. assert (Hi := past_inside i r Hp). rewrite pieces_at. destruct given. unfold error_at.
 unfold err_arg. rewrite <- input_acts by exact Hp. fold (err_arg o (vsubR (at_ (x i) r) (at_ (xh i) r))
   (vsubR (f r (q i r)) (f r (qh i r))) (at_ (w i) r)).
 rewrite <- (arg_difference o siz (at_ (x i) r) (at_ (xh i) r) [] (at_ (w i) r) (f r (q i r)) (f r (qh i r))
   (g i r) (gq i r) (gy i) (eta i)); auto; try (rewrite length_at; auto).
 rewrite <- plant_q, <- observer_q by exact Hi. apply class; auto.
 - rewrite plant_q by exact Hi.
   apply (plant_arg_length o siz (at_ (x i) r) (at_ (xh i) r) [] (at_ (w i) r) (f r (q i r)) []
     (g i r) (gq i r) (gy i) (eta i));
   auto; rewrite length_at; auto.
 - rewrite observer_q by exact Hi.
   apply (observer_arg_length o siz (at_ (x i) r) (at_ (xh i) r) [] [] []
     (f r (qh i r)) (g i r) (gq i r) (gy i) (eta i));
   auto; rewrite length_at; auto. Qed.
Lemma residual i : vsubR (y (S i)) (C o ** at_ (xh i) (t (S i)) ++++ gy (S i))
  = seen o (at_ (pieces i) (t (S i))) (eta (S i)).
Proof.
 rewrite pieces_at. destruct given. rewrite measured. unfold error_at.
 apply (seen_difference o siz (at_ (x i) (t (S i))) (at_ (xh i) (t (S i))) [] [] [] []
   (g i 0) (gq i 0) (gy (S i)) (eta (S i)));
 auto; rewrite length_at; auto. Qed.
Lemma seen_acts i : (i < j)%nat ->
  seen o (at_ (pieces i) (t (S i))) (eta (S i)) = seen o (at_ (pieces i) (t (S i))) (sensed (S i)).
Proof. intros Hi. unfold seen. apply noise_acts; auto. now destruct (sizes o siz) as (_ & _ & _ & _ & _ & E & _). Qed.
Lemma pieces_jump i : (i < j)%nat ->
  at_ (pieces (S i)) (t (S i)) = err_after o (at_ (pieces i) (t (S i))) (sensed (S i)).
Proof.
 intros Hi. assert (E := residual i). rewrite seen_acts in E by exact Hi. unfold err_after. rewrite <- E, !pieces_at.
 destruct given. unfold error_at. rewrite corrected, plant_goes_on.
 apply (after_difference o siz (at_ (x i) (t (S i))) (at_ (xh i) (t (S i))) [] [] [] []
   (g i 0) (gq i 0) (gy (S i)) (eta (S i)));
 auto; rewrite length_at; auto. Qed.
Lemma th_jump i : (i < j)%nat -> at_ (th (S i)) (t (S i)) = hold_after o (at_ (pieces i) (t (S i))) (sensed (S i)).
Proof. intros Hi. unfold hold_after. rewrite <- seen_acts, <- residual by exact Hi. destruct given. apply held. Qed.

Let phi i := weighed o c (pieces i) (acting i).
Let size i r := joint o (error_at x xh i r) (at_ (th i) r).
Theorem observed : exp (2 * Q2R (rate c) * s) * storage (segments c) (t (S j) - s) (size j s)
  + (total phi t j + RInt (phi j) (t j) s)
  <= Q2R (roof c) * sq (size 0%nat 0)
   + Q2R (kappa c) * summed (fun i => exp (2 * Q2R (rate c) * t i) * sq (sensed i)) j.
Proof.
 unfold size. rewrite <- !pieces_at. destruct given as [].
 apply (run o c TF TJ TR cert t pieces th (fun i r => vsubR (f r (q i r)) (f r (qh i r))) acting sensed j s); auto.
 - intros i. unfold pieces, diff. rewrite map_length, combine_length, size_x, size_xh. lia.
 - intros i r. rewrite vsub_length; rewrite !size_f; auto.
 - intros i r. unfold acting, entries. destruct (driven c); auto. rewrite length_at. auto.
 - intros i. unfold sensed, entries. destruct (noisy c); auto.
 - intros i r. apply pieces_move.
 - intros i r Hp. apply observer_th. now apply past_inside.
 - intros i r Hp. unfold acting. destruct (driven c).
   + apply steady_sq, w_continuous. now apply past_inside.
   + apply continuous_const.
 - intros i r. apply pieces_class.
 - intros i. apply pieces_jump.
 - intros i. apply th_jump. Qed.
End Observed.

(* Sums of integrals *)
Lemma total_ext g h t k : (forall i, (i < k)%nat -> t i <= t (S i)) ->
  (forall i r, (i < k)%nat -> t i <= r <= t (S i) -> g i r = h i r) -> total g t k = total h t k.
Proof.
 induction k as [|k IH]; intros Ht E; [reflexivity|]. cbn [total].
 rewrite IH by (intros; first [apply Ht; lia|apply E; auto; lia]).
 f_equal. apply RInt_ext. intros r Hr. specialize (Ht k ltac:(lia)). rewrite Rmin_left, Rmax_right in Hr by lra.
 apply E; [lia|lra]. Qed.
Lemma total_minus g h a t k : (forall i, (i < k)%nat -> t i <= t (S i)) ->
  (forall i, (i < k)%nat -> continuous_on (g i) (t i) (t (S i))) ->
  (forall i, (i < k)%nat -> continuous_on (h i) (t i) (t (S i))) ->
  total (fun i r => g i r - a * h i r) t k = total g t k - a * total h t k.
Proof.
 induction k as [|k IH]; intros Ht Cg Ch; [cbn [total]; ring|].
 cbn [total]. rewrite IH by (intros; first [apply Ht; lia|apply Cg; lia|apply Ch; lia]).
 assert (Ig := integrable (g k) _ _ (Ht k ltac:(lia)) (Cg k ltac:(lia))).
 assert (Ih := integrable (h k) _ _ (Ht k ltac:(lia)) (Ch k ltac:(lia))).
 assert (E : RInt (fun r => g k r - a * h k r) (t k) (t (S k))
   = RInt (g k) (t k) (t (S k)) - a * RInt (h k) (t k) (t (S k))).
 { apply (is_RInt_unique (V := R_CompleteNormedModule)).
   apply (is_RInt_minus (V := R_NormedModule) (g k) (fun r => a * h k r)).
   - apply (RInt_correct (V := R_CompleteNormedModule) _ _ _ Ig).
   - apply (is_RInt_scal (V := R_NormedModule) (h k)). apply (RInt_correct (V := R_CompleteNormedModule) _ _ _ Ih). }
 rewrite E. ring. Qed.
Lemma total_nonneg g t k : (forall i, (i < k)%nat -> t i <= t (S i)) ->
  (forall i, (i < k)%nat -> continuous_on (g i) (t i) (t (S i))) ->
  (forall i r, (i < k)%nat -> t i <= r <= t (S i) -> 0 <= g i r) -> 0 <= total g t k.
Proof.
 induction k as [|k IH]; intros Ht Cg P; cbn [total]; [lra|].
 assert (0 <= total g t k) by (apply IH; intros; first [apply Ht; lia|apply Cg; lia|apply P; auto; lia]).
 assert (0 <= RInt (g k) (t k) (t (S k))); [|lra].
 apply RInt_ge_0; [apply Ht; lia|apply integrable; [apply Ht|apply Cg]; lia|].
 intros r Hr. apply P; [lia|lra]. Qed.
Lemma summed_ext g h k : (forall i, (i < k)%nat -> g (S i) = h (S i)) -> summed g k = summed h k.
Proof. induction k as [|k IH]; intros E; [reflexivity|]. cbn [summed]. rewrite IH by (intros; apply E; lia).
 rewrite E; auto. Qed.
Lemma summed_nonneg g k : (forall i, 0 <= g i) -> 0 <= summed g k.
Proof. induction k as [|k IH]; intros P; cbn [summed]; [lra|]. specialize (IH P). specialize (P (S k)). lra. Qed.
Lemma summed_zero g k : (forall i, (i < k)%nat -> g (S i) = 0) -> summed g k = 0.
Proof. induction k as [|k IH]; intros E; cbn [summed]; [ring|]. rewrite IH by (intros; apply E; lia).
 rewrite E by lia. ring. Qed.
Lemma summed_scal g a k : summed (fun i => a * g i) k = a * summed g k.
Proof. induction k as [|k IH]; cbn [summed]; [ring|]. rewrite IH. ring. Qed.
Lemma summed_le g h k : (forall i, (i < k)%nat -> g (S i) <= h (S i)) -> summed g k <= summed h k.
Proof.
 induction k as [|k IH]; intros E; cbn [summed]; [lra|]. assert (A := IH ltac:(intros; apply E; lia)).
 specialize (E k ltac:(lia)). lra. Qed.
