"""Suprema of the Lipschitz constant over all gains, without the gain; a closed form wherever there is one."""

from math import inf, sqrt

import numpy as np
from flint import fmpq_mat

from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.inequality import ONE
from obsdesign.errors import UndecidedError
from obsdesign.families.lipschitz import samples
from obsdesign.families.lipschitz.closed_forms import (
    Core,
    Unseen,
    least_undetecting,
    regular,
    unstructured,
)
from obsdesign.families.lipschitz.relaxations import Lipschitz
from obsdesign.families.lipschitz.stretch import Stretch
from obsdesign.lmi.formula import Exact, Problem, in_floats
from obsdesign.lmi.solve import Answer, Status
from obsdesign.model.plant import Plant
from obsdesign.model.structure import undetectable
from obsdesign.records import dataclass, replace

ACCURACY = 1e-6  # of the constant of several blocks, relative


@dataclass(frozen=True)
class Supremum:
    """Supremum of the largest constant over all gains; infinite if any constant will do, 0 if none will."""

    value: float
    attained: bool = False
    closed: str = ""  # the closed form in words; "" where it is numerical


GAMMA = "-h + sqrt(h^2 + 2 (1 - h) g - 1), h = sigma(H)^2, g = "
EVERY, NONE = "every constant will do", "a mode is undetectable"


def largest_constant(engine: Engine, unit: Lipschitz, relaxation: str) -> Supremum:
    """Supremum of the constant c for which some gain makes the error converge at the rate of `unit`, without w and z.

    It is attained where the storage function of the optimum is regular and the rate is positive (at the rate 0 the
    inequality is strict). With several blocks that is not known, as it takes finite scales too, and never claimed.

    `engine`: solves where there is no closed form; `unit`: the family for the constant 1; `relaxation`: "s-procedure";
    or "norm-bound" or "abbaszadeh", which are the same here: Theorems 1 and 2. Raises `UndecidedError`: the reduced
    problem was not solved.
    """
    if unit.about.pace.sampled:
        return of_samples(engine, in_floats(unit))
    if relaxation == "s-procedure":
        return by_scales(engine, in_floats(unit))
    limit, whole = theorem2(engine, unit), in_floats(unit).lipschitz
    if whole or not limit.value:
        return replace(limit, value=limit.value and limit.value / whole)
    return Supremum(inf, closed=EVERY)


def hides(unit: Lipschitz) -> bool:
    """Whether a mode is undetectable at the rate of a family in doubles."""
    return bool(undetectable(unit.plant, unit.multiplier.member, unit.edge))


def theorem2(engine: Engine, unit: Lipschitz) -> Supremum:
    """Supremum of the constant l of f as a whole."""
    fixed = in_floats(unit)
    if hides(fixed):
        return Supremum(0.0, closed=NONE)
    unseen = Unseen.of(fixed)
    if not unseen.order:
        return Supremum(inf, closed=EVERY)
    if unseen.order == 1:
        attained = fixed.rate > 0 and not unseen.W.any()
        return Supremum(unseen.closed, attained, "(|w| - nu'w) / 2, C nu = 0, w = (A + decay I) nu")
    answer = optimum(engine, unseen.problem())
    return Supremum(max(-answer.objective / 2, 0.0), fixed.rate > 0 and unseen.regular(answer.values))


def of_samples(engine: Engine, unit: Lipschitz) -> Supremum:
    """S-procedure of samples."""
    if hides(unit):
        return Supremum(0.0, closed=NONE)
    value, P = samples.largest(engine, unit.undisturbed())
    if value == inf:
        return Supremum(inf, closed=EVERY)
    attained = unit.rate > 0 and len(unit.multiplier.blocks) == 1 and regular(P)
    feedback = samples.feedback(unit)
    if feedback and value >= feedback.most * (1 - ACCURACY):
        return Supremum(feedback.most, attained, feedback.sentence)
    return Supremum(value, attained)


