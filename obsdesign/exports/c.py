"""An observer as C99: a header, a source without allocation, and a self-test with vectors of the simulator."""

from collections.abc import Iterator, Mapping

from obsdesign.exports.c_language import FINITE, NEWTON, OWN, PAIRS, RESERVED, TOLERANCE, language
from obsdesign.exports.code import Language, identifiers
from obsdesign.exports.selftest import selftest
from obsdesign.exports.subject import ITERATIONS, READ, TIMED, Subject, comment, loops_of, shortest
from obsdesign.exports.vectors import Vectors
from obsdesign.model.ahead import ahead
from obsdesign.stepping.routine import Let, Routine, Solve


def files(subject: Subject, vectors: Vectors) -> dict[str, bytes]:
    """Files of the export, by name."""
    ID = subject.name
    made = {f"{ID}.h": header(subject), f"{ID}.c": source(subject), f"{ID}_selftest.c": selftest(subject, vectors)}
    return {name: text.encode() for name, text in made.items()}


def header(subject: Subject) -> str:
    """Header `ID.h`."""
    ID, one = subject.name, subject.implemented
    flow = f"""\
/* At a measurement y, at t. */
int {ID}_jump({ID}_state *s, {ID}_real t, const {ID}_real *u, const {ID}_real *y);
/* From t to t + dt, with u held; dt at most {ID}_PERIOD. */
int {ID}_flow({ID}_state *s, {ID}_real t, {ID}_real dt, const {ID}_real *u);
"""
    kept = f"    {ID}_real xhat0[{len(one.plant_states)}];\n    int given, begun;\n" if subject.begins else ""
    return f"""\
{comment(subject, *subject.numbers)}
#ifndef {ID}_H
#define {ID}_H
#ifdef __cplusplus
extern "C" {{
#endif

typedef {"float" if subject.single else "double"} {ID}_real;

#define {ID}_NS {len(one.states)} /* states: {listed(one.states)} */
#define {ID}_NU {len(subject.inputs)} /* known inputs u: {listed(subject.inputs, subject.units)} */
#define {ID}_NY {len(subject.outputs)} /* measured outputs y: {listed(subject.outputs, subject.units)} */
#define {ID}_NE {len(subject.estimates)} /* estimates: {listed(subject.estimates, subject.units)} */
#define {ID}_PERIOD (({ID}_real){shortest(subject.period)}) /* s */

typedef struct {{
    {ID}_real x[{max(1, len(one.states))}];
{kept}}} {ID}_state;

extern const char *const {ID}_names[{ID}_NE];

/* All return 0; or 1 for an input that is not finite, or a null pointer where one is needed; or 2 where an equation has
   no finite value, or a loop did not converge. The state is unchanged then. t is in s. */

/* xhat0: the states {listed(one.plant_states)}; null: as in the spec. */
int {ID}_init({ID}_state *s, const {ID}_real *xhat0);
{step_comment(subject)}
int {ID}_step({ID}_state *s, {ID}_real t, const {ID}_real *u, const {ID}_real *y);
{flow if subject.instants else ""}int {ID}_estimate(const {ID}_state *s, {ID}_real t, const {ID}_real *u, \
const {ID}_real *y, {ID}_real *out);

#ifdef __cplusplus
}}
#endif
#endif
"""


def step_comment(subject: Subject) -> str:
    """What a step does, in words."""
    if subject.instants:
        return "/* From t to t + period without a measurement, with u held; y is not looked at. */"
    if subject.ahead:
        return (
            "/* From t to t + period: y of the sample that is reached; u of the sample at t, then that of the other. */"
        )
    return "/* From t to t + period, with u and y held. */"


def listed(names: tuple[str, ...], units: Mapping[str, str] | None = None) -> str:
    """Names, with their units."""
    texts = (f"{name} [{units[name]}]" if units and name in units else name for name in names)
    return ", ".join(texts).replace("*/", "* /") or "none"


def source(subject: Subject) -> str:
    """Source `ID.c`."""
    ID, tongue = subject.name, language(subject.single)
    bodies = [loop for routine in subject.routines.values() for loop in loops(subject, routine, tongue)]
    inner = [name for name in ("begin", "locate") if name in subject.routines]
    bodies += [init(subject), *(function(subject, name, tongue) for name in inner)]
    bodies += [started(subject)] if subject.begins else []
    bodies += [function(subject, name, tongue) for name in subject.routines if name not in inner]
    names = ", ".join(quoted(name) for name in subject.estimates)
    return "\n".join([
        comment(subject, *subject.numbers),
        f'#include "{ID}.h"\n#include <math.h>\n#include <stddef.h>\n',
        f"typedef {ID}_real real;\n",
        f"const char *const {ID}_names[{ID}_NE] = {{{names}}};\n",
        *helpers(subject, tongue),
        *bodies,
    ])  # fmt: skip


