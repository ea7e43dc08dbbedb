"""Names of parameters and signals: defaults, and what a name may not be."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from obsdesign.expressions.functions import FUNCTIONS
from obsdesign.reading.schema import System
from obsdesign.sections.document import described
from obsdesign.sections.forms import unknown
from obsdesign.sections.values import Axis, Reader, counted
from obsdesign.spec import numbered

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
ARGUMENT = re.compile(r"q[0-9]*")  # of a nonlinearity


@dataclass(frozen=True)
class Names:
    """Names of the signals of a plant."""

    states: tuple[str, ...]
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    w: tuple[str, ...]


def meaning(name: str) -> str | None:
    """Say what a name means already, or why it is none."""
    if not NAME.fullmatch(name):
        return "is not a name; use letters, digits and _, a letter first"
    if name == "t":
        return "is the time; choose another name"
    if name == "pi" or name in FUNCTIONS:
        return "is a function or a constant; choose another name"
    if ARGUMENT.fullmatch(name):
        return "is the argument of a nonlinearity; choose another name"
    if name.startswith("hat_"):
        return "begins like the name of an estimate; choose another name"
    return None


def read_parameters(reader: Reader, parameters: Mapping[str, str]) -> None:
    """Values of the parameters, each from those before it."""
    for name, text in parameters.items():
        if reason := meaning(name):
            reader.wrong(("parameters", name), f"{described(name)} {reason}", at_key=True)
        value = reader.number(text, ("parameters", name))
        if reason is None:
            reader.parameters[name] = value


def read_names(reader: Reader, system: System, states: Axis, outputs: Axis, w: Axis) -> Names | None:
    """Names of the signals; None if an earlier error leaves them open."""
    before = len(reader.problems)
    taken = dict.fromkeys(numbered("w", w.size or 0), "an exogenous input")
    names = Names(
        states=given_or(reader, "states", system.states, states, "x"),
        outputs=given_or(reader, "outputs", system.outputs, outputs, "y"),
        inputs=tuple(system.inputs),
        w=tuple(taken),
    )
    for key, each in (("states", "a state"), ("outputs", "an output"), ("inputs", "an input")):
        given = getattr(system, key)
        for i, name in enumerate(getattr(names, key)):
            if reason := meaning(name) or (name in taken and f"is {taken[name]} already; choose another name"):
                reader.wrong(("system", key, i) if given else ("system", key), f"{described(name)} {reason}")
            taken[name] = each
    for name in reader.parameters:
        if name in taken:
            message = f"{name} is {taken[name]} already; choose another name"
            reader.wrong(("parameters", name), message, at_key=True)
    for name in system.units:
        if name not in taken:
            reader.wrong(("system", "units", name), unknown("signal", name, tuple(taken), {}), at_key=True)
    return names if len(reader.problems) == before else None


def given_or(reader: Reader, key: str, given: Sequence[str] | None, axis: Axis, letter: str) -> tuple[str, ...]:
    """Names as given, or the default ones."""
    if given is not None and not axis.admits(len(given)):
        reader.wrong(("system", key), f"expected {counted(axis.size, 'name')} ({axis}), found {len(given)}")
    return numbered(letter, axis.size or 0) if given is None else tuple(given)
