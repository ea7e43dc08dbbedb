"""The self-test of an observer in C: a program that runs it on vectors, and returns 0 where it estimates the same."""

from collections.abc import Callable

import numpy as np

from obsdesign.exports.c_language import language
from obsdesign.exports.subject import Subject, comment, shortest
from obsdesign.exports.vectors import Vectors
from obsdesign.lmi.formula import Float

AGREE = {False: 1e-9, True: 1e-3}  # relative to the size of each estimate; True: of floats of 32 bits

SELFTEST = """\
{comment}
#include "{ID}.h"
#include <math.h>
#include <stdio.h>

/* {about}: t, u, y, whether a measurement is taken, and the estimates. */
#define ROWS {rows}
static const {ID}_real t[ROWS] = {{{t}}};
static const {ID}_real u[ROWS][{nu}] = {{{u}}};
static const {ID}_real y[ROWS][{ny}] = {{{y}}};
static const int measured[ROWS] = {{{measured}}};
static const {ID}_real on[ROWS] = {{{on}}}; /* to the next row */
static const double expected[ROWS][{ne}] = {{{expected}}};
static const double size[{ne}] = {{{size}}};

int main(void)
{{
    {ID}_state s;
    {ID}_real out[{ne}], inputs[{twice}];
    double worst = 0;
    int i, k;
    (void)measured;
    (void)on;
    if ({ID}_init(&s, NULL)) return 1;
    for (k = 0; k < ROWS; k++) {{
{jump}        if ({ID}_estimate(&s, t[k], u[k], y[k], out)) return 1;
        for (i = 0; i < {ID}_NE; i++) {{
            const double off = fabs((double)out[i] - expected[k][i])/size[i];
            if (!(off <= worst)) worst = off;
        }}
        if (k + 1 == ROWS) break;
        for (i = 0; i < {ID}_NU; i++) {{
            inputs[i] = u[k][i];
            inputs[{ID}_NU + i] = u[k + 1][i];
        }}
{step}    }}
    printf("{ID}: %d rows, largest deviation %.3g of the size of an estimate\\n", ROWS, worst);
    return worst <= {tolerance} ? 0 : 1;
}}
"""


def selftest(subject: Subject, vectors: Vectors) -> str:
    """Source `ID_selftest.c`."""
    ID, number = subject.name, language(subject.single).number
    size = np.maximum(np.abs(vectors.estimates).max(axis=0, initial=0.0), 1e-12)
    step = f"        if ({ID}_step(&s, t[k], inputs, y[k{' + 1' if subject.ahead else ''}])) return 1;\n"
    if subject.instants:
        flow = f"{ID}_flow(&s, t[k], on[k], inputs)"
        step = f"        if (on[k] == {ID}_PERIOD ? {ID}_step(&s, t[k], inputs, NULL) : {flow}) return 1;\n"
    jump = f"        if (measured[k] && {ID}_jump(&s, t[k], u[k], y[k])) return 1;\n" if subject.instants else ""

    def table(rows: Float, write: Callable[[float], str] = number) -> str:
        width = max(1, rows.shape[1])
        filled = np.hstack([rows, np.zeros((len(rows), width - rows.shape[1]))])
        return ",\n    ".join("{" + ", ".join(map(write, row)) + "}" for row in filled.tolist())

    return SELFTEST.format(
        comment=comment(subject), ID=ID, rows=len(vectors.t), nu=max(1, len(subject.inputs)),
        about="The simulation of the spec in the same steps" if vectors.simulated else "Waves in place of u and y",
        ny=len(subject.outputs), ne=len(subject.estimates), twice=max(1, 2 * len(subject.inputs)),
        t=", ".join(map(number, vectors.t.tolist())), u=table(vectors.u), y=table(vectors.y),
        measured=", ".join(str(int(flag)) for flag in vectors.measured.tolist()),
        on=", ".join(map(number, vectors.on.tolist())),
        expected=table(vectors.estimates, shortest), size=", ".join(map(shortest, size.tolist())),
        jump=jump, step=step, tolerance=AGREE[subject.single],
    )  # fmt: skip
