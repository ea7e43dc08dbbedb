"""Speed of the simulation of sporadic observers: `pytest tests/benchmarks --benchmark-only`.

Times are processor times, so that another process on the machine does not count.
"""

import time

import numpy as np
import pytest

from obsdesign.expressions import parse
from obsdesign.simulate.hybrid import Sampling, simulate_sporadic
from obsdesign.spec import loads

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
LINK_L = np.array([[9.328, 1], [-48.78, 22.11], [-0.0524, 3.199], [19.41, -0.9032]])
CASES = {  # spec, L, H, T2, measurements, seconds
    "linear": (OSCILLATOR, np.array([[2.067], [-3]]), np.array([[-1.384]]), 0.41, 127, 0.05),
    "nonlinear": (LINK, LINK_L, -LINK_L[:2], 0.1, 351, 1.5),
}


@pytest.mark.parametrize("case", CASES)
def test_a_run_with_irregular_measurements_is_quick(benchmark, case):
    text, L, H, T2, count, limit = CASES[case]
    spec = loads(HEAD + text)
    sampling = Sampling(T2 / 2, T2, parse(f"{T2 / 4!r}*sin(10*t) + {3 * T2 / 4!r}", ["t"]))
    times = []

    def run():
        start = time.process_time()
        found = simulate_sporadic(spec, {"L": L, "H": H}, sampling, None)
        times.append(time.process_time() - start)
        return found

    assert benchmark.pedantic(run, rounds=5, warmup_rounds=1).summary["sampling"]["received"] == count
    assert min(times) < limit
