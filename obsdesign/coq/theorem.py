"""The claim of a dissipation inequality as a file of Coq: the numbers of the result, T, and the theorem.

Coq computes the matrix of the inequality itself from the numbers of the file. With

    V' + 2 alpha V + weight |H e|^2 - supply |v|^2 <= 0,    V = e' P e >= floor |e|^2,

or V+ - rho^2 V in the place of V' + 2 alpha V, weight = mu1 and supply = mu2 where a claim is about the energy of z,
weight = 0 and supply = 2 alpha mu1, or (1 - rho^2) mu1, where it is about its peak, the theorem states the guarantee
for every f of the class and all trajectories of plant and observer.
"""

import re
from dataclasses import dataclass, replace
from typing import NamedTuple

from flint import fmpq

from obsdesign.coq.bounds import bounded
from obsdesign.coq.congruence import congruence, triangle
from obsdesign.coq.decimals import comment, matrix, number
from obsdesign.coq.hulls import Hull, of_hulls
from obsdesign.coq.membership import Ending, Words, ending
from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.certificate import Certificate
from obsdesign.lmi.formula import Array, Exact, Values, identity, rational, rational_number, zeros
from obsdesign.model.filtered import apart
from obsdesign.model.multiplier import Scaled, Sum
from obsdesign.model.plant import Plant
from obsdesign.nonlinearities.cone import Cone
from obsdesign.nonlinearities.jacobian import Polytope
from obsdesign.spec import Spec

NAME = "designed"  # the design in the file
FLOOR = 0.9  # of the least eigenvalue of P, which decay is told with


@dataclass(frozen=True)
class Course:
    """How a theorem speaks of plant and observer over time."""

    run: str  # what x, xhat, .. are: a definition of the library
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
    design: str = NAME  # what it is computed of


CONTINUOUS = Course(
    run="trajectories",
    time="t : R",
    always="forall t, 0 <= t ->",
    files="ObsForm ObsDesign ObsHull ObsTrajectory ObsPlant ObsTheorem ObsMembers ObsRegions",
    instant="forall t, 0 <= t ->",
    error="error_at",
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
- It does not state reconstruction, larger Lipschitz constants, where poles lie, steps of an implementation, that
  trajectories exist. What gain_bound and storage_bound say of bounds on L1 and P, where there are some, is beside it.
- That {given} below are those of the spec is believed.
  Here e = xhat - x, and L1 = -L where the words have L.""",
)
PREDICTED = Course(
    run="predicted",
    time="k : nat",
    always="forall k,",
    files="ObsForm ObsDesign ObsHull ObsTrajectory ObsPlant ObsTheorem ObsMembers ObsSamples ObsRegions",
    instant="forall N : nat,",
    error="error_of",
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
- It does not state larger Lipschitz constants, that there are such sequences, or anything of a plant in continuous
  time. What gain_bound and storage_bound say of bounds on L1 and P, where there are some, is beside it.
- That {given} below are those of the spec is believed.
  Here e = xhat - x, and L1 = -L where the words have L.""",
    claims="claims_{}_of_samples",
)
FILTERED = replace(
    PREDICTED,
    run="filtered",
    limits=PREDICTED.limits
    + """
- In v k stand the disturbances of the sample k and those of the measurement y (k + 1): gamma is about this v, and
  where the words have another gamma, of v itself, that follows from it.""",
    design=f"(ahead {NAME})",
)
IMPORTS = """\
Require Import Reals ZArith QArith Qreals List Lra Psatz.
From Coquelicot Require Import Coquelicot.
From Obs Require Import {files}.
Import ListNotations.
"""


class UnexportedError(Exception):
    """A part of a claim that no file of Coq is written of, in words."""


def exported(certificate: Certificate, spec: Spec, statement: str, bounds: Bounds = NO_BOUNDS) -> str:
    """File of Coq with the claim of a certificate that holds, headed by what it is about; `bounds`: kept ones."""
    course, plant = CONTINUOUS, certificate.family.plant
    if certificate.family.about.pace.sampled:
        course = FILTERED if spec.observer.filtered else PREDICTED
        plant = apart(spec.augmented) if spec.observer.filtered else plant
    text, end = written(certificate, spec, plant, course, bounds)
    head = heading(spec, statement, course, end, plant, not certificate.rate)
    return "\n".join([*map(comment, head), text])


def stated(text: str) -> str:
    """What the theorem of such a file states, in Coq, on one line."""
    start = text.rindex("\nTheorem for_") + 1
    return " ".join(text[start : text.index("Proof.", start)].split())


class Subject(NamedTuple):
    """The last theorem of a file: its name, and why it is about a class and not about the f of the spec."""

    theorem: str
    reason: str  # empty where it is about that f

    def words(self) -> list[str]:
        """What is said of it."""
        if not self.reason:
            return ["about the f of the spec"]
        return ["about every f of the class", f"that the f of the spec is one of them is not shown: {self.reason}"]


def subject(text: str) -> Subject:
    """What the theorem of such a file is about."""
    name = re.findall(r"^Theorem (for_\w+)", text, re.MULTILINE)[-1]
    reason = re.search(r"^\(\* for_the_class is about every f of its class: (.*) \*\)$", text, re.MULTILINE)
    return Subject(name, reason[1] if reason else "")


