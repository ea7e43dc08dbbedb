"""What recurs bounds what clock-dependent certificates prove from the other side: limits, growth and gains."""

import json
from dataclasses import replace

import numpy as np
import pytest
from flint import fmpq
from scipy.linalg import expm
from scipy.optimize import brentq
from support.commands import run
from support.sweep import rng, seeds

from obsdesign.dissipation.engine import Engine
from obsdesign.families.sporadic.clock.analysis import FEASIBLE, Analysis
from obsdesign.families.sporadic.clock.energy import gain
from obsdesign.families.sporadic.clock.linear import LinearError
from obsdesign.families.sporadic.clock.study import fastest, longest
from obsdesign.families.sporadic.clock.theorem import ErrorSystem, held, reset
from obsdesign.families.sporadic.clock.truth import frozen, truth
from obsdesign.lmi.formula import in_floats, printed, rational
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant

LINEAR, NONE = Multiplier(()), np.zeros((0, 0))


def plant(A, B, C, Bf=None, Cq=None):
    A, B, C = (np.array(M, dtype=float) for M in (A, B, C))
    Bf = np.zeros((len(A), 0)) if Bf is None else np.array(Bf, dtype=float)
    Cq = np.zeros((0, len(A))) if Cq is None else np.array(Cq, dtype=float)
    (nq, nf), nw, ny = (len(Cq), Bf.shape[1]), B.shape[1], len(C)
    zeros = [np.zeros(shape) for shape in ((nq, nf), (nq, nw), (ny, nf), (ny, nw))]
    return Plant(A, Bf, B, Cq, *zeros[:2], C, *zeros[2:], (), (), ())


def error(p, Cp, L, H):
    return held(p, np.array(Cp, dtype=float), np.array(L, dtype=float), np.array(H, dtype=float))


MOTOR = plant([[0, 1], [0, -3]], [[0], [1]], [[1, 0]])
OSCILLATOR = plant([[0, 1], [-4, 0]], [[1], [0]], [[1, 0]])
ROBOT = plant([[0, 1, 0], [0, -0.01, 0], [1, 0, 0]], [[0], [1], [0]], [[1, 0, 0], [0, 0, 1]])
ARM = plant(
    [[0, 1, 0, 0], [-48.6, -1.25, 48.6, 0], [0, 0, 0, 1], [19.5, 0, -19.5, 0]],
    [[0], [2], [0], [0]],
    [[1, 0, 0, 0], [0, 1, 0, 0]],
    [[0], [0], [0], [-1]],
    [[0, 0, 1, 0]],
)
ARM_L = np.array([[11.5042, 0.788213], [-2.59655, 14.3202], [4.72995, 1.89367], [8.29872, 2.046]])
ARM_H = [[-9.7899, -0.0342746], [-47.0298, -7.46493]]
PREDICTOR = np.array([[9.328, 1], [-48.78, 22.11], [-0.0524, 3.199], [19.41, -0.9032]])
LINK = [[0, 0, 1, 0], [0, 0, 0, 1]]
SLOPES = [np.array([[k]]) for k in (-3.33, 0.0, 3.33)]

