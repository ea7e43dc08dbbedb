"""What gains are proved to achieve by clock-dependent certificates, a witness for each claim."""

import math

from flint import fmpq

from obsdesign.dissipation import scan
from obsdesign.dissipation.decimals import round_down, round_up
from obsdesign.families.sporadic.clock.analysis import FEASIBLE, Analysis, Found
from obsdesign.families.sporadic.clock.witness import GOALS, Goal, Witness, constants
from obsdesign.families.sporadic.gains import EDGE, PART, SHORTENED
from obsdesign.lmi.formula import approximate, printed

PARTS = (0.15, 0.3, 0.5, 0.7)  # of the fastest rate, at which the constants of w and eta are proved
NOISY = 1.1  # gamma, relative to the least, of the bound that takes the noise of measurements in
QUIET = 0.5  # of the fastest rate, at which |x| is proved to decay where no rate is asked for
ROUGH = 3e-2  # accuracy of the fastest rate, relative, of which these are parts
FASTER = 2.0  # between rates that are tried, until one has no solution
MOST = 40  # .. of these


def fastest(analysis: Analysis, T2: fmpq, low: fmpq, high: float | None = None, *, rough: bool = False) -> float | None:
    """Largest rate for which there is a solution, or None if there is none at the lowest; numerical, to `EDGE`.

    `rough`: whether `ROUGH` does, by quick solves.
    """

    def missing(decay: float) -> float:
        return FEASIBLE - analysis.margin(T2, printed(decay), quick=rough)

    begin = float(low)
    if missing(begin) >= 0:
        return None
    if high is None:
        high = max(2 * begin, 0.1 / float(T2))
        for _ in range(MOST):
            if missing(high) >= 0:
                break
            begin, high = high, FASTER * high
    if rough:
        return scan.edge(lambda decay: missing(decay) < 0, begin, high, ROUGH)
    return scan.zero(missing, begin, high, EDGE * high)


def longest(analysis: Analysis, decay: fmpq, low: float, high: float) -> float | None:
    """Largest T2 of an interval for which there is a solution, or None; numerical."""
    return scan.zero(lambda T2: FEASIBLE - analysis.margin(printed(T2), decay), low, high, EDGE * high)


def proof_of_longest(analysis: Analysis, edge: float, decay: fmpq, low: fmpq) -> Witness | None:
    """Witness for the longest T2 that is found, below the edge where solutions end numerically; None without one."""
    proofs: dict[float, Witness] = {}

    def proved(T2: float) -> bool:
        exact = max(printed(round_down(T2, 6)), low)
        witness = analysis.prove(GOALS["overshoot"], exact, decay)
        if witness is None or not witness.holds:
            return False
        proofs[T2] = witness
        return True

    above = edge
    for backoff in SHORTENED:
        inside = edge * (1 - backoff)
        if inside <= float(low):
            break
        if proved(inside):
            return proofs[scan.edge(proved, inside, above, backoff * PART)]
        above = inside
    return None


def witnesses(analysis: Analysis, T2: fmpq, decay: fmpq) -> dict[str, Witness]:
    """Witness of gamma, of the decay, and of the constants of w and eta, each with the best of a few rates."""
    gamma = analysis.prove(GOALS["gamma"], T2, decay)
    found = {"gamma": gamma}
    if gamma and gamma.holds:
        level = {"mu": printed(round_up(float(gamma.numbers["mu"]) * NOISY**2, 6))}
        found["energy"] = analysis.prove(GOALS["energy"], T2, decay, given=level)
    limit = fastest(analysis, T2, decay, rough=True)
    if rate := decay or printed(round_down(QUIET * (limit or 0.0), 3)):
        found["overshoot"] = analysis.prove(GOALS["overshoot"], T2, rate)
    if limit is not None:
        rates = [printed(round_down(part * limit, 3)) for part in PARTS]
        if analysis.system.Bx.shape[1]:
            found["disturbance"] = best(analysis, GOALS["disturbance"], T2, rates)
        if analysis.T1:
            found["noise"] = best(analysis, GOALS["noise"], T2, rates)
    return {
        name: witness for name, witness in found.items() if witness is not None and (witness.holds or name == "gamma")
    }


def best(analysis: Analysis, goal: Goal, T2: fmpq, rates: list[fmpq]) -> Witness | None:
    """Witness of the least constant over a few rates, by their solves; None where none is found."""
    found = {rate: analysis.least(goal, T2, rate) for rate in rates if rate}
    sizes = {rate: size(goal, one, rate, analysis.T1) for rate, one in found.items()}
    for rate in sorted((r for r in sizes if math.isfinite(sizes[r])), key=sizes.__getitem__):
        witness = analysis.prove(goal, T2, rate, found[rate])
        if witness and witness.holds:
            return witness
    return None


def size(goal: Goal, found: Found, rate: fmpq, T1: fmpq) -> float:
    """Constant that a solve finds at a rate."""
    if found.values is None or found.objective <= 0:
        return math.inf
    known = constants(goal, {goal.least: printed(found.objective)}, rate, T1)
    return min(map(approximate, known.values()), default=math.inf)
