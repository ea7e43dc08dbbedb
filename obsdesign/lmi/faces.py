"""Search for the multipliers of a refutation: a solver proposes them, and `farkas` decides.

The multipliers for which the unknowns cancel are a linear space with a rational basis. A semidefinite program finds the
one of widest margin in the cone, and its coordinates, rounded, are exact multipliers. If the margin is zero, the
multipliers are restricted to a face of the cone, Z = V S V', with the null vectors of the solver's Z read as simple
fractions, until S is well inside. (An observer inequality has such null vectors as a rule: its multipliers vanish on
what the output shows.) A wrong guess does no harm, since the result is decided exactly.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from flint import fmpq

from obsdesign.lmi.farkas import MOST, Constraint, Refutation, constraints, decided, null_space
from obsdesign.lmi.formula import Array, Unknown, rational, rational_number, zeros
from obsdesign.lmi.probe import Block, Program
from obsdesign.lmi.proof import Formula, with_digits
from obsdesign.lmi.reduce import power_of_two
from obsdesign.lmi.solvers import Solver, call
from obsdesign.records import dataclass, replace

DIGITS = (2, 4, 8, 12)  # of the multipliers
SWEEPS = 6  # scalings in which a center is computed
SPREAD = 1e-2  # largest ratio of diagonal entries that one rescaling takes away
NOISE = 1e-6  # a largest smallest eigenvalue further below zero means that only zero is in the cone
EDGE = 1e-6  # an eigenvalue below this counts as zero
ROUNDING = 1e-11  # relative size of what is rounding only
NEAR = (1e-2, 1e-3, 1e-5)  # distances within which an entry of a null vector is read as a fraction
FACES = 24  # of the cone that are tried
LARGEST = 600  # coordinates of the multipliers of a problem that is attempted


def refutation(formula: Formula, unknowns: Sequence[Unknown], solver: str = "clarabel") -> Refutation | None:
    """Look for exact multipliers that refute inequalities.

    `formula`, `unknowns`: as for `check`.

    Returns None if none was found: the inequalities have a solution, or no certificate of this kind with rational
    faces.
    """
    if sum(u.size for u in unknowns) > MOST:
        return None
    given = constraints(formula, unknowns)
    if sum(len(c.vanishing) * (len(c.vanishing) + 1) // 2 for c in given) > LARGEST:
        return None
    faces = [Cone(given, tuple(rational(np.eye(len(c.vanishing))[:, ~c.vanishing]) for c in given))]
    for _ in range(FACES):
        if not faces:
            break
        cone, space = faces.pop().narrowed()
        tried = []
        for center in centers(cone, space, call(solver)):
            tried.append(center)
            for digits in DIGITS if center.margin > 0 else ():
                made = decided(given, cone.multipliers(with_digits(center.y, digits) @ space))
                if made.holds:
                    return made
        faces += [face for face in smaller(cone, tried) if face.order < cone.order]
    return None


def smaller(cone: "Cone", centers: Sequence["Center"]) -> "Iterator[Cone]":
    """Faces that some multipliers lie near, the most likely last."""
    if centers:
        clearest, last = max(centers, key=lambda center: center.gap), centers[-1]
        for center in dict.fromkeys((last, clearest)):
            for near in reversed(NEAR):
                yield cone.face(center, near)


@dataclass(frozen=True)
class Cone:
    """Multipliers V_j S_j V_j' + W_j with S_j >= 0, and any symmetric W_j in the rows of F_j that vanish."""

    given: tuple[Constraint, ...]
    ranges: tuple[Array, ...]  # V_j, (k, r), zero in the rows that vanish

    @cached_property
    def free(self) -> list[tuple[Array, Array]]:
        """Row and column indices of the coordinates of each W."""
        found = []
        for c in self.given:
            row, column = np.triu_indices(len(c.vanishing))
            kept = c.vanishing[row] | c.vanishing[column]
            found.append((row[kept], column[kept]))
        return found

    @property
    def sizes(self) -> list[int]:
        """Numbers of coordinates: of each S, then of each W."""
        orders = [V.shape[1] for V in self.ranges]
        return [r * (r + 1) // 2 for r in orders] + [len(row) for row, _ in self.free]

    def space(self) -> Array:
        """Rational basis, as rows of coordinates, of the multipliers for which the unknowns cancel."""
        pairs = zip(self.given, self.ranges, strict=True)
        columns = [weighted(V.T @ c.terms @ V, *np.triu_indices(V.shape[1])) for c, V in pairs]
        columns += [weighted(c.terms, *free) for c, free in zip(self.given, self.free, strict=True)]
        return null_space(np.concatenate(columns, axis=1))

    def parts(self, coordinates: Array) -> list[Array]:
        """All S, then all W, from coordinates (.., sum of sizes)."""
        parts = np.split(coordinates, np.cumsum(self.sizes)[:-1], axis=-1)
        S = [scattered(x, V.shape[1], *np.triu_indices(V.shape[1])) for x, V in zip(parts, self.ranges, strict=False)]
        free = zip(parts[len(S) :], self.given, self.free, strict=True)
        return S + [scattered(x, len(c.vanishing), *place) for x, c, place in free]

    def multipliers(self, coordinates: Array) -> dict[str, Array]:
        """Z of each inequality."""
        parts, count = self.parts(coordinates), len(self.given)
        rows = zip(self.given, self.ranges, parts[:count], parts[count:], strict=True)
        return {c.name: V @ S @ V.T + W for c, V, S, W in rows}

    def narrowed(self) -> "tuple[Cone, Array]":
        """Same multipliers without the null vectors that all S of the space have in common, and the space."""
        cone, space = self, self.space()
        while True:
            S = cone.parts(space)[: len(cone.given)]
            common = [null_space(s.reshape(len(s) * s.shape[-1], s.shape[-1])) for s in S]
            if not any(len(null) for null in common):
                return cone, space
            cone = Cone(cone.given, tuple(V @ null_space(null).T for V, null in zip(cone.ranges, common, strict=True)))
            space = cone.space()

    def face(self, center: "Center", near: float) -> "Cone":
        """Face that the multipliers at a center lie near, where null vectors are read as fractions so near."""
        edges = zip(self.ranges, center.scaled, center.scales, strict=True)
        return Cone(self.given, tuple(V @ range_of(S, scale, near) for V, S, scale in edges))

    @property
    def order(self) -> int:
        """Rows of all S."""
        return sum(V.shape[1] for V in self.ranges)


def weighted(terms: Array, row: Array, column: Array) -> Array:
    """Coefficients of the entries (row, column) of a symmetric Z in <terms, Z>."""
    return np.asarray(terms[:, row, column] * np.where(row == column, fmpq(1), fmpq(2)))


def scattered(entries: Array, order: int, row: Array, column: Array) -> Array:
    """Symmetric matrix (.., order, order) with the given entries, and zeros elsewhere."""
    matrix = zeros((*entries.shape[:-1], order, order), like=[entries])
    matrix[..., row, column] = entries
    matrix[..., column, row] = entries
    return matrix


@dataclass(frozen=True, eq=False)
class Center:
    """Multipliers of mean eigenvalue 1 whose smallest eigenvalue is largest, in some scaling of the S_j."""

    y: Array  # coordinates in the space
    margin: float  # the eigenvalue
    scaled: tuple[Array, ...]  # D_j S_j D_j
    scales: tuple[Array, ...]  # diagonals of D_j

    @property
    def gap(self) -> float:
        """Smallest eigenvalue that counts, over the largest that counts as zero."""
        values = np.concatenate([np.linalg.eigvalsh(S) for S in self.scaled])
        zero = np.abs(values[values <= EDGE]).max(initial=np.finfo(float).eps)
        return float(values[values > EDGE].min(initial=1.0) / zero)

    def rescaled(self) -> tuple[Array, ...]:
        """Scales that take diagonals nearer to 1; an entry counts as no smaller than `SPREAD` times the largest."""
        largest = [max(float(np.diag(S).max(initial=0)), SPREAD) for S in self.scaled]
        return tuple(
            d / power_of_two(np.sqrt(np.maximum(np.diag(S), SPREAD * size)))
            for d, S, size in zip(self.scales, self.scaled, largest, strict=True)
        )


def centers(cone: Cone, space: Array, solver: Solver) -> Iterator[Center]:
    """Centers of a space of multipliers, each in the scaling of the last; none if only zero is in the cone."""
    parts = cone.parts(space.astype(float))[: len(cone.given)]
    lengths = power_of_two(np.max([np.abs(S).max(axis=(1, 2), initial=0) for S in parts], axis=0))  # of any size so far
    parts = [S / lengths[:, None, None] for S in parts]
    scales = tuple(np.ones(S.shape[-1]) for S in parts)
    for _ in range(SWEEPS):
        center = centered(parts, scales, solver)
        if center is None or center.margin < -NOISE:
            return
        yield replace(center, y=center.y / lengths)
        scales = center.rescaled()


def centered(parts: Sequence[Array], scales: tuple[Array, ...], solver: Solver) -> Center | None:
    """Center of a space of multipliers in given scales, in doubles; None if it has no point of trace 1 at all.

    `parts`: for each inequality, its S at each element of the basis of the space, (K, r, r).
    """
    scaled = [S * np.outer(d, d) for S, d in zip(parts, scales, strict=True)]
    flat = np.concatenate([S.reshape(len(S), S.shape[-1] ** 2) for S in scaled], axis=1)
    if not flat.any():
        return None
    lengths = power_of_two(np.abs(flat).max(axis=1))[:, None]  # or else what is small beside others would be rounding
    U, sizes, _ = np.linalg.svd(flat / lengths, full_matrices=False)
    kept = sizes > ROUNDING * sizes[0]
    T = U[:, kept] / sizes[kept] / lengths  # y = T z, z orthonormal
    basis = [np.tensordot(T.T, S, axes=1) for S in scaled]
    traces = np.asarray(sum(np.trace(S, axis1=1, axis2=2) for S in basis))
    if np.linalg.norm(traces) <= ROUNDING:
        return None
    # z = first + others u has the trace that was asked for
    first = traces * sum(S.shape[-1] for S in basis) / (traces @ traces)
    others = np.linalg.svd(traces[None])[2][1:]
    blocks = [
        Block(
            "S >= t I",
            -np.concatenate([np.tensordot(np.vstack([first, others]), S, axes=1), -np.eye(S.shape[-1])[None]]),
            strict=False,
        )
        for S in basis
        if S.shape[-1]
    ]
    _, x, _ = solver(Program(np.append(np.zeros(len(others)), -1.0), 0.0, tuple(blocks)))
    if not np.isfinite(x).all():
        return None
    z = first + x[:-1] @ others
    return Center(T @ z, float(x[-1]), tuple(np.tensordot(z, S, axes=1) for S in basis), scales)


def range_of(S: Array, scale: Array, near: float) -> Array:
    """Rational basis, as columns, of the range of S at the edge of the cone, whose null vectors are simple.

    `S`, `scale`: D S D in doubles, of a size near 1, and the diagonal of D; `near`: distance within which an entry of a
    null vector is read as a fraction.
    """
    values, vectors = np.linalg.eigh(S)
    null = scale[:, None] * vectors[:, values <= EDGE]
    rows = echelon((null / np.linalg.norm(null, axis=0)).T)
    return null_space(np.vectorize(lambda x: simplest(float(x), near), otypes=[object])(rows)).T


def echelon(rows: Array) -> Array:
    """Reduced echelon form of independent rows with complete pivoting: entries at most about 1."""
    E = rows.copy()
    for i in range(len(E)):
        rest = np.abs(E[i:])
        a, j = divmod(int(rest.argmax()), rest.shape[1])
        E[[i, i + a]] = E[[i + a, i]]
        E[i] /= E[i, j]
        E[np.arange(len(E)) != i] -= np.delete(E[:, j], i)[:, None] * E[i]
    return E


def simplest(value: float, near: float) -> fmpq:
    """Fraction of the smallest denominator within a relative distance; zero for a number smaller than that."""
    if abs(value) < near:
        return fmpq(0)
    size = rational_number(abs(value))
    found = between(size * (1 - rational_number(near)), size * (1 + rational_number(near)))
    return found if value > 0 else -found


def between(low: fmpq, high: fmpq) -> fmpq:
    """Fraction of the smallest denominator in an interval of positive numbers, by continued fractions."""
    whole = low.ceil()
    if whole <= high:
        return fmpq(whole)
    below = low.floor()
    return below + 1 / between(1 / (high - below), 1 / (low - below))
