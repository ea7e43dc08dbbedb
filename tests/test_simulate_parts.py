"""The parts of the simulation: Jacobians, algebraic loops, switching instants, integration."""

from dataclasses import replace

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st

from obsdesign.dissipation.guarantee import EnergyGuarantee
from obsdesign.errors import UsageError
from obsdesign.expressions import parse
from obsdesign.families import FAMILIES
from obsdesign.lmi.formula import rational_number
from obsdesign.reading import loads
from obsdesign.simulate.integrate import Flow, Segment, Tolerance, integrate
from obsdesign.simulate.program import Program
from obsdesign.simulate.scenario import scenario
from obsdesign.simulate.switches import Switches
from obsdesign.simulate.system import System

HEAD = "obsdesign: 1\nobserver: {type: l2, L2: 0, alpha: 0.1}\n"
TWO_STATES = "A: [[0, 1], [-2, -3]], B: [[0, 1], [1, 0]], C: [[1, 0], [0, 1]], D: [[0.2, 0], [0, 0.1]]"
SPECS = {
    "explicit": f"""
system: {{{TWO_STATES}}}
nonlinearities: [{{f: q**3, type: monotone, Bf: [1, 0], Cq: [0, 1], Dq: [0.3, 0]}}]
disturbance: integrator
simulation: {{horizon: 1, x0: [1, 2], w: [sin(t), t]}}
""",
    "loops": f"""
system: {{{TWO_STATES}, inputs: [u], gx: [y1*u, sin(y2)], gy: [u, 0]}}
nonlinearities:
  - {{f: [tanh(q1) + sin(y1)*q2, sin(q1)*cos(q2)/9], type: {{lipschitz: 9}}, Bf: [[1, 0], [0, 1]], Cq: [[1, 0], [1, 1]],
      Dqf: [[-0.3, 0.1, 0.2], [0, 0.1, 0.1]], Df: [[0.1, 0], [0, 0.2]], gq: [u*y2, 0]}}
  - {{f: atan(q), type: atan, Bf: [1, 1], Cq: [0, 1], Dqf: [0.1, 0, -0.4]}}
disturbance: {{type: {{sinusoid: {{omega: 2}}}}}}
simulation: {{horizon: 1, x0: [1, 2], v: [sin(t), t], u: [cos(t) - x1*x2]}}
""",
    "w of the states": f"""
system: {{{TWO_STATES}}}
nonlinearities: [{{f: atan(q) + y1, type: {{lipschitz: 1}}, Bf: [1, 0], Cq: [0, 1], Dq: [0.3, 0]}}]
disturbance: integrator
simulation: {{horizon: 1, x0: [1, 2], w: [x1*x2, t - x1**2]}}
""",
}


@pytest.mark.parametrize("text", SPECS.values(), ids=SPECS.keys())
def test_the_jacobian_is_the_derivative_of_the_flow(text):
    spec = loads(HEAD + text)
    random = np.random.default_rng(5)
    plant = spec.augmented
    gains = {
        "L1": random.normal(size=(plant.n, 2)),
        "L2": 0.3 * random.normal(size=(len(plant.Cq), 2)),
    }
    guarantee = EnergyGuarantee(gamma=1, rate=0.3, mu1=1, mu2=1, P=np.eye(plant.n))
    acting = replace(scenario(spec, spec.simulation, sampled=False), noise=np.ones((1, 2)))
    observer = FAMILIES["l2"].observer(spec, gains)
    system = System(acting, observer, spec.H.astype(float), guarantee)
    s = random.normal(size=len(system.start(spec.simulation.x0, spec.simulation.xhat0, np.zeros(0))))
    noise = 0.1 * random.normal(size=2)
    h = 1e-6
    columns = [
        (system.rhs(0.4, s + h * d, noise) - system.rhs(0.4, s - h * d, noise)) / (2 * h) for d in np.eye(len(s))
    ]
    assert system.jacobian(0.4, s, noise) == pytest.approx(np.array(columns).T, abs=2e-7)


def looped(terms, K):
    """phi_i = term_i(a + K phi), with a_i the inputs; the names of the terms are those of phi."""
    names = [f"a{i + 1}" for i in range(len(terms))]
    made = {f"phi{i + 1}": parse(term, names) for i, term in enumerate(terms)}
    made |= {
        name: {f"given{i + 1}": fmpq(1), **{f"phi{j + 1}": rational_number(float(k)) for j, k in enumerate(K[i])}}
        for i, name in enumerate(names)
    }
    program = Program(
        ["t", *(f"given{i + 1}" for i in range(len(terms)))], made, [f"phi{i + 1}" for i in range(len(terms))]
    )
    places = program.places(f"phi{i + 1}" for i in range(len(terms)))
    return lambda a: program.run(0.0, np.asarray(a, dtype=float), np.zeros(0))[places]


@given(
    st.lists(st.floats(-50, 50), min_size=3, max_size=3),
    st.lists(st.floats(-50, 50), min_size=3, max_size=3),
)
def test_a_loop_is_solved_from_any_previous_solution(first, second):
    K = np.array([[-1, 0.5, 0.2], [0, -2, 0], [0.3, 0, -1]])
    solve = looped(["a1**3", "a2*abs(a2)", "atan(a3)"], K)
    for a in (np.array(first), np.array(second)):
        phi = solve(a)
        q = a + K @ phi
        assert phi == pytest.approx([q[0] ** 3, q[1] * abs(q[1]), np.arctan(q[2])], rel=1e-9, abs=1e-9)


