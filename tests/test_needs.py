"""What an expression needs: it has a value exactly where its needs hold, and a derivative only where the further do."""

import numpy as np
import pytest

from obsdesign.expressions import parse
from obsdesign.expressions.needs import further, needs

NAMES = ("x", "y")
HOLDS = {"is not 0": np.not_equal, ">= 0": np.greater_equal, "> 0": np.greater}
GRID = np.linspace(-2, 2, 41)
X, Y = (part.ravel() for part in np.meshgrid(GRID, GRID))
VALUES = [
    "1/x", "x**(-2)", "x**3", "sqrt(x) + log(y)", "asin(x)*acos(y)", "x**(1/3)", "x**(-1/3)", "1/(x - y)",
    "where(x > 0, log(x), y)", "where(x <= 0, sqrt(-x), 1/x)", "where(x - y, 1/(x - y), 0)", "where(y, 1, 1/x)",
    "where((x > 0)*(y > 1), log(x), 2)", "where(x >= 1, where(y < 0, log(-y), sqrt(y)), 1/(x - 1))", "1/(x - x)",
    "where(x == y, 0, 1/(y - x))", "where(x != 0, 1/x, 0)", "where(x > 0, 1/(y - y), 0)", "0**(-1) + x", "tan(x)",
    "where(x >= 1, log(x - 1), 0)", "where(x < y, sqrt(x - y), 0)", "where(x == y, sqrt(2*x - 2*y), 0)",
]  # fmt: skip


def holding(found):
    """Points of the grid at which needs hold, on the branches where they are looked at."""
    true = np.ones(X.shape, dtype=bool)
    for one in found:
        taken = [c.function(NAMES)(X, Y) != 0 for c in one.branch]
        true &= HOLDS[one.sign](one.value.function(NAMES)(X, Y), 0) | ~np.all([np.full(X.shape, True), *taken], axis=0)
    return true


@pytest.mark.parametrize("text", VALUES)
def test_an_expression_has_a_value_where_its_needs_hold(text):
    value = parse(text, NAMES)
    assert (np.isfinite(value.function(NAMES)(X, Y)) == holding(needs(value))).all()


def test_a_power_with_a_varying_exponent_may_have_a_value_elsewhere():
    value = parse("x**y", NAMES)
    (found,) = needs(value)
    assert np.isfinite(value.function(NAMES)(X, Y))[holding([found])].all()
    assert found.leaves == "whether x**y has a value"


@pytest.mark.parametrize("text", ["where(x > 0, 1/x, 2)", "where(x - y, 1/(x - y), 0)", "where(x >= 0, sqrt(x), 0)"])
def test_what_a_branch_says_is_no_need(text):
    assert all(one.branch for one in needs(parse(text, NAMES)))
    assert not needs(parse(text.replace("x - y", "x != y", 1), NAMES))


def test_a_part_that_is_on_two_branches_is_needed_where_one_is_taken():
    shared = parse("where(x > 1, z, where(y > 1, z, where(y < -1, 2*z, 3)))", ("x", "y", "z"))
    value = shared.substituted({"z": parse("sqrt(x + y)", NAMES)})
    assert (np.isfinite(value.function(NAMES)(X, Y)) == holding(needs(value))).all()
    everywhere = shared.substituted({"z": parse("sqrt(x)", NAMES)}) + parse("x", NAMES)
    assert needs(everywhere)[0].branch


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("sqrt(x)", X > 0),
        ("asin(x/2)", abs(X) < 2),
        ("x**(1/3)", X > 0),
        ("x**(4/3)", X >= 0),
        ("atan2(y, x)", (Y != 0) | (X > 0)),
        ("sin(x)*exp(y)", X > -3),
    ],
)
def test_a_root_an_arc_and_an_angle_have_derivatives_off_their_ends_and_cuts(text, where):
    value = parse(text, NAMES)
    assert (holding([*needs(value), *further(value)]) == where).all()
