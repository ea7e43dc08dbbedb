"""Whether the implicit equation q = c + D f(t, y, q) of a plant, or of an observer, has one solution."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from obsdesign.lmi.formula import Array, Inequality, Problem, Values, he, identity, in_floats
from obsdesign.lmi.proof import holds
from obsdesign.lmi.solve import Status, widest
from obsdesign.model.multiplier import Matrix, Multiplier

EXPLICIT = "no block of f acts on its own argument, so they are computed block by block"


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

    `D`, `multiplier`: the (nq, nf) matrix Dqf of a plant, or Dqf + L2 Df of an observer, and the multiplier of f.
    """
    D, blocks = in_floats(D), in_floats(multiplier.blocks)
    q, f = parts(multiplier)
    groups = loops(D, q, f)
    for group in groups:
        inner = D[np.ix_(inside(q, group), inside(f, group))]
        if widest(contraction(inner, Multiplier(tuple(blocks[i] for i in group)))).status is not Status.OPTIMAL:
            problem = f"no multiplier of {names(group)} was found that makes [D; I]' M [D; I] negative definite"
            return Verdict(False, problem)
    return accepted(groups)


def contraction(D: Array, multiplier: Multiplier) -> Problem:
    """Find M of the set with N < 0, or N <= -I: the set is a cone, so M may have any size. In doubles."""

    def conditions(v: Values) -> tuple[Inequality, ...]:
        N = form(D, multiplier.matrix(v))
        return Inequality("N <= -I", N + identity(D.shape[1], D)), *multiplier.inequalities(v)

    return Problem(multiplier.unknowns(), conditions)


def form(D: Array, M: Matrix) -> Array:
    """N = [D; I]' M [D; I]."""
    M11, M12, M22 = M
    return np.asarray(D.mT @ M11 @ D + he(D.mT @ M12) + M22)


def proved(D: Array, multiplier: Multiplier, values: Values) -> Verdict:
    """Decide the same exactly, for one M of the set: N < 0 for each group of blocks in a loop.

    `D`, `multiplier`, `values`: in rationals. The values of the unknowns of M satisfy the inequalities of its set,
    which is not checked here.
    """
    q, f = parts(multiplier)
    M11, M12, M22 = multiplier.matrix(values)
    groups = loops(D, q, f)
    for group in groups:
        rows, columns = inside(q, group), inside(f, group)
        across = np.ix_(rows, columns)
        N = form(D[across], (M11[np.ix_(rows, rows)], M12[across], M22[np.ix_(columns, columns)]))
        if not holds(Inequality("N < 0", N, strict=True)):
            problem = f"the multiplier does not make [D; I]' M [D; I] of {names(group)} negative definite"
            return Verdict(False, problem)
    return accepted(groups)


def accepted(groups: Sequence[Sequence[int]]) -> Verdict:
    """Verdict where N < 0 for all groups."""
    if not groups:
        return Verdict(True, EXPLICIT)
    return Verdict(True, f"[D; I]' M [D; I] < 0 for {' and for '.join(map(names, groups))}")


def names(group: Sequence[int]) -> str:
    """Name the blocks of a group as a user counts them."""
    return ", ".join(f"f{i + 1}" for i in group)


def parts(multiplier: Multiplier) -> tuple[list[Array], list[Array]]:
    """Positions of each block in q, and in f."""
    return indices([b.nq for b in multiplier.blocks]), indices([b.nf for b in multiplier.blocks])


def indices(sizes: Sequence[int]) -> list[Array]:
    """Positions of consecutive parts of a vector."""
    return np.split(np.arange(sum(sizes)), np.cumsum(sizes)[:-1])


def inside(positions: Sequence[Array], group: Sequence[int]) -> Array:
    """Positions of all blocks of a group."""
    return np.concatenate([positions[i] for i in group])


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
