"""Observers whose measurements arrive sporadically, Ferrante, Gouaisbaut, Sanfelice and Tarbouriech (2019)."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from obsdesign.families.family import Family

if TYPE_CHECKING:
    from obsdesign.dissipation.engine import Engine
    from obsdesign.families.asked import Estimation
    from obsdesign.families.family import Rows
    from obsdesign.families.finding import Finding
    from obsdesign.families.observer import Observer
    from obsdesign.families.outcome import Claim, Outcome, Proof
    from obsdesign.families.sporadic.request import SporadicObserver, SporadicRequest
    from obsdesign.files import ResultFile
    from obsdesign.lmi.formula import Array
    from obsdesign.sections.values import Reader
    from obsdesign.spec import Spec


class SporadicFamily(Family):
    """The family, for the registry."""

    names = ("sporadic",)
    sampled = True

    @property
    def Section(self) -> "type[SporadicObserver]":
        """Keys of the section `observer:`."""
        from obsdesign.families.sporadic.request import SporadicObserver

        return SporadicObserver

    def request(self, reader: "Reader", section: "SporadicObserver", problem: "Estimation") -> "SporadicRequest":
        """What a spec asks for, in its numbers."""
        from obsdesign.families.sporadic.request import read_request

        return read_request(reader, section, problem)

    def observer(self, spec: "Spec", gains: "Mapping[str, Array]") -> "Observer":
        """Equations of the observer with given gains."""
        from obsdesign.families.sporadic.observer import observer

        return observer(spec, gains)

    def check(self, spec: "Spec", engine: "Engine") -> "list[Finding]":  # noqa: ARG002
        """What the structure of a spec allows."""
        from obsdesign.families.sporadic.check import check

        return check(spec)

    def design(self, spec: "Spec", engine: "Engine") -> "Outcome":
        """Gains and what is proved of them, or why there are none."""
        from obsdesign.families.sporadic.design import design_sporadic
        from obsdesign.families.sporadic.request import request_of

        return design_sporadic(spec.augmented, spec.multiplier, spec.H, request_of(spec), engine)

    def written(self, spec: "Spec", outcome: "Outcome") -> dict[str, Any]:
        """Entry `observer` of a result file."""
        from obsdesign.families.sporadic.claim import written

        return written(spec, outcome)

    def gains(self, spec: "Spec", file: "ResultFile") -> "Mapping[str, Array]":
        """Exact gains of a result file."""
        from obsdesign.families.sporadic.claim import read_gains

        return read_gains(spec, file)

    def claim(self, spec: "Spec", file: "ResultFile") -> "Claim":
        """Claim of a certified result file, checked."""
        from obsdesign.families.sporadic.claim import read

        return read(spec, file)

    def absence(self, spec: "Spec", file: "ResultFile") -> "Proof":
        """Proof that there is no solution."""
        if "certificate" not in file.table("diagnosis"):
            raise file.wrong("diagnosis", "holds no certificate, so there is nothing to be verified")
        raise file.wrong("diagnosis.certificate", f"there is none for type {spec.observer.type}")

    def proved(self, observer: Mapping[str, Any], guarantee: Mapping[str, Any]) -> "Rows":  # noqa: ARG002
        """What is proved, for a table."""
        from obsdesign.families.sporadic.table import claim

        return claim(guarantee)

    def figures(self, observer: Mapping[str, Any]) -> "Rows":
        """What an engineer asks first of the gains, for a table."""
        from obsdesign.families.sporadic.table import gains

        return gains(observer)


SPORADIC = SporadicFamily()
