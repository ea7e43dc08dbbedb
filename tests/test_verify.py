"""What `verify` believes: nothing that the exact proof does not show, of nothing but the file as it is written."""

import json
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.commands import run
from support.forging import put, with_figures, with_spec
from support.sweep import examples

from obsdesign.errors import UsageError
from obsdesign.families.incremental.theorems import L2
from obsdesign.files import ResultFile
from obsdesign.reading import load
from obsdesign.work import verify


@pytest.fixture(scope="session")
def genuine(made) -> str:
    """The text of a certified result."""
    return (made / "cart.gains.json").read_text()


def restated(content, **claim):
    """A content whose claim is changed, and whose statement says so."""
    content["guarantee"] |= claim
    g = content["guarantee"]
    g["statement"] = L2.about.statement.format(gamma=repr(float(g["gamma"])), rate=repr(float(g["alpha"])))
    return content


def test_the_genuine_file_is_proved_and_proved_again_when_written_otherwise(genuine, content, outcome_of):
    assert outcome_of(genuine).exit_code == 0
    assert outcome_of(json.dumps(content, indent=7, sort_keys=True)).exit_code == 0


# The theorem, written out by hand for the cart


def largest_eigenvalue(content):
    """Largest eigenvalue of the dissipation inequality and of -P, in doubles, rows scaled to a unit diagonal.

    The cart under a force w' = v, with one nonlinearity of slope in [-1, 1] (the sine) and L2 = 0:
    V = e' P e, V' + 2 alpha V + mu1 |z|^2 - mu2 |v|^2 + 2 lambda (dq^2 - df^2) <= 0, z the error of the states.
    """
    L1 = np.array(content["observer"]["L1"], dtype=float)
    P = np.array([[float(Fraction(x)) for x in row] for row in content["certificate"]["P"]])
    (scale,) = (float(Fraction(x)) for x in content["certificate"]["multipliers"].values())
    g = {k: float(Fraction(str(v))) for k, v in content["guarantee"].items() if k in {"alpha", "mu1", "mu2"}}
    A = np.array([[0.0, 1, 0], [-1, -1, 1], [0, 0, 0]])
    C, Cq = np.array([[1.0, 0, 0]]), np.array([[1.0, 0, 0]])
    Bf, B, H = np.array([[0.0], [0.2], [0]]), np.array([[0.0], [0], [1]]), np.diag([1.0, 1, 0])
    top = P @ (A + L1 @ C)
    top = top + top.T + 2 * g["alpha"] * P + g["mu1"] * H + 2 * scale * Cq.T @ Cq
    M = np.block(
        [
            [top, P @ Bf, -P @ B],
            [(P @ Bf).T, np.diag([-2 * scale]), Bf.T @ B],
            [-(P @ B).T, B.T @ Bf, np.diag([-g["mu2"]])],
        ]
    )
    d = 1 / np.sqrt(np.abs(np.diag(M)))
    return max(np.linalg.eigvalsh(M * np.outer(d, d)).max(), np.linalg.eigvalsh(-P).max())


def test_the_proof_agrees_with_eigenvalues_of_the_theorem_written_out_by_hand(content):
    assert largest_eigenvalue(content) < 0


@pytest.mark.parametrize("factor", [1 - 1e-6, 1 + 1e-6, 0.99, 1.01, 0.5, 2, 0, -1])
@pytest.mark.parametrize("row", [0, 1, 2])
def test_a_changed_gain_is_judged_as_the_eigenvalues_judge_it(content, outcome_of, row, factor):
    content["observer"]["L1"][row][0] *= factor
    with_figures(content)
    largest = largest_eigenvalue(content)
    assert abs(largest) > 1e-9
    outcome = outcome_of(content)
    assert outcome.exit_code == (0 if largest < 0 else 4)
    assert ("not proved" in outcome.stderr) == (largest > 0)


def test_the_last_digit_of_a_gain_is_read(content, made, tmp_path):
    digits = repr(content["observer"]["L1"][0][0])
    text = json.dumps(content).replace(digits, digits + "1", 1)
    path = tmp_path / "digit.json"
    path.write_text(text)
    L1 = ResultFile.open(str(path)).matrix((3, 1), "observer", "L1")
    genuine = ResultFile.open(str(made / "cart.gains.json")).matrix((3, 1), "observer", "L1")
    assert (genuine != L1).sum() == 1
    assert Fraction(str(L1[0, 0])) == Fraction(digits + "1")


# Whatever numbers a spec holds, the file holds those that were proved

