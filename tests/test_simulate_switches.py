"""Runs through jumps and kinks of signals, known in time or located in the states, against closed forms."""

import json

import numpy as np
import pytest
from support.commands import run

from obsdesign.simulate import simulation

SPEC = """obsdesign: 1
name: case
system: {inputs: [u], A: [[-1]], B: [[1, 0]], C: [[1]], D: [[0, 0.1]], gx: [u]}
observer: {type: l2, alpha: 0.1}
simulation: {horizon: 5, x0: [%s], u: ["%s"]%s}
"""
NOISE = ", noise: {type: uniform, amplitude: [0.02], period: 0.02}"


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch, sketched):  # noqa: ARG001
    monkeypatch.chdir(tmp_path)


def simulated(tmp_path, x0, u, further=""):
    """Rows of a run of the command line, t, x1, hat_x1, .., and its summary."""
    (tmp_path / "case.yaml").write_text(SPEC % (x0, u, further))
    outcome = run("simulate", "case.yaml", "--json")
    assert outcome.exit_code == 0, outcome.output
    return np.loadtxt("case.run.csv", delimiter=",", skiprows=1), json.loads(outcome.stdout)


def pulses(*spans):
    """x(5) of x' = -x + u from zero, with u = 1 in each span."""
    return sum(np.exp(stop - 5) - np.exp(start - 5) for start, stop in spans)


@pytest.mark.parametrize(
    ("x0", "u", "end"),
    [
        (0, "sin(t/200) > 0", pulses((0, 5))),
        (0, "sin(2*pi*500*t) > 0", pulses(*((k / 500, (k + 0.5) / 500) for k in range(2500)))),
        (0, "where(abs(t - 2) <= 1e-7, 1e7, 0)", 1e7 * pulses((2 - 1e-7, 2 + 1e-7))),
        (0, "min(max(t - 1, 0), 2)", 2 - np.exp(-2) + np.exp(-4)),
        (1, "(x1 > 0.6)*(x1 - 1)", 0.6 * np.exp(0.4 - 5)),
        (1, "abs(x1 - 0.3)", 0.15 + 0.15 * np.exp(-2 * (5 - 7 / 3))),
        (0.1, "min(1, 3*x1)", 1 - 2 / 3 * np.exp(-(5 - np.log(10 / 3) / 2))),
        (0.1, "sat(4*x1)", 1 - 0.75 * np.exp(-(5 - np.log(2.5) / 3))),
        (0, "1 - 0.2*sign(x1 - 0.6)", 0.8 - 0.2 * np.exp(np.log(2) - 5)),
        (0, "where(abs(x1 - 0.5) < 0.2, 2, 1)*(t > 1)", 1 - 0.3 * np.exp(np.log(17 / 13 / 0.7) - 4)),
    ],
)
def test_a_run_passes_jumps_and_kinks_exactly(tmp_path, x0, u, end):
    rows, summary = simulated(tmp_path, x0, u)
    assert summary["status"] == "done"
    assert rows[-1, 1] == pytest.approx(end, abs=2e-7)
    assert all(bound["holds"] for bound in summary["bounds"])


def test_a_sliding_mode_is_told_in_words_and_without_delay(tmp_path):
    rows, summary = simulated(tmp_path, 1, "-2*sign(x1 - 0.2)")
    assert summary["status"] == "stall"
    assert summary["time"] == pytest.approx(np.log(3 / 2.2), abs=1e-3)
    assert "the sign of x1 - 0.2 changes without end, as in a sliding mode" in summary["reason"]
    assert (rows[:, 1] > 0.199).all()


@pytest.mark.parametrize(("u", "further"), [("0", NOISE), ("sin(2*pi*40*t) > 0.3", ""), ("sin(20*t) > 0", NOISE)])
def test_inputs_that_are_held_are_followed_exactly_where_there_are_many(tmp_path, monkeypatch, u, further):
    exact, _ = simulated(tmp_path, 1, u, further)
    monkeypatch.setattr(simulation, "MANY", np.inf)
    one_by_one, _ = simulated(tmp_path, 1, u, further)
    assert exact == pytest.approx(one_by_one, abs=3e-6)
