"""Answers that a frozen member of the class, f = K q, hides a mode: a reason, a finding and a proof, in any family."""

import re
from collections.abc import Callable, Sequence
from itertools import combinations, islice, product
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.dissipation.pace import Pace
from obsdesign.errors import UndecidedError
from obsdesign.families.finding import Finding, complex_pair, described, finding, smaller_class
from obsdesign.families.outcome import Diagnosis, Outcome, Proof, Verdict
from obsdesign.files import ResultFile, rows
from obsdesign.lmi.formula import Array, block_diagonal, in_floats
from obsdesign.lmi.proof import Check
from obsdesign.model.edge import Edge
from obsdesign.model.frozen import MOST, Hidden, blind, hidden, proved
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.structure import undetectable
from obsdesign.records import dataclass, replace
from obsdesign.spec import Nonlinearity, Spec, arguments, numbered

KIND = "member"
NAME = re.compile(r"[^\W\d]\w*")  # of a signal
FREE = "free"  # a K that is whatever keeps y = 0


@dataclass(frozen=True)
class Demand:
    """What a request asks of the error of every observer: a decay, for every f of a class."""

    edge: Edge  # of the least rate that is asked for; if it is zero, any decay
    multiplier: Multiplier
    pace: Pace
    gain: str = "L"  # key of the injection in a spec
    largest: fmpq | None = None  # what bounds its norm, unless it is given
    L2: Array | None = None  # None: any
    theorem: str = ""  # whose inequality alone asks a bounded gain for more, where the error is not that of a copy
    cancelled: str = ""  # channels of w that may be anything, in words


def designed(spec: Spec, demand: Demand, design: Callable[[], Outcome]) -> Outcome:
    """Outcome of a design; where it has no proved gains, with the member of the class that rules every observer out."""
    try:
        outcome = design()
    except UndecidedError:
        if not (found := hidden(spec.posed, demand.multiplier, demand.edge)):
            raise
        return Outcome(Verdict.INFEASIBLE, diagnosis=diagnosis(spec, found, demand))
    if outcome.status is Verdict.CERTIFIED:
        return outcome
    found = hidden(spec.posed, demand.multiplier, demand.edge)
    if not found:
        return outcome
    known, said = outcome.diagnosis, diagnosis(spec, found, demand)
    feasible = said["feasible"] | known.get("feasible", {})
    if "nonlinearity" in known:
        said["suggestion"] += f"; {smaller_class(spec.nonlinearities, known, demand.pace.key)}"
    elif known.get("feasible") and known["condition"] != said["condition"]:
        said["reason"] += f"; {known['reason']}"
        said["suggestion"] = known["suggestion"]
    said["feasible"] = feasible
    gains = outcome.gains if outcome.status is Verdict.INFEASIBLE else {}
    return replace(outcome, status=Verdict.INFEASIBLE, gains=gains, claim=None, diagnosis={**known, **said})


def diagnosis(spec: Spec, found: Hidden, demand: Demand) -> Diagnosis:
    """Answer that no observer makes the error decay as it must, with what proves it."""
    named = members(found.member, terms(spec))
    must = f"at the rate {demand.pace.said(demand.edge.rate)}" if demand.edge.rate else "at all"
    chosen = [FREE if K is None else rows(K) for K in found.slopes]
    decay = demand.edge.of(found.mode.eigenvalue)
    if decay > 0:
        instead = demand.pace.necessary(decay)
    else:
        declared = any(not block.type.endswith("(auto)") for block in spec.nonlinearities)
        tighter = ", or a tighter type of the nonlinearity" if declared and helps(spec, demand) else ""
        instead = f"a measurement that shows it is needed{tighter}"
    if named and not blind(spec.posed, demand.edge) and (independent := together(spec)):
        must = f"{must} for every f of the class; the class takes {independent}, so that this member may not occur"
        instead += "; an observer.type that takes the equations as they are has no such class"
    whatever = f" whatever {demand.cancelled} is" if demand.cancelled else ""
    return {
        "id": "OBS601",
        "condition": "detectability",
        "reason": f"{sentence(spec, found, demand)}, so no observer makes its error decay {must}{whatever}",
        "mode": described(found.mode),
        **({"member": named} if named else {}),
        "slopes": slopes(found),
        "feasible": {demand.pace.bound: demand.pace.told(decay)} if decay > 0 else {},
        "suggestion": instead,
        "proof": "exact",
        "certificate": {"kind": KIND, "members": dict(zip(numbered("f", len(found.slopes)), chosen, strict=True))},
    }


