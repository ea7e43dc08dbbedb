"""Processor times, so that another process on the machine does not count."""

import subprocess
import sys
import time
from functools import cache
from statistics import median


def processor_time(run):
    """Seconds that a call takes, and what it returns."""
    start = time.process_time()
    result = run()
    return time.process_time() - start, result


def child_time(*command):
    """Seconds that a whole process takes with its start-up, the median of five."""
    code = "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL); "
    code += "r = resource.getrusage(resource.RUSAGE_CHILDREN); print(r.ru_utime + r.ru_stime)"
    runs = [subprocess.run([sys.executable, "-c", code, *command], capture_output=True, check=True) for _ in range(5)]
    return median(float(run.stdout) for run in runs)


@cache
def slowness():
    """How much slower this machine is at starting numpy than the one the bounds were set on (0.1 s), at least 1."""
    return max(1.0, child_time(sys.executable, "-c", "import numpy") / 0.1)
