"""Third reading of a formula: in rationals, where the sign of a matrix is a fact. No solver takes part."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from flint import fmpq, fmpq_mat

from obsdesign.lmi.dominance import definite
from obsdesign.lmi.formula import Array, Inequality, Unknown, Values, approximate, decimal_number, rational
from obsdesign.lmi.probe import coordinates, matrices
from obsdesign.records import dataclass

Formula = Callable[[Values], Sequence[Inequality]]


@dataclass(frozen=True)
class Check:
    """One condition of a certificate.

    `margin` is the distance from the edge, in doubles and only for the reader: for a matrix the smallest eigenvalue of
    -F with its rows scaled to a unit diagonal (rows that must vanish left out), for a number the number itself; minus
    infinity where doubles do not reach.
    """

    name: str
    holds: bool
    margin: float


class Proved:
    """What holds if every condition that was checked of it does."""

    if TYPE_CHECKING:

        @property
        def checks(self) -> tuple[Check, ...]:
            """The conditions."""

    @property
    def holds(self) -> bool:
        """Whether it is proved."""
        return all(check.holds for check in self.checks)


def prove(inequalities: Sequence[Inequality]) -> tuple[Check, ...]:
    """Decide every inequality exactly.

    Raises `TypeError`: an entry is no rational: what a double stands for is known up to rounding only, so that nothing
    of it is a proof (a defect of the caller).
    """
    return tuple(Check(i.name, holds(i), margin(i.matrix)) for i in inequalities)


def holds(inequality: Inequality) -> bool:
    """Whether the matrix is negative semidefinite, or definite if the inequality is strict.

    By dominance where that decides, by an exact factorisation elsewhere. Raises `TypeError`: an entry is no rational.
    """
    require_rational(inequality)
    S = -inequality.matrix
    if (S != S.T).any():
        return False
    if not inequality.strict:
        kept = (S != 0).any(axis=0)
        S = S[kept][:, kept]
    if definite(S):
        return True
    if refuted(S):
        return False
    signs = pivots(S)
    return signs is not None and (min(signs, default=1) > 0 or not inequality.strict)


def refuted(S: Array) -> bool:
    """Whether some x is found with x' S x < 0, in rationals; an exact factorisation of a large matrix takes minutes.

    x is the eigenvector of the smallest eigenvalue in doubles, of S with a unit diagonal.
    """
    A = np.vectorize(approximate, otypes=[float])(S)
    if not len(S) or not np.isfinite(A).all():
        return False
    size = np.sqrt(np.abs(np.diag(A)))
    scale = 1 / np.where(size > 0, size, 1.0)
    with np.errstate(all="ignore"):
        scaled = scale[:, None] * A * scale
    if not np.isfinite(scaled).all():
        return False
    x = np.linalg.eigh(scaled)[1][:, 0] * scale
    if not np.isfinite(x).all():
        return False
    exact = fmpq_mat(rational(x[:, None]).tolist())
    return bool((exact.transpose() * fmpq_mat(S.tolist()) * exact)[0, 0] < 0)


def require_rational(inequality: Inequality) -> None:
    """Refuse a matrix with an entry that is no rational."""
    if all(isinstance(entry, fmpq) for entry in inequality.matrix.flat):
        return
    for place, entry in np.ndenumerate(inequality.matrix):
        if not isinstance(entry, fmpq):
            where = ", ".join(str(i + 1) for i in place)
            raise TypeError(
                f"the proof of {inequality.name!r} takes rationals only, and the entry at ({where}) is {entry!r}, "
                f"of type {type(entry).__name__}"
            )


def pivots(matrix: Array) -> list[int] | None:
    """Signs (0 or 1) of D in the exact factorisation L D L' of a symmetric matrix; None if it is not >= 0.

    Without pivoting: a zero on the diagonal of a semidefinite matrix makes its row zero.
    """
    S = matrix.copy()
    signs = []
    for k in range(len(S)):
        d, column = S[k, k], S[k + 1 :, k]
        if d < 0 or (d == 0 and (column != 0).any()):
            return None
        signs.append(int(d > 0))
        if d > 0:
            S[k + 1 :, k + 1 :] -= np.outer(column / d, column)
    return signs


def margin(matrix: Array) -> float:
    """Smallest eigenvalue of -F scaled to a unit diagonal, without rows that are zero."""
    S = -np.vectorize(approximate, otypes=[float])(matrix)
    if not np.isfinite(S).all():
        return -np.inf
    if len(S) == 1:
        return float(S[0, 0])
    S = S[:, S.any(axis=0)][S.any(axis=1)]
    least = max(1e-15 * np.abs(S).max(initial=0), np.finfo(float).tiny)
    scale = 1 / np.sqrt(np.maximum(np.abs(np.diag(S)), least))
    S = scale[:, None] * S * scale  # from the left, so that no product of two scales overflows
    return float(np.linalg.eigvalsh(S).min(initial=np.inf)) if len(S) else 0.0


def rounded(values: Values, digits: int) -> dict[str, Array]:
    """Rationals of the values at so many significant decimal digits."""
    return {name: with_digits(matrix, digits) for name, matrix in values.items()}


def with_digits(matrix: Array, digits: int) -> Array:
    """Rationals of a matrix at so many significant decimal digits."""
    return np.asarray(np.vectorize(lambda x: decimal_number(f"{x:.{digits}g}"), otypes=[object])(matrix))


def complete(
    formula: Formula,
    unknowns: Sequence[Unknown],
    values: Values,
    rows: Sequence[tuple[str, int]],
    pivots: Sequence[int],
) -> dict[str, Array]:
    """Move the pivot coordinates so that the given rows of the inequalities vanish exactly.

    `formula`, `unknowns`, `values`: the inequalities in rationals, their unknowns and a point that nearly satisfies the
    equalities; `rows`, `pivots`: what `reduce` found in doubles: (inequality, row) pairs that must vanish, and the
    coordinates they determine.
    """
    x = coordinates(unknowns, values)
    if not pivots:
        return dict(values)

    def residual(point: Array) -> Array:
        by_name = {i.name: i.matrix for i in formula(matrices(unknowns, point))}
        return np.concatenate([by_name[name][row] for name, row in rows])

    at = residual(x)
    J = np.stack([residual(x + unit) - at for unit in rational(np.eye(len(x))[list(pivots)])], axis=1)
    J, r = fmpq_mat(J.tolist()), fmpq_mat([[v] for v in at])
    step = (J.transpose() * J).solve(-(J.transpose() * r))
    for j, d in zip(pivots, step.entries(), strict=True):
        x[j] += d
    return matrices(unknowns, x)
