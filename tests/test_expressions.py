"""The language of expressions: what is read, what is refused and where, what is exact."""

import math

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from support.bounded import soon

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression, ExpressionError, constant, parse

NAMES = ("x", "y", "t", "q")


def refusal(text, names=NAMES):
    with pytest.raises(ExpressionError) as caught:
        parse(text, names)
    return caught.value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("-3**2", -9),
        ("2**3**2", 512),
        ("2**-1", fmpq(1, 2)),
        ("10 - 2 - 3", 5),
        ("12/3/2", 2),
        ("-2*3 + 4", -2),
        ("(1 + 2)*3", 9),
        ("+-+1", -1),
        (".5 + 5.", fmpq(11, 2)),
        ("1e-3", fmpq(1, 1000)),
        ("2.5E+1", 25),
        ("010", 10),
        ("3 > 2", 1),
        ("2*3 <= 5", 0),
        ("(1 < 2) + (2 == 2) + (1 != 1)", 2),
        ("where(1 < 2, 3, 1/3)", 3),
        ("where(0, 3, 1/3)", fmpq(1, 3)),
        ("max(1/3, 0.3, 1/4)", fmpq(1, 3)),
        ("min(1/3, 0.3, 1/4)", fmpq(1, 4)),
        ("sat(-7) + sat(1/7)", fmpq(-6, 7)),
        ("sign(-0.1) + abs(-2/3)", fmpq(-1, 3)),
        ("sqrt(4/9)", fmpq(2, 3)),
        ("8**(1/3)", 2),
        ("(4/9)**-1.5", fmpq(27, 8)),
        ("exp(0) + cos(0) + log(1) + atan2(0, 2)", 2),
        ("0.1 + 0.2", fmpq(3, 10)),
        ("(1/3)**100 * 3**100", 1),
        ("2**1024/2**1000", 2**24),
    ],
)
def test_rational_arithmetic_is_exact_and_binds_as_in_python(text, value):
    assert constant(text) == (fmpq(value), False)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("sqrt(2)", math.sqrt(2)),
        ("pi/4", math.pi / 4),
        ("sin(1)", 0.8414709848078965),
        ("exp(-2)", 0.1353352832366127),
        ("sin(1e22)", -0.8522008497671888),
        ("cos(pi)", -1.0),
        ("2**0.5", math.sqrt(2)),
        ("sqrt(2)**2 - 2", 0.0),
        ("exp(-1000)", 0.0),
        ("exp(-exp(1000))", 0.0),
        ("sinh(1)**2 - cosh(1)**2", -1.0),
        ("where(pi > 3, sqrt(3), 0)", math.sqrt(3)),
        ("sat(pi) + sign(sin(4))", 0.0),
        ("min(pi, 4) - max(pi, 3)", 0.0),
        ("atan2(-1, -1)", -3 * math.pi / 4),
        ("exp(40) - exp(40)*(1 - 1e-30)", 2.3538526683701998e-13),
    ],
)
def test_an_irrational_value_is_the_correctly_rounded_double_and_says_so(text, value):
    assert constant(text) == (fmpq(*value.as_integer_ratio()), True)


@pytest.mark.parametrize(
    "text",
    [
        "log(-1)",
        "log(0)",
        "0**-1",
        "1/(pi - pi)",
        "sqrt(-1)",
        "(-8)**(1/3)",
        "asin(2)",
        "exp(1000)",
        "-exp(exp(1000))",
        "exp(exp(exp(exp(10))))",
        "sin(exp(exp(100)))",
        "sign(sqrt(2)**2 - 2)",
        "1e308*10",
    ],
)
def test_a_constant_without_a_finite_value_is_refused(text):
    with pytest.raises(ExpressionError):
        constant(text)


def test_parameters_enter_as_exact_numbers():
    assert constant("a/3 + a", {"a": fmpq(1, 10)}) == (fmpq(2, 15), False)
    assert parse("a*x", ["x"], {"a": fmpq(1, 10)}) == parse("0.1*x", ["x"])


