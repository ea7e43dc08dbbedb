"""Every reading of a random expression agrees with ball arithmetic, which shares none of their rules."""

import math

import numpy as np
import pytest
from flint import ctx, fmpq
from hypothesis import assume, given
from hypothesis import strategies as st
from support.sweep import examples

from obsdesign.expressions import ExpressionError, Interval, parse, vector_function
from obsdesign.expressions.constant import ball
from obsdesign.expressions.tree import Number

NAMES = ("x", "y")
SMOOTH = ["sin", "cos", "tan", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "asin", "acos"]
ALL = [*SMOOTH, "abs", "sign", "sat"]
RELATIONS = ["<", "<=", ">", ">=", "==", "!="]

leaves = st.sampled_from(["x", "y"] * 4 + ["0", "1", "2", "0.5", "3.7", "1/3", "-2", "pi", "1e-3", "40"])
exponents = st.sampled_from(["2", "3", "-1", "-2", "0.5", "1/3", "-7/2", "5"])


def form(pattern, *parts):
    return st.tuples(*parts).map(lambda values: pattern.format(*values))


def smooth(inner):
    return st.one_of(
        form("{}({})", st.sampled_from(SMOOTH), inner),
        form("({}){}({})", inner, st.sampled_from(["+", "-", "*", "/"]), inner),
        form("({})**({})", inner, exponents),
        form("({})**({})", inner, inner),
        form("atan2({}, {})", inner, inner),
    )


def any_kind(inner):
    return st.one_of(
        smooth(inner),
        form("{}({})", st.sampled_from(ALL), inner),
        form("{}({}, {}, {})", st.sampled_from(["min", "max"]), inner, inner, inner),
        form(
            "where(({}){}({}), {}, {})",
            inner,
            st.sampled_from(["<", "<=", ">", ">=", "==", "!="]),
            *[inner] * 3,
        ),
    )


def expressions(extend):
    """Random expressions of x, y; texts whose constants are too large are left out."""

    def read(text):
        try:
            return parse(text, NAMES)
        except ExpressionError:
            return None

    return st.recursive(leaves, extend, max_leaves=6).map(read).filter(lambda e: e is not None)


points = st.sampled_from([0.0, 1.0, -1.0, 0.5, 2.0, 1e-9, -30.0]) | st.floats(-5, 5) | st.floats(-1e6, 1e6)


ordinary = st.floats(-3, 3).map(lambda value: round(value, 3))


def exact(expression, x, y, bits=400):
    """Ball of the value at doubles."""
    values = {"x": fmpq(*x.as_integer_ratio()), "y": fmpq(*y.as_integer_ratio())}
    return ball(expression.order, values, bits)


@examples(300)
@given(expressions(any_kind))
def test_the_text_parses_back_to_an_equal_expression(expression):
    again = parse(expression.text, NAMES)
    assert again == expression
    assert again.names == expression.names
    assert [type(n) for n in again.order] == [type(n) for n in expression.order]


@examples(300)
@given(expressions(any_kind), points, points)
def test_plain_floats_and_arrays_give_the_same_values_inside_the_enclosure(expression, x, y):
    one = expression.scalar(NAMES)(x, y)
    many = expression.function(NAMES)(np.array([x, x]), y)
    assert many.shape == (2,)
    assert vector_function([expression, expression], NAMES)([x, y]) == pytest.approx([one] * 2, nan_ok=True)
    around = expression.enclose({"x": Interval(x, x), "y": Interval(y, y)})
    assume(not around.empty)  # a function may answer where a comparison with NaN is false
    error = max(0.0, float(around.high - around.low)) if math.isfinite(one) else 0.0
    assert many == pytest.approx([one] * 2, rel=1e-12, abs=error, nan_ok=True)
    if math.isfinite(one):
        slack = 1e-15 * abs(one)  # numpy and math err by a unit in the last place at points inside, too
        assert around.low - slack <= one <= around.high + slack


