"""The disturbance section of a spec: how w is generated from v."""

from collections.abc import Mapping, Sequence
from itertools import product
from math import pi

from flint import fmpq

from obsdesign.model import disturbance
from obsdesign.model.disturbance import Generator
from obsdesign.reading.blocks import Block, read_block, read_nonlinearity
from obsdesign.reading.disturbance_schema import ChannelData, Disturbance, DisturbanceModel
from obsdesign.reading.plant import Layout, order
from obsdesign.records import dataclass
from obsdesign.sections.document import Loc
from obsdesign.sections.scalars import described
from obsdesign.sections.values import Axis, Entries, Reader, Size, counted
from obsdesign.spec import Nonlinearity
from obsdesign.tables.text import at_least

MATRICES = ("Am", "Bmf", "Bm", "Cq2", "Dq2f", "Dq2", "Cm", "Dwf", "Dm")
XM, V = Axis(None, "state of the disturbance model"), Axis(None, "v")
Q2, F2 = Axis(None, "component of q2"), Axis(None, "component of f2")


@dataclass(frozen=True)
class Exogenous:
    """What was read of the disturbance section, open where an earlier error leaves it open."""

    xm: Axis = XM
    v: Axis = V
    q: Axis = Q2
    generator: Generator | None = None
    states: tuple[str, ...] = ()
    nonlinearities: tuple[Nonlinearity | None, ...] = ()
    noisy: bool = False  # whether its last channels are noise that the spec declares


@dataclass(frozen=True)
class Channel:
    """Model of one channel of w (or of all of them), with templates of the names of its states."""

    generator: Generator
    states: tuple[str, ...]
    nonlinearities: tuple[Nonlinearity | None, ...] = ()


def named(name: str, period: fmpq | None) -> Channel:
    """Model of the channel {w} by its name."""
    if name == "unknown":
        return Channel(disturbance.unknown(), ())
    if name == "integrator":
        return Channel(disturbance.integrator(period), ("{w}",))
    return Channel(disturbance.double_integrator(period), ("{w}", "d{w}"))


def read_disturbance(
    reader: Reader,
    section: str | ChannelData | Sequence[str | ChannelData] | None,
    layout: Layout,
    period: fmpq | None = None,
) -> Exogenous:
    """Model of the disturbance, in samples if there is a period; the section is None if its structure is wrong."""
    loc: Loc = ("disturbance",)
    if isinstance(section, Disturbance) and section.type is not None:
        section, loc = section.type, (*loc, "type")
    if section is None:
        return Exogenous()
    if section != "unknown" and layout.w.size == 0:
        written = reader.document.find(("system",))[1].value
        equations = isinstance(written, dict) and "dynamics" in written
        key = "system.disturbances" if equations else "system.B or system.D"
        reader.wrong(loc, f"there is no w to generate; give {key}", id="OBS405")
        return Exogenous()
    channels = read_channels(reader, section, loc, layout, period)
    if sum(len(channel.generator.Cm) for channel in channels) != layout.w.size:
        return Exogenous()
    return stacked(reader, channels, loc, layout)


def read_channels(
    reader: Reader,
    section: str | ChannelData | Sequence[str | ChannelData],
    loc: Loc,
    layout: Layout,
    period: fmpq | None,
) -> list[Channel]:
    """Models of the channels of w."""
    w = layout.w
    if isinstance(section, ChannelData) and section.model is not None:
        return [read_model(reader, section.model, (*loc, "model"), w, layout)]
    if isinstance(section, str | ChannelData):
        return [read_channel(reader, section, loc, layout, period)] * (w.size or 0)
    if not w.admits(len(section)):
        reader.wrong(loc, f"expected {counted(w.size, 'model')} ({w}), found {len(section)}", id="OBS209")
        return []
    return [read_channel(reader, item, (*loc, i), layout, period) for i, item in enumerate(section)]


