"""Enclosures hold every difference quotient and are tight; `auto` picks the tightest type that is proved."""

import json
import re
from contextlib import suppress

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from support.bounded import soon
from support.commands import run
from support.functions import NAMES, within
from support.sweep import examples

from obsdesign.errors import UsageError
from obsdesign.expressions import Interval, parse
from obsdesign.nonlinearities import TEMPLATES
from obsdesign.nonlinearities.evidence.automatic import choose, cocoercive, lipschitz, outward, slopes
from obsdesign.nonlinearities.evidence.claims import Hull
from obsdesign.nonlinearities.evidence.continuity import continuous
from obsdesign.nonlinearities.evidence.enclosure import enclosure, supremum
from obsdesign.nonlinearities.evidence.norm import norm_bound
from obsdesign.nonlinearities.evidence.restriction import Restriction

DERIVED = {"auto": choose} | {name: type_.derive for name, type_ in TEMPLATES.items() if type_.derive}

INF = np.inf


def square(*names, size=1.0):
    return dict.fromkeys(names, (-size, size))


def binary(form):
    return lambda parts: st.builds(form.format, parts, parts)


LEAVES = st.sampled_from(["q1", "q2", "0.7", "-1.5", "2"])
FORMS = [
    "({} + {})", "({} - {})", "({} * {})", "max({}, {})", "min({}, {})", "({}/(1.5 + sin({})))",
    "where({} < 0.3, {}, 1)",
]  # fmt: skip
UNARY = ["sin({})", "cos({})", "tanh({})", "atan({})", "abs({})", "sat({})", "({})**2", "sqrt(1 + ({})**2)", "sign({})"]
TEXTS = st.recursive(
    LEAVES,
    lambda parts: st.one_of(
        *(binary(form)(parts) for form in FORMS), *(st.builds(form.format, parts) for form in UNARY)
    ),
    max_leaves=6,
)


@examples(30)
@given(TEXTS, st.floats(-3, 2), st.floats(0.1, 3), st.integers(0, 2**32 - 1))
def test_an_enclosure_holds_every_difference_quotient(text, low, width, seed):
    region = {"q1": (low, low + width), "q2": (-1.0, 1.0)}
    try:
        found = enclosure(within(text, nq=2, **region))
    except UsageError:  # it may jump
        return
    rng = np.random.default_rng(seed)
    ends = np.array([*region.values()])[:, :, None]
    first, second = ends[:, 0] + (ends[:, 1] - ends[:, 0]) * rng.random((2, 2, 400))
    f = parse(text, NAMES).function(("q1", "q2"))
    for j in range(2):
        moved = first.copy()
        moved[j] = second[j]
        df, dq = f(*moved) - f(*first), moved[j] - first[j]
        slack = 1e-12 * (1 + abs(f(*first)).max()) / abs(dq) + 1e-12 * abs(df / dq)
        assert np.all(df / dq >= found.low[0, j] - slack)
        assert np.all(df / dq <= found.high[0, j] + slack)


@examples(40)
@given(TEXTS, st.floats(-3, 2), st.floats(0.1, 3))
def test_a_supremum_is_between_what_is_attained_and_its_bound(text, low, width):
    g = parse(text, NAMES)
    box = dict.fromkeys(sorted(g.names), (low, low + width))
    found = supremum(g.enclose, box, 2000)
    points = np.random.default_rng(0).uniform(low, low + width, (len(box), 500))
    assert g.function(tuple(box))(*points).max(initial=-INF) <= found.bound
    assert found.attained <= found.bound


TIGHT = [
    ("sin(q)", {}, -1, 1),
    ("cos(3*q)", {}, -3, 3),
    ("tanh(q)", {}, 0, 1),
    ("tanh(q)", {"q": (-1, 1)}, 1 - np.tanh(1) ** 2, 1),
    ("atan(q)", {}, 0, 1),
    ("2*q + sin(q)", {}, 1, 3),
    ("-2*q - sin(q)", {}, -3, -1),
    ("sat(q)", {}, 0, 1),
    ("max(q, 0)", {}, 0, 1),
    ("abs(q)", {}, -1, 1),
    ("q*abs(q)", {"q": (-2, 3)}, 0, 6),
    ("q*abs(q)", {}, 0, INF),
    ("q**3", {}, 0, INF),
    ("q**3", {"q": (-1, 2)}, 0, 12),
    ("q - q**3", {"q": (-1, 1)}, -2, 1),
    ("q*exp(-q**2)", {"q": (-3, 3)}, -2 * np.exp(-1.5), 1),
    ("q/(1 + q**2)", {"q": (-100, 100)}, -1 / 8, 1),
    ("log(q)", {"q": (0.5, INF)}, 0, 2),
    ("y1*tanh(q) + t", {"y1": (0, 2)}, 0, 2),
    ("0.1*q", {}, 0.1, 0.1),
    ("where(q > 2, q**2, q)", {"q": (-1, 1)}, 1, 1),
    ("where(t < 1, 1, 2)*sin(q)", {}, -2, 2),
]


