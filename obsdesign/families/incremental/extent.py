"""The largest class of nonlinearities for which a design is possible."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from obsdesign.dissipation.scan import edge
from obsdesign.families.outcome import Diagnosis
from obsdesign.lmi.formula import in_floats, printed
from obsdesign.model.multiplier import Block, Multiplier, Scaled
from obsdesign.nonlinearities.evidence.claims import Quadratic, generators
from obsdesign.nonlinearities.evidence.refutation import counterexample
from obsdesign.spec import Nonlinearity, Spec

SMALLEST = 1e-6  # share of a class below which it is not searched
STEEPEST = 1e4  # slope bound that is tried for a class without one
EDGE = 1e-4  # relative
BACK = 1e-3  # relative, from the edge to the class that is told, so that its numbers in few digits are within it


def largest_class(spec: Spec, feasible: Callable[[Multiplier], bool]) -> Diagnosis:
    """Largest part of the class of one nonlinearity, the others as they are, for which there is a solution.

    A class shrinks towards its member K: f = K q + s (g - K q) with g in the class and s < 1, so a Lipschitz constant k
    becomes s k. A class without an upper slope bound is cut to slopes up to s. A class that an f which is given is
    seen not to be of is none that could be declared.

    `feasible`: whether the problem has a solution with another multiplier in place of `spec.multiplier`.

    Returns nothing if no nonlinearity alone can be blamed, or else `nonlinearity`, counted from 1, and `feasible`:
    {lipschitz: k}, {slope: [a, b]} or, for other types, {share: s}.
    """
    parts = [n.multiplier.blocks for n in spec.nonlinearities]
    for i, blocks in enumerate(parts):
        if not all(isinstance(block, Scaled) for block in blocks):
            continue

        def enough(share: float, i: int = i) -> bool:
            changed = [[reduced(b, share) for b in part] if k == i else part for k, part in enumerate(parts)]
            return feasible(Multiplier(tuple(block for part in changed for block in part)))

        share = largest_share(enough)
        if share is not None:
            smaller = [reduced(block, share) for block in blocks]
            if not contradicted(spec.nonlinearities[i], smaller):
                return {"nonlinearity": i + 1, "feasible": size(smaller, share)}
    return {}


def contradicted(nonlinearity: Nonlinearity, blocks: Sequence[Scaled]) -> bool:
    """Whether an f is given, and is seen not to be of a class on the region of its type."""
    if nonlinearity.f is None:
        return False
    claims = map(Quadratic, generators(Multiplier(tuple(blocks))))
    return counterexample(nonlinearity.restricted({}), claims) is not None


def largest_share(feasible: Callable[[float], bool]) -> float | None:
    """Largest feasible share, less `BACK`; None if even the smallest is infeasible."""
    if not feasible(SMALLEST):
        return None
    if feasible(1.0):  # slopes up to `STEEPEST` where there is no bound at all
        return 1.0
    return edge(feasible, SMALLEST, 1.0, EDGE) * (1 - BACK)


def reduced(block: Block, share: float) -> Scaled:
    """Set of the reduced class: T'MT with T = [s I 0; (s - 1) K, I]; of a monotone block that of slopes up to s."""
    assert isinstance(block, Scaled)
    s, M11, M12, M22 = printed(share), block.M11, block.M12, block.M22
    if not M11.any() and not M22.any():
        return replace(block, M12=s * printed(STEEPEST) * M12, M22=-(M12 + M12.mT))
    moved = (s - 1) * block.member
    across = s * M12 + moved.mT @ M22
    return replace(block, M11=s * (s * M11 + M12 @ moved) + moved.mT @ across.mT, M12=across)


def size(blocks: Sequence[Scaled], share: float) -> dict[str, Any]:
    """Class of a nonlinearity in the terms of the catalogue."""
    exact = in_floats(tuple(blocks))
    if len(exact) == 1 and not exact[0].M12.any() and exact[0].M22[0, 0]:
        gain, loss = exact[0].M11, -exact[0].M22
        k2 = gain[0, 0] / loss[0, 0]
        if np.allclose(gain, gain[0, 0] * np.eye(len(gain))) and np.allclose(loss, loss[0, 0] * np.eye(len(loss))):
            return {"lipschitz": float(np.sqrt(k2))}
    if all(block.nq == block.nf == 1 and block.M22.item() < 0 for block in exact):
        slopes = [sorted(np.roots([b.M22.item(), 2 * b.M12.item(), b.M11.item()]).real.tolist()) for b in exact]
        return {"slope": slopes[0] if len(slopes) == 1 else slopes}
    return {"share": share}
