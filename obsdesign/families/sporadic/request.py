"""What a spec asks where measurements arrive sporadically, in its numbers."""

from collections.abc import Iterator, Mapping
from typing import ClassVar

from flint import fmpq

from obsdesign.dissipation.bounds import SLACK, Bounds, Range, Trade, ends
from obsdesign.dissipation.pace import DECAY
from obsdesign.families import asked
from obsdesign.families.frozen import Demand
from obsdesign.families.sporadic.clock.bernstein import FARTHEST, LARGEST_DEGREE, MOST_SEGMENTS, SHAPE, Shape
from obsdesign.families.sporadic.section import (
    CLOCK,
    INJECTIONS,
    ClockSection,
    SporadicBounds,
    SporadicObjective,
    SporadicObserver,
)
from obsdesign.lmi.formula import Array, printed
from obsdesign.model.edge import Edge
from obsdesign.records import dataclass, replace
from obsdesign.sections.document import Loc
from obsdesign.sections.values import Reader
from obsdesign.spec import Spec

EXPONENTS = Range(fmpq(1, 1000), fmpq(100), points=40, log=True)  # delta T2 that are tried if the spec does not say
ABOVE_DECAY = ("proposition-3", "proposition-5")  # need delta > 2 decay
ABOVE = fmpq(1001, 1000)  # least delta / (2 decay) for them
RANGED = {"max-T2": "T2", "max-decay": "decay"}  # objective: the key that must be a range
INSTEAD = "; a w of finite energy has no value at an instant: what disturbs a sample is simulation.noise"
ABSENT = ("D", "Dq", "Dqf", "Df")


