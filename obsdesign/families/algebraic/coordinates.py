"""Observers in coordinates: Kazantzis-Kravaris-Luenberger, parameter-estimation-based, and both (Propositions 1 to 3).

xi' = lambda(y, u) xi + B(y, u),     phi(x)' = lambda(y, u) phi(x) + B(y, u)      (4)
xhat = phiL(xi + theta, y),          theta = phi(x) - xi constant where lambda = 0    (9), (10), (15)

Where lambda < 0 the error xi - phi(x) decays as exp(int lambda). In (41) the paper has lambda with the other sign.
"""

from collections.abc import Collection, Sequence
from dataclasses import asdict
from typing import Any

from flint import fmpq

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.families.algebraic.cascade import Cascade, Error
from obsdesign.families.algebraic.estimator import Estimation, assumed, estimation, excited, exponential, needed
from obsdesign.families.algebraic.forms import Coordinate, Estimator, Immersion, Transformed
from obsdesign.families.algebraic.high_gain import sensitivity
from obsdesign.families.algebraic.identity import Answer, Identity, Negative, Undecided
from obsdesign.families.algebraic.immersion import by_default
from obsdesign.families.algebraic.order import circle, circular, couplings, held, named, once, waits
from obsdesign.families.algebraic.scheme import (
    INVERTED,
    UNBOUNDED,
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
from obsdesign.records import dataclass, replace

UNUSED = "whether it matters, since xhat does not depend on it"
DIFFERENT = "whether the observer that is recast converges, for it is not that of the coordinates"
ANOTHER = "that the errors of the observer that is recast fall: it is another one than that of the coordinates"


@dataclass(frozen=True)
class Recast:
    """Entry of a result file on an observer that is recast."""

    holds: bool
    condition: str = "N_zeta M + N_xi B + N_y ydot(xhat, u) = 0 and phi_dot(xhat, u) = lambda xi + B for all arguments"


@dataclass(frozen=True)
class Moves:
    """What is proved of errors, and what they say."""

    statements: list[Statement]
    says: list[str]
    rates: dict[str, str]  # statement that gives the rate of a coordinate, by name
    open: list[str]  # couplings that are not proved to be bounded
    runs: tuple[str, ...] = ()  # what depends on a run
    need: str = ""  # what the estimates of constants need to converge


def scheme(plant: Plant, form: Transformed) -> Scheme:
    """What such an observer rests on, and its equations."""
    phi = {one.name: one.phi for one in form.coordinates}
    needed = used(form)
    unused = {c.name: "" if c.name in needed else UNUSED for c in form.coordinates}
    statements = [one for c in form.coordinates for one in coordinate(plant, c, phi, unused[c.name])]
    statements += inverses(plant, form.left_inverse, phi)
    parameters = tuple(c.name for c in form.coordinates if c.estimated)
    observer, theta, excitation = equations(plant, form, parameters)
    numbers: dict[str, Any] = {"coordinates": [described(c) for c in form.coordinates]}
    by_output = form.estimator is not None and form.estimator.method == "proportional"
    given = tuple(one for one in statements if isinstance(one, Identity))
    moves = proportionally(plant, form, theta, given) if by_output else regressively(plant, form, parameters)
    statements += moves.statements
    excitation = replace(excitation, need=moves.need) if excitation else None
    right = "the coordinates, theta included, are phi(x)" if theta else "the coordinates are phi(x)"
    exact = [f"xhat = x where {right}, {INVERTED}"] if form.left_inverse else []
    unbounded = [UNBOUNDED] if form.left_inverse else []
    says, rates = [*moves.says, *exact], moves.rates
    depends = [*moves.runs, *unbounded, *moves.open]
    if form.recast:
        conditions = [*still(plant, observer, theta), *same(plant, form, observer, theta)]
        holds = all(one.decided(plant.region).answer is Answer.PROVED for one in conditions)
        statements += conditions
        numbers["recast"] = asdict(Recast(holds))
        observer = recast(plant, form, observer, theta)
        says.append("the observer is one of immersion and invariance with beta = xi + theta")
        if not holds:
            says, rates, depends = [*exact, says[-1]], {}, [*depends, ANOTHER]
    return Scheme(tuple(statements), observer, numbers, tuple(says), tuple(depends), rates, excitation)


def used(form: Transformed) -> set[str]:
    """Coordinates on which xhat depends, by an estimator or not."""
    rows = form.estimator.regressions if form.estimator else ()
    constants = [c.name for c in form.coordinates if c.estimated]
    shown = (side.names for side in form.left_inverse.values())
    return waits(form, *set(constants).union(*shown, *(named(row) for row in rows)))


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


def decays(c: Coordinate) -> str:
    """Name of the statement that a coordinate decays."""
    return f"{c.name}: lambda = {c.rate} < 0"


def coordinate(plant: Plant, c: Coordinate, phi: Named, leaves: str) -> list[Statement]:
    """The partial differential equation of a coordinate, and the sign of its lambda; `leaves`: as of an `Identity`."""
    rate, B = plant.on(c.rate), plant.on(c.B, phi)
    residual = less(plant.along(c.phi), multiplied(rate, c.phi), B)
    name = f"{c.name}: d/dt ({c.phi}) = {c.B}" if c.estimated else f"{c.name}: d/dt ({c.phi}) = ({c.rate}) phi + {c.B}"
    found: list[Statement] = [Identity(name, residual, leaves)]
    if not c.estimated:
        found.append(Negative(decays(c), rate, leaves=leaves))
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


def attraction(plant: Plant, form: Transformed, theta: Named, given: tuple[Identity, ...]) -> Cascade:
    """How the errors of a proportional estimator move, those of the coordinates too.

    Of xi + thetahat: d' = lambda d + B(phi + d) - B(phi) + dK/dy (ydot(x) - ydot(xhat)).
    """
    assert form.estimator
    phi = {c.name: c.phi for c in form.coordinates}
    d = {c.name: Expression.variable(f"δ_{c.name}") for c in form.coordinates}
    off = {name: added([side, d[name]]) for name, side in phi.items()}
    states = {name: Expression.variable(name) for name in plant.dynamics}
    estimates = {**states, **{name: plant.on(side, off) for name, side in form.left_inverse.items()}}
    errors = {}
    for c in form.coordinates:
        moving = [multiplied(plant.on(c.rate), d[c.name]), less(plant.on(c.B, off), plant.on(c.B, phi))]
        what = f"estimate of theta of {c.name}" if c.name in theta else f"error of {c.name}"
        if c.name in theta:
            K = form.estimator.K[c.name]
            moving.append(plant.on(less(plant.driven(K), plant.driven(K, estimates))))
        name = f"the error of the {what}" if c.name in theta else f"the {what}"
        errors[d[c.name].text] = Error(name, what, what, added(moving))
    return Cascade(plant, errors, sensitivity(plant, form.left_inverse, phi), given)


def proportionally(plant: Plant, form: Transformed, theta: Named, given: tuple[Identity, ...]) -> Moves:
    """What is proved of the errors of coordinates and of a proportional estimator; `given`: without it, nothing."""
    assert form.estimator
    K = form.estimator.K
    found = [one for name in theta for one in (*smooth(f"K of {name}", K[name]), *plant.differentiable(K[name]))]
    says = [said(c) + once(waits(form, *c.B.names)) for c in form.coordinates if c.estimated]
    rates: dict[str, str] = {}
    open_: list[str] = []
    for block in attraction(plant, form, theta, given).blocks():
        own, before = ([name.removeprefix("δ_") for name in names] for names in (block.own, block.before))
        single = next((c for c in form.coordinates if own == [c.name] and not c.estimated), None)
        says.append((said(single) if single else block.said) + once(before))
        found += () if single else block.statements
        if len(own) == 1 and not before:
            rates |= {own[0]: decays(single)} if single else {f"theta of {own[0]}": block.rate}
        open_ += block.open
    return Moves(found, says, rates, open_)


def regressively(plant: Plant, form: Transformed, parameters: Sequence[str]) -> Moves:
    """What is proved of the errors of coordinates, and of regressions where there is an estimator."""
    path = circle(form)
    says = [said(c) + once(waits(form, *c.B.names), c.name in path) for c in form.coordinates]
    rates = {c.name: decays(c) for c in form.coordinates if not c.estimated and not waits(form, *c.B.names)}
    if not form.estimator:
        return Moves([], says, rates, couplings(plant, form))
    found = regressions(plant, form.estimator, form.coordinates)
    before = set().union(*(held(form, each) for each in form.estimator.regressions))
    says.append(regressed(form.estimator) + once(before, bool(path)))
    need = needed(form.estimator, parameters, sorted(before))
    lowest = assumed(form.estimator, parameters)
    converge = f"that the estimates of theta of {', '.join(parameters)} converge, {excited(need)}"
    found += [Undecided(circular(path))] if path else []
    return Moves(found, says, rates, couplings(plant, form), (converge, *lowest), "; ".join([need, *lowest]))


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


def same(plant: Plant, form: Transformed, observer: Observer, theta: Named) -> list[Statement]:
    """Whether d/dt phi(xhat) is what each coordinate does: otherwise the observer that is recast is another one.

    Of xhat = phiL(xi + theta, y) this is so if phi(xhat) is xi + theta, whatever these are.
    """
    full, found = corrected(form, theta), list[Statement]()
    for c in form.coordinates:
        moves = added([multiplied(c.rate, full[c.name]), c.B.substituted(full)])
        residual = less(moves, plant.along(c.phi).substituted(observer.estimates))
        found.append(Identity(f"recast: d/dt ({c.phi}) at xhat is that of {c.name}", residual, DIFFERENT))
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
