"""The way of an observer along the rows of a log, in C."""

from functools import cached_property

from obsdesign.exports.subject import Subject
from obsdesign.stepping.routine import Routine

ROUNDING = 1e-9  # of a period: what is left of a row's time and is no step
NAME = "observer"


class Engine(Subject):
    """The routines that a log needs: those that are exported, and a part of a step, what is expected, and arguments."""

    @cached_property
    def routines(self) -> dict[str, Routine]:
        """Routines by name."""
        one = self.implemented
        part = {"part": one.part} if one.part is not None and not self.instants else {}
        arguments = {"arguments": one.arguments} if one.watched else {}
        regain = {"regain": one.regain} if one.regain else {}
        return {**self.exported, **part, "predict": one.predict, **arguments, **regain}


FILLED = """
/* y with what is expected where it is missing. Whether all of it is known then. */
static int filled(const observer_state *s, real t, const real *u, const real *y, real *last, real *expected, real *full)
{{
    int j;
    (void)last;
    for (j = 0; j < {ny}; j++) full[j] = isfinite(y[j]) ? y[j] : 0;
    if (observer_predict(s, t, u, full, expected)) return 0;
    for (j = 0; j < {ny}; j++)
        if (!isfinite(y[j])) full[j] = expected[j];
    return 1;
}}
"""
TOLD = """
/* y where it is known, else as it was known last; behind the known inputs, which of y are known. Whether it could. */
static int filled(const observer_state *s, real t, real *u, const real *y, real *last, real *expected, real *full)
{{
    int j;
    for (j = 0; j < {ny}; j++) {{
        u[{at} + j] = isfinite(y[j]) ? 1 : 0;
        if (isfinite(y[j])) last[j] = y[j];
        full[j] = isfinite(last[j]) ? last[j] : 0;
    }}
    return expected == NULL || !observer_predict(s, t, u, full, expected);
}}
"""
DRIVER = """
int observer_size(void) {{ return (int)sizeof(observer_state); }}
{filling}
long observer_run(observer_state *s, long K, int begin, int first, double h, const real *t, const real *u,
                  const real *y, real *out, real *expected, real *arguments, real *last)
{{
    long k;
    int j;
    real full[{ny1}], hoped[{ny1}], inputs[{nu2}];
    (void)first;
    (void)h;
    (void)arguments;
    (void)j;
    for (k = 0; k < K; k++) {{
        const real *now = u + k*{nu}, *seen = y + k*{ny};
        if (k > 0 || !begin) {{
{record}        }}
        if (k + 1 == K) break;
{advance}    }}
    return K;
}}
"""
RECORD = """\
{copied}            if (!filled(s, t[k], {now}, seen, last, expected + k*{ny}, full)) return k;
{start}{jump}            if (observer_estimate(s, t[k], {now}, full, out + k*{ne})) return k;
{arguments}"""
AHEAD = """\
            for (j = 0; j < {ny}; j++) full[j] = isfinite(seen[j]) ? seen[j] : 0;
{copied}            if (observer_estimate(s, t[k], {now}, full, out + k*{ne})) return k;
"""
COPIED = """\
            for (j = 0; j < {nu}; j++) inputs[j] = now[j];
"""
BEGIN = """\
            if (!start(s, t[k], {now}, full)) return k;
"""
JUMP = """\
            for (j = 0; j < {ny} && !isfinite(seen[j]); j++) continue;
            if (j < {ny} && observer_jump(s, t[k], now, full)) return k;
"""
NEXT = """\
{copied}        if (!filled(s, t[k], {now}, seen, last, {hoped}, full)) return k + 1;
        if (observer_step(s, t[k], {now}, full)) return k + 1;
"""
REACHED = """\
        for (j = 0; j < {nu}; j++) {{ inputs[j] = now[j]; inputs[{nu} + j] = now[{nu} + j]; }}
        if (observer_predict(s, t[k], inputs, NULL, expected + (k + 1)*{ny})) return k + 1;
        for (j = 0; j < {ny}; j++) full[j] = isfinite(seen[{ny} + j]) ? seen[{ny} + j] : expected[(k + 1)*{ny} + j];
        if (observer_step(s, t[k], inputs, full)) return k + 1;
"""
REACHED_IN_PART = """\
        for (j = 0; j < {nu}; j++) {{ inputs[j] = now[j]; inputs[{width} + j] = now[{nu} + j]; }}
        filled(s, t[k], inputs, seen, last, NULL, full);
        filled(s, t[k], inputs + {width}, seen + {ny}, last, NULL, full);
        if (observer_predict(s, t[k], inputs, full, expected + (k + 1)*{ny})) return k + 1;
        if (observer_step(s, t[k], inputs, full)) return k + 1;
"""
REGAIN = """\
            for (j = 0; j < {nu}; j++) inputs[j] = now[j];
            filled(s, t[k], inputs, seen, last, NULL, full);
            if (observer_regain(s, t[k], inputs, full)) return k + 1;
"""
PARTS = """\
        {{
            const real span = t[k + 1] - t[k];
            const real slack = {rounding} + 1e-15*fabs(t[k + 1])/h; /* of a period: what is no step of its own */
            const long parts = (long)ceil(span/h - slack);
            long i;
{regain}            for (i = 0; span > 0 && i < (parts < 1 ? 1 : parts); i++) {{
                const real from = t[k] + i*h, left = t[k + 1] - from;
                const real on = left > h*(1 - slack) ? h : left;
                const real share = first ? (from + on/2 - t[k])/span : 0;
                real known[{ny1}];
                for (j = 0; j < {nu}; j++) inputs[j] = now[j] + share*(now[{nu} + j] - now[j]);
                for (j = 0; j < {ny}; j++)
                    known[j] = seen[j] + (first && isfinite(seen[{ny} + j]) ? share*(seen[{ny} + j] - seen[j]) : 0);
                if (!filled(s, from, inputs, known, last, {hoped}, full)) return k + 1;
                if ({go}) return k + 1;
            }}
        }}
"""


