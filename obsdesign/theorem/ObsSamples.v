(* obsdesign: Plants of samples: x+ in the place of x', the rate rho in that of alpha, sums in that of integrals.
   Here alpha d is rho. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Obs Require Import ObsForm ObsDesign ObsHull ObsPlant ObsTheorem ObsBlocks.
Import ListNotations.
Open Scope R_scope.

(* Sum of the first N values *)
Fixpoint sum_to (g : nat -> R) (N : nat) : R := match N with O => 0 | S k => sum_to g k + g k end.

(* Plant and observer with predicted estimates: xh k knows y 0 .. y (k - 1).
   x, xh, v: sequences of vectors; q, qh, y, yh: their arguments and outputs; g, gq, gy: known terms; f: of k and q *)
Record predicted (d : design) (f : nat -> list R -> list R) (x xh v q qh y yh g gq gy : nat -> list R) : Prop := {
  of_x : forall k, length (x k) = n d; of_xh : forall k, length (xh k) = n d; of_v : forall k, length (v k) = nv d;
  of_f : forall k r, length (f k r) = nf d;
  of_g : forall k, length (g k) = n d; of_gq : forall k, length (gq k) = nq d; of_gy : forall k, length (gy k) = ny d;
  next_x : forall k, x (S k) = A d ** x k ++++ Bf d ** f k (q k) ++++ g k ++++ B d ** v k;
  has_q : forall k, q k = Cq d ** x k ++++ Dqf d ** f k (q k) ++++ gq k ++++ Dq d ** v k;
  has_y : forall k, y k = C d ** x k ++++ Df d ** f k (q k) ++++ gy k ++++ D d ** v k;
  next_xh : forall k, xh (S k) = A d ** xh k ++++ Bf d ** f k (qh k) ++++ g k ++++ L1 d ** vsubR (yh k) (y k);
  has_qh : forall k, qh k = Cq d ** xh k ++++ Dqf d ** f k (qh k) ++++ gq k ++++ L2 d ** vsubR (yh k) (y k);
  has_yh : forall k, yh k = C d ** xh k ++++ Df d ** f k (qh k) ++++ gy k
}.

(* Plant and observer with filtered estimates: xh k knows y 1 .. y k. In v k stand the disturbances of the sample k,
   and those of the measurement y (k + 1); f is not in y *)
Record filtered (d : design) (f : nat -> list R -> list R) (x xh v q qh y yh g gq gy : nat -> list R) : Prop := {
  size_of_x : forall k, length (x k) = n d; size_of_xh : forall k, length (xh k) = n d;
  size_of_v : forall k, length (v k) = nv d; size_of_f : forall k r, length (f k r) = nf d;
  size_of_g : forall k, length (g k) = n d; size_of_gq : forall k, length (gq k) = nq d;
  size_of_gy : forall k, length (gy k) = ny d;
  state : forall k, x (S k) = A d ** x k ++++ Bf d ** f k (q k) ++++ g k ++++ B d ** v k;
  argument : forall k, q k = Cq d ** x k ++++ Dqf d ** f k (q k) ++++ gq k ++++ Dq d ** v k;
  measured : forall k, y (S k) = C d ** x (S k) ++++ gy (S k) ++++ D d ** v k;
  estimate : forall k, xh (S k) = A d ** xh k ++++ Bf d ** f k (qh k) ++++ g k ++++ L1 d ** vsubR (yh (S k)) (y (S k));
  estimated_argument : forall k,
    qh k = Cq d ** xh k ++++ Dqf d ** f k (qh k) ++++ gq k ++++ L2 d ** vsubR (yh (S k)) (y (S k));
  foreseen : forall k, yh (S k) = C d ** (A d ** xh k ++++ Bf d ** f k (qh k) ++++ g k) ++++ gy (S k)
}.
Definition error_of (x xh : nat -> list R) (k : nat) := vsubR (xh k) (x k).

(* V+ - rho^2 V + weight |z|^2 - supply |v|^2 <= 0 as a form, and what the kernel computes *)
Section Step.
Variable d : design.
Definition step_form : list term :=
  [((alpha d * alpha d)%Q, le d, Mul (P d) (le d)); (Qopp 1, ldot d, Mul (P d) (ldot d));
   (Qopp (weight d), lz d, lz d); (supply d, lv d, lv d)] ++ flat_map (minus_sigma d) (inequalities d).
Definition certified_step (T TP : list (list Z)) : bool :=
  forallb (fun m => Qle_bool 0 (scaling m)) (inequalities d) && Qle_bool 0 (alpha d) && Qle_bool (alpha d) 1 &&
  negb (Qle_bool (floor d) 0) && Qle_bool 0 (weight d) && Qle_bool 0 (supply d) &&
  check false (n d + nf d + nv d) step_form T && check false (n d) (definite d) TP.

Variables T TP : list (list Z).
Hypothesis cert : certified_step T TP = true.
Lemma step_parts : Forall (fun m => 0 <= Q2R (scaling m)) (inequalities d) /\ 0 <= Q2R (alpha d) <= 1 /\
  0 < Q2R (floor d) /\ 0 <= Q2R (weight d) /\ 0 <= Q2R (supply d) /\
  check false (n d + nf d + nv d) step_form T = true /\ check false (n d) (definite d) TP = true.
Proof. unfold certified_step in cert. rewrite !andb_true_iff in cert.
 destruct cert as (((((((K1 & K2) & K0) & K3) & K4) & K5) & K6) & K7).
 repeat split; auto using Qle_R, Qpos_R.
 - rewrite forallb_forall in K1. apply Forall_forall. intros m Hm. apply Qle_R. now apply K1.
 - apply Qle_bool_iff, Qle_Rle in K0. now rewrite Q2R_one in K0. Qed.

Notation rho := (Q2R (alpha d)).
Theorem step e f v : length e = n d -> length f = nf d -> length v = nv d ->
  (forall m, In m (inequalities d) -> 0 <= sigma m (err_arg d e f v) f) ->
  V d (err_dot d e f v) - rho * rho * V d e + Q2R (weight d) * sq (zed d e) - Q2R (supply d) * sq v <= 0.
Proof. intros He Hf Hv Hs. destruct step_parts as (K1 & _ & _ & _ & _ & K & _).
 assert (N := nonnegative _ _ _ K (e ++ f ++ v) ltac:(rewrite !app_length; lia)).
 destruct (parts d e f v He Hf Hv) as (Ee & Ef & Ev), (programs d e f v He Hf Hv) as (Eo & Eq & Ez).
 unfold step_form in N. rewrite quad_app, (sigmas_value d _ _ (err_arg d e f v) f) in N by auto.
 assert (S := sigmas_nonneg (inequalities d) (err_arg d e f v) f K1 Hs).
 unfold quad in N. cbn [bil bil1 eval] in N. rewrite Ez, Eo, Ee, Ev, !Q2R_opp, Q2R_mult, Q2R_one in N.
 unfold V, sq. lra. Qed.

(* Any error that obeys the error equations *)
Variables (e v f : nat -> list R).
Hypothesis (len_e : forall k, length (e k) = n d) (len_v : forall k, length (v k) = nv d).
Hypothesis (len_f : forall k, length (f k) = nf d).
Hypothesis error : forall k, e (S k) = err_dot d (e k) (f k) (v k).
Hypothesis class : forall k m, In m (inequalities d) -> 0 <= sigma m (err_arg d (e k) (f k) (v k)) (f k).
Lemma step_at k :
  V d (e (S k)) + Q2R (weight d) * sq (zed d (e k)) <= rho * rho * V d (e k) + Q2R (supply d) * sq (v k).
Proof. assert (N := step (e k) (f k) (v k) (len_e k) (len_f k) (len_v k) (class k)). rewrite <- error in N. lra. Qed.
Lemma sq_pos x : 0 <= sq x.
Proof. unfold sq. induction x; simpl; [lra|]. assert (0 <= a * a) by apply Rle_0_sqr. lra. Qed.
Lemma floor_of_V k : Q2R (floor d) * sq (e k) <= V d (e k).
Proof. destruct step_parts as (_ & _ & _ & _ & _ & _ & K). assert (N := nonnegative _ _ _ K (e k) (len_e k)).
 unfold quad, definite in N. cbn [bil bil1] in N. rewrite Q2R_opp, Q2R_one in N. cbn [eval] in N.
 rewrite !(eval_le d (e k) (len_e k)) in N. unfold V, sq. lra. Qed.
Lemma V_positive k : 0 <= V d (e k).
Proof. destruct step_parts as (_ & _ & F & _). assert (K := floor_of_V k).
 assert (0 <= Q2R (floor d) * sq (e k)) by (apply Rmult_le_pos; [lra|apply sq_pos]). lra. Qed.
Lemma rho2 : 0 <= rho * rho <= 1.
Proof. destruct step_parts as (_ & R & _). split; [apply Rmult_le_pos; lra|].
 replace 1 with (1 * 1) by ring. apply Rmult_le_compat; lra. Qed.

(* V (N) + weight sum |z|^2 <= V (0) + supply sum |v|^2 *)
Theorem summed N : Q2R (weight d) * sum_to (fun k => sq (zed d (e k))) N
  <= V d (e 0%nat) + Q2R (supply d) * sum_to (fun k => sq (v k)) N.
Proof. cut (V d (e N) + Q2R (weight d) * sum_to (fun k => sq (zed d (e k))) N
    <= V d (e 0%nat) + Q2R (supply d) * sum_to (fun k => sq (v k)) N); [assert (P := V_positive N); lra|].
 induction N as [|k IH]; cbn [sum_to]; [lra|]. assert (I := step_at k). assert (R := rho2).
 assert (rho * rho * V d (e k) <= 1 * V d (e k)) by (apply Rmult_le_compat_r; [apply V_positive|lra]). lra. Qed.

(* V - c falls by rho^2 a sample where supply |v|^2 <= (1 - rho^2) c *)
Theorem contracted c N : (forall k, (k < N)%nat -> Q2R (supply d) * sq (v k) <= (1 - rho * rho) * c) ->
  V d (e N) - c <= rho ^ (2 * N) * (V d (e 0%nat) - c).
Proof. rewrite pow_mult. replace (rho ^ 2) with (rho * rho) by ring. induction N as [|k IH]; intros H; [simpl; lra|].
 assert (I := step_at k). specialize (IH ltac:(intros; apply H; lia)). specialize (H k ltac:(lia)).
 destruct step_parts as (_ & _ & _ & W & _).
 assert (0 <= Q2R (weight d) * sq (zed d (e k))) by (apply Rmult_le_pos; auto; apply sq_pos).
 assert (rho * rho * (V d (e k) - c) <= rho * rho * ((rho * rho) ^ k * (V d (e 0%nat) - c)))
   by (apply Rmult_le_compat_l; [apply rho2|exact IH]).
 cbn [pow]. lra. Qed.
Theorem decayed N : (forall k, (k < N)%nat -> sq (v k) = 0) ->
   Q2R (floor d) * sq (e N) <= rho ^ (2 * N) * V d (e 0%nat).
Proof. intros Z. assert (W := contracted 0 N). rewrite !Rminus_0_r in W. eapply Rle_trans; [apply floor_of_V|].
 apply W. intros k Hk. rewrite (Z k Hk). lra. Qed.
End Step.

(* The error of predicted estimates obeys the error equations *)
Section Error.
Variable d : design.
Hypothesis siz : sized d = true.
Variables (f : nat -> list R -> list R) (x xh v q qh y yh g gq gy : nat -> list R).
Hypothesis class : forall t a b m, length a = nq d -> length b = nq d -> In m (inequalities d) ->
  0 <= sigma m (vsubR a b) (vsubR (f t a) (f t b)).
Hypothesis run : predicted d f x xh v q qh y yh g gq gy.
Definition df k := vsubR (f k (qh k)) (f k (q k)).
Lemma error_length k : length (error_of x xh k) = n d.
Proof. destruct run. unfold error_of. rewrite vsub_length; rewrite ?of_x0, ?of_xh0; auto. Qed.
Lemma df_length k : length (df k) = nf d.
Proof. destruct run. unfold df. rewrite vsub_length; rewrite ?of_f0; auto. Qed.
Lemma error_next k : error_of x xh (S k) = err_dot d (error_of x xh k) (df k) (v k).
Proof. destruct run. unfold error_of, df.
 rewrite (dot_error d siz (x k) (xh k) (v k) (q k) (qh k) (y k) (yh k) (g k) (gq k) (gy k) (f k (q k)) (f k (qh k)));
   auto.
 rewrite next_x0, next_xh0. reflexivity. Qed.
Lemma error_class k m : In m (inequalities d) -> 0 <= sigma m (err_arg d (error_of x xh k) (df k) (v k)) (df k).
Proof. intros Hm. destruct run. unfold error_of, df.
 rewrite (arg_error d siz (x k) (xh k) (v k) (q k) (qh k) (y k) (yh k) (g k) (gq k) (gy k) (f k (q k)) (f k (qh k)));
   auto.
 apply class; auto.
 - apply (qh_length d siz (x k) (xh k) (v k) (q k) (qh k) (y k) (yh k) (g k) (gq k) (gy k) (f k (q k)) (f k (qh k)));
     auto.
 - apply (q_length d siz (x k) (xh k) (v k) (q k) (qh k) (y k) (yh k) (g k) (gq k) (gy k) (f k (q k)) (f k (qh k)));
     auto.
Qed.
End Error.

(* What is stated of samples *)
Definition claims_energy_of_samples (d : design) (gamma : Q) (T TP : list (list Z))
  (TH : list (list (list (list Z)))) : bool :=
  sized d && certified_step d T TP && hulls_proved d TH && negb (Qle_bool (weight d) 0) &&
    Qle_bool (supply d) (gamma * gamma * weight d).
Definition claims_peak_of_samples (d : design) (gamma mu1 mu2 : Q) (T TP TO : list (list Z))
  (TH : list (list (list (list Z)))) : bool :=
  sized d && certified_step d T TP && hulls_proved d TH && check false (n d) (bounded d mu2) TO && Qle_bool 0 mu2 &&
    Qle_bool 0 mu1 &&
  Qeq_bool (supply d) ((1 - alpha d * alpha d) * mu1) && Qle_bool (mu1 * mu2) (gamma * gamma).

Theorem energy_of_predicted d gamma T TP TH : claims_energy_of_samples d gamma T TP TH = true ->
  forall f, of_class d f -> forall x xh v q qh y yh g gq gy, predicted d f x xh v q qh y yh g gq gy -> forall N,
  let e := error_of x xh in
  sum_to (fun k => sq (zed d (e k))) N
  <= V d (e 0%nat) / Q2R (weight d) + Q2R gamma * Q2R gamma * sum_to (fun k => sq (v k)) N
  /\ ((forall k, (k < N)%nat -> sq (v k) = 0) -> Q2R (floor d) * sq (e N) <= Q2R (alpha d) ^ (2 * N) * V d (e 0%nat)).
Proof. intros K f Hf x xh v q qh y yh g gq gy H N e. unfold claims_energy_of_samples in K. rewrite !andb_true_iff in K.
 destruct K as ((((S & K) & KH) & W) & G). assert (Hc := class_holds d TH f KH Hf). clear Hf. rename Hc into Hf.
 apply Qpos_R in W. apply Qle_bool_iff, Qle_Rle in G. rewrite !Q2R_mult in G.
 assert (Le := error_length d f x xh v q qh y yh g gq gy H). assert (Lf := df_length d f x xh v q qh y yh g gq gy H).
 assert (E := error_next d S f x xh v q qh y yh g gq gy H).
 assert (M := error_class d S f x xh v q qh y yh g gq gy Hf H). destruct H. split.
 - assert (B := summed d T TP K e v _ Le of_v0 Lf E M N).
   assert (Iv : 0 <= sum_to (fun k => sq (v k)) N).
   { clear. induction N as [|k IH]; cbn [sum_to]; [lra|]. assert (P := sq_pos (v k)). lra. }
   set (Iz := sum_to (fun k => sq (zed d (e k))) N) in *. set (I := sum_to (fun k => sq (v k)) N) in *.
   set (V0 := V d (e 0%nat)) in *.
   apply (Rmult_le_reg_l (Q2R (weight d))); auto. eapply Rle_trans; [exact B|].
   replace (Q2R (weight d) * (V0 / Q2R (weight d) + Q2R gamma * Q2R gamma * I))
     with (V0 + (Q2R gamma * Q2R gamma * Q2R (weight d)) * I) by (field; lra).
   apply Rplus_le_compat_l. now apply Rmult_le_compat_r.
 - intros Z. exact (decayed d T TP K e v _ Le of_v0 Lf E M N Z). Qed.

Theorem peak_of_predicted d gamma mu1 mu2 T TP TO TH : claims_peak_of_samples d gamma mu1 mu2 T TP TO TH = true ->
  forall f, of_class d f -> forall x xh v q qh y yh g gq gy, predicted d f x xh v q qh y yh g gq gy -> forall N,
  let e := error_of x xh in
  (forall vbar, (forall k, (k < N)%nat -> sq (v k) <= vbar) -> 0 <= vbar ->
     sq (zed d (e N)) <= Q2R gamma * Q2R gamma * vbar + Q2R mu2 * Q2R (alpha d) ^ (2 * N) * V d (e 0%nat)
     /\ V d (e N) <= Rmax (V d (e 0%nat)) (Q2R mu1 * vbar))
  /\ ((forall k, (k < N)%nat -> sq (v k) = 0) -> Q2R (floor d) * sq (e N) <= Q2R (alpha d) ^ (2 * N) * V d (e 0%nat)).
Proof. intros K f Hf x xh v q qh y yh g gq gy H N e. unfold claims_peak_of_samples in K. rewrite !andb_true_iff in K.
 destruct K as (((((((S & K) & KH) & O) & M2) & M1) & E1) & G). assert (Hc := class_holds d TH f KH Hf). clear Hf.
 rename Hc into Hf.
 apply Qle_R in M1, M2. apply Qeq_bool_iff, Qeq_eqR in E1. apply Qle_bool_iff, Qle_Rle in G.
 rewrite !Q2R_mult, Q2R_minus, Q2R_one, Q2R_mult in *.
 assert (Le := error_length d f x xh v q qh y yh g gq gy H). assert (Lf := df_length d f x xh v q qh y yh g gq gy H).
 assert (E := error_next d S f x xh v q qh y yh g gq gy H).
 assert (M := error_class d S f x xh v q qh y yh g gq gy Hf H). destruct H. split.
 - intros vbar Hv Hb.
   assert (C := contracted d T TP K e v _ Le of_v0 Lf E M (Q2R mu1 * vbar) N).
   assert (B := below_level d mu2 TO (e N) O (Le N)).
   destruct (step_parts d T TP K) as (_ & _ & _ & _ & Ks & _). assert (R := rho2 d T TP K).
   assert (C' : V d (e N) - Q2R mu1 * vbar <= Q2R (alpha d) ^ (2 * N) * (V d (e 0%nat) - Q2R mu1 * vbar)).
   { apply C. intros k Hk. specialize (Hv k Hk). rewrite <- Rmult_assoc, <- E1. now apply Rmult_le_compat_l. }
   set (V0 := V d (e 0%nat)) in *. set (r := Q2R (alpha d) ^ (2 * N)) in *.
   assert (P0 : 0 <= r). { apply pow_le. destruct (step_parts d T TP K) as (_ & R0 & _). lra. }
   assert (P1 : 0 <= Q2R mu1 * vbar) by now apply Rmult_le_pos.
   assert (P2 : 0 <= r * (Q2R mu1 * vbar)) by now apply Rmult_le_pos.
   assert (R1 : r <= 1).
   { unfold r. rewrite pow_mult. replace (Q2R (alpha d) ^ 2) with (Q2R (alpha d) * Q2R (alpha d)) by ring.
     rewrite <- (pow1 N). apply pow_incr. exact R. }
   split; [|exact (between _ _ _ _ P0 R1 C')].
   assert (P3 : Q2R mu2 * V d (e N) <= Q2R mu2 * (Q2R mu1 * vbar + r * V0)) by (apply Rmult_le_compat_l; lra).
   assert (Q2R mu1 * Q2R mu2 * vbar <= Q2R gamma * Q2R gamma * vbar) by now apply Rmult_le_compat_r. lra.
 - intros Z. exact (decayed d T TP K e v _ Le of_v0 Lf E M N Z). Qed.

(* Filtered estimates are predicted ones of another plant, whose output at k is y (k + 1) *)
Definition ahead (d : design) : design := {|
  n := n d; nf := nf d; nv := nv d; ny := ny d; nq := nq d; A := A d; Bf := Bf d; B := B d;
  C := product (C d) (A d); Df := product (C d) (Bf d); D := sum (product (C d) (B d)) (D d);
  Cq := Cq d; Dqf := Dqf d; Dq := Dq d; H := H d; L1 := L1 d; L2 := L2 d;
  alpha := alpha d; weight := weight d; supply := supply d; P := P d; floor := floor d;
  multipliers := multipliers d; hulls := hulls d |}.

Theorem filtered_is_predicted d f x xh v q qh y yh g gq gy : sized (ahead d) = true ->
  filtered d f x xh v q qh y yh g gq gy ->
  predicted (ahead d) f x xh v q qh (fun k => y (S k)) (fun k => yh (S k)) g gq (fun k => C d ** g k ++++ gy (S k)).
Proof. intros S []. assert (Lc : length (C d) = ny d).
 { unfold sized in S. rewrite !andb_true_iff, !Nat.eqb_eq in S. cbn in S. unfold product in S.
   rewrite map_length in S. tauto. }
 constructor; auto; intros k; cbn [ahead ny A Bf B C Df D].
 - rewrite vadd_length; rewrite mv_length; auto. now rewrite size_of_gy0.
 - rewrite measured0, state0, sum_R, !product_R, !mv_add, <- !vadd_assoc. do 3 f_equal.
   rewrite !vadd_assoc. f_equal. apply vadd_comm.
 - rewrite foreseen0, !product_R, !mv_add, <- !vadd_assoc. reflexivity. Qed.

Theorem energy_of_filtered d gamma T TP TH : claims_energy_of_samples (ahead d) gamma T TP TH = true ->
  forall f, of_class d f -> forall x xh v q qh y yh g gq gy, filtered d f x xh v q qh y yh g gq gy -> forall N,
  let e := error_of x xh in
  sum_to (fun k => sq (zed d (e k))) N
  <= V d (e 0%nat) / Q2R (weight d) + Q2R gamma * Q2R gamma * sum_to (fun k => sq (v k)) N
  /\ ((forall k, (k < N)%nat -> sq (v k) = 0) -> Q2R (floor d) * sq (e N) <= Q2R (alpha d) ^ (2 * N) * V d (e 0%nat)).
Proof. intros K f Hf x xh v q qh y yh g gq gy H. assert (S : sized (ahead d) = true).
 { unfold claims_energy_of_samples in K. rewrite !andb_true_iff in K. tauto. }
 exact (energy_of_predicted (ahead d) gamma T TP TH K f Hf _ _ _ _ _ _ _ _ _ _
   (filtered_is_predicted d f _ _ _ _ _ _ _ _ _ _ S H)).
Qed.
Theorem peak_of_filtered d gamma mu1 mu2 T TP TO TH :
  claims_peak_of_samples (ahead d) gamma mu1 mu2 T TP TO TH = true ->
  forall f, of_class d f -> forall x xh v q qh y yh g gq gy, filtered d f x xh v q qh y yh g gq gy -> forall N,
  let e := error_of x xh in
  (forall vbar, (forall k, (k < N)%nat -> sq (v k) <= vbar) -> 0 <= vbar ->
     sq (zed d (e N)) <= Q2R gamma * Q2R gamma * vbar + Q2R mu2 * Q2R (alpha d) ^ (2 * N) * V d (e 0%nat)
     /\ V d (e N) <= Rmax (V d (e 0%nat)) (Q2R mu1 * vbar))
  /\ ((forall k, (k < N)%nat -> sq (v k) = 0) -> Q2R (floor d) * sq (e N) <= Q2R (alpha d) ^ (2 * N) * V d (e 0%nat)).
Proof. intros K f Hf x xh v q qh y yh g gq gy H. assert (S : sized (ahead d) = true).
 { unfold claims_peak_of_samples in K. rewrite !andb_true_iff in K. tauto. }
 exact (peak_of_predicted (ahead d) gamma mu1 mu2 T TP TO TH K f Hf _ _ _ _ _ _ _ _ _ _
   (filtered_is_predicted d f _ _ _ _ _ _ _ _ _ _ S H)).
Qed.
