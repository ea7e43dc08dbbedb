(* obsdesign: The f of a spec as a member of the class of an observer with measurements at instants. *)
Require Import Reals QArith List.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign ObsPlant ObsInstants.
Import ListNotations.
Open Scope R_scope.

(* A design with the class of an observer: of no other entry of it anything is said *)
Definition class_of (o : observer) : design := {|
  ObsDesign.n := 0; ObsDesign.nf := nf o; nv := 0; ObsDesign.ny := 0; ObsDesign.nq := nq o;
  ObsDesign.A := []; ObsDesign.Bf := []; ObsDesign.B := []; ObsDesign.C := []; Df := []; D := [];
  ObsDesign.Cq := []; ObsDesign.Dqf := []; ObsDesign.Dq := []; ObsDesign.H := []; L1 := []; L2 := []; P := [];
  alpha := 0; weight := 0; supply := 0; ObsDesign.floor := 0;
  ObsDesign.multipliers := multipliers o; hulls := [] |}%Q.
Lemma of_instants o (f : R -> list R -> list R) : ObsPlant.of_class (class_of o) f -> of_class o f.
Proof. intros C t a b m La Lb Hm. now apply (proj1 (C t a b La Lb)). Qed.

(* Trajectories that stay where two functions have the same values *)
Lemma instants_of_region o f g (region : list R -> Prop) t x xh th w q qh g1 gq y gy eta :
  trajectories o f t x xh th w q qh g1 gq y gy eta -> (forall s r, length (g s r) = nf o) ->
  (forall s r, region r -> g s r = f s r) ->
  (forall j s, t j <= s <= t (S j) -> region (q j s) /\ region (qh j s)) ->
  trajectories o g t x xh th w q qh g1 gq y gy eta.
Proof. intros [] Len E I. split; auto; intros j s Hs; destruct (I j s Hs); rewrite E by assumption; auto. Qed.
