"""Certified state observers for nonlinear systems with unknown inputs.

>>> import obsdesign as od
>>> design = od.solve(od.load("pendulum.yaml"))
>>> print(design)
>>> design.verify().holds
>>> run = design.simulate(horizon=5)
>>> design.save("pendulum.gains.json")

Each name is imported when it is first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from obsdesign.batches import batch
    from obsdesign.data.comparison import LogComparison, compare
    from obsdesign.data.estimation import Estimates, estimate
    from obsdesign.data.tuning import Tuning, tune
    from obsdesign.design import Design
    from obsdesign.difference import diff
    from obsdesign.errors import InfeasibleError, ObsdesignError, TimeLimitError, UndecidedError, UsageError
    from obsdesign.exports import Exported, export
    from obsdesign.families.finding import Finding
    from obsdesign.families.outcome import Proof
    from obsdesign.reading import Spec
    from obsdesign.reports.page import Report, report
    from obsdesign.simulate import Run
    from obsdesign.simulate.comparison import Comparison
    from obsdesign.simulate.montecarlo import MonteCarlo
    from obsdesign.work import check, lipschitz, load, read, solve, theorem, verify

__version__ = "0.1.0"

__all__ = [
    "Comparison",
    "Design",
    "Estimates",
    "Exported",
    "Finding",
    "InfeasibleError",
    "LogComparison",
    "MonteCarlo",
    "ObsdesignError",
    "Proof",
    "Report",
    "Run",
    "Spec",
    "TimeLimitError",
    "Tuning",
    "UndecidedError",
    "UsageError",
    "batch",
    "check",
    "compare",
    "diff",
    "estimate",
    "export",
    "lipschitz",
    "load",
    "read",
    "report",
    "solve",
    "theorem",
    "tune",
    "verify",
]

HOMES = {
    "work": ("check", "lipschitz", "load", "read", "solve", "theorem", "verify"),
    "batches": ("batch",),
    "design": ("Design",),
    "reports.page": ("Report", "report"),
    "difference": ("diff",),
    "data.comparison": ("LogComparison", "compare"),
    "data.estimation": ("Estimates", "estimate"),
    "data.tuning": ("Tuning", "tune"),
    "exports": ("Exported", "export"),
    "reading": ("Spec",),  # which reads the sections that a Spec is called with
    "simulate": ("Run",),
    "simulate.comparison": ("Comparison",),
    "simulate.montecarlo": ("MonteCarlo",),
    "families.finding": ("Finding",),
    "families.outcome": ("Proof",),
    "errors": ("InfeasibleError", "ObsdesignError", "TimeLimitError", "UndecidedError", "UsageError"),
}


def __getattr__(name: str) -> Any:
    """Import a public name from its module."""
    for module, names in HOMES.items():
        if name in names:
            return getattr(import_module(f"obsdesign.{module}"), name)
    raise AttributeError(f"module 'obsdesign' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted([*__all__, "__version__"])
