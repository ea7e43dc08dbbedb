"""How large an injection must be at least for a decay rate, in rationals, from frozen members f = K q of a class.

With K in place of f the error of an observer follows e' = (A + L C) e, whose poles have to be at -alpha or left of it;
of samples e+ = (A + L C) e, with poles of absolute value rho at most, and -rho stands for alpha in what follows.
Then for every real s > -alpha, with d = det(sI - A), M = C (sI - A)^-1 and b = |M|_F |L|,

    (s + alpha)^n <= det(sI - A - L C) = d det(I - M L) <= |d| (1 + b)^ny,

and b >= 1 where d < 0. For one output det(I - M L) = 1 - M L, so that (s + alpha)^n <= |d| b + d.
"""

from itertools import islice, product

import numpy as np
from flint import arb, ctx, fmpq

from obsdesign.lmi.formula import Array, Exact, identity, in_floats, rational_number
from obsdesign.model.frozen import BITS, MOST, array, closed, matrix
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.pencil import System
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass, replace

POINTS = np.geomspace(1e-3, 1e3, 60)  # s + alpha, in units of the fastest of the rates of A and alpha
REFINED = 3  # times, about the best
BELOW = 1 - 1e-3  # of the bound in doubles, that is proved, in 4 digits


@dataclass(frozen=True)
class Needed:
    """That no gain with |L| <= size makes the error decay at a rate, at a member of the class."""

    slopes: tuple[Array, ...]  # K of each block
    at: fmpq  # s, 1/s
    size: fmpq


def needed(plant: Plant[Exact], multiplier: Multiplier, rate: fmpq, L2: Array | None) -> Needed | None:
    """Largest size that the vertices of a class are found to exclude, proved; None if none is found.

    `L2`: (nq, ny); None: any, and then only f = 0 is looked at.
    """
    blocks, best, found = multiplier.blocks, 0.0, None
    choices = [b.vertices if L2 is not None else (0 * b.member,) if b.contains(0 * b.member) else () for b in blocks]
    for slopes in islice(product(*choices), MOST):
        s, size = largest(system_of(plant, multiplier, slopes, L2), float(rate))
        if size > best:
            best, found = size, (slopes, s)
    if found is None:
        return None
    size = rational_number(f"{best * BELOW:.4g}")
    made = Needed(found[0], rational_number(repr(found[1])), size)
    return made if proved(plant, multiplier, rate, L2, made) else None


def system_of(
    plant: Plant[Exact], multiplier: Multiplier, slopes: tuple[Array, ...], L2: Array | None
) -> System | None:
    """A and C of the error with f = K q and L2, in rationals; None where the algebraic loop has no one solution."""
    if L2 is not None:
        plant = replace(plant, Cq=plant.Cq + L2 @ plant.C, Dqf=plant.Dqf + L2 @ plant.Df)
    return closed(plant, multiplier.blocks, slopes)[0]


def largest(system: System | None, rate: float) -> tuple[float, float]:
    """Point s and the largest size of L that one excludes, in doubles; zero if none does."""
    if system is None or not system.C.any():
        return 0.0, 0.0
    A, C = in_floats(system.A), in_floats(system.C)
    unit = max(rate, float(np.abs(np.linalg.eigvals(A)).max()))
    grid, best = unit * POINTS - rate, (0.0, 0.0)
    for _ in range(REFINED if unit else 0):
        known = [(float(f"{s:.6g}"), excluded(A, C, float(f"{s:.6g}"), rate)) for s in grid]
        k = max(range(len(known)), key=lambda i: known[i][1])
        best = max(best, known[k], key=lambda pair: pair[1])
        grid = np.linspace(grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)], 20)
    return best


def excluded(A: Array, C: Array, s: float, rate: float) -> float:
    """Size of L that a point s excludes, in doubles."""
    pencil, ny = s * np.eye(len(A)) - A, len(C)
    sign, logarithm = np.linalg.slogdet(pencil)
    if s + rate <= 0 or not sign:
        return 0.0
    ratio = np.exp(min(len(A) * np.log(s + rate) - logarithm, 700.0))
    b = ratio - sign if ny == 1 else max(ratio ** (1 / ny) - 1, float(sign < 0))
    return float(b / np.linalg.norm(np.linalg.solve(pencil.T, C.T)))


def proved(plant: Plant[Exact], multiplier: Multiplier, rate: fmpq, L2: Array | None, found: Needed) -> bool:
    """Whether a member and an s exclude a size, in balls about rationals."""
    members = zip(found.slopes, multiplier.blocks, strict=True)
    free = L2 is None and any(K.any() for K in found.slopes)
    if free or found.at + rate <= 0 or not all(block.contains(K) for K, block in members):
        return False
    system = system_of(plant, multiplier, found.slopes, L2)
    if system is None:
        return False
    pencil = matrix(found.at * identity(plant.n, system.A) - system.A)
    d, ny = pencil.det(), len(system.C)
    if not d:
        return False
    M = system.C @ array(pencil.inv())
    with ctx.workprec(BITS):
        b = arb((M * M).sum() * found.size * found.size).sqrt()
        least = arb((found.at + rate) ** plant.n)
        if ny == 1:
            return bool(least > arb(abs(d)) * b + arb(d))
        return bool(least > arb(abs(d)) * (1 + b) ** ny) or (d < 0 and bool(b < 1))
