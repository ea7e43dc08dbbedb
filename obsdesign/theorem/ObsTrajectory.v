(* obsdesign: From the inequality at every instant to the bounds along trajectories, for all plants and signals. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign.
Import ListNotations.
Open Scope R_scope.

(* Signals: lists of functions of time *)
Definition at_ (es : list (R -> R)) (t : R) : list R := map (fun g => g t) es.
Definition moves (es : list (R -> R)) (t : R) (ds : list R) := List.Forall2 (fun g d => is_derive g t d) es ds.
Definition steady (vs : list (R -> R)) (t : R) := List.Forall (fun g => continuous g t) vs.

Lemma der_const (c t : R) : is_derive (fun _ : R => c) t 0.
Proof. apply (is_derive_const (K := R_AbsRing) (V := R_NormedModule)). Qed.
Lemma moves_steady es t ds : moves es t ds -> steady es t.
Proof. intros H. induction H; constructor; auto. apply (ex_derive_continuous (K := R_AbsRing) (V := R_NormedModule)).
 now exists y. Qed.
Lemma moves_dot es fs t ds : moves es t ds -> forall dfs, moves fs t dfs ->
  is_derive (fun s => dotR (at_ es s) (at_ fs s)) t (dotR ds (at_ fs t) + dotR (at_ es t) dfs).
Proof. intros H. revert fs. induction H as [|g d es ds H Hs IH]; intros fs dfs K; [simpl;
   apply (is_derive_ext (fun _ => 0)); [reflexivity|]; replace (0+0) with 0 by ring; apply der_const|].
 destruct K as [|h k fs ks K Ks]; simpl.
 - apply (is_derive_ext (fun _ => 0)); [reflexivity|]. replace (0+0) with 0 by ring. apply der_const.
 - replace (d * h t + dotR ds (at_ fs t) + (g t * k + dotR (at_ es t) ks))
     with (plus (plus (mult d (h t)) (mult (g t) k)) (dotR ds (at_ fs t) + dotR (at_ es t) ks)) by (unfold plus,
       mult; simpl; ring).
   apply (is_derive_plus (fun s => g s * h s) (fun s => dotR (at_ es s) (at_ fs s))).
   + apply (is_derive_mult g h); auto. intros; apply Rmult_comm.
   + apply IH. exact Ks. Qed.
Definition rows (M : list (list R)) (es : list (R -> R)) : list (R -> R) := map (fun r s => dotR r (at_ es s)) M.
Lemma at_rows M es t : at_ (rows M es) t = mvR M (at_ es t).
Proof. unfold at_, rows, mv. rewrite map_map. reflexivity. Qed.
Lemma dot_moves r : forall es t ds, moves es t ds -> is_derive (fun s => dotR r (at_ es s)) t (dotR r ds).
Proof. induction r; intros es t ds H; simpl.
 - apply der_const.
 - destruct H as [|g d es ds H Hs]; simpl; [apply der_const|].
   apply (is_derive_plus (fun s => a * g s) (fun s => dotR r (at_ es s))); [|auto].
   apply (is_derive_scal g t a d H). Qed.
Lemma moves_rows M es t ds : moves es t ds -> moves (rows M es) t (mvR M ds).
Proof. intros H. unfold rows, mv. induction M; simpl; constructor; auto. now apply dot_moves. Qed.
Lemma steady_sq vs t : steady vs t -> continuous (fun s => sq (at_ vs s)) t.
Proof. unfold sq. intros H. induction H; simpl; [apply continuous_const|].
 apply (continuous_plus (fun s => x s * x s) (fun s => dotR (at_ l s) (at_ l s))); auto.
 apply (continuous_mult x x); auto. Qed.
Lemma moves_length es t ds : moves es t ds -> length ds = length es.
Proof. intros H. induction H; simpl; auto. Qed.

(* A function that does not rise *)
Lemma falls (W w : R -> R) T : 0 <= T -> (forall t, 0 <= t -> is_derive W t (w t)) -> (forall t, 0 <= t <= T ->
   w t <= 0) -> W T <= W 0.
Proof. intros HT D N. destruct (MVT_gen W 0 T w) as (c & Hc & E).
 - intros x Hx. apply D. rewrite Rmin_left in Hx by lra. lra.
 - intros x Hx. rewrite Rmin_left in Hx by lra. apply derivable_continuous_pt. exists (w x). apply is_derive_Reals.
   apply D. lra.
 - rewrite Rmin_left, Rmax_right in Hc by lra. specialize (N c Hc). nra. Qed.
Definition energy (g : R -> R) (t : R) := RInt g 0 t.
Lemma energy_derive (g : R -> R) : (forall t, 0 <= t -> continuous g t) ->
  forall t, is_derive (fun s => RInt (fun r => g (Rabs r)) 0 s) t (g (Rabs t)).
Proof. intros C t. assert (K : forall r, continuous (fun r => g (Rabs r)) r).
 { intros r. apply (continuous_comp Rabs g); [apply continuous_Rabs|]. apply C. apply Rabs_pos. }
 apply (is_derive_RInt (fun r => g (Rabs r)) _ 0 t); [|apply K].
 apply filter_forall. intros s. apply (RInt_correct (V := R_CompleteNormedModule)).
 apply (ex_RInt_continuous (V := R_CompleteNormedModule)). intros; apply K. Qed.
Lemma energy_abs (g : R -> R) t : 0 <= t -> RInt (fun r => g (Rabs r)) 0 t = energy g t.
Proof. intros Ht. apply RInt_ext. intros x Hx. rewrite Rmin_left in Hx by lra. rewrite Rabs_pos_eq; auto. lra. Qed.

Section Theorems.
Variable d : design.
Variables (T TP : list (list Z)).
Hypothesis cert : certified d T TP = true.
Variables (es vs : list (R -> R)) (fs : R -> list R).
Hypothesis len_e : length es = n d.
Hypothesis len_v : length vs = nv d.
Hypothesis len_f : forall t, length (fs t) = nf d.
Let e t := at_ es t.
Let v t := at_ vs t.
Hypothesis error : forall t, 0 <= t -> moves es t (err_dot d (e t) (fs t) (v t)).
Hypothesis class : forall t, 0 <= t -> forall m, In m (inequalities d) ->
   0 <= sigma m (err_arg d (e t) (fs t) (v t)) (fs t).
Let V t := ObsDesign.V d (e t).
Let z t := zed d (e t).
Let dV t := V_dot d (e t) (err_dot d (e t) (fs t) (v t)).
Lemma e_length t : length (e t) = n d. Proof. unfold e, at_. now rewrite map_length. Qed.
Lemma v_length t : length (v t) = nv d. Proof. unfold v, at_. now rewrite map_length. Qed.
Lemma V_moves t : 0 <= t -> is_derive V t (dV t).
Proof. intros Ht. specialize (error t Ht).
 assert (K := moves_dot es (rows (rmat (P d)) es) t _ error _ (moves_rows (rmat (P d)) es t _ error)).
 rewrite at_rows in K. unfold V, dV, V_dot, ObsDesign.V. eapply is_derive_ext; [|exact K]. intros s. simpl.
 now rewrite at_rows. Qed.
Lemma inequality t : 0 <= t -> dV t + 2 * Q2R (alpha d) * V t + Q2R (weight d) * sq (z t) - Q2R (supply d) * sq (v t)
   <= 0.
Proof. intros Ht. apply (dissipates d T TP cert); auto using e_length, v_length. Qed.
Lemma V_nonneg t : Q2R (floor d) * sq (e t) <= V t.
Proof. apply (above_floor d T TP cert). apply e_length. Qed.
Lemma sq_nonneg x : 0 <= sq x.
Proof. unfold sq. induction x; simpl; [lra|]. assert (0 <= a * a) by apply Rle_0_sqr. lra. Qed.
Lemma V_pos t : 0 <= V t.
Proof. destruct (cert_parts d T TP cert) as (_ & _ & F & _). assert (K := V_nonneg t). assert (S := sq_nonneg (e t)).
 nra. Qed.
Lemma alpha_nonneg : 0 <= Q2R (alpha d). Proof. now destruct (cert_parts d T TP cert) as (_ & K & _). Qed.

(* weight int |z|^2 <= V(0) + supply int |v|^2 *)
Theorem l2_bound : (forall t, 0 <= t -> steady vs t) -> forall t, 0 <= t ->
  Q2R (weight d) * RInt (fun s => sq (z s)) 0 t <= V 0 + Q2R (supply d) * RInt (fun s => sq (v s)) 0 t.
Proof. intros Cv t Ht.
 assert (Cz : forall s, 0 <= s -> continuous (fun s => sq (z s)) s).
 { intros s Hs. eapply continuous_ext; [|apply (steady_sq (rows (rmat (H d)) es) s)].
   - intros r. simpl. unfold z, zed. now rewrite at_rows.
   - apply (moves_steady _ _ _ (moves_rows _ _ _ _ (error s Hs))). }
 assert (Dz := energy_derive _ Cz). assert (Dv := energy_derive (fun s => sq (v s)) (fun s Hs => steady_sq vs s (Cv s
   Hs))).
 set (Iz := fun s => RInt (fun r => sq (z (Rabs r))) 0 s) in *.
 set (Iv := fun s => RInt (fun r => sq (v (Rabs r))) 0 s) in *.
 set (W := fun s => (V s + Q2R (weight d) * Iz s) - Q2R (supply d) * Iv s).
 assert (F : W t <= W 0).
 { apply (falls W (fun s => (dV s + Q2R (weight d) * sq (z (Rabs s))) - Q2R (supply d) * sq (v (Rabs s)))); auto.
   - intros s Hs. apply (is_derive_minus (fun s => V s + Q2R (weight d) * Iz s) (fun s => Q2R (supply d) * Iv s)).
     + apply (is_derive_plus V (fun s => Q2R (weight d) * Iz s)); [now apply V_moves|]. apply (is_derive_scal Iz).
       apply Dz.
     + apply (is_derive_scal Iv). apply Dv.
   - intros s Hs. rewrite Rabs_pos_eq by lra. assert (I := inequality s ltac:(lra)). assert (V0 := V_pos s).
     assert (A0 := alpha_nonneg).
     assert (0 <= Q2R (alpha d) * V s) by now apply Rmult_le_pos. lra. }
 unfold W, Iz, Iv in F. rewrite !RInt_point in F. rewrite (energy_abs (fun r => sq (z r))),
   (energy_abs (fun r => sq (v r))) in F by auto.
 unfold zero in F. simpl in F. unfold energy in F. assert (P := V_pos t). lra. Qed.

(* exp(2 alpha t) (V - c) does not rise where supply |v|^2 <= 2 alpha c *)
Lemma weighted c t : 0 <= t -> (forall s, 0 <= s <= t -> Q2R (supply d) * sq (v s) <= 2 * Q2R (alpha d) * c) ->
  V t - c <= exp (- (2 * Q2R (alpha d) * t)) * (V 0 - c).
Proof. intros Ht S. set (k := 2 * Q2R (alpha d)) in *. set (W := fun s => exp (k * s) * (V s - c)).
 assert (F : W t <= W 0).
 { apply (falls W (fun s => (k * exp (k * s)) * (V s - c) + exp (k * s) * dV s)); auto.
   - intros s Hs. apply (is_derive_mult (fun s => exp (k * s)) (fun s => V s - c)).
     + auto_derive; auto. ring.
     + replace (dV s) with (minus (dV s) 0) by (unfold minus, plus, opp; simpl; ring).
       apply (is_derive_minus V (fun _ => c)); [now apply V_moves|apply der_const].
     + intros; apply Rmult_comm.
   - intros s Hs. assert (I := inequality s ltac:(lra)). specialize (S s Hs). fold k in I.
     assert (0 <= Q2R (weight d) * sq (z s)).
     { destruct (cert_parts d T TP cert) as (_ & _ & _ & Kw & _). apply Rmult_le_pos; auto. apply sq_nonneg. }
     assert (E := exp_pos (k * s)). replace (k * exp (k * s) * (V s - c) + exp (k * s) * dV s) with
       (exp (k * s) * (dV s + k * V s - k * c)) by ring.
     assert (0 <= exp (k * s) * - (dV s + k * V s - k * c)) by (apply Rmult_le_pos; lra). lra. }
 unfold W in F. rewrite Rmult_0_r, exp_0, Rmult_1_l in F.
 rewrite exp_Ropp. assert (E := exp_pos (k * t)). apply (Rmult_le_reg_l (exp (k * t))); auto.
 rewrite <- Rmult_assoc, Rinv_r, Rmult_1_l by lra. exact F. Qed.
(* |e(t)|^2 floor <= exp(-2 alpha t) V(0) where v = 0 *)
Theorem decay t : 0 <= t -> (forall s, 0 <= s <= t -> sq (v s) = 0) ->
  Q2R (floor d) * sq (e t) <= exp (- (2 * Q2R (alpha d) * t)) * V 0.
Proof. intros Ht Z. assert (K := weighted 0 t Ht). assert (F := V_nonneg t). rewrite !Rminus_0_r in K.
 eapply Rle_trans; [exact F|]. apply K. intros s Hs. rewrite (Z s Hs). lra. Qed.
(* Where supply = 2 alpha mu1: V <= c + exp(-2 alpha t) (V(0) - c), c = mu1 sup|v|^2 *)
Theorem storage_bound mu1 vbar t :
  Q2R (supply d) = 2 * Q2R (alpha d) * mu1 -> 0 <= t -> (forall s, 0 <= s <= t -> sq (v s) <= vbar) ->
  V t - mu1 * vbar <= exp (- (2 * Q2R (alpha d) * t)) * (V 0 - mu1 * vbar).
Proof. intros Hs Ht Hv. apply (weighted (mu1 * vbar) t Ht). intros s Hs'. specialize (Hv s Hs').
 destruct (cert_parts d T TP cert) as (_ & _ & _ & _ & Ks & _).
 assert (Q2R (supply d) * sq (v s) <= Q2R (supply d) * vbar) by now apply Rmult_le_compat_l. rewrite Hs in *. lra. Qed.
End Theorems.