@pytest.mark.parametrize(
    ("text", "column", "word"),
    [
        ("", 0, "found the end"),
        ("x +", 3, "found the end"),
        ("x x", 2, "operator"),
        ("2x", 1, "operator"),
        ("(x", 2, "')'"),
        ("x)", 1, "operator"),
        ("sin(x", 5, "')'"),
        ("sin()", 4, "number"),
        ("atan2(x)", 0, "takes 2"),
        ("min(x)", 0, "takes 2 to"),
        ("max(x,)", 6, "number"),
        ("3 + sine(x)", 4, "'sin'"),
        ("xx + 1", 0, "'x'"),
        ("1 + z", 4, "allowed: pi, q, t, x, y"),
        ("sin + 1", 0, "sin(..)"),
        ("x(1)", 0, "no function"),
        ("pi(1)", 0, "no function"),
        ("2*e", 2, "exp(1)"),
        ("x^2", 1, "**"),
        ("x < y < 1", 6, "chain"),
        ("x and y", 2, "*"),
        ("x = 1", 2, "=="),
        ("1/0", 1, "division by zero"),
        ("x/(2 - 2)", 1, "division by zero"),
        ("1e400", 0, "range"),
        ("x + 1e-400", 4, "range"),
        ("1e99999999999999999999", 0, "range"),
        ("9" * 400, 0, "range"),
        ("9" * 9999, 0, "bits"),
    ],
)
def test_a_mistake_is_named_with_its_column_and_what_is_allowed(text, column, word):
    error = refusal(text)
    assert (error.column, word in error.message) == (column, True), error.message
    assert "\n" not in str(error)
    assert isinstance(error, UsageError)


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("9**9**9**9", 4),
        ("x**100000", 1),
        ("x**-(99999/2)", 1),
        ("x**(sqrt(2)*10**5)", 1),
        ("x**log(0)", 1),
        ("((((1/3)**10000)**10000)**10000)**10000", 16),
        ("__import__('os')", 11),
        ("x.__class__", 1),
        ("x[0]", 1),
        ("lambda: 1", 6),
        ("sin(x=1)", 5),
        ("'x'", 0),
        ('f"{x}"', 1),
        ("x\0", 1),
        ("x\\", 1),
        ("\u0445 + 1", 0),  # Cyrillic
        ("x\uff0b1", 1),  # full-width plus
        ("\u0661", 0),  # Arabic digit one
        ("x\u200b", 1),
        ("(" * 5000, 100),
        ("(" * 101 + "x" + ")" * 101, 100),
        ("sin(" * 200, 403),
        ("-" * 200 + "x", 100),
        ("/".join("x" * 200), 201),
        ("**".join("x" * 200), 301),
        ("(" * 9000 + "x" + ")" * 9000, 10_000),
        ("+".join("x" * 6000), 10_000),
    ],
)
def test_hostile_text_is_refused_at_once(text, column):
    with soon():
        error = refusal(text)
    assert error.column == column, error.message
    assert len(error.message) < 200


@pytest.mark.parametrize(
    "text",
    [
        "+".join("x" * 5000),
        "*".join("x" * 5000),
        "(" * 100 + "x" + ")" * 100,
        "sin(" * 99 + "x" + ")" * 99,
        "x**1e4",
    ],
    ids=["a sum", "a product", "brackets", "functions", "a power"],
)
def test_the_largest_expressions_within_the_limits_have_every_reading(text):
    with soon():
        expression = parse(text, NAMES)
        slope = expression.derivative("x")
        assert expression.scalar(["x"])(1.0) == pytest.approx(expression.function(["x"])(1.0))
        assert slope.scalar(["x"])(1.0) == pytest.approx(slope.function(["x"])(1.0))
    assert expression.text.count("x") == text.count("x")


