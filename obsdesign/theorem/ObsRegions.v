(* obsdesign: Functions whose difference quotients are known on an interval only, and trajectories that stay in it.

   Outside the interval such a function is continued by lines, and then its quotients are known everywhere. Of
   trajectories that stay inside, the function and the continued one have the same. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign ObsTrajectory ObsPlant ObsTheorem ObsSamples ObsMembers.
Import ListNotations.
Open Scope R_scope.

Definition secants_on (lo hi a : Q) (b : option Q) (phi : R -> R) :=
  forall p r, Q2R lo <= p <= Q2R hi -> Q2R lo <= r <= Q2R hi -> exists k, quotient a b k /\ phi p - phi r = k * (p - r).

(* A differentiable function has the quotients of its derivative *)
Lemma secants_on_derivative lo hi a b phi slope :
  (forall x, Q2R lo <= x <= Q2R hi -> is_derive phi x (slope x)) ->
  (forall x, Q2R lo <= x <= Q2R hi -> quotient a b (slope x)) -> secants_on lo hi a b phi.
Proof. intros D B p r Hp Hr.
 assert (I : forall x, Rmin r p <= x <= Rmax r p -> Q2R lo <= x <= Q2R hi).
 { intros x. unfold Rmin, Rmax. destruct (Rle_dec r p); lra. }
 destruct (MVT_gen phi r p slope) as (c & Hc & E).
 - intros x Hx. apply D, I. lra.
 - intros x Hx. apply derivable_continuous_pt. exists (slope x). apply is_derive_Reals. now apply D, I.
 - exists (slope c). split; [now apply B, I|exact E]. Qed.
(* The same of a quotient of two functions, of which the second is positive *)
Lemma quotient_of (a : Q) (b : option Q) num den : 0 < den -> Q2R a * den <= num ->
  match b with Some c => num <= Q2R c * den | None => True end -> quotient a b (num / den).
Proof. intros P L U. split; [now apply -> Rle_div_r; [apply L|lra]|]. destruct b; [|exact I]. apply Rle_div_l; lra. Qed.
Lemma secants_on_equal lo hi a b phi psi : (forall x, Q2R lo <= x <= Q2R hi -> phi x = psi x) ->
  secants_on lo hi a b psi -> secants_on lo hi a b phi.
Proof. intros E S p r Hp Hr. rewrite !E by assumption. now apply S. Qed.

(* The square root on an interval of positive numbers *)
Definition root_ends (lo hi a b : Q) : bool :=
  negb (Qle_bool lo 0) && Qle_bool 0 a && Qle_bool 0 b && Qle_bool (4 * a * a * hi) 1 && Qle_bool 1 (4 * b * b * lo).
Lemma sqrt_secants lo hi a b : root_ends lo hi a b = true -> secants_on lo hi a (Some b) sqrt.
Proof. unfold root_ends. rewrite !andb_true_iff. intros ((((K1 & K2) & K3) & K4) & K5).
 apply Qpos_R in K1. apply Qle_R in K2, K3. apply Qle_bool_iff, Qle_Rle in K4, K5.
 rewrite !Q2R_mult, Q2R_one in *. replace (Q2R 4) with 4 in * by (unfold Q2R; simpl; lra).
 apply (secants_on_derivative _ _ _ _ _ (fun x => 1 / (2 * sqrt x))); intros x Hx.
 - auto_derive; [lra|]. field. apply Rgt_not_eq, sqrt_lt_R0. lra.
 - assert (S := sqrt_lt_R0 x ltac:(lra)). assert (E := sqrt_sqrt x ltac:(lra)). set (s := sqrt x) in *.
   assert (Ka := Rmult_le_compat_l (4 * Q2R a * Q2R a) x (Q2R hi) ltac:(nra) ltac:(lra)).
   assert (Kb := Rmult_le_compat_l (4 * Q2R b * Q2R b) (Q2R lo) x ltac:(nra) ltac:(lra)).
   apply quotient_of; [lra| |]; apply Rsqr_incr_0; unfold Rsqr; nra. Qed.

(* phi, continued by lines of the least slope *)
Definition clipped (lo hi : Q) (s : R) := Rmax (Q2R lo) (Rmin (Q2R hi) s).
Definition continued (lo hi a : Q) (phi : R -> R) (s : R) := phi (clipped lo hi s) + Q2R a * (s - clipped lo hi s).
Lemma clipped_inside lo hi s : Q2R lo <= s <= Q2R hi -> clipped lo hi s = s.
Proof. intros K. unfold clipped. rewrite (Rmin_right (Q2R hi) s) by lra. apply Rmax_right. lra. Qed.
Lemma continued_inside lo hi a phi s : Q2R lo <= s <= Q2R hi -> continued lo hi a phi s = phi s.
Proof. intros K. unfold continued. rewrite clipped_inside by exact K. ring. Qed.
Lemma clipped_secants lo hi : Qle_bool lo hi = true -> secants 0 (Some 1%Q) (clipped lo hi).
Proof. intros K. apply Qle_bool_iff, Qle_Rle in K.
 apply secants_increments; [|split; [numbers|]]; intros p r L; unfold clipped, Rmax, Rmin;
  replace (Q2R 0) with 0 by numbers; replace (Q2R 1) with 1 by numbers;
  destruct (Rle_dec (Q2R hi) p), (Rle_dec (Q2R hi) r); repeat destruct (Rle_dec _ _); lra. Qed.
Lemma clipped_range lo hi s : Q2R lo <= Q2R hi -> Q2R lo <= clipped lo hi s <= Q2R hi.
Proof. intros K. unfold clipped. split; [apply Rmax_l|]. apply Rmax_lub; [exact K|apply Rmin_l]. Qed.
Definition ordered (lo hi a : Q) (b : option Q) : bool :=
  Qle_bool lo hi && match b with Some c => Qle_bool a c | None => true end.
Lemma continued_secants lo hi a b phi : ordered lo hi a b = true -> secants_on lo hi a b phi ->
  secants a b (continued lo hi a phi).
Proof. unfold ordered. rewrite andb_true_iff. intros [K O] S p r.
  destruct (clipped_secants lo hi K p r) as (m & [M1 M2] & Em).
 replace (Q2R 0) with 0 in M1 by numbers. replace (Q2R 1) with 1 in M2 by numbers.
 apply Qle_bool_iff, Qle_Rle in K.
 destruct (S (clipped lo hi p) (clipped lo hi r)) as (k & [L U] & E); try now apply clipped_range.
 exists (Q2R a + m * (k - Q2R a)). split.
 - assert (P := Rmult_le_pos m (k - Q2R a) ltac:(lra) ltac:(lra)). split; [lra|]. destruct b as [c|]; [|exact I].
   assert (P' := Rmult_le_pos (1 - m) (k - Q2R a) ltac:(lra) ltac:(lra)). lra.
 - unfold continued.
   replace (_ - _) with ((phi (clipped lo hi p) - phi (clipped lo hi r)) +
   Q2R a * ((p - r) - (clipped lo hi p - clipped lo hi r)))
    by ring. rewrite E, Em. ring. Qed.

(* Trajectories that stay where two functions have the same values *)
Lemma trajectories_of_region d f g (region : list R -> Prop) x xh v q qh y yh g1 gq gy :
  trajectories d f x xh v q qh y yh g1 gq gy -> (forall t r, length (g t r) = nf d) ->
  (forall t r, region r -> g t r = f t r) -> (forall t, 0 <= t -> region (q t) /\ region (qh t)) ->
  trajectories d g x xh v q qh y yh g1 gq gy.
Proof. intros [] L E I. split; auto; intros t Ht; destruct (I t Ht); rewrite E by assumption; auto. Qed.
Lemma predicted_of_region d f g (region : list R -> Prop) x xh v q qh y yh g1 gq gy :
  predicted d f x xh v q qh y yh g1 gq gy -> (forall k r, length (g k r) = nf d) ->
  (forall k r, region r -> g k r = f k r) -> (forall k, region (q k) /\ region (qh k)) ->
  predicted d g x xh v q qh y yh g1 gq gy.
Proof. intros [] L E I. split; auto; intros k; destruct (I k); rewrite E by assumption; auto. Qed.
Lemma filtered_of_region d f g (region : list R -> Prop) x xh v q qh y yh g1 gq gy :
  filtered d f x xh v q qh y yh g1 gq gy -> (forall k r, length (g k r) = nf d) ->
  (forall k r, region r -> g k r = f k r) -> (forall k, region (q k) /\ region (qh k)) ->
  filtered d g x xh v q qh y yh g1 gq gy.
Proof. intros [] L E I. split; auto; intros k; destruct (I k); rewrite ?E by assumption; auto. Qed.

(* Steps of a proof about one function *)
Ltac between K := unfold Q2R in K; simpl Qnum in K; simpl Qden in K.
Ltac fractions := unfold Q2R; simpl Qnum; simpl Qden.
Ltac by_signs := fractions;
  repeat match goal with |- context [Rabs ?x] =>
    first [rewrite (Rabs_pos_eq x) by lra | rewrite (Rabs_left1 x) by lra] end; reflexivity.
Ltac nonzero := repeat split; try exact I; try (apply Rgt_not_eq; nra); try (apply Rlt_not_eq; nra).
Ltac derived := fractions; auto_derive; [nonzero|field; nonzero].
Ltac not_negative :=
  match goal with
  | |- 0 <= _ + _ => apply Rplus_le_le_0_compat; not_negative
  | |- 0 <= _ * _ => apply Rmult_le_pos; not_negative
  | |- 0 <= _ ^ _ => apply pow_le; not_negative
  | _ => fractions; lra
  end.
Ltac by_bernstein e := assert (0 <= e) by not_negative; unfold Q2R in *; simpl Qnum in *; simpl Qden in *; lra.
Ltac inside_limits := rewrite ?continued_inside by (fractions; lra); reflexivity.
