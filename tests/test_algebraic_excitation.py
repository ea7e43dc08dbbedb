"""What estimates of constants need to converge is said in full, and a run tells whether it had it."""

import json
from pathlib import Path

import pytest
from support.commands import run
from support.shipped import SPECS

pytestmark = pytest.mark.usefixtures("here", "sketched")

TWO = """\
obsdesign: 1
system: {dynamics: {x1: -x1 + %s + %s, a: 0, b: 0}, outputs: {y: x1}}
observer:
  type: pebo
  coordinates: [{name: xa, phi: a}, {name: xb, phi: b}]
  left_inverse: {a: xa, b: xb}
  estimator: {regressions: [{output: y, known: %s, m: {xa: %s, xb: %s}}], method: %s, alpha: 5, gamma: 1%s}
simulation: {horizon: 60, x0: [0, 1, -1]}
"""
LINEAR = ("-y + (%s)*xa + sin(t)*xb", "%s", "sin(t)", "gradient", "")
POWERS = ("-y", "(%s)*exp(xa)", "sin(t)*exp(xb)", "log-gradient", ", as: {xa: exp, xb: exp}")
FORMS = {"gradient": ("(%s)*a", "sin(t)*b", *LINEAR), "log-gradient": ("(%s)*exp(a)", "sin(t)*exp(b)", *POWERS)}
BOUNDED = (
    "it suffices that the least eigenvalue of int psi psi' dt over every window of one length exceeds c > 0 and psi "
    "stays bounded"
)


def made(text, *changes):
    """Statement, table and summary of a certified spec and its run."""
    Path("case.yaml").write_text(text)
    outcome = run("solve", "case.yaml")
    assert outcome.exit_code == 0, outcome.output
    assert run("verify", "case.gains.json").exit_code == 0
    ran = run("simulate", "case.gains.json", "--json", *changes)
    assert ran.exit_code == 0, ran.output
    said = json.loads(Path("case.gains.json").read_text())["guarantee"]["statement"]
    return said, outcome.stdout, json.loads(ran.stdout)


@pytest.mark.parametrize("method", FORMS)
@pytest.mark.parametrize(("psi", "converges"), [("1 + t", False), ("1 + cos(t)", True)])
def test_a_gradient_of_several_constants_needs_regressors_that_stay_bounded(method, psi, converges):
    parts = [part % psi if "%s" in part else part for part in FORMS[method]]
    said, table, summary = made(TWO % tuple(parts))
    assert BOUNDED in said
    assert BOUNDED in table
    found = summary["excitation"]
    assert BOUNDED in found["note"]
    assert found["least_eigenvalue_of_a_window"] > 0.5
    assert (found["largest_regressor"] < 3) == converges
    assert (found["largest_regressor_at_the_end"] > 50) != converges
    assert (summary["final_error"] < 0.1) == converges


@pytest.mark.parametrize(("start", "reached"), [("-20", False), ("1", True)])
def test_a_logarithm_that_is_never_reached_is_assumed_not_to_be_asked_for(start, reached):
    text = (SPECS / "exponential-drift.yaml").read_text()
    head, _ = text.split("simulation:")
    said, table, summary = made(f"{head}simulation: {{horizon: 20, x0: [0.5, 1, {start}], u: 0.05 - 0.1*x3}}\n")
    assumed = "that exp(theta) of xi2 exceeds 1e-06, which is assumed: the estimate is log(max(Theta, 1e-06))"
    assert f"not proved: {assumed}" in said
    assert assumed in table
    assert assumed in summary["excitation"]["note"]
    assert summary["guard"]["theta_xi2"]["at_end"] == (not reached)
    assert (summary["final_error"] < 1e-3) == reached
    told = run("simulate", "case.gains.json").stdout
    assert ("at its end too: the estimate is not to be believed there" in told) != reached
    assert ("guard          theta_xi2: never acts" in told) == reached


MIXED = """\
obsdesign: 1
system: {dynamics: {x1: -x1 + a*%s, a: 0}, outputs: {y: x1}}
observer:
  type: pebo
  coordinates: [{name: xa, phi: a}]
  left_inverse: {a: xa}
  estimator:
    regressions: [{output: y, known: -y + xa*%s, m: {xa: %s}}]
    alpha: 5
    gamma: 1
    method: drem
    filters: %s
    kappa: %s
simulation: {horizon: 60, x0: [3, 1]}
"""
KEPT = "since the memory forgets nothing (kappa is 0) and keeps the error of the filters at the start"
FORGOTTEN = "psi must stay bounded for the memory to forget the error of the filters at the start"
MEMORIES = {  # m, how the filters begin, kappa; what is said of the error at the start, whether the estimate is right
    "kept": ("exp(-t)", "zero", 0, KEPT, False),
    "kept, and outweighed": ("(2 + sin(t))", "zero", 0, KEPT, True),
    "forgotten": ("(2 + sin(t))", "zero", 1, FORGOTTEN, True),
    "none": ("exp(-t)", "consistent", 0, "", True),
}


@pytest.mark.parametrize(("m", "filters", "kappa", "words", "right"), MEMORIES.values(), ids=MEMORIES)
def test_a_memory_that_forgets_nothing_keeps_the_error_with_which_filters_begin(m, filters, kappa, words, right):
    said, table, summary = made(MIXED % (m, m, m, filters, kappa))
    need = "int Delta^2 dt must grow without end"
    assert need in said
    assert words in said
    assert words in table
    assert words in summary["excitation"]["note"]
    assert ("filters at the start" in said) == bool(words)
    assert summary["excitation"]["delta_squared"] > 1
    assert (summary["final_error"] < 0.1) == right


def test_a_memory_that_forgets_nothing_keeps_the_error_of_an_earlier_coordinate():
    text = (SPECS / "cascade-mixing.yaml").read_text()
    kept = [line for line in text.splitlines() if "kappa" not in line]
    said, *_ = made("\n".join(kept), "--set", "simulation.horizon=1")
    assert "forgets nothing (kappa is 0) and keeps the error of the estimate of x" in said
    said, *_ = made(text, "--set", "simulation.horizon=1")
    assert "psi must stay bounded for the memory to forget the error of the estimate of x" in said
