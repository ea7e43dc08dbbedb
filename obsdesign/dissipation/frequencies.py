"""Frequencies at which responses of linear systems can be large, and the largest of what is made of them."""

from collections.abc import Callable

import numpy as np

from obsdesign.lmi.formula import Array

COUNT = 120
RESONANCE = np.linspace(-2, 2, 17)  # about the frequency of a pole, in units of its decay
FINER = 9  # frequencies about a largest gain, in as many rounds as
REFINEMENTS, OWN_REFINEMENTS = 4, 5
LEAST = np.finfo(float).tiny


def distinct(values: Array) -> Array:
    """Values in rising order, each once, as of `np.unique`; that imports masked arrays, a 40th of a short proof."""
    rising = np.sort(values, axis=None, kind="stable")  # quick where parts are in order, as they mostly are
    return np.asarray(rising[np.append(True, np.diff(rising) > 0)])


def around(poles: Array) -> Array:
    """Frequencies in rad/s around poles, and zero."""
    sizes = np.abs(poles[poles != 0]) if (poles != 0).any() else np.ones(1)
    grid = np.geomspace(sizes.min() / 100, sizes.max() * 100, COUNT)
    near = (np.abs(poles.imag) + RESONANCE[:, None] * np.abs(poles.real)).ravel()
    return distinct(np.concatenate([[0.0], grid, sizes, near[near > 0]]))


def angles(poles: Array) -> Array:
    """Frequencies from 0 to pi in rad a sample, around those of poles z = exp(s), and all over."""
    within = around(np.log(np.maximum(np.abs(poles), LEAST)) + 1j * np.angle(poles))
    return distinct(np.concatenate([np.linspace(0, np.pi, COUNT), within[within < np.pi]]))


def largest(sizes: Callable[[Array], Array], grid: Array) -> Array:
    """Largest of each column of sizes at frequencies, on a grid and on finer ones about what is the largest there."""
    values = sizes(grid)
    found = values.max(axis=0)
    for _ in range(REFINEMENTS):
        tops = distinct(values.argmax(axis=0))
        lows, highs = grid[np.maximum(tops - 1, 0)], grid[np.minimum(tops + 1, len(grid) - 1)]
        grid = distinct(np.linspace(lows, highs, FINER))
        values = sizes(grid)
        found = np.maximum(found, values.max(axis=0))
    return np.asarray(found)


def largest_apart(sizes: Callable[[Array], Array], own: Callable[[Array], Array], grid: Array) -> Array:
    """The same, where `own` tells the sizes of each column at frequencies of its own, (count, columns) both."""
    values = sizes(grid)
    found, each = values.max(axis=0), np.arange(values.shape[1])
    grid = np.broadcast_to(grid[:, None], values.shape)
    for _ in range(OWN_REFINEMENTS):
        tops = values.argmax(axis=0)
        lows, highs = grid[np.maximum(tops - 1, 0), each], grid[np.minimum(tops + 1, len(grid) - 1), each]
        grid = np.linspace(lows, highs, FINER)
        values = own(grid)
        found = np.maximum(found, values.max(axis=0))
    return np.asarray(found)
