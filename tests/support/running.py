"""Runs of given gains against a guarantee that a test makes up, which no design would carry."""

from obsdesign.families import FAMILIES
from obsdesign.families.sporadic.observer import holding
from obsdesign.simulate import run


def simulate(spec, gains, guarantee, progress=None):
    observer = FAMILIES[spec.observer.type].observer(spec, gains)
    return run(spec, observer, guarantee, progress=progress)


def simulate_sporadic(spec, gains, sampling, guarantee):
    """The family of the spec plays no part."""
    return run(spec, holding(spec, gains), guarantee, sampling)
