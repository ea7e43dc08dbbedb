"""Specs in discrete time: what they may hold, and answers where there is no observer."""

import contextlib
import json

import pytest
from support.commands import run

from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.families import FAMILIES
from obsdesign.families.outcome import Verdict
from obsdesign.reading import loads
from obsdesign.tables.text import at_most

PLANT = """
obsdesign: 1
system: {{{time}A: [[.9, .1], [0, .8]], C: [1, 0], B: [[0, 0], [.1, 0]], D: [0, .1]}}
{more}
observer: {{{observer}}}
"""


def spec(observer, time="time: discrete, ", more=""):
    return PLANT.format(time=time, more=more, observer=observer)


WRONG = [
    (spec("type: l2", "time: discrete, period: 0, "), "system.period: 0 is not allowed; give a number > 0"),
    (spec("type: l2, rho: 1.2"), "observer.rho: 1.2 is not allowed; give a number in (0, 1]"),
    (spec("type: l2, rho: 0"), "observer.rho: 0 is not allowed; give a number in (0, 1]"),
    (spec("type: linf, rho: 1"), "observer.rho: 1 is not allowed; give a number in [0, 1)"),
    (spec("type: l2, rho: {min: .5, max: 1.5}"), "observer.rho.max: 1.5 is not allowed"),
    (spec("type: l2, rho: .9, alpha: 1", "time: discrete, period: 1, "), "observer.rho: stands beside observer.alpha"),
    (spec("type: l2, rho: .9", ""), "observer.rho: is the decay a sample, of a plant with time: discrete"),
    (spec("type: l2, alpha: 1, estimate: filtered", ""), "observer.estimate: is of a plant with time: discrete"),
    (
        spec("type: l2, rho: .9", "time: discrete, Ts: .1, "),
        "system.Ts: Ts is called period here: write time: discrete",
    ),
    (spec("type: l2, rho: .9", "time: discret, "), "system.time: unknown time discret; did you mean discrete?"),
    (spec("type: l2, alpha: 1", "period: .1, "), "system.period: goes with time: discrete"),
    (spec("type: l2", more="disturbance: [integrator, unknown]"), "system: period is missing, and the disturbance"),
    (spec("type: l2, alpha: 1"), "system: period is missing, and observer.alpha is in 1/s"),
    (
        spec("type: l2", "time: discrete, units: {x1: rad/s}, "),
        "system: period is missing, and the unit of x1 is rad/s",
    ),
    (
        spec("type: l2", "time: discrete, period: 1, ", "disturbance: [{sinusoid: {omega: 4}}, unknown]"),
        "disturbance[0].sinusoid.omega: 4 rad/s is too fast for samples 1 s apart, which show less than 3.141",
    ),
    (
        spec("type: l2, estimate: filtered", more="nonlinearities: [{type: sin, Bf: [0, 1], Cq: [1, 0], Df: [1]}]"),
        "nonlinearities: Df must be zero for estimate: filtered; predicted estimates take it",
    ),
    (spec("type: linf, reconstruct: w"), "observer.reconstruct: is for continuous time"),
    (spec("type: l2, objective: max-alpha, rho: .9"), "observer.rho: objective max-alpha needs a range"),
]


@pytest.mark.parametrize(("text", "said"), WRONG)
def test_a_wrong_spec_is_refused_in_one_line(text, said):
    with pytest.raises(UsageError) as refused:
        loads(text)
    assert [str(p) for p in refused.value.problems if said in str(p)]
    assert len(refused.value.problems) == 1


@pytest.mark.parametrize("name", [name for name, family in FAMILIES.items() if not family.discrete])
def test_other_families_say_which_take_discrete_time(name):
    with pytest.raises(UsageError) as refused:
        loads(spec(f"type: {name}"))
    said = f"system.time: discrete time is not available for type {name}"
    assert any(said in str(p) or "kkl" in str(p) for p in refused.value.problems)
    assert "take l2, linf" in str(refused.value)


MODE = """
obsdesign: 1
system: {{time: discrete, A: [[.9, 0], [0, {mode}]], C: [1, 0], B: [[1, 0], [0, 0]], D: [0, 1]}}
performance: {{H: [{H}]}}
observer: {{type: {type}, rho: {rho}}}
"""
LOOP = """
obsdesign: 1
system: {{time: discrete, A: [[.9, .1], [0, .8]], C: [1, 0], B: [[0, 0], [.1, 0]], D: [0, .1]}}
nonlinearities: [{{type: {type}, Bf: [0, -.1], Cq: [0, 1]}}]
observer: {{type: l2, rho: .95}}
"""
SLOW = """
obsdesign: 1
system: {{time: discrete, A: [[.5, 0], [0, .8]], C: [1, 0], B: [[.1, 0], [.1, 0]], D: [0, .1]}}
nonlinearities: [{{type: {{slope: [0, {k}]}}, Bf: [0, 1], Cq: [0, 1]}}]
observer: {{type: l2, rho: .96}}
"""
SCALAR = """
obsdesign: 1
system: {{time: discrete, A: .5, C: 1, B: [.1, 0], D: [0, .1]}}
nonlinearities: [{{type: {{lipschitz: 1.01}}, Bf: 1, Cq: 1}}]
observer: {{type: l2, rho: 1{more}}}
"""


def solved(text):
    made = loads(text)
    return FAMILIES[made.observer.type].design(made, Engine())


