"""The claim of an observer with samples at instants as a file of Coq: its numbers, T, and the theorem.

For the energy of z the rate in the file is 0: then no sign of V is needed but that of P(0), at the samples. The
control values that prove the claim at its own rate need not do so at this one; those of shorter segments do as a rule.
"""

from collections.abc import Iterator, Mapping

import numpy as np
from flint import fmpq

from obsdesign.coq.clock import Observer, Storage, forms
from obsdesign.coq.congruence import congruence, triangle
from obsdesign.coq.course import NAME
from obsdesign.coq.decimals import comment, matrix, number
from obsdesign.coq.membership import Ending, Words, ending
from obsdesign.coq.theorem import UnexportedError
from obsdesign.lmi.formula import Array, Values, rational
from obsdesign.model.multiplier import Matrix, Multiplier, Scaled, Sum
from obsdesign.records import dataclass, replace
from obsdesign.spec import Spec

HALVINGS = 2  # of the segments, at most, until the inequalities hold at the rate of the file
IMPORTS = """\
Require Import Reals ZArith QArith Qreals List Lra.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsForm ObsDesign ObsTrajectory ObsPlant ObsMembers ObsRegions.
From Obs Require Import ObsInstants ObsInstantsMembers ObsClock ObsClockTheorem.
Import ListNotations.
"""
LIMITS = """\
These words are checked by nothing here. What Coq proves is {theorem}, at the end of this file:
- Of the words it states {told}. The size of an error is |(e, d)|, d = C e - theta, or |e| where xhat is reset.
- The energies of z and w are those up to any measurement, not up to an instant between two of them.
- Its premises: {premise};
  between measurements x, xhat and theta are differentiable and w is continuous, up to both ends of each interval.
- It does not state {untold}, bounds on gains, that trajectories exist.
- That {given} below are those of the spec is believed. Here e = x - xhat."""
QUANTIFIED = "t x xh th w q qh g gq y gy eta"
RUN = f"forall {QUANTIFIED}, trajectories {NAME} f {QUANTIFIED} ->"
LETS = f"""\
let e := error_at x xh in
  let size j s := sq (joint {NAME} (e j s) (at_ (th j) s)) in
  let z2 j s := sq (zed {NAME} (e j s)) in
  let w2 j s := sq (at_ (w j) s) in"""
INTRODUCED = f"intros f F {QUANTIFIED} X e size z2 w2."
SIGNALS = f"f {QUANTIFIED} F X"


@dataclass(frozen=True)
class Kind:
    """What is stated of one storage function: the boolean that the kernel computes, the theorem, the conclusion."""

    claims: str
    lemma: str
    levels: tuple[str, ...]  # numbers of the claim that they take
    words: str
    conclusion: str


KINDS = {
    "overshoot": Kind(
        "claims_decay",
        "decay_guarantee",
        ("overshoot", "decay"),
        "the decay of the error where w = 0 and eta = 0",
        """\
(forall j s, t j <= s <= t (S j) ->
    (forall i r, past t j s i r -> w2 i r = 0) -> (forall i, (i < j)%nat -> sq (eta (S i)) = 0) ->
    size j s <= Q2R overshoot * Q2R overshoot * exp (- (2 * Q2R decay * s)) * size 0%nat 0)""",
    ),
    "disturbance": Kind(
        "claims_peak",
        "peak_guarantee",
        ("disturbance",),
        "the bound by sup|w| from zero error where eta = 0",
        """\
(forall j s, t j <= s <= t (S j) -> size 0%nat 0 = 0 -> (forall i, (i < j)%nat -> sq (eta (S i)) = 0) ->
    forall bound, (forall i r, past t j s i r -> w2 i r <= bound) ->
    size j s <= Q2R disturbance * Q2R disturbance * bound)""",
    ),
    "noise": Kind(
        "claims_noise",
        "noise_guarantee",
        ("noise",),
        "the bound by sup|eta| from zero error where w = 0",
        """\
(forall j s, t j <= s <= t (S j) -> size 0%nat 0 = 0 -> (forall i r, past t j s i r -> w2 i r = 0) ->
    forall bound, 0 <= bound -> (forall i, (i < j)%nat -> sq (eta (S i)) <= bound) ->
    size j s <= Q2R noise * Q2R noise * bound)""",
    ),
    "gamma": Kind(
        "claims_gain",
        "gain_guarantee",
        ("gamma", "initial"),
        "the bound on |z|_2 where eta = 0",
        """\
(forall j, (forall i, (i < j)%nat -> sq (eta (S i)) = 0) ->
    total z2 t (S j) <= Q2R initial * Q2R initial * size 0%nat 0 + Q2R gamma * Q2R gamma * total w2 t (S j))""",
    ),
    "energy": Kind(
        "claims_energy",
        "energy_guarantee",
        ("energy_of_error", "energy_of_w", "energy_of_noise"),
        "the bound on |z|_2^2 with noise",
        """\
(forall j,
    total z2 t (S j) <= Q2R energy_of_error * size 0%nat 0 + Q2R energy_of_w * total w2 t (S j)
      + Q2R energy_of_noise * summed (fun i => sq (eta i)) j)""",
    ),
}