def written(
    certificate: Certificate, spec: Spec, plant: Plant[Exact], course: Course, bounds: Bounds = NO_BOUNDS
) -> tuple[str, Ending]:
    """Design, T, and the theorems with their proofs; and how they end."""
    family, peak = certificate.family, certificate.guarantee.norm == "sup"
    H, P = family.H, certificate.P
    weight, supply = (fmpq(0), family.loss * certificate.mu1) if peak else (certificate.mu1, certificate.mu2)
    values = {**certificate.multipliers, "P": P, "Y": P @ family.L1}
    floor = rational_number(f"{FLOOR * certificate.guarantee.spectrum[0]:.3g}")
    levels = {"weight": weight, "supply": supply, "floor": floor}
    forms = {
        "T": -family.dissipation(values, weight * (H.mT @ H), rational([[supply]])),
        "TP": P - floor * identity(len(P), P),
        **({"TO": certificate.mu2 * P - H.mT @ H} if peak else {}),
    }
    what, constants = ("peak", ("gamma", "mu1", "mu2")) if peak else ("energy", ("gamma",))
    arguments = " ".join([*constants, *forms, "TH"])
    run = f"forall x xh v q qh y yh g gq gy, {course.run} {NAME} f x xh v q qh y yh g gq gy ->"
    error = f"let e := {course.error} x xh in"
    concluded = f"{course.instant}\n  {error}\n  {getattr(course, what)}\n  /\\ ({course.decay})."
    words = Words(course.time, course.always, course.run, run, concluded)
    rays = [*multipliers(certificate), *((fmpq(1), *hull.M) for hull in hulls(certificate))]
    end = ending(spec.nonlinearities, rays, NAME, words)
    text = "\n".join(
        [
            IMPORTS.format(files=course.files),
            "Open Scope Q_scope.",
            record(certificate, plant, levels),
            *(f"Definition {key} : Q := {number(getattr(certificate, key))}." for key in constants),
            "Open Scope Z_scope.",
            *(f"Definition {name} := {triangle(congruence(S))}." for name, S in forms.items()),
            f"Definition TH : list (list (list (list Z))) := {of_hulls(hulls(certificate))}.",
            "Open Scope R_scope.",
            "",
            *bounded(certificate, bounds, NAME),
            f"Lemma proved : {course.claims.format(what)} {course.design} {arguments} = true.",
            "Proof. vm_cast_no_check (eq_refl true). Qed.",
            "",
            f"Theorem for_the_class : forall f, of_class {NAME} f ->",
            f"  {run} {concluded}",
            f"Proof. exact ({what}_of_{course.run} {NAME} {arguments} proved). Qed.",
            "",
            *end.lines,
        ]
    )
    return text, end


def heading(spec: Spec, statement: str, course: Course, end: Ending, plant: Plant[Exact], still: bool) -> list[str]:
    """What the file is about, in words; none of it is checked by Coq. `still`: whether the rate is that of no decay."""
    names = {"x": [*spec.plant.states, *spec.model_states], "v": plant.exogenous, "y": plant.outputs}
    rate = "rho = 1" if course.error == "error_of" else "alpha = 0"
    limits = course.limits.format(
        theorem=end.theorem,
        premise=end.premise,
        given="the numbers and the f" if end.theorem == "for_this_f" else "the numbers",
        still=f"; at {rate} it\n  says that e stays bounded" if still else "",
    )
    return [
        f"obsdesign: the guarantee of {spec.name}, type {spec.observer.type}, as a theorem",
        "; ".join(f"{key}: {', '.join(name)}" for key, name in names.items()),
        f"in words: {statement}",
        *limits.splitlines(),
    ]


def record(certificate: Certificate, plant: Plant[Exact], levels: dict[str, fmpq]) -> str:
    """The design: plant, gains, storage function, multipliers, with the numbers of the result."""
    family = certificate.family
    sizes = {"n": plant.n, "nf": plant.Bf.shape[1], "nv": plant.B.shape[1], "ny": len(plant.C), "nq": len(plant.Cq)}
    matrices = {key: getattr(plant, key) for key in ("A", "Bf", "B", "C", "Df", "D", "Cq", "Dqf", "Dq")}
    matrices |= {"H": family.H, "L1": family.L1, "L2": family.L2, "P": certificate.P}
    rays = ";\n    ".join(
        f"{{| scaling := {number(scale)}; M11 := {matrix(M11)}; M12 := {matrix(M12)}; M22 := {matrix(M22)} |}}"
        for scale, M11, M12, M22 in multipliers(certificate)
    )
    written = ";\n    ".join(hull.written() for hull in hulls(certificate))
    numbers = {"alpha": family.about.pace.told(family.rate), **levels}
    return "\n".join(
        [
            f"Definition {NAME} : design := {{|",
            "  " + " ".join(f"{key} := {size}%nat;" for key, size in sizes.items()),
            *(f"  {key} := {matrix(M)};" for key, M in matrices.items()),
            "  " + " ".join(f"{key} := {number(x)};" for key, x in numbers.items()),
            f"  multipliers := [{rays}];",
            f"  hulls := [{written}] |}}.",
        ]
    )


def multipliers(certificate: Certificate) -> list[tuple[fmpq, Array, Array, Array]]:
    """Scale and matrices M11, M12, M22 of each inequality of the class that has a scale."""
    multiplier, rays = certificate.family.multiplier, []
    unknowns = multiplier.unknowns()
    for label, block in multiplier.labelled():
        for one in block.unknowns(label) if isinstance(block, Scaled | Sum) else ():
            none = {other.name: zeros(other.shape, [block.member]) for other in unknowns}
            unit: Values = none | {one.name: rational([[1]])}
            rays.append((certificate.multipliers[one.name].item(), *multiplier.matrix(unit)))
    return rays


def hulls(certificate: Certificate) -> list[Hull]:
    """Multipliers that are matrices."""
    multiplier, found, q, f = certificate.family.multiplier, [], 0, 0
    for label, block in multiplier.labelled():
        if isinstance(block, Cone | Polytope):
            M = block.matrix(certificate.multipliers, label)
            found.append(Hull.of(block, M, (q, f), multiplier.member.shape[::-1]))
        q, f = q + block.nq, f + block.nf
    return found
