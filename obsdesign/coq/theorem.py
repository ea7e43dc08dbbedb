"""The claim of a dissipation inequality as a file of Coq: the numbers of the result, T, and the theorem.

Coq computes the matrix of the inequality itself from the numbers of the file. With

    V' + 2 alpha V + weight |H e|^2 - supply |v|^2 <= 0,    V = e' P e >= floor |e|^2,

weight = mu1 and supply = mu2 where a claim is about the energy of z, weight = 0 and supply = 2 alpha mu1 where it is
about its peak, the theorem states the guarantee for every f of the class and all trajectories of plant and observer.
"""

from dataclasses import dataclass

import numpy as np
from flint import fmpq

from obsdesign.coq.congruence import congruence, triangle
from obsdesign.coq.decimals import comment, matrix, number
from obsdesign.dissipation.certificate import Certificate
from obsdesign.lmi.formula import Array, Values, identity, rational, rational_number
from obsdesign.model.multiplier import Matrix, Multiplier, Scaled, Sum
from obsdesign.spec import Spec

SAYS = {"T": "the dissipation inequality", "TP": "P > 0", "TO": "|z|^2 <= mu2 V"}  # what T stands for
NAME = "designed"  # the design in the file
FLOOR = 0.9  # of the least eigenvalue of P, which decay is told with
IMPORTS = """\
Require Import Reals ZArith QArith Qreals List Lra Psatz.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign ObsTrajectory ObsPlant ObsTheorem.
Import ListNotations.
"""
LIMITS = """\
These words are checked by nothing here. What Coq proves is for_the_class, at the end of this file:
- Of the words it states the bound on z, and floor |e|^2 <= exp(-2 alpha t) e0' P e0 where v = 0. As floor is less than
  the least eigenvalue of P, its constant is larger than sqrt(cond(P)); at alpha = 0 it says that e stays bounded.
- Its premises: f satisfies the inequalities of multipliers for all arguments, also where the words are local;
  x and xhat are differentiable and v is continuous at every t >= 0.
- It does not state (P2), bounds on gains and P, reconstruction, larger Lipschitz constants, that trajectories exist.
- That the numbers below are those of the spec is believed. Here e = xhat - x, and L1 = -L where the words have L."""
DECAY = f"""\
(forall s, 0 <= s <= t -> sq (at_ v s) = 0) ->
      Q2R (floor {NAME}) * sq (e t) <= exp (- (2 * Q2R (alpha {NAME}) * t)) * V {NAME} (e 0)"""


@dataclass(frozen=True)
class Kind:
    """What is stated of a claim: the boolean that the kernel computes, the theorem of the library, the conclusion."""

    claims: str
    lemma: str
    levels: tuple[str, ...]  # numbers of the claim that they take
    conclusion: str


ENERGY = Kind(
    "claims_energy",
    "energy_guarantee",
    ("gamma",),
    f"""\
RInt (fun s => sq (zed {NAME} (e s))) 0 t <=
      V {NAME} (e 0) / Q2R (weight {NAME}) + Q2R gamma * Q2R gamma * RInt (fun s => sq (at_ v s)) 0 t""",
)
PEAK = Kind(
    "claims_peak",
    "peak_guarantee",
    ("gamma", "mu1", "mu2"),
    f"""\
(forall vbar, (forall s, 0 <= s <= t -> sq (at_ v s) <= vbar) ->
      sq (zed {NAME} (e t)) <= Q2R gamma * Q2R gamma * vbar
        + Q2R mu2 * exp (- (2 * Q2R (alpha {NAME}) * t)) * V {NAME} (e 0))""",
)


class UnexportedError(Exception):
    """A part of a claim that no file of Coq is written of, in words."""


def exported(certificate: Certificate, spec: Spec, statement: str) -> str:
    """File of Coq with the claim of a certificate that holds, headed by what it is about.

    Raises `UnexportedError`: the claim is one of samples, or has a multiplier that is no scale; or no T was found.
    """
    return "\n".join([*map(comment, heading(spec, statement)), written(certificate)])


def stated(text: str) -> str:
    """What the theorem of such a file states, in Coq, on one line."""
    start = text.index("Theorem for_the_class : ")
    return " ".join(text[start : text.index("Proof.", start)].split())


