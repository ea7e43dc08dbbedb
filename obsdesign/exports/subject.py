"""What is exported: an observer in steps under an identifier, with what is proved of it in words."""

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path

from flint import fmpq

from obsdesign import __version__
from obsdesign.design import Design
from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.expressions.tree import Call, Number
from obsdesign.families import FAMILIES
from obsdesign.files import digest
from obsdesign.lmi.formula import rational_number
from obsdesign.records import dataclass
from obsdesign.spec import Spec
from obsdesign.stepping.implemented import Implemented, implemented
from obsdesign.stepping.method import METHODS
from obsdesign.stepping.routine import Routine, Solve
from obsdesign.trial import Implementation

READ = ("estimate", "predict", "arguments")  # routines that leave the state as it is
TIMED = ("flow", "part")  # .. that go over a time of at most a period
SHORTEST = fmpq(1, 10**15)  # s, of a period
ITERATIONS = 60  # of Newton's method in a loop
MOST_STATES = 12  # of a certificate that is written out
ARITHMETIC = {"+": "additions", "*": "products", "/": "quotients"}


@dataclass(frozen=True)
class Subject:
    """An observer in steps, and what is said of it."""

    name: str  # an identifier
    implemented: Implemented
    words: tuple[str, ...]  # where it comes from, and what is proved of it, in lines
    units: dict[str, str]  # of signals, where they have one
    single: bool = False  # numbers are floats of 32 bits
    numbers: tuple[str, ...] = ()  # of what is proved, so that a reader can hold it, in lines

    @property
    def inputs(self) -> tuple[str, ...]:
        """Known inputs."""
        return self.implemented.observer.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        """Measured outputs."""
        return self.implemented.observer.outputs

    @property
    def estimates(self) -> tuple[str, ...]:
        """What is estimated."""
        return tuple(self.implemented.observer.estimates)

    @property
    def instants(self) -> bool:
        """Whether y is known at instants only."""
        return self.implemented.jump is not None

    @property
    def ahead(self) -> bool:
        """Whether a step takes u and y of the sample that it reaches."""
        return bool(self.implemented.observer.following)

    @cached_property
    def routines(self) -> dict[str, Routine]:
        """Routines that are written, by name."""
        return self.exported

    @cached_property
    def exported(self) -> dict[str, Routine]:
        """Routines of an observer on its own, by name."""
        one = self.implemented
        start = {"begin": one.begin, "locate": one.locate}
        runs = {"step": one.step, "flow": one.part if self.instants else None, "jump": one.jump}
        found = {**start, **runs, "estimate": one.estimate}
        return {name: made for name, made in found.items() if made is not None}

    @property
    def begins(self) -> bool:
        """Whether some states begin at a function of t, u and y."""
        return "begin" in self.routines or "locate" in self.routines

    @property
    def period(self) -> float:
        """Period in s, as a double."""
        return float(self.implemented.period.p) / float(self.implemented.period.q)

    def cost(self, name: str = "step") -> dict[str, int]:
        """Operations of a routine by kind; of a loop, those of one of its iterations."""
        found = Counter[str]()
        for side in self.routines[name].expressions():
            for node in side.order:
                if not isinstance(node, Call) or node.operation == "pi":
                    continue
                last = node.arguments[-1]
                if node.operation == "**" and isinstance(last, Number) and last.value in (2, 3):
                    found["products"] += int(last.value.p) - 1
                elif kind := ARITHMETIC.get(node.operation):
                    found[kind] += len(node.arguments) - 1
                else:
                    found[node.operation] += 1
        return dict(found)

    @property
    def loops(self) -> bool:
        """Whether an algebraic loop is solved in each step."""
        return any(isinstance(one, Solve) for made in self.routines.values() for one in made.statements)


def subject_of(design: Design, name: str, period: str | float | None, method: str | None, single: bool) -> Subject:
    """What is exported of a design, in the steps of its spec or in others.

    Raises `UsageError`: see `obsdesign.exports.export`.
    """
    spec = design.spec
    steps = asked(spec, period, method)
    if name and name != identifier(name):
        said = f"{name!r} is no identifier of C: letters, digits and _, a letter first; write {identifier(name)}"
        raise UsageError(Problem(f"--name: {said}", id="OBS904"))
    if steps is not None:
        require_stable(design, steps)
    one = implemented(spec, design.observer, steps)
    called = name or identifier(stem(design.path))
    return Subject(called, one, words(design, one), dict(spec.units), single, numbers(design))


def stem(path: str) -> str:
    """Name of a spec or of its gains file, without folder and endings."""
    name = Path(path).name.strip("<>")
    return name.removesuffix(".gains.json") if name.endswith(".gains.json") else Path(name).stem


def asked(spec: Spec, period: str | float | None, method: str | None) -> Implementation | None:
    """Steps of an observer in continuous time; None where the plant is in samples."""
    if spec.period is not None:
        if period is not None or method is not None:
            said = f"this plant is in samples, {float(spec.period):g} s apart, and so is its observer: leave them out"
            raise UsageError(f"--period, --method: {said}", id="OBS904")
        return None
    given = spec.implementation
    if given is None and (period is None or method is None):
        options = {"--period SECONDS": period, "--method euler, rk4 or exact": method}
        missing = " and ".join(option for option, value in options.items() if value is None)
        said = f"the spec has no implementation; give {missing}"
        raise UsageError(Problem(said, key="implementation", id="OBS801"))
    if method is not None and method not in METHODS:
        raise UsageError(f"--method: {method!r} is no method; allowed: {', '.join(METHODS)}", id="OBS904")
    h = given.period if period is None and given else seconds(period)
    return Implementation(h, method or (given.method if given else "rk4"))  # type: ignore[arg-type]


