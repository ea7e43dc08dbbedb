"""One run of an ensemble: what is kept of it."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from obsdesign.families.guarantee import Bound
from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass
from obsdesign.simulate.integrate import Status
from obsdesign.simulate.record import Record
from obsdesign.simulate.summary import checks
from obsdesign.spec import Spec

EVENLY, EARLY, FIRST = 301, 150, 1e-5  # instants of an envelope: evenly spaced, and from so early on by ratios
HEAD = 8  # bytes of the length of what comes first


@dataclass(frozen=True)
class Member:
    """What is kept of one run."""

    seed: int
    status: Status
    time: float  # s, where it ended
    bounds: list[Bound]  # those that are proved of it, or observed where nothing is
    omitted: str  # why bounds are left out, or nothing
    cut_by: str  # what the run did when bounds were checked no longer, or nothing
    left: bool  # whether it left the region of a declared type
    rms: list[float]  # of the errors of each estimate, over its time
    peak: list[float]
    sizes: Float  # (instants, estimates): |error|; NaN after its end

    @property
    def lost(self) -> bool:
        """Whether it escaped, or could not be computed to its end."""
        return self.status in ("escape", "stall")

    @property
    def broken(self) -> bool:
        """Whether a bound is not kept."""
        return not all(bound["holds"] for bound in self.bounds)

    @property
    def mean_square(self) -> Array:
        """Of each estimate."""
        return np.square(self.rms)


def estimates(record: Record) -> tuple[str, ...]:
    """Names of what is estimated: states of the plant, and unknown inputs."""
    acting = record.acting
    return (*acting.plant.states[: acting.n], *(acting.inputs[i] for i in record.estimated))


def instants(spec: Spec) -> Float:
    """Instants of an envelope (G,): of samples in discrete time, else evenly spaced, and close at the beginning."""
    simulation = spec.simulation
    assert simulation
    horizon = simulation.horizon
    if spec.period is None:
        early = np.geomspace(FIRST * horizon, horizon, EARLY)[:-1]
        return np.unique(np.concatenate((np.linspace(0, horizon, EVENLY), early)))
    period = float(spec.period)
    last = int(horizon / period * (1 + 1e-9))
    return np.asarray(np.unique(np.linspace(0, last, EVENLY + EARLY).astype(int)) * period)


def member_of(record: Record, seed: int, grid: Float) -> Member:
    """What is kept of a run, at the instants (G,) of the envelope."""
    found, trajectory, t = checks(record), record.trajectory, record.t
    error = np.hstack([record.e[:, : record.acting.n], record.signals.w_error])
    size = np.abs(error)
    reached = grid <= t[-1] * (1 + 1e-12)
    at = np.array([np.interp(grid, t, column, right=np.nan) for column in size.T]).T
    at[reached & np.isnan(at).any(axis=1)] = size[-1]
    at[~reached] = np.nan
    bounds = found.get("observed", found["bounds"])
    left, omitted = bool(record.left), found["bounds_omitted"] or ""
    rms = np.sqrt(mean(error**2, t, in_samples=record.acting.clock is not None)).tolist()
    status = trajectory.status
    return Member(
        seed, status, trajectory.time, bounds, omitted, record.cut[1], left, rms, size.max(axis=0).tolist(), at
    )


def mean(values: Float, t: Float, *, in_samples: bool) -> Array:
    """Mean of columns (M, k) over times t (M,), increasing."""
    if in_samples or t[-1] == t[0]:
        return np.asarray(values.mean(axis=0))
    return np.asarray(np.trapezoid(values, t, axis=0) / (t[-1] - t[0]))


def packed(members: Sequence[Member]) -> bytes:
    """Some runs as bytes; numbers are the same doubles."""
    plain = [{name: value for name, value in asdict(one).items() if name != "sizes"} for one in members]
    head = json.dumps({"shape": members[0].sizes.shape, "members": plain}).encode()
    return len(head).to_bytes(HEAD, "big") + head + np.array([one.sizes for one in members]).tobytes()


def unpacked(content: bytes) -> list[Member]:
    """Runs of `packed`."""
    end = HEAD + int.from_bytes(content[:HEAD], "big")
    head: dict[str, Any] = json.loads(content[HEAD:end])
    sizes = np.frombuffer(content[end:]).reshape(-1, *head["shape"])
    return [Member(**one, sizes=rows) for one, rows in zip(head["members"], sizes, strict=True)]