@pytest.mark.parametrize(("text", "region", "low", "high"), TIGHT)
def test_an_enclosure_is_tight_and_takes_little_time(text, region, low, high):
    f = within(text, **region)
    with soon():
        found = enclosure(f)
    scale = max(abs(x) for x in (low, high) if np.isfinite(x))
    assert low - 1e-4 * scale <= found.low[0, 0] <= low + 1e-15
    assert high - 1e-15 <= found.high[0, 0] <= high + 1e-4 * scale
    assert found.gap < 1e-4


def test_an_enclosure_says_how_tight_it_is():
    f = within("sin(q1*q2*q3)*cos(q1 - q2 + q3)/(1.1 + sin(q1*q3))", nq=3, **square("q1", "q2", "q3", size=3.0))
    found = enclosure(f)
    slopes = f.jacobian[0][0].function(("q1", "q2", "q3"))(*np.random.default_rng(0).uniform(-3, 3, (3, 100_000)))
    assert slopes.max() <= found.high[0, 0]
    assert found.gap > 1e-3
    assert found.high[0, 0] * (1 - found.gap) <= slopes.max() * 1.2


JUMPS = [
    ("sign(q)", {}),
    ("sign(q)*q**2", {}),
    ("where(q > 0, q, 1)", {}),
    ("(q > 0)*q", {}),
    ("1/q", {"q": (-1, 1)}),
    ("tan(q)", {"q": (0, 2)}),
    ("sqrt(q)", {"q": (-1, 1)}),
    ("log(q)", {}),
    ("q**(1/3)", {"q": (-1, 1)}),
    ("atan2(q, -1)", {"q": (-1, 1)}),
    ("asin(q)", {"q": (0, 2)}),
]


@pytest.mark.parametrize(("text", "region"), JUMPS)
def test_what_may_jump_or_be_undefined_has_no_enclosure(text, region):
    with pytest.raises(UsageError, match=r"f may jump or be undefined at q in \["):
        enclosure(within(text, **region))


@pytest.mark.parametrize(
    ("text", "region"),
    [("sign(q)*q", {"q": (1, 2)}), ("1/q", {"q": (1, 2)}), ("sqrt(q)", {"q": (1, 4)}), ("atan2(q, 1)", {})],
)
def test_away_from_the_jump_there_is_an_enclosure(text, region):
    assert np.isfinite(enclosure(within(text, **region)).high).all()


def test_continuity_is_told_for_each_box():
    boxes = {"q": Interval(np.array([-2.0, -1.0, 1.0]), np.array([-1.0, 1.0, 2.0]))}
    assert continuous(parse("sign(q)", ("q",)), boxes, ("q",)).tolist() == [True, False, True]


@pytest.mark.parametrize(
    ("f", "region", "norm"),
    [
        (("sin(q1) + cos(q2)",), {}, np.sqrt(2)),
        (("sin(q1)", "tanh(q1 + q2)"), {}, (1 + np.sqrt(5)) / 2),
        (("q1*q2", "q1**2 - q2**2"), square("q1", "q2"), np.sqrt(8)),
        (("q1 - (q1**2 + q2**2)*q1", "q2 - (q1**2 + q2**2)*q2"), square("q1", "q2"), 5),
        (("3*q1 + 4*q2",), {}, 5),
    ],
)
def test_the_norm_of_a_jacobian_is_bounded_tightly(f, region, norm):
    found = norm_bound(within(*f, nq=2, **region))
    assert found.attained <= norm + 1e-12
    assert norm * (1 - 1e-12) <= found.bound <= norm * (1 + 1e-3)


