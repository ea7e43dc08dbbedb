(* obsdesign: A plant whose disturbance w comes from a model that an unknown v drives, and the observer of both.
   The theorems about it are in ObsJoined.v. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign ObsTrajectory ObsPlant ObsBlocks.
Import ListNotations.
Open Scope R_scope.

(* xm' = Am xm + Bmf f2 + Bm v,  q2 = Cq2 xm + Dq2f f2 + Dq2 v,  w = Cm xm + Dwf f2 + Dm v; sizes of xm, f2, v, q2 *)
Record generator := {
  mn : nat; mf : nat; mv : nat; mq : nat;
  Am : list (list Q); Bmf : list (list Q); Bm : list (list Q);
  Cq2 : list (list Q); Dq2f : list (list Q); Dq2 : list (list Q);
  Cm : list (list Q); Dwf : list (list Q); Dm : list (list Q)
}.

(* Plant and model at one instant; fq = f1 ++ f2 are the values of f *)
Section Instant.
Variables (d : design) (m : generator).
Definition f1 (fq : list R) := firstn (nf d) fq.
Definition f2 (fq : list R) := skipn (nf d) fq.
Definition the_w (xm fq v : list R) := Cm m ** xm ++++ Dwf m ** f2 fq ++++ Dm m ** v.
Definition dot_x (x fq g w : list R) := A d ** x ++++ Bf d ** f1 fq ++++ g ++++ B d ** w.
Definition dot_xm (xm fq v : list R) := Am m ** xm ++++ Bmf m ** f2 fq ++++ Bm m ** v.
Definition the_q (x xm fq gq w v : list R) :=
  (Cq d ** x ++++ Dqf d ** f1 fq ++++ gq ++++ Dq d ** w) ++ (Cq2 m ** xm ++++ Dq2f m ** f2 fq ++++ Dq2 m ** v).
Definition the_y (x fq gy w : list R) := C d ** x ++++ Df d ** f1 fq ++++ gy ++++ D d ** w.
End Instant.

(* x, xm, v: lists of functions of time; xh, xmh: the estimates; q, qh: arguments of f, of plant and model; the others
   as in `trajectories`. The model in the observer has no v, and L1, L2 act on both. *)
Record driven (d : design) (m : generator) (f : R -> list R -> list R) (x xm xh xmh v : list (R -> R))
  (w wh q qh y yh g gq gy : R -> list R) : Prop := {
  count_x : length x = n d; count_xm : length xm = mn m; count_xh : length xh = n d; count_xmh : length xmh = mn m;
  count_v : length v = mv m; count_f : forall t r, length (f t r) = (nf d + mf m)%nat;
  count_g : forall t, length (g t) = n d; count_gq : forall t, length (gq t) = nq d;
  count_gy : forall t, length (gy t) = ny d;
  steady_v : forall t, 0 <= t -> steady v t;
  by_model : forall t, 0 <= t -> w t = the_w d m (at_ xm t) (f t (q t)) (at_ v t);
  moving_x : forall t, 0 <= t -> moves x t (dot_x d (at_ x t) (f t (q t)) (g t) (w t));
  moving_xm : forall t, 0 <= t -> moves xm t (dot_xm d m (at_ xm t) (f t (q t)) (at_ v t));
  having_q : forall t, 0 <= t -> q t = the_q d m (at_ x t) (at_ xm t) (f t (q t)) (gq t) (w t) (at_ v t);
  having_y : forall t, 0 <= t -> y t = the_y d (at_ x t) (f t (q t)) (gy t) (w t);
  by_observer : forall t, 0 <= t -> wh t = the_w d m (at_ xmh t) (f t (qh t)) [];
  moving_xh : forall t, 0 <= t -> moves (xh ++ xmh) t
    ((dot_x d (at_ xh t) (f t (qh t)) (g t) (wh t) ++ dot_xm d m (at_ xmh t) (f t (qh t)) [])
       ++++ L1 d ** vsubR (yh t) (y t));
  having_qh : forall t, 0 <= t -> qh t = the_q d m (at_ xh t) (at_ xmh t) (f t (qh t)) (gq t) (wh t) []
       ++++ L2 d ** vsubR (yh t) (y t);
  having_yh : forall t, 0 <= t -> yh t = the_y d (at_ xh t) (f t (qh t)) (gy t) (wh t)
}.

(* The same in samples, with predicted estimates; x, xm, v, .. are sequences of vectors *)
Record driven_predicted (d : design) (m : generator) (f : nat -> list R -> list R)
  (x xm xh xmh v w wh q qh y yh g gq gy : nat -> list R) : Prop := {
  many_x : forall k, length (x k) = n d; many_xm : forall k, length (xm k) = mn m;
  many_xh : forall k, length (xh k) = n d; many_xmh : forall k, length (xmh k) = mn m;
  many_v : forall k, length (v k) = mv m; many_f : forall k r, length (f k r) = (nf d + mf m)%nat;
  many_g : forall k, length (g k) = n d; many_gq : forall k, length (gq k) = nq d;
  many_gy : forall k, length (gy k) = ny d;
  model_w : forall k, w k = the_w d m (xm k) (f k (q k)) (v k);
  later_x : forall k, x (S k) = dot_x d (x k) (f k (q k)) (g k) (w k);
  later_xm : forall k, xm (S k) = dot_xm d m (xm k) (f k (q k)) (v k);
  same_q : forall k, q k = the_q d m (x k) (xm k) (f k (q k)) (gq k) (w k) (v k);
  same_y : forall k, y k = the_y d (x k) (f k (q k)) (gy k) (w k);
  model_wh : forall k, wh k = the_w d m (xmh k) (f k (qh k)) [];
  later_xh : forall k, xh (S k) ++ xmh (S k) =
    (dot_x d (xh k) (f k (qh k)) (g k) (wh k) ++ dot_xm d m (xmh k) (f k (qh k)) []) ++++ L1 d ** vsubR (yh k) (y k);
  same_qh : forall k,
    qh k = the_q d m (xh k) (xmh k) (f k (qh k)) (gq k) (wh k) [] ++++ L2 d ** vsubR (yh k) (y k);
  same_yh : forall k, yh k = the_y d (xh k) (f k (qh k)) (gy k) (wh k)
}.

(* .. and with filtered estimates: f is not in y, and the observer foresees y (k + 1) by a step without v *)
Record driven_filtered (d : design) (m : generator) (f : nat -> list R -> list R)
  (x xm xh xmh v w wh q qh y yh g gq gy : nat -> list R) : Prop := {
  all_x : forall k, length (x k) = n d; all_xm : forall k, length (xm k) = mn m;
  all_xh : forall k, length (xh k) = n d; all_xmh : forall k, length (xmh k) = mn m;
  all_v : forall k, length (v k) = mv m; all_f : forall k r, length (f k r) = (nf d + mf m)%nat;
  all_g : forall k, length (g k) = n d; all_gq : forall k, length (gq k) = nq d;
  all_gy : forall k, length (gy k) = ny d;
  its_w : forall k, w k = the_w d m (xm k) (f k (q k)) (v k);
  its_x : forall k, x (S k) = dot_x d (x k) (f k (q k)) (g k) (w k);
  its_xm : forall k, xm (S k) = dot_xm d m (xm k) (f k (q k)) (v k);
  its_q : forall k, q k = the_q d m (x k) (xm k) (f k (q k)) (gq k) (w k) (v k);
  its_y : forall k, y (S k) = C d ** x (S k) ++++ gy (S k) ++++ D d ** w (S k);
  its_wh : forall k, wh k = the_w d m (xmh k) (f k (qh k)) [];
  its_xh : forall k, xh (S k) ++ xmh (S k) =
    (dot_x d (xh k) (f k (qh k)) (g k) (wh k) ++ dot_xm d m (xmh k) (f k (qh k)) [])
      ++++ L1 d ** vsubR (yh (S k)) (y (S k));
  its_qh : forall k,
    qh k = the_q d m (xh k) (xmh k) (f k (qh k)) (gq k) (wh k) [] ++++ L2 d ** vsubR (yh (S k)) (y (S k));
  its_yh : forall k, yh (S k) = C d ** dot_x d (xh k) (f k (qh k)) (g k) (wh k) ++++ gy (S k)
    ++++ D d ** (Cm m ** dot_xm d m (xmh k) (f k (qh k)) [])
}.
Definition beside_at (a b : nat -> list R) (k : nat) := a k ++ b k.
(* What acts between the estimates k and k + 1: components of v k, and those of v (k + 1) that y (k + 1) has *)
Definition acting (now late : list bool) (v : nat -> list R) (k : nat) := picked now (v k) ++ picked late (v (S k)).
