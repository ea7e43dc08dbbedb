"""The claim of a dissipation inequality as a file of Coq: the numbers of the result, T, and the theorem.

Coq computes the matrix of the inequality itself from the numbers of the file. With

    V' + 2 alpha V + weight |H e|^2 - supply |v|^2 <= 0,    V = e' P e >= floor |e|^2,

or V+ - rho^2 V in the place of V' + 2 alpha V, weight = mu1 and supply = mu2 where a claim is about the energy of z,
weight = 0 and supply = 2 alpha mu1, or (1 - rho^2) mu1, where it is about its peak, the theorem states the guarantee
for every f of the class and all trajectories of plant and observer.
"""

import re
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import NamedTuple

from flint import fmpq

from obsdesign.coq.bounds import bounded
from obsdesign.coq.congruence import congruence, triangle
from obsdesign.coq.course import CONTINUOUS, FILTERED, MODEL, NAME, PREDICTED, Course, driven
from obsdesign.coq.decimals import comment, matrix, number
from obsdesign.coq.hulls import Hull, of_hulls
from obsdesign.coq.membership import Ending, Words, ending
from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.certificate import Certificate
from obsdesign.lmi.formula import Array, Exact, Inequality, Values, identity, rational, rational_number, zeros
from obsdesign.lmi.proof import holds
from obsdesign.model.disturbance import Generator
from obsdesign.model.filtered import apart, channels
from obsdesign.model.multiplier import Scaled, Sum
from obsdesign.model.plant import Plant
from obsdesign.nonlinearities.cone import Cone
from obsdesign.nonlinearities.jacobian import Polytope
from obsdesign.spec import Spec

PLACES = 31  # of the rates that are tried where none is claimed
FLOOR = 0.9  # of the least eigenvalue of P, which decay is told with


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
    certificate, claimed = decaying(certificate), certificate.rate
    course, plant, model = CONTINUOUS, certificate.family.plant, list[str]()
    if certificate.family.about.pace.sampled:
        course = FILTERED if spec.observer.filtered else PREDICTED
        plant = apart(spec.augmented) if spec.observer.filtered else plant
    if not spec.generator.direct:
        course, plant, model = driven(course), spec.plant, modelled(spec)
    text, end = written(certificate, spec, plant, course, bounds, model)
    rates = Rates(bool(claimed), bool(certificate.rate))
    head = heading(spec, statement, course, end, plant, rates)
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


def weights(certificate: Certificate) -> tuple[fmpq, fmpq]:
    """Weight of |z|^2 and supply in the inequality."""
    if certificate.guarantee.norm == "sup":
        return fmpq(0), certificate.family.loss * certificate.mu1
    return certificate.mu1, certificate.mu2


def decrease(certificate: Certificate) -> Array:
    """Matrix of the inequality, which is not positive."""
    family, P = certificate.family, certificate.P
    weight, supply = weights(certificate)
    values = {**certificate.multipliers, "P": P, "Y": P @ family.L1}
    return family.dissipation(values, weight * (family.H.mT @ family.H), rational([[supply]]))


def decaying(certificate: Certificate) -> Certificate:
    """The same with a positive rate, where none is claimed and a strict inequality leaves room for one: then e -> 0."""
    family = certificate.family
    if family.rate or family.about.at_rest != "strict":
        return certificate
    rates = (fmpq(digit, 10**places) for places in range(1, PLACES) for digit in (5, 2, 1))
    tried = (replace(certificate, family=replace(family, rate=rate)) for rate in rates)
    return next((one for one in tried if holds(Inequality("", decrease(one)))), certificate)