K1 = error(MOTOR, np.eye(2), [[0], [3]], [[0]])
TABLE = {  # error, members, rate, T1, T2, period from which it does not decay at the rate, gains at T1, T2 and both
    "motor": (K1, [NONE], 0.24, 0.5, 1.115, 2.2991, None),
    "oscillator": (
        error(OSCILLATOR, np.eye(2), [[2.067], [-3]], [[-1.384]]),
        *([NONE], 0.05, 0.205, 0.41, 1.170, (1.1244, 1.1709, 1.1952)),
    ),
    "rival": (
        error(OSCILLATOR, np.eye(2), [[0.3648], [-0.4655]], [[-0.3648]]),
        *([NONE], 0.05, 0.205, 0.41, 1.420, None),
    ),
    "rival, slowly": (
        error(OSCILLATOR, np.eye(2), [[0.3648], [-0.4655]], [[-0.3648]]),
        *([NONE], 0.001, 0.205, 0.41, None, (5.483, 5.438, 5.455)),
    ),
    "robot": (
        error(ROBOT, [[0, 1, 0]], [[3.7, -2.194], [2.908, -2.075], [1.637, 0.155]], np.zeros((2, 2))),
        *([NONE], 0.2, 0.1714, 0.3, 1.0349, (1.3008, 1.3034, 1.3023)),
    ),
    "robot, rival": (
        error(ROBOT, [[0, 1, 0]], [[0.8079, 0.2555], [0.2071, 0.055], [0.7609, 0.7714]], np.zeros((2, 2))),
        *([NONE], 0.2, 0.1714, 0.3, 1.5035, (7.597, 7.612, 7.607)),
    ),
    "arm": (error(ARM, LINK, ARM_L, ARM_H), SLOPES, 0.01, 0.05, 0.1, 0.4002, (0.2034, 0.2036, 0.2036)),
    "arm, predictor": (
        error(ARM, LINK, PREDICTOR, -PREDICTOR[:2]),
        *(SLOPES, 0.01, 0.05, 0.10902, 0.608, (0.3082, 0.3104, 0.3088)),
    ),
}


def radius(system, K, decay, gaps):
    """Spectral radius of a sequence of intervals, straight from the flow and the jump."""
    A, M = system.F + system.Bfx @ K @ system.Cq + decay * np.eye(system.order), np.eye(system.order)
    for T in gaps:
        M = expm(A * T) @ system.J @ M
    return np.abs(np.linalg.eigvals(M)).max()


def spectrum(made: LinearError, gaps, pieces=24, angles=60):
    """Largest singular value, over frequency, of the sequence whose w is constant on many pieces of an interval.

    It is below the gain, and tends to it; by integrals of Van Loan over one piece.
    """
    (m, nw), J, x, Q = made.B.shape, made.U @ made.V, None, 0.0
    total = m + nw * pieces * len(gaps)
    x, column = np.eye(m, total), m
    for T in gaps:
        h, x = T / pieces, J @ x
        N = np.block([[made.A, made.B], [np.zeros((nw, m + nw))]])
        C = np.hstack([made.C, np.zeros((len(made.C), nw))])
        big = expm(np.block([[-N.T, C.T @ C], [np.zeros_like(N), N]]) * h)
        step = big[m + nw :, m + nw :]
        W = step.T @ big[: m + nw, m + nw :]
        for _ in range(pieces):
            both = np.vstack([x, np.eye(nw, total, column) / np.sqrt(h)])
            Q, x, column = Q + both.T @ W @ both, step[:m] @ both, column + nw
    Phi, Gamma, found = x[:, :m], x[:, m:], 0.0
    values = np.linalg.eigvals(Phi)
    near = np.angle(values) + np.outer(np.linspace(-2, 2, 41), 1 - np.abs(values))
    for z in np.exp(1j * np.concatenate([np.linspace(0, np.pi, angles), near.ravel()])):
        lift = np.vstack([np.linalg.solve(z * np.eye(m) - Phi, Gamma), np.eye(total - m)])
        found = max(found, np.linalg.eigvalsh(lift.conj().T @ Q @ lift)[-1])
    return np.sqrt(found)


@pytest.mark.parametrize("name", TABLE)
def test_the_limits_and_the_gains_of_periodic_measurements_are_those_of_a_reference(name):
    system, members, decay, T1, T2, period, gains = TABLE[name]
    found = truth(system, members, T1, T2, decay)
    if period:
        assert found["period_limit"] == pytest.approx(period, rel=1e-3)
    limit = found["period_limit"]
    assert max(radius(system, K, decay, [limit]) for K in members) == pytest.approx(1, abs=1e-4)
    before = np.linspace(T1, limit * (1 - 1e-5), 50)
    assert max(radius(system, K, decay, [T]) for K in members for T in before) < 1
    if gains:
        both = max(gain(frozen(system, K, decay), [T1, T2]) for K in members)
        assert [found["gamma"]["T1"], found["gamma"]["T2"], both] == pytest.approx(gains, rel=1e-3)
        assert found["gamma"]["pattern"] >= both * (1 - 1e-4)