def sentence(spec: Spec, found: Hidden, demand: Demand) -> str:
    """Member and mode in words, or that every f hides it."""
    named = members(found.member, terms(spec))
    if demand.cancelled:
        at = f"at {named}, which the types allow, " if named else ""
        unseen = f"while {demand.cancelled} keeps y at zero: it is a zero of {demand.cancelled} to y"
        return f"{at}{found.mode.sentence} {unseen}"
    if not named:
        return found.mode.sentence
    if always := blind(spec.posed, demand.edge):
        return f"whatever f is, {always.sentence}"
    more = "" if helps(spec, demand) else ", and at every other member that was tried there is such a mode"
    return f"at {named}, which the types allow, {found.mode.sentence}{more}"


def together(spec: Spec) -> str:
    """Terms with a signal in common, which their types do not know of; nothing where there are none."""
    blocks = [block for block in spec.nonlinearities if block.term]
    used = {
        block.term: {name for text in block.arguments for name in NAME.findall(text)}
        | {name for f in block.f or () for name in f.names.difference(arguments(block.nq))}
        for block in blocks
    }
    shared = {name for one, other in combinations(used.values(), 2) for name in one & other} - {"t"}
    alike = [term for term, names in used.items() if names & shared]
    return f"{' and '.join(alike)} as independent, though they share {', '.join(sorted(shared))}" if alike else ""


def helps(spec: Spec, demand: Demand) -> bool:
    """Whether some member of the class, at its ends or within, hides no slow mode: a smaller class may hide none."""
    blocks, plant = demand.multiplier.blocks, spec.posed.doubles
    chosen = product(*((block.member, *block.vertices) for block in blocks))
    tried = (block_diagonal([in_floats(K) for K in each]) for each in islice(chosen, MOST))
    return any(not undetectable(plant, K, demand.edge) for K in tried)


def terms(spec: Spec) -> list[str]:
    """What the function of each class is called, where a plant as equations has a name for it.

    Slopes are over the argument q of a block; where a term is written in -q, that is said.
    """
    return [block.term + reversed_argument(block) for block in spec.nonlinearities for _ in block.multiplier.blocks]


def reversed_argument(block: Nonlinearity) -> str:
    """Argument a - b of a term that is written in b - a, in words; nothing for others."""
    parts = block.arguments[0].split(" - ") if block.term and len(block.arguments) == 1 else []
    reverse = " - ".join(parts[::-1])
    return f" over {block.arguments[0]}" if len(parts) == 2 and parts[0] != parts[1] and reverse in block.term else ""


def members(chosen: Sequence[Array], called: Sequence[str] = ()) -> str:
    """Members of the classes in words, with names of their functions; nothing where there is no f."""
    names = [name or f"f{i}" for i, name in enumerate((*called, *[""] * (len(chosen) - len(called))), start=1)]
    return " and ".join(slope(in_floats(K), name) for K, name in zip(chosen, names, strict=False))


def slope(K: Array, name: str) -> str:
    """Linear map in words."""
    if K.size == 1:
        return f"the slope {K.item() + 0.0:.6g} of {name}"
    return f"a Jacobian of {name} of norm {np.linalg.norm(K, 2):.6g}"


def slopes(found: Hidden) -> dict[str, Any]:
    """Slopes, or Jacobians as rows, by f1, f2, .."""
    return {f"f{i}": K.item() if K.size == 1 else K.tolist() for i, K in enumerate(found.member, start=1)}


def findings(spec: Spec, demand: Demand) -> list[Finding]:
    """Finding that a member hides a mode; none where no member is found to."""
    found = hidden(spec.posed, demand.multiplier, demand.edge)
    if not found:
        return []
    numbers: dict[str, Any] = {"eigenvalue": complex_pair(found.mode.eigenvalue), "slopes": slopes(found)}
    return [finding("members", False, sentence(spec, found, demand), decides=True, **numbers, id="OBS601")]


def read(spec: Spec, demand: Demand, file: ResultFile) -> Proof:
    """Prove anew that the member of a result file hides a mode from every observer.

    Raises `UsageError`: it is malformed, or has not one member for each nonlinearity.
    """
    root, shapes = ("diagnosis", "certificate", "members"), [b.member.shape for b in demand.multiplier.blocks]
    names, table = numbered("f", len(shapes)), file.table(*root)
    if set(table) != set(names):
        raise file.wrong(
            ".".join(root), f"expected one for each of {', '.join(names) or 'no'} nonlinearities", id="OBS702"
        )
    chosen = tuple(
        None if table[name] == FREE else file.matrix(shape, *root, name)
        for name, shape in zip(names, shapes, strict=True)
    )
    found = proved(spec.posed, demand.multiplier, chosen, demand.edge)
    name = "a member of the class hides a mode that does not decay at the rate that is asked for"
    check = Check(name, found is not None, 1.0 if found else -1.0)
    said: dict[str, Any] = diagnosis(spec, found, demand) if found else {"reason": name}
    return Proof(f"no solution: {said['reason']}", (check,), used=("kind", "members"))
