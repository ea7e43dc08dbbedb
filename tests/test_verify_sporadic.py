"""What `verify` believes of observers for sporadic measurements: nothing that is not proved."""

import copy
import json
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.commands import result_of, run
from support.forging import at, claiming, put, scaled, with_spec, with_text
from support.fractions import fractions, positive
from support.sweep import examples

OSCILLATOR = """
obsdesign: 1
name: Oscillator
system: {A: [[0, 1], [-4, 0]], B: [1, 0], C: [1, 0]}
nonlinearities: [{f: 0.5*sin(q), type: {lipschitz: 0.5}, Bf: [0, 1], Cq: [1, 0]}]
observer: {type: sporadic, T1: 0.1, T2: 0.2, decay: 0.05, delta: {min: 1, max: 8, points: 5}, bounds: {L: 10}}
"""
GIVEN = OSCILLATOR.replace("bounds: {L: 10}", "gains: {L: [2.067, -3], H: -1.384}")
CLAIM = ("gamma", "mu", "decay", "T1", "T2")
pytestmark = pytest.mark.xdist_group("verify-sporadic")  # its results are solved for once


@pytest.fixture(scope="module")
def certified(tmp_path_factory):
    """Solves a spec and returns the text of its result."""
    folder = tmp_path_factory.mktemp("oscillator")

    def certified(text, name):
        return result_of(folder, text, name)

    return certified


@pytest.fixture(scope="module")
def genuine(certified):
    """The text of a certified design."""
    return certified(OSCILLATOR, "designed")


def claimed(content, name, value):
    """A content with another number of its guarantee, wherever it stands."""
    if name in content["observer"]:
        content["observer"][name] = value
    return claiming(content, content["guarantee"][name], value, **{name: value})


# An independent proof


def above_exponential(x):
    """A fraction a little above exp(x), 0 <= x <= 10: forty terms of the series and more than the rest."""
    term, total = Fraction(1), Fraction(1)
    for k in range(1, 41):
        term *= Fraction(x) / k
        total += term
    return total + term


def dissipation(content, s):
    """V' + 2 decay V + |z|^2 - mu |w|^2 + m (l^2 |dq|^2 - |df|^2) as a matrix in (e, d, w, df).

    V = e' P1 e + s d' P2 d with s = exp(delta tau), tau' = -1; the dynamics of e = x - xhat and d = C e - theta follow
    from the statement.
    """
    observer, guarantee, proof = content["observer"], content["guarantee"], content["certificate"]
    A, C = fractions([[0, 1], [-4, 0]]), fractions([[1, 0]])
    L, H, P1, P2 = map(fractions, (observer["L"], observer["H"], proof["P1"], proof["P2"]))
    delta, decay, mu = fractions([observer["delta"], guarantee["decay"], guarantee["mu"]])
    scale = fractions([*proof["multipliers"].values()]).item()
    e, d, w, f = np.split(fractions(np.eye(5, dtype=int)), [2, 3, 4])
    e_rate = A @ e + fractions([[1], [0]]) @ w + fractions([[0], [1]]) @ f - L @ (C @ e - d)
    d_rate = C @ e_rate - H @ (C @ e - d)
    half = e.T @ P1 @ (e_rate + decay * e) + s * d.T @ P2 @ (d_rate + (decay - delta / 2) * d)
    q = e[:1] / 2  # e1 with the Lipschitz constant 1/2
    return half + half.T + e.T @ e - mu * w.T @ w + scale * (q.T @ q - f.T @ f)


@pytest.mark.parametrize("spec", [OSCILLATOR, GIVEN])
def test_the_numbers_of_a_file_prove_its_claim_by_hand(certified, spec):
    content = json.loads(certified(spec, "by-hand"))
    exponent = Fraction(str(content["observer"]["delta"])) * Fraction(str(content["observer"]["T2"]))
    assert 0 < exponent <= 10
    for s in (Fraction(1), above_exponential(exponent)):
        assert positive(-dissipation(content, s))
    assert positive(fractions(content["certificate"]["P1"]), strict=True)
    assert positive(fractions(content["certificate"]["P2"]), strict=True)
    assert Fraction(str(content["guarantee"]["gamma"])) ** 2 >= Fraction(str(content["guarantee"]["mu"])) >= 0
    assert 0 < content["guarantee"]["T1"] <= content["guarantee"]["T2"]