@pytest.mark.parametrize(
    ("name", "T1", "most"),
    [
        ("motor", 0, 1.599),
        ("motor", 0.81, 1.621),
        ("rival", 0, 1.161),
        ("rival", 0.67, 1.39),
        ("arm, predictor", 0, 0.599),
    ],
)
def test_a_sequence_of_intervals_is_unstable_where_periodic_measurements_are_not(name, T1, most):
    system, members, decay, _, T2, period, _ = TABLE[name]
    limit = truth(system, members, T1, max(T1, T2), decay)["pattern_limit"]
    assert limit["T2"] <= most < period
    gaps = np.array(limit["gaps"])
    assert ((gaps >= T1 - 1e-5) & (gaps <= limit["T2"] + 1e-5)).all()
    assert len(set(limit["gaps"])) > 1
    assert max(radius(system, K, decay, gaps) for K in members) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("name", TABLE)
def test_the_growth_of_the_worst_sequence_is_what_it_is_and_no_less_than_that_of_periods(name):
    system, members, decay, T1, T2, *_ = TABLE[name]
    found = truth(system, members, T1, T2, decay)["pattern"]

    def growth(gaps):
        return max(np.log(radius(system, K, 0.0, gaps)) / sum(gaps) for K in members)

    assert found["growth"] == pytest.approx(growth(found["gaps"]), rel=1e-4)
    assert found["growth"] >= max(growth([T]) for T in (T1, T2)) - 1e-6


def test_the_gain_of_an_integrator_that_is_reset_is_that_of_one_interval():
    # e' = w, e+ = 0: sup |z|_2 / |w|_2 on [0, T] is that of integration, 2 T / pi
    system = reset(plant([[0]], [[1]], [[1]]), np.eye(1), np.eye(1))
    found = truth(system, [NONE], 0.3, 0.6, 0.0)
    assert [found["gamma"][name] for name in ("T1", "T2", "pattern")] == pytest.approx(
        [0.6 / np.pi, 1.2 / np.pi, 1.2 / np.pi], rel=2e-4
    )
    assert found["period_limit"] is found["pattern_limit"] is None
    assert found["pattern"]["growth"] == -np.inf
    assert found["of"] == "the error itself"


def test_a_first_order_error_is_known_in_closed_form():
    # e' = a e, e+ = (1 - k) e: it decays at the rate lambda as long as (1 - k) exp((a + lambda) T) < 1
    a, k, decay = 0.7, 0.8, 0.1
    system = reset(plant([[a]], [[1]], [[1]]), np.eye(1), np.array([[k]]))
    found = truth(system, [NONE], 0, 1.0, decay)
    assert found["period_limit"] == pytest.approx(-np.log(1 - k) / (a + decay), rel=1e-5)
    assert found["pattern_limit"]["T2"] == pytest.approx(found["period_limit"])
    assert found["pattern"]["growth"] == pytest.approx(np.log(1 - k) + a)
    assert "T1" not in found["gamma"]
    assert gain(frozen(system, NONE, decay), [1.01 * found["period_limit"]]) == np.inf


def test_an_interval_so_short_that_doubles_see_no_decay_is_not_called_unstable():
    system = reset(plant([[-1]], [[1]], [[1]]), np.eye(1), np.array([[0]]))
    found = truth(system, [NONE], 1e-20, 2e-20, 0.0)
    assert found["period_limit"] is found["pattern_limit"] is None


def test_a_narrow_range_of_unstable_periods_is_found():
    # an undamped oscillation seen by its position is not corrected at half its period and at multiples of that
    system = reset(plant([[0, 50], [-50, 0]], [[0], [1]], [[1, 0]]), np.eye(2), np.array([[0.5], [0.02]]))
    found = truth(system, [NONE], 0.0386, 0.06, 0.0)
    half = np.pi / 50
    begin = brentq(lambda T: radius(system, NONE, 0.0, [T]) - 1, 0.98 * half, 0.995 * half)
    assert found["period_limit"] == pytest.approx(begin, rel=1e-5)
    assert radius(system, NONE, 0.0, [1.001 * half]) < 1  # that is the end of them


