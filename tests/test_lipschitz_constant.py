"""Lipschitz constants: bounds that hold, a lower one that is attained, and what has none."""

import json
from math import inf
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.commands import run
from support.functions import NAMES, within
from support.sweep import examples

from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.expressions import Expression, parse
from obsdesign.families.lipschitz.coordinates import scaling
from obsdesign.nonlinearities.evidence.constant import Constant, lipschitz_constant
from obsdesign.nonlinearities.evidence.norm import enclosed, largest_norm, radius_norm, uncoupled
from obsdesign.nonlinearities.evidence.proof import lipschitz_proved
from obsdesign.reading import loads

pytestmark = pytest.mark.usefixtures("here")

POLYNOMIAL = ("q1**3", "-6*q1**5 - 6*q1**2*q2 - 2*q1**4 - 2*q1**2")
TRIGONOMETRIC = (("cos(a)*cos(b)", "cos(a+b)"), ("3*a**2 - a", "-6*a**2 + 2*a*b"))
SPECS = Path(__file__).parent.parent / "specs"


def matrix(rows):
    return [[parse(text, NAMES) for text in row] for row in rows]


def polynomial(q1, q2):
    return within(*POLYNOMIAL, nq=2, q1=q1, q2=q2)


def norm_at(J, point):
    names = tuple(point)
    return np.linalg.norm([[float(g.function(names)(*point.values())) for g in row] for row in J], 2)


@pytest.mark.parametrize(
    ("limit", "value"),
    [(1e-12, 1.309935), (0.5, 2.773938), (1, 4.262823), (1.45, 5.607868), (2, 7.254307), (3, 10.25076)],
)
def test_a_maximum_in_a_corner_takes_one_box(limit, value):
    found = lipschitz_constant(polynomial((-0.25, 0.25), (-limit, limit)))
    assert found.boxes == 1
    assert found.lower == pytest.approx(value, abs=1e-5)
    assert found.upper == pytest.approx(value, abs=1e-5)


@pytest.mark.parametrize(
    ("J", "box", "lower", "upper"),
    [
        (matrix(TRIGONOMETRIC), {"a": (-1.0, 1.0), "b": (-2.0, 2.0)}, 10.786207, 10.786214),
        (polynomial((-0.25, 0.25), (-2.0, -1.0)), None, 5.0097425, 5.0097473),
        (polynomial((-0.25, 0.1), (0.1, 0.3)), None, 1.9530052, 1.9530069),
        (polynomial((-0.2, 0.0), (-0.4, -0.2)), None, 0.4246121, 0.4246124),
    ],
)
def test_what_needs_many_boxes_gets_them(J, box, lower, upper):
    if box is None:
        J, box = J.jacobian, J.box
    found = largest_norm(J, box)
    assert found.boxes > 1
    assert found.bound <= found.attained * (1 + 1e-6)
    assert lower - 1e-6 <= found.attained <= found.bound <= upper + 1e-6
    assert norm_at(J, found.point) == pytest.approx(found.attained, rel=1e-9)


def test_a_maximum_inside_the_region_is_as_tight_as_one_in_a_corner():
    f = within("exp(-(q1 - 0.3)**2 - 2*q2**2)", nq=2, q1=(-2.0, 2.0), q2=(-2.0, 2.0))
    found = lipschitz_constant(f)
    assert found.lower <= 2 / np.sqrt(np.e) * (1 + 1e-15)
    assert found.upper >= 2 / np.sqrt(np.e) * (1 - 1e-15)
    assert found.gap <= 1e-6
    assert found.boxes < 20_000
    np.testing.assert_allclose([found.point["q1"], abs(found.point["q2"])], [0.3, 0.5], atol=2e-3)


def test_components_that_share_no_argument_are_bounded_apart():
    f = within("sin(2*q1)", "tanh(q2)", "3*cos(q3)", nq=3)
    assert len(uncoupled(f.jacobian)) == 3
    found = lipschitz_constant(f)
    assert (found.lower, found.upper) == (pytest.approx(3), pytest.approx(3))
    assert norm_at(f.jacobian, found.point) >= found.lower * (1 - 1e-12)


