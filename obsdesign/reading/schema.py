"""The format of a spec, version 1: which keys there are and what form their values have.

The sections hold structure only: sizes and meanings are for `resolve`. Every section of a file may be None,
which is what is left of a section whose structure is wrong. What each family of observers takes stands in its folder,
and the data of each type of nonlinearity in its file.
"""

import re
from collections.abc import Mapping
from typing import Any, ClassVar, Self

from obsdesign.families import FAMILIES
from obsdesign.families.asked import FAMILY, ObserverSection
from obsdesign.nonlinearities import TEMPLATES
from obsdesign.reading.trial_schema import Simulation
from obsdesign.sections.document import Loc
from obsdesign.sections.forms import (
    ANYTHING,
    ENTRY,
    LINE,
    MATRIX,
    SIGNALS,
    TEXT,
    Either,
    Entries,
    Items,
    Key,
    ListOf,
    MapOf,
    Named,
    OneOf,
    Schema,
    Section,
    key,
    nearest,
    refuse,
    required,
)
from obsdesign.sections.values import Reader

AUTO = "auto"
MAX_BLOCKS = 400
CHANNELS = ("unknown", "integrator", "double-integrator")
CHANNEL_FORMS = ("sinusoid", "bias+sinusoid", "model")
REGION = Named("Region", MapOf(ListOf(ENTRY, 2, 2)))
SOMEWHERE = "where the type holds: [lo, hi] of q (q1, q2, ..), t, outputs, .."


DISCRETE = "belongs to discrete time, which is not available in this version: the plant is x' = A x + .."


class Signals(Section):
    """Names of the signals of a plant, however it is written."""

    hints: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("Ts", "ts", "dt", "period", "time", "sample-time", "discretise"), DISCRETE
    )

    states: list[str] | None = key(ListOf(TEXT), "names, default x1, x2, ..")
    inputs: list[str] = key(ListOf(TEXT), "names of known inputs, usable in gx, gy, gq and f", default=[])
    disturbances: list[str] | None = key(ListOf(TEXT), "names of the channels of w, default w1, w2, ..")
    units: dict[str, str] = key(MapOf(LINE), "units of states, outputs and inputs, for axes and tables", default={})


class InMatrices(Signals):
    """x' = A x + sum_i Bf_i f_i + gx + B w ;  y = C x + sum_i Df_i f_i + gy + D w."""

    hints: ClassVar[Mapping[str, str]] = {
        **Signals.hints,
        **dict.fromkeys(("domain", "types"), "belongs to a plant as equations (system.dynamics); see nonlinearities"),
    }

    outputs: list[str] | None = key(ListOf(TEXT), "names, default y1, y2, ..")
    A: Entries = required(MATRIX, "nx x nx")
    B: Entries | None = key(MATRIX, "nx x nw; w is disturbance and noise together")
    C: Entries = required(MATRIX, "ny x nx")
    D: Entries | None = key(MATRIX, "ny x nw")
    gx: Items | None = key(SIGNALS, "known terms: expressions of t, the outputs and the inputs")
    gy: Items | None = key(SIGNALS, "known terms: expressions of t and the inputs")


class Auto(Section):
    """A type that is derived from f."""

    region: dict[str, list[str]] | None = key(REGION, "[lo, hi] of q (q1, q2, ..) and of what else f depends on")


class TypeData(Section):
    """A type of nonlinearity that has data, and where it holds."""

    beside = ("region",)

    def __init__(self, name: str, data: Any, region: dict[str, list[str]] | None = None) -> None:
        self.name = name
        self.data = data  # as the form of the type reads it
        self.region = region

    @classmethod
    def forms(cls) -> dict[str, Key]:
        """Types that take data, as they are registered."""
        types = {name: Key(t.data.form, t.data.description) for name, t in TEMPLATES.items() if t.data is not None}
        derived = Key(Auto, "the tightest type that f is proved to have")
        return {**types, AUTO: derived, "region": Key(REGION, SOMEWHERE)}

    @classmethod
    def hinted(cls) -> Mapping[str, str]:
        """What to say of types that take no data."""
        return {name: f"takes no data; write type: {name}" for name, t in TEMPLATES.items() if t.data is None}

    @classmethod
    def of(cls, found: Mapping[str, Any]) -> Self:
        """Return the type that is given."""
        name = next(name for name in found if name not in cls.beside)
        return cls(name, found[name], found.get("region"))


