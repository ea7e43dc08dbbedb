"""A drone with a barometer, as a newcomer writes it: what the commands say of it, and of slips in it."""

import json
from pathlib import Path

from support.commands import run

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
