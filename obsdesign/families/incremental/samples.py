"""What f, v and modes at the very rate rule out of observers in discrete time, whatever the gains.

With V+ = |N|^2_P in (e, f, v), N = [Ne Nf Nv], the inequality asks of its diagonal, besides what continuous time does,

    (e, e)   Q + Ge' M11 Ge <= rho^2 P          so that P has a floor,
    (f, f)   Nf' P Nf <= -M22                   where Gf = 0,
    (v, v)   Nv' P Nv + Gv' M11 Gv <= m I.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from obsdesign.dissipation.analysis import ball_of
from obsdesign.dissipation.bounds import ends
from obsdesign.dissipation.inequality import Incremental
from obsdesign.errors import UndecidedError
from obsdesign.families.finding import Finding, described, finding, outside
from obsdesign.families.incremental.request import Request
from obsdesign.families.incremental.stiffness import block_name, steep_blocks
from obsdesign.families.outcome import Diagnosis
from obsdesign.lmi.formula import Array
from obsdesign.model.structure import modes, undetectable
from obsdesign.spec import Spec
from obsdesign.tables.text import at_least

INSTEAD = (
    "declare a finite slope, or prove one on a region (auto); discretise by implicit Euler, which puts f into its own "
    "argument; or ask for filtered estimates with an L2 that has L2 C Bf < 0"
)
STRUCTURE = "say by Bf and Cq where f acts and what it reads, instead of every state through every state"
SMALLER = "declare a smaller constant, or a slope on a region"
LOUDER = "measure what makes the floor lower, or ask for a larger gamma"
ROUNDING = 1e-9  # relative
DIGITS = 12  # of what is computed in doubles
SLOWER = 1e-3  # of rho, that is suggested
NONE = 1e-9  # of z along a mode of length 1


def obstacle(spec: Spec, family: Incremental) -> Diagnosis | None:
    """What rules every gain out without a solver, where something does; a family in doubles."""
    return explicit(spec, family) or wide(spec, family)


def explicit(spec: Spec, family: Incremental) -> Diagnosis | None:
    """A block without an upper slope bound that acts on its argument a sample later only, Gf = 0: L1 has to cancel it.

    With M11 = M22 = 0 the block (f, f) of the inequality is Nf' P Nf <= 0, so that Nf = Bf + L1 Df = 0, which Df = 0
    rules out; and where some L1 does, the error that is left must decay.

    It is no conservatism: a pole of the error goes to infinity with the slope, for every pair of gains, unless
    Ge (zI - Ne)^-1 Nf = 0.
    """
    p = family.plant
    for i, _, _, columns in steep_blocks(family):
        Bf, Df = p.Bf[:, columns], p.Df[:, columns]
        Gf = p.Dqf[:, columns] if family.L2 is None else p.Dqf[:, columns] + family.L2 @ Df
        if Gf.any() or (family.L2 is None and Df.any()):
            continue
        L1 = -Bf @ np.linalg.pinv(Df)
        steep = f"{block_name(spec, i)} has no upper slope bound, and acts on its argument in the next sample only"
        found: Diagnosis = {"id": "OBS605", "condition": "explicit", "feasible": {}, "suggestion": INSTEAD}
        if (np.abs(Bf + L1 @ Df) > ROUNDING * np.abs(Bf).max()).any():
            return {**found, "reason": f"{steep}: no gain makes a contraction of an error that such a slope multiplies"}
        left = modes(p.A + L1 @ p.C, (np.eye(len(Df)) - Df @ np.linalg.pinv(Df)) @ p.C, p.states, family.edge)
        if left and len(family.multiplier.blocks) == 1:
            hides = f"L1 has to cancel it, after which {left[0].sentence}{outside(family.edge, family.about.pace)}"
            return {**found, "reason": f"{steep}: {hides}", "mode": described(left[0])}
    return None


def wide(spec: Spec, family: Incremental) -> Diagnosis | None:
    """A class of matrices K = center + S U T, |U| <= 1, that is too wide for rho: |T Ge Nf S| <= rho is necessary.

    (e, e) gives Ge' T' T Ge <= rho^2 P for the scale 1, and (f, f) Nf' P Nf <= (S S')^-1. It is so of the problem
    itself, for an f that turns with time, where nothing that L1 and L2 do changes Ge Nf: Df = 0 and Dqf = 0. A free L2
    takes from it what C Bf shows.
    """
    rho = float(family.about.pace.told(family.rate))
    for i, ball in balls(spec, family):
        value = float(np.linalg.norm(ball.T @ ball.Ge @ ball.Nf @ ball.S, 2))
        if value <= rho * (1 + ROUNDING):
            continue
        pace, middle = family.about.pace, ", about the middle of its class," if ball.center.any() else ""
        gains = "L1 and L2" if family.L2 is None or not (family.plant.C @ ball.Nf).any() else "L1"
        return {
            "id": "OBS618",
            "condition": "width",
            "reason": f"through {block_name(spec, i)}{middle} an error of its argument may be {at_least(value)} times "
            f"as large in the next sample whatever {gains}, and {pace.said(family.rate)} needs that to be at most rho",
            "value": value,
            "feasible": {pace.bound: value} if value < 1 else {},
            "suggestion": "; or ".join(ways(spec, family)),
        }
    return None


class Ball(NamedTuple):
    """A class {center + S U T, |U| <= 1} with the Ge and Nf of its block; S without what a free L2 takes from it."""

    Ge: Array
    Nf: Array
    center: Array
    S: Array
    T: Array


def balls(spec: Spec, family: Incremental) -> Iterator[tuple[int, Ball]]:
    """Number of each block that is a ball of matrices, and the ball, where no L1 changes Ge Nf.

    Every other block has M11 >= 0 for f - K q, K its member, and so takes nothing from (e, e).
    """
    p, L2, q, f = family.plant, family.L2, 0, 0
    if p.Df.any() or p.Dqf.any():
        return
    for i, block in enumerate(spec.multiplier.blocks):
        rows, columns = slice(q, q + block.nq), slice(f, f + block.nf)
        q, f = rows.stop, columns.stop
        ball = ball_of(block) if block.bounded else None
        if ball is None:
            continue
        center, S, T = ball
        Cq, Nf = p.Cq[rows], p.Bf[:, columns]
        if L2 is None:
            yield i, Ball(Cq, Nf, center, S @ unseen(p.C @ Nf @ S), T)
        else:
            yield i, Ball(Cq + L2[rows] @ p.C, Nf, center, S, T)


def unseen(seen: Array) -> Array:
    """Projection on what a matrix takes to zero."""
    return np.eye(seen.shape[1]) - np.linalg.pinv(seen) @ seen


def ways(spec: Spec, family: Incremental) -> Iterator[str]:
    """What may do instead."""
    p, shows = family.plant, (family.plant.C @ family.plant.Bf).any()
    if p.Bf.shape == p.Cq.T.shape == (p.n, p.n) != (1, 1) and (p.Cq == np.eye(p.n)).all():
        yield STRUCTURE
    if shows and not spec.observer.filtered:
        yield "ask for filtered estimates (estimate: filtered), which know y_k"
    if shows and family.L2 is not None:
        yield "look at another L2, as -Cq C^+ where y shows q, or `L2: free`"
    yield SMALLER


def floor(spec: Spec, request: Request, family: Incremental) -> list[Finding]:
    """What no gain makes gamma smaller than, where the class contains f = 0: v reaches z in the next sample.

    |H (B + L1 D)| / rho by (e, e) and (v, v) for l2, |H (B + L1 D)| / sqrt(1 - rho^2) for linf, at the rho of those
    that are asked for where it is least; the least norm over L1 is that for the v that D does not show.
    """
    p = family.plant
    if not p.B.shape[1] or any(not block.contains(0 * block.member) for block in spec.multiplier.blocks):
        return []
    least = float(np.linalg.norm(family.H @ p.B @ unseen(p.D), 2)) / largest(request)
    if least <= ROUNDING * float(np.linalg.norm(family.H @ p.B, 2)):
        return []
    asked = None if request.gains or request.level is None else float(request.level)
    beyond = asked is not None and asked < least * (1 - ROUNDING)
    told = f"no gain has a gamma below {at_least(float(f'{least:.{DIGITS}g}'))}"
    said = f"{told}: v reaches z in the next sample, where L1 takes from it what D shows at most"
    said += f", and gamma = {asked:g} was asked for" if beyond else ""
    return [finding("floor of gamma", not beyond, said, decides=True, advice=LOUDER, floor=least, id="OBS619")]


def largest(request: Request) -> float:
    """Largest factor of gamma in the floor: rho of l2, or sqrt(1 - rho^2) of linf, of those that are asked for."""
    rhos = [float(request.pace.told(end)) for end in ends(request.rate)]
    return max(rhos) if request.type == "l2" else max(np.sqrt(1 - rho * rho) for rho in rhos)


def at_the_edge(family: Incremental) -> Diagnosis:
    """Answer that a mode which no output shows decays at the very rate that is asked for, and z shows it; else empty.

    V+ - rho^2 V cannot be negative along it, so that z has to be zero there. Where it is, the inequality holds without
    any margin at best, and nothing is decided.

    `family`: in doubles. Raises `UndecidedError`: there is such a mode, and z does not show it.
    """
    if not family.edge.weak:
        return {}
    p, pace = family.plant, family.about.pace
    for mode in undetectable(p, family.multiplier.member, replace(family.edge, weak=False)):
        entries, here = dict(mode.along), pace.said(family.rate)
        z = family.H @ np.array([entries.get(name, 0) for name in p.states])
        if not family.about.monotone or np.abs(z).max(initial=0.0) <= NONE:
            slower = "leave it out of the plant" if not family.rate else f"ask for {pace.slower(family.rate - SLOWER)}"
            said = f"{mode.sentence}, and decays at {here} itself, where nothing is decided: {slower}, or measure it"
            raise UndecidedError(said, id="OBS507")
        slower = pace.necessary(family.edge.of(mode.eigenvalue))
        return {
            "id": "OBS601",
            "condition": "detectability",
            "reason": f"{mode.sentence}, and z shows it: at {here} itself that is too slow",
            "mode": described(mode),
            "feasible": {pace.bound: abs(mode.eigenvalue)} if family.rate else {},
            "suggestion": f"{f'{slower}; or ' if family.rate else ''}a measurement that shows it, or a performance "
            "without it, is needed",
        }
    return {}
