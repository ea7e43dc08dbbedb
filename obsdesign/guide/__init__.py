"""The manual: a page a topic, `TOPIC.md` beside this module.

messages.md has a section for each id of a message, glossary.md one for each word of results, by all names in its title.
"""

import re
from importlib.resources import files

ID = re.compile(r"OBS[0-9]{3}")
MESSAGES = "messages"  # topic of the page that explains ids
GLOSSARY = "glossary"  # topic of the page that explains words


def topics() -> dict[str, str]:
    """Topics in the order of the alphabet, and the title of the page of each."""
    pages = (page for page in files(__name__).iterdir() if page.name.endswith(".md"))
    found = {page.name.removesuffix(".md"): page.read_text("utf-8") for page in pages}
    return {name: found[name].partition("\n")[0].lstrip("# ") for name in sorted(found)}


def explained(topic: str) -> str | None:
    """Page of a topic, or the section of an id such as OBS104, as Markdown; None: there is none."""
    id = topic.upper()
    if ID.fullmatch(id):
        return sections().get(id)
    return page(topic) if topic in topics() else None


def sections() -> dict[str, str]:
    """Sections of the page of messages by their ids."""
    parts = re.split(rf"^(?=## {ID.pattern} )", page(MESSAGES), flags=re.MULTILINE)
    return {part[3:9]: part for part in parts[1:]}


def words() -> dict[str, str]:
    """Sections of the glossary by each of their names."""
    parts = re.split(r"^(?=## )", page(GLOSSARY), flags=re.MULTILINE)[1:]
    return {name: part for part in parts for name in part[3:].partition("\n")[0].split(", ")}


def meaning(word: str) -> str | None:
    """Section of the glossary on a word, or on an entry of a file such as guarantee.limit.gamma; None: there is none.

    A capital letter matters only between words that differ in nothing else, such as v and V.
    """
    known, (first, *rest) = words(), word.split(".")
    folded = {name.lower(): part for name, part in reversed(known.items())}
    for name in (part.replace("_", " ").strip() for part in rest or (first,)):
        if found := known.get(name, folded.get(name.lower())):
            return found
    return None


def page(topic: str) -> str:
    """Text of a page."""
    return files(__name__).joinpath(f"{topic}.md").read_text("utf-8")
