"""Plants, observers and files for runs along recorded signals."""

from pathlib import Path

from obsdesign.work import trial

HEAD = "obsdesign: 1\nname: case\n"
ARM = """system: {states: [angle, rate], inputs: [u], disturbances: [push], domain: {angle: [-9, 9], rate: [-9, 9]},
         dynamics: {angle: rate, rate: -sin(angle) - 0.5*rate + u + push}, outputs: {y: angle}}
"""
CART = "system: {states: [angle, rate], inputs: [u], A: [[0, 1], [-1, -1]], B: [[0], [1]], C: [1, 0], gx: [0, u]}\n"
SINE = "nonlinearities: [{type: sin, Bf: [0, -1], Cq: [1, 0]}]\n"
SAMPLES = """system: {time: discrete, period: 0.1, states: [x], inputs: [u], A: [[0.9]], B: [[0.1, 0]], C: [[1]],
         D: [[0, 0.05]], gx: [0.1*u], gy: [0.2*u]}
"""
L2 = "observer: {type: l2, gains: {L1: [-4, -3], L2: [0]}, alpha: 0.05}\n"
CASES = {  # plant, observer and what else is in its simulation
    "continuous": (CART + SINE, L2, "w: [0.2*cos(t)]"),
    "linear": (CART, "observer: {type: l2, gains: {L1: [-4, -3]}, alpha: 0.1}\n", "w: [0.3]"),
    "stiff": (CART + SINE, "observer: {type: l2, gains: {L1: [-2000, -1000000], L2: [0]}, alpha: 0.05}\n", ""),
    "noise": (CART + SINE, L2, "noise: {type: uniform, amplitude: 0.02, period: 0.03}"),
    "much noise": (CART + SINE, L2, "noise: {type: uniform, amplitude: 0.02, period: 0.01}"),
    "equations": (ARM, "observer: {type: ekf, Q: {push: 0.1}, R: 1.0e-2}\n", "w: [0.2*sin(t)]"),
    "steps": (CART + SINE, L2 + "implementation: {period: 0.01, method: rk4}\n", "observer: implementation"),
    "switches": (CART + SINE, L2, 'w: ["where(angle > 0.2, 0.1, 0)"]'),
    "instants": (
        CART + SINE,
        "observer: {type: sporadic, T1: 0.05, T2: 0.2, injection: dynamic, gains: {L: [-2, -1], H: [[-8]]}}\n",
        "sampling: random, noise: {amplitude: 0.01}",
    ),
    "samples": (SAMPLES, "observer: {type: linf, rho: 0.8, objective: min-gamma}\n", "w: [cos(t), 0]"),
    "filter in samples": (
        "system: {time: discrete, period: 0.1, states: [x], inputs: [u], disturbances: [w1], "
        "dynamics: {x: 0.9*x + 0.1*sin(x) + 0.1*u + w1}, outputs: {y: x + 0.2*u}}\n",
        "observer: {type: ekf, Q: {w1: 0.1}, R: 1.0e-2}\n",
        "w: [0.1*cos(t)]",
    ),
    "filtered": (
        SAMPLES,
        "observer: {type: linf, rho: 0.8, objective: min-gamma, estimate: filtered}\n",
        "w: [cos(t), 0]",
    ),
}
DISCRETE = {"samples", "filtered", "filter in samples"}


def rows(path, t, *columns, head="t,u", sep=","):
    """Write a file of columns."""
    lines = [sep.join(map(repr, map(float, row))) for row in zip(t, *columns, strict=True)]
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text("\n".join([head.replace(",", sep), *lines]) + "\n")


def simulated(case, u, horizon=2, points=41):
    """Run of a case along an input, as it is written in a spec."""
    plant, observer, further = CASES[case]
    x0 = "x0: [1]" if case in DISCRETE else "x0: [0.7, 0]"
    text = f"{HEAD}{plant}{observer}simulation: {{horizon: {horizon}, points: {points}, {x0}, u: {u}, {further}}}\n"
    Path("case.yaml").write_text(text)
    return trial("case.yaml").simulate()
