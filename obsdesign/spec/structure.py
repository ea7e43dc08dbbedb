"""From a document to the models of the format, with every structural error at its place and in plain words."""

from collections.abc import Iterator
from typing import Any, get_args

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from obsdesign.errors import Problem
from obsdesign.spec.document import Document, Loc, described
from obsdesign.spec.schema import File, Section
from obsdesign.spec.words import nearest, unknown

EXPECTED = {
    "is_instance_of": "a number or arithmetic",
    "string_type": "text",
    "list_type": "a list",
    "dict_type": "a mapping",
    "bool_type": "true or false",
    "too_short": "two items [lo, hi]",
    "too_long": "two items [lo, hi]",
}


def validate(document: Document) -> tuple[File | None, list[Problem]]:
    """Read the structure of a document.

    Returns
    -------
    file
        None if nothing can be read; a section in which something is wrong is None.
    problems
        What is wrong in the YAML and in the structure.
    """
    problems = list(document.problems)
    tree = document.root.plain()
    if not isinstance(tree, dict):
        expected = f"a mapping with the keys {', '.join(File.keys())}"
        problems.append(document.problem((), f"expected {expected}; found {described(tree)}"))
        return None, problems
    broken = {meant(problem.key) for problem in problems}
    try:
        return (File.model_validate(tree) if not broken else sound(tree, broken)), problems
    except ValidationError as error:
        known = {problem.key for problem in problems}
        found = [explained(document, details) for details in error.errors(include_url=False)]
        problems += [problem for problem in found if problem.key not in known]
        return sound(tree, broken | {meant(problem.key) for problem in found}), problems


def sound(tree: dict[str, Any], broken: set[str]) -> File:
    """What is left of a file whose `broken` sections are wrong."""
    keys = [key for key in File.keys() if key in tree or key in broken]
    return File.model_validate({key: None if key in broken else tree[key] for key in keys})


def meant(key: str) -> str:
    """Section in which a dotted key stands, or was probably meant to stand."""
    name = key.partition(".")[0].partition("[")[0]
    return nearest(name, File.keys()) or name


def explained(document: Document, details: ErrorDetails) -> Problem:
    """One structural error at its place in plain words."""
    loc = tuple(name for name in details["loc"] if not str(name).startswith("<"))
    kind, value = details["type"], details["input"]
    if kind == "missing":
        return document.problem(loc, "is required")
    if kind == "extra_forbidden":
        owner = model_at(loc[:-1])
        return document.problem(loc, unknown("key", loc[-1], owner.keys(), owner.hints), at_key=True)
    if kind in {"word", "choice", "later"}:
        return document.problem(loc, details["msg"], at_key=kind == "later")
    expected = EXPECTED.get(kind) or details["msg"]
    if kind == "model_type":
        expected = f"a mapping with the keys {', '.join(model_at(loc).keys())}"
    return document.problem(loc, f"expected {expected}; found {described(value)}")


def model_at(loc: Loc) -> type[Section]:
    """Model of the mapping at `loc`; no union of the format has more than one that is a mapping."""
    model: type[Section] = File
    for name in loc:
        for key, field in model.model_fields.items():
            if name == (field.alias or key):
                model = next(models(field.annotation), model)
                break
    return model


def models(annotation: Any) -> Iterator[type[Section]]:
    """Models inside a type."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        yield annotation
    for argument in get_args(annotation):
        yield from models(argument)
