(* obsdesign: What an exported file states: all trajectories of the plant and of the observer, one f. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign ObsHull ObsTrajectory ObsPlant.
Import ListNotations.
Open Scope R_scope.

(* x, xh, v: lists of functions of time; q, qh, y, yh: their arguments and outputs; g, gq, gy: known terms;
   f: of time and q *)
Record trajectories (d : design) (f : R -> list R -> list R) (x xh v : list (R -> R))
  (q qh y yh g gq gy : R -> list R) : Prop := {
  size_x : length x = n d; size_xh : length xh = n d; size_v : length v = nv d;
  size_f : forall t r, length (f t r) = nf d;
  size_g : forall t, length (g t) = n d; size_gq : forall t, length (gq t) = nq d;
  size_gy : forall t, length (gy t) = ny d;
  v_continuous : forall t, 0 <= t -> steady v t;
  plant_x : forall t, 0 <= t -> moves x t (A d ** at_ x t ++++ Bf d ** f t (q t) ++++ g t ++++ B d ** at_ v t);
  plant_q : forall t, 0 <= t -> q t = Cq d ** at_ x t ++++ Dqf d ** f t (q t) ++++ gq t ++++ Dq d ** at_ v t;
  plant_y : forall t, 0 <= t -> y t = C d ** at_ x t ++++ Df d ** f t (q t) ++++ gy t ++++ D d ** at_ v t;
  observer_x : forall t, 0 <= t ->
    moves xh t (A d ** at_ xh t ++++ Bf d ** f t (qh t) ++++ g t ++++ L1 d ** vsubR (yh t) (y t));
  observer_q : forall t, 0 <= t ->
    qh t = Cq d ** at_ xh t ++++ Dqf d ** f t (qh t) ++++ gq t ++++ L2 d ** vsubR (yh t) (y t);
  observer_y : forall t, 0 <= t -> yh t = C d ** at_ xh t ++++ Df d ** f t (qh t) ++++ gy t
}.
Definition error_at (x xh : list (R -> R)) (t : R) := vsubR (at_ xh t) (at_ x t).

Definition claims_energy (d : design) (gamma : Q) (T TP : list (list Z)) (TH : list (list (list (list Z)))) : bool :=
  sized d && certified d T TP && hulls_proved d TH && negb (Qle_bool (weight d) 0) &&
    Qle_bool (supply d) (gamma * gamma * weight d).
Definition claims_peak (d : design) (gamma mu1 mu2 : Q) (T TP TO : list (list Z))
  (TH : list (list (list (list Z)))) : bool :=
  sized d && certified d T TP && hulls_proved d TH && check false (n d) (bounded d mu2) TO &&
  Qle_bool 0 mu2 && Qle_bool 0 mu1 && Qeq_bool (supply d) (2 * alpha d * mu1) && Qle_bool (mu1 * mu2) (gamma * gamma).

(* What falls from a towards c stays below the larger of the two *)
Lemma between b a c k : 0 <= k -> k <= 1 -> b - c <= k * (a - c) -> b <= Rmax a c.
Proof. intros K0 K1 W. unfold Rmax. destruct (Rle_dec a c) as [L|L].
 - assert (0 <= k * (c - a)) by (apply Rmult_le_pos; lra). lra.
 - assert (0 <= (1 - k) * (a - c)) by (apply Rmult_le_pos; lra). lra. Qed.

Theorem energy_of_trajectories d gamma T TP TH : claims_energy d gamma T TP TH = true ->
  forall f, of_class d f -> forall x xh v q qh y yh g gq gy, trajectories d f x xh v q qh y yh g gq gy ->
  forall t, 0 <= t -> let e := error_at x xh in
  RInt (fun s => sq (zed d (e s))) 0 t
  <= V d (e 0) / Q2R (weight d) + Q2R gamma * Q2R gamma * RInt (fun s => sq (at_ v s)) 0 t
  /\ ((forall s, 0 <= s <= t -> sq (at_ v s) = 0) ->
      Q2R (floor d) * sq (e t) <= exp (- (2 * Q2R (alpha d) * t)) * V d (e 0)).
Proof. intros K f Hf x xh v q qh y yh g gq gy H t Ht. unfold claims_energy in K. rewrite !andb_true_iff in K.
 destruct K as ((((S & K) & KH) & W) & G). assert (Hc := class_holds d TH f KH Hf). clear Hf. rename Hc into Hf.
 apply Qpos_R in W. apply Qle_bool_iff, Qle_Rle in G. rewrite !Q2R_mult in G. destruct H. cbv zeta. split.
 - assert (M := plant_l2 d S T TP K x xh v q qh yh y g gq gy f size_x0 size_xh0 size_v0 size_f0 size_g0 size_gq0
     size_gy0 plant_x0 plant_q0 plant_y0 observer_x0 observer_q0 observer_y0 Hf v_continuous0 t Ht).
   fold (error_at x xh) in M. cbv zeta beta in M.
   set (Iz := RInt (fun s => sq (zed d (vsubR (at_ xh s) (at_ x s)))) 0 t) in *.
   assert (Iv : 0 <= RInt (fun s => sq (at_ v s)) 0 t).
   { apply RInt_ge_0; auto.
     - apply (ex_RInt_continuous (V := R_CompleteNormedModule)). intros z Hz. rewrite Rmin_left in Hz by lra.
       apply steady_sq. apply v_continuous0. lra.
     - intros. apply sq_nonneg. }
   unfold error_at. fold Iz. set (I := RInt (fun s => sq (at_ v s)) 0 t) in *. set (V0 := V d _) in *.
   apply (Rmult_le_reg_l (Q2R (weight d))); auto. eapply Rle_trans; [exact M|].
   replace (Q2R (weight d) * (V0 / Q2R (weight d) + Q2R gamma * Q2R gamma * I)) with
     (V0 + (Q2R gamma * Q2R gamma * Q2R (weight d)) * I) by (field; lra).
   apply Rplus_le_compat_l. now apply Rmult_le_compat_r.
 - intros Z. exact (plant_decay d S T TP K x xh v q qh yh y g gq gy f size_x0 size_xh0 size_v0 size_f0 size_g0
     size_gq0 size_gy0
     plant_x0 plant_q0 plant_y0 observer_x0 observer_q0 observer_y0 Hf t Ht Z). Qed.

Theorem peak_of_trajectories d gamma mu1 mu2 T TP TO TH : claims_peak d gamma mu1 mu2 T TP TO TH = true ->
  forall f, of_class d f -> forall x xh v q qh y yh g gq gy, trajectories d f x xh v q qh y yh g gq gy ->
  forall t, 0 <= t -> let e := error_at x xh in
  (forall vbar, (forall s, 0 <= s <= t -> sq (at_ v s) <= vbar) ->
     sq (zed d (e t)) <= Q2R gamma * Q2R gamma * vbar + Q2R mu2 * exp (- (2 * Q2R (alpha d) * t)) * V d (e 0)
     /\ V d (e t) <= Rmax (V d (e 0)) (Q2R mu1 * vbar))
  /\ ((forall s, 0 <= s <= t -> sq (at_ v s) = 0) ->
      Q2R (floor d) * sq (e t) <= exp (- (2 * Q2R (alpha d) * t)) * V d (e 0)).
Proof. intros K f Hf x xh v q qh y yh g gq gy H t Ht. unfold claims_peak in K. rewrite !andb_true_iff in K.
 destruct K as (((((((S & K) & KH) & O) & M2) & M1) & E) & G).
 assert (Hc := class_holds d TH f KH Hf). clear Hf. rename Hc into Hf.
 apply Qle_R in M1, M2. apply Qeq_bool_iff, Qeq_eqR in E. apply Qle_bool_iff, Qle_Rle in G. rewrite !Q2R_mult in *.
 rewrite Q2R_two in E.
 destruct H. cbv zeta. split.
 - intros vbar Hv.
   assert (W := plant_storage d S T TP K x xh v q qh yh y g gq gy f size_x0 size_xh0 size_v0 size_f0 size_g0 size_gq0
     size_gy0 plant_x0 plant_q0 plant_y0 observer_x0 observer_q0 observer_y0 Hf (Q2R mu1) vbar t E Ht Hv).
   assert (Le : length (error_at x xh t) = n d) by (unfold error_at; rewrite vsub_length; rewrite ?at_length;
     congruence).
   assert (B := below_level d mu2 TO (error_at x xh t) O Le).
   cbv zeta beta in W. fold (error_at x xh t) (error_at x xh 0) in W. set (V0 := V d (error_at x xh 0)) in *.
   set (Vt := V d (error_at x xh t)) in *. set (k := exp _) in *.
   destruct (cert_parts d T TP K) as (_ & A0 & _).
   assert (P0 : 0 < k) by apply exp_pos.
   assert (P1 : k <= 1).
   { unfold k. rewrite <- exp_0. apply Rnot_lt_le. intros L. apply exp_lt_inv in L.
     assert (0 <= Q2R (alpha d) * t) by now apply Rmult_le_pos. lra. }
   assert (B0 : 0 <= vbar). { eapply Rle_trans; [apply (sq_nonneg (at_ v 0))|apply Hv; lra]. }
   assert (C0 : 0 <= Q2R mu1 * vbar) by now apply Rmult_le_pos. split.
   + assert (0 <= k * (Q2R mu1 * vbar)) by (apply Rmult_le_pos; lra).
     assert (Q2R mu2 * Vt <= Q2R mu2 * (Q2R mu1 * vbar + k * V0)) by (apply Rmult_le_compat_l; lra).
     assert (Q2R mu1 * Q2R mu2 * vbar <= Q2R gamma * Q2R gamma * vbar) by now apply Rmult_le_compat_r. lra.
   + exact (between Vt V0 (Q2R mu1 * vbar) k (Rlt_le _ _ P0) P1 W).
 - intros Z. exact (plant_decay d S T TP K x xh v q qh yh y g gq gy f size_x0 size_xh0 size_v0 size_f0 size_g0
     size_gq0 size_gy0
     plant_x0 plant_q0 plant_y0 observer_x0 observer_q0 observer_y0 Hf t Ht Z). Qed.
