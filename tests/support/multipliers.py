"""Multipliers of the library, and the forms that they make."""

import numpy as np

from obsdesign.lmi.formula import Problem, in_floats, rational, rational_number, symmetric
from obsdesign.lmi.probe import coordinates
from obsdesign.lmi.probe import matrices as matrices_of
from obsdesign.lmi.solve import Status, reduction, widest
from obsdesign.nonlinearities import TEMPLATES

ROTATION = [[0, -1], [1, 0]]


def exactly(*numbers):
    """Rationals."""
    return tuple(rational_number(x) for x in numbers)


def matrices(*listed):
    """Rational matrices."""
    return [rational(matrix) for matrix in listed]


def made(template, data, nq=1, nf=1):
    """Multiplier of a type."""
    return TEMPLATES[template](data, nq, nf)


def assembled(multiplier, v):
    """M in the order (q, f)."""
    M11, M12, M22 = multiplier.matrix(v)
    return symmetric([[M11, M12], [M22]])


def difference(f, q1, q2):
    """(dq, df) at two arguments."""
    return np.concatenate([q1 - q2, np.atleast_1d(f(q1)) - np.atleast_1d(f(q2))])


def form(M, d):
    """Incremental quadratic form, relative to its largest term."""
    terms = d[:, None] * M * d
    return terms.sum() / max(np.abs(terms).max(), 1e-300)


def smallest(multipliers, f, nq, span=3.0, pairs=400):
    """Smallest relative value of several forms over many pairs of arguments, half of them close."""
    rng = np.random.default_rng(0)
    q1 = rng.uniform(-span, span, (pairs, nq))
    step = rng.uniform(-span, span, (pairs, nq)) * np.where(np.arange(pairs) % 2, 1.0, 1e-3)[:, None]
    differences = [difference(f, a, a + b) for a, b in zip(q1, step, strict=True)]
    return min(form(M, d) for M in multipliers for d in differences)


def edge(multiplier, draws=40):
    """Multipliers at the edge of the set, of unit size: shots in random directions from points inside (hit and run)."""
    multiplier, rng = in_floats(multiplier), np.random.default_rng(0)
    problem = Problem(multiplier.unknowns(), multiplier.inequalities)
    reduced = reduction(problem)
    inside = widest(problem)
    assert inside.status is Status.OPTIMAL
    z = coordinates(problem.unknowns, inside.values)[reduced.free]
    found = []
    for _ in range(draws):
        step = rng.standard_normal(z.shape) * np.linalg.norm(z)
        reach = (1 - 1e-6) * min([10.0, *(farthest(block.at(z), block.at(step)) for block in reduced.program.blocks)])
        M = assembled(multiplier, matrices_of(problem.unknowns, reduced.point(z + reach * step)))
        found.append(M / max(np.abs(M).max(), 1e-300))
        z = z + rng.uniform(0.2, 0.8) * reach * step
        z /= np.linalg.norm(z)
    return found


def farthest(F, G):
    """Largest s with F + s G <= 0, where F < 0."""
    half = np.linalg.inv(np.linalg.cholesky(-F))
    rate = np.linalg.eigvalsh(half @ G @ half.T)[-1]
    return 1 / rate if rate > 0 else np.inf
