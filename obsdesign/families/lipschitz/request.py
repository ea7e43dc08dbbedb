"""What a spec asks of an observer of a Lipschitz system: its section, and the same in the numbers of the spec."""

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar, Literal, get_args

from flint import fmpq

from obsdesign.dissipation.bounds import NO_BOUNDS, SLACK, Bounds, Range, Trade, ends
from obsdesign.dissipation.pace import DECAY, RHO, Pace
from obsdesign.families import asked, rates
from obsdesign.families.frozen import Demand
from obsdesign.families.lipschitz.refusals import UNSTRUCTURED, require_lipschitz
from obsdesign.families.poles import read_poles
from obsdesign.families.rates import RateSection
from obsdesign.lmi.formula import Array, printed
from obsdesign.model.edge import Edge
from obsdesign.nonlinearities import combine
from obsdesign.nonlinearities.lipschitz import lipschitz
from obsdesign.records import dataclass, replace
from obsdesign.sections.document import Loc, dotted
from obsdesign.sections.forms import ENTRY, MATRIX, Entries, OneOf, Section, key, required
from obsdesign.sections.values import Reader
from obsdesign.spec import Nonlinearity, Spec

ZERO = fmpq(0)

LipschitzObjective = Literal["max-lipschitz", "min-gamma", "pareto"]
LipschitzRelaxation = Literal["s-procedure", "norm-bound", "abbaszadeh", "compare"]


class Least(Section):
    """A lower bound."""

    min: str = required(ENTRY, "the bound, > 0", example="0.01")


class LipschitzBounds(Section):
    """What a design may use."""

    L: str | asked.Frobenius | asked.Sizes | None = key(
        asked.LARGEST_GAIN,
        "largest spectral norm of L; or {frobenius: ..}; or several for objective pareto: gamma against the gain",
        otherwise="none",
        example="20",
    )
    P: Least | None = key(Least, "P >= min I, which keeps the gain finite", otherwise="none", example="{min: 0.01}")
    gamma: str | None = key(ENTRY, "largest gamma, of min-gamma", otherwise="none", unit="z per w", example="0.5")


class LipschitzGains(Section):
    """Gain to be analyzed instead of designed; it multiplies (y - yhat)."""

    L: Entries = required(MATRIX, "(nx + nm) x ny, nm states of the disturbance model", example="[[6], [30]]")


class LipschitzObserver(RateSection):
    """What is asked of an observer of a Lipschitz system, xhat' = A xhat + Bf f(Cq xhat) + L (y - yhat)."""

    hints: ClassVar[Mapping[str, str]] = {**RateSection.hints, "alpha": "is called decay in type lipschitz"}

    relaxation: LipschitzRelaxation = key(
        OneOf("relaxation", get_args(LipschitzRelaxation)),
        "of what is known of f; compare: all of them, beside each other",
        default="s-procedure",
        example="compare",
    )
    objective: LipschitzObjective = key(
        OneOf("objective", get_args(LipschitzObjective)),
        "the largest Lipschitz constant; the least gamma at the declared one; or, with a weight, one against the other",
        default="max-lipschitz",
        example="min-gamma",
    )
    weight: str | asked.Interval | None = key(
        asked.SEARCHED,
        "in [0, 1], for pareto: minimize weight / lipschitz + (1 - weight) gamma^2; a range is a curve",
        otherwise="none; pareto needs it",
        example="0.9",
    )
    decay: str | asked.Interval | None = key(
        asked.SEARCHED,
        "decay rate of the error; a range, as of rho, for pareto only",
        unit="1/s",
        otherwise="0",
        example="0.2",
    )
    slack: str | None = key(
        ENTRY,
        "relative distance from the optimum, for a smaller gain",
        otherwise="0.05",
        example="0.05",
    )
    bounds: LipschitzBounds | str | None = key(
        asked.bounds_of(LipschitzBounds),
        "what a design may use; auto: the knee of gamma against |L|",
        otherwise="none",
        example="{L: 20}",
    )
    gains: LipschitzGains | None = key(
        LipschitzGains,
        "a gain that is analysed and certified as it is",
        otherwise="designed",
        example="{L: [[6], [30]]}",
    )


