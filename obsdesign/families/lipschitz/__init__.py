"""Observers of Lipschitz systems, Abbaszadeh and Marquez (2010)."""

from typing import Any


class LipschitzFamily:
    """The family, for the registry."""

    names = ("lipschitz",)

    @property
    def Section(self) -> Any:
        """Keys of the section `observer:`."""
        from obsdesign.reading.families import LipschitzObserver

        return LipschitzObserver


LIPSCHITZ = LipschitzFamily()