@dataclass(frozen=True)
class SporadicRequest:
    """The `observer` section of a spec for the family whose measurements arrive sporadically."""

    reconstruct: ClassVar[bool] = False
    filtered: ClassVar[bool] = False

    type: str
    T1: fmpq  # s, shortest interval between measurements
    T2: fmpq | Range  # s, longest
    decay: fmpq | Range  # lambda_t, 1/s
    delta: Range  # where the free exponent of the storage function is searched; a number is a range of itself
    injections: tuple[str, ...]  # of INJECTIONS, a curve each
    relaxations: tuple[str, ...]  # of these injections, a curve each; empty: the tightest of each
    objective: SporadicObjective = "min-gamma"
    slack: fmpq = SLACK
    largest_gain: fmpq | None = None  # bounds.L, spectral
    largest_gamma: fmpq | None = None
    largest_reset: fmpq | None = None  # bounds.K, spectral
    gains: Mapping[str, Array] | None = None  # L (n, ny) and H (ny, ny), or K (n, ny): analysis of these
    shape: Shape = SHAPE  # of clock-dependent storage functions
    delta_given: bool = False  # whether the spec says where delta is searched
    shape_given: bool = False  # .. and what the storage functions of the time left are
    drive: str = "w"  # v where a disturbance model generates w
    gap: bool = False  # whether K depends on the interval that has just ended
    trade: Trade | None = None  # gamma against |L|, or |K|, whose knee is shipped

    def within(self, size: fmpq) -> "SporadicRequest":
        """The same for the least gamma with a gain of at most a size."""
        assert self.trade
        key = "largest_reset" if self.trade.gain == "K" else "largest_gain"
        return replace(self, objective="min-gamma", trade=None, **{key: size})

    @property
    def restrictions(self) -> list[str]:
        """Bounds on what a design may use, in words."""
        return [*Bounds(L1=self.largest_gain).words("L"), *Bounds(L1=self.largest_reset).words("K")]

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Injection and relaxation of each curve, in the order of the request, each once."""
        wanted = {name: self.relaxations or INJECTIONS[name][:1] for name in self.injections}
        found = ((name, r) for name, relaxations in wanted.items() for r in relaxations if r in INJECTIONS[name])
        return tuple(dict.fromkeys(found))

    def parts(self) -> "Iterator[SporadicRequest]":
        """The same request of clock-dependent certificates alone, and of propositions alone, as far as it has such."""
        for clocked in (True, False):
            pairs = [(name, relaxation) for name, relaxation in self.pairs if (relaxation == CLOCK) == clocked]
            injections, relaxations = (
                (tuple(dict.fromkeys(words)) for words in zip(*pairs, strict=True)) if pairs else ((), ())
            )
            if pairs:
                yield self.part(injections, relaxations)

    def older(self) -> "SporadicRequest | None":
        """The same request of the tightest propositions, which need a gain L; None where there is none."""
        injections = tuple(name for name in self.injections if len(INJECTIONS[name]) > 1)
        if not injections or "K" in (self.gains or {}):
            return None
        relaxations = tuple(dict.fromkeys(INJECTIONS[name][1] for name in injections))
        return self.part(injections, relaxations)

    def part(self, injections: tuple[str, ...], relaxations: tuple[str, ...]) -> "SporadicRequest":
        """The same request of some injections and relaxations, without what is for others."""
        shaped = self.shape_given and CLOCK in relaxations
        made = replace(self, injections=injections, relaxations=relaxations, shape_given=shaped)
        return made if "reset" in injections else replace(made, largest_reset=None, gap=False)

    @property
    def clocked(self) -> bool:
        """Whether every curve is of clock-dependent certificates."""
        return all(relaxation == CLOCK for _, relaxation in self.pairs)

    def conflicts(self) -> Iterator[tuple[tuple[str, ...], str]]:
        """Relaxations that fit none of the injections, or else injections that have none of the relaxations."""
        if self.delta_given and self.pairs and self.clocked:
            yield ("delta",), "is the exponent of a proposition; relaxation clock has none: leave `delta` out"
        if self.shape_given and self.pairs and not any(relaxation == CLOCK for _, relaxation in self.pairs):
            yield ("clock",), "is the storage function of relaxation clock, which is not asked for: leave `clock` out"
        yield from self.idle()
        yield from self.several()
        known = "; ".join(f"{name} takes {', '.join(relaxations)}" for name, relaxations in INJECTIONS.items())
        fitting = {relaxation for _, relaxation in self.pairs}
        strays = [relaxation for relaxation in self.relaxations if relaxation not in fitting]
        for relaxation in strays:
            yield ("relaxation",), f"{relaxation} is for another injection than {', '.join(self.injections)}; {known}"
        for name in self.injections if not strays else ():
            if name not in {injection for injection, _ in self.pairs}:
                yield ("injection",), f"{name} has none of the relaxations that are listed; {known}"

    def several(self) -> Iterator[tuple[tuple[str, ...], str]]:
        """What a curve of gamma against the gain has one of."""
        if self.trade is None or self.gains:
            return
        if len(self.injections) > 1 or self.gap:
            yield ("bounds",), "gamma against the gain is a curve of one injection with one constant gain"
        for name in ("T2", "decay"):
            if isinstance(getattr(self, name), Range):
                yield (name,), f"gamma against the gain is a curve at one {name}: give a number"

    def idle(self) -> Iterator[tuple[tuple[str, ...], str]]:
        """Bounds, and a K that depends on the interval, of an injection that is not asked for."""
        resets, holds = "reset" in self.injections, set(self.injections) != {"reset"}
        if self.largest_reset is not None and not resets:
            yield ("bounds", "K"), "bounds K of injection reset, which is not asked for; give `bounds.L`"
        if self.largest_gain is not None and not holds:
            yield ("bounds", "L"), "bounds L, and injection reset has the gain K; give `bounds.K`"
        if self.gap and not resets:
            yield ("clock", "gain"), "gap is for injection reset, which is not asked for; leave it out"
        if self.gap and self.gains:
            yield ("clock", "gain"), "gap is for a gain that is designed; K of `gains` is constant: leave it out"


def request(reader: Reader, section: SporadicObserver, problem: asked.Estimation) -> SporadicRequest:
    """Return the request, held against what the family knows."""
    loc: Loc = ("observer",)
    T1 = reader.number(section.T1, (*loc, "T1"), ">= 0")
    T2 = asked.read_searched(reader, section.T2, (*loc, "T2"), "> 0")
    decay = asked.read_searched(reader, section.decay or "0", (*loc, "decay"), ">= 0")
    require_ordered(reader, T1, T2)
    relaxations, injections = chosen(section)
    require_sampled(reader, problem, clocked=set(relaxations) <= {CLOCK})
    bounds = (
        section.bounds if isinstance(section.bounds, SporadicBounds) else SporadicBounds(L=None, K=None, gamma=None)
    )
    gain = "K" if injections == ("reset",) else "L"
    trade = asked.read_trade(reader, section.bounds, gain, section.objective, problem)
    require_ranges(reader, section, T2, decay, alone=trade is None)
    request = SporadicRequest(
        type=section.type,
        T1=T1,
        T2=T2,
        decay=decay,
        delta=read_delta(reader, section, T2, decay, relaxations),
        injections=injections,
        relaxations=relaxations,
        objective=section.objective,
        slack=asked.read_slack(reader, section.slack),
        largest_gain=asked.read_largest_gain(reader, bounds.L, "L")[0],
        largest_gamma=asked.read_bound(reader, bounds.gamma, "gamma"),
        largest_reset=asked.read_largest_gain(reader, bounds.K, "K")[0],
        gains=read_gains(reader, section, problem),
        shape=read_shape(reader, section.clock, T1, T2),
        drive="v" if problem.generator is not None and len(problem.generator.Am) else "w",
        delta_given=section.delta is not None,
        shape_given=section.clock is not None,
        gap=section.clock is not None and section.clock.gain == "gap",
        trade=trade,
    )
    asked.refuse_conflicts(reader, request)
    if request.gains:
        asked.note_unused(reader, section, ("slack", "bounds"), asked.AS_GIVEN)
    elif request.objective == "feasibility":
        asked.note_unused(reader, section, ("slack",), "feasibility has no optimum")
    return request


def chosen(section: SporadicObserver) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Relaxations, and the injections that they are for: `delta` alone means the propositions."""
    relaxations, injections = listed(section.relaxation), listed(section.injection)
    if not injections and section.gains and section.gains.K is not None:
        injections = ("reset",)
    if not relaxations and section.delta is not None:
        relaxations = tuple(INJECTIONS[name][1] for name in injections or ("dynamic",) if len(INJECTIONS[name]) > 1)
    return relaxations, injections or fitting(relaxations)


