"""A drone with a barometer, as a newcomer writes it: what the commands say of it, and of slips in it."""

import json
from pathlib import Path

import numpy as np
import pytest
from support.commands import run

from obsdesign import work
from obsdesign.plot.run import heading

pytestmark = pytest.mark.usefixtures("here")

DRONE = """obsdesign: 1
name: Drone altitude
parameters: {m: 1.2, g: 9.81, cd: 0.15}
system:
  inputs: [thrust]
  disturbances: [wind, noise]
  units: {h: m, vz: m/s, thrust: N, wind: m/s^2, baro: m}
  dynamics:
    h: vz
    vz: thrust/m - g - cd/m*vz*abs(vz) + wind
  outputs: {baro: h + 0.3*noise}
  domain: {vz: [-6, 6]}
disturbance: [integrator, unknown]
performance: [h, vz, wind]
observer:
  type: l2
  alpha: 0.3
  bounds: {L1: 20}
simulation:
  horizon: 3
  x0: {h: 10, vz: 0}
  xhat0: {h: 10}
  u: {thrust: "m*g - 0.5*(h - 10) - 1.0*vz"}
  w: {wind: "0.8*sin(t/3)"}
  noise: {type: normal, amplitude: 0.3, period: 0.02}
  seed: 1
"""


def drone(old="", new=""):
    """Write the spec, a part of it replaced."""
    assert old in DRONE
    Path("drone.yaml").write_text(DRONE.replace(old, new) if old else DRONE)
    return "drone.yaml"


def test_a_constant_that_follows_from_a_proved_slope_is_proved():
    spec = drone()
    (block,) = json.loads(run("lipschitz", spec, "--json").stdout)["blocks"]
    assert (block["declared"], block["proved"]) == (12, True)
    assert "NOT" not in run("lipschitz", spec).stdout
    (block,) = json.loads(run("lipschitz", spec, "--json").stdout)["blocks"]
    assert block["upper"] <= block["declared"]


def test_a_change_that_makes_a_parameter_of_no_use_is_refused_with_the_nearest_name():
    outcome = run("solve", drone(), "--set", "parameters.mm=2")
    assert outcome.exit_code == 2
    assert "parameters.mm: unknown parameter mm; did you mean m? allowed: m, g, cd [OBS201]" in outcome.stderr
    assert run("check", drone(), "--set", "parameters.m=2").exit_code == 0
    twice = run("check", drone(), "--set", "parameters.mm=2", "--set", "parameters.m=mm")
    assert twice.exit_code == 2  # m stands first, and mm is not yet known there


def test_a_parameter_that_nothing_uses_is_told():
    outcome = run("check", drone("cd: 0.15}", "cd: 0.15, rho: 1.2}"))
    assert outcome.exit_code == 0
    assert (
        "parameters.rho has no effect: no number and no expression uses it; use it or leave it out [OBS615]"
        in outcome.stdout
    )
    assert "OBS615" not in run("check", drone()).stdout


def test_an_input_that_is_not_given_is_told_to_be_zero():
    spec = drone()
    assert "not given" not in run("solve", spec, "--simulate").stdout
    spec = drone('  u: {thrust: "m*g - 0.5*(h - 10) - 1.0*vz"}\n', "")
    assert "simulation.u.thrust is not given; 0 is used" in run("solve", spec, "--simulate").stdout


def test_the_samples_of_a_run_hold_what_replays_it():
    assert run("solve", drone(), "--simulate", "-q").exit_code == 0
    header, *rows = Path("drone.run.csv").read_text().splitlines()
    columns = dict(zip(header.split(","), np.loadtxt(rows, delimiter=",").T, strict=True))
    assert list(columns)[:7] == ["t", "h", "vz", "hat_h", "hat_vz", "wind", "noise"]
    np.testing.assert_allclose(
        columns["thrust"], 1.2 * 9.81 - 0.5 * (columns["h"] - 10) - columns["vz"], rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(
        columns["baro"], columns["h"] + 0.3 * columns["noise"] + columns["noise_baro"], atol=1e-9
    )
    assert 0.2 < columns["noise_baro"].std() < 0.4
    drone("  noise: {type: normal, amplitude: 0.3, period: 0.02}\n", "")
    assert run("solve", "drone.yaml", "--simulate", "-q").exit_code == 0
    assert "noise_baro" not in Path("drone.run.csv").read_text()


def test_the_title_of_a_run_with_noise_tells_whole_why_no_bound_is_held_against_it():
    spec = drone()
    assert run("solve", spec, "-q").exit_code == 0
    title = heading(work.read("drone.gains.json").simulate())
    assert title.endswith("; no bound: the guarantee does not cover simulation.noise")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("obsdesign: 1", "obsdesign:1", "1:1: a space parts a key from its value: write obsdesign: 1 ["),
        ("inputs: [", "inputs [", "5:3: a colon stands after a key: write inputs: [thrust] ["),
        ("alpha: 0.3", "alpha:0.3", "17:3: a space parts a key from its value: write alpha: 0.3 ["),
        ("horizon: 3", "horizon:3", "20:3: a space parts a key from its value: write horizon: 3 ["),
        ("h: vz\n", "h = vz\n", "9:5: a value stands after a colon, a derivative too: write h: vz ["),
        ("h: vz\n", "h' = vz\n", "9:5: a value stands after a colon, a derivative too: write h: vz ["),
        ("h: vz\n    vz:", "h = vz\n    vz =", "system.dynamics: expected a mapping, such as h: vz; found"),
        ("Drone altitude", "Drone: altitude", "2:1: a text that holds ': ' is quoted: write name: 'Drone: altitude' ["),
        ("  type: l2", "  - type: l2", "16:5: a key of a mapping has no - before it: write type: l2 ["),
        (
            "  type: l2\n  alpha: 0.3\n  bounds",
            "  - type: l2\n  - alpha: 0.3\n  - bounds",
            "reconstruct, each without a - before it; found a list",
        ),
        ("  u: {thrust", "  u: {thrust}}", "not valid YAML"),
    ],
)
def test_a_slip_in_yaml_is_told_in_its_own_line_with_what_to_write(old, new, said):
    drone(old, new)
    outcome = run("check", "drone.yaml")
    assert outcome.exit_code == 2
    assert said in outcome.stderr


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("unknown]", "white]", "white has no model: write unknown, w = v"),
        ("unknown]", "whte-noise]", "did you mean white-noise? It has no model: write unknown, w = v;"),
        ("vz*abs(vz)", "vz*math.fabs(vz)", "write abs(..)"),
        ("vz*abs(vz)", "vz*np.arctann(vz)", "write atan(..)"),
        ("performance: [h, vz, wind]", "performance: [h, gust]", "unknown state gust; allowed: h, vz, wind ["),
    ],
)
def test_what_is_suggested_is_allowed_there(old, new, said):
    outcome = run("check", drone(old, new))
    assert outcome.exit_code == 2
    assert said in outcome.stderr


@pytest.mark.parametrize("change", ["observer.bounds.L1=20,40", "observer.alpha=0.1,0.2"])
def test_several_values_of_a_key_are_for_a_batch(change):
    outcome = run("solve", drone(), "--set", change)
    assert outcome.exit_code == 2
    assert "expected one number; several values of a key are for `obsdesign batch --set`" in outcome.stderr
    assert "batch" not in run("solve", drone("alpha: 0.3", "alpha: '0,3'")).stderr
