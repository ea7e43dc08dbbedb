"""A declared type that its f contradicts is refused with a pair that shows it; a tight one never is."""

import re

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from support.bounded import soon
from support.commands import run
from support.functions import within
from support.sweep import examples

from obsdesign.errors import UsageError
from obsdesign.expressions import Interval
from obsdesign.expressions.interval import point
from obsdesign.lmi.formula import rational
from obsdesign.nonlinearities import TEMPLATES
from obsdesign.nonlinearities.evidence.claims import Hull, Quadratic
from obsdesign.nonlinearities.evidence.refutation import counterexample
from obsdesign.reading import loads

ONE = fmpq(1)


def search(f, name, data):
    return counterexample(f, TEMPLATES[name].claims(data, TEMPLATES[name](data, f.nq, len(f.f))))


def row(*entries):
    return rational([entries])


def times(k, x):
    return point(k) * x


def refutes(f, name, data, found):
    """Whether a pair violates a claim, in interval arithmetic, which knows nothing of balls."""
    ends = [{name: point(x) for name, x in end.items()} for end in (found.first, found.second)]
    dq = [found.first[q] - found.second[q] for q in f.arguments]
    df = [g.enclose(ends[0]) + -g.enclose(ends[1]) for g in f.f]
    for claim in TEMPLATES[name].claims(data, TEMPLATES[name](data, f.nq, len(f.f))):
        if isinstance(claim, Quadratic):
            s = [*map(point, dq), *df]
            value = Interval(np.array(0.0), np.array(0.0))
            for i, j in np.ndindex(claim.M.shape):
                value = value + times(claim.M[i, j], s[i] * s[j])
            if value.high < 0:
                return True
        else:
            middles = [float(x.low + x.high) / 2 for x in df]
            distance, _, _ = claim.distance(np.array(dq, dtype=float), middles)
            if distance > 1e-8:
                return True
    return False


SOFTMAX = ("exp(q1)/(exp(q1) + exp(q2))", "exp(q2)/(exp(q1) + exp(q2))")
RADIAL = ("q1 - (q1**2 + q2**2)*q1", "q2 - (q1**2 + q2**2)*q2")
PLANE = {"q1": (-1.0, 1.0), "q2": (-1.0, 1.0)}
CORNERS = [row(-1, -1), row(-1, 1), row(1, -1), row(1, 1)]

WRONG = [
    (("sin(q)",), 1, {}, "lipschitz", fmpq(95, 100)),
    (("tanh(q)",), 1, {}, "lipschitz", fmpq(95, 100)),
    (("2*q + sin(q)",), 1, {}, "lipschitz", fmpq(285, 100)),
    (("q*exp(-q**2)",), 1, {}, "lipschitz", fmpq(95, 100)),
    (("q*exp(-q**2)",), 1, {}, "slope", [(fmpq(-424, 1000), ONE)]),
    (("sin(q1) + cos(q2)",), 2, {}, "lipschitz", fmpq(1343, 1000)),
    (("q**3",), 1, {"q": (-2.0, 2.0)}, "lipschitz", fmpq(114, 10)),
    (("sat(100*(q - 3))",), 1, {}, "lipschitz", fmpq(95)),
    (("exp(-100*(q - 7.3)**2)",), 1, {}, "lipschitz", fmpq(81, 10)),
    (("sign(q)",), 1, {}, "lipschitz", fmpq(1000)),
    (("log(q)",), 1, {}, "lipschitz", fmpq(1)),
    (("y1*tanh(q) + t",), 1, {"y1": (0.0, 2.0)}, "lipschitz", fmpq(19, 10)),
    (("-q**3",), 1, {}, "monotone", None),
    (("q - q**3",), 1, {"q": (-0.58, 0.58)}, "monotone", None),
    (("max(q, 0)",), 1, {}, "slope", [(fmpq(1, 20), ONE)]),
    (("sin(q1)", "tanh(q1 + q2)"), 2, {}, "slope", [(-ONE, ONE), (fmpq(0), ONE)]),
    (("sin(q1)", "tanh(q2)"), 2, {}, "slope", [(-ONE, ONE), (fmpq(0), fmpq(95, 100))]),
    (SOFTMAX, 2, {}, "cocoercive", fmpq(475, 1000)),
    (("sin(q)",), 1, {}, "sector", (row(-1), row(0.95))),
    (("sin(q)",), 1, {}, "ball", (row(0), row(0.95))),
    (RADIAL, 2, PLANE, "one-sided-lipschitz", (fmpq(95, 100), fmpq(100), fmpq(0))),
    (RADIAL, 2, {}, "one-sided-lipschitz", (ONE, fmpq(1), fmpq(0))),
    (("2*sin(q)",), 1, {}, "multiplier", rational([[1, 0], [0, -1]])),
    (("sin(q1) + cos(q2)",), 2, {}, "jacobian", [*CORNERS[:3], row(1, 0.95)]),
    (("q1**3", "q2**3 + q1"), 2, {}, "cone", [rational([[1, 0], [1, 0]]), rational([[0, 0], [0, 1]])]),
    (("-exp(q)",), 1, {}, "cone", [row(1)]),
]


