"""Suprema of the Lipschitz constant over all gains, without the gain; a closed form wherever there is one."""

from dataclasses import dataclass
from math import inf, sqrt

from flint import fmpq_mat

from obsdesign.design.engine import Engine
from obsdesign.lmi.formula import in_floats
from obsdesign.lmi.solve import Status
from obsdesign.model.plant import Plant
from obsdesign.model.structure import undetectable
from obsdesign.observers.lipschitz import Lipschitz, NormBound
from obsdesign.observers.lipschitz_limits import Core, Unseen, least_undetecting, norm_of, regular, unstructured

ACCURACY = 1e-10  # of the constant where it is the root of a margin
ENOUGH = 1e5  # where several blocks have this constant, in the units of the core, they have any


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
    inequality is strict).

    Parameters
    ----------
    engine
        Solves where there is no closed form.
    unit
        The family for the constant 1.
    relaxation
        "s-procedure"; or "norm-bound" or "abbaszadeh", which are the same here: Theorems 1 and 2.

    Raises
    ------
    ArithmeticError
        The reduced problem was not solved.
    """
    fixed = in_floats(unit)
    if undetectable(fixed.plant, fixed.multiplier.member, fixed.alpha):
        return Supremum(0.0, closed=NONE)
    return by_scales(engine, fixed) if relaxation == "s-procedure" else by_norms(engine, fixed)


def by_norms(engine: Engine, unit: Lipschitz) -> Supremum:
    """Theorem 2."""
    unseen, whole = Unseen.of(unit), norm_of(unit)
    if not unseen.order or not whole:
        return Supremum(inf, closed=EVERY)
    if unseen.order == 1:
        attained = unit.alpha > 0 and not unseen.W.any()
        return Supremum(unseen.closed / whole, attained, "(|w| - nu'w) / 2, C nu = 0, w = (A + decay I) nu")
    answer = engine.minimise(unseen.problem())
    solved(answer.status)
    return Supremum(max(-answer.objective / 2 / whole, 0.0), unit.alpha > 0 and unseen.regular(answer.values))


def by_scales(engine: Engine, unit: Lipschitz) -> Supremum:
    """S-procedure."""
    core = Core.of(unit)
    if core.unlimited:
        return Supremum(inf, closed=EVERY)
    if len(core.sizes) > 1:
        return Supremum(root(engine, core, by_norms(engine, unit).value))
    if len(core.system.A) == 1:
        value, positive = core.closed
        return Supremum(value, unit.alpha > 0 and positive, "least size of a linear f that hides a mode")
    answer = engine.minimise(core.problem())
    solved(answer.status)
    return Supremum(core.scale * sqrt(max(-answer.objective, 0.0)), unit.alpha > 0 and regular(answer.values["P"]))


def root(engine: Engine, core: Core, known: float) -> float:
    """Constant at which the margin of several blocks vanishes, above one that is known to do."""
    from scipy.optimize import brentq

    def excess(constant: float) -> float:
        answer = engine.minimise(core.excess(constant))
        solved(answer.status)
        return answer.objective - 1

    low, high = 0.9 * known, 2 * known or core.scale
    while excess(high) < 0:
        if high > ENOUGH * core.scale:
            return inf
        high *= 4
    return float(brentq(excess, low, high, xtol=ACCURACY * high, rtol=ACCURACY))


def solved(status: Status) -> None:
    """Refuse an answer that is none."""
    if status is not Status.OPTIMAL:
        raise ArithmeticError("the reduced problem of the largest Lipschitz constant was not solved")


def largest_for_gamma(engine: Engine, unit: Lipschitz, relaxation: str) -> Supremum:
    """Supremum of the constant c for which some gain has some finite gamma.

    With Theorems 3 and 4 ("abbaszadeh") l < -h + sqrt(h^2 + 2 (1 - h) g - 1), h = sigma(H)^2 and g the l of Theorem 2,
    whatever B and D are: P <= (1 - h) / (2 l) I leaves a < (1 - h) g / l, and H'H + ((l + 1 / l) / 2 - a) I < 0. There
    is none unless h < 1 and 2 (1 - h) g > 1. It is not attained. In the other relaxations gamma has no part in it.
    """
    supremum = largest_constant(engine, unit, relaxation)
    if relaxation != "abbaszadeh":
        return supremum
    fixed = in_floats(unit)
    whole, h = norm_of(fixed), seen(fixed)
    if h >= 1 or supremum.value == 0:
        return Supremum(0.0, closed="sigma(H) >= 1" if h >= 1 else supremum.closed)
    if supremum.value == inf:
        return supremum
    excess = 2 * (1 - h) * supremum.value * whole - 1
    value = excess / (h + sqrt(h * h + excess)) if excess > 0 else 0.0
    return Supremum(value / whole, closed=GAMMA + (supremum.closed or "limit of Theorem 2"))


def seen(unit: Lipschitz) -> float:
    """Return h = sigma(H)^2, in doubles."""
    return float(NormBound(unit.plant, unit.multiplier, unit.H, unit.alpha).seen)


def ceiling(unit: Lipschitz) -> float | None:
    """Constant of a linear f that makes a mode undetectable at the rate of `unit`, whatever the gain and the method.

    The minimum of sigma_min((A - s I) N) over real s >= -beta, N an orthonormal basis of ker C; only where f is any
    function of x with a constant, and None otherwise, or where there is no such f.
    """
    fixed = in_floats(unit)
    if not unstructured(fixed) or not Unseen.of(fixed).order:
        return None
    return least_undetecting(fixed) / norm_of(fixed)


def cancels(plant: Plant) -> bool:
    """Whether there is w, and a finite gain keeps it from the error: L D = B has a solution, in rationals."""
    if not plant.B.shape[1]:
        return False
    D, B = plant.D.tolist(), plant.B.tolist()
    return bool(fmpq_mat(D).rank() == fmpq_mat(D + B).rank())
