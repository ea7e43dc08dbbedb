"""The forms that values of a spec take: words, entries, vectors, matrices, and mappings with known keys.

A form reads a value (`read`), says at its place what is wrong with it, and has a JSON Schema (`schema`). A number stays
the text that it was written as. What is wrong reads as None; the section of the file in which it stands is not used.

Why these and no library's (2026-11-28, Python 3.11, one core, the spec of the magnetic bearing, times in ms):

                     import  build  read   all errors   JSON Schema  lines around it
    these                 7      4  0.07   yes          yes          289
    pydantic 2.14        57     47  0.04   yes          yes          247, and a model built again for each registration
    msgspec 0.22         10      1  0.002  the first    yes          messages and places as well
    attrs, cattrs        25      8  0.01   one a class  no           unions, messages, places and schema as well

`import obsdesign.reading` went from 387 to 294 ms and from 62 to 50 MB. What a section may hold is known only when it
is read, since families and types of nonlinearities are registered, which no static model says.
"""

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Protocol, Self, dataclass_transform

from obsdesign.errors import NOT_ONE_LINE
from obsdesign.records import dataclass
from obsdesign.sections.document import Loc, compose
from obsdesign.sections.scalars import Number, described
from obsdesign.sections.slips import rewritten
from obsdesign.sections.values import Reader
from obsdesign.sections.words import nearest, unknown

Schema = dict[str, Any]
Entries = str | list[str] | list[list[str]]  # of a matrix
Items = str | list[str]


class Form(Protocol):
    """What may stand at a place."""

    def read(self, reader: Reader, value: Any, loc: Loc) -> Any:
        """Return the value; None, with what is wrong noted, if it has another form."""

    def schema(self, definitions: Schema) -> Schema:
        """JSON Schema; what has a name is added to the definitions."""


def refuse(reader: Reader, expected: str, value: Any, loc: Loc) -> Any:
    """None, with a note that a value has another form; that it is missing was said by the reader of the text."""
    if value is not None:
        reader.wrong(loc, f"expected {expected}; found {described(value)}", id="OBS204")


@dataclass(frozen=True)
class Single:
    """A single value, as it is."""

    accepts: Callable[[Any], bool]
    expected: str
    written: Schema

    def read(self, reader: Reader, value: Any, loc: Loc) -> Any:
        """Return the value."""
        return value if self.accepts(value) else refuse(reader, self.expected, value, loc)

    def schema(self, definitions: Schema) -> Schema:  # noqa: ARG002
        """Its type in JSON."""
        return dict(self.written)


@dataclass(frozen=True)
class OneOf:
    """A text that is one of a few words."""

    kind: str
    words: Callable[[], tuple[str, ...]] | tuple[str, ...]  # called where a registry may grow
    hints: Callable[[], Mapping[str, str]] = dict  # what to say of other words that have a meaning
    beside: Callable[[], tuple[str, ...]] = tuple  # what else is allowed at the place, for messages

    @property
    def known(self) -> tuple[str, ...]:
        """The words."""
        return self.words() if callable(self.words) else self.words

    def read(self, reader: Reader, value: Any, loc: Loc) -> Any:
        """Return the word."""
        if isinstance(value, str) and value in self.known:
            return str(value)
        if value is not None:
            reader.wrong(loc, unknown(self.kind, value, self.known, self.hints(), self.beside()), id="OBS202")
        return None

    def schema(self, definitions: Schema) -> Schema:  # noqa: ARG002
        """The words."""
        return {"enum": list(self.known)}


@dataclass(frozen=True)
class ListOf:
    """A list of so many items of one form."""

    item: Form
    least: int = 0
    most: int | None = None

    def read(self, reader: Reader, value: Any, loc: Loc) -> Any:
        """Return the items."""
        if not isinstance(value, list):
            return refuse(reader, "a list", value, loc)
        if len(value) < self.least:
            return refuse(reader, f"at least {self.least} item{'s' * (self.least > 1)}", value, loc)
        if self.most is not None and len(value) > self.most:
            return refuse(reader, f"at most {self.most} item{'s' * (self.most > 1)}", value, loc)
        if isinstance(self.item, Single) and all(map(self.item.accepts, value)):
            return value
        return [self.item.read(reader, item, (*loc, i)) for i, item in enumerate(value)]

    def schema(self, definitions: Schema) -> Schema:
        """An array."""
        limits = {"minItems": self.least or None, "maxItems": self.most}
        known = {name: limit for name, limit in limits.items() if limit is not None}
        return {"type": "array", "items": self.item.schema(definitions), **known}


