"""The forms that values of a spec take: words, entries, vectors, matrices, and mappings with known keys.

A form reads a value (`read`), says at its place what is wrong with it, and has a JSON Schema (`schema`). A number stays
the text that it was written as. What is wrong reads as None; the section of the file in which it stands is not used.

That these are the project's own, and no library's, was measured (Python 3.11, a shipped spec, one core):
MEASURED
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Generic, Protocol, Self, TypeVar

from obsdesign.sections.document import Loc, described
from obsdesign.sections.values import Reader
from obsdesign.sections.words import nearest, unknown

Schema = dict[str, Any]
T_co = TypeVar("T_co", covariant=True)


class Form(Protocol[T_co]):
    """What may stand at a place."""

    def read(self, reader: Reader, value: Any, loc: Loc) -> T_co | None:
        """Return the value; None, with what is wrong noted, if it has another form."""

    def schema(self, definitions: Schema) -> Schema:
        """JSON Schema; what has a name is added to the definitions."""


def refuse(reader: Reader, expected: str, value: Any, loc: Loc) -> None:
    """Note that a value has another form; that it is missing was said by the reader of the text."""
    if value is not None:
        reader.wrong(loc, f"expected {expected}; found {described(value)}")


@dataclass(frozen=True)
class Plain(Generic[T_co]):
    """A single value of a type of Python."""

    type: type[T_co]
    expected: str
    written: Schema

    def read(self, reader: Reader, value: Any, loc: Loc) -> T_co | None:
        """Return the value as it is."""
        if isinstance(value, self.type):
            return value
        refuse(reader, self.expected, value, loc)
        return None

    def schema(self, definitions: Schema) -> Schema:  # noqa: ARG002
        """Its type in JSON."""
        return dict(self.written)


@dataclass(frozen=True)
class OneOf:
    """A text that is one of a few words."""

    kind: str
    words: Sequence[str] | Callable[[], Sequence[str]]  # called when it is read, where a registry may grow
    hints: Mapping[str, str] | Callable[[], Mapping[str, str]] = field(default_factory=dict)  # of words meant elsewhere

    def read(self, reader: Reader, value: Any, loc: Loc) -> str | None:
        """Return the word."""
        words = self.words() if callable(self.words) else self.words
        if isinstance(value, str) and value in words:
            return str(value)
        if value is not None:
            hints = self.hints() if callable(self.hints) else self.hints
            reader.wrong(loc, unknown(self.kind, value, words, hints))
        return None

    def schema(self, definitions: Schema) -> Schema:  # noqa: ARG002
        """The words."""
        return {"enum": list(self.words() if callable(self.words) else self.words)}


@dataclass(frozen=True)
class Word:
    """The word auto, where other data may stand as well."""

    word: str
    expected: str

    def read(self, reader: Reader, value: Any, loc: Loc) -> str | None:
        """Return the word."""
        if value == self.word:
            return self.word
        refuse(reader, self.expected, value, loc)
        return None

    def schema(self, definitions: Schema) -> Schema:  # noqa: ARG002
        """The word."""
        return {"const": self.word}


@dataclass(frozen=True)
class ListOf(Generic[T_co]):
    """A list of so many items of one form."""

    item: Form[T_co]
    least: int = 0
    most: int | None = None

    def read(self, reader: Reader, value: Any, loc: Loc) -> list[T_co | None] | None:
        """Return the items."""
        if not isinstance(value, list):
            refuse(reader, "a list", value, loc)
            return None
        if len(value) < self.least:
            refuse(reader, f"at least {self.least} items", value, loc)
            return None
        if self.most is not None and len(value) > self.most:
            refuse(reader, f"at most {self.most} items", value, loc)
            return None
        if isinstance(self.item, Plain) and all(isinstance(item, self.item.type) for item in value):
            return value
        return [self.item.read(reader, item, (*loc, i)) for i, item in enumerate(value)]

    def schema(self, definitions: Schema) -> Schema:
        """An array."""
        limits = {"minItems": self.least or None, "maxItems": self.most}
        known = {key: limit for key, limit in limits.items() if limit is not None}
        return {"type": "array", "items": self.item.schema(definitions), **known}


@dataclass(frozen=True)
class MapOf(Generic[T_co]):
    """A mapping of any names to values of one form."""

    item: Form[T_co]

    def read(self, reader: Reader, value: Any, loc: Loc) -> dict[str, T_co | None] | None:
        """Return the values by name."""
        if not isinstance(value, dict):
            refuse(reader, "a mapping", value, loc)
            return None
        return {name: self.item.read(reader, item, (*loc, name)) for name, item in value.items()}

    def schema(self, definitions: Schema) -> Schema:
        """An object with any keys."""
        return {"type": "object", "additionalProperties": self.item.schema(definitions) or True}


@dataclass(frozen=True)
class Anything:
    """A value of any form."""

    def read(self, reader: Reader, value: Any, loc: Loc) -> Any:  # noqa: ARG002
        """Return the value as it is."""
        return value

    def schema(self, definitions: Schema) -> Schema:  # noqa: ARG002
        """Nothing is required."""
        return {}


@dataclass(frozen=True)
class Either:
    """One of a few forms, told apart by whether the value is a single one, a list, rows (lists in it) or a mapping."""

    expected: str
    scalar: Form[Any] | None = None
    items: Form[Any] | None = None
    rows: Form[Any] | None = None
    mapping: Form[Any] | None = None

    def read(self, reader: Reader, value: Any, loc: Loc) -> Any:
        """Return the value as its own form reads it."""
        form = self.scalar
        if isinstance(value, dict):
            form = self.mapping
        elif isinstance(value, list):
            form = self.rows if any(isinstance(item, list) for item in value) else self.items
        if form is not None:
            return form.read(reader, value, loc)
        refuse(reader, self.expected, value, loc)
        return None

    def schema(self, definitions: Schema) -> Schema:
        """One of the forms."""
        forms = (self.scalar, self.items, None if self.rows is self.items else self.rows, self.mapping)
        return {"oneOf": [form.schema(definitions) for form in forms if form is not None]}


@dataclass(frozen=True)
class Named(Generic[T_co]):
    """A form that the JSON Schema defines once, by name."""

    name: str
    form: Form[T_co]

    def read(self, reader: Reader, value: Any, loc: Loc) -> T_co | None:
        """Return the value."""
        return self.form.read(reader, value, loc)

    def schema(self, definitions: Schema) -> Schema:
        """A reference."""
        if self.name not in definitions:
            definitions[self.name] = self.form.schema(definitions)
        return {"$ref": f"#/$defs/{self.name}"}


ENTRY = Plain(str, "a number or arithmetic", {"type": ["number", "string"]})
TEXT = Plain(str, "text", {"type": "string"})
FLAG = Plain(bool, "true or false", {"type": "boolean"})
NUMBERS = ListOf(ENTRY)
MATRIX = Named("Matrix", Either("a number, a vector or a list of rows", ENTRY, NUMBERS, ListOf(NUMBERS)))
VECTOR = Named("Vector", Either("a number or a list of numbers", ENTRY, NUMBERS))
SIGNALS = Named("Signals", Either("an expression or a list of expressions", ENTRY, NUMBERS))


@dataclass(frozen=True)
class Key:
    """A key of a mapping."""

    form: Form[Any]
    description: str = ""
    default: Any = None
    required: bool = False

    def schema(self, definitions: Schema) -> Schema:
        """JSON Schema of the value, with what is said of it."""
        said = {"description": self.description} if self.description else {}
        given = {} if self.default is None else {"default": self.default}
        return {**self.form.schema(definitions), **said, **given}


def key(form: Form[Any], description: str = "", *, default: Any = None, name: str | None = None) -> Any:
    """Field of a section that may be left out; `name` is how it is written where that is no name of Python."""
    made = Key(form, description, default)
    return field(kw_only=True, default_factory=lambda: default, metadata={"key": made, "name": name})


def required(form: Form[Any], description: str = "") -> Any:
    """Field of a section that must be given."""
    return field(kw_only=True, metadata={"key": Key(form, description, required=True)})


def read_keys(
    reader: Reader, keys: Mapping[str, Key], value: Mapping[str, Any], loc: Loc, hints: Mapping[str, str]
) -> dict[str, Any]:
    """Values of the keys that are given; a misspelt key is not missing as well.

    Parameters
    ----------
    hints
        What to say of other keys that have a meaning.
    """
    others = [name for name in value if name not in keys]
    misspelt = {nearest(name, tuple(keys)) for name in others}
    for name, one in keys.items():
        if one.required and name not in value and name not in misspelt:
            reader.wrong((*loc, name), "is required")
    for name in others:
        reader.wrong((*loc, name), unknown("key", name, tuple(keys), hints), at_key=True)
    return {name: one.form.read(reader, value[name], (*loc, name)) for name, one in keys.items() if name in value}


class Section:
    """A mapping with known keys: a frozen dataclass, each field a `key` or `required`."""

    hints: ClassVar[Mapping[str, str]] = {}  # what to say of other keys that have a meaning

    @classmethod
    def forms(cls) -> dict[str, Key]:
        """Keys as they are written."""
        return {f.metadata.get("name") or f.name: f.metadata["key"] for f in fields(cls)}  # type: ignore[arg-type]

    @classmethod
    def hinted(cls) -> Mapping[str, str]:
        """What to say of other keys that have a meaning."""
        return cls.hints

    @classmethod
    def read(cls, reader: Reader, value: Any, loc: Loc) -> Self | None:
        """Return the section; None, with what is wrong noted."""
        if not isinstance(value, dict):
            refuse(reader, f"a mapping with the keys {', '.join(cls.forms())}", value, loc)
            return None
        before = len(reader.problems)
        found = read_keys(reader, cls.forms(), value, loc, cls.hinted())
        if len(reader.problems) == before:
            cls.agree(reader, found, loc)
        return cls.of(found) if len(reader.problems) == before and None not in found.values() else None

    @classmethod
    def agree(cls, reader: Reader, found: Mapping[str, Any], loc: Loc) -> None:
        """Refuse keys that do not go together."""

    @classmethod
    def of(cls, found: Mapping[str, Any]) -> Self:
        """Return the section of these values."""
        names = {f.metadata.get("name") or f.name: f.name for f in fields(cls)}  # type: ignore[arg-type]
        return cls(**{names[name]: value for name, value in found.items()})

    @classmethod
    def schema(cls, definitions: Schema) -> Schema:
        """Return a reference to an object with these keys and no others."""
        if cls.__name__ not in definitions:
            definitions[cls.__name__] = {}
            definitions[cls.__name__] = cls.described(definitions)
        return {"$ref": f"#/$defs/{cls.__name__}"}

    @classmethod
    def described(cls, definitions: Schema) -> Schema:
        """An object with these keys and no others."""
        keys = cls.forms()
        needed = [name for name, one in keys.items() if one.required]
        return {
            "title": cls.__name__,
            "description": cls.__doc__,
            "type": "object",
            "properties": {name: one.schema(definitions) for name, one in keys.items()},
            "additionalProperties": False,
            **({"required": needed} if needed else {}),
        }


class Choice(Section):
    """A mapping with exactly one of its keys, but for those that may stand beside it."""

    beside: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def agree(cls, reader: Reader, found: Mapping[str, Any], loc: Loc) -> None:
        """Refuse a mapping with another number of its keys."""
        choices = [name for name in cls.forms() if name not in cls.beside]
        if sum(name in found for name in choices) != 1:
            reader.wrong(loc, f"expected one of the keys {', '.join(choices)}")
