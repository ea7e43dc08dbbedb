"""The simulation section of a spec: how to try the observer."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.expressions.functions import is_condition
from obsdesign.families import FAMILIES, Family
from obsdesign.reading import trial_schema as schema
from obsdesign.reading.generator import Exogenous
from obsdesign.reading.plant import Layout
from obsdesign.reading.signals import Acting
from obsdesign.reading.uncertainty import read_uncertainty, read_widths
from obsdesign.sections.document import Loc
from obsdesign.sections.scalars import described
from obsdesign.sections.values import Axis, Entries, Reader, counted
from obsdesign.sections.words import unknown
from obsdesign.trial import Noise, Simulation, Vector

MAX_PERIODS = 10**7  # of noise in a simulation, each with a sample of every output
MAX_POINTS = 10**6
MAX_SAMPLES = 10**6  # of a plant in discrete time, in a run
SAMPLING = ("sampling", "period", "dropout", "theta0")  # keys for measurements at instants


def read_simulation(
    reader: Reader,
    section: schema.Simulation | None,
    layout: Layout,
    exogenous: Exogenous,
    family: Family | None,
    period: fmpq | None = None,
    in_plant: Collection[str] = (),
) -> Simulation | None:
    """Return the trial; None if there is none.

    `family`: says whether measurements arrive at instants, and whether the observer has coordinates of its own;
    `period`: of the samples, in discrete time; `in_plant`: names of the parameters that stand in the plant.
    """
    if section is None:
        return None
    loc: Loc = ("simulation",)
    known_family = family is not None and reader.clean(("observer",))  # a wrong observer may be one of any family
    sampled = not known_family or (family is not None and family.sampled)
    horizon = read_horizon(reader, section.horizon, period)
    xm = exogenous.xm
    names = (layout.names.states if layout.names else ()), exogenous.states
    xhat0 = read_state(reader, section.xhat0, (*loc, "xhat0"), layout.states, xm, names)
    size = (layout.states.size or 0) + (xm.size or 0)
    acting = Acting(reader, layout, exogenous)
    w = acting.w(section.w)
    if not sampled:
        refuse_sampling(reader, section)
    if known_family and family not in in_coordinates().values():
        refuse_coordinates(reader, section)
    x0 = read_state(reader, section.x0, (*loc, "x0"), layout.states, xm, names)
    if section.w is not None:
        refuse_model(reader, section, x0[layout.states.size :] if layout.states.size else None)
    constants = section.theta0 if isinstance(section.theta0, dict) else {}
    theta0 = None if isinstance(section.theta0, dict) else section.theta0
    correction = reader.entries(theta0, (*loc, "theta0"))
    return Simulation(
        horizon=float(horizon),
        x0=x0,
        xhat0=np.concatenate([xhat0, np.zeros(max(size - len(xhat0), 0))]),
        w=w,
        v=acting.v(section.v) if w is None else None,
        u=acting.u(section.u),
        noise=read_noise(reader, section.noise, layout.outputs, horizon, period, sampled=sampled),
        seed=reader.integer(section.seed, (*loc, "seed"), 0, 0, 2**63 - 1),
        points=reader.integer(section.points, (*loc, "points"), 2000, 2, MAX_POINTS),
        sampling=read_sampling(reader, section.sampling),
        period=None if section.period is None else float(reader.number(section.period, (*loc, "period"), "> 0")),
        dropout=read_dropout(reader, section.dropout),
        theta0=None if theta0 is None else reader.vector(correction, layout.outputs).astype(float),
        xi0=read_values(reader, section.xi0 or {}, (*loc, "xi0")),
        constants=read_values(reader, constants, (*loc, "theta0")),
        events=read_events(reader, section.events, layout),
        stepped=section.observer == "implementation",
        silent=acting.silent(section.u),
        recorded=acting.recorded,
        x0_width=read_widths(reader, section.x0_width, layout.states, names[0]),
        uncertainty=read_uncertainty(reader, section.uncertainty or {}, in_plant),
    )


def read_horizon(reader: Reader, written: str, period: fmpq | None) -> fmpq:
    """Length of the run in s; in discrete time with a sample after the first one, and not with too many."""
    loc: Loc = ("simulation", "horizon")
    horizon = reader.number(written, loc, "> 0")
    if period is None or not reader.clean(loc):
        return horizon
    if horizon < period:
        said = f"{float(horizon):g} s ends before the next sample; give at least system.period, {float(period):g} s"
        reader.wrong(loc, said, id="OBS208")
    elif horizon > MAX_SAMPLES * period:
        reader.wrong(loc, f"more than {MAX_SAMPLES:,} samples in the horizon; give a shorter one", id="OBS210")
    return horizon


def read_values(reader: Reader, written: Mapping[str, str], loc: Loc) -> dict[str, fmpq]:
    """Numbers by name."""
    return {name: reader.number(text, (*loc, name)) for name, text in written.items()}


def read_events(reader: Reader, written: Mapping[str, str], layout: Layout) -> dict[str, Expression]:
    """Conditions that end a run: comparisons of the signals of the plant, and their products, smallest and largest."""
    known = layout.known("states", "outputs", "inputs")
    events: dict[str, Expression] = {}
    for name, text in written.items() if known is not None else ():
        place: Loc = ("simulation", "events", name)
        events[name] = reader.expression(text, place, known or ())
        if reader.clean(place) and not is_condition(events[name].root):
            reader.wrong(
                place, f"{described(text)} is no condition; write a comparison, such as abs(x1) > 1e3", id="OBS301"
            )
    return events


def refuse_sampling(reader: Reader, section: schema.Simulation) -> None:
    """Refuse the keys of families whose measurements arrive at instants."""
    for key in SAMPLING:
        if getattr(section, key) is not None and not isinstance(getattr(section, key), dict):
            owners = " or ".join(name for name, family in FAMILIES.items() if family.sampled)
            reader.wrong(("simulation", key), f"belongs to observer.type {owners}", at_key=True, id="OBS213")


def refuse_model(reader: Reader, section: schema.Simulation, start: Vector | None) -> None:
    """Refuse what drives the disturbance model, or where it begins but at zero: it does not run where w is given."""
    loc: Loc = ("simulation",)
    if section.v is not None:
        said = "w is given already; give w or v, the signal that drives the disturbance model"
        reader.wrong((*loc, "v"), said, id="OBS206")
    if start is not None and start.any() and reader.clean((*loc, "x0")):
        said = f"the disturbance model begins at {start.tolist()}, and does not run where w is given; give one of both"
        reader.wrong((*loc, "x0"), said, id="OBS206")


def in_coordinates() -> dict[str, Family]:
    """Families whose observers have states of their own, by name."""
    return {name: family for name, family in FAMILIES.items() if family.equations and not family.matrices}


def refuse_coordinates(reader: Reader, section: schema.Simulation) -> None:
    """Refuse the keys of families whose observers have states of their own."""
    for key in ("xi0", "theta0"):
        if isinstance(getattr(section, key), dict):
            what = "" if key == "xi0" else "by coordinate "
            said = f"{what}belongs to observer.type {' or '.join(in_coordinates())}; leave it out"
            reader.wrong(("simulation", key), said, at_key=True, id="OBS213")


def read_sampling(reader: Reader, written: str | schema.Law | None) -> str | Expression:
    """When measurements arrive: periodic, random, or a law."""
    if isinstance(written, schema.Law):
        place: Loc = ("simulation", "sampling", "law")
        laws = reader.expressions(written.law, place, Axis(1, "law"), ("t",))
        if laws and not laws[0].names and reader.clean(place) and laws[0].scalar(["t"])(0.0) <= 0:
            said = f"{described(written.law)} is not allowed; give the time to the next measurement, in s: a number > 0"
            reader.wrong(place, said, id="OBS208")
        return laws[0] if laws else "periodic"
    return written or "periodic"


def read_dropout(reader: Reader, written: str | None) -> float:
    """Share of the measurements that are lost."""
    loc: Loc = ("simulation", "dropout")
    share = reader.number(written or "0", loc, ">= 0")
    if share >= 1 and reader.clean(loc):
        reader.wrong(loc, f"{float(share):g} is no share below 1; give a number in [0, 1)", id="OBS208")
    return float(share)


def read_state(
    reader: Reader,
    written: schema.Numbers | None,
    loc: Loc,
    x: Axis,
    xm: Axis,
    names: tuple[Sequence[str], Sequence[str]],
) -> Vector:
    """State at the beginning, of the plant or of the augmented plant: as a list, or by the names of x and xm."""
    entries = reader.entries(None if isinstance(written, dict) else written, loc)
    if isinstance(written, dict):
        entries = named_state(reader, written, loc, names)
    if x.size is not None and xm.size:
        total = x.size + xm.size
        each = f"{x.each}, or {total} with those of the disturbance model"
        x = replace(x, size=total if entries.values.size == total > 1 else x.size, each=each)
    return reader.vector(entries, x).astype(float)


def named_state(
    reader: Reader, written: Mapping[str, str], loc: Loc, names: tuple[Sequence[str], Sequence[str]]
) -> Entries:
    """State given by names; of the augmented plant where one of xm is named."""
    x, xm = names
    allowed = (*x, *xm)
    for name in written:
        if x and name not in allowed:
            reader.wrong((*loc, name), unknown("state", name, allowed, {}), at_key=True, id="OBS203")
    order = allowed if any(name in written for name in xm if name not in x) else x
    return Entries(loc, np.array([reader.number(written.get(name, "0"), (*loc, name)) for name in order], dtype=object))


def read_noise(
    reader: Reader, section: schema.Noise | None, outputs: Axis, horizon: fmpq, samples: fmpq | None, *, sampled: bool
) -> Noise | None:
    """Measurement noise; where measurements arrive at instants, or time is discrete, it needs no period."""
    if section is None:
        return None
    loc: Loc = ("simulation", "noise")
    if section.period is None and samples is None and not sampled:
        reader.wrong((*loc, "period"), "is required", id="OBS205")
    otherwise = horizon if samples is None else samples
    period = otherwise if section.period is None else reader.number(section.period, (*loc, "period"), "> 0")
    if samples is not None and period != samples and reader.clean((*loc, "period")):
        said = f"{float(period):g} s is not that of the samples, {float(samples):g} s"
        reader.wrong((*loc, "period"), f"{said}: noise is drawn at each; leave it out", id="OBS208")
    if horizon > MAX_PERIODS * period:
        reader.wrong(
            (*loc, "period"), f"more than {MAX_PERIODS:,} periods in the horizon; give a longer period", id="OBS210"
        )
    place = (*loc, "amplitude")
    if isinstance(section.amplitude, str):
        amplitude = [reader.number(section.amplitude, place, ">= 0")] * (outputs.size or 0)
    else:
        reader.limit(len(section.amplitude), "amplitudes", place)
        amplitude = [reader.number(a, (*place, i), ">= 0") for i, a in enumerate(section.amplitude)]
        if not outputs.admits(len(amplitude)):
            expected = f"expected {counted(outputs.size, 'number')} ({outputs})"
            reader.wrong(place, f"{expected}, found {len(amplitude)}", id="OBS209")
    return Noise(
        "uniform" if section.type == "uniform" else "gaussian", np.array([float(a) for a in amplitude]), float(period)
    )