def random_error(random, n):
    """Stable error with sporadic measurements, T2 and a longest period, for a plant that need not be stable."""
    from scipy.linalg import solve_continuous_are

    A, B, C = random.normal(size=(n, n)), random.normal(size=(n, 1)), random.normal(size=(1, n))
    L = solve_continuous_are(A.T, C.T, np.eye(n), np.eye(1)) @ C.T
    p = plant(A, B, C)
    T2 = 0.3 / np.linalg.norm(A - L @ C, 2)
    if random.integers(2):
        return reset(p, np.eye(n), (L * T2).round(4)), T2
    return held(p, np.eye(n), L.round(4), random.normal(size=(1, 1)).round(4)), T2


@seeds(8)
def test_the_gain_of_a_sequence_is_that_of_a_lifted_system(seed):
    random = rng(seed)
    system, T2 = random_error(random, int(random.integers(1, 4)))
    gaps = [T2, T2 / 3] if seed % 2 else [T2]
    made = frozen(system, NONE, 0.0)
    assert made.growth(gaps) < 0
    found = gain(made, gaps)
    assert 0.995 < spectrum(made, gaps) / found < 1 + 2e-4
    assert gain(replace(made, B=3 * made.B, C=made.C / 100), gaps) == pytest.approx(0.03 * found, rel=1e-3)


def exact(system):
    """Same error in the decimals that print its entries."""
    return ErrorSystem(**{key: X if key in {"kept", "others"} else printed(X) for key, X in vars(system).items()})


@seeds(6)
def test_nothing_is_proved_that_is_better_than_the_truth(seed):
    random = rng(seed)
    system, T2 = random_error(random, int(random.integers(1, 4)))
    T2 = printed(float(f"{T2:.3g}"))
    T1 = T2 / 2 if seed % 2 else fmpq(0)
    analysis = Analysis(Engine(), exact(system), LINEAR, T1)
    found = truth(system, [NONE], float(T1), float(T2), 0.0)
    assert analysis.gamma(T2, fmpq(0)) >= (1 - 1e-5) * max(v for k, v in found["gamma"].items() if k != "gaps")
    rate = fastest(analysis, T2, fmpq(0))
    assert rate is None or rate <= -found["pattern"]["growth"] * (1 + 1e-4)
    limit = found["pattern_limit"]
    tolerated = longest(analysis, fmpq(0), float(T2), 10 * float(T2))
    assert limit is None or tolerated is None or tolerated <= limit["T2"] * (1 + 1e-4)


def margin(T1, T2):
    """Margin of the inequalities for the motor."""
    analysis = Analysis(Engine(), exact(K1), LINEAR, rational([[T1]]).item())
    return analysis.margin(rational([[T2]]).item(), fmpq(24, 100))


def test_a_longest_interval_above_the_edge_of_the_sequences_is_refused():
    assert margin("0", "1.35") > FEASIBLE
    assert margin("0", "1.6") <= FEASIBLE
    assert margin("0.81", "1.62") <= FEASIBLE


def test_periodic_measurements_are_proved_close_to_where_they_are_unstable_and_no_further():
    assert margin("2.2", "2.2") > FEASIBLE
    assert margin("2.31", "2.31") <= FEASIBLE


SPEC = """
obsdesign: 1
system: {A: [[0, 1], [-4, 0]], B: [1, 0], C: [1, 0]}
observer: {type: sporadic, T1: 0.205, T2: 0.41, decay: 0.05, gains: {L: [2.067, -3], H: -1.384}}
"""


def solved(text, folder):
    spec, result = folder / "a.yaml", folder / "a.gains.json"
    spec.write_text(text)
    outcome = run("solve", spec, "-o", result)
    assert outcome.exit_code == 0, outcome.output
    lines = [line.split(maxsplit=1)[1] for line in outcome.output.splitlines() if line.startswith("truth")]
    assert run("verify", result, "-q").exit_code == 0
    return json.loads(result.read_text()), lines