TYPE = Either(
    "the name of a type, or a mapping with its data",
    OneOf(
        "type",
        lambda: (*(name for name, template in TEMPLATES.items() if template.data is None), AUTO),
        lambda: {name: f"needs data: {{{name}: ..}}" for name, t in TEMPLATES.items() if t.data is not None},
        lambda: tuple(f"{{{name}: ..}}" for name, template in TEMPLATES.items() if template.data is not None),
    ),
    mapping=TypeData,
)


class Equations(Signals):
    """x' = f(t, x, u, w, y) and y = h(t, x, u, w), by name."""

    hints: ClassVar[Mapping[str, str]] = {
        **Signals.hints,
        **dict.fromkeys(
            ("A", "B", "C", "D", "gx", "gy"), "belongs to a plant in matrices; with dynamics the tool makes it"
        ),
    }

    dynamics: dict[str, str] = required(MapOf(ENTRY, 1), "derivative of each state: an expression of any signals and t")
    outputs: dict[str, str] = required(
        MapOf(ENTRY, 1), "each output: an expression of states, inputs, disturbances and t"
    )
    domain: dict[str, list[str]] | None = key(REGION, "[lo, hi] of signals: where the types of terms hold")
    types: dict[str, str | TypeData] = key(MapOf(TYPE), "types of terms, by their text or f1, f2, ..", default={})


class System:
    """The plant, in matrices or as equations."""

    def read(self, reader: Reader, value: Any, loc: Loc) -> InMatrices | Equations | None:
        """Return the section."""
        equations = isinstance(value, dict) and "dynamics" in value
        section: type[InMatrices | Equations] = Equations if equations else InMatrices
        return section.read(reader, value, loc)

    def schema(self, definitions: Schema) -> Schema:
        """One of the sections."""
        return {"oneOf": [section.schema(definitions) for section in (InMatrices, Equations)]}


class Function(Section):
    """One block of f in a disturbance model."""

    type: str | TypeData = required(TYPE, "what the design may assume of f")
    f: Items | None = key(SIGNALS, "expressions of q (q1, q2, ..), t, the outputs and the inputs")
    region: dict[str, list[str]] | None = key(REGION, SOMEWHERE)


class Nonlinearity(Function):
    """One block of f, with its own argument q = Cq x + Dqf f + gq + Dq w."""

    Bf: Entries | None = key(MATRIX, "nx x nf_i")
    Cq: Entries | None = key(MATRIX, "nq_i x nx")
    Dqf: Entries | None = key(MATRIX, "nq_i x nf, for all blocks of the plant")
    Dq: Entries | None = key(MATRIX, "nq_i x nw")
    gq: Items | None = key(SIGNALS, "known terms: expressions of t, the outputs and the inputs")
    Df: Entries | None = key(MATRIX, "ny x nf_i")


class Frequency(Section):
    """Of a sinusoid."""

    omega: str = required(ENTRY, "rad/s")


class DisturbanceModel(Section):
    """xm' = Am xm + Bmf f2 + Bm v, q2 = Cq2 xm + Dq2f f2 + Dq2 v, w = Cm xm + Dwf f2 + Dm v."""

    Am: Entries | None = key(MATRIX)
    Bm: Entries | None = key(MATRIX)
    Cm: Entries | None = key(MATRIX)
    Dm: Entries | None = key(MATRIX)
    Bmf: Entries | None = key(MATRIX)
    Cq2: Entries | None = key(MATRIX)
    Dq2f: Entries | None = key(MATRIX)
    Dq2: Entries | None = key(MATRIX)
    Dwf: Entries | None = key(MATRIX)
    nonlinearities: list[Function] = key(ListOf(Function, most=MAX_BLOCKS), "f and type only", default=[])


class ChannelData(Section):
    """A disturbance model that has data."""

    beside = ()
    hints: ClassVar[Mapping[str, str]] = {
        **{name: f"takes no data; write {name}" for name in CHANNELS},
        "type": "is left out in a list: write [integrator, unknown, ..]",
    }

    sinusoid: Frequency | None = key(Frequency)
    bias_sinusoid: Frequency | None = key(Frequency, name="bias+sinusoid")
    model: DisturbanceModel | None = key(DisturbanceModel)