def read_gains(reader: Reader, section: SporadicObserver, problem: asked.Estimation) -> Mapping[str, Array] | None:
    """Gains to be analyzed: L and H, or K of a reset; one without the other."""
    if section.gains is None:
        return None
    loc: Loc = ("observer", "gains")
    resets = "reset" in listed(section.injection) or (not section.injection and section.gains.K is not None)
    stray = [name for name in ("L", "H") if resets and getattr(section.gains, name) is not None]
    stray += ["K"] if not resets and section.gains.K is not None else []
    for name in stray:
        has = "has the gain K alone" if resets else "has the gains L and H"
        reader.wrong(
            (*loc, name), f"is no gain of this injection: {'reset' if resets else 'one that holds'} {has}", id="OBS206"
        )
    if not resets and section.gains.L is None and not stray:
        reader.wrong(loc, "L is missing; give {L: .., H: ..}, or {K: ..} with injection reset", id="OBS201")
    if resets and section.gains.K is None and not stray:
        reader.wrong(loc, "K is missing; injection reset has the gain K, {K: ..}", id="OBS201")
    states, outputs = problem.states, problem.outputs
    sizes = {"K": (states, outputs)} if resets else {"L": (states, outputs), "H": (outputs, outputs)}
    return asked.read_gains(reader, section.gains, sizes)


def read_shape(reader: Reader, section: ClockSection | None, T1: fmpq, T2: fmpq | Range) -> Shape:
    """Degree and segments, and how far the storage function looks ahead."""
    if section is None:
        return Shape()
    loc: Loc = ("observer", "clock")
    degree = reader.integer(section.degree, (*loc, "degree"), 4, 1, LARGEST_DEGREE)
    segments = reader.integer(section.segments, (*loc, "segments"), 2, 1, MOST_SEGMENTS)
    lookahead = reader.integer(section.lookahead, (*loc, "lookahead"), 1, 1, FARTHEST)
    if lookahead > 1 and not T1 and reader.clean(("observer", "T1")):
        reader.wrong((*loc, "lookahead"), f"{lookahead} needs T1 > 0; for T1 = 0 it gains nothing, give 1", id="OBS208")
    if section.gain == "gap" and not 0 < T1 < ends(T2)[0] and reader.clean(("observer", "T1")):
        where = "T1 > 0" if not T1 else "T2 above T1, intervals of different lengths"
        reader.wrong((*loc, "gain"), f"gap needs {where}; give constant", id="OBS208")
    if section.gain == "gap" and lookahead > 1:
        reader.wrong((*loc, "lookahead"), f"{lookahead} is for a constant gain; with gain: gap give 1", id="OBS208")
    return Shape(degree, segments, lookahead)


def require_sampled(reader: Reader, problem: asked.Estimation, *, clocked: bool) -> None:
    """Refuse what the family does not know: a w or an f that acts on a sample.

    The propositions know no f of f or of w either, and no disturbance model.
    """
    modelled = problem.generator is not None and len(problem.generator.Am) > 0
    if modelled and not clocked:
        said = "the propositions take no disturbance model; relaxation clock does: leave `relaxation` and `delta` out"
        reader.wrong(("observer", "type"), said, id="OBS406")
    for name in ("D", "Df") if clocked else ABSENT:
        if name == "D" and modelled and not through(problem):
            continue
        for place, said in problem.refused(name, "type sporadic"):
            reader.wrong(place, f"{said}{INSTEAD if name == 'D' else ''}", id="OBS406")


