"""What `verify` believes of observers for sporadic measurements, beyond what test_every_family asks of any claim."""

import copy
import json
import math
import re
from decimal import ROUND_CEILING, Context, Decimal
from fractions import Fraction

import numpy as np
import pytest
from support.commands import result_of
from support.forging import claiming, scaled, with_spec, with_text
from support.fractions import fractions, positive

OSCILLATOR = """
obsdesign: 1
name: Oscillator
system: {A: [[0, 1], [-4, 0]], B: [1, 0], C: [1, 0]}
nonlinearities: [{f: 0.5*sin(q), type: {lipschitz: 0.5}, Bf: [0, 1], Cq: [1, 0]}]
observer: {type: sporadic, T1: 0.1, T2: 0.2, decay: 0.05, delta: {min: 1, max: 8, points: 5}, bounds: {L: 10}}
"""
GIVEN = OSCILLATOR.replace("bounds: {L: 10}", "gains: {L: [2.067, -3], H: -1.384}")
pytestmark = [pytest.mark.xdist_group("verify-sporadic"), pytest.mark.usefixtures("designed_once")]


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
    assert "intervals 0.1 to 0.2 s" in outcome.stdout
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


# Constants

DECOUPLED = """
obsdesign: 1
name: e' = -e + w, and d' = -d + w
system: {A: [[-1, 0], [0, -1]], B: [1, 0], C: [1, 0]}
performance: {H: [1, 0]}
observer:
  {type: sporadic, T1: %s, T2: 1, decay: %s, relaxation: proposition-2, gains: {L: [0, 0], H: -1}}
"""
STEEP = [[1.0, 2.0**20], [2.0**20, 2.0**40 + 2.0**-12]]  # of condition 1e27
CASES = [("0.5", "0.05"), ("1", "0.05"), ("0.5", "0")]  # T1 and decay
NAMES = ("rate", "overshoot", "initial", "disturbance", "noise")


def steep(certified, T1, decay):
    """A file of the decoupled errors whose P1 is STEEP."""
    content = json.loads(certified(DECOUPLED % (T1, decay), f"steep-{T1}-{decay}"))
    content = with_spec(content, "H: [1, 0]", "H: [9.765625e-4, 1024]")
    content["certificate"] |= {"P1": STEEP, "P2": [[1.0]]}
    content["observer"]["delta"] = 1.0
    content["guarantee"] |= {"gamma": 3.0, "mu": 9.0}
    for part in ("guarantee", "certificate"):
        content[part].pop("T2_max", None)
    return content


def extent():
    """Fractions: V of |(e, d)| = 1 is above the first and below the second, and below the third where e = 0."""
    P1, ratio = fractions(STEEP), above_exponential(1)
    trace = P1[0, 0] + P1[1, 1]
    return (P1[0, 0] * P1[1, 1] - P1[0, 1] ** 2) / trace, trace, ratio


def slowest():
    """A fraction below the smallest eigenvalue of -M over tau, for the decay zero, by bisection in fractions."""
    P1, H, (_, _, ratio) = fractions(STEEP), fractions([[2**-10, 2**10]]), extent()
    eye, low, high = fractions(np.eye(4, dtype=int)), Fraction(0), Fraction(1)
    e, d, w = np.split(eye, [2, 3])
    M = []
    for s in (Fraction(1), ratio):
        half = e.T @ P1 @ (fractions([[1], [0]]) @ w - e) + s * d.T @ (w - d * Fraction(3, 2))
        M.append(half + half.T + (H @ e).T @ (H @ e) - 9 * w.T @ w)
    for _ in range(110):
        x = (low + high) / 2
        low, high = (x, high) if all(positive(-m - x * eye) for m in M) else (low, x)
    return low


def constants(T1, decay, low=None):
    """Constants of the decoupled errors, each worse than the proved one by 1e-9; `low`: smallest eigenvalue of P1."""
    exact, rho2, omega2 = extent()
    rho1 = float(exact) if low is None else low
    rate = float(decay) or float(slowest() / (2 * rho2)) * (1 - 1e-9)
    found = {
        "overshoot": math.sqrt(rho2 / rho1),
        "initial": math.sqrt(rho2),
        "disturbance": 3 / math.sqrt(2 * rate * rho1),
        "noise": math.sqrt(float(omega2) / (-math.expm1(-2 * rate * float(T1)) * rho1)),
    }
    return {"rate": rate, **{name: x * (1 + 1e-9) for name, x in found.items()}}


def stating(content, numbers):
    """A content with these constants, which its statement gives as well, rounded up to six digits."""
    up = {name: f"{float(Context(6, ROUND_CEILING).create_decimal(repr(x))):.6g}" for name, x in numbers.items()}
    for pattern, new in {
        r"<= \S+ exp\(-\S+ t\)": f"<= {up['overshoot']} exp(-{numbers['rate']!r} t)",
        r"plus .*? sup\|eta": f"plus {up['disturbance']} sup|w| + {up['noise']} sup|eta",
        r"\|z\|_2 .*? \|\(e": f"|z|_2 <= {content['guarantee']['gamma']!r} |w|_2 + {up['initial']} |(e",
    }.items():
        content["guarantee"]["statement"], count = re.subn(pattern, new, content["guarantee"]["statement"], count=1)
        assert count == 1
    content["guarantee"] |= numbers
    return content