@pytest.mark.parametrize(
    ("text", "printed"),
    [
        ("2*x*3 - y/2", "6*x - y/2"),
        ("x - (y - 3)", "x - (y - 3)"),
        ("-(x/y)", "-x/y"),
        ("(x**y)**2", "(x**y)**2"),
        ("x**y**2", "x**y**2"),
        ("(-3)**x", "(-3)**x"),
        ("x*(y/q)", "x*(y/q)"),
        ("1/3*x", "1/3*x"),
        ("0.1*x", "0.1*x"),
        ("y**1 + x*0 + x**0", "y + 1"),
        ("(x < 1)*2", "2*(x < 1)"),
        ("min(x, y, 0)", "min(x, y, 0)"),
        ("1e-300*x", "1e-300*x"),
    ],
)
def test_text_is_what_an_engineer_would_write(text, printed):
    assert str(parse(text, NAMES)) == printed


def test_equality_is_structural():
    same = {parse("x + 1", NAMES), parse(" x+1.0 ", ["x"]), parse("(x) + 2 - 1", NAMES)}
    assert len(same) == 1
    assert parse("x*y", NAMES) != parse("y*x", NAMES)
    assert parse("x", NAMES) != "x"


def test_names_are_the_variables_that_occur():
    assert parse("x*sin(q) + pi", NAMES).names == {"x", "q"}
    assert parse("0*x + 1", NAMES).names == set()


def test_a_combination_is_the_sum_of_products():
    parts = [parse("x", NAMES), parse("x*abs(x)", NAMES), parse("y", NAMES)]
    whole = Expression.combination([fmpq(2), fmpq(-1, 3), fmpq(0)], parts)
    assert whole == parse("2*x - 1/3*x*abs(x)", NAMES)
    assert Expression.combination([], []) == Expression.number(0)
    with pytest.raises(ValueError, match="zip"):
        Expression.combination([fmpq(1)], parts)


@pytest.mark.parametrize(
    ("text", "switches", "decided"),
    [
        ("sin(t)", [], "sin(t)"),
        ("sign(t - 1)", ["t - 1"], "s1"),
        ("abs(2*t - x)", ["2*t - x"], "s1*(2*t - x)"),
        ("sat(t)", ["t - 1", "t + 1"], "where(s1 > 0, 1, where(s2 < 0, -1, t))"),
        (
            "min(t, 2, x)",
            ["t - 2", "t - x", "2 - x"],
            "where((s1 <= 0)*(s2 <= 0), t, where(s3 <= 0, 2, x))",
        ),
        ("max(t, x)", ["t - x"], "where(s1 >= 0, t, x)"),
        ("where(t < 1, x, 2)", ["t - 1"], "where(s1 < 0, x, 2)"),
        ("where((t > 1)*(t <= 2), x, 2)", ["t - 1", "t - 2"], "where((s1 > 0)*(s2 <= 0), x, 2)"),
        ("where(sin(t), 1, 2)", ["sin(t)"], "where(s1, 1, 2)"),
        ("abs(t) + sign(t)", ["t", "t"], "s1*t + s2"),
        ("abs(abs(t) - 1)", ["t", "abs(t) - 1"], "s2*(s1*t - 1)"),
    ],
)
def test_jumps_and_kinks_are_decided_by_the_signs_of_functions(text, switches, decided):
    found = []

    def sign(g, _):
        found.append(str(g))
        return Expression.variable(f"s{len(found)}")

    assert str(parse(text, NAMES).decided(sign)) == decided
    assert found == switches


@given(st.floats(-3, 3), st.floats(-3, 3))
def test_a_decided_expression_has_the_value_of_the_expression_where_its_signs_are_right(t, x):
    e = parse(
        "sat(t) + min(t, 2*x, 1) - max(x, t**2)*abs(t - x) + where(sign(x)*(t > 0), t, sat(x)) + sign(t - 1)", "tx"
    )
    signs = {}

    def sign(_, g):
        signs[f"s{len(signs)}"] = float(np.sign(g.scalar(["t", "x", *signs])(t, x, *signs.values())))
        return Expression.variable(f"s{len(signs) - 1}")

    decided = e.decided(sign)
    assert decided.scalar(["t", "x", *signs])(t, x, *signs.values()) == e.scalar("tx")(t, x)
