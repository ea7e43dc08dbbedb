"""What the cuts of a search over scales allow: held against cuts of known functions and another solver of programs."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import linprog

from obsdesign.riccati.cuts import BOX, Cuts
from obsdesign.riccati.equation import Signal


def sizes(spread):
    """Sizes within so many powers of ten of 1."""
    return st.floats(-spread, spread).map(lambda power: 10**power)


@st.composite
def tangents(draw, spread=3, nearest=0.0):
    """Tangents of the convex mu = sum (a_j lambda_j + b_j / lambda_j) at some points, their scales and a, b.

    `spread`: of a and b; `nearest`: how near to those of the least mu the scales come, in powers of ten.
    """
    k = draw(st.integers(1, 4))
    a, b = (np.array([draw(sizes(spread)) for _ in range(k)]) for _ in "ab")
    away = st.floats(nearest, 2) | st.floats(-2, -nearest)
    cuts = Cuts()
    for _ in range(draw(st.integers(1, 8))):
        scales = np.sqrt(b / a) * np.array([10 ** draw(away) for _ in range(k)])
        supplied = draw(sizes(3))
        slopes, value = a - b / scales**2, float(np.sum(a * scales + b / scales))
        cuts.add(Signal(value * supplied, supplied, 0.0, slopes * supplied), scales)
    return cuts, a, b, scales


@given(tangents())
def test_the_least_mu_of_all_cuts_is_a_lower_bound(drawn):
    cuts, a, b, scales = drawn
    mu = float(np.sum(a * scales + b / scales))
    assert cuts.lower(scales, mu) <= 2 * np.sum(np.sqrt(a * b)) + 1e-8 * mu


@given(tangents(spread=1, nearest=0.05))  # slopes that are zero but for rounding are taken for zero by one solver only
def test_the_least_mu_of_all_cuts_is_the_one_of_another_solver(drawn):
    cuts, a, b, scales = drawn
    mu = float(np.sum(a * scales + b / scales))
    least = cuts.lower(scales, mu)
    rows, right = cuts.rows(scales, mu)
    theirs = linprog(np.eye(len(a) + 1)[-1], rows, right, bounds=[(0, None)] * (len(a) + 1), method="highs")
    assert least / mu == pytest.approx(theirs.fun, abs=1e-8)


@given(tangents(), st.floats(0.05, 0.95))
def test_the_nearest_scales_have_the_level_and_are_no_further_than_others(drawn, share):
    cuts, a, b, scales = drawn
    mu = float(np.sum(a * scales + b / scales))
    lower = cuts.lower(scales, mu)
    level = lower + share * (mu - lower)
    found = cuts.nearest(scales, mu, level)
    rows, right = cuts.rows(scales, mu)
    k = len(a)
    upper = right - rows[:, k] * level / mu
    bounds = [(1 / BOX, BOX)] * k
    inside = linprog(np.zeros(k), rows[:, :k], upper, bounds=bounds, method="highs")
    assume(inside.status in {0, 2})
    if found is None:
        assert inside.status == 2 or (upper - rows[:, :k] @ inside.x).min() < 1e-7
        return
    y = found / scales
    assert (rows[:, :k] @ y <= upper + 1e-7).all()
    assert (y >= 1 / BOX - 1e-7).all()
    assert (y <= BOX + 1e-7).all()
    if inside.status == 0:  # of a convex set, (y - 1) makes no sharp angle with any way to another point
        assert (y - 1) @ (inside.x - y) >= -1e-6 * (1 + abs(y - 1).max() ** 2 + abs(inside.x).max() ** 2)


@given(tangents())
def test_the_middle_has_the_most_room(drawn):
    cuts, a, b, scales = drawn
    mu = float(np.sum(a * scales + b / scales))
    middle = cuts.middle(scales, mu * (1 + 1e-3))
    if middle is None:  # between cuts that leave next to nothing
        assert cuts.lower(scales, mu) > mu * (1 - 1e-6)
        return
    assert cuts.allowed(middle) <= mu * (1 + 2e-3)


def test_cuts_that_leave_nothing_have_no_scales():
    cuts, one = Cuts(), np.ones(1)
    cuts.add(Signal(1.0, 0.0, 0.0, -one), one)  # 2 <= lambda
    cuts.add(Signal(1.0, 0.0, 0.0, one), one)  # lambda <= 0
    assert cuts.allowed(one) == np.inf
    assert cuts.middle(one, 1.0) is None
    assert cuts.nearest(one, 1.0, 1.0) is None


def test_a_flat_cut_leads_to_the_edge_of_what_is_near():
    cuts, one = Cuts(), np.ones(1)
    cuts.add(Signal(1.0, 1.0, 0.0, -1e-6 * one), one)  # 1 - 1e-6 (lambda - 1) <= mu
    assert cuts.lower(one, 1.0) == pytest.approx(0, abs=1e-9)
    assert cuts.nearest(one, 1.0, 0.99) is None
    assert cuts.lowest(one, 1.0) == pytest.approx([BOX])


def test_a_signal_that_is_no_number_says_nothing():
    cuts = Cuts()
    cuts.add(Signal(np.nan, 1.0, 0.0, np.ones(1)), np.ones(1))
    assert not list(cuts)
    assert cuts.allowed(np.ones(1)) == 0.0
