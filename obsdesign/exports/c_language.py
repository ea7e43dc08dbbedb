"""How C99 writes expressions, and the functions that an exported observer may need."""

import numpy as np

from obsdesign.exports.code import Language
from obsdesign.exports.subject import shortest

WORDS = """auto break case char const continue default do double else enum extern float for goto if inline int long
register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
_Bool _Complex _Imaginary asm typeof near far NULL isfinite isnan main s u y out xhat0 given begun i j k n r a J real
y0 y1 yn j0 j1 jn gamma signal index time div abs exit remainder here new found start begin locate newton all_finite
size saturate lower upper dt"""  # that mean something in C, or in what is written here
LIBM = """sin cos tan asin acos atan sinh cosh tanh exp log sqrt pow atan2 fabs acosh asinh atanh cbrt ceil copysign erf
erfc exp2 expm1 fdim floor fma fmax fmin fmod frexp hypot ilogb ldexp lgamma llrint llround log10 log1p log2 logb lrint
lround modf nan nearbyint nextafter nexttoward remquo rint round scalbln scalbn tgamma trunc"""
OWN = {"square": "x*x", "cube": "x*x*x", "sign": "x > 0 ? 1 : x < 0 ? -1 : x", "sat": "x < -1 ? -1 : x > 1 ? 1 : x"}
PAIRS = {"min": "a <= b || a != a ? a : b", "max": "a >= b || a != a ? a : b"}
RESERVED = frozenset(f"{WORDS} {LIBM} {' '.join(OWN)} {'f '.join(LIBM.split())}f".split())
TOLERANCE = {False: "1e-10", True: "1e-5f"}  # of the last step of Newton's method in a loop


def language(single: bool) -> Language:
    """How C writes expressions; in floats of 32 bits if `single`."""
    f = "f" if single else ""
    names = {name: f"{name}{f}" for name in LIBM.split()}
    own = {"square": "square", "cube": "cube", "sign": "sign", "sat": "saturate", "min": "lower", "max": "upper"}
    return Language(
        number=lambda value: shortest(float(np.float32(value)) if single else value) + f,
        functions={**names, **own, "abs": f"fabs{f}", "**": f"pow{f}", "pi": f"3.141592653589793{f}"},
        choice="({c} ? {a} : {b})",
    )


FINITE = """\
static int all_finite(int n, const real *values)
{
    int i;
    for (i = 0; i < n; i++)
        if (!isfinite(values[i])) return 0;
    return 1;
}
"""

NEWTON = """\
typedef void equations(const real *known, const real *a, real *r, real (*J)[{n}]);

static real size(int n, const real *r)
{{
    real sum = 0;
    int i;
    for (i = 0; i < n; i++) sum += r[i]*r[i];
    return sum;
}}

/* Solve r(a) = 0 by Newton's method from a = 0, with steps that are halved until |r| falls. */
static int newton(int n, equations *of, const real *known, real *a)
{{
    real r[{n}], J[{n}][{n}], d[{n}], b[{n}], unused[{n}][{n}];
    int i, j, k, round, half;
    for (i = 0; i < n; i++) a[i] = 0;
    for (round = 0; round < {iterations}; round++) {{
        real before, step = 0, length = 0, share = 1;
        of(known, a, r, J);
        before = size(n, r);
        if (!isfinite(before)) return 0;
        for (i = 0; i < n; i++) d[i] = -r[i];
        for (k = 0; k < n; k++) {{ /* Gauss, with pivots */
            int p = k;
            for (i = k + 1; i < n; i++)
                if ({abs}(J[i][k]) > {abs}(J[p][k])) p = i;
            if (!({abs}(J[p][k]) > 0)) return 0;
            for (j = 0; j < n; j++) {{ real m = J[k][j]; J[k][j] = J[p][j]; J[p][j] = m; }}
            {{ real m = d[k]; d[k] = d[p]; d[p] = m; }}
            for (i = k + 1; i < n; i++) {{
                real m = J[i][k]/J[k][k];
                for (j = k; j < n; j++) J[i][j] -= m*J[k][j];
                d[i] -= m*d[k];
            }}
        }}
        for (i = n - 1; i >= 0; i--) {{
            for (j = i + 1; j < n; j++) d[i] -= J[i][j]*d[j];
            d[i] /= J[i][i];
        }}
        for (half = 0; half < 40; half++, share /= 2) {{
            for (i = 0; i < n; i++) b[i] = a[i] + share*d[i];
            of(known, b, r, unused);
            if (size(n, r) <= before) break;
        }}
        for (i = 0; i < n; i++) {{
            if ({abs}(d[i]) > step) step = {abs}(d[i]);
            if ({abs}(b[i]) > length) length = {abs}(b[i]);
            a[i] = b[i];
        }}
        if (step <= {tolerance}*(1 + length)) return 1;
    }}
    return 0;
}}
"""
