(* obsdesign: Matrices in rationals that are made of others: products, sums, and blocks beside and above each other. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Obs Require Import ObsForm ObsDesign ObsHull ObsPlant.
Import ListNotations.
Open Scope R_scope.

Definition add_q (a b : Q) := Qred (a + b).
Definition mul_q (a b : Q) := Qred (a * b).
Fixpoint row_times (r : list Q) (N : list (list Q)) : list Q :=
  match r, N with a :: r, b :: N => vadd Q add_q (scale Q mul_q a b) (row_times r N) | _, _ => [] end.
Definition product (M N : list (list Q)) : list (list Q) := map (fun r => row_times r N) M.
Definition sum (M N : list (list Q)) : list (list Q) := vadd (list Q) (vadd Q add_q) M N.
(* [M, N] where M has k columns: its rows are filled up with zeros, or cut; missing rows are zero *)
Fixpoint padded (k : nat) (r : list Q) : list Q :=
  match k, r with O, _ => [] | S k, [] => 0%Q :: padded k [] | S k, a :: r => a :: padded k r end.
Fixpoint beside (k : nat) (M N : list (list Q)) : list (list Q) :=
  match M, N with
  | r :: M, s :: N => (padded k r ++ s) :: beside k M N
  | r :: M, [] => padded k r :: beside k M []
  | [], N => map (app (padded k [])) N
  end.
(* The columns, or the components, that a mask has *)
Fixpoint picked {T : Type} (mask : list bool) (x : list T) : list T :=
  match mask, x with b :: mask, a :: x => if b then a :: picked mask x else picked mask x | _, _ => [] end.
Definition columns (mask : list bool) (M : list (list Q)) : list (list Q) := map (picked mask) M.
Fixpoint only (mask : list bool) (r : list Q) : bool :=
  match r with [] => true | a :: r => (hd false mask || Qeq_bool a 0) && only (tl mask) r end.
Definition ones (mask : list bool) : nat := length (filter (fun b => b) mask).

Lemma add_R u : forall w, map Q2R (vadd Q add_q u w) = vaddR (map Q2R u) (map Q2R w).
Proof. induction u; intros w; simpl; auto. destruct w; simpl; auto. f_equal; auto.
 unfold add_q. rewrite <- Q2R_plus. apply Qeq_eqR, Qred_correct. Qed.
Lemma scale_R a u : map Q2R (scale Q mul_q a u) = scaleR (Q2R a) (map Q2R u).
Proof. unfold scale. rewrite !map_map. apply map_ext. intros b.
 unfold mul_q. rewrite <- Q2R_mult. apply Qeq_eqR, Qred_correct. Qed.
Lemma by_rows M x : M ** x = map (fun r => dotR (map Q2R r) x) M.
Proof. unfold mv, rmat. apply map_map. Qed.
Lemma product_R M N x : product M N ** x = M ** (N ** x).
Proof. rewrite (by_rows M), by_rows. unfold product. rewrite map_map. apply map_ext. intros r.
 revert N. induction r as [|a r IH]; intros N; [reflexivity|]. destruct N as [|b N]; [now rewrite dot_nil_r|].
 cbn [row_times map]. rewrite add_R, scale_R, dot_add_l, dot_scale_l, IH. reflexivity. Qed.
Lemma sum_R M : forall N x, sum M N ** x = M ** x ++++ N ** x.
Proof. unfold sum. induction M as [|r M IH]; intros N x; [reflexivity|]. destruct N as [|s N]; [reflexivity|].
 cbn [vadd mv rmat map]. unfold mv, rmat in IH. rewrite add_R, dot_add_l, IH. reflexivity. Qed.

Lemma app_R (M N : list (list Q)) x : (M ++ N) ** x = (M ** x) ++ (N ** x).
Proof. unfold mv, rmat. now rewrite !map_app. Qed.
Lemma padded_dot y s : forall x k r, length x = k ->
  dotR (map Q2R (padded k r ++ s)) (x ++ y) = dotR (map Q2R r) x + dotR (map Q2R s) y.
Proof. induction x as [|a x IH]; intros k r L; subst k; cbn [length padded app map].
 - rewrite dot_nil_r. ring.
 - destruct r as [|b r]; cbn [app map dot]; rewrite IH by reflexivity; cbn [map dot]; [rewrite Q2R_zero|]; ring. Qed.
Lemma beside_R k x y : length x = k -> forall M N, beside k M N ** (x ++ y) = M ** x ++++ N ** y.
Proof. intros L. assert (K : forall s, dotR (map Q2R (padded k [] ++ s)) (x ++ y) = dotR (map Q2R s) y).
 { intros s. rewrite padded_dot by exact L. cbn [map dot]. ring. }
 induction M as [|r M IH]; intros N.
 - cbn [beside]. rewrite !by_rows, map_map. cbn [map vadd]. apply map_ext. exact K.
 - destruct N as [|s N]; cbn [beside]; rewrite !by_rows in *; cbn [map vadd].
   + rewrite <- (app_nil_r (padded k r)), padded_dot by exact L. rewrite <- (vadd_nil_r (map _ M)).
     specialize (IH []). rewrite !by_rows in IH. cbn [map] in IH. rewrite IH. f_equal. cbn [map dot]. ring.
   + rewrite padded_dot by exact L. f_equal. specialize (IH N). now rewrite !by_rows in IH. Qed.
Lemma below_R k x y : length x = k -> forall N, beside k [] N ** (x ++ y) = N ** y.
Proof. intros L N. now rewrite beside_R. Qed.
Lemma product_length M N : length (product M N) = length M. Proof. unfold product. apply map_length. Qed.
Lemma beside_length k : forall M N, length (beside k M N) = Nat.max (length M) (length N).
Proof. induction M as [|r M IH]; intros N; [cbn [beside length]; now rewrite map_length|].
 destruct N as [|s N]; cbn [beside length]; rewrite IH; cbn [length]; lia. Qed.
Lemma app_add (a b c e : list R) : length a = length c -> (a ++ b) ++++ (c ++ e) = (a ++++ c) ++ (b ++++ e).
Proof. revert c. induction a as [|u a IH]; intros [|w c] L; try discriminate L; [reflexivity|]. cbn [app vadd].
 f_equal. apply IH. now injection L. Qed.
Lemma add_zeros k : forall a, length a = k -> a ++++ repeat 0 k = a.
Proof. induction k as [|k IH]; intros [|u a] L; try discriminate L; [reflexivity|]. cbn [repeat vadd].
 rewrite IH by (now injection L). f_equal. ring. Qed.
Lemma times_nil M : M ** [] = repeat 0 (length M).
Proof. rewrite by_rows. induction M as [|r M IH]; [reflexivity|]. cbn [map repeat length]. now rewrite dot_nil_r, IH.
 Qed.
Lemma picked_length {T : Type} mask : forall x : list T, length x = length mask -> length (picked mask x) = ones mask.
Proof. induction mask as [|b mask IH]; intros [|a x] L; try discriminate L; [reflexivity|]. injection L as L.
 unfold ones in *. cbn [picked filter]. destruct b; cbn [length]; now rewrite IH. Qed.
Lemma picked_dot mask : forall r x, only mask r = true ->
  dotR (map Q2R (picked mask r)) (picked mask x) = dotR (map Q2R r) x.
Proof. induction mask as [|b mask IH]; intros r x K.
 - cbn [picked map dot]. symmetry. apply zero_dot. unfold zero. revert K. induction r as [|a r IH]; [reflexivity|].
   cbn [only forallb hd tl orb]. rewrite !andb_true_iff. intros [K1 K2]. auto.
 - destruct r as [|a r]; [cbn [picked map dot]; reflexivity|]. cbn [only hd tl] in K.
   rewrite andb_true_iff, orb_true_iff in K. destruct K as [K1 K2]. destruct x as [|u x].
   + cbn [picked]. now rewrite !dot_nil_r.
   + destruct b; cbn [picked map dot]; rewrite (IH r x K2); [reflexivity|]. destruct K1 as [K1|K1]; [discriminate K1|].
     rewrite (Qzero_R _ K1). ring. Qed.
Lemma columns_R mask M x : forallb (only mask) M = true -> columns mask M ** picked mask x = M ** x.
Proof. intros K. rewrite (by_rows M), by_rows. unfold columns. rewrite map_map. apply map_ext_in. intros r Hr.
 rewrite forallb_forall in K. apply picked_dot. now apply K. Qed.
Lemma silent_R M x : forallb zero M = true -> M ** x = repeat 0 (length M).
Proof. rewrite by_rows. induction M as [|r M IH]; intros K; [reflexivity|]. cbn [forallb] in K.
 rewrite andb_true_iff in K. destruct K as [K1 K2]. cbn [map length repeat]. now rewrite (zero_dot _ _ K1), (IH K2).
 Qed.
(* Sums of vectors of one length *)
Ltac sizes_agree := repeat match goal with
  | |- context [length (vaddR ?u ?w)] => rewrite (vadd_length u w); [|sizes_agree]
  | |- context [length (vsubR ?u ?w)] => rewrite (vsub_length u w); [|sizes_agree]
  end; rewrite ?mv_length, ?app_length, ?beside_length, ?product_length, ?repeat_length; cbn [length]; lia.
