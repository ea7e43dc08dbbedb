"""Speed of many runs: `pytest tests/benchmarks --benchmark-only`."""

from support.shipped import solved
from support.speed import processor_time, slowness

RUNS = 250
STARTS = {"x0_width": [1, 1, 1]}


def test_runs_of_the_magnetic_bearing_go_together_many_times_as_fast_as_one_by_one(benchmark):
    _, design = solved("corless2019-magnetic-bearing")
    alone = min(processor_time(lambda seed=seed: design.simulate(seed=seed, **STARTS))[0] for seed in range(4))
    times = []

    def run():
        seconds, found = processor_time(lambda: design.montecarlo(RUNS, **STARTS))
        times.append(seconds)
        return found

    found = benchmark.pedantic(run, rounds=2)
    assert len(found.members) == RUNS
    assert all(bound["holds"] for bound in found.report["bounds"])
    assert min(times) < alone * RUNS / 5  # in one run of the benchmark: what one by one would take
    assert min(times) < 15 * slowness()  # so that 1000 take less than 30 s on two cores