@pytest.mark.parametrize(("T1", "decay"), CASES)
def test_constants_of_a_steep_storage_function_are_proved_up_to_its_condition(certified, outcome_of, T1, decay):
    true = constants(T1, decay)
    outcome = outcome_of(stating(steep(certified, T1, decay), true))
    assert outcome.exit_code == 0, outcome.output
    assert "holds  overshoot is proved" in outcome.stdout
    for name in NAMES:
        better = true[name] * (1 + 1e-6 if name == "rate" else 1 - 1e-6)
        outcome = outcome_of(stating(steep(certified, T1, decay), true | {name: better}))
        assert outcome.exit_code == 4, (name, outcome.output)
        assert f"{name} is proved" in outcome.stderr


def test_constants_that_doubles_find_of_a_steep_storage_function_are_refused(certified, outcome_of):
    low = max(abs(np.linalg.eigvalsh(np.array(STEEP))[0]), 2.0**-20)  # what doubles leave of it beside 2^40
    assert low > 1e6 * extent()[0]
    outcome = outcome_of(stating(steep(certified, *CASES[0]), constants(*CASES[0], low=low)))
    assert outcome.exit_code == 4
    assert "overshoot is proved" in outcome.stderr


@pytest.mark.parametrize("name", NAMES[1:])
def test_a_constant_is_believed_if_it_is_not_better_than_the_proved_one(certified, outcome_of, name):
    made = json.loads(certified(GIVEN.replace("decay: 0.05", "decay: 0"), "constants-0"))
    found = {key: made["guarantee"][key] for key in NAMES}
    for factor, code in ((1.25, 0), (0.8, 4)):
        claimed = stating(copy.deepcopy(made), found | {name: found[name] * factor})
        assert outcome_of(claimed).exit_code == code
    del made["guarantee"][name]
    assert f"guarantee.{name}: missing" in outcome_of(made).stderr


def test_a_slower_rate_needs_larger_constants(certified, outcome_of):
    made = json.loads(certified(GIVEN.replace("decay: 0.05", "decay: 0"), "constants-0"))
    found = {key: made["guarantee"][key] for key in NAMES}
    slower = found | {"rate": found["rate"] / 4}
    assert outcome_of(stating(copy.deepcopy(made), slower)).exit_code == 4
    slower |= {"disturbance": 2.001 * found["disturbance"], "noise": 2.001 * found["noise"]}
    assert outcome_of(stating(made, slower)).exit_code == 0


@pytest.mark.parametrize(
    ("injection", "power"),
    [("gains: {L: [2.067, -3], H: -1.384}", 28), ("gains: {L: [2.067, -3], H: -2.067}", -28)],
    ids=["held", "predictor"],
)
def test_other_units_of_the_states_change_no_constant_but_by_what_they_are(certified, outcome_of, injection, power):
    """States and outputs times 2^power: V is what it was, |(e, d)| is 2^power times as large."""
    text = GIVEN.replace("gains: {L: [2.067, -3], H: -1.384}", injection).replace(
        "T1: 0.1, T2: 0.2", "T1: 0.15, T2: 0.15"
    )
    made, unit = json.loads(certified(text, injection[-7:-1])), Fraction(2) ** power
    small = f"{Decimal(2) ** -power:f}"
    for old, new in {
        "B: [1, 0]": f"B: [{unit.numerator}/{unit.denominator}, 0]",
        "Bf: [0, 1]": f"Bf: [0, {unit.numerator}/{unit.denominator}]",
        "Cq: [1, 0]": f"Cq: [{small}, 0]",
        "nonlinearities": f"performance: {{H: [[{small}, 0], [0, {small}]]}}\nnonlinearities",
    }.items():
        text = text.replace(old, new)
    made = with_text(made, text)
    for part in (made["certificate"], made["certificate"].get("T2_max", {})):
        for name in {"P1", "P2"} & part.keys():
            part[name] = [[str(Fraction(str(x)) / unit**2) for x in row] for row in part[name]]
    found = {name: made["guarantee"][name] for name in NAMES}
    found |= {"initial": found["initial"] / float(unit), "disturbance": found["disturbance"] * float(unit)}
    found = {name: x if name == "rate" else x * (1 + 1e-14) for name, x in found.items()}
    assert outcome_of(stating(copy.deepcopy(made), found)).exit_code == 0
    for name in NAMES[1:]:
        forged = stating(copy.deepcopy(made), found | {name: found[name] * (1 - 1e-12)})
        assert f"{name} is proved" in outcome_of(forged).stderr
