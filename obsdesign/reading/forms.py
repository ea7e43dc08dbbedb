"""The forms that values of a spec take: words, entries, vectors, matrices, and mappings with known keys.

A number stays the text that it was written as (`Entry`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict, Discriminator, InstanceOf, Tag, WithJsonSchema
from pydantic import model_validator as validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema
from typing_extensions import TypeAliasType

from obsdesign.reading.words import unknown


def form(value: Any) -> str:
    """Tag of the form of a value, by which a union is told apart."""
    if isinstance(value, dict):
        return "<mapping>"
    if isinstance(value, list):
        return "<rows>" if any(isinstance(item, list) for item in value) else "<list>"
    return "<scalar>"


def outline(value: Any) -> str:
    """Tag of the form of a value, whatever a list holds."""
    return "<list>" if isinstance(value, list) else form(value)


def told_apart(expected: str, by: Callable[[Any], str] = form) -> Discriminator:
    """Discriminator of a union by form; `expected` completes "expected .., found ..."."""
    return Discriminator(by, custom_error_type="expected", custom_error_message=expected)


@dataclass(frozen=True, eq=False)
class OneOf:
    """Marks a text as one of a few words."""

    kind: str
    words: tuple[str, ...]
    hints: Mapping[str, str] = field(default_factory=dict)  # what to say of other words that have a meaning

    def check(self, value: Any) -> str:
        """Return the word, or say which are allowed."""
        if isinstance(value, str) and value in self.words:
            return value
        raise PydanticCustomError("word", "{message}", {"message": unknown(self.kind, value, self.words, self.hints)})

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.check)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> JsonSchemaValue:
        return {"enum": list(self.words)}


@dataclass(frozen=True, eq=False)
class Automatic:
    """Marks the word auto in place of data of another form."""

    instead: str  # the other form

    def check(self, value: Any) -> str:
        """Return the word, or say what is allowed."""
        if value == "auto":
            return "auto"
        raise PydanticCustomError("expected", "{message}", {"message": f"{self.instead}, or auto"})

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.check)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> JsonSchemaValue:
        return {"const": "auto"}


Text = str
Entry = Annotated[InstanceOf[str], WithJsonSchema({"type": ["number", "string"]})]
Scalar = Annotated[Entry, Tag("<scalar>")]
Items = Annotated[list[Entry], Tag("<list>")]
Rows = Annotated[list[list[Entry]], Tag("<rows>")]
Matrix = TypeAliasType("Matrix", Annotated[Scalar | Items | Rows, told_apart("a number, a vector or a list of rows")])
Vector = TypeAliasType("Vector", Annotated[Scalar | Items, told_apart("a number or a list of numbers")])
Signals = TypeAliasType("Signals", Annotated[Scalar | Items, told_apart("an expression or a list of expressions")])


class Section(BaseModel):
    """A mapping with known keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)
    hints: ClassVar[Mapping[str, str]] = {}  # what to say of other keys that have a meaning
    tag: ClassVar[str] = "<mapping>"  # in unions

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Names of the keys, as they are written."""
        return tuple(f.alias or name for name, f in cls.model_fields.items())


class Choice(Section):
    """A mapping with exactly one of its keys, but for those that may stand beside it."""

    beside: ClassVar[tuple[str, ...]] = ()

    @validator(mode="after")
    def _one_key(self) -> Self:
        if len(self.model_fields_set.difference(self.beside)) != 1:
            keys = ", ".join(name for name in self.names() if name not in self.beside)
            raise PydanticCustomError("choice", "expected one of the keys {keys}", {"keys": keys})
        return self
