"""An observer as Python: one file that needs numpy only, and computes in plain floats."""

import json
from collections.abc import Iterable, Iterator, Mapping

from obsdesign.errors import one_line
from obsdesign.exports.code import Language
from obsdesign.exports.python_language import RESERVED, helpers, language
from obsdesign.exports.routines import (
    WIDTH,
    folded,
    inputs_of,
    listed,
    loop_names,
    meaning,
    named,
    needs_y,
    outputs_of,
    takes_y,
    wrapped,
)
from obsdesign.exports.subject import READ, TIMED, Subject, loops_of, shortest
from obsdesign.exports.vectors import Vectors
from obsdesign.stepping.routine import Let

GIVES = {
    "begin": "State at the start, of what begins at a function of t, u and y.",
    "locate": "State at the start, of what begins at a function of an estimate.",
    "step": "State at t + PERIOD.",
    "flow": "State at t + dt.",
    "jump": "State after a measurement.",
    "estimate": "Estimates.",
    "part": "State at t + dt.",
    "predict": "Outputs as they are expected.",
    "arguments": "Arguments of f.",
    "regain": "State at a row, by which outputs are known in it.",
}


def files(subject: Subject, _: Vectors) -> dict[str, bytes]:
    """Files of the export, by name."""
    return {f"{subject.name}.py": source(subject).encode()}


def source(subject: Subject) -> str:
    """Module `ID.py`."""
    tongue = language()
    made = equations(subject, tongue)
    constants = [f"PERIOD = {shortest(subject.period)}  # s"]
    if subject.implemented.copied:
        values = subject.implemented.xhat0[: len(subject.implemented.plant_states)]
        constants += constant("XHAT0", map(shortest, values), "where the estimate of the states begins")
    parts = [
        "\n".join([head(subject), "", "import math", "", "import numpy as np", "", *constants]),
        observer(subject),
        *made,
        *helpers(subject, tongue),
    ]
    return "\n\n\n".join(parts) + "\n"


def functions(subject: Subject) -> str:
    """The equations alone: a module with a function of state, t, u and y for each routine."""
    tongue = language()
    made = equations(subject, tongue)
    return "\n\n\n".join(["import math", *made, *helpers(subject, tongue)]) + "\n"


def equations(subject: Subject, tongue: Language) -> list[str]:
    """Equations of all routines, as functions of a module."""
    both = ((*loops(subject, which, tongue), function(subject, which, tongue)) for which in subject.routines)
    return [text for texts in both for text in texts]


def quoted(text: str) -> str:
    """Text as it may stand in a docstring."""
    return one_line(text).replace("\\", "\\\\").replace('"""', "'''")


def head(subject: Subject) -> str:
    """Docstring of the module."""
    lists = (("u", subject.inputs), ("y", subject.outputs), ("estimates", subject.estimates))
    lines = [line for text in subject.words for line in wrapped(quoted(text), "", "  ")]
    lines += ["", "t in s; in the order of the arguments:"]
    lines += [line for name, names in lists for line in wrapped(listed(names, subject.units), f"{name}: ", "  ")]
    return "\n".join([f'"""Observer {subject.name}.', "", *lines, '"""'])


def observer(subject: Subject) -> str:
    """The class."""
    start = f"the states {', '.join(subject.implemented.plant_states)}"
    about = f"Observer that begins at an estimate of {start}; None: where the spec begins."
    lines = [
        "class Observer:",
        *wrapped(about, '    """', "    "),
        "",
        "    ValueError: an argument is not finite, or has another length. ArithmeticError: an equation has no finite",
        "    value, or does not converge. The state is what it was before then.",
        '    """',
        "",
        *constant("names", map(json.dumps, subject.estimates), "of the estimates", "    "),
        *constant("inputs", map(json.dumps, subject.inputs), "u", "    "),
        *constant("outputs", map(json.dumps, subject.outputs), "y", "    "),
        "",
        "    def __init__(self, xhat0=None):",
        *starts(subject),
    ]
    if subject.begins:
        lines += ["", *begun(subject)]
    for which in subject.routines:
        if which not in ("begin", "locate"):
            lines += ["", *method(subject, which)]
    return "\n".join(lines)


def constant(name: str, values: Iterable[str], comment: str, indent: str = "") -> Iterator[str]:
    """Tuple as a constant."""
    texts = list(values)
    made = ", ".join(texts) + ("," if len(texts) == 1 else "")
    if len(line := f"{indent}{name} = ({made})  # {comment}") <= WIDTH:
        yield line
    else:
        inner = f"{indent}    "
        yield from (f"{indent}{name} = (  # {comment}", *wrapped(f"{', '.join(texts)},", inner, inner), f"{indent})")


def starts(subject: Subject) -> Iterator[str]:
    """Body of the constructor."""
    one, n = subject.implemented, len(subject.implemented.plant_states)
    places, given = dict(one.copied), f'numbers("xhat0", xhat0, {n})'
    if places:
        yield f"        x0 = XHAT0 if xhat0 is None else {given}"
    elif not subject.begins:
        yield "        if xhat0 is not None:"
        yield f"            {given}"
    yield "        self.x = ("
    for i, (name, value) in enumerate(zip(one.states, one.begins, strict=True)):
        yield f"            {f'x0[{places[i]}]' if i in places else shortest(value)},  # {name}"
    yield "        )"
    if subject.begins:
        yield f"        self.begun, self.xhat0 = False, None if xhat0 is None else {given}"


