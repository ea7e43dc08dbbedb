"""The sections `system:` and `nonlinearities:` of a spec: which keys there are and what form their values have."""

from collections.abc import Mapping
from typing import Any, ClassVar, Self

from obsdesign.nonlinearities import TEMPLATES
from obsdesign.sections.document import Loc
from obsdesign.sections.forms import (
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
    required,
)
from obsdesign.sections.values import Reader

AUTO = "auto"
MAX_BLOCKS = 400
REGION = Named("Region", MapOf(ListOf(ENTRY, 2, 2)))
EVERYWHERE = "everywhere"
SOMEWHERE = "where the type holds: [lo, hi] of q (q1, q2, ..), t, outputs, .."


TIMES = ("continuous", "discrete")
METHODS = ("hold", "implicit-euler")
METHOD_HINTS = {
    **dict.fromkeys(("zoh", "zero-order-hold", "exact", "c2d"), "is called hold here"),
    **dict.fromkeys(("euler", "forward-euler", "explicit-euler"), "is not there; hold is exact where f rests"),
    **dict.fromkeys(("backward-euler", "implicit"), "is called implicit-euler here"),
}


class Defect(Section):
    """How fast the continuous plant may move, so that a claim covers it at the samples."""

    q_rate: str = required(
        ENTRY,
        "largest |q_i'| of every nonlinearity, or auto: found on system.domain, of a plant as equations",
        unit="q per s",
        example="2.0",
    )
    w_rate: str | None = key(
        ENTRY, "largest |w'|, > 0; required where w acts on the states", unit="w per s", otherwise="0", example="1.0"
    )


class Discretise(Section):
    """A plant in samples that stands for a continuous one."""

    hints: ClassVar[Mapping[str, str]] = dict.fromkeys(("Ts", "ts", "dt", "sample-time"), "is called period here")

    period: str = required(ENTRY, "of the samples, > 0", unit="s", example="0.01")
    method: str = key(
        OneOf("method", METHODS, lambda: METHOD_HINTS),
        "hold: f, known terms and w are held over each period; implicit-euler: f is that of the next sample",
        default="hold",
        example="implicit-euler",
    )
    defect: Defect | None = key(
        Defect,
        "bounds, with which the error at the samples of the continuous plant is certified; method hold",
        otherwise="nothing is claimed of the continuous plant",
        example="{q_rate: 2.0, w_rate: 1.0}",
    )


class Signals(Section):
    """Names of the signals of a plant, however it is written."""

    hints: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("Ts", "ts", "dt", "sample-time", "sampling"), "is called period here: write time: discrete, and period: in s"
    )

    time: str = key(
        OneOf("time", TIMES),
        "discrete: the plant is x+ = A x + .., + the next sample, and `dynamics` give that",
        default="continuous",
        example="discrete",
    )
    period: str | None = key(
        ENTRY,
        "of the samples, > 0; required where anything of the spec is in seconds",
        unit="s",
        otherwise="1, or none in continuous time",
        example="0.01",
    )

    discretise: Discretise | None = key(
        Discretise,
        "design for a plant in samples that stands for this continuous one",
        otherwise="the plant as it is",
        example="{period: 0.01, method: hold}",
    )
    states: list[str] | None = key(
        ListOf(TEXT),
        "names of the states",
        otherwise="x1, x2, ..; of equations those of dynamics",
        example="[angle, speed]",
    )
    inputs: list[str] = key(
        ListOf(TEXT), "names of known inputs, usable in known terms and equations", default=[], example="[voltage]"
    )
    disturbances: list[str] | None = key(
        ListOf(TEXT), "names of the channels of w", otherwise="w1, w2, ..; of equations none", example="[torque, noise]"
    )
    units: dict[str, str] = key(
        MapOf(LINE), "units of states, outputs and inputs, for axes and tables", default={}, example="{angle: rad}"
    )


