"""Several observers on one plant, with the same input, and noise of the same size."""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.records import dataclass, replace
from obsdesign.simulate.definitions import rate
from obsdesign.simulate.ensemble import Spread, spread
from obsdesign.simulate.problem import one_problem
from obsdesign.simulate.record import Record
from obsdesign.simulate.run import Run
from obsdesign.simulate.running import recorded, run_of

if TYPE_CHECKING:
    from obsdesign.design import Design

WINDOW = 1 / 6  # of the horizon, after which noise and floor are looked at
FALL = 2.0  # ratio of the rms in the first quarter of the window to that in the last, above which an error falls
SEEN = 1e-6  # of the largest error: less is not looked at
LOOKS = 60  # instants of a run at which it is asked how fast an observer is


@dataclass(frozen=True)
class Entrant:
    """One observer: its run without noise, and what noise adds."""

    label: str
    design: "Design"
    record: Record
    window: tuple[float, float]
    spread: Spread | None  # None without noise

    @cached_property
    def run(self) -> Run:
        """The run without noise."""
        return run_of(self.record)

    @property
    def said(self) -> dict[str, str | None]:
        """What is proved of it, in words and in one line; None where nothing is."""
        claim, spec = self.design.claim, self.design.spec
        if not (self.design.proved and claim):
            return {"statement": None, "claim": None}
        return {"statement": claim.statement(spec), "claim": "; ".join([claim.headline(spec), *spec.provisos])}

    @property
    def errors(self) -> Mapping[str, tuple[Array, Array]]:
        """Times and errors of each estimate, with the noise of the first run if there is any."""
        if self.spread is not None and self.spread.t.size:
            return {name: (self.spread.t, e) for name, e in zip(self.spread.names, self.spread.errors.T, strict=True)}
        return self.quiet

    @property
    def quiet(self) -> Mapping[str, tuple[Array, Array]]:
        """Times and errors of each estimate without noise."""
        record = self.record
        errors = np.hstack([record.e[:, : record.acting.n], record.signals.w_error])
        return {name: (record.t, e) for name, e in zip(self.run.summary["settling"], errors.T, strict=True)}

    @cached_property
    def fastest(self) -> float:
        """Largest eigenvalue, 1/s, of the observer's own dynamics along its run without noise; NaN of samples."""
        system, record = self.record.system, self.record
        if record.acting.clock is not None:
            return np.nan
        moving = system.flowing[len(system.integrated) :]
        rates = system.program.places(map(rate, moving))
        found = [0.0]
        for k in np.unique(np.linspace(0, len(record.t) - 1, LOOKS).astype(int)):
            t = float(record.t[k])
            X = system.program.run(t, record.s[k, : system.width], system.quiet(t))
            J = system.program.derivatives(X, moving)[rates]
            found.append(float(np.abs(np.linalg.eigvals(J)).max(initial=0.0)) if np.isfinite(J).all() else np.inf)
        return max(found)

    def written(self) -> dict[str, Any]:
        """Entry of a report."""
        spec, observer = self.design.spec, self.record.system.observer
        fastest = self.fastest
        return {
            "name": spec.name,
            "label": self.label,
            "file": self.design.path,
            "type": spec.observer.type,
            "status": str(self.design.status),
            **self.said,
            "order": len(observer.states),
            "fastest": fastest if np.isfinite(fastest) else None,
            "run": self.run.status,
            "validity": self.run.summary.get("validity"),
            "states": {name: {**times, **self.noise(name), "floor": self.floor(name)} for name, times in self.times},
            "transient": [name for name, _ in self.times if self.falls(name)],
        }

    @property
    def held(self) -> str | None:
        """How long a value of the noise lasts; None without noise."""
        simulation = self.design.spec.simulation
        if self.spread is None or simulation is None or simulation.noise is None:
            return None
        if self.record.acting.clock is not None:
            return "drawn at each sample"
        return "drawn at each measurement" if self.record.schedule else f"held for {simulation.noise.period:g} s"

    @property
    def times(self) -> list[tuple[str, Mapping[str, float | None]]]:
        """Settling times of each estimate."""
        return list(self.run.summary["settling"].items())

    def noise(self, name: str) -> dict[str, float | None]:
        """Mean and standard deviation over the runs of the rms of what noise adds to an estimate."""
        if self.spread is None:
            return {"noise_rms": 0.0, "noise_rms_std": 0.0}
        rms = self.spread.rms[:, self.spread.names.index(name)]
        if not np.isfinite(rms).all():
            return {"noise_rms": None, "noise_rms_std": None}
        return {"noise_rms": float(rms.mean()), "noise_rms_std": float(rms.std(ddof=1)) if len(rms) > 1 else 0.0}

    def floor(self, name: str) -> float | None:
        """Rms of the error without noise over the window; None where the run ended before it did."""
        if self.quiet[name][0][-1] < self.window[1] * (1 - 1e-9):
            return None
        return self.rms(name, *self.window)

    def falls(self, name: str) -> bool:
        """Whether the error without noise still falls over the window, so that its rms there is no floor."""
        first, last = self.window
        quarter = (last - first) / 4
        early, late = self.rms(name, first, first + quarter), self.rms(name, last - quarter, last)
        seen = SEEN * float(np.abs(self.quiet[name][1]).max())
        return early is not None and late is not None and early > max(FALL * late, seen)

    def rms(self, name: str, first: float, last: float) -> float | None:
        """Rms of the error without noise between two times; None where the run has no two steps there."""
        t, e = self.quiet[name]
        inside = (t >= first) & (t <= last)
        if inside.sum() < 2:
            return None
        t, e = t[inside], e[inside]
        if self.record.acting.clock is not None:
            return float(np.sqrt(np.mean(e**2)))
        return float(np.sqrt(np.trapezoid(e**2, t) / (t[-1] - t[0])))