def begun(subject: Subject) -> Iterator[str]:
    """Method that sets the states that begin at a function of t, u and y."""
    yield "    def start(self, t, u, y):"
    yield '        """State, which begins at what t, u and y are first."""'
    yield "        if self.begun:"
    yield "            return self.x"
    made = "self.x"
    if "begin" in subject.routines:
        yield f"        x = computed(begin, {made}, t, u, y)"
        made = "x"
    if "locate" in subject.routines:
        yield "        if self.xhat0 is not None:"
        yield f"            return computed(locate, {made}, self.xhat0, t, u, y)"
    yield f"        return {made}"


def method(subject: Subject, which: str) -> Iterator[str]:
    """Method of the interface."""
    dt, y = ", dt" if which == "flow" else "", ", y" if takes_y(subject, which) else ""
    optional = "=None" if y and not needs_y(subject, which) else ""
    unused = ", y=None" if which == "step" and not y else ""
    yield f"    def {which}(self, t{dt}, u{y}{optional}{unused}):"
    yield f'        """{meaning(subject, which, "PERIOD")}"""'
    nu, ny = len(inputs_of(subject, which)), len(subject.outputs)
    yield f'        t, u = instant("t", t), numbers("u", u, {nu})'
    if which == "flow":
        yield '        dt = instant("dt", dt)'
        yield "        if not 0 <= dt <= PERIOD * (1 + 1e-6):"
        yield '            raise ValueError(f"dt is {dt} s; expected 0 to {PERIOD}")'
    if optional:
        yield "        if y is not None:"
        yield f'            y = numbers("y", y, {ny})'
    elif y:
        yield f'        y = numbers("y", y, {ny})'
    state = "self.start(t, u, y)" if subject.begins else "self.x"
    call = f"computed({which}, {state}, t{dt}, u{y})"
    if which == "estimate":
        yield f"        return np.array({call})"
    elif subject.begins:
        yield f"        self.x, self.begun = {call}, True"
    else:
        yield f"        self.x = {call}"


def function(subject: Subject, which: str, tongue: Language) -> str:
    """Equations of a routine, as a function of the module."""
    one, routine, names = subject.implemented, subject.routines[which], named(subject, which, RESERVED)
    dt, y = f", {names[one.dt]}" if which in TIMED else "", ", y" if takes_y(subject, which) else ""
    lines = [f"def {which}(x{', xhat0' if which == 'locate' else ''}, t{dt}, u{y}):"]
    lines += [f'    """{GIVES[which]}"""']
    given = {"x": one.states, "u": inputs_of(subject, which), "y": outputs_of(subject, which) if y else ()}
    given |= {"xhat0": one.plant_states} if which == "locate" else {}
    kept = tuple(routine.results) if which in READ else one.states
    used = {*routine.given, *(name for name in kept if name not in routine.results)}
    for source, signals in given.items():
        if used.intersection(signals):
            lines.append(f"    {targets(signals, {n: names[n] if n in used else '_' for n in signals})} = {source}")
    loop = iter(zip(loops_of(routine), loop_names(subject, which), strict=True))
    for statement in routine.statements:
        if isinstance(statement, Let):
            lines += assigned(names[statement.name], tongue.code(statement.value, names))
        else:
            (solve, known), name = next(loop)
            values = f"({', '.join(names[n] for n in known)}{',' if len(known) == 1 else ''})"
            lines.append(f"    {targets(solve.unknowns, names)} = newton({name}, {values}, {len(solve.unknowns)})")
    made = {name: tongue.code(side, names) for name, side in routine.results.items()}
    found = [line for name in kept for line in entry(made.get(name) or names[name])]
    return "\n".join([*lines, "    return (", *found, "    )"])


def targets(signals: tuple[str, ...], names: Mapping[str, str]) -> str:
    """Left side of an assignment of several values."""
    return f"({names[signals[0]]},)" if len(signals) == 1 else ", ".join(names[name] for name in signals)


def assigned(name: str, code: str) -> Iterator[str]:
    """Assignment, in as many lines as it needs."""
    if len(line := f"    {name} = {code}") <= WIDTH:
        yield line
    else:
        yield from (f"    {name} = (", *folded(code, "        "), "    )")


def entry(code: str) -> Iterator[str]:
    """Entry of a tuple, in as many lines as it needs."""
    *lines, last = folded(code, "        ")
    yield from (*lines, f"{last},")


def loops(subject: Subject, which: str, tongue: Language) -> Iterator[str]:
    """Equations of the loops of a routine, as functions of the module."""
    names = named(subject, which, RESERVED)
    for (solve, known), name in zip(loops_of(subject.routines[which]), loop_names(subject, which), strict=True):
        lines = [f"def {name}(known, a):", f'    """Residuals of a loop in {len(solve.unknowns)}, and their slopes."""']
        lines += [f"    {targets(known, names)} = known"] if known else []
        lines += [f"    {targets(solve.unknowns, names)} = a", "    residuals = ["]
        lines += [line for side in solve.residuals for line in entry(tongue.code(side, names))]
        lines += ["    ]", "    slopes = ["]
        for row in solve.slopes:
            lines.append(f"        [{', '.join(tongue.code(side, names) for side in row)}],")
        yield "\n".join([*lines, "    ]", "    return residuals, slopes"])