def written(
    certificate: Certificate,
    spec: Spec,
    plant: Plant[Exact],
    course: Course,
    bounds: Bounds = NO_BOUNDS,
    model: Sequence[str] = (),
) -> tuple[str, Ending]:
    """Design, T, and the theorems with their proofs; and how they end. `model`: of w, as lines of Coq."""
    family, peak = certificate.family, certificate.guarantee.norm == "sup"
    H, P = family.H, certificate.P
    weight, supply = weights(certificate)
    floor = rational_number(f"{FLOOR * certificate.guarantee.spectrum[0]:.3g}")
    levels = {"weight": weight, "supply": supply, "floor": floor}
    forms = {
        "T": -decrease(certificate),
        "TP": P - floor * identity(len(P), P),
        **({"TO": certificate.mu2 * P - H.mT @ H} if peak else {}),
    }
    what, constants = ("peak", ("gamma", "mu1", "mu2")) if peak else ("energy", ("gamma",))
    arguments = " ".join([*constants, *forms, "TH"])
    run = f"forall {course.signals}, {course.run} {course.about} f {course.signals} ->"
    error = f"let e := {course.error} in"
    concluded = f"{course.instant}\n  {error}\n  {getattr(course, what)}\n  /\\ ({course.decay})."
    stays = f"{course.run}_of_region {course.about}"
    words = Words(course.time, course.always, stays, course.signals, run, concluded)
    rays = [*multipliers(certificate), *((fmpq(1), *hull.M) for hull in hulls(certificate))]
    end = ending(spec.nonlinearities, rays, course.whole, words)
    text = "\n".join(
        [
            IMPORTS.format(files=course.files),
            "Open Scope Q_scope.",
            record(certificate, plant, levels),
            *model,
            *(f"Definition {key} : Q := {number(getattr(certificate, key))}." for key in constants),
            "Open Scope Z_scope.",
            *(f"Definition {name} := {triangle(congruence(S))}." for name, S in forms.items()),
            f"Definition TH : list (list (list (list Z))) := {of_hulls(hulls(certificate))}.",
            "Open Scope R_scope.",
            "",
            *bounded(certificate, bounds, course.whole),
            f"Lemma proved : {course.claims.format(what)} {course.computed} {arguments} = true.",
            "Proof. vm_cast_no_check (eq_refl true). Qed.",
            "",
            f"Theorem for_the_class : forall f, of_class {course.whole} f ->",
            f"  {run} {concluded}",
            f"Proof. exact ({what}_of_{course.run} {course.theorem} {arguments} proved). Qed.",
            "",
            *end.lines,
        ]
    )
    return text, end


class Rates(NamedTuple):
    """Whether the words claim decay at some rate, and whether the theorem states it."""

    claimed: bool
    stated: bool

    def told(self, *, sampled: bool) -> str:
        """What the theorem says of decay where the words name no rate."""
        if self.claimed:
            return ""
        if not self.stated:
            return f"; at {'rho = 1' if sampled else 'alpha = 0'} it\n  says that e stays bounded"
        rate = "rho < 1" if sampled else "alpha > 0"
        return (
            f".\n  The words name no rate: this {rate} is one that the strict inequality leaves room for, hence e -> 0"
        )


def heading(spec: Spec, statement: str, course: Course, end: Ending, plant: Plant[Exact], rates: Rates) -> list[str]:
    """What the file is about, in words; none of it is checked by Coq."""
    names = {"x": spec.plant.states, "xm": spec.model_states, "w": spec.plant.exogenous, "v": spec.drives}
    if spec.generator.direct:
        names = {"x": spec.plant.states, "v": plant.exogenous}
    names["y"] = plant.outputs
    limits = course.limits.format(
        theorem=end.theorem,
        premise=end.premise,
        given="the numbers and the f" if end.theorem == "for_this_f" else "the numbers",
        joined=""
        if spec.generator.direct
        else ";\n  that plant and model of w make the matrices of the inequality is proved",
        error="xhat - x" if spec.generator.direct else "(xhat, xmhat) - (x, xm)",
        still=rates.told(sampled=course.sampled),
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


def modelled(spec: Spec) -> list[str]:
    """The model of w; of filtered estimates also which components of v act at a sample, and which on its y."""
    g, names = spec.generator, [field.name for field in fields(Generator) if field.name != "inverse"]
    sizes = {"mn": len(g.Am), "mf": g.Bmf.shape[1], "mv": g.Bm.shape[1], "mq": len(g.Cq2)}
    masks = channels(spec.augmented) if spec.observer.filtered else ()
    acts = zip(("now", "late"), masks, strict=False)
    return [
        f"(* Above H, L1, L2, P, multipliers and hulls are about (x, xm) and the f of plant and {MODEL}. *)",
        f"Definition {MODEL} : generator := {{|",
        "  " + " ".join(f"{key} := {size}%nat;" for key, size in sizes.items()),
        "  " + ";\n  ".join(f"{key} := {matrix(getattr(g, key))}" for key in names) + " |}.",
        *(f"Definition {key} : list bool := [{'; '.join(str(bool(x)).lower() for x in mask)}]." for key, mask in acts),
    ]


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
