"""Why clock-dependent certificates prove nothing of gains, and what would be possible."""

from collections.abc import Sequence

from flint import fmpq

from obsdesign.families.outcome import Diagnosis
from obsdesign.families.sporadic.clock.search import Curve
from obsdesign.tables.text import at_least

CLOSE = 1e-3  # relative, from a limit to what is suggested


def useless(T1: fmpq, T2: fmpq, decay: fmpq, tolerated: float | None) -> Diagnosis:
    """Answer that given gains achieve nothing; `tolerated`: the largest T2 for which there seems to be a solution."""
    shorter = "look at a smaller decay"
    if tolerated:
        shorter = f"look at T2 about {at_least(tolerated * (1 - CLOSE), 4)}, where solutions seem to end"
    return {
        "id": "OBS609",
        "condition": "gains",
        "reason": (
            "no storage function of the time left to the next measurement was found for these gains, for intervals "
            f"from T1 = {float(T1):g} to T2 = {float(T2):g} with decay {float(decay):g}"
        ),
        "feasible": {"T2": tolerated} if tolerated else {},
        "suggestion": f"{shorter}, or look at new gains: leave `gains` out",
    }


def nothing_found(curves: Sequence[Curve], T2: fmpq, decay: fmpq, shorter: float | None) -> str:
    """Say that no gains were found, which proves nothing, and for which T2 some were."""
    names = " or ".join(dict.fromkeys(curve.name for curve in curves))
    bounds = [f"|{'K' if c.name == 'reset' else 'L'}| <= {c.kappa:g}" for c in curves if c.kappa is not None]
    within = f" with {' and '.join(dict.fromkeys(bounds))}" if bounds else ""
    said = f"no gains of injection {names}{within} were found for T2 = {float(T2):g} with decay {float(decay):g}"
    instead = [f"ask for T2 at most {at_least(shorter, 3)}, for which some were found"] if shorter else []
    instead += ["allow larger gains"] if bounds else []
    return f"{said}; {', or '.join([*instead, 'try another injection or a smaller decay'])}"
