"""What `verify` believes of observers of Lipschitz systems, beyond what test_every_family asks of any claim.

The results are made by hand, of gains that are given here, so that nothing but the proof is tested.
"""

import copy
import itertools
import json
from fractions import Fraction

import numpy as np
import pytest
from flint import fmpq
from support.forging import claiming, scaled, with_spec
from support.lipschitz import FRONT, PAIR, QUIET, QUIET_L, L, designed, made, written

from obsdesign.design import Design
from obsdesign.work import read


@pytest.fixture(scope="module")
def results():
    """Results by name."""
    return {
        "pair": made(PAIR, fmpq(3, 10), 0.72, admissible=(fmpq(9, 10), 1.5)),
        "quiet": made(QUIET, fmpq(1), gain=QUIET_L),
        "front": made(FRONT, fmpq(1, 2), 0.9, gain=2 * L, decay=0.025),
    }


@pytest.fixture(params=["pair", "quiet", "front"])
def content(request, results):
    """A result, to be forged."""
    return copy.deepcopy(results[request.param])


@pytest.fixture
def pair(results):
    """The one with two blocks, and with a larger constant that is tolerated."""
    return copy.deepcopy(results["pair"])


@pytest.fixture
def quiet(results):
    """The one without w, and with the largest constant as the objective."""
    return copy.deepcopy(results["quiet"])


# What the numbers say


def test_a_genuine_file_is_proved(content, outcome_of):
    outcome = outcome_of(content)
    assert outcome.exit_code == 0
    last = outcome.stdout.splitlines()[-1]
    assert last.startswith(f"proved: Lipschitz constant {content['guarantee']['lipschitz']:g}")
    assert f"decay rate {content['guarantee']['decay']:g} 1/s" in last
    assert ("gamma" in last) == ("gamma" in content["guarantee"])


def test_no_linear_f_of_the_claim_is_slower_than_the_rate_or_has_a_larger_gain(pair):
    guarantee, gain = pair["guarantee"], np.array(pair["observer"]["L"])
    A, B, C, D = np.array([[0, 1], [-1, -1]]), np.array([[1, 0], [1, 0]]), np.array([[1, 0]]), np.array([[0, 0.2]])
    levels = [(guarantee["lipschitz"], guarantee["gamma"])]
    levels += [(guarantee["admissible"], pair["certificate"]["admissible"]["gamma"])]
    worst = 0.0
    for (c, gamma), *signs in itertools.product(levels, (-1, 0, 1), (-1, 0, 1)):
        F = A - gain @ C + np.array([[0, 0], [signs[0] * c, signs[1] * c / 3]])
        assert np.linalg.eigvals(F).real.max() <= -guarantee["decay"]
        response = np.linalg.solve(1j * np.geomspace(1e-3, 1e3, 500)[:, None, None] * np.eye(2) - F, B - gain @ D)
        worst = max(worst, 0.5 * np.linalg.norm(response, 2, axis=(1, 2)).max() / gamma)
    assert 0.5 < worst <= 1


def test_what_is_left_for_an_uncertainty_is_what_is_tolerated_beyond_the_declared_constant(pair, quiet):
    assert pair["guarantee"]["margin"] == 0.6
    assert pair["guarantee"]["constants"] == [0.3, 0.1]
    assert "|dh1| <= 0.6 |dq1|, |dh2| <= 0.2 |dq2|" in pair["guarantee"]["statement"]
    assert quiet["guarantee"]["margin"] == 0.6
    assert "Proposition 1: the same for f + h" in quiet["guarantee"]["statement"]


def test_without_w_there_is_no_gamma(quiet, outcome_of):
    assert not {"gamma", "mu1", "mu2"} & set(quiet["guarantee"])
    assert "norm2(w)" not in quiet["guarantee"]["statement"]
    quiet["guarantee"]["gamma"] = 0.1
    outcome = outcome_of(quiet)
    assert outcome.exit_code == 2
    assert "guarantee.gamma" in outcome.stderr


def test_a_limit_that_is_infinite_is_called_unbounded(content):
    assert content["guarantee"]["limit"] == {"unbounded": True, "attained": False}


