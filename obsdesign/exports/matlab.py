"""An observer as functions of MATLAB, each in a file of its own; they run in GNU Octave too."""

from collections.abc import Iterator, Mapping, Sequence

from obsdesign.errors import one_line
from obsdesign.exports.code import Language
from obsdesign.exports.matlab_language import RESERVED, helpers, language
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
from obsdesign.exports.subject import Subject, loops_of, shortest
from obsdesign.exports.vectors import Vectors
from obsdesign.stepping.routine import Let

ARGUMENTS = {"step": "t, u, y", "jump": "t, u, y", "flow": "t, dt, u", "estimate": "t, u, y"}
STORED = {"x": "s.x", "xhat0": "s.xhat0"}  # where the functions of the interface keep what equations take


def files(subject: Subject, _: Vectors) -> dict[str, bytes]:
    """Files of the export, by name."""
    made = {"init": init(subject)}
    made |= {which: function(subject, which) for which in ARGUMENTS if which in subject.routines}
    return {f"{subject.name}_{which}.m": text.encode() for which, text in made.items()}


def words(subject: Subject) -> list[str]:
    """Comment on where the observer comes from, and what is proved of it."""
    return ["%", *(line for text in subject.words for line in wrapped(one_line(text), "% ", "%   "))]


def init(subject: Subject) -> str:
    """File `ID_init.m`."""
    ID, one, n = subject.name, subject.implemented, len(subject.implemented.plant_states)
    said = f"Observer at its start. xhat0: estimate of {', '.join(one.plant_states)}; without: where the spec begins."
    lines = [f"function s = {ID}_init(xhat0)", *wrapped(f"{ID}_init {said}", "% ", "%   "), *words(subject), ""]
    lines += [f"s.x = zeros({len(one.states)}, 1);"]
    lines += [
        f"s.x({i}) = {shortest(value)}; % {name}"
        for i, (name, value) in enumerate(zip(one.states, one.begins, strict=True), start=1)
    ]
    lines += ["given = nargin > 0 && ~isempty(xhat0);"]
    if subject.begins:
        lines += [f"s.xhat0 = zeros({n}, 1);", "s.given = given;", "s.begun = false;"]
    lines += ["if given", f"    xhat0 = numbers(xhat0, {n}, 'xhat0');"]
    lines += [f"    s.x({i + 1}) = xhat0({k + 1});" for i, k in one.copied]
    lines += ["    s.xhat0 = xhat0;"] if subject.begins else []
    text = "\n".join([*lines, "end", "end"])
    return "\n\n".join([text, *helpers(language(), ID, text)]) + "\n"


def function(subject: Subject, which: str) -> str:
    """File of a function that runs the observer."""
    ID, tongue = subject.name, language()
    lines = [f"function {'out' if which == 'estimate' else 's'} = {ID}_{which}(s, {ARGUMENTS[which]})"]
    lines += wrapped(f"{ID}_{which} {meaning(subject, which, f'{subject.period:g} s')}", "% ", "%   ")
    for name, signals in (("u", subject.inputs), ("y", subject.outputs), ("estimates", subject.estimates)):
        lines += wrapped(listed(signals, subject.units), f"%   {name}: ", "%     ")
    lines += ["%   t in s.", *words(subject), "", *checked(subject, which)]
    lines += ["s = started(s, t, u, y);"] if subject.begins else []
    if which == "estimate":
        lines += [f"out = finite({headed(subject, which, STORED)});"]
    else:
        lines += [f"s.x = finite({headed(subject, which, STORED)});"]
        lines += ["s.begun = true;"] if subject.begins else []
    parts, inner = ["\n".join([*lines, "end"])], [name for name in ("begin", "locate") if name in subject.routines]
    parts += [started(inner, subject)] if inner else []
    for name in (*inner, which):
        parts += [*loops(subject, name, tongue), equations(subject, name, tongue)]
    return "\n\n".join([*parts, *helpers(tongue, ID, "\n".join(parts))]) + "\n"


def checked(subject: Subject, which: str) -> Iterator[str]:
    """Refusals of what a function cannot take."""
    yield "t = numbers(t, 1, 't');"
    yield f"u = numbers(u, {len(inputs_of(subject, which))}, 'u');"
    if which == "flow":
        period = shortest(subject.period)
        yield "dt = numbers(dt, 1, 'dt');"
        yield f"if dt < 0 || dt > {period}*(1 + 1e-6)"
        yield f"    error('{subject.name}:input', 'dt is %g s; expected 0 to %g s', dt, {period});"
        yield "end"
    if needs_y(subject, which):
        yield f"y = numbers(y, {len(subject.outputs)}, 'y');"
    elif takes_y(subject, which):
        yield "if nargin > 3 && ~isempty(y)"
        yield f"    numbers(y, {len(subject.outputs)}, 'y');"
        yield "end"


