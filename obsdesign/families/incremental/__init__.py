"""Observers with the gains L1 and L2 (families l2 and linf), Corless and Chakrabarty (2019)."""

from typing import Any


class IncrementalFamily:
    """The family, for the registry."""

    names = ("l2", "linf")

    @property
    def Section(self) -> Any:
        """Keys of the section `observer:`."""
        from obsdesign.reading.families import Observer

        return Observer


INCREMENTAL = IncrementalFamily()
