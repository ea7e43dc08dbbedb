"""`obsdesign explain`: the manual."""

from collections.abc import Iterator
from typing import Annotated

import typer

from obsdesign.cli.printing import say
from obsdesign.errors import Problem, UsageError

KEYS = "spec"  # topic whose page ends with all keys


def explain(
    topic: Annotated[
        list[str], typer.Argument(metavar="[TOPIC|WORD|ID|KEY]", help="Default: the list of topics.")
    ] = [],  # noqa: B006
) -> None:
    """Print a page of the manual, or what a word of a result such as gamma, an id such as OBS104 or a key means."""
    from obsdesign.guide import topics
    from obsdesign.tables.text import aligned

    asked = " ".join(topic).strip()
    if not asked:
        say(aligned([*topics().items()]))
        say("\nobsdesign explain TOPIC prints a page, obsdesign explain OBS104 what a message means,")
        say("obsdesign explain gamma what a word of a result means (of the glossary),")
        say("obsdesign explain observer.alpha what a key of a spec takes")
        return
    found = [text.rstrip() for text in texts(asked)]
    if not found:
        raise missing(asked)
    say("\n\n".join(found))


def texts(topic: str) -> Iterator[str]:
    """What the manual has on a topic: its page, its word in the glossary, the keys of a spec of this name."""
    from obsdesign.guide import explained, meaning
    from obsdesign.reading import reference
    from obsdesign.tables.text import aligned

    page, key = explained(topic), reference.explained(topic)
    if page:
        yield f"{page}\n{aligned(reference.listed())}" if topic == KEYS else page
    word = None if key and "." in topic else meaning(topic)
    if key and not page:
        yield key
    if word:
        yield word
    others = [] if key or page else [name for name in reference.entries() if name.rpartition(".")[2] == topic]
    if len(others) == 1 and not word:
        yield reference.explained(others[0]) or ""
    elif others:
        yield f"As a key of a spec: obsdesign explain {', '.join(others)}"


def near(id: str, known: list[str]) -> str:
    """Ids of messages of the same hundred, or else of which hundreds there are some."""
    same = [one for one in known if one[3] == id[3]]
    hundreds = ", ".join(dict.fromkeys(f"{one[:4]}.." for one in known))
    return f"{same[0]} to {same[-1]} of its kind" if same else f"ids that begin with {hundreds}"


def missing(topic: str) -> UsageError:
    """What is said where there is no page: what was probably meant, or what there is."""
    from obsdesign.guide import ID, sections, topics, words
    from obsdesign.reading import reference
    from obsdesign.sections.words import nearest

    if ID.fullmatch(topic.upper()):
        known = near(topic.upper(), list(sections()))
        said = f"there is no page of it; allowed: {known}; `explain messages`, which prints all"
        return UsageError(Problem(said, topic, id="OBS907"))

    meant = nearest(topic, [*topics(), *words(), *reference.entries()])
    question = f"; did you mean {meant}?" if meant else ";"
    allowed = f"{', '.join(topics())}, a word of `explain glossary` such as gamma, the id of a message such as OBS104"
    return UsageError(
        Problem(
            f"there is no page of it{question} allowed: {allowed}, a key such as observer.alpha", topic, id="OBS907"
        )
    )
