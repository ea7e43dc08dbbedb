"""What a user may have meant where a spec has no design: each change is tried, and told only if it is certified."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any, cast

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import Bounds, Range
from obsdesign.dissipation.decimals import round_down, round_up
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.pace import ALPHA, DECAY, RHO
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.families import FAMILIES
from obsdesign.families.outcome import Diagnosis, Outcome, Verdict
from obsdesign.lmi.formula import printed
from obsdesign.nonlinearities import TEMPLATES
from obsdesign.nonlinearities.evidence.automatic import choose
from obsdesign.nonlinearities.evidence.restriction import EVERYWHERE, Ends
from obsdesign.spec import Nonlinearity, Spec

SIZES = (1e3, 1e5)  # of a gain, that are tried where nothing bounds it
ROOM = (0.02, 0.15, 0.5)  # relative, beyond what is necessary
Limits = tuple[fmpq, fmpq]
Change = tuple[str, dict[str, Any]]  # in words, and of a request
LARGE = 16  # order from which smaller regions are not tried, which takes minutes
SHARES = (fmpq(1, 2), fmpq(1, 10), fmpq(1, 100))  # of a region, or half-widths where it has no end


def advised(spec: Spec, outcome: Outcome, engine: Engine) -> Outcome:
    """Outcome whose suggestion begins with what was found to be certified instead."""
    parts = (
        other_sign(spec, engine),
        smaller_region(spec, engine, outcome.diagnosis),
        within_reach(spec, outcome.diagnosis, engine),
    )
    found = [said for part in parts for said in part]
    if not found:
        return outcome
    known = outcome.diagnosis.get("suggestion")
    suggestion = "; ".join([*found, *([known] if known else [])])
    return replace(outcome, diagnosis={**outcome.diagnosis, "suggestion": suggestion})


def within_bounds(spec: Spec, error: UndecidedError, engine: Engine) -> UndecidedError:
    """Error of a design whose gain nothing bounds, with a bound that does; at once the same where a range is asked."""
    request, problem = cast("Any", spec.observer), error.problems[0]
    bounds = getattr(request, "bounds", None)
    searched = any(isinstance(value, Range) for value in vars(request).values())
    if problem.id != "OBS507" or searched or not isinstance(bounds, Bounds) or bounds.L1 or request.gains:
        return error
    name = next(name for name in ("L1", "L") if name in FAMILIES[request.type].results["observer"])
    for size in SIZES:
        bounded = replace(request, bounds=replace(bounds, L1=printed(size)))
        if certified(replace(spec, observer=bounded), engine):
            said = f"{problem.message}; give `bounds: {{{name}: {size:g}}}`, with which there is a solution"
            return UndecidedError(said, id="OBS507")
    return error


def without_diagnosis(_: float, doing: str) -> None:
    """End a trial where the search for a reason begins: that it fails is all that is asked."""
    if doing == "diagnosis":
        raise UndecidedError("a trial has no diagnosis", id="OBS507")


def certified(spec: Spec, engine: Engine) -> bool:
    """Whether a spec is certified."""
    trial = Engine(engine.solver, without_diagnosis)
    try:
        return FAMILIES[spec.observer.type].design(spec, trial).status is Verdict.CERTIFIED
    except (UsageError, UndecidedError):
        return False
    finally:
        engine.solves += trial.solves


def other_sign(spec: Spec, engine: Engine) -> Iterator[str]:
    """Gains that were given with the sign of another convention."""
    gains = spec.observer.gains or {}
    some = tuple(name for name, gain in gains.items() if gain.any())
    for turned in dict.fromkeys((some[:1], some)) if some else ():
        changed = {name: -gain if name in turned else gain for name, gain in gains.items()}
        request = replace(cast("Any", spec.observer), gains=changed)
        if certified(replace(spec, observer=request), engine):
            names = ", ".join(f"-{name}" for name in turned)
            multiplied = FAMILIES[spec.observer.type].Section.residual
            yield f"give {names}: with the opposite sign they are certified, since gains multiply {multiplied} here"
            return


def smaller_region(spec: Spec, engine: Engine, diagnosis: Diagnosis) -> Iterator[str]:
    """Regions on which the types that were derived from f are tight enough: of its arguments, or of inputs in terms."""
    found = derived(spec)
    if not found or spec.posed.n >= LARGE:
        return
    ways = [narrowed, *([narrowed_inputs] if any(inputs(spec.nonlinearities[i], spec) for i in found) else [])]
    for narrow, share in product(ways, SHARES):
        blocks, said, domain = list(spec.nonlinearities), [], dict[str, Limits]()
        for i in found:
            region = narrow(blocks[i], share, spec)
            if blocks[i].term:
                domain = met(domain, in_signals(spec, i, region))
            else:
                said.append(f"region: {{{in_words(in_arguments(blocks[i], region))}}} for nonlinearities[{i}]")
            blocks[i] = on_region(blocks[i], region)
        said += [f"system.domain: {{{in_words(domain)}}}"] if domain else []
        sayable = all(low < high for low, high in domain.values())
        if said and sayable and certified(replace(spec, nonlinearities=tuple(blocks)), engine):
            yield f"{too_wide(spec, diagnosis)}: there is a solution with {' and '.join(said)}"
            return


def derived(spec: Spec) -> Sequence[int]:
    """Nonlinearities whose types follow from f on a region, for a family that uses them."""
    if FAMILIES[spec.observer.type].unstructured:
        return ()
    return [i for i, block in enumerate(spec.nonlinearities) if block.f and block.type.endswith("(auto)")]


def too_wide(spec: Spec, diagnosis: Diagnosis) -> str:
    """What a smaller region leaves out: the member that hides a mode, or the derived types as they are."""
    called = [block.term or f"f of nonlinearities[{i}]" for i, block in enumerate(spec.nonlinearities)]
    if failing := diagnosis.get("member"):
        return f"a smaller region is without {failing}"
    types = " or ".join(f"{spec.nonlinearities[i].type.removesuffix(' (auto)')} of {called[i]}" for i in derived(spec))
    return f"the type {types} is too wide"


def in_words(limits: Mapping[str, Limits]) -> str:
    """Limits of variables as a spec has them."""
    return ", ".join(f"{name}: [{float(low):g}, {float(high):g}]" for name, (low, high) in limits.items())


def in_arguments(block: Nonlinearity, region: Mapping[str, Limits]) -> dict[str, Limits]:
    """Limits of the argument of a block by its name in a spec."""
    return {("q" if block.nq == 1 and name == "q1" else name): ends for name, ends in region.items()}


def in_signals(spec: Spec, i: int, region: Mapping[str, Limits]) -> dict[str, Limits]:
    """Limits of signals of the plant that keep what a term depends on in a region."""
    plant, block = spec.plant, spec.nonlinearities[i]
    first = sum(earlier.nq for earlier in spec.nonlinearities[:i])
    found: dict[str, Limits] = {name: ends for name, ends in region.items() if name in spec.inputs}
    for k, row in enumerate(np.hstack([plant.Cq, plant.Dq])[first : first + block.nq], start=1):
        if f"q{k}" in region and row.any():
            weights = {name: c for name, c in zip((*plant.states, *plant.exogenous), row, strict=True) if c}
            found = met(found, box(weights, region[f"q{k}"]))
    return found


def box(weights: Mapping[str, fmpq], ends: Limits) -> dict[str, Limits]:
    """Limits of signals that keep a weighted sum of them within its own, around zero where there are several."""
    low, high = ends
    if len(weights) == 1:
        [(name, c)] = weights.items()
        return {name: (min(low / c, high / c), max(low / c, high / c))}
    half = printed(round_down(float(max(min(-low, high), fmpq(0)) / sum(map(abs, weights.values()), fmpq(0))), 4))
    return dict.fromkeys(weights, (-half, half))


def met(one: Mapping[str, Limits], other: Mapping[str, Limits]) -> dict[str, Limits]:
    """Ranges within both."""
    shared = {n: (max(one[n][0], other[n][0]), min(one[n][1], other[n][1])) for n in one.keys() & other.keys()}
    return {**one, **other, **shared}


def inputs(block: Nonlinearity, spec: Spec) -> dict[str, Ends]:
    """Ranges of the inputs on which the type of a term rests."""
    known = block.others.items() if block.term else ()
    return {name: ends for name, ends in known if name in spec.inputs and None not in ends}


def narrowed_inputs(block: Nonlinearity, share: fmpq, spec: Spec) -> dict[str, Limits]:
    """Smaller ranges of inputs."""
    return {name: part(ends, share) for name, ends in inputs(block, spec).items()}


def narrowed(block: Nonlinearity, share: fmpq, spec: Spec) -> dict[str, Limits]:  # noqa: ARG001
    """Smaller region of the argument."""
    return {f"q{k + 1}": part(ends, share) for k, ends in enumerate(block.region or (EVERYWHERE,) * block.nq)}


def part(ends: Ends, share: fmpq) -> Limits:
    """Smaller range around zero, or around its middle where zero is outside it."""
    low, high = ends
    outside = (low is not None and low > 0) or (high is not None and high < 0)
    if low is None or high is None:
        start = (low if low is not None else high) if outside else fmpq(0)
        return (
            start - share if low is None else max(low, start - share),
            start + share if high is None else min(high, start + share),
        )
    middle = (low + high) / 2 if outside else fmpq(0)
    return middle - share * (middle - low), middle + share * (high - middle)


def within_reach(spec: Spec, diagnosis: Diagnosis, engine: Engine) -> Iterator[str]:
    """A rate, a gamma or a free L2 that does, where a diagnosis says what is necessary only."""
    request = cast("Any", spec.observer)
    for said, change in (*slower(request, diagnosis), *larger(request, diagnosis), *free_injection(request, diagnosis)):
        if certified(replace(spec, observer=replace(request, **change)), engine):
            yield f"{said}, with which there is a solution"
            return


def slower(request: Any, diagnosis: Diagnosis) -> Iterator[Change]:
    """Rates below that of a mode which no gain makes faster."""
    feasible, key = diagnosis.get("feasible", {}), "rate" if hasattr(request, "rate") else "decay"
    named = {pace.bound: pace for pace in (ALPHA, DECAY, RHO)}
    named |= {"alpha": ALPHA} if diagnosis["condition"] == "zero dynamics" else {}
    for pace, limit in ((named[name], feasible[name]) for name in named if name in feasible):
        for rate in (pace.found(pace.rounded(pace.told(limit) * (1 - room), 3)) for room in ROOM):
            yield f"ask for {pace.slower(float(rate), 3)}", {key: rate}


def larger(request: Any, diagnosis: Diagnosis) -> Iterator[Change]:
    """Levels of gamma above the least that is possible."""
    levels = diagnosis["gamma"] if diagnosis["condition"] == "gamma" and hasattr(request, "bounds") else {}
    least = float(levels.get("bounded", levels.get("least", 0)))
    for value in (round_up(least * (1 + room), 4) for room in ROOM) if levels else ():
        bounded = {"bounds": replace(request.bounds, gamma=printed(value))}
        objective = getattr(request, "gamma", None) is not None
        yield f"ask for gamma at least {value:g}", {"gamma": printed(value)} if objective else bounded


def free_injection(request: Any, diagnosis: Diagnosis) -> Iterator[Change]:
    """L2 left to the tool, where one that is given is in the way."""
    if diagnosis["condition"] in {"passivity", "noise"} and request.L2 is not None and not request.gains:
        yield "ask for `L2: free`", {"L2": None}


def on_region(block: Nonlinearity, region: dict[str, Limits]) -> Nonlinearity:
    """Block with the type that is derived on a region; raises `UsageError` if there is none."""
    assert block.f
    choice = choose(block.restricted(region))
    template = TEMPLATES[choice.name]
    constants = template.constants(choice.data, block.nq)
    multiplier = template(choice.data, block.nq, len(block.f))
    own = tuple(region[f"q{k + 1}"] for k in range(block.nq)) if "q1" in region else block.region
    others = {name: region.get(name, ends) for name, ends in block.others.items()}
    return replace(block, multiplier=multiplier, region=own, others=others, lipschitz=constants)
