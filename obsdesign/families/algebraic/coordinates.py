"""Observers in coordinates: Kazantzis-Kravaris-Luenberger, parameter-estimation-based, and both (Propositions 1 to 3).

xi' = lambda(y, u) xi + B(y, u),     phi(x)' = lambda(y, u) phi(x) + B(y, u)      (4)
xhat = phiL(xi + theta, y),          theta = phi(x) - xi constant where lambda = 0    (9), (10), (15)

Where lambda < 0 the error xi - phi(x) decays as exp(int lambda). In (41) the paper has lambda with the other sign.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

from flint import fmpq

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.expressions.algebra import simplified
from obsdesign.families.algebraic.estimator import Estimation, assumed, estimation, excited, exponential, needed
from obsdesign.families.algebraic.forms import Coordinate, Estimator, Immersion, Regression, Transformed
from obsdesign.families.algebraic.identity import Identity, Negative
from obsdesign.families.algebraic.immersion import by_default
from obsdesign.families.algebraic.scheme import (
    DECAYS,
    INVERTED,
    UNBOUNDED,
    ZERO,
    Excitation,
    Plant,
    Scheme,
    Statement,
    added,
    decay,
    inverses,
    less,
    multiplied,
    scaled,
    slope,
    smooth,
    values,
)
from obsdesign.families.observer import Observer
from obsdesign.model.equations import Named


def scheme(plant: Plant, form: Transformed) -> Scheme:
    """What such an observer rests on, and its equations."""
    phi = {one.name: one.phi for one in form.coordinates}
    statements: list[Statement] = [one for c in form.coordinates for one in coordinate(plant, c, phi)]
    statements += inverses(plant, form.left_inverse, phi)
    parameters = tuple(c.name for c in form.coordinates if c.estimated)
    observer, theta, excitation = equations(plant, form, parameters)
    numbers: dict[str, Any] = {"coordinates": [described(c) for c in form.coordinates]}
    says = [said(c) + cascade(waits(form, c.B)) for c in form.coordinates]
    depends = [UNBOUNDED] if form.left_inverse else []
    rates = {c.name: decays(c) for c in form.coordinates if not c.estimated and not waits(form, c.B)}
    if form.estimator and form.estimator.method == "proportional":
        found, more, moves = attraction(plant, form, theta)
        before = waits(form, *form.left_inverse.values()) - set(theta)
        before |= waits(form, *(c.B for c in form.coordinates if c.estimated))
        alone = not before and len(theta) == 1
        statements, rates = [*statements, *found], {**rates, **more} if alone else rates
        says += [move + cascade({*before, *list(theta)[:i]}) for i, move in enumerate(moves)]
    elif form.estimator:
        statements += regressions(plant, form.estimator, form.coordinates)
        before = set().union(*(held(form, each) for each in form.estimator.regressions))
        says.append(regressed(form.estimator) + cascade(before))
        need = needed(form.estimator, parameters, sorted(before))
        lowest = assumed(form.estimator, parameters)
        assert excitation
        excitation = replace(excitation, need="; ".join([need, *lowest]))
        converges = f"that the estimates of theta of {', '.join(parameters)} converge, {excited(need)}"
        depends = [converges, *lowest, *depends]
    right = "the coordinates, theta included, are phi(x)" if theta else "the coordinates are phi(x)"
    says += [f"xhat = x where {right}, {INVERTED}"] if form.left_inverse else []
    if form.recast:
        statements += still(plant, observer, theta)
        observer = recast(plant, form, observer, theta)
        says.append("the observer is one of immersion and invariance with beta = xi + theta")
    return Scheme(tuple(statements), observer, numbers, tuple(says), tuple(depends), rates, excitation)


def described(c: Coordinate) -> dict[str, Any]:
    """Entry of a result file."""
    return {"name": c.name, "phi": c.phi.text, "lambda": c.rate.text, "B": c.B.text}


def said(c: Coordinate) -> str:
    """What a coordinate does."""
    if c.estimated:
        return f"theta of {c.name}, ({c.phi}) - {c.name}, is constant"
    return f"the error of {c.name}, {c.name} - ({c.phi}), {decay(c.rate)}"


def regressed(estimator: Estimator) -> str:
    """What is proved of the regressions of an estimator."""
    value = "exp(theta)" if estimator.powers else "theta"
    exact = "exactly" if estimator.consistent else f"up to an error that decays as exp(-{estimator.alpha}*t)"
    regression = f"d(output)/dt = known + m {value} for every theta"
    return f"{regression}, so that Y = psi {value} holds of the filtered signals {exact}"


def waits(form: Transformed, *sides: Expression) -> set[str]:
    """Coordinates whose estimates must be right before what stands in right sides is, those before them included.

    In `B`, `K` and the left inverse the name of a coordinate is its estimate; one with lambda 0 is right once its
    constant is.
    """
    own = {c.name: c for c in form.coordinates}
    used = {name for side in sides for name in side.names if name in own}
    return used.union(*(waits(form, own[name].B) for name in used))


def held(form: Transformed, regression: Regression) -> set[str]:
    """Coordinates whose estimates must be right before a regression is; of one with lambda 0, those it waits for."""
    own = {c.name: c for c in form.coordinates}
    sides = (regression.known, *regression.m.values())
    used = {name for side in sides for name in side.names if name in own} | set(regression.m)
    decaying = {name for name in used if not own[name].estimated}
    return decaying.union(*(waits(form, own[name].B) for name in used))


def cascade(names: Collection[str]) -> str:
    """Clause on what has to be right before."""
    right = f", once the estimate of {', '.join(sorted(names))} is right"
    return f"{right} (an error of it acts as a disturbance)" if names else ""


def decays(c: Coordinate) -> str:
    """Name of the statement that a coordinate decays."""
    return f"{c.name}: lambda = {c.rate} < 0"


def coordinate(plant: Plant, c: Coordinate, phi: dict[str, Expression]) -> list[Statement]:
    """The partial differential equation of a coordinate, and the sign of its lambda."""
    rate, B = plant.on(c.rate), plant.on(c.B, phi)
    residual = less(plant.along(c.phi), multiplied(rate, c.phi), B)
    name = f"{c.name}: d/dt ({c.phi}) = {c.B}" if c.estimated else f"{c.name}: d/dt ({c.phi}) = ({c.rate}) phi + {c.B}"
    found: list[Statement] = [Identity(name, residual)]
    if not c.estimated:
        found.append(Negative(decays(c), rate))
    found += smooth(c.name, c.phi)
    return found + [one for side in (c.rate, c.B) for one in values(c.name, side, phi)]


def regressions(plant: Plant, estimator: Estimator, coordinates: Sequence[Coordinate]) -> list[Statement]:
    """d(output)/dt = known + sum m theta, for every theta: xi is phi - theta where lambda = 0, and phi elsewhere."""
    theta = {c.name: Expression.variable(f"θ_{c.name}") for c in coordinates if c.estimated}
    xi = {c.name: less(c.phi, theta[c.name]) if c.estimated else c.phi for c in coordinates}
    value = {name: exponential(t) if name in estimator.powers else t for name, t in theta.items()}
    found: list[Statement] = []
    for k, each in enumerate(estimator.regressions, start=1):
        sides = [multiplied(plant.on(m, xi), value[name]) for name, m in each.m.items()]
        residual = less(plant.rate(each.output), plant.on(each.known, xi), *sides)
        terms = " + ".join(f"({m}) {'exp(theta)' if n in estimator.powers else 'theta'}" for n, m in each.m.items())
        for side in (each.known, *each.m.values()):
            found += values(f"regression {k}", side, xi)
        found += plant.differentiable(Expression.variable(each.output))
        found.append(Identity(f"regression {k}: d/dt {each.output} = {each.known} + {terms}", residual))
    return found


def equations(
    plant: Plant, form: Transformed, parameters: tuple[str, ...]
) -> tuple[Observer, dict[str, Expression], Excitation | None]:
    """Equations of the observer, its estimates of theta, and what excites them."""
    xi = {c.name: Expression.variable(c.name) for c in form.coordinates}
    made, theta = Estimation(), {}
    if form.estimator and form.estimator.method == "proportional":
        K = form.estimator.K
        theta = {name: added([Expression.variable(f"zeta_{name}"), K[name]]) for name in parameters if name in K}
    elif form.estimator:
        made = estimation(form.estimator, xi, parameters)
        theta = made.theta
    full = corrected(form, theta)
    estimates = {**plant.measured(), **{name: side.substituted(full) for name, side in form.left_inverse.items()}}
    estimates = {name: estimates[name] for name in plant.dynamics}
    dynamics = {c.name: added([multiplied(c.rate, xi[c.name]), c.B.substituted(full)]) for c in form.coordinates}
    own = dict(made.dynamics)
    if form.estimator and form.estimator.method == "proportional":
        own |= proportional(plant, form.estimator, estimates, tuple(theta))
    require_own(plant, dynamics, own)
    dynamics |= own
    observer = Observer(dynamics, estimates, plant.inputs, tuple(plant.outputs), initial=made.initial)
    if not made.regressors or not form.estimator:
        return observer, theta, None
    rows = zip(form.estimator.regressions, made.regressors, strict=True)
    psi = tuple(dict(zip(regression.m, row, strict=True)) for regression, row in rows)
    return observer, theta, Excitation(psi, parameters, made.determinant, tuple(made.guarded.values()))


def require_own(plant: Plant, coordinates: Collection[str], own: Named) -> None:
    """Refuse a plant or coordinate that has the name of a state of the estimator."""
    taken = {*plant.dynamics, *plant.outputs, *plant.inputs, *coordinates}
    for name in own:
        if name in taken:
            said = f"{name} is the name of a state of the estimator; choose another name for the signal"
            raise UsageError(Problem(said, key="observer.estimator", id="OBS211"))


def corrected(form: Transformed, theta: Named) -> dict[str, Expression]:
    """Estimates of phi, by coordinate: xi, or xi + theta."""
    xi = {c.name: Expression.variable(c.name) for c in form.coordinates}
    return {name: added([side, theta[name]]) if name in theta else side for name, side in xi.items()}


def proportional(plant: Plant, estimator: Estimator, estimates: Named, names: Sequence[str]) -> dict[str, Expression]:
    """Zeta' = -dK/dy ydot(xhat, u): theta = zeta + K(y) stays where it is right, theta' = dK/dy (ydot - ydot(xhat))."""
    return {f"zeta_{name}": scaled(fmpq(-1), plant.driven(estimator.K[name], estimates)) for name in names}


def attraction(plant: Plant, form: Transformed, theta: Named) -> tuple[list[Statement], dict[str, str], list[str]]:
    """Statements that d = thetahat - theta of a proportional estimator obeys d' = lambda d with lambda < 0.

    With the names of those that give a rate, and what they say.
    """
    assert form.estimator
    d = {name: Expression.variable(f"δ_{name}") for name in theta}
    off = {c.name: added([c.phi, d[c.name]]) if c.name in d else c.phi for c in form.coordinates}
    states = {name: Expression.variable(name) for name in plant.dynamics}
    estimates = {**states, **{name: plant.on(side, off) for name, side in form.left_inverse.items()}}
    zero = dict.fromkeys((side.text for side in d.values()), ZERO)
    found: list[Statement] = []
    named, says = {}, []
    for i, name in enumerate(theta):
        K = form.estimator.K[name]
        moving = plant.on(less(plant.driven(K), plant.driven(K, estimates)))
        later = moving.substituted({f"δ_{other}": ZERO for other in list(theta)[:i]})
        rate = simplified(later.derivative(f"δ_{name}").substituted(zero))
        found += [*smooth(f"K of {name}", K), *plant.differentiable(K)]
        residual = less(later, multiplied(rate, d[name]))
        error = Identity(f"estimate of theta of {name}: d' = ({rate}) d", residual, f"whether {DECAYS}")
        named[f"theta of {name}"] = f"estimate of theta of {name}: {rate} < 0"
        found += [error, Negative(named[f"theta of {name}"], rate, given=(error,))]
        says.append(f"the error of the estimate of theta of {name} {decay(rate)}")
    return found, named, says


def still(plant: Plant, observer: Observer, theta: Named) -> list[Statement]:
    """Condition (*) of the unification: thetahat stands still along the observer, with the plant at its estimate.

    N_zeta M + N_xi B + N_y ydot(xhat, u) = 0 for all arguments. It is the hypothesis of Proposition 5 that {theta =
    thetahat} is invariant, read for every xi and zeta; (26) has it where xi = phi(x) only.
    """
    found: list[Statement] = []
    for name, side in theta.items():
        moves = [multiplied(slope(side, signal), rate) for signal, rate in observer.dynamics.items()]
        said = f"condition (*) for {name}: its estimate of theta stands still where xhat is right"
        found.append(Identity(said, added([plant.driven(side, observer.estimates), *moves])))
    return found


def recast(plant: Plant, form: Transformed, observer: Observer, theta: Named) -> Observer:
    """The observer of immersion and invariance with beta = xi + N, and Q the field of the observer itself (23)."""
    b = {c.name: Expression.variable(f"b{i + 1}") for i, c in enumerate(form.coordinates)}
    manifold = Immersion(
        chi=observer.states,
        phi=tuple(c.phi for c in form.coordinates),
        beta=tuple(corrected(form, theta).values()),
        left_inverse={name: side.substituted(b) for name, side in form.left_inverse.items()},
        dynamics=None,
        Q=tuple(observer.dynamics.values()),
    )
    return replace(observer, dynamics=by_default(plant, manifold, observer.estimates))
