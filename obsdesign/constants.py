"""The Lipschitz constants of the nonlinearities of a spec, proved, as the command `lipschitz` reports them."""

from collections.abc import Mapping
from typing import Any

from obsdesign.errors import InfeasibleError, Problem, UndecidedError, UsageError
from obsdesign.nonlinearities.evidence.constant import Constant, lipschitz_constant
from obsdesign.nonlinearities.evidence.proof import lipschitz_proved
from obsdesign.nonlinearities.evidence.restriction import SINCE_ZERO, Restriction
from obsdesign.spec import Nonlinearity, Spec


def constants(spec: Spec) -> dict[str, Any]:
    """Lipschitz constant of every block of f that is given as a function.

    Returns `name`, and `blocks`, each with `name`, `type` and, where f is given, `region` (of the variables that f
    depends on; null: no limit), `declared` and `proved` (by itself, or with the type that it follows from) where its
    type has a constant, and either `lower` <= constant <= `upper` (proved), `point` (where the Jacobian of f has at
    least the 2-norm `lower`), `gap` (relative) and `boxes`, or `infinite` (true: so it is seen to be; false: no bound
    could be proved) and `reason`.

    Raises `UsageError`: no block has an f.
    """
    if all(block.f is None for block in spec.nonlinearities):
        raise UsageError("no nonlinearity has an f, of which there could be a constant; give f", id="OBS402")
    return {
        "name": spec.name,
        "blocks": [entry(name, block) for name, block in zip(names(spec), spec.nonlinearities, strict=True)],
    }


def require_finite(report: Mapping[str, Any]) -> None:
    """Refuse a report of which a constant has no upper bound.

    Raises `InfeasibleError`: a constant is seen to be infinite; `UndecidedError`: it could only not be bounded.
    """
    missing = [block for block in report["blocks"] if "reason" in block]
    if missing:
        error = InfeasibleError if any(block["infinite"] for block in missing) else UndecidedError
        said = {True: "the Lipschitz constant is infinite", False: "no bound of the Lipschitz constant is proved"}
        told = [(block["name"], f"{said[block['infinite']]}: {block['reason']}") for block in missing]
        raise error(*(Problem(reason, key=name, id="OBS403") for name, reason in told))


def names(spec: Spec) -> list[str]:
    """Names of the blocks, those of the plant first."""
    left, found = spec.plant.Cq.shape[0], []
    for i, block in enumerate(spec.nonlinearities, start=1):
        found.append(block.term or f"f_{i}" if left > 0 else f"f_{i} (disturbance)")
        left -= block.nq
    return found


def restriction(block: Nonlinearity) -> Restriction:
    """Return f on its region; a run begins at t = 0."""
    assert block.f is not None
    own = {f"q{i + 1}": ends for i, ends in enumerate(block.region or ())}
    return Restriction.of(block.f, block.nq, {"t": SINCE_ZERO, **own, **block.others})


def entry(name: str, block: Nonlinearity) -> dict[str, Any]:
    """Report on one block."""
    report: dict[str, Any] = {"name": name, "type": block.type}
    if block.f is None:
        return report
    f = restriction(block)
    called = {q: block.argument(k, f.shown(q)) for k, q in enumerate(f.arguments)}
    shown = {q: called.get(q, q) for q in used(f)}
    report["region"] = {name: [None if x is None else float(x) for x in f.region[q]] for q, name in shown.items()}
    if block.lipschitz:
        declared = max(block.lipschitz)
        report |= {"declared": float(declared), "proved": not block.assumed or lipschitz_proved(f, declared)}
    return report | bounds(shown, lipschitz_constant(f))


def bounds(shown: Mapping[str, str], found: Constant) -> dict[str, Any]:
    """Both bounds of a constant, or why there is none; `shown`: what each variable of f is called."""
    if found.reason:
        return {"infinite": found.infinite, "reason": found.reason}
    return {
        "lower": found.lower,
        "upper": found.upper,
        "point": {name: found.point[q] for q, name in shown.items()},
        "gap": found.gap,
        "boxes": found.boxes,
    }


def used(f: Restriction) -> list[str]:
    """Variables that f depends on."""
    return [name for name in f.region if any(name in component.names for component in f.f)]
