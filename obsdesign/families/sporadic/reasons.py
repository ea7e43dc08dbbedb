"""Why there is no observer for sporadic measurements, in the terms of the model, and what would be possible."""

import math

import numpy as np

from obsdesign.families.outcome import Diagnosis
from obsdesign.families.reach import too_tight
from obsdesign.lmi.formula import Array, Exact, in_floats
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.pencil import text
from obsdesign.model.plant import Plant
from obsdesign.model.structure import linear
from obsdesign.tables.text import at_least, at_most

HIDDEN = 1e-9  # smallest singular value, of unit eigenvectors seen through a unit C, that counts as zero


def hiding_interval(plant: Plant[Exact], multiplier: Multiplier, decay: float, T2: float) -> Diagnosis:
    """Answer that measurements at a constant interval of at most T2 cannot tell two modes apart; empty if none does.

    Modes with eigenvalues that differ by 2 pi i k / T grow alike from one measurement to the next. If a combination of
    them is not seen, C v = 0, no observer whatsoever makes it decay; and (28) speaks of every interval in (0, T2].
    """
    system = linear(plant.doubles, in_floats(multiplier.member))
    values, vectors = np.linalg.eig(system.A)
    fastest = np.abs(values).max(initial=decay)
    slow = values.real >= -decay - 1e-12 * fastest
    intervals = sorted(
        2 * math.pi / float(abs(a.imag - b.imag))
        for i, a in enumerate(values)
        for b in values[:i]
        if abs(a.real - b.real) <= HIDDEN * fastest < abs(a.imag - b.imag)
    )
    for T in (T for T in intervals if T <= T2):
        for i in np.flatnonzero(slow):
            turns = (values - values[i]) * T / (2j * math.pi)
            alike = np.abs(turns - np.round(turns.real)) <= HIDDEN * max(1.0, float(np.abs(turns).max(initial=0.0)))
            if unseen(system.C, vectors[:, alike]):
                return hides(values[alike], T)
    return {}


def unseen(C: Array, V: Array) -> bool:
    """Whether a combination of the columns of V is mapped to zero."""
    seen = C @ V / (np.linalg.norm(C, 2) or 1.0)
    return bool(np.linalg.matrix_rank(seen, tol=HIDDEN) < V.shape[1])


def hides(values: Array, T: float) -> Diagnosis:
    """Answer that an interval hides the difference of modes."""
    found = " and ".join(text(complex(value)) for value in values)
    return {
        "condition": "sampling",
        "reason": f"measurements every T = {T:.6g} are pathological: they cannot tell the modes at {found} apart",
        "interval": T,
        "feasible": {"T2_below": T},
        "suggestion": f"ask for T2 well below {T:.6g}, or measure another state",
    }


def too_long(T2: float, decay: float, largest: float | None, fastest: float | None, form: str) -> Diagnosis:
    """Answer that the inequalities have no solution, with the largest T2 and decay that do."""
    reason = f"{form} has no solution for T2 = {T2:g} with decay {decay:g}, whatever the gain from w"
    feasible = {name: value for name, value in (("T2", largest), ("decay", fastest)) if value is not None}
    hints = [f"ask for {name} at most {at_least(value * (1 - 1e-3), 4)}" for name, value in feasible.items()]
    hints.append("try another range of delta, or another relaxation or injection")
    return {
        "condition": "inequality",
        "reason": reason + (f"; the largest T2 is {largest:.5g}" if largest is not None else ""),
        "feasible": feasible,
        "suggestion": ", or ".join(hints),
    }


def out_of_reach(asked: float, least: float) -> Diagnosis:
    """Answer that gamma is bounded below what is possible."""
    return {
        "condition": "gamma",
        "reason": f"gamma at most {asked:g} was asked for, and the least possible is {least:.6g}",
        "gamma": {"asked": asked, "least": least},
        "feasible": {"gamma": least},
        "suggestion": f"allow gamma above {at_most(least)}",
    }


def too_small(kappa: float, T2: float, decay: float, size: float | None) -> Diagnosis:
    """Answer that no gain within the bound was found; `size`: a bound that does."""
    enough = {"L": (size, "allow |L| up to")} if size else {}
    where = f"for T2 = {T2:g} with decay {decay:g}"
    return too_tight([f"|L| <= {kappa:g}"], where, enough)


def out_of_bounds(name: str) -> Diagnosis:
    """Answer that no value of a range is within the bounds."""
    return {
        "condition": "bounds",
        "reason": f"no {name} of the range was reached",
        "feasible": {},
        "suggestion": "allow larger bounds",
    }


def useless(T2: float, decay: float, tolerated: float | None) -> Diagnosis:
    """Answer that given gains achieve nothing."""
    shorter = f"ask for T2 at most {at_least(tolerated * (1 - 1e-3), 4)}" if tolerated else "ask for a smaller decay"
    return {
        "condition": "gains",
        "reason": f"no storage function of Theorem 2 proves these gains for T2 = {T2:g} with decay {decay:g}",
        "feasible": {"T2": tolerated} if tolerated else {},
        "suggestion": f"{shorter}, or design new gains: leave `gains` out",
    }
