"""Observers with the gains L1 and L2 (families l2 and linf), Corless and Chakrabarty (2019)."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from obsdesign.families.family import Family

if TYPE_CHECKING:
    from obsdesign.dissipation.engine import Engine
    from obsdesign.families import observer as equations
    from obsdesign.families.asked import Estimation
    from obsdesign.families.family import Rows
    from obsdesign.families.finding import Finding
    from obsdesign.families.incremental.request import Observer, Request
    from obsdesign.families.outcome import Claim, Outcome, Proof
    from obsdesign.files import ResultFile
    from obsdesign.lmi.formula import Array
    from obsdesign.sections.values import Reader
    from obsdesign.spec import Spec


class IncrementalFamily(Family):
    """The family, for the registry."""

    names = ("l2", "linf")

    @property
    def Section(self) -> "type[Observer]":
        """Keys of the section `observer:`."""
        from obsdesign.families.incremental.request import Observer

        return Observer

    def request(self, reader: "Reader", section: "Observer", problem: "Estimation") -> "Request":
        """What a spec asks for, in its numbers."""
        from obsdesign.families.incremental.request import read_request

        return read_request(reader, section, problem)

    def observer(self, spec: "Spec", gains: "Mapping[str, Array]") -> "equations.Observer":
        """Equations of the observer with given gains."""
        from obsdesign.families.incremental.observer import observer

        return observer(spec, gains)

    def check(self, spec: "Spec", engine: "Engine") -> "list[Finding]":  # noqa: ARG002
        """What the structure of a spec allows."""
        from obsdesign.families.incremental.check import check

        return check(spec)

    def design(self, spec: "Spec", engine: "Engine") -> "Outcome":
        """Gains and what is proved of them, or why there are none."""
        from obsdesign.families.incremental.design import design_incremental

        return design_incremental(spec, engine)

    def written(self, spec: "Spec", outcome: "Outcome") -> dict[str, Any]:
        """Entry `observer` of a result file."""
        from obsdesign.families.incremental.claim import written

        return written(spec, outcome)

    def gains(self, spec: "Spec", file: "ResultFile") -> "Mapping[str, Array]":
        """Exact gains of a result file."""
        from obsdesign.families.incremental.claim import read_gains

        return read_gains(spec, file)

    def claim(self, spec: "Spec", file: "ResultFile") -> "Claim":
        """Claim of a certified result file, checked."""
        from obsdesign.families.incremental.claim import read

        return read(spec, file)

    def absence(self, spec: "Spec", file: "ResultFile") -> "Proof":
        """Proof that there is no solution."""
        from obsdesign.families.incremental.absence import read

        return read(spec, file)

    def proved(self, observer: Mapping[str, Any], guarantee: Mapping[str, Any]) -> "Rows":
        """What is proved, for a table."""
        from obsdesign.families.incremental.table import claim
        from obsdesign.families.incremental.theorems import THEOREMS

        return claim(guarantee, THEOREMS[observer["type"]].meaning)

    def figures(self, observer: Mapping[str, Any]) -> "Rows":
        """What an engineer asks first of the gains, for a table."""
        from obsdesign.families.incremental.table import gains

        return gains(observer)


INCREMENTAL = IncrementalFamily()
