"""Answers that bounds are too tight for what is asked, in any family, and the proof where one gain can be excluded.

A search of gains within a bound on their size is convex only with a condition that is more than the bound, so that
finding none says nothing by itself. That there is none is told where a frozen member of the class needs larger gains,
which is exact, or where not even what all gains within the bounds satisfy has a solution, which is numerical. Of
measurements that arrive sporadically the former is told of the theorem alone: its inequality asks for a decay of
e' = (A + L C) e, which the error itself does not follow.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from obsdesign.errors import UndecidedError
from obsdesign.families.frozen import Demand, members, terms
from obsdesign.families.outcome import Diagnosis, Outcome, Proof, Verdict
from obsdesign.files import ResultFile, rows
from obsdesign.lmi.proof import Check
from obsdesign.model.injection import Needed, needed, proved
from obsdesign.spec import Spec, numbered

KIND = "injection"


def too_tight(
    asked: Sequence[str], where: str, enough: Mapping[str, tuple[float, str]], hints: Sequence[str] = ()
) -> Diagnosis:
    """Answer that nothing within bounds was found.

    `asked`: the bounds in words; `where`: for what; `enough`: by its key in `feasible`, the value of a bound or of a
    rate with which a solution was found, the others as they are, and how to ask for it; `hints`: what else may help.
    Larger bounds and slower decays were tried; where none is given, none was found.
    """
    said = [f"{words} {value:g}, with which there is one" for value, words in enough.values()]
    return {
        "id": "OBS611",
        "condition": "bounds",
        "reason": f"no gain with {' and '.join(asked)} was found {where}",
        "feasible": {key: value for key, (value, _) in enough.items()},
        "suggestion": ", or ".join([*said, *hints]) or "neither larger bounds nor a slower decay was found to do",
    }


def judged(diagnosis: Diagnosis, *, decided: bool, **known: Any) -> Outcome:
    """Outcome without a gain within bounds: infeasible where that is decided numerically, or else undecided."""
    if not decided:
        return Outcome(Verdict.UNDECIDED, diagnosis=diagnosis, **known)
    said = {"reason": f"no solution within the bounds: {diagnosis['reason']}", "proof": "numerical"}
    return Outcome(Verdict.INFEASIBLE, diagnosis={**diagnosis, **said}, **known)


def designed(spec: Spec, demand: Demand, design: Callable[[], Outcome]) -> Outcome:
    """Outcome of a design; where none is found within a bound on the gain, with the proof that there is none.

    Raises `UndecidedError`: none was found, and nothing says that there is none.
    """
    outcome = design()
    if outcome.diagnosis.get("condition") == "bounds" and demand.largest is not None:
        found = needed(spec.posed, demand.multiplier, -demand.edge.end, demand.L2)
        if found and found.size > demand.largest:
            proof = diagnosis(spec, found, demand)
            return replace(outcome, status=Verdict.INFEASIBLE, diagnosis={**outcome.diagnosis, **proof})
    if outcome.status is Verdict.UNDECIDED:
        raise UndecidedError(
            f"{outcome.diagnosis['reason']}; {outcome.diagnosis['suggestion']}", id=outcome.diagnosis["id"]
        )
    return outcome


def diagnosis(spec: Spec, found: Needed, demand: Demand) -> Diagnosis:
    """Answer that the gain has to be larger, with what proves it."""
    chosen = dict(zip(numbered("f", len(found.slopes)), map(rows, found.slopes), strict=True))
    asked = f"|{demand.gain}| <= {float(demand.largest or 0):g} was asked for"
    return {
        "reason": f"no solution within the bounds: {asked}, and {sentence(spec, found, demand)}",
        "proof": "exact",
        "certificate": {"kind": KIND, "members": chosen, "at": str(found.at), "size": str(found.size)},
    }


def sentence(spec: Spec, found: Needed, demand: Demand) -> str:
    """Member and size in words."""
    member = members(found.slopes, terms(spec))
    at = f"at {member}, which the types allow, " if member else ""
    rate = demand.pace.said(demand.edge.rate)
    if demand.theorem:
        size = f"|{demand.gain}| at most {float(found.size):g}"
        return f"{at}the inequality of {demand.theorem} has no solution with {size} for {rate}"
    return f"{at}{rate} needs |{demand.gain}| above {float(found.size):g}"


def read(spec: Spec, demand: Demand, file: ResultFile) -> Proof:
    """Prove anew that no gain within the bound of a spec makes the error of a member decay as it must.

    Raises `UsageError`: it is malformed, or has not one member for each nonlinearity.
    """
    root, blocks = ("diagnosis", "certificate"), demand.multiplier.blocks
    names = numbered("f", len(blocks))
    if set(file.table(*root, "members")) != set(names):
        raise file.wrong(
            "diagnosis.certificate.members", f"expected one for each of {len(blocks)} nonlinearities", id="OBS702"
        )
    slopes = (file.matrix(b.member.shape, *root, "members", name) for name, b in zip(names, blocks, strict=True))
    found = Needed(tuple(slopes), file.number(*root, "at"), file.number(*root, "size"))
    if demand.largest is None or found.size <= demand.largest:
        raise file.wrong(
            "diagnosis.certificate.size", "not above the bound of the spec, or the spec has none", id="OBS707"
        )
    holds = proved(spec.posed, demand.multiplier, -demand.edge.end, demand.L2, found)
    name = "a member of the class needs a larger gain"
    if demand.theorem:
        name = f"at a member of the class {demand.theorem} needs a larger gain"
    check = Check(name, holds, 1.0 if holds else -1.0)
    said = f"no solution within the bounds: {sentence(spec, found, demand)}"
    return Proof(said, (check,), used=("kind", "members", "at", "size"))
