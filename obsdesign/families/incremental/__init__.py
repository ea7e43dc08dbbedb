"""Observers with the gains L1 and L2 (families l2 and linf), Corless and Chakrabarty (2019)."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from obsdesign.families.family import Family

if TYPE_CHECKING:
    from obsdesign.families import observer as equations
    from obsdesign.families.asked import Estimation
    from obsdesign.families.incremental.request import Observer, Request
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


INCREMENTAL = IncrementalFamily()
