(* obsdesign: Plant and observer with one and the same nonlinearity: their difference obeys the error equations. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign ObsHull ObsTrajectory.
Import ListNotations.
Open Scope R_scope.

Definition sized (d : design) : bool :=
  let l (M : list (list Q)) k := (length M =? k)%nat in
  l (A d) (n d) && l (Bf d) (n d) && l (B d) (n d) && l (L1 d) (n d) && l (C d) (ny d) && l (Df d) (ny d) &&
    l (D d) (ny d) &&
  l (Cq d) (nq d) && l (Dqf d) (nq d) && l (Dq d) (nq d) && l (L2 d) (nq d).
Lemma nth_vadd x : forall y i, nth i (vaddR x y) 0 = nth i x 0 + nth i y 0.
Proof. induction x; intros y i; simpl; [destruct i; ring|]. destruct y; simpl; destruct i; try ring; auto. Qed.
Lemma nth_scale c x : forall i, nth i (scaleR c x) 0 = c * nth i x 0.
Proof. induction x; intros i; simpl; [destruct i; ring|]. destruct i; auto. Qed.
Lemma vsub_length x y : length y = length x -> length (vsubR x y) = length x.
Proof. intros H. unfold vsubR. apply vadd_length. now rewrite scale_length. Qed.
Lemma mv_length M x : length (mvR (rmat M) x) = length M.
Proof. unfold mv, rmat. now rewrite !map_length. Qed.
Lemma mv_sub M x y : mvR M (vsubR x y) = vsubR (mvR M x) (mvR M y).
Proof. unfold vsubR. now rewrite mv_add, mv_scale. Qed.
Definition diff (xs ys : list (R -> R)) : list (R -> R) := map (fun p t => fst p t - snd p t) (combine xs ys).
Lemma at_diff xs : forall ys t, length ys = length xs -> at_ (diff xs ys) t = vsubR (at_ xs t) (at_ ys t).
Proof. induction xs; intros ys t H; destruct ys; simpl in *; try lia; auto. unfold vsubR, diff, at_ in *.
 cbn [map combine vadd scale fst snd]. f_equal; [ring|]. apply IHxs. lia. Qed.
Lemma diff_moves xs t dx : moves xs t dx -> forall ys dy, moves ys t dy -> length ys = length xs ->
   moves (diff xs ys) t (vsubR dx dy).
Proof. intros H. induction H as [|g a xs dx H Hs IH]; intros ys dy K L; destruct K as [|h b ys dy K Ks]; simpl in *;
   try lia; [constructor|].
 constructor.
 - replace (a + -1 * b) with (minus a b) by (unfold minus, plus, opp; simpl; ring). now apply (is_derive_minus g h).
 - apply IH; auto. Qed.

Notation "M ** u" := (mvR (rmat M) u) (at level 40).
Notation "u ++++ w" := (vaddR u w) (at level 50, left associativity).

(* f of time and q is in the class: its differences satisfy every inequality of the multipliers, and lie in the hulls,
   or satisfy their inequalities *)
Definition in_hull (h : hull) (dq df : list R) := within h dq df \/ 0 <= sigma (form_of h) dq df.
Definition of_class {time : Type} (d : design) (f : time -> list R -> list R) :=
  forall t a b, length a = nq d -> length b = nq d ->
  (forall m, In m (multipliers d) -> 0 <= sigma m (vsubR a b) (vsubR (f t a) (f t b)))
  /\ (forall h, In h (hulls d) -> in_hull h (vsubR a b) (vsubR (f t a) (f t b))).
Lemma of_inequalities {time : Type} d (f : time -> list R -> list R) :
  (forall t a b m, length a = nq d -> length b = nq d -> In m (inequalities d) ->
     0 <= sigma m (vsubR a b) (vsubR (f t a) (f t b))) -> of_class d f.
Proof. intros K t a b La Lb. unfold inequalities in K. split; [intros m Hm|intros h Hh; right]; apply K; auto;
 apply in_app_iff; [now left|right; now apply in_map]. Qed.
Lemma class_holds {time : Type} d TH (f : time -> list R -> list R) : hulls_proved d TH = true -> of_class d f ->
  forall t a b m, length a = nq d -> length b = nq d -> In m (inequalities d) ->
    0 <= sigma m (vsubR a b) (vsubR (f t a) (f t b)).
Proof. intros K C t a b m La Lb Hm. destruct (C t a b La Lb) as [S W]. unfold inequalities in Hm.
 apply in_app_iff in Hm.
 destruct Hm as [Hm|Hm]; [now apply S|]. apply in_map_iff in Hm. destruct Hm as (h & <- & Hh).
 destruct (W h Hh) as [Wh|Wh]; [|exact Wh]. apply (hulls_hold d TH); auto. rewrite vsub_length; congruence. Qed.

(* One instant: vectors only, so for continuous and discrete time *)
Section Instant.
Variable d : design.
Hypothesis siz : sized d = true.
Variables (X Xh v q qh y yh g gq gy fq fqh : list R).
Hypothesis (len_X : length X = n d) (len_Xh : length Xh = n d) (len_g : length g = n d) (len_gq : length gq = nq d)
   (len_gy : length gy = ny d).
Hypothesis plant_q : q = Cq d ** X ++++ Dqf d ** fq ++++ gq ++++ Dq d ** v.
Hypothesis plant_y : y = C d ** X ++++ Df d ** fq ++++ gy ++++ D d ** v.
Hypothesis observer_q : qh = Cq d ** Xh ++++ Dqf d ** fqh ++++ gq ++++ L2 d ** vsubR yh y.
Hypothesis observer_y : yh = C d ** Xh ++++ Df d ** fqh ++++ gy.
Lemma sizes : length (A d) = n d /\ length (Bf d) = n d /\ length (B d) = n d /\ length (L1 d) = n d /\
  length (C d) = ny d /\ length (Df d) = ny d /\ length (D d) = ny d /\
  length (Cq d) = nq d /\ length (Dqf d) = nq d /\ length (Dq d) = nq d /\ length (L2 d) = nq d.
Proof using All. unfold sized in siz. rewrite !andb_true_iff, !Nat.eqb_eq in siz. tauto. Qed.
Ltac len := repeat match goal with
  | |- context [length (vaddR ?u ?w)] => rewrite (vadd_length u w); [|len]
  | |- context [length (vsubR ?u ?w)] => rewrite (vsub_length u w); [|len]
  end; rewrite ?mv_length; lia.
Ltac pointwise := apply (nth_ext _ _ 0 0); [len|intros i Hi; unfold vsubR;
   rewrite ?mv_add, ?mv_scale, ?nth_vadd, ?nth_scale, ?mv_add, ?mv_scale, ?nth_vadd, ?nth_scale; ring].
Lemma out_error : err_out d (vsubR Xh X) (vsubR fqh fq) v = vsubR yh y.
Proof using All. destruct sizes as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?). unfold err_out.
 rewrite !mv_sub, observer_y, plant_y. pointwise. Qed.