def test_a_constant_that_no_double_holds_is_covered_by_the_next_one_above(outcome_of):
    text, above = PAIR.replace("lipschitz: 0.3", "lipschitz: 2/3"), "0.6666666666666667"
    content = made(text, fmpq(int(above[2:]), 10**16), 1.1)
    assert content["guarantee"]["lipschitz"] == float(above)
    assert Fraction(above) > Fraction(2, 3)
    assert content["guarantee"]["margin"] == 0
    assert outcome_of(content).exit_code == 0
    content["guarantee"]["lipschitz"] = 2 / 3
    said = f"guarantee.lipschitz: {2 / 3!r} is not what the spec asks for, {above} [OBS707]"
    assert said in outcome_of(content).stderr


def test_where_the_types_hold_is_said(outcome_of):
    local = made(PAIR.replace("{lipschitz: 0.1}", "{lipschitz: 0.1}, region: {q: [-1, 2]}"), fmpq(3, 10), 0.72)
    assert (
        "; local: as long as q of nonlinearities[1] and its estimate stay in [-1, 2]; assumed: "
        in (local["guarantee"]["statement"])
    )
    assert outcome_of(local).exit_code == 0


# Tampering


@pytest.mark.parametrize("factor", ["0.99", "1.01", "-1"])
@pytest.mark.parametrize("key", ["lipschitz", "gamma", "mu1", "mu2"])
def test_a_forged_number_of_the_larger_claim_is_caught(pair, outcome_of, key, factor):
    assert outcome_of(scaled(pair, ("certificate", "admissible", key), factor)).exit_code in {2, 4}


@pytest.mark.parametrize("lipschitz", [1.5, 5.0, 1e300])
def test_a_larger_constant_is_not_proved_even_with_the_margin_and_the_statement_of_it(quiet, outcome_of, lipschitz):
    margin = float(Fraction(repr(lipschitz)) - Fraction("0.4"))
    claiming(quiet, "|df| <= 1.0 |dq|", f"|df| <= {lipschitz!r} |dq|", lipschitz=lipschitz, margin=margin)
    statement = quiet["guarantee"]["statement"]
    quiet["guarantee"]["statement"] = statement.replace("|dh| <= 0.6 |dq|", f"|dh| <= {margin!r} |dq|")
    assert outcome_of(quiet).exit_code == 4


@pytest.mark.parametrize("lipschitz", [0.29, 0.31])
def test_for_the_least_gamma_the_constant_is_the_declared_one(pair, outcome_of, lipschitz):
    pair["guarantee"]["lipschitz"] = lipschitz
    outcome = outcome_of(pair)
    assert outcome.exit_code == 2
    assert "guarantee.lipschitz" in outcome.stderr
    assert "not what the spec asks for" in outcome.stderr


def test_on_a_front_the_constant_is_at_least_the_declared_one(results, outcome_of):
    content = copy.deepcopy(results["front"])
    assert outcome_of(content).exit_code == 0
    content["guarantee"]["lipschitz"] = 0.39
    assert "guarantee.lipschitz" in outcome_of(content).stderr


@pytest.mark.parametrize("decay", [0.049, 0.051, -0.05])
def test_the_decay_is_the_one_that_the_spec_asks_for(pair, outcome_of, decay):
    outcome = outcome_of(claiming(pair, "exp(-0.05 t)", f"exp(-{decay!r} t)", decay=decay))
    assert outcome.exit_code == 2
    assert "guarantee.decay" in outcome.stderr


def test_a_larger_constant_in_the_spec_is_not_covered(pair, outcome_of):
    with_spec(pair, "lipschitz: 0.3", "lipschitz: 9")
    assert outcome_of(pair).exit_code == 2


def test_constants_in_another_proportion_are_another_problem(pair, outcome_of):
    with_spec(pair, "lipschitz: 0.1", "lipschitz: 0.2")
    assert outcome_of(pair).exit_code in {2, 4}


