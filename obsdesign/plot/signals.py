"""What a figure of a run shows: the estimates that the spec asks for, with what is proved of each, y and the inputs."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from obsdesign.families.guarantee import LAST
from obsdesign.lmi.formula import Array, rational
from obsdesign.plot.axis import finite, plain, with_unit
from obsdesign.records import dataclass, replace
from obsdesign.spec import limited

if TYPE_CHECKING:
    from obsdesign.simulate import Run

VALUES = ("true", "estimate", "radius", "measured", "stepped")  # of a curve


@dataclass(frozen=True)
class Curve:
    """A true signal at the samples, what is known of it, and the region in which it and its estimate should stay."""

    label: str
    true: Array  # (N,)
    estimate: Array | None = None  # (N,)
    radius: Array | None = None  # (N,), proved, NaN where nothing is
    measured: Array | None = None  # (N,), or (K,) at the instants
    instants: Array | None = None  # (K,), s, of measurements
    region: tuple[float, float] | None = None
    stepped: Array | None = None  # (M,), the estimate at the steps of the integrator, with its peaks between samples

    def __post_init__(self) -> None:
        for name in VALUES:
            if (values := getattr(self, name)) is not None:
                object.__setattr__(self, name, finite(values))

    def scaled(self, factor: float) -> "Curve":
        """The same in another unit."""
        parts = {name: getattr(self, name) for name in VALUES}
        return replace(self, **{name: factor * part for name, part in parts.items() if part is not None})


@dataclass(frozen=True)
class Estimate:
    """A signal that is estimated: its curve at the samples, and its error at the steps of the integrator."""

    name: str
    curve: Curve
    t: Array  # (M,), s
    error: Array  # (M,)
    bound: Array | None  # (M,), proved of |error| at each instant; NaN where nothing is
    settling: Mapping[str, float | None] | None  # s; None where the summary has none
    limit: float | None = None  # proved of |error| in the last fifth of the run

    @property
    def label(self) -> str:
        """Name and unit."""
        return self.curve.label

    @property
    def peak(self) -> tuple[float, float]:
        """Time and size of the largest error."""
        size = np.nan_to_num(np.abs(self.error))
        top = int(np.argmax(size))
        return float(self.t[top]), float(size[top])

    @property
    def unsettled(self) -> tuple[float, float]:
        """How late, and how badly, it settles: for the order of importance."""
        last = (self.settling or {"t1": None})["t1"]
        size = np.abs(self.error)
        late, height = size[self.t >= LAST * self.t[-1]].max(), np.ptp(np.nan_to_num(self.curve.true))
        return (np.inf if last is None else last, late / (height or float(size.max()) or 1.0))


@dataclass(frozen=True)
class Source:
    """Where a run keeps a signal that is estimated: its truth, its estimate and its error, with its row h e."""

    name: str
    label: str
    true: Array
    estimate: Array
    stepped: Array  # the estimate at the steps
    error: Array
    row: Array | None  # None: the error is no combination of e
    limit: float | None = None


def wanted(run: "Run") -> list[Estimate]:
    """What the spec asks for (`performance`), and what the observer reconstructs."""
    sources = unique(asked(run))
    return estimates(run, sources or states(run))


def others(run: "Run", shown: Sequence[Estimate]) -> list[Estimate]:
    """Every other signal that is estimated."""
    names = {estimate.name for estimate in shown}
    return estimates(run, [s for s in unique([*asked(run), *states(run), *inputs(run)]) if s.name not in names])


def unique(sources: Sequence[Source]) -> list[Source]:
    """One of each name."""
    found: dict[str, Source] = {}
    for source in sources:
        found.setdefault(source.name, source)
    return list(found.values())


def asked(run: "Run") -> list[Source]:
    """Signals of the rows of H; w where it is reconstructed, alone if H asks for no more than the states."""
    known = {source.name: source for source in [*states(run), *inputs(run)]}
    found = []
    for name, row in zip(run.spec.H_names, run.spec.H, strict=True):
        (used,) = np.nonzero(row != 0)
        single = run.states[used[0]] if len(used) == 1 else ""
        if source := known.get(name) or known.get(single):
            found.append(source)
        elif len(used) and used[-1] < run.xi.shape[1]:
            size = run.xi.shape[1]
            h = row[:size].astype(float)
            found.append(
                Source(
                    name,
                    plain(name),
                    run.xi @ h,
                    run.xihat[:, :size] @ h,
                    run.steps.xihat[:, :size] @ h,
                    run.steps.e @ h,
                    row,
                )
            )
    if not run.spec.observer.reconstruct:
        return found
    return inputs(run) if {source.name for source in found} == set(run.states) else [*found, *inputs(run)]


def states(run: "Run") -> list[Source]:
    """The states of the plant, and those of the disturbance model where they have a true value."""
    basis = rational(np.eye(len(run.spec.model_states) + run.plant_states))
    return [
        Source(
            name,
            with_unit(run.spec, name),
            run.xi[:, i],
            run.xihat[:, i],
            run.steps.xihat[:, i],
            run.steps.e[:, i],
            basis[i],
        )
        for i, name in enumerate(run.states[: run.xi.shape[1]])
    ]


def inputs(run: "Run") -> list[Source]:
    """The unknown inputs that are estimated."""
    model, zeros = run.spec.generator, np.zeros(run.plant_states, dtype=int)
    limit = None if run.schedule else reconstructed(run)
    found = []
    for k, i in enumerate(run.estimated):
        name = run.exogenous[i]
        direct = run.spec.observer.reconstruct or np.any(model.Dm[i] != 0) or np.any(model.Dwf[i] != 0)
        row = None if direct else rational(np.concatenate([zeros, model.Cm[i]]))
        signals = run.w[:, i], run.what[:, k], run.steps.what[:, k], run.steps.w_error[:, k]
        found.append(Source(name, with_unit(run.spec, name), *signals, row, limit))
    return found


def reconstructed(run: "Run") -> float | None:
    """What is proved of |what - w| in the last fifth of a run, for a w that is reconstructed."""
    accuracy = run.summary.get("reconstruction", {})
    if "bound" not in accuracy or "note" in accuracy:
        return None
    return float(accuracy["bound"] + accuracy["transient_left"])


def estimates(run: "Run", sources: Sequence[Source]) -> list[Estimate]:
    """Estimates of some signals, with what V says of each error at each instant: |h e| <= sqrt(h P^-1 h') sqrt(V)."""
    rows = [k for k, source in enumerate(sources) if source.row is not None]
    reach: dict[int, float] = {}
    if run.guarantee is not None and run.V_bound is not None and rows:
        H = np.array([sources[k].row for k in rows])
        reach = dict(zip(rows, run.guarantee.reach(H).tolist(), strict=True))
    return [estimate(run, source, reach.get(k)) for k, source in enumerate(sources)]


def estimate(run: "Run", source: Source, reach: float | None) -> Estimate:
    """One estimate, with its proved bound as long as the guarantee says something of the run."""

    def bound(t: Array, V: Array | None) -> Array | None:
        if reach is None or V is None:
            return None
        return finite(np.where(t < run.until, reach * np.sqrt(V), np.nan))

    curve = Curve(source.label, source.true, source.estimate, bound(run.t, run.V_bound), stepped=source.stepped)
    return Estimate(
        source.name,
        curve,
        run.steps.t,
        finite(source.error),
        bound(run.steps.t, run.steps.V_bound),
        run.summary["settling"].get(source.name),
        source.limit,
    )


def outputs(run: "Run") -> list[Curve]:
    """The outputs, with what is measured of them where noise makes a difference, or it is measured at instants."""
    after = None if run.schedule is None else np.flatnonzero(np.diff(run.steps.j)) + 1
    found = []
    for i, name in enumerate(run.outputs):
        label, true = with_unit(run.spec, name), run.y_true[:, i]
        if after is not None:
            found.append(Curve(label, true, measured=run.steps.y[after, i], instants=run.steps.t[after]))
        else:
            found.append(Curve(label, true, measured=None if np.array_equal(run.y, run.y_true) else run.y[:, i]))
    return found


def driving(run: "Run", shown: Sequence[Estimate]) -> list[Curve]:
    """Known inputs, unknown ones that are not shown elsewhere, and v where all of these are; none that is always 0."""
    names = {estimate.name for estimate in shown}
    known = list(zip(run.spec.inputs, run.u.T, strict=True))
    unknown = [(name, w) for name, w in zip(run.exogenous, run.w.T, strict=True) if name not in names]
    v = () if run.v is None or unknown or not run.spec.model_states else zip(run.spec.drives, run.v.T, strict=True)
    others = [Curve(with_unit(run.spec, name), values) for name, values in (*unknown, *v) if values.any()]
    mark = ", known" if others else ""
    return [*(Curve(with_unit(run.spec, name) + mark, values) for name, values in known if values.any()), *others]


def arguments(run: "Run") -> list[Curve]:
    """The arguments of f that have to stay in a region."""
    found = []
    for i, k, column, region in limited(run.spec.nonlinearities):
        name = run.spec.nonlinearities[i - 1].argument(k, f"q{k + 1} of nonlinearities[{i - 1}]")
        found.append(Curve(plain(name), run.q[:, column], run.qhat[:, column], region=region))
    return found