def seconds(period: str | float | None) -> fmpq:
    """Period in s, as it is written; raises `UsageError`."""
    try:
        value = rational_number(period if isinstance(period, str) else repr(float(period or 0)))
    except (ValueError, ZeroDivisionError):
        value = fmpq(0)
    if not SHORTEST < value < 10**9 or "_" in str(period):
        raise UsageError(f"--period: {period} is no time in s; give a number > 0, such as 1.0e-3", id="OBS904")
    return value


def require_stable(design: Design, steps: Implementation) -> None:
    """Refuse a period above the largest with which the method is stable for every member of the class, as found."""
    if FAMILIES[design.spec.observer.type].sampled:
        return  # between measurements it goes as the plant does
    largest = (design.analysis.get("largest_step") or {}).get(steps.method)
    if largest is not None and float(steps.period) > largest:
        others = {n: h for n, h in design.analysis["largest_step"].items() if h is None or h >= float(steps.period)}
        instead = f", or method {' or '.join(others)}" if others else ""
        said = f"a step of {float(steps.period):g} s is above the largest with which {steps.method} is stable for every"
        raise UsageError(
            Problem(f"{said} member of the class, {largest:.4g} s; take at most that{instead}",
                    key="implementation.period", id="OBS921")
        )  # fmt: skip


def words(design: Design, one: Implemented) -> tuple[str, ...]:
    """Where an observer comes from, and what is proved of it."""
    spec = design.spec
    steps = (
        f"in steps of {float(one.period):g} s, {one.method}" if one.method else f"in samples, {float(one.period):g} s"
    )
    origin = f"of the result {design.path}, SHA-256 {digest(design.recorded.raw.decode())}" if design.recorded else ""
    source = origin or f"of the spec {spec.path}, SHA-256 {digest(spec.text)}"
    lines = [f"obsdesign {__version__}: observer of {spec.name}, type {spec.observer.type}, {steps}", source]
    if not design.proved or design.claim is None:
        return (*lines, "no guarantee: nothing is proved of these gains")
    stated = str(design.claimed().get("guarantee", {}).get("statement", design.claim.headline(spec)))
    imposed = "implementation" in design.claimed().get("guarantee", {})
    of_steps = "only what is said of them is proved" if imposed else "nothing is proved"
    about = f"in continuous time, with these gains; of its steps {of_steps}" if one.method else "in exact numbers"
    lines += [f"proved of the observer {about}:", *stated.splitlines()]
    lines += [proviso for proviso in spec.provisos if proviso not in stated]
    theorem = design.recorded.content.get("theorem") if design.recorded else None
    if isinstance(theorem, Mapping):
        lines.append(f"recorded: Coq accepted {theorem.get('name')} of a file with SHA-256 {theorem.get('sha256')}")
    return tuple(lines)


def numbers(design: Design) -> tuple[str, ...]:
    """Numbers of a claim: those of its guarantee, z = H e, and the matrices of its storage function, as exact text.

    A certificate of more than 12 states, or one that is no matrix, is named by its file only.
    """
    if not design.proved or design.claim is None:
        return ()
    spec, claimed = design.spec, design.claimed()
    guarantee, certificate = (claimed.get(name, {}) for name in ("guarantee", "certificate"))
    scalars = [f"{n} = {x}" for n, x in guarantee.items() if isinstance(x, int | float) and not isinstance(x, bool)]
    lines = [f"with {', '.join(scalars)}"] if scalars else []
    if FAMILIES[spec.observer.type].equations:
        return tuple(lines)
    place = f"the result {design.path}, of the SHA-256 above" if design.recorded else "what solve -o writes of the spec"
    matrices = {
        n: rows for n, rows in certificate.items() if isinstance(rows, list) and rows and isinstance(rows[0], list)
    }
    if not matrices or len(spec.augmented.A) > MOST_STATES:
        return (*lines, f"its certificate is in {place}")
    H = [[str(x) for x in row] for row in spec.H.tolist()]
    lines += [
        f"{n} = [{'; '.join(', '.join(map(str, row)) for row in rows)}]" for n, rows in (("H", H), *matrices.items())
    ]
    return (*lines, f"its multipliers are in {place}")


def identifier(name: str) -> str:
    """Name as an identifier: other characters are _, and x_ comes before what is no letter."""
    made = re.sub(r"[^A-Za-z0-9_]", "_", name) or "observer"
    return made if made[0].isalpha() else f"x_{made}"


def loops_of(routine: Routine) -> Iterator[tuple[Solve, tuple[str, ...]]]:
    """Algebraic loops of a routine, each with the known signals that it takes."""
    for one in routine.statements:
        if isinstance(one, Solve):
            sides: list[Expression] = [*one.residuals, *(slope for row in one.slopes for slope in row)]
            yield one, tuple(dict.fromkeys(n for side in sides for n in sorted(side.names) if n not in one.unknowns))


def shortest(value: float) -> str:
    """Shortest decimal of a double, with a point or an exponent."""
    assert math.isfinite(value)
    text = repr(float(value))
    return text if any(c in text for c in ".e") else f"{text}.0"


def comment(subject: Subject, *further: str) -> str:
    """Comment of C at the head of a file: what is said of the observer, and further lines."""
    lines = "\n   ".join(line.replace("*/", "* /").replace("/*", "/ *") for line in (*subject.words, *further))
    return f"/* {lines} */"
