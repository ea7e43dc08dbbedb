"""What `check` says of a plant: only what means something for it."""

import json
from pathlib import Path

import pytest
from support.commands import run

pytestmark = pytest.mark.usefixtures("here")

HIDDEN = "obsdesign: 1\nsystem: {A: [[%s, 0], [0, -3]], C: [0, 1]}\nobserver: %s\n"
OBSERVERS = {"alpha": "{type: l2, alpha: 0.3}", "lambda_t": "{type: sporadic, T1: 0.1, T2: 0.2}"}


def findings_of(text):
    """Findings by their names."""
    Path("spec.yaml").write_text(text)
    return {f["name"]: f for f in json.loads(run("check", "spec.yaml", "--json").stdout)["findings"]}


@pytest.mark.parametrize("name", OBSERVERS)
@pytest.mark.parametrize(("value", "why"), [("0.2", "grows"), ("0", "does not decay")])
def test_no_decay_is_said_where_there_can_be_none(name, value, why):
    found = findings_of(HIDDEN % (value, OBSERVERS[name]))["decay"]
    assert found["sentence"] == f"no {name} > 0 can be had: a mode that no output shows {why}"
    assert found["limit"] == -float(value)
    assert not found["holds"]


def test_the_limit_of_a_decay_is_a_number_where_there_is_one():
    assert (
        findings_of(HIDDEN % ("-0.2", OBSERVERS["alpha"]))["decay"]["sentence"] == "detectability limits alpha to 0.2"
    )


def test_zeros_from_a_disturbance_are_told_only_where_there_is_one():
    text = "obsdesign: 1\nsystem: {A: [[0, 1], [-2, -3]], %sC: [1, 0]}\nobserver: {type: l2, alpha: 0.3}\n"
    assert not [name for name in findings_of(text % "") if name.startswith("zeros")]
    assert [n for n in findings_of(text % "B: [0, 1], ") if n.startswith("zeros")] == ["zeros, w to y", "zeros, v to y"]


def test_a_run_tells_its_largest_error_in_words():
    text = (
        "obsdesign: 1\nsystem: {A: [[0, 1], [-2, -3]], C: [1, 0]}\nobserver: {type: l2, alpha: 0.3, bounds: {L1: 9}}\n"
    )
    Path("spec.yaml").write_text(text + "simulation: {horizon: 1, x0: [1, 0], points: 50}\n")
    assert "largest error  1 of x1, at t = 0 s" in run("simulate", "spec.yaml").stdout
