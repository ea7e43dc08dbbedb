"""What `verify` believes of observers for sporadic measurements, beyond what test_every_family asks of any claim."""

import copy
import json
from fractions import Fraction

import numpy as np
import pytest
from support.commands import result_of
from support.forging import claiming, scaled, with_text
from support.fractions import fractions, positive

OSCILLATOR = """
obsdesign: 1
name: Oscillator
system: {A: [[0, 1], [-4, 0]], B: [1, 0], C: [1, 0]}
nonlinearities: [{f: 0.5*sin(q), type: {lipschitz: 0.5}, Bf: [0, 1], Cq: [1, 0]}]
observer: {type: sporadic, T1: 0.1, T2: 0.2, decay: 0.05, delta: {min: 1, max: 8, points: 5}, bounds: {L: 10}}
"""
GIVEN = OSCILLATOR.replace("bounds: {L: 10}", "gains: {L: [2.067, -3], H: -1.384}")
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


@pytest.mark.parametrize(
    ("name", "value"), [("T1", 0.05), ("T1", 0.15), ("T2", 0.19), ("T2", 0.3), ("decay", 0.04), ("decay", 0.1)]
)
def test_a_claim_that_the_spec_does_not_ask_for_is_refused(content, outcome_of, name, value):
    outcome = outcome_of(claimed(content, name, value))
    assert outcome.exit_code == 2
    assert f"guarantee.{name}" in outcome.stderr
    assert "not what the spec asks for" in outcome.stderr


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


def test_a_statement_that_says_more_than_the_numbers_is_refused(content, outcome_of):
    statement = content["guarantee"]["statement"]
    content["guarantee"]["statement"] = statement.replace("no later than 0.2", "no later than 2.0")
    assert content["guarantee"]["statement"] != statement
    outcome = outcome_of(content)
    assert outcome.exit_code == 2
    assert "guarantee.statement" in outcome.stderr


def test_a_claim_of_this_family_is_no_claim_of_another_one(content, outcome_of):
    text = "obsdesign: 1\nsystem: {A: [[0, 1], [-4, 0]], B: [1, 0], C: [1, 0]}\nobserver: {type: l2, alpha: 1}\n"
    assert outcome_of(with_text(content, text)).exit_code == 2


def test_gains_that_the_spec_gives_may_not_be_replaced_by_better_ones(certified, genuine, outcome_of):
    content, better = json.loads(certified(GIVEN, "given")), json.loads(genuine)
    assert outcome_of(content).exit_code == 0
    for section in ("observer", "guarantee", "certificate"):
        content[section] = better[section]
    outcome = outcome_of(content)
    assert outcome.exit_code == 2
    assert "differs from the gain that the spec gives" in outcome.stderr


@pytest.fixture(scope="module")
def analyzed(certified):
    """The file of given gains, which says up to which T2 they are proved."""
    return json.loads(certified(GIVEN, "analyzed"))


def test_the_longest_interval_of_given_gains_is_proved_too(analyzed, outcome_of):
    assert analyzed["guarantee"]["T2_max"] > 0.2
    outcome = outcome_of(copy.deepcopy(analyzed))
    assert outcome.exit_code == 0
    assert "T2_max: P1 > 0" in outcome.stdout
