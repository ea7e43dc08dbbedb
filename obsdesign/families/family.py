"""What a family of observers is to the rest: all that a stage may know of it."""

from typing import Any, Protocol


class Family(Protocol):
    """A family of observers: one object, in the `__init__.py` of its folder; its methods import what they use."""

    @property
    def names(self) -> tuple[str, ...]:
        """Values of `observer.type`."""

    @property
    def Section(self) -> Any:
        """Keys of the section `observer:`; what messages and the JSON Schema say of them comes from here."""