@pytest.mark.parametrize(("f", "nq", "region", "name", "data"), WRONG)
def test_a_type_that_is_wrong_by_five_percent_is_refuted_by_a_pair_in_the_region(f, nq, region, name, data):
    where = within(*f, nq=nq, **region)
    with soon():
        found = search(where, name, data)
    assert found is not None
    assert refutes(where, name, data, found)
    for variable, (low, high) in where.box.items():
        assert low <= float(found.first[variable]) <= high
        assert low <= float(found.second[variable]) <= high
    assert all(found.first[name] == found.second[name] for name in where.others)


TRUE = [
    (("sin(q)",), 1, {}, "lipschitz", ONE),
    (("sin(q)",), 1, {}, "sector", (row(-1), row(1))),
    (("sin(q)",), 1, {}, "multiplier", rational([[1, 0], [0, -1]])),
    (("tanh(q)",), 1, {}, "cocoercive", ONE),
    (("2*q + sin(q)",), 1, {}, "lipschitz", fmpq(3)),
    (("q*abs(q)",), 1, {}, "monotone", None),
    (("q**3",), 1, {}, "monotone", None),
    (("q**3",), 1, {"q": (-2.0, 2.0)}, "lipschitz", fmpq(12)),
    (("q - q**3",), 1, {"q": (-0.577, 0.577)}, "monotone", None),
    (("q*exp(-q**2)",), 1, {}, "slope", [(fmpq(-44627, 100000), ONE)]),
    (("max(q, 0)",), 1, {}, "slope", [(fmpq(0), ONE)]),
    (("1e6*q + 1e-3*sin(q)",), 1, {}, "slope", [(fmpq(999999999, 1000), fmpq(1000000001, 1000))]),
    (("sqrt(1 + q**2)",), 1, {}, "lipschitz", ONE),
    (("q1 + q2",), 2, {}, "lipschitz", fmpq(*np.sqrt(2).as_integer_ratio())),
    (("sin(q1) + cos(q2)",), 2, {}, "lipschitz", fmpq(14143, 10000)),
    (("0.1*q1", "0.3*q2"), 2, {}, "slope", [(fmpq(1, 10), fmpq(1, 10)), (fmpq(3, 10), fmpq(3, 10))]),
    (SOFTMAX, 2, {}, "cocoercive", fmpq(1, 2)),
    (RADIAL, 2, PLANE, "one-sided-lipschitz", (ONE, fmpq(25), fmpq(0))),
    (("sin(q)",), 1, {}, "ball", (row(0), row(1))),
    (("sin(q1) + cos(q2)",), 2, {}, "jacobian", CORNERS),
    (("q1**3", "q2**3 + q1**3"), 2, {}, "cone", [rational([[1, 0], [1, 0]]), rational([[0, 0], [0, 1]])]),
    (("exp(q)",), 1, {}, "cone", [row(1)]),
    (("y1*tanh(q) + t",), 1, {"y1": (0.0, 2.0)}, "lipschitz", fmpq(2)),
    (("q**3",), 1, {}, "slope", [(fmpq(0), None)]),
]


