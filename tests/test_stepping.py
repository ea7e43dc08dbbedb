"""An observer in steps: closed forms of each method, order of the equations, loops, and runs of an implementation."""

import math

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from support.shipped import SPECS

import obsdesign as od
from obsdesign.errors import UsageError
from obsdesign.expressions import Expression, parse
from obsdesign.families.observer import Observer
from obsdesign.reading import loads
from obsdesign.stepping.implemented import Implemented
from obsdesign.stepping.machine import Machine, StuckError, compiled
from obsdesign.stepping.method import linear_part
from obsdesign.stepping.routine import Let, Solve, routine

A = np.array([[-1.5, 2.0], [-0.5, -3.0]])


def sides(**texts):
    """Right sides by name."""
    names = {"x", "z", "a", "b", "u", "y", "t"}
    return {name: parse(text, names) for name, text in texts.items()}


def observer(**changes):
    """A linear observer with an input and an output."""
    made = {
        "dynamics": sides(x="-1.5*x + 2*z + 3*u + 0.5*(y - a)", z="-0.5*x - 3*z"),
        "estimates": sides(x="x", z="z"),
        "inputs": ("u",),
        "outputs": ("y",),
        "algebraic": sides(a="x"),
    }
    return Observer(**{**made, **changes})


def machine(one, method, period="1/10", x0=(1.0, -2.0)):
    """The observer in steps."""
    return Machine(Implemented(one, fmpq(*map(int, period.split("/"))), method, ("x", "z"), np.zeros(2)), x0)


def with_start(one, method, period="1/10"):
    made = machine(one, method, period, None)
    made.state[:] = (1.0, -2.0)
    return made


def rate(s, u, y):
    """The same by hand."""
    x, z = s
    return np.array([-1.5 * x + 2 * z + 3 * u + 0.5 * (y - x), -0.5 * x - 3 * z])


def test_euler_is_a_step_along_the_rate():
    made = with_start(observer(), "euler")
    made.step(0.0, [0.7], [2.0])
    assert made.state == pytest.approx(np.array([1.0, -2.0]) + 0.1 * rate((1.0, -2.0), 0.7, 2.0), rel=1e-14)


def test_runge_kutta_is_the_classical_one_with_time_in_it():
    one = observer(dynamics=sides(x="-1.5*x + 2*z + sin(3*t)*u", z="x*z - y*t"))
    made, h, s = with_start(one, "rk4"), 0.1, np.array([1.0, -2.0])

    def f(t, s):
        return np.array([-1.5 * s[0] + 2 * s[1] + math.sin(3 * t) * 0.7, s[0] * s[1] - 2.0 * t])

    made.step(0.4, [0.7], [2.0])
    k1 = f(0.4, s)
    k2 = f(0.45, s + h / 2 * k1)
    k3 = f(0.45, s + h / 2 * k2)
    k4 = f(0.5, s + h * k3)
    assert made.state == pytest.approx(s + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), rel=1e-13)


@pytest.mark.parametrize("period", ["1/10", "3/1"])
def test_exact_solves_a_linear_observer(period):
    made, h = with_start(observer(), "exact", period), float(fmpq(*map(int, period.split("/"))))
    made.step(0.0, [0.7], [2.0])
    found = solve_ivp(lambda _, s: rate(s, 0.7, 2.0), (0, h), [1.0, -2.0], rtol=1e-12, atol=1e-13, method="DOP853")
    assert made.state == pytest.approx(found.y[:, -1], rel=1e-10)


@pytest.mark.parametrize("method", ["euler", "rk4", "exact"])
@settings(max_examples=10)
@given(share=st.floats(0, 1))
def test_a_part_of_a_step_is_the_method_over_that_time(method, share):
    """Over the whole period it is the step; of `exact`, over any part, the solution."""
    whole, part = with_start(observer(), method, "3/2"), with_start(observer(), method, "3/2")
    whole.step(0.0, [0.7], [2.0])
    part.part(0.0, 1.5, [0.7], [2.0])
    assert part.state == pytest.approx(whole.state, rel=1e-12, abs=1e-12)
    if method == "exact":
        some = with_start(observer(), method, "3/2")
        some.part(0.0, 1.5 * share, [0.7], [2.0])
        some.part(0.0, 1.5 - 1.5 * share, [0.7], [2.0])
        assert some.state == pytest.approx(whole.state, rel=1e-12, abs=1e-12)


def test_the_linear_part_goes_through_what_is_linear():
    one = observer(dynamics=sides(x="-2*x + sin(x) + 4*(y - a)", z="b"), algebraic=sides(a="3*x + z", b="a - x*x"))
    assert linear_part(one).tolist() == [[-14, -4], [3, 1]]


@pytest.mark.parametrize("share", [1.0, 0.7, 0.5, 2.0**-20, 3e-7, 0.0])
def test_a_part_of_a_stiff_exact_step_is_its_solution(share):
    one = observer(dynamics=sides(x="-1000000*x + 1000000*z", z="z"))
    made = with_start(one, "exact", "1/1")
    made.part(0.0, share, [0.0], [0.0])
    slow = -2 * 1e6 / (1e6 + 1)  # x = slow e^t + (1 - slow) e^(-1e6 t), z = -2 e^t
    expected = [slow * math.exp(share) + (1 - slow) * math.exp(-1e6 * share), -2 * math.exp(share)]
    assert made.state == pytest.approx(expected, rel=1e-12)