@dataclass(frozen=True)
class Part:
    """A part of the claim: a storage function, and the numbers that it proves."""

    kind: Kind
    storage: Storage
    levels: Mapping[str, fmpq]  # those of the kind


def exported(o: Observer, parts: Mapping[str, Part], spec: Spec, statement: str) -> str:
    """File of Coq with what the storage functions prove, by names, headed by what it is about.

    Raises `UnexportedError`: a multiplier is no scale, or no T was found.
    """
    cone = rays(o.multiplier)
    made = {name: told(name, o, part, cone) for name, part in parts.items()}
    parts = {name: part for name, (part, _) in made.items()}
    stated = "\n  /\\ ".join(part.kind.conclusion for part in parts.values())
    end = ending(spec.nonlinearities, [(fmpq(1), *ray) for ray in cone.values()], NAME, words(stated))
    return "\n".join(
        [
            *map(comment, heading(spec, statement, parts, end)),
            IMPORTS,
            "Open Scope Q_scope.",
            record(o),
            *(line for name, part in parts.items() for line in certificate(name, part)),
            "Open Scope Z_scope.",
            *(line for _, lines in made.values() for line in lines),
            "Open Scope R_scope.",
            "",
            *(line for name, part in parts.items() for line in computed(name, part)),
            f"Theorem for_the_class : forall f, of_class {NAME} f ->\n  {RUN}\n  {LETS}\n  {stated}.",
            f"Proof.\n {INTRODUCED}\n exact {proof(parts)}. Qed.",
            "",
            *end.lines,
        ]
    )


def words(stated: str) -> Words:
    """How the theorem about the f of a spec speaks."""
    return Words(
        time="s : R",
        always="forall j s, t j <= s <= t (S j) ->",
        lemma=f"instants_of_region {NAME}",
        run=RUN,
        concluded=f"{LETS}\n  {stated}.",
        signals=QUANTIFIED,
        inside="{always} region (q j {time}) /\\ region (qh j {time})",
        design="(class_of {})",
        first="apply of_instants. ",
    )


def proof(parts: Mapping[str, Part]) -> str:
    """Proof of all parts."""
    each = [f"({part.kind.lemma} {arguments(name, part, SIGNALS)} proved_{name})" for name, part in parts.items()]
    return "".join(f"(conj {one} " for one in each[:-1]) + each[-1] + ")" * (len(each) - 1)


def arguments(name: str, part: Part, signals: str = "") -> str:
    """What the boolean of a storage function takes, and the theorem, which takes the signals too."""
    last = "TP" if part.storage.normal else "T0"
    given = [NAME, f"of_{name}", *(f"{name}_{T}" for T in ("TF", "TJ", "TR")), *([signals] if signals else [])]
    return " ".join([*given, *part.kind.levels, f"{name}_{last}"])


def computed(name: str, part: Part) -> list[str]:
    """The one computation of a storage function."""
    return [
        f"Lemma proved_{name} : {part.kind.claims} {arguments(name, part)} = true.",
        "Proof. vm_cast_no_check (eq_refl true). Qed.",
        "",
    ]


def heading(spec: Spec, statement: str, parts: Mapping[str, Part], end: Ending) -> list[str]:
    """What the file is about, in words; none of it is checked by Coq."""
    told = "; ".join(part.kind.words for part in parts.values())
    left = [kind.words for name, kind in KINDS.items() if name not in parts]
    given = "the numbers and the f" if end.theorem == "for_this_f" else "the numbers"
    untold = ", ".join([*left, "that these bounds add", "what holds where measurements stay away"])
    return [
        f"obsdesign: the guarantee of {spec.name}, type {spec.observer.type}, as a theorem",
        f"states: {', '.join([*spec.plant.states, *spec.model_states])}",
        f"in words: {statement}",
        *LIMITS.format(told=told, untold=untold, theorem=end.theorem, premise=end.premise, given=given).splitlines(),
    ]


