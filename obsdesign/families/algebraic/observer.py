"""Equations of an observer without an LMI, as it runs, and where it begins."""

from collections.abc import Mapping
from dataclasses import replace

from flint import fmpq

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.families.algebraic.claim import Claim
from obsdesign.families.algebraic.estimator import exponential
from obsdesign.families.algebraic.forms import Form, Immersion, Transformed
from obsdesign.families.algebraic.immersion import on_manifold
from obsdesign.families.algebraic.scheme import Plant, less
from obsdesign.families.observer import Observer
from obsdesign.lmi.formula import printed
from obsdesign.spec import Spec
from obsdesign.trial import Simulation


def observer(spec: Spec, form: Form) -> Observer:
    """Observer of a form, from the coordinates and constants with which a simulation begins.

    Raises `UsageError`: the simulation names a coordinate that there is none of.
    """
    claim = Claim.of(spec, form)
    made = replace(claim.scheme.observer, proved=claim.holds)
    made = replace(made, located=located(spec, form, {name: Expression.variable(name) for name in spec.plant.states}))
    if spec.simulation is None:
        return made
    begin = {**begins(spec, form), **{name: Expression.number(e) for name, e in spec.simulation.xi0.items()}}
    states = [name for name in made.states if name not in made.twins]
    if isinstance(form, Transformed):
        states = [c.name for c in form.coordinates]
    elif isinstance(form, Immersion):
        states = list(form.chi)
    require_known(spec.simulation.xi0, states, "xi0")
    return replace(made, initial={**made.initial, **begin, **constants(spec.simulation, form)})


def begins(spec: Spec, form: Form) -> dict[str, Expression]:
    """Coordinates of an estimate xhat0 that is not 0, by name; see `located`."""
    assert spec.simulation
    if not spec.simulation.xhat0.any():
        return {}
    xhat0 = map(Expression.number, printed(spec.simulation.xhat0))
    return located(spec, form, dict(zip(spec.plant.states, xhat0, strict=True)))


def located(spec: Spec, form: Form, estimate: Mapping[str, Expression]) -> dict[str, Expression]:
    """Coordinates phi(xhat) of an estimate, by name, the states that outputs show as measured.

    None where a copy of the plant begins there by itself, and where beta(y, chi) = phi(xhat) is not solved for chi.
    """
    assert spec.typed
    plant = Plant.of(spec.typed)
    known = {**estimate, **plant.measured()}
    if isinstance(form, Immersion):
        return on_manifold(form, known)
    phi = {c.name: c.phi for c in form.coordinates} if isinstance(form, Transformed) else form.states or {}
    return {name: side.substituted(known) for name, side in phi.items()}


def beginning(spec: Spec, form: Form) -> dict[str, str]:
    """What a run says of an estimate xhat0 that is not 0, as `start` of its summary."""
    assert spec.simulation
    copies = not isinstance(form, Transformed | Immersion) and form.states is None
    if copies or not spec.simulation.xhat0.any():
        return {}
    if not (names := begins(spec, form)):
        return {"start": "xhat0 has no effect: beta = phi(xhat0) is not solved for chi; name chi in simulation.xi0"}
    begun = [name for name in names if name not in spec.simulation.xi0]
    if not begun:
        return {"start": "xhat0 has no effect: simulation.xi0 says where every coordinate begins"}
    said = "at the estimate xhat0, in which states that outputs show are as they are measured"
    return {"start": f"{', '.join(begun)} {said}"}


def constants(simulation: Simulation, form: Form) -> dict[str, Expression]:
    """Where the estimates of theta begin: at theta, or at exp(theta); zeta at theta - K(y)."""
    if not isinstance(form, Transformed) or form.estimator is None:
        require_known(simulation.constants, [], "theta0")
        return {}
    estimator, estimated = form.estimator, [c.name for c in form.coordinates if c.estimated]
    require_known(simulation.constants, estimated, "theta0")
    found: dict[str, Expression] = {}
    for name in estimated:
        theta = Expression.number(simulation.constants.get(name, fmpq(0)))
        if estimator.method == "proportional":
            found[f"zeta_{name}"] = less(theta, estimator.K[name])
        elif name in estimator.powers and estimator.method != "log-gradient":
            found[f"theta_{name}"] = exponential(theta)
        else:
            found[f"theta_{name}"] = theta
    return found


def require_known(given: object, names: list[str], key: str) -> None:
    """Refuse the name of a coordinate that there is none of."""
    for name in given if isinstance(given, dict) else ():
        if name not in names:
            said = f"{name} is no coordinate here; allowed: {', '.join(names) or 'none'}"
            raise UsageError(Problem(said, key=f"simulation.{key}.{name}", id="OBS203"))