@dataclass(frozen=True)
class LipschitzRequest:
    """The `observer` section of a spec for the family of Lipschitz systems.

    The bound L1 is that of L. Only the rate and the weight of `pareto` may be ranges.
    """

    reconstruct: ClassVar[bool] = False

    type: str
    lipschitz: tuple[fmpq, ...]  # declared constant of each block of f
    relaxation: LipschitzRelaxation = "s-procedure"
    objective: LipschitzObjective = "max-lipschitz"
    weight: fmpq | Range | None = None  # of 1 / lipschitz against gamma^2, in [0, 1], for pareto
    rate: fmpq | Range = ZERO  # beta, 1/s; of samples 1 - rho
    slack: fmpq = SLACK
    bounds: Bounds = NO_BOUNDS
    gains: Mapping[str, Array] | None = None  # L (n, ny): analysis of this
    drive: str = "w"  # v where a disturbance model generates w
    pace: Pace = DECAY
    filtered: bool = False  # whether the estimate of a sample knows its y
    trade: Trade | None = None  # gamma against |L|, whose knee is shipped

    def within(self, size: fmpq) -> "LipschitzRequest":
        """The same for the least gamma with |L| at most a size."""
        return replace(self, objective="min-gamma", trade=None, bounds=replace(self.bounds, L1=size))

    @property
    def told(self) -> tuple[fmpq, fmpq]:
        """Least and largest decay that are asked for, or rho."""
        low, high = sorted(map(self.pace.told, ends(self.rate)))
        return low, high

    @property
    def rates(self) -> tuple[fmpq, ...]:
        """Rates that are asked for, the least first; the decay, or rho, of each as a file holds it."""
        told = self.pace.told
        grid = self.rate.grid() if isinstance(self.rate, Range) else (self.rate,)
        return tuple(told(printed(told(rate))) for rate in grid)

    @property
    def placed(self) -> Bounds:
        """Bounds on the poles."""
        return Bounds(poles=self.bounds.poles)

    @property
    def storage(self) -> Bounds:
        """Those, and the bound on the P of the guarantee: of a design, with gamma, whose P has a scale."""
        scaled = self.gains is None and self.objective != "max-lipschitz"
        return replace(self.placed, floor=self.bounds.floor) if scaled else self.placed

    @property
    def restrictions(self) -> list[str]:
        """Bounds on what a design may use, in words."""
        return self.bounds.words("L")

    def conflicts(self) -> Iterator[tuple[tuple[str, ...], str]]:
        """Keys that do not go with the objective or the relaxation, and why, with what to do instead."""
        if self.objective == "pareto" and self.gains is not None:
            yield ("gains",), "pareto designs gains; analyze given ones with max-lipschitz or min-gamma"
        if self.objective != "min-gamma" and self.bounds.gamma is not None and not self.trade:
            said = "pareto weighs" if self.objective == "pareto" else "max-lipschitz knows no"
            yield ("bounds", "gamma"), f"{said} gamma; bound it with min-gamma"
        if (self.objective, self.relaxation) == ("max-lipschitz", "s-procedure") and self.bounds.floor is not None:
            said = "the P of max-lipschitz has no scale in the s-procedure; bound L, or choose norm-bound"
            yield ("bounds", "P"), said
        if self.trade and self.relaxation == "compare":
            yield ("relaxation",), "compare takes one bound on L; choose one relaxation for gamma against |L|"
        if self.trade and self.weight is not None:
            yield ("weight",), "is of lipschitz against gamma; gamma against |L| has none: leave it out"
        if self.trade and isinstance(self.rate, Range):
            yield (self.pace.key,), f"gamma against |L| is a curve at one {self.pace.key}: give a number"
        if self.relaxation != "s-procedure" and self.bounds.poles is not None:
            yield ("relaxation",), "poles and implementation.impose are proved by the s-procedure only; choose it"
        for name, value in (("weight", self.weight), (self.pace.key, self.rate)):
            if self.relaxation == "compare" and isinstance(value, Range):
                yield (name,), "compare takes a number, not a range; choose one relaxation for a curve"


def request(reader: Reader, section: LipschitzObserver, problem: asked.Estimation) -> LipschitzRequest:
    """Return the request, held against what the family knows."""
    request = LipschitzRequest(
        type=section.type,
        lipschitz=tuple(constant for block in problem.nonlinearities for constant in block.lipschitz),
        relaxation=section.relaxation,
        objective=section.objective,
        weight=read_weight(reader, section),
        rate=read_rate(reader, section, problem.period),
        pace=DECAY if problem.period is None else RHO,
        filtered=section.filtered,
        slack=asked.read_slack(reader, section.slack),
        bounds=replace(read_bounds(reader, section.bounds), poles=read_poles(reader, section.poles, problem)),
        gains=asked.read_gains(reader, section.gains, {"L": (problem.states, problem.outputs)}),
        drive="v" if problem.generator is not None and len(problem.generator.Am) else "w",
        trade=asked.read_trade(reader, section.bounds, "L", section.objective, problem),
    )
    asked.refuse_conflicts(reader, request)
    if problem.period is not None:
        require_s_procedure(reader, request)
    if request.gains:
        asked.note_unused(reader, section, ("slack", "bounds"), asked.AS_GIVEN)
    require_lipschitz(reader, request, problem)
    return request


def read_rate(reader: Reader, section: LipschitzObserver, period: fmpq | None) -> fmpq | Range:
    """Decay rate, or 1 - rho; a range for pareto only."""
    name, written = section.written("decay", period)
    if isinstance(written, asked.Interval) and section.objective != "pareto":
        said = f"objective {section.objective} needs a number; a range is for pareto"
        reader.wrong(("observer", name), said, id="OBS215")
    found = rates.read_rate(reader, section, "decay", period, ">= 0")
    return ZERO if found is None else found


