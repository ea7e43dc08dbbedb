"""The simulation section of a spec: how to try the observer."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from flint import fmpq

from obsdesign.spec import schema
from obsdesign.spec.document import Loc
from obsdesign.spec.model import Noise, Simulation, Vector
from obsdesign.spec.plant import Layout
from obsdesign.spec.values import Axis, Reader, counted

MAX_PERIODS = 10**7  # of noise in a simulation, each with a sample of every output
MAX_POINTS = 10**6


def read_simulation(
    reader: Reader, section: schema.Simulation | None, layout: Layout, xm: Axis, v: Axis
) -> Simulation | None:
    """Return the trial; None if there is none."""
    if section is None:
        return None
    loc: Loc = ("simulation",)
    horizon = reader.number(section.horizon, (*loc, "horizon"), "> 0")
    known = layout.known("states")
    if section.w is not None and section.v is not None:
        reader.wrong((*loc, "v"), "w is given already; give w or v, the signal that drives the disturbance model")
    xhat0 = read_state(reader, section.xhat0, (*loc, "xhat0"), layout.states, xm)
    size = (layout.states.size or 0) + (xm.size or 0)
    w = None if section.w is None else reader.expressions(section.w, (*loc, "w"), layout.w, known)
    inputs = Axis(None if layout.names is None else len(layout.names.inputs), "input")
    return Simulation(
        horizon=float(horizon),
        x0=read_state(reader, section.x0, (*loc, "x0"), layout.states, xm),
        xhat0=np.concatenate([xhat0, np.zeros(max(size - len(xhat0), 0))]),
        w=w,
        v=reader.expressions(section.v, (*loc, "v"), v, ("t",)) if w is None else None,
        u=reader.expressions(section.u, (*loc, "u"), inputs, known),
        noise=read_noise(reader, section.noise, layout.outputs, horizon),
        seed=reader.integer(section.seed, (*loc, "seed"), 0, 0, 2**63 - 1),
        points=reader.integer(section.points, (*loc, "points"), 2000, 2, MAX_POINTS),
    )


def read_state(reader: Reader, written: str | Sequence[str] | None, loc: Loc, x: Axis, xm: Axis) -> Vector:
    """State at the beginning, of the plant or of the augmented plant."""
    entries = reader.entries(written, loc)
    if x.size is not None and xm.size:
        total = x.size + xm.size
        each = f"{x.each}, or {total} with those of the disturbance model"
        x = replace(x, size=total if entries.values.size == total > 1 else x.size, each=each)
    return reader.vector(entries, x).astype(float)


def read_noise(reader: Reader, section: schema.Noise | None, outputs: Axis, horizon: fmpq) -> Noise | None:
    """Measurement noise."""
    if section is None:
        return None
    loc: Loc = ("simulation", "noise")
    period = reader.number(section.period, (*loc, "period"), "> 0")
    if horizon > MAX_PERIODS * period:
        reader.wrong((*loc, "period"), f"more than {MAX_PERIODS:,} periods in the horizon; give a longer period")
    place = (*loc, "amplitude")
    if isinstance(section.amplitude, str):
        amplitude = [reader.number(section.amplitude, place, ">= 0")] * (outputs.size or 0)
    else:
        reader.limit(len(section.amplitude), "amplitudes", place)
        amplitude = [reader.number(a, (*place, i), ">= 0") for i, a in enumerate(section.amplitude)]
        if not outputs.admits(len(amplitude)):
            expected = f"expected {counted(outputs.size, 'number')} ({outputs})"
            reader.wrong(place, f"{expected}, found {len(amplitude)}")
    return Noise(section.type, np.array([float(a) for a in amplitude]), float(period))
