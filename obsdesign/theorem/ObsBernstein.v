(* obsdesign: Polynomials in Bernstein form, of any degree: sign, derivative,
  and what a function gains whose slope is bounded. *)
Require Import Reals List Lia Lra.
From Coquelicot Require Import Coquelicot.
Open Scope R_scope.

(* Value at s of the polynomial with the control values a 0 .. a d (de Casteljau) *)
Fixpoint bez (d : nat) (a : nat -> R) (s : R) : R :=
  match d with O => a O | S d => (1 - s) * bez d a s + s * bez d (fun k => a (S k)) s end.

(* It is linear in its control values *)
Lemma bez_ext d : forall a b s, (forall k, (k <= d)%nat -> a k = b k) -> bez d a s = bez d b s.
Proof.
 induction d; intros a b s H; simpl; [apply H; lia|].
 rewrite (IHd a b), (IHd (fun k => a (S k)) (fun k => b (S k))); auto; intros; apply H; lia. Qed.
Lemma bez_add d : forall a b s, bez d (fun k => a k + b k) s = bez d a s + bez d b s.
Proof. induction d; intros a b s; simpl; auto. rewrite IHd, (IHd (fun k => a (S k)) (fun k => b (S k))). ring. Qed.
Lemma bez_scale d : forall c a s, bez d (fun k => c * a k) s = c * bez d a s.
Proof. induction d; intros c a s; simpl; auto. rewrite IHd, (IHd c (fun k => a (S k))). ring. Qed.
Lemma bez_const d : forall c s, bez d (fun _ => c) s = c.
Proof. induction d; intros c s; simpl; auto. rewrite !IHd. ring. Qed.

(* It begins with the first control value and ends with the last one *)
Lemma bez_start d : forall a, bez d a 0 = a O.
Proof. induction d; intros a; simpl; auto. rewrite IHd. ring. Qed.
Lemma bez_end d : forall a, bez d a 1 = a d.
Proof. induction d; intros a; simpl; auto. rewrite (IHd (fun k => a (S k))). ring. Qed.

(* On [0, 1] it keeps the bounds of its control values *)
Lemma bez_nonneg d : forall a s, 0 <= s <= 1 -> (forall k, (k <= d)%nat -> 0 <= a k) -> 0 <= bez d a s.
Proof.
 induction d; intros a s Hs H; simpl; [apply H; lia|].
 assert (0 <= bez d a s) by (apply IHd; auto).
 assert (0 <= bez d (fun k => a (S k)) s) by (apply IHd; auto; intros; apply H; lia).
 assert (0 <= (1 - s) * bez d a s) by (apply Rmult_le_pos; lra).
 assert (0 <= s * bez d (fun k => a (S k)) s) by (apply Rmult_le_pos; lra). lra. Qed.
Lemma bez_le d a c s : 0 <= s <= 1 -> (forall k, (k <= d)%nat -> a k <= c) -> bez d a s <= c.
Proof.
 intros Hs H. assert (K := bez_nonneg d (fun k => c + -1 * a k) s Hs). rewrite bez_add, bez_scale, bez_const in K.
 assert (0 <= c + -1 * bez d a s); [|lra]. apply K. intros k Hk. specialize (H k Hk). lra. Qed.
Lemma bez_ge d a c s : 0 <= s <= 1 -> (forall k, (k <= d)%nat -> c <= a k) -> c <= bez d a s.
Proof.
 intros Hs H. assert (K := bez_nonneg d (fun k => a k + -1 * c) s Hs).
 rewrite bez_add, (bez_const d (-1 * c)) in K.
 assert (0 <= bez d a s + -1 * c); [|lra]. apply K. intros k Hk. specialize (H k Hk). lra. Qed.

(* Its derivative in s has, at the same degree, the control values k (a_k - a_(k-1)) + (d - k) (a_(k+1) - a_k) *)
Definition slopes (d : nat) (a : nat -> R) (k : nat) : R :=
  INR k * (a k - a (pred k)) + (INR d - INR k) * (a (S k) - a k).
