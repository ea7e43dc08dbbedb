"""The split of a plant as equations is the equations; identities that are proved are true."""

import math
import random
import re

import numpy as np
import pytest
from flint import fmpq
from hypothesis import assume, given
from hypothesis import strategies as st
from support.sweep import examples

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression, ExpressionError, parse
from obsdesign.expressions.algebra import identical
from obsdesign.model.coefficients import Coefficients
from obsdesign.model.split import Splitter
from obsdesign.reading import loads

STATES, INPUTS, DISTURBANCES, OUTPUTS = ("a", "b", "c"), ("u",), ("w", "n"), ("y",)
NAMES = ("t", *STATES, *INPUTS, *DISTURBANCES)
leaves = st.sampled_from(["a", "b", "c", "u", "t", "2", "0.5", "1/3", "-1", "3"])
FORMS = [
    "({} + {})", "({} - {})", "({})*({})", "({})*({})", "({} - 2*{})", "sin({})", "tanh(3*({}))", "({})*abs({})",
    "({})**2", "exp(-({})**2)", "({})/(1 + ({})**2)", "atan({} + {})", "({})/4", "max({}, {})",
]  # fmt: skip


def filled(form, parts):
    """A form with parts in its places."""
    for _ in range(form.count("{}")):
        form = form.replace("{}", parts[_ % len(parts)], 1)
    return form


expressions = st.recursive(
    leaves,
    lambda inner: st.builds(filled, st.sampled_from(FORMS), st.lists(inner, min_size=2, max_size=2)),
    max_leaves=6,
)
noise = st.sampled_from(["", " + w", " - 0.2*w + n/3", " + 2*n"])
sums = st.builds(lambda terms, w: " + ".join(terms) + w, st.lists(expressions, min_size=1, max_size=4), noise)


def read(texts, names=NAMES):
    """Expressions by name."""
    return {name: parse(text, names) for name, text in texts.items()}


def split(dynamics, outputs, measured=None):
    """Split of right sides; the example is left out where one cannot be split."""
    try:
        return Splitter(STATES, DISTURBANCES, measured or {}).split(dynamics, outputs)
    except (UsageError, ExpressionError):
        assume(False)


def agree(first, second, names, seed=0):
    """Whether two expressions have the same values at random points, where both have one."""
    points = np.random.default_rng(seed).uniform(-2, 2, (len(names), 60))
    values = [np.broadcast_to(e.function(names)(*points), 60) for e in (first, second)]
    known = np.isfinite(values[0]) & np.isfinite(values[1]) & (np.abs(values[0]) < 1e9)
    return np.allclose(values[0][known], values[1][known], rtol=1e-6, atol=1e-6)


@examples(150, deadline=None)
@given(st.lists(sums, min_size=3, max_size=3), sums)
def test_the_split_is_the_equations(sides, output):
    dynamics, outputs = read(dict(zip(STATES, sides, strict=True))), read({"y": output})
    found = split(dynamics, outputs)
    for name, side in {**dynamics, **outputs}.items():
        assert agree(found.restored(name), side, NAMES)
        assert identical(found.restored(name), side)
    assert found.proved({**dynamics, **outputs}, outputs)
    for term in found.terms:
        assert term.arguments
        assert term.f.names <= {"t", "u", "q", *(f"q{i + 1}" for i in range(len(term.arguments)))}
        assert all(c != 0 for c in term.enters.values())


@examples(60, deadline=None)
@given(st.lists(sums, min_size=3, max_size=3))
def test_a_state_that_is_measured_without_noise_may_stand_for_its_output(sides):
    dynamics, outputs = read(dict(zip(STATES, sides, strict=True))), read({"y": "2*a"})
    found = split(dynamics, outputs, {"a": Expression.combination([fmpq(1, 2)], [Expression.variable("y")])})
    assert found.proved({**dynamics, **outputs}, outputs)
    for name, side in dynamics.items():
        assert agree(found.restored(name).substituted(outputs), side, NAMES)


