"""Observers for sporadic measurements: (4) of Ferrante et al. (2019), which holds its output error, and a reset."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from obsdesign.dissipation.analysis import Errors
from obsdesign.dissipation.bounds import ends
from obsdesign.expressions import Expression
from obsdesign.expressions.bernstein import bernstein
from obsdesign.families.guarantee import SampledGuarantee
from obsdesign.families.observer import Copy, Observer
from obsdesign.families.sporadic.clock.theorem import error_system
from obsdesign.families.sporadic.clock.truth import truth
from obsdesign.families.sporadic.periodic import Periodic
from obsdesign.families.sporadic.request import request_of
from obsdesign.lmi.formula import Array, Exact, identity, in_floats, printed
from obsdesign.model.equations import free, linear, total, weighted
from obsdesign.spec import Spec


def observer(spec: Spec, gains: Mapping[str, Array]) -> Observer:
    """Observer of a spec, for T1 and the least T2 that it asks for; see `holding`, `resetting`, `adapting`."""
    if "K_of_gap" in gains:
        made = adapting(spec, printed(gains["knots"]), printed(gains["K_of_gap"]))
    else:
        made = resetting(spec, printed(gains["K"])) if "K" in gains else holding(spec, gains)
    return replace(made, intervals=intervals(spec))


def holding(spec: Spec, gains: Mapping[str, Array]) -> Observer:
    """Observer with the gains L (n, ny) and H (ny, ny).

    zhat'  = A zhat + Bf f(t, u, qhat) + gx + L theta,    qhat = Cq zhat + gq
    theta' = H theta
    theta+ = y - yhat     at a measurement,               yhat = C zhat + gy

    Raises `UsageError` if a nonlinearity has no f.
    """
    L, H = (printed(gains[name]) for name in ("L", "H"))
    plant = spec.equations(spec.augmented)
    copy, taken = Copy.of(plant), set(plant.signals)
    theta = [free(f"theta_{name}", taken) for name in plant.outputs]
    eye = identity(len(theta), L)
    innovation = linear(np.hstack([eye, -eye]), (*plant.outputs, *copy.outputs))
    return Observer(
        dynamics={
            **copy.corrected(copy.dynamics, L, theta),
            **dict(zip(theta, linear(H, theta), strict=True)),
        },
        estimates={copy.twins[name]: Expression.variable(name) for name in copy.dynamics},
        inputs=spec.inputs,
        outputs=tuple(plant.outputs),
        algebraic={**copy.algebraic, **copy.outputs},
        jump=dict(zip(theta, innovation, strict=True)),
        twins=copy.twins,
    )


def resetting(spec: Spec, K: Exact) -> Observer:
    """Observer with the gain K (n, ny).

    zhat'  = A zhat + Bf f(t, u, qhat) + gx,    qhat = Cq zhat + gq
    zhat+  = zhat + K (y - yhat)     at a measurement,               yhat = C zhat + gy

    Raises `UsageError` if a nonlinearity has no f.
    """
    plant = spec.equations(spec.augmented)
    copy = Copy.of(plant)
    states = {name: Expression.variable(name) for name in copy.dynamics}
    return Observer(
        dynamics=copy.dynamics,
        estimates={copy.twins[name]: state for name, state in states.items()},
        inputs=spec.inputs,
        outputs=tuple(plant.outputs),
        algebraic={**copy.algebraic, **copy.outputs},
        jump=copy.corrected(states, np.hstack([K, -K]), (*plant.outputs, *copy.outputs)),
        twins=copy.twins,
    )


def adapting(spec: Spec, knots: Array, K: Array) -> Observer:
    """Observer with a gain K(s) that depends on the time s since the measurement before, or since t = 0.

    zhat'  = A zhat + Bf f(t, u, qhat) + gx,    qhat = Cq zhat + gq
    zhat+  = zhat + K(s) (y - yhat)     at a measurement,            yhat = C zhat + gy

    `knots`: (N + 1,), s, exact; `K`: control values of its Bernstein form, (N, d + 1, n, ny), exact. Before the first
    knot and beyond the last K is that of the knot.

    Raises `UsageError` if a nonlinearity has no f.
    """
    made = resetting(spec, K[0, 0])
    taken = {*made.dynamics, *made.algebraic, *made.inputs, *made.outputs, "t"}
    gap = free("gap", taken)
    weights = bernstein(gap, knots.tolist(), K.shape[1] - 1)
    places = [free(f"weight{j + 1}", taken) for j in range(len(weights))]
    innovations = [free(f"innovation_{y}", taken) for y in made.outputs]
    hats = [hat for y in made.outputs for hat, twin in made.twins.items() if twin == y]
    eye = identity(len(hats), K[0, 0])
    parts = [Expression.variable(w) * Expression.variable(r) for w in places for r in innovations]
    corrections = weighted(np.hstack([*K.reshape(-1, *K.shape[2:])]), parts)
    states = [Expression.variable(name) for name in made.dynamics]
    return replace(
        made,
        jump=dict(zip(made.dynamics, total(states, corrections), strict=True)),
        received={
            **dict(zip(places, weights, strict=True)),
            **dict(zip(innovations, linear(np.hstack([eye, -eye]), (*made.outputs, *hats)), strict=True)),
        },
        gap=gap,
    )


def sampled(spec: Spec, gains: Mapping[str, Array], guarantee: SampledGuarantee | None) -> Periodic:
    """Error systems between two measurements: (e, theta)' = [A, -L; 0, H] (e, theta), or e' = A e.

    Intervals are those of the guarantee, or the least that is asked for.
    """
    p, eye = spec.augmented.doubles, np.eye(spec.augmented.n)
    T1, T2 = (guarantee.T1, guarantee.T2) if guarantee else intervals(spec)
    if "L" not in gains:
        K = gains["K"] if "K" in gains else np.stack([gains["K_of_gap"][0, 0], gains["K_of_gap"][-1, -1]])
        J, Jn = eye - K @ p.C, -K
        return Periodic(**vars(Errors.of(p, spec.multiplier, in_floats(spec.H))), J=J, Jn=Jn, T1=T1, T2=T2)
    L, H = gains["L"], gains["H"]
    n, ny = L.shape
    below, beside = ((0, ny), (0, 0)), ((0, 0), (0, ny))
    flow = replace(
        p,
        A=np.block([[p.A, -L], [np.zeros((ny, n)), H]]),
        B=np.pad(p.B, below),
        Bf=np.pad(p.Bf, below),
        C=np.pad(p.C, beside),
        Cq=np.pad(p.Cq, beside),
    )
    J, Jn = np.vstack([eye, p.C]), np.vstack([np.zeros((n, ny)), np.eye(ny)])
    errors = Errors.of(flow, spec.multiplier, np.pad(in_floats(spec.H), beside))
    return Periodic(**vars(errors), J=J, Jn=Jn, T1=T1, T2=T2)


def beside(spec: Spec, gains: Mapping[str, Array], guarantee: SampledGuarantee | None) -> dict[str, Any]:
    """Entry `truth` of `analysis`, what no claim can be better than; see `truth`. Empty where nothing is known.

    Intervals are those of the guarantee, or the least that is asked for, and so is the rate.
    """
    T1, T2 = (guarantee.T1, guarantee.T2) if guarantee else intervals(spec)
    if "K_of_gap" in gains:
        return {}  # J is not one matrix
    decay = guarantee.decay if guarantee else float(ends(request_of(spec).decay)[0])
    error = error_system(spec.augmented.doubles, in_floats(spec.H), gains)
    members = Errors.of(spec.augmented, spec.multiplier, spec.H).through
    found = truth(error, members, T1, T2, decay)
    return {"truth": found} if found else {}


def intervals(spec: Spec) -> tuple[float, float]:
    """T1 and T2 that a spec asks for, s; the least T2 of a range."""
    request = request_of(spec)
    T1, T2 = float(request.T1), float(ends(request.T2)[0])
    return T1, max(T2, T1)