Lemma dot_error : err_dot d (vsubR Xh X) (vsubR fqh fq) v =
  vsubR (A d ** Xh ++++ Bf d ** fqh ++++ g ++++ L1 d ** vsubR yh y) (A d ** X ++++ Bf d ** fq ++++ g ++++ B d ** v).
Proof using All. destruct sizes as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?). unfold err_dot.
 rewrite out_error, !(mv_sub _ Xh), !(mv_sub _ fqh).
 generalize (L1 d ** vsubR yh y) (mv_length (L1 d) (vsubR yh y)). intros l Hl. pointwise. Qed.
Lemma arg_error : err_arg d (vsubR Xh X) (vsubR fqh fq) v = vsubR qh q.
Proof using All. destruct sizes as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?). unfold err_arg.
 rewrite out_error, !(mv_sub _ Xh), !(mv_sub _ fqh).
 rewrite plant_q, observer_q. generalize (L2 d ** vsubR yh y) (mv_length (L2 d) (vsubR yh y)). intros l Hl.
 pointwise. Qed.
Lemma q_length : length q = nq d.
Proof using All. destruct sizes as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?). rewrite plant_q. len. Qed.
Lemma qh_length : length qh = nq d.
Proof using All. destruct sizes as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?). rewrite observer_q. len. Qed.
End Instant.

Section Plant.
Variable d : design.
Hypothesis siz : sized d = true.
Variables (T TP : list (list Z)).
Hypothesis cert : certified d T TP = true.
Variables (x xh vs : list (R -> R)) (q qh yh y g gq gy : R -> list R) (f : R -> list R -> list R).
Hypothesis (len_x : length x = n d) (len_xh : length xh = n d) (len_v : length vs = nv d).
Hypothesis len_f : forall t r, length (f t r) = nf d.
Hypothesis len_g : forall t, length (g t) = n d.
Hypothesis len_gq : forall t, length (gq t) = nq d.
Hypothesis len_gy : forall t, length (gy t) = ny d.
(* the plant *)
Hypothesis plant_x : forall t, 0 <= t -> moves x t (A d ** at_ x t ++++ Bf d ** f t (q t) ++++ g t ++++
   B d ** at_ vs t).
Hypothesis plant_q : forall t, 0 <= t -> q t = Cq d ** at_ x t ++++ Dqf d ** f t (q t) ++++ gq t ++++ Dq d ** at_ vs t.
Hypothesis plant_y : forall t, 0 <= t -> y t = C d ** at_ x t ++++ Df d ** f t (q t) ++++ gy t ++++ D d ** at_ vs t.
(* the observer *)
Hypothesis observer_x : forall t, 0 <= t -> moves xh t (A d ** at_ xh t ++++ Bf d ** f t (qh t) ++++ g t ++++
   L1 d ** vsubR (yh t) (y t)).