# Tampering


def test_the_genuine_file_is_proved(content, outcome_of):
    outcome = outcome_of(content)
    assert outcome.exit_code == 0
    assert outcome.stdout.splitlines()[-1].startswith("proved: gamma ")
    assert "intervals from 0.1 to 0.2 s" in outcome.stdout
    assert content["certificate"]["multipliers"]


@pytest.mark.parametrize("factor", ["0.99", "1.01", "0", "-1"])
@pytest.mark.parametrize("key", CLAIM)
def test_a_forged_number_of_the_claim_is_caught(content, outcome_of, key, factor):
    assert outcome_of(scaled(content, ("guarantee", key), factor)).exit_code in {2, 4}


@pytest.mark.parametrize("factor", [0.99, 0.5, 0, -1])
def test_a_lower_gamma_is_not_proved_even_with_the_mu_and_the_statement_of_it(content, outcome_of, factor):
    gamma = content["guarantee"]["gamma"] * factor
    claimed(content, "gamma", gamma)
    content["guarantee"]["mu"] = gamma * gamma
    assert outcome_of(content).exit_code == 4


@pytest.mark.parametrize(
    ("name", "value"), [("T1", 0.05), ("T1", 0.15), ("T2", 0.19), ("T2", 0.3), ("decay", 0.04), ("decay", 0.1)]
)
def test_a_claim_that_the_spec_does_not_ask_for_is_refused(content, outcome_of, name, value):
    outcome = outcome_of(claimed(content, name, value))
    assert outcome.exit_code == 2
    assert f"guarantee.{name}" in outcome.stderr
    assert "not what the spec asks for" in outcome.stderr


@pytest.mark.parametrize(
    ("old", "new", "name", "value"), [("T2: 0.2", "T2: 3", "T2", 3.0), ("0.05", "8", "decay", 8.0)]
)
def test_a_claim_beyond_what_the_gains_achieve_is_not_proved_with_a_spec_that_asks_for_it(
    content, outcome_of, old, new, name, value
):
    outcome = outcome_of(claimed(with_spec(content, old, new), name, value))
    assert outcome.exit_code == 4
    assert "NOT proved" in outcome.stdout


def test_a_larger_lipschitz_constant_in_the_spec_is_not_covered(content, outcome_of):
    with_spec(content, "0.5*sin(q), type: {lipschitz: 0.5}", "9*sin(q), type: {lipschitz: 9}")
    assert outcome_of(content).exit_code == 4


@pytest.mark.parametrize("factor", ["0", "-1", "0.1", "10", "1000000"])
def test_a_forged_exponent_proves_nothing(content, outcome_of, factor):
    assert outcome_of(scaled(content, ("observer", "delta"), factor)).exit_code in {2, 4}


@pytest.mark.parametrize("value", [0.1999, 0.2001, 0, -0.2])
@pytest.mark.parametrize("name", ["T1", "T2"])
def test_intervals_of_the_observer_that_differ_from_those_of_the_guarantee_are_refused(
    content, outcome_of, name, value
):
    content["observer"][name] = value
    outcome = outcome_of(content)
    assert outcome.exit_code == 2
    assert f"observer.{name}" in outcome.stderr


@pytest.mark.parametrize("factor", ["0", "-1", "0.5", "2"])
@pytest.mark.parametrize("name", ["L", "H"])
def test_other_gains_are_not_proved(content, outcome_of, name, factor):
    assert outcome_of(scaled(content, ("observer", name), factor)).exit_code == 4


