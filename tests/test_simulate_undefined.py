"""A run that cannot begin says which signal has no value at t = 0, and points at what is written."""

from pathlib import Path

import pytest
from support.commands import run

SPEC = """obsdesign: 1
name: begin
system:
  inputs: [u]
  disturbances: [push]
  dynamics: {x1: x2, x2: -x1 - x2 + u + push + log(x1 + 2.5)}
  outputs: {y: x1 + sqrt(2.5 - x1)}
  domain: {x1: [-2, 2], x2: [-2, 2], u: [-1, 1]}
observer: {type: ekf, Q: {push: 0.1}, R: 1.0e-4}
simulation: {horizon: 1%s}
"""


@pytest.mark.parametrize(
    ("change", "key", "said"),
    [
        (", w: [1/t]", "simulation.w[0]", "push = 1/t has no finite value at t = 0"),
        (", w: {push: sqrt(t - 1)}", "simulation.w.push", "push = sqrt(t - 1) has no finite value at t = 0"),
        (
            ", w: {push: 1.0e+300}",
            "simulation.w.push",
            "1e+300 at t = 0, whose square is beyond",
        ),
        (", u: log(t)", "simulation.u", "u = log(t) has no finite value at t = 0"),
        (", xhat0: {x2: 1.0e+200}", "simulation.xhat0.x2", "hat_x2 is 1e+200 at t = 0, whose square is beyond"),
        (", x0: [3, 0]", "system.outputs.y", "y has no finite value at t = 0, where x is x0"),
        (", x0: [-3, 0]", "system.dynamics.x2", "the rate of x2 has no finite value at t = 0, where x is x0"),
    ],
)
def test_the_signal_without_a_value_is_named_where_it_is_written(tmp_path, monkeypatch, change, key, said):
    monkeypatch.chdir(tmp_path)
    Path("case.yaml").write_text(SPEC % change)
    outcome = run("simulate", "case.yaml")
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    line = outcome.stderr.splitlines()[-1]
    assert line.startswith("case.yaml:")
    assert f": {key}: " in line
    assert said in line
    assert line.endswith("[OBS304]")


def test_the_v_that_generates_a_w_is_named_with_the_w(made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    outcome = run("simulate", made / "cart.gains.json", "--set", "simulation.w=[sqrt(t)]")
    assert outcome.exit_code == 2
    assert "simulation.w[0]: 0.5/sqrt(t), the v that generates w1, has no finite value at t = 0" in outcome.stderr


def test_a_nonlinearity_without_a_value_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    block = "nonlinearities: [{f: log(q), type: {slope: auto, region: {q: [0.1, 2]}}, Bf: [0, -1], Cq: [1, 0]}]"
    plant = "system: {A: [[0, 1], [-1, -1]], C: [[1, 0]]}\nobserver: {type: l2, alpha: 0.1, bounds: {L1: 100}}"
    Path("case.yaml").write_text(f"obsdesign: 1\n{block}\n{plant}\nsimulation: {{horizon: 1, x0: [-1, 0]}}\n")
    outcome = run("simulate", "case.yaml")
    assert outcome.exit_code == 2
    assert "case.yaml:2:17: nonlinearities: the rate of x2 has no finite value" in outcome.stderr
