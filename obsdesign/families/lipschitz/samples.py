"""The largest Lipschitz constant of samples over all gains, and what bounds it whatever the gain.

Gains stay finite as a rule, so that the problem with the gain will do; where y shows f too late to be of any help the
storage function of the limit is singular, and the coordinates matter.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from obsdesign.dissipation.bounds import NO_BOUNDS
from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UndecidedError
from obsdesign.families.lipschitz.closed_forms import ZERO, arguments
from obsdesign.families.lipschitz.relaxations import Lipschitz
from obsdesign.families.lipschitz.stretch import Stretch
from obsdesign.lmi.formula import Array
from obsdesign.lmi.solve import Status
from obsdesign.model.pencil import split
from obsdesign.records import dataclass, replace

LEAST_SHOWN = 1e-3  # relative, of how well y and q show a coordinate


def largest(engine: Engine, unit: Lipschitz) -> tuple[float, Array]:
    """Supremum of the constant, infinite where every one will do, and the P of the optimum, in doubles.

    `unit`: the family without w and z for the constant 1, in doubles. Raises `UndecidedError`: it was not found.
    """
    stretch = Stretch(engine, unit)
    answer = stretch.best()
    if answer.status is Status.UNDECIDED:
        stretch = Stretch(engine, aligned(unit))
        answer = stretch.best()
    if answer.status is Status.UNDECIDED:
        answer = stretch.bisected(NO_BOUNDS)
    if answer.status is not Status.OPTIMAL:
        raise UndecidedError("the largest Lipschitz constant over all gains was not found", id="OBS507")
    return stretch.constant(answer), answer.values["P"]


def aligned(unit: Lipschitz) -> Lipschitz:
    """Same problem in the coordinates in which y and q of n samples show all states alike."""
    p = unit.plant
    rows = [np.vstack([p.C, p.Cq])]
    for _ in range(p.n - 1):
        rows.append(rows[-1] @ p.A)
    _, sizes, V = np.linalg.svd(units(np.vstack(rows)))
    T = np.maximum(sizes, LEAST_SHOWN * sizes[0])[:, None] * V
    back = np.linalg.inv(T)
    plant = replace(p, A=T @ p.A @ back, Bf=T @ p.Bf, B=T @ p.B, C=p.C @ back, Cq=p.Cq @ back)
    return replace(unit, plant=plant, H=unit.H @ back)


@dataclass(frozen=True)
class Feedback:
    """How f comes back to its own argument before y can tell: Cq A^(j-1) Bf Z, with C A^(i-1) Bf Z = 0 for i < j.

    From rho^2 P >= tau l^2 Cq'Cq and Nf' P Nf <= tau I, and V+ <= rho^2 V where df = 0, the s-procedure has
    l |Cq A^(j-1) Bf Z| <= rho^j whatever the gain. Of filtered estimates the y of the same sample can tell as well:
    their C is C A, and Df Z = 0 for Df = C Bf. For j = 1 it is so of the problem itself with f(k, q), which may turn
    its difference from sample to sample so that |Cq e+| >= l |Cq Nf| |Cq e|.
    """

    samples: int  # j
    most: float  # rho^j / |Cq A^(j-1) Bf Z|, least over the blocks

    @property
    def sentence(self) -> str:
        """Bound in words."""
        j, power = self.samples, f" A^{self.samples - 1}" if self.samples > 2 else " A" * (self.samples - 1)
        return f"rho{f'^{j}' * (j > 1)} / |Cq{power} Bf|, by which f comes back to its argument before y can tell"


def feedback(unit: Lipschitz) -> Feedback | None:
    """Feedback that bounds the constant most, in doubles; None if there is none within n samples."""
    return min(feedbacks(unit), key=lambda feedback: feedback.most, default=None)


def feedbacks(unit: Lipschitz) -> Iterator[Feedback]:
    """Feedbacks of each block by itself."""
    p, columns = unit.plant, np.cumsum([0, *(b.nf for b in unit.multiplier.scaled_blocks())])
    for Cq, (i, k) in zip(arguments(unit), pairwise(columns), strict=True):
        moved, shown, whole = p.Bf[:, i:k], p.Df[:, i:k], np.linalg.norm(Cq, 2) * np.linalg.norm(p.Bf[:, i:k], 2)
        for j in range(1, p.n + 1):
            hidden = moved @ split(units(shown))[0]
            size = float(np.linalg.norm(Cq @ hidden, 2)) if hidden.size else 0.0
            if size > ZERO * whole:
                yield Feedback(j, float(unit.edge.end) ** j / size)
            moved, shown = p.A @ moved, np.vstack([shown, p.C @ moved])


def units(rows: Array) -> Array:
    """Rows of length 1, but for those that are zero."""
    sizes = np.linalg.norm(rows, axis=1, keepdims=True)
    return np.asarray(rows / np.where(sizes > 0, sizes, 1))
