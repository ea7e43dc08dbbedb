"""What the structure of a spec allows, or rules out: before any design, and in answers about an impossible one."""

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

from obsdesign.dissipation.pace import Pace
from obsdesign.families.outcome import Diagnosis
from obsdesign.lmi.formula import Array, Float
from obsdesign.model.edge import Edge
from obsdesign.model.plant import Plant
from obsdesign.model.structure import Mode, decay_limit, undetectable
from obsdesign.records import dataclass
from obsdesign.spec import Nonlinearity
from obsdesign.tables.text import at_most

UNDISTURBED = "no disturbance acts on this plant, so that gamma says nothing: the design is for feasibility"


@dataclass(frozen=True)
class Finding:
    """One finding, with the numbers that belong to it."""

    id: str
    name: str
    holds: bool
    decides: bool  # whether a failure rules every gain out
    sentence: str
    numbers: Mapping[str, Any]
    advice: str = ""  # what to do where it does not hold; without one a user can do nothing

    @property
    def stands(self) -> bool:
        """Whether it leaves room for a design."""
        return self.holds or not self.decides

    def written(self) -> dict[str, Any]:
        """Entry of a report."""
        said = {"name": self.name, "holds": self.holds, "decides": self.decides, "sentence": self.sentence}
        return {
            "id": self.id,
            **said,
            **({} if self.holds or not self.advice else {"advice": self.advice}),
            **self.numbers,
        }


def finding(
    name: str, holds: bool, sentence: str, *, id: str, decides: bool = False, advice: str = "", **numbers: Any
) -> Finding:
    """One finding."""
    return Finding(id, name, bool(holds), bool(decides), sentence, numbers, advice)


def detectability(plant: Plant[Float], K: Array, edge: Edge, pace: Pace) -> list[Finding]:
    """Modes that no output shows, and the decay that they leave."""
    limit, key = decay_limit(plant, K, sampled=pace.sampled), pace.key
    modes = undetectable(plant, K, edge)
    found = [
        finding(
            "detectability",
            False,
            mode.sentence + outside(edge, pace) + frozen_at(K),
            decides=True,
            eigenvalue=complex_pair(mode.eigenvalue),
            id="OBS601",
        )
        for mode in modes
    ] or [
        finding(
            "detectability",
            True,
            f"no hidden mode is slower than {pace.said(edge.rate)}{frozen_at(K)}",
            decides=True,
            id="OBS601",
        )
    ]
    if isfinite(limit) and (modes or limit >= edge.rate):  # else rounding of a stiff plant leaves it open
        hidden = "grows" if limit < 0 else "does not decay"
        none = f"no {pace.some} can be had: a mode that no output shows {hidden}{frozen_at(K)}"
        least = " at least" if pace.sampled else ""
        said = f"detectability limits {key} to{least} {pace.told(limit) + 0.0:g}{frozen_at(K)}" if limit > 0 else none
        allowed = limit > edge.rate or (edge.weak and limit >= edge.rate)
        found.append(finding("decay", allowed, said, decides=True, limit=pace.told(limit), id="OBS602"))
    return found


def outside(edge: Edge, pace: Pace) -> str:
    """Where a mode of samples must not lie: outside the circle of radius rho, or on it too."""
    if not pace.sampled:
        return ""
    where = "outside" if edge.weak else "not inside"
    return f", and it is {where} |lambda| = {pace.key} = {float(edge.end):g}"


def frozen_at(K: Array) -> str:
    """Which plant is looked at, where f is taken as f = K q; nothing is said where there is no f."""
    if not K.any():
        return " with f = 0" if K.size else ""
    return f" with f = {K.item():g} q" if K.size == 1 else " with f = K q, K of its class"


def complex_pair(value: complex) -> list[float]:
    """[real, imaginary]."""
    return [float(value.real), float(value.imag)]


def described(mode: Mode) -> dict[str, Any]:
    """Eigenvalue and eigenvector of a mode, by the names of the states."""
    return {
        "eigenvalue": [mode.eigenvalue.real + 0.0, mode.eigenvalue.imag + 0.0],
        "eigenvector": {name: [entry.real + 0.0, entry.imag + 0.0] for name, entry in mode.along},
    }


def enough(least: float, bounded: float | None = None, *, searched: bool = False, exact: bool = True) -> str:
    """What gamma is necessary, or only the least that was found, over all gains and within bounds if there are any.

    `searched`: whether the former is of a search that may have missed a better one; `exact`: whether the bounds leave
    the problem convex.
    """
    whole = lowest(least, found=searched)
    if bounded is None:
        return whole
    return f"within the bounds {lowest(bounded, found=searched or not exact)}; without them {whole}"


def lowest(gamma: float, *, found: bool) -> str:
    """Least gamma, in words."""
    least = at_most(gamma)
    return f"gamma {least} is the least that was found" if found else f"gamma above {least} is necessary"


def smaller_class(blocks: Sequence[Nonlinearity], found: Diagnosis, key: str) -> str:
    """Suggestion of the class of a `nonlinearity` that would be `feasible`, as far as it is so `within` bounds.

    `key`: of the rate.
    """
    which = blocks[found["nonlinearity"] - 1].term or f"nonlinearities[{found['nonlinearity'] - 1}]"
    known = {name: value for name, value in found["feasible"].items() if name in {"lipschitz", "slope", "share"}}
    largest = ", ".join(f"{name} {shown(value)}" for name, value in known.items())
    return f"{which} would be feasible at this {key} with {largest}{found['within']}"


def shown(value: Any) -> str:
    """Number, or list of numbers, in few digits."""
    return f"[{', '.join(map(shown, value))}]" if isinstance(value, list) else f"{value:.4g}"


def hidden_mode(plant: Plant[Float], K: Array, edge: Edge, pace: Pace, symbol: str = "", more: str = "") -> Diagnosis:
    """Answer that a mode of the plant with f = K q is undetectable at a rate; empty if none is.

    The rate has a `symbol` in a sentence; `more` may help besides another measurement.
    """
    modes = undetectable(plant, K, edge)
    if not modes:
        return {}
    limit = decay_limit(plant, K, sampled=pace.sampled)
    return {
        "id": "OBS601",
        "condition": "detectability",
        "reason": f"{modes[0].sentence}{outside(edge, pace)}, so no gain makes its error decay "
        f"at the rate {symbol}{pace.told(edge.rate):g}",
        "mode": described(modes[0]),
        "feasible": {pace.bound: pace.told(limit)} if limit > 0 else {},
        "suggestion": pace.necessary(limit) if limit > 0 else f"a measurement that shows it is needed{more}",
    }
