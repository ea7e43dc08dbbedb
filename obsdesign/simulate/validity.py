"""Whether a run stays where the guarantee was proved, and keeps its bounds."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from obsdesign.errors import Problem, ViolatedError
from obsdesign.lmi.formula import Array
from obsdesign.nonlinearities.evidence.restriction import outward
from obsdesign.spec import Nonlinearity, limited
from obsdesign.tables.text import at_most

Side = Literal["plant", "estimate"]


@dataclass(frozen=True)
class Leaving:
    """The first instant at which an argument of f is outside the region on which its type holds."""

    nonlinearity: int  # from 1
    argument: str  # q1, q2, .. of this nonlinearity, t, an output or an input; of equations what it is of the states
    of: Side
    time: float
    value: float
    region: tuple[float | None, float | None]  # None: unbounded
    own: bool = True  # whether the name of the argument means something in this nonlinearity only

    def __str__(self) -> str:
        whose = {"plant": "of the plant", "estimate": "of the observer"}[self.of]
        which = f"{self.argument} of nonlinearities[{self.nonlinearity - 1}]" if self.own else self.argument
        where = f"{which} {whose}"
        return f"{where} is {self.value:.4g}, outside {interval(self.region)}, at t = {self.time:.4g}"

    def written(self) -> dict[str, Any]:
        """Entry of a summary."""
        entry = asdict(self)
        entry.pop("own")
        return entry


def is_local(blocks: Sequence[Nonlinearity]) -> bool:
    """Whether a type holds on a region only, and the guarantee with it."""
    return any(block.region is not None or block.others for block in blocks)


def leavings(
    blocks: Sequence[Nonlinearity], t: Array, q: Array, qhat: Array, known: Mapping[str, Array]
) -> tuple[Leaving, ...]:
    """First leaving of each limited argument of f, in the order of time.

    Parameters
    ----------
    blocks
        With nq components of q in all.
    t
        Instants (M,) of the run.
    q, qhat
        Arguments of f in the plant and in the observer, (M, nq).
    known
        The arguments that both share, by name: t, outputs and inputs, (M,) each.
    """
    sides: tuple[tuple[Side, Array], ...] = (("plant", q), ("estimate", qhat))
    watched = [
        (i, blocks[i - 1].argument(k, f"q{k + 1}"), of, values[:, column], limits)
        for i, k, column, limits in limited(blocks)
        for of, values in sides
    ]
    for i, block in enumerate(blocks, start=1):
        watched += [(i, name, "plant", known[name], outward(ends)) for name, ends in block.others.items()]
    found = [
        Leaving(
            i, name, of, float(t[out[0]]), float(values[out[0]]), (finite(low), finite(high)), not blocks[i - 1].term
        )
        for i, name, of, values, (low, high) in watched
        if len(out := np.flatnonzero((values < low) | (values > high)))
    ]
    return tuple(sorted(found, key=lambda leaving: leaving.time))


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