def test_a_larger_constant_below_the_one_of_the_claim_is_refused(pair, outcome_of):
    pair["guarantee"]["admissible"] = pair["certificate"]["admissible"]["lipschitz"] = 0.2
    outcome = outcome_of(pair)
    assert outcome.exit_code == 2
    assert "guarantee.admissible" in outcome.stderr


def test_another_relaxation_is_refused(pair, outcome_of):
    pair["observer"]["relaxation"] = "norm-bound"
    outcome = outcome_of(pair)
    assert outcome.exit_code == 2
    assert "observer.relaxation" in outcome.stderr


def test_a_gain_that_the_spec_gives_may_not_be_replaced(pair, outcome_of):
    with_spec(pair, "decay: 0.05", "decay: 0.05, gains: {L: [[1], [0.5]]}")
    assert outcome_of(pair).exit_code == 0
    with_spec(pair, "[[1], [0.5]]", "[[1], [0.6]]")
    outcome = outcome_of(pair)
    assert outcome.exit_code == 2
    assert "differs from the gain that the spec gives" in outcome.stderr


@pytest.mark.parametrize(
    ("bound", "held"), [("5.657", True), ("5.656", False), ("{frobenius: 5.657}", True), ("{frobenius: 5.656}", False)]
)
def test_the_bound_of_the_spec_on_the_gain_is_held(quiet, outcome_of, bound, held):
    quiet["certificate"]["checks"].append({"name": "|L| <= kappa", "holds": True})
    outcome = outcome_of(with_spec(quiet, "decay: 0.05", f"decay: 0.05, bounds: {{L: {bound}}}"))
    assert outcome.exit_code == (0 if held else 4)
    assert f"{'holds' if held else 'FAILS'}  |L| <= kappa" in outcome.stdout


def test_a_bound_does_not_hold_a_gain_that_the_spec_gives(quiet, outcome_of):
    with_spec(quiet, "decay: 0.05", "decay: 0.05, gains: {L: [[4], [4]]}, bounds: {L: 1}")
    assert outcome_of(quiet).exit_code == 0


def test_the_two_norms_of_a_gain_differ(outcome_of):
    text = QUIET.replace("C: [1, 0]", "C: [[1, 0], [0, 1]]").replace("decay: 0.05", "decay: 0.05, bounds: {L: 3}")
    content = made(text, fmpq(1), gain=3 * np.eye(2))
    content["certificate"]["checks"].append({"name": "|L| <= kappa", "holds": True})
    assert outcome_of(content).exit_code == 0
    assert outcome_of(with_spec(content, "{L: 3}", "{L: {frobenius: 3}}")).exit_code == 4


# For a simulation


@pytest.fixture
def recorded_of(tmp_path):
    """Writes a file and reads it for a simulation."""

    def recorded_of(content):
        (tmp_path / "gains.json").write_text(json.dumps(content))
        return read(tmp_path / "gains.json")

    return recorded_of


def test_a_simulation_gets_the_gain_with_the_sign_of_the_paper_and_the_guarantee(pair, recorded_of):
    design = recorded_of(pair)
    spec, gains, guarantee = design.spec, design.gains, design.guarantee
    assert spec.observer.lipschitz == (fmpq(3, 10), fmpq(1, 10))
    assert gains.keys() == {"L"}
    np.testing.assert_array_equal(gains["L"], L)
    assert (guarantee.symbol_in_words, guarantee.gamma, guarantee.rate, guarantee.mu1) == ("decay", 0.72, 0.05, 1)
    assert np.linalg.eigvalsh(guarantee.doubles).min() > 0


def test_a_claim_that_the_declared_constant_is_beyond_is_proved_but_guarantees_nothing_of_the_plant(
    quiet, outcome_of, recorded_of
):
    assert recorded_of(quiet).guarantee is not None
    spec, design = designed(QUIET.replace("lipschitz: 0.4", "lipschitz: 1.25"), fmpq(1), gain=QUIET_L)
    assert Design.of(spec, design).guarantee is None
    content = written(spec, design)
    assert content["guarantee"]["margin"] == -0.25
    assert "the spec declares 1.25, of which this says nothing" in content["guarantee"]["statement"]
    assert outcome_of(content).exit_code == 0
    assert recorded_of(content).guarantee is None
