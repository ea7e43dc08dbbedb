"""Exact proofs that linear matrix inequalities have no solution; no solver takes part.

Let F_j(x) = A0_j + sum_i x_i Ai_j <= 0 (< 0 where strict) be the inequalities. Symmetric multipliers Z_j >= 0 with

    sum_j <Ai_j, Z_j> = 0 for every i,    c = sum_j <A0_j, Z_j> >= 0,    c > 0 or Z_j != 0 for a strict F_j,

refute them: at a solution, sum_j <F_j(x), Z_j> = c >= 0, although no term is positive, and the term of a strict F_j
with Z_j != 0 is negative.

A diagonal entry of F_j that is zero for every x makes its row zero wherever F_j <= 0, so these rows of Z_j may have
any sign; and so on with the diagonal entries that are zero wherever these rows vanish. Without that, observer
inequalities with a monotone nonlinearity have no certificate, because they hold up to any residual that is not zero.

In what follows the constant part has a factor s of its own, with s > 0: then c is the multiplier of that inequality.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat

from obsdesign.errors import UndecidedError
from obsdesign.lmi.formula import Array, Inequality, Unknown, approximate, identity, product, rational, zeros
from obsdesign.lmi.probe import matrices
from obsdesign.lmi.proof import Check, Formula, Proved, holds
from obsdesign.records import dataclass, replace

KIND = "farkas"
MOST = 2400  # scalar unknowns of inequalities that are read: each has a matrix of rationals
CONSTANT = "1 > 0"  # the inequality s > 0, whose multiplier is c


@dataclass(frozen=True)
class Constraint:
    """One inequality sum_i x_i terms[i] <= 0 (or < 0), homogeneous in x, with x_0 = s."""

    name: str
    terms: Array  # (1 + N, k, k) in rationals
    strict: bool
    vanishing: Array  # (k,), rows that are zero at every solution

    def combination(self, Z: Array) -> Array:
        """<terms[i], Z> for every i."""
        return np.asarray(self.flat @ Z.ravel())

    @property
    def flat(self) -> Array:
        """Terms as rows, (1 + N, k^2)."""
        return self.terms.reshape(len(self.terms), -1)


@dataclass(frozen=True)
class Refutation(Proved):
    """Multipliers that prove that inequalities have no solution, by name, and what was checked of them."""

    multipliers: Mapping[str, Array]  # rational
    checks: tuple[Check, ...]

    def written(self) -> dict[str, Any]:
        """What a file holds: {"kind": KIND, "multipliers": {name: rows of "p/q"}, "checks": [..]}."""
        return {
            "kind": KIND,
            "multipliers": {name: [[str(z) for z in row] for row in Z] for name, Z in self.multipliers.items()},
            "checks": [{"name": c.name, "holds": c.holds} for c in self.checks],
        }


def constraints(formula: Formula, unknowns: Sequence[Unknown]) -> tuple[Constraint, ...]:
    """Read inequalities in rationals, made homogeneous, with the rows that must vanish.

    Raises `UndecidedError`: they have too many unknowns.
    """
    size = sum(u.size for u in unknowns)
    if size > MOST:
        said = f"the inequalities have {size:,} scalar unknowns, and at most {MOST:,} are read exactly"
        raise UndecidedError(said, id="OBS908")
    points = matrices(unknowns, rational(np.vstack([np.zeros(size), np.eye(size)])))
    read = []
    for inequality in formula(points):
        value = np.broadcast_to(inequality.matrix, (size + 1, *inequality.matrix.shape[-2:])).copy()
        value[1:] -= value[0]
        read.append(Constraint(inequality.name, value, inequality.strict, np.zeros(value.shape[-1], dtype=bool)))
    s = zeros((size + 1, 1, 1), like=[rational([[1]])])
    s[0] = fmpq(-1)
    return with_vanishing_rows((*read, Constraint(CONSTANT, s, True, np.zeros(1, dtype=bool))))


def with_vanishing_rows(given: tuple[Constraint, ...]) -> tuple[Constraint, ...]:
    """Mark the rows whose diagonal entry is zero for every x, then for every x at which these vanish, and so on."""
    found = list(given)
    basis = rational(np.eye(len(given[0].terms)))  # of the x at which the rows found so far vanish, as rows
    while True:
        rows = []
        for i, c in enumerate(found):
            if c.strict:
                continue
            inside = product(basis, c.flat).reshape(-1, *c.terms.shape[1:])
            zero = (inside.diagonal(axis1=1, axis2=2) == 0).all(axis=0) & ~c.vanishing
            if zero.any():
                rows.append(inside[:, zero].reshape(len(basis), -1))
                found[i] = replace(c, vanishing=c.vanishing | zero)
        if not rows:
            return tuple(found)
        basis = product(null_space(np.concatenate(rows, axis=1).T), basis)


def check(formula: Formula, unknowns: Sequence[Unknown], multipliers: Mapping[str, Array]) -> Refutation:
    """Decide exactly whether given multipliers refute the inequalities; no solver takes part.

    `formula`, `unknowns`: the inequalities, affine in the unknowns, to be evaluated in rationals; `multipliers`: a
    symmetric rational matrix for each inequality by name, and a 1x1 matrix c for "1 > 0"; what is missing is zero.
    """
    return decided(constraints(formula, unknowns), multipliers)


def decided(given: Sequence[Constraint], multipliers: Mapping[str, Array]) -> Refutation:
    """Decide it for inequalities that were read already."""
    shapes = {c.name: c.terms.shape[1:] for c in given}
    fits = set(multipliers) <= set(shapes) and all(Z.shape == shapes[name] for name, Z in multipliers.items())
    if not fits:
        return Refutation(multipliers, (Check("a multiplier for each inequality", False, -np.inf),))
    Z = {c.name: multipliers.get(c.name, zeros(c.terms.shape[1:], like=[c.terms])) for c in given}
    sums = sum(c.combination(Z[c.name]) for c in given)
    strict = sum((sum(np.diag(Z[c.name])) for c in given if c.strict), fmpq(0))
    return Refutation(
        multipliers,
        (
            Check("the unknowns cancel", not np.any(sums), 0.0),
            *(nonnegative(c, Z[c.name]) for c in given),
            Check("a strict inequality has Z != 0", bool(strict > 0), approximate(strict)),
        ),
    )


def nonnegative(c: Constraint, Z: Array) -> Check:
    """Whether a multiplier is symmetric, and positive semidefinite in the rows that need not vanish."""
    kept = Inequality(c.name, -Z[~c.vanishing][:, ~c.vanishing])
    return Check(f"Z >= 0 for {c.name}", bool((Z == Z.T).all()) and holds(kept), 0.0)


def null_space(matrix: Array) -> Array:
    """Rational basis of {u : matrix u = 0}, as rows."""
    size = matrix.shape[1]
    if not len(matrix):
        return identity(size, matrix)
    reduced, rank = fmpq_mat(*matrix.shape, matrix.ravel().tolist()).rref()
    rows = np.array(reduced.entries(), dtype=object).reshape(matrix.shape)[:rank]
    pivots = [int(np.flatnonzero(row != 0)[0]) for row in rows]
    free = np.setdiff1d(np.arange(size), pivots)
    basis = zeros((len(free), size), [matrix])
    basis[np.arange(len(free)), free] = fmpq(1)
    basis[:, pivots] = -rows[:, free].T
    return basis