def test_the_gap_is_relative():
    assert Constant(300.0, 400.0).gap == pytest.approx(0.25)
    assert Constant(0.0, 0.0).gap == 0


def test_a_constant_function_has_the_constant_zero():
    found = lipschitz_constant(within("1", "2", nq=2))
    assert (found.lower, found.upper, found.gap) == (0, 0, 0)


LEAVES = st.sampled_from(["q1", "q2", "q3", "0.7", "-1.5", "2"])
TEXTS = st.recursive(
    LEAVES,
    lambda parts: st.one_of(
        st.builds("({} + {})".format, parts, parts),
        st.builds("({} * {})".format, parts, parts),
        st.builds("({} - {})".format, parts, parts),
        *(st.builds(form.format, parts) for form in ("sin({})", "cos({})", "({})**2", "tanh({})", "abs({})")),
    ),
    max_leaves=5,
)


@examples(40)
@given(st.lists(TEXTS, min_size=2, max_size=3), st.floats(-2, 1), st.floats(0.1, 2), st.integers(0, 2**32 - 1))
def test_no_difference_quotient_exceeds_the_upper_bound_and_the_lower_one_is_attained(texts, low, width, seed):
    f = within(*texts, nq=3, q1=(low, low + width), q2=(-1.0, 1.0), q3=(0.0, width))
    found = largest_norm(f.jacobian, f.box, work=60_000)
    assert found.attained <= found.bound
    assert norm_at(f.jacobian, found.point) >= found.attained * (1 - 1e-9)
    assert all(lower <= found.point[name] <= upper for name, (lower, upper) in f.box.items())
    limits = np.array([*f.box.values()])[:, :, None]
    ends = limits[:, 0] + (limits[:, 1] - limits[:, 0]) * np.random.default_rng(seed).random((2, 3, 300))
    at = [np.array([g.function(f.arguments)(*points) for g in f.f]) for points in ends]
    df, dq = np.linalg.norm(at[0] - at[1], axis=0), np.linalg.norm(ends[0] - ends[1], axis=0)
    assert np.all(df <= found.bound * dq * (1 + 1e-12) + 1e-13 * (1 + abs(at[0]).max()))


@examples(50)
@given(st.integers(1, 4), st.integers(1, 4), st.integers(0, 2**32 - 1))
def test_the_norm_of_radii_bounds_every_matrix_within_them(rows, columns, seed):
    rng = np.random.default_rng(seed)
    R = rng.random((rows, columns)) * rng.integers(0, 2, (rows, columns))
    E = rng.choice([-1, 1], (50, rows, columns)) * R
    assert np.linalg.norm(E, 2, axis=(1, 2)).max() <= radius_norm(R)


def test_an_entry_without_a_bound_has_an_infinite_radius():
    from obsdesign.expressions import Interval

    boxes = {"q": Interval(np.array([-1.0, 1.0]), np.array([1.0, 2.0]))}
    _, radius = enclosed([[parse("1/q", ("q",)), Expression.number(1)]], boxes)
    assert radius[0].tolist() == [[inf, 0]]
    assert radius[1][0, 0] < 0.3


@pytest.mark.parametrize(
    ("f", "nq", "region", "words"),
    [
        (POLYNOMIAL, 2, {"q1": (-0.25, 0.25)}, "q2 = "),
        (("q**3",), 1, {}, "grows without bound"),
        (("exp(q)",), 1, {}, "grows without bound"),
        (("q*log(1 + q**2)",), 1, {}, "grows without bound"),
        (("sin(q**2)",), 1, {}, "grows without bound"),
        (("t*q",), 1, {"t": (0.0, inf)}, "t = "),
        (("1/q",), 1, {"q": (-1.0, 1.0)}, "grows without bound"),
        (("tan(q)",), 1, {"q": (0.0, 2.0)}, "at q = 1.571"),
        (("sign(q)",), 1, {}, "grows without bound"),
        (("sqrt(q)",), 1, {"q": (0.0, 1.0)}, "grows without bound"),
        (("sqrt(q)",), 1, {"q": (-1.0, 1.0)}, "f is undefined at q = -"),
        (("log(q)",), 1, {}, "f is undefined at q = -"),
    ],
)
def test_an_infinite_constant_is_told_with_the_place(f, nq, region, words):
    found = lipschitz_constant(within(*f, nq=nq, **region))
    assert found.infinite
    assert found.upper == inf
    assert words in found.reason