RADIAL = ("(q1**2 + q2**2)*q1", "(q1**2 + q2**2)*q2")
CHOICES = [
    (("sin(q)",), 1, {}, "slope [-1, 1]"),
    (("2*tanh(q)",), 1, {}, "slope [0, 2]"),
    (("q*abs(q)",), 1, {}, "slope [0, .inf]"),
    (("q**3",), 1, {}, "slope [0, .inf]"),
    (("-q**3",), 1, square("q"), "slope [-3, 0]"),
    (("-2*q - sin(q)",), 1, {}, "slope [-3, -1]"),
    (("tanh(q) - q",), 1, {}, "slope [-1, 0]"),
    (("sat(q)",), 1, {}, "slope [0, 1]"),
    (("2*q + sin(q)",), 1, {}, "slope [1, 3]"),
    (("0.1*q",), 1, {}, "slope [0.1, 0.1]"),
    (("tanh(q1)", "sat(q2)"), 2, {}, "slope [0, 1]"),
    (("tanh(q1)", "sin(q2)"), 2, {}, "slope [[0, -1], 1]"),
    (("sin(q1) + cos(q2)",), 2, {}, "jacobian of 4 vertices"),
    (("sin(q1)", "tanh(q1 + q2)"), 2, {}, "jacobian of 4 vertices"),
    (("tanh(q1 - q2)", "q2"), 2, {}, "jacobian of 4 vertices"),
    (RADIAL, 2, square("q1", "q2"), "jacobian of 48 vertices"),
    (("3*q1 + q2", "q1"), 2, {}, "jacobian of 1 vertices"),
]


@pytest.mark.parametrize(("f", "nq", "region", "text"), CHOICES)
def test_auto_picks_the_tightest_type(f, nq, region, text):
    assert choose(within(*f, nq=nq, **region)).text == text


@pytest.mark.parametrize(
    ("f", "make"), [("q**3/7 - q/3", slopes), ("sin(q)*exp(q/3)", lipschitz), ("q + q**3/7", cocoercive)]
)
def test_what_a_table_has_of_a_type_has_few_digits_and_follows_from_it(f, make):
    choice = make(within(f, nq=1, **square("q")))
    brief, exact = (list(map(float, re.findall(r"[-+.e0-9]+\d", text))) for text in (choice.label, choice.text))
    assert len(choice.label) < len(choice.text)
    assert brief == pytest.approx(exact, rel=1e-5)
    assert brief[-1] >= exact[-1]
    assert brief[0] <= exact[0] or len(brief) == 1


def test_many_entries_that_vary_give_a_lipschitz_constant():
    f = [f"sin(q{i}) + 0.1*cos(q{i % 3 + 1}) + 0.01*sin(2*q{(i + 1) % 3 + 1})" for i in (1, 2, 3)]
    choice = choose(within(*f, nq=3))
    assert choice.name == "lipschitz"
    assert 1 <= choice.data <= fmpq(125, 100)


@pytest.mark.parametrize(
    ("f", "nq", "region"),
    [*((f, nq, region) for f, nq, region, _ in CHOICES), (("q*exp(-q**2)",), 1, square("q", size=3.0))],
)
def test_whatever_is_derived_holds_for_every_pair(f, nq, region):
    where = within(*f, nq=nq, **region)
    choices = [choose(where)]
    for derive in DERIVED.values():
        with suppress(UsageError):
            choices.append(derive(where))
    assert len(choices) > 2
    ends = np.array([[max(low, -20), min(high, 20)] for low, high in where.box.values()])[:, :, None]
    first, second = ends[:, 0] + (ends[:, 1] - ends[:, 0]) * np.random.default_rng(0).random((2, nq, 200))
    second[:, ::2] = first[:, ::2] + 1e-3 * (second[:, ::2] - first[:, ::2])
    at = [np.array([g.function(where.arguments)(*points) for g in where.f]) for points in (first, second)]
    for choice in choices:
        for claim in TEMPLATES[choice.name].claims(choice.data, TEMPLATES[choice.name](choice.data, nq, len(f))):
            assert claim.violation((first - second).T, (at[0] - at[1]).T).min() > -1e-9


