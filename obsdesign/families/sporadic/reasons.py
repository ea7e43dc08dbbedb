"""Why there is no observer for sporadic measurements, in the terms of the model, and what would be possible."""

import math
from collections.abc import Mapping, Sequence
from itertools import islice, product

import numpy as np

from obsdesign.dissipation.decimals import round_up
from obsdesign.families.frozen import members
from obsdesign.families.outcome import Diagnosis
from obsdesign.families.reach import too_tight
from obsdesign.lmi.formula import Array, Exact, block_diagonal, in_floats
from obsdesign.model.frozen import MOST
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.pencil import System, text
from obsdesign.model.plant import Plant
from obsdesign.model.structure import linear
from obsdesign.tables.text import at_least, at_most

CLOSE = 1e-3  # relative, from a limit to what is suggested
HIDDEN = 1e-9  # smallest singular value, of unit eigenvectors seen through a unit C, that counts as zero


def missed(goal: float) -> str:
    """Say that what is shipped has a larger gamma than the slack allows."""
    return f"no gain was found to reach gamma = {goal:g}, all that the slack allows; this is the nearest found"


def hiding_interval(plant: Plant[Exact], multiplier: Multiplier, decay: float, T2: float) -> Diagnosis:
    """Answer of the shortest interval that hides modes of the plant with f = K q, for K inside and at the vertices."""
    choices = [(b.member, *(K for K in b.vertices if b.contains(K))) for b in multiplier.blocks]
    found = []
    for chosen in islice(product(*choices), MOST):
        K = block_diagonal([in_floats(K) for K in chosen]) if chosen else in_floats(multiplier.member)
        found.append((hiding(linear(plant.doubles, K), decay, T2), chosen))
    said, chosen = min(found, key=lambda pair: pair[0].get("interval", math.inf))
    if said and (member := members(chosen)):
        said["reason"] = f"at {member}, which the types allow, {said['reason']}"
    return said


def hiding(system: System, decay: float, T2: float) -> Diagnosis:
    """Answer that measurements at a constant interval of at most T2 cannot tell two modes apart; empty if none does.

    Modes with eigenvalues that differ by 2 pi i k / T grow alike from one measurement to the next. If a combination of
    them is not seen, C v = 0, no observer whatsoever makes it decay; and (28) speaks of every interval in (0, T2].
    """
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
        "id": "OBS610",
        "condition": "sampling",
        "reason": f"measurements every T = {T:.6g} are pathological: they cannot tell the modes at {found} apart",
        "interval": T,
        "feasible": {"T2_below": T},
        "suggestion": f"T2 below {T:.6g} is necessary, or another measurement",
    }


def too_long(T2: float, decay: float, feasible: Mapping[str, float], hints: Sequence[str], form: str) -> Diagnosis:
    """Answer that the inequalities have no solution, with the largest T2 and decay that do, and what was tried."""
    reason = f"{form} has no solution for T2 = {T2:g} with decay {decay:g}, whatever the gain from w"
    return {
        "id": "OBS603",
        "condition": "inequality",
        "reason": reason + (f"; the largest T2 is {feasible['T2']:.5g}" if "T2" in feasible else ""),
        "feasible": dict(feasible),
        "suggestion": ", or ".join(hints) or "look at another range of delta, or another relaxation or injection",
    }


def out_of_reach(asked: float, least: float) -> Diagnosis:
    """Answer that gamma is bounded below the least that a search over delta found."""
    return {
        "id": "OBS604",
        "condition": "gamma",
        "reason": f"gamma at most {asked:g} was asked for, and the least that was found is {least:.6g}",
        "gamma": {"asked": asked, "least": least},
        "feasible": {"gamma": least},
        "suggestion": f"allow gamma above {at_most(least)}, the least that was found",
    }


def too_small(
    kappa: float, T2: float, decay: float, gamma: float | None = None, reached: float | None = None
) -> Diagnosis:
    """Answer that no gain within the bound was found, for a `gamma` that is asked for; `reached`: one that it does."""
    enough = {}
    if gamma is not None and reached:
        enough["gamma"] = round_up(reached * (1 + CLOSE), 4), "within the bounds ask for gamma at least"
    where = f"for T2 = {T2:g} with decay {decay:g}" + ("" if gamma is None else f" and gamma at most {gamma:g}")
    return too_tight([f"|L| <= {kappa:g}"], where, enough)


def out_of_bounds(name: str) -> Diagnosis:
    """Answer that no value of a range is within the bounds."""
    return {
        "id": "OBS611",
        "condition": "bounds",
        "reason": f"no {name} of the range was reached",
        "feasible": {},
        "suggestion": "without bounds there are solutions",
    }


def useless(T1: float, T2: float, decay: float, tolerated: float | None) -> Diagnosis:
    """Answer that given gains achieve nothing; `tolerated`: the largest T2 for which they are proved to."""
    shorter = "look at a smaller decay"
    if tolerated:
        shorter = f"ask for T2 at most {at_least(tolerated * (1 - CLOSE), 4)}, which these gains are proved to tolerate"
        shorter += f", and T1, which is {T1:g}, no longer than that" if tolerated * (1 - CLOSE) < T1 else ""
    return {
        "id": "OBS609",
        "condition": "gains",
        "reason": "no storage function of Theorem 2 was found that proves these gains "
        f"for T2 = {T2:g} with decay {decay:g}",
        "feasible": {"T2": tolerated} if tolerated else {},
        "suggestion": f"{shorter}, or look at new gains: leave `gains` out",
    }