Hypothesis observer_q : forall t, 0 <= t -> qh t = Cq d ** at_ xh t ++++ Dqf d ** f t (qh t) ++++ gq t ++++
   L2 d ** vsubR (yh t) (y t).
Hypothesis observer_y : forall t, 0 <= t -> yh t = C d ** at_ xh t ++++ Df d ** f t (qh t) ++++ gy t.
(* the class *)
Hypothesis class : forall t a b m, length a = nq d -> length b = nq d -> In m (inequalities d) ->
   0 <= sigma m (vsubR a b) (vsubR (f t a) (f t b)).

Definition es := diff xh x.
Definition fs t := vsubR (f t (qh t)) (f t (q t)).
Lemma es_at t : at_ es t = vsubR (at_ xh t) (at_ x t).
Proof. apply at_diff. lia. Qed.
Lemma at_length (zs : list (R -> R)) t : length (at_ zs t) = length zs.
Proof. apply map_length. Qed.
Lemma es_length : length es = n d.
Proof. unfold es, diff. rewrite map_length, combine_length. lia. Qed.
Lemma fs_length t : length (fs t) = nf d.
Proof. unfold fs. rewrite vsub_length; rewrite !len_f; auto. Qed.
Lemma error t : 0 <= t -> moves es t (err_dot d (at_ es t) (fs t) (at_ vs t)).
Proof. intros Ht. rewrite es_at. unfold fs. rewrite (dot_error d siz (at_ x t) (at_ xh t) (at_ vs t) (q t) (qh t) (y
   t) (yh t) (g t) (gq t) (gy t) (f t (q t)) (f t (qh t))); auto; try (rewrite at_length; assumption).
 apply diff_moves; auto. lia. Qed.
Lemma member t : 0 <= t -> forall m, In m (inequalities d) ->
   0 <= sigma m (err_arg d (at_ es t) (fs t) (at_ vs t)) (fs t).
Proof. intros Ht m Hm. rewrite es_at. unfold fs.
 rewrite (arg_error d siz (at_ x t) (at_ xh t) (at_ vs t) (q t) (qh t) (y t) (yh t) (g t) (gq t) (gy t) (f t (q t))
   (f t (qh t))); auto; try (rewrite at_length; assumption).
 apply class; auto.
 - apply (qh_length d siz (at_ x t) (at_ xh t) (at_ vs t) (q t) (qh t) (y t) (yh t) (g t) (gq t) (gy t) (f t (q t))
     (f t (qh t))); auto; rewrite at_length; assumption.
 - apply (q_length d siz (at_ x t) (at_ xh t) (at_ vs t) (q t) (qh t) (y t) (yh t) (g t) (gq t) (gy t) (f t (q t)) (f
     t (qh t))); auto; rewrite at_length; assumption. Qed.

Let e t := vsubR (at_ xh t) (at_ x t).
Theorem plant_l2 : (forall t, 0 <= t -> steady vs t) -> forall t, 0 <= t ->
  Q2R (weight d) * RInt (fun s => sq (zed d (e s))) 0 t
  <= V d (e 0) + Q2R (supply d) * RInt (fun s => sq (at_ vs s)) 0 t.
Proof. intros Cv t Ht. assert (K := l2_bound d T TP cert es vs fs es_length len_v fs_length error member Cv t Ht).
 cbv zeta beta in K. rewrite es_at in K. erewrite RInt_ext; [exact K|]. intros s _. simpl. now rewrite es_at. Qed.
Theorem plant_decay t : 0 <= t -> (forall s, 0 <= s <= t -> sq (at_ vs s) = 0) ->
  Q2R (floor d) * sq (e t) <= exp (- (2 * Q2R (alpha d) * t)) * V d (e 0).
Proof. intros Ht Z. assert (K := decay d T TP cert es vs fs es_length len_v fs_length error member t Ht Z).
 cbv zeta beta in K. rewrite !es_at in K. exact K. Qed.
Theorem plant_storage mu1 vbar t : Q2R (supply d) = 2 * Q2R (alpha d) * mu1 -> 0 <= t ->
  (forall s, 0 <= s <= t -> sq (at_ vs s) <= vbar) ->
  V d (e t) - mu1 * vbar <= exp (- (2 * Q2R (alpha d) * t)) * (V d (e 0) - mu1 * vbar).
Proof. intros K Ht Hv. assert (S := storage_bound d T TP cert es vs fs es_length len_v fs_length error member mu1
   vbar t K Ht Hv).
 cbv zeta beta in S. rewrite !es_at in S. exact S. Qed.
Lemma e_length t : length (e t) = n d.
Proof. unfold e. rewrite vsub_length; rewrite !at_length; congruence. Qed.
End Plant.
