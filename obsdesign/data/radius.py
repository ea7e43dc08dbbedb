"""What is proved of the error of each estimate along a log, from bounds on |v| and on the errors at its start.

It is so of plants in samples, and of measurements at instants: of another continuous plant nothing in a log says what y
does between its rows.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import numpy as np
from flint import fmpq

from obsdesign.design import Design
from obsdesign.families import FAMILIES
from obsdesign.families.guarantee import Rates, SampledGuarantee, Steps
from obsdesign.lmi.formula import Array, Exact, Float, approximate, identity, in_floats
from obsdesign.model.filtered import gain_of
from obsdesign.records import dataclass
from obsdesign.spec import Spec
from obsdesign.trial import Recorded

RANGES = "the claim holds for ranges of known inputs or outputs, which are not followed along a log"
OUTWARD = 1 + 1e-9  # rounding of what is computed in doubles here


@dataclass(frozen=True)
class Radius:
    """Bounds |error| <= reach sqrt(V_k), V_k <= rho^(2 k) V_0 + c |v|^2 (1 - rho^(2 k)) / (1 - rho^2), at row k from 0.

    At rho = 1 V grows by c |v|^2 in each sample. The error at row 0 is given, and its bound is this where it is less.
    """

    names: tuple[str, ...]  # of estimates
    reach: Float
    reach_of_arguments: Float  # likewise of q, in the order of the spec
    rates: Steps
    start: float  # V_0
    v2: float  # |v|^2
    first: Float  # bounds on the errors at row 0 that are given
    premise: str  # under which they hold
    outputs: tuple[int, ...]  # places of the outputs y = C x + gy + D v, without f, of which xhat knows no y yet
    reach_of_outputs: Float  # of C e of these
    direct: Float  # |D| of these

    def storage(self, k: Array) -> Float:
        """Bound on sqrt(V) at rows."""
        left, lost = self.rates.rho ** (2.0 * k), float(approximate(self.rates.dampened))
        grown = (1 - left) / lost if lost else k
        return np.asarray(np.sqrt(left * self.start + self.rates.c * self.v2 * grown) * OUTWARD)

    def along(self, first: int, t: Float, measured: Array) -> tuple[Float, Float]:  # noqa: ARG002
        """Radii of the estimates (K, names) and of the arguments of f (K, nq) at rows from one on.

        `t`: their times in s; `measured`: whether y is taken at them.
        """
        k = np.arange(first, first + len(t))
        root = self.storage(k)[:, None]
        radii = np.where(k[:, None] == 0, np.minimum(root * self.reach, self.first), root * self.reach)
        return radii, np.asarray(root * self.reach_of_arguments)

    def contradicted(self, innovations: Float, k: Array) -> Array:
        """Rows of which an innovation is larger than what the premise allows: |y - yhat| <= reach sqrt(V) + |D| |v|."""
        bound = self.storage(k)[:, None] * self.reach_of_outputs + OUTWARD * self.direct * np.sqrt(self.v2)
        return np.asarray((np.abs(innovations[:, self.outputs]) > bound).any(axis=1))


@dataclass
class SampledRadius:
    """Bounds |h e| <= reach sqrt(V(t)), for measurements at instants, and |h| |(e, d)(t)|, of which the less counts.

    Between measurements V' <= -2 alpha V + c |v|^2, and at each V grows by no more than kick |eta|^2.
    """

    names: tuple[str, ...]  # of estimates
    reach: Float
    reach_of_arguments: Float
    rates: Rates
    V: float  # at the last row; before the first one, at the start
    v2: float  # |v|^2
    added: float  # kick |eta|^2
    premise: str  # under which they hold
    lengths: Float  # |h| of the estimates
    lengths_of_arguments: Float
    lasting: Callable[[Float], Array]  # bounds on |(e, d)| at times after the first row
    t: float = math.nan  # s, of the last row
    begin: float = math.nan  # s, of the first

    def along(self, _: int, t: Float, measured: Array) -> tuple[Float, Float]:
        """Radii of the estimates and of the arguments of f at the rows that follow, as `Radius.along`."""
        if math.isnan(self.begin) and len(t):
            self.begin = self.t = float(t[0])
        t = np.maximum.accumulate(np.concatenate([[self.t], t]))[1:]  # a row that comes late has no radius
        root, size = self.storage(t, measured)[:, None], self.lasting(t - self.begin)[:, None] * OUTWARD
        pairs = (self.reach, self.lengths), (self.reach_of_arguments, self.lengths_of_arguments)
        radii, spread = (np.minimum(root * reach, size * length) for reach, length in pairs)
        return radii, spread

    def storage(self, t: Float, measured: Array) -> Float:
        """Bound on sqrt(V) at the rows that follow, at times t, where `measured` says whether y is taken."""
        alpha, found = self.rates.alpha, np.zeros(len(t))
        for k, now in enumerate(t.tolist()):
            span = now - self.t
            grown = -math.expm1(-2 * alpha * span) / (2 * alpha) if alpha else span
            self.V = math.exp(-2 * alpha * span) * self.V + self.rates.c * self.v2 * grown
            self.V += self.added * bool(measured[k])
            self.t, found[k] = now, self.V
        return np.asarray(np.sqrt(found) * OUTWARD)


def radius(design: Design, where: Recorded, estimates: Sequence[str]) -> Radius | SampledRadius | str:
    """Radii of the estimates of a design on a log, or why there are none."""
    guarantee, spec = design.guarantee, design.spec
    if guarantee is None:
        return "nothing is proved of these gains"
    family = FAMILIES[spec.observer.type]
    instants, none = family.sampled, f"of type {spec.observer.type} none is computed along a log"
    if why := none if family.equations else unheld(spec) if instants else uncovered(design):
        return why
    states = (*spec.plant.states, *spec.model_states)
    if where.v_sup is None or (missing := [name for name in states if name not in where.e0]):
        what = "v_sup" if where.v_sup is None else f"e0 of {', '.join(missing)}"
        return f"data: {{{what}}} is not given"
    rows, given = outputs(spec, estimates), np.array([float(where.e0[name]) for name in states])
    if instants:
        return sampled(cast("SampledGuarantee", guarantee), spec, where, rows, given)
    rates, p = guarantee.rates(), spec.augmented
    assert isinstance(rates, Steps)
    v2 = float(where.v_sup) ** 2 * (float(gain_of(p, peaks=True)) if spec.observer.filtered else 1.0)
    if spec.continuous is not None and spec.continuous.defect:
        v2 += 1.0  # the defect, as a channel of length 1
    names = tuple(rows)
    H = np.array([rows[name] for name in names], dtype=object).reshape(len(names), len(states))
    P: Any = guarantee.P  # type: ignore[attr-defined]
    e0 = guarantee.entering(given)  # type: ignore[attr-defined]
    reach, of_q = (np.asarray(guarantee.reach(M)) if len(M) else np.zeros(0) for M in (H, p.Cq))
    if not np.isfinite([*reach, *of_q]).all():
        return "the estimates hold the noise of y at once"
    plain = tuple(i for i, row in enumerate(p.Df) if not (row != 0).any() and not spec.observer.filtered)
    of_y = np.asarray(guarantee.reach(p.C[list(plain)])) if plain else np.zeros(0)
    direct = np.array([np.linalg.norm([approximate(entry) for entry in p.D[i]]) for i in plain])
    first = np.abs(H.astype(float)).reshape(len(names), len(states)) @ given
    return Radius(
        names, reach, of_q, rates, largest(P, e0), v2, first, premise(spec, timed=bool(where.arrival)),
        plain, of_y, direct,
    )  # fmt: skip


def sampled(
    guarantee: SampledGuarantee, spec: Spec, where: Recorded, rows: Mapping[str, Array], e0: Float
) -> SampledRadius | str:
    """Radii where measurements come at instants, of rows of e by estimate, with bounds e0 on the errors before them."""
    assert where.v_sup is not None
    if where.eta_sup is None:
        return "data: {eta_sup} is not given"
    starts = guarantee.entering(spec.augmented.C)
    H, C = np.array([*rows.values()], dtype=object).reshape(len(rows), len(e0)), in_floats(spec.augmented.C)
    reach, of_q = (np.asarray(guarantee.reach(M)) if len(M) else np.zeros(0) for M in (H, spec.augmented.Cq))
    if not starts or not np.isfinite([*reach, *of_q]).all():
        return "the storage function is not known to be positive"
    added = guarantee.kick * float(where.eta_sup) ** 2 if where.eta_sup else 0.0
    if not math.isfinite(added):
        return "the certificate says nothing of noise at measurements: data: {eta_sup: 0} leaves it out"
    rates, start = guarantee.rates(), max(largest(M, e0) for M in starts)
    assert isinstance(rates, Rates)
    said = "|v| <= v_sup at all times, |eta| <= eta_sup at all measurements, errors before the first row within e0, the"
    said += " plant as in the spec, known inputs between rows as hold says, the observer integrated to 1e-6"
    said += ", up to the first row that came after one that was made later" * bool(where.arrival)
    assumed = [f"assumed: {' and '.join(spec.assumed)}"] if spec.assumed else []
    lengths, of_arguments = (np.linalg.norm(in_floats(M), axis=1) for M in (H, spec.augmented.Cq))
    v, eta, size = float(where.v_sup), float(where.eta_sup), float(np.linalg.norm([*e0, *np.abs(C) @ e0]))
    return SampledRadius(
        tuple(rows), reach, of_q, rates, start, v**2, added, "; ".join([said, *assumed]), lengths, of_arguments,
        lambda t: guarantee.lasting(t, size, v, eta),
    )  # fmt: skip


def unheld(spec: Spec) -> str:
    """Why what is proved of measurements at instants says nothing of a log, or nothing."""
    reasons = {
        "nothing is proved of the steps of an implementation; leave it out": spec.implementation is not None,
        RANGES: any(block.others for block in spec.nonlinearities),
        "the claim is local, and where the arguments of f are between rows is not known": bool(spec.validity),
    }
    return next((why for why, applies in reasons.items() if applies), "")


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


def uncovered(design: Design) -> str:
    """Why what is proved says nothing of a log, or nothing."""
    spec, p = design.spec, design.spec.augmented
    loops = (p.Dqf != 0).any() or (p.Dq != 0).any() or spec.observer.filtered
    injected = (design.gains.get("L2", np.zeros(0)) != 0).any()
    continuous = spec.period is None
    reasons = {
        "nothing is proved of the steps of an implementation; take a plant in samples": (
            continuous and spec.implementation is not None
        ),
        "of a continuous plant y is not known between rows; take a plant in samples, or discretise with a defect": (
            continuous
        ),
        "nothing is proved of the continuous plant: give discretise a defect": (
            spec.continuous is not None and spec.continuous.defect is None
        ),
        RANGES: any(block.others for block in spec.nonlinearities),
        "the claim is local, and where the arguments of f are in the plant does not follow from the estimates": (
            bool(spec.validity) and (loops or injected)
        ),
    }
    return next((why for why, applies in reasons.items() if applies), "")


def premise(spec: Spec, *, timed: bool = False) -> str:
    """What has to be true of a log for the radii to hold; `timed`: it says when each row became known."""
    said = "|v| <= v_sup at all samples, errors at the first row within e0, the plant as in the spec, rows its samples"
    if spec.continuous is not None:
        said = f"{said}, q and w no faster than defect says, and known inputs constant over each period"
    if timed:
        said = f"{said}, up to the first that is used after its time"
    assumed = [f"assumed: {' and '.join(spec.assumed)}"] if spec.assumed else []
    return "; ".join([said, *assumed])
