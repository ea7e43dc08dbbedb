"""What a user may have meant where a spec is infeasible: told where it is certified, and only there."""

import json
import re
from pathlib import Path

import pytest
from support.commands import run

PLANT = """\
obsdesign: 1
name: spring
system: {A: [[0, 1], [-1, -1]], B: [0, 1], C: [1, 0]}
nonlinearities:
  - {f: sin(q), type: {lipschitz: 1}, Bf: [0, 0.2], Cq: [1, 0]}
"""
GIVEN = {
    "l2": ("{type: l2, alpha: 0.1, gains: {L1: [%s2, %s2], L2: 0}}", "-L1", "yhat - y"),
    "linf": ("{type: linf, alpha: 0.1, gains: {L1: [%s2, %s2], L2: 0}}", "-L1", "yhat - y"),
    "lipschitz": ("{type: lipschitz, objective: min-gamma, gains: {L: [%s2, %s2]}}", "-L", "y - yhat"),
    "sporadic": ("{type: sporadic, T1: 0.05, T2: 0.1, gains: {L: [%s2, %s2], H: 0}}", "-L", "y - yhat"),
}


def suggestion(text):
    """What is suggested for a spec that is infeasible."""
    Path("spec.yaml").write_text(text)
    outcome = run("solve", "spec.yaml")
    assert outcome.exit_code == 3, outcome.output
    said = json.loads(Path("spec.gains.json").read_text())["diagnosis"].get("suggestion", "")
    assert said in outcome.stdout
    return said


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("family", GIVEN)
def test_gains_of_the_other_sign_are_recognised(family):
    asked, names, residual = GIVEN[family]
    wrong = "" if residual == "yhat - y" else "-"
    text = PLANT + f"observer: {asked % (wrong, wrong)}\n"
    assert suggestion(text).startswith(
        f"give {names}: with the opposite sign they are certified, since gains multiply {residual} here"
    )
    assert "opposite sign" not in suggestion(text.replace("[[0, 1], [-1, -1]]", "[[0, 1], [9, 9]]"))


CART = """\
obsdesign: 1
system: {A: [[0, 1, 0], [-2, -1, 1], [0, 0, -0.1]], B: [[0], [1], [0]], C: [1, 0, 0]}
observer: {type: l2, alpha: 0.2, %s}
"""


@pytest.mark.usefixtures("here")
def test_a_gamma_below_the_least_that_was_found_within_bounds_is_not_said_to_be_impossible():
    said = suggestion(CART % "bounds: {L1: 20, gamma: 1.0e-4}")
    levels = re.search(r"gamma (\S+) is the least .*; without them gamma above (\S+) is", said)
    found, least = map(float, levels.groups())
    assert f"within the bounds gamma {found:g} is the least that was found" in said
    Path("spec.yaml").write_text(CART % "gains: {L1: [[-3.59769], [-8.7312], [-17.629]]}")  # |L1| = 19.999
    assert run("solve", "spec.yaml").exit_code == 0
    assert least < json.loads(Path("spec.gains.json").read_text())["guarantee"]["gamma"] < found


SEEN = "[[-1, 1], [0, -0.5]], B: [1, 0], C: [1, 0]}\nnonlinearities: [{type: {lipschitz: 1.5}, Bf: [1, 0], Cq: [0, 1]}]"
CUBIC = "[[-1, 1], [0, -1]], B: [1, 0], C: [1, 0]}\nnonlinearities: [{type: monotone, Bf: [0, -1], Cq: [1, 1]}]"
STEEP = "[[-1, 0], [1, -1]], B: [0, 1], C: [0, 1]}\nnonlinearities: [{type: monotone, Bf: [0, -1], Cq: [0, 1]}]"
CHAIN = "[[-1, 0], [0, -0.5]], B: [1, 0], C: [1, 0]}"
NOISY = "[[0, 1], [0, -0.5]], B: [[0, 0], [1, 0]], C: [1, 0], D: [[0, 0.01]]}"
SMALL = f"{NOISY}\nnonlinearities: [{{type: {{lipschitz: 0.1}}, Bf: [0, 1], Cq: [1, 0]}}]"
NECESSARY = [
    (SEEN, "{type: l2, L2: 0, alpha: 0.8, bounds: {L1: 50}}", "alpha: 0.8", "alpha: %s", "alpha below 0.5"),
    (SEEN, "{type: linf, L2: 0, alpha: 0.8, bounds: {L1: 50}}", "alpha: 0.8", "alpha: %s", "alpha below 0.5"),
    (CHAIN, "{type: l2, alpha: 0.6, bounds: {L1: 9}}", "alpha: 0.6", "alpha: %s", "alpha below 0.5"),
    (CHAIN, "{type: sporadic, T1: 0.1, T2: 0.2, decay: 0.6}", "decay: 0.6", "decay: %s", "decay below 0.5"),
    (STEEP, "{type: l2, L2: 0, alpha: 2.5, bounds: {L1: 9}}", "alpha: 2.5", "alpha: %s", "alpha at most 1"),
    (CUBIC, "{type: linf, L2: 0, alpha: 0.1, bounds: {L1: 30}}", "L2: 0", "L2: free", "L2 <= -0.1"),
    (NOISY, "{type: l2, alpha: 0.5, objective: {gamma: 0.001}}", "0.001", "%s", "gamma above 0.100313"),
    (NOISY, "{type: linf, alpha: 0.5, bounds: {gamma: 0.001, L1: 1000}}", "0.001", "%s", "gamma above 0.377121"),
    (SMALL, "{type: lipschitz, objective: min-gamma, decay: 0.5, bounds: {gamma: 0.001}}", "0.001", "%s", "gamma"),
]


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(("system", "observer", "asked", "instead", "necessary"), NECESSARY)
def test_what_is_suggested_was_tried_and_what_is_only_necessary_is_said_to_be(
    system, observer, asked, instead, necessary
):
    text = f"obsdesign: 1\nsystem: {{A: {system}\nobserver: {observer}\n"
    said = suggestion(text)
    cure, rest = said.split(", with which there is a solution; ", 1)
    assert necessary in rest
    assert "is necessary" in rest
    number = cure.rpartition(" ")[2]
    Path("spec.yaml").write_text(text.replace(asked, instead.replace("%s", number)))
    assert run("solve", "spec.yaml").exit_code == 0
    assert run("verify", "spec.gains.json", "-q").exit_code == 0