@pytest.mark.parametrize(
    ("f", "region"),
    [("sign(q)*q**2", {"q": (-1.0, 1.0)}), ("sqrt(1 + q**2)", {}), ("q*sin(q)/q", {"q": (-1.0, 1.0)})],
)
def test_a_finite_constant_that_is_not_proved_is_not_called_infinite(f, region):
    found = lipschitz_constant(within(f, **region))
    assert found.upper == inf
    assert not found.infinite
    assert " at q in [" in found.reason


@pytest.mark.parametrize(("k", "holds"), [("3.33", True), ("3.329999", False)])
def test_a_declared_constant_is_proved_to_its_last_digit(k, holds):
    from obsdesign.lmi.formula import rational_number

    assert lipschitz_proved(within("-3.33*sin(q)"), rational_number(k)) is holds
    assert lipschitz_proved(within("-3.33*sin(q1)", "1.5*q2", nq=2), rational_number(k)) is holds


# The command

JOINT = """
obsdesign: 1
name: Flexible joint
system:
  A: [[0, 1, 0, 0], [-48.6, -1.25, 48.6, 0], [0, 0, 0, 1], [19.5, 0, -19.5, 0]]
  B: [[0], [0], [0], [1]]
  C: [[1, 0, 0, 0], [0, 1, 0, 0]]
nonlinearities:
  - {type: {lipschitz: 3.33}, f: -3.33*sin(q), Bf: [0, 0, 0, 1], Cq: [0, 0, 1, 0]}
observer: OBSERVER
"""
L2 = "{type: l2, L2: 0, alpha: 0.1}"
PAPER = "{type: lipschitz, relaxation: abbaszadeh}"
PLAIN = """
obsdesign: 1
system: {A: [[0, 1], [-1, -1]], B: [[0], [1]], C: [[1, 0]]}
nonlinearities:
BLOCKS
observer: {type: l2, L2: 0, alpha: 0.1}
"""


def examined(text, *options):
    Path("x.yaml").write_text(text)
    return run("lipschitz", "x.yaml", *options)


def plain(*blocks):
    return PLAIN.replace("BLOCKS", "\n".join(f"  - {{{block}, Bf: [0, 1], Cq: [1, 0]}}" for block in blocks))


def test_the_command_shows_both_bounds_beside_the_declared_constant():
    outcome = examined(plain("type: {lipschitz: 4}, f: 2*q + sin(q)"))
    assert outcome.exit_code == 0
    rows = [line.split(maxsplit=1) for line in outcome.stdout.splitlines()]
    assert ["constant", "3 .. 3   proved, gap 0, 1 box"] in rows
    assert ["declared", "4   proved"] in rows
    assert ["attained", "q = 0"] in rows


def test_the_command_prints_numbers_that_a_script_can_read():
    blocks = "type: monotone, f: q**3, region: {q: [-1, 2]}", "type: {slope: [0, 1]}"
    report = json.loads(examined(plain(*blocks), "--json").stdout)
    first, second = report["blocks"]
    assert first["lower"] == pytest.approx(12)
    assert first["upper"] == pytest.approx(12)
    assert first["point"] == {"q": 2}
    assert first["region"] == {"q": [-1, 2]}
    assert "declared" not in first
    assert "region" not in second


def test_a_block_without_f_is_said_to_have_none():
    outcome = examined(plain("type: sin", "type: {slope: [0, 1]}"))
    assert outcome.exit_code == 0
    assert "no f is given" in outcome.stdout