@dataclass(frozen=True)
class MapOf:
    """A mapping of any names to values of one form."""

    item: Form
    least: int = 0

    def read(self, reader: Reader, value: Any, loc: Loc) -> Any:
        """Return the values by name."""
        if not isinstance(value, dict):
            return refuse(reader, "a mapping" + rewritten(value), value, loc)
        if len(value) < self.least:
            return refuse(reader, f"at least {self.least} entry", value, loc)
        return {name: self.item.read(reader, item, (*loc, name)) for name, item in value.items()}

    def schema(self, definitions: Schema) -> Schema:
        """An object with any keys."""
        least = {"minProperties": self.least} if self.least else {}
        return {"type": "object", "additionalProperties": self.item.schema(definitions) or True, **least}


@dataclass(frozen=True)
class Either:
    """One of a few forms, told apart by whether the value is a single one, a list, rows (lists in it) or a mapping."""

    expected: str
    scalar: Form | None = None
    items: Form | None = None
    rows: Form | None = None
    mapping: Form | None = None

    def read(self, reader: Reader, value: Any, loc: Loc) -> Any:
        """Return the value as its own form reads it."""
        form = self.scalar
        if isinstance(value, dict):
            form = self.mapping
        elif isinstance(value, list):
            form = self.rows if any(isinstance(item, list) for item in value) else self.items
        return refuse(reader, self.expected, value, loc) if form is None else form.read(reader, value, loc)

    def schema(self, definitions: Schema) -> Schema:
        """One of the forms."""
        forms = (self.scalar, self.items, None if self.rows is self.items else self.rows, self.mapping)
        return {"anyOf": [form.schema(definitions) for form in forms if form is not None]}


@dataclass(frozen=True)
class Named:
    """A form that the JSON Schema defines once, by name."""

    name: str
    form: Form

    def read(self, reader: Reader, value: Any, loc: Loc) -> Any:
        """Return the value."""
        return self.form.read(reader, value, loc)

    def schema(self, definitions: Schema) -> Schema:
        """A reference."""
        if self.name not in definitions:
            definitions[self.name] = self.form.schema(definitions)
        return {"$ref": f"#/$defs/{self.name}"}


def auto(expected: str) -> Single:
    """Form of the word auto, where other data may stand as well."""
    return Single(lambda value: value == "auto", expected, {"const": "auto"})


def are_lines(value: Any) -> bool:
    """Whether every text in a value is one line, as it is printed."""
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return not (isinstance(value, str) and NOT_ONE_LINE.search(value)) and all(map(are_lines, parts))


ENTRY = Single(lambda value: isinstance(value, str), "a number or arithmetic", {"type": ["number", "string"]})
TEXT = Single(lambda value: isinstance(value, str), "text", {"type": ["string", "number"]})
FLAG = Single(lambda value: isinstance(value, bool), "true or false", {"type": "boolean"})
LINE = Single(lambda value: isinstance(value, str) and are_lines(value), "one line of text", TEXT.written)
ANYTHING = Single(are_lines, "numbers and texts of one line", {})
NUMBERS = ListOf(ENTRY)
MATRIX = Named("Matrix", Either("a number, a vector or a list of rows", ENTRY, NUMBERS, ListOf(NUMBERS)))
VECTOR = Named("Vector", Either("a number or a list of numbers", ENTRY, NUMBERS))
SIGNALS = Named("Signals", Either("an expression or a list of expressions (files are not read here)", ENTRY, NUMBERS))


@dataclass(frozen=True)
class Key:
    """A key of a mapping, and what the manual says of it."""

    form: Form
    description: str = ""
    default: Any = None
    name: str | None = None  # as it is written, where that is no name of Python
    required: bool = False
    otherwise: str = ""  # what holds where it is left out, if that is no value that could be written
    unit: str = ""
    example: str = ""  # a value, as YAML

    @property
    def asked(self) -> str:
        """What to give where it is missing, if one of several forms."""
        return f"; give {self.form.expected}" if isinstance(self.form, Either) else ""

    def schema(self, definitions: Schema) -> Schema:
        """JSON Schema of the value, with what is said of it."""
        otherwise = f"default: {self.otherwise}" if self.otherwise else ""
        said = "; ".join(part for part in (self.description, self.unit, otherwise) if part)
        described = {"description": said} if said else {}
        shown = {"examples": [in_json(compose(self.example, "").root.plain())]} if self.example else {}
        given = {} if self.default is None else {"default": self.default}
        return {**self.form.schema(definitions), **described, **given, **shown}


