"""First reading of a formula: one batched evaluation gives the affine map that the solver sees."""

from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import accumulate, pairwise

import numpy as np

from obsdesign.errors import UndecidedError
from obsdesign.lmi.formula import Array, Inequality, Problem, Unknown, Values
from obsdesign.records import dataclass

MOST = 2**13  # scalar unknowns: the points at which a formula is evaluated take 0.5 GiB then, and its values some more
TOGETHER = 2**20  # entries of values of a formula up to which they are looked at together
FAR = 2.0**20  # coordinates at which a formula is evaluated: its constant part is nothing beside its terms there


@dataclass(frozen=True)
class Block:
    """The constraint terms[0] + sum_i x_i terms[i + 1] <= 0 (or < 0 if strict) on symmetric k x k matrices."""

    name: str
    terms: Array  # (1 + N, k, k)
    strict: bool

    @property
    def order(self) -> int:
        """Number of rows k."""
        return int(self.terms.shape[-1])

    def at(self, x: Array) -> Array:
        """Value at a point x (N,)."""
        order = self.order
        return np.asarray(np.dot(with_one(x)[None], self.terms.reshape(len(x) + 1, -1)).reshape(order, order))

    def over(self, S: Array) -> "Block":
        """Same block over z, where (1, x) = S (1, z)."""
        terms = (S.T @ self.terms.reshape(len(self.terms), -1)).reshape(-1, self.order, self.order)
        return Block(self.name, terms, self.strict)

    def rows(self, keep: Array) -> "Block":
        """Same block with only the rows and columns that `keep` (a mask) selects."""
        return Block(self.name, self.terms[:, keep][:, :, keep], self.strict)

    def scaled(self, d: Array) -> "Block":
        """diag(d) F diag(d)."""
        return Block(self.name, self.terms * (d[:, None] * d), self.strict)

    def congruent(self, N: Array) -> "Block":
        """N' F N."""
        return Block(self.name, N.T @ self.terms @ N, self.strict)


@dataclass(frozen=True)
class Program:
    """Minimise cost' x + constant subject to the blocks."""

    cost: Array  # (N,)
    constant: float
    blocks: tuple[Block, ...]


@cache
def places(orders: tuple[int, ...]) -> tuple[Array, Array]:
    """Row and column of each column of `flat`, the rows of all blocks numbered one after the other."""
    firsts = (0, *accumulate(orders))
    pairs = [np.indices((order, order)).reshape(2, -1) + first for order, first in zip(orders, firsts, strict=False)]
    row, column = np.concatenate([np.zeros((2, 0), dtype=int), *pairs], axis=1)
    return row, column


def flat(blocks: Sequence[Block]) -> Iterator[Array]:
    """Terms of all blocks side by side, (1 + N, sum of k^2), in parts that are looked at together.

    Many small blocks are looked at as quickly so as one.
    """
    together = sum(block.terms.size for block in blocks) < TOGETHER
    for group in [blocks] if together and blocks else [[block] for block in blocks]:
        parts = [block.terms.reshape(len(block.terms), -1) for block in group]
        yield np.concatenate(parts, axis=1) if len(parts) > 1 else parts[0]


def entries(blocks: Sequence[Block]) -> tuple[Array, Array, Array, Array]:
    """Term, row and column, as in `places`, and size of each entry of some blocks that is not zero."""
    row, column = places(tuple(block.order for block in blocks))
    terms, at, sizes, first = [], [], [], 0
    for part in flat(blocks):
        found = np.flatnonzero(part != 0)  # many times as fast as a search by two indices
        term, place = np.divmod(found, part.shape[1])
        terms.append(term)
        at.append(first + place)
        sizes.append(np.abs(part.ravel()[found]))
        first += part.shape[1]
    where = np.concatenate(at)
    return np.concatenate(terms), row[where], column[where], np.concatenate(sizes)


def with_one(x: Array) -> Array:
    """Weights (1, x) of the terms of a block."""
    weights = np.ones(len(x) + 1)
    weights[1:] = x
    return weights


