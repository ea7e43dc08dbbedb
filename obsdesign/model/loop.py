"""Whether the implicit equation q = c + D f(t, y, q) of a plant, or of an observer, has one solution."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from obsdesign.lmi.formula import Array, Inequality, Values, he, in_floats
from obsdesign.lmi.proof import holds
from obsdesign.model.multiplier import Multiplier, Scaled

EXPLICIT = "no block of f acts on its own argument, so they are computed block by block"
MARGIN = 1e-6  # an eigenvalue further below zero counts as negative; above the tolerance of linear programs


@dataclass(frozen=True)
class Verdict:
    """Whether the loop is known to have one solution, and why."""

    unique: bool
    argument: str

    @property
    def sentence(self) -> str:
        """Verdict in words."""
        answer = "has one solution" if self.unique else "may have no solution, or several"
        return f"q = c + D f(q) {answer}: {self.argument}"


def well_posed(D: Array, multiplier: Multiplier) -> Verdict:
    """Decide whether q = c + D f(q) has one solution for every c and every continuous f of the class.

    Blocks that do not act on their own arguments through D are computed one after the other. A group of
    blocks that do has one solution if N = [D; I]' M [D; I] < 0 for some M of the multiplier set, which reads
    k |D| < 1 for a Lipschitz block and D + D' < 0 for a monotone one. Proof, with g(q) = q - D f(q):

    - dq = D df + dg in [dq; df]' M [dq; df] >= 0 and N < 0 bound |df|, hence |dq|, by a multiple of |dg|;
    - so g is injective (uniqueness), and |g(q)| grows without bound with |q|;
    - a continuous injective map of R^n into itself is open, and one that grows without bound has a closed
      range; a range that is open and closed is all of R^n (existence).

    The condition is sufficient only, so a negative answer says "may".

    Parameters
    ----------
    D, multiplier
        The (nq, nf) matrix Dqf of a plant, or Dqf + L2 Df of an observer, and the multiplier of f.
    """
    D, blocks = in_floats(D), in_floats(multiplier.blocks)
    q, f = indices([len(b.M11) for b in blocks]), indices([len(b.M22) for b in blocks])
    groups = loops(D, q, f)
    if not groups:
        return Verdict(True, EXPLICIT)
    for group in groups:
        inside = np.concatenate([f[i] for i in group])
        forms = [form(D[np.ix_(q[i], inside)], blocks[i], np.isin(inside, f[i])) for i in group]
        if smallest_peak(forms) >= -MARGIN:
            return Verdict(False, f"no multiplier of {names(group)} makes [D; I]' M [D; I] negative definite")
    return Verdict(True, f"[D; I]' M [D; I] < 0 for {' and for '.join(map(names, groups))}")


def proved(D: Array, multiplier: Multiplier, scales: Values) -> Verdict:
    """Decide the same exactly, for the given scales: N < 0 for each group of blocks in a loop.

    Parameters
    ----------
    D, multiplier, scales
        In rationals.
    """
    q, f = indices([len(b.M11) for b in multiplier.blocks]), indices([len(b.M22) for b in multiplier.blocks])
    M11, M12, M22 = multiplier.matrix(scales)
    groups = loops(D, q, f)
    for group in groups:
        rows, columns = np.concatenate([q[i] for i in group]), np.concatenate([f[i] for i in group])
        inner = D[np.ix_(rows, columns)]
        N = inner.T @ M11[np.ix_(rows, rows)] @ inner + he(inner.T @ M12[np.ix_(rows, columns)])
        if not holds(Inequality("N < 0", N + M22[np.ix_(columns, columns)], strict=True)):
            return Verdict(False, f"the scales do not make [D; I]' M [D; I] of {names(group)} negative definite")
    if not groups:
        return Verdict(True, EXPLICIT)
    return Verdict(True, f"[D; I]' M [D; I] < 0 for {' and for '.join(map(names, groups))}")


def names(group: Sequence[int]) -> str:
    """Name the blocks of a group as a user counts them."""
    return ", ".join(f"f{i + 1}" for i in group)


def indices(sizes: Sequence[int]) -> list[Array]:
    """Positions of consecutive parts of a vector."""
    ends = np.cumsum([0, *sizes])
    return [np.arange(ends[i], ends[i + 1]) for i in range(len(sizes))]


def loops(D: Array, q: Sequence[Array], f: Sequence[Array]) -> list[tuple[int, ...]]:
    """Find the groups of blocks that act on their own arguments.

    They are the strongly connected components, with an edge, of the graph in which block j acts on block i if
    D takes f_j into q_i.
    """
    acts = np.zeros((len(q), len(f)), dtype=bool)
    for i, rows in enumerate(q):
        acts[i] = [(D[np.ix_(rows, columns)] != 0).any() for columns in f]
    reach = acts.copy()
    for _ in q:
        reach |= (reach.astype(int) @ acts.astype(int)) > 0
    mutual = reach & reach.T
    return sorted({tuple(np.flatnonzero(mutual[i]).tolist()) for i in range(len(q)) if mutual[i, i]})


def form(D: Array, block: Scaled, own: Array) -> Array:
    """[D; E]' M [D; E] for one block of a group: D gives its argument, and E takes its own value out of f."""
    E = np.eye(D.shape[1])[own]
    return np.asarray(D.T @ block.M11 @ D + he(D.T @ block.M12 @ E) + E.T @ block.M22 @ E)


def smallest_peak(forms: Sequence[Array]) -> float:
    """Smallest largest eigenvalue of sum_i s_i N_i, balanced, over s >= 0 with sum 1, or any negative one.

    Cutting planes: the largest eigenvalue is the maximum of v' N(s) v over unit vectors v, which is linear in
    s. Each s that is tried adds its eigenvectors to the v for which the next s is best.
    """
    N = balanced(forms)
    scales, bound, cuts = np.full(len(N), 1 / len(N)), -np.inf, np.empty((0, len(N)))
    for _ in range(100):
        peaks, v = np.linalg.eigh(np.tensordot(scales, N, axes=1))
        if peaks[-1] < -MARGIN or bound >= -MARGIN:
            break
        cuts = np.vstack([cuts, np.einsum("ai,kab,bi->ik", v, N, v)])
        scales, bound = best_scales(cuts)
    return float(peaks[-1])


def balanced(forms: Sequence[Array]) -> Array:
    """Forms of norm 1, in coordinates (by a diagonal congruence, which keeps signs) of equal weight."""
    N = np.array([form / (np.linalg.norm(form) or 1.0) for form in forms])
    weights = np.linalg.norm(N, axis=2).sum(axis=0)
    units = np.sqrt(np.where(weights > 0, weights, 1.0))
    return np.asarray(N / units / units[:, None])


def best_scales(cuts: Array) -> tuple[Array, float]:
    """Scales s >= 0 with sum 1 that minimise the largest entry of cuts @ s, and this entry."""
    from scipy.optimize import linprog

    rows, k = cuts.shape
    objective = np.append(np.zeros(k), 1.0)
    inequalities = np.hstack([cuts, -np.ones((rows, 1))])
    total = [np.append(np.ones(k), 0.0)]
    best: Any = linprog(objective, inequalities, np.zeros(rows), total, [1.0], [(0, 1)] * k + [(None, None)])
    return best.x[:k], float(best.fun)
