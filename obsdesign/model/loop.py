"""Whether the implicit equation q = c + D f(t, y, q) of a plant, or of an observer, has one solution."""

from collections.abc import Callable, Sequence

import numpy as np

from obsdesign.lmi.formula import Array, Inequality, Problem, Values, he, identity, in_floats
from obsdesign.lmi.proof import holds
from obsdesign.lmi.solve import Status, widest
from obsdesign.model.multiplier import Matrix, Multiplier
from obsdesign.records import dataclass

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

    def contracts(group: Sequence[int], q: Array, f: Array) -> bool:
        own = Multiplier(tuple(blocks[i] for i in group))
        return widest(contraction(D[np.ix_(q, f)], own)).status is Status.OPTIMAL

    failing = "no multiplier of {} was found that makes [D; I]' M [D; I] negative definite"
    return judged(D, multiplier, contracts, failing)


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
    M11, M12, M22 = multiplier.matrix(values)

    def contracts(_: Sequence[int], q: Array, f: Array) -> bool:
        across = np.ix_(q, f)
        N = form(D[across], (M11[np.ix_(q, q)], M12[across], M22[np.ix_(f, f)]))
        return holds(Inequality("N < 0", N, strict=True))

    return judged(D, multiplier, contracts, "the multiplier does not make [D; I]' M [D; I] of {} negative definite")


def judged(
    D: Array, multiplier: Multiplier, contracts: Callable[[Sequence[int], Array, Array], bool], failing: str
) -> Verdict:
    """Verdict on all groups of blocks in a loop; `contracts` takes a group and its positions in q and in f."""
    sizes = np.array([[0, 0], *([block.nq, block.nf] for block in multiplier.blocks)]).T
    q, f = (np.split(np.arange(count.sum()), np.cumsum(count)[1:-1]) for count in sizes)
    groups = loops(D, q, f)
    for group in groups:
        if not contracts(group, *(np.concatenate([positions[i] for i in group]) for positions in (q, f))):
            return Verdict(False, failing.format(names(group)))
    if not groups:
        return Verdict(True, EXPLICIT)
    return Verdict(True, f"[D; I]' M [D; I] < 0 for {' and for '.join(map(names, groups))}")


def names(group: Sequence[int]) -> str:
    """Name the blocks of a group as a user counts them."""
    return ", ".join(f"f{i + 1}" for i in group)


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
