"""What a spec asks of an observer with the gains L1 and L2: its section, and the same in the numbers of the spec."""

from collections.abc import Mapping
from typing import ClassVar, Literal, get_args

from flint import fmpq, fmpq_mat

from obsdesign.dissipation.bounds import NO_BOUNDS, SLACK, Bounds, Range, Trade, ends
from obsdesign.dissipation.inequality import Incremental
from obsdesign.dissipation.pace import ALPHA, RHO, Pace
from obsdesign.families import asked, rates
from obsdesign.families.frozen import Demand
from obsdesign.families.incremental.theorems import theorem
from obsdesign.families.poles import read_poles, refuse_free
from obsdesign.families.rates import RateSection
from obsdesign.lmi.formula import Array, printed
from obsdesign.records import dataclass, replace
from obsdesign.sections.document import Loc
from obsdesign.sections.forms import ENTRY, MATRIX, Either, Entries, OneOf, Section, key, required
from obsdesign.sections.values import Reader
from obsdesign.spec import Spec

Objective = Literal["min-gamma", "max-alpha", "feasibility", "pareto"]
SEARCHED = Range(fmpq(1, 1000), fmpq(1000), points=25, log=True)  # where the search looks if the spec does not say
RANGED = ("max-alpha", "pareto")  # objectives that need a range of alpha or of rho
STEPS = Range(fmpq(1, 100_000), fmpq(1), points=25, log=True)  # .. of 1 - rho
FAST = replace(STEPS, high=fmpq(99, 100))  # .. whose largest is asked for: of a linear plant as a rule there is none


class Level(Section):
    """A performance level to reach."""

    gamma: str = required(ENTRY, "the level, > 0", unit="z per v", example="0.01")


class LargestValues(Section):
    """What a design may use at most."""

    L1: str | asked.Frobenius | asked.Sizes | None = key(
        asked.LARGEST_GAIN,
        "largest spectral norm of L1; or {frobenius: ..}; or several for objective pareto: gamma against the gain",
        otherwise="none",
        example="400",
    )
    P: str | None = key(ENTRY, "p of P <= p I", otherwise="none", example="1.0e+6")
    gamma: str | None = key(ENTRY, "largest gamma", otherwise="none", unit="z per v", example="0.5")


class Gains(Section):
    """Gains to be analyzed instead of designed; they multiply (yhat - y)."""

    L1: Entries = required(MATRIX, "(nx + nm) x ny, nm states of the disturbance model", example="[[-6], [-30]]")
    L2: Entries | None = key(MATRIX, "nq x ny", otherwise="0", example="[[0, -110]]")


class Observer(RateSection):
    """What is asked of the design of an observer with the gains L1 and L2."""

    residual = "yhat - y"

    L2: Entries | None = key(
        MATRIX,
        "nq x ny, the gain inside f: a matrix, whose rows follow q, the plant's blocks first; or `free`: designed",
        otherwise="0",
        example="[[0, -110]]",
    )
    alpha: str | asked.Interval | None = key(
        asked.SEARCHED,
        "decay rate of the error, a number > 0 or a range that is searched",
        unit="1/s",
        otherwise="searched from 0.001 to 1000",
        example="{min: 0.01, max: 2.0, points: 25, log: true}",
    )
    objective: Objective | Level = key(
        Either(
            "an objective, or {gamma: a number}",
            OneOf("objective", get_args(Objective), beside=lambda: ("{gamma: ..}",)),
            mapping=Level,
        ),
        "the least gamma; the fastest decay; any solution; the curve of gamma against alpha; or to reach a gamma",
        default="min-gamma",
        example="{gamma: 0.01}",
    )
    slack: str | None = key(
        ENTRY, "relative distance from the optimum, for a smaller gain", otherwise="0.05", example="0.05"
    )
    bounds: LargestValues | str | None = key(
        asked.bounds_of(LargestValues),
        "what a design may use at most; auto: the knee of gamma against |L1|",
        otherwise="none",
        example="{L1: 400}",
    )
    gains: Gains | None = key(
        Gains, "gains that are analysed and certified as they are", otherwise="designed", example="{L1: [[-6], [-30]]}"
    )
    reconstruct: str | None = key(
        OneOf("signal", ("w",)),
        "w, by pinv(B) L1 (yhat - y); for linf, without a disturbance model",
        otherwise="none",
        example="w",
    )


