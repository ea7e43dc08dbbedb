"""The observer (12) of Corless and Chakrabarty (2019): a copy of the plant with two injections."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from obsdesign.dissipation.analysis import Errors
from obsdesign.dissipation.modes import modes
from obsdesign.expressions import Expression
from obsdesign.families.observer import Copy, Observer, injected
from obsdesign.lmi.formula import Array, printed
from obsdesign.model.ahead import ahead
from obsdesign.model.disturbance import with_inputs
from obsdesign.model.equations import Equations, Named, free, linear
from obsdesign.model.filtered import channels
from obsdesign.spec import Spec


def observer(spec: Spec, gains: Mapping[str, Array]) -> Observer:
    """Observer with the gains L1 (n + nm, ny) and L2 (nq, ny), which multiply yhat - y.

    xihat' = A xihat + Bf f(t, y, qhat) + gx + L1 (yhat - y),    in discrete time xihat+ = ..
    qhat   = Cq xihat + Dqf f(t, y, qhat) + gq + L2 (yhat - y)
    yhat   = C xihat + Df f(t, y, qhat) + gy
    what   = Cm xmhat + Dwf f2, where no v enters w directly, or pinv(B) L1 (yhat - y) where the spec asks for it

    Filtered estimates, which know the y of their sample, see `waiting`.

    Raises `UsageError` if a nonlinearity has no f.
    """
    L1, L2 = (printed(gains[name]) for name in ("L1", "L2"))
    outputs = spec.plant.outputs
    plant = spec.equations(with_inputs(spec.augmented, spec.generator, spec.reserved))
    copy = Copy.of(plant)
    sides = list(copy.outputs.items())
    y, w = dict(sides[: len(outputs)]), dict(sides[len(outputs) :])
    copy, beside = replace(copy, outputs=y), dict[str, Expression]()
    measured, following = outputs, tuple[str, ...]()
    if spec.observer.filtered:
        copy, beside = waiting(copy, plant)
        measured = tuple(map(ahead, outputs))
        following = (*map(ahead, ("t", *spec.inputs)), *measured)
    copy = injected(copy, L1, L2, measured)
    states = {copy.twins[name]: Expression.variable(name) for name in list(copy.dynamics)[: spec.plant.n]}
    modeled = zip(spec.plant.exogenous, w.values(), spec.generator.Dm, strict=True)
    of_w = (
        reconstructed(spec, gains["L1"], tuple(y))
        if spec.observer.reconstruct
        else {name: side for name, side, direct in modeled if not (direct != 0).any()}
    )
    return Observer(
        dynamics=copy.dynamics,
        estimates={**states, **of_w},
        inputs=spec.inputs,
        outputs=outputs,
        algebraic={**copy.algebraic, **beside, **copy.outputs},
        twins={name: twin for name, twin in copy.twins.items() if name not in w},
        following=following,
    )


def waiting(copy: Copy, plant: Equations) -> tuple[Copy, dict[str, Expression]]:
    """Copy that waits for the y of the next sample, and its prediction xibar of the state there.

    xibar  = A xihat + Bf f(t, y, qhat) + gx
    yhat   = C xibar + gy+
    xihat+ = xibar + L1 (yhat - y+)
    qhat   = Cq xihat + Dqf f(t, y, qhat) + gq + L2 (yhat - y+)
    """
    taken = {*plant.signals, *copy.twins}
    bars = {hat: free(f"bar_{copy.twins[hat]}", taken) for hat in copy.dynamics}
    predicted = {hat: Expression.variable(bar) for hat, bar in bars.items()}
    known = {name: Expression.variable(ahead(name)) for name in ("t", *plant.inputs)}
    outputs = {name: side.substituted({**predicted, **known}) for name, side in copy.outputs.items()}
    twins = {bar: ahead(copy.twins[hat]) for hat, bar in bars.items()}
    twins |= {name: ahead(copy.twins[name]) for name in outputs}
    return (
        replace(copy, dynamics=predicted, outputs=outputs, twins={**copy.twins, **twins}),
        {bars[hat]: side for hat, side in copy.dynamics.items()},
    )


def errors(spec: Spec, gains: Mapping[str, Array]) -> Errors:
    """Error systems of the observer."""
    taken = channels(spec.augmented) if spec.observer.filtered else None
    time = {"modes": modes(spec.period), "channels": taken}
    return Errors.of(spec.posed, spec.multiplier, spec.H, gains["L1"], gains["L2"], **time)


def reconstructed(spec: Spec, L1: Array, estimates: tuple[str, ...]) -> Named:
    """Return what = pinv(B) L1 (yhat - y), given the names of yhat."""
    K = printed(np.linalg.pinv(spec.plant.doubles.B) @ L1)
    sides = linear(np.hstack([K, -K]), (*estimates, *spec.plant.outputs))
    return dict(zip(spec.plant.exogenous, sides, strict=True))