Lemma slopes_step d a s : bez (S d) (slopes (S d) a) s =
  bez d (fun k => a (S k)) s - bez d a s + (1 - s) * bez d (slopes d a) s + s * bez d (slopes d (fun k => a (S k))) s.
Proof.
 cbn [bez].
 rewrite (bez_ext d (slopes (S d) a) (fun k => (a (S k) + -1 * a k) + slopes d a k))
   by (intros; unfold slopes; rewrite S_INR; ring).
 rewrite (bez_ext d (fun k => slopes (S d) a (S k)) (fun k => (a (S k) + -1 * a k) + slopes d (fun k => a (S k)) k)).
 - rewrite !bez_add, !bez_scale. ring.
 - intros k _. unfold slopes. rewrite !S_INR. destruct k; [simpl; ring|]. cbn [pred]. rewrite ?S_INR. ring. Qed.

(* Derivative in t where both the control values and s depend on t *)
Theorem bez_moves d : forall (a : nat -> R -> R) (da : nat -> R) (s : R -> R) (ds t : R),
  (forall k, is_derive (a k) t (da k)) -> is_derive s t ds ->
  is_derive (fun r => bez d (fun k => a k r) (s r)) t
    (bez d da (s t) + ds * bez d (slopes d (fun k => a k t)) (s t)).
Proof.
 induction d; intros a da s ds t Ha Hs.
 - simpl. replace (da O + ds * slopes 0 (fun k => a k t) 0) with (da O) by (unfold slopes; simpl; ring). apply Ha.
 - rewrite slopes_step. cbn [bez].
   set (u := bez d (fun k => a k t) (s t)). set (w := bez d (fun k => a (S k) t) (s t)).
   set (du := bez d da (s t) + ds * bez d (slopes d (fun k => a k t)) (s t)).
   set (dw := bez d (fun k => da (S k)) (s t) + ds * bez d (slopes d (fun k => a (S k) t)) (s t)).
   assert (Ds : is_derive (fun r => 1 - s r) t (- ds)).
   { replace (- ds) with (minus 0 ds) by (unfold minus, plus, opp; simpl; ring).
     apply (is_derive_minus (fun _ => 1) s); auto. apply (is_derive_const (K := R_AbsRing) (V := R_NormedModule)). }
   assert (Du : is_derive (fun r => (1 - s r) * bez d (fun k => a k r) (s r)) t (- ds * u + (1 - s t) * du)).
   { exact (is_derive_mult _ _ t _ _ Ds (IHd a da s ds t Ha Hs) Rmult_comm). }
   assert (Dw : is_derive (fun r => s r * bez d (fun k => a (S k) r) (s r)) t (ds * w + s t * dw)).
   { exact (is_derive_mult _ _ t _ _ Hs (IHd _ _ s ds t (fun k => Ha (S k)) Hs) Rmult_comm). }
   match goal with |- is_derive _ _ ?l => replace l with (plus (- ds * u + (1 - s t) * du) (ds * w + s t * dw)) end.
   + exact (is_derive_plus _ _ _ _ _ Du Dw).
   + unfold plus, u, w, du, dw. simpl. ring. Qed.