def driver(subject: Engine) -> str:
    """C of the way along rows."""
    one, part = subject.implemented, bool(subject.implemented.known)
    ny, ne, width = len(subject.outputs), len(subject.estimates), len(subject.inputs)
    nu = width - len(one.known)
    sizes: dict[str, object] = {
        "nu": nu,
        "ny": ny,
        "ne": ne,
        "ny1": max(1, ny),
        "nu2": max(1, 2 * width),
        "rounding": ROUNDING,
    }
    sizes |= {"at": nu, "width": width, "now": "inputs" if part else "now", "hoped": "NULL" if part else "hoped"}
    sizes |= {"copied": COPIED.format(nu=nu) if part else ""}
    arguments = f"if (observer_arguments(s, t[k], {sizes['now']}, full, arguments + k*{len(one.watched)})) return k;"
    jump = JUMP.format(**sizes) if subject.instants else ""
    record = (AHEAD if subject.ahead else RECORD).format(
        **sizes,
        start=BEGIN.format(**sizes) if subject.begins else "",
        jump=jump,
        arguments=f"            {arguments}\n" if one.watched and not subject.ahead else "",
    )
    whole = "observer_step(s, from, inputs, full)" if not subject.instants else "observer_flow(s, from, on, inputs)"
    go = (
        whole
        if subject.instants
        else f"on > observer_PERIOD*(1 - {ROUNDING}) ? {whole} : observer_part(s, from, on, inputs, full)"
    )
    reached = REACHED_IN_PART if part else REACHED
    regain = REGAIN.format(**sizes) if one.regain else ""
    pattern = PARTS if one.method else reached if subject.ahead else NEXT
    advance = pattern.format(**sizes, go=go, regain=regain)
    filling = (TOLD if part else FILLED).format(**sizes)
    return DRIVER.format(**sizes, filling=filling, record=record, advance=advance)
