"""Why clock-dependent certificates prove nothing of gains, and what would be possible."""

from collections.abc import Mapping, Sequence
from typing import Any

from flint import fmpq

from obsdesign.families.outcome import Diagnosis
from obsdesign.families.sporadic.clock.bernstein import Shape
from obsdesign.families.sporadic.clock.search import Curve
from obsdesign.families.sporadic.clock.truth import OF_PLANT
from obsdesign.tables.text import at_least, at_most

FINER = ((6, 4), (8, 4))  # degree and segments that are advised
SPARE = 1e-2  # relative, above the least gamma that is found
CLOSE = 1e-3  # relative, from a limit to what is suggested


def unstable(found: Mapping[str, Any], T1: fmpq, T2: fmpq, decay: fmpq, tolerated: float | None) -> Diagnosis:
    """Answer that an error does not decay with given gains, for intervals that recur; `found`: entries of `truth`."""
    gaps, limit = found["pattern_limit"]["gaps"], found["pattern_limit"]["T2"]
    recurring = f"with measurements {', '.join(f'{gap:g}' for gap in gaps)} s apart, again and again,"
    rate = f" at {float(decay):g} 1/s" if decay else ""
    which = "of" if found["of"] == OF_PLANT else "of a frozen member f = K q, which the types allow, and of"
    instead = f"T2 below {limit:.4g} is necessary"
    if limit <= float(T1) * (1 + CLOSE):
        reason = f"these gains are of no use: {recurring} the error {which} these gains does not decay{rate}"
        return {
            "id": "OBS609",
            "condition": "gains",
            "reason": reason,
            "suggestion": "give other gains, or leave `gains` out",
        }
    if tolerated:
        instead = f"ask for T2 at most about {at_least(tolerated * (1 - CLOSE), 3)}, which these gains seem to tolerate"
    return {
        "id": "OBS609",
        "condition": "gains",
        "reason": f"T2 = {float(T2):g} is too long: {recurring} the error {which} these gains does not decay{rate}",
        "feasible": {"T2": tolerated} if tolerated else {"T2_below": limit},
        "suggestion": f"{instead}, or leave `gains` out",
    }


def finer(shape: Shape) -> list[str]:
    """Storage functions that may prove more than those of a request, as its key; none where these are of many terms."""
    known = ((max(d, shape.degree), max(s, shape.segments)) for d, s in FINER)
    return [
        f"try `clock: {{degree: {d}, segments: {s}}}`" for d, s in known if (d, s) != (shape.degree, shape.segments)
    ][:1]


def above_bound(least: float, cap: float, *, bounded: bool) -> str:
    """Say that a bound on gamma is below the least that was found; `bounded`: whether gains are bounded too."""
    said = f"the least gamma that was found is {least:g}, above `bounds.gamma` = {cap:g}"
    larger = "allow larger gains" if bounded else "bound the gains, with which another descent begins"
    return f"{said}; ask for {at_most(least * (1 + SPARE), 3)} or more, {larger}, or try another injection"


def undecided(T1: fmpq, T2: fmpq, decay: fmpq, tolerated: float | None, shape: Shape) -> str:
    """Say that nothing was proved of given gains, which proves nothing, and what to try."""
    where = f"for intervals from T1 = {float(T1):g} to T2 = {float(T2):g} with decay {float(decay):g}"
    said = f"no storage function of the time left to the next measurement was found for these gains {where}"
    instead = [f"ask for T2 at most about {at_least(tolerated * (1 - CLOSE), 3)}"] if tolerated else []
    return f"{said}; {', or '.join([*instead, *finer(shape), 'ask for a smaller decay'])}"


def nothing_found(curves: Sequence[Curve], T2: fmpq, decay: fmpq, shorter: float | None) -> str:
    """Say that no gains were found, which proves nothing, and for which T2 some were."""
    names = " or ".join(dict.fromkeys(curve.name for curve in curves))
    bounds = [f"|{'K' if c.name == 'reset' else 'L'}| <= {c.kappa:g}" for c in curves if c.kappa is not None]
    within = f" with {' and '.join(dict.fromkeys(bounds))}" if bounds else ""
    said = f"no gains of injection {names}{within} were found for T2 = {float(T2):g} with decay {float(decay):g}"
    less = shorter is not None and shorter < float(T2) * (1 - CLOSE)
    instead = [f"ask for T2 at most {at_least(shorter, 3)}, for which some were found"] if shorter and less else []
    instead += [*(["allow larger gains"] if bounds else []), *finer(curves[0].shape)]
    return f"{said}; {', or '.join([*instead, 'try another injection or a smaller decay'])}"
