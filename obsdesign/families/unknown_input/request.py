"""What a spec asks of an unknown-input observer: its section, and the same in the numbers of the spec."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import ClassVar, Literal, get_args

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import NO_BOUNDS, SLACK, Bounds, Range
from obsdesign.dissipation.inequality import Incremental
from obsdesign.dissipation.pace import ALPHA, RHO, Pace
from obsdesign.families import asked, rates
from obsdesign.families.frozen import Demand
from obsdesign.families.incremental import request as incremental
from obsdesign.families.incremental.request import Level
from obsdesign.families.poles import read_poles
from obsdesign.families.rates import RateSection
from obsdesign.families.unknown_input import transform
from obsdesign.families.unknown_input.theorem import DiscreteUnknownInput, UnknownInput
from obsdesign.lmi.formula import Array, Exact
from obsdesign.model.disturbance import Generator
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass, replace
from obsdesign.sections.document import Loc
from obsdesign.sections.forms import ENTRY, MATRIX, TEXT, Either, Entries, ListOf, OneOf, Section, key, required
from obsdesign.sections.values import Reader
from obsdesign.sections.words import unknown
from obsdesign.spec import Spec

Objective = Literal["min-gamma", "max-alpha", "feasibility"]


class UnknownInputBounds(Section):
    """What a design may use at most."""

    L: str | asked.Frobenius | None = key(
        Either("a number, or {frobenius: a number}", ENTRY, mapping=asked.Frobenius),
        "largest spectral norm of L; or {frobenius: ..}",
        otherwise="none",
        example="20",
    )
    gamma: str | None = key(ENTRY, "largest gamma", otherwise="none", unit="z per v", example="0.5")


class UnknownInputGains(Section):
    """Gains to be analyzed instead of designed; L multiplies (y - yhat)."""

    E: Entries | None = key(
        MATRIX, "nx x ny, with E C B = B exactly: 1/3, not 0.333", otherwise="as designed", example="[[1], [1/3]]"
    )
    L: Entries = required(MATRIX, "nx x ny", example="[[6], [30]]")


class UnknownInputObserver(RateSection):
    """What is asked of an observer xi' = T (A xhat + Bf f + gx) + L (y - yhat), xhat = xi + E y, T = I - E C."""

    cancel: str | list[str] | None = key(
        Either("a name or a list of names", TEXT, ListOf(TEXT, least=1)),
        "channels of w that must not drive the error: T B = 0 in their columns of B",
        otherwise="all that act on x and are not in y at once",
        example="[w1]",
    )
    alpha: str | asked.Interval | None = key(
        asked.SEARCHED,
        "decay rate of the error, a number > 0 or a range that is searched",
        unit="1/s",
        otherwise="searched from 0.001 to 1000",
        example="1",
    )
    objective: Objective | Level = key(
        Either(
            "an objective, or {gamma: a number}",
            OneOf("objective", get_args(Objective), beside=lambda: ("{gamma: ..}",)),
            mapping=Level,
        ),
        "the least gamma from the other channels; the fastest decay; any solution; or to reach a gamma",
        default="min-gamma",
        example="{gamma: 0.01}",
    )
    slack: str | None = key(
        ENTRY, "relative distance from the optimum, for a smaller gain", otherwise="0.05", example="0.05"
    )
    bounds: UnknownInputBounds | None = key(
        UnknownInputBounds, "what a design may use at most", otherwise="none", example="{L: 20}"
    )
    gains: UnknownInputGains | None = key(
        UnknownInputGains,
        "gains that are analysed and certified as they are",
        otherwise="designed",
        example="{L: [[6], [30]]}",
    )


@dataclass(frozen=True)
class Request(incremental.Request):
    """What is asked of the plant that is left, as the family l2 is asked it: L1 = -L."""

    Z: Array | None = None  # (nz, nv): z = H eps + Z v

    def family(self, spec: Spec, rate: fmpq, L1: Array | None, L2: Array | None) -> Incremental:
        """Inequality of the plant that is left."""
        kind = DiscreteUnknownInput if self.pace.sampled else UnknownInput
        return kind(spec.posed, spec.multiplier, spec.H, rate, L1, L2, Z=self.Z)


