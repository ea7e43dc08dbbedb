"""Units in which the inequalities of an observer are handed to a solver; proofs are in those of the spec."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from obsdesign.dissipation.inequality import Incremental
from obsdesign.lmi.equilibrate import scales
from obsdesign.lmi.formula import Array
from obsdesign.lmi.probe import matrices

Factors = dict[str, Any]  # powers of two, one or a list, by what they belong to


def scaling(family: Incremental) -> Factors:
    """How many of the units of the spec those of the solver are: of states, outputs, disturbances, and of time in s.

    They are read off the factors of P, of Y and of the rows of (13) where gamma is minimised. `family`: in doubles.
    """
    problem = family.least_gamma()
    found = scales(problem)
    unit, rows = matrices(problem.unknowns, found.s), found.rows
    states, (block, first) = rows[0][: family.plant.n], family.place_of_v
    told = {"states": states, "disturbances": rows[block][first:][: family.plant.B.shape[1]]}
    told |= {"outputs": mean(1 / (states[:, None] * unit["Y"]))} if "Y" in unit else {}
    return powers({**told, "time": mean(states**2 * np.diag(unit["P"]))})


def mean(sizes: Array) -> Array:
    """Geometric mean over the first axis."""
    return np.asarray(np.exp2(np.mean(np.log2(sizes), axis=0)))


def powers(told: Mapping[str, Array | float]) -> Factors:
    """Factors as a file holds them, to the nearest power of two; none where all are 1."""
    found = {name: np.exp2(np.floor(np.log2(factors) + 0.5)) for name, factors in told.items()}
    return {name: u.tolist() for name, u in found.items()} if any((u != 1).any() for u in found.values()) else {}
