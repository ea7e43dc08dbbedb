(* obsdesign: What an exported file states of an observer with measurements at instants. Of trajectories with one f:
     gain_guarantee     int |z|^2 <= initial^2 size(0) + gamma^2 int |w|^2 up to any measurement, where eta = 0,
     energy_guarantee   the same with kappa sum |eta|^2,
     decay_guarantee    size(s) <= overshoot^2 exp(-2 decay s) size(0) where w = 0 and eta = 0 up to s,
     peak_guarantee     size(s) <= disturbance^2 sup |w|^2 from zero error where eta = 0 up to s,
     noise_guarantee    size(s) <= noise^2 sup |eta|^2 from zero error where w = 0 up to s,
   size = |Se e + St th|^2. Not stated: that these bounds add, gains, what holds where measurements stay away. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign ObsTrajectory ObsPlant ObsBernstein ObsInstants ObsClock ObsGap ObsClockRun.
Import ListNotations.
Open Scope R_scope.

Lemma Qle_bool_R p q : Qle_bool p q = true -> Q2R p <= Q2R q.
Proof. intros E. now apply Qle_Rle, Qle_bool_iff. Qed.
Lemma Qeq_bool_R p q : Qeq_bool p q = true -> Q2R p = Q2R q.
Proof. intros E. now apply Qeq_eqR, Qeq_bool_iff. Qed.

(* P(0) >= 0 *)
Definition starts (o : observer) (c : witness) : list term := [(1%Q, lx o, Mul (first c) (lx o))].
Lemma starts_reads o c T0 e th : check false (n o + nt o) (starts o c) T0 = true ->
  length e = n o -> length th = nt o -> 0 <= value (first c) (joint o e th).
Proof.
 intros C He Ht. assert (N := nonnegative _ _ _ C (e ++ th) ltac:(rewrite app_length; lia)).
 unfold quad, starts, lx in N. cbn [bil bil1 eval] in N. unfold le, lt in N.
 assert (E := read_first e th _ He). assert (F := read_next e th [] _ _ He Ht). rewrite app_nil_r in F.
 rewrite E, F, Q2R_one in N. unfold value, joint. lra. Qed.

(* A rational that is not above exp a: the first terms of 1 + a / 1 (1 + a / 2 (1 + ..)) *)
Fixpoint series (a : Q) (k more : nat) : Q :=
  match more with O => 1 | S more => 1 + a / number (S k) * series a (S k) more end.
Lemma series_R a : forall more k, / INR (fact k) * Q2R a ^ k * Q2R (series a k more) =
  sum_f_R0 (fun i => / INR (fact (k + i)) * Q2R a ^ (k + i)) more.
Proof.
 induction more as [|more IH]; intros k; cbn [series].
 - cbn [sum_f_R0]. rewrite Nat.add_0_r, Q2R_one. ring.
 - rewrite decomp_sum by lia. cbn [pred]. rewrite Nat.add_0_r.
   rewrite (sum_eq _ (fun i => / INR (fact (S k + i)) * Q2R a ^ (S k + i)))
     by (intros i _; now replace (k + S i)%nat with (S k + i)%nat by lia).
   rewrite <- IH. assert (N : ~ (number (S k) == 0)%Q).
   { intros Z. apply Qeq_eqR in Z. rewrite number_R, Q2R_zero in Z. now apply (not_0_INR (S k)) in Z. }
   rewrite Q2R_plus, Q2R_mult, Q2R_div, number_R, Q2R_one, fact_simpl, mult_INR by exact N.
   assert (INR (S k) <> 0) by (now apply not_0_INR). assert (INR (fact k) <> 0) by apply INR_fact_neq_0.
   cbn [pow]. field. auto. Qed.
Lemma series_below a more : 0 <= Q2R a -> Q2R (series a 0 more) <= exp (Q2R a).
Proof.
 intros Ha. assert (E := series_R a more 0). simpl in E. replace (/ 1 * 1) with 1 in E by field. rewrite Rmult_1_l in E.
 rewrite E. unfold exp. destruct (exist_exp (Q2R a)) as [l Hl]. simpl.
 apply (sum_incr (fun i => / INR (fact i) * Q2R a ^ i)); [exact Hl|].
 intros i. apply Rmult_le_pos; [|now apply pow_le]. apply Rlt_le, Rinv_0_lt_compat, INR_fact_lt_0. Qed.

Section Guarantees.
Variables (o : observer) (c : witness) (TF TJ TR : list (list (list (list Z)))).
Variables (f : R -> list R -> list R) (t : nat -> R) (x xh th w : nat -> list (R -> R)).
Variables (q qh g gq : nat -> R -> list R) (y gy eta : nat -> list R).
Hypothesis class : of_class o f.
Hypothesis given : trajectories o f t x xh th w q qh g gq y gy eta.
Let e := error_at x xh.
Let size i r := sq (joint o (e i r) (at_ (th i) r)).
Let z2 i r := sq (zed o (e i r)).
Let w2 i r := sq (at_ (w i) r).
Let phi i := weighed o c (pieces x xh i) (acting c w i).
Let k2 := 2 * Q2R (rate c).
Let noise i := exp (k2 * t i) * sq (sensed c eta i).

Lemma ordered : 0 <= Q2R (T1 o) -> forall i, t i <= t (S i).
Proof. intros P i. destruct given. destruct i; [rewrite start; lra|]. specialize (intervals i). lra. Qed.
Lemma e_length i r : length (e i r) = n o.
Proof. destruct given. unfold e, error_at. rewrite vsub_length; rewrite !length_at; auto.
 now rewrite size_x, size_xh. Qed.
Lemma th_length i r : length (at_ (th i) r) = nt o.
Proof. destruct given. now rewrite length_at. Qed.
Lemma w2_continuous i : continuous_on (w2 i) (t i) (t (S i)).
Proof. intros r Hr. destruct given. now apply steady_sq, w_continuous. Qed.
Lemma z2_continuous i : continuous_on (z2 i) (t i) (t (S i)).
Proof.
 intros r Hr. destruct given. unfold z2. eapply continuous_ext;
   [|apply (steady_sq (rows (rmat (Cp o)) (diff (x i) (xh i))) r)].
 - intros s. simpl. rewrite at_rows, at_diff; [reflexivity|]. now rewrite size_x, size_xh.
 - eapply moves_steady, moves_rows, diff_moves; [apply plant_x; exact Hr|apply observer_x; exact Hr|].
   now rewrite size_x, size_xh. Qed.
Lemma phi_value i r : phi i r = exp (k2 * r) * (Q2R (weight c) * z2 i r - Q2R (mu c) * sq (acting c w i r)).
Proof. unfold phi, weighed. now rewrite (pieces_at o f t x xh th w q qh g gq y gy eta given). Qed.

(* The energy of z, at rate 0 *)
Definition energy_holds (r m k : Q) (T0 : list (list Z)) : bool :=
  sized o && certified o c TF TJ TR && driven c && Qeq_bool (rate c) 0 && Qeq_bool (weight c) 1 &&
  check false (n o + nt o) (starts o c) T0 && Qle_bool (roof c) r && Qle_bool (mu c) m && Qle_bool (kappa c) k.
Lemma energy_bounded r m k T0 : energy_holds r m k T0 = true -> forall j,
  noisy c = true \/ (forall i, (i < j)%nat -> sq (eta (S i)) = 0) ->
  total z2 t (S j) <= Q2R r * size 0%nat 0 + Q2R m * total w2 t (S j) + Q2R k * summed (fun i => sq (eta i)) j.
Proof.
 intros B j Hq. unfold energy_holds in B. rewrite !andb_true_iff in B.
 destruct B as ((((((((Sz & B) & D) & R) & W) & P) & Lr) & Lm) & Lk).
 apply Qeq_bool_R in R, W. rewrite Q2R_zero in R. rewrite Q2R_one in W. apply Qle_bool_R in Lr, Lm, Lk.
 assert (K0 : forall a, k2 * a = 0) by (intros a; unfold k2; rewrite R; ring).
 destruct (sound_parts o c TF TJ TR B) as (_ & P1 & _). assert (Ord := ordered P1).
 assert (O := observed o c TF TJ TR Sz B f t x xh th w q qh g gq y gy eta class given j (t (S j))
   ltac:(specialize (Ord j); lra) (or_introl D) Hq).
 fold k2 phi noise e in O. rewrite K0, exp_0, Rminus_diag_eq, (V_start o c TF TJ TR B) in O by reflexivity.
 assert (N := starts_reads o c T0 _ _ P (e_length j (t (S j))) (th_length j (t (S j)))).
 assert (E : total phi t (S j) = total z2 t (S j) - Q2R (mu c) * total w2 t (S j)).
 { rewrite <- total_minus by (intros; auto using z2_continuous, w2_continuous). apply total_ext; auto.
   intros i s _ _. rewrite phi_value, K0, exp_0, W. unfold acting. rewrite D. fold (w2 i s). ring. }
 assert (Nw : 0 <= total w2 t (S j)) by (apply total_nonneg; auto using w2_continuous; intros; apply sq_nonneg).
 assert (Nn : Q2R (kappa c) * summed noise j <= Q2R k * summed (fun i => sq (eta i)) j).
 { assert (summed noise j = summed (fun i => sq (eta i)) j) as ->.
   { apply summed_ext. intros i Hi. unfold noise. rewrite K0, exp_0. unfold sensed. destruct (noisy c); [ring|].
     destruct Hq as [Hq|Hq]; [discriminate|]. rewrite Hq by exact Hi. unfold sq. simpl. ring. }
   apply Rmult_le_compat_r; [|exact Lk]. apply summed_nonneg. intros; apply sq_nonneg. }
 change (total phi t j + RInt (phi j) (t j) (t (S j))) with (total phi t (S j)) in O. rewrite E in O.
 assert (Nr : Q2R (roof c) * size 0%nat 0 <= Q2R r * size 0%nat 0)
   by (apply Rmult_le_compat_r; [apply sq_nonneg|exact Lr]).
 assert (Nm : Q2R (mu c) * total w2 t (S j) <= Q2R m * total w2 t (S j)) by now apply Rmult_le_compat_r.
 unfold size in *. lra. Qed.
(* with noise *)
Definition claims_energy (r m k : Q) (T0 : list (list Z)) : bool := noisy c && energy_holds r m k T0.
Theorem energy_guarantee r m k T0 : claims_energy r m k T0 = true -> forall j,
  total z2 t (S j) <= Q2R r * size 0%nat 0 + Q2R m * total w2 t (S j) + Q2R k * summed (fun i => sq (eta i)) j.
Proof. intros B j. apply andb_true_iff in B. destruct B as [N B]. apply (energy_bounded r m k T0 B j). now left. Qed.
(* without noise *)
Definition claims_gain (gamma initial : Q) (T0 : list (list Z)) : bool :=
  energy_holds (initial * initial) (gamma * gamma) (kappa c) T0.
Theorem gain_guarantee gamma initial T0 : claims_gain gamma initial T0 = true -> forall j,
  (forall i, (i < j)%nat -> sq (eta (S i)) = 0) ->
  total z2 t (S j) <= Q2R initial * Q2R initial * size 0%nat 0 + Q2R gamma * Q2R gamma * total w2 t (S j).
Proof.
 intros B j He. assert (E := energy_bounded _ _ _ T0 B j (or_intror He)). rewrite !Q2R_mult in E.
 rewrite (summed_zero (fun i => sq (eta i)) j He) in E. lra. Qed.

(* The size of the error at the instant s of piece j, where V >= size everywhere *)
Definition normal (TP : list (list (list (list Z)))) : bool :=
  sized o && certified o c TF TJ TR && Qeq_bool (weight c) 0 &&
  everywhere (n o + nt o) (above o 1) (segments c) TP.
Lemma normal_bounded TP j s : normal TP = true -> t j <= s <= t (S j) ->
  driven c = true \/ (forall i r, past t j s i r -> w2 i r = 0) ->
  noisy c = true \/ (forall i, (i < j)%nat -> sq (eta (S i)) = 0) ->
  exp (k2 * s) * size j s + (total phi t j + RInt (phi j) (t j) s)
  <= Q2R (roof c) * size 0%nat 0 + Q2R (kappa c) * summed noise j.
Proof.
 intros B Hs Hw He. unfold normal in B. rewrite !andb_true_iff in B. destruct B as (((Sz & B) & _) & E).
 assert (O := observed o c TF TJ TR Sz B f t x xh th w q qh g gq y gy eta class given j s Hs Hw He).
 eapply Rle_trans; [|exact O]. apply Rplus_le_compat_r, Rmult_le_compat_l; [apply Rlt_le, exp_pos|].
 destruct (sound_parts o c TF TJ TR B) as (_ & P1 & P2 & _ & _ & W). assert (Ord := ordered P1 j).
 apply (storage_keeps (joint o (e j s) (at_ (th j) s)) (fun a => size j s <= a)).
 - apply (some_segments o c TF TJ TR B).
 - intros a Ha. now apply W.
 - intros d a r Hr Ha. now apply bez_ge.
 - intros a Ha k Hk. assert (A := above_reads o (e j s) (at_ (th j) s) (e_length j s) (th_length j s) 1 a k).
   rewrite Q2R_one, Rmult_1_l in A. apply A. apply (everywhere_holds _ _ _ _ E a Ha k Hk).
   now rewrite app_length, e_length, th_length.
 - destruct given. rewrite <- P2. destruct j as [|j]; [rewrite start in *; lra|]. specialize (intervals j). lra. Qed.
Lemma normal_rate TP : normal TP = true -> Q2R (weight c) = 0 /\ 0 <= Q2R (T1 o) /\ 0 <= k2.
Proof.
 intros B. unfold normal in B. rewrite !andb_true_iff in B. destruct B as (((_ & B) & W) & _).
 destruct (sound_parts o c TF TJ TR B) as (_ & P1 & _ & P3 & _). apply Qeq_bool_R in W. rewrite Q2R_zero in W.
 repeat split; auto. unfold k2. lra. Qed.
Lemma no_integral i : driven c = false -> Q2R (weight c) = 0 -> forall a b, RInt (phi i) a b = 0.
Proof.
 intros D W a b. rewrite (RInt_ext _ (fun _ => 0)).
 - rewrite RInt_const. unfold scal. simpl. unfold mult. simpl. ring.
 - intros r _. rewrite phi_value, W. unfold acting. rewrite D. unfold sq at 1. cbn [dot].
   match goal with |- ?l = _ => change (l = 0 :> R) end. ring. Qed.
Lemma no_total k : driven c = false -> Q2R (weight c) = 0 -> total phi t k = 0.
Proof. intros D W. induction k; cbn [total]; [reflexivity|]. rewrite IHk, no_integral by auto. ring. Qed.
Lemma no_noise k : noisy c = false -> summed noise k = 0.
Proof. intros N. apply summed_zero. intros i _. unfold noise, sensed. rewrite N. unfold sq. cbn [dot]. ring. Qed.

Definition claims_decay (overshoot decay : Q) TP : bool :=
  normal TP && negb (driven c) && negb (noisy c) && Qeq_bool (rate c) decay &&
  Qle_bool (roof c) (overshoot * overshoot).
Theorem decay_guarantee overshoot decay TP : claims_decay overshoot decay TP = true ->
  forall j s, t j <= s <= t (S j) ->
  (forall i r, past t j s i r -> w2 i r = 0) -> (forall i, (i < j)%nat -> sq (eta (S i)) = 0) ->
  size j s <= Q2R overshoot * Q2R overshoot * exp (- (2 * Q2R decay * s)) * size 0%nat 0.
Proof.
 intros B j s Hs Hw He. unfold claims_decay in B. rewrite !andb_true_iff in B. destruct B as ((((B & D) & N) & R) & Lr).
 apply negb_true_iff in D, N. apply Qeq_bool_R in R. apply Qle_bool_R in Lr. rewrite Q2R_mult in Lr.
 destruct (normal_rate TP B) as (W & _ & _). assert (O := normal_bounded TP j s B Hs (or_intror Hw) (or_intror He)).
 rewrite no_total, no_integral, no_noise in O by auto. rewrite <- R. fold k2. assert (Ep := exp_pos (k2 * s)).
 assert (M : Q2R (roof c) * size 0%nat 0 <= Q2R overshoot * Q2R overshoot * size 0%nat 0)
   by (apply Rmult_le_compat_r; [apply sq_nonneg|exact Lr]).
 rewrite exp_Ropp. apply (Rmult_le_reg_l (exp (k2 * s))); auto.
 replace (exp (k2 * s) * (Q2R overshoot * Q2R overshoot * / exp (k2 * s) * size 0%nat 0))
   with (Q2R overshoot * Q2R overshoot * size 0%nat 0) by (field; lra). lra. Qed.

(* The weighed integral of a bounded w *)
Lemma exp_derive r : is_derive (fun r => exp (k2 * r)) r (k2 * exp (k2 * r)).
Proof. auto_derive; auto. ring. Qed.
Lemma bounded_integral i a b m : a <= b -> continuous_on (phi i) a b ->
  (forall r, a <= r <= b -> - (m * (k2 * exp (k2 * r))) <= phi i r) ->
  - (m * (exp (k2 * b) - exp (k2 * a))) <= RInt (phi i) a b.
Proof.
 intros Hab Hc Hm. set (h := fun r => - (m * (k2 * exp (k2 * r)))).
 assert (D : forall r, is_derive (fun r => - (m * exp (k2 * r))) r (h r)).
 { intros r. unfold h. auto_derive; auto. ring. }
 assert (C : forall r, continuous h r).
 { intros r. apply (ex_derive_continuous (K := R_AbsRing) (V := R_NormedModule)). unfold h. auto_derive. auto. }
 assert (E : RInt h a b = - (m * (exp (k2 * b) - exp (k2 * a)))).
 { rewrite (is_RInt_unique (V := R_CompleteNormedModule) h a b (minus (- (m * exp (k2 * b))) (- (m * exp (k2 * a))))).
   - unfold minus, plus, opp. simpl. ring.
   - apply (is_RInt_derive (V := R_CompleteNormedModule) (fun r => - (m * exp (k2 * r)))); auto. }
 rewrite <- E. apply RInt_le; auto.
 - apply integrable; auto. intros r _. apply C.
 - now apply integrable.
 - intros r Hr. apply Hm. lra. Qed.
Lemma bounded_total m k : 0 <= Q2R (T1 o) -> (forall i, (i < k)%nat -> continuous_on (phi i) (t i) (t (S i))) ->
  (forall i r, (i < k)%nat -> t i <= r <= t (S i) -> - (m * (k2 * exp (k2 * r))) <= phi i r) ->
  - (m * (exp (k2 * t k) - 1)) <= total phi t k.
Proof.
 intros P. induction k as [|k IH]; intros Hc Hm; cbn [total].
 - destruct given. rewrite start, Rmult_0_r, exp_0. lra.
 - assert (A := IH ltac:(intros; apply Hc; lia) ltac:(intros; apply Hm; auto; lia)).
   assert (E := bounded_integral k (t k) (t (S k)) m (ordered P k) (Hc k ltac:(lia))
     (fun r Hr => Hm k r ltac:(lia) Hr)). lra. Qed.
Lemma phi_continuous i : continuous_on (phi i) (t i) (t (S i)).
Proof.
 intros r Hr. eapply continuous_ext; [intros s; symmetry; apply phi_value|].
 apply (continuous_mult (fun s => exp (k2 * s))).
 - apply (ex_derive_continuous (K := R_AbsRing) (V := R_NormedModule)). exists (k2 * exp (k2 * r)). apply exp_derive.
 - apply (continuous_minus (fun s => Q2R (weight c) * z2 i s) (fun s => Q2R (mu c) * sq (acting c w i s))).
   + apply (continuous_mult (fun _ => Q2R (weight c))); [apply continuous_const|]. now apply z2_continuous.
   + apply (continuous_mult (fun _ => Q2R (mu c))); [apply continuous_const|]. unfold acting.
     destruct (driven c); [now apply w2_continuous|apply continuous_const]. Qed.

Definition claims_peak (disturbance : Q) TP : bool :=
  normal TP && driven c && negb (noisy c) && negb (Qle_bool (rate c) 0) && Qle_bool 0 (mu c) &&
  Qle_bool (mu c) (2 * rate c * disturbance * disturbance).
Theorem peak_guarantee disturbance TP : claims_peak disturbance TP = true ->
  forall j s, t j <= s <= t (S j) -> size 0%nat 0 = 0 -> (forall i, (i < j)%nat -> sq (eta (S i)) = 0) ->
  forall bound, (forall i r, past t j s i r -> w2 i r <= bound) ->
  size j s <= Q2R disturbance * Q2R disturbance * bound.
Proof.
 intros B j s Hs H0 He bound Hw. unfold claims_peak in B. rewrite !andb_true_iff in B.
 destruct B as (((((B & D) & N) & R) & M0) & M). apply negb_true_iff in N. apply positive_R in R.
 apply Qle_R in M0. apply Qle_bool_R in M. rewrite !Q2R_mult, Q2R_two in M.
 destruct (normal_rate TP B) as (W & P & _). assert (O := normal_bounded TP j s B Hs (or_introl D) (or_intror He)).
 rewrite no_noise, H0 in O by auto. assert (Pk : 0 < k2) by (unfold k2; lra).
 set (m := Q2R (mu c) * bound / k2).
 assert (L : forall i r, past t j s i r -> - (m * (k2 * exp (k2 * r))) <= phi i r).
 { intros i r Hp. rewrite phi_value, W. unfold acting. rewrite D. fold (w2 i r). specialize (Hw i r Hp).
   assert (Ep := exp_pos (k2 * r)).
   assert (A : Q2R (mu c) * w2 i r <= Q2R (mu c) * bound) by now apply Rmult_le_compat_l.
   apply (Rmult_le_compat_l (exp (k2 * r))) in A; [|lra].
   replace (m * (k2 * exp (k2 * r))) with (exp (k2 * r) * (Q2R (mu c) * bound)) by (unfold m; field; lra). lra. }
 assert (A := bounded_total m j P (fun i _ => phi_continuous i) (fun i r Hi Hr => L i r (or_introl (conj Hi Hr)))).
 assert (F := bounded_integral j (t j) s m (proj1 Hs)
   (fun r Hr => phi_continuous j r ltac:(lra)) (fun r Hr => L j r (or_intror (conj eq_refl Hr)))).
 assert (Ep := exp_pos (k2 * s)). assert (Bp : 0 <= bound).
 { eapply Rle_trans; [apply (sq_nonneg (at_ (w j) (t j)))|apply (Hw j (t j))]. right. split; auto. lra. }
 assert (Mp : 0 <= m) by (unfold m; apply Rmult_le_pos; [now apply Rmult_le_pos|apply Rlt_le, Rinv_0_lt_compat; lra]).
 assert (V : size j s <= m) by (apply (Rmult_le_reg_l (exp (k2 * s))); auto; lra).
 eapply Rle_trans; [exact V|]. unfold m. apply Rle_div_l; [lra|].
 apply (Rmult_le_compat_r bound) in M; auto. unfold k2. lra. Qed.

(* Weights of measurements that are at least T1 apart: a geometric sum *)
Lemma weights_bounded j : 0 < k2 -> 0 < Q2R (T1 o) ->
  summed (fun i => exp (k2 * t i)) j * (1 - exp (- (k2 * Q2R (T1 o)))) <= exp (k2 * t j).
Proof.
 intros Pk Pt. set (p := exp (- (k2 * Q2R (T1 o)))). assert (Pp : 0 < p) by apply exp_pos.
 assert (Pa : 0 < k2 * Q2R (T1 o)) by now apply Rmult_lt_0_compat.
 assert (P1 : p < 1) by (unfold p; rewrite <- exp_0; apply exp_increasing; lra).
 induction j as [|j IH]; cbn [summed]; [rewrite Rmult_0_l; apply Rlt_le, exp_pos|].
 assert (E : summed (fun i => exp (k2 * t i)) j * (1 - p) <= p * exp (k2 * t (S j))); [|lra].
 destruct j as [|j]; [cbn [summed]; rewrite Rmult_0_l; apply Rlt_le, Rmult_lt_0_compat; [lra|apply exp_pos]|].
 eapply Rle_trans; [exact IH|]. unfold p. rewrite <- exp_plus. destruct given. specialize (intervals j).
 assert (I : k2 * Q2R (T1 o) <= k2 * (t (S (S j)) - t (S j))) by (apply Rmult_le_compat_l; lra).
 destruct (Rle_lt_or_eq_dec (k2 * t (S j)) (- (k2 * Q2R (T1 o)) + k2 * t (S (S j))) ltac:(lra)) as [L|L].
 - apply Rlt_le, exp_increasing, L.
 - rewrite L. lra. Qed.

(* kappa <= (1 - exp(-2 rate T1)) noise^2, by a rational below exp(2 rate T1) *)
Definition terms : nat := 60.
Definition claims_noise (level : Q) TP : bool :=
  let p := series (2 * rate c * T1 o) 0 terms in
  normal TP && negb (driven c) && noisy c && negb (Qle_bool (rate c) 0) && negb (Qle_bool (T1 o) 0) &&
  Qle_bool 0 (kappa c) && Qle_bool 1 p && Qle_bool (kappa c * p) (level * level * (p - 1)).
Theorem noise_guarantee level TP : claims_noise level TP = true ->
  forall j s, t j <= s <= t (S j) -> size 0%nat 0 = 0 -> (forall i r, past t j s i r -> w2 i r = 0) ->
  forall bound, 0 <= bound -> (forall i, (i < j)%nat -> sq (eta (S i)) <= bound) ->
  size j s <= Q2R level * Q2R level * bound.
Proof.
 intros B j s Hs H0 Hw bound Pb He. unfold claims_noise in B. rewrite !andb_true_iff in B.
 destruct B as (((((((B & D) & N) & R) & T) & K0) & Lp) & L). apply negb_true_iff in D. apply positive_R in R, T.
 apply Qle_R in K0. apply Qle_bool_R in L, Lp. rewrite Q2R_one in Lp. rewrite !Q2R_mult, Q2R_minus, Q2R_one in L.
 destruct (normal_rate TP B) as (W & _ & _). assert (O := normal_bounded TP j s B Hs (or_intror Hw) (or_introl N)).
 rewrite no_total, no_integral, H0 in O by auto. assert (Pk : 0 < k2) by (unfold k2; lra).
 assert (Pa : 0 < k2 * Q2R (T1 o)) by now apply Rmult_lt_0_compat.
 assert (S := series_below (2 * rate c * T1 o) terms). rewrite !Q2R_mult, Q2R_two in S. fold k2 in S.
 specialize (S ltac:(lra)).
 set (p := Q2R (series _ 0 terms)) in *. set (u := exp (- (k2 * Q2R (T1 o)))) in *.
 assert (G := weights_bounded j Pk T). fold u in G. assert (Pu : 0 < u) by apply exp_pos.
 assert (P1 : u < 1) by (unfold u; rewrite <- exp_0; apply exp_increasing; lra).
 assert (U : u * exp (k2 * Q2R (T1 o)) = 1) by (unfold u; rewrite <- exp_plus, Rplus_opp_l; apply exp_0).
 assert (A : summed noise j <= bound * summed (fun i => exp (k2 * t i)) j).
 { rewrite <- summed_scal. apply summed_le. intros i Hi. unfold noise, sensed. rewrite N, Rmult_comm.
   apply Rmult_le_compat_r; [apply Rlt_le, exp_pos|]. now apply He. }
 apply (Rmult_le_compat_l (Q2R (kappa c))) in A; auto. assert (Ep := exp_pos (k2 * s)).
 assert (Ts : exp (k2 * t j) <= exp (k2 * s)).
 { destruct (Req_dec (t j) s) as [->|Ne]; [lra|]. apply Rlt_le, exp_increasing, Rmult_lt_compat_l; lra. }
 assert (V : (1 - u) * size j s <= Q2R (kappa c) * bound).
 { apply (Rmult_le_reg_l (exp (k2 * s))); auto.
   apply (Rmult_le_compat_l (1 - u)) in O; [|lra]. apply (Rmult_le_compat_l (1 - u)) in A; [|lra].
   assert (Kb : 0 <= Q2R (kappa c) * bound) by now apply Rmult_le_pos.
   apply (Rmult_le_compat_l (Q2R (kappa c) * bound)) in G; auto.
   apply (Rmult_le_compat_l (Q2R (kappa c) * bound)) in Ts; auto. lra. }
 assert (M : Q2R (kappa c) <= Q2R level * Q2R level * (1 - u)).
 { apply (Rmult_le_reg_r p); [lra|]. eapply Rle_trans; [exact L|].
   assert (Pu1 : u * p <= 1) by (rewrite <- U; apply Rmult_le_compat_l; lra).
   assert (L2 : 0 <= Q2R level * Q2R level) by apply Rle_0_sqr.
   replace (Q2R level * Q2R level * (1 - u) * p) with (Q2R level * Q2R level * (p - u * p)) by ring.
   apply Rmult_le_compat_l; lra. }
 apply (Rmult_le_reg_l (1 - u)); [lra|]. eapply Rle_trans; [exact V|].
 apply (Rmult_le_compat_r bound) in M; auto. lra. Qed.
End Guarantees.
