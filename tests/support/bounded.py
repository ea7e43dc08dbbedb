"""Inputs that would cost minutes or never end if nothing bounded them."""

import time
from contextlib import contextmanager

SOON = 20.0  # seconds of processor time: ten times what the slowest of them costs on a machine that is busy


@contextmanager
def soon():
    """Hold that what stands within ends soon; how fast it is, is for the benchmarks to tell."""
    started = time.process_time()
    yield
    assert time.process_time() - started < SOON
