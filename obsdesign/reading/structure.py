"""From a document to the models of the format, with every structural error in plain words at its place."""

import re
from collections.abc import Iterator
from typing import Any, get_args

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from obsdesign.errors import Problem
from obsdesign.reading.document import MAX_PROBLEMS, Document, Loc, described
from obsdesign.reading.forms import Section
from obsdesign.reading.schema import File
from obsdesign.reading.words import nearest, unknown

EXPECTED = {
    "is_instance_of": "a number or arithmetic",
    "string_type": "text",
    "list_type": "a list",
    "dict_type": "a mapping",
    "bool_type": "true or false",
    "too_short": "at least {min_length} items",
    "too_long": "at most {max_length} items",
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
        expected = f"a mapping with the keys {', '.join(File.names())}"
        problems.append(document.problem((), f"expected {expected}; found {described(tree)}"))
        return None, problems
    broken = {meant(re.split(r"[.\[]", problem.key)[0]) for problem in problems}
    try:
        file = File.model_validate(tree)
    except ValidationError as error:
        errors = [(place(details), details) for details in error.errors(include_url=False)]
        broken.update(meant(str(loc[0])) for loc, _ in errors)
        known = {problem.key for problem in problems}
        problems += [problem for problem in explained(document, errors) if problem.key not in known]
        return sound(tree, broken), problems
    return sound(tree, broken) if broken else file, problems


def sound(tree: dict[str, Any], broken: set[str]) -> File:
    """Return what is left of a file whose `broken` sections are wrong."""
    left = {key: tree[key] for key in File.names() if key in tree and key not in broken}
    return File.model_validate(left | dict.fromkeys(broken.intersection(File.names())))


def meant(name: str) -> str:
    """Section that a key of a file was probably meant to be."""
    return nearest(name, File.names()) or name


def place(details: ErrorDetails) -> Loc:
    """Where an error stands, without the tags of unions."""
    return tuple(name for name in details["loc"] if not str(name).startswith("<"))


def explained(document: Document, errors: list[tuple[Loc, ErrorDetails]]) -> Iterator[Problem]:
    """Structural errors at their places in plain words; a misspelt key is not missing as well."""
    misspelt = {
        (*loc[:-1], nearest(str(loc[-1]), model_at(details["loc"][:-1]).names()))
        for loc, details in errors[:MAX_PROBLEMS]
        if details["type"] == "extra_forbidden"
    }
    for loc, details in errors[: MAX_PROBLEMS + 1]:
        if not (details["type"] == "missing" and loc in misspelt):
            yield explanation(document, loc, details)


def explanation(document: Document, loc: Loc, details: ErrorDetails) -> Problem:
    """One structural error at its place in plain words."""
    kind, value = details["type"], details["input"]
    if kind == "missing":
        return document.problem(loc, "is required")
    if kind == "extra_forbidden":
        owner = model_at(details["loc"][:-1])
        return document.problem(loc, unknown("key", loc[-1], owner.names(), owner.hints), at_key=True)
    if kind in {"word", "choice", "later"}:
        return document.problem(loc, details["msg"], at_key=kind == "later")
    expected = EXPECTED[kind].format(**details.get("ctx", {})) if kind in EXPECTED else details["msg"]
    if kind == "model_type":
        keys = ", ".join(model_at(details["loc"]).names())
        expected = f"a mapping with the keys {keys}"
    return document.problem(loc, f"expected {expected}; found {described(value)}")


def model_at(loc: Loc) -> type[Section]:
    """Model of the mapping at `loc`, with the tags of unions, which tell models of one place apart."""
    model: type[Section] = File
    found: list[type[Section]] = []
    for name in loc:
        model = next((option for option in found if option.tag == name), model)
        for key, field in model.model_fields.items():
            if name == (field.alias or key):
                found = list(models(field.annotation))
                model = next(iter(found), model)
                break
    return model


def models(annotation: Any) -> Iterator[type[Section]]:
    """Models inside a type."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        yield annotation
    for argument in get_args(annotation):
        yield from models(argument)