def stacked(reader: Reader, channels: Sequence[Channel], loc: Loc, layout: Layout) -> Exogenous:
    """Models one under the other, with the names of their states."""
    nm = sum(len(channel.states) for channel in channels)
    if layout.states.size is not None:
        reader.limit(layout.states.size + nm, "states of the plant and of the disturbance model", loc)
    generator = disturbance.stack([channel.generator for channel in channels])
    called = layout.names.w if layout.names else ()
    names = [*called, *(f"w{i + 1}" for i in range(len(called), len(channels)))]
    templates = [(w, state) for w, channel in zip(names, channels, strict=False) for state in channel.states]
    states = tuple(state.format(w=w, k=k + 1) for k, (w, state) in enumerate(templates))
    taken = set(layout.names.states + layout.names.outputs + layout.names.inputs) if layout.names else set()
    for name in states:
        if name in taken:
            reader.wrong(
                loc, f"{name} names a state of the disturbance model; rename what is called so in system", id="OBS211"
            )
    return Exogenous(
        XM.of(nm),
        V.of(generator.Bm.shape[1]),
        Q2.of(generator.Cq2.shape[0]),
        generator,
        states,
        tuple(block for channel in channels for block in channel.nonlinearities),
    )


def read_channel(reader: Reader, section: str | ChannelData, loc: Loc, layout: Layout, period: fmpq | None) -> Channel:
    """Model of one channel of w."""
    if isinstance(section, str):
        return named(section, period)
    if section.model is not None:
        return read_model(reader, section.model, (*loc, "model"), layout.w.of(1), layout)
    if section.sinusoid is not None:
        omega = read_omega(reader, section.sinusoid.omega, (*loc, "sinusoid", "omega"), period)
        return Channel(disturbance.sinusoid(omega, period), ("{w}", "d{w}"))
    assert section.bias_sinusoid is not None  # the format has exactly one of the three
    omega = read_omega(reader, section.bias_sinusoid.omega, (*loc, "bias+sinusoid", "omega"), period)
    return Channel(disturbance.bias_and_sinusoid(omega, period), ("{w}.bias", "{w}.sine", "d{w}.sine"))


def read_omega(reader: Reader, text: str, loc: Loc, period: fmpq | None) -> fmpq:
    """Frequency of a sinusoid, which samples show up to half their rate."""
    omega = reader.number(text, loc, "> 0")
    if period is None or float(omega * period) < pi * (1 - 1e-6):
        return omega
    most = at_least(pi / float(period), 4)
    said = f"{described(text)} rad/s is too fast for samples {float(period):g} s apart, which show less than {most}"
    reader.wrong(loc, f"{said}; give a slower sinusoid, or a shorter system.period", id="OBS208")
    return fmpq(1, 2) / period


def read_model(reader: Reader, section: DisturbanceModel, loc: Loc, w: Axis, layout: Layout) -> Channel:
    """Model of the user's own."""
    matrices = {key: reader.entries(getattr(section, key), (*loc, key)) for key in MATRICES}
    otherwise = matrices["Cm"].shape(w.size)[1] or matrices["Bm"].shape()[0] or matrices["Bmf"].shape()[0] or 0
    nm = order(reader, matrices["Am"], otherwise)
    blocks = read_blocks(reader, section, matrices, loc, nm)
    xm = XM.of(nm)
    q = Q2.of(sum(block.nq for block in blocks))
    f = F2.of(sum(block.nf for block in blocks))
    nv = matrices["Bm"].shape(nm)[1] or matrices["Dm"].shape(w.size)[1] or matrices["Dq2"].shape(q.size)[1] or 0
    v = V.of(nv)
    reader.limit(q.size, "components of q2", loc)
    reader.limit(f.size, "components of f2", loc)
    axes = zip(MATRICES, product((xm, q, w), (xm, f, v)), strict=True)
    exact = {key: reader.matrix(matrices[key], rows, columns) for key, (rows, columns) in axes}
    known = layout.known("outputs", "inputs")
    nonlinearities = tuple(read_nonlinearity(reader, block, known) for block in blocks)
    generator = Generator(**exact, inverse=(None,) * (w.size or 0))
    return Channel(generator, ("xm{k}",) * (nm or 0), nonlinearities)


def read_blocks(
    reader: Reader, section: DisturbanceModel, matrices: Mapping[str, Entries], loc: Loc, nm: Size
) -> list[Block]:
    """Nonlinear blocks of a model; a single one takes all of q2 and f2, several take a component each."""
    nq = nf = None
    if len(section.nonlinearities) == 1:
        nq = matrices["Cq2"].shape(None, nm)[0] or matrices["Dq2f"].shape()[0] or matrices["Dq2"].shape()[0]
        nf = matrices["Bmf"].shape(nm)[1] or matrices["Dwf"].shape()[1]
    return [
        read_block(reader, function, (*loc, "nonlinearities", i), nq, nf)
        for i, function in enumerate(section.nonlinearities)
    ]
