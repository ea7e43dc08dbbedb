"""Estimates on a log cost little beside reading and writing its numbers, and no memory that grows with it."""

import io
import subprocess
import sys
import time

import numpy as np
import pytest
from support.shipped import SPECS

import obsdesign as od

ROWS = 300_000
OVER = 1.6  # times what reading and formatting the same columns cost; measured 1.15 to 1.3
MEMORY = 300 * 1024  # kB


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Gains, and a log of a 3-state observer with implementation at the period of its rows."""
    folder = tmp_path_factory.mktemp("log")
    od.solve(od.load(SPECS / "pendulum-embedded.yaml")).save(folder / "pendulum.gains.json")
    rng, t = np.random.default_rng(0), np.arange(ROWS) * 1e-3
    y = np.column_stack([np.sin(t), np.cos(t)]) + 1e-3 * rng.normal(size=(ROWS, 2))
    table = np.column_stack([t, y])
    text = "t,y_angle,y_speed\n" + ("%.3f,%.9g,%.9g\n" * ROWS) % tuple(table.ravel().tolist())
    (folder / "log.csv").write_text(text)
    return folder


def test_a_row_costs_little_more_than_its_numbers(benchmark, log):
    def measured():
        began = time.process_time()
        rows = np.loadtxt(io.BytesIO((log / "log.csv").read_bytes().partition(b"\n")[2]), delimiter=",", comments=None)
        made = np.column_stack([rows, rows, rows[:, :1]])  # as many columns as are written
        ("%.12g,%.12g,%.12g,%.12g,%.12g,%.12g,%.12g\n" * ROWS) % tuple(made.ravel().tolist())
        numbers = time.process_time() - began
        began = time.process_time()
        od.estimate(log / "pendulum.gains.json", log / "log.csv", log / "out.csv")
        return (time.process_time() - began) / numbers

    ratio = benchmark.pedantic(measured, rounds=1)
    assert min(ratio, measured()) < OVER


def test_memory_does_not_grow_with_the_log(benchmark, log):
    code = (
        "import re, sys, obsdesign as od;"
        "od.estimate(sys.argv[1], sys.argv[2], sys.argv[3]);"
        "print(re.search(r'VmHWM:\\s+(\\d+)', open('/proc/self/status').read())[1])"  # not what its parent used
    )
    command = [sys.executable, "-c", code, log / "pendulum.gains.json", log / "log.csv", log / "out.csv"]
    used = benchmark.pedantic(lambda: int(subprocess.check_output(command)), rounds=1)
    assert used < MEMORY