def in_json(value: Any) -> Any:
    """A plain value with its numbers as JSON has them."""
    if isinstance(value, dict):
        return {name: in_json(item) for name, item in value.items()}
    if isinstance(value, list):
        return [in_json(item) for item in value]
    if not isinstance(value, Number):
        return value
    return int(value) if value.lstrip("-").isdigit() else float(value)


def key(
    form: Form,
    description: str = "",
    *,
    default: Any = None,
    otherwise: str = "",
    unit: str = "",
    example: str = "",
    name: str | None = None,
) -> Any:
    """Key of a section that may be left out."""
    return Key(form, description, default, name, otherwise=otherwise, unit=unit, example=example)


def required(form: Form, description: str = "", *, unit: str = "", example: str = "") -> Any:
    """Key of a section that must be given."""
    return Key(form, description, required=True, unit=unit, example=example)


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(key, required))
class Section:
    """A mapping with known keys: each attribute of a subclass that is made by `key` or `required`; itself a form."""

    hints: ClassVar[Mapping[str, str]] = {}  # what to say of other keys that have a meaning
    beside: ClassVar[tuple[str, ...] | None] = None  # exactly one other key is given beside these; None: any number
    declared: ClassVar[dict[str, Key]] = {}  # by attribute

    def __init_subclass__(cls) -> None:
        own = {name: value for name, value in vars(cls).items() if isinstance(value, Key)}
        cls.declared = {**cls.declared, **own}
        for name, one in own.items():
            setattr(cls, name, one.default)

    def __init__(self, **values: Any) -> None:
        vars(self).update(values)

    @classmethod
    def forms(cls) -> dict[str, Key]:
        """Keys as they are written."""
        return {one.name or name: one for name, one in cls.declared.items()}

    @classmethod
    def hinted(cls) -> Mapping[str, str]:
        """What to say of other keys that have a meaning."""
        return cls.hints

    @classmethod
    def read(cls, reader: Reader, value: Any, loc: Loc) -> Self | None:
        """Return the section; None, with what is wrong noted."""
        if not isinstance(value, dict):
            refuse(reader, f"a mapping with the keys {', '.join(cls.forms())}{rewritten(value)}", value, loc)
            return None
        before = len(reader.problems)
        found = cls.values(reader, value, loc)
        choices = [name for name in cls.forms() if name not in (cls.beside or ())]
        if cls.beside is not None and len(reader.problems) == before and sum(name in found for name in choices) != 1:
            reader.wrong(loc, f"expected one of the keys {', '.join(choices)}", id="OBS206")
        return cls.of(found) if len(reader.problems) == before and None not in found.values() else None

    @classmethod
    def values(cls, reader: Reader, value: Mapping[str, Any], loc: Loc) -> dict[str, Any]:
        """Values of the keys that are given; a misspelt key is not missing as well."""
        keys = cls.forms()
        others = [name for name in value if name not in keys]
        misspelt = {nearest(name, tuple(keys)) for name in others}
        for name, one in keys.items():
            if one.required and name not in value and name not in misspelt:
                reader.wrong((*loc, name), f"is required{one.asked}", id="OBS205")
        for name in others:
            reader.wrong((*loc, name), unknown("key", name, tuple(keys), cls.hinted()), at_key=True, id="OBS201")
        return {name: one.form.read(reader, value[name], (*loc, name)) for name, one in keys.items() if name in value}

    @classmethod
    def of(cls, found: Mapping[str, Any]) -> Self:
        """Return the section of these values."""
        names = {one.name or name: name for name, one in cls.declared.items()}
        return cls(**{names[name]: value for name, value in found.items()})

    @classmethod
    def schema(cls, definitions: Schema) -> Schema:
        """Return a reference to an object with these keys and no others."""
        if cls.__name__ not in definitions:
            definitions[cls.__name__] = {}
            definitions[cls.__name__] = cls.object(definitions)
        return {"$ref": f"#/$defs/{cls.__name__}"}

    @classmethod
    def object(cls, definitions: Schema) -> Schema:
        """Return an object with these keys and no others."""
        keys = cls.forms()
        needed = [name for name, one in keys.items() if one.required]
        choices = [] if cls.beside is None else [name for name in keys if name not in cls.beside]
        return {
            "title": cls.__name__,
            "description": cls.__doc__,
            "type": "object",
            "properties": {name: one.schema(definitions) for name, one in keys.items()},
            "additionalProperties": False,
            **({"required": needed} if needed else {}),
            **({"oneOf": [{"required": [name]} for name in choices]} if choices else {}),
        }
