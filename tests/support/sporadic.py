"""The examples with sporadic measurements, their published gains, and storage functions for them."""

from dataclasses import replace

import numpy as np

from obsdesign.expressions import parse
from obsdesign.families.sporadic.guarantee import SporadicGuarantee
from obsdesign.reading import loads
from obsdesign.simulate import Sampling

HEAD = "obsdesign: 1\nname: test\nobserver: {type: l2, L2: 0, alpha: 0.1}\n"

OSCILLATOR = """
system: {A: [[0, 1], [-4, 0]], B: [[1], [0]], C: [[1, 0]]}
simulation: {horizon: 40, x0: [0, 0], w: ["where(t <= 5, -1, where(t <= 10, 1, where(t <= 15, -1, 0)))"]}
"""
LINK = """
system:
  A: [[0, 1, 0, 0], [-48.6, -1.25, 48.6, 0], [0, 0, 0, 1], [19.5, 0, -19.5, 0]]
  B: [[0], [2], [0], [0]]
  C: [[1, 0, 0, 0], [0, 1, 0, 0]]
nonlinearities: [{f: 3.33*sin(q), type: {lipschitz: 3.33}, Bf: [0, 0, 0, -1], Cq: [0, 0, 1, 0]}]
performance: {H: [[0, 0, 1, 0], [0, 0, 0, 1]]}
simulation: {horizon: 25, x0: 0, w: ["where(t <= 20, sin(2*t), 0)"]}
"""


def gains(L, H):
    """Gains of an observer."""
    return {"L": np.array(L, dtype=float), "H": np.array(H, dtype=float)}


DESIGN = gains([[2.067], [-3]], [[-1.384]])  # (51)
LINK_L = np.array([[9.328, 1], [-48.78, 22.11], [-0.0524, 3.199], [19.41, -0.9032]])
PREDICTOR = gains(LINK_L, -LINK_L[:2])

# V of (51) with gamma = 36, and of the predictor of the link; `test_the_storage_functions_..` checks the inequalities.
OSCILLATOR_V = SporadicGuarantee(
    gamma=36.0,
    decay=0.05,
    delta=2.995,
    T1=0.205,
    T2=0.41,
    P1=np.array([[10.1234, -13.8493], [-13.8493, 20.6754]]),
    P2=np.array([[49.1878]]),
)
LINK_V = SporadicGuarantee(
    gamma=1.53,
    decay=0.01,
    delta=17.0,
    T1=0.05,
    T2=0.1,
    P1=np.array(
        [
            [13.23074, 1.65369, -16.10618, 0.80617],
            [1.65369, 0.79756, -5.15077, 0.63918],
            [-16.10618, -5.15077, 40.44179, -5.27835],
            [0.80617, 0.63918, -5.27835, 1.84265],
        ]
    ),
    P2=np.array([[5.19346, -0.51361], [-0.51361, 0.22946]]),
)


def paper(T1, T2, **others):
    """The law (52)."""
    half, middle = (T2 - T1) / 2, (T2 + T1) / 2
    return Sampling(T1, T2, parse(f"{half!r}*sin(10*t) + {middle!r}", ["t"]), **others)


def read(text, **changes):
    spec = loads(HEAD + text)
    return replace(spec, simulation=replace(spec.simulation, **changes))


def free(**changes):
    """Oscillator without input, as in Figure 4."""
    return read(OSCILLATOR, w=None, **({"x0": np.ones(2), "xhat0": np.full(2, -2.0), "horizon": 10.0} | changes))
