"""Identities between expressions: true ones are proved, false ones never are."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from obsdesign.expressions import ExpressionError, parse
from obsdesign.expressions.algebra import identical, simplified

NAMES = ("x", "y", "z")
TRUE = [
    ("(x + y)**2", "x**2 + 2*x*y + y**2"),
    ("1/(1 + 1/x)", "x/(x + 1)"),
    ("sin(x + y)", "sin(x)*cos(y) + cos(x)*sin(y)"),
    ("sin(x)**4 + cos(x)**4", "1 - 2*sin(x)**2*cos(x)**2"),
    ("sin(x/2)*cos(x/2)", "sin(x)/2"),
    ("tan(x)*cos(x)", "sin(x)"),
    ("exp(x/2 + y)**2", "exp(x)*exp(2*y)"),
    ("exp(x + log(y))", "y*exp(x)"),
    ("log(exp(x + y)*exp(-y))", "x"),
    ("tanh(x)", "(exp(2*x) - 1)/(exp(2*x) + 1)"),
    ("1/cosh(x)**2", "1 - tanh(x)**2"),
    ("sqrt(x/y)**2*y", "x"),
    ("x**1.5", "x*sqrt(x)"),
    ("abs(x - y)**2", "(x - y)**2"),
    ("sqrt(sin(x)**2)", "sqrt(1 - cos(x)**2)"),
]
FALSE = [
    ("x", "x + 1e-30"),
    ("sin(x)", "x"),
    ("exp(x)", "exp(x + 1e-12)"),
    ("sqrt(x**2)", "x"),
    ("log(x**2)", "log(x)"),
    ("abs(x)", "x"),
    ("sign(x)**2", "1"),
    ("atan2(x, y)", "atan2(y, x)"),
    ("max(x, y)", "x"),
]


@pytest.mark.parametrize(("a", "b"), TRUE)
def test_what_is_equal_is_proved(a, b):
    assert identical(parse(a, NAMES), parse(b, NAMES))


@pytest.mark.parametrize(("a", "b"), FALSE)
def test_what_is_not_equal_everywhere_is_not_proved(a, b):
    assert not identical(parse(a, NAMES), parse(b, NAMES))


def terms(depth):
    """Texts of expressions of x, y and z."""
    leaf = st.sampled_from(["x", "y", "z", "2", "0.5", "3"])
    if not depth:
        return leaf
    below = terms(depth - 1)
    return st.one_of(
        leaf,
        st.builds("({} {} {})".format, below, st.sampled_from("+-*/"), below),
        st.builds("{}({})".format, st.sampled_from(["sin", "cos", "exp", "tanh", "abs", "atan", "sqrt", "log"]), below),
        st.builds("({})**{}".format, below, st.sampled_from(["2", "3", "0.5"])),
    )


def read(text):
    """The expression of a text; what is no expression, as x/(2 - 2), is left out."""
    try:
        return parse(text, NAMES)
    except ExpressionError:
        assume(False)


def values(expression, points):
    """Values at points (3, N); NaN where there is none."""
    return expression.function(NAMES)(*points)


@given(terms(3), terms(3))
def test_two_expressions_that_differ_anywhere_are_never_proved_equal(a, b):
    first, second = read(a), read(b)
    try:
        equal = identical(first, second)
    except ExpressionError:
        return
    points = np.random.default_rng(0).uniform(-2, 2, (3, 50))
    one, other = values(first, points), values(second, points)
    known = np.isfinite(one) & np.isfinite(other) & (abs(one) < 1e6)
    if equal:
        assert np.allclose(one[known], other[known], rtol=1e-6, atol=1e-6)


@given(terms(3))
def test_an_expression_in_lowest_terms_has_the_same_values(a):
    expression = read(a)
    points = np.random.default_rng(1).uniform(-2, 2, (3, 50))
    one, other = values(expression, points), values(simplified(expression), points)
    known = np.isfinite(one) & np.isfinite(other) & (abs(one) < 1e6)
    assert np.allclose(one[known], other[known], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("text", ["(x + y + z + 1)**64*(x + y + z + 2)**64", "(x + 1/y + z)**64*(y + 1/x + z)**64"])
def test_what_is_too_large_is_refused_at_once(text):
    with pytest.raises(ExpressionError, match="too large"):
        identical(parse(text, NAMES), parse("x", NAMES))