@dataclass(frozen=True)
class UnknownInputRequest:
    """The `observer` section of a spec for unknown-input observers."""

    drive: ClassVar[str] = "v"
    reconstruct: ClassVar[bool] = False
    filtered: ClassVar[bool] = False  # its estimates know y at once, and its inequality is of that sample alone

    type: str
    cancel: tuple[int, ...]  # places among the channels of w
    rate: fmpq | Range  # alpha; of samples 1 - rho
    objective: Literal["min-gamma", "max-alpha", "feasibility", "gamma"] = "min-gamma"
    gamma: fmpq | None = None  # the level to reach, for objective "gamma"
    slack: fmpq = SLACK
    bounds: Bounds = NO_BOUNDS
    gains: Mapping[str, Array] | None = None  # L, and E where it is given
    pace: Pace = ALPHA

    @property
    def restrictions(self) -> Sequence[str]:
        """Bounds on what a design may use, in words."""
        return self.bounds.words("L")

    def posed(self, plant: Plant[Exact]) -> Plant[Exact]:
        """Plant that is left with the E of a design; where there is none, the plant without the channels."""
        E = transform.chosen(plant, self.cancel)
        none = transform.exact_zeros(plant.n, len(plant.C))
        return transform.remaining(plant, self.cancel, none if E is None else E)

    @cached_property
    def given(self) -> Exact | None:
        """E of the gains that are analyzed, if it is given."""
        return (self.gains or {}).get("E")


def request(reader: Reader, section: UnknownInputObserver, problem: asked.Estimation) -> UnknownInputRequest:
    """Return the request, held against what the family knows."""
    objective = "gamma" if isinstance(section.objective, Level) else section.objective
    gamma = None
    if isinstance(section.objective, Level):
        gamma = reader.number(section.objective.gamma, ("observer", "objective", "gamma"), "> 0")
    if problem.generator is not None and not problem.generator.direct:
        said = "is for another observer.type: what is cancelled needs no model; leave it out"
        reader.wrong(("disturbance",), said, id="OBS951")
    if section.filtered:
        said = "is what this type does anyway: xhat_k = xi_k + E y_k knows y_k; leave it out"
        reader.wrong(("observer", "estimate"), said, at_key=True, id="OBS213")
    cancel = read_cancel(reader, section, problem)
    made = UnknownInputRequest(
        type=section.type,
        cancel=cancel,
        rate=read_rate(reader, section, problem.period),
        objective=objective,
        gamma=gamma,
        slack=asked.read_slack(reader, section.slack),
        bounds=read_bounds(reader, section, problem),
        gains=read_gains(reader, section, problem, cancel),
        pace=ALPHA if problem.period is None else RHO,
    )
    if made.gains:
        asked.note_unused(reader, section, ("objective", "slack", "bounds"), asked.AS_GIVEN)
    elif objective == "gamma":
        asked.note_unused(reader, section, ("slack",), "the level is what objective.gamma says")
    return made


def read_rate(reader: Reader, section: UnknownInputObserver, period: fmpq | None) -> fmpq | Range:
    """Decay rate, or where to search it; in discrete time no decay is asked for unless it is said."""
    name, written = section.written("alpha", period)
    fastest = section.objective == "max-alpha"
    if fastest and written is not None and not isinstance(written, asked.Interval):
        said = "objective max-alpha needs a range; give {min: .., max: ..}"
        reader.wrong(("observer", name), said, id="OBS215")
    found = rates.read_rate(reader, section, "alpha", period, "> 0")
    if found is not None:
        return found
    if period is not None:
        return incremental.FAST if fastest else fmpq(0)
    ends = f"{float(incremental.SEARCHED.low):g} to {float(incremental.SEARCHED.high):g}"
    reader.notes.append(f"observer.{name} is not given and is searched from {ends}")
    return incremental.SEARCHED


def read_cancel(reader: Reader, section: UnknownInputObserver, problem: asked.Estimation) -> tuple[int, ...]:
    """Places of the channels that are cancelled."""
    plant, loc = problem.plant, ("observer", "cancel")
    if plant is None:
        return ()
    names = plant.exogenous
    able = [k for k in range(len(names)) if not why_not(plant, k)]
    acting = [names[k] for k in able if plant.B[:, k].any()]
    if section.cancel is None:
        if not acting:
            said = "has nothing to cancel: no disturbance acts on x without being in y at once; take l2"
            reader.wrong(("observer", "type"), said, id="OBS951")
        return tuple(names.index(name) for name in acting)
    asked_for = [section.cancel] if isinstance(section.cancel, str) else section.cancel
    for i, name in enumerate(asked_for):
        here: Loc = loc if isinstance(section.cancel, str) else (*loc, i)
        if name not in names:
            reader.wrong(here, unknown("disturbance", name, names, {}), id="OBS203")
        elif said := why_not(plant, names.index(name)):
            instead = f"can be: {', '.join(acting)}" if acting else "none can be here; take l2"
            reader.wrong(here, f"{name} cannot be cancelled: {said}; {instead}", id="OBS951")
    return tuple(sorted({names.index(name) for name in asked_for if name in names}))


