"""Many runs of one observer, each with a seed of its own: with other noise, starts, parameters and intervals."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.families.guarantee import Guarantee
from obsdesign.families.observer import Observer
from obsdesign.lmi.formula import Float
from obsdesign.records import dataclass, replace
from obsdesign.simulate.drawing import drawn, foreign, observer_of, tried, uncertain
from obsdesign.simulate.member import Member, estimates, instants, member_of, packed, unpacked
from obsdesign.simulate.processes import shared_out
from obsdesign.simulate.record import UNPROVED, Record
from obsdesign.simulate.running import recorded
from obsdesign.simulate.scenario import noise_samples
from obsdesign.simulate.simulation import initial, system_of
from obsdesign.simulate.tally import report_of, worst_seeds
from obsdesign.simulate.together import applies, together
from obsdesign.spec import Spec

if TYPE_CHECKING:
    from obsdesign.design import Design

MOST = 10_000  # runs
TOGETHER, ALONE = 125, 4  # runs in a part of the work: in common steps, or each by itself
FEW = 12  # runs that are as quick by themselves
LARGEST_SEED = 2**63 - 1
QUANTILES = (0.5, 0.05, 0.95)


@dataclass(frozen=True, repr=False)
class MonteCarlo:
    """Runs of one observer, in the order of their seeds."""

    spec: Spec  # of the run with the first seed
    names: tuple[str, ...]  # of the estimates
    t: Float  # (G,), s: instants of the envelope
    members: tuple[Member, ...]
    why: str  # why nothing is proved of the runs; empty: something may be
    same: bool = False  # whether nothing is drawn, so that all runs are one
    intervals: bool = False  # whether those between measurements are drawn

    @property
    def kept(self) -> list[Member]:
        """Runs that did not escape."""
        return [one for one in self.members if not one.lost]

    @cached_property
    def report(self) -> Mapping[str, Any]:
        """Everything that is said of them, as `--json`."""
        return report_of(self)

    @cached_property
    def sizes(self) -> Float:
        """|error| of every run that did not escape, (runs, instants, estimates); NaN after its end."""
        none = np.zeros((0, len(self.t), len(self.names)))
        return np.array([one.sizes for one in self.kept]) if self.kept else none

    @cached_property
    def going(self) -> Float:
        """Number of runs at each instant, (G,), of those that did not escape."""
        return np.asarray(np.isfinite(self.sizes).all(axis=2).sum(axis=0), dtype=float)

    def envelope(self, k: int) -> Float:
        """|error| of estimate k over the runs, (G, 4): median, 5 % and 95 %, and that of the run of largest rms."""
        found = np.full((len(self.t), 4), np.nan)
        seen = self.going > 0
        if seen.any():
            found[seen, :3] = np.nanquantile(self.sizes[:, seen, k], QUANTILES, axis=0).T
            found[:, 3] = self.kept[int(np.argmax([one.rms[k] for one in self.kept]))].sizes[:, k]
        return found

    def table(self) -> tuple[list[str], Float]:
        """Header and rows of the envelope: t, and of each estimate median, 5 %, 95 % and worst run; number of runs."""
        header, columns = ["t"], [self.t[:, None]]
        for k, name in enumerate(self.names):
            header += [f"median_{name}", f"p5_{name}", f"p95_{name}", f"worst_{name}"]
            columns.append(self.envelope(k))
        return [*header, "runs"], np.hstack([*columns, self.going[:, None]])[self.going > 0]

    def plot(self, path: str | None = None) -> bytes:
        """Draw the envelope, and write it where a path is given: as SVG if this ends so, else as PNG.

        Raises `UsageError` if the file cannot be written.
        """
        from obsdesign.disk import write_whole
        from obsdesign.plot import form_of
        from obsdesign.plot.envelope import envelope_figure

        figure = envelope_figure(self, form=form_of(path))
        if path is not None:
            write_whole(path, figure)
        return figure

    def __repr__(self) -> str:
        return f"<{len(self.members)} runs of {self.spec.name!r}>"

    def __str__(self) -> str:
        from obsdesign.tables.montecarlo import montecarlo_table

        return montecarlo_table(self.report)


@dataclass(frozen=True)
class Subject:
    """What is run with each seed."""

    design: "Design"
    spec: Spec
    observer: Observer
    guarantee: Guarantee | None
    grid: Float

    def seeded(self, seed: int) -> Spec:
        """Spec of the run of a seed, with nothing drawn as yet."""
        assert self.spec.simulation
        return replace(self.spec, simulation=replace(self.spec.simulation, seed=seed))

    def alone(self, seed: int) -> tuple[Member, tuple[str, ...]]:
        """Run of a seed as `simulate` has it, and the names of its estimates.

        Raises `UsageError`: the plant that is drawn is none, or it cannot begin.
        """
        trial = drawn(self.seeded(seed))
        try:
            record = recorded(trial.spec, self.observer, self.guarantee, foreign=foreign(self.design, trial.parameters))
        except UsageError as error:
            told = (replace(one, message=f"{one.message} (with seed {seed})") for one in error.problems)
            raise UsageError(*told) from None
        return member_of(record, seed, self.grid), estimates(record)

    @cached_property
    def common(self) -> bool:
        """Whether the runs have one plant, and go in common steps."""
        simulation = self.spec.simulation
        assert simulation
        if uncertain(self.spec) or simulation.stepped or self.spec.period is not None or self.observer.jump:
            return False
        return applies(system_of(self.spec, simulation, self.observer, self.guarantee))

    @property
    def part(self) -> int:
        """Number of runs in a part of the work: it does not depend on how many there are."""
        return TOGETHER if self.common else ALONE

    def part_of(self, seeds: Sequence[int]) -> list[Member]:
        """Some runs: together where they go so, a run that seems to break a bound by itself."""
        found = dict(self.together(seeds)) if self.common and len(seeds) >= FEW else {}
        return [found[seed] if seed in found else self.alone(seed)[0] for seed in seeds]

    def together(self, seeds: Sequence[int]) -> "Sequence[tuple[int, Member]]":
        """Runs in common steps, by their seeds; without those that have to go by themselves."""
        specs = [drawn(self.seeded(seed)).spec for seed in seeds]
        first = specs[0].simulation
        assert first
        base = system_of(specs[0], first, self.observer, self.guarantee)
        systems, starts, count = [], [], len(base.scenario.outputs)
        for spec in specs:
            assert spec.simulation
            one = copy(base)
            if base.scenario.noisy:
                one.scenario = replace(base.scenario, noise=noise_samples(spec.simulation, count)[0])
            systems.append(one)
            try:
                starts.append(initial(one, spec.simulation, None))
            except ArithmeticError:
                return []  # each tells what is wrong with it
        breaks, why = base.breaks(), foreign(self.design, {})
        made = zip(seeds, specs, systems, together(systems, starts, self.grid), strict=True)
        members = [
            (seed, member_of(Record(spec, one, breaks, path, why), seed, self.grid))
            for seed, spec, one, path in made
            if path is not None
        ]
        return [(seed, one) for seed, one in members if why or not one.broken]


def varies(spec: Spec, observer: Observer) -> bool:
    """Whether anything of a run depends on its seed."""
    simulation = spec.simulation
    assert simulation
    noise, width = simulation.noise, simulation.x0_width
    drawn_start = width is not None and bool(width.any())
    noisy = noise is not None and bool(noise.amplitude.any())
    return random_intervals(spec, observer) or drawn_start or noisy or uncertain(spec)


def random_intervals(spec: Spec, observer: Observer) -> bool:
    """Whether measurements arrive, or are lost, at random."""
    simulation = spec.simulation
    assert simulation
    return bool(observer.jump) and (simulation.sampling == "random" or simulation.dropout > 0)


def require_runs(spec: Spec, runs: int) -> int:
    """First seed of so many runs. Raises `UsageError`: there can be no such runs."""
    if isinstance(runs, bool) or not isinstance(runs, int) or not 1 <= runs <= MOST:
        raise UsageError(Problem(f"{runs!r}; give a whole number of runs from 1 to {MOST:,}", "runs", id="OBS933"))
    if spec.simulation is None:
        said = "is missing; give at least horizon, x0, and w or v"
        raise UsageError(spec.located(Problem(said, key="simulation", id="OBS801")))
    if spec.simulation.seed + runs - 1 > LARGEST_SEED:
        said = f"the last of {runs} runs would have a seed above {LARGEST_SEED}; give a smaller one"
        raise UsageError(spec.located(Problem(said, key="simulation.seed", id="OBS933")))
    return spec.simulation.seed


def montecarlo(
    design: "Design",
    runs: int,
    jobs: int = 1,
    progress: Callable[[float], None] | None = None,
    changes: Mapping[str, Any] | None = None,
) -> MonteCarlo:
    """Runs of a design with the seeds from that of its spec on, in so many processes; the same for any number of them.

    `changes`: other values of keys of `simulation`. The runs that are told of as worst are those that `simulate` makes
    of their seeds; errors of the others are known to better than a hundredth. Raises `UsageError`: see `simulate`.
    """
    spec = tried(design, changes or {})
    first = require_runs(spec, runs)
    seeds = list(range(first, first + runs))
    with spec.placed():
        subject = Subject(design, spec, observer_of(design, spec), design.guarantee, instants(spec))
        member, names = subject.alone(first)
        why = foreign(design, drawn(spec).parameters) or (UNPROVED if member.omitted == UNPROVED else "")
        if not varies(spec, subject.observer):
            members = tuple(replace(member, seed=seed) for seed in seeds)
            return MonteCarlo(spec, names, subject.grid, members, why, same=True)
        found = computed(subject, seeds, jobs, progress)
        random = random_intervals(spec, subject.observer)
        exact = {first: member} if subject.common and runs >= FEW else found
        while True:
            found |= exact
            made = MonteCarlo(spec, names, subject.grid, tuple(found[seed] for seed in seeds), why, intervals=random)
            if not (anew := sorted(worst_seeds(made) - exact.keys())):
                return made
            exact |= computed(subject, anew, jobs, alone=True)


def computed(
    subject: Subject,
    seeds: Sequence[int],
    jobs: int,
    progress: Callable[[float], None] | None = None,
    *,
    alone: bool = False,
) -> dict[int, Member]:
    """Runs by their seeds; `alone`: each by itself."""
    size = 1 if alone else subject.part
    parts = [seeds[k : k + size] for k in range(0, len(seeds), size)]
    found: dict[int, Member] = {}
    for _, content in shared_out(len(parts), lambda k: packed(subject.part_of(parts[k])), jobs):
        found |= {one.seed: one for one in unpacked(content)}
        if progress is not None:
            progress(len(found) / len(seeds))
    return found
