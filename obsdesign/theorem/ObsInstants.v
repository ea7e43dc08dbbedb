(* obsdesign: What a theorem about measurements at instants is stated with: plant, observer, their trajectories. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign ObsTrajectory ObsPlant.
Import ListNotations.
Open Scope R_scope.

(* Plant x' = A x + Bf f(t, q) + g + B w, q = Cq x + Dqf f(t, q) + gq + Dq w, with z = Cp (x - xh). Observer
     xh' = A xh + Bf f(t, qh) + g + L th, th' = H th between measurements,
     xh+ = xh + K r, th+ = G r at a measurement y = C x + gy + eta, with r = y - (C xh + gy).
   The size of an error is that of Se (x - xh) + St th. *)
Record observer := {
  n : nat; nt : nat; nf : nat; nw : nat; ny : nat; nq : nat;   (* entries of x, th, f, w, y, q *)
  A : list (list Q); Bf : list (list Q); B : list (list Q); C : list (list Q);
  Cq : list (list Q); Dqf : list (list Q); Dq : list (list Q); Cp : list (list Q);
  L : list (list Q); H : list (list Q); K : list (list Q); G : list (list Q);
  Se : list (list Q); St : list (list Q);
  T1 : Q; T2 : Q;                                              (* shortest and longest interval *)
  multipliers : list multiplier                                (* of the class; their `scaling` plays no part *)
}.
Definition of_class (o : observer) (f : R -> list R -> list R) :=
  forall t a b m, length a = nq o -> length b = nq o -> In m (multipliers o) ->
    0 <= sigma m (vsubR a b) (vsubR (f t a) (f t b)).

(* Signals come in pieces: piece j lives on [t j, t (S j)], between the measurements at its ends; t 0 = 0 is none *)
Record trajectories (o : observer) (f : R -> list R -> list R) (t : nat -> R) (x xh th w : nat -> list (R -> R))
  (q qh g gq : nat -> R -> list R) (y gy eta : nat -> list R) : Prop := {
  size_x : forall j, length (x j) = n o; size_xh : forall j, length (xh j) = n o;
  size_th : forall j, length (th j) = nt o; size_w : forall j, length (w j) = nw o;
  size_f : forall s r, length (f s r) = nf o; size_g : forall j s, length (g j s) = n o;
  size_gq : forall j s, length (gq j s) = nq o; size_gy : forall j, length (gy j) = ny o;
  size_eta : forall j, length (eta j) = ny o;
  start : t 0%nat = 0;
  before_first : 0 <= t 1%nat <= Q2R (T2 o);
  intervals : forall j, Q2R (T1 o) <= t (S (S j)) - t (S j) <= Q2R (T2 o);
  w_continuous : forall j s, t j <= s <= t (S j) -> steady (w j) s;
  plant_x : forall j s, t j <= s <= t (S j) ->
    moves (x j) s (A o ** at_ (x j) s ++++ Bf o ** f s (q j s) ++++ g j s ++++ B o ** at_ (w j) s);
  plant_q : forall j s, t j <= s <= t (S j) ->
    q j s = Cq o ** at_ (x j) s ++++ Dqf o ** f s (q j s) ++++ gq j s ++++ Dq o ** at_ (w j) s;
  observer_x : forall j s, t j <= s <= t (S j) ->
    moves (xh j) s (A o ** at_ (xh j) s ++++ Bf o ** f s (qh j s) ++++ g j s ++++ L o ** at_ (th j) s);
  observer_q : forall j s, t j <= s <= t (S j) ->
    qh j s = Cq o ** at_ (xh j) s ++++ Dqf o ** f s (qh j s) ++++ gq j s;
  observer_th : forall j s, t j <= s <= t (S j) -> moves (th j) s (H o ** at_ (th j) s);
  measured : forall j, y (S j) = C o ** at_ (x j) (t (S j)) ++++ gy (S j) ++++ eta (S j);
  plant_goes_on : forall j, at_ (x (S j)) (t (S j)) = at_ (x j) (t (S j));
  corrected : forall j, let r := vsubR (y (S j)) (C o ** at_ (xh j) (t (S j)) ++++ gy (S j)) in
    at_ (xh (S j)) (t (S j)) = at_ (xh j) (t (S j)) ++++ K o ** r;
  held : forall j, let r := vsubR (y (S j)) (C o ** at_ (xh j) (t (S j)) ++++ gy (S j)) in
    at_ (th (S j)) (t (S j)) = G o ** r
}.

(* Error of piece j, its size, z; the integral over the first pieces; the sum over the first measurements *)
Definition error_at (x xh : nat -> list (R -> R)) (j : nat) (s : R) := vsubR (at_ (x j) s) (at_ (xh j) s).
Definition joint (o : observer) (e th : list R) := Se o ** e ++++ St o ** th.
Definition zed (o : observer) (e : list R) := Cp o ** e.
Fixpoint total (g : nat -> R -> R) (t : nat -> R) (pieces : nat) : R :=
  match pieces with O => 0 | S j => total g t j + RInt (g j) (t j) (t (S j)) end.
Fixpoint summed (g : nat -> R) (measurements : nat) : R :=
  match measurements with O => 0 | S j => summed g j + g (S j) end.

(* Instants up to s in piece j *)
Definition past (t : nat -> R) (j : nat) (s : R) (i : nat) (r : R) :=
  (i < j)%nat /\ t i <= r <= t (S i) \/ i = j /\ t i <= r <= s.

(* Equations of the error *)
Definition err_dot (o : observer) (e th f w : list R) := vsubR (A o ** e ++++ Bf o ** f ++++ B o ** w) (L o ** th).
Definition hold_dot (o : observer) (th : list R) := H o ** th.
Definition err_arg (o : observer) (e f w : list R) := Cq o ** e ++++ Dqf o ** f ++++ Dq o ** w.
Definition seen (o : observer) (e eta : list R) := C o ** e ++++ eta.
Definition err_after (o : observer) (e eta : list R) := vsubR e (K o ** seen o e eta).
Definition hold_after (o : observer) (e eta : list R) := G o ** seen o e eta.

(* Plant and observer with one f: their difference obeys them *)
Definition sized (o : observer) : bool :=
  let l (M : list (list Q)) k := (length M =? k)%nat in
  l (A o) (n o) && l (Bf o) (n o) && l (B o) (n o) && l (L o) (n o) && l (K o) (n o) && l (C o) (ny o) &&
  l (Cq o) (nq o) && l (Dqf o) (nq o) && l (Dq o) (nq o) && l (H o) (nt o) && l (G o) (nt o).
Section Difference.
Variable o : observer.
Hypothesis siz : sized o = true.
Lemma sizes : length (A o) = n o /\ length (Bf o) = n o /\ length (B o) = n o /\ length (L o) = n o
  /\ length (K o) = n o /\ length (C o) = ny o /\ length (Cq o) = nq o /\ length (Dqf o) = nq o /\ length (Dq o) = nq o
  /\ length (H o) = nt o /\ length (G o) = nt o.
Proof. unfold sized in siz. rewrite !andb_true_iff, !Nat.eqb_eq in siz. tauto. Qed.
Ltac len := repeat match goal with
  | |- context [length (vaddR ?u ?w)] => rewrite (vadd_length u w); [|len]
  | |- context [length (vsubR ?u ?w)] => rewrite (vsub_length u w); [|len]
  end; rewrite ?mv_length; lia.
Ltac pointwise := apply (nth_ext _ _ 0 0); [len|intros i Hi; unfold vsubR;
  rewrite ?mv_add, ?mv_scale, ?nth_vadd, ?nth_scale, ?mv_add, ?mv_scale, ?nth_vadd, ?nth_scale; ring].
Variables x xh th w fq fqh g gq gy eta : list R.
Hypothesis (len_x : length x = n o) (len_xh : length xh = n o) (len_g : length g = n o).
Hypothesis (len_gq : length gq = nq o) (len_gy : length gy = ny o) (len_eta : length eta = ny o).
Lemma dot_difference :
  vsubR (A o ** x ++++ Bf o ** fq ++++ g ++++ B o ** w) (A o ** xh ++++ Bf o ** fqh ++++ g ++++ L o ** th) =
    err_dot o (vsubR x xh) th (vsubR fq fqh) w.
Proof using All. destruct sizes as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?). unfold err_dot. rewrite !mv_sub.
 pointwise. Qed.
