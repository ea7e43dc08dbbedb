"""How many random problems a test looks at, and which: the option `--sweep N[:SEED]`.

By default a sweep is as large as it must be to find what it is there to find, and looks at the same problems in every
run. `--sweep 20:7` makes it look at twenty times as many, drawn from the seed 7; `-m sweep` runs the sweeps alone.
"""

import hypothesis
import numpy as np
import pytest


class Sweep:
    """What the option says; conftest.py reads it before test files are imported."""

    factor = 1.0
    seed = None

    def read(self, text):
        """Take N or N:SEED; ValueError otherwise."""
        factor, colon, seed = text.partition(":")
        self.factor, self.seed = float(factor), int(seed) if colon else None
        if not 0 < self.factor < 1e6:
            raise ValueError(text)

    def size(self, count):
        """Size of a sweep of so many problems by default."""
        return max(1, round(count * self.factor))


SWEEP = Sweep()


def examples(count, **limits):
    """Mark a property test that looks at so many examples by default."""

    def decorate(test):
        if SWEEP.seed is not None:
            test = hypothesis.seed(SWEEP.seed)(test)
            limits["derandomize"] = False
        return pytest.mark.sweep(hypothesis.settings(max_examples=SWEEP.size(count), **limits)(test))

    return decorate


def seeds(count):
    """Mark a test that is run for so many seeds by default."""
    first = 0 if SWEEP.seed is None else 1000 * (SWEEP.seed + 1)
    numbers = range(first, first + SWEEP.size(count))
    return lambda test: pytest.mark.sweep(pytest.mark.parametrize("seed", numbers)(test))


def rng(seed):
    """Generator of a sweep that draws from this seed by default."""
    return np.random.default_rng(seed if SWEEP.seed is None else [SWEEP.seed, seed])
