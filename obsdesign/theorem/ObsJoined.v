(* obsdesign: Plant and model of the disturbance as one plant with the state (x, xm), of which the other files speak. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign ObsHull ObsTrajectory ObsPlant ObsTheorem ObsBlocks ObsSamples ObsModel.
Import ListNotations.
Open Scope R_scope.

(* Plant and model as one plant; the other fields are about it already *)
Definition joined (d : design) (m : generator) : design := {|
  n := n d + mn m; nf := nf d + mf m; nv := mv m; ny := ny d; nq := nq d + mq m;
  A := beside (n d) (A d) (product (B d) (Cm m)) ++ beside (n d) [] (Am m);
  Bf := beside (nf d) (Bf d) (product (B d) (Dwf m)) ++ beside (nf d) [] (Bmf m);
  B := product (B d) (Dm m) ++ Bm m;
  C := beside (n d) (C d) (product (D d) (Cm m));
  Df := beside (nf d) (Df d) (product (D d) (Dwf m));
  D := product (D d) (Dm m);
  Cq := beside (n d) (Cq d) (product (Dq d) (Cm m)) ++ beside (n d) [] (Cq2 m);
  Dqf := beside (nf d) (Dqf d) (product (Dq d) (Dwf m)) ++ beside (nf d) [] (Dq2f m);
  Dq := product (Dq d) (Dm m) ++ Dq2 m;
  H := H d; L1 := L1 d; L2 := L2 d; alpha := alpha d; weight := weight d; supply := supply d; P := P d;
  floor := floor d; multipliers := multipliers d; hulls := hulls d |}.
Definition fits (d : design) (m : generator) : bool :=
  let l (M : list (list Q)) k := (length M =? k)%nat in
  l (A d) (n d) && l (Bf d) (n d) && l (B d) (n d) && l (C d) (ny d) && l (Df d) (ny d) && l (D d) (ny d) &&
  l (Cq d) (nq d) && l (Dqf d) (nq d) && l (Dq d) (nq d) && l (Am m) (mn m) && l (Bmf m) (mn m) && l (Bm m) (mn m) &&
  l (Cq2 m) (mq m) && l (Dq2f m) (mq m) && l (Dq2 m) (mq m) && l (Cm m) (nv d) && l (Dwf m) (nv d) && l (Dm m) (nv d).

Notation with_zeros g k := (fun t => g t ++ repeat 0 k).

Section Joined.
Variables (d : design) (m : generator).
Hypothesis fit : fits d m = true.
Notation J := (joined d m).
Lemma lengths : length (A d) = n d /\ length (Bf d) = n d /\ length (B d) = n d /\
  length (C d) = ny d /\ length (Df d) = ny d /\ length (D d) = ny d /\
  length (Cq d) = nq d /\ length (Dqf d) = nq d /\ length (Dq d) = nq d /\
  length (Am m) = mn m /\ length (Bmf m) = mn m /\ length (Bm m) = mn m /\
  length (Cq2 m) = mq m /\ length (Dq2f m) = mq m /\ length (Dq2 m) = mq m.
Proof. unfold fits in fit. rewrite !andb_true_iff, !Nat.eqb_eq in fit. tauto. Qed.
Lemma parts_of_f fq : length fq = (nf d + mf m)%nat -> length (f1 d fq) = nf d /\ fq = f1 d fq ++ f2 d fq.
Proof. intros L. unfold f1, f2. rewrite firstn_length, firstn_skipn. split; [lia|reflexivity]. Qed.
Lemma ahead_of (a b c : list R) : a ++++ (b ++++ c) = b ++++ (a ++++ c).
Proof. now rewrite !vadd_assoc, (vadd_comm a b). Qed.
Lemma shuffle (a b c e g u : list R) :
  (a ++++ b) ++++ (c ++++ e) ++++ g ++++ u = a ++++ c ++++ g ++++ (b ++++ e ++++ u).
Proof. rewrite (vadd_swap a b c e), <- !vadd_assoc. do 2 f_equal. now rewrite (ahead_of e g), (ahead_of b g). Qed.

(* Rows of the plant, of matrices that act on x, f1 and w; and rows of the model below them *)
Lemma rows_of_plant M N K x xm fq g v : length x = n d -> length fq = (nf d + mf m)%nat ->
  beside (n d) M (product K (Cm m)) ** (x ++ xm) ++++ beside (nf d) N (product K (Dwf m)) ** fq ++++ g
    ++++ product K (Dm m) ** v
  = M ** x ++++ N ** f1 d fq ++++ g ++++ K ** the_w d m xm fq v.
Proof. intros Lx Lf. destruct (parts_of_f fq Lf) as [L1 E]. rewrite beside_R by exact Lx.
 replace (beside (nf d) N (product K (Dwf m)) ** fq) with (N ** f1 d fq ++++ product K (Dwf m) ** f2 d fq).
 - unfold the_w. rewrite !mv_add, !product_R. apply shuffle.
 - rewrite <- (beside_R (nf d) _ _ L1). now rewrite <- E. Qed.
Lemma rows_of_both k j M N K Mm Nm Km x xm fq g v : length x = n d -> length fq = (nf d + mf m)%nat ->
  length M = k -> length N = k -> length K = k -> length g = k ->
  length Mm = j -> length Nm = j -> length Km = j ->
  (beside (n d) M (product K (Cm m)) ++ beside (n d) [] Mm) ** (x ++ xm)
    ++++ (beside (nf d) N (product K (Dwf m)) ++ beside (nf d) [] Nm) ** fq ++++ (g ++ repeat 0 j)
    ++++ (product K (Dm m) ++ Km) ** v
  = (M ** x ++++ N ** f1 d fq ++++ g ++++ K ** the_w d m xm fq v) ++ (Mm ** xm ++++ Nm ** f2 d fq ++++ Km ** v).
Proof. intros Lx Lf LM LN LK Lg LMm LNm LKm. destruct (parts_of_f fq Lf) as [L1 E].
 rewrite <- (rows_of_plant M N K x xm fq g v Lx Lf), !app_R, (below_R (n d) x xm Lx).
 assert (Em : beside (nf d) [] Nm ** fq = Nm ** f2 d fq) by 
   (rewrite E at 1; exact (below_R (nf d) _ _ L1 Nm)).
 rewrite Em.
 rewrite app_add by sizes_agree. rewrite app_add by sizes_agree. rewrite app_add by sizes_agree.
 rewrite (add_zeros j); [reflexivity|]. sizes_agree. Qed.
Section Values.
Variables (x xm fq : list R).
Hypothesis (Lx : length x = n d) (Lf : length fq = (nf d + mf m)%nat).
Lemma joined_dot g v : length g = n d ->
  dot_x d x fq g (the_w d m xm fq v) ++ dot_xm d m xm fq v
  = A J ** (x ++ xm) ++++ Bf J ** fq ++++ (g ++ repeat 0 (mn m)) ++++ B J ** v.
Proof. intros Lg. destruct lengths as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?).
 symmetry. now apply (rows_of_both (n d)). Qed.