@examples(60, deadline=None)
@given(st.lists(sums, min_size=3, max_size=3), st.permutations(STATES), st.integers(0, 99))
def test_the_split_depends_on_neither_names_nor_the_order_of_terms(sides, names, seed):
    dynamics = read(dict(zip(STATES, sides, strict=True)))
    found = split(dynamics, {})
    fresh = dict(zip(STATES, ("p", "r", "s"), strict=True))
    renamed = {
        fresh[name]: side.substituted({old: Expression.variable(new) for old, new in fresh.items()})
        for name, side in dynamics.items()
    }
    other = Splitter(tuple(fresh.values()), DISTURBANCES, {}).split(renamed, {})

    def in_fresh(row):
        return {fresh.get(name, name): c for name, c in row.items()}

    assert other.linear == {fresh[name]: in_fresh(row) for name, row in found.linear.items()}
    assert [term.f.text for term in other.terms] == [term.f.text for term in found.terms]
    assert [term.enters for term in other.terms] == [in_fresh(term.enters) for term in found.terms]
    shuffled = {}
    for name in names:
        summands = list(dynamics[name].summands())
        random.Random(seed).shuffle(summands)
        shuffled[name] = Expression.combination([c for c, _ in summands], [e for _, e in summands])
    again = split(shuffled, {})
    assert again.linear == found.linear
    assert len(again.terms) == len(found.terms)
    assert all(identical(again.known[name], found.known[name]) for name in STATES)


@examples(200, deadline=None)
@given(expressions, expressions, st.sampled_from(["same", "sum", "product", "other"]))
def test_what_is_proved_to_be_identical_is_equal_wherever_both_are_defined(first, second, how):
    a, b = (parse(text, NAMES) for text in (first, second))
    pairs = {
        "same": (a, a),
        "sum": (Expression.combination([fmpq(1), fmpq(1)], [a, b]), Expression.combination([fmpq(1), fmpq(1)], [b, a])),
        "product": (parse(f"({first})*({second} + 1)", NAMES), parse(f"({second})*({first}) + ({first})", NAMES)),
        "other": (a, b),
    }
    left, right = pairs[how]
    try:
        proved = identical(left, right)
    except ExpressionError:
        assume(False)
    if how != "other":
        assert proved
    if proved:
        assert agree(left, right, NAMES)


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("exp(a + b)", "exp(a)*exp(b)"), ("exp(2*a)", "exp(a)**2"), ("log(exp(a))", "a"), ("exp(-log(a))", "1/a"),
        ("sin(a)**2 + cos(a)**2", "1"), ("sin(a + b)", "sin(a)*cos(b) + cos(a)*sin(b)"),
        ("cos(2*a)", "1 - 2*sin(a)**2"),
        ("tan(a)*cos(a)", "sin(a)"), ("sqrt(a)**2", "a"), ("abs(a)**2", "a**2"), ("(a**2 - b**2)/(a - b)", "a + b"),
        ("tanh(a)", "(exp(2*a) - 1)/(exp(2*a) + 1)"), ("cosh(a)**2 - sinh(a)**2", "1"), ("atan(a + b)", "atan(b + a)"),
    ],
)  # fmt: skip
def test_known_identities_are_proved(left, right):
    assert identical(parse(left, NAMES), parse(right, NAMES))


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("sqrt(a**2)", "a"), ("abs(a)", "a"), ("atan(tan(a))", "a"), ("sin(a)", "cos(a)"),
        ("exp(a*b)", "exp(a)*exp(b)"),
        ("log(a**2)", "log(a)"), ("tanh(2*a)", "2*tanh(a)"), ("a/(1 + a)", "a/(1 + a**2)"), ("max(a, b)", "a"),
    ],
)  # fmt: skip
def test_false_identities_are_not_proved(left, right):
    assert not identical(parse(left, NAMES), parse(right, NAMES))


@pytest.mark.parametrize(
    ("text", "terms"),
    [
        ("a*(1 - b) - tanh(50*(a - b)) + 3*tanh(50*(a - b))", {"a*b": 2, "tanh(50*(a - b))": 1}),
        ("sin(a) + 2*sin(a) - 3*sin(a) + b", {}),
        ("(a + 2*b)*abs(a + 2*b) + u*a", {"(a + 2*b)*abs(a + 2*b)": 1, "u*a": 1}),
        ("a*t - u*sin(t) + 5", {"a*t": 1}),
        ("a**2*b/7", {"a**2*b": 2}),
        ("atan(u - c + c)", {}),
    ],
)
def test_terms_of_a_right_side(text, terms):
    found = split(read({"a": text}), {})
    assert {term.text: len(term.arguments) for term in found.terms} == terms