def quoted(name: str) -> str:
    """A string of C."""
    return '"' + "".join(c if c.isascii() and c.isprintable() and c not in '"\\?' else "_" for c in name) + '"'


def helpers(subject: Subject, tongue: Language) -> Iterator[str]:
    """Functions that the code uses."""
    for name, body in OWN.items():
        if name in tongue.used:
            yield f"static real {tongue.functions[name]}(real x) {{ return {body}; }}\n"
    for name, body in PAIRS.items():
        if name in tongue.used:
            yield f"static real {tongue.functions[name]}(real a, real b) {{ return {body}; }}\n"
    yield FINITE
    if subject.loops:
        size = max(len(loop.unknowns) for made in subject.routines.values() for loop, _ in loops_of(made))
        f = "f" if subject.single else ""
        yield NEWTON.format(n=size, iterations=ITERATIONS, tolerance=TOLERANCE[subject.single], abs=f"fabs{f}")


def loops(subject: Subject, routine: Routine, tongue: Language) -> Iterator[str]:
    """Equations of the loops of a routine, as functions."""
    for loop, known in loops_of(routine):
        names = identifiers((*known, *loop.unknowns), RESERVED)
        n = max(len(one.unknowns) for made in subject.routines.values() for one, _ in loops_of(made))
        lines = [f"    const real {names[name]} = known[{i}];" for i, name in enumerate(known)]
        lines += [f"    const real {names[name]} = a[{i}];" for i, name in enumerate(loop.unknowns)]
        lines += [f"    r[{i}] = {tongue.code(side, names)};" for i, side in enumerate(loop.residuals)]
        for i, row in enumerate(loop.slopes):
            lines += [f"    J[{i}][{j}] = {tongue.code(side, names)};" for j, side in enumerate(row)]
        unused = [] if known else ["    (void)known;"]
        unused += [f"    (void){names[name]};" for name in loop.unknowns]
        head = f"static void {loop_name(routine, loop, subject)}(const real *known, const real *a, real *r, "
        yield "\n".join([f"{head}real (*J)[{n}])\n{{", *lines[: len(known) + len(loop.unknowns)], *unused,
                         *lines[len(known) + len(loop.unknowns) :], "}\n"])  # fmt: skip


def loop_name(routine: Routine, loop: Solve, subject: Subject) -> str:
    """Name of the function of a loop."""
    which = next(name for name, made in subject.routines.items() if made is routine)
    number = [one for one, _ in loops_of(routine)].index(loop) + 1
    return f"{which}_loop{number}"


def init(subject: Subject) -> str:
    """Function ID_init."""
    ID, one, tongue = subject.name, subject.implemented, language(subject.single)
    values = ", ".join(map(tongue.number, one.begins))
    given = "".join(f"        s->x[{i}] = xhat0[{k}];\n" for i, k in one.copied)
    n, later = len(one.plant_states), ""
    if subject.begins:
        given += f"        for (i = 0; i < {n}; i++) s->xhat0[i] = xhat0[i];\n"
        later = "    s->given = xhat0 != NULL;\n    s->begun = 0;\n"
    return f"""\
int {ID}_init({ID}_state *s, const real *xhat0)
{{
    static const real start[{max(1, len(one.states))}] = {{{values or 0}}};
    int i;
    if (s == NULL || (xhat0 != NULL && !all_finite({n}, xhat0))) return 1;
    for (i = 0; i < {ID}_NS; i++) s->x[i] = start[i];
    if (xhat0 != NULL) {{
{given}    }}
{later}    return 0;
}}
"""


def function(subject: Subject, which: str, tongue: Language) -> str:
    """One of the functions that run the observer; of `begin` and `locate`, which set the start, for this file only."""
    ID, routine = subject.name, subject.routines[which]
    names = identifiers(signals(routine), RESERVED)
    inner = which in ("begin", "locate")
    dt, takes_y = ", real dt" if which in TIMED else "", "" if which == "flow" else ", const real *y"
    constant, out = ("const ", ", real *out") if which in READ else ("", "")
    head = f"{'static ' if inner else ''}int {'' if inner else f'{ID}_'}{which}({constant}{ID}_state *s, real t{dt}, "
    lines = ["(void)t;", "(void)u;", "(void)y;"] if inner else guards(subject, which)
    if subject.begins and not inner:
        lines += [f"{ID}_state here;", "here = *s;", "if (!start(&here, t, u, y)) return 2;"]
    state = "here." if subject.begins and not inner else "s->"
    lines += unpacked(subject, routine, names, state)
    lines += computed(subject, routine, names, tongue)
    lines += stored(subject, which, state)
    return "\n".join([f"{head}const real *u{takes_y}{out})\n{{", *(f"    {line}" for line in lines), "}\n"])


