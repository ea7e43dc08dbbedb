"""What any result of this family is held against: the intervals, the decay and the gains that its spec asks for."""

from collections.abc import Mapping

from flint import fmpq

from obsdesign.dissipation.bounds import Bounds, ends
from obsdesign.dissipation.certificate import kept
from obsdesign.families.sporadic.request import SporadicRequest
from obsdesign.families.sporadic.theorem import tied_gain
from obsdesign.files import ResultFile
from obsdesign.lmi.formula import Array, approximate, printed
from obsdesign.lmi.proof import Check
from obsdesign.spec import Spec


def read_gains(spec: Spec, file: ResultFile) -> dict[str, Array]:
    """Exact gains of a file: L and H, or K."""
    n, ny = spec.augmented.n, len(spec.augmented.C)
    sizes = {"K": (n, ny)} if "K" in file.table("observer") else {"L": (n, ny), "H": (ny, ny)}
    return {name: file.matrix(shape, "observer", name) for name, shape in sizes.items()}


def require_asked(
    file: ResultFile, request: SporadicRequest, gains: Mapping[str, Array], claim: Mapping[str, fmpq], C: Array
) -> None:
    """Hold a claim against what the spec asks: the family, T1, T2, the decay, the injection, given gains."""
    if file.at("observer", "type") != request.type:
        raise file.wrong("observer.type", f"the spec asks for {request.type}", id="OBS707")
    asked = {"T1": request.T1, "T2": request.T2, "decay": request.decay}
    for name, value in asked.items():
        low, high = ends(value)
        if not printed(low) <= claim[name] <= printed(high):
            raise file.wrong(
                f"guarantee.{name}", f"{approximate(claim[name]):g} is not what the spec asks for", id="OBS707"
            )
    for name in ("T1", "T2"):
        if file.number("observer", name) != claim[name]:
            raise file.wrong(f"observer.{name}", "differs from that of the guarantee", id="OBS705")
    if request.gains:
        require_given(file, request.gains, gains)
    elif not any(of_injection(name, gains, C) for name in request.injections):
        key, said = ("K" if "K" in gains else "H"), " or ".join(request.injections)
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
    name, largest = ("K", request.largest_reset) if "K" in gains else ("L", request.largest_gain)
    return kept(Bounds(L1=largest), gains[name])


def of_injection(name: str, gains: Mapping[str, Array], C: Array) -> bool:
    """Whether gains are those of an injection."""
    if (name == "reset") != ("K" in gains):
        return False
    H = None if name == "reset" else tied_gain(name, gains["L"], C)
    return H is None or not (gains["H"] != H).any()