CHANNEL_HINTS = {
    **{name: f"needs data: {{{name}: ..}}" for name in CHANNEL_FORMS},
    **dict.fromkeys(("constant", "bias", "drift", "random-walk", "step"), "is called integrator here: w' = v"),
    "ramp": "is called double-integrator here: w'' = v",
    **dict.fromkeys(("sine", "sin", "harmonic", "periodic"), "is written {sinusoid: {omega: ..}}"),
    **dict.fromkeys(("none", "noise", "white-noise", "bounded"), "has no model: write unknown, w = v"),
}
CHANNEL_NAME = OneOf(
    "disturbance",
    CHANNELS,
    lambda: CHANNEL_HINTS,
    lambda: ("{sinusoid: {omega: ..}}", "{bias+sinusoid: {omega: ..}}", "{model: ..}"),
)
CHANNEL = Either("the name of a disturbance model, or a mapping with its data", CHANNEL_NAME, mapping=ChannelData)
CHANNELWISE = "a disturbance model, or a list with one for each channel of w"


class Disturbance(ChannelData):
    """How w is generated from v; `type` may be left out."""

    type: str | ChannelData | list[str | ChannelData] | None = key(
        Either(CHANNELWISE, CHANNEL_NAME, ListOf(CHANNEL), mapping=ChannelData)
    )


class Weight(Section):
    """z = H e."""

    H: Entries = required(MATRIX, "over the augmented state (x, xm)")


class Observer:
    """The section of the family that `type` names."""

    def read(self, reader: Reader, value: Any, loc: Loc) -> ObserverSection | None:
        """Return the section; where the family is not known that says it all."""
        name = value.get("type") if isinstance(value, dict) else None
        if isinstance(value, dict) and "type" in value and not (isinstance(name, str) and name in FAMILIES):
            FAMILY.read(reader, name, (*loc, "type"))
            return None
        section: type[ObserverSection] = FAMILIES[name or next(iter(FAMILIES))].Section
        return section.read(reader, value, loc)

    def schema(self, definitions: Schema) -> Schema:
        """One of the sections."""
        sections = dict.fromkeys(family.Section for family in FAMILIES.values())
        return {"oneOf": [section.schema(definitions) for section in sections]}


class File(Section):
    """A spec of obsdesign, format 1: one estimation problem."""

    obsdesign: str | None = required(ENTRY, "version of the format: 1")
    name: str | None = key(LINE)
    source: str | None = key(TEXT)
    description: str | None = key(TEXT)
    reproduces: list[str] | None = key(
        ListOf(LINE), "figures and tables of `source` that this spec makes again, such as Fig. 3", default=[]
    )
    parameters: dict[str, str] | None = key(
        MapOf(ENTRY), "numbers, usable by name in entries and expressions", default={}
    )
    system: InMatrices | Equations | None = required(System())
    nonlinearities: list[Nonlinearity] | None = key(ListOf(Nonlinearity, most=MAX_BLOCKS), "the blocks f_i", default=[])
    disturbance: str | Disturbance | list[str | ChannelData] | None = key(
        Either(CHANNELWISE, CHANNEL_NAME, ListOf(CHANNEL), mapping=Disturbance), default="unknown"
    )
    performance: str | list[str] | Weight | None = key(
        Either("x, w, all, a list of names, or {H: a matrix}", TEXT, ListOf(TEXT), mapping=Weight), default="x"
    )
    observer: ObserverSection | None = required(Observer())
    simulation: Simulation | None = key(Simulation)
    expect: dict[str, Any] | None = key(MapOf(ANYTHING), "what this spec must give", default={})


def read_file(reader: Reader) -> File | None:
    """Structure of a document; a section in which something is wrong, be it only as YAML, is None."""
    tree, keys = reader.document.root.plain(), File.forms()
    if not isinstance(tree, dict):
        refuse(reader, f"a mapping with the keys {', '.join(keys)}", tree, ())
        return None
    before = list(reader.problems)
    known = {problem.key for problem in before}
    found = File.values(reader, tree, ())
    reader.problems[:] = before + [problem for problem in reader.problems[len(before) :] if problem.key not in known]
    names = [re.split(r"[.\[]", problem.key)[0] for problem in reader.problems]
    broken = {nearest(name, tuple(keys)) for name in names}
    return File(**{name: None if name in broken else found.get(name, one.default) for name, one in keys.items()})


def json_schema() -> Schema:
    """JSON Schema of the format, for editors."""
    definitions: Schema = {}
    whole = File.object(definitions)
    return {"$defs": definitions, **whole}
