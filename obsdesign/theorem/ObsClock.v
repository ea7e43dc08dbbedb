(* obsdesign: The certificate of an observer with measurements at instants: quadratic forms of the time that is left to
   the next one, what must not be negative of them, and what the kernel computes. *)
Require Import Reals ZArith QArith Qreals List Lia Lra Bool.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign ObsTrajectory ObsPlant ObsBernstein ObsInstants.
Import ListNotations.
Open Scope R_scope.

(* The certificate: on each segment of the time left P is a polynomial with the matrices `controls`; `scales` are those
   of the multipliers at each of them. What it proves: V' + 2 rate V + weight |z|^2 - mu |w|^2 <= 0 in between,
   V+ <= V + kappa |eta|^2 at a measurement, V <= roof |Se e + St th|^2. *)
Record segment := { width : Q; controls : list (list (list Q)); scales : list (list Q) }.
Record witness := {
  rate : Q; weight : Q; mu : Q; kappa : Q; roof : Q;
  driven : bool; noisy : bool;                                 (* whether w and eta act *)
  segments : list segment
}.

Section Instant.
Variable o : observer.
Definition value (M : list (list Q)) (x : list R) := dotR x (M ** x).
Definition value_dot (M : list (list Q)) (x dx : list R) := dotR dx (M ** x) + dotR x (M ** dx).

(* The same as programs over e ++ th ++ f ++ w *)
Variable c : witness.
Definition entries (acts : bool) (k : nat) : nat := if acts then k else O.
Definition le := Part 0 (n o).
Definition lt := Part (n o) (nt o).
Definition lf := Part (n o + nt o) (nf o).
Definition lw := Part (n o + nt o + nf o) (entries (driven c) (nw o)).
Definition lx := Add (Mul (Se o) le) (Mul (St o) lt).
Definition led := Sub (Add (Add (Mul (A o) le) (Mul (Bf o) lf)) (Mul (B o) lw)) (Mul (L o) lt).
Definition ldx := Add (Mul (Se o) led) (Mul (St o) (Mul (H o) lt)).
Definition lq := Add (Add (Mul (Cq o) le) (Mul (Dqf o) lf)) (Mul (Dq o) lw).
Definition lz := Mul (Cp o) le.
(* and over e ++ th ++ eta *)
Definition ln := Part (n o + nt o) (entries (noisy c) (ny o)).
Definition lr := Add (Mul (C o) le) ln.
Definition lxa := Add (Mul (Se o) (Sub le (Mul (K o) lr))) (Mul (St o) (Mul (G o) lr)).

(* The forms that must not be negative at the control value k of a segment *)
Definition control (s : segment) (k : nat) := nth k (controls s) [].
Definition degree (s : segment) := pred (length (controls s)).
Definition number (k : nat) : Q := inject_Z (Z.of_nat k).
Definition minus_sigma (sm : Q * multiplier) : list term :=
  let (s, m) := sm in
  [(Qopp s, lq, Mul (M11 m) lq); (Qopp (2 * s), lq, Mul (M12 m) lf); (Qopp s, lf, Mul (M22 m) lf)].
Definition flow (s : segment) (k : nat) : list term :=
  let from := (number k / width s)%Q in let to := ((number (degree s) - number k) / width s)%Q in
  [(Qopp from, lx, Mul (control s (pred k)) lx); ((from - to - 2 * rate c)%Q, lx, Mul (control s k) lx);
   (to, lx, Mul (control s (S k)) lx);                        (* from P (k - 1) to P (k + 1): x' (P' - 2 rate P) x *)
   (Qopp 1, ldx, Mul (control s k) lx); (Qopp 1, lx, Mul (control s k) ldx);
   (Qopp (weight c), lz, lz); (mu c, lw, lw)]
  ++ flat_map minus_sigma (combine (nth k (scales s) []) (multipliers o)).
Definition first : list (list Q) := match segments c with s :: _ => control s 0 | [] => [] end.
Definition jump (s : segment) (k : nat) : list term :=
  [(1%Q, lx, Mul first lx); (Qopp 1, lxa, Mul (control s k) lxa); (kappa c, ln, ln)].
Definition below (s : segment) (k : nat) : list term := [(roof c, lx, lx); (Qopp 1, lx, Mul (control s k) lx)].
Definition above (floor : Q) (s : segment) (k : nat) : list term :=
  [(1%Q, lx, Mul (control s k) lx); (Qopp floor, lx, lx)].

(* What the kernel computes; T: triangular matrices for each segment and control value *)
Fixpoint everywhere N (form : segment -> nat -> list term) (segs : list segment) (T : list (list (list (list Z)))) :=
  match segs with
  | [] => true
  | s :: rest => forallb (fun k => check false N (form s k) (nth k (hd [] T) [])) (seq 0 (S (degree s)))
      && everywhere N form rest (tl T)
  end.
(* jumps: to the control values of the segments that meet [T1, T2], of the last one to the last value where T1 = T2 *)
Definition ends_early (from : Q) (s : segment) (rest : list segment) : bool :=
  match rest with [] => false | _ => Qle_bool (from + width s) (T1 o) end.
Definition only_last (rest : list segment) : bool :=
  match rest with [] => Qle_bool (T2 o) (T1 o) | _ => false end.
Fixpoint settles N (from : Q) (segs : list segment) (T : list (list (list (list Z)))) :=
  match segs with
  | [] => true
  | s :: rest =>
      forallb (fun k => ends_early from s rest || (only_last rest && negb (k =? degree s)%nat)
        || check false N (jump s k) (nth k (hd [] T) [])) (seq 0 (S (degree s)))
      && settles N (from + width s)%Q rest (tl T)
  end.
Definition Q_same (a b : Q) : {a = b} + {a <> b}.
Proof. decide equality; [apply Pos.eq_dec|apply Z.eq_dec]. Defined.
Definition same (M N : list (list Q)) : bool := if list_eq_dec (list_eq_dec Q_same) M N then true else false.
Fixpoint joined (segs : list segment) : bool :=
  match segs with s :: (s' :: _) as rest => same (control s (degree s)) (control s' 0) && joined rest | _ => true end.
Fixpoint whole (segs : list segment) : Q := match segs with [] => 0 | s :: rest => width s + whole rest end.
Definition sound : bool :=
  negb (Qle_bool (whole (segments c)) 0) && Qle_bool 0 (T1 o) && Qeq_bool (T2 o) (whole (segments c)) &&
  Qle_bool 0 (rate c) && joined (segments c) &&
  forallb (fun s => negb (Qle_bool (width s) 0) && forallb (forallb (Qle_bool 0)) (scales s)) (segments c).
Definition certified TF TJ TR : bool :=
  sound && everywhere (n o + nt o + nf o + entries (driven c) (nw o)) flow (segments c) TF &&
  settles (n o + nt o + entries (noisy c) (ny o)) 0 (segments c) TJ &&
  everywhere (n o + nt o) below (segments c) TR.

(* The storage function, of the time tau that is left *)
Definition poly (s : segment) (tau : R) (x : list R) :=
  bez (degree s) (fun k => value (control s k) x) (tau / Q2R (width s)).
Fixpoint storage (segs : list segment) (tau : R) (x : list R) : R :=
  match segs with
  | [] => 0
  | s :: [] => poly s tau x
  | s :: rest => if Rlt_dec tau (Q2R (width s)) then poly s tau x else storage rest (tau - Q2R (width s)) x
  end.
End Instant.
