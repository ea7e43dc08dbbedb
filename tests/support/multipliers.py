"""Multipliers of the library, and the forms that they make."""

import numpy as np

from obsdesign.lmi.formula import rational, rational_number, symmetric
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
