"""The loop shift f -> f - K q, which makes M11 >= 0, and the way back; a free L2 needs it."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.lmi import formula
from obsdesign.lmi.equilibrate import units
from obsdesign.lmi.formula import Array, Inequality, Values, block_diagonal
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant

LEAST_SCALE = 1e-7  # a free L2 = R / lambda needs lambda > 0; relative to P, in the scales of the data
LARGEST_SCALE = 1e4  # .. and a bounded one: where f depends on measured states, Cq + L2 C -> 0 and lambda -> inf


def with_usable_scales(problem: formula.Problem, multiplier: Multiplier) -> formula.Problem:
    """With LEAST_SCALE <= lambda / (mean of the diagonal of P) <= LARGEST_SCALE, all in the scales of the data."""
    unit = units(problem)

    def usable(v: Values) -> Iterator[Inequality]:
        mean = np.trace(v["P"] / unit["P"], axis1=-2, axis2=-1)[..., None, None] / len(unit["P"])
        for name in (unknown.name for unknown in multiplier.unknowns()):
            scale = v[name] / unit[name]
            yield Inequality(f"{name} > 0", LEAST_SCALE * mean - scale)
            yield Inequality(f"{name} bounded", scale - LARGEST_SCALE * mean)

    return replace(problem, inequalities=lambda v: (*problem.inequalities(v), *usable(v)))


def unshifted(L2: Array, plant: Plant[Array], K: Array) -> Array:
    """L2 for f of the L2 found for f - K q: L2n = X (I - Df K X)^-1 with X = (I - Dqf K)^-1 L2."""
    X = np.linalg.solve(np.eye(len(L2)) + L2 @ plant.Df @ K, L2)
    return np.asarray((np.eye(len(L2)) - plant.Dqf @ K) @ X)


def free_factor(multiplier: Multiplier) -> Array:
    """U with M11 = U U' for unit scales, block by block; a block with M11 = 0 has no columns."""
    return block_diagonal([square_root(b.M11) for b in multiplier.scaled_blocks()])


def square_root(M: Array) -> Array:
    """U with M = U U', its columns as many as the rank.

    Raises `UsageError` if M is not positive semidefinite: the multiplier does not allow a free L2.
    """
    values, vectors = np.linalg.eigh(M)
    scale = np.abs(values).max(initial=0)
    if (values < -1e-12 * scale).any():
        raise UsageError(
            Problem("a free L2 needs a multiplier with M11 >= 0; give L2 as a matrix", key="observer.L2", id="OBS501")
        )
    keep = values > 1e-12 * scale
    return np.asarray(vectors[:, keep] * np.sqrt(values[keep]))


def shifted_plant(plant: Plant[Array], K: Array) -> Plant[Array]:
    """Plant with f = K q + f~, so that f = (I - K Dqf)^-1 (f~ + K (Cq x + Dq w)) and q = W (Cq x + Dqf f~ + Dq w)."""
    p = plant
    W = np.linalg.inv(np.eye(p.Cq.shape[0]) - p.Dqf @ K)
    Cq, Dqf, Dq = W @ p.Cq, W @ p.Dqf, W @ p.Dq
    through = np.eye(K.shape[0]) + K @ Dqf
    return replace(
        p,
        A=p.A + p.Bf @ K @ Cq,
        Bf=p.Bf @ through,
        B=p.B + p.Bf @ K @ Dq,
        Cq=Cq,
        Dqf=Dqf,
        Dq=Dq,
        C=p.C + p.Df @ K @ Cq,
        Df=p.Df @ through,
        D=p.D + p.Df @ K @ Dq,
    )
