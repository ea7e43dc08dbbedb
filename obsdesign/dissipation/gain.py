"""Small gains: the least |L1| that reaches a gamma, and L2 where it is free.

Under the convex bound |L1| <= kappa (t I <= P, [P, Y; Y', kappa^2 t I] >= 0) the least gamma, or another objective,
falls with kappa and is reliable to compute over many decades; minimising the bound itself at a given gamma is not.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from obsdesign.dissipation.bounds import NO_BOUNDS, Bounds
from obsdesign.dissipation.central import scaled
from obsdesign.dissipation.decimals import round_up, significant
from obsdesign.dissipation.elimination import SEARCHED, least_gamma
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.inequality import Incremental
from obsdesign.dissipation.scan import edge, strides
from obsdesign.dissipation.shift import unshifted
from obsdesign.lmi.equilibrate import units
from obsdesign.lmi.formula import Array, Values, in_floats, printed, rational_number
from obsdesign.lmi.solve import Answer, Status
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.structure import undetectable

DIGITS = (6, 9, 12, 17)  # of a shipped gain; more only where fewer will not do
KAPPAS = 12  # bounds that are tried for the smallest gain
STRIDE = 4  # down from a bound that will do, until one will not
NEAR = 0.13  # relative, to which the smallest is found
CLOSELY = 0.02  # .. and the least bound that will do
NEARER = 0.005  # .. where the gain is not within its bound there
ROOM = 2e-3  # of gamma, left to the rounding of the gain
ROUNDING = 1e-5  # of a bound on L1, likewise
ACCURATE = 1e-3  # relative, to which an objective is believed where it excludes a goal
WIDEST = 2  # convex bounds beyond the bound on |L1| that are tried
MODERATE = (10.0, 1000.0)  # gains, in sizes of the plant
WIDENINGS = 3  # attempts at a convex bound whose gain comes nearer to the bound that was asked for

Solve = Callable[[Bounds, Values | None], Answer]  # least objective within bounds, from the solution of one nearby


def searchable(family: Incremental) -> Incremental:
    """Same problem in doubles; where L2 is found, for f - K q."""
    return in_floats(family) if family.L2 is not None else family.shifted()


def least(engine: Engine, family: Incremental) -> Solve:
    """Least gamma^2 of a family within bounds."""
    return lambda bounds, start: engine.minimise(family.least_gamma(bounds), start)


def within(engine: Engine, family: Incremental, bounds: Bounds = NO_BOUNDS, *, doubted: bool = True) -> Answer:
    """Least gamma^2 within bounds; by Riccati equations where there are none and these tell.

    `doubted`: whether a solver's word that there is none is held against other solves.
    """
    return judged(engine, family, unjudged(engine, family, bounds, doubted=doubted), bounds)


def unjudged(engine: Engine, family: Incremental, bounds: Bounds = NO_BOUNDS, *, doubted: bool = True) -> Answer:
    """Same, but that Riccati equations are not asked of small plants what inequalities leave undecided."""
    known = least_gamma(engine, family, bounds)
    if known is not None:
        return known
    answer = bounded(least(engine, family), bounds)
    return believed(engine, family, answer, bounds) if doubted else answer


def believed(engine: Engine, family: Incremental, answer: Answer, bounds: Bounds) -> Answer:
    """Answer that is undecided where a solver finds no gain of any size although there is one.

    Without f there is one wherever no hidden mode is too slow. With f, one of a moderate size is searched: where
    outputs are all but free of noise, the gains near the limit are of another size than P, and a solver calls that
    infeasible. Then scales with which a Riccati equation has a solution.
    """
    if answer.status is not Status.INFEASIBLE or family.L1 is not None or bounds.L1 is not None or bounds.poles:
        return answer
    if undetectable(family.plant, in_floats(family.multiplier.member), family.edge):
        return answer
    largest, linear = sizes(family)[0], not family.plant.Bf.any()
    within = (engine.minimise(family.least_gamma(sized(bounds, step * largest))) for step in MODERATE)
    found = linear or any(one.status is Status.OPTIMAL for one in within)
    found = found or (engine.equations and next(scaled(family), None) is not None)
    return replace(answer, status=Status.UNDECIDED) if found else answer


def sizes(family: Incremental) -> tuple[float, float]:
    """Sizes of |L1| and gamma by the data of the plant, to the nearest power of 1000: 1 in the usual units."""
    unit = units(family.least_gamma())
    largest = np.linalg.norm(unit["Y"] / np.diag(unit["P"])[:, None])
    return nearest_thousand(float(largest)), nearest_thousand(math.sqrt(unit["mu"].item()))


def nearest_thousand(size: float) -> float:
    """Nearest power of 1000."""
    return 1000.0 ** round(math.log(size, 1000)) if size > 0 else 1.0


def judged(engine: Engine, family: Incremental, answer: Answer, bounds: Bounds = NO_BOUNDS) -> Answer:
    """Answer of `unjudged`, or of Riccati equations in its place where it is undecided and these tell."""
    undecided = answer.status is Status.UNDECIDED and family.plant.n < SEARCHED
    return (undecided and least_gamma(engine, family, bounds, smallest=0)) or answer


def bounded(solve: Solve, bounds: Bounds) -> Answer:
    """Least objective within bounds; the convex bound on |L1| is widened while the gain it gives stays inside.

    None is infeasible only if not even what every gain within the bound satisfies has a solution.
    """
    if bounds.L1 is None:
        return solve(bounds, None)
    size = allowed = limit_of(bounds)
    best = solve(sized(bounds, size), None)
    if best.status is not Status.OPTIMAL:
        return replace(best, status=Status.INFEASIBLE if excluded(solve, bounds) else Status.UNDECIDED)
    for _ in range(WIDENINGS):
        found = norm(best.values, bounds)
        if not found:
            break
        size *= allowed / found
        wider = solve(sized(bounds, size), best.values)
        if wider.status is not Status.OPTIMAL or norm(wider.values, bounds) > allowed:
            break
        best = wider
    return best


def excluded(solve: Solve, bounds: Bounds, goal: float = math.inf) -> bool:
    """Whether no gain within bounds has an objective of at most a goal: what they all satisfy has none, numerically."""
    answer = solve(replace(bounds, necessary=True), None)
    missed = answer.status is Status.OPTIMAL and answer.objective > goal * (1 + ACCURATE)
    return answer.status is Status.INFEASIBLE or missed


def unplaced(engine: Engine, family: Incremental, bounds: Bounds) -> bool:
    """Whether no gain of any size has its poles where bounds want them: no P and multipliers prove it, numerically.

    Whatever gamma is: without v and z.
    """
    if bounds.poles is None:
        return False
    undisturbed = replace(family, plant=family.plant.undisturbed, H=family.H[:0])
    return engine.marginless(undisturbed.witness(1.0, Bounds(poles=bounds.poles)))


def least_size(solve: Solve, bounds: Bounds, goal: float = math.inf) -> float | None:
    """Bound on |L1| that is found to do for an objective of at most a goal, the least to `CLOSELY`; None if none is."""
    if bounds.L1 is None:
        return None

    def reaches(size: float) -> bool:
        answer = bounded(solve, sized(bounds, size))
        return answer.status is Status.OPTIMAL and answer.objective <= goal

    inside, outside = strides(reaches, float(bounds.L1), 1 / STRIDE, KAPPAS)
    if inside is None or outside is None:
        return None
    return round_up(edge(reaches, inside, outside, CLOSELY) * (1 + CLOSELY), 4)


def small_gains(
    engine: Engine, family: Incremental, gamma: float, bounds: Bounds
) -> Iterator[tuple[Incremental, Values]]:
    """Families with both gains, of small norm and in more and more digits, and the P and scales they come from.

    `family`: in rationals; L2 may be free; `gamma`: level to reach, with some room.
    """
    for fixed in with_L2(family, lambda search: next(smallest(engine, search, gamma, bounds), None)):
        for values in smallest(engine, in_floats(fixed), gamma, bounds):
            for L1 in rounded_gains(values, bounds):
                yield replace(fixed, L1=L1), values


def rounded_gains(values: Values, bounds: Bounds) -> Iterator[Array]:
    """L1 = P^-1 Y in more and more digits, as rationals, where it is within its bound."""
    for digits in DIGITS:
        L1 = significant(gain(values), digits)
        if bounds.L1 is None or size_of(L1, bounds) <= float(bounds.L1):
            yield printed(L1)


def with_L2(family: Incremental, solve: Callable[[Incremental], Values | None]) -> Iterator[Incremental]:
    """Families with L2 = R / lambda, back from the loop shift, in more and more digits; or the family itself.

    `solve`: R and lambda of the family in which they are found, if there are any.
    """
    if family.L2 is not None:
        yield family
        return
    values = solve(searchable(family))
    if values is None:
        return
    blocks = family.multiplier.scaled_blocks()
    plant, K = in_floats(family.plant), in_floats(family.multiplier.member)
    unknowns = Multiplier(blocks).unknowns()
    scales = np.repeat([values[u.name].item() for u in unknowns], [len(b.M11) for b in blocks])
    L2 = unshifted(values["R"] / scales[:, None], plant, K)
    for digits in DIGITS:
        yield replace(family, L2=printed(significant(L2, digits)))


def smallest(engine: Engine, family: Incremental, gamma: float, bounds: Bounds) -> Iterator[Values]:
    """P, Y, .. of gains of small norm that reach gamma, with mu1 = 1, the smallest first; none if none was found."""
    wide = engine.widest(family.witness(gamma, Bounds(poles=bounds.poles)))
    if wide.status is Status.OPTIMAL:
        yield from descended(least(engine, family), (gamma * (1 - ROOM)) ** 2, wide.values, bounds)


def descended(solve: Solve, goal: float, wide: Values, bounds: Bounds) -> Iterator[Values]:
    """P, Y, .. of a gain of small norm whose objective is at most a goal, then of the larger ones on the way to it.

    These are for where a solver takes a gain that is too small for one that will do, with a P of huge condition.

    The smallest kappa is found to `NEAR`, from the gain of the widest margin down; or else from the bound, where a
    solve with more room is lost because a finite gain reaches any level. The last resort is the least objective.
    """
    allowed = limit_of(bounds)
    found = [wide] if norm(wide, bounds) <= allowed and bounds.floor is None else []
    start: Values | None = None

    def reaches(kappa: float) -> bool:
        nonlocal start
        answer = solve(sized(bounds, kappa), start)
        if answer.status is not Status.OPTIMAL or answer.objective > goal:
            return False
        start = answer.values
        if norm(start, bounds) <= allowed:
            found.append(start)
        return True

    inside, outside = strides(reaches, min(norm(wide, bounds), WIDEST * allowed), 1 / STRIDE, KAPPAS)
    if inside is None and allowed < math.inf and reaches(allowed):
        inside, outside = strides(reaches, allowed, 1 / STRIDE, KAPPAS)
    for tolerance in (NEAR, NEARER):
        fits = start is not None and norm(start, bounds) <= allowed
        if inside is not None and outside is not None and (tolerance == NEAR or not fits):
            inside = edge(reaches, inside, outside, tolerance)
    if not found and bounds.L1 is not None:
        best = bounded(solve, bounds)
        found = [best.values] if best.status is Status.OPTIMAL and best.objective <= goal else []
    yield from reversed(found)


def limit_of(bounds: Bounds) -> float:
    """Largest norm of L1 before it is rounded."""
    return math.inf if bounds.L1 is None else float(bounds.L1) * (1 - ROUNDING)


def sized(bounds: Bounds, size: float) -> Bounds:
    """Bounds with another size of L1."""
    return replace(bounds, L1=rational_number(repr(size)))


def gain(values: Values) -> Array:
    """L1 = P^-1 Y, in the scales of the diagonal of P."""
    P = values["P"]
    d = 1 / np.sqrt(np.abs(np.diag(P)))[:, None]
    return np.asarray(d * np.linalg.solve(d * P * d.T, d * values["Y"]))


def norm(values: Values, bounds: Bounds) -> float:
    """Norm of L1 in which it is bounded."""
    return size_of(gain(values), bounds)


def size_of(L1: Array, bounds: Bounds) -> float:
    """Spectral or Frobenius norm."""
    return float(np.linalg.norm(L1, 2 if bounds.norm == "spectral" else "fro"))


def doubles(family: Incremental) -> dict[str, Array]:
    """Both gains as doubles, which print as the decimals that were proved."""
    fixed = in_floats(family)
    assert fixed.L1 is not None
    assert fixed.L2 is not None
    return {"L1": fixed.L1, "L2": fixed.L2}
