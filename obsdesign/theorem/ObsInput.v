(* obsdesign: Reconstruction of the input of a linear plant: what = Bi L1 (yhat - y) with Bi B = I, and
   what - w = Bi e' - Bi A e. The error e is driven by w, and its derivative by w'. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign ObsHull ObsTrajectory ObsPlant ObsTheorem ObsBlocks.
Import ListNotations.
Open Scope R_scope.

(* A storage function of the errors of a design for another output: V' + 2 alpha V <= 2 alpha mu1 |v|^2 and
   |z|^2 <= mu2 V *)
Record level := { level_P : list (list Q); level_floor : Q; level_alpha : Q; level_mu1 : Q; level_mu2 : Q }.
Definition with_level (d : design) (l : level) (Hl : list (list Q)) : design := {|
  n := n d; nf := nf d; nv := nv d; ny := ny d; nq := nq d; A := A d; Bf := Bf d; B := B d; C := C d; Df := Df d;
  D := D d; Cq := Cq d; Dqf := Dqf d; Dq := Dq d; H := Hl; L1 := L1 d; L2 := L2 d;
  alpha := level_alpha l; weight := 0; supply := 2 * level_alpha l * level_mu1 l; P := level_P l;
  floor := level_floor l; multipliers := []; hulls := [] |}.
Definition level_V (l : level) (e : list R) := dotR e (level_P l ** e).
Definition size (x : list R) := sqrt (sq x).
(* What is left of V at the time t, as a bound on |z| *)
Definition left_of (l : level) (t V0 : R) := exp (- (Q2R (level_alpha l) * t)) * sqrt (Q2R (level_mu2 l) * V0).

Fixpoint eye (k : nat) : list (list Q) :=
  match k with O => [] | S k => (1%Q :: repeat 0%Q k) :: map (cons 0%Q) (eye k) end.
Definition alike_row (r s : list Q) : bool :=
  (length r =? length s)%nat && forallb (fun p => Qeq_bool (fst p) (snd p)) (combine r s).
Definition alike (M N : list (list Q)) : bool :=
  (length M =? length N)%nat && forallb (fun p => alike_row (fst p) (snd p)) (combine M N).
Definition proves_level (d : design) (l : level) Hl (c : Q) (T TP TO : list (list Z)) : bool :=
  let dl := with_level d l Hl in
  certified dl T TP && check false (n d) (bounded dl (level_mu2 l)) TO && Qle_bool 0 (level_mu1 l) &&
  Qle_bool 0 (level_mu2 l) && Qle_bool 0 c && Qle_bool (level_mu1 l * level_mu2 l) (c * c).
Definition claims_reconstruction (d : design) (Bi : list (list Q)) (drift rate : level) (c_w c_rate : Q)
  (T TP TO T' TP' TO' : list (list Z)) : bool :=
  sized d && (nf d =? 0)%nat && (length Bi =? nv d)%nat && alike (product Bi (B d)) (eye (nv d)) &&
  proves_level d drift (product Bi (A d)) c_w T TP TO && proves_level d rate Bi c_rate T' TP' TO'.

Lemma alike_R M : forall N, alike M N = true -> rmat M = rmat N.
Proof. assert (Row : forall r s, alike_row r s = true -> map Q2R r = map Q2R s).
 { unfold alike_row. induction r as [|a r IH]; intros [|b s] K; try discriminate K; [reflexivity|].
   cbn [length combine forallb fst snd] in K. rewrite !andb_true_iff in K. destruct K as [K1 [K2 K3]].
   cbn [map]. f_equal; [now apply Qeq_eqR, Qeq_bool_iff|]. apply IH. rewrite andb_true_iff. now split. }
 unfold alike. induction M as [|r M IH]; intros [|s N] K; try discriminate K; [reflexivity|].
 cbn [length combine forallb fst snd] in K. rewrite !andb_true_iff in K. destruct K as [K1 [K2 K3]].
 cbn [rmat map]. f_equal; [now apply Row|]. apply IH. rewrite andb_true_iff. now split. Qed.
Lemma eye_R k : forall w, length w = k -> eye k ** w = w.
Proof. induction k as [|k IH]; intros [|a w] L; try discriminate L; [reflexivity|]. injection L as L.
 rewrite by_rows. cbn [eye map dot]. f_equal.
 - rewrite Q2R_one. replace (dotR (map Q2R (repeat 0%Q k)) w) with 0; [ring|]. symmetry. clear.
   revert w. induction k as [|k IH]; intros [|b w]; cbn [repeat map dot]; try reflexivity. rewrite IH, Q2R_zero. ring.
 - rewrite map_map. transitivity (eye k ** w); [|now apply IH]. rewrite by_rows. apply map_ext. intros r. cbn [map dot].
   rewrite Q2R_zero. ring. Qed.

(* Sizes of vectors *)
Lemma dot_of_nothing a : sq a <= 0 -> forall b, dotR a b = 0.
Proof. unfold sq. induction a as [|u a IH]; intros K b; [reflexivity|]. cbn [dot] in K. assert (S := sq_nonneg a).
 unfold sq in S. assert (U : 0 <= u * u) by apply Rle_0_sqr. assert (Z : u = 0) by nra.
 destruct b as [|w b]; [reflexivity|]. cbn [dot]. rewrite IH by lra. rewrite Z. ring. Qed.
Lemma sum_below a b p r : 0 <= p -> 0 <= r -> sq a <= p * p -> sq b <= r * r -> sq (vsubR a b) <= (p + r) * (p + r).
Proof. intros Hp Hr Ka Kb.
 assert (E : forall s u, sq (vaddR (scaleR s a) (scaleR u b)) = s * s * sq a + 2 * s * u * dotR a b + u * u * sq b).
 { intros s u. unfold sq. rewrite !dot_add_l, !dot_add_r, !dot_scale_l, !dot_scale_r, (dot_comm b a). ring. }
 assert (Cs : - dotR a b <= p * r).
 { destruct (Rle_lt_or_eq_dec 0 p Hp) as [Pp|Z].
   - destruct (Rle_lt_or_eq_dec 0 r Hr) as [Pr|Z].
     + assert (S := sq_nonneg (vaddR (scaleR r a) (scaleR p b))). rewrite E in S.
       assert (r * r * sq a <= r * r * (p * p)) by (apply Rmult_le_compat_l; [apply Rle_0_sqr|exact Ka]).
       assert (p * p * sq b <= p * p * (r * r)) by (apply Rmult_le_compat_l; [apply Rle_0_sqr|exact Kb]).
       apply (Rmult_le_reg_l (2 * (p * r))); [|lra]. assert (0 < p * r) by now apply Rmult_lt_0_compat. lra.
     + rewrite dot_comm, dot_of_nothing by (rewrite <- Z in Kb; lra). rewrite <- Z. lra.
   - rewrite dot_of_nothing by (rewrite <- Z in Ka; lra). rewrite <- Z. lra. }
 assert (X : sq (vsubR a b) = sq a - 2 * dotR a b + sq b).
 { unfold vsubR, sq. rewrite !dot_add_l, !dot_add_r, !dot_scale_l, !dot_scale_r, (dot_comm b a). ring. }
 rewrite X. lra. Qed.

(* A program of signals, and its derivative *)
Definition sum_of (f g : R -> R) : R -> R := fun t => f t + g t.
Fixpoint signals (l : lin) (zs : list (R -> R)) : list (R -> R) :=
  match l with
  | Part k n => firstn n (skipn k zs)
  | Mul M l => rows (rmat M) (signals l zs)
  | Add a b => vadd (R -> R) sum_of (signals a zs) (signals b zs)
  | Sub a b => vadd (R -> R) sum_of (signals a zs) (map (fun g t => -1 * g t) (signals b zs))
  end.
Lemma at_sum f : forall g t, at_ (vadd (R -> R) sum_of f g) t = vaddR (at_ f t) (at_ g t).
Proof. induction f as [|u f IH]; intros [|w g] t; try reflexivity. cbn [vadd at_ map]. f_equal. apply IH. Qed.
Lemma at_signals l zs t : at_ (signals l zs) t = eval l (at_ zs t).
Proof. induction l as [k m|M l IH|a IHa b IHb|a IHa b IHb]; cbn [signals eval].
 - unfold at_. now rewrite skipn_map, firstn_map.
 - now rewrite at_rows, IH.
 - now rewrite at_sum, IHa, IHb.
 - rewrite at_sum, IHa, <- IHb. unfold vsubR, at_, scale. now rewrite !map_map. Qed.
Lemma moves_sum f t df : moves f t df -> forall g dg, moves g t dg -> moves (vadd (R -> R) sum_of f g) t (vaddR df dg).
Proof. intros K. induction K as [|u a f df Ku K IH]; intros g dg L; [destruct L; constructor; auto|].
 destruct L as [|w b g dg Lw L]; cbn [vadd]; constructor; auto; [now apply (is_derive_plus u w)|now apply IH]. Qed.
Lemma moves_part k : forall f t df m, moves f t df -> moves (firstn m (skipn k f)) t (firstn m (skipn k df)).
Proof. induction k as [|k IH]; intros f t df m K.
 - cbn [skipn]. revert m. induction K as [|u a f df Ku K IH]; intros [|m]; cbn [firstn]; constructor; auto. apply IH.
 - destruct K as [|u a f df Ku K]; cbn [skipn]; [destruct m; constructor|now apply IH]. Qed.
Lemma moves_signals l zs t dz : moves zs t dz -> moves (signals l zs) t (eval l dz).
Proof. intros K. induction l as [k m|M l IH|a IHa b IHb|a IHa b IHb]; cbn [signals eval].
 - now apply moves_part.
 - now apply moves_rows.
 - now apply moves_sum.
 - apply moves_sum; [exact IHa|]. clear - IHb. unfold scale. induction IHb as [|u e f df Ku K IH]; constructor; auto.
   apply (is_derive_scal u t (-1) e Ku). Qed.

(* What a level says of signals that obey the error equations *)
Lemma level_holds d l Hl c T TP TO es vs : proves_level d l Hl c T TP TO = true -> nf d = 0%nat ->
  length es = n d -> length vs = nv d ->
  (forall t, 0 <= t -> moves es t (err_dot d (at_ es t) [] (at_ vs t))) ->
  forall t u, 0 <= t -> 0 <= u -> (forall s, 0 <= s <= t -> sq (at_ vs s) <= u * u) ->
  let p := Q2R c * u + left_of l t (level_V l (at_ es 0)) in sq (Hl ** at_ es t) <= p * p.
Proof. intros K F Le Lv E t u Ht Hu Hv p. unfold proves_level in K. rewrite !andb_true_iff in K.
 destruct K as (((((K & O) & M1) & M2) & C0) & C2). set (dl := with_level d l Hl) in *.
 assert (S := storage_bound dl T TP K es vs (fun _ => []) Le Lv (fun _ => eq_sym F) E
   (fun _ _ m Hm => match Hm with end) (Q2R (level_mu1 l)) (u * u) t).
 cbv zeta beta in S. assert (Lt : length (at_ es t) = n dl) by (unfold at_; rewrite map_length; exact Le).
 assert (Bz := below_level dl (level_mu2 l) TO (at_ es t) O Lt).
 change (zed dl (at_ es t)) with (Hl ** at_ es t) in Bz.
 assert (V0 : 0 <= level_V l (at_ es 0)).
 { assert (G := above_floor dl T TP K (at_ es 0)). change (V dl (at_ es 0)) with (level_V l (at_ es 0)) in G.
   destruct (cert_parts dl T TP K) as (_ & _ & Fl & _). assert (Q := sq_nonneg (at_ es 0)).
   specialize (G ltac:(unfold at_; rewrite map_length; exact Le)).
   assert (0 <= Q2R (floor dl) * sq (at_ es 0)) by (apply Rmult_le_pos; lra). lra. }
 change (V dl (at_ es t)) with (level_V l (at_ es t)) in *. change (V dl (at_ es 0)) with (level_V l (at_ es 0)) in S.
 change (alpha dl) with (level_alpha l) in S. change (supply dl) with (2 * level_alpha l * level_mu1 l)%Q in S.
 apply Qle_R in M1, M2, C0. apply Qle_bool_iff, Qle_Rle in C2. rewrite !Q2R_mult in *. rewrite Q2R_two in S.
 specialize (S ltac:(ring) Ht Hv). set (k := exp (- (Q2R (level_alpha l) * t))).
 assert (P0 : 0 < k) by apply exp_pos.
 replace (exp (- (2 * Q2R (level_alpha l) * t))) with (k * k) in S by (unfold k; rewrite <- exp_plus; f_equal; ring).
 unfold p, left_of. fold k. set (W := level_V l (at_ es 0)) in *. set (m := Q2R (level_mu2 l)) in *.
 set (m1 := Q2R (level_mu1 l)) in *. set (cc := Q2R c) in *.
 assert (Q : sqrt (m * W) * sqrt (m * W) = m * W) by (apply sqrt_sqrt; now apply Rmult_le_pos).
 assert (Q0 : 0 <= sqrt (m * W)) by apply sqrt_pos. set (q := sqrt (m * W)) in *.
 assert (U : 0 <= u * u) by apply Rle_0_sqr.
 assert (A1 : m * level_V l (at_ es t) <= m * (m1 * (u * u) + k * k * W)).
 { apply Rmult_le_compat_l; [exact M2|]. assert (0 <= k * k * (m1 * (u * u))); [|lra].
   apply Rmult_le_pos; [apply Rle_0_sqr|now apply Rmult_le_pos]. }
 assert (A2 : m1 * m * (u * u) <= cc * cc * (u * u)) by now apply Rmult_le_compat_r.
 assert (A3 : 0 <= cc * u * (k * q)) by (apply Rmult_le_pos; [now apply Rmult_le_pos|apply Rmult_le_pos; lra]).
 replace (m * (m1 * (u * u) + k * k * W)) with (m1 * m * (u * u) + k * k * (m * W)) in A1 by ring.
 rewrite <- Q in A1. lra. Qed.

Section Input.
Variables (d : design) (Bi : list (list Q)) (drift rate : level) (c_w c_rate : Q) (T TP TO T' TP' TO' : list (list Z)).
Hypothesis claim : claims_reconstruction d Bi drift rate c_w c_rate T TP TO T' TP' TO' = true.
Theorem reconstructs f x xh w q qh y yh g gq gy dw : trajectories d f x xh w q qh y yh g gq gy ->
  (forall t, 0 <= t -> moves w t (at_ dw t)) ->
  forall t w_sup rate_sup, 0 <= t -> 0 <= w_sup -> 0 <= rate_sup ->
  (forall s, 0 <= s <= t -> sq (at_ w s) <= w_sup * w_sup) ->
  (forall s, 0 <= s <= t -> sq (at_ dw s) <= rate_sup * rate_sup) ->
  let e := error_at x xh in
  size (vsubR (Bi ** (L1 d ** vsubR (yh t) (y t))) (at_ w t)) <=
    Q2R c_w * w_sup + Q2R c_rate * rate_sup
      + left_of drift t (level_V drift (e 0)) + left_of rate t (level_V rate (err_dot d (e 0) [] (at_ w 0))).
Proof. intros X Dw t w_sup rate_sup Ht Hw Hr Kw Kr. cbv zeta. unfold claims_reconstruction in claim.
 rewrite !andb_true_iff in claim. destruct claim as (((((S & F) & Lb) & Ib) & K1) & K2).
 apply Nat.eqb_eq in F, Lb. destruct X.
 assert (Nil : forall s r, f s r = []) by (intros s r; apply length_zero_iff_nil; rewrite size_f; exact F).
 set (es := diff xh x). assert (At : forall s, at_ es s = error_at x xh s) by (intros s; apply at_diff; lia).
 assert (Le : length es = n d) by (unfold es, diff; rewrite map_length, combine_length; lia).
 assert (E : forall s, 0 <= s -> moves es s (err_dot d (at_ es s) [] (at_ w s))).
 { intros s Hs. assert (M := error d S x xh w q qh yh y g gq gy f size_x size_xh size_v size_g size_gq size_gy
     plant_x plant_q plant_y observer_x observer_q observer_y s Hs). unfold fs in M. rewrite !Nil in M. exact M. }
 assert (Pr : forall a b, length a = n d -> length b = nv d -> eval (ldot d) (a ++ [] ++ b) = err_dot d a [] b).
 { intros a b La Lv'. now apply (programs d a [] b). }
 set (es' := signals (ldot d) (es ++ w)).
 assert (At' : forall s, at_ es' s = err_dot d (at_ es s) [] (at_ w s)).
 { intros s. unfold es'. rewrite at_signals. unfold at_ at 1. rewrite map_app.
   apply Pr; unfold at_; now rewrite map_length. }
 assert (Ldw : length dw = nv d).
 { specialize (Dw 0 (Rle_refl 0)). apply moves_length in Dw. unfold at_ in Dw. rewrite map_length in Dw. lia. }
 assert (E' : forall s, 0 <= s -> moves es' s (err_dot d (at_ es' s) [] (at_ dw s))).
 { intros s Hs. rewrite At', <- Pr.
   - apply moves_signals. apply Forall2_app; [now apply E|now apply Dw].
   - specialize (E s Hs). apply moves_length in E. congruence.
   - unfold at_. now rewrite map_length. }
 assert (Le' : length es' = n d).
 { specialize (E 0 (Rle_refl 0)). apply moves_length in E. rewrite <- At' in E. unfold at_ in E.
   rewrite map_length in E. lia. }
 assert (N1 := level_holds d drift _ c_w T TP TO es w K1 F Le size_v E t w_sup Ht Hw Kw).
 assert (N2 := level_holds d rate _ c_rate T' TP' TO' es' dw K2 F Le' Ldw E' t rate_sup Ht Hr Kr).
 cbv zeta in N1, N2. rewrite !At', !At in N2. rewrite !At in N1.
 assert (Id : vsubR (Bi ** (L1 d ** vsubR (yh t) (y t))) (at_ w t)
   = vsubR (Bi ** err_dot d (error_at x xh t) [] (at_ w t)) (product Bi (A d) ** error_at x xh t)).
 { assert (O := out_error d S (at_ x t) (at_ xh t) (at_ w t) (q t) (qh t) (y t) (yh t) (g t) (gq t) (gy t) [] []).
   rewrite <- (O ltac:(unfold at_; now rewrite map_length) ltac:(unfold at_; now rewrite map_length)); auto;
     try (rewrite <- (Nil t (q t)); now auto); try (rewrite <- (Nil t (qh t)); now auto).
   assert (W : Bi ** (B d ** at_ w t) = at_ w t).
   { rewrite <- product_R. unfold rmat at 1. fold (rmat (product Bi (B d))). rewrite (alike_R _ _ Ib).
     apply eye_R. unfold at_. now rewrite map_length. }
   fold (error_at x xh t). change (vsubR [] []) with (@nil R).
   set (o := L1 d ** err_out d (error_at x xh t) [] (at_ w t)). unfold err_dot. fold o.
   assert (Bn : Bi ** (Bf d ** []) = repeat 0 (nv d)).
   { rewrite times_nil. rewrite <- Lb. rewrite by_rows. clear. generalize (length (Bf d)). intros k.
     induction Bi as [|r M IH]; [reflexivity|]. cbn [map repeat length]. f_equal; [|exact IH].
     clear. revert r. induction k as [|k IH]; intros [|a r]; cbn [repeat map dot]; try reflexivity.
     rewrite IH. ring. }
   assert (Lw : length (at_ w t) = nv d) by (unfold at_; now rewrite map_length).
   rewrite product_R, !mv_add, mv_sub, mv_add, W, Bn.
   apply (nth_ext _ _ 0 0).
   - sizes_agree.
   - intros i Hi. unfold vsubR. repeat (rewrite nth_vadd || rewrite nth_scale). rewrite nth_repeat. ring. }
 rewrite Id. unfold size.
 assert (L0 : forall l s V0, 0 <= left_of l s V0).
 { intros l s V0. unfold left_of. apply Rmult_le_pos; [left; apply exp_pos|apply sqrt_pos]. }
 assert (C1 : 0 <= Q2R c_w).
 { unfold proves_level in K1. rewrite !andb_true_iff in K1. apply Qle_R. tauto. }
 assert (C2 : 0 <= Q2R c_rate).
 { unfold proves_level in K2. rewrite !andb_true_iff in K2. apply Qle_R. tauto. }
 set (p1 := Q2R c_w * w_sup + left_of drift t (level_V drift (error_at x xh 0))) in *.
 set (p2 := Q2R c_rate * rate_sup + left_of rate t _) in *.
 assert (P1 : 0 <= p1) by (unfold p1; assert (Q := Rmult_le_pos _ _ C1 Hw); assert (Z := L0 drift t
   (level_V drift (error_at x xh 0))); lra).
 assert (P2 : 0 <= p2) by (unfold p2; assert (Q := Rmult_le_pos _ _ C2 Hr); assert (Z := L0 rate t
   (level_V rate (err_dot d (error_at x xh 0) [] (at_ w 0)))); lra).
 assert (Fin := sum_below _ _ p2 p1 P2 P1 N2 N1). apply sqrt_le_1_alt in Fin.
 rewrite sqrt_square in Fin by lra. unfold p1, p2 in Fin. lra. Qed.
End Input.
