"""Observers with the gains L1 and L2 (families l2 and linf), Corless and Chakrabarty (2019)."""

from typing import TYPE_CHECKING

from obsdesign.families.family import Family

if TYPE_CHECKING:
    from obsdesign.families.asked import Estimation
    from obsdesign.families.incremental.request import Observer, Request
    from obsdesign.sections.values import Reader


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


INCREMENTAL = IncrementalFamily()