@pytest.mark.parametrize("factor", ["0", "-1", "1/2", "2"])
@pytest.mark.parametrize("name", ["P1", "P2"])
def test_a_forged_storage_function_proves_nothing(content, outcome_of, name, factor):
    outcome = outcome_of(scaled(content, ("certificate", name), factor))
    assert outcome.exit_code == 4
    assert "NOT proved" in outcome.stdout


@pytest.mark.parametrize("factor", ["0", "-1", "100"])
def test_a_forged_multiplier_proves_nothing(content, outcome_of, factor):
    (name,) = content["certificate"]["multipliers"]
    assert outcome_of(scaled(content, ("certificate", "multipliers", name), factor)).exit_code == 4


def test_an_asymmetric_storage_function_proves_nothing(content, outcome_of):
    assert outcome_of(scaled(content, ("certificate", "P1", 0, 1), 1 + Fraction(1, 10**15))).exit_code == 4


def test_a_statement_that_says_more_than_the_numbers_is_refused(content, outcome_of):
    statement = content["guarantee"]["statement"]
    content["guarantee"]["statement"] = statement.replace("no later than 0.2", "no later than 2.0")
    assert content["guarantee"]["statement"] != statement
    outcome = outcome_of(content)
    assert outcome.exit_code == 2
    assert "guarantee.statement" in outcome.stderr


@pytest.mark.parametrize("type_", ["l2", "linf", "Sporadic", "", None, 1])
def test_another_family_is_refused(content, outcome_of, type_):
    content["observer"]["type"] = type_
    outcome = outcome_of(content)
    assert outcome.exit_code == 2
    assert "observer.type" in outcome.stderr


def test_a_claim_of_this_family_is_no_claim_of_another_one(content, outcome_of):
    text = "obsdesign: 1\nsystem: {A: [[0, 1], [-4, 0]], B: [1, 0], C: [1, 0]}\nobserver: {type: l2, alpha: 1}\n"
    assert outcome_of(with_text(content, text)).exit_code == 2


def test_a_changed_spec_is_refused(content, outcome_of):
    content["spec"]["text"] = content["spec"]["text"].replace("-4", "-5")
    assert "spec.sha256" in outcome_of(content).stderr


def test_gains_that_the_spec_gives_may_not_be_replaced_by_better_ones(certified, genuine, outcome_of):
    content, better = json.loads(certified(GIVEN, "given")), json.loads(genuine)
    assert outcome_of(content).exit_code == 0
    for section in ("observer", "guarantee", "certificate"):
        content[section] = better[section]
    outcome = outcome_of(content)
    assert outcome.exit_code == 2
    assert "differs from the gain that the spec gives" in outcome.stderr


# Malformed files

PLACES = [
    *(("guarantee", key) for key in CLAIM),
    ("guarantee", "statement"),
    ("observer", "type"),
    ("observer", "L"),
    ("observer", "H"),
    ("observer", "T1"),
    ("observer", "T2"),
    ("observer", "delta"),
    ("certificate", "P1"),
    ("certificate", "P2"),
    ("certificate", "multipliers"),
    ("observer",),
    ("guarantee",),
    ("certificate",),
    ("status",),
    ("spec",),
]
ODD = ["NaN", "1/0", "1e999999999", None, True, [], [["1", "2"], ["3"]], {"a": 1}]


@pytest.mark.parametrize("keys", PLACES, ids=".".join)
def test_a_missing_key_is_named(content, outcome_of, keys):
    del at(content, keys[:-1])[keys[-1]]
    outcome = outcome_of(content)
    assert outcome.exit_code == 2
    assert f"{'.'.join(keys)}" in outcome.stderr
    assert "missing" in outcome.stderr


@pytest.mark.parametrize("keys", PLACES, ids=".".join)
def test_what_is_no_number_or_matrix_or_text_there_is_refused(content, outcome_of, keys):
    for odd in ODD:
        forged = put(copy.deepcopy(content), keys, odd)
        assert outcome_of(forged).exit_code in {2, 4}, odd