(* A function that is held at the ends of [a, b] *)
Definition clamp (a b s : R) := (a + b + Rabs (s - a) - Rabs (s - b)) / 2.
Lemma clamp_in a b s : a <= b -> a <= clamp a b s <= b.
Proof. intros H. unfold clamp, Rabs. destruct (Rcase_abs (s - a)), (Rcase_abs (s - b)); lra. Qed.
Lemma clamp_id a b s : a <= s <= b -> clamp a b s = s.
Proof. intros H. unfold clamp, Rabs. destruct (Rcase_abs (s - a)), (Rcase_abs (s - b)); lra. Qed.
Lemma clamp_continuous a b s : continuous (clamp a b) s.
Proof.
 assert (K : forall c, continuous (fun s => Rabs (s - c)) s).
 { intros c. apply (continuous_comp (fun s => s - c) Rabs); [|apply continuous_Rabs].
   apply (continuous_minus (fun s => s) (fun _ => c)); [apply continuous_id|apply continuous_const]. }
 unfold clamp. apply (continuous_mult (fun s => a + b + Rabs (s - a) - Rabs (s - b)) (fun _ => / 2)).
 - apply (continuous_minus (fun s => a + b + Rabs (s - a)) (fun s => Rabs (s - b))); auto.
   apply (continuous_plus (fun _ => a + b) (fun s => Rabs (s - a))); auto. apply continuous_const.
 - apply continuous_const. Qed.

Definition continuous_on (g : R -> R) (a b : R) := forall s, a <= s <= b -> continuous g s.
Lemma integrable g a b : a <= b -> continuous_on g a b -> ex_RInt g a b.
Proof.
 intros H K. apply (ex_RInt_continuous (V := R_CompleteNormedModule)). intros s Hs.
 rewrite Rmin_left, Rmax_right in Hs by lra. now apply K. Qed.
Lemma integral_joins g a b c : a <= b <= c -> continuous_on g a c -> RInt g a c = RInt g a b + RInt g b c.
Proof.
 intros H K. symmetry. apply (RInt_Chasles (V := R_CompleteNormedModule)).
 - apply integrable; [lra|]. intros s Hs. apply K. lra.
 - apply integrable; [lra|]. intros s Hs. apply K. lra. Qed.

(* Where W' + g <= 0, what W loses is no less than the integral of g *)
Lemma falls_by (W w g : R -> R) a b : a <= b -> continuous_on g a b ->
  (forall s, a <= s <= b -> is_derive W s (w s)) -> (forall s, a <= s <= b -> w s + g s <= 0) ->
  W b + RInt g a b <= W a.
Proof.
 intros Hab Hg HW Hw. set (h := fun s => g (clamp a b s)).
 assert (Ch : forall s, continuous h s).
 { intros s. apply (continuous_comp (clamp a b) g); [apply clamp_continuous|]. apply Hg. now apply clamp_in. }
 assert (Dh : forall s, is_derive (fun r => RInt h a r) s (h s)).
 { intros s. apply (is_derive_RInt h _ a s); [|apply Ch]. apply filter_forall. intros r.
   apply (RInt_correct (V := R_CompleteNormedModule)), (ex_RInt_continuous (V := R_CompleteNormedModule)). auto. }
 assert (E : RInt g a b = RInt h a b).
 { apply RInt_ext. intros s Hs. rewrite Rmin_left, Rmax_right in Hs by lra. unfold h. rewrite clamp_id; auto. lra. }
 assert (D : forall s, a <= s <= b -> is_derive (fun r => W r + RInt h a r) s (w s + h s)).
 { intros s Hs. apply (is_derive_plus W (fun r => RInt h a r)); auto. }
 destruct (MVT_gen (fun r => W r + RInt h a r) a b (fun s => w s + h s)) as (c & Hc & F).
 - intros s Hs. rewrite Rmin_left, Rmax_right in Hs by lra. apply D. lra.
 - intros s Hs. rewrite Rmin_left, Rmax_right in Hs by lra. apply derivable_continuous_pt.
   exists (w s + h s). now apply is_derive_Reals, D.
 - rewrite Rmin_left, Rmax_right in Hc by lra. specialize (Hw c Hc). unfold h in F at 3. rewrite clamp_id in F by auto.
   rewrite RInt_point in F. unfold zero in F. simpl in F. rewrite E.
   assert (0 <= - (w c + g c) * (b - a)) by (apply Rmult_le_pos; lra). lra. Qed.
