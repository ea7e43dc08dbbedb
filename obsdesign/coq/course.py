"""How a theorem speaks of plant and observer over time: what runs they are of, and what is stated of them, in Coq."""

from obsdesign.records import dataclass, replace

NAME = "designed"  # the design in the file
MODEL = "model"  # the model of the disturbance
JOINED = f"(joined {NAME} {MODEL})"  # both as one plant


@dataclass(frozen=True)
class Course:
    """How a theorem speaks of plant and observer over time."""

    run: str  # what the signals are: a definition of the library
    time: str  # variable and type
    always: str  # for all of it
    files: str  # of the library
    instant: str
    error: str
    energy: str
    peak: str
    decay: str
    limits: str  # what of the words the theorem does not state
    claims: str = "claims_{}"  # the boolean that the kernel computes
    computed: str = NAME  # what it is computed of
    signals: str = "x xh v q qh y yh g gq gy"
    about: str = NAME  # what the run is of
    theorem: str = NAME  # what the theorem of the library is applied to
    whole: str = NAME  # design with the class of f, and the sizes of e and y

    @property
    def sampled(self) -> bool:
        """Whether time is counted in samples."""
        return self.time.endswith("nat")


CONTINUOUS = Course(
    run="trajectories",
    time="t : R",
    always="forall t, 0 <= t ->",
    files="ObsForm ObsDesign ObsHull ObsTrajectory ObsPlant ObsTheorem ObsMembers ObsRegions",
    instant="forall t, 0 <= t ->",
    error="error_at x xh",
    energy=f"""\
RInt (fun s => sq (zed {NAME} (e s))) 0 t <=
      V {NAME} (e 0) / Q2R (weight {NAME}) + Q2R gamma * Q2R gamma * RInt (fun s => sq (at_ v s)) 0 t""",
    peak=f"""\
(forall vbar, (forall s, 0 <= s <= t -> sq (at_ v s) <= vbar) ->
      sq (zed {NAME} (e t)) <= Q2R gamma * Q2R gamma * vbar
        + Q2R mu2 * exp (- (2 * Q2R (alpha {NAME}) * t)) * V {NAME} (e 0)
      /\\ V {NAME} (e t) <= Rmax (V {NAME} (e 0)) (Q2R mu1 * vbar))""",
    decay=f"""\
(forall s, 0 <= s <= t -> sq (at_ v s) = 0) ->
      Q2R (floor {NAME}) * sq (e t) <= exp (- (2 * Q2R (alpha {NAME}) * t)) * V {NAME} (e 0)""",
    limits="""\
These words are checked by nothing here. What Coq proves is {theorem}, at the end of this file:
- Of the words it states the bound on z, and floor |e|^2 <= exp(-2 alpha t) e0' P e0 where v = 0. As floor is less than
  the least eigenvalue of P, its constant is larger than sqrt(cond(P)){still}.
- Its premises: {premise};
  x and xhat are differentiable and v is continuous at every t >= 0.
- It does not state that trajectories exist, reconstruction where the plant has an f, where poles lie, steps of an
  implementation. What gain_bound and storage_bound say of bounds on L1 and P, Larger.larger_constants of larger
  Lipschitz constants, and reconstruction_bound of the reconstruction of w, where there are some, is beside it.
- That {given} below are those of the spec is believed{joined}.
  Here e = {error}, and L1 = -L where the words have L.""",
)
PREDICTED = Course(
    run="predicted",
    time="k : nat",
    always="forall k,",
    files="ObsForm ObsDesign ObsHull ObsTrajectory ObsPlant ObsTheorem ObsMembers ObsSamples ObsRegions",
    instant="forall N : nat,",
    error="error_of x xh",
    energy=f"""\
sum_to (fun k => sq (zed {NAME} (e k))) N <=
      V {NAME} (e 0%nat) / Q2R (weight {NAME}) + Q2R gamma * Q2R gamma * sum_to (fun k => sq (v k)) N""",
    peak=f"""\
(forall vbar, (forall k, (k < N)%nat -> sq (v k) <= vbar) -> 0 <= vbar ->
      sq (zed {NAME} (e N)) <= Q2R gamma * Q2R gamma * vbar
        + Q2R mu2 * Q2R (alpha {NAME}) ^ (2 * N) * V {NAME} (e 0%nat)
      /\\ V {NAME} (e N) <= Rmax (V {NAME} (e 0%nat)) (Q2R mu1 * vbar))""",
    decay=f"""\
(forall k, (k < N)%nat -> sq (v k) = 0) ->
      Q2R (floor {NAME}) * sq (e N) <= Q2R (alpha {NAME}) ^ (2 * N) * V {NAME} (e 0%nat)""",
    limits="""\
These words are checked by nothing here. What Coq proves is {theorem}, at the end of this file:
- Of the words it states the bound on z, and floor |e_N|^2 <= rho^(2 N) e0' P e0 where v = 0; alpha is rho there. As
  floor is less than the least eigenvalue of P, its constant is larger than sqrt(cond(P)){still}.
- Its premise: {premise}.
- It does not state that there are such sequences, or anything of a plant in continuous time. What gain_bound and
  storage_bound say of bounds on L1 and P, and Larger.larger_constants of larger Lipschitz constants, where there are
  some, is beside it.
- That {given} below are those of the spec is believed{joined}.
  Here e = {error}, and L1 = -L where the words have L.""",
    claims="claims_{}_of_samples",
)
FILTERED = replace(
    PREDICTED,
    run="filtered",
    limits=f"""{PREDICTED.limits}
- In v k are the disturbances of the sample k and those of the measurement y (k + 1): gamma is about this, and
  where the words have another gamma, of v itself, that follows from it.""",
    computed=f"(ahead {NAME})",
)


def driven(course: Course) -> Course:
    """The same with a model of w, whose file has the matrices of both, and no products of them."""
    sampled = course.sampled
    made = replace(
        course,
        run={"trajectories": "driven", "predicted": "driven_predicted", "filtered": "driven_filtered"}[course.run],
        signals="x xm xh xmh v w wh q qh y yh g gq gy",
        files=f"{course.files} ObsBlocks{'' if sampled else ' ObsSamples'} ObsModel ObsJoined",
        error="error_of (beside_at x xm) (beside_at xh xmh)" if sampled else "error_at (x ++ xm) (xh ++ xmh)",
        claims="claims_{}_of_sampled_model" if sampled else "claims_{}_of_model",
        computed=f"{NAME} {MODEL}",
        about=f"{NAME} {MODEL}",
        theorem=f"{NAME} {MODEL}",
        whole=JOINED,
    )
    if course is not FILTERED:
        return made
    acting = {
        part: getattr(made, part).replace("(v k)", "(acting now late v k)") for part in ("energy", "peak", "decay")
    }
    masked = f"{NAME} {MODEL} now late"
    limits = made.limits.replace("In v k", "In acting now late v k")
    claims = "claims_{}_of_filtered_model"
    return replace(made, claims=claims, computed=masked, theorem=masked, limits=limits, **acting)