TOGETHER = [
    (("-q1*(q1**2 + q2**2)", "-q2*(q1**2 + q2**2)"), 2, square("q1", "q2"), 0.3),
    (("-q1*(q1**2 + q2**2)", "-q2*(q1**2 + q2**2)"), 2, square("q1", "q2", size=0.7), 0.3),
    (("q1*q2", "q1**2"), 2, square("q1", "q2"), 1.0),
    (("sin(q1 + q2)", "q1*q2**2"), 2, {"q1": (0.0, 1.0), "q2": (-2.0, 1.0)}, 1.0),
    (("exp(q1)*q2 + q1",), 2, square("q1", "q2"), 1.0),
    (("y1*q1 + y1**2*q2",), 2, {"y1": (0.0, 1.0)}, 0.8),
]


@pytest.mark.parametrize(("f", "nq", "region", "share"), TOGETHER)
def test_the_jacobian_is_in_the_hull_of_the_vertices_wherever_it_is_looked_at(f, nq, region, share):
    where = within(*f, nq=nq, **region)
    found = choose(where)
    assert found.name == "jacobian"
    assert len(found.data) <= 64
    rng = np.random.default_rng(1)
    low, high = np.array([*where.box.values()]).T
    low, high = (np.where(np.isinf(end), np.sign(end) * 9, end) for end in (low, high))
    points = low[:, None] + (high - low)[:, None] * np.hstack(
        [rng.random((len(low), 400)), rng.integers(0, 2, (len(low), 40))]
    )
    J = np.array([[np.broadcast_to(g.function(tuple(where.box))(*points), 440) for g in row] for row in where.jacobian])
    claim = Hull(np.array(found.data).reshape(len(found.data), -1, 1), conic=False)
    assert claim.violation(np.ones((440, 1)), J.reshape(-1, 440).T).min() > -1e-9
    gained = re.search(r"they take ([0-9.]+) of the box", found.reason)
    assert (float(gained[1]) if gained else 1.0) <= share


def test_terms_and_factors_in_another_order_are_the_same_entry():
    found = choose(within("-q1*(q1**2 + q2**2)", "-(q2**2 + q1**2)*q2", nq=2, **square("q1", "q2")))
    assert "entries of the Jacobian that vary: 3" in found.reason
    assert all(vertex[0, 1] == vertex[1, 0] for vertex in found.data)


DRAG = """\
obsdesign: 1
system: {{A: [[1, -1], [1, 1]], B: [[1, 0], [0, 0]], C: [0, 1], D: [0, 0.1]}}
nonlinearities:
  - f: [-q1*(q1**2 + q2**2), -q2*(q1**2 + q2**2)]
    type: {{auto: {{region: {{q1: [-{r}, {r}], q2: [-{r}, {r}]}}}}}}
    Bf: [[1, 0], [0, 1]]
    Cq: [[1, 0], [0, 1]]
observer: {{type: l2, alpha: 0.2}}
"""


@pytest.mark.parametrize(("radius", "least", "reached"), [("1", 1.8389, 1.95), ("0.7", 1.1843, 1.3)])
def test_planar_drag_is_certified_for_what_its_jacobian_is_as_a_set(tmp_path, radius, least, reached):
    (tmp_path / "s.yaml").write_text(DRAG.format(r=radius))
    outcome = run("solve", tmp_path / "s.yaml", "-o", tmp_path / "g.json")
    assert outcome.exit_code == 0, outcome.output
    content = json.loads((tmp_path / "g.json").read_text())
    assert least <= content["guarantee"]["limit"]["gamma"] <= reached  # the box: none, and 79
    assert "of the box of their ranges at most" in outcome.stdout
    assert run("verify", tmp_path / "g.json").exit_code == 0


def test_entries_that_are_the_same_expression_vary_together():
    found = choose(within("sin(q1)", "tanh(q1 + q2)", nq=2))
    assert {tuple(vertex[1]) for vertex in found.data} == {(0, 0), (1, 1)}


