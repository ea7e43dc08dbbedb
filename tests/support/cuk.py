"""A Cuk converter with noise, and a stiff observer of it."""

from flint import fmpq

from obsdesign.expressions import parse
from obsdesign.families.observer import Observer

CUK = """
obsdesign: 1
parameters: {E: 12, L1: 0.01, L3: 0.01, C2: 22.0e-6, C4: 22.9e-6, G: 0.0447}
system:
  states: [i1, v4, v2, i3]
  inputs: [u]
  dynamics: {i1: (E-(1-u)*v2)/L1, v4: (i3-G*v4)/C4, v2: ((1-u)*i1+u*i3)/C2, i3: -(u*v2+v4)/L3}
  outputs: {y1: v2, y2: i3}
  domain: {i1: [-3, 3], v4: [-30, 0], v2: [5, 50], i3: [-2, 2], u: [0.1, 0.9]}
observer: {type: l2, alpha: 10}
simulation:
  horizon: 0.06
  x0: [1, -6, 20, -0.3]
  u: 0.5 + 0.1*sin(30*t)
  noise: {type: uniform, amplitude: [0.02, 2.0e-4], period: 1.0e-4}
"""


def stiff(gamma):
    """The [KKL+PEB] observer of the converter, whose estimator has the rate gamma psi^2."""
    values = {"E": 12, "L1": fmpq(1, 100), "C2": fmpq(22, 10**6), "C4": fmpq(229, 10**7), "G": fmpq(447, 10**4)}
    values |= {"alpha": fmpq(1, 2), "gamma": gamma}
    names = ("t", "u", "y1", "y2", "xi1", "xi2", "z", "f", "psi", "theta")
    dynamics = {
        "xi1": "(E-(1-u)*y1)/L1",
        "xi2": "-(G/C4)*xi2+y2/C4",
        "z": "alpha*(y1-z)",
        "f": "alpha*(((1-u)*xi1+u*y2)/C2-f)",
        "psi": "alpha*((1-u)/C2-psi)",
        "theta": "gamma*psi*(alpha*(y1-z)-f-psi*theta)",
    }
    sides = {name: parse(text, names, values) for name, text in dynamics.items()}
    estimates = {"i1": "xi1+theta", "v4": "xi2", "v2": "y1", "i3": "y2"}
    estimates = {name: parse(text, names) for name, text in estimates.items()}
    return Observer(sides, estimates, ("u",), ("y1", "y2"), initial={"z": parse("y1", names)})
