"""The unknown-input observer as equations: its states xi follow T x, and y is in its estimates at once."""

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np
from flint import fmpq

from obsdesign.dissipation.analysis import Errors
from obsdesign.expressions import Expression
from obsdesign.families.observer import Copy, Observer
from obsdesign.families.unknown_input import transform
from obsdesign.families.unknown_input.errors import errors as errors_of
from obsdesign.families.unknown_input.request import factor
from obsdesign.lmi.formula import Array, Exact, in_floats, printed
from obsdesign.model.equations import free, linear
from obsdesign.spec import Spec


def exact(spec: Spec, E: Array) -> Exact:
    """E in rationals: that of the spec, where its doubles are these, or else the decimals that print them."""
    known = factor(spec)
    return known if known is not None and np.array_equal(in_floats(known), in_floats(E)) else printed(E)


def observer(spec: Spec, gains: Mapping[str, Array]) -> Observer:
    """Observer with E (n, ny) and L (n, ny), which multiplies y - yhat.

    xi'  = T (A xhat + Bf f(t, y, qhat) + gx) + L (y - yhat),    in discrete time xi+ = ..
    xhat = xi + E (y - gy),    xi(0) = T xhat0
    qhat = Cq xhat + Dqf f(t, y, qhat) + gq
    yhat = C xhat + Df f(t, y, qhat) + gy

    Raises `UsageError` if a nonlinearity has no f.
    """
    E, L = exact(spec, gains["E"]), printed(gains["L"])
    T, x, y = transform.projector(spec.augmented, E), spec.plant.states, spec.plant.outputs
    plant = spec.equations(spec.augmented)
    copy = Copy.of(plant)
    taken = {*plant.signals, *copy.twins}
    names = [free(f"xi_{name}", taken) for name in x]
    hats = list(copy.dynamics)
    residual = (*y, *copy.outputs)
    moved = [[*zip(row, copy.dynamics.values(), strict=True)] for row in T]
    sides = [
        collected([*pairs, (fmpq(1), side)])
        for pairs, side in zip(moved, linear(np.hstack([L, -L]), residual), strict=True)
    ]
    seen = [[*zip(row, map(Expression.variable, y), strict=True), *zip(-row, spec.gy, strict=True)] for row in E]
    estimates = {
        hat: collected([(fmpq(1), Expression.variable(xi)), *pairs])
        for hat, xi, pairs in zip(hats, names, seen, strict=True)
    }
    follows = dict(zip(names, linear(T, x), strict=True))
    start = (
        {}
        if spec.simulation is None or not spec.simulation.xhat0.any()
        else dict(zip(names, map(Expression.number, T @ printed(spec.simulation.xhat0)), strict=True))
    )
    return Observer(
        dynamics=dict(zip(names, sides, strict=True)),
        estimates={name: Expression.variable(hat) for name, hat in zip(x, hats, strict=True)},
        inputs=spec.inputs,
        outputs=y,
        algebraic={**estimates, **copy.algebraic, **copy.outputs},
        initial=start,
        located=follows,
        follows=follows,
        twins=copy.twins,
    )


def collected(pairs: Sequence[tuple[fmpq, Expression]]) -> Expression:
    """Linear combination of expressions, each term of them once."""
    found: defaultdict[Expression, fmpq] = defaultdict(fmpq)
    for weight, side in pairs:
        for c, term in side.summands() if weight != 0 else ():
            found[term] += weight * c
    kept = {term: c for term, c in found.items() if c != 0}
    return Expression.combination([*kept.values()], [*kept])


def errors(spec: Spec, gains: Mapping[str, Array]) -> Errors:
    """Error systems of the observer."""
    return errors_of(spec, exact(spec, gains["E"]), gains)
