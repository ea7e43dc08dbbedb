"""What `verify` believes of bounds on |what - w|, beyond what test_every_family asks of any claim."""

import copy

import pytest
from support.commands import result_of
from support.forging import at, claiming, put, scaled, with_spec

TANK = """
obsdesign: 1
name: Tank
system: {A: [[-1, 0.3], [0.2, -2]], B: [[1], [0.5]], C: [[1, 0]], D: [[0.1]]}
nonlinearities: [{f: sin(q), type: {slope: [-1, 1]}, Bf: [[0.3], [0.5]], Cq: [[0.3, 1]], Dqf: [[0.2]], Dq: [[0.1]]}]
observer: {type: linf, reconstruct: w, alpha: 0.5, bounds: {L1: 20}}
"""
ROOT = ("certificate", "reconstruction")
LEVELS = ("pinv(B) A e", "(Cq + L2 C) e", "pinv(B) e' from w'", "pinv(B) e' from d")
SLOPES = ("slope of f", "variation of the slope")
pytestmark = pytest.mark.xdist_group("verify-linf")  # its results are solved for once


@pytest.fixture(scope="module")
def genuine(tmp_path_factory):
    """The text of a certified result with a reconstruction."""
    return result_of(tmp_path_factory.mktemp("tank"), TANK)


def test_the_genuine_file_is_proved(content, outcome_of):
    outcome = outcome_of(content)
    assert outcome.exit_code == 0
    assert set(at(content, ROOT)["levels"]) == set(LEVELS)
    assert set(at(content, ROOT)["slopes"]) == set(SLOPES)


# The guarantee of the family


def test_the_same_storage_function_is_no_proof_for_the_other_family(content, outcome_of):
    forged = with_spec(content, "type: linf, reconstruct: w", "type: l2")
    assert outcome_of(forged).exit_code == 2  # observer.type
    forged["observer"]["type"] = "l2"
    assert outcome_of(forged).exit_code == 2  # a reconstruction
    del forged["guarantee"]["reconstruction"]
    assert outcome_of(forged).exit_code == 4


# The bound on the reconstruction


@pytest.mark.parametrize("key", ["w", "w_rate", "x_rate"])
def test_a_smaller_constant_is_not_proved(content, outcome_of, key):
    constant = content["guarantee"]["reconstruction"][key]
    smaller = constant * (1 - 1e-6)
    content["guarantee"]["reconstruction"][key] = smaller
    assert outcome_of(content).exit_code == 4
    outcome = outcome_of(claiming(content, constant, smaller))
    assert outcome.exit_code == 4
    assert "is large enough" in outcome.stderr


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize(
    ("key", "factor"),
    [
        ("gamma", "0.999"),
        ("gamma", "-1"),
        ("mu1", "0.5"),
        ("mu1", "2"),
        ("mu2", "0.5"),
        ("mu2", "2"),
        ("alpha", "10"),
        ("alpha", "-1"),
    ],
)
def test_a_forged_level_proves_nothing(content, outcome_of, level, key, factor):
    outcome = outcome_of(scaled(content, (*ROOT, "levels", level, key), factor))
    assert outcome.exit_code == 4
    assert level in outcome.stderr


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("factor", ["-1", "5"])
def test_a_forged_multiplier_of_a_level_proves_nothing(content, outcome_of, level, factor):
    assert outcome_of(scaled(content, (*ROOT, "levels", level, "multipliers", "lambda1"), factor)).exit_code == 4


@pytest.mark.parametrize("level", LEVELS)
def test_a_level_is_not_proved_by_that_of_another(content, outcome_of, level):
    """Each has another output or another input; the level of w' serves for one whose output is smaller only."""
    found = at(content, ROOT)["levels"]
    caught = 0
    for other in LEVELS:
        forged = copy.deepcopy(content)
        at(forged, ROOT)["levels"][level] = found[other]
        code = outcome_of(forged).exit_code
        assert code in {0, 4}
        assert code == 0 or other != level
        caught += code == 4
    assert caught >= 1


@pytest.mark.parametrize("slope", SLOPES)
@pytest.mark.parametrize(("factor", "code"), [("0.99", 4), ("0", 4), ("-1", 4), ("1.5", 4)])
def test_a_forged_bound_on_the_slope_proves_nothing(content, outcome_of, slope, factor, code):
    """A larger one is proved, and the constants are too small for it."""
    outcome = outcome_of(scaled(content, (*ROOT, "slopes", slope, "bound"), factor))
    assert outcome.exit_code == code


@pytest.mark.parametrize("slope", SLOPES)
@pytest.mark.parametrize("factor", ["-1", "0", "2"])
def test_a_forged_multiplier_of_a_slope_proves_nothing(content, outcome_of, slope, factor):
    outcome = outcome_of(scaled(content, (*ROOT, "slopes", slope, "values", "lambda1"), factor))
    assert outcome.exit_code == 4
    assert slope in outcome.stderr


def test_a_slope_that_leaves_the_loop_open_is_refused(content, outcome_of):
    outcome = outcome_of(put(content, (*ROOT, "slopes", "slope of f", "bound"), 5.0))
    assert outcome.exit_code == 2
    assert "not below 1" in outcome.stderr


def test_a_file_may_claim_less(content, outcome_of):
    """Without the bound in claim, witness and statement, what is left is proved."""
    del content["guarantee"]["reconstruction"], content["certificate"]["reconstruction"]
    assert outcome_of(content).exit_code == 2
    statement = content["guarantee"]["statement"]
    content["guarantee"]["statement"] = statement.partition("; limsup |what - w|")[0]
    assert outcome_of(content).exit_code == 0


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (", reconstruct: w", "", "does not ask for it"),
        ("f: sin(q)", "f: sin(q + t)", "depends on t"),
        ("f: sin(q)", "f: sin(q)*cos(y1)", "depends on y1"),
        ("Dqf: [[0.2]]", "Dqf: [[0.2]], gq: t", "known terms"),
        ("Dqf: [[0.2]]", "Dqf: [[0.2]], Df: [[0.1]]", "Df = 0"),
        ("Dqf: [[0.2]]", "Dqf: [[1.2]]", "not below 1"),
        ("observer:", "disturbance: integrator\nobserver:", "spec.text"),
        ("B: [[1], [0.5]]", "B: [[0], [0]]", "spec.text"),
    ],
)
def test_a_spec_that_admits_no_such_bound_is_found_out(content, outcome_of, old, new, reason):
    outcome = outcome_of(with_spec(content, old, new))
    assert outcome.exit_code == 2
    assert reason in outcome.stderr


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("slope: [-1, 1]", "slope: [-2, 2]"),
        ("D: [[0.1]]", "D: [[0.2]]"),
        ("Dq: [[0.1]]", "Dq: [[-3]]"),
        ("Bf: [[0.3], [0.5]]", "Bf: [[30], [50]]"),
        ("B: [[1], [0.5]]", "B: [[1], [5]]"),
        ("[0.2, -2]]", "[0.2, -0.2]]"),
    ],
)
def test_another_plant_is_not_proved_by_it(content, outcome_of, old, new):
    forged = with_spec(content, old, new)
    if "slope" in old:
        forged = with_spec(forged, "f: sin(q), ", "f: 2*sin(q), ") | {"notes": []}
    assert outcome_of(forged).exit_code == 4
