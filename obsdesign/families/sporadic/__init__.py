"""Observers whose measurements arrive sporadically, Ferrante, Gouaisbaut, Sanfelice and Tarbouriech (2019)."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from obsdesign.families.family import Family

if TYPE_CHECKING:
    from obsdesign.families.asked import Estimation
    from obsdesign.families.observer import Observer
    from obsdesign.families.sporadic.request import SporadicObserver, SporadicRequest
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


SPORADIC = SporadicFamily()