LATERAL = """\
obsdesign: 1
name: tyres that saturate
system: {A: [[0, -25], [0, 0]], B: [[1, 0], [0, 0]], C: [[0, 1]], D: [[0, 0.01]]}
nonlinearities:
  - {f: 8000*atan(10*q), type: auto, Bf: [-6.7e-4, -4.8e-4], Cq: [0.04, 0.048]}
  - {f: 8500*atan(12*q), type: auto, Bf: [-6.7e-4, 5.6e-4], Cq: [0.04, -0.056]}
observer: {type: %s}
"""


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("observer", ["l2, alpha: 0.5", "linf, alpha: 0.5"])
def test_a_region_that_makes_auto_infeasible_is_named(observer):
    text = LATERAL % observer
    said = suggestion(text)
    assert re.match(r"(a smaller region is without|the type) .*: there is a solution with region: \{q: \[-", said)
    region = said.partition("region: {q: ")[2].partition("}")[0]
    narrower = text.replace("type: auto", f"type: auto, region: {{q: {region}}}")
    Path("narrower.yaml").write_text(narrower)
    assert run("solve", "narrower.yaml", "-q").exit_code == 0
    assert "region: {q" not in suggestion(text.replace("type: auto", "type: {slope: [0, .inf]}"))


MOTOR = """\
obsdesign: 1
name: flux of a motor
system:
  inputs: [om]
  dynamics:
    ia: -262*ia + 1800*fa + 90*om*fb
    ib: -262*ib + 1800*fb - 90*om*fa
    fa: -40*fa - 2*om*fb + 3.6*ia
    fb: -40*fb + 2*om*fa + 3.6*ib
  outputs: {y1: ia, y2: ib}
  domain: {om: [-20, 20], fa: [-1, 1], fb: [-1, 1]}
observer: {type: l2, alpha: 1}
"""


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("types", ["", "{om*fb: {lipschitz: 20}}"])
def test_what_f_itself_contradicts_is_not_advised_but_the_region_of_an_input_is(types):
    text = MOTOR.replace("  domain", f"  types: {types}\n  domain") if types else MOTOR
    said = suggestion(text)
    assert said.startswith("a smaller region is without the slope -20 of om*fb and the slope 20 of om*fa: there is")
    assert "would be feasible" not in said
    assert ("a tighter type" in said) == bool(types)
    narrower = said.partition("system.domain: {om: ")[2].partition("}")[0]
    Path("narrower.yaml").write_text(text.replace("om: [-20, 20]", f"om: {narrower}").replace(" 20}", " 10}"))
    assert run("solve", "narrower.yaml", "-q").exit_code == 0


@pytest.mark.usefixtures("here")
def test_terms_that_share_a_signal_are_said_to_be_taken_as_independent():
    suggestion(MOTOR)
    found = json.loads(Path("spec.gains.json").read_text())["diagnosis"]
    assert (
        "the class takes om*fb and om*fa as independent, though they share om, so that this member" in found["reason"]
    )
    assert run("verify", "spec.gains.json").exit_code == 0
    suggestion(FLAT)
    assert "independent" not in json.loads(Path("spec.gains.json").read_text())["diagnosis"]["reason"]


FLAT = """\
obsdesign: 1
system:
  dynamics: {x1: x2, x2: sin(x1) + 0.2*x2}
  outputs: {y: x2}
observer: {type: l2, alpha: 0.1}
"""


