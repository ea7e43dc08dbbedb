"""What is drawn of a run with its seed beside noise and intervals: where the plant starts, and its parameters.

Each has a generator of its own, so that what is drawn of one does not depend on whether the others are drawn.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.families.observer import Observer
from obsdesign.reading import varied, with_simulation
from obsdesign.records import dataclass, field, replace
from obsdesign.sections.changes import claimed, opened
from obsdesign.spec import Spec

if TYPE_CHECKING:
    from obsdesign.design import Design

START, PARAMETERS = 1, 2  # numbers of the generators of a seed
WORDS = frozenset(("name", "source", "description", "reproduces", "expect"))
BESIDE = WORDS | {"performance", "observer", "simulation", "data"}  # sections that leave the plant as it is


@dataclass(frozen=True)
class Drawn:
    """The plant and the start of one run, and what of them was drawn; where nothing was, they are those of the spec."""

    spec: Spec  # of the run
    x0: Mapping[str, float] = field(default_factory=dict)  # of states with a width, by name
    parameters: Mapping[str, float] = field(default_factory=dict)

    def written(self) -> dict[str, dict[str, float]]:
        """Entries of a summary, without what was not drawn."""
        parts = {"drawn_x0": dict(self.x0), "drawn_parameters": dict(self.parameters)}
        return {name: part for name, part in parts.items() if part}


def observer_of(design: "Design", spec: Spec) -> Observer:
    """Observer of a design as it begins in a run of a spec."""
    return replace(design, spec=replace(design.spec, simulation=spec.simulation)).observer


def uncertain(spec: Spec) -> bool:
    """Whether the plant of a run is another than that of the spec."""
    return spec.simulation is not None and any(one.share for one in spec.simulation.uncertainty.values())


def drawn(spec: Spec) -> Drawn:
    """Plant and start of the run with the seed of a spec.

    x0 is uniform within x0 less and plus `simulation.x0_width`, a parameter within its nominal value times 1 less and
    plus its share of `simulation.uncertainty`. Signals, noise and the observer keep the nominal parameters. Raises
    `UsageError`: with these parameters the plant is none.
    """
    simulation = spec.simulation
    if simulation is None:
        return Drawn(spec)
    start: dict[str, float] = {}
    if simulation.x0_width is not None and simulation.x0_width.any():
        width = simulation.x0_width
        x0 = simulation.x0.copy()
        x0[: len(width)] += width * np.random.default_rng((simulation.seed, START)).uniform(-1, 1, len(width))
        start = {name: float(x) for name, x, w in zip(spec.plant.states, x0, width, strict=False) if w}
        spec = replace(spec, simulation=replace(simulation, x0=x0))
    if not uncertain(spec):
        return Drawn(spec, start)
    generator = np.random.default_rng((simulation.seed, PARAMETERS))
    values = {
        name: float(one.nominal) * (1 + float(one.share) * float(generator.uniform(-1, 1)))
        for name, one in simulation.uncertainty.items()
    }
    values = {name: value for name, value in values.items() if simulation.uncertainty[name].share}
    try:
        other = varied(spec, values)
    except UsageError as error:
        told = ", ".join(f"{name} = {value:.6g}" for name, value in values.items())
        said = f"with seed {simulation.seed} it draws {told}, with which the spec has no plant"
        raise UsageError(
            Problem(f"{said}: {error.problems[0].message}", key="simulation.uncertainty", id="OBS931")
        ) from None
    return Drawn(replace(on_plant(spec, other), simulation=spec.simulation), start, values)


def tried(design: "Design", changes: Mapping[str, Any]) -> Spec:
    """Spec of what is run: that of a design, or with the plant elsewhere, with other values of keys of `simulation`."""
    spec = design.spec
    if (there := design.elsewhere) is not None:
        name = spec.name if there.name == spec.name else f"{spec.name}, on {there.name}"
        step = spec.implementation or there.implementation
        made = replace(on_plant(spec, there), name=name, implementation=step)
        spec = replace(made, text=there.text, path=there.path, changes=there.changes)
    return with_simulation(spec, changes) if changes else spec


def foreign(design: "Design", parameters: Mapping[str, float]) -> str:
    """Why nothing is proved of a run of a design whose plant has drawn parameters; empty where something may be."""
    said = []
    if design.elsewhere is not None:
        changed = f" with {', '.join(told)}" if (told := claimed(design.elsewhere.changes)) else ""
        there = f"{design.elsewhere.path}{changed}"
        said.append(
            f"the plant is that of {there}, and what is proved of the gains in {design.path} is of their own plant"
        )
    if parameters:
        said.append("the plant has the parameters that were drawn, and a proof is of the nominal ones")
    return f"no guarantee: {'; '.join(said)}" if said else ""


def on_plant(spec: Spec, other: Spec) -> Spec:
    """Spec with the plant of another one, and with what acts on it."""
    made = replace(spec, plant=other.plant, generator=other.generator, gx=other.gx, gq=other.gq, gy=other.gy)
    made = replace(made, typed=other.typed, nonlinearities=other.nonlinearities, noise=other.noise, units=other.units)
    return replace(made, simulation=other.simulation or spec.simulation)


def same_plant(spec: Spec, other: Spec) -> bool:
    """Whether two specs differ, as they are written, in nothing but the observer, z, how it is tried and words."""
    one, two = (opened(each.text, each.path, each.changes).root.plain() for each in (spec, other))
    return all(one.get(key) == two.get(key) for key in (one.keys() | two.keys()) - BESIDE)


def require_fitting(spec: Spec, other: Spec, gains: str) -> None:
    """Refuse a plant on which the observer of a spec, whose gains are in a file, cannot run.

    Raises `UsageError` with all that does not fit: names of signals, in their order, time, the form of the plant.
    """
    pairs = {
        "system.states": (spec.plant.states, other.plant.states),
        "system.inputs": (spec.inputs, other.inputs),
        "system.outputs": (spec.plant.outputs, other.plant.outputs),
        "system.disturbances": (spec.plant.exogenous, other.plant.exogenous),
    }
    if spec.plant.exogenous == other.plant.exogenous:
        pairs["disturbance"] = spec.model_states, other.model_states
    found = [
        Problem(f"{amount(there)} here, and {amount(own)} in {gains}: the gains do not fit", key=key, id="OBS932")
        for key, (own, there) in pairs.items()
        if own != there
    ]
    if spec.period != other.period:
        own, there = ("continuous" if one.period is None else f"{float(one.period):g} s" for one in (spec, other))
        said = f"time is {there} here, and {own} in {gains}: the gains do not fit"
        found.append(Problem(said, key="system.time", id="OBS932"))
    if (spec.typed is None) != (other.typed is None):
        said = f"takes the plant in another form than {spec.observer.type}, whose gains they are; give that type here"
        found.append(Problem(said, key="observer.type", id="OBS932"))
    if found:
        raise UsageError(*map(other.located, found))


def amount(names: tuple[str, ...]) -> str:
    """Some names with their number."""
    return f"{len(names)} ({', '.join(names)})" if names else "none"
