"""The claim of a dissipation inequality as a file of Coq: the numbers of the result, T, and the theorem.

Coq computes the matrix of the inequality itself from the numbers of the file. With

    V' + 2 alpha V + weight |H e|^2 - supply |v|^2 <= 0,    V = e' P e >= floor |e|^2,

or V+ - rho^2 V in the place of V' + 2 alpha V, weight = mu1 and supply = mu2 where a claim is about the energy of z,
weight = 0 and supply = 2 alpha mu1, or (1 - rho^2) mu1, where it is about its peak, the theorem states the guarantee
for every f of the class and all trajectories of plant and observer.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import NamedTuple

from flint import fmpq

from obsdesign.coq.bounds import bounded
from obsdesign.coq.congruence import congruence, triangle
from obsdesign.coq.course import CONTINUOUS, FILTERED, MODEL, NAME, PREDICTED, Course, driven
from obsdesign.coq.decimals import comment, matrix, number
from obsdesign.coq.hulls import of_hulls
from obsdesign.coq.inequality import decaying, decrease, hulls, least, multipliers, weights
from obsdesign.coq.membership import Ending, Words, ending
from obsdesign.coq.reconstruction import FILE, Reconstruction
from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.certificate import Certificate
from obsdesign.lmi.formula import Array, Exact, identity
from obsdesign.model.disturbance import Generator
from obsdesign.model.filtered import apart, channels
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass, replace
from obsdesign.spec import Spec

LARGER = "Larger"  # module of the larger constants
IMPORTS = """\
Require Import Reals ZArith QArith Qreals List Lra Psatz.
From Coquelicot Require Import Coquelicot.
From Obs Require Import {files}.
Import ListNotations.
"""


class UnexportedError(Exception):
    """A part of a claim that no file of Coq is written of, in words."""


def exported(
    certificate: Certificate,
    spec: Spec,
    statement: str,
    bounds: Bounds = NO_BOUNDS,
    larger: Certificate | None = None,
    reconstruction: Reconstruction | None = None,
) -> str:
    """File of Coq with the claim of a certificate that holds, headed by what it is about.

    `bounds`: kept ones; `larger`: certificate of the same gains for larger Lipschitz constants; `reconstruction`: of w.
    """
    claimed = Claimed(decaying(certificate), certificate.family.plant, CONTINUOUS)
    model = list[str]()
    if certificate.family.about.pace.sampled:
        claimed = replace(claimed, course=FILTERED if spec.observer.filtered else PREDICTED)
        claimed = replace(claimed, plant=apart(spec.augmented)) if spec.observer.filtered else claimed
    if not spec.generator.direct:
        claimed, model = replace(claimed, course=driven(claimed.course), plant=spec.plant), modelled(spec)
    more = replace(claimed, certificate=decaying(larger)) if larger else None
    beside = [*bounded(certificate, bounds, claimed.course.whole), *(beyond(more) if more else ())]
    if reconstruction:
        claimed = replace(claimed, course=replace(claimed.course, files=f"{claimed.course.files} {FILE}"))
        beside += reconstruction.lines(claimed.course.whole)
    text, end = written(claimed, spec, model, beside)
    head = heading(spec, statement, claimed, end, Rates(bool(certificate.rate), bool(claimed.certificate.rate)))
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


@dataclass(frozen=True)
class Claimed:
    """A certificate, of a plant as the file has it, and how its theorem speaks."""

    certificate: Certificate
    plant: Plant[Exact]
    course: Course

    @property
    def peak(self) -> bool:
        """Whether it is about the peak of z, or about its energy."""
        return self.certificate.guarantee.norm == "sup"

    @property
    def constants(self) -> tuple[str, ...]:
        """Numbers of the claim that are not of the design."""
        return ("gamma", "mu1", "mu2") if self.peak else ("gamma",)

    @property
    def forms(self) -> dict[str, Array]:
        """Matrices that must not be negative, by the names of their T."""
        P, H = self.certificate.P, self.certificate.family.H
        found = {"T": -decrease(self.certificate), "TP": P - least(self.certificate) * identity(len(P), P)}
        return {**found, "TO": self.certificate.mu2 * P - H.mT @ H} if self.peak else found

    def data(self, like: str = "", model: Sequence[str] = ()) -> list[str]:
        """The design, the model of w, further numbers, and T. `like`: the design that has the same plant and gains."""
        weight, supply = weights(self.certificate)
        family = self.certificate.family
        levels = {
            "alpha": family.about.pace.told(family.rate),
            "weight": weight,
            "supply": supply,
            "floor": least(self.certificate),
        }
        return [
            "Open Scope Q_scope.",
            record(self.certificate, self.plant, levels, like),
            *model,
            *(f"Definition {key} : Q := {number(getattr(self.certificate, key))}." for key in self.constants),
            "Open Scope Z_scope.",
            *(f"Definition {name} := {triangle(congruence(S))}." for name, S in self.forms.items()),
            f"Definition TH : list (list (list (list Z))) := {of_hulls(hulls(self.certificate))}.",
            "Open Scope R_scope.",
            "",
        ]

    @property
    def words(self) -> Words:
        """What is stated, of runs of what kind."""
        course = self.course
        run = f"forall {course.signals}, {course.run} {course.about} f {course.signals} ->"
        bound = course.peak if self.peak else course.energy
        concluded = f"{course.instant}\n  let e := {course.error} in\n  {bound}\n  /\\ ({course.decay})."
        stays = f"{course.run}_of_region {course.about}"
        return Words(course.time, course.always, stays, course.signals, run, concluded)

    def theorem(self, name: str) -> list[str]:
        """The theorem about every f of the class, and its proof."""
        course, what = self.course, "peak" if self.peak else "energy"
        arguments = " ".join([*self.constants, *self.forms, "TH"])
        return [
            f"Lemma proved : {course.claims.format(what)} {course.computed} {arguments} = true.",
            "Proof. vm_cast_no_check (eq_refl true). Qed.",
            "",
            f"Theorem {name} : forall f, of_class {course.whole} f ->",
            f"  {self.words.run} {self.words.concluded}",
            f"Proof. exact ({what}_of_{course.run} {course.theorem} {arguments} proved). Qed.",
            "",
        ]


def written(claimed: Claimed, spec: Spec, model: Sequence[str] = (), beside: Sequence[str] = ()) -> tuple[str, Ending]:
    """Design, T, and the theorems with their proofs; and how they end.

    `model`: of w, as lines of Coq; `beside`: lines of further theorems.
    """
    course, certificate = claimed.course, claimed.certificate
    rays = [*multipliers(certificate), *((fmpq(1), *hull.M) for hull in hulls(certificate))]
    end = ending(spec.nonlinearities, rays, course.whole, claimed.words)
    lines = [
        IMPORTS.format(files=course.files),
        *claimed.data(model=model),
        *beside,
        *claimed.theorem("for_the_class"),
        *end.lines,
    ]
    return "\n".join(lines), end


def beyond(larger: Claimed) -> list[str]:
    """What holds of the same observer for a larger class, in a module of its own."""
    return [
        "(* The same gains for larger Lipschitz constants *)",
        f"Module {LARGER}.",
        *larger.data(like=NAME),
        *larger.theorem("larger_constants"),
        f"End {LARGER}.",
        f"Print Assumptions {LARGER}.larger_constants.",
        "",
    ]


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


def heading(spec: Spec, statement: str, claimed: Claimed, end: Ending, rates: Rates) -> list[str]:
    """What the file is about, in words; none of it is checked by Coq."""
    names = {"x": spec.plant.states, "xm": spec.model_states, "w": spec.plant.exogenous, "v": spec.drives}
    if spec.generator.direct:
        names = {"x": spec.plant.states, "v": claimed.plant.exogenous}
    names["y"] = claimed.plant.outputs
    limits = claimed.course.limits.format(
        theorem=end.theorem,
        premise=end.premise,
        given="the numbers and the f" if end.theorem == "for_this_f" else "the numbers",
        joined=""
        if spec.generator.direct
        else ";\n  that plant and model of w make the matrices of the inequality is proved",
        error="xhat - x" if spec.generator.direct else "(xhat, xmhat) - (x, xm)",
        still=rates.told(sampled=claimed.course.sampled),
    )
    return [
        f"obsdesign: the guarantee of {spec.name}, type {spec.observer.type}, as a theorem",
        "; ".join(f"{key}: {', '.join(name)}" for key, name in names.items()),
        f"in words: {statement}",
        *limits.splitlines(),
    ]


def record(certificate: Certificate, plant: Plant[Exact], levels: Mapping[str, fmpq], like: str = "") -> str:
    """The design: plant, gains, storage function, multipliers, with the numbers of the result.

    `like`: the design that plant and gains are those of; empty: they are written.
    """
    family = certificate.family
    sizes = {"n": plant.n, "nf": plant.Bf.shape[1], "nv": plant.B.shape[1], "ny": len(plant.C), "nq": len(plant.Cq)}
    matrices = {key: getattr(plant, key) for key in ("A", "Bf", "B", "C", "Df", "D", "Cq", "Dqf", "Dq")}
    matrices |= {"H": family.H, "L1": family.L1, "L2": family.L2}
    rays = ";\n    ".join(
        f"{{| scaling := {number(scale)}; M11 := {matrix(M11)}; M12 := {matrix(M12)}; M22 := {matrix(M22)} |}}"
        for scale, M11, M12, M22 in multipliers(certificate)
    )
    written = ";\n    ".join(hull.written() for hull in hulls(certificate))
    same = [" ".join(f"{key} := {key} {like};" for key in names) for names in (sizes, matrices)]
    own = [" ".join(f"{key} := {size}%nat;" for key, size in sizes.items())]
    own += [f"{key} := {matrix(M)};" for key, M in matrices.items()]
    return "\n".join(
        [
            f"Definition {NAME} : design := {{|",
            *(f"  {line}" for line in (same if like else own)),
            f"  P := {matrix(certificate.P)};",
            "  " + " ".join(f"{key} := {number(x)};" for key, x in levels.items()),
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
