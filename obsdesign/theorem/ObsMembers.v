(* obsdesign: An f that is a sum of functions of one variable, and the proof that it is in a class of a design.

   f(q) = sum of column_i * phi_i(row_i . q + shift_i), where the difference quotients of phi_i are in an interval.
   The inequality of a multiplier is concave in each of these quotients, so that its ends prove it for all of them. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign ObsPlant ObsTheorem.
Import ListNotations.
Open Scope R_scope.

(* Difference quotients: between a and b, or above a *)
Definition quotient (a : Q) (b : option Q) (k : R) :=
  Q2R a <= k /\ match b with Some c => k <= Q2R c | None => True end.
Definition secants (a : Q) (b : option Q) (phi : R -> R) :=
  forall p r, exists k, quotient a b k /\ phi p - phi r = k * (p - r).

(* A differentiable function has the quotients of its derivative *)
Lemma secants_derivative a b phi slope :
  (forall x, is_derive phi x (slope x)) -> (forall x, quotient a b (slope x)) -> secants a b phi.
Proof. intros D B p r. destruct (MVT_gen phi r p slope) as (c & _ & E).
 - intros; apply D.
 - intros. apply derivable_continuous_pt. exists (slope x). now apply is_derive_Reals.
 - exists (slope c). auto. Qed.

(* Any function: it is enough to compare its increments to those of lines *)
Lemma secants_increments a b phi :
  (forall p r, r < p -> Q2R a * (p - r) <= phi p - phi r) ->
  match b with Some c => Q2R a <= Q2R c /\ forall p r, r < p -> phi p - phi r <= Q2R c * (p - r) | None => True end ->
  secants a b phi.
Proof. intros L U p r. destruct (Req_dec p r) as [->|N].
 - exists (Q2R a). split; [|ring]. split; [lra|]. destruct b; [apply U|exact I].
 - exists ((phi p - phi r) / (p - r)). split; [|field; lra].
   assert (O : forall p r, r < p -> quotient a b ((phi p - phi r) / (p - r))).
   { intros x y Lt. split; [now apply -> Rle_div_r; [apply L|lra]|]. destruct b; [|exact I].
     apply Rle_div_l; [lra|now apply U]. }
   destruct (Rlt_or_le r p) as [Lt|Le]; [now apply O|].
   replace ((phi p - phi r) / (p - r)) with ((phi r - phi p) / (r - p)) by (field; lra). apply O. lra. Qed.

Ltac numbers := unfold quotient, Q2R; simpl; try lra.

(* Functions that a spec may name *)
Definition law (s : R) := s * Rabs s.
Definition sat (s : R) := Rmax (-1) (Rmin 1 s).
Definition relu (s : R) := Rmax s 0.

Lemma sin_secants : secants (-1) (Some 1%Q) sin.
Proof. apply (secants_derivative _ _ sin cos); intros x; [auto_derive; auto; ring|].
 assert (B := COS_bound x). numbers. Qed.
Lemma cos_secants : secants (-1) (Some 1%Q) cos.
Proof. apply (secants_derivative _ _ cos (fun x => - sin x)); intros x; [auto_derive; auto; ring|].
 assert (B := SIN_bound x). numbers. Qed.
Lemma atan_secants : secants 0 (Some 1%Q) atan.
Proof. apply (secants_derivative _ _ atan (fun x => / (1 + x ^ 2))); intros x.
 - apply is_derive_Reals. apply derivable_pt_lim_atan.
 - assert (S := pow2_ge_0 x). assert (P := Rinv_0_lt_compat (1 + x ^ 2) ltac:(lra)).
   assert (L := Rinv_le_contravar 1 (1 + x ^ 2) ltac:(lra) ltac:(lra)). rewrite Rinv_1 in L.
   set (k := / (1 + x ^ 2)) in *. numbers. Qed.
Lemma tanh_secants : secants 0 (Some 1%Q) tanh.
Proof. apply (secants_derivative _ _ tanh (fun x => 1 - tanh x ^ 2)); intros x;
  assert (0 < exp x) by apply exp_pos; assert (0 < exp (- x)) by apply exp_pos.
 - unfold tanh, sinh, cosh. auto_derive; [intuition lra|field; lra].
 - assert (T : tanh x ^ 2 <= 1).
   { unfold tanh, sinh, cosh. set (a := exp x) in *. set (b := exp (- x)) in *.
     replace (((a - b) / 2 / ((a + b) / 2)) ^ 2) with ((a - b) * (a - b) / ((a + b) * (a + b))) by (field; lra).
     apply Rle_div_l; nra. }
   assert (0 <= tanh x ^ 2) by (rewrite <- Rsqr_pow2; apply Rle_0_sqr). numbers. Qed.
Lemma exp_secants : secants 0 None exp.
Proof. apply (secants_derivative _ _ exp exp); intros x; [auto_derive; auto; ring|].
 assert (B := exp_pos x). numbers. Qed.
Lemma sinh_secants : secants 1 None sinh.
Proof. apply (secants_derivative _ _ sinh cosh); intros x; unfold sinh, cosh; [auto_derive; auto; field|].
 assert (P := exp_pos x). assert (E := exp_plus x (- x)). replace (x + - x) with 0 in E by ring. rewrite exp_0 in E.
 set (a := exp x) in *. set (b := exp (- x)) in *. assert (S := Rle_0_sqr (a - 1)). unfold Rsqr in S.
 assert (1 <= (a + b) / 2); [|numbers]. apply (Rmult_le_reg_l a); [exact P|]. nra. Qed.
Lemma abs_secants : secants (-1) (Some 1%Q) Rabs.
Proof. apply secants_increments; [|split; [numbers|]]; intros p r L; unfold Rabs;
  destruct (Rcase_abs p), (Rcase_abs r); numbers. Qed.
Lemma sat_secants : secants 0 (Some 1%Q) sat.
Proof. apply secants_increments; [|split; [numbers|]]; intros p r L; unfold sat, Rmax, Rmin;
  destruct (Rle_dec 1 p), (Rle_dec 1 r); repeat destruct (Rle_dec _ _); numbers. Qed.
Lemma relu_secants : secants 0 (Some 1%Q) relu.
Proof. apply secants_increments; [|split; [numbers|]]; intros p r L; unfold relu, Rmax;
  destruct (Rle_dec p 0), (Rle_dec r 0); numbers. Qed.
Lemma law_secants : secants 0 None law.
Proof. apply secants_increments; [|exact I]. intros p r L. unfold law, Rabs.
 destruct (Rcase_abs p), (Rcase_abs r); numbers; nra. Qed.
Lemma odd_secants m : secants 0 None (fun s => s ^ (2 * m + 1)).
Proof. apply (secants_derivative _ _ _ (fun s => INR (2 * m + 1) * (s ^ m) ^ 2)); intros s.
 - apply is_derive_Reals. rewrite <- pow_mult. replace (m * 2)%nat with (pred (2 * m + 1)) by lia.
   apply derivable_pt_lim_pow.
 - assert (K := pos_INR (2 * m + 1)). assert (S := pow2_ge_0 (s ^ m)). split; [|exact I].
   unfold Q2R. simpl Qnum. rewrite Rmult_0_l. now apply Rmult_le_pos. Qed.
Lemma one_secants : secants 0 (Some 0%Q) (fun _ => 1).
Proof. intros p r. exists 0. split; [numbers|ring]. Qed.
Lemma id_secants : secants 1 (Some 1%Q) (fun s => s).
Proof. intros p r. exists 1. split; [numbers|ring]. Qed.

(* The f of such functions: ridges are told by numbers only *)
Record ridge := { row : list Q; shift : Q; column : list (list Q); least : Q; most : option Q }.
Definition dotQ (w : list Q) (q : list R) := dotR (map Q2R w) q.
Definition along (r : ridge) (s : R) : list R := mvR (rmat (column r)) [s].
Definition arguments (rs : list ridge) (q : list R) := map (fun r => dotQ (row r) q + Q2R (shift r)) rs.
Fixpoint values (phis : list (R -> R)) (xs : list R) : list R :=
  match phis, xs with phi :: phis, x :: xs => phi x :: values phis xs | _, _ => [] end.
Fixpoint mixed (rs : list ridge) (ys : list R) : list R :=
  match rs, ys with r :: rs, y :: ys => vaddR (along r y) (mixed rs ys) | _, _ => [] end.
Definition zeros (m : nat) : list R := repeat 0 m.
Definition secants_of (rs : list ridge) (phis : list (R -> R)) :=
  List.Forall2 (fun r phi => secants (least r) (most r) phi) rs phis.

(* Differences of f are sums of quotients k along the ridges *)
Definition turned (rs : list ridge) (ks : list R) (dq : list R) :=
  map (fun rk : ridge * R => snd rk * dotQ (row (fst rk)) dq) (combine rs ks).
Lemma sub_add a b c e : vsubR (vaddR a b) (vaddR c e) = vaddR (vsubR a c) (vsubR b e).
Proof. unfold vsubR. rewrite scale_add. apply vadd_swap. Qed.
Lemma sub_along r s u : vsubR (along r s) (along r u) = along r (s - u).
Proof. unfold along. rewrite <- mv_sub. f_equal. unfold vsubR. simpl. f_equal. ring. Qed.
Lemma dotQ_sub w a b : dotQ w (vsubR a b) = dotQ w a - dotQ w b.
Proof. unfold dotQ, vsubR. rewrite dot_add_r, dot_scale_r. ring. Qed.
Lemma quotients rs phis : secants_of rs phis -> forall a b, exists ks,
  List.Forall2 (fun r k => quotient (least r) (most r) k) rs ks /\
  vsubR (mixed rs (values phis (arguments rs a))) (mixed rs (values phis (arguments rs b))) =
  mixed rs (turned rs ks (vsubR a b)).
Proof. intros S a b. induction S as [|r phi rs phis Hs _ IH]; [exists []; now split|].
 destruct IH as (ks & W & E).
 destruct (Hs (dotQ (row r) a + Q2R (shift r)) (dotQ (row r) b + Q2R (shift r))) as (k & Hk & Ek).
 exists (k :: ks). split; [now constructor|]. cbn [arguments map values mixed turned combine fst snd].
 rewrite sub_add, sub_along, Ek, dotQ_sub. f_equal; [|exact E]. f_equal. ring. Qed.
Lemma zeros_sub m : vsubR (zeros m) (zeros m) = zeros m.
Proof. unfold vsubR, zeros. induction m; simpl; [reflexivity|]. f_equal; [ring|exact IHm]. Qed.

(* sigma of z + s u is a parabola in s *)
Definition rate (m : multiplier) (q z u : list R) :=
  2 * dotR q (mvR (rmat (M12 m)) u) + dotR z (mvR (rmat (M22 m)) u) + dotR u (mvR (rmat (M22 m)) z).
Lemma sigma_step m q z u s :
  sigma m q (vaddR z (scaleR s u)) = sigma m q z + s * rate m q z u + s * s * dotR u (mvR (rmat (M22 m)) u).
Proof. unfold sigma, rate. rewrite !mv_add, !mv_scale, !dot_add_l, !dot_add_r, !dot_scale_l, !dot_scale_r. ring. Qed.
Lemma along_scale r s : along r s = scaleR s (along r 1).
Proof. unfold along. rewrite <- mv_scale. f_equal. simpl. f_equal. ring. Qed.
Lemma concave a b k s c0 c1 c2 : a <= k <= b -> c2 <= 0 ->
  0 <= c0 + (a * s) * c1 + (a * s) * (a * s) * c2 -> 0 <= c0 + (b * s) * c1 + (b * s) * (b * s) * c2 ->
  0 <= c0 + (k * s) * c1 + (k * s) * (k * s) * c2.
Proof. intros [L U] C A B. destruct (Req_dec a b) as [->|N]; [now replace k with b by lra|].
 set (A' := c0 + _ + _) in A. set (B' := c0 + _ + _) in B. apply (Rmult_le_reg_l (b - a)); [lra|]. rewrite Rmult_0_r.
 replace ((b - a) * _) with ((b - k) * A' + (k - a) * B' + (k - a) * (b - k) * (b - a) * (s * s) * - c2)
  by (unfold A', B'; ring).
 assert (S := Rle_0_sqr s). unfold Rsqr in S. clearbody A' B'. revert S. generalize (s * s). intros t S.
 apply Rplus_le_le_0_compat; [apply Rplus_le_le_0_compat; apply Rmult_le_pos; lra|].
 repeat apply Rmult_le_pos; lra. Qed.

(* The proof that a class has f, as data: what is done with one ridge after another, and T for each form *)
Inductive proof :=
| Ends (T : list (list Z))                   (* all quotients are chosen: the form in dq is not negative *)
| Silent (p : proof)                         (* the ridge does not enter sigma *)
| Fixed (p : proof)                          (* its interval is one number *)
| Both (p r : proof)                         (* sigma is concave in its quotient: both ends *)
| Rising (T : list (list Z)) (p : proof).    (* sigma rises with its quotient: the least one *)
Fixpoint unit (N : nat) : list (list Z) := match N with O => [] | S N => (1%Z :: repeat 0%Z N) :: unit N end.

(* A ridge does not enter sigma where its column meets zeros only *)
Definition null (a : Q) : bool := Qeq_bool a 0.
Fixpoint apart (w c : list Q) : bool :=
  match w, c with a :: w, b :: c => (null a || null b) && apart w c | _, _ => true end.
Fixpoint cleared (c : list Q) (M : list (list Q)) : bool :=
  match c, M with b :: c, w :: M => (null b || forallb null w) && cleared c M | _, _ => true end.
Definition heads (r : ridge) : list Q := map (hd 0%Q) (column r).
Definition unmet (m : multiplier) (r : ridge) : bool :=
  let c := heads r in
  forallb (fun w => apart w c) (M12 m) && forallb (fun w => apart w c) (M22 m) && cleared c (M22 m).
Lemma null_R a : null a = true -> Q2R a = 0.
Proof. intros K. apply Qeq_bool_iff, Qeq_eqR in K. now rewrite Q2R_zero in K. Qed.
Lemma along_heads r : along r 1 = map Q2R (heads r).
Proof. unfold along, mv, rmat, heads. rewrite !map_map. apply map_ext. intros [|a w]; simpl;
  [now rewrite Q2R_zero|rewrite dot_nil_r; ring]. Qed.
Lemma apart_dot w : forall c, apart w c = true -> dotR (map Q2R w) (map Q2R c) = 0.
Proof. induction w as [|a w IH]; intros [|b c] K; try reflexivity. cbn [apart] in K. apply andb_true_iff in K.
 destruct K as [K1 K2]. cbn [map dot]. rewrite (IH c K2). apply orb_true_iff in K1.
 destruct K1 as [E|E]; rewrite (null_R _ E); ring. Qed.
Lemma apart_mv M c : forall z, forallb (fun w => apart w c) M = true -> dotR z (mvR (rmat M) (map Q2R c)) = 0.
Proof. induction M as [|w M IH]; intros z K; [apply dot_nil_r|]. cbn [forallb] in K. apply andb_true_iff in K.
 destruct K as [K1 K2]. destruct z as [|a z]; [reflexivity|]. cbn [rmat mv map dot]. rewrite (apart_dot w c K1).
 assert (E := IH z K2). unfold mv, rmat in E. rewrite E. ring. Qed.
Lemma null_dot w : forall z, forallb null w = true -> dotR (map Q2R w) z = 0.
Proof. induction w as [|a w IH]; intros [|b z] K; try reflexivity. cbn [forallb] in K. apply andb_true_iff in K.
 destruct K as [K1 K2]. cbn [map dot]. rewrite (IH z K2), (null_R _ K1). ring. Qed.
Lemma cleared_mv c z : forall M, cleared c M = true -> dotR (map Q2R c) (mvR (rmat M) z) = 0.
Proof. induction c as [|b c IH]; intros [|w M] K; try reflexivity. cbn [cleared] in K. apply andb_true_iff in K.
 destruct K as [K1 K2]. cbn [rmat mv map dot]. assert (E := IH M K2). unfold mv, rmat in E. rewrite E.
 apply orb_true_iff in K1. destruct K1 as [K1|K1]; [rewrite (null_R _ K1)|rewrite (null_dot w z K1)]; ring. Qed.
Lemma unmet_sigma m r q z s : unmet m r = true -> sigma m q (vaddR z (scaleR s (along r 1))) = sigma m q z.
Proof. unfold unmet. rewrite !andb_true_iff. intros [[K1 K2] K3]. rewrite sigma_step. unfold rate. rewrite along_heads.
 rewrite (apart_mv _ _ _ K1), !(apart_mv _ _ _ K2), (cleared_mv _ _ _ K3). ring. Qed.

Section Member.
Variables (nq nf : nat).
Definition dq := Part 0 nq.
Definition moved (r : ridge) (k : Q) (y : lin) := Add y (Mul (column r) (Mul [map (Qmult k) (row r)] dq)).
Definition value_form (m : multiplier) (y : lin) : list term :=
  [(1%Q, dq, Mul (M11 m) dq); (2%Q, dq, Mul (M12 m) y); (1%Q, y, Mul (M22 m) y)].
Definition curve_form (m : multiplier) (r : ridge) : list term :=
  let u := Mul (column r) (Part 0 1) in [(Qopp 1, u, Mul (M22 m) u)].
Definition square_form (m : multiplier) (r : ridge) : list term :=
  let z := Part 0 nf in let u := Mul (column r) (Part nf 1) in
  [(1%Q, z, Mul (M22 m) u); (1%Q, u, Mul (M22 m) z)].
Definition rise_form (m : multiplier) (r : ridge) : list term :=
  [(2%Q, dq, Mul (M12 m) (Mul (column r) (Mul [row r] dq)))].

Fixpoint proves (m : multiplier) (y : lin) (rs : list ridge) (p : proof) : bool :=
  match rs, p with
  | [], Ends T => check false nq (value_form m y) T
  | r :: rs, Silent p => unmet m r && proves m y rs p
  | r :: rs, Fixed p =>
      match most r with Some b => Qeq_bool (least r) b && proves m (moved r b y) rs p | None => false end
  | r :: rs, Both p1 p2 =>
      match most r with
      | Some b => check false 1 (curve_form m r) (unit 1) && proves m (moved r (least r) y) rs p1 &&
        proves m (moved r b y) rs p2
      | None => false end
  | r :: rs, Rising T p =>
      check false (nf + 1) (square_form m r) (unit (nf + 1)) && check false nq (rise_form m r) T &&
      proves m (moved r (least r) y) rs p
  | _, _ => false
  end.

Lemma eval_dq q : length q = nq -> eval dq q = q.
Proof. intros L. unfold dq. cbn [eval skipn]. rewrite <- L. apply firstn_all. Qed.
Lemma dotQ_scale k w q : dotQ (map (Qmult k) w) q = Q2R k * dotQ w q.
Proof. unfold dotQ. revert q. induction w; intros q; simpl; [ring|]. destruct q; [ring|]. rewrite IHw, Q2R_mult.
  ring. Qed.
Lemma eval_moved r k y q : length q = nq -> eval (moved r k y) q = vaddR (eval y q) (along r (Q2R k * dotQ (row r) q)).
Proof. intros L. unfold moved, along. cbn [eval]. rewrite (eval_dq q L), <- dotQ_scale. reflexivity. Qed.
Lemma value_of m y q : length q = nq -> quad (value_form m y) q = sigma m q (eval y q).
Proof. intros L. unfold quad, value_form, sigma. cbn [bil bil1 eval]. rewrite (eval_dq q L), Q2R_one, Q2R_two.
  ring. Qed.
Lemma eval_unit r : mvR (rmat (column r)) (firstn 1 (skipn 0 [1])) = along r 1. Proof. reflexivity. Qed.
Lemma curve_of m r : quad (curve_form m r) [1] = - dotR (along r 1) (mvR (rmat (M22 m)) (along r 1)).
Proof. unfold quad, curve_form. cbn [bil bil1 eval]. rewrite eval_unit, Q2R_opp, Q2R_one. ring. Qed.
Lemma square_of m r z s : length z = nf -> quad (square_form m r) (z ++ [s]) =
  s * (dotR z (mvR (rmat (M22 m)) (along r 1)) + dotR (along r 1) (mvR (rmat (M22 m)) z)).
Proof. intros K. unfold quad, square_form. cbn [bil bil1 eval].
 replace (firstn nf (skipn 0 (z ++ [s]))) with z by (rewrite <- K; symmetry; apply firstn_app_exact).
 rewrite <- K, skipn_app_exact. change (firstn 1 [s]) with [s]. fold (along r s).
 rewrite (along_scale r s), !mv_scale, !dot_scale_r, dot_scale_l, Q2R_one. ring. Qed.
Lemma rise_of m r q : length q = nq ->
  quad (rise_form m r) q = 2 * (dotQ (row r) q * dotR q (mvR (rmat (M12 m)) (along r 1))).
Proof. intros L. unfold quad, rise_form. cbn [bil bil1 eval]. rewrite (eval_dq q L), Q2R_two.
 change (mvR (rmat [row r]) q) with [dotQ (row r) q]. fold (along r (dotQ (row r) q)).
 rewrite along_scale, mv_scale, dot_scale_r. ring. Qed.
(* What a form over (.., s) says that is linear in s and not negative *)
Lemma no_rate c : 0 <= 1 * c -> 0 <= -1 * c -> c = 0. Proof. lra. Qed.

Definition sized_column (r : ridge) : bool := (length (column r) =? nf)%nat.
Lemma along_length r s : sized_column r = true -> length (along r s) = nf.
Proof. intros K. apply Nat.eqb_eq in K. unfold along, mv, rmat. now rewrite !map_length. Qed.
Lemma mixed_length rs : forall ys, forallb sized_column rs = true -> forall y, length y = nf ->
  length (vaddR y (mixed rs ys)) = nf.
Proof. induction rs as [|r rs IH]; intros [|s ys] K y Hy; cbn [mixed]; rewrite ?vadd_nil_r; auto.
 cbn [forallb] in K. apply andb_true_iff in K. destruct K as [K1 K2]. rewrite vadd_assoc. apply IH; auto.
 rewrite vadd_length; auto. rewrite along_length; auto. Qed.

Lemma swap y u w : vaddR y (vaddR u w) = vaddR (vaddR y w) u.
Proof. rewrite <- vadd_assoc. f_equal. apply vadd_comm. Qed.
Theorem proved_sigma m q : length q = nq -> forall rs p y, proves m y rs p = true -> forallb sized_column rs = true ->
  length (eval y q) = nf -> forall ks, List.Forall2 (fun r k => quotient (least r) (most r) k) rs ks ->
  0 <= sigma m q (vaddR (eval y q) (mixed rs (turned rs ks q))).
Proof. intros L. induction rs as [|r rs IH]; intros p y K Z Ly ks W.
 - inversion W. destruct p; try discriminate K. cbn [mixed]. rewrite vadd_nil_r. rewrite <- value_of by exact L.
   exact (nonnegative _ _ _ K q L).
 - inversion W as [|? k ? ks' Hk W']. subst. cbn [turned combine map mixed fst snd]. fold (turned rs ks' q).
   cbn [forallb] in Z. apply andb_true_iff in Z. destruct Z as [Z1 Z2].
   set (w := dotQ (row r) q). set (rest := mixed rs (turned rs ks' q)). set (z := vaddR (eval y q) rest).
   assert (Lz : length z = nf) by (now apply mixed_length).
   assert (At : forall c p, proves m (moved r c y) rs p = true ->
   0 <= sigma m q (vaddR z (scaleR (Q2R c * w) (along r 1)))).
   { intros c p' Kc. unfold z. rewrite <- swap, <- along_scale, vadd_assoc. unfold w.
     rewrite <- (eval_moved r c y q L). apply (IH p'); auto. rewrite eval_moved by exact L.
     rewrite vadd_length; auto. rewrite along_length; auto. }
   rewrite swap. fold z. rewrite along_scale. destruct Hk as [Low High]. destruct p; try discriminate K;
   cbn [proves] in K.
   + apply andb_true_iff in K. destruct K as [K1 K2]. rewrite unmet_sigma by exact K1. now apply (IH p).
   + destruct (most r) as [b|]; [|discriminate]. apply andb_true_iff in K. destruct K as [K1 K2].
     apply Qeq_bool_iff, Qeq_eqR in K1. replace k with (Q2R b) by lra. now apply (At b p).
   + destruct (most r) as [b|]; [|discriminate]. rewrite !andb_true_iff in K. destruct K as [[K1 K2] K3].
     assert (C := nonnegative _ _ _ K1 [1] eq_refl). rewrite curve_of in C.
     assert (A1 := At _ _ K2). assert (A2 := At _ _ K3). rewrite sigma_step in *.
     apply (concave (Q2R (least r)) (Q2R b)); auto. lra.
   + rewrite !andb_true_iff in K. destruct K as [[K1 K2] K3].
     assert (R : forall z, length z = nf ->
     dotR z (mvR (rmat (M22 m)) (along r 1)) + dotR (along r 1) (mvR (rmat (M22 m)) z) = 0).
     { intros z' Lz'. apply no_rate; rewrite <- square_of by assumption; apply (nonnegative _ _ _ K1);
       rewrite app_length; simpl; lia. }
     assert (E := R _ (along_length r 1 Z1)). assert (Rz := R z Lz).
     assert (G := nonnegative _ _ _ K2 q L). rewrite rise_of in G by exact L. fold w in G.
     assert (A1 := At _ _ K3). rewrite sigma_step in *. unfold rate in *.
     replace (dotR (along r 1) (mvR (rmat (M22 m)) (along r 1))) with 0 in * by lra.
     assert (M := Rmult_le_pos (k - Q2R (least r)) _ ltac:(lra) G). nra.
Qed.
End Member.

(* f is of the class of a design *)
Definition start (nq nf : nat) : lin := Mul (repeat [] nf) (dq nq).
Lemma start_zeros nq nf q : eval (start nq nf) q = zeros nf.
Proof. unfold start, zeros. cbn [eval]. induction nf; simpl; [reflexivity|]. now f_equal. Qed.
Fixpoint prove_all (ms : list multiplier) (proves : multiplier -> proof -> bool) (ps : list proof) : bool :=
  match ms, ps with [], [] => true | m :: ms, p :: ps => proves m p && prove_all ms proves ps | _, _ => false end.
Definition proves_class (d : design) (rs : list ridge) (ps : list proof) : bool :=
  forallb (sized_column (nf d)) rs &&
  prove_all (inequalities d) (fun m p => proves (nq d) (nf d) m (start (nq d) (nf d)) rs p) ps.
Lemma prove_all_in ms ok : forall ps, prove_all ms ok ps = true -> forall m, In m ms -> exists p, ok m p = true.
Proof. induction ms as [|m' ms IH]; intros [|p ps] K m; try discriminate K; [intros []|].
 cbn [prove_all] in K. apply andb_true_iff in K. destruct K as [K1 K2]. intros [<-|In_ms]; [eauto|].
 now apply (IH ps). Qed.

Theorem member {time : Type} d (f : time -> list R -> list R) rs phis inner ps : proves_class d rs ps = true ->
  secants_of rs phis ->
  (forall q, length q = nq d -> arguments rs q = inner q) ->
  (forall t q, length q = nq d -> f t q = vaddR (zeros (nf d)) (mixed rs (values phis (inner q)))) ->
  of_class d f.
Proof. intros K S I F. apply of_inequalities. intros t a b m La Lb Hm. unfold proves_class in K.
  apply andb_true_iff in K. destruct K as [K1 K2].
 destruct (prove_all_in _ _ _ K2 m Hm) as (p & Kp). rewrite !F, <- !I, sub_add, zeros_sub by assumption.
 destruct (quotients rs phis S a b) as (ks & W & ->). rewrite <- (start_zeros (nq d) (nf d) (vsubR a b)).
 apply (proved_sigma (nq d) (nf d) m (vsubR a b)) with (p := p); auto.
 - rewrite vsub_length; congruence.
 - rewrite start_zeros. apply repeat_length. Qed.

(* The last two premises, where q is written out *)
Ltac written_out K :=
  match type of K with length ?q = _ =>
    cbn in K; repeat (destruct q as [|? q]; [discriminate K|]); destruct q; [|discriminate K]; clear K end.
Ltac read_off := unfold arguments, dotQ, Q2R; cbn; repeat (apply f_equal2; [lra|]); reflexivity.
