"""Sizes of the states of a run in their units, from its data alone."""

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.simulate.definitions import rate
from obsdesign.simulate.system import System

BALANCINGS = 20  # sweeps over the states
LOOKS = 65  # instants at which it is seen what the inputs drive


def balanced(F: Array) -> Array:
    """Powers of two d with which the rows and columns of F d / d' are of like size (Osborne, 1960).

    What no row drives, an input, is scaled to the size of what others drive.
    """
    size, d, driven = np.abs(F), np.ones(len(F)), np.asarray(F.any(axis=1))
    np.fill_diagonal(size, 0)
    for _ in range(BALANCINGS):
        for i in range(len(F)):
            row, column = size[i].sum(), size[:, i].sum()
            if column and (row or not driven[i]):
                largest = size[:, driven].sum(axis=1).max(initial=0.0) or 1.0
                scale = 2.0 ** round(float(np.log2(row / column) / 2 if row else np.log2(largest / column)))
                d[i] *= scale
                size[i] /= scale
                size[:, i] *= scale
    return d


def sizes(system: System, start: Array) -> Array:
    """Sizes (end,) of the flowing states, those of a true state and of its error alike, whatever their units are.

    Their ratios balance the Jacobian at the start, s (ns,); the states at the start, and what the inputs would add to
    the state zero over the horizon, set their size.
    """
    program, flowing = system.program, system.flowing
    rates = [rate(name) for name in flowing]
    names = [name.removesuffix(" error") for name in flowing]
    place = [sorted(set(names)).index(name) for name in names]
    t = np.linspace(0.0, system.scenario.horizon, LOOKS)
    with np.errstate(all="ignore"):
        X = program.run(0.0, start[: system.width], system.quiet(0.0))
        slopes = np.nan_to_num(np.abs(program.derivatives(X, flowing)[program.places(rates)]), posinf=0.0)
        driven = np.nan_to_num(np.abs(system.table(t, np.zeros((LOOKS, system.width))).of(rates)), posinf=0.0)
    folded = np.zeros((len(names), len(names)))
    np.add.at(folded, np.ix_(place, place), slopes)
    ratios = balanced(folded)[place]
    reach = np.maximum(np.abs(start[: system.end]), t[-1] * driven.max(axis=0)) / ratios
    return np.asarray((reach.max(initial=0.0) or 1.0) * ratios)
