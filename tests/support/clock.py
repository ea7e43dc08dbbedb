"""The examples with sporadic measurements and given gains, as clock-dependent certificates analyse them."""

from functools import cache
from typing import NamedTuple

import numpy as np

from obsdesign.dissipation.engine import Engine
from obsdesign.families.sporadic.clock.analysis import Analysis
from obsdesign.families.sporadic.clock.bernstein import SHAPE, Shape
from obsdesign.families.sporadic.clock.theorem import error_system
from obsdesign.lmi.formula import rational
from obsdesign.reading import loads

HEAD = "obsdesign: 1\nobserver: {type: sporadic, T1: 0.1, T2: 0.2}\n"
MOTOR = "system: {A: [[0, 1], [0, -3]], B: [0, 1], C: [1, 0]}\n"
OSCILLATOR = "system: {A: [[0, 1], [-4, 0]], B: [1, 0], C: [1, 0]}\n"
ROBOT = """
system: {A: [[0, 1, 0], [0, -0.01, 0], [1, 0, 0]], B: [0, 1, 0], C: [[1, 0, 0], [0, 0, 1]]}
performance: {H: [0, 1, 0]}
"""
ARM = """
system:
  A: [[0, 1, 0, 0], [-48.6, -1.25, 48.6, 0], [0, 0, 0, 1], [19.5, 0, -19.5, 0]]
  B: [0, 2, 0, 0]
  C: [[1, 0, 0, 0], [0, 1, 0, 0]]
nonlinearities: [{f: 3.33*sin(q), type: {lipschitz: 3.33}, Bf: [0, 0, 0, -1], Cq: [0, 0, 1, 0]}]
performance: {H: [[0, 0, 1, 0], [0, 0, 0, 1]]}
"""
PREDICTOR = [[9.328, 1], [-48.78, 22.11], [-0.0524, 3.199], [19.41, -0.9032]]


class Example(NamedTuple):
    """A plant, gains, and the intervals and the rate of the paper, as a spec has them."""

    system: str
    gains: dict[str, list]
    T1: str
    T2: str
    decay: str


EXAMPLES = {
    "motor": Example(MOTOR, {"L": [[0], [3]], "H": [[0]]}, "0", "1.115", "0.24"),
    "oscillator": Example(OSCILLATOR, {"L": [[2.067], [-3]], "H": [[-1.384]]}, "0.205", "0.41", "0.05"),
    "oscillator, rival": Example(OSCILLATOR, {"L": [[0.3648], [-0.4655]], "H": [[-0.3648]]}, "0.205", "0.41", "0.001"),
    "robot": Example(
        ROBOT, {"L": [[3.7, -2.194], [2.908, -2.075], [1.637, 0.155]], "H": [[0, 0]] * 2}, "0.1714", "0.3", "0.2"
    ),
    "robot, rival": Example(
        ROBOT, {"L": [[0.8079, 0.2555], [0.2071, 0.055], [0.7609, 0.7714]], "H": [[0, 0]] * 2}, "0.1714", "0.3", "0.2"
    ),
    "arm": Example(
        ARM,
        {
            "L": [[11.5042, 0.788213], [-2.59655, 14.3202], [4.72995, 1.89367], [8.29872, 2.046]],
            "H": [[-9.7899, -0.0342746], [-47.0298, -7.46493]],
        },
        *("0.05", "0.1", "0.01"),
    ),
    "arm, predictor": Example(ARM, {"L": PREDICTOR, "H": [[-9.328, -1], [48.78, -22.11]]}, "0.05", "0.10902", "0.01"),
}


def exact(number):
    """A number of a spec in rationals."""
    return rational([[number]]).item()


@cache
def spec_of(system):
    """Spec of a plant."""
    return loads(HEAD + system)


@cache
def analysis(name, T1=None, degree=4, segments=2, lookahead=1):
    """Error of an example for intervals from T1 on."""
    case = EXAMPLES[name]
    return analysis_of(case.system, case.gains, case.T1 if T1 is None else T1, Shape(degree, segments, lookahead))


def analysis_of(system, gains, T1, shape=SHAPE):
    """Error of a plant, as a spec has it, with gains."""
    spec = spec_of(system)
    error = error_system(spec.augmented, spec.H, {key: rational(np.array(x)) for key, x in gains.items()})
    return Analysis(Engine(), error, spec.multiplier, exact(T1), shape)


@cache
def gamma(name, degree=4, segments=2, T1=None, T2=None, lookahead=1):
    """Least gamma of an example."""
    case = EXAMPLES[name]
    made = analysis(name, T1, degree, segments, lookahead)
    return made.gamma(exact(case.T2 if T2 is None else T2), exact(case.decay))
