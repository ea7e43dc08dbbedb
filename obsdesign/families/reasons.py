"""What answers about an impossible design have in common, in any family."""

from typing import Any

from obsdesign.families.outcome import Diagnosis
from obsdesign.lmi.formula import Array, Float
from obsdesign.model.plant import Plant
from obsdesign.model.structure import Mode, decay_limit, undetectable


def described(mode: Mode) -> dict[str, Any]:
    """Eigenvalue and eigenvector of a mode, by the names of the states."""
    return {
        "eigenvalue": [mode.eigenvalue.real + 0.0, mode.eigenvalue.imag + 0.0],
        "eigenvector": {name: [entry.real + 0.0, entry.imag + 0.0] for name, entry in mode.along},
    }


def hidden_mode(
    plant: Plant[Float],
    K: Array,
    rate: float,
    symbol: str = "",
    key: str = "decay",
    asked: str = "a decay",
    more: str = "",
) -> Diagnosis:
    """Answer that a mode of the plant with f = K q is undetectable at a rate; empty if none is.

    The rate has a `symbol`, a `key` in a spec, and is `asked` for; `more` would help besides measuring another state.
    """
    modes = undetectable(plant, K, rate)
    if not modes:
        return {}
    limit = decay_limit(plant, K)
    return {
        "condition": "detectability",
        "reason": f"{modes[0].sentence}, so no gain makes its error decay at the rate {symbol}{rate:g}",
        "mode": described(modes[0]),
        "feasible": {f"{key}_below": limit} if limit > 0 else {},
        "suggestion": f"ask for {asked} below {limit:g}" if limit > 0 else f"measure another state{more}",
    }