Lemma joined_q gq v : length gq = nq d ->
  the_q d m x xm fq gq (the_w d m xm fq v) v
  = Cq J ** (x ++ xm) ++++ Dqf J ** fq ++++ (gq ++ repeat 0 (mq m)) ++++ Dq J ** v.
Proof. intros Lg. destruct lengths as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?).
 symmetry. now apply (rows_of_both (nq d)). Qed.
Lemma joined_y gy v :
  the_y d x fq gy (the_w d m xm fq v) = C J ** (x ++ xm) ++++ Df J ** fq ++++ gy ++++ D J ** v.
Proof. symmetry. now apply rows_of_plant. Qed.
(* .. without v *)
Lemma still u M : length u = length M -> u ++++ M ** [] = u.
Proof. intros L. rewrite times_nil. now apply add_zeros. Qed.
Lemma dot_still g : length g = n d ->
  dot_x d x fq g (the_w d m xm fq []) ++ dot_xm d m xm fq []
  = A J ** (x ++ xm) ++++ Bf J ** fq ++++ (g ++ repeat 0 (mn m)).
Proof. intros Lg. destruct lengths as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?).
 rewrite joined_dot by exact Lg. apply still. cbn [joined A Bf B]. sizes_agree. Qed.
Lemma q_still gq : length gq = nq d ->
  the_q d m x xm fq gq (the_w d m xm fq []) [] = Cq J ** (x ++ xm) ++++ Dqf J ** fq ++++ (gq ++ repeat 0 (mq m)).