@dataclass(frozen=True)
class Request:
    """The `observer` section of a spec for the families whose observer is (12), with gains L1 and L2."""

    drive: ClassVar[str] = "v"

    type: str
    L2: Array | None  # (nq, ny); None: free
    rate: fmpq | Range  # alpha; of samples 1 - rho
    objective: Objective | Literal["gamma"] = "min-gamma"
    gamma: fmpq | None = None  # the level to reach, for objective "gamma"
    slack: fmpq = SLACK
    bounds: Bounds = NO_BOUNDS
    gains: Mapping[str, Array] | None = None  # analysis of these instead of a design
    reconstruct: bool = False  # w by pinv(B) L1 (yhat - y)
    pace: Pace = ALPHA
    filtered: bool = False  # whether the estimate of a sample knows its y
    trade: Trade | None = None  # gamma against |L1|, whose knee is shipped

    def within(self, size: fmpq) -> "Request":
        """The same for the least gamma with |L1| at most a size."""
        return replace(self, objective="min-gamma", trade=None, bounds=replace(self.bounds, L1=size))

    @property
    def feedback(self) -> Array | None:
        """L2 of the gains that are analyzed, or of the design; None: free."""
        return self.gains["L2"] if self.gains else self.L2

    @property
    def told(self) -> tuple[fmpq, fmpq]:
        """Least and largest alpha that are asked for, or rho."""
        low, high = sorted(map(self.pace.told, ends(self.rate)))
        return low, high

    @property
    def level(self) -> fmpq | None:
        """Largest gamma that does what is asked; None: any."""
        asked = [level for level in (self.gamma, self.bounds.gamma) if level is not None]
        return min(asked, default=None)

    @property
    def restrictions(self) -> list[str]:
        """Bounds on what a design may use, in words."""
        return self.bounds.words("L1")

    def family(self, spec: Spec, rate: fmpq, L1: Array | None, L2: Array | None) -> Incremental:
        """Inequality of a spec at a rate, with gains; None: to be found."""
        return theorem(self.type, sampled=self.pace.sampled)(spec.posed, spec.multiplier, spec.H, rate, L1, L2)

    @property
    def kept(self) -> Bounds:
        """Bounds that a claim is held against: of given gains those on the poles only."""
        return Bounds(poles=self.bounds.poles) if self.gains else self.bounds

    def printed(self) -> "Request":
        """Same request with every number that a result file repeats as the decimal that it will hold."""
        told = self.pace.told
        low, high = (told(printed(told(end))) for end in ends(self.rate))
        return replace(
            self,
            rate=replace(self.rate, low=low, high=high) if isinstance(self.rate, Range) else low,
            L2=None if self.L2 is None else printed(self.L2),
            gamma=None if self.gamma is None else printed(self.gamma),
            gains=self.gains and {name: printed(matrix) for name, matrix in self.gains.items()},
        )


def request(reader: Reader, section: Observer, problem: asked.Estimation) -> Request:
    """Return the request, held against what the family knows."""
    objective = "gamma" if isinstance(section.objective, Level) else section.objective
    gamma = None
    if isinstance(section.objective, Level):
        gamma = reader.number(section.objective.gamma, ("observer", "objective", "gamma"), "> 0")
    L2 = None
    if section.L2 != "free":
        L2 = reader.matrix(reader.entries(section.L2, ("observer", "L2")), problem.q, problem.outputs)
    request = Request(
        type=section.type,
        L2=L2,
        rate=read_rate(reader, section, problem.period),
        pace=ALPHA if problem.period is None else RHO,
        filtered=section.filtered,
        objective=objective,
        gamma=gamma,
        slack=asked.read_slack(reader, section.slack),
        bounds=replace(read_bounds(reader, section.bounds), poles=read_poles(reader, section.poles, problem)),
        gains=asked.read_gains(
            reader, section.gains, {"L1": (problem.states, problem.outputs), "L2": (problem.q, problem.outputs)}
        ),
        reconstruct=section.reconstruct is not None,
        trade=asked.read_trade(reader, section.bounds, "L1", objective, problem),
    )
    if request.trade and not request.gains:
        require_one_rate(reader, request, section)
    refuse_free(reader, request.bounds.poles, request.feedback)
    if request.gains:
        asked.note_unused(reader, section, ("L2", "objective", "slack", "bounds"), asked.AS_GIVEN)
    elif objective == "gamma":
        asked.note_unused(reader, section, ("slack",), "the level is what objective.gamma says")
    for name, written in (("alpha", section.alpha), ("rho", section.rho)):
        if objective == "max-alpha" and isinstance(written, asked.Interval) and written.points:
            reader.unused.append(f"observer.{name}.points has no effect: max-alpha halves the range, without a grid")
    if request.filtered:
        for where, said in problem.refused("Df", "estimate: filtered"):
            reader.wrong(where, f"{said}; predicted estimates take it", id="OBS406")
    if request.reconstruct:
        require_reconstructible(reader, request, problem)
    return request