def test_a_result_says_what_is_true_beside_what_is_proved(tmp_path):
    content, lines = solved(SPEC, tmp_path)
    found, proved = content["analysis"]["truth"], content["guarantee"]
    assert found["period_limit"] == pytest.approx(1.170, abs=5e-4)
    assert proved["T2_max"] <= found["pattern_limit"]["T2"]
    assert max(found["gamma"][name] for name in ("T1", "T2", "pattern")) <= proved["gamma"]
    assert proved["rate"] <= -found["pattern"]["growth"]
    assert "analysis" in content["numerical"]
    assert lines == [
        "T2 proved 1.167 s, no such decay from 1.171 s (periodic)   of the error itself",
        "gamma at least 1.195 with the weight exp(0.05 t)   of the error itself",
        "decay at most 1.291 1/s   of the error itself",
    ]


def test_without_a_rate_and_for_any_positive_interval_the_error_is_called_unstable(tmp_path):
    content, lines = solved(SPEC.replace("T1: 0.205", "T1: 0").replace("decay: 0.05, ", ""), tmp_path)
    assert content["analysis"]["truth"]["gamma"].keys() == {"T2", "pattern", "gaps"}
    assert " s, unstable from " in lines[0]
    assert not any("weight" in line for line in lines)


def test_the_truth_of_a_nonlinear_plant_is_that_of_a_member_and_is_said_to_be(tmp_path):
    block = "nonlinearities: [{f: 0.1*sin(q), type: {lipschitz: 0.1}, Bf: [0, 1], Cq: [1, 0]}]\n"
    content, lines = solved(SPEC + block, tmp_path)
    linear, _ = solved(SPEC, tmp_path)
    found, without = content["analysis"]["truth"], linear["analysis"]["truth"]
    assert found["gamma"]["T2"] > without["gamma"]["T2"]
    assert found["period_limit"] < without["period_limit"]
    assert all(line.endswith("of the worst frozen member f = K q that was found") for line in lines)


def test_an_error_that_grows_beyond_doubles_has_no_truth():
    system = in_floats(reset(plant([[50]], [[1]], [[1]]), np.eye(1), np.eye(1)))
    assert truth(system, [NONE], 0.5, 1.0, 0.0) == {}


@pytest.mark.parametrize("powers", [(4, -4), (-6, 6), (9, 0)])
def test_units_of_states_and_signals_change_nothing_of_the_truth(powers):
    """Neither a direction of J that is small nor a gain that is small is taken for none."""
    p = plant([[0, 1], [-4, -0.1]], [[1], [0]], [[1, 0]])
    plain, unit = error(p, np.eye(2), [[2.0], [-3.0]], [[-1.4]]), np.array([10.0**k for k in (*powers, powers[0])])
    scaled = replace(
        plain,
        F=plain.F * unit[:, None] / unit,
        Bx=plain.Bx * unit[:, None] * 1e5,
        J=plain.J * unit[:, None] / unit,
        Jn=plain.Jn * unit[:, None],
        Cp=plain.Cp / unit,
        Cq=plain.Cq / unit,
        Bfx=plain.Bfx * unit[:, None],
        Dq=plain.Dq * 1e5,
    )
    before, after = (truth(made, [np.zeros((0, 0))], 0.1, 0.3, 0.05) for made in (plain, scaled))
    for key in ("T1", "T2", "pattern"):
        assert after["gamma"][key] == pytest.approx(1e5 * before["gamma"][key], rel=1e-3)
    assert after["period_limit"] == pytest.approx(before["period_limit"], rel=1e-5)
    assert after["pattern_limit"]["T2"] == pytest.approx(before["pattern_limit"]["T2"], rel=1e-3)
    assert after["pattern"]["growth"] == pytest.approx(before["pattern"]["growth"], rel=1e-5)