Proof. intros Lg. destruct lengths as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?).
 rewrite joined_q by exact Lg. apply still. cbn [joined Cq Dqf Dq]. sizes_agree. Qed.
Lemma y_still gy : length gy = ny d ->
  the_y d x fq gy (the_w d m xm fq []) = C J ** (x ++ xm) ++++ Df J ** fq ++++ gy.
Proof. intros Lg. destruct lengths as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?).
 rewrite joined_y. apply still. cbn [joined C Df D]. sizes_agree. Qed.
End Values.

Lemma at_app (a b : list (R -> R)) t : at_ (a ++ b) t = at_ a t ++ at_ b t.
Proof. apply map_app. Qed.
Theorem driven_is_joined f x xm xh xmh v w wh q qh y yh g gq gy :
  driven d m f x xm xh xmh v w wh q qh y yh g gq gy ->
  trajectories J f (x ++ xm) (xh ++ xmh) v q qh y yh (with_zeros g (mn m)) (with_zeros gq (mq m)) gy.
Proof. intros []. assert (Ax : forall t, length (at_ x t) = n d) by (intros t; unfold at_; now rewrite map_length).
 assert (Axh : forall t, length (at_ xh t) = n d) by (intros t; unfold at_; now rewrite map_length).
 constructor; auto; try (intros t Ht; rewrite ?at_app).
 - cbn [joined n]. rewrite app_length. lia.
 - cbn [joined n]. rewrite app_length. lia.
 - intros t. cbn [joined n]. rewrite app_length, repeat_length. auto.
 - intros t. cbn [joined nq]. rewrite app_length, repeat_length. auto.
 - rewrite <- joined_dot, <- by_model by auto. apply Forall2_app; [now apply moving_x|now apply moving_xm].
 - rewrite <- joined_q, <- by_model by auto. auto.
 - rewrite <- joined_y, <- by_model by auto. auto.
 - rewrite <- dot_still, <- by_observer by auto. auto.
 - rewrite <- q_still, <- by_observer by auto. auto.
 - rewrite <- y_still, <- by_observer by auto. auto. Qed.
Theorem driven_predicted_is_joined f x xm xh xmh v w wh q qh y yh g gq gy :
  driven_predicted d m f x xm xh xmh v w wh q qh y yh g gq gy ->
  predicted J f (beside_at x xm) (beside_at xh xmh) v q qh y yh (with_zeros g (mn m)) (with_zeros gq (mq m)) gy.
Proof. intros []. constructor; auto; intros k; unfold beside_at.
 - cbn [joined n]. rewrite app_length. auto.
 - cbn [joined n]. rewrite app_length. auto.
 - cbn [joined n]. rewrite app_length, repeat_length. auto.
 - cbn [joined nq]. rewrite app_length, repeat_length. auto.
 - rewrite <- joined_dot, <- model_w by auto. now rewrite later_x, later_xm.
 - rewrite <- joined_q, <- model_w by auto. auto.
 - rewrite <- joined_y, <- model_w by auto. auto.
 - rewrite <- dot_still, <- model_wh by auto. auto.
 - rewrite <- q_still, <- model_wh by auto. auto.
 - rewrite <- y_still, <- model_wh by auto. auto. Qed.
End Joined.