def given(subject: Subject, which: str) -> dict[str, tuple[str, ...]]:
    """Signals in each argument of the equations of a routine, as far as any of them is needed."""
    one, routine = subject.implemented, subject.routines[which]
    homes = {"x": one.states, "xhat0": one.plant_states if which == "locate" else (), "t": ("t",), "dt": (one.dt,)}
    homes |= {"u": inputs_of(subject, which), "y": outputs_of(subject, which)}
    needed = {home: names for home, names in homes.items() if set(names).intersection(routine.given)}
    return needed if which == "estimate" else {"x": one.states, **needed}


def headed(subject: Subject, which: str, homes: Mapping[str, str]) -> str:
    """Call, or head, of the equations of a routine, with these arguments in place of the names of their homes."""
    name = "estimates" if which == "estimate" else f"{which}_state"
    return f"{name}({', '.join(homes.get(home, home) for home in given(subject, which))})"


def started(inner: Sequence[str], subject: Subject) -> str:
    """Function that sets the states that begin at a function of t, u and y, once."""
    lines = ["function s = started(s, t, u, y)", "% States that begin at what t, u and y are first."]
    lines += ["if s.begun", "    return", "end"]
    if "begin" in inner:
        lines += [f"s.x = finite({headed(subject, 'begin', STORED)});"]
    if "locate" in inner:
        lines += ["if s.given", f"    s.x = finite({headed(subject, 'locate', STORED)});", "end"]
    return "\n".join([*lines, "end"])


def equations(subject: Subject, which: str, tongue: Language) -> str:
    """Equations of a routine, as a function of the file."""
    one, routine, names = subject.implemented, subject.routines[which], named(subject, which, RESERVED)
    result, homes = "out" if which == "estimate" else "x", given(subject, which)
    lines = [f"function {result} = {headed(subject, which, {'dt': names[one.dt]})}"]
    for home, signals in homes.items():
        lines += unpacked(home, signals, names, routine.given) if home not in ("t", "dt") else []
    loop = iter(zip(loops_of(routine), loop_names(subject, which), strict=True))
    for statement in routine.statements:
        if isinstance(statement, Let):
            lines += assigned(names[statement.name], tongue.code(statement.value, names))
            continue
        (solve, known), name = next(loop)
        lines += [f"{name}_a = newton(@{name}, [{'; '.join(names[n] for n in known)}], {len(solve.unknowns)});"]
        lines += unpacked(f"{name}_a", solve.unknowns, names, solve.unknowns)
    lines += [f"out = zeros({len(routine.results)}, 1);"] if which == "estimate" else []
    for i, (name, side) in enumerate(routine.results.items()):
        place = i if which == "estimate" else one.states.index(name)
        lines += assigned(f"{result}({place + 1})", tongue.code(side, names))
    return "\n".join([*lines, "end"])


def unpacked(home: str, signals: tuple[str, ...], names: Mapping[str, str], used: tuple[str, ...]) -> Iterator[str]:
    """Signals of an argument, under their names."""
    for i, name in enumerate(signals, start=1):
        if name in used:
            yield f"{names[name]} = {home}({i});"


def assigned(name: str, code: str) -> Iterator[str]:
    """Assignment, in as many lines as it needs."""
    if len(line := f"{name} = {code};") <= WIDTH:
        yield line
    else:
        yield from (f"{name} = ...", *folded(f"{code};", "    ", " ..."))


def loops(subject: Subject, which: str, tongue: Language) -> Iterator[str]:
    """Equations of the loops of a routine, as functions of the file."""
    names = named(subject, which, RESERVED)
    for (solve, known), name in zip(loops_of(subject.routines[which]), loop_names(subject, which), strict=True):
        n = len(solve.unknowns)
        lines = [f"function [r, J] = {name}(known, a)", f"% Residuals of a loop in {n}, and their slopes."]
        lines += [*unpacked("known", known, names, known), *unpacked("a", solve.unknowns, names, solve.unknowns)]
        lines += [f"r = zeros({n}, 1);", f"J = zeros({n}, {n});"]
        for i, side in enumerate(solve.residuals, start=1):
            lines += assigned(f"r({i})", tongue.code(side, names))
        for i, row in enumerate(solve.slopes, start=1):
            for j, side in enumerate(row, start=1):
                lines += assigned(f"J({i}, {j})", tongue.code(side, names))
        yield "\n".join([*lines, "end"])