@pytest.mark.parametrize(
    ("block", "code", "words"),
    [
        ("type: cubic", 3, "f_1: the Lipschitz constant is infinite: its slope grows without bound"),
        ("type: monotone, f: sqrt(q), region: {q: [0, 1]}", 3, "its slope grows without bound"),
        ("type: monotone, f: q*sqrt(1 + q**2)/sqrt(1 + q**2)", 4, "f_1: no bound of the Lipschitz constant is proved"),
        ("type: {slope: [0, 1]}", 2, "x.yaml: no nonlinearity has an f"),
        ("type: {lipschitz: 2}, f: 2*q + sin(q)", 2, "the constant is between 3 and 3"),
    ],
)
def test_the_command_answers_what_has_no_constant_in_one_line(block, code, words):
    outcome = examined(plain(block), "--quiet")
    assert outcome.exit_code == code
    assert outcome.stdout == ""
    assert words in outcome.stderr
    assert len(outcome.stderr.splitlines()) == 1


def test_an_infinite_constant_is_null_free_json():
    outcome = examined(plain("type: cubic"), "--json")
    assert outcome.exit_code == 3
    (block,) = json.loads(outcome.stdout)["blocks"]
    assert block["infinite"] is True
    assert "upper" not in block


@pytest.mark.parametrize(
    ("observer", "admissible", "identity"), [(L2, 11.6171080, 0.9997543), (PAPER, 2.5059626, 0.4606927)]
)
def test_scaled_coordinates_change_both_constants(observer, admissible, identity):
    report = json.loads(examined(JOINT.replace("OBSERVER", observer), "--T", "1,1,4,0.1", "--json").stdout)["scaling"]
    assert report["identity"]["upper"] == pytest.approx(3.33, rel=1e-8)
    assert report["identity"]["admissible"] == pytest.approx(identity, rel=1e-5)
    scaled = report["scaled"]
    assert (scaled["lower"], scaled["upper"]) == (pytest.approx(0.08325), pytest.approx(0.08325))
    assert scaled["admissible"] == pytest.approx(admissible, rel=1e-5)
    assert scaled["margin"] == pytest.approx(scaled["admissible"] - scaled["upper"])
    assert scaled["ratio"] == pytest.approx(scaled["admissible"] / scaled["upper"])


@pytest.mark.parametrize("observer", [L2, PAPER])
def test_the_search_does_at_least_as_well_as_the_coordinates_of_the_paper(observer):
    report = scaling(loads(JOINT.replace("OBSERVER", observer)), Engine())
    by_hand = scaling(loads(JOINT.replace("OBSERVER", observer)), Engine(), ["1", "1", "4", "0.1"])
    assert report["scaled"]["ratio"] >= by_hand["scaled"]["ratio"]
    assert report["scaled"]["T"][0] == 1
    again = scaling(loads(JOINT.replace("OBSERVER", observer)), Engine())
    assert again == report


def test_scaling_takes_several_blocks_and_reads_no_constant_from_their_types():
    blocks = "type: sin, gq: 1", "type: {lipschitz: 5}, f: 2*tanh(q)"
    report = scaling(loads(plain(*blocks)), Engine(), ["1", "0.5"])
    assert report["identity"]["upper"] == pytest.approx(3, rel=1e-6)
    assert report["scaled"]["upper"] == pytest.approx(1.5, rel=1e-6)


@pytest.mark.parametrize("T", ["1,2", "1,1,1,0", "1,1,-1,1", "a,b,c,d", "1,1,1,1/0", "1,1,1,nan", "1,1,1,inf"])
def test_a_wrong_T_is_refused(T):
    outcome = examined(JOINT.replace("OBSERVER", L2), "--T", T)
    assert outcome.exit_code == 2
    assert outcome.stderr.startswith("--T: expected 4 positive numbers")


def test_a_hidden_mode_leaves_no_admissible_constant():
    text = plain("type: sin").replace("C: [[1, 0]]", "C: [[0, 0]]").replace("[-1, -1]", "[1, 1]")
    report = scaling(loads(text), Engine())
    assert report["identity"]["admissible"] == 0
    assert report["scaled"]["T"] == [1, 1]


@pytest.mark.parametrize(
    ("block", "error"),
    [
        ("type: {slope: [0, 1]}", UsageError),
        ("type: sin, Dqf: [[0.1]]", UsageError),
        ("type: monotone, f: sign(q)", UsageError),
        ("type: cubic", UndecidedError),
    ],
)
def test_scaling_without_a_constant_is_refused(block, error):
    with pytest.raises(error):
        scaling(loads(plain(block)), Engine())
