"""`obsdesign explain`: the manual."""

from typing import Annotated

import typer

from obsdesign.cli.printing import say
from obsdesign.errors import Problem, UsageError

KEYS = "spec"  # topic whose page ends with all keys


def explain(
    topic: Annotated[str, typer.Argument(metavar="[TOPIC|ID|KEY]", help="Default: the list of topics.")] = "",
) -> None:
    """Print a page of the manual, what a message such as OBS104 means, or what a key such as observer.alpha takes."""
    from obsdesign.guide import explained, topics
    from obsdesign.tables.text import aligned

    if not topic:
        say(aligned([*topics().items()]))
        say("\nobsdesign explain TOPIC prints a page, obsdesign explain OBS104 what a message means,")
        say("obsdesign explain observer.alpha what a key of a spec takes")
        return
    text = explained(topic)
    if text is None or topic == KEYS:
        from obsdesign.reading import reference

        text = reference.explained(topic) if text is None else f"{text}\n{aligned(reference.listed())}"
    if text is None:
        raise missing(topic)
    say(text.rstrip())


def near(id: str, known: list[str]) -> str:
    """Ids of messages of the same hundred, or else of which hundreds there are some."""
    same = [one for one in known if one[3] == id[3]]
    hundreds = ", ".join(dict.fromkeys(f"{one[:4]}.." for one in known))
    return f"{same[0]} to {same[-1]} of its kind" if same else f"ids that begin with {hundreds}"


def missing(topic: str) -> UsageError:
    """What is said where there is no page: what was probably meant, or what there is."""
    from obsdesign.guide import ID, sections, topics
    from obsdesign.reading import reference
    from obsdesign.sections.words import nearest

    if ID.fullmatch(topic.upper()):
        known = near(topic.upper(), list(sections()))
        said = f"there is no page of it; allowed: {known}; `explain messages`, which prints all"
        return UsageError(Problem(said, topic, id="OBS907"))

    meant = nearest(topic, [*topics(), *reference.entries()])
    question = f"; did you mean {meant}?" if meant else ";"
    allowed = f"{', '.join(topics())}, the id of a message such as OBS104, a key such as observer.alpha"
    return UsageError(Problem(f"there is no page of it{question} allowed: {allowed}", topic, id="OBS907"))