LINEAR = """
obsdesign: 1
system: {A: [[0, 1], [-1, -1]], B: [[0], [1]], C: [[1, 0]]}
nonlinearities: [{type: tanh, Bf: [0, 0.2], Cq: [1, 0]}]
observer: {type: l2, %s}
"""


@pytest.mark.parametrize(
    "observer",
    [
        "L2: 0, alpha: 1/3, objective: {gamma: 0.5}",
        "L2: 0, alpha: sqrt(0.02), objective: {gamma: 0.5}",
        "L2: 0, alpha: 0.1, objective: {gamma: 1/3}",
        "L2: 0, alpha: 0.1, objective: {gamma: 0.314159265358978}",
        "L2: [[1/3]], alpha: 0.1, objective: {gamma: 0.5}",
        "alpha: 0.1, gains: {L1: [[-10/3], [-7]], L2: [[0]]}",
        "alpha: 0.1, gains: {L1: [[-10.3333333333333333333], [-7]], L2: [[0]]}",
        "alpha: {min: 1/30, max: sqrt(2), points: 3, log: true}, L2: 0, objective: pareto, bounds: {L1: 50}",
        "alpha: {min: 1/30, max: sqrt(2)}, L2: 0, objective: max-alpha",
    ],
)
def test_what_solve_certifies_verify_proves(tmp_path, observer):
    spec, gains = tmp_path / "s.yaml", tmp_path / "g.json"
    spec.write_text(LINEAR % observer)
    solved = run("solve", spec, "-o", gains)
    assert solved.exit_code == 0, solved.output
    verified = run("verify", gains, spec)
    assert verified.exit_code == 0, verified.output


# Forged files: what is true of every family stands in test_every_family


@pytest.mark.parametrize("scale", ["-1", "-1/10000000000000000000000", "0"])
def test_a_multiplier_that_is_not_positive_proves_nothing(content, outcome_of, scale):
    (name,) = content["certificate"]["multipliers"]
    content["certificate"]["multipliers"][name] = scale
    outcome = outcome_of(content)
    assert outcome.exit_code == 4
    assert scale == "0" or name in outcome.stderr


@pytest.mark.parametrize("alpha", [0.11, 0.09, "10000000000000000000001/100000000000000000000000"])
def test_alpha_is_the_one_that_the_spec_asks_for(content, outcome_of, alpha):
    claim = {"alpha": alpha} if isinstance(alpha, float) else {}
    forged = restated(content, **claim)
    forged["guarantee"]["alpha"] = alpha
    outcome = outcome_of(forged)
    assert outcome.exit_code == 2
    assert "guarantee.alpha" in outcome.stderr


@pytest.mark.parametrize("status", ["uncertified", "Certified", None, True, 1])
def test_only_a_certified_result_is_verified(content, outcome_of, status):
    content["status"] = status
    outcome = outcome_of(content)
    assert outcome.exit_code == 2
    assert "status" in outcome.stderr


def test_a_certified_result_that_is_called_infeasible_has_nothing_to_verify(content, outcome_of):
    outcome = outcome_of(content | {"status": "infeasible"})
    assert outcome.exit_code == 2
    assert "diagnosis: missing" in outcome.stderr


# Specs


def test_a_spec_that_was_altered_in_the_file_is_refused_by_its_hash(content, outcome_of):
    content["spec"]["text"] = content["spec"]["text"].replace("0.2]", "0.1]")
    outcome = outcome_of(content)
    assert outcome.exit_code == 2
    assert "spec.sha256" in outcome.stderr


def test_a_spec_that_was_altered_with_its_hash_is_another_problem(content, outcome_of, made):
    forged = with_spec(content, "Bf: [0, 0.2]", "Bf: [0, 20]")
    assert outcome_of(forged).exit_code == 4
    beside = outcome_of(forged, made / "cart.yaml")
    assert beside.exit_code == 2
    assert "spec.sha256" in beside.stderr


def test_a_spec_of_other_dimensions_is_refused_by_the_shape(content, outcome_of):
    outcome = outcome_of(with_spec(content, "disturbance: integrator", "disturbance: double-integrator"))
    assert outcome.exit_code == 2
    assert "observer.L1: expected a 4x1 matrix" in outcome.stderr


def test_the_spec_that_the_gains_were_made_from_is_accepted_beside_them(genuine, outcome_of, made, bearing):
    assert outcome_of(genuine, made / "cart.yaml").exit_code == 0
    outcome = outcome_of(genuine, bearing)
    assert outcome.exit_code == 2
    assert "another spec" in outcome.stderr