def written(certificate: Certificate) -> str:
    """Design, T, and the theorem with its proof. Raises `UnexportedError`."""
    family, peak = certificate.family, certificate.guarantee.norm == "sup"
    if family.about.pace.sampled:
        raise UnexportedError("a claim about samples is not exported yet, those of plants in continuous time are")
    kind, H, P = PEAK if peak else ENERGY, family.H, certificate.P
    weight, supply = (fmpq(0), 2 * family.rate * certificate.mu1) if peak else (certificate.mu1, certificate.mu2)
    floor = floor_of(P)
    values = {**certificate.multipliers, "P": P, "Y": P @ family.L1}
    forms = {
        "T": -family.dissipation(values, weight * (H.mT @ H), rational([[supply]])),
        "TP": P - floor * identity(len(P), P),
        **({"TO": certificate.mu2 * P - H.mT @ H} if peak else {}),
    }
    levels = [f"Definition {key} : Q := {number(getattr(certificate, key))}." for key in kind.levels]
    arguments = " ".join([NAME, *kind.levels, *forms])
    return "\n".join(
        [
            IMPORTS,
            "Open Scope Q_scope.",
            record(certificate, {"weight": weight, "supply": supply, "floor": floor}),
            *levels,
            "Open Scope Z_scope.",
            *(f"Definition {name} := {triangle(found(SAYS[name], S))}." for name, S in forms.items()),
            "Open Scope R_scope.",
            "",
            f"Lemma proved : {kind.claims} {arguments} = true.",
            "Proof. vm_cast_no_check (eq_refl true). Qed.",
            "",
            f"Theorem for_the_class : forall f, of_class {NAME} f ->",
            f"  forall x xh v q qh y yh g gq gy, trajectories {NAME} f x xh v q qh y yh g gq gy -> forall t, 0 <= t ->",
            "  let e := error_at x xh in",
            f"  {kind.conclusion}",
            f"  /\\ ({DECAY}).",
            f"Proof. exact ({kind.lemma} {arguments} proved). Qed.",
            "",
            "Print Assumptions for_the_class.",
            "",
        ]
    )


def floor_of(P: Array) -> fmpq:
    """Three digits of most of the least eigenvalue of P; zero, which Coq refuses, where doubles see none."""
    least = float(np.linalg.eigvalsh(P.astype(float))[0])
    return rational_number(f"{FLOOR * max(least, 0.0):.3g}")


def heading(spec: Spec, statement: str) -> list[str]:
    """What the file is about, in words; none of it is checked by Coq."""
    states = ", ".join([*spec.plant.states, *spec.model_states])
    return [
        f"obsdesign: the guarantee of {spec.name}, type {spec.observer.type}, as a theorem",
        f"states: {states}",
        f"in words: {statement}",
        *LIMITS.splitlines(),
    ]


def record(certificate: Certificate, levels: dict[str, fmpq]) -> str:
    """The design: plant, gains, storage function, multipliers, with the numbers of the result."""
    family, plant = certificate.family, certificate.family.plant
    sizes = {"n": plant.n, "nf": plant.Bf.shape[1], "nv": plant.B.shape[1], "ny": len(plant.C), "nq": len(plant.Cq)}
    matrices = {key: getattr(plant, key) for key in ("A", "Bf", "B", "C", "Df", "D", "Cq", "Dqf", "Dq")}
    matrices |= {"H": family.H, "L1": family.L1, "L2": family.L2, "P": certificate.P}
    rays = ";\n    ".join(
        f"{{| scaling := {number(scale)}; M11 := {matrix(M11)}; M12 := {matrix(M12)}; M22 := {matrix(M22)} |}}"
        for scale, M11, M12, M22 in multipliers(certificate)
    )
    numbers = {"alpha": family.rate, **levels}
    return "\n".join(
        [
            f"Definition {NAME} : design := {{|",
            "  " + " ".join(f"{key} := {size}%nat;" for key, size in sizes.items()),
            *(f"  {key} := {matrix(M)};" for key, M in matrices.items()),
            "  " + " ".join(f"{key} := {number(x)};" for key, x in numbers.items()),
            f"  multipliers := [{rays}] |}}.",
        ]
    )


def multipliers(certificate: Certificate) -> list[tuple[fmpq, Array, Array, Array]]:
    """Scale and matrices M11, M12, M22 of each inequality of the class. Raises `UnexportedError`, as `rays` does."""
    return [(certificate.multipliers[name].item(), *M) for name, M in rays(certificate.family.multiplier).items()]


def rays(multiplier: Multiplier) -> dict[str, Matrix]:
    """Matrices M11, M12, M22 of each inequality of a class, by the name of its scale.

    Raises `UnexportedError`: the multipliers of a block are no sum of scaled inequalities that each f of it satisfies.
    """
    for label, block in multiplier.labelled():
        if not isinstance(block, Scaled | Sum):
            said = f"the multiplier of f{label} is one of matrices, which is not exported yet; those of scales are"
            raise UnexportedError(said)
    names = [unknown.name for unknown in multiplier.unknowns()]
    units: dict[str, Values] = {one: {name: rational([[int(name == one)]]) for name in names} for one in names}
    return {name: multiplier.matrix(unit) for name, unit in units.items()}


def found(what: str, S: Array) -> list[list[int]]:
    """T for a matrix that must not be negative, which says what; raises `UnexportedError` if there is none."""
    if (T := congruence(S)) is None:
        raise UnexportedError(f"{what} does not hold in the form that Coq is told of, so no file was written")
    return T
