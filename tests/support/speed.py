"""Processor times, so that another process on the machine does not count."""

import subprocess
import sys
import time
from statistics import median


def processor_time(run):
    """Seconds that a call takes, and what it returns."""
    start = time.process_time()
    result = run()
    return time.process_time() - start, result


def compared(ours, theirs, pairs=5):
    """Least seconds of one call and of another, in turn, so that what else the machine does meets both alike."""
    times = [(processor_time(ours)[0], processor_time(theirs)[0]) for _ in range(pairs)]
    return min(first for first, _ in times), min(second for _, second in times)


def child_time(*command):
    """Seconds that a whole process takes with its start-up, the median of five."""
    code = "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL); "
    code += "r = resource.getrusage(resource.RUSAGE_CHILDREN); print(r.ru_utime + r.ru_stime)"
    runs = [subprocess.run([sys.executable, "-c", code, *command], capture_output=True, check=True) for _ in range(5)]
    return median(float(run.stdout) for run in runs)


def slowness():
    """How much slower this machine is now at starting numpy than the one bounds were set on (0.1 s), at least 1.

    Measured anew each time: a shared machine is not equally fast for long.
    """
    return max(1.0, child_time(sys.executable, "-c", "import numpy") / 0.1)
