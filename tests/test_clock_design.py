"""Design for clock-dependent certificates: convex problems, gradients, descents, units, and random plants."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.clock import EXAMPLES, OSCILLATOR, ROBOT, exact, spec_of
from support.sweep import rng

from obsdesign.dissipation.engine import Engine
from obsdesign.families.sporadic.clock.analysis import Analysis
from obsdesign.families.sporadic.clock.bernstein import SHAPE, Shape, of_gain
from obsdesign.families.sporadic.clock.convex import GapReset, Predictor, Reset
from obsdesign.families.sporadic.clock.descent import Injection, descend, walled
from obsdesign.families.sporadic.clock.search import Curve
from obsdesign.families.sporadic.clock.theorem import error_system
from obsdesign.families.sporadic.clock.witness import GOALS
from obsdesign.lmi.formula import in_floats, rational

pytestmark = pytest.mark.xdist_group("clock-design")  # its searches are made once
TIMES = {
    "oscillator": ("0.205", "0.41"),
    "robot": ("0.1714", "0.3"),
    "arm": ("0.05", "0.1"),
    "arm, slow": ("0.15", "0.3"),
}


def example(name):
    """Plant, multiplier, Cp, intervals and rate, in doubles but for the times."""
    T1, T2 = TIMES[name]
    case = EXAMPLES[name.partition(",")[0]]
    spec = spec_of(case.system)
    return (
        spec.augmented.doubles,
        in_floats(spec.multiplier),
        in_floats(spec.H),
        exact(T1),
        exact(T2),
        exact(case.decay),
    )


def error_of(name, gains, shape=SHAPE):
    """Analysis of gains in doubles."""
    plant, M, Cp, T1, *_ = example(name)
    return Analysis(Engine(), error_system(plant, Cp, gains), M, T1, shape)


def solved(form, name, kappa, shape):
    """Least gamma of a convex problem and its gain."""
    plant, _, _, _, T2, decay = example(name)
    zero = np.zeros((plant.n, len(plant.C)))
    none = {"L": zero, "H": np.zeros((len(plant.C),) * 2)} if form is Predictor else {"K": zero}
    made = error_of(name, none, shape)
    return form(made.theorem(T2, decay).doubles, plant.C, np.ones(plant.n), np.full(len(plant.C), 1 / kappa)).least(
        made
    )


def analysed(name, gains, shape=SHAPE):
    """Gamma of gains."""
    *_, T2, decay = example(name)
    return error_of(name, gains, shape).gamma(T2, decay)


# Convex problems


@pytest.mark.parametrize(
    ("name", "kappa", "least", "after"),
    [
        ("oscillator", 10, 1.998, 1.202),
        ("robot", 20, 0.579, 0.520),
        ("arm", 50, 0.2345, 0.2262),
        ("arm, slow", 20, 1.034, 0.510),
    ],
)
def test_a_predictor_of_bounded_gain_is_as_good_as_a_reference(name, kappa, least, after):
    gamma, L = solved(Predictor, name, kappa, Shape(4, 4))
    C = example(name)[0].C
    assert np.linalg.norm(L, 2) <= kappa * (1 + 1e-6)
    assert gamma == pytest.approx(least, rel=0.012)
    found = analysed(name, {"L": L, "H": -C @ L})
    assert found == pytest.approx(after, rel=0.01)
    assert found <= gamma


@pytest.mark.parametrize(
    ("name", "bounded", "free", "bound"),
    [
        ("oscillator", 1.210, 1.105, 1.0356),
        ("robot", 0.405, 0.252, 0.2198),
        ("arm", 0.2174, 0.2145, 0.127),
        ("arm, slow", 0.295, 0.237, 0.203),
    ],
)
def test_a_reset_is_as_good_as_a_reference_and_no_better_than_any_causal_observer(name, bounded, free, bound):
    for kappa, value in ((3, bounded), (1e3, free)):
        gamma, K = solved(Reset, name, kappa, Shape(6, 2))
        assert np.linalg.norm(K, 2) <= kappa * (1 + 1e-6)
        assert bound <= gamma <= value * 1.01
        assert bound <= analysed(name, {"K": K}) <= gamma * 1.08
        if kappa == 3:
            assert gamma == pytest.approx(value, rel=0.01)


@pytest.mark.parametrize(("name", "constant", "bound"), [("oscillator", 1.105, 1.0356), ("arm, slow", 0.237, 0.203)])
def test_a_gain_that_depends_on_the_interval_is_no_worse_than_a_constant_one(name, constant, bound):
    gamma, K = solved(GapReset, name, 1e3, Shape(6, 2))
    assert bound <= gamma <= constant * 1.002
    assert bound <= adapted(name, K) <= gamma * 1.002


def adapted(name, K):
    """Gamma of a gain that depends on the interval, by storage functions of the time elapsed on the same segments."""
    *_, T1, T2, decay = example(name)
    gains = {"K_of_gap": K, "knots": np.array([float(T1), float(T2)])}
    made = replace(error_of(name, gains), clock=of_gain(T1, np.array([T1, T2], dtype=object), K))
    return made.gamma(T2, decay)


def test_a_constant_gain_is_a_gain_that_depends_on_the_interval():
    K = np.array([[0.7], [0.4]])
    left, elapsed = analysed("oscillator", {"K": K}), adapted("oscillator", np.broadcast_to(K, (1, 5, 2, 1)))
    assert 1.0356 <= left <= elapsed <= 1.2 * left


# Gradients and descents

STARTS = {
    ("oscillator", "hold"): {"L": [[1.0335], [-1.5]], "H": [[0]]},
    ("oscillator", "dynamic"): {"L": [[2.067], [-3]], "H": [[-1.384]]},
    ("oscillator", "predictor"): {"L": [[2.0], [-1]], "H": [[-2.0]]},
    ("oscillator", "reset"): {"K": [[0.78], [0.45]]},
    ("robot", "hold"): EXAMPLES["robot"].gains,
    ("robot", "dynamic"): EXAMPLES["robot"].gains,
    ("arm", "dynamic"): EXAMPLES["arm"].gains,
}


def start(name, injection):
    """Injection and its free gains as a vector."""
    plant = example(name)[0]
    made = Injection(injection, plant.C, np.full(plant.n, 2.0), np.full(len(plant.C), 0.5), np.full((1, 1), 3.0))
    return made, made.vector({key: np.array(gain, dtype=float) for key, gain in STARTS[name, injection].items()})


@pytest.mark.parametrize(("name", "injection"), STARTS)
def test_the_gradient_of_mu_is_that_of_differences(name, injection):
    made, x = start(name, injection)
    *_, T2, decay = example(name)

    def slope(x):
        return error_of(name, made.gains(x), Shape(3, 2)).slope(T2, decay)

    found, random = made.gradient(slope(x)), rng(7)
    for _ in range(3):
        step = random.normal(size=len(x))
        h = (1e-2 if name == "arm" else 1e-3) / np.linalg.norm(step)
        difference = (slope(x + h * step).mu - slope(x - h * step).mu) / (2 * h)
        assert found @ step == pytest.approx(
            difference, rel=5e-3, abs=3e-3 * np.linalg.norm(found) * np.linalg.norm(step)
        )


@pytest.mark.parametrize(
    ("name", "injection", "kappa", "value"),
    [
        ("oscillator", "hold", None, 1.122),
        ("oscillator", "dynamic", 3.7, 1.103),
        ("oscillator", "dynamic", 10.0, 1.095),
        ("robot", "hold", 18.5, 0.395),
        ("arm", "dynamic", 15.3, 0.2175),
    ],
)
def test_a_search_ends_no_worse_than_a_reference(name, injection, kappa, value):
    case = EXAMPLES[name]
    spec, (*_, T1, T2, decay) = spec_of(case.system), example(name)
    curve = Curve(Engine(), spec.augmented, spec.multiplier, spec.H, T1, SHAPE, injection, kappa)
    found = curve.best(T2, decay)
    assert curve.size(found.gains) <= (kappa or math.inf)
    assert curve.analysis(found.gains, Shape(4, 4)).gamma(T2, decay) <= value * 1.01


@pytest.mark.xfail(reason="it ends in a local minimum of about 0.72")
def test_a_descent_from_given_gains_ends_no_worse_than_a_reference():
    case = EXAMPLES["robot"]
    spec, (*_, T1, T2, decay) = spec_of(case.system), example("robot")
    curve = Curve(Engine(), spec.augmented, spec.multiplier, spec.H, T1, SHAPE, "dynamic", 5.74)
    first = curve.measured({key: np.array(gain, dtype=float) for key, gain in case.gains.items()}, T2, decay)
    found = curve.descended(first, 5.74, T2, decay, 80)
    assert curve.size(found.gains) < 5.74
    assert curve.analysis(found.gains, Shape(4, 4)).gamma(T2, decay) <= 0.504 * 1.01


def test_a_barrier_has_the_slope_of_differences_and_no_value_outside():
    L, step = np.array([[1.0, 0.3], [-0.4, 0.8], [0.1, 0.2]]), rng(0).normal(size=(3, 2))
    value, slope = walled(L, 2.0)
    h = 1e-6
    difference = (walled(L + h * step, 2.0)[0] - walled(L - h * step, 2.0)[0]) / (2 * h)
    assert (slope * step).sum() == pytest.approx(difference, rel=1e-6)
    assert value == pytest.approx(-math.log(1 - (np.linalg.norm(L, 2) / 2) ** 2))
    assert walled(3 * L, 2.0)[0] == math.inf


def test_a_descent_finds_the_minimum_of_a_function_with_walls():
    def bowl(x):
        if abs(x[0]) >= 2:
            return math.inf, 0 * x
        return float((x[0] - 1) ** 2 + 10 * (x[1] + 3) ** 2 - 0.1 * np.log(4 - x[0] ** 2)), np.array(
            [2 * (x[0] - 1) + 0.2 * x[0] / (4 - x[0] ** 2), 20 * (x[1] + 3)]
        )

    x, *_ = descend(bowl, np.array([-1.9, 5.0]), 60)
    assert np.linalg.norm(bowl(x)[1]) < 0.1


# Units and coordinates

TRANSFORMED = {"oscillator": OSCILLATOR, "robot": ROBOT}


def in_units(name, x, y, t, w):
    """Example with states, outputs, time and disturbance measured in other units, powers of ten, and its times."""
    case = EXAMPLES[name]
    *_, T1, T2, decay = example(name)
    spec = spec_of(case.system)
    plant, Cp = spec.augmented, spec.H
    x, y, t, w = (rational([[f"1e{power}"]]).item() for power in (x, y, t, w))
    moved = replace(
        plant,
        **{
            "A": plant.A / t,
            "Bf": plant.Bf * x / t,
            "B": plant.B * x / w / t,
            "C": plant.C * y / x,
            "Cq": plant.Cq / x,
        },
    )
    gains = {key: rational(np.array(gain)) for key, gain in case.gains.items()}
    gains = {"L": gains["L"] * x / y / t, "H": gains["H"] / t}
    made = Analysis(Engine(), error_system(moved, Cp / x, gains), spec.multiplier, T1 * t)
    return made, T2 * t, decay / t


@pytest.mark.parametrize("power", [1, 3, 6, -3, -6])
@pytest.mark.parametrize("name", ["oscillator", "robot", "arm"])
def test_gamma_in_other_units_is_what_it_should_be_and_is_proved(name, power):
    base, T2, decay = in_units(name, 0, 0, 0, 0)
    gamma = base.gamma(T2, decay)
    for units in ((power, 0, 0, 0), (0, power, 0, 0), (0, 0, power, 0), (0, 0, 0, power), (power, -power, 0, power)):
        made, T2, decay = in_units(name, *units)
        expected = gamma * (1.0 if not units[3] else 10.0 ** -units[3])
        assert made.gamma(T2, decay) == pytest.approx(expected, rel=1e-3), units
        witness = made.prove(GOALS["gamma"], T2, decay)
        assert witness.holds, units
        assert expected * (1 - 1e-4) <= float(witness.constants()["gamma"]) <= expected * 1.03
