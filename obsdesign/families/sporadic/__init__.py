"""Observers whose measurements arrive sporadically, Ferrante, Gouaisbaut, Sanfelice and Tarbouriech (2019)."""

from typing import TYPE_CHECKING

from obsdesign.families.family import Family

if TYPE_CHECKING:
    from obsdesign.families.asked import Estimation
    from obsdesign.families.sporadic.request import SporadicObserver, SporadicRequest
    from obsdesign.sections.values import Reader


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


SPORADIC = SporadicFamily()