@examples(300)
@given(expressions(smooth), ordinary, ordinary)
def test_the_derivative_is_the_limit_of_the_difference_quotient(expression, x, y):
    try:
        slope = exact(expression.derivative("x"), x, y)
    except ExpressionError:  # its constants grow too large
        return
    with ctx.workprec(400):
        h = fmpq(1, 2**100)
        at = {"x": fmpq(*x.as_integer_ratio()), "y": fmpq(*y.as_integer_ratio())}
        right = ball(expression.order, {**at, "x": at["x"] + h}, 400)
        left = ball(expression.order, {**at, "x": at["x"] - h}, 400)
        quotient = (right - left) / (2 * h)
        assume(quotient.is_finite() and slope.is_finite() and abs(quotient) < 1e15)
        assert not abs(quotient - slope) > 1e-9 * (1 + abs(slope))


@examples(200)
@given(expressions(any_kind), points, points, points, points, st.floats(0, 1), st.floats(0, 1))
def test_an_enclosure_holds_every_value(expression, a, b, c, d, s, r):
    (x0, x1), (y0, y1) = sorted([a, b]), sorted([c, d])
    found = expression.enclose({"x": Interval(x0, x1), "y": Interval(y0, y1)})
    assert not np.isnan(found.low)
    assert not np.isnan(found.high)
    for u, v in [(s, r), (0.0, 0.0), (1.0, 1.0), (0.0, 1.0), (1.0, 0.0)]:
        x, y = min(x1, x0 + u * (x1 - x0)), min(y1, y0 + v * (y1 - y0))
        value = exact(expression, x, y)
        if value.is_finite():
            low, high = float(found.low), float(found.high)
            assert not value < low, (expression.text, x, y)
            assert not value > high, (expression.text, x, y)


def box(low, high):
    return {"x": Interval(np.array(low), np.array(high)), "y": Interval(np.array(1.0), np.array(2.0))}


def enclosed(text, low, high):
    found = parse(text, NAMES).enclose(box(low, high))
    return found.low.tolist(), found.high.tolist()


@pytest.mark.parametrize(
    ("text", "low", "high", "expected"),
    [
        ("x + 1 - 1", -1.0, 3.0, (-1, 3)),
        ("2*x - y", -1.0, 3.0, (-4, 5)),
        ("x/2", -1.0, 3.0, (-0.5, 1.5)),
        ("x*x", -1.0, 3.0, (-3, 9)),
        ("x**2", -1.0, 3.0, (0, 9)),
        ("x**3", -1.0, 3.0, (-1, 27)),
        ("x**2", 1e-200, 3.0, (0, 9)),
        ("x**-1", 2.0, 4.0, (0.25, 0.5)),
        ("x**-2", -4.0, 2.0, (0.06249999999999999, np.inf)),
        ("3*x**2", -1.0, 2.0, (0, 12)),
        ("1/x", -1.0, 2.0, (-np.inf, np.inf)),
        ("1/x", 0.0, 2.0, (0.49999999999999994, np.inf)),
        ("1/x", -2.0, 0.0, (-np.inf, -0.49999999999999994)),
        ("x/x", 0.0, 2.0, (0.0, np.inf)),
        ("x/x", 0.0, 0.0, (-np.inf, np.inf)),
        ("0.1*(x/x)", 1.0, 1.0, (0.09999999999999999, 0.1)),
        ("abs(x)", -1.0, 3.0, (0, 3)),
        ("sign(x)", -1.0, 3.0, (-1, 1)),
        ("sat(x)", 0.5, 3.0, (0.5, 1)),
        ("min(x, y, 5)", -1.0, 3.0, (-1, 2)),
        ("max(x, y)", -1.0, 3.0, (1, 3)),
        ("sqrt(x)", -4.0, 9.0, (0, 3)),
        ("sin(x)", 0.0, 10.0, (-1, 1)),
        ("sin(x)", 0.0, 0.0, (0, 0)),
        ("cos(x)", -1e300, 1e300, (-1, 1)),
        ("sin(x)", 1e300, 1e300, (-1, 1)),
        ("tan(x)", 1.0, 2.0, (-np.inf, np.inf)),
        ("tanh(x)", -np.inf, np.inf, (-1, 1)),
        ("1 - tanh(x)**2", -np.inf, np.inf, (0, 1)),
        ("1/(1 + x**2)", -np.inf, np.inf, (0, 1)),
        ("x - sat(x)", -np.inf, np.inf, (-np.inf, np.inf)),
        ("log(x)", -1.0, 1.0, (-np.inf, 0)),
        ("cosh(x)", 0.0, 0.0, (1, 1)),
        ("where(x < 5, x, 100)", -1.0, 3.0, (-1, 3)),
        ("where(x < 0, -1, 1)", -1.0, 3.0, (-1, 1)),
        ("where(x > 4, log(0 - x), 7)", 1.0, 3.0, (7, 7)),
        ("(x >= 4) + (x != 5)", -1.0, 3.0, (1, 1)),
    ],
)
def test_an_enclosure_is_the_range_where_a_formula_gives_it(text, low, high, expected):
    assert enclosed(text, low, high) == expected