@pytest.mark.usefixtures("here")
def test_a_slope_that_is_too_flat_is_not_called_too_steep():
    said = suggestion(FLAT)
    assert said.startswith("a smaller region is without the slope 0 of sin(x1): there is a solution with")
    assert "steep" not in said
    domain = said.partition("system.domain: ")[2].partition("}")[0] + "}"
    Path("narrower.yaml").write_text(FLAT.replace("  outputs", f"  domain: {domain}\n  outputs"))
    assert run("solve", "narrower.yaml", "-q").exit_code == 0


GYRO = """\
obsdesign: 1
system:
  inputs: [delta]
  disturbances: [wind, noise]
  dynamics:
    vy: -20*r + 40*atan(delta - (vy + 1.2*r)/20) + 45*atan(-(vy - 1.5*r)/20) + wind
    r: 29*atan(delta - (vy + 1.2*r)/20) - 42*atan(-(vy - 1.5*r)/20)
  outputs: {gyro: r + 0.01*noise}
performance: [vy]
observer: {type: l2, alpha: 0.5, bounds: {L1: 100}}
"""


@pytest.mark.usefixtures("here")
def test_the_domain_that_is_suggested_is_one_of_signals_of_the_plant():
    domain = re.search(r"there is a solution with system.domain: (\{vy: \[.*?\], r: \[.*?\]\})", suggestion(GYRO))[1]
    Path("narrower.yaml").write_text(GYRO.replace("  outputs", f"  domain: {domain}\n  outputs"))
    assert run("solve", "narrower.yaml", "-q").exit_code == 0


DRAG = """\
obsdesign: 1
system:
  inputs: [F]
  disturbances: [d, n]
  dynamics: {p: s, s: F - 0.3*s*abs(s) + d}
  outputs: {y: p + n}
disturbance: [integrator, unknown]
observer: {type: l2, alpha: 0.3%s}
"""


@pytest.mark.usefixtures("here")
def test_larger_bounds_are_advised_only_where_they_help():
    said = suggestion(DRAG % ", bounds: {L1: 50}")
    assert said.startswith(
        "the type slope [0, .inf] of s*abs(s) is too wide: there is a solution with system.domain: {s: ["
    )
    assert "bounds" not in said  # none would do


@pytest.mark.usefixtures("here")
def test_a_slope_without_bound_is_decided_with_what_would_do():
    said = suggestion(DRAG % "")
    assert said.startswith("the type slope [0, .inf] of s*abs(s) is too wide: there is a solution with system.domain")


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("bounds", ["{L: 0.001}", "{gamma: 0.01}"])
def test_bounds_of_the_largest_interval_are_advised_as_they_were_tried(bounds):
    observer = "{type: sporadic, objective: max-T2, T1: 0.01, T2: {min: 0.05, max: 1}, decay: 0.8, bounds: %s, %s}"
    text = PLANT + f"observer: {observer % (bounds, 'relaxation: proposition-2')}\n"
    said = suggestion(text)
    if bounds == "{gamma: 0.01}":
        assert said == "without bounds there are solutions"
        return
    size = said.removeprefix("allow |L| up to ").partition(",")[0]
    Path("wider.yaml").write_text(text.replace("0.001", size))
    assert run("solve", "wider.yaml", "-q").exit_code == 0


STRIBECK = """\
obsdesign: 1
system:
  inputs: [u]
  disturbances: [load]
  dynamics:
    i: (u - 0.5*i - 0.02*w)/0.001
    w: (0.02*i - 0.0001*w - 0.002*tanh(w/0.1) - load)/0.0005
  outputs: {cur: i}
disturbance: integrator
performance: [w, load]
observer: {type: l2, alpha: 1%s}
"""


@pytest.mark.usefixtures("here")
def test_a_design_that_stays_undecided_without_a_bound_on_its_gain_is_told_one_that_does(monkeypatch):
    Path("spec.yaml").write_text(STRIBECK % "")
    assert run("solve", "spec.yaml", "-q").exit_code == 0
    monkeypatch.setattr("obsdesign.families.incremental.limits.least_proved", lambda *_: None)
    monkeypatch.setattr("obsdesign.elsewhere.states", lambda _: None)
    outcome = run("solve", "spec.yaml")
    assert (outcome.exit_code, "[OBS507]" in outcome.stderr) == (4, True)
    bounds = re.search(r"give `(bounds: \{L1: \S+\})`, with which there is a solution", outcome.stderr)[1]
    Path("spec.yaml").write_text(STRIBECK % f", {bounds}")
    assert run("solve", "spec.yaml", "-q").exit_code == 0
    monkeypatch.setattr("obsdesign.advice.certified", lambda *_: False)
    Path("spec.yaml").write_text(STRIBECK % "")
    assert "give `bounds" not in run("solve", "spec.yaml").stderr