def by_scales(engine: Engine, unit: Lipschitz) -> Supremum:
    """S-procedure; several scales are those of a larger constant, as long as there is one."""
    if hides(unit):
        return Supremum(0.0, closed=NONE)
    core = Core.of(unit)
    if not core.shares:
        return Supremum(inf, closed=EVERY)
    attainable = unit.rate > 0 and len(unit.multiplier.blocks) == 1
    if len(core.shares) == len(core.system.A) == 1:
        value, decays = core.closed
        return Supremum(value, attainable and decays, "least size of a linear f that hides a mode")
    if len(core.shares) == 1 and (known := Stretch(engine, unit.undisturbed())).eliminated:
        P = known.eliminated.values.get("P")
        return Supremum(known.constant(known.eliminated), attainable and P is not None and regular(P))
    answer = optimum(engine, core.largest([ONE] * len(core.shares)))
    value = core.constant(answer.objective)
    if len(core.shares) > 1:
        return Supremum(widened(engine, core, value))
    return Supremum(value, attainable and regular(answer.values["P"]))


def widened(engine: Engine, core: Core, value: float) -> float:
    """Largest constant of several blocks over their scales, from that for equal scales.

    As long as some scales admit a larger constant, the largest for the most central of them; phase I proposes them, and
    what it says is not believed without that.
    """
    step = ACCURACY
    while value:
        better, answer = 0.0, engine.widest(core.admissible(value * (1 + step)))
        if answer.status is Status.OPTIMAL:
            scales = np.array([answer.values[name] for name in core.scales])
            answer = engine.minimise(core.largest(scales / np.max(scales)))
            better = core.constant(answer.objective) if answer.status is Status.OPTIMAL else 0.0
        if better > value * (1 + step / 2):
            value, step = better, min(8 * step, 1.0)
        elif step > ACCURACY:
            step = max(step / 64, ACCURACY)
        else:
            break
    return value


def optimum(engine: Engine, problem: Problem) -> Answer:
    """Optimum of a reduced problem. Raises `UndecidedError`: it was not solved."""
    answer = engine.minimise(problem, precise=True)
    if answer.status is not Status.OPTIMAL:
        raise UndecidedError(
            "the largest Lipschitz constant over all gains was not found: its problem was not solved", id="OBS507"
        )
    return answer


def largest_for_gamma(engine: Engine, unit: Lipschitz, relaxation: str) -> Supremum:
    """Supremum of the constant c for which some gain has some finite gamma.

    With Theorems 3 and 4 ("abbaszadeh") l < -h + sqrt(h^2 + 2 (1 - h) g - 1), h = sigma(H)^2 and g the l of Theorem 2,
    whatever B and D are: P <= (1 - h) / (2 l) I leaves a < (1 - h) g / l, and H'H + ((l + 1 / l) / 2 - a) I < 0. There
    is none unless h < 1 and 2 (1 - h) g > 1. It is not attained. In the other relaxations gamma has no part in it.
    """
    if relaxation != "abbaszadeh":
        return largest_constant(engine, unit, relaxation)
    limit, whole, h = theorem2(engine, unit), in_floats(unit).lipschitz, in_floats(unit).seen
    if h >= 1 or not limit.value:
        return Supremum(0.0, closed="sigma(H) >= 1" if h >= 1 else limit.closed)
    excess = 2 * (1 - h) * limit.value - 1
    if excess > 0 and (limit.value == inf or not whole):
        return Supremum(inf, closed=EVERY)
    value = excess / (h + sqrt(h * h + excess)) / whole if excess > 0 else 0.0
    return Supremum(value, closed=GAMMA + (limit.closed or "limit of Theorem 2"))


def ceiling(unit: Lipschitz) -> float | None:
    """Constant of a linear f that makes a mode undetectable at the rate of `unit`, whatever the gain and the method.

    The minimum of sigma_min((A - s I) N) over real s >= -beta, or |s| >= rho, N an orthonormal basis of ker C; only
    where f is any function of x with a constant, and None otherwise, or where there is no such f.
    """
    fixed = in_floats(unit)
    least = least_undetecting(fixed) if unstructured(fixed) else inf
    return None if least == inf else least / fixed.lipschitz


def cancels(plant: Plant[Exact]) -> bool:
    """Whether there is w, and a finite gain keeps it from the error: L D = B has a solution, in rationals."""
    if not plant.B.shape[1]:
        return False
    D, B = plant.D.tolist(), plant.B.tolist()
    return bool(fmpq_mat(D).rank() == fmpq_mat(D + B).rank())