@pytest.mark.parametrize(
    ("text", "low", "high", "expected"),
    [
        ("exp(x)", -1.0, 3.0, (math.exp(-1), math.exp(3))),
        ("sin(x)", 2.0, 4.0, (math.sin(4), math.sin(2))),
        ("sin(x)", 1.0, 2.0, (math.sin(1), 1.0)),
        ("cos(x)", 98.0, 100.0, (math.cos(98), math.cos(100))),
        ("acos(x)", -7.0, 0.5, (math.acos(0.5), math.pi)),
        ("x**(1/3)", -1.0, 8.0, (0.0, 2.0)),
        ("x**y", 2.0, 3.0, (2.0, 9.0)),
        ("x**(y - 1)", -2.0, 3.0, (-3.0, 3.0)),
        ("atan2(x, y)", -1.0, 1.0, (-math.pi / 4, math.pi / 4)),
        ("atan2(x, -y)", -1.0, 1.0, (-math.pi, math.pi)),
        ("pi*x", 1.0, 1.0, (math.pi, math.pi)),
        ("cosh(x)", -1.0, 2.0, (1.0, math.cosh(2))),
    ],
)
def test_an_enclosure_is_tight_to_a_few_units_in_the_last_place(text, low, high, expected):
    found = enclosed(text, low, high)
    assert found == pytest.approx(expected, rel=4e-15, abs=3e-323)
    assert found[0] <= expected[0] <= expected[1] <= found[1]


@pytest.mark.parametrize("text", ["log(x)", "sqrt(x)", "x**0.5", "asin(x - 2.5)", "1 + exp(acos(x))", "x < log(x)"])
def test_an_enclosure_is_empty_where_the_expression_is_defined_nowhere(text):
    found = parse(text, NAMES).enclose(box([-3.0, 0.9], [-2.0, 1.0]))
    assert found.empty.tolist() == [True, "asin" in text]


@examples(50)
@given(expressions(any_kind), st.lists(st.tuples(points, points), min_size=1, max_size=5))
def test_many_boxes_are_enclosed_as_one_by_one(expression, ends):
    powers = [node.arguments[1] for node in expression.order if getattr(node, "operation", "") == "**"]
    assume(all(isinstance(exponent, Number) for exponent in powers))  # else integers in some boxes only
    low, high = np.sort(np.array(ends), axis=1).T
    together = expression.enclose(box(low, high))
    for i in range(len(ends)):
        one = expression.enclose(box(low[i], high[i]))
        assert np.broadcast_to(together.low, low.shape)[i] == one.low
        assert np.broadcast_to(together.high, low.shape)[i] == one.high


