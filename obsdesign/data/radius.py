"""What is proved of the error of each estimate along a log, from bounds on |v| and on the errors at its start."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.design import Design
from obsdesign.families import FAMILIES
from obsdesign.families.guarantee import Rates, Steps
from obsdesign.lmi.formula import Array, Exact, Float, approximate, identity
from obsdesign.model.filtered import gain_of
from obsdesign.spec import Spec
from obsdesign.trial import Recorded

OUTWARD = 1 + 1e-9  # rounding of what is computed in doubles here


@dataclass(frozen=True)
class Radius:
    """Bounds |error| <= reach sqrt(V(t)), with V(t) <= left(t - t0) V(0) + c |v|^2 (1 - left(t - t0)) / dampened.

    dampened is 2 alpha, or 1 - rho^2 of samples; where it is 0, V grows by c |v|^2 in a unit of time.
    """

    names: tuple[str, ...]  # of estimates
    reach: Float
    rates: Rates | Steps
    start: float  # V(0)
    v2: float  # |v|^2
    premise: str  # under which they hold

    def along(self, since: Float) -> Float:
        """Radii at times since the start of the log, s: (K, names)."""
        left, lost = self.rates.left(since), float(approximate(self.rates.dampened))
        unit = self.rates.period if isinstance(self.rates, Steps) else 1.0
        grown = (1 - left) / lost if lost else np.round(since / unit) if unit != 1 else since / unit
        V = left * self.start + self.rates.c * self.v2 * grown
        return np.asarray(np.sqrt(V)[:, None] * self.reach * OUTWARD)


def radius(design: Design, where: Recorded, estimates: Sequence[str]) -> Radius | str:
    """Radii of the estimates of a design on a log, or why there are none."""
    guarantee, spec = design.guarantee, design.spec
    if guarantee is None:
        return "nothing is proved of these gains"
    if FAMILIES[spec.observer.type].sampled or FAMILIES[spec.observer.type].equations:
        return f"no bound that holds for all times is proved of type {spec.observer.type}"
    states = (*spec.plant.states, *spec.model_states)
    if where.v_sup is None or (missing := [name for name in states if name not in where.e0]):
        what = "v_sup" if where.v_sup is None else f"e0 of {', '.join(missing)}"
        return f"data: {{{what}}} is not given"
    if why := uncovered(spec):
        return why
    rates, rows = guarantee.rates(), outputs(spec, estimates)
    v2 = float(where.v_sup) ** 2 * (float(gain_of(spec.augmented, peaks=True)) if spec.observer.filtered else 1.0)
    if spec.continuous is not None and spec.continuous.defect:
        v2 += 1.0  # the defect, as a channel of length 1
    names = tuple(rows)
    H = np.array([rows[name] for name in names], dtype=object).reshape(len(names), len(states))
    P: Any = guarantee.P  # type: ignore[attr-defined]
    e0 = np.array([float(where.e0[name]) for name in states])
    return Radius(names, np.asarray(guarantee.reach(H)), rates, largest(P, e0), v2, premise(spec))


def largest(P: Exact, e0: Float) -> float:
    """Bound on e' P e over the errors with |e_i| <= e0_i."""
    sizes = np.abs(np.vectorize(approximate, otypes=[float])(P))
    return float(e0 @ sizes @ e0) * OUTWARD


def outputs(spec: Spec, estimates: Sequence[str]) -> dict[str, Array]:
    """Row over (x, xm) of the error of each estimate that is a function of these."""
    n, size = spec.plant.n, len(spec.plant.states) + len(spec.model_states)
    eye, found = identity(size, np.zeros(0, dtype=object)), dict[str, Array]()
    for name, row in zip(spec.plant.states, eye, strict=False):
        found[name] = row
    modeled = zip(spec.plant.exogenous, spec.generator.Cm, spec.generator.Dm, spec.generator.Dwf, strict=True)
    for name, row, *direct in modeled:
        if not spec.observer.reconstruct and not any((part != 0).any() for part in direct):
            found[name] = np.concatenate([np.full(n, fmpq(0), dtype=object), row])
    return {name: row for name, row in found.items() if name in estimates}


def uncovered(spec: Spec) -> str:
    """Why what is proved says nothing of a log, or nothing."""
    if spec.continuous is not None and spec.continuous.defect is None:
        return "nothing is proved of the continuous plant: give discretise a defect"
    if spec.period is not None:
        return ""
    if spec.implementation is not None:
        said = "no bound on the error is proved of the steps of an implementation"
        return f"{said}; leave it out, or take a plant in samples"
    p = spec.posed.doubles
    kernel = null_space(np.vstack([p.B, p.Dq]))
    reached = p.D @ kernel
    if np.linalg.matrix_rank(reached) < len(p.C):
        loose = [y for y, row in zip(spec.plant.outputs, reached, strict=True) if not row.any()] or spec.plant.outputs
        said = f"what y does between rows is no noise that the spec gives {', '.join(loose)}"
        return f"{said}: it takes a channel of its own in D, or a plant in samples"
    return ""


def null_space(M: Float) -> Float:
    """Orthonormal columns that M takes to 0."""
    if not len(M):
        return np.eye(M.shape[1])
    _, sizes, V = np.linalg.svd(M)
    rank = int((sizes > 1e-12 * max(sizes.max(initial=0.0), 1e-300)).sum())
    return np.asarray(V[rank:].T)


def premise(spec: Spec) -> str:
    """What has to be true of a log for the radii to hold."""
    said = "|v| <= v_sup at all times, errors at the first row within e0, the plant as in the spec"
    if spec.continuous is not None:
        return f"{said}, q and w no faster than defect says, and known inputs constant over each period"
    if spec.period is None:
        return f"{said}; v counts what y does between rows, where it is held, as noise, and u is as it is held"
    return said
