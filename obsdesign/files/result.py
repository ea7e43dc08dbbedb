"""Everything about a design, as a result file holds it."""

import datetime
import platform
from importlib.metadata import version
from typing import Any

from obsdesign import __version__
from obsdesign.families.incremental import written as incremental
from obsdesign.families.lipschitz import written as lipschitz
from obsdesign.families.sporadic import written as sporadic
from obsdesign.files.text import digest
from obsdesign.spec import Spec
from obsdesign.work import Design, LipschitzDesign, SporadicDesign

FORMAT = 1


def result(spec: Spec, design: Design | LipschitzDesign | SporadicDesign, solver: str) -> dict[str, Any]:
    """Spec, status, what the family has to say, diagnosis, notes, solver and tool."""
    family = content(spec, design)
    counts = {"scalars": design.counts} if isinstance(design, SporadicDesign) else {}
    notes = [*spec.notes, *design.notes]
    return {
        "obsdesign": FORMAT,
        "name": spec.name,
        "spec": {"path": spec.path, "sha256": digest(spec.text), "text": spec.text},
        "status": design.status,
        **{key: family[key] for key in ("observer", "guarantee", "certificate") if key in family},
        **({"diagnosis": design.diagnosis} if design.diagnosis else {}),
        **({"search": family["search"]} if "search" in family else {}),
        **({"notes": notes} if notes else {}),
        "solver": {
            "name": solver,
            "version": version("clarabel" if solver == "clarabel" else "cvxpy"),
            "solves": design.solves,
            "time_s": round(design.time_s, 4),
            **counts,
        },
        "tool": {"version": __version__, "python": platform.python_version(), "cvxpy": version("cvxpy")},
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }


def content(spec: Spec, design: Design | LipschitzDesign | SporadicDesign) -> dict[str, Any]:
    """Observer, guarantee, certificate and search of the family."""
    if isinstance(design, LipschitzDesign):
        return lipschitz.content(spec, design)
    return sporadic.content(spec, design) if isinstance(design, SporadicDesign) else incremental.content(spec, design)
