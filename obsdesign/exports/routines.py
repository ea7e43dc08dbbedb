"""What an observer has in common in languages that compute with lists of numbers: names, loops, and what is said."""

import re
import textwrap
from collections.abc import Iterator, Mapping

from obsdesign.exports.code import identifiers
from obsdesign.exports.subject import Subject, loops_of
from obsdesign.model.ahead import ahead
from obsdesign.stepping.routine import Let, Routine

WIDTH = 110  # characters of a line, where it can be broken


def inputs_of(subject: Subject, which: str) -> tuple[str, ...]:
    """Signals that a routine is given as u."""
    late = tuple(map(ahead, subject.inputs)) if subject.ahead and which in ("step", "predict") else ()
    return (*subject.inputs, *late)


def outputs_of(subject: Subject, which: str) -> tuple[str, ...]:
    """Signals that a routine is given as y."""
    return tuple(map(ahead, subject.outputs)) if subject.ahead and which == "step" else subject.outputs


def takes_y(subject: Subject, which: str) -> bool:
    """Whether a function of the interface has the measured outputs as an argument."""
    return not (subject.instants and which in ("step", "flow"))


def needs_y(subject: Subject, which: str) -> bool:
    """Whether a function of the interface cannot do without the measured outputs."""
    if which == "estimate":
        return subject.begins or any(name in subject.outputs for name in subject.routines[which].given)
    return takes_y(subject, which)


def signals(routine: Routine) -> tuple[str, ...]:
    """Names of what a routine computes before its results."""
    return tuple(n for one in routine.statements for n in ((one.name,) if isinstance(one, Let) else one.unknowns))


def named(subject: Subject, which: str, reserved: frozenset[str]) -> dict[str, str]:
    """Identifiers of the signals of a routine."""
    one, routine = subject.implemented, subject.routines[which]
    given = ("t", one.dt, *one.states, *inputs_of(subject, which), *outputs_of(subject, which), *one.plant_states)
    return identifiers(tuple(dict.fromkeys((*given, *signals(routine)))), reserved)


def loop_names(subject: Subject, which: str) -> list[str]:
    """Names of the functions of the loops of a routine, in their order."""
    return [f"{which}_loop{i}" for i, _ in enumerate(loops_of(subject.routines[which]), start=1)]


def meaning(subject: Subject, which: str, period: str) -> str:
    """What a function of the interface does, in words."""
    if which == "step" and subject.instants:
        return f"From t to t + {period} without a measurement, with u held."
    if which == "step" and subject.ahead:
        return f"From t to t + {period}: y of the sample that is reached; u of the sample at t, then that of the other."
    return {
        "step": f"From t to t + {period}, with u and y held.",
        "flow": f"From t to t + dt, with u held; dt is at most {period}.",
        "jump": "Take a measurement y, at t.",
        "estimate": "Estimates at t.",
    }[which]


def listed(names: tuple[str, ...], units: Mapping[str, str]) -> str:
    """Names, with their units."""
    return ", ".join(f"{name} [{units[name]}]" if name in units else name for name in names) or "none"


def folded(text: str, indent: str, ending: str = "") -> Iterator[str]:
    """Lines of an expression that is too long for one, broken before + and -; all but the last have this ending."""
    bound = re.sub(r" ([+-]) ", " \\1\N{NO-BREAK SPACE}", text)
    lines = textwrap.wrap(bound, WIDTH, break_long_words=False, break_on_hyphens=False)
    for i, line in enumerate(lines, start=1):
        yield indent + line.replace("\N{NO-BREAK SPACE}", " ") + (ending if i < len(lines) else "")


def wrapped(text: str, start: str, indent: str) -> list[str]:
    """Lines of a sentence, the first of which begins with `start`."""
    return textwrap.wrap(start + text, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
