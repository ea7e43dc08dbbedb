(* obsdesign: The observer, its error equations, the dissipation inequality as a form, and the theorem for every
   e, f and v. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Obs Require Import ObsForm.
Import ListNotations.
Open Scope R_scope.

Record multiplier := { scaling : Q; M11 : list (list Q); M12 : list (list Q); M22 : list (list Q) }.
(* A multiplier that is a matrix, of `count` components of f from `first` on: it is about df = Theta dq with
   Theta in the hull of `corners`, or, where it is conic, any sum of them with weights that are not negative *)
Record hull := { form_of : multiplier; conic : bool; first : nat; count : nat; corners : list (list (list Q)) }.
Record design := {
  n : nat; nf : nat; nv : nat; ny : nat; nq : nat;
  A : list (list Q); Bf : list (list Q); B : list (list Q);
  C : list (list Q); Df : list (list Q); D : list (list Q);
  Cq : list (list Q); Dqf : list (list Q); Dq : list (list Q);
  H : list (list Q); L1 : list (list Q); L2 : list (list Q);
  alpha : Q; weight : Q; supply : Q;          (* V' + 2 alpha V + weight |z|^2 - supply |v|^2 <= 0 *)
  P : list (list Q); floor : Q;               (* P >= floor I *)
  multipliers : list multiplier;
  hulls : list hull
}.
Definition sq (x : list R) := dotR x x.
Definition sigma (m : multiplier) (q f : list R) :=
  dotR q (mvR (rmat (M11 m)) q) + 2 * dotR q (mvR (rmat (M12 m)) f) + dotR f (mvR (rmat (M22 m)) f).

(* All inequalities that the class satisfies *)
Definition inequalities (d : design) := multipliers d ++ map form_of (hulls d).

Section Error.
Variable d : design.
Definition err_out (e f v : list R) := vsubR (vaddR (mvR (rmat (C d)) e) (mvR (rmat (Df d)) f)) (mvR (rmat (D d)) v).
Definition err_dot (e f v : list R) :=
  vaddR (vsubR (vaddR (mvR (rmat (A d)) e) (mvR (rmat (Bf d)) f)) (mvR (rmat (B d)) v))
    (mvR (rmat (L1 d)) (err_out e f v)).
Definition err_arg (e f v : list R) :=
  vaddR (vsubR (vaddR (mvR (rmat (Cq d)) e) (mvR (rmat (Dqf d)) f)) (mvR (rmat (Dq d)) v))
    (mvR (rmat (L2 d)) (err_out e f v)).
Definition zed (e : list R) := mvR (rmat (H d)) e.
Definition V (e : list R) := dotR e (mvR (rmat (P d)) e).
Definition V_dot (e de : list R) := dotR de (mvR (rmat (P d)) e) + dotR e (mvR (rmat (P d)) de).

(* The same as programs over x = e ++ f ++ v *)
Definition le := Part 0 (n d).
Definition lf := Part (n d) (nf d).
Definition lv := Part (n d + nf d) (nv d).
Definition lout := Sub (Add (Mul (C d) le) (Mul (Df d) lf)) (Mul (D d) lv).
Definition ldot := Add (Sub (Add (Mul (A d) le) (Mul (Bf d) lf)) (Mul (B d) lv)) (Mul (L1 d) lout).
Definition larg := Add (Sub (Add (Mul (Cq d) le) (Mul (Dqf d) lf)) (Mul (Dq d) lv)) (Mul (L2 d) lout).
Definition lz := Mul (H d) le.
Definition minus_sigma (m : multiplier) : list term :=
  [(Qopp (scaling m), larg, Mul (M11 m) larg); (Qopp (2 * scaling m), larg, Mul (M12 m) lf);
    (Qopp (scaling m), lf, Mul (M22 m) lf)].
Definition dissipation : list term :=
  [(Qopp 1, ldot, Mul (P d) le); (Qopp 1, le, Mul (P d) ldot); (Qopp (2 * alpha d), le, Mul (P d) le);
   (Qopp (weight d), lz, lz); (supply d, lv, lv)] ++ flat_map minus_sigma (inequalities d).
Definition definite : list term := [(1%Q, le, Mul (P d) le); (Qopp (floor d), le, le)].
Definition bounded (mu : Q) : list term := [(mu, le, Mul (P d) le); (Qopp 1, lz, lz)].
Definition gain_form (kappa : Q) : list term :=
  let y := Part 0 (ny d) in [((kappa * kappa)%Q, y, y); (Qopp 1, Mul (L1 d) y, Mul (L1 d) y)].
Definition storage_form (p : Q) : list term := [(p, le, le); (Qopp 1, le, Mul (P d) le)].

Definition certified (T TP : list (list Z)) : bool :=
  forallb (fun m => Qle_bool 0 (scaling m)) (inequalities d) && Qle_bool 0 (alpha d) && negb (Qle_bool (floor d) 0) &&
  Qle_bool 0 (weight d) && Qle_bool 0 (supply d) &&
  check false (n d + nf d + nv d) dissipation T && check false (n d) definite TP.

Lemma firstn_app_exact (a b : list R) : firstn (length a) (a ++ b) = a.
Proof. rewrite firstn_app, Nat.sub_diag, firstn_O, app_nil_r. apply firstn_all. Qed.
Lemma skipn_app_exact (a b : list R) : skipn (length a) (a ++ b) = b.
Proof. rewrite skipn_app, Nat.sub_diag, skipn_all. reflexivity. Qed.
Lemma parts e f v : length e = n d -> length f = nf d -> length v = nv d ->
  eval le (e ++ f ++ v) = e /\ eval lf (e ++ f ++ v) = f /\ eval lv (e ++ f ++ v) = v.
Proof. intros He Hf Hv. unfold le, lf, lv. cbn [eval]. rewrite <- He, <- Hf, <- Hv. repeat split.
 - apply firstn_app_exact.
 - rewrite skipn_app_exact. apply firstn_app_exact.
 - rewrite app_assoc, <- app_length, skipn_app_exact. apply firstn_all. Qed.
Lemma quad_app F G x : quad (F ++ G) x = quad F x + quad G x.
Proof. unfold quad. induction F; simpl; [ring|]. rewrite IHF. ring. Qed.
Lemma Q2R_one : Q2R 1 = 1. Proof. unfold Q2R. simpl. field. Qed.
Lemma Q2R_two : Q2R 2 = 2. Proof. unfold Q2R. simpl. field. Qed.
Lemma Q2R_zero : Q2R 0 = 0. Proof. unfold Q2R. simpl. field. Qed.
Lemma Qle_R q : Qle_bool 0 q = true -> 0 <= Q2R q.
Proof. intros K. apply Qle_bool_iff, Qle_Rle in K. now rewrite Q2R_zero in K. Qed.

Lemma Qpos_R q : negb (Qle_bool q 0) = true -> 0 < Q2R q.
Proof. intros K. apply negb_true_iff in K. destruct (Rle_or_lt (Q2R q) 0) as [L|L]; auto.
 rewrite <- Q2R_zero in L. apply Rle_Qle in L. apply Qle_bool_iff in L. congruence. Qed.

(* The sum of scaling sigma_m over the multipliers, which the class makes nonnegative *)
Definition sigmas (ms : list multiplier) (q f : list R) :=
  fold_right Rplus 0 (map (fun m => Q2R (scaling m) * sigma m q f) ms).
Lemma sigmas_value ms x q f : eval larg x = q -> eval lf x = f -> quad (flat_map minus_sigma ms) x = - sigmas ms q f.
Proof. intros Eq Ef. unfold sigmas. induction ms as [|m ms IH]; [unfold quad; simpl; ring|].
 cbn [flat_map map fold_right]. rewrite quad_app, IH.
 unfold quad, minus_sigma. cbn [bil bil1 eval]. rewrite Eq, Ef, !Q2R_opp, Q2R_mult, Q2R_two. unfold sigma. ring. Qed.
Lemma sigmas_nonneg ms q f :
  Forall (fun m => 0 <= Q2R (scaling m)) ms -> (forall m, In m ms -> 0 <= sigma m q f) -> 0 <= sigmas ms q f.
Proof. unfold sigmas. intros K Hs. induction ms as [|m ms IH]; simpl; [lra|]. inversion K; subst.
 assert (0 <= Q2R (scaling m) * sigma m q f) by (apply Rmult_le_pos; [auto|apply Hs; now left]).
 assert (IH' := IH ltac:(assumption) ltac:(intros; apply Hs; now right)). lra. Qed.

(* What the programs are at x = e ++ f ++ v *)
Lemma programs e f v : length e = n d -> length f = nf d -> length v = nv d ->
  eval ldot (e ++ f ++ v) = err_dot e f v /\ eval larg (e ++ f ++ v) = err_arg e f v /\ eval lz (e ++ f ++ v) = zed e.
Proof. intros He Hf Hv. destruct (parts e f v He Hf Hv) as (Ee & Ef & Ev).
 unfold ldot, larg, lz, lout. cbn [eval]. rewrite Ee, Ef, Ev. now repeat split. Qed.

Lemma dissipation_value e f v : length e = n d -> length f = nf d -> length v = nv d ->
  quad dissipation (e ++ f ++ v) =
  - (V_dot e (err_dot e f v) + 2 * Q2R (alpha d) * V e + Q2R (weight d) * sq (zed e) - Q2R (supply d) * sq v)
  - sigmas (inequalities d) (err_arg e f v) f.
Proof. intros He Hf Hv. destruct (parts e f v He Hf Hv) as (Ee & Ef & Ev), (programs e f v He Hf Hv) as (Eo & Eq & Ez).
 unfold dissipation. rewrite quad_app, (sigmas_value _ _ (err_arg e f v) f) by auto.
 unfold quad. cbn [bil bil1 eval]. rewrite Ez, Eo, Ee, Ev, !Q2R_opp, Q2R_mult, Q2R_two, Q2R_one.
 unfold V_dot, V, sq. ring. Qed.

Variables T TP : list (list Z).
Hypothesis cert : certified T TP = true.
Lemma cert_parts : Forall (fun m => 0 <= Q2R (scaling m)) (inequalities d) /\ 0 <= Q2R (alpha d) /\
   0 < Q2R (floor d) /\ 0 <= Q2R (weight d)
  /\ 0 <= Q2R (supply d) /\ check false (n d + nf d + nv d) dissipation T = true /\
    check false (n d) definite TP = true.
Proof. unfold certified in cert. rewrite !andb_true_iff in cert.
 destruct cert as ((((((K1 & K2) & K3) & K4) & K5) & K6) & K7).
 repeat split; auto using Qle_R.
 - rewrite forallb_forall in K1. apply Forall_forall. intros m Hm. apply Qle_R. now apply K1.
 - apply negb_true_iff in K3. destruct (Rle_or_lt (Q2R (floor d)) 0) as [L|L]; auto.
   rewrite <- Q2R_zero in L. apply Rle_Qle in L. apply Qle_bool_iff in L. congruence. Qed.

Theorem dissipates e f v : length e = n d -> length f = nf d -> length v = nv d ->
  (forall m, In m (inequalities d) -> 0 <= sigma m (err_arg e f v) f) ->
  V_dot e (err_dot e f v) + 2 * Q2R (alpha d) * V e + Q2R (weight d) * sq (zed e) - Q2R (supply d) * sq v <= 0.
Proof. intros He Hf Hv Hs. destruct cert_parts as (K1 & _ & _ & _ & _ & K & _).
 assert (N := nonnegative _ _ _ K (e ++ f ++ v) ltac:(rewrite !app_length; lia)).
 rewrite dissipation_value in N by auto.
 assert (S := sigmas_nonneg _ (err_arg e f v) f K1 Hs). lra. Qed.

Lemma eval_le e : length e = n d -> eval le e = e.
Proof. intros He. unfold le. cbn [eval skipn]. rewrite <- He. apply firstn_all. Qed.
Theorem above_floor e : length e = n d -> Q2R (floor d) * sq e <= V e.
Proof. intros He. destruct cert_parts as (_ & _ & _ & _ & _ & _ & K).
 assert (N := nonnegative _ _ _ K e He). unfold quad, definite in N. cbn [bil bil1] in N.
 rewrite Q2R_opp, Q2R_one in N. cbn [eval] in N. rewrite !(eval_le e He) in N. unfold V, sq. lra. Qed.
Theorem below_level mu TO e : check false (n d) (bounded mu) TO = true -> length e = n d -> sq (zed e) <= Q2R mu * V e.
Proof. intros K He. assert (N := nonnegative _ _ _ K e He). unfold quad, bounded, lz in N. cbn [bil bil1] in N.
 rewrite Q2R_opp, Q2R_one in N. cbn [eval] in N. rewrite !(eval_le e He) in N. unfold V, sq, zed. lra. Qed.

(* Bounds on the gain and on P *)
Theorem gain_bounded kappa TL : check false (ny d) (gain_form kappa) TL = true -> forall y, length y = ny d ->
  sq (mvR (rmat (L1 d)) y) <= Q2R kappa * Q2R kappa * sq y.
Proof. intros K y Hy. assert (N := nonnegative _ _ _ K y Hy). unfold quad, gain_form in N. cbn [bil bil1] in N.
 rewrite Q2R_opp, Q2R_mult, Q2R_one in N. cbn [eval skipn] in N. rewrite <- Hy, firstn_all in N. unfold sq. lra. Qed.
Theorem storage_bounded p TS : check false (n d) (storage_form p) TS = true -> forall e, length e = n d ->
   V e <= Q2R p * sq e.
Proof. intros K e He. assert (N := nonnegative _ _ _ K e He). unfold quad, storage_form in N. cbn [bil bil1] in N.
 rewrite Q2R_opp, Q2R_one in N. cbn [eval] in N. rewrite !(eval_le e He) in N. unfold V, sq. lra. Qed.
End Error.
