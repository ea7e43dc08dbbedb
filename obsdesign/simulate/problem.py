"""Whether specs pose one problem, so that their observers can be compared: one plant, and what acts on it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from hashlib import sha256
from typing import Any

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression, ExpressionError
from obsdesign.expressions.algebra import identical
from obsdesign.families import FAMILIES
from obsdesign.families.noise import channels
from obsdesign.simulate.recorded import Track, recordings, with_paths
from obsdesign.spec import Spec
from obsdesign.trial import Simulation

ZERO = Expression.number(0)
LONGEST = 60  # characters of a value in a message
Entry = tuple[str, str, Any]  # a key of a spec, what is meant there, its value; None: nothing is asked of it


def one_problem(specs: Sequence[Spec]) -> list[Spec]:
    """Return the specs; one that has no `simulation` with that of the first that has.

    Raises `UsageError`: none has one, or two differ in the plant or in what acts on it.
    """
    tried = [spec for spec in specs if spec.simulation]
    if not tried:
        said = "is missing in every spec; a comparison needs a horizon, x0, and what acts on the plant"
        raise UsageError(specs[0].located(Problem(said, key="simulation", id="OBS801")))
    first = next((spec for spec in tried if not FAMILIES[spec.observer.type].sampled), tried[0])
    made = [spec if spec.simulation else adopted(spec, first) for spec in specs]
    asked = list(entries(first))
    for spec in made:
        for (_, _, one), (key, what, other) in zip(asked, entries(spec), strict=False):
            if None not in (one, other) and not same(one, other):
                said = f"{what} is {shown(other)}, but {shown(one)} in {first.path}; a comparison needs one plant"
                raise UsageError(spec.located(Problem(said, key=key, id="OBS805")))
    return made


def adopted(spec: Spec, first: Spec) -> Spec:
    """Spec with the simulation of another one, where its signals have the same names; its estimates start at zero."""
    first = with_paths(first)
    simulation = first.simulation
    assert simulation
    w = by_name(first, simulation)
    found = replace(
        simulation,
        x0=np.array([value for _, value in sorted(starts(first), key=lambda pair: spec.plant.states.index(pair[0]))]),
        xhat0=np.zeros(spec.augmented.n),
        w=tuple(w.get(name, ZERO) for name in spec.plant.exogenous),
        v=None,
    )
    return replace(spec, simulation=found)


def entries(spec: Spec) -> Iterator[Entry]:
    """What must be the same: names of signals, start, horizon, inputs, noise, right sides as they are driven."""
    simulation = spec.simulation
    assert simulation
    plant = spec.equations(spec.plant)
    for what, names in (("states", plant.states), ("inputs", plant.inputs), ("outputs", plant.outputs)):
        yield f"system.{what}", f"the list of {what}", ", ".join(sorted(names)) or "empty"
    samples = "continuous" if spec.period is None else f"discrete, with samples {float(spec.period):g} s apart"
    yield "system.time", "time", samples
    yield "simulation.horizon", "the horizon", simulation.horizon
    for name, value in sorted(starts(spec)):
        yield "simulation.x0", f"{name}(0)", value
    for name, side in sorted(zip(spec.inputs, simulation.u, strict=True)):
        yield "simulation.u", name, side
    yield "simulation", "what is in files", contents(spec, simulation)
    yield from noises(spec, simulation)
    v = [side for k, side in enumerate(simulation.v or ()) if k not in channels(spec)[1]]
    yield "simulation.v", "v", ", ".join(side.text for side in v) or "not given"
    yield "disturbance", "the disturbance model", model(spec) if simulation.v else None
    sides, driven = dict(plant.sides()), by_name(spec, simulation)
    inner = {name: sides[name] for name in (*plant.algebraic, *plant.outputs)}
    for _ in inner:
        sides = {name: side.substituted({k: e for k, e in inner.items() if k != name}) for name, side in sides.items()}
    for name in (*sorted(plant.states), *sorted(plant.outputs)):
        yield "system", f"{name}'" if name in plant.states else name, sides[name].substituted(driven)


def starts(spec: Spec) -> list[tuple[str, float]]:
    """Initial state of the plant."""
    assert spec.simulation
    return list(zip(spec.plant.states, map(float, spec.simulation.x0), strict=False))


def by_name(spec: Spec, simulation: Simulation) -> Mapping[str, Expression]:
    """Disturbances by the names that they have in the equations; where v generates them only noise, which is apart."""
    exogenous = spec.equations(spec.plant).exogenous
    still = {exogenous[k]: ZERO for k in channels(spec)[0]}
    return still | dict(zip(exogenous, simulation.w or (), strict=False))


def model(spec: Spec) -> str:
    """Disturbance model of the channels of w that no noise is, all of its matrices."""
    m, (w, v) = spec.generator, channels(spec)
    of_v = np.delete(m.Bm, v, axis=1), np.delete(m.Dq2, v, axis=1), np.delete(np.delete(m.Dm, v, axis=1), w, axis=0)
    of_w = (np.delete(M, w, axis=0) for M in (m.Cm, m.Dwf))
    inverse = [own for i, own in enumerate(m.inverse) if i not in w]
    return str((m.Am, m.Bmf, m.Cq2, m.Dq2f, *of_w, *of_v, inverse))


def contents(spec: Spec, simulation: Simulation) -> str:
    """Signals in files, each with the hash of its samples within the horizon; empty without any."""
    tracks = recordings(spec, simulation).tracks
    pairs = ((simulation.recorded[track.variable], track) for track in tracks)
    return "; ".join(
        sorted(f"{one.name} from {one.file}, hold {one.hold}, sha256 {digest(track)}" for one, track in pairs)
    )


def digest(track: Track) -> str:
    """Beginning of the SHA-256 of the rows of a signal."""
    return sha256(np.concatenate((track.t, track.values)).tobytes()).hexdigest()[:8]


def noises(spec: Spec, simulation: Simulation) -> Iterator[Entry]:
    """What acts on the outputs, and how long it is held; it is not, where they are known at instants only."""
    noise, ny = simulation.noise, len(spec.plant.outputs)
    sizes = noise.amplitude if noise else np.zeros(ny)
    for name, size in sorted(zip(spec.plant.outputs, sizes, strict=True)):
        yield "simulation.noise", f"noise of {name}", f"{noise.type} {size:g}" if noise and size else "none"
    held = noise is not None and not FAMILIES[spec.observer.type].sampled
    yield "simulation.noise.period", "the period of the noise", noise.period if noise and held else None


def same(a: Any, b: Any) -> bool:
    """Whether two values are equal, expressions identically."""
    if isinstance(a, Expression) and isinstance(b, Expression) and a != b:
        try:
            return identical(a, b)
        except ExpressionError:
            return False
    return bool(a == b)


def shown(value: Any) -> str:
    """Value in a message."""
    text = f"{value:g}" if isinstance(value, float) else str(value) or "missing"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 2]}.."
