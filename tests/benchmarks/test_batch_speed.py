"""What a batch costs beside solving and verifying, for each spec, in processor time of all its processes.

It runs with `pytest tests/benchmarks --benchmark-only`, and the numbers are in --benchmark-json.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

from support.speed import slowness

SPECS, JOBS = 60, 1
OVERHEAD = 0.020  # s
ROOT = Path(__file__).parents[2]
SPEC = """
obsdesign: 1
system: {{A: [[-{rate}]], B: [[1]], C: [[1]]}}
observer: {{type: l2, alpha: 0.1, bounds: {{L1: 5}}}}
"""
ALONE = """
import sys, time
from pathlib import Path
from obsdesign.disk import write_whole
from obsdesign.work import load, solve

def design(path):
    made = solve(load(path))
    assert made.verify().holds
    write_whole(path + ".gains.json", made.text())

first, *others = sys.argv[1:]
design(first)  # what is imported once
started = time.process_time()
for path in others:
    design(path)
print(time.process_time() - started)
"""


def spent(*command):
    """Processor time (s) of a process and of all that it started."""
    before = os.times()
    subprocess.run([sys.executable, *map(str, command)], check=True, capture_output=True, env=environment())
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def environment():
    """One thread of linear algebra, and this tree."""
    return os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}


def test_a_batch_costs_little_beside_the_designs(benchmark, tmp_path):
    paths = []
    for i in range(SPECS + 1):
        path = tmp_path / f"{i:04}.yaml"
        path.write_text(SPEC.format(rate=1 + i / 1000))
        paths.append(path)
    batch = ["-m", "obsdesign", "batch", "-q", "--jobs", JOBS]

    def measured():
        start = spent(*batch, paths[0], "--out", tmp_path / "one")
        whole = spent(*batch, *paths, "--out", tmp_path / "all")
        alone = subprocess.run(
            [sys.executable, "-c", ALONE, *paths], check=True, capture_output=True, text=True, env=environment()
        )
        return (whole - start) / SPECS, float(alone.stdout) / SPECS

    in_batch, alone = benchmark.pedantic(measured, rounds=1)
    benchmark.extra_info.update({"in a batch [ms]": round(1e3 * in_batch, 2), "alone [ms]": round(1e3 * alone, 2)})
    assert json.loads((tmp_path / "all" / "summary.json").read_text())["counts"]["certified"] == SPECS + 1
    assert in_batch - alone < OVERHEAD * slowness()
