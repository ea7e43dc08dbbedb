"""What a user may have meant where a spec is infeasible: each change is tried, and told only if it is certified."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, cast

from flint import fmpq

from obsdesign.dissipation.decimals import round_down, round_up
from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.families import FAMILIES
from obsdesign.families.outcome import Diagnosis, Outcome, Verdict
from obsdesign.lmi.formula import printed
from obsdesign.nonlinearities import TEMPLATES
from obsdesign.nonlinearities.evidence.automatic import choose
from obsdesign.nonlinearities.evidence.restriction import EVERYWHERE, SINCE_ZERO, Ends, Restriction
from obsdesign.spec import Nonlinearity, Spec

ROOM = (0.02, 0.15, 0.5)  # relative, beyond what is necessary
Change = tuple[str, dict[str, Any]]  # in words, and of a request
SHARES = (fmpq(1, 2), fmpq(1, 10), fmpq(1, 100))  # of a region, or half-widths where it has no end


def advised(spec: Spec, outcome: Outcome, engine: Engine) -> Outcome:
    """Outcome whose suggestion begins with what was found to be certified instead."""
    tried = (other_sign(spec, engine), smaller_region(spec, engine), within_reach(spec, outcome.diagnosis, engine))
    found = [said for part in tried for said in part]
    if not found:
        return outcome
    known = outcome.diagnosis.get("suggestion")
    suggestion = "; ".join([*found, *([known] if known else [])])
    return replace(outcome, diagnosis={**outcome.diagnosis, "suggestion": suggestion})


def certified(spec: Spec, engine: Engine) -> bool:
    """Whether a spec is certified."""
    trial = Engine(engine.solver)
    try:
        return FAMILIES[spec.observer.type].design(spec, trial).status is Verdict.CERTIFIED
    except (UsageError, UndecidedError):
        return False
    finally:
        engine.solves += trial.solves


def other_sign(spec: Spec, engine: Engine) -> Iterator[str]:
    """Gains that were given with the sign of another convention."""
    gains = spec.observer.gains or {}
    if not gains:
        return
    opposite = {name: -gain if name == next(iter(gains)) else gain for name, gain in gains.items()}
    for changed in (opposite, {name: -gain for name, gain in gains.items()}):
        request = replace(cast("Any", spec.observer), gains=changed)
        if certified(replace(spec, observer=request), engine):
            names = ", ".join(f"-{name}" for name in gains if (changed[name] != gains[name]).any())
            multiplied = FAMILIES[spec.observer.type].Section.residual
            yield f"give {names}: with the opposite sign they are certified, since gains multiply {multiplied} here"
            return


def smaller_region(spec: Spec, engine: Engine) -> Iterator[str]:
    """Regions on which the types that were derived from f are tight enough."""
    derived = [i for i, block in enumerate(spec.nonlinearities) if block.f and block.type.endswith("(auto)")]
    if not derived or FAMILIES[spec.observer.type].unstructured:
        return
    for share in SHARES:
        blocks, said, domain = list(spec.nonlinearities), [], dict[str, str]()
        for i in derived:
            region = narrowed(blocks[i], share)
            blocks[i] = on_region(blocks[i], region)
            names = blocks[i].arguments or (["q"] if len(region) == 1 else list(region))
            ends = ((float(low or 0), float(high or 0)) for low, high in region.values())
            limits = {q: f"{q}: [{low:g}, {high:g}]" for q, (low, high) in zip(names, ends, strict=True)}
            if blocks[i].term:
                domain |= limits
            else:
                said.append(f"region: {{{', '.join(limits.values())}}} for nonlinearities[{i}]")
        said += [f"system.domain: {{{', '.join(domain.values())}}}"] if domain else []
        if certified(replace(spec, nonlinearities=tuple(blocks)), engine):
            yield f"f is too steep on the region of its type: there is a solution with {' and '.join(said)}"
            return


def within_reach(spec: Spec, diagnosis: Diagnosis, engine: Engine) -> Iterator[str]:
    """A rate, a gamma or a free L2 that does, where a diagnosis says what is necessary only."""
    request = cast("Any", spec.observer)
    for said, change in (*slower(diagnosis), *larger(request, diagnosis), *free_injection(request, diagnosis)):
        if certified(replace(spec, observer=replace(request, **change)), engine):
            yield f"{said}, with which there is a solution"
            return


def slower(diagnosis: Diagnosis) -> Iterator[Change]:
    """Rates below that of a mode which no gain makes faster."""
    feasible = diagnosis.get("feasible", {})
    named = {"alpha_below": "alpha", "decay_below": "decay"}
    named |= {"alpha": "alpha"} if diagnosis["condition"] == "zero dynamics" else {}
    for key, limit in ((key, feasible[name]) for name, key in named.items() if name in feasible):
        for value in (round_down(limit * (1 - room), 3) for room in ROOM):
            yield f"ask for {key} at most {value:g}", {key: printed(value)}


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


def narrowed(block: Nonlinearity, share: fmpq) -> dict[str, Ends]:
    """Smaller region around zero, or around its middle where that is outside it."""
    region: dict[str, Ends] = {}
    for k, (low, high) in enumerate(block.region or (EVERYWHERE,) * block.nq):
        outside = (low is not None and low > 0) or (high is not None and high < 0)
        if low is None or high is None:
            start = (low if low is not None else high) if outside else fmpq(0)
            ends = start - share, start + share
            region[f"q{k + 1}"] = (
                ends[0] if low is None else max(low, ends[0]),
                ends[1] if high is None else min(high, ends[1]),
            )
        else:
            middle = (low + high) / 2 if outside else fmpq(0)
            region[f"q{k + 1}"] = middle - share * (middle - low), middle + share * (high - middle)
    return region


def on_region(block: Nonlinearity, region: dict[str, Ends]) -> Nonlinearity:
    """Block with the type that is derived on a region; raises `UsageError` if there is none."""
    assert block.f
    choice = choose(Restriction.of(block.f, block.nq, {"t": SINCE_ZERO, **block.others, **region}))
    template = TEMPLATES[choice.name]
    constants = template.constants(choice.data, block.nq)
    multiplier = template(choice.data, block.nq, len(block.f))
    return replace(block, multiplier=multiplier, region=tuple(region.values()), lipschitz=constants)