WHOLE = """obsdesign: 1
system:
  inputs: [u]
  disturbances: [w, n]
  dynamics: {a: "%s", b: "%s", c: "%s"}
  outputs: {y: "%s"}
  domain: {a: [-1, 1], b: [-2, 1], c: [0, 2], u: [-1, 1]}
observer: {type: l2, alpha: 0.1}
"""
CORRUPTED = [("a", "aa"), ("*", "/"), ("(", "(("), ("sin", "sign"), ("w", "w**2"), ("+ ", "+ a*w + "), ("b", "log(b)")]


def answered(text):
    """The spec of a text, or None and what is wrong with it."""
    try:
        return loads(text, "spec.yaml"), ()
    except UsageError as error:
        return None, error.problems


def test_random_equations_are_both_split_and_refused():
    assert answered(WHOLE % ("b*c + w", "-sin(a)*b - 2*n", "u*c - c**3 + a", "a + w"))[0]
    assert not answered(WHOLE % ("b*c + w", "-sign(b) - 2*n", "u*c", "a"))[0]


@examples(40, deadline=None)
@given(st.lists(sums, min_size=3, max_size=3), sums, st.sampled_from([None, *CORRUPTED]), st.integers(0, 3))
def test_a_spec_of_random_equations_is_split_or_answered_in_lines_of_its_own_keys(sides, output, change, where):
    texts = [*sides, output]
    if change:
        texts[where] = texts[where].replace(*change, 1)
    spec, problems = answered(WHOLE % tuple(texts))
    assert len(problems) == len(set(problems))
    for problem in problems:
        assert problem.key.startswith("system."), str(problem)
        assert problem.line, str(problem)
        assert not re.search(r"\bq\d*\b|nonlinearities|\n", problem.message), str(problem)
    if spec is None:
        return
    plant = spec.equations(spec.plant)
    q = dict(plant.algebraic)
    for name, text in zip((*STATES, "y"), texts, strict=True):
        side = {**plant.dynamics, **plant.outputs}[name].substituted(q).substituted(dict(plant.outputs)).substituted(q)
        assert agree(side, parse(text, NAMES), NAMES)


@pytest.mark.parametrize(
    ("side", "row", "read"),
    [
        ("sqrt(2)*w - b", {"w": math.sqrt(2), "b": -1}, {"sqrt(2)"}),
        ("-sqrt(2)*(a + w)/pi", {"a": -math.sqrt(2) * (1 / math.pi)}, {"sqrt(2)", "pi"}),
        ("a*(1 + exp(1))/2", {"a": (1 + math.e) / 2}, {"1 + exp(1)"}),
        ("sin(pi*t) + u*sqrt(3) + sin(pi*a) + a", {"a": 1}, set()),  # what is known, and functions, keep theirs
    ],
)
def test_an_irrational_coefficient_is_a_double(side, row, read):
    coefficients = Coefficients((*STATES, *DISTURBANCES))
    made = coefficients.in_numbers(parse(side, NAMES))
    linear = Splitter(STATES, DISTURBANCES, {}).split({"a": made}, {}).linear["a"]
    assert {name: float(linear[name]) for name in row} == pytest.approx(row, rel=1e-15)
    assert set(coefficients.read) == read
    assert all(float(parse(text, ()).scalar(())()) == value for text, value in coefficients.read.items())


def test_an_irrational_coefficient_that_is_not_finite_is_refused():
    with pytest.raises(ExpressionError, match="undefined, infinite"):
        Coefficients(STATES).in_numbers(parse("log(0)*a", NAMES))


def test_a_spec_says_which_double_is_meant():
    spec = loads(
        "obsdesign: 1\nsystem: {states: [a], disturbances: [w], dynamics: {a: sqrt(2)*w - a}, outputs: {y: a}}\n"
        "observer: {type: l2, alpha: 0.1}"
    )
    assert float(spec.plant.B[0, 0]) == math.sqrt(2)
    assert spec.notes == ("sqrt(2) in system.dynamics.a is read as the double 1.4142135623730951",)