def why_not(plant: Plant[Exact], k: int) -> str:
    """Why a channel of w cannot be cancelled, whatever E is; empty where nothing is in the way."""
    shown = [y for y, entry in zip(plant.outputs, plant.D[:, k], strict=True) if entry != 0]
    if shown:
        return f"it is in {', '.join(shown)} at once (D), and so in xhat = xi + E y, or in L (y - yhat)"
    if plant.Dq[:, k].any():
        return "a nonlinearity is a function of it (Dq)"
    return ""


def read_bounds(reader: Reader, section: UnknownInputObserver, problem: asked.Estimation) -> Bounds:
    """Largest gain and level, and where the poles lie."""
    bounds = Bounds(poles=read_poles(reader, section.poles, problem))
    if section.bounds is None:
        return bounds
    gain, norm = asked.read_largest_gain(reader, section.bounds.L, "L")
    return replace(bounds, L1=gain, norm=norm, gamma=asked.read_bound(reader, section.bounds.gamma, "gamma"))


def read_gains(
    reader: Reader, section: UnknownInputObserver, problem: asked.Estimation, cancel: Sequence[int]
) -> Mapping[str, Array] | None:
    """Given gains; an E that does not cancel is refused."""
    if section.gains is None:
        return None
    size, loc = (problem.states, problem.outputs), ("observer", "gains")
    found = {"L": reader.matrix(reader.entries(section.gains.L, (*loc, "L")), *size)}
    if section.gains.E is None:
        return found
    E, plant = reader.matrix(reader.entries(section.gains.E, (*loc, "E")), *size), problem.plant
    if plant is not None and reader.clean((*loc, "E")) and E.shape == plant.C.T.shape:
        left = transform.projector(plant, E) @ plant.B[:, list(cancel)]
        if (left != 0).any():
            worst = max((float(abs(x)) for x in left.ravel()), default=0.0)
            said = f"does not cancel: E C B differs from B by {worst:.3g}; write it exactly (1/3), or leave E out"
            reader.wrong((*loc, "E"), said, id="OBS952")
        if (E @ plant.Df != 0).any():
            reader.wrong((*loc, "E"), "takes f out of y (E Df must be zero); leave E out", id="OBS952")
    return {**found, "E": E}


def factor(spec: Spec) -> Exact | None:
    """E: the given one, or that of `transform.chosen`; None where there is none."""
    asked_for = request_of(spec)
    return transform.chosen(spec.augmented, asked_for.cancel) if asked_for.given is None else asked_for.given


def reduced(spec: Spec, E: Exact | None = None) -> Spec:
    """The same problem for the plant that is left, of whose l2 observer L1 = -L is the gain.

    `E`: another one than that of the spec.
    """
    one, plant = request_of(spec), spec.augmented
    E = factor(spec) if E is None else E
    if E is None:
        E = transform.exact_zeros(plant.n, len(plant.C))
    kept = [k for k in range(plant.B.shape[1]) if k not in one.cancel]
    Z = spec.H @ transform.direct(plant, one.cancel, E)
    none = transform.exact_zeros(len(plant.Cq), len(plant.C))
    inner = Request(
        type="l2",
        L2=none,
        rate=one.rate,
        objective=one.objective,
        gamma=one.gamma,
        slack=one.slack,
        bounds=one.bounds,
        gains=one.gains and {"L1": -one.gains["L"], "L2": none},
        pace=one.pace,
        Z=Z if (Z != 0).any() else None,
    )
    left = transform.remaining(plant, one.cancel, E)
    named = replace(left, exogenous=tuple(spec.plant.exogenous[k] for k in kept))
    return replace(
        spec,
        plant=named,
        generator=only(spec.generator, kept),
        drives=left.exogenous,
        observer=inner,
        noise={},
        simulation=None,
        as_equations=False,
    )


def only(model: Generator, kept: Sequence[int]) -> Generator:
    """Some of the channels of w = v."""
    k = list(kept)
    return replace(
        model,
        Bm=model.Bm[:, k],
        Dq2=model.Dq2[:, k],
        Cm=model.Cm[k],
        Dwf=model.Dwf[k],
        Dm=model.Dm[np.ix_(k, k)],
        inverse=tuple(model.inverse[i] for i in k),
    )


def demand(spec: Spec) -> Demand:
    """Decay at the least rate that is asked for, for every f of its type, whatever the cancelled channels are."""
    return replace(incremental.demand(reduced(spec)), gain="L", cancelled=", ".join(spec.cancelled))


def request_of(spec: Spec) -> UnknownInputRequest:
    """What a spec of this family asks for."""
    assert isinstance(spec.observer, UnknownInputRequest)
    return spec.observer


SECTION = UnknownInputObserver
RESULTS = {
    "guarantee": (*("gamma", "alpha", "rho", "mu1", "mu2", "poles", "implementation", "limit", "limit_bounded"),),
    "observer": ("cancelled", "E", "L", "period", "poles", "fastest", "largest_step", "noise_gain", "condition_P"),
}
