"""Functions f(q): some of the library in numpy, bounds on their slopes, and texts restricted to a region."""

import numpy as np

from obsdesign.expressions import parse
from obsdesign.lmi.formula import rational_number
from obsdesign.nonlinearities.evidence.restriction import Restriction

NAMES = ("q", "q1", "q2", "q3", "t", "y1", "a", "b")


def sat(q):
    """Saturation at 1."""
    return np.clip(q, -1, 1)


def bounds(*pairs):
    """Exact intervals; None has no upper end."""
    return [(rational_number(a), None if b is None else rational_number(b)) for a, b in pairs]


def within(*f, nq=1, **region):
    """f, given as texts, on a region."""
    return Restriction.of([parse(text, NAMES) for text in f], nq, {q: exact(*limits) for q, limits in region.items()})


def exact(*limits):
    """Limits as a spec has them."""
    return tuple(None if abs(x) == np.inf else rational_number(repr(x)) for x in limits)