def require_one_rate(reader: Reader, request: Request, section: Observer) -> None:
    """Refuse a range of rates beside one of gains; l2 has its least gamma at the slowest."""
    name, written = section.written("alpha", fmpq(1) if request.pace.sampled else None)
    if isinstance(written, asked.Interval) or (isinstance(request.rate, Range) and request.type != "l2"):
        said = f"gamma against |L1| is a curve at one {request.pace.key}: give a number"
        reader.wrong(("observer", name), said, id="OBS215")


def require_reconstructible(reader: Reader, request: Request, problem: asked.Estimation) -> None:
    """Refuse what = pinv(B) L1 (yhat - y) for another family, a disturbance model, or a B without a left inverse."""
    loc: Loc = ("observer", "reconstruct")
    if problem.period is not None:
        reader.wrong(loc, "is for continuous time; of samples take a disturbance model, as integrator", id="OBS503")
        return
    if request.type != "linf":
        reader.wrong(loc, f"not available for type {request.type}; it needs type linf", id="OBS503")
        return
    if problem.noisy:
        reader.wrong(loc, "takes no noise beside w; leave out one of the two, or give simulation.noise", id="OBS503")
        return
    if problem.generator is not None and len(problem.generator.Am):
        reader.wrong(loc, "the disturbance model estimates w already; leave out one of the two", id="OBS503")
    if problem.plant is not None:
        B = problem.plant.B
        rank = fmpq_mat(B.tolist()).rank() if B.size else 0
        if not B.shape[1] or rank < B.shape[1]:
            said = f"needs system.B of full column rank, for its left inverse; it has rank {rank} of {B.shape[1]}"
            if problem.as_equations:
                said = f"needs disturbances that act on the states independently; {rank} of {B.shape[1]} do"
            reader.wrong(loc, said, id="OBS503")


def read_rate(reader: Reader, section: Observer, period: fmpq | None) -> fmpq | Range:
    """Decay rate, alpha or 1 - rho, or where to search it."""
    name, written = section.written("alpha", period)
    alone = not (isinstance(section.bounds, LargestValues) and isinstance(section.bounds.L1, asked.Sizes))
    if section.objective in RANGED and alone and written is not None and not isinstance(written, asked.Interval):
        said = f"objective {section.objective} needs a range; give {{min: .., max: ..}}"
        reader.wrong(("observer", name), said, id="OBS215")
    found = rates.read_rate(reader, section, "alpha", period, "> 0", dead=section.type == "linf")
    if found is not None:
        return found
    if period is not None and section.type == "l2" and (section.objective not in RANGED or not alone):
        return fmpq(0)
    searched = SEARCHED if period is None else STEPS if section.objective != "max-alpha" else FAST
    ends = (searched.low, searched.high) if period is None else (1 - searched.high, 1 - searched.low)
    first, last = ends
    reader.notes.append(f"observer.{name} is not given and is searched from {float(first):g} to {float(last):g}")
    return searched


def read_bounds(reader: Reader, section: LargestValues | str | None) -> Bounds:
    """Largest gain, storage function and level."""
    if not isinstance(section, LargestValues):
        return NO_BOUNDS
    gain, norm = asked.read_largest_gain(reader, section.L1, "L1")
    P, gamma = (asked.read_bound(reader, getattr(section, name), name) for name in ("P", "gamma"))
    return Bounds(gain, norm, P, gamma)


def posed(spec: Spec, rate: fmpq | None = None, L1: Array | None = None, L2: Array | None = None) -> Incremental:
    """Inequality of a spec in rationals, at the least rate that is asked for or another; gains: those of the request.

    L2 is that of the request where it is not given.
    """
    request = request_of(spec).printed()
    given = request.gains or {}
    rate = ends(request.rate)[0] if rate is None else rate
    L1 = given.get("L1") if L1 is None else L1
    L2 = given.get("L2", request.L2) if L2 is None else L2
    return request.family(spec, rate, L1, L2)


def demand(spec: Spec) -> Demand:
    """Decay at the least alpha that is asked for, for every f of its type."""
    request = request_of(spec).printed()
    largest = None if request.gains else request.bounds.L1
    return Demand(posed(spec).edge, spec.multiplier, request.pace, "L1", largest, request.feedback)


def request_of(spec: Spec) -> Request:
    """What a spec of this family asks for."""
    assert isinstance(spec.observer, Request)
    return spec.observer


SECTION, LIMITS = Observer, ("limit", "limit_bounded")
RESULTS = {
    "guarantee": (
        "gamma",
        "gamma_v",
        "alpha",
        "rho",
        "at_samples",
        "mu1",
        "mu2",
        "reconstruction",
        "poles",
        "implementation",
        "limit",
        "limit_bounded",
    ),
    "observer": ("L1", "L2", "estimate", "period", "poles", "fastest", "largest_step", "noise_gain", "condition_P"),
}
