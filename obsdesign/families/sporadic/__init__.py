"""Observers whose measurements arrive sporadically, Ferrante, Gouaisbaut, Sanfelice and Tarbouriech (2019)."""

from typing import Any


class SporadicFamily:
    """The family, for the registry."""

    names = ("sporadic",)

    @property
    def Section(self) -> Any:
        """Keys of the section `observer:`."""
        from obsdesign.reading.families import SporadicObserver

        return SporadicObserver


SPORADIC = SporadicFamily()
