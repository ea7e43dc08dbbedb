"""Equations of an observer without an LMI, as it runs, and where it begins."""

from dataclasses import replace

from flint import fmpq

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.families.algebraic.claim import Claim
from obsdesign.families.algebraic.estimator import exponential
from obsdesign.families.algebraic.forms import Form, Immersion, Transformed
from obsdesign.families.algebraic.scheme import less
from obsdesign.families.observer import Observer
from obsdesign.spec import Simulation, Spec


def observer(spec: Spec, form: Form) -> Observer:
    """Observer of a form, from the coordinates and constants with which a simulation begins.

    Raises `UsageError`: the simulation names a coordinate that there is none of.
    """
    claim = Claim.of(spec, form)
    made = replace(claim.scheme.observer, proved=claim.holds)
    if spec.simulation is None:
        return made
    begin = {name: Expression.number(value) for name, value in spec.simulation.xi0.items()}
    states = [name for name in made.states if name not in made.twins]
    if isinstance(form, Transformed):
        states = [c.name for c in form.coordinates]
    elif isinstance(form, Immersion):
        states = list(form.chi)
    require_known(spec.simulation.xi0, states, "xi0")
    return replace(made, initial={**made.initial, **begin, **constants(spec.simulation, form)})


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
