"""Speed of runs of many seeds: `pytest tests/benchmarks --benchmark-only`."""

import pytest
from flint import fmpq
from support.cuk import CUK, stiff
from support.speed import processor_time, slowness

from obsdesign.reading import loads
from obsdesign.simulate.ensemble import spread


@pytest.mark.parametrize("gamma", [fmpq(1, 10**6), fmpq(1, 1000)])
def test_twelve_thousand_noise_samples_of_ten_seeds_take_a_few_seconds_however_stiff(benchmark, gamma):
    spec, times = loads(CUK.replace("horizon: 0.06", "horizon: 1.2")), []

    def run():
        seconds, found = processor_time(lambda: spread(spec, stiff(gamma), tuple(range(10)), (0.2, 1.2)))
        times.append(seconds)
        return found

    assert benchmark.pedantic(run, rounds=2).rms.shape == (10, 4)
    assert min(times) < 8 * slowness()
