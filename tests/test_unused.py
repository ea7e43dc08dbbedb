"""Keys of a spec that have no effect: they are refused, or `check` and `solve` say so."""

import json
from pathlib import Path

import pytest
from support.commands import run

pytestmark = pytest.mark.usefixtures("here")

PLANT = "obsdesign: 1\nsystem: {A: [[0, 1], [-2, -3]], B: [0, 1], C: [1, 0]}\n"
CURVED = PLANT + "nonlinearities: [{f: sin(q), type: sin, Bf: [0, 1], Cq: [1, 0]}]\n"
EQUATIONS = (
    "obsdesign: 1\nsystem: {disturbances: [force], dynamics: {x1: x2, x2: -2*x1 - 3*x2 + force}, outputs: {y1: x1}}\n"
)
HIGH_GAIN = EQUATIONS + "observer: {type: high-gain, injection: {x1: {y1: 10}, x2: {y1: 30}}}\n"
SPORADIC = "type: sporadic, T1: 0.05, T2: 0.1, delta: 9"
AS_GIVEN = "has no effect: given gains are analysed as they are"


def notes_of(text):
    """What `check` finds to be without effect, and what `solve` notes of it."""
    Path("spec.yaml").write_text(text)
    checked = run("check", "spec.yaml", "--json")
    assert checked.exit_code == 0, checked.stderr
    found = [f["sentence"] for f in json.loads(checked.stdout)["findings"] if f["id"] == "OBS615"]
    assert run("solve", "spec.yaml", "-q").exit_code in {0, 4}
    assert [
        note for note in json.loads(Path("spec.gains.json").read_text()).get("notes", ()) if "effect" in note
    ] == found
    assert run("verify", "spec.gains.json", "-q").exit_code in {0, 4}
    return found


@pytest.mark.parametrize(
    ("plant", "observer", "entry", "why"),
    [
        (PLANT, "type: l2, alpha: 0.3, gains: {L1: [-1, -1]}", "slack: 0.3", AS_GIVEN),
        (PLANT, "type: l2, alpha: 0.3, gains: {L1: [-1, -1]}", "bounds: {gamma: 1.0e-3}", AS_GIVEN),
        (CURVED, "type: l2, alpha: 0.3, gains: {L1: [-1, -1]}", "L2: 1", AS_GIVEN),
        (PLANT, "type: linf, alpha: 0.3, gains: {L1: [-1, -1]}", "objective: feasibility", AS_GIVEN),
        (
            PLANT,
            "type: l2, alpha: 0.3, objective: {gamma: 0.9}",
            "slack: 0.3",
            "the level is what objective.gamma says",
        ),
        (CURVED, "type: lipschitz, gains: {L: [1, 1]}", "bounds: {L: 9}", AS_GIVEN),
        (CURVED, f"{SPORADIC}, gains: {{L: [1, 0.1]}}", "bounds: {L: 9}", AS_GIVEN),
        (CURVED, f"{SPORADIC}, objective: feasibility", "slack: 0.3", "has no effect: feasibility has no optimum"),
    ],
)
def test_a_key_of_the_observer_without_effect_is_told(plant, observer, entry, why):
    (said,) = notes_of(f"{plant}observer: {{{observer}, {entry}}}\n")
    assert said.startswith(f"observer.{entry.partition(':')[0]} has no effect: ")
    assert why in said
    assert not notes_of(f"{plant}observer: {{{observer}}}\n")


def test_a_grid_that_is_not_searched_is_told():
    asked = "observer: {type: l2, objective: max-alpha, alpha: {min: 0.1, max: 3%s}, bounds: {L1: 9}}\n"
    (said,) = notes_of(PLANT + asked % ", points: 9")
    assert said == "observer.alpha.points has no effect: max-alpha halves the range, without a grid"
    assert not notes_of(PLANT + asked % "")


def test_performance_is_no_matter_of_a_family_without_an_lmi():
    (said,) = notes_of(HIGH_GAIN + "performance: [x1]\n")
    assert said.startswith(
        "performance has no effect on the design by type high-gain: the observer does not depend on it"
    )
    assert not notes_of(HIGH_GAIN + "performance: x\n")


@pytest.mark.parametrize("written", ["[force]", "w"])
def test_a_disturbance_cannot_be_asked_of_a_family_that_estimates_states(written):
    Path("spec.yaml").write_text(HIGH_GAIN + f"performance: {written}\n")
    outcome = run("check", "spec.yaml")
    assert outcome.exit_code == 2
    assert "force is unknown, and this type of observer estimates states only; name states" in outcome.stderr


@pytest.mark.parametrize("key", ["xi0: {a: 1}", "theta0: {a: 1}"])
@pytest.mark.parametrize(
    "observer", ["{type: l2, alpha: 0.3}", "{type: sporadic, T1: 0.1, T2: 0.2}", "{type: ekf, Q: 1, R: 1}"]
)
def test_coordinates_are_refused_where_an_observer_has_none(key, observer):
    Path("spec.yaml").write_text(f"{PLANT}observer: {observer}\nsimulation: {{horizon: 1, {key}}}\n")
    outcome = run("check", "spec.yaml")
    assert outcome.exit_code == 2
    assert "belongs to observer.type kkl or pebo or kkl+pebo or immersion-invariance or high-gain" in outcome.stderr