def test_an_exact_step_that_no_doubles_hold_is_refused():
    with pytest.raises(UsageError, match="takes 4026 sums"):
        with_start(observer(dynamics=sides(x="-1e300*x", z="-z")), "exact", "1/1").part(0.0, 0.5, [0.0], [0.0])
    with pytest.raises(UsageError, match="exact over 1 s is beyond what doubles hold"):
        with_start(observer(dynamics=sides(x="1e5*x", z="-z")), "exact", "1/1").step(0.0, [0.0], [0.0])


def test_equations_are_put_in_order():
    made = routine(("x",), sides(a="2*b", b="x + 1"), sides(z="a*b"))
    assert [one.name for one in made.statements] == ["b", "a"]
    assert compiled(made)([3.0]) == [32.0]


def test_a_loop_is_solved_for_as_few_signals_as_one_finds():
    """a = cos(b), b = a + z: one unknown."""
    made = routine(("z",), sides(a="cos(b)", b="a + z", y="u"), sides(x="b"))
    (loop, follows) = made.statements
    assert isinstance(loop, Solve)
    assert len(loop.unknowns) == 1
    assert isinstance(follows, Let)
    (b,) = compiled(made)([0.3])
    assert b == pytest.approx(math.cos(b) + 0.3, abs=1e-12)


def test_a_loop_without_a_solution_is_told():
    made = routine((), sides(a="a*a + 1"), sides(x="a"))
    with pytest.raises(StuckError, match="does not converge"):
        compiled(made)([])


def test_what_occurs_twice_is_computed_once_and_branches_stay():
    one = observer(dynamics=sides(x="sin(x + z) + where(x > 0, sqrt(x), 0)", z="sin(x + z) + where(x > 0, sqrt(x), 1)"))
    made = Implemented(one, fmpq(1, 10), "euler", ("x", "z"), np.zeros(2))
    texts = [side.text for side in made.step.expressions()]
    assert sum("sin" in text for text in texts) == 1
    assert sum("sqrt" in text for text in texts) == 2  # which has no value where x < 0
    x, z = -1.0, 2.0
    machine_of = Machine(made)
    machine_of.state[:] = (x, z)
    machine_of.step(0.0, [0.0], [0.0])
    assert machine_of.state == pytest.approx([x + 0.1 * math.sin(1), z + 0.1 * (math.sin(1) + 1)])


def test_names_of_signals_that_a_step_makes_are_free():
    one = observer(
        dynamics={"x": parse("-x + rate1_x", {"x", "rate1_x"})},
        algebraic={"rate1_x": parse("2*y", {"y"})},
        estimates={"x": Expression.variable("x")},
    )
    made = Machine(Implemented(one, fmpq(1, 10), "rk4", ("x",), np.zeros(1)))
    made.step(0.0, [0.0], [1.0])
    assert made.state == pytest.approx([2 * (1 - math.exp(-0.1))], rel=1e-6)


PENDULUM = (SPECS / "pendulum-embedded.yaml").read_text()


def test_a_run_in_steps_tends_to_that_in_continuous_time():
    """Held outputs are late by half a period, so halving it halves the difference."""
    gains = od.solve(loads(PENDULUM)).gains
    text = PENDULUM.replace("bounds: {L1: 5}", f"gains: {{L1: {gains['L1'].tolist()}, L2: {gains['L2'].tolist()}}}")
    ends = []
    for period in ("4.0e-2", "2.0e-2", "1.0e-2"):
        design = od.solve(
            loads(text.replace("1.0e-3, method", f"{period}, method").replace("horizon: 20", "horizon: 2"))
        )
        stepped, smooth = design.simulate(), design.simulate(observer="continuous")
        assert stepped.summary["bounds"] == []
        assert "runs in steps" in stepped.summary["bounds_omitted"]
        ends.append(np.abs(stepped.xihat[-1] - smooth.xihat[-1]).max())
    assert ends[1] == pytest.approx(ends[0] / 2, rel=0.1)
    assert ends[2] == pytest.approx(ends[1] / 2, rel=0.1)


def test_a_step_that_is_too_long_ends_the_run_and_says_so():
    text = (SPECS / "corless2019-magnetic-bearing.yaml").read_text()
    design = od.solve(loads(f"{text}\nimplementation: {{period: 1.0e-4}}\n"))
    run = design.simulate(observer="implementation")
    assert run.status == "escape"
    assert run.time < 0.01


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("implementation: {period: 1.0e-3, method: rk4}", ""), "needs the section implementation"),
        (("period: 1.0e-3", "period: 0"), "implementation.period"),
        (("method: rk4", "method: rk5"), "rk4"),
        (("horizon: 20", "horizon: 2000"), "holds 2,000,000 steps"),
    ],
)
def test_wrong_steps_are_refused(change, said):
    with pytest.raises(UsageError, match=said):
        od.solve(loads(PENDULUM.replace(*change))).simulate()


def test_a_plant_in_samples_has_no_implementation():
    text = (SPECS / "discrete-motor.yaml").read_text()
    with pytest.raises(UsageError, match="this plant is in samples"):
        loads(f"{text}\nimplementation: {{period: 1.0e-3}}\n")


def test_noise_that_is_declared_acts_once():
    """The noisy output is the output and its noise, in steps as in continuous time."""
    text = PENDULUM.replace("observer: {type", "observer: {type").replace("performance: all", "noise: {y_angle: 0.01}")
    made = od.solve(loads(text)).simulate(horizon=2)
    off = (made.y - made.xi[:, :2])[:, 0]
    assert off.std() == pytest.approx(0.01, rel=0.1)
