"""The format of a spec, version 1: which keys there are and what form their values have.

The models hold structure only: sizes and meanings are for `resolve`. Every section of a file may be None,
which is what is left of a section whose structure is wrong. What each family of observers takes stands in `families`.
"""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, get_args

from pydantic import ConfigDict, Field, Tag, ValidationError
from pydantic import model_validator as validator
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import PydanticCustomError, core_schema
from typing_extensions import TypeAliasType

from obsdesign.nonlinearities import FUNCTIONS
from obsdesign.reading.families import AnyObserver
from obsdesign.reading.forms import (
    Automatic,
    Choice,
    Entry,
    Matrix,
    OneOf,
    Section,
    Signals,
    Text,
    Vector,
    outline,
    told_apart,
)
from obsdesign.reading.words import unavailable

TYPES = ("monotone", *FUNCTIONS)
FORMS = (
    "lipschitz", "slope", "sector", "cocoercive", "ball", "one-sided-lipschitz", "jacobian", "cone", "multiplier",
)  # fmt: skip
MAX_BLOCKS = 400
MAX_MATRICES = 1024
CHANNELS = ("unknown", "integrator", "double-integrator")
CHANNEL_FORMS = ("sinusoid", "bias+sinusoid", "model")


class System(Section):
    """x' = A x + sum_i Bf_i f_i + gx + B w ;  y = C x + sum_i Df_i f_i + gy + D w."""

    hints = unavailable(("dynamics", "domain"), ("A", "C"))

    states: list[Text] | None = Field(None, description="names, default x1, x2, ..")
    outputs: list[Text] | None = Field(None, description="names, default y1, y2, ..")
    inputs: list[Text] = Field([], description="names of known inputs, usable in gx, gy, gq and f")
    units: dict[str, Text] = Field({}, description="units of states, outputs and inputs, for axes and tables")
    A: Matrix = Field(description="nx x nx")
    B: Matrix | None = Field(None, description="nx x nw; w is disturbance and noise together")
    C: Matrix = Field(description="ny x nx")
    D: Matrix | None = Field(None, description="ny x nw")
    gx: Signals | None = Field(None, description="known terms: expressions of t, the outputs and the inputs")
    gy: Signals | None = Field(None, description="known terms: expressions of t and the inputs")

    @validator(mode="before")
    @classmethod
    def _matrices(cls, data: Any) -> Any:
        if isinstance(data, dict) and "dynamics" in data:
            refusal = PydanticCustomError("later", "{message}", {"message": cls.hints["dynamics"]})
            error = {"type": refusal, "loc": ("dynamics",), "input": data}
            raise ValidationError.from_exception_data(cls.__name__, [error])  # type: ignore[list-item]
        return data


Matrices = TypeAliasType("Matrices", Annotated[list[Matrix], Field(min_length=1, max_length=MAX_MATRICES)])
Region = TypeAliasType("Region", dict[str, Annotated[list[Entry], Field(min_length=2, max_length=2)]])


class Auto(Section):
    """A type that is derived from f."""

    region: Region | None = Field(None, description="[lo, hi] of q (q1, q2, ..) and of what else f depends on")


class Sector(Section):
    """(df - K1 dq)' (K2 dq - df) >= 0."""

    K1: Matrix | None = Field(None, description="nf x nq, default 0")
    K2: Matrix = Field(description="nf x nq")


class Ball(Section):
    """norm(df - K dq) <= norm(W dq)."""

    K: Matrix | None = Field(None, description="nf x nq, default 0")
    W: Matrix = Field(description="with nq columns")


class OneSidedLipschitz(Section):
    """dq'df <= rho dq'dq and df'df <= beta dq'dq + phi dq'df."""

    rho: Entry
    beta: Entry
    phi: Entry