def test_loops_without_a_cycle_are_substituted():
    solve = looped(["a1**2", "sign(a2) + a2", "exp(a3)"], np.array([[0, 1, 0], [0, 0, 1], [0, 0, 0]]))
    c = np.exp(0.5)
    b = 1 + 0.25 + c
    assert solve([1, 0.25, 0.5]) == pytest.approx([(1 + b) ** 2, b, c])


def test_a_loop_without_a_solution_is_an_arithmetic_error():
    solve = looped(["a1**2", "0*a2", "0*a3"], np.diag([1.0, 0, 0]))  # phi = (1 + phi)^2
    with pytest.raises(ArithmeticError, match="loop"):
        solve([1.0, 0, 0])


def breaks(text, horizon):
    """Instants at which a signal of time jumps or bends."""
    switches = Switches()
    switches.decided(parse(text, ["t"]))
    return switches.breaks(horizon)


def test_switching_instants_are_neighboring_doubles():
    into, out_of = breaks("where(t < 0.3, 1, 2)", 1.0)  # t - 0.3 is zero in between
    assert into == (np.nextafter(0.3, 0), 0.3)
    assert out_of == (0.3, np.nextafter(0.3, 1))
    (pair,) = breaks("abs(t**2 - 0.5)", 1.0)
    assert pair[0] ** 2 < 0.5 < pair[1] ** 2
    assert pair[1] == np.nextafter(pair[0], 1)
    assert breaks("sin(t)*exp(-t)", 10.0) == []


def test_a_switching_function_that_vanishes_for_a_while_has_two_instants():
    instants = sorted({round(after, 9) for _, after in breaks("abs(max(t - 1, 0) - max(t - 2, 0) - 1)", 3.0)})
    assert instants == [1.0, 2.0]


@given(st.floats(0.01, 0.99), st.floats(1.01, 1.99))
def test_every_crossing_inside_the_horizon_is_found(a, b):
    found = breaks(f"sign((t - {a})*({b} - t))", 2.0)
    for crossing in (a, b):
        assert min(abs(after - crossing) for _, after in found) < 1e-14


@pytest.mark.parametrize(
    ("text", "horizon", "instants"),
    [
        ("sin(2*pi*5000*t) > 0", 5, np.arange(50_000) / 1e4),
        ("sin(t/200) > 0", 5, [0]),
        ("where(abs(t - 33.3333) < 1e-9, 1, 0)", 100, [33.3333 - 1e-9, 33.3333, 33.3333 + 1e-9]),
        ("sign(cos(1/(t + 0.01)))", 1, 1 / (np.pi * (np.arange(20) + 0.5)) - 0.01),
        ("where(sin(t) > 0, sin(3*t) > 0.5, t > 4)", 5, [np.pi / 18, 5 * np.pi / 18, np.pi, 4]),
        ("tan(t) > 1", 5, [np.pi / 4, np.pi / 2]),
    ],
)
def test_no_change_of_a_sign_is_stepped_over_however_fast_or_brief(text, horizon, instants):
    found = np.array([after for _, after in breaks(text, horizon)])
    for instant in instants:
        assert np.abs(found - instant).min() < 1e-12


@pytest.mark.parametrize("text", ["sin(1e6*t) > 0", "sign(sin(t)**2 + cos(t)**2 - 1)"])
def test_a_signal_that_changes_too_often_is_refused(text):
    with pytest.raises(UsageError, match=r"the sign of .* in t cannot be followed: .* shorten it, or write"):
        breaks(text, 5.0)


def test_jumps_are_applied_where_segments_begin_and_samples_take_the_value_after():
    flow = Flow(lambda t, s, held: -s + held, lambda t, s, held: -np.eye(1), watched=1)  # noqa: ARG005
    segments = [
        Segment(0.0, 1.0, lambda s: s, np.zeros(1)),
        Segment(1.0, 1.0, lambda s: s + 1, np.zeros(1)),
        Segment(1.0, 2.0, lambda s: s + 1, np.full(1, 5.0)),
    ]
    samples = np.array([0, 0.5, 1.5, 2.0])
    run = integrate(flow, np.ones(1), segments, samples, Tolerance(1e-9, np.full(1, 1e-12)))
    after = np.exp(-1) + 2
    late = [5 + (after - 5) * np.exp(-h) for h in (0.5, 1.0)]
    assert run.status == "done"
    assert run.s[:, 0] == pytest.approx([1, np.exp(-0.5), *late], abs=1e-7)


def test_chattering_is_a_stall_and_not_an_endless_run():
    flow = Flow(
        lambda t, s, held: held - np.sign(s) * (2 + np.sin(1e9 * s)),  # noqa: ARG005
        lambda t, s, held: np.zeros((1, 1)),  # noqa: ARG005
        watched=1,
    )
    segment = Segment(0.0, 10.0, lambda s: s, np.zeros(1))
    tolerance = Tolerance(1e-8, np.full(1, 1e-12))
    run = integrate(flow, np.ones(1), [segment], np.linspace(0, 10, 11), tolerance)
    assert run.status == "stall"
    assert run.time < 1
    assert len(run.t) == 1
