(* obsdesign: Quadratic forms given by programs over rational matrices, and the proof of their sign by a congruence
   with an integer triangular matrix and diagonal dominance. Vectors are lists that are read as sequences
   with zeros behind their end; so the laws of linear algebra hold without hypotheses on lengths. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
Import ListNotations.

Section Vectors.
Variables (T : Type) (zero : T) (add mul : T -> T -> T).
Fixpoint dot (x y : list T) : T := match x, y with a :: x', b :: y' => add (mul a b) (dot x' y') | _, _ => zero end.
Fixpoint vadd (x y : list T) : list T :=
  match x, y with nil, _ => y | _, nil => x | a :: x', b :: y' => add a b :: vadd x' y' end.
Definition scale (c : T) (x : list T) : list T := map (mul c) x.
Definition mv (M : list (list T)) (x : list T) : list T := map (fun r => dot r x) M.
End Vectors.

Notation dotR := (dot R 0%R Rplus Rmult).
Notation vaddR := (vadd R Rplus).
Notation scaleR := (scale R Rmult).
Notation mvR := (mv R 0%R Rplus Rmult).
Notation dotZ := (dot Z 0%Z Z.add Z.mul).
Notation vaddZ := (vadd Z Z.add).
Notation scaleZ := (scale Z Z.mul).
Notation mvZ := (mv Z 0%Z Z.add Z.mul).
Definition vsubR (x y : list R) := vaddR x (scaleR (-1)%R y).
Definition rmat (M : list (list Q)) : list (list R) := map (map Q2R) M.

Open Scope R_scope.
Lemma dot_nil_r x : dotR x [] = 0. Proof. destruct x; reflexivity. Qed.
Lemma vadd_nil_r x : vaddR x [] = x. Proof. destruct x; reflexivity. Qed.
Lemma dot_comm x : forall y, dotR x y = dotR y x.
Proof. induction x; destruct y; simpl; auto. rewrite IHx; ring. Qed.
Lemma dot_add_l x : forall y z, dotR (vaddR x y) z = dotR x z + dotR y z.
Proof. induction x; intros y z; simpl; [ring|]. destruct y; simpl.
 - destruct z; simpl; ring.
 - destruct z; simpl; [ring|]. rewrite IHx. ring. Qed.
Lemma dot_scale_l c x : forall z, dotR (scaleR c x) z = c * dotR x z.
Proof. induction x; intros z; simpl; [ring|]. destruct z; simpl; [ring|]. unfold scale in IHx. rewrite IHx. ring. Qed.
Lemma dot_add_r x y z : dotR z (vaddR x y) = dotR z x + dotR z y.
Proof. rewrite !(dot_comm z). apply dot_add_l. Qed.
Lemma dot_scale_r c x z : dotR z (scaleR c x) = c * dotR z x.
Proof. rewrite !(dot_comm z). apply dot_scale_l. Qed.
Lemma mv_add M x y : mvR M (vaddR x y) = vaddR (mvR M x) (mvR M y).
Proof. unfold mv. induction M; simpl; auto. rewrite IHM, dot_add_r. reflexivity. Qed.
Lemma mv_scale M c x : mvR M (scaleR c x) = scaleR c (mvR M x).
Proof. unfold mv. induction M; simpl; auto. rewrite IHM. f_equal. apply dot_scale_r. Qed.
Lemma vadd_comm x : forall y, vaddR x y = vaddR y x.
Proof. induction x; destruct y; simpl; auto. f_equal; [ring|auto]. Qed.
Lemma vadd_assoc x : forall y z, vaddR x (vaddR y z) = vaddR (vaddR x y) z.
Proof. induction x; intros y z; simpl; auto. destruct y; simpl; auto. destruct z; simpl; auto. f_equal; [ring|auto].
 Qed.
Lemma vadd_swap a b c d : vaddR (vaddR a b) (vaddR c d) = vaddR (vaddR a c) (vaddR b d).
Proof. rewrite <- !vadd_assoc. f_equal. rewrite !vadd_assoc. f_equal. apply vadd_comm. Qed.
Lemma scale_add c x : forall y, scaleR c (vaddR x y) = vaddR (scaleR c x) (scaleR c y).
Proof. induction x; intros y; simpl; auto. destruct y; simpl; auto. f_equal; [ring|apply IHx]. Qed.
Lemma scale_scale c d x : scaleR c (scaleR d x) = scaleR (c * d) x.
Proof. unfold scale. rewrite map_map. apply map_ext. intros; ring. Qed.
Lemma skipn_add k : forall x y, skipn k (vaddR x y) = vaddR (skipn k x) (skipn k y).
Proof. induction k; intros x y; simpl; auto. destruct x; simpl; auto. destruct y; simpl; auto.
 now rewrite vadd_nil_r. Qed.
Lemma firstn_add k : forall x y, firstn k (vaddR x y) = vaddR (firstn k x) (firstn k y).
Proof. induction k; intros x y; simpl; auto. destruct x; simpl; auto. destruct y; simpl; auto. f_equal; auto. Qed.
Lemma scale_length c x : length (scaleR c x) = length x. Proof. apply map_length. Qed.
Lemma vadd_length x : forall y, length y = length x -> length (vaddR x y) = length x.
Proof. induction x; intros y H; simpl; [exact H|]. destruct y; simpl in *; [lia|]. rewrite IHx; lia. Qed.

(* Programs for linear maps *)
Inductive lin :=
| Part (from len : nat)
| Mul (M : list (list Q)) (l : lin)
| Add (a b : lin)
| Sub (a b : lin).
Fixpoint eval (l : lin) (x : list R) : list R :=
  match l with
  | Part k n => firstn n (skipn k x)
  | Mul M l => mvR (rmat M) (eval l x)
  | Add a b => vaddR (eval a x) (eval b x)
  | Sub a b => vsubR (eval a x) (eval b x)
  end.
Lemma eval_add l x y : eval l (vaddR x y) = vaddR (eval l x) (eval l y).
Proof. induction l; cbn [eval].
 - now rewrite skipn_add, firstn_add.
 - now rewrite IHl, mv_add.
 - rewrite IHl1, IHl2. apply vadd_swap.
 - rewrite IHl1, IHl2. unfold vsubR. rewrite scale_add. apply vadd_swap. Qed.
Lemma eval_scale l c x : eval l (scaleR c x) = scaleR c (eval l x).
Proof. induction l; cbn [eval].
 - unfold scale. now rewrite skipn_map, firstn_map.
 - now rewrite IHl, mv_scale.
 - now rewrite IHl1, IHl2, scale_add.
 - rewrite IHl1, IHl2. unfold vsubR. rewrite scale_add, !scale_scale. do 2 f_equal. ring. Qed.

Definition term := (Q * lin * lin)%type.
Definition bil1 (t : term) x y := let '(c, u, w) := t in Q2R c * dotR (eval u x) (eval w y).
Fixpoint bil (F : list term) x y := match F with nil => 0 | t :: F => bil1 t x y + bil F x y end.
Definition quad F x := bil F x x.
Lemma bil_add_l F x y z : bil F (vaddR x y) z = bil F x z + bil F y z.
Proof. induction F as [|[[c u] w] F IH]; simpl; [ring|]. rewrite IH, eval_add, dot_add_l. ring. Qed.
Lemma bil_add_r F x y z : bil F z (vaddR x y) = bil F z x + bil F z y.
Proof. induction F as [|[[c u] w] F IH]; simpl; [ring|]. rewrite IH, eval_add, dot_add_r. ring. Qed.
Lemma bil_scale_l F c x z : bil F (scaleR c x) z = c * bil F x z.
Proof. induction F as [|[[d u] w] F IH]; simpl; [ring|]. rewrite IH, eval_scale, dot_scale_l. ring. Qed.
Lemma bil_scale_r F c x z : bil F z (scaleR c x) = c * bil F z x.
Proof. induction F as [|[[d u] w] F IH]; simpl; [ring|]. rewrite IH, eval_scale, dot_scale_r. ring. Qed.
Lemma eval_nil l : dotR (eval l []) (eval l []) = 0.
Proof. assert (H := eval_scale l 0 []). simpl in H. rewrite H, dot_scale_l. ring. Qed.
Lemma bil_nil_l F y : bil F [] y = 0.
Proof. assert (H := bil_scale_l F 0 [] y). simpl in H. rewrite H. ring. Qed.
Lemma bil_nil_r F y : bil F y [] = 0.
Proof. assert (H := bil_scale_r F 0 [] y). simpl in H. rewrite H. ring. Qed.

(* The same programs over integers, with a denominator *)
Inductive linZ :=
| PartZ (from len : nat)
| MulZ (M : list (list Z)) (l : linZ)
| CombZ (ca : Z) (a : linZ) (cb : Z) (b : linZ).
Fixpoint evalZ (l : linZ) (x : list Z) : list Z :=
  match l with
  | PartZ k n => firstn n (skipn k x)
  | MulZ M l => let x := evalZ l x in mvZ M x
  | CombZ ca a cb b => vaddZ (scaleZ ca (evalZ a x)) (scaleZ cb (evalZ b x))
  end.
Open Scope Z_scope.
Definition lcm_row (d : Z) (r : list Q) := fold_right (fun q d => Z.lcm (QDen q) d) d r.
Definition lcm_mat (M : list (list Q)) := fold_right (fun r d => lcm_row d r) 1 M.
Definition numer (d : Z) (q : Q) := Qnum q * (d / QDen q).
Fixpoint compile (l : lin) : linZ * Z :=
  match l with
  | Part k n => (PartZ k n, 1)
  | Mul M l => let '(lz, d) := compile l in let dm := lcm_mat M in (MulZ (map (map (numer dm)) M) lz, dm * d)
  | Add a b => let '(az, da) := compile a in let '(bz, db) := compile b in let d := Z.lcm da db in
      (CombZ (d / da) az (d / db) bz, d)
  | Sub a b => let '(az, da) := compile a in let '(bz, db) := compile b in let d := Z.lcm da db in
      (CombZ (d / da) az (- (d / db)) bz, d)
  end.
Lemma lcm_pos a b : 0 < a -> 0 < b -> 0 < Z.lcm a b.
Proof. intros. assert (0 <= Z.lcm a b) by apply Z.lcm_nonneg. assert (Z.lcm a b <> 0); [|lia]. rewrite Z.lcm_eq_0.
 lia. Qed.
Lemma div_mul d a : 0 < a -> (a | d) -> d / a * a = d.
Proof. intros Ha [k ->]. rewrite Z.div_mul; lia. Qed.
Lemma lcm_row_spec r : forall d, 0 < d -> 0 < lcm_row d r /\ (d | lcm_row d r) /\
   Forall (fun q => (QDen q | lcm_row d r)) r.
Proof. induction r as [|q r IH]; intros d Hd; simpl.
 - repeat split; auto. apply Z.divide_refl.
 - destruct (IH d Hd) as (P & D & F). repeat split.
   + apply lcm_pos; auto. lia.
   + eapply Z.divide_trans; [exact D|apply Z.divide_lcm_r].
   + constructor; [apply Z.divide_lcm_l|]. eapply Forall_impl; [|exact F]. intros a Ha. simpl in Ha.
     eapply Z.divide_trans; [exact Ha|apply Z.divide_lcm_r]. Qed.
Lemma lcm_mat_spec M : 0 < lcm_mat M /\ Forall (Forall (fun q => (QDen q | lcm_mat M))) M.
Proof. induction M as [|r M [P F]]; simpl; [split; [lia|constructor]|].
 destruct (lcm_row_spec r _ P) as (P' & D' & F'). split; auto. constructor; auto.
 eapply Forall_impl; [|exact F]. intros a. apply Forall_impl. intros b Hb.
 eapply Z.divide_trans; [exact Hb|exact D']. Qed.
Open Scope R_scope.
Lemma numer_spec d q : (0 < d)%Z -> (QDen q | d)%Z -> IZR (numer d q) = IZR d * Q2R q.
Proof. intros Hd Hq. unfold numer, Q2R. rewrite mult_IZR.
 assert (E := div_mul d (QDen q) ltac:(lia) Hq). apply (f_equal IZR) in E. rewrite mult_IZR in E.
 assert (IZR (QDen q) <> 0) by (apply not_0_IZR; lia). rewrite <- E. field. exact H. Qed.
Lemma dot_IZR x : forall y, dotR (map IZR x) (map IZR y) = IZR (dotZ x y).
Proof. induction x; destruct y; simpl; auto. rewrite IHx, plus_IZR, mult_IZR. reflexivity. Qed.
Lemma vadd_IZR x : forall y, map IZR (vaddZ x y) = vaddR (map IZR x) (map IZR y).
Proof. induction x; destruct y; simpl; auto. rewrite plus_IZR, IHx. reflexivity. Qed.
Lemma scale_IZR c x : map IZR (scaleZ c x) = scaleR (IZR c) (map IZR x).
Proof. unfold scale. rewrite !map_map. apply map_ext. intros; apply mult_IZR. Qed.
Lemma mv_IZR M x : map IZR (mvZ M x) = mvR (map (map IZR) M) (map IZR x).
Proof. unfold mv. rewrite !map_map. apply map_ext. intros; symmetry; apply dot_IZR. Qed.
Lemma mv_mult d M x : mvR (map (map (fun q => d * Q2R q)) M) x = scaleR d (mvR (rmat M) x).
Proof. unfold mv, scale, rmat. rewrite !map_map. apply map_ext. intros r. rewrite <- dot_scale_l. f_equal.
 unfold scale. now rewrite map_map. Qed.
Lemma compile_spec l : (0 < snd (compile l))%Z /\
  forall x, map IZR (evalZ (fst (compile l)) x) = scaleR (IZR (snd (compile l))) (eval l (map IZR x)).
Proof.
 assert (L : forall da d c, (0 < da)%Z -> (da | d)%Z -> c = (d / da)%Z -> IZR c * IZR da = IZR d).
 { intros da d c H D ->. rewrite <- mult_IZR. f_equal. now apply div_mul. }
 induction l as [k n|M l IH|a IHa b IHb|a IHa b IHb]; cbn [compile].
 - split; [simpl; lia|]. intros x. cbn. rewrite skipn_map, firstn_map. unfold scale. rewrite map_map. apply map_ext.
   intros; ring.
 - destruct (compile l) as [lz d]. simpl in IH. destruct IH as [P H]. simpl. destruct (lcm_mat_spec M) as [PM FM].
   split; [lia|].
   intros x. rewrite mv_IZR, H, mv_scale, mult_IZR.
   assert (E : map (map IZR) (map (map (numer (lcm_mat M))) M) = map (map (fun q => IZR (lcm_mat M) * Q2R q)) M).
   { rewrite map_map. apply map_ext_in. intros r Hr. rewrite map_map. apply map_ext_in. intros q Hq.
   apply numer_spec; auto.
     rewrite Forall_forall in FM. specialize (FM r Hr). rewrite Forall_forall in FM. auto. }
   rewrite E, mv_mult, scale_scale. f_equal. ring.
 - destruct (compile a) as [az da], (compile b) as [bz db]. simpl in IHa, IHb.
   destruct IHa as [Pa Ha], IHb as [Pb Hb]. simpl.
   split; [now apply lcm_pos|]. intros x. rewrite vadd_IZR, !scale_IZR, Ha, Hb, !scale_scale, scale_add.
   rewrite (L da (Z.lcm da db)), (L db (Z.lcm da db)); auto using Z.divide_lcm_l, Z.divide_lcm_r.
 - destruct (compile a) as [az da], (compile b) as [bz db]. simpl in IHa, IHb.
   destruct IHa as [Pa Ha], IHb as [Pb Hb]. simpl.
   split; [now apply lcm_pos|]. intros x. unfold vsubR.
   rewrite vadd_IZR, !scale_IZR, Ha, Hb, !scale_scale, scale_add, opp_IZR, scale_scale.
   rewrite (L da (Z.lcm da db)); auto using Z.divide_lcm_l. f_equal. f_equal.
   rewrite <- (L db (Z.lcm da db) _ Pb (Z.divide_lcm_r _ _) eq_refl). ring. Qed.

Definition termZ := (Z * linZ * linZ)%type.
Definition den1 (t : term) : Z := let '(c, u, w) := t in (QDen c * (snd (compile u) * snd (compile w)))%Z.
Definition den (F : list term) : Z := fold_right (fun t d => Z.lcm (den1 t) d) 1%Z F.
Definition compile1 (d : Z) (t : term) : termZ :=
  let '(c, u, w) := t in ((Qnum c * (d / den1 t))%Z, fst (compile u), fst (compile w)).
Definition bilZ1 (t : termZ) x y := let '(c, u, w) := t in (c * dotZ (evalZ u x) (evalZ w y))%Z.
Fixpoint bilZ (F : list termZ) x y : Z := match F with nil => 0%Z | t :: F => (bilZ1 t x y + bilZ F x y)%Z end.
Lemma den1_pos t : (0 < den1 t)%Z.
Proof. destruct t as [[c u] w]. unfold den1. destruct (compile_spec u), (compile_spec w).
 apply Z.mul_pos_pos; [lia|]. now apply Z.mul_pos_pos. Qed.
Lemma compile1_spec d t x y : (0 < d)%Z -> (den1 t | d)%Z ->
  IZR (bilZ1 (compile1 d t) x y) = IZR d * bil1 t (map IZR x) (map IZR y).
Proof. intros Hd H. assert (P := den1_pos t). assert (E := div_mul d _ P H). destruct t as [[c u] w].
 cbn [compile1 bilZ1 bil1].
 destruct (compile_spec u) as [Pu Hu], (compile_spec w) as [Pw Hw].
 rewrite !mult_IZR, <- dot_IZR, Hu, Hw, dot_scale_l, dot_scale_r. unfold den1 in *.
 set (k := (d / _)%Z) in *. apply (f_equal IZR) in E. rewrite !mult_IZR in E. rewrite <- E.
 unfold Q2R. assert (IZR (QDen c) <> 0) by (apply not_0_IZR; lia). field. exact H0. Qed.
Lemma den_spec F : (0 < den F)%Z /\ Forall (fun t => (den1 t | den F)%Z) F.
Proof. induction F as [|t F [P H]]; simpl; [split; [lia|constructor]|]. split; [apply lcm_pos; auto using den1_pos|].
 constructor; [apply Z.divide_lcm_l|]. eapply Forall_impl; [|exact H]. intros a Ha.
 eapply Z.divide_trans; [exact Ha|apply Z.divide_lcm_r]. Qed.

(* Columns: what a vector gives under the two programs of each term; the coefficient is multiplied into the first. *)
Definition column (F : list termZ) (x : list Z) : list (list Z * list Z) :=
  map (fun t => let '(c, u, w) := t in (scaleZ c (evalZ u x), evalZ w x)) F.
Fixpoint pair (a b : list (list Z * list Z)) : Z :=
  match a, b with (u, _) :: a, (_, w) :: b => (dotZ u w + pair a b)%Z | _, _ => 0%Z end.
Lemma dotZ_scale c x : forall y, dotZ (scaleZ c x) y = (c * dotZ x y)%Z.
Proof. unfold scale. induction x; intros y; simpl; [ring|]. destruct y; simpl; [ring|]. rewrite IHx. ring. Qed.
Lemma pair_spec F x y : pair (column F x) (column F y) = bilZ F x y.
Proof. unfold column. induction F as [|[[c u] w] F IH]; [reflexivity|]. cbn [map pair bilZ]. rewrite IH, dotZ_scale.
 reflexivity. Qed.
Lemma pair_bil F x y : IZR (pair (column (map (compile1 (den F)) F) x) (column (map (compile1 (den F)) F) y))
  = IZR (den F) * bil F (map IZR x) (map IZR y).
Proof. rewrite pair_spec. destruct (den_spec F) as [P H]. revert P H. generalize (den F). intros d P.
 induction F as [|t F IH]; intros H; simpl; [ring|]. inversion H; subst. rewrite plus_IZR, IH, compile1_spec; auto.
 ring. Qed.

(* Dominance: `debit` is what the diagonal owes *)
Definition vabs (r : list Z) := map Z.abs r.
Definition total (r : list Z) := fold_right Z.add 0%Z r.
Fixpoint dominant (debit : list Z) (cols : list (list (list Z * list Z))) : bool :=
  match cols with
  | nil => true
  | c :: cs => let r := map (fun c' => (pair c c' + pair c' c)%Z) cs in let a := vabs r in
     ((total a + hd 0 debit) <=? 2 * pair c c)%Z && dominant (vaddZ (tl debit) a) cs
  end.
Fixpoint comb (y : list R) (X : list (list R)) : list R :=
  match y, X with a :: y, x :: X => vaddR (scaleR a x) (comb y X) | _, _ => [] end.
Definition squares (y : list R) := map (fun a => a * a) y.
Lemma young (y r s : R) : - Rabs r * (y * y) <= 2 * (y * (r * s)) + Rabs r * (s * s).
Proof. assert (0 <= (y - s) * (y - s)) by apply Rle_0_sqr. assert (0 <= (y + s) * (y + s)) by apply Rle_0_sqr.
 unfold Rabs; destruct (Rcase_abs r); nra. Qed.
Lemma young_row y : forall r s, length s = length r ->
  - IZR (total (vabs r)) * (y * y) <= 2 * (y * dotR s (map IZR r)) + dotR (map IZR (vabs r)) (squares s).
Proof. induction r; intros s H; destruct s; simpl in *; try lia; try lra.
 rewrite plus_IZR, abs_IZR. specialize (IHr s ltac:(lia)). assert (Y := young y (IZR a) r0). unfold vabs in *. nra. Qed.
Lemma row_spec F c (x : list R) : forall cs X y, Forall2 (fun k v => IZR (pair c k + pair k c) = IZR (den F) * (bil F
   x v + bil F v x)) cs X ->
  length y = length X ->
  IZR (den F) * (bil F x (comb y X) + bil F (comb y X) x) = dotR y (map IZR (map (fun k => (pair c k + pair k c)%Z)
    cs)).
Proof. intros cs X y H. revert y. induction H; intros z Hl; destruct z; simpl in *; try lia.
 - rewrite bil_nil_l, bil_nil_r. ring.
 - rewrite bil_add_l, bil_add_r, bil_scale_l, bil_scale_r, H, <- (IHForall2 z) by lia. ring. Qed.
Lemma dominant_spec F : forall X debit y, let col := column (map (compile1 (den F)) F) in
  dominant debit (map col X) = true -> length y = length X ->
  dotR (map IZR debit) (squares y) <= 2 * IZR (den F) * quad F (comb y (map (map IZR) X)).
Proof. intros X debit y col. revert debit y. induction X as [|x X IH]; intros debit y H Hl; destruct y;
   try (simpl in Hl; lia); cbn [map dominant comb squares] in *; simpl in Hl.
 - rewrite dot_nil_r. unfold quad. rewrite bil_nil_l. lra.
 - apply andb_true_iff in H. destruct H as [H1 H2]. apply Z.leb_le, IZR_le in H1. rewrite plus_IZR, mult_IZR in H1.
   specialize (IH _ y H2 ltac:(lia)).
   set (rr := map (fun c' => (pair (col x) c' + pair c' (col x))%Z) (map col X)) in *.
   rewrite vadd_IZR, dot_add_l in IH.
   assert (Y := young_row r rr y ltac:(unfold rr; rewrite !map_length; lia)).
   assert (E : IZR (den F) * (bil F (map IZR x) (comb y (map (map IZR) X)) + bil F (comb y (map (map IZR) X)) (map
     IZR x)) = dotR y (map IZR rr)).
   { apply row_spec; [|rewrite map_length; lia]. clear. induction X; simpl; constructor; auto.
     rewrite plus_IZR. unfold col. rewrite !pair_bil. ring. }
   unfold quad in *. rewrite bil_add_l, !bil_add_r, !bil_scale_l, !bil_scale_r.
   set (q := bil F (map IZR x) (map IZR x)). assert (Q : IZR (pair (col x) (col x)) = IZR (den F) * q) by
     apply pair_bil.
   rewrite Q in H1. set (cy := comb y _) in *.
   assert (D : dotR (map IZR debit) (r * r :: squares y) = IZR (hd 0%Z debit) * (r * r) + dotR (map IZR (tl debit))
     (squares y)).
   { destruct debit; simpl; ring. }
   change (map (fun a => a * a) y) with (squares y). rewrite D.
   replace (2 * IZR (den F) * (r * (r * q) + r * bil F (map IZR x) cy + (r * bil F cy (map IZR x) + bil F cy cy)))
     with (2 * (IZR (den F) * q) * (r * r) + 2 * (r * (IZR (den F) * (bil F (map IZR x) cy + bil F cy (map IZR x))))
       + 2 * IZR (den F) * bil F cy cy) by ring.
   rewrite E. assert (0 <= r * r) by apply Rle_0_sqr. nra. Qed.

(* Triangular T: row j holds what follows its j zeros *)
Fixpoint pad (rows : list (list Z)) : list (list Z) := match rows with
   nil => nil | r :: rs => r :: map (cons 0%Z) (pad rs) end.
Fixpoint triangular (rows : list (list Z)) : bool :=
  match rows with nil => true | r :: rs => (length r =? length rows)%nat && negb (hd 0 r =? 0)%Z && triangular rs end.
Lemma pad_length rows : length (pad rows) = length rows.
Proof. induction rows; simpl; auto. now rewrite map_length, IHrows. Qed.
Lemma comb_zero : forall X y, length y = length X -> X <> [] -> comb y (map (cons 0) X) = 0 :: comb y X.
Proof. induction X as [|x X IH]; intros y H N; [congruence|]. destruct y; simpl in *; [lia|].
 destruct X as [|x' X].
 - destruct y; simpl in *; [|lia]. rewrite vadd_nil_r. f_equal. ring.
 - rewrite (IH y) by (simpl in *; congruence || lia). f_equal. ring. Qed.
Lemma sub_add (y : R) : forall r x, length x = length r -> vaddR (scaleR y r) (vaddR x (scaleR (- y) r)) = x.
Proof. induction r; destruct x; simpl; intros; try lia; auto. f_equal; [ring|]. apply IHr. lia. Qed.
Lemma onto : forall rows x, triangular rows = true -> length x = length rows ->
  exists y, length y = length rows /\ comb y (map (map IZR) (pad rows)) = x.
Proof. induction rows as [|r rows IH]; intros x H Hl; [exists []; destruct x; simpl in *; auto; lia|].
 cbn [triangular] in H. apply andb_true_iff in H. destruct H as [H H3]. apply andb_true_iff in H. destruct H as [H1 H2].
 apply Nat.eqb_eq in H1. destruct r as [|t r]; [simpl in H1; lia|]. destruct x as [|x0 x]; [simpl in Hl; lia|].
 simpl in H1, H2, Hl.
 assert (Ht : IZR t <> 0). { apply not_0_IZR. intros ->. discriminate. }
 set (y0 := x0 / IZR t). set (r' := map IZR r).
 assert (Lr : length r' = length rows) by (unfold r'; rewrite map_length; lia).
 destruct (IH (vaddR x (scaleR (- y0) r')) H3) as (y & Ly & Cy).
 { rewrite vadd_length; [lia|]. rewrite scale_length. lia. }
 exists (y0 :: y). split; [simpl; lia|]. cbn [pad map comb]. rewrite !map_map.
 replace (map (fun l => map IZR (0%Z :: l)) (pad rows)) with (map (cons 0) (map (map IZR) (pad rows))) by
   (rewrite map_map; reflexivity).
 destruct rows as [|r1 rows].
 - simpl in *. destruct y; [|simpl in Ly; lia]. simpl. destruct x; [|simpl in Hl; lia].
   destruct r; [|simpl in H1; lia]. simpl. f_equal. unfold y0. field. exact Ht.
 - rewrite comb_zero; [|rewrite map_length, pad_length; exact Ly|simpl; discriminate].
   rewrite Cy. cbn [map scale vadd]. fold r'. f_equal; [unfold y0; field; exact Ht|]. apply sub_add. simpl in *. lia.
   Qed.

Definition check (strict : bool) (N : nat) (F : list term) (rows : list (list Z)) : bool :=
  (length rows =? N)%nat && triangular rows &&
  (let d := den F in let FZ := map (compile1 d) F in dominant (if strict then repeat 1%Z N else []) (map (column FZ)
    (pad rows))).
Theorem nonnegative N F rows : check false N F rows = true -> forall x, length x = N -> 0 <= quad F x.
Proof. unfold check. intros H x Hx. apply andb_true_iff in H. destruct H as [H D]. apply andb_true_iff in H.
 destruct H as [L T].
 apply Nat.eqb_eq in L. destruct (onto rows x T ltac:(lia)) as (y & Ly & <-).
 assert (S := dominant_spec F (pad rows) [] y D ltac:(rewrite pad_length; exact Ly)). cbn [map dot] in S.
 destruct (den_spec F) as [P _]. apply IZR_lt in P.
 destruct (Rle_or_lt 0 (quad F (comb y (map (map IZR) (pad rows))))) as [|B]; auto. exfalso.
 assert (0 < IZR (den F) * - quad F (comb y (map (map IZR) (pad rows)))) by (apply Rmult_lt_0_compat; lra). lra. Qed.
Lemma squares_zero : forall y, dotR (repeat 1 (length y)) (squares y) <= 0 -> Forall (fun a => a = 0) y.
Proof. unfold squares. assert (P : forall y, 0 <= dotR (repeat 1 (length y)) (map (fun a => a * a) y)).
 { induction y; cbn [repeat length map dot]; [lra|]. assert (0 <= a * a) by apply Rle_0_sqr. lra. }
 induction y as [|a y IH]; intros H; constructor; cbn [repeat length map dot] in H; specialize (P y).
 - assert (0 <= a * a) by apply Rle_0_sqr. assert (a * a = 0) by lra. apply Rsqr_0_uniq. assumption.
 - apply IH. assert (0 <= a * a) by apply Rle_0_sqr. lra. Qed.
Lemma vadd_zeros a : forall b, Forall (fun a => a = 0) a -> Forall (fun a => a = 0) b ->
   Forall (fun a => a = 0) (vaddR a b).
Proof. induction a; intros b' H K; simpl; auto. destruct b'; auto. inversion H; inversion K; subst.
 constructor; [ring|auto]. Qed.
Lemma comb_zeros : forall y X, Forall (fun a => a = 0) y -> Forall (fun a => a = 0) (comb y X).
Proof. induction y; intros X H; destruct X; simpl; try constructor. inversion H; subst. apply vadd_zeros; auto.
 clear. induction l; simpl; constructor; auto. ring. Qed.
Theorem positive N F rows : check true N F rows = true -> forall x, length x = N -> ~ Forall (fun a => a = 0) x ->
   0 < quad F x.
Proof. unfold check. intros H x Hx Nz. apply andb_true_iff in H. destruct H as [H D]. apply andb_true_iff in H.
 destruct H as [L T].
 apply Nat.eqb_eq in L. destruct (onto rows x T ltac:(lia)) as (y & Ly & E).
 assert (S := dominant_spec F (pad rows) _ y D ltac:(rewrite pad_length; exact Ly)).
 replace (map IZR (if true then repeat 1%Z N else [])) with (repeat 1 (length y)) in S by (rewrite Ly, L; clear;
   induction N; simpl in *; congruence).
 rewrite E in S. destruct (den_spec F) as [P _]. apply IZR_lt in P.
 destruct (Rlt_or_le 0 (quad F x)) as [|B]; auto. exfalso. apply Nz. rewrite <- E. apply comb_zeros.
 apply squares_zero. assert (0 <= IZR (den F) * - quad F x) by (apply Rmult_le_pos; lra). lra. Qed.
