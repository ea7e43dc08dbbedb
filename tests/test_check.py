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


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "system: {A: [[0, 1], [-2, -3]], B: [[0, 0], [1, 0]], C: [1, 0], D: [0, 1]}\n"
            "observer: {type: l2, alpha: 0.3}",
            "Theorem 2 does not promise any gamma > 0, its conditions being sufficient only: y shows some of v too "
            "late; y determines 1 of the 2 components of v at most; `solve` tells the limit of gamma, which may be 0 "
            "all the same; where it is too large, measure another signal [OBS614]",
        ),
        (
            "system: {A: -1, C: 1}\nobserver: {type: ekf, Q: 1, R: 1}",
            "ekf: no guarantee; nothing of its error is proved, whatever the weights are; "
            "`obsdesign compare` runs it beside an observer that is proved [OBS505]",
        ),
        (
            "system: {A: -1, C: 1}\nparameters: {unused: 1}\nobserver: {type: l2, alpha: 0.3}",
            "parameters.unused has no effect: no number and no expression uses it; use it or leave it out [OBS615]",
        ),
        (
            "system: {A: [[0, 1], [-1, -1]], C: [1, 0]}\nnonlinearities: [{type: {lipschitz: 9}}]\n"
            "observer: {type: lipschitz}",
            "describe f by a slope and use type l2 [OBS607]",
        ),
    ],
)
def test_a_note_says_what_to_do_and_what_asks_for_nothing_is_in_json_only(text, said):
    Path("spec.yaml").write_text(f"obsdesign: 1\n{text}\n")
    outcome = run("check", "spec.yaml")
    assert outcome.exit_code == 0
    notes = [line for line in outcome.stdout.splitlines() if line.startswith("note")]
    assert notes[-1].endswith(said)
    failed = [f for f in json.loads(run("check", "spec.yaml", "--json").stdout)["findings"] if not f["holds"]]
    told = [f"note  {f['sentence']}; {f['advice']} [{f['id']}]" for f in failed if "advice" in f]
    assert told == notes
    assert len(failed) >= len(notes)


def test_a_relaxation_that_is_too_rough_names_one_that_does():
    system = "system: {A: [[0, 1], [-1, -1]], B: [0, 1], C: [1, 0]}\nnonlinearities: [{type: {lipschitz: 0.8}}]"
    asked = "{type: lipschitz, objective: min-gamma, relaxation: abbaszadeh}"
    Path("spec.yaml").write_text(f"obsdesign: 1\n{system}\nobserver: {asked}\n")
    outcome = run("check", "spec.yaml")
    assert outcome.exit_code == 3
    assert "; take relaxation: s-procedure [OBS607]\n" in outcome.stdout


def test_a_run_tells_its_largest_error_in_words():
    text = (
        "obsdesign: 1\nsystem: {A: [[0, 1], [-2, -3]], C: [1, 0]}\nobserver: {type: l2, alpha: 0.3, bounds: {L1: 9}}\n"
    )
    Path("spec.yaml").write_text(text + "simulation: {horizon: 1, x0: [1, 0], points: 50}\n")
    assert "largest error  1 of x1, at t = 0 s" in run("simulate", "spec.yaml").stdout