@pytest.mark.parametrize(
    ("text", "condition", "proof", "said"),
    [
        (MODE.format(mode=1.1, H="[1, 1]", type="l2", rho=0.95), "detectability", "exact", "lambda = 1.1"),
        (MODE.format(mode=0.96, H="[1, 0]", type="l2", rho=0.95), "detectability", "exact", "rho above 0.96"),
        (MODE.format(mode=0.96, H="[0, 1]", type="linf", rho=0.95), "detectability", "exact", "rho above 0.96"),
        (MODE.format(mode=0.96, H="[0, 1]", type="l2", rho=0.96), "detectability", "exact", "and z shows it"),
        (MODE.format(mode=1, H="[0, 1]", type="l2", rho=1), "detectability", "exact", "at rho = 1 itself"),
        (LOOP.format(type="monotone"), "explicit", "exact", "implicit Euler"),
        (LOOP.format(type="{slope: [0, 18.019]}"), "decay", "exact", "ask for rho at least"),
        (SLOW.format(k=0.165), "detectability", "exact", "the slope 0.165 of f1"),
        (SCALAR.format(more=""), "width", "exact", "L2: free"),
    ],
)
def test_infeasible_specs_say_why_and_what_to_do(text, condition, proof, said):
    outcome = solved(text)
    assert outcome.status is Verdict.INFEASIBLE
    assert (outcome.diagnosis["condition"], outcome.diagnosis["proof"]) == (condition, proof)
    assert said in f"{outcome.diagnosis['reason']}; {outcome.diagnosis['suggestion']}"
    assert "alpha" not in f"{outcome.diagnosis['reason']}; {outcome.diagnosis['suggestion']}"


@pytest.mark.parametrize(
    "text", [LOOP.format(type="{slope: [0, 18.017]}"), SLOW.format(k=0.155), SCALAR.format(more=", L2: free")]
)
def test_just_inside_there_is_an_observer(text):
    assert solved(text).status is Verdict.CERTIFIED


@pytest.mark.parametrize(
    ("family", "rho", "H"), [("l2", 0.96, "[1, 0]"), ("linf", 0.96, "[0, 1]"), ("l2", 1, "[1, 0]")]
)
def test_nothing_is_decided_of_a_mode_at_the_very_edge_that_z_does_not_show(family, rho, H):
    with pytest.raises(UndecidedError, match="is not seen by any output, and decays at rho"):
        solved(MODE.format(mode=rho, H=H, type=family, rho=rho))


@pytest.mark.parametrize("text", [MODE.format(mode=1.1, H="[1, 1]", type="l2", rho=0.95), LOOP.format(type="monotone")])
def test_that_there_is_none_is_proved_anew(text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "none.yaml").write_text(text)
    assert run("solve", "none.yaml", "-q").exit_code == 3
    outcome = run("verify", "none.gains.json")
    assert outcome.exit_code == 0
    assert "no solution" in outcome.stdout


TWICE = """
obsdesign: 1
system: {time: discrete, A: -0.9, B: 1, C: 1, D: 1}
observer: {type: TYPE, rho: RHO, estimate: filtered, gains: {L1: -0.5}}
simulation: {horizon: 400, x0: [0], w: ["cos(pi*t)"]}
"""


@pytest.mark.parametrize(("family", "rho"), [("l2", "1"), ("linf", "0.7")])
def test_what_is_told_of_filtered_estimates_is_gamma_of_v_itself(family, rho, tmp_path, monkeypatch):
    """Where v acts on the state and on y; w = (-1)^k nearly reaches it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "twice.yaml").write_text(TWICE.replace("TYPE", family).replace("RHO", rho))
    assert run("solve", "twice.yaml", "-q").exit_code == 0
    claimed = json.loads((tmp_path / "twice.gains.json").read_text())["guarantee"]
    assert claimed["gamma_v"] == pytest.approx(2**0.5 * claimed["gamma"], rel=1e-9)
    told = run("verify", "twice.gains.json").stdout
    assert f"gamma_v {at_most(claimed['gamma_v'])}" in told
    assert f"gamma {at_most(claimed['gamma'])}" not in told
    e, errors = 0.0, []
    for k in range(400):  # e+ = A e - B v + L1 (C A e - C B v - D v+), v = (-1)^k
        errors.append(abs(e))
        e = -0.9 * e - (-1) ** k - 0.5 * (-0.9 * e - (-1) ** k - (-1) ** (k + 1))
    reached = max(errors) if family == "linf" else (sum(x * x for x in errors) / 400) ** 0.5
    assert claimed["gamma"] < reached <= claimed["gamma_v"]


@pytest.mark.parametrize(("alpha", "said"), [("1e15", "give at most 60, or rho"), ("1e-300", "give at least 1e-12")])
def test_rates_that_samples_do_not_tell_are_refused(alpha, said):
    with pytest.raises(UsageError, match=said):
        loads(spec(f"type: l2, alpha: {alpha}", "time: discrete, period: 1, "))


def test_the_least_rho_of_a_linear_plant_is_sought_above_a_hundredth():
    outcome = solved(spec("type: l2, objective: max-alpha"))
    assert outcome.status is Verdict.CERTIFIED
    assert outcome.limit["rho"] == pytest.approx(0.01)


def test_matrices_beyond_what_doubles_square_are_no_crash():
    text = spec("type: l2, rho: .95").replace(".9, .1", "1e200, .1")
    with contextlib.suppress(UsageError, UndecidedError):
        assert solved(text).status is not Verdict.CERTIFIED