class TypeData(Choice):
    """A type of nonlinearity that has data, and where it holds."""

    hints: ClassVar[Mapping[str, str]] = {name: f"takes no data; write type: {name}" for name in TYPES}
    beside = ("region",)

    lipschitz: Entry | None = Field(None, description="norm(df) <= lipschitz norm(dq); or auto")
    slope: (
        Annotated[
            Annotated[str, Automatic("[lo, hi]"), Tag("<scalar>")]
            | Annotated[list[Vector], Field(min_length=2, max_length=2), Tag("<list>")],
            told_apart("[lo, hi], or auto", outline),
        ]
        | None
    ) = Field(None, description="[lo, hi], each a number or one for each component; .inf allowed for hi; or auto")
    sector: Sector | None = None
    cocoercive: Entry | None = Field(None, description="dq'df >= df'df / cocoercive; or auto")
    ball: Ball | None = None
    one_sided_lipschitz: OneSidedLipschitz | None = Field(None, alias="one-sided-lipschitz")
    jacobian: (
        Annotated[
            Annotated[str, Automatic("a list of matrices"), Tag("<scalar>")] | Annotated[Matrices, Tag("<list>")],
            told_apart("a list of matrices, or auto", outline),
        ]
        | None
    ) = Field(None, description="every Jacobian is in the convex hull of these nf x nq matrices; or auto")
    cone: Matrices | None = Field(
        None, description="every Jacobian is a nonnegative combination of these nf x nq matrices"
    )
    multiplier: Matrix | None = Field(None, description="M of [dq; df]' M [dq; df] >= 0, (nq + nf) square")
    auto: Auto | None = Field(None, description="the tightest type that f is proved to have")
    region: Region | None = Field(None, description="where the type holds: [lo, hi] of q (q1, q2, ..), t, outputs, ..")


Type = Annotated[
    Annotated[
        str,
        OneOf("type", (*TYPES, "auto"), {name: f"needs data: {{{name}: ..}}" for name in FORMS}),
        Tag("<scalar>"),
    ]
    | Annotated[TypeData, Tag("<mapping>")],
    told_apart("the name of a type, or a mapping with its data"),
]


class Function(Section):
    """One block of f in a disturbance model."""

    type: Type = Field(description="what the design may assume of f")
    f: Signals | None = Field(None, description="expressions of q (q1, q2, ..), t, the outputs and the inputs")
    region: Region | None = Field(None, description="where the type holds: [lo, hi] of q (q1, q2, ..), t, outputs, ..")


class Nonlinearity(Function):
    """One block of f, with its own argument q = Cq x + Dqf f + gq + Dq w."""

    Bf: Matrix | None = Field(None, description="nx x nf_i")
    Cq: Matrix | None = Field(None, description="nq_i x nx")
    Dqf: Matrix | None = Field(None, description="nq_i x nf, for all blocks of the plant")
    Dq: Matrix | None = Field(None, description="nq_i x nw")
    gq: Signals | None = Field(None, description="known terms: expressions of t, the outputs and the inputs")
    Df: Matrix | None = Field(None, description="ny x nf_i")


class Frequency(Section):
    """Of a sinusoid."""

    omega: Entry = Field(description="rad/s")


class DisturbanceModel(Section):
    """xm' = Am xm + Bmf f2 + Bm v, q2 = Cq2 xm + Dq2f f2 + Dq2 v, w = Cm xm + Dwf f2 + Dm v."""

    Am: Matrix | None = None
    Bm: Matrix | None = None
    Cm: Matrix | None = None
    Dm: Matrix | None = None
    Bmf: Matrix | None = None
    Cq2: Matrix | None = None
    Dq2f: Matrix | None = None
    Dq2: Matrix | None = None
    Dwf: Matrix | None = None
    nonlinearities: list[Function] = Field([], max_length=MAX_BLOCKS, description="f and type only")


class ChannelData(Choice):
    """A disturbance model that has data."""

    hints: ClassVar[Mapping[str, str]] = {name: f"takes no data; write {name}" for name in CHANNELS}

    sinusoid: Frequency | None = None
    bias_sinusoid: Frequency | None = Field(None, alias="bias+sinusoid")
    model: DisturbanceModel | None = None


ChannelName = Annotated[
    str,
    OneOf("disturbance", CHANNELS, {name: f"needs data: {{{name}: ..}}" for name in CHANNEL_FORMS}),
    Tag("<scalar>"),
]
Channel = Annotated[
    ChannelName | Annotated[ChannelData, Tag("<mapping>")],
    told_apart("the name of a disturbance model, or a mapping with its data"),
]
Channels = Annotated[
    ChannelName | Annotated[ChannelData, Tag("<mapping>")] | Annotated[list[Channel], Tag("<list>")],
    told_apart("a disturbance model, or a list with one for each channel of w"),
]


