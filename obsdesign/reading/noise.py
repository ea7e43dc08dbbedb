"""The section `noise:` of a spec: how noisy the outputs are, as channels of w and as what a run draws.

y_i = .. + c_i n_i, with a channel n_i of w after those that are declared: c_i is the number that the section gives, the
rms or the density of the noise. w = v for it, and `performance` does not ask for it. Where y is known at instants, or
the observer takes the plant as equations, there is no channel, and the noise is that of the runs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.families import Family
from obsdesign.lmi.formula import zeros
from obsdesign.model.disturbance import stack, unknown
from obsdesign.model.equations import free
from obsdesign.reading import trial_schema as schema
from obsdesign.reading.generator import Exogenous
from obsdesign.reading.plant import Layout, Names, Reading
from obsdesign.sections import words
from obsdesign.sections.document import Loc
from obsdesign.sections.values import Reader
from obsdesign.trial import Level, Noise, Simulation

ZERO = Expression.number(0)
OF_RUNS = "is a key of simulation.noise; here stands the rms of each output, by its name"


def read_levels(reader: Reader, section: Mapping[str, str | schema.NoiseLevel]) -> dict[str, Level]:
    """Noise of the outputs by name; the names are held against those of the plant in `require_outputs`."""
    found = {}
    for name, written in section.items():
        loc: Loc = ("noise", name)
        if not isinstance(written, schema.NoiseLevel):
            found[name] = Level(reader.number(written, loc, "> 0"))
            continue
        given = [key for key in ("rms", "density") if getattr(written, key) is not None]
        if len(given) != 1 or (given == ["density"] and written.period is not None):
            reader.wrong(loc, "expected a number, {rms: .., period: ..} or {density: ..}", id="OBS206")
            continue
        number = reader.number(getattr(written, given[0]), (*loc, given[0]), "> 0")
        period = None if written.period is None else reader.number(written.period, (*loc, "period"), "> 0")
        found[name] = Level(number, period, density=given == ["density"])
    return found


def require_outputs(reader: Reader, levels: Mapping[str, Level], layout: Layout) -> None:
    """Refuse noise of what is no output."""
    for name in levels if layout.names else ():
        if layout.names and name not in layout.names.outputs:
            hints = dict.fromkeys(("type", "amplitude", "period"), OF_RUNS)
            said = words.unknown("output", name, layout.names.outputs, hints)
            reader.wrong(("noise", name), said, at_key=True, id="OBS203")


def channels(levels: Mapping[str, Level], names: Names) -> tuple[str, ...]:
    """Names of the channels of w that the noise is, in the order of the section; outputs that are none are left out."""
    taken = {"t", *names.states, *names.outputs, *names.inputs, *names.w}
    return tuple(free(f"noise_{name}", taken) for name in levels if name in names.outputs)


def in_outputs(outputs: Mapping[str, Expression], levels: Mapping[str, Level], names: Names) -> dict[str, Expression]:
    """Right sides of the outputs with their noise, y + c n."""
    noisy, added = [name for name in levels if name in outputs], dict[str, Expression]()
    for name, channel in zip(noisy, channels(levels, names), strict=True):
        parts = [outputs[name], Expression.variable(channel)]
        added[name] = Expression.combination([fmpq(1), levels[name].number], parts)
    return {**outputs, **added}


def in_matrices(reader: Reader, found: Reading, levels: Mapping[str, Level]) -> Reading:
    """The plant with the columns of the noise in D."""
    plant, names = found.plant, found.layout.names
    if plant is None or names is None or not levels:
        return found
    rows = [names.outputs.index(name) for name in levels if name in names.outputs]
    D = zeros((len(plant.D), len(rows)), [plant.A])
    D[rows, np.arange(len(rows))] = [levels[names.outputs[row]].number for row in rows]
    B, Dq = (zeros((len(M), len(rows)), [plant.A]) for M in (plant.B, plant.Dq))
    B, D, Dq = (np.hstack(pair) for pair in ((plant.B, B), (plant.D, D), (plant.Dq, Dq)))
    held = {name for side in (*found.gx, *found.gq) for name in side.names} & {names.outputs[row] for row in rows}
    for name in sorted(held):
        reader.notes.append(f"known terms of the plant hold {name}, and with it its noise: it drives the plant as well")
    wide = replace(plant, B=B, D=D, Dq=Dq, exogenous=(*plant.exogenous, *channels(levels, names)))
    return replace(found, plant=wide)


def beside(exogenous: Exogenous, count: int) -> Exogenous:
    """Disturbance model with so many further channels of w = v."""
    if not count or exogenous.generator is None:
        return exogenous
    v = None if exogenous.v.size is None else exogenous.v.size + count
    whole = stack([exogenous.generator, *[unknown()] * count])
    return replace(exogenous, generator=whole, v=exogenous.v.of(v), noisy=True)


def drawn(
    reader: Reader,
    levels: Mapping[str, Level],
    outputs: Sequence[str],
    simulation: Simulation,
    period: fmpq | None,
    steps: fmpq | None,
    family: Family | None,
) -> Simulation:
    """Trial in which the channels of the noise are still, and its noise is drawn where the trial has none of its own.

    `period`: s, of the samples, where the spec knows one; `steps`: of an implementation, which stands for a period that
    noise does not have.
    """
    own = {name: level.number for name, level in levels.items()} if family and family.noise_in_w else {}
    w, v = (None if side is None else (*side, *[ZERO] * len(own)) for side in (simulation.w, simulation.v))
    simulation = replace(simulation, w=w, v=v)
    if simulation.noise is not None or not levels:
        return simulation
    instants = family is not None and family.sampled
    known = {level.period for level in levels.values() if level.period is not None}
    if period is not None and known - {period}:
        said = f"the samples are {float(period):g} s apart, and noise is drawn at each; leave its period out"
        reader.wrong(("noise",), said, id="OBS208")
    if instants and any(level.density for level in levels.values()):
        reader.wrong(("noise",), "a measurement at an instant has no density of noise; give its rms", id="OBS208")
    held = period or (known.pop() if len(known) == 1 else None if known else steps)
    trouble = "" if instants or held is not None else why_not(levels, known)
    length = float(held) if held is not None else simulation.horizon
    sizes = [levels[name].rms(length) if name in levels else 0.0 for name in outputs]
    return replace(simulation, noise=Noise("gaussian", np.array(sizes), length, trouble, own))


def why_not(levels: Mapping[str, Level], periods: set[fmpq]) -> str:
    """Why a run cannot draw the noise, and what to write."""
    if len(periods) > 1:
        told = " and ".join(f"{float(period):g} s" for period in sorted(periods))
        return f"is held for {told}, and a run draws all of it at once: give one period, or simulation.noise"
    name, level = next(iter(levels.items()))
    said = "how long a value of it lasts is not known, which a run needs"
    if level.density:
        return f"{said}: give a rms with a period, {name}: {{rms: .., period: ..}}, or simulation.noise"
    return f"{said}: write {name}: {{rms: {float(level.number):g}, period: ..}}, in s, or give simulation.noise"
