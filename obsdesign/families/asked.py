"""What a section `observer:` may hold in any family: its type, ranges that are searched, bounds, the slack."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, Literal

from flint import fmpq

from obsdesign.dissipation.bounds import SLACK, Conflicting, Range, Trade
from obsdesign.families import FAMILIES
from obsdesign.lmi.formula import Array, Exact
from obsdesign.model.disturbance import Generator
from obsdesign.model.equations import Typed
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass
from obsdesign.sections.document import Loc
from obsdesign.sections.forms import ENTRY, FLAG, Either, OneOf, Schema, Section, key, refuse, required
from obsdesign.sections.scalars import described
from obsdesign.sections.values import Axis, Reader, Sign
from obsdesign.spec import Nonlinearity
from obsdesign.trial import Implementation

AS_GIVEN = "given gains are analysed as they are"
MAX_POINTS = 10_000
MOST_SIZES = 100  # bounds on a gain that are gone through, a design each
AUTO = "auto"
CALLED = {  # in other words
    **dict.fromkeys(("hinf", "h-inf", "h-infinity", "hinfinity"), "is called l2 here: it bounds the gain in energy"),
    **dict.fromkeys(
        ("l1", "peak-to-peak", "l-inf", "linfinity"), "is called linf here: it bounds the peak-to-peak gain"
    ),
    "kalman": "is called ekf here, to compare with; l2 bounds the gain in energy from disturbance and noise",
    **dict.fromkeys(("luenberger", "linear"), "is l2 here: without nonlinearities it is the observer of Luenberger"),
    **dict.fromkeys(("sampled", "sampled-data", "continuous-discrete"), "is called sporadic here"),
}
FAMILY = OneOf("observer", lambda: tuple(FAMILIES), lambda: CALLED)


@dataclass(frozen=True)
class Estimation:
    """The estimation problem that an observer is for; None, or an open size, where an earlier error leaves it open."""

    states: Axis  # augmented
    outputs: Axis  # measured
    q: Axis  # with the components of the disturbance model
    plant: Plant[Exact] | None
    generator: Generator | None
    H: Array
    nonlinearities: tuple[Nonlinearity, ...]  # as the family takes them
    typed: Typed | None = None  # the plant as equations, of a family that takes it so
    as_equations: bool = False  # whether the matrices are those of equations that were split
    period: fmpq | None = None  # s, of a plant x+ = ..
    noisy: bool = False  # whether the last channels of w are noise that the spec declares
    steps: Implementation | None = None  # in which the observer is to run
    inputs: tuple[str, ...] = ()  # known

    def refused(self, name: str, taker: str) -> Iterator[tuple[Loc, str]]:
        """Where D, Df, Dq or Dqf is not zero, which a `taker` does not take, in words; of equations in their terms."""
        plant = self.plant
        if plant is None or not getattr(plant, name).any():
            return
        if not self.as_equations:
            yield ("system", name) if name == "D" else ("nonlinearities",), f"{name} must be zero for {taker}"
            return
        for place, what in disturbed(plant) if name == "D" else entering(plant, self.nonlinearities, name):
            yield place, f"holds {what}, which {taker} does not take"


def disturbed(plant: Plant[Exact]) -> Iterator[tuple[Loc, str]]:
    """Outputs that hold disturbances."""
    for y, row in zip(plant.outputs, plant.D, strict=True):
        if held := [w for w, entry in zip(plant.exogenous, row, strict=True) if entry != 0]:
            yield ("system", "outputs", y), f"the disturbance {', '.join(held)}"


def entering(plant: Plant[Exact], terms: Sequence[Nonlinearity], name: str) -> Iterator[tuple[Loc, str]]:
    """Outputs that hold terms (Df), and right sides that hold terms of disturbances (Dq)."""
    first = 0
    for term, moves, shows in zip(terms, plant.Bf.T, plant.Df.T, strict=False):
        rows, first = plant.Dq[first : first + term.nq], first + term.nq
        sides: list[Loc] = [("system", "dynamics", x) for x, c in zip(plant.states, moves, strict=True) if c != 0]
        outputs: list[Loc] = [("system", "outputs", y) for y, c in zip(plant.outputs, shows, strict=True) if c != 0]
        acting = ", ".join(w for w, column in zip(plant.exogenous, rows.T, strict=True) if column.any())
        if name == "Df":
            yield from ((place, f"the nonlinear term {term.term}") for place in outputs)
        elif acting:
            yield [*sides, *outputs][0], f"the term {term.term}, a function of the disturbance {acting}"


class ObserverSection(Section):
    """Keys of `observer:` in one family."""

    residual: ClassVar[str] = "y - yhat"  # what gains multiply

    type: str = required(FAMILY, "the family, which says what is proved and what else may stand here", example="l2")

    @classmethod
    def names(cls) -> list[str]:
        """Types whose section this is."""
        return [name for name, family in FAMILIES.items() if family.Section is cls]

    @classmethod
    def object(cls, definitions: Schema) -> Schema:
        """Return the keys of these types: the type tells the sections of an observer apart."""
        schema = super().object(definitions)
        schema["properties"]["type"] |= {"enum": cls.names(), "examples": cls.names()[:1]}
        return schema

    @classmethod
    def hinted(cls) -> Mapping[str, str]:
        """What to say of keys that only other families take, or none yet."""
        keys = {name: [k for k in family.Section.forms() if k != "type"] for name, family in FAMILIES.items()}
        own = [k for k in cls.forms() if k != "type"]
        owners = {k: [name for name in keys if k in keys[name]] for others in keys.values() for k in others}
        allowed = f"allowed here: type, {', '.join(own)}"
        elsewhere = {
            k: f"does not belong to type {' or '.join(cls.names())}, but to {' or '.join(names)}; {allowed}"
            for k, names in owners.items()
            if k not in own
        }
        return {**elsewhere, **cls.hints}


class Interval(Section):
    """An interval that is searched."""

    min: str = required(ENTRY, "where it begins, below max", example="0.01")
    max: str = required(ENTRY, "where it ends", example="2")
    points: str | None = key(ENTRY, "values on the grid, 2 to 10,000", otherwise="25", example="25")
    log: bool = key(FLAG, "whether neighbours on the grid differ by a factor", default=False, example="true")


class Frobenius(Section):
    """A bound on the Frobenius norm."""

    frobenius: str = required(ENTRY, "largest Frobenius norm, > 0", example="20")


class Sizes(Section):
    """Bounds on the size of a gain, spaced by a factor, that objective pareto goes through."""

    min: str = required(ENTRY, "least bound, > 0", example="1")
    max: str = required(ENTRY, "largest bound", example="1.0e+4")
    points: str | None = key(ENTRY, "how many, 2 to 100", otherwise="12", example="12")


SEVERAL = "a range {min: .., max: .., points: ..}"


@dataclass(frozen=True)
class Largest:
    """Several bounds, or one on the Frobenius norm, if there is such."""

    frobenius: bool

    def read(self, reader: Reader, value: Any, loc: Loc) -> Frobenius | Sizes | None:
        """Return the section."""
        if not Sizes.forms().keys().isdisjoint(value):
            return Sizes.read(reader, value, loc)
        if self.frobenius:
            return Frobenius.read(reader, value, loc)
        refuse(reader, f"a number, or {SEVERAL}", value, loc)
        return None

    def schema(self, definitions: Schema) -> Schema:
        """One of the sections."""
        return {"oneOf": [section.schema(definitions) for section in self.sections()]}

    def sections(self) -> list[type[Section]]:
        """Sections that may stand here."""
        return [*([Frobenius] if self.frobenius else []), Sizes]


LARGEST_GAIN = Either(f"a number, {{frobenius: a number}}, or {SEVERAL}", ENTRY, mapping=Largest(frobenius=True))
LARGEST_SPECTRAL = Either(f"a number, or {SEVERAL}", ENTRY, mapping=Largest(frobenius=False))
SEARCHED = Either("a number, or a range {min: .., max: .., points: .., log: ..}", ENTRY, mapping=Interval)


def refuse_conflicts(reader: Reader, request: Conflicting) -> None:
    """Refuse keys that do not go with others."""
    for keys, why in request.conflicts():
        if reader.clean(("observer", *keys)):
            reader.wrong(("observer", *keys), why, at_key=True, id="OBS206")


def note_unused(reader: Reader, section: Section, names: Sequence[str], why: str) -> None:
    """Note keys that are given, other than by default, and have no effect."""
    given = [name for name in names if getattr(section, name) != section.declared[name].default]
    reader.unused += [f"observer.{name} has no effect: {why}" for name in given]


def read_searched(reader: Reader, written: str | Interval, loc: Loc, sign: Sign, first: Sign = "> 0") -> fmpq | Range:
    """Read a number, or the range in which it is searched.

    `sign`, `first`: of the number, and of the end at which a range begins.
    """
    if isinstance(written, Interval):
        return read_range(reader, written, loc, first)
    return reader.number(written, loc, sign)


def read_range(reader: Reader, section: Interval, loc: Loc, sign: Sign = "> 0") -> Range:
    """Interval that is searched; one that is spaced by a factor cannot begin at zero."""
    before = len(reader.problems)
    low = reader.number(section.min, (*loc, "min"), "> 0" if section.log else sign)
    high = reader.number(section.max, (*loc, "max"), "> 0")
    points = reader.integer(section.points, (*loc, "points"), 25, 2, MAX_POINTS)
    if len(reader.problems) == before and low >= high:
        reader.wrong(
            loc,
            f"min {described(section.min)} is not below max {described(section.max)}; a range needs min < max",
            id="OBS208",
        )
    return Range(low, high, points, section.log)


def read_slack(reader: Reader, written: str | None) -> fmpq:
    """How far from the optimum a design may be."""
    return SLACK if written is None else reader.number(written, ("observer", "slack"), ">= 0")


def bounds_of(section: type[Section]) -> Either:
    """Form of bounds on what a design may use, or of the word auto."""
    word = OneOf("bounds", (AUTO,), beside=lambda: ("{gain: ..}",))
    return Either("auto, or a mapping of bounds", word, mapping=section)


def read_trade(
    reader: Reader, bounds: Section | str | None, gain: str, objective: str, problem: Estimation
) -> Trade | None:
    """What is asked of the curve of gamma against the size of a gain; None where nothing is.

    `bounds`: auto, or the section, whose entry of the gain may be several bounds.
    """
    loc: Loc = ("observer", "bounds")
    written = None if bounds is None or bounds == AUTO else getattr(bounds, gain)
    if bounds != AUTO and not isinstance(written, Sizes):
        return None
    if problem.plant is not None and not problem.plant.B.shape[1]:
        reader.wrong(loc, "the knee is one of gamma, and nothing disturbs this plant; give a number", id="OBS405")
    if bounds == AUTO:
        if objective != "min-gamma":
            said = f"auto is the knee of gamma against the gain, of objective min-gamma, not {objective}; give a number"
            reader.wrong(loc, said, id="OBS206")
        return Trade(gain)
    assert isinstance(written, Sizes)
    return Trade(gain, read_sizes(reader, written, gain, objective))


def read_sizes(reader: Reader, written: Sizes, gain: str, objective: str) -> Range:
    """Bounds on a gain that objective pareto goes through."""
    loc: Loc = ("observer", "bounds", gain)
    if objective != "pareto":
        reader.wrong(loc, "a range of bounds is for objective: pareto; give a number, or bounds: auto", id="OBS215")
    low, high = reader.number(written.min, (*loc, "min"), "> 0"), reader.number(written.max, (*loc, "max"), "> 0")
    points = reader.integer(written.points, (*loc, "points"), 12, 2, MOST_SIZES)
    if low >= high and reader.clean(loc):
        reader.wrong(loc, "min is not below max; a range needs min < max", id="OBS208")
    return Range(low, high, points, log=True)


def read_largest_gain(
    reader: Reader, written: str | Frobenius | Sizes | None, name: str
) -> tuple[fmpq | None, Literal["spectral", "frobenius"]]:
    """Largest gain, of several the largest of all, and the norm that is meant."""
    if isinstance(written, Sizes):
        return reader.number(written.max, ("observer", "bounds", name, "max"), "> 0"), "spectral"
    if isinstance(written, Frobenius):
        return read_bound(reader, written.frobenius, name, "frobenius"), "frobenius"
    return read_bound(reader, written, name), "spectral"


def read_bound(reader: Reader, written: str | None, *keys: str) -> fmpq | None:
    """One number of the bounds."""
    return None if written is None else reader.number(written, ("observer", "bounds", *keys), "> 0")


def read_gains(
    reader: Reader, section: Section | None, sizes: Mapping[str, tuple[Axis, Axis]]
) -> Mapping[str, Array] | None:
    """Gains to be analyzed, by name, of these numbers of rows and columns."""
    if section is None:
        return None
    loc: Loc = ("observer", "gains")
    return {
        name: reader.matrix(reader.entries(getattr(section, name), (*loc, name)), *size) for name, size in sizes.items()
    }