class Disturbance(ChannelData):
    """How w is generated from v; `type` may be left out."""

    type: Channels | None = None


class Weight(Section):
    """z = H e."""

    H: Matrix = Field(description="over the augmented state (x, xm)")


NoiseName = Literal["uniform", "gaussian"]


class Law(Section):
    """A law of the sampling instants."""

    law: Entry = Field(description="expression of t for the next interval")


SamplingName = Literal["periodic", "random"]


class Noise(Section):
    """Extra measurement noise, constant over each period."""

    type: Annotated[NoiseName, OneOf("noise", get_args(NoiseName))] = "uniform"
    amplitude: Vector = Field(description="half width or standard deviation, one number or one for each output")
    period: Entry | None = Field(None, description="s; for type sporadic noise is drawn at each measurement")


class Simulation(Section):
    """How to try the observer."""

    hints = unavailable(("events",), ())

    horizon: Entry = Field(description="s")
    x0: Vector | None = Field(None, description="over x, or over the augmented state; default 0")
    xhat0: Vector | None = Field(None, description="over x, or over the augmented state; default 0")
    w: Signals | None = Field(None, description="expressions of t and the states")
    v: Signals | None = Field(None, description="expressions of t: what drives the disturbance model")
    u: Signals | None = Field(None, description="known inputs: expressions of t and the states")
    noise: Noise | None = None
    sampling: (
        Annotated[
            Annotated[SamplingName, OneOf("sampling", get_args(SamplingName)), Tag("<scalar>")]
            | Annotated[Law, Tag("<mapping>")],
            told_apart("periodic, random, or {law: an expression of t}"),
        ]
        | None
    ) = Field(None, description="of the family sporadic: periodic (default, T2), random in [T1, T2], or a law")
    period: Entry | None = Field(None, description="s, of periodic sampling; default T2")
    dropout: Entry | None = Field(None, description="share of the measurements that are lost, in [0, 1)")
    theta0: Vector | None = Field(None, description="correction before the first measurement; default 0")
    seed: Entry | None = None
    points: Entry | None = Field(None, description="samples kept, default 2000")


class File(Section):
    """A spec of obsdesign, format 1: one estimation problem."""

    model_config = ConfigDict(defer_build=False)  # the whole format is built here, at once

    obsdesign: Entry | None = Field(description="version of the format: 1")
    name: Text | None = None
    source: Text | None = None
    description: Text | None = None
    parameters: dict[str, Entry] | None = Field({}, description="numbers, usable by name in entries and expressions")
    system: System | None
    nonlinearities: list[Nonlinearity] | None = Field([], max_length=MAX_BLOCKS, description="the blocks f_i")
    disturbance: (
        Annotated[
            ChannelName | Annotated[Disturbance, Tag("<mapping>")] | Annotated[list[Channel], Tag("<list>")],
            told_apart("a disturbance model, or a list with one for each channel of w"),
        ]
        | None
    ) = "unknown"
    performance: (
        Annotated[
            Annotated[str, Tag("<scalar>")]
            | Annotated[list[Text], Tag("<list>")]
            | Annotated[Weight, Tag("<mapping>")],
            told_apart("x, w, all, a list of names, or {H: a matrix}"),
        ]
        | None
    ) = "x"
    observer: AnyObserver | None
    simulation: Simulation | None = None
    expect: dict[str, Any] | None = Field({}, description="what this spec must give")


class SchemaWriter(GenerateJsonSchema):
    """JSON Schema in which a key may be left out but not be null."""

    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        """Return the schema of the value itself."""
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        """Return the schema of the value itself, where the default is that there is none."""
        if "default" in schema and schema["default"] is None:
            return self.generate_inner(schema["schema"])
        return super().default_schema(schema)


def json_schema() -> dict[str, Any]:
    """JSON Schema of the format, for editors."""
    return File.model_json_schema(schema_generator=SchemaWriter)