def test_what_is_wrong_with_the_embedded_spec_is_said_with_its_line(content, outcome_of):
    outcome = outcome_of(with_spec(content, "alpha: 0.1", "alpha: fast"))
    assert outcome.exit_code == 2
    assert "observer.alpha" in outcome.stderr
    assert "spec.text" in outcome.stderr


# Malformed files

NUMBERS = (
    ("guarantee", "gamma"),
    ("guarantee", "alpha"),
    ("guarantee", "mu1"),
    ("guarantee", "mu2"),
    ("observer", "L1", 0, 0),
    ("observer", "L2", 0, 0),
    ("certificate", "P", 1, 1),
    ("certificate", "multipliers", "lambda1"),
)
NO_NUMBERS = (
    "1/0",
    "0x10",
    "1e999",
    "nan",
    "-inf",
    "",
    "1/2/3",
    "1.5/2",
    "ten",
    "1 2",
    "--1",
    "1e",
    None,
    True,
    [],
    {},
)


@pytest.mark.parametrize("keys", NUMBERS, ids=lambda keys: ".".join(map(str, keys)))
def test_what_is_no_number_is_refused_by_the_name_of_its_key(content, outcome_of, keys):
    name = ".".join(key for key in keys if isinstance(key, str))
    for value in NO_NUMBERS:
        put(content, keys, value)
        outcome = outcome_of(content)
        assert outcome.exit_code == 2, value
        assert f"{name}: " in outcome.stderr, value
        assert len(outcome.stderr.splitlines()) == 1


@pytest.mark.parametrize("text", ["NaN", "Infinity", "-Infinity"])
def test_a_constant_that_is_no_json_is_refused(genuine, content, outcome_of, text):
    outcome = outcome_of(genuine.replace(f'"gamma": {content["guarantee"]["gamma"]}', f'"gamma": {text}', 1))
    assert outcome.exit_code == 2
    assert f"{text} is no number" in outcome.stderr


@pytest.mark.parametrize(
    "digits", ["1" * 10_000_000, "1e-" + "9" * 10_000_000, "1" * 5_000_000 + "/" + "7" * 5_000_000]
)
def test_a_number_of_megabytes_is_refused_at_once(content, outcome_of, digits):
    content["certificate"]["P"][0][0] = digits
    outcome = outcome_of(content)
    assert outcome.exit_code == 2
    assert "certificate.P" in outcome.stderr
    assert len(outcome.stderr) < 300


@pytest.mark.parametrize("keys", NUMBERS, ids=lambda keys: ".".join(map(str, keys)))
def test_a_number_beyond_doubles_is_answered_too(content, outcome_of, keys):
    for number in ("1e400", "-1e400", "1e200", f"{10**1000}/3", "1e-400", f"1/{10**1000}"):
        put(content, keys, number)
        outcome_of(content)


def test_numbers_whose_product_is_beyond_doubles_are_answered_too(content, outcome_of):
    content["observer"]["L1"] = [["1e300"]] * 3
    content["certificate"]["P"] = [["1e300" if i == j else "0" for j in range(3)] for i in range(3)]
    assert outcome_of(content).exit_code == 4


def test_a_witness_may_have_thousands_of_digits(content, outcome_of):
    (name,) = content["certificate"]["multipliers"]
    long = Fraction(content["certificate"]["multipliers"][name]) * Fraction(10**6000 + 1, 10**6000)
    content["certificate"]["multipliers"][name] = digits(long)
    assert outcome_of(content).exit_code == 0


def digits(number):
    """p/q of any length; `str` refuses to write more than 4300 digits."""
    from flint import fmpz

    return f"{fmpz(number.numerator)}/{fmpz(number.denominator)}"


