"""Observers in coordinates: Kazantzis-Kravaris-Luenberger, parameter-estimation-based, and both (Propositions 1 to 3).

xi' = lambda(y, u) xi + B(y, u),     phi(x)' = lambda(y, u) phi(x) + B(y, u)      (4)
xhat = phiL(xi + theta, y),          theta = phi(x) - xi constant where lambda = 0    (9), (10), (15)

Where lambda < 0 the error xi - phi(x) decays as exp(int lambda). In (41) the paper has lambda with the other sign.
"""

from collections.abc import Sequence
from typing import Any

from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.families.algebraic.estimator import Estimation, estimation, exponential
from obsdesign.families.algebraic.identity import Identity, Negative
from obsdesign.families.algebraic.request import Coordinate, Estimator, Transformed
from obsdesign.families.algebraic.scheme import (
    Nonzero,
    Plant,
    Scheme,
    Statement,
    added,
    inverses,
    less,
    multiplied,
    scaled,
)
from obsdesign.families.observer import Observer


def scheme(plant: Plant, form: Transformed) -> Scheme:
    """What such an observer rests on, and its equations."""
    phi = {one.name: one.phi for one in form.coordinates}
    statements: list[Statement] = [one for c in form.coordinates for one in coordinate(plant, c, phi)]
    statements += inverses(plant, form.left_inverse, phi)
    parameters = tuple(c.name for c in form.coordinates if c.estimated)
    if form.estimator:
        statements += regressions(plant, form.estimator, form.coordinates)
    observer = equations(plant, form, parameters)
    rates = {c.name: decays(c) for c in form.coordinates if not c.estimated}
    says = [f"{c.name} - ({c.phi}) decays at least as fast as its rate" for c in form.coordinates if not c.estimated]
    says += [f"({c.phi}) - {c.name} is constant" for c in form.coordinates if c.estimated]
    says += ["the left inverse gives x"] if form.left_inverse else []
    if form.estimator and form.estimator.regressions:
        exact = "exactly" if form.estimator.consistent else "up to an error that decays with the filters"
        says.append(f"Y = psi theta {exact}")
    depends = []
    if parameters and form.estimator and form.estimator.method != "proportional":
        depends.append(f"convergence to theta of {', '.join(parameters)} needs excitation, which a run reports")
    numbers: dict[str, Any] = {"coordinates": [described(c) for c in form.coordinates]}
    return Scheme(tuple(statements), observer, numbers, tuple(says), tuple(depends), rates)


def described(c: Coordinate) -> dict[str, Any]:
    """Entry of a result file."""
    return {"name": c.name, "phi": c.phi.text, "lambda": c.rate.text, "B": c.B.text}


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
    for side in (c.rate, c.B):
        found += [Nonzero(f"{c.name}: {d} is not 0", plant.on(d, phi)) for d in side.divisors()]
    return found


def regressions(plant: Plant, estimator: Estimator, coordinates: Sequence[Coordinate]) -> list[Statement]:
    """d(output)/dt = known + sum m theta, for every theta: xi is phi - theta where lambda = 0, and phi elsewhere."""
    theta = {c.name: Expression.variable(f"theta_{c.name}") for c in coordinates if c.estimated}
    xi = {c.name: less(c.phi, theta[c.name]) if c.estimated else c.phi for c in coordinates}
    value = {name: exponential(t) if name in estimator.powers else t for name, t in theta.items()}
    found: list[Statement] = []
    for k, each in enumerate(estimator.regressions, start=1):
        sides = [multiplied(plant.on(m, xi), value[name]) for name, m in each.m.items()]
        residual = less(plant.along(plant.outputs[each.output]), plant.on(each.known, xi), *sides)
        terms = " + ".join(f"({m}) {'exp(theta)' if n in estimator.powers else 'theta'}" for n, m in each.m.items())
        found.append(Identity(f"regression {k}: d/dt {each.output} = {each.known} + {terms}", residual))
    return found


def equations(plant: Plant, form: Transformed, parameters: tuple[str, ...]) -> Observer:
    """Equations of the observer: the coordinates, the estimator and the estimates."""
    xi = {c.name: Expression.variable(c.name) for c in form.coordinates}
    theta: dict[str, Expression] = {}
    made = Estimation()
    if form.estimator and form.estimator.method == "proportional":
        theta = {
            name: added([Expression.variable(f"zeta_{name}"), form.estimator.K[name]])
            for name in parameters
            if name in form.estimator.K
        }
    elif form.estimator:
        estimates = {c.name: xi[c.name] for c in form.coordinates}
        made = estimation(form.estimator, estimates, parameters)
        theta = made.theta
    full = {name: added([side, theta[name]]) if name in theta else side for name, side in xi.items()}
    estimates = {**plant.measured(), **{name: side.substituted(full) for name, side in form.left_inverse.items()}}
    estimates = {name: estimates[name] for name in plant.dynamics}
    dynamics = {c.name: added([multiplied(c.rate, xi[c.name]), c.B.substituted(full)]) for c in form.coordinates}
    dynamics |= made.dynamics
    if form.estimator and form.estimator.method == "proportional":
        dynamics |= proportional(plant, form.estimator, estimates, tuple(theta))
    return Observer(dynamics, estimates, plant.inputs, tuple(plant.outputs), initial=made.initial)


def proportional(
    plant: Plant, estimator: Estimator, estimates: dict[str, Expression], names: tuple[str, ...]
) -> dict[str, Expression]:
    """Zeta' = -dK/dy ydot(xhat, u): theta = zeta + K(y) stays where it is right, theta' = dK/dy (ydot - ydot(xhat))."""
    rates = {y: plant.along(h).substituted(estimates) for y, h in plant.outputs.items()}
    return {
        f"zeta_{name}": scaled(
            fmpq(-1), added([multiplied(estimator.K[name].derivative(y), rate) for y, rate in rates.items()])
        )
        for name in names
    }