@pytest.mark.parametrize(("f", "nq", "region", "name", "data"), TRUE)
def test_a_type_that_is_exactly_tight_is_never_refuted(f, nq, region, name, data):
    assert search(within(*f, nq=nq, **region), name, data) is None


@examples(20)
@given(st.decimals("0.01", "100", places=2), st.decimals("-5", "5", places=2), st.sampled_from(["sin", "tanh", "atan"]))
def test_a_scaled_and_shifted_function_is_refuted_just_when_its_constant_is_too_small(k, shift, name):
    f = within(f"{k}*{name}(q + ({shift}))")
    exact = fmpq(*k.as_integer_ratio())
    assert search(f, "lipschitz", exact) is None
    found = search(f, "lipschitz", exact * fmpq(95, 100))
    assert found is not None
    assert refutes(f, "lipschitz", exact * fmpq(95, 100), found)


@examples(20)
@given(st.lists(st.integers(-3, 3), min_size=4, max_size=4), st.lists(st.integers(-200, 200), min_size=2, max_size=2))
def test_what_is_in_a_hull_is_never_refuted(entries, hundredths):
    dq = np.array(hundredths) / 100
    exact = np.array([rational([[a, b]]) for a in entries[:2] for b in entries[2:]])
    weights = np.array([0.1, 0.2, 0.3, 0.4])
    df = (weights @ exact[:, 0].astype(float)) @ dq
    assert Hull(exact, conic=False).violation(np.array([dq]), np.array([[df]]))[0] > -1e-9


def spec(block, Bf="[0, 1]", Cq="[1, 0]"):
    return loads(
        "obsdesign: 1\nsystem: {A: [[0, 1], [-1, 0]], C: [1, 0], inputs: [u]}\n"
        f"nonlinearities:\n  - {{{block}, Bf: {Bf}, Cq: {Cq}}}\nobserver: {{type: l2, alpha: 1}}\n",
        "s.yaml",
    )


def refusal(*block):
    with pytest.raises(UsageError) as caught:
        spec(*block)
    (problem,) = caught.value.problems
    assert (problem.key, problem.file, problem.line) == ("nonlinearities[0].type", "s.yaml", 4)
    assert "\n" not in str(problem)
    return problem.message


@pytest.mark.parametrize(
    ("block", "words"),
    [
        (
            "type: {lipschitz: 0.95}, f: sin(q)",
            ("lipschitz 0.95 is refuted by q = ", "|df| = ", " exceeds 0.95 |dq| = "),
        ),
        ("type: {slope: [0, 2.85]}, f: 2*q + sin(q)", ("slope [0, 2.85] is refuted", "df/dq = ", "is above 2.85")),
        ("type: {slope: [0.05, 1]}, f: tanh(q)", ("is below 0.05",)),
        ("type: monotone, f: -q", ("monotone is refuted by q = ", "dq' df = ", "is negative")),
        ("type: {lipschitz: 1}, f: u*q, region: {u: [0, 2]}", ("(at u = 2)",)),
        ("type: {jacobian: [0, 1]}, f: 2*q", ("jacobian of 2 matrices is refuted", "no convex combination")),
        ("type: {cone: [1]}, f: -q", ("no nonnegative combination",)),
        ("type: {sector: {K2: 1}}, f: 2*q", ("(df - K1 dq)' (K2 dq - df) = ",)),
        ("type: {multiplier: [[1, 0], [0, -1]]}, f: 2*q", ("[dq; df]' M [dq; df] = ",)),
        ("type: {one-sided-lipschitz: {rho: 0.9, beta: 9, phi: 0}}, f: q", ("rho dq' dq - dq' df = ",)),
    ],
)
def test_a_refutation_is_one_line_at_the_type(block, words):
    message = refusal(block)
    assert all(part in message for part in words), message


