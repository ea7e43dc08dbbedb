(* obsdesign: Multipliers that are matrices: df = Theta dq with Theta between given matrices, the corners of a hull,
   or a
   sum of them with weights that are not negative. What holds of the corners holds of every such Theta. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Obs Require Import ObsForm ObsDesign.
Import ListNotations.
Open Scope R_scope.

(* sum_i s_i f_i *)
Fixpoint mix (s : list R) (fs : list (list R)) : list R :=
  match s, fs with a :: s, f :: fs => vaddR (scaleR a f) (mix s fs) | _, _ => [] end.
Fixpoint total (s : list R) : R := match s with [] => 0 | a :: s => a + total s end.
(* The components of df that belong to a hull are those of sum_i s_i Theta_i dq, s_i >= 0;
   their sum is 1 but of a cone *)
Definition inside (h : hull) (i : nat) : bool := (first h <=? i)%nat && (i <? first h + count h)%nat.
Definition within (h : hull) (dq df : list R) : Prop := exists s,
  List.Forall (fun a => 0 <= a) s /\ length s = length (corners h) /\ (conic h = false -> total s = 1) /\
  forall i, inside h i = true -> nth i df 0 = nth i (mix s (map (fun Theta => mvR (rmat Theta) dq) (corners h))) 0.

(* What the kernel computes: M is zero outside the components of the hull, M22 <= 0, and at each corner
   q' M11 q + 2 q' M12 Theta q + q' Theta' M22 Theta q >= 0; of a cone M22 = 0, M11 >= 0, q' M12 Theta q >= 0 *)
Definition zero (r : list Q) : bool := forallb (fun a => Qeq_bool a 0) r.
Fixpoint silent (h : hull) (i : nat) (r : list Q) : bool :=
  match r with [] => true | a :: r => (inside h i || Qeq_bool a 0) && silent h (S i) r end.
Fixpoint silent_rows (h : hull) (i : nat) (N : list (list Q)) : bool :=
  match N with [] => true | r :: N => (inside h i || zero r) && silent_rows h (S i) N end.
Definition corner (nq : nat) (m : multiplier) (Theta : list (list Q)) : list term :=
  let q := Part 0 nq in let f := Mul Theta q in
  [(1%Q, q, Mul (M11 m) q); (2%Q, q, Mul (M12 m) f); (1%Q, f, Mul (M22 m) f)].
Definition ray (nq : nat) (m : multiplier) (Theta : list (list Q)) : list term :=
  let q := Part 0 nq in [(1%Q, q, Mul (M12 m) (Mul Theta q))].
Definition each (N : nat) (form : list (list Q) -> list term) (corners : list (list (list Q)))
  (Ts : list (list (list Z))) : bool :=
  (length Ts =? length corners)%nat && forallb (fun p => check false N (form (fst p)) (snd p)) (combine corners Ts).
Definition hull_proved (nq nf : nat) (h : hull) (Ts : list (list (list Z))) : bool :=
  let m := form_of h in let q := Part 0 nq in let f := Part 0 nf in
  forallb (silent h 0) (M12 m) && forallb (silent h 0) (M22 m) && silent_rows h 0 (M22 m) &&
  forallb (fun Theta => length Theta =? nf)%nat (corners h) &&
  match Ts with
  | [] => false
  | T :: Ts => if conic h
      then forallb zero (M22 m) && check false nq [(1%Q, q, Mul (M11 m) q)] T && each nq (ray nq m) (corners h) Ts
      else check false nf [(Qopp 1, f, Mul (M22 m) f)] T && each nq (corner nq m) (corners h) Ts
  end.
Definition hulls_proved (d : design) (TH : list (list (list (list Z)))) : bool :=
  (length TH =? length (hulls d))%nat && forallb (fun p => hull_proved (nq d) (nf d) (fst p) (snd p)) (combine (hulls
    d) TH).

(* A product does not change where r is zero *)
Lemma agree r : forall f g : list R, (forall i, nth i r 0 = 0 \/ nth i f 0 = nth i g 0) -> dotR r f = dotR r g.
Proof. induction r as [|a r IH]; intros f g K; [reflexivity|].
 assert (K0 := K 0%nat). assert (KS := fun i => K (S i)). cbn [nth] in K0, KS.
 destruct f as [|b f], g as [|c g]; cbn [dot nth] in *.
 - reflexivity.
 - assert (E := IH [] g ltac:(intros i; specialize (KS i); destruct i; exact KS)). rewrite dot_nil_r in E. rewrite <- E.
   destruct K0 as [->| <-]; ring.
 - assert (E := IH f [] ltac:(intros i; specialize (KS i); destruct i; exact KS)). rewrite dot_nil_r in E. rewrite E.
   destruct K0 as [->| ->]; ring.
 - rewrite (IH f g KS). destruct K0 as [->| ->]; ring. Qed.
Lemma Qzero_R a : Qeq_bool a 0 = true -> Q2R a = 0.
Proof. intros E. apply Qeq_bool_iff, Qeq_eqR in E. now rewrite Q2R_zero in E. Qed.
Lemma silent_nth h r : forall k, silent h k r = true -> forall i, inside h (k + i) = true \/ nth i (map Q2R r) 0 = 0.
Proof. induction r as [|a r IH]; intros k K i; [right; destruct i; reflexivity|].
 cbn [silent] in K. rewrite andb_true_iff, orb_true_iff in K. destruct K as [K0 K]. destruct i as [|i]; cbn [map nth].
 - rewrite Nat.add_0_r. destruct K0; [now left|right; now apply Qzero_R].
 - replace (k + S i)%nat with (S k + i)%nat by lia. now apply IH. Qed.
Lemma zero_dot r u : zero r = true -> dotR (map Q2R r) u = 0.
Proof. unfold zero. revert u. induction r as [|a r IH]; intros u K; [reflexivity|]. cbn [forallb] in K.
 rewrite andb_true_iff in K. destruct K as [K0 K]. destruct u; [reflexivity|]. cbn [map dot].
 rewrite (IH _ K), (Qzero_R _ K0). ring. Qed.
Lemma silent_rows_nth h N u : forall k, silent_rows h k N = true ->
  forall i, inside h (k + i) = true \/ nth i (mvR (rmat N) u) 0 = 0.
Proof. induction N as [|r N IH]; intros k K i; [right; destruct i; reflexivity|].
 cbn [silent_rows] in K. rewrite andb_true_iff, orb_true_iff in K. destruct K as [K0 K]. destruct i as [|i].
 - rewrite Nat.add_0_r. destruct K0; [now left|right]. cbn. now apply zero_dot.
 - replace (k + S i)%nat with (S k + i)%nat by lia. exact (IH (S k) K i). Qed.
Lemma silent_mv h N (f g : list R) : forallb (silent h 0) N = true ->
  (forall i, inside h i = true -> nth i f 0 = nth i g 0) -> mvR (rmat N) f = mvR (rmat N) g.
Proof. intros K E. unfold mv, rmat. rewrite !map_map. apply map_ext_in. intros r Hr. apply agree. intros i.
 rewrite forallb_forall in K. destruct (silent_nth h r 0 (K r Hr) i); auto. Qed.
Lemma sigma_agrees h q f g : let m := form_of h in
  forallb (silent h 0) (M12 m) = true -> forallb (silent h 0) (M22 m) = true -> silent_rows h 0 (M22 m) = true ->
  (forall i, inside h i = true -> nth i f 0 = nth i g 0) -> sigma m q f = sigma m q g.
Proof. intros m K1 K2 K3 E. unfold sigma. rewrite (silent_mv h _ f g K1 E), (silent_mv h _ f g K2 E). f_equal.
 rewrite (dot_comm f), (dot_comm g). apply agree. intros i. destruct (silent_rows_nth h (M22 m) g 0 K3 i); auto. Qed.

(* Jensen: f' M22 f is concave where M22 <= 0 *)
Section Mixed.
Variables (m : multiplier) (q : list R).
Notation form x y := (dotR x (mvR (rmat (M22 m)) y)).
Fixpoint weighted (s : list R) (g : list R -> R) (fs : list (list R)) : R :=
  match s, fs with a :: s, f :: fs => a * g f + weighted s g fs | _, _ => 0 end.
Lemma form_mix y s : forall fs, length s = length fs ->
  weighted s (fun f => form (vsubR f y) (vsubR f y)) fs =
  weighted s (fun f => form f f) fs - form (mix s fs) y - form y (mix s fs) + total s * form y y.
Proof. induction s as [|a s IH]; intros fs L; destruct fs as [|f fs]; try discriminate L; cbn [weighted mix total].
 - assert (E : mvR (rmat (M22 m)) [] = scaleR 0 (mvR (rmat (M22 m)) [])) by exact (mv_scale _ 0 []).
   rewrite E, dot_scale_r. cbn [dot]. ring.
 - rewrite (IH fs) by (injection L; auto). unfold vsubR.
   rewrite !mv_add, !mv_scale, !dot_add_l, !dot_add_r, !dot_scale_l, !dot_scale_r.
   ring. Qed.
Lemma linear_mix s : forall fs, length s = length fs ->
  dotR q (mvR (rmat (M12 m)) (mix s fs)) = weighted s (fun f => dotR q (mvR (rmat (M12 m)) f)) fs.
Proof. induction s as [|a s IH]; intros fs L; destruct fs as [|f fs]; try discriminate L; cbn [weighted mix].
 - assert (E : mvR (rmat (M12 m)) [] = scaleR 0 (mvR (rmat (M12 m)) [])) by exact (mv_scale _ 0 []).
   rewrite E, dot_scale_r. ring.
 - rewrite mv_add, mv_scale, dot_add_r, dot_scale_r, (IH fs) by (injection L; auto). reflexivity. Qed.
Lemma weighted_sum s g k : forall fs, length s = length fs ->
  weighted s (fun f => g f + k f) fs = weighted s g fs + weighted s k fs.
Proof. induction s as [|a s IH]; intros fs L; destruct fs as [|f fs]; try discriminate L; cbn [weighted]; [ring|].
 rewrite (IH fs) by (injection L; auto). ring. Qed.
Lemma weighted_scale s c g : forall fs, length s = length fs -> weighted s (fun f => c * g f) fs = c * weighted s g fs.
Proof. induction s as [|a s IH]; intros fs L; destruct fs as [|f fs]; try discriminate L; cbn [weighted]; [ring|].
 rewrite (IH fs) by (injection L; auto). ring. Qed.
Lemma weighted_const s c : forall fs, length s = length fs -> weighted s (fun _ => c) fs = total s * c.
Proof. induction s as [|a s IH]; intros fs L; destruct fs as [|f fs]; try discriminate L; cbn [weighted total]; [ring|].
 rewrite (IH fs) by (injection L; auto). ring. Qed.
Lemma weighted_sign s g : List.Forall (fun a => 0 <= a) s -> forall fs, (forall f, In f fs -> 0 <= g f) ->
   0 <= weighted s g fs.
Proof. intros K. induction K as [|a s Ha K IH]; intros fs G; [destruct fs; simpl; lra|].
 destruct fs as [|f fs]; cbn [weighted]; [lra|].
 assert (0 <= a * g f) by (apply Rmult_le_pos; [auto|apply G; now left]).
 assert (0 <= weighted s g fs) by (apply IH; intros; apply G; now right). lra. Qed.
Lemma mix_length k s : forall fs, length s = length fs -> (forall f, In f fs -> length f = k) -> s <> [] ->
  length (mix s fs) = k.
Proof. induction s as [|a s IH]; intros fs L K N; [congruence|]. destruct fs as [|f fs]; [discriminate L|]. cbn [mix].
 assert (Kf : length f = k) by (apply K; now left). destruct s as [|b s].
 - destruct fs; [|discriminate L]. cbn [mix]. now rewrite vadd_nil_r, scale_length.
 - rewrite vadd_length; rewrite scale_length; auto.
   rewrite Kf. apply IH; [injection L; auto|intros; apply K; now right|discriminate]. Qed.
End Mixed.

(* Hence the inequality of M for every df of the hull, or of the cone *)
Lemma each_spec N form : forall cs Ts, each N form cs Ts = true -> forall Theta, In Theta cs ->
   forall x, length x = N ->
  0 <= quad (form Theta) x.
Proof. unfold each. intros cs Ts K. rewrite andb_true_iff, Nat.eqb_eq in K. destruct K as [L K]. revert Ts L K.
 induction cs as [|c cs IH]; intros Ts L K Theta Hc x Hx; [contradiction|]. destruct Ts as [|T Ts]; [discriminate L|].
 cbn [combine forallb fst snd] in K. rewrite andb_true_iff in K. destruct K as [K0 K]. destruct Hc as [<-|Hc].
 - exact (nonnegative _ _ _ K0 x Hx).
 - apply (IH Ts); auto. Qed.
Theorem hull_holds nq nf h Ts q f : hull_proved nq nf h Ts = true -> length q = nq -> within h q f ->
   0 <= sigma (form_of h) q f.
Proof. unfold hull_proved. rewrite !andb_true_iff. intros ((((K1 & K2) & K3) & K4) & K5) Lq (s & Ws & Ls & One & E).
 set (fs := map (fun Theta => mvR (rmat Theta) q) (corners h)) in *. set (m := form_of h) in *.
 assert (Lf : length s = length fs) by (unfold fs; now rewrite map_length).
 assert (A : sigma m q f = sigma m q (mix s fs)) by exact (sigma_agrees h q f (mix s fs) K1 K2 K3 E). rewrite A.
 assert (Ep : eval (Part 0 nq) q = q) by (cbn [eval skipn]; rewrite <- Lq; apply firstn_all).
 destruct Ts as [|T Ts]; [discriminate|]. destruct (conic h).
 - rewrite !andb_true_iff in K5. destruct K5 as [[Z K11] Kr].
   assert (N := nonnegative _ _ _ K11 q Lq). unfold quad in N. cbn [bil bil1] in N. rewrite Q2R_one in N.
   cbn [eval] in N.
   cbn [eval] in Ep. rewrite Ep in N.
   unfold sigma. rewrite linear_mix by exact Lf.
   replace (dotR (mix s fs) (mvR (rmat (M22 m)) (mix s fs))) with 0.
   + assert (0 <= weighted s (fun g => dotR q (mvR (rmat (M12 m)) g)) fs); [|lra]. apply weighted_sign; auto.
     intros g Hg. unfold fs in Hg. apply in_map_iff in Hg. destruct Hg as (Theta & <- & Ht).
     assert (R := each_spec _ _ _ _ Kr Theta Ht q Lq). unfold quad, ray in R. cbn [bil bil1] in R.
     rewrite Q2R_one in R. cbn [eval] in R. rewrite Ep in R. lra.
   + rewrite dot_comm. symmetry. clear - Z. rewrite forallb_forall in Z. unfold mv, rmat. rewrite map_map.
     generalize (mix s fs) at 2. induction (M22 m) as [|r N IH]; intros u; [reflexivity|]. destruct u; [reflexivity|].
     cbn [map dot]. rewrite IH by (intros; apply Z; now right). rewrite zero_dot by (apply Z; now left). ring.
 - rewrite andb_true_iff in K5. destruct K5 as [K22 Kc]. specialize (One eq_refl).
   assert (S : 0 <= weighted s (fun g => sigma m q g) fs).
   { apply weighted_sign; auto. intros g Hg. unfold fs in Hg. apply in_map_iff in Hg. destruct Hg as (Theta & <- & Ht).
     assert (R := each_spec _ _ _ _ Kc Theta Ht q Lq). unfold quad, corner in R. cbn [bil bil1] in R.
     rewrite Q2R_one, Q2R_two in R. cbn [eval] in R. cbn [eval] in Ep. rewrite Ep in R. unfold sigma. lra. }
   unfold sigma in S. rewrite (weighted_sum s _ _ fs Lf), (weighted_sum s _ _ fs Lf), (weighted_const s _ fs Lf),
     (weighted_scale s 2 _ fs Lf), <- (linear_mix m q s fs Lf), One in S.
   assert (J := form_mix m (mix s fs) s fs Lf). rewrite One in J.
   assert (Ng : 0 <= weighted s (fun g => - (1) * dotR (vsubR g (mix s fs)) (mvR (rmat (M22 m)) (vsubR g (mix s
     fs)))) fs).
   { assert (sN : s <> []) by (intros ->; simpl in One; lra).
     assert (Lg : forall g, In g fs -> length g = nf).
     { intros g Hg. unfold fs in Hg. apply in_map_iff in Hg. destruct Hg as (Theta & <- & Ht).
       rewrite forallb_forall in K4. specialize (K4 Theta Ht). apply Nat.eqb_eq in K4.
       unfold mv, rmat. now rewrite !map_length. }
     apply weighted_sign; auto. intros g Hg. set (u := vsubR g (mix s fs)).
     assert (Lu : length u = nf).
     { unfold u, vsubR. rewrite vadd_length; auto. rewrite scale_length, (mix_length nf), (Lg g Hg); auto. }
     assert (R := nonnegative _ _ _ K22 u Lu). unfold quad in R. cbn [bil bil1] in R. rewrite Q2R_opp, Q2R_one in R.
     assert (Eu : firstn nf (skipn 0 u) = u) by (cbn [skipn]; rewrite <- Lu; apply firstn_all).
     cbn [eval] in R. rewrite Eu in R. lra. }
   rewrite weighted_scale in Ng by exact Lf. unfold sigma. lra. Qed.
Theorem hulls_hold d TH q df : hulls_proved d TH = true -> length q = nq d ->
  forall h, In h (hulls d) -> within h q df -> 0 <= sigma (form_of h) q df.
Proof. unfold hulls_proved. rewrite andb_true_iff, Nat.eqb_eq. intros [L K] Lq. revert TH L K.
 induction (hulls d) as [|g hs IH]; intros TH L K h Hh W; [contradiction|]. destruct TH as [|Ts TH]; [discriminate L|].
 cbn [combine forallb fst snd] in K. rewrite andb_true_iff in K. destruct K as [K0 K]. destruct Hh as [<-|Hh].
 - exact (hull_holds _ _ _ _ _ _ K0 Lq W).
 - apply (IH TH); auto. Qed.
