"""The section `disturbance:` of a spec: which keys there are and what form their values have."""

from collections.abc import Mapping
from typing import ClassVar

from obsdesign.reading.plant_schema import MAX_BLOCKS, Function
from obsdesign.sections.forms import ENTRY, MATRIX, Either, Entries, ListOf, OneOf, Section, key, required

CHANNELS = ("unknown", "integrator", "double-integrator")
CHANNEL_FORMS = ("sinusoid", "bias+sinusoid", "model")


class Frequency(Section):
    """Of a sinusoid."""

    omega: str = required(ENTRY, "frequency, > 0", unit="rad/s", example="2")


class DisturbanceModel(Section):
    """xm' = Am xm + Bmf f2 + Bm v, q2 = Cq2 xm + Dq2f f2 + Dq2 v, w = Cm xm + Dwf f2 + Dm v."""

    Am: Entries | None = key(MATRIX, "nm x nm", otherwise="0", example="[[0, 1], [-4, 0]]")
    Bm: Entries | None = key(MATRIX, "nm x nv", otherwise="0", example="[0, 1]")
    Cm: Entries | None = key(MATRIX, "nw x nm", otherwise="0", example="[1, 0]")
    Dm: Entries | None = key(MATRIX, "nw x nv", otherwise="0", example="[[0, 0.1]]")
    Bmf: Entries | None = key(MATRIX, "nm x nf2, f2 the blocks of the model", otherwise="0", example="[0, -1]")
    Cq2: Entries | None = key(MATRIX, "nq2 x nm", otherwise="0", example="[1, 0]")
    Dq2f: Entries | None = key(MATRIX, "nq2 x nf, for the blocks of both", otherwise="0", example="[[0, 0.1]]")
    Dq2: Entries | None = key(MATRIX, "nq2 x nv", otherwise="0", example="[[0, 0.1]]")
    Dwf: Entries | None = key(MATRIX, "nw x nf2", otherwise="0", example="[0.1]")
    nonlinearities: list[Function] = key(
        ListOf(Function, most=MAX_BLOCKS),
        "blocks of f2, with f and type only",
        default=[],
        example="[{f: q**3, type: monotone}]",
    )


class ChannelData(Section):
    """A disturbance model that has data."""

    beside = ()
    hints: ClassVar[Mapping[str, str]] = {
        **{name: f"takes no data; write {name}" for name in CHANNELS},
        "type": "is left out in a list: write [integrator, unknown, ..]",
    }

    sinusoid: Frequency | None = key(Frequency, "w'' = -omega^2 w + v", otherwise="another model", example="{omega: 2}")
    bias_sinusoid: Frequency | None = key(
        Frequency,
        "the sum of an integrator and a sinusoid, each with a v of its own",
        name="bias+sinusoid",
        otherwise="another model",
        example="{omega: 2}",
    )
    model: DisturbanceModel | None = key(
        DisturbanceModel,
        "any model, in matrices",
        otherwise="another model",
        example="{Am: -0.1, Bm: 1, Cm: 1}",
    )


CHANNEL_HINTS = {
    **{name: f"needs data: {{{name}: ..}}" for name in CHANNEL_FORMS},
    **dict.fromkeys(("constant", "bias", "drift", "random-walk", "step"), "is called integrator here: w' = v"),
    "ramp": "is called double-integrator here: w'' = v",
    **dict.fromkeys(("sine", "sin", "harmonic", "periodic"), "is written {sinusoid: {omega: ..}}"),
    **dict.fromkeys(("none", "noise", "white", "white-noise", "bounded"), "has no model: write unknown, w = v"),
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
        Either(CHANNELWISE, CHANNEL_NAME, ListOf(CHANNEL), mapping=ChannelData),
        "the model, or a list with one for each channel of w",
        otherwise="the model stands beside it",
        example="[integrator, unknown]",
    )
