"""Limits of ill-conditioned plants, held against Riccati equations in several hundred digits."""

import numpy as np
import pytest
from support.digits import Plant
from support.rods import family

from obsdesign.dissipation.elimination import least_gamma
from obsdesign.dissipation.engine import Engine

ALPHA = 0.01


def in_units(rng, n, ny):
    """States in units between 1e-5 and 1e5, outputs with noise from 1e-8 on."""
    T, noise = np.diag(10 ** rng.uniform(-5, 5, n)), 10 ** rng.uniform(-8, -1, ny)
    return rng.normal(size=(n, n)), T, noise


def stiff(rng, n, ny):
    """Rates between 1e-3 and 1e5 1/s."""
    A = np.diag(-(10 ** rng.uniform(-3, 5, n))) + np.diag(rng.normal(size=n - 1), 1)
    return A, np.eye(n), 10 ** rng.uniform(-8, -1, ny)


def quiet(rng, n, ny):
    """Outputs with noise of 1e-6 to 1e-3."""
    return 10 * rng.normal(size=(n, n)), np.eye(n), 10 ** rng.uniform(-6, -3, ny)


def plants(kind, seeds):
    """Matrices A, B, C, D, H of random plants of a kind."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        n, nw, ny = (int(rng.integers(*ends)) for ends in ((3, 9), (1, 4), (1, 3)))
        B, C = rng.normal(size=(n, nw)), rng.normal(size=(ny, n))
        A, T, noise = kind(rng, n, ny)
        back = np.linalg.inv(T)
        D = np.hstack([np.zeros((ny, nw)), np.diag(noise)])
        yield T @ A @ back, np.hstack([T @ B, np.zeros((n, ny))]), C @ back, D, back


@pytest.mark.parametrize("name", ["l2", "linf"])
@pytest.mark.parametrize(("kind", "least_told"), [(in_units, 6), (stiff, 3), (quiet, 5)])
def test_a_limit_that_is_told_is_right_and_most_are_told(kind, least_told, name):
    told = 0
    for A, B, C, D, H in plants(kind, range(6)):
        found = least_gamma(Engine(), family(name, A, B, C, D, ALPHA, H))
        if found is None:
            continue
        told += 1
        gamma, reference = found.objective**0.5, Plant(A, B, C, D, H)
        if name == "linf":
            assert gamma == pytest.approx(reference.peak(ALPHA), rel=1e-4)
        else:
            assert reference.reaches(gamma * (1 + 1e-4), ALPHA)
            assert not reference.reaches(gamma * (1 - 1e-4), ALPHA)
    assert told >= least_told
