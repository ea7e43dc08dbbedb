"""What the manual says of the keys of a spec, from what their sections say of them."""

import re
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple

from obsdesign.families.asked import ObserverSection
from obsdesign.reading.schema import File
from obsdesign.sections.forms import Either, Form, Key, ListOf, MapOf, Named, OneOf, Section, Single

Parts = list[type[Section]]


class Entry(NamedTuple):
    """What there is to say of a key in one section."""

    said: str
    facts: str
    types: tuple[str, ...]  # of the families in whose section it stands
    section: type[Section]


def explained(name: str) -> str | None:
    """Entry of a key by its dotted name, such as observer.alpha, as Markdown; None: there is no such key."""
    found = entries().get(re.sub(r"\[\d*\]", "", name))
    if found is None:
        return None
    alike: dict[tuple[str, str], list[str]] = {}
    for entry in found:
        alike.setdefault((entry.said, entry.facts), []).extend(entry.types)
    texts = (f"{typed(types)}{said}.\n\n{facts}" for (said, facts), types in alike.items())
    return f"## {name}\n\n" + "\n".join(texts)


def typed(types: Sequence[str]) -> str:
    """Words for the families whose key it is."""
    return f"Type {', '.join(types)}: " if types else ""


def listed() -> list[tuple[str, str]]:
    """Keys, and what each is; those of a section that stands in several places only once."""
    rows = []
    seen: set[tuple[type[Section], str]] = set()
    for name, found in entries().items():
        sections = {(entry.section, name.rpartition(".")[2]) for entry in found}
        if not sections <= seen:
            rows.append((name, "; or: ".join(dict.fromkeys(entry.said for entry in found))))
        seen |= sections
    return rows


@cache
def entries() -> dict[str, list[Entry]]:
    """What there is to say of each key, by its dotted name."""
    found: dict[str, list[Entry]] = {}
    for name, one, section in walked(File, ""):
        types = tuple(section.names()) if issubclass(section, ObserverSection) else ()
        found.setdefault(name, []).append(Entry(one.description, facts(name, one, section), types, section))
    return found


def facts(name: str, one: Key, section: type[Section]) -> str:
    """Section, form, unit, default and example of a key, as a list."""
    written = name.rpartition(".")[2]
    default = "none; it is required" if one.required else one.otherwise or written_default(one.default)
    choices = [other for other in section.forms() if other not in (section.beside or ())]
    if section.beside is not None and written in choices:
        default = f"none; one of {', '.join(choices)} is given"
    keys = ", ".join(dict.fromkeys(key for part in parts(one.form) for key in part.forms()))
    within = "" if section is File or issubclass(section, ObserverSection) else section.__doc__
    rows = {"in": within, "form": words(one.form), "keys": keys, "unit": one.unit, "default": default}
    example = {"example": f"`{written}: {one.example}`"} if one.example else {}
    return "".join(f"- {what}: {said}\n" for what, said in {**rows, **example}.items() if said)


def written_default(value: Any) -> str:
    """Default as a spec has it."""
    return {True: "true", False: "false"}[value] if isinstance(value, bool) else str(value) if value is not None else ""


def walked(section: type[Section], prefix: str) -> Iterator[tuple[str, Key, type[Section]]]:
    """Every key below a section, with its dotted name and the section in which it stands."""
    for name, one in section.forms().items():
        yield f"{prefix}{name}", one, section
        for part in parts(one.form):
            if not issubclass(section, part):  # the same keys again
                yield from walked(part, f"{prefix}{name}.")


def parts(form: Form | type[Section]) -> Parts:
    """Sections that may stand at a place; those that hold no more than others are left out, but for observers.

    Of these the type tells which it is.
    """
    found: Parts = []
    if isinstance(form, type):
        found = [form]
    elif isinstance(form, Named):
        found = parts(form.form)
    elif isinstance(form, ListOf):
        found = parts(form.item)
    elif isinstance(form, Either):
        forms = (form.scalar, form.items, form.rows, form.mapping)
        found = [part for inner in forms if inner is not None for part in parts(inner)]
    elif hasattr(form, "sections"):
        found = form.sections()
    found = list(dict.fromkeys(found))
    return [
        part
        for part in found
        if issubclass(part, ObserverSection)
        or not any(other is not part and issubclass(other, part) for other in found)
    ]


def words(form: Form | type[Section]) -> str:
    """What may stand at a place, in words."""
    if isinstance(form, Single | Either):
        return form.expected
    if isinstance(form, OneOf):
        return f"one of {', '.join((*form.known, *form.beside()))}"
    if isinstance(form, Named):
        return words(form.form)
    if isinstance(form, ListOf):
        count = "two" if form.least == form.most == 2 else ""
        return " ".join(part for part in ("a list of", count, f"items, each {words(form.item)}") if part)
    if isinstance(form, MapOf):
        return f"a mapping of names, each to {words(form.item)}"
    return "a mapping"