@pytest.mark.parametrize(
    ("text", "x", "value"),
    [
        ("log(x)", -1.0, math.nan),
        ("log(x)", 0.0, -math.inf),
        ("1/x", 0.0, math.inf),
        ("-1/x", 0.0, -math.inf),
        ("x/x", 0.0, math.nan),
        ("x**-1", 0.0, math.inf),
        ("x**0.5", -1.0, math.nan),
        ("x**(1/3)", -8.0, math.nan),
        ("exp(x)", 1000.0, math.inf),
        ("x**3", 1e200, math.inf),
        ("x**7", 1e200, math.inf),
        ("cosh(x)", 1000.0, math.inf),
        ("sin(x)", math.inf, math.nan),
        ("asin(x)", 2.0, math.nan),
        ("max(x, 1)", math.nan, math.nan),
        ("max(1, x)", math.nan, math.nan),
        ("min(1, x, 2)", math.nan, math.nan),
        ("sat(x)", math.nan, math.nan),
        ("sign(x)", math.nan, math.nan),
        ("where(x > 0, log(x), 5)", -1.0, 5.0),
        ("sat(x)", -math.inf, -1.0),
        ("x < 1", math.nan, 0.0),
    ],
)
def test_outside_the_domain_functions_answer_nan_or_infinity_without_a_warning(text, x, value):
    expression = parse(text, NAMES)
    assert expression.scalar(["x"])(x) == pytest.approx(value, nan_ok=True)
    assert expression.function(["x"])([x, x]) == pytest.approx([value, value], nan_ok=True)
    assert vector_function([expression], ["x"])([x]) == pytest.approx([value], nan_ok=True)


@pytest.mark.parametrize(
    ("text", "slope"),
    [
        ("x*abs(x)", "abs(x) + x*sign(x)"),
        ("x**3", "3*x**2"),
        ("sat(2*x)", "2*where(abs(2*x) < 1, 1, 0)"),
        ("sign(x) + (x < 1)", "0"),
        ("max(x, 0)", "where(x >= 0, 1, 0)"),
        ("where(x < y, x**2, 3)", "where(x < y, 2*x, 0)"),
        ("x**(1/2)", "0.5*x**(-0.5)"),
        ("2**x", "2**x*log(2)"),
        ("x**y", "y*x**(y - 1)"),
        ("1/x", "-1/x**2"),
        ("sin(2*x) + y*t", "2*cos(2*x)"),
        ("y", "0"),
    ],
)
def test_derivatives_are_simplified_lightly(text, slope):
    assert parse(text, [*NAMES, "t"]).derivative("x") == parse(slope, NAMES)


def test_a_constant_and_a_variable_broadcast_to_the_shape_of_the_arguments():
    grid = np.zeros((2, 1)), np.arange(3.0)
    assert parse("7", NAMES).function(NAMES)(*grid).tolist() == [[7.0] * 3] * 2
    assert parse("y", NAMES).function(NAMES)(*grid).shape == (2, 3)
    copy = parse("y", NAMES).function(["y"])(grid[1])
    copy[0] = 5
    assert grid[1][0] == 0
    assert parse("7", NAMES).scalar([])() == 7.0


@pytest.mark.parametrize("place", range(5))
def test_an_exponent_that_is_a_variable_is_that_variable_wherever_it_stands(place):
    names = [f"a{i}" for i in range(5)]
    side = parse(f"(1 + a0**2)**a{place}", names)
    values = [0.7, 1.3, -0.4, 2.6, 0.9]
    expected = (1 + 0.49) ** values[place]
    assert side.scalar(names)(*values) == pytest.approx(expected, rel=1e-14)
    assert side.rows(names)(np.array([[v] for v in values]))[0] == pytest.approx(expected, rel=1e-14)
    plain = parse(f"a1**a{place}", names)
    assert plain.scalar(names)(*values) == pytest.approx(1.3 ** values[place], rel=1e-14)