def record(o: Observer) -> str:
    """Plant, observer, error and class, with the numbers of the result."""
    matrices = {key: getattr(o.plant, key) for key in ("A", "Bf", "B", "C", "Cq", "Dqf", "Dq")}
    matrices |= {key: getattr(o, key) for key in ("Cp", "L", "H", "K", "G", "Se", "St")}
    cone = ";\n    ".join(
        f"{{| scaling := 1; M11 := {matrix(M11)}; M12 := {matrix(M12)}; M22 := {matrix(M22)} |}}"
        for M11, M12, M22 in rays(o.multiplier).values()
    )
    return "\n".join(
        [
            f"Definition {NAME} : observer := {{|",
            "  " + " ".join(f"{key} := {size}%nat;" for key, size in o.sizes.items()),
            *(f"  {key} := {matrix(M)};" for key, M in matrices.items()),
            f"  T1 := {number(o.T1)}; T2 := {number(o.T2)};",
            f"  multipliers := [{cone}] |}}.",
        ]
    )


def certificate(name: str, part: Part) -> Iterator[str]:
    """Numbers of the claim, and the storage function."""
    s = part.storage
    for key in part.kind.levels:
        yield f"Definition {key} : Q := {number(part.levels[key])}."
    numbers = {key: number(getattr(s, key)) for key in ("rate", "weight", "mu", "kappa", "roof")}
    flags = {key: str(getattr(s, key)).lower() for key in ("driven", "noisy")}
    yield f"Definition of_{name} : witness := {{|"
    yield "  " + " ".join(f"{key} := {value};" for key, value in {**numbers, **flags}.items())
    yield "  segments := [" + ";\n    ".join(segment(s, i) for i in range(len(s.controls))) + "] |}."


def segment(s: Storage, i: int) -> str:
    """Width of a segment, control values of P, and scales of the multipliers at each."""
    controls = ";\n      ".join(matrix(P) for P in s.controls[i])
    scales = matrix(np.array([values[i] for values in s.scales.values()], dtype=object).reshape(-1, s.degree + 1).T)
    return (
        f"{{| width := {number(s.knots[i + 1] - s.knots[i])}; controls := [{controls}];\n      scales := {scales} |}}"
    )


def told(name: str, o: Observer, part: Part, cone: Mapping[str, Matrix]) -> tuple[Part, list[str]]:
    """Part and its T; on shorter segments where the control values of its own are too far from the polynomials."""
    for _ in range(HALVINGS):
        try:
            return part, list(triangles(name, o, part.storage, cone))
        except UnexportedError:
            part = replace(part, storage=part.storage.halved())
    return part, list(triangles(name, o, part.storage, cone))


def triangles(name: str, o: Observer, s: Storage, cone: Mapping[str, Matrix]) -> Iterator[str]:
    """T of each matrix; an empty list where none is asked."""
    for key, what, stack in forms(o, s, cone):
        rows = [["[]" if S is None else triangle(found(f"{what} ({name})", S)) for S in row] for row in stack]
        text = rows[0][0] if key == "T0" else "[" + ";\n ".join("[" + ";\n ".join(row) + "]" for row in rows) + "]"
        yield f"Definition {name}_{key} := {text}."


def found(what: str, S: Array) -> list[list[int]]:
    """T for a matrix that must not be negative, which says what; raises `UnexportedError` if there is none."""
    try:
        return congruence(S)
    except ValueError:
        said = f"{what} does not hold in the form that Coq is told of, so no file was written"
        raise UnexportedError(said) from None


def rays(multiplier: Multiplier) -> dict[str, Matrix]:
    """Matrices M11, M12, M22 of each inequality of a class, by the name of its scale.

    Raises `UnexportedError`: the multipliers of a block are no sum of scaled inequalities that each f of it satisfies.
    """
    for label, block in multiplier.labelled():
        if not isinstance(block, Scaled | Sum):
            said = f"the multiplier of f{label} is one of matrices, which is not exported yet where there is a clock"
            raise UnexportedError(said)
    names = [unknown.name for unknown in multiplier.unknowns()]
    units: dict[str, Values] = {one: {name: rational([[int(name == one)]]) for name in names} for one in names}
    return {name: multiplier.matrix(unit) for name, unit in units.items()}