def require_s_procedure(reader: Reader, request: LipschitzRequest) -> None:
    """Refuse relaxations that are theorems of continuous time."""
    if request.relaxation in UNSTRUCTURED:
        name, several = request.relaxation, request.relaxation == "compare"
        what, whose = (f"{name} is of theorems", "their") if several else (f"{name} is a theorem", "its")
        said = f"{what} of continuous time; in discrete time the s-procedure takes {whose} place"
        reader.wrong(("observer", "relaxation"), said, id="OBS406")


def read_weight(reader: Reader, section: LipschitzObserver) -> fmpq | Range | None:
    """Weight of 1 / lipschitz against gamma^2, or where it is scanned."""
    loc: Loc = ("observer", "weight")
    if section.weight is None:
        several = isinstance(section.bounds, LipschitzBounds) and isinstance(section.bounds.L, asked.Sizes)
        if section.objective == "pareto" and not several:
            reader.wrong(loc, "is required for pareto; give a number in [0, 1], or {min: 0, max: 1}", id="OBS205")
        return None
    if section.objective != "pareto":
        reader.wrong(loc, f"belongs to objective pareto, not to {section.objective}", at_key=True, id="OBS213")
    weight = asked.read_searched(reader, section.weight, loc, ">= 0", ">= 0")
    place = (*loc, "max") if isinstance(section.weight, asked.Interval) else loc
    if (largest := ends(weight)[1]) > 1:
        reader.wrong(place, f"{float(largest):g} is above 1; a weight is in [0, 1]", id="OBS208")
    return weight


def read_bounds(reader: Reader, section: LipschitzBounds | str | None) -> Bounds:
    """Largest gain and level, and least storage function."""
    if not isinstance(section, LipschitzBounds):
        return NO_BOUNDS
    gain, norm = asked.read_largest_gain(reader, section.L, "L")
    least = asked.read_bound(reader, section.P.min, "P", "min") if section.P else None
    return Bounds(gain, norm, gamma=asked.read_bound(reader, section.gamma, "gamma"), floor=least)


def nonlinearities(
    reader: Reader, plant: Sequence[Nonlinearity | None], model: Sequence[Nonlinearity | None]
) -> tuple[Nonlinearity, ...]:
    """Blocks with the multipliers |df| <= k |dq| of their constants, for a block or for each of its components.

    `plant`, `model`: blocks of the plant and of the disturbance model; None after an error.
    """
    found = []
    for i, block in enumerate((*plant, *model)):
        place: Loc = ("nonlinearities", i, "type") if i < len(plant) else ("disturbance",)
        if block is not None and not block.lipschitz:
            instead = "give {lipschitz: k}, or {lipschitz: auto} with f and a region"
            reader.wrong(
                place, f"{block.type} has no Lipschitz constant that type lipschitz knows; {instead}", id="OBS406"
            )
        elif block is not None:
            found.append(read_as_lipschitz(reader, block, place))
    return tuple(found)


def read_as_lipschitz(reader: Reader, block: Nonlinearity, place: Loc) -> Nonlinearity:
    """One block with the multiplier of its constants, and a note where it was declared by another type."""
    constants = block.lipschitz
    whole = (block.multiplier.member.shape[1], block.multiplier.member.shape[0])
    sizes = [whole] if len(constants) == 1 else [(1, 1)] * len(constants)
    if not block.type.startswith("lipschitz"):
        values = ", ".join(f"{float(k):g}" for k in constants)
        reader.notes.append(f"{block.term or dotted(place)}: {block.type} is read as lipschitz {values}")
    return replace(block, multiplier=combine(lipschitz(k, *size) for k, size in zip(constants, sizes, strict=True)))


def demand(spec: Spec) -> Demand:
    """Decay at the least rate that is asked for, for the declared constants; max-lipschitz is content with any."""
    request, sizes = request_of(spec), [(block.nq, block.nf) for block in spec.multiplier.blocks]
    part = 0 if request.objective == "max-lipschitz" else 1
    assumed = combine(lipschitz(part * k, *size) for k, size in zip(request.lipschitz, sizes, strict=True))
    largest, none = None if request.gains else request.bounds.L1, 0 * (spec.posed.Cq @ spec.posed.C.T)
    return Demand(Edge(request.rates[0], request.pace.sampled), assumed, request.pace, "L", largest, none)


def request_of(spec: Spec) -> LipschitzRequest:
    """What a spec of this family asks for."""
    assert isinstance(spec.observer, LipschitzRequest)
    return spec.observer


SECTION = LipschitzObserver
RESULTS = {
    "guarantee": (
        *("lipschitz", "constants", "gamma", "gamma_v", "decay", "rho", "alpha", "mu1", "mu2", "margin"),
        *("poles", "implementation", "limit", "limit_bounded", "admissible", "ceiling", "comparison", "widened"),
    ),
    "observer": (
        *("L", "relaxation", "estimate", "period", "poles", "fastest", "largest_step", "noise_gain", "condition_P"),
    ),
}