Lemma arg_difference :
  vsubR (Cq o ** x ++++ Dqf o ** fq ++++ gq ++++ Dq o ** w) (Cq o ** xh ++++ Dqf o ** fqh ++++ gq) =
    err_arg o (vsubR x xh) (vsubR fq fqh) w.
Proof using All. destruct sizes as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?). unfold err_arg. rewrite !mv_sub.
 pointwise. Qed.
Lemma seen_difference : vsubR (C o ** x ++++ gy ++++ eta) (C o ** xh ++++ gy) = seen o (vsubR x xh) eta.
Proof using All. destruct sizes as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?). unfold seen. rewrite !mv_sub.
 pointwise. Qed.
Lemma after_difference r : vsubR x (xh ++++ K o ** r) = vsubR (vsubR x xh) (K o ** r).
Proof using All. destruct sizes as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?).
 generalize (K o ** r) (mv_length (K o) r). intros l Hl. pointwise. Qed.
Lemma plant_arg_length : length (Cq o ** x ++++ Dqf o ** fq ++++ gq ++++ Dq o ** w) = nq o.
Proof using All. destruct sizes as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?). len. Qed.
Lemma observer_arg_length : length (Cq o ** xh ++++ Dqf o ** fqh ++++ gq) = nq o.
Proof using All. destruct sizes as (? & ? & ? & ? & ? & ? & ? & ? & ? & ? & ?). len. Qed.
End Difference.
