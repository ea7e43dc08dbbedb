"""What any result of this family is held against: the intervals, the decay and the gains that its spec asks for."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import Bounds, ends
from obsdesign.dissipation.certificate import kept
from obsdesign.families.sporadic.clock.bernstein import LARGEST_DEGREE
from obsdesign.families.sporadic.request import SporadicRequest, request_of
from obsdesign.families.sporadic.theorem import tied_gain
from obsdesign.files import ResultFile
from obsdesign.lmi.formula import Array, printed
from obsdesign.lmi.proof import Check
from obsdesign.spec import Spec


def read_gains(spec: Spec, file: ResultFile) -> dict[str, Array]:
    """Exact gains of a file: L and H, or K."""
    n, ny = spec.augmented.n, len(spec.augmented.C)
    request, told = request_of(spec), file.table("observer").keys()
    resets = request.injections == ("reset",) or {"K", "K_of_gap"} & told
    if resets and (request.gap or "K_of_gap" in told) and "K" not in told:
        return read_adapted(file, (n, ny))
    sizes = {"K": (n, ny)} if resets else {"L": (n, ny), "H": (ny, ny)}
    return {name: file.matrix(shape, "observer", name) for name, shape in sizes.items()}


def read_adapted(file: ResultFile, size: tuple[int, int]) -> dict[str, Array]:
    """Exact control values of a gain that depends on the interval that has just ended, and the ends of its segments."""
    root = ("observer", "K_of_gap")
    knots = file.numbers(*root, "knots")
    rising = len(knots) > 1 and all(a < b for a, b in pairwise(knots))
    if not rising or [knots[0], knots[-1]] != [file.number("observer", name) for name in ("T1", "T2")]:
        raise file.wrong("observer.K_of_gap.knots", "expected numbers that rise from T1 to T2", id="OBS702")
    first = file.at(*root, "K")
    degree = len(first[0]) - 1 if isinstance(first, list) and first and isinstance(first[0], list) else 0
    if not 1 <= degree <= LARGEST_DEGREE:
        raise file.wrong("observer.K_of_gap.K", "expected a list of matrices for each segment", id="OBS702")
    K = file.stack((len(knots) - 1, degree + 1, *size), *root, "K")
    return {"K_of_gap": K, "knots": np.array(knots, dtype=object)}


def require_asked(
    file: ResultFile, request: SporadicRequest, gains: Mapping[str, Array], claim: Mapping[str, fmpq], C: Array
) -> None:
    """Hold a claim against what the spec asks: the family, T1, T2, the decay, the injection, given gains."""
    if file.at("observer", "type") != request.type:
        raise file.wrong("observer.type", f"the spec asks for {request.type}", id="OBS707")
    asked = {"T1": request.T1, "T2": request.T2, "decay": request.decay}
    for name, value in asked.items():
        file.require_asked(ends(value), "guarantee", name)
    for name in ("T1", "T2"):
        if file.number("observer", name) != claim[name]:
            raise file.wrong(f"observer.{name}", "differs from that of the guarantee", id="OBS705")
    if request.gains:
        require_given(file, request.gains, gains)
    elif not any(of_injection(name, gains, C, gap=request.gap) for name in request.injections):
        key, said = ("H" if "H" in gains else next(iter(gains))), " or ".join(request.injections)
        said += f" with clock.gain {'gap' if request.gap else 'constant'}" if "reset" in request.injections else ""
        raise file.wrong(f"observer.{key}", f"not that of {said}, which the spec asks for", id="OBS707")


def require_given(file: ResultFile, given: Mapping[str, Array], gains: Mapping[str, Array]) -> None:
    """Hold the gains of a file against those that a spec gives."""
    if given.keys() != gains.keys():
        raise file.wrong(
            "observer", f"holds the gain {', '.join(gains)}; the spec gives {', '.join(given)}", id="OBS707"
        )
    for name, gain in given.items():
        if (printed(gain) != gains[name]).any():
            raise file.wrong(f"observer.{name}", "differs from the gain that the spec gives", id="OBS707")


def held(request: SporadicRequest, gains: Mapping[str, Array]) -> tuple[Check, ...]:
    """Whether a designed gain keeps its bound, in rationals."""
    if request.gains:
        return ()
    if "L" in gains:
        return kept(Bounds(L1=request.largest_gain), gains["L"])
    values = gains["K"][None] if "K" in gains else gains["K_of_gap"].reshape(-1, *gains["K_of_gap"].shape[2:])
    return tuple(check for K in values for check in kept(Bounds(L1=request.largest_reset), K, name="K"))


def of_injection(name: str, gains: Mapping[str, Array], C: Array, *, gap: bool) -> bool:
    """Whether gains are those of an injection; `gap`: whether K of a reset may depend on the interval."""
    if name == "reset":
        return "K" in gains or (gap and "K_of_gap" in gains)
    if "L" not in gains:
        return False
    H = tied_gain(name, gains["L"], C)
    return H is None or not (gains["H"] != H).any()