@dataclass(frozen=True)
class Comparison:
    """Observers side by side."""

    entrants: tuple[Entrant, ...]
    seeds: tuple[int, ...]

    @cached_property
    def report(self) -> Mapping[str, Any]:
        """Everything that is said of them, as `--json`."""
        first = self.entrants[0]
        spec = first.design.spec
        assert spec.simulation
        return {
            "plant": {
                "name": spec.name,
                "x0": [float(x) for x in spec.simulation.x0[: spec.plant.n]],
                "horizon": spec.simulation.horizon,
            },
            "seeds": list(self.seeds),
            "window": list(first.window),
            "observers": [one.written() for one in self.entrants],
            "notes": self.notes,
        }

    @property
    def notes(self) -> list[str]:
        """What is to be known of the comparison: whether the noise lasts as long for all."""
        held = {one.label: one.held for one in self.entrants}
        if len({*held.values()}) < 2:
            return []
        told = ", ".join(f"{how} for {label}" for label, how in held.items())
        return [f"the noise has one size and not one density: {told}; noise rms are not of the same noise"]

    @property
    def title(self) -> str:
        """What the names of all have in common, or the first."""
        names = [one.design.spec.name for one in self.entrants]
        return shared(names) or names[0]

    def plot(self, path: str | None = None) -> bytes:
        """Draw states and errors, and write them where a path is given: as SVG if this ends so, else as PNG.

        Raises `UsageError` if the file cannot be written.
        """
        from obsdesign.disk import write_whole
        from obsdesign.plot import form_of
        from obsdesign.plot.comparison import comparison_figure

        figure = comparison_figure(self, form=form_of(path))
        if path is not None:
            write_whole(path, figure)
        return figure

    def __str__(self) -> str:
        from obsdesign.tables.comparison import comparison_table

        return comparison_table(self.report)


def compare(
    designs: "Sequence[Design]", seeds: int, progress: Callable[[float, str], None] = lambda *_: None
) -> Comparison:
    """Run observers on one plant: each without noise, and together with the noise of so many seeds.

    The first seed is that of the first spec. `progress` is called with the fraction done, and with what is being done.
    Raises `UsageError`: the specs do not pose one problem, or have no `simulation`.
    """
    specs = one_problem([design.spec for design in designs])
    simulation = specs[0].simulation
    assert simulation
    window = (WINDOW * simulation.horizon, simulation.horizon)
    numbers = tuple(range(simulation.seed, simulation.seed + seeds))
    labels = told_apart(designs)
    found = []
    for k, (label, design, spec) in enumerate(zip(labels, designs, specs, strict=True)):
        progress(k / len(designs), label)
        with spec.placed():
            found.append(entrant(label, replace(design, spec=spec), window, numbers))
    return Comparison(tuple(found), numbers)


def entrant(label: str, design: "Design", window: tuple[float, float], seeds: tuple[int, ...]) -> Entrant:
    """One observer on its plant."""
    spec, observer = design.spec, design.observer
    assert spec.simulation
    quiet = replace(spec, simulation=replace(spec.simulation, noise=None))
    record = recorded(quiet, observer, design.guarantee)
    noisy = spec.simulation.noise is not None and spec.simulation.noise.amplitude.any()
    return Entrant(label, design, record, window, spread(spec, observer, seeds, window) if noisy else None)


def told_apart(designs: "Sequence[Design]") -> list[str]:
    """A short name for each: that of its spec, its type, its file, whatever is the first that tells all apart.

    What all names begin with is left out, up to a comma.
    """
    begin = len(shared([design.spec.name for design in designs]))
    choices = (
        [design.spec.name[begin:].removeprefix(", ") for design in designs],
        [design.spec.observer.type for design in designs],
        [design.path for design in designs],
    )
    numbered = [f"{k}: {design.path}" for k, design in enumerate(designs, start=1)]
    return next((names for names in choices if len(set(names)) == len(names)), numbered)


def shared(names: Sequence[str]) -> str:
    """What several names begin with, up to a comma, after which each goes on."""
    first, *others = (name.split(", ") for name in names)
    count = min([len(first), *map(len, others)]) - 1 if others else 0
    same = next((k for k in range(count) if any(other[k] != first[k] for other in others)), count)
    return ", ".join(first[:same])