@pytest.mark.parametrize(
    ("keys", "value", "expected"),
    [
        (("observer", "L1"), [[1.0]], "observer.L1: expected a 3x1 matrix"),
        (("observer", "L1"), [[1.0], [1.0, 2.0], [1.0]], "observer.L1: expected a 3x1 matrix"),
        (("observer", "L1"), [1.0, 2.0, 3.0], "observer.L1: expected a 3x1 matrix"),
        (("observer", "L1"), "gain", "observer.L1: expected a 3x1 matrix"),
        (("observer", "L1"), {}, "observer.L1: expected a 3x1 matrix"),
        (("observer", "L2"), [], "observer.L2: expected a 1x1 matrix"),
        (("certificate", "P"), [["1", "0"], ["0", "1"]], "certificate.P: expected a 3x3 matrix"),
        (("certificate", "P"), None, "certificate.P: expected a 3x3 matrix"),
        (("guarantee", "alpha"), "1" * 100_001, "a number of 100,001 characters; at most 100,000 are read"),
        (("certificate", "multipliers"), [], "certificate.multipliers.lambda1"),
        (("certificate", "multipliers"), {}, "certificate.multipliers.lambda1"),
        (("certificate",), "exact", "certificate.P"),
        (("guarantee",), None, "guarantee.gamma"),
        (("guarantee",), {}, "guarantee.gamma"),
        (("guarantee", "statement"), "fine", "guarantee.statement"),
        (("observer",), 3, "observer.L1"),
        (("observer", "type"), "linf", "observer.type"),
        (("observer", "type"), None, "observer.type"),
        (("spec",), None, "spec.text"),
        (("spec", "text"), 7, "spec.sha256"),
        (("spec", "text"), "obsdesign: 1", "spec.sha256"),
        (("spec", "text"), "\ud800", "spec.sha256"),
        (("obsdesign",), 2, "obsdesign"),
        (("obsdesign",), True, "obsdesign"),
        (("obsdesign",), 1.0, "obsdesign"),
    ],
)
def test_what_has_the_wrong_shape_is_refused_by_the_name_of_its_key(content, outcome_of, keys, value, expected):
    put(content, keys, value)
    outcome = outcome_of(content)
    assert outcome.exit_code == 2
    assert expected in outcome.stderr
    assert len(outcome.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "null",
        "[]",
        "1",
        '"certified"',
        "{}",
        "[" * 100_000,
        '{"a":' * 100_000 + "1" + "}" * 100_000,
        "1" * 10_000_000,
        b"\xff\xfe\x00",
        b"\x00" * 100,
        b"\x80abc",
        "obsdesign: 1\n",
    ],
    ids=lambda text: repr(text[:12]),
)
def test_what_is_no_result_file_is_refused(outcome_of, text):
    outcome = outcome_of(text)
    assert outcome.exit_code == 2
    assert len(outcome.stderr.splitlines()) == 1
    assert len(outcome.stderr) < 400


def test_a_file_that_was_cut_off_is_refused_wherever_it_was_cut(genuine, outcome_of):
    for length in range(0, len(genuine) - 2, 211):
        assert outcome_of(genuine[:length]).exit_code == 2


def test_a_key_that_stands_twice_does_not_hide_what_is_verified(genuine, outcome_of):
    twice = genuine.replace('"certificate": {', '"certificate": {"P": [["0"]]},\n  "certificate": {', 1)
    assert outcome_of(twice).exit_code in {0, 2}
    last = genuine.rstrip().removesuffix("}") + ', "guarantee": {"gamma": 1e-9}}'
    assert outcome_of(last).exit_code == 2


# Numbers are read as written


@examples(50)
@given(p=st.integers(-(10**30), 10**30), q=st.integers(1, 10**30), shift=st.integers(-20, 20))
def test_fractions_and_decimals_are_read_exactly(reader, p, q, shift):
    assert Fraction(str(reader.exact(f"{p}/{q}", "x"))) == Fraction(p, q)
    assert Fraction(str(reader.exact(f"{p}e{shift}", "x"))) == p * Fraction(10) ** shift


@pytest.fixture(scope="session")
def reader(made):
    """A result file that was read."""
    return ResultFile.open(str(made / "cart.gains.json"))


def test_a_tenth_is_a_tenth_and_not_the_double_beside_it(reader):
    assert str(reader.exact("0.1", "x")) == "1/10"
    assert str(reader.exact("1e-1", "x")) == "1/10"
    assert str(reader.exact("2/20", "x")) == "1/10"
    assert str(reader.exact("0.1000000000000000055511151231257827", "x")) != "1/10"


def test_the_gains_of_a_file_are_those_of_its_text(reader, content):
    L1 = reader.matrix((3, 1), "observer", "L1")
    assert [[float(x) for x in row] for row in L1] == content["observer"]["L1"]
    assert all(
        Fraction(str(x)) == Fraction(repr(y)) for x, (y,) in zip(L1[:, 0], content["observer"]["L1"], strict=True)
    )


def test_the_library_raises_what_the_command_prints(made, bearing):
    path = str(made / "cart.gains.json")
    assert verify(path, load(str(made / "cart.yaml"))).holds
    with pytest.raises(UsageError, match="another spec"):
        verify(path, load(str(bearing)))