(* The v of filtered estimates: `acting` in the place of v *)
Definition apart (d : design) (now late : list bool) : design := {|
  n := n d; nf := nf d; nv := ones now + ones late; ny := ny d; nq := nq d; A := A d; Bf := Bf d;
  B := beside (ones now) (columns now (B d)) []; C := C d; Df := Df d;
  D := beside (ones now) [] (columns late (D d));
  Cq := Cq d; Dqf := Dqf d; Dq := beside (ones now) (columns now (Dq d)) []; H := H d; L1 := L1 d; L2 := L2 d;
  alpha := alpha d; weight := weight d; supply := supply d; P := P d; floor := floor d;
  multipliers := multipliers d; hulls := hulls d |}.
Definition masked (d : design) (m : generator) (now late : list bool) : bool :=
  (length now =? mv m)%nat && (length late =? mv m)%nat &&
  forallb (only now) (B (joined d m)) && forallb (only now) (Dq (joined d m)) &&
  forallb (only late) (D (joined d m)) && forallb zero (product (D d) (Dwf m)).
Section Filtered.
Variables (d : design) (m : generator) (now late : list bool).
Hypothesis (fit : fits d m = true) (mask : masked d m now late = true).
Notation J := (joined d m).
Notation F := (apart J now late).
Lemma mask_parts : length now = mv m /\ length late = mv m /\
  forallb (only now) (B J) = true /\ forallb (only now) (Dq J) = true /\
  forallb (only late) (D J) = true /\ forallb zero (product (D d) (Dwf m)) = true.