def through(problem: asked.Estimation) -> bool:
    """Whether what drives a disturbance model acts on y at once."""
    plant, generator = problem.plant, problem.generator
    if plant is None or generator is None:
        return False
    return bool((plant.D @ generator.Dm != 0).any() or (plant.D @ generator.Dwf != 0).any())


def listed(written: str | list[str] | None) -> tuple[str, ...]:
    """One word or several as a tuple."""
    return () if written is None else (written,) if isinstance(written, str) else tuple(written)


def require_ordered(reader: Reader, T1: fmpq, T2: fmpq | Range) -> None:
    """Refuse T2 below T1."""
    if ends(T2)[1] < T1 and reader.clean(("observer", "T1")) and reader.clean(("observer", "T2")):
        largest = f"{float(ends(T2)[1]):g}"
        reader.wrong(
            ("observer", "T2"), f"{largest} is below T1 = {float(T1):g}; a longest interval is at least T1", id="OBS208"
        )


def require_ranges(
    reader: Reader, section: SporadicObserver, T2: fmpq | Range, decay: fmpq | Range, *, alone: bool
) -> None:
    """Refuse a search without a range to search; `alone`: whether there is no curve over the gain."""
    found = {"T2": T2, "decay": decay}
    key = RANGED.get(section.objective)
    if key and not isinstance(found[key], Range):
        reader.wrong(
            ("observer", key), f"objective {section.objective} needs a range; give {{min: .., max: ..}}", id="OBS215"
        )
    if section.objective == "pareto" and alone and not any(isinstance(value, Range) for value in found.values()):
        reader.wrong(("observer", "objective"), "pareto needs a range of T2 or of decay", id="OBS215")


def fitting(relaxations: tuple[str, ...]) -> tuple[str, ...]:
    """Injections where none is named: dynamic, and hold as far as its proposition is listed."""
    found = tuple(name for name in ("dynamic", "hold") if set(INJECTIONS[name][1:]) & set(relaxations))
    return found or ("dynamic",)


def read_delta(
    reader: Reader, section: SporadicObserver, T2: fmpq | Range, decay: fmpq | Range, relaxations: tuple[str, ...]
) -> Range:
    """Where delta is searched; the design cuts the range for a relaxation that needs delta > 2 decay."""
    loc: Loc = ("observer", "delta")
    if section.delta is None:
        shortest = ends(T2)[0] or fmpq(1)  # zero is refused elsewhere
        return replace(EXPONENTS, low=EXPONENTS.low / shortest, high=EXPONENTS.high / shortest)
    delta = asked.read_searched(reader, section.delta, loc, "> 0")
    low, high = ends(delta)
    least = 2 * ends(decay)[0]
    bound = [name for name in relaxations if name in ABOVE_DECAY] or (
        ["proposition-5"] if "hold" in listed(section.injection) else []
    )
    if bound and not section.gains and high < least * ABOVE and reader.clean(loc):
        reader.wrong(loc, f"{bound[0]} needs delta above 2 decay = {float(least):g}; give a larger one", id="OBS208")
    return delta if isinstance(delta, Range) else Range(low, high, points=1)


def demand(spec: Spec) -> Demand:
    """Decay at the least decay that is asked for, for every f of its type."""
    request, none = request_of(spec), 0 * (spec.augmented.Cq @ spec.augmented.C.T)
    largest = None if request.gains or request.clocked else request.largest_gain
    edge = Edge(printed(ends(request.decay)[0]))
    return Demand(edge, spec.multiplier, DECAY, "L", largest, none, "Theorem 2")


def request_of(spec: Spec) -> SporadicRequest:
    """What a spec of this family asks for."""
    assert isinstance(spec.observer, SporadicRequest)
    return spec.observer


SECTION = SporadicObserver
RESULTS = {
    "guarantee": (
        *("gamma", "decay", "T1", "T2", "T2_max", "limit", "limit_bounded", "jitter", "mu"),
        *("kind", "rate", "overshoot", "initial", "disturbance", "noise", "outage"),
    ),
    "observer": ("L", "H", "K", "K_of_gap", "T1", "T2", "delta", "multipliers", "contraction", "noise_gain"),
}
