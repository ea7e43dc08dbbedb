(* obsdesign: Errors that obey e' = rate e while a plant and its observer run, and how they fall. *)
Require Import Reals QArith Qreals Lra FunctionalExtensionality.
From Coquelicot Require Import Coquelicot.
Open Scope R_scope.

(* Of a signal e up to the time T: e' = rate e; |e(t)| <= exp(- c t) |e(0)|; it is constant; it is zero *)
Definition obeys (T : R) (e rate : R -> R) := forall t, 0 <= t <= T -> is_derive e t (rate t * e t).
Definition decays (T : R) (e : R -> R) (c : R) := forall t, 0 <= t <= T -> Rabs (e t) <= exp (- (c * t)) * Rabs (e 0).
Definition still (T : R) (e : R -> R) := forall t, 0 <= t <= T -> e t = e 0.
Definition vanishes (T : R) (e : R -> R) := forall t, 0 <= t <= T -> e t = 0.
(* rate <= - c *)
Definition below (T : R) (rate : R -> R) (c : R) := forall t, 0 <= t <= T -> rate t <= - c.

Lemma not_rising (g dg : R -> R) T : (forall t, 0 <= t <= T -> is_derive g t (dg t)) ->
  (forall t, 0 <= t <= T -> dg t <= 0) -> forall t, 0 <= t <= T -> g t <= g 0.
Proof. intros D N t Ht. destruct (MVT_gen g 0 t dg) as (s & B & E).
 - intros s B. apply D. rewrite Rmin_left, Rmax_right in B; lra.
 - intros s B. rewrite Rmin_left, Rmax_right in B by lra. apply derivable_continuous_pt. exists (dg s).
   apply is_derive_Reals, D. lra.
 - rewrite Rmin_left, Rmax_right in B by lra. assert (K := N s ltac:(lra)).
   assert (0 <= - dg s * (t - 0)) by (apply Rmult_le_pos; lra). lra. Qed.

Theorem decay (T : R) (e rate : R -> R) (c : R) : obeys T e rate -> below T rate c -> decays T e c.
Proof. intros O B t Ht.
 assert (S : exp (2 * c * t) * (e t * e t) <= exp (2 * c * 0) * (e 0 * e 0)).
 { apply (not_rising (fun s => exp (2 * c * s) * (e s * e s))
     (fun s => 2 * (c + rate s) * (exp (2 * c * s) * (e s * e s))) T); [| |exact Ht].
   - intros s Hs. auto_derive; [repeat split; exists (rate s * e s); now apply O|].
     erewrite (is_derive_unique _ s) by exact (O s Hs). ring.
   - intros s Hs. assert (C := B s Hs). assert (P := exp_pos (2 * c * s)). assert (Q := Rle_0_sqr (e s)).
     unfold Rsqr in Q. assert (0 <= (- (c + rate s)) * (exp (2 * c * s) * (e s * e s))); [|lra].
     apply Rmult_le_pos; [lra|apply Rmult_le_pos; lra]. }
 apply Rsqr_incr_0; [|apply Rabs_pos|apply Rmult_le_pos; [left; apply exp_pos|apply Rabs_pos]].
 rewrite Rsqr_mult, <- !Rsqr_abs. unfold Rsqr. rewrite Rmult_0_r, exp_0, Rmult_1_l in S.
 replace (exp (- (c * t)) * exp (- (c * t))) with (/ exp (2 * c * t)) by
   (rewrite <- exp_plus, <- exp_Ropp; f_equal; ring).
 assert (P := exp_pos (2 * c * t)). apply (Rmult_le_reg_l (exp (2 * c * t))); [exact P|].
 set (E := exp (2 * c * t)) in *. replace (E * (/ E * (e 0 * e 0))) with (e 0 * e 0) by (field; lra). lra. Qed.

Theorem constant (T : R) (e : R -> R) : (forall t, 0 <= t <= T -> is_derive e t 0) -> still T e.
Proof. intros D t Ht. destruct (MVT_gen e 0 t (fun _ => 0)) as (s & B & E); [| |lra].
 - intros s B. apply D. rewrite Rmin_left, Rmax_right in B; lra.
 - intros s B. rewrite Rmin_left, Rmax_right in B by lra. apply derivable_continuous_pt. exists 0.
   apply is_derive_Reals, D. lra. Qed.

(* Errors that act on each other fall with a storage function V *)
Theorem falling (T r most : R) (V dV size : R -> R) : (forall t, 0 <= t <= T -> is_derive V t (dV t)) ->
  (forall t, 0 <= t <= T -> dV t <= - (2 * r * V t)) -> (forall t, 0 <= t <= T -> size t <= V t <= most * size t) ->
  forall t, 0 <= t <= T -> size t <= most * exp (- (2 * r * t)) * size 0.
Proof. intros D N S t Ht.
 assert (F : exp (2 * r * t) * V t <= exp (2 * r * 0) * V 0).
 { apply (not_rising (fun s => exp (2 * r * s) * V s) (fun s => exp (2 * r * s) * (dV s + 2 * r * V s)) T).
   - intros s Hs. auto_derive; [repeat split; exists (dV s); now apply D|].
     erewrite (is_derive_unique _ s) by exact (D s Hs). ring.
   - intros s Hs. assert (C := N s Hs). assert (P := exp_pos (2 * r * s)).
     assert (0 <= exp (2 * r * s) * - (dV s + 2 * r * V s)) by (apply Rmult_le_pos; lra). lra.
   - exact Ht. }
 rewrite Rmult_0_r, exp_0, Rmult_1_l in F. assert (B := S t Ht). assert (B0 := S 0 ltac:(lra)).
 rewrite exp_Ropp. assert (P := exp_pos (2 * r * t)). apply (Rmult_le_reg_l (exp (2 * r * t))); [exact P|].
 set (E := exp (2 * r * t)) in *. replace (E * (most * / E * size 0)) with (most * size 0) by (field; lra).
 assert (E * size t <= E * V t) by (apply Rmult_le_compat_l; lra). lra. Qed.

(* A quotient that is below a number *)
Lemma quotient_below (f a b c : R) : 0 < b -> f * b = a -> a + c * b <= 0 -> f <= - c.
Proof. intros B <- N. apply (Rmult_le_reg_r b); lra. Qed.
(* Signals that are equal at every time are one *)
Lemma same (f g : R -> R) : (forall t, f t = g t) -> f = g.
Proof. apply functional_extensionality. Qed.
(* A power is not negative *)
Lemma even_power x n : 0 <= x ^ (2 * n).
Proof. rewrite pow_mult. apply pow_le, pow2_ge_0. Qed.

(* Decimals as quotients of integers *)
Ltac integers := repeat match goal with
  | |- context [Q2R (Qmake ?a ?b)] => change (Q2R (Qmake a b)) with (IZR a / IZR (Zpos b))
  end.
(* What a quotient, a root or a logarithm needs at a time t: K, 0 <= t <= T *)
Ltac needed K := first
  [ exact I
  | apply Rgt_not_eq, exp_pos
  | match goal with N : forall t, _ -> _ <> 0 |- _ <> 0 => let Z := fresh in intros Z; apply (N _ K); lra end
  | match goal with N : forall t, _ -> 0 < _ |- sqrt _ <> 0 =>
      let P := fresh in apply Rgt_not_eq, sqrt_lt_R0; assert (P := N _ K); cbv beta in P; lra end
  | match goal with N : forall t, _ -> 0 < _ |- _ => let P := fresh in assert (P := N _ K); cbv beta in P; lra end
  | lra
  | let Z := fresh in intros Z; lra
  | apply Rmult_integral_contrapositive_currified; needed K
  | apply pow_nonzero; needed K ].
(* An equation of rational functions, of terms whose exponents are split *)
Ltac algebra K :=
  unfold Rminus; rewrite ?ln_exp, ?exp_plus, ?exp_Ropp; repeat rewrite exp_ln by needed K;
  integers; field; repeat split; needed K.
(* The derivative of a signal, by those of the signals that it is made of *)
Ltac moves K :=
  auto_derive;
  [ repeat split; first
      [ eexists; match goal with H : forall t, _ -> is_derive _ t _ |- _ => exact (H _ K) end | integers; needed K ]
  | repeat match goal with |- context [Derive ?g ?s] =>
      erewrite (is_derive_unique g s) by (match goal with H : forall t, _ -> is_derive _ t _ |- _ => exact (H s K) end)
    end ].