Proof. unfold masked in mask. rewrite !andb_true_iff, !Nat.eqb_eq in mask. tauto. Qed.
Lemma soon_R M u v' : forallb (only now) M = true -> length u = mv m ->
  beside (ones now) (columns now M) [] ** (picked now u ++ picked late v') = M ** u.
Proof. intros K L. destruct mask_parts as (Ln & _). rewrite beside_R by (apply picked_length; congruence).
 rewrite columns_R by exact K. apply vadd_nil_r. Qed.
Lemma late_R M u v' : forallb (only late) M = true -> length u = mv m ->
  beside (ones now) [] (columns late M) ** (picked now u ++ picked late v') = M ** v'.
Proof. intros K L. destruct mask_parts as (Ln & _). rewrite below_R by (apply picked_length; congruence).
 now apply columns_R. Qed.
Theorem driven_filtered_is_filtered f x xm xh xmh v w wh q qh y yh g gq gy :
  driven_filtered d m f x xm xh xmh v w wh q qh y yh g gq gy ->
  filtered F f (beside_at x xm) (beside_at xh xmh) (acting now late v) q qh y yh
    (with_zeros g (mn m)) (with_zeros gq (mq m)) gy.
Proof. intros []. destruct mask_parts as (Ln & Ll & KB & KDq & KD & KZ).
 destruct (lengths d m fit) as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?).
 constructor; auto; intros k; unfold beside_at, acting;
   cbn [apart n nf nv ny nq A Bf B C Df D Cq Dqf Dq L1 L2].
 - cbn [joined n]. rewrite app_length. auto.
 - cbn [joined n]. rewrite app_length. auto.
 - rewrite app_length, !picked_length; [reflexivity|rewrite Ll; auto|rewrite Ln; auto].
 - cbn [joined n]. rewrite app_length, repeat_length. auto.
 - cbn [joined nq]. rewrite app_length, repeat_length. auto.
 - rewrite soon_R, <- joined_dot, <- its_w by auto. now rewrite its_x, its_xm.
 - rewrite soon_R, <- joined_q, <- its_w by auto. auto.
 - rewrite late_R by auto. cbn [joined C D]. rewrite its_y, its_w, beside_R by auto. unfold the_w.
   rewrite !mv_add, !product_R, <- (product_R (D d) (Dwf m)), (silent_R _ _ KZ), product_length.
   rewrite add_zeros by (rewrite mv_length; reflexivity). rewrite <- !vadd_assoc. f_equal. rewrite !vadd_assoc.
   f_equal. apply vadd_comm.
 - rewrite <- dot_still, <- its_wh by auto. auto.
 - rewrite <- q_still, <- its_wh by auto. auto.
 - rewrite <- dot_still, <- its_wh by auto. cbn [joined C]. rewrite beside_R.
   + rewrite its_yh, product_R, <- !vadd_assoc. f_equal. apply vadd_comm.
   + assert (Lg := all_g k). unfold dot_x. sizes_agree. Qed.
End Filtered.

(* What the kernel computes, and what is stated *)
Definition claims_energy_of_model (d : design) (m : generator) gamma T TP TH : bool :=
  fits d m && claims_energy (joined d m) gamma T TP TH.
Definition claims_peak_of_model (d : design) (m : generator) gamma mu1 mu2 T TP TO TH : bool :=
  fits d m && claims_peak (joined d m) gamma mu1 mu2 T TP TO TH.
Definition claims_energy_of_sampled_model (d : design) (m : generator) gamma T TP TH : bool :=
  fits d m && claims_energy_of_samples (joined d m) gamma T TP TH.
Definition claims_peak_of_sampled_model (d : design) (m : generator) gamma mu1 mu2 T TP TO TH : bool :=
  fits d m && claims_peak_of_samples (joined d m) gamma mu1 mu2 T TP TO TH.
Definition claims_energy_of_filtered_model (d : design) (m : generator) now late gamma T TP TH : bool :=
  fits d m && masked d m now late && claims_energy_of_samples (ahead (apart (joined d m) now late)) gamma T TP TH.
Definition claims_peak_of_filtered_model (d : design) (m : generator) now late gamma mu1 mu2 T TP TO TH : bool :=
  fits d m && masked d m now late &&
  claims_peak_of_samples (ahead (apart (joined d m) now late)) gamma mu1 mu2 T TP TO TH.

Theorem energy_of_driven d m gamma T TP TH : claims_energy_of_model d m gamma T TP TH = true ->
  forall f, of_class (joined d m) f -> forall x xm xh xmh v w wh q qh y yh g gq gy,
  driven d m f x xm xh xmh v w wh q qh y yh g gq gy ->
  forall t, 0 <= t -> let e := error_at (x ++ xm) (xh ++ xmh) in
  RInt (fun s => sq (zed d (e s))) 0 t
  <= V d (e 0) / Q2R (weight d) + Q2R gamma * Q2R gamma * RInt (fun s => sq (at_ v s)) 0 t
  /\ ((forall s, 0 <= s <= t -> sq (at_ v s) = 0) ->
      Q2R (floor d) * sq (e t) <= exp (- (2 * Q2R (alpha d) * t)) * V d (e 0)).
Proof. intros K f Hf x xm xh xmh v w wh q qh y yh g gq gy R. apply andb_true_iff in K. destruct K as [Fit K].
 exact (energy_of_trajectories _ gamma T TP TH K f Hf _ _ _ _ _ _ _ _ _ _
   (driven_is_joined d m Fit f x xm xh xmh v w wh q qh y yh g gq gy R)). Qed.
Theorem peak_of_driven d m gamma mu1 mu2 T TP TO TH : claims_peak_of_model d m gamma mu1 mu2 T TP TO TH = true ->
  forall f, of_class (joined d m) f -> forall x xm xh xmh v w wh q qh y yh g gq gy,
  driven d m f x xm xh xmh v w wh q qh y yh g gq gy ->
  forall t, 0 <= t -> let e := error_at (x ++ xm) (xh ++ xmh) in
  (forall vbar, (forall s, 0 <= s <= t -> sq (at_ v s) <= vbar) ->
     sq (zed d (e t)) <= Q2R gamma * Q2R gamma * vbar + Q2R mu2 * exp (- (2 * Q2R (alpha d) * t)) * V d (e 0)
     /\ V d (e t) <= Rmax (V d (e 0)) (Q2R mu1 * vbar))
  /\ ((forall s, 0 <= s <= t -> sq (at_ v s) = 0) ->
      Q2R (floor d) * sq (e t) <= exp (- (2 * Q2R (alpha d) * t)) * V d (e 0)).
Proof. intros K f Hf x xm xh xmh v w wh q qh y yh g gq gy R. apply andb_true_iff in K. destruct K as [Fit K].
 exact (peak_of_trajectories _ gamma mu1 mu2 T TP TO TH K f Hf _ _ _ _ _ _ _ _ _ _
   (driven_is_joined d m Fit f x xm xh xmh v w wh q qh y yh g gq gy R)). Qed.
Theorem energy_of_driven_predicted d m gamma T TP TH : claims_energy_of_sampled_model d m gamma T TP TH = true ->
  forall f, of_class (joined d m) f -> forall x xm xh xmh v w wh q qh y yh g gq gy,
  driven_predicted d m f x xm xh xmh v w wh q qh y yh g gq gy ->
  forall N, let e := error_of (beside_at x xm) (beside_at xh xmh) in
  sum_to (fun k => sq (zed d (e k))) N
  <= V d (e 0%nat) / Q2R (weight d) + Q2R gamma * Q2R gamma * sum_to (fun k => sq (v k)) N
  /\ ((forall k, (k < N)%nat -> sq (v k) = 0) -> Q2R (floor d) * sq (e N) <= Q2R (alpha d) ^ (2 * N) * V d (e 0%nat)).
Proof. intros K f Hf x xm xh xmh v w wh q qh y yh g gq gy R. apply andb_true_iff in K. destruct K as [Fit K].
 exact (energy_of_predicted _ gamma T TP TH K f Hf _ _ _ _ _ _ _ _ _ _
   (driven_predicted_is_joined d m Fit f x xm xh xmh v w wh q qh y yh g gq gy R)). Qed.
Theorem peak_of_driven_predicted d m gamma mu1 mu2 T TP TO TH :
  claims_peak_of_sampled_model d m gamma mu1 mu2 T TP TO TH = true ->
  forall f, of_class (joined d m) f -> forall x xm xh xmh v w wh q qh y yh g gq gy,
  driven_predicted d m f x xm xh xmh v w wh q qh y yh g gq gy ->
  forall N, let e := error_of (beside_at x xm) (beside_at xh xmh) in
  (forall vbar, (forall k, (k < N)%nat -> sq (v k) <= vbar) -> 0 <= vbar ->
     sq (zed d (e N)) <= Q2R gamma * Q2R gamma * vbar + Q2R mu2 * Q2R (alpha d) ^ (2 * N) * V d (e 0%nat)
     /\ V d (e N) <= Rmax (V d (e 0%nat)) (Q2R mu1 * vbar))
  /\ ((forall k, (k < N)%nat -> sq (v k) = 0) -> Q2R (floor d) * sq (e N) <= Q2R (alpha d) ^ (2 * N) * V d (e 0%nat)).
Proof. intros K f Hf x xm xh xmh v w wh q qh y yh g gq gy R. apply andb_true_iff in K. destruct K as [Fit K].
 exact (peak_of_predicted _ gamma mu1 mu2 T TP TO TH K f Hf _ _ _ _ _ _ _ _ _ _
   (driven_predicted_is_joined d m Fit f x xm xh xmh v w wh q qh y yh g gq gy R)). Qed.
Theorem energy_of_driven_filtered d m now late gamma T TP TH :
  claims_energy_of_filtered_model d m now late gamma T TP TH = true ->
  forall f, of_class (joined d m) f -> forall x xm xh xmh v w wh q qh y yh g gq gy,
  driven_filtered d m f x xm xh xmh v w wh q qh y yh g gq gy ->
  forall N, let e := error_of (beside_at x xm) (beside_at xh xmh) in
  sum_to (fun k => sq (zed d (e k))) N
  <= V d (e 0%nat) / Q2R (weight d) + Q2R gamma * Q2R gamma * sum_to (fun k => sq (acting now late v k)) N
  /\ ((forall k, (k < N)%nat -> sq (acting now late v k) = 0) ->
      Q2R (floor d) * sq (e N) <= Q2R (alpha d) ^ (2 * N) * V d (e 0%nat)).
Proof. intros K f Hf x xm xh xmh v w wh q qh y yh g gq gy R. unfold claims_energy_of_filtered_model in K.
 rewrite !andb_true_iff in K. destruct K as [[Fit M] K].
 exact (energy_of_filtered _ gamma T TP TH K f Hf _ _ _ _ _ _ _ _ _ _
   (driven_filtered_is_filtered d m now late Fit M f x xm xh xmh v w wh q qh y yh g gq gy R)). Qed.
Theorem peak_of_driven_filtered d m now late gamma mu1 mu2 T TP TO TH :
  claims_peak_of_filtered_model d m now late gamma mu1 mu2 T TP TO TH = true ->
  forall f, of_class (joined d m) f -> forall x xm xh xmh v w wh q qh y yh g gq gy,
  driven_filtered d m f x xm xh xmh v w wh q qh y yh g gq gy ->
  forall N, let e := error_of (beside_at x xm) (beside_at xh xmh) in
  (forall vbar, (forall k, (k < N)%nat -> sq (acting now late v k) <= vbar) -> 0 <= vbar ->
     sq (zed d (e N)) <= Q2R gamma * Q2R gamma * vbar + Q2R mu2 * Q2R (alpha d) ^ (2 * N) * V d (e 0%nat)
     /\ V d (e N) <= Rmax (V d (e 0%nat)) (Q2R mu1 * vbar))
  /\ ((forall k, (k < N)%nat -> sq (acting now late v k) = 0) ->
      Q2R (floor d) * sq (e N) <= Q2R (alpha d) ^ (2 * N) * V d (e 0%nat)).
Proof. intros K f Hf x xm xh xmh v w wh q qh y yh g gq gy R. unfold claims_peak_of_filtered_model in K.
 rewrite !andb_true_iff in K. destruct K as [[Fit M] K].
 exact (peak_of_filtered _ gamma mu1 mu2 T TP TO TH K f Hf _ _ _ _ _ _ _ _ _ _
   (driven_filtered_is_filtered d m now late Fit M f x xm xh xmh v w wh q qh y yh g gq gy R)). Qed.

(* Runs that stay where two functions have the same values *)
Lemma driven_of_region d m f g (region : list R -> Prop) x xm xh xmh v w wh q qh y yh g1 gq gy :
  driven d m f x xm xh xmh v w wh q qh y yh g1 gq gy -> (forall t r, length (g t r) = (nf d + mf m)%nat) ->
  (forall t r, region r -> g t r = f t r) -> (forall t, 0 <= t -> region (q t) /\ region (qh t)) ->
  driven d m g x xm xh xmh v w wh q qh y yh g1 gq gy.
Proof. intros [] L E I. split; auto; intros t Ht; destruct (I t Ht); rewrite E by assumption; auto. Qed.
Lemma driven_predicted_of_region d m f g (region : list R -> Prop) x xm xh xmh v w wh q qh y yh g1 gq gy :
  driven_predicted d m f x xm xh xmh v w wh q qh y yh g1 gq gy -> (forall k r, length (g k r) = (nf d + mf m)%nat) ->
  (forall k r, region r -> g k r = f k r) -> (forall k, region (q k) /\ region (qh k)) ->
  driven_predicted d m g x xm xh xmh v w wh q qh y yh g1 gq gy.
Proof. intros [] L E I. split; auto; intros k; destruct (I k); rewrite E by assumption; auto. Qed.
Lemma driven_filtered_of_region d m f g (region : list R -> Prop) x xm xh xmh v w wh q qh y yh g1 gq gy :
  driven_filtered d m f x xm xh xmh v w wh q qh y yh g1 gq gy -> (forall k r, length (g k r) = (nf d + mf m)%nat) ->
  (forall k r, region r -> g k r = f k r) -> (forall k, region (q k) /\ region (qh k)) ->
  driven_filtered d m g x xm xh xmh v w wh q qh y yh g1 gq gy.
Proof. intros [] L E I. split; auto; intros k; destruct (I k); rewrite ?E by assumption; auto. Qed.