def test_a_refutation_names_every_component():
    message = refusal("type: {lipschitz: 1}, f: q1 + sin(q2)", "[0, 1]", "[[1, 0], [0, 1]]")
    assert message.count("q1 = ") == message.count("q2 = ") == 2


def test_a_component_that_depends_on_another_one_has_no_slope():
    message = refusal("type: {slope: [0, 1]}, f: [q2, q2]", "[[1, 0], [0, 1]]", "[[1, 0], [0, 1]]")
    assert "f1 changes by" in message or "df1/dq1 = " in message


def test_a_pair_is_written_in_few_digits():
    with pytest.raises(UsageError, match=r"refuted by q = -?[0-9.]{1,4} and q = -?[0-9.]{1,4}: "):
        spec("type: {lipschitz: 0.95}, f: sin(q)")


def test_a_region_saves_a_type_that_does_not_hold_everywhere():
    assert spec("type: monotone, f: q**3 - q, region: {q: [1, 2]}").validity
    with pytest.raises(UsageError, match="monotone is refuted"):
        spec("type: monotone, f: q**3 - q")


EDGE = """\
obsdesign: 1
system: {{inputs: [d], A: [[-1]], B: [[1]], C: [[1]]}}
nonlinearities:
  - {{f: (1 - d)*q, type: {{{type}, region: {{d: [0.2, 0.8]}}}}, Bf: [1], Cq: [1]}}
observer: {{{observer}}}
"""
OBSERVERS = [
    "type: l2, alpha: 0.1, bounds: {L1: 10}",
    "type: linf, alpha: 0.1, bounds: {L1: 10}",
    "type: lipschitz, bounds: {L: 10}",
    "type: sporadic, T1: 0.1, T2: 0.2",
]


@pytest.mark.parametrize("observer", OBSERVERS)
@pytest.mark.parametrize("type_", ["slope: [0.2, 0.8]", "lipschitz: 0.8", "cocoercive: 0.8"])
def test_equality_at_the_edge_of_a_region_is_no_refutation(observer, type_, tmp_path):
    path = tmp_path / "edge.yaml"
    path.write_text(EDGE.format(type=type_, observer=observer))
    found = run("solve", path, "-o", tmp_path / "g.json", "-q")
    assert found.exit_code == 0, found.output
    assert run("verify", tmp_path / "g.json").exit_code == 0


@pytest.mark.parametrize("type_", ["slope: [0.2, 0.79999999]", "slope: [0.20000001, 0.8]", "lipschitz: 0.79999999"])
def test_what_passes_its_bound_at_the_edge_of_a_region_only_is_refuted_there(type_, tmp_path):
    path = tmp_path / "edge.yaml"
    path.write_text(EDGE.format(type=type_, observer=OBSERVERS[0]))
    found = run("check", path)
    assert found.exit_code == 2
    d = re.search(r"\(at d = ([0-9.]+)\)", found.stderr)
    assert d is not None, found.stderr
    assert 0.2 <= float(d[1]) <= 0.8


def test_two_searches_find_the_same_pair():
    f = within("sin(q1) + cos(q2)", nq=2)
    assert search(f, "lipschitz", ONE) == search(f, "lipschitz", ONE)


def test_a_refutation_within_a_region_of_every_argument_is_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wild.yaml").write_text(
        "obsdesign: 1\nsystem: {A: [[-1, 0], [0, -1]], B: [1, 0], C: [1, 1]}\nnonlinearities:\n"
        "  - {f: sin(1/(q1**2+q2**2))*cos(exp(q1*q2)), type: {lipschitz: 3, region: {q1: [-5, 5], q2: [-5, 5]}},\n"
        "     Bf: [0, 1], Cq: [[1, 0], [0, 1]]}\nobserver: {type: l2, alpha: 0.1}\n"
    )
    outcome = run("solve", "wild.yaml")
    assert outcome.exit_code == 2
    assert "lipschitz 3 is refuted by q1 = " in outcome.stderr
    assert "cannot have that value" not in outcome.stderr
