"""Why a design is impossible, in the terms of the model, and what would be possible."""

from typing import Any

import numpy as np

from obsdesign.lmi.formula import Array, in_floats
from obsdesign.model.structure import decay_limit, undetectable
from obsdesign.observers.l2 import L2
from obsdesign.spec.model import Spec


def why_not(spec: Spec, family: L2, largest_alpha: float | None, known: dict[str, Any]) -> dict[str, Any]:
    """Reasons that hold whatever the gains, the most telling first.

    Parameters
    ----------
    spec, family
        The problem, at the alpha that is infeasible.
    largest_alpha
        The largest alpha that is feasible, if one was found.
    known
        What the design knows already, such as a bound that was too tight.

    Returns
    -------
    dict
        `reason` in one sentence, `condition` that fails, data of it, `feasible` and a `suggestion`.
    """
    alpha = float(family.alpha)
    plant, K = in_floats(family.plant), in_floats(family.multiplier.member)
    hidden = undetectable(plant, K, alpha)
    if hidden:
        mode = hidden[0]
        limit = decay_limit(plant, K)
        return {
            "condition": "detectability",
            "reason": f"{mode.sentence}, so no gain makes its error decay at the rate alpha = {alpha:g}",
            "mode": {
                "eigenvalue": [mode.eigenvalue.real, mode.eigenvalue.imag],
                "eigenvector": {name: [entry.real, entry.imag] for name, entry in mode.along},
            },
            "feasible": {"alpha_below": limit} if limit > 0 else {},
            "suggestion": f"ask for alpha below {limit:g}"
            if limit > 0
            else "measure another state, or model w otherwise",
        }
    if known:
        return {"condition": next(iter(known)), "reason": sentence(known), **known, "suggestion": relaxation(known)}
    passivity = failing_passivity(spec, in_floats(family)) if family.L2 is not None else None
    if passivity:
        return passivity
    if largest_alpha is not None:
        return {
            "condition": "decay",
            "reason": f"alpha = {alpha:g} is too fast: there is a solution only up to alpha = {largest_alpha:.5g}",
            "feasible": {"alpha": largest_alpha},
            "suggestion": f"ask for alpha at most {largest_alpha * (1 - 1e-4):.5g}{other(family)}",
        }
    return {
        "condition": "inequality",
        "reason": f"Theorem 1 has no solution at alpha = {alpha:g}, nor at any smaller alpha that was tried",
        "feasible": {},
        "suggestion": "a tighter type of the nonlinearity or another measurement may make it feasible" + other(family),
    }


def other(family: L2) -> str:
    """Suggestion of a free L2 where it is fixed."""
    return "" if family.L2 is None else "; so may another L2, or `L2: free`"


def sentence(known: dict[str, Any]) -> str:
    """Reason that the design knew already, in words."""
    if "gamma" in known:
        asked, least = known["gamma"]["asked"], known["gamma"]["least"]
        return f"gamma = {asked:g} was asked for, and the least possible is {least:.6g}"
    return str(next(iter(known.values())))


def relaxation(known: dict[str, Any]) -> str:
    """What to change in the request."""
    if "gamma" in known:
        return f"ask for gamma above {known['gamma']['least']:.6g}"
    return "allow larger bounds" if "bounds" in known else "design new gains: leave `gains` out"


def failing_passivity(spec: Spec, family: L2) -> dict[str, Any] | None:
    """Blocks with M22 = 0 and M11 = 0 force P Bf + lambda (Cq + L2 C)' = 0, hence (Cq + L2 C) Bf < 0.

    This needs Bf of full column rank, Df = 0, and a loop without Dqf; it says nothing otherwise.
    """
    p = family.plant
    assert family.L2 is not None
    if p.Df.any() or (p.Dqf + family.L2 @ p.Df).any():
        return None
    q = f = 0
    for i, block in enumerate(family.multiplier.blocks):
        rows, columns = slice(q, q + len(block.M11)), slice(f, f + len(block.M22))
        q, f = rows.stop, columns.stop
        if block.M22.any() or block.M11.any() or not p.Bf[:, columns].any():
            continue
        product: Array = block.M12.T @ (p.Cq[rows] + family.L2[rows] @ p.C) @ p.Bf[:, columns]
        largest = float(np.linalg.eigvalsh(product + product.T).max()) / 2
        if largest >= 0:
            shown = f"{largest:g}" if product.size == 1 else f"a matrix with the eigenvalue {largest:g}"
            return {
                "condition": "passivity",
                "reason": (
                    f"{block_name(spec, i)} has no upper slope bound, so P Bf + lambda (Cq + L2 C)' = 0 must hold "
                    f"with P > 0 and lambda >= 0; that needs (Cq + L2 C) Bf < 0, and here it is {shown}"
                ),
                "value": largest,
                "feasible": {},
                "suggestion": "choose L2 with (Cq + L2 C) Bf < 0, or `L2: free`",
            }
    return None


def block_name(spec: Spec, index: int) -> str:
    """Nonlinearity that block `index` of the multiplier belongs to."""
    owners = [n for n in spec.nonlinearities for _ in n.multiplier.blocks]
    return f"the nonlinearity {spec.nonlinearities.index(owners[index]) + 1} ({owners[index].type})"