@pytest.mark.parametrize("text", ["NaN", "Infinity", "-Infinity"])
@pytest.mark.parametrize("keys", [("guarantee", "gamma"), ("certificate", "P1", 0, 0), ("observer", "L", 0, 0)])
def test_not_a_number_is_not_read(content, outcome_of, keys, text):
    put(content, keys, float(text.replace("Infinity", "inf")))
    outcome = outcome_of(content)
    assert outcome.exit_code == 2
    assert "is no number" in outcome.stderr


@examples(40)
@given(data=st.data())
def test_no_forgery_is_answered_with_a_traceback_or_believed_where_gamma_is_lower(content, outcome_of, data):
    forged = claimed(copy.deepcopy(content), "gamma", data.draw(st.floats(0, content["guarantee"]["gamma"] * 0.9)))
    forged["guarantee"]["mu"] = forged["guarantee"]["gamma"] ** 2
    places = [("certificate", "P1"), ("certificate", "P2"), ("observer", "delta"), ("observer", "L"), ("observer", "H")]
    for keys in data.draw(st.lists(st.sampled_from(places), max_size=3)):
        scaled(forged, keys, data.draw(st.fractions(-3, 3, max_denominator=20)))
    assert outcome_of(forged).exit_code in {2, 4}


# No solution


@pytest.fixture(scope="module")
def hopeless(tmp_path_factory):
    """The text of an infeasible result."""
    folder = tmp_path_factory.mktemp("hopeless")
    (folder / "spec.yaml").write_text(OSCILLATOR.replace("T2: 0.2", "T2: 1.2"))
    outcome = run("solve", folder / "spec.yaml", "-o", folder / "out.json")
    assert outcome.exit_code == 3, outcome.output
    return (folder / "out.json").read_text()


def test_an_infeasible_result_without_a_certificate_proves_nothing(hopeless, outcome_of):
    outcome = outcome_of(hopeless)
    assert outcome.exit_code == 2
    assert "certificate" in outcome.stderr


@pytest.mark.parametrize("certificate", [{}, {"alpha": "1"}, {"alpha": "1", "multipliers": {}}, [], 1])
def test_an_infeasible_result_with_a_certificate_of_another_family_is_refused(hopeless, outcome_of, certificate):
    content = json.loads(hopeless)
    content["diagnosis"]["certificate"] = certificate
    assert outcome_of(content).exit_code == 2


def test_an_infeasible_result_is_not_made_certified_by_saying_so(hopeless, outcome_of):
    assert outcome_of(json.loads(hopeless) | {"status": "certified"}).exit_code == 2


# Numbers that follow from the certificate


@pytest.mark.parametrize("key", ["rate", "overshoot", "initial", "disturbance", "noise", "jitter"])
def test_a_constant_that_does_not_follow_from_the_certificate_is_refused(content, outcome_of, key):
    content["guarantee"][key] *= 0.5
    outcome = outcome_of(content)
    assert outcome.exit_code == 2
    assert f"guarantee.{key}" in outcome.stderr


@pytest.fixture(scope="module")
def analyzed(certified):
    """The file of given gains, which says up to which T2 they are proved."""
    return json.loads(certified(GIVEN, "analyzed"))


def test_the_longest_interval_of_given_gains_is_proved_too(analyzed, outcome_of):
    assert analyzed["guarantee"]["T2_max"] > 0.2
    outcome = outcome_of(copy.deepcopy(analyzed))
    assert outcome.exit_code == 0
    assert "T2_max: P1 > 0" in outcome.stdout


def test_a_longer_interval_than_is_proved_is_caught(analyzed, outcome_of):
    forged = copy.deepcopy(analyzed)
    forged["guarantee"]["T2_max"] *= 1.1
    assert outcome_of(forged).exit_code == 4
    del forged["certificate"]["T2_max"]
    outcome = outcome_of(forged)
    assert outcome.exit_code == 2
    assert "certificate.T2_max" in outcome.stderr
