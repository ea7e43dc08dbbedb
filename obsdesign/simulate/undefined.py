"""Which signal has no value where a run begins, and where in the spec it is written."""

from collections.abc import Iterator, Mapping

import numpy as np

from obsdesign.expressions import Expression
from obsdesign.sections.changes import opened
from obsdesign.simulate.clock import clock_of, following
from obsdesign.simulate.recorded import recordings
from obsdesign.spec import Spec
from obsdesign.trial import Simulation

Found = tuple[str, str]  # key of the spec, and what is wrong there


def undefined(spec: Spec, simulation: Simulation) -> Found:
    """Why a run cannot begin: the first signal that has no finite value at t = 0, or whose square has none.

    What is written is looked at first, then what follows from it: the v that generates w, and the rates of the plant.
    """
    with np.errstate(all="ignore"):
        found = next((one for look in (written, derived, rates) for one in look(spec, simulation)), None)
    said = "at t = 0 the observer, or the guarantee, has no finite value: begin elsewhere, with x0 and xhat0"
    return found or ("simulation", said)


def place(spec: Spec, section: str, part: str, k: int, name: str) -> str:
    """Key of one entry of a part of a section, which may be a list, a mapping, or one text."""
    entries = opened(spec.text, spec.path, spec.changes).root.plain().get(section, {}).get(part)
    if isinstance(entries, dict):
        return f"{section}.{part}.{name}" if name in entries else f"{section}.{part}"
    if entries is None and section == "system":
        return "nonlinearities"  # of a plant in matrices
    return f"{section}.{part}[{k}]" if isinstance(entries, list) else f"{section}.{part}"


def written(spec: Spec, simulation: Simulation) -> Iterator[Found]:
    """States and signals of the section `simulation`."""
    states = (*spec.plant.states, *spec.model_states)
    for part, begin, hat in (("x0", simulation.x0, ""), ("xhat0", simulation.xhat0, "hat_")):
        for k, (name, value) in enumerate(zip(states, begin, strict=False)):
            if why := flaw(f"{hat}{name}", float(value)):
                yield place(spec, "simulation", part, k, name), why
    known = at_start(spec, simulation)
    called = {"u": spec.inputs, "w": spec.plant.exogenous, "v": spec.drives}
    for part, names in called.items():
        for k, (name, signal) in enumerate(zip(names, getattr(simulation, part) or (), strict=False)):
            if why := flaw(f"{name} = {signal.text}", evaluated(signal, known)):
                yield place(spec, "simulation", part, k, name), why


def flaw(what: str, value: float) -> str:
    """What is wrong with a value at t = 0, if anything is."""
    if not np.isfinite(value):
        return f"{what} has no finite value at t = 0, where the run begins; give one that has"
    if not np.isfinite(np.square(value)):
        return f"{what} is {value:g} at t = 0, whose square is beyond what doubles can hold; give a smaller one"
    return ""


def derived(spec: Spec, simulation: Simulation) -> Iterator[Found]:
    """What the disturbance model needs of w: its derivatives, or its next samples."""
    driven = spec.generator.drive(simulation.w, lambda w: following(w, spec)) if simulation.w else None
    clock = clock_of(spec, simulation.horizon)
    known = clock.named(0.0) if clock else {"t": 0.0}
    for k, (name, v) in enumerate(zip(spec.plant.exogenous, driven[0] if driven else (), strict=False)):
        what = f"{v.text}, the v that generates {name},"
        if v.names <= known.keys() and (why := flaw(what, evaluated(v, known))):
            yield place(spec, "simulation", "w", k, name), why


def rates(spec: Spec, simulation: Simulation) -> Iterator[Found]:
    """Outputs and rates of the plant at its start."""
    plant = spec.equations(spec.plant)
    known = at_start(spec, simulation)
    known |= {name: evaluated(u, known) for name, u in zip(plant.inputs, simulation.u, strict=True)}
    known |= dict.fromkeys(plant.exogenous, 0.0)
    known |= {name: evaluated(w, known) for name, w in zip(plant.exogenous, simulation.w or (), strict=False)}
    sides = dict(plant.sides())
    for name in (*plant.algebraic, *plant.outputs, *plant.states):
        found = evaluated(sides[name], known) if sides[name].names <= known.keys() else 0.0
        if not np.isfinite(found) and name not in plant.algebraic:
            own = name in plant.states
            part, what = ("dynamics", f"the rate of {name}") if own else ("outputs", name)
            k = [*(plant.states if own else plant.outputs)].index(name)
            said = f"{what} has no finite value at t = 0, where x is x0; begin elsewhere"
            yield place(spec, "system", part, k, name), said
        known = {name: found, **known}


def at_start(spec: Spec, simulation: Simulation) -> dict[str, float]:
    """What signals may depend on, at t = 0."""
    in_files = {name: float(value) for name, value in recordings(spec, simulation).at(0.0).items()}
    return {"t": 0.0, **in_files, **dict(zip(spec.plant.states, map(float, simulation.x0), strict=False))}


def evaluated(signal: Expression, known: Mapping[str, float]) -> float:
    """Value of a signal."""
    return float(signal.scalar([*known])(*known.values()))
