"""Speed of the simulation of sporadic observers: `pytest tests/benchmarks --benchmark-only`.

Times are processor times, so that another process on the machine does not count.
"""

import time

import pytest
from support.running import simulate_sporadic
from support.speed import slowness
from support.sporadic import DESIGN, HEAD, LINK, OSCILLATOR, PREDICTOR

from obsdesign.expressions import parse
from obsdesign.reading import loads
from obsdesign.simulate import Sampling

CASES = {  # spec, gains, T2, measurements, seconds
    "linear": (OSCILLATOR, DESIGN, 0.41, 127, 0.05),
    "nonlinear": (LINK, PREDICTOR, 0.1, 351, 1.5),
}


@pytest.mark.parametrize("case", CASES)
def test_a_run_with_irregular_measurements_is_quick(benchmark, case):
    text, gains, T2, count, limit = CASES[case]
    spec = loads(HEAD + text)
    sampling = Sampling(T2 / 2, T2, parse(f"{T2 / 4!r}*sin(10*t) + {3 * T2 / 4!r}", ["t"]))
    times = []

    def run():
        start = time.process_time()
        found = simulate_sporadic(spec, gains, sampling, None)
        times.append(time.process_time() - start)
        return found

    assert benchmark.pedantic(run, rounds=5, warmup_rounds=1).summary["sampling"]["received"] == count
    assert min(times) < limit * slowness()
