"""Whether a run stays where the guarantee was proved, and keeps its bounds."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Literal

import numpy as np

from obsdesign.errors import Problem, ViolatedError
from obsdesign.lmi.formula import Array
from obsdesign.nonlinearities.evidence.restriction import outward
from obsdesign.records import dataclass
from obsdesign.spec import Nonlinearity, limited
from obsdesign.tables.text import at_most

Side = Literal["plant", "estimate"]
PARTS, NARROWINGS = 33, 6  # of a step in which an argument goes out: the instant is found to 1e-9 of it


@dataclass(frozen=True)
class Leaving:
    """The first instant at which an argument of f is outside the region on which its type holds."""

    nonlinearity: int  # from 1
    argument: str  # q1, q2, .. of this nonlinearity, t, an output or an input; of equations what it is of the states
    of: Side
    time: float
    value: float  # there: an end of the region, unless the argument begins outside or jumps there
    region: tuple[float | None, float | None]  # None: unbounded
    own: bool = True  # whether the name of the argument means something in this nonlinearity only

    def __str__(self) -> str:
        whose = {"plant": "of the plant", "estimate": "of the observer"}[self.of]
        which = f"{self.argument} of nonlinearities[{self.nonlinearity - 1}]" if self.own else self.argument
        inside = interval(self.region)
        how = f"leaves {inside}" if self.value in self.region else f"is {self.value:.4g}, outside {inside},"
        return f"{which} {whose} {how} at t = {self.time:.4g}"

    def written(self) -> dict[str, Any]:
        """Entry of a summary."""
        entry = asdict(self)
        entry.pop("own")
        return entry


def is_local(blocks: Sequence[Nonlinearity]) -> bool:
    """Whether a type holds on a region only, and the guarantee with it."""
    return any(block.region is not None or block.others for block in blocks)


@dataclass(frozen=True)
class Arguments:
    """Arguments of all f at instants of a run."""

    t: Array  # (M,)
    q: Array  # (M, nq), in the plant
    qhat: Array  # (M, nq), in the observer
    known: Mapping[str, Array]  # those that both share, by name: t, outputs and inputs, (M,) each


@dataclass(frozen=True)
class Watched:
    """An argument that has to stay within limits."""

    nonlinearity: int
    argument: str
    of: Side
    place: int | str  # column of q, or name of what both sides share
    limits: tuple[float, float]

    def values(self, at: Arguments) -> Array:
        """What it is, (M,)."""
        if isinstance(self.place, str):
            return at.known[self.place]
        return np.asarray((at.q if self.of == "plant" else at.qhat)[:, self.place])

    def outside(self, at: Arguments) -> Array:
        """Instants at which it does not, (M,)."""
        values, (low, high) = self.values(at), self.limits
        return np.asarray((values < low) | (values > high))


def leavings(
    blocks: Sequence[Nonlinearity], run: Arguments, between: Callable[[int, Array], Arguments] | None
) -> tuple[Leaving, ...]:
    """First leaving of each limited argument of f, in the order of time.

    Parameters
    ----------
    blocks
        With nq components of q in all.
    run
        At the instants of the run.
    between
        The same between instant k - 1 and instant k, at shares of the time between both, 0 to 1; None where there is
        nothing between two samples.
    """
    found = []
    for one in watched(blocks):
        if len(out := np.flatnonzero(one.outside(run))):
            at, value = crossing(one, run, int(out[0]), between)
            low, high = map(finite, one.limits)
            own = not blocks[one.nonlinearity - 1].term
            found.append(Leaving(one.nonlinearity, one.argument, one.of, at, value, (low, high), own))
    return tuple(sorted(found, key=lambda leaving: leaving.time))


def watched(blocks: Sequence[Nonlinearity]) -> Iterator[Watched]:
    """Arguments of f that are limited."""
    for i, k, column, limits in limited(blocks):
        name = blocks[i - 1].argument(k, f"q{k + 1}")
        yield Watched(i, name, "plant", column, limits)
        yield Watched(i, name, "estimate", column, limits)
    for i, block in enumerate(blocks, start=1):
        for name, ends in block.others.items():
            yield Watched(i, name, "plant", name, outward(ends))


def crossing(
    one: Watched, run: Arguments, k: int, between: Callable[[int, Array], Arguments] | None
) -> tuple[float, float]:
    """When an argument that is outside at instant k, and not before, goes out, and its value there."""
    value = float(one.values(run)[k])
    if k == 0 or between is None or run.t[k - 1] == run.t[k]:
        return float(run.t[k]), value
    low, high = 0.0, 1.0
    for _ in range(NARROWINGS):
        shares = np.linspace(low, high, PARTS)
        out = one.outside(between(k, shares))
        first = int(np.argmax([*out[1:-1], True]))
        low, high = shares[first : first + 2]
    return float(run.t[k - 1] + high * (run.t[k] - run.t[k - 1])), float(np.clip(value, *one.limits))


def region(blocks: Sequence[Nonlinearity]) -> str:
    """Where the arguments of f must stay, in words."""
    ends = [(f"q{k + 1} of nonlinearities[{i - 1}]", i, k, limits) for i, k, _, limits in limited(blocks)]
    said = [f"{blocks[i - 1].argument(k, name)} in {interval(limits)}" for name, i, k, limits in ends]
    for i, block in enumerate(blocks):
        whose = "" if block.term else f" of nonlinearities[{i}]"
        said += [f"{name}{whose} in {interval(outward(limits))}" for name, limits in block.others.items()]
    return ", ".join(dict.fromkeys(said))


def interval(limits: Sequence[float | None]) -> str:
    """Limits as an interval."""
    low, high = (
        f"{sign}inf" if end is None or np.isinf(end) else f"{end:g}" for sign, end in zip("-+", limits, strict=True)
    )
    return f"[{low}, {high}]"


def finite(limit: float) -> float | None:
    """Return the limit, or None where there is none."""
    return limit if np.isfinite(limit) else None


def validity(blocks: Sequence[Nonlinearity], left: Sequence[Leaving], guaranteed: bool) -> dict[str, Any]:
    """Regions of the types, where the run left them, and what that means."""
    note = f"the run {'leaves' if left else 'stays in'} the region of the declared types, {region(blocks)}"
    if left:
        note += f": {left[0]}"
    if left and guaranteed:
        note += "; the guarantee is local and says nothing of the run from then on"
    return {"holds": not left, "region": region(blocks), "left": [leaving.written() for leaving in left], "note": note}


def require_kept(summary: Mapping[str, Any], samples: str) -> None:
    """Hold a run to the bounds that are proved of it.

    Raises `ViolatedError` if it breaks one.
    """
    broken = [bound for bound in summary["bounds"] if not bound["holds"]]
    if broken:
        first = broken[0]
        said = (
            f"the run breaks {len(broken)} of the bounds that are proved of it: {first['value']:.6g} is not "
            f"below {at_most(first['bound'])} in {first['name']}; this is a defect of obsdesign: please report it with "
            "the spec and the gains file"
        )
        raise ViolatedError(Problem(said, samples, id="OBS807"))
