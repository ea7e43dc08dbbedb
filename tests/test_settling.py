"""When an estimate has come within 5 % and 1 % of its initial error, against closed forms."""

import re
from pathlib import Path

import numpy as np
import pytest
from support.commands import run
from support.running import simulate

from obsdesign.reading import loads
from obsdesign.simulate.summary import last_above

SPEC = """
obsdesign: 1
system: {{states: [x, still], outputs: [y, z], A: [[0, 0], [0, 0]], B: [[0, 0], [0, 0]], C: [[1, 0], [0, 1]]}}
observer: {{type: l2, alpha: 0.1}}
simulation: {{horizon: {horizon}, x0: [{x0}, 0], w: ["0", "0"], points: {points}}}
"""


def settling(gain, horizon=4, x0=1, points=5):
    """Of the observer xhat' = gain (xhat - y), with as few samples as given."""
    spec = loads(SPEC.format(horizon=horizon, x0=x0, points=points))
    gains = {"L1": np.diag([gain, -1.0]), "L2": np.zeros((0, 2))}
    return simulate(spec, gains, None).summary["settling"]


@pytest.mark.parametrize("x0", [1, -3])
def test_an_exponential_error_settles_when_it_must_however_few_samples_are_kept(x0):
    found = settling(-2.0, x0=x0)["x"]
    assert found["t5"] == pytest.approx(np.log(20) / 2, rel=1e-6)
    assert found["t1"] == pytest.approx(np.log(100) / 2, rel=1e-6)


def test_it_is_null_where_the_error_is_above_at_the_end_and_zero_where_there_was_none():
    found = settling(-1.0)
    assert found["x"] == {"t5": pytest.approx(np.log(20)), "t1": None, "peak": 1.0}
    assert found["still"] == {"t5": 0.0, "t1": 0.0, "peak": 0.0}


def test_the_last_time_counts_where_an_error_comes_back():
    t = np.linspace(0, 3, 3001)
    e = np.exp(-t) * np.cos(8 * t)
    assert last_above(t, e, 0.2) == pytest.approx(t[np.abs(e) > 0.2][-1], abs=1e-3)


def test_a_table_says_what_a_settling_time_is_and_in_which_unit(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = SPEC.format(horizon=4, x0=1, points=5).replace("alpha: 0.1", "alpha: 0.1, gains: {L1: [[-1, 0], [0, -1]]}")
    Path("still.yaml").write_text(text)
    run("solve", "still.yaml", "-q")
    rows = dict(re.split("  +", row, maxsplit=1) for row in run("simulate", "still.yaml").stdout.splitlines())
    assert rows["time"] == "4 s"
    assert rows["settling time"] == "not in this run: |e| is above 1 % of its largest at the end"
    assert rows["final error"] == f"{np.exp(-4):.6g}   |e| at the end"
    assert rows["settling"] == "still: starts at 0, |error| at most 0"
    assert "x: |error| stays below 5 % after 2.996 s, below 1 % never   of |error(0)|\n" in run("simulate").stdout
    told = run("simulate", "still.yaml", "--set", "simulation.horizon=5").stdout
    assert "settling time  4.60517 s   after that |e| stays below 1 % of its largest\n" in told
    told = run("simulate", "still.yaml", "--set", "simulation.horizon=4.7").stdout
    assert "settling time  not held before the end: |e| is above 1 % of its largest until 4.605 s\n" in told
    assert "x: |error| stays below 5 % after 2.996 s, below 1 % not held before the end   of |error(0)|\n" in told
    assert "5 %, 1 %: time in s after which |error| without noise stays below" in run("compare", "still.yaml").stdout


def test_an_error_that_changes_its_sign_between_two_steps_is_a_straight_line():
    assert last_above(np.array([0.0, 1.0]), np.array([1.0, -0.1]), 0.45) == pytest.approx(0.5)