def started(subject: Subject) -> str:
    """Function that sets the states that begin at a function of t, u and y, once."""
    calls = "".join(
        f"    if ({'s->given && ' if name == 'locate' else ''}!{name}(s, t, u, y)) return 0;\n"
        for name in ("begin", "locate")
        if name in subject.routines
    )
    return f"""\
static int start({subject.name}_state *s, real t, const real *u, const real *y)
{{
    if (s->begun) return 1;
{calls}    s->begun = 1;
    return 1;
}}
"""


def signals(routine: Routine) -> tuple[str, ...]:
    """Every name in a routine."""
    made = [name for one in routine.statements for name in ((one.name,) if isinstance(one, Let) else one.unknowns)]
    return tuple(dict.fromkeys((*routine.given, *made)))


def guards(subject: Subject, which: str) -> list[str]:
    """Refusals of what a function cannot take."""
    ID, given = subject.name, subject.routines[which].given
    both = subject.ahead and which in ("step", "predict")
    nu, ny, slack = len(subject.inputs) * (1 + both), len(subject.outputs), language(subject.single).number(1e-6)
    least = ["s == NULL", "!isfinite(t)"]
    least += ["out == NULL"] if which in READ else []
    least += [f"!(dt >= 0 && dt <= {ID}_PERIOD*(1 + {slack}))"] if which in TIMED else []
    if nu:
        least.append(f"u == NULL || !all_finite({nu}, u)")
    needs_y = which in ("step", "part", "jump") and not (which == "step" and subject.instants)
    if needs_y or subject.begins or any(name in subject.outputs for name in given):
        least.append(f"y == NULL || !all_finite({ny}, y)")
    elif which in READ:
        least.append(f"(y != NULL && !all_finite({ny}, y))")
    lines = [f"if ({' || '.join(least)}) return 1;"]
    return [*lines, *([] if nu else ["(void)u;"]), *(["(void)y;"] if which == "step" and subject.instants else [])]


def unpacked(subject: Subject, routine: Routine, names: Mapping[str, str], state: str) -> Iterator[str]:
    """Signals that a routine takes, under their names."""
    one, inputs, outputs = subject.implemented, subject.inputs, subject.outputs
    homes = {name: f"{state}x[{i}]" for i, name in enumerate(one.states)}
    homes |= {name: f"u[{i}]" for i, name in enumerate((*inputs, *map(ahead, inputs)))}
    homes |= {name: f"y[{i}]" for names_y in (outputs, tuple(map(ahead, outputs))) for i, name in enumerate(names_y)}
    if routine is one.locate:
        homes = {**{name: f"{state}xhat0[{i}]" for i, name in enumerate(one.plant_states)}, **homes}
    for name in routine.given:
        home = {"t": "t", one.dt: "dt"}.get(name) or homes[name]
        if home != names[name]:
            yield f"const real {names[name]} = {home};"


def computed(subject: Subject, routine: Routine, names: Mapping[str, str], tongue: Language) -> Iterator[str]:
    """Statements, and the results in `found`."""
    loops = iter(loops_of(routine))
    for one in routine.statements:
        if isinstance(one, Let):
            yield f"const real {names[one.name]} = {tongue.code(one.value, names)};"
            continue
        loop, known = next(loops)
        number, n = loop_name(routine, loop, subject), len(loop.unknowns)
        yield f"real {number}_a[{n}];"
        values = ", ".join(names[name] for name in known) or "0"
        yield f"const real {number}_known[{max(1, len(known))}] = {{{values}}};"
        yield f"const int {number}_solved = newton({n}, {number}, {number}_known, {number}_a);"
        for i, name in enumerate(loop.unknowns):
            yield f"const real {names[name]} = {number}_a[{i}];"
    yield f"const real found[{max(1, len(routine.results))}] = {{"
    for side in routine.results.values():
        yield f"    {tongue.code(side, names)},"
    yield "};"
    for loop, _ in loops_of(routine):
        yield f"if (!{loop_name(routine, loop, subject)}_solved) return 2;"


def stored(subject: Subject, which: str, state: str) -> Iterator[str]:
    """What becomes of the results: states, or estimates."""
    one, routine = subject.implemented, subject.routines[which]
    inner = which in ("begin", "locate")
    yield f"if (!all_finite({len(routine.results)}, found)) return {0 if inner else 2};"
    if which in READ:
        yield from (f"out[{i}] = found[{i}];" for i in range(len(routine.results)))
    else:
        if state == "here." and not inner:
            yield "*s = here;"
        yield from (f"s->x[{one.states.index(name)}] = found[{i}];" for i, name in enumerate(routine.results))
    yield f"return {1 if inner else 0};"