@pytest.mark.parametrize(
    ("kind", "f", "nq", "words"),
    [
        ("auto", ("-q**3",), 1, "df/dq cannot be bounded below at q in [-inf, inf]; give a smaller region"),
        ("lipschitz", ("q**3",), 1, "df/dq cannot be bounded above at q in [-inf, inf]"),
        ("auto", ("q1**2", "q1*q2"), 2, "df1/dq1 cannot be bounded"),
        ("lipschitz", ("q1", "q1*q2"), 2, "the Jacobian of f cannot be bounded at q1 in ["),
        ("slope", ("q1 + q2", "q2"), 2, "f_i a function of q_i only"),
        ("cocoercive", ("q1 + q2", "q2"), 2, "f_i a function of q_i only"),
        ("cocoercive", ("sin(q)",), 1, "its slope may be -1"),
        ("auto", ("y1*q",), 1, "df/dq cannot be bounded below at y1 in [-inf, inf]"),
    ],
)
def test_what_cannot_be_derived_is_refused_in_one_line(kind, f, nq, words):
    with pytest.raises(UsageError) as caught:
        DERIVED[kind](within(*f, nq=nq))
    (problem,) = caught.value.problems
    assert words in problem.message


@given(st.floats(-1e6, 1e6))
def test_rounding_goes_outward_and_prints_12_digits(value):
    exact = fmpq(*value.as_integer_ratio())
    low, high = outward(value, up=False), outward(value, up=True)
    assert low <= exact <= high
    assert high - low <= abs(exact) * fmpq(1, 10**11)
    assert float(repr(float(high))) == float(high)


@pytest.mark.parametrize(
    ("f", "region", "name", "data", "holds"),
    [
        ("sin(q)", {}, "lipschitz", fmpq(1), True),
        ("sin(q)", {}, "lipschitz", fmpq(99, 100), False),
        ("q*abs(q)", {}, "monotone", None, True),
        ("q - q**3", square("q", size=0.5), "monotone", None, True),
        ("q - q**3", square("q"), "monotone", None, False),
        ("tanh(q)", {}, "cocoercive", fmpq(1), True),
        ("tanh(q)", {}, "slope", [(fmpq(0), None)], True),
        ("tanh(q)", {}, "slope", [(fmpq(0), fmpq(9, 10))], False),
        ("sign(q)", {}, "monotone", None, False),
    ],
)
def test_only_what_holds_is_proved(f, region, name, data, holds):
    assert TEMPLATES[name].proved(within(f, **region), data) is holds


@examples(60, deadline=None)
@given(
    st.lists(st.tuples(st.integers(-3, 3), st.integers(0, 3), st.integers(0, 2)), min_size=1, max_size=4),
    st.integers(-3, 2),
    st.integers(1, 4),
    st.sampled_from(["{}", "sin({})", "({})/(2 + q**2)", "abs({})", "({})/u", "max({}, q)"]),
)
def test_the_ends_of_a_slope_are_attained_or_outside_what_is(terms, low, width, form):
    text = form.format(" + ".join(f"{c}*q**{k}*u**{m}" for c, k, m in terms))
    f = parse(text, ("q", "u"))
    region = {"q": (fmpq(low), fmpq(low + width)), "u": (fmpq(1, 2), fmpq(3))}
    restriction = Restriction.of([f], 1, region)
    try:
        choice = choose(restriction)
    except UsageError:
        return
    ((least, most),) = choice.data
    q, u = np.random.default_rng(0).uniform([low, 0.5], [low + width, 3], (2000, 2)).T
    slopes = f.derivative("q").function(("q", "u"))(q, u)
    slopes = slopes[np.isfinite(slopes)]
    assert float(least) - 1e-9 * abs(float(least)) <= slopes.min()
    assert slopes.max() <= float(most) + 1e-9 * abs(float(most))


@pytest.mark.parametrize(
    ("text", "ends"),
    [
        ("u*q", (fmpq(1, 10), fmpq(9, 10))), ("(1 - u)*q", (fmpq(1, 10), fmpq(9, 10))), ("q**2", (fmpq(-2), fmpq(6))),
        ("1/(q + 2)", (fmpq(-1), fmpq(-1, 25))), ("u*q**2/3", (fmpq(-3, 5), fmpq(9, 5))),
        ("q*abs(q)", (fmpq(0), fmpq(6))),
    ],
)  # fmt: skip
def test_slopes_whose_extremes_are_rational_at_corners_are_exact(text, ends):
    region = {"q": (fmpq(-1), fmpq(3)), "u": (fmpq(1, 10), fmpq(9, 10))}
    ((least, most),) = choose(Restriction.of([parse(text, ("q", "u"))], 1, region)).data
    if "abs" in text:
        assert (float(least), float(most)) == pytest.approx(tuple(map(float, ends)), abs=1e-4)
    else:
        assert (least, most) == ends
