"""Dataclasses that are quick to import: what compares and prints them is not compiled for each class.

`dataclasses.dataclass` writes the methods of a class as text and compiles it whenever its module is imported (up to
Python 3.12 one by one). A design, a proof or a message imports some two hundred classes: that was a quarter of their
time. Here only __init__ is compiled; __eq__, __hash__, __repr__ and what keeps a frozen object as it is are functions
of the names of the fields, and mean the same. All modules take `dataclass` from here, for a frozen class of the one
kind has no subclass of the other, and what goes with it; a type checker sees those of the standard library.
"""

import dataclasses
from collections.abc import Callable, Collection, Sequence
from dataclasses import field, replace
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

__all__ = ["dataclass", "field", "replace"]

if TYPE_CHECKING:
    from dataclasses import dataclass
else:

    def dataclass(
        cls: type | None = None, /, *, frozen: bool = False, eq: bool = True, repr: bool = True, kw_only: bool = False
    ) -> Any:
        """`dataclasses.dataclass` with those of its options that are used here."""

        def made(cls: type) -> type:
            own = vars(cls)
            hashed = own.get("__hash__") is not None
            done = dataclasses.dataclass(cls, eq=False, repr=False, kw_only=kw_only)
            fields = dataclasses.fields(done)
            if eq and "__eq__" not in own:
                done.__eq__ = equality([one.name for one in fields if one.compare])
            if eq and not hashed:
                names = [one.name for one in fields if (one.compare if one.hash is None else one.hash)]
                done.__hash__ = hashing(names) if frozen else None
            if repr and "__repr__" not in own:
                done.__repr__ = printing([one.name for one in fields if one.repr])
            if frozen:
                done.__setattr__ = setting({one.name for one in fields if one.init})
                done.__delattr__ = undeletable
            return done

        return made if cls is None else made(cls)


def setting(names: Collection[str]) -> Callable[[Any, str, Any], None]:
    """__setattr__ of a frozen class: __init__ sets each attribute of these names once, and nothing sets another."""

    def set_once(self: Any, name: str, value: Any) -> None:
        own = self.__dict__
        if name in own or name not in names:
            raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
        own[name] = value

    return set_once


def undeletable(self: Any, name: str) -> None:  # noqa: ARG001
    """__delattr__ of a frozen class."""
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")


def reader(names: Sequence[str]) -> Callable[[Any], tuple[Any, ...]]:
    """Function of an object: the tuple of its attributes of these names."""
    if len(names) > 1:
        return attrgetter(*names)
    return lambda one: tuple(getattr(one, name) for name in names)


def equality(names: Sequence[str]) -> Callable[[Any, Any], bool]:
    """__eq__ of a class: the other is of the same class and has the same attributes of these names."""
    values = reader(names)

    def equal(self: Any, other: Any) -> bool:
        return values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented

    return equal


def hashing(names: Sequence[str]) -> Callable[[Any], int]:
    """__hash__ of a class: that of the tuple of its attributes of these names."""
    values = reader(names)

    def hashed(self: Any) -> int:
        return hash(values(self))

    return hashed


def printing(names: Sequence[str]) -> Callable[[Any], str]:
    """__repr__ of a class: its name and its attributes of these names; an object within itself is three dots."""

    @recursive_repr()
    def printed(self: Any) -> str:
        return f"{type(self).__qualname__}({', '.join(f'{name}={getattr(self, name)!r}' for name in names)})"

    return printed
