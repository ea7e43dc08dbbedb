"""The manual: a page a topic, `TOPIC.md` beside this module; in messages.md a section for each id of a message."""

import re
from importlib.resources import files

from obsdesign.errors import Problem, UsageError

ID = re.compile(r"OBS[0-9]{3}")
MESSAGES = "messages"  # topic of the page that explains ids


def topics() -> dict[str, str]:
    """Topics in the order of the alphabet, and the title of the page of each."""
    pages = (page for page in files(__name__).iterdir() if page.name.endswith(".md"))
    found = {page.name.removesuffix(".md"): page.read_text("utf-8") for page in pages}
    return {name: found[name].partition("\n")[0].lstrip("# ") for name in sorted(found)}


def explained(topic: str) -> str:
    """Page of a topic, or the section of an id such as OBS104, as Markdown.

    Raises `UsageError`: there is none.
    """
    id = topic.upper()
    if ID.fullmatch(id):
        if id in (known := sections()):
            return known[id]
    elif topic in topics():
        return page(topic)
    allowed = f"{', '.join(topics())}, or the id of a message such as OBS104"
    raise UsageError(Problem(f"there is no page of it; allowed: {allowed}", topic, id="OBS907"))


def sections() -> dict[str, str]:
    """Sections of the page of messages by their ids."""
    parts = re.split(rf"^(?=## {ID.pattern} )", page(MESSAGES), flags=re.MULTILINE)
    return {part[3:9]: part for part in parts[1:]}


def page(topic: str) -> str:
    """Text of a page."""
    return files(__name__).joinpath(f"{topic}.md").read_text("utf-8")