def split(whole: Array, ends: Iterable[int]) -> list[Array]:
    """Parts of a vector, each up to its end."""
    return [whole[start:end] for start, end in pairwise((0, *ends))]


def coordinates(unknowns: Sequence[Unknown], values: Values) -> Array:
    """Stack the coordinates (..., N) of all unknowns."""
    return np.concatenate([u.pack(values[u.name]) for u in unknowns], axis=-1)


def matrices(unknowns: Sequence[Unknown], x: Array) -> dict[str, Array]:
    """Unknowns as matrices, from coordinates x (..., N)."""
    edges = np.cumsum([0, *(u.size for u in unknowns)])
    return {u.name: u.unpack(x[..., a:b]) for u, a, b in zip(unknowns, edges, edges[1:], strict=False)}


def probe(problem: Problem) -> Program:
    """Evaluate a formula at zero and far out along every basis element at once, and check that it is affine.

    Raises `ArithmeticError` if superposition fails at a random point: the formula is not affine in its unknowns (a
    defect); `UndecidedError` if it has too many unknowns, or its data are beyond about 1e240.
    """
    size = sum(u.size for u in problem.unknowns)
    if size > MOST:
        said = f"the inequality has {size:,} scalar unknowns, and at most {MOST:,} fit in memory: take fewer states"
        raise UndecidedError(said, id="OBS908")
    witness = np.random.default_rng(0).standard_normal(size)
    points = matrices(problem.unknowns, np.vstack([np.zeros(size), FAR * np.eye(size), witness]))
    with np.errstate(over="ignore", invalid="ignore"):
        inequalities = problem.inequalities(points)
    entries = (size + 2) * sum(inequality.matrix.shape[-1] ** 2 for inequality in inequalities)
    groups = [inequalities] if entries < TOGETHER else [[inequality] for inequality in inequalities]
    blocks = tuple(block for group in groups for block in affine(group, witness))
    cost, constant = np.zeros(size), 0.0
    if problem.minimise:
        objective = np.broadcast_to(problem.minimise(points), (size + 2, 1, 1))[:, 0, 0]
        cost, constant = (objective[1:-1] - objective[0]) / FAR, float(objective[0])
    return Program(cost, constant, blocks)


def affine(inequalities: Sequence[Inequality], witness: Array) -> Iterator[Block]:
    """Terms of inequalities from their values at zero, far out along every basis element, and at a random point.

    Raises as `probe`.
    """
    count, orders = len(witness) + 2, [inequality.matrix.shape[-1] for inequality in inequalities]
    flat = [np.broadcast_to(i.matrix, (count, *i.matrix.shape[-2:])).reshape(count, -1) for i in inequalities]
    values = np.concatenate(flat, axis=1) if len(flat) > 1 else flat[0] if flat else np.zeros((count, 0))
    edges = [0, *accumulate(order * order for order in orders)]
    finite = np.asarray(np.isfinite(values).all(axis=0))
    if not finite.all():
        name = next(i.name for i, (a, b) in zip(inequalities, pairwise(edges), strict=True) if not finite[a:b].all())
        raise UndecidedError(f"the numbers in {name!r} are too large for doubles: choose other units", id="OBS508")
    terms = values[:-1] - values[0]
    terms /= FAR
    terms[0] = values[0]
    expected, found = with_one(witness) @ terms, values[-1]
    some = [k for k, order in enumerate(orders) if order]
    seen = np.abs(np.stack([expected - found, expected, found]))
    off, *sizes = np.maximum.reduceat(seen, [edges[k] for k in some], axis=1) if some else seen
    wrong = np.flatnonzero(off > 1e-9 * np.sum(sizes, axis=0))
    if len(wrong):
        raise ArithmeticError(f"the inequality {inequalities[some[wrong[0]]].name!r} is not affine in its unknowns")
    for inequality, order, (a, b) in zip(inequalities, orders, pairwise(edges), strict=True):
        own = np.ascontiguousarray(terms[:, a:b]).reshape(len(terms), order, order)
        yield Block(inequality.name, own, inequality.strict)