class InMatrices(Signals):
    """x' = A x + sum_i Bf_i f_i + gx + B w ;  y = C x + sum_i Df_i f_i + gy + D w."""

    hints: ClassVar[Mapping[str, str]] = {
        **Signals.hints,
        **dict.fromkeys(("domain", "types"), "belongs to a plant as equations (system.dynamics); see nonlinearities"),
    }

    outputs: list[str] | None = key(ListOf(TEXT), "names of the outputs", otherwise="y1, y2, ..", example="[encoder]")
    A: Entries = required(MATRIX, "nx x nx: the linear part", example="[[0, 1], [-2, -1]]")
    B: Entries | None = key(
        MATRIX,
        "nx x nw: how w, disturbance and noise, drives x",
        otherwise="no w",
        example="[[0, 0], [1, 0]]",
    )
    C: Entries = required(MATRIX, "ny x nx: what is measured", example="[1, 0]")
    D: Entries | None = key(MATRIX, "ny x nw: how w enters the outputs", otherwise="0", example="[0, 0.01]")
    gx: Items | None = key(
        SIGNALS,
        "nx known terms: expressions of t, the outputs and the inputs",
        otherwise="0",
        example="['0', u - y**3]",
    )
    gy: Items | None = key(
        SIGNALS, "ny known terms: expressions of t and the inputs", otherwise="0", example="[0.1*u1]"
    )


class Auto(Section):
    """A type that is derived from f."""

    region: dict[str, list[str]] | None = key(
        REGION,
        "[lo, hi] of q (q1, q2, ..) and of what else f depends on",
        otherwise="all numbers",
        example="{q: [-1, 1]}",
    )


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
        taking = {name: t.data for name, t in TEMPLATES.items() if t.data is not None}
        types = {name: Key(data.form, data.description, example=data.example) for name, data in taking.items()}
        derived = Key(Auto, "the tightest type that f is proved to have", example="{region: {q: [-1, 1]}}")
        return {**types, AUTO: derived, "region": key(REGION, SOMEWHERE, otherwise=EVERYWHERE, example="{q: [-1, 1]}")}

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

    dynamics: dict[str, str] = required(
        MapOf(ENTRY, 1),
        "derivative of each state: an expression of any signals and t",
        example="{angle: speed, speed: -sin(angle) + torque}",
    )
    outputs: dict[str, str] = required(
        MapOf(ENTRY, 1),
        "each output: an expression of states, inputs, disturbances and t",
        example="{encoder: angle + 0.002*noise}",
    )
    domain: dict[str, list[str]] | None = key(
        REGION, "[lo, hi] of signals: where the types of terms hold", otherwise="everywhere", example="{v: [5, 60]}"
    )
    types: dict[str, str | TypeData] = key(
        MapOf(TYPE), "types of terms, by their text or f1, f2, ..", default={}, example="{tanh(50*v): monotone}"
    )


class System:
    """The plant, in matrices or as equations."""

    def read(self, reader: Reader, value: Any, loc: Loc) -> InMatrices | Equations | None:
        """Return the section."""
        equations = isinstance(value, dict) and "dynamics" in value
        section: type[InMatrices | Equations] = Equations if equations else InMatrices
        return section.read(reader, value, loc)

    def schema(self, definitions: Schema) -> Schema:
        """One of the sections."""
        return {"oneOf": [section.schema(definitions) for section in self.sections()]}

    def sections(self) -> list[type[Section]]:
        """Sections that may stand here."""
        return [InMatrices, Equations]


class Function(Section):
    """One block of f in a disturbance model."""

    type: str | TypeData = required(TYPE, "what the design may assume of f", example="{slope: [0, 2.5]}")
    f: Items | None = key(
        SIGNALS,
        "nf_i expressions of q (q1, q2, ..), t, the outputs and the inputs",
        otherwise="that of the type, where it names one; else the spec cannot be simulated",
        example="3.33*sin(q)",
    )
    region: dict[str, list[str]] | None = key(REGION, SOMEWHERE, otherwise=EVERYWHERE, example="{q: [-1, 1]}")


class Nonlinearity(Function):
    """One block of f, with its own argument q = Cq x + Dqf f + gq + Dq w."""

    Bf: Entries | None = key(
        MATRIX,
        "nx x nf_i: how f_i drives the states",
        otherwise="0; where f is unstructured the identity",
        example="[0, -1]",
    )
    Cq: Entries | None = key(
        MATRIX,
        "nq_i x nx: how the states enter q_i",
        otherwise="0; where f is unstructured the identity",
        example="[1, 0]",
    )
    Dqf: Entries | None = key(
        MATRIX, "nq_i x nf: how f, all its blocks, enters q_i", otherwise="0", example="[[0, 0.1]]"
    )
    Dq: Entries | None = key(MATRIX, "nq_i x nw: how w enters q_i", otherwise="0", example="[[0, 0.1]]")
    gq: Items | None = key(
        SIGNALS, "nq_i known terms: expressions of t, the outputs and the inputs", otherwise="0", example="[u1]"
    )
    Df: Entries | None = key(MATRIX, "ny x nf_i: how f_i enters the outputs", otherwise="0", example="[0.1]")
