"""How Python writes expressions, and the functions that an exported observer may need."""

import keyword
from collections.abc import Iterator

from obsdesign.exports.code import Code, Language
from obsdesign.exports.subject import ITERATIONS, Subject, shortest
from obsdesign.expressions.tree import Call, Number

QUOTIENT = """\
try:
        return a / b
    except ZeroDivisionError:
        return math.copysign(math.inf, a) * math.copysign(1.0, b) if abs(a) > 0 else math.nan"""
POWER = """\
try:
        return math.pow(a, b)
    except (OverflowError, ValueError):
        if a < 0 and b % 1 != 0:
            return math.nan
        return math.copysign(math.inf, a) if b % 2 == 1 else math.inf"""
UNDEFINED = """\
try:
        return math.%s(x)
    except ValueError:
        return math.nan"""
MATH = ("atan", "tanh", "atan2", "pi")
RAISING = ("sin", "cos", "tan", "asin", "acos", "sqrt")  # where they are not defined
OWN = {  # functions of the trade that Python has not, or not quite: numbers go on where they are infinite or undefined
    "/": ("divided(a, b)", "Quotient; infinite or NaN where b is zero.", QUOTIENT),
    "**": ("power(a, b)", "Power; infinite or NaN where it is no number.", POWER),
    "log": ("log(x)", "Logarithm.", "return math.log(x) if x > 0 else math.nan if x else -math.inf"),
    **{name: (f"{name}(x)", f"Function {name}; NaN where it is not defined.", UNDEFINED % name) for name in RAISING},
    "square": ("square(x)", "Square.", "return x * x"),
    "cube": ("cube(x)", "Cube.", "return x * x * x"),
    "sign": ("sign(x)", "Sign; 0 of 0.", "return 1.0 if x > 0 else -1.0 if x < 0 else x"),
    "sat": ("saturated(x)", "x within -1 and 1.", "return -1.0 if x < -1 else 1.0 if x > 1 else x"),
    "min": ("lower(a, b)", "The smaller of two numbers.", "return a if a <= b or math.isnan(a) else b"),
    "max": ("upper(a, b)", "The larger of two numbers.", "return a if a >= b or math.isnan(a) else b"),
}
LARGE = {"exp": "math.inf", "cosh": "math.inf", "sinh": "math.copysign(math.inf, x)"}  # beyond what a double can hold
WORDS = "math np x u y a known xhat0 abs newton solved size computed numbers instant Observer PERIOD True False"
ROUTINES = "begin locate step flow jump estimate part predict arguments"
CALLED = {name: head[: head.index("(")] for name, (head, _, _) in OWN.items()} | {name: name for name in LARGE}
RESERVED = frozenset([*keyword.kwlist, *f"{WORDS} {ROUTINES}".split(), *CALLED.values()])


class Python(Language):
    """Python, whose division by zero gives no number of its own."""

    def quotient(self, node: Call, arguments: list[Code]) -> Code:
        """A quotient; of a divisor that may be zero it is a function."""
        if isinstance(node.arguments[1], Number) and node.arguments[1].value != 0:
            return super().quotient(node, arguments)
        return self.call("/", arguments)


def language() -> Language:
    """How Python writes expressions."""
    names = {name: f"math.{name}" for name in MATH}
    return Python(
        number=shortest,
        functions={**names, **CALLED, "abs": "abs"},
        choice="({a} if {c} else {b})",
    )


def helpers(subject: Subject, tongue: Language) -> Iterator[str]:
    """Functions that the equations use, and the checks."""
    for name, (head, said, body) in OWN.items():
        if name in tongue.used:
            yield f'def {head}:\n    """{said}"""\n    {body}'
    for name, limit in LARGE.items():
        if name in tongue.used:
            yield LARGEST.format(name=name, limit=limit)
    if subject.loops:
        yield NEWTON.format(iterations=ITERATIONS)
    yield CHECKS


LARGEST = '''\
def {name}(x):
    """Function {name}; infinite where a double cannot hold it."""
    try:
        return math.{name}(x)
    except OverflowError:
        return {limit}'''

NEWTON = '''\
def newton(equations, known, n):
    """Solve r(a) = 0 by Newton's method from a = 0, with steps that are halved until |r| falls."""
    a = [0.0] * n
    for _ in range({iterations}):
        r, slopes = equations(known, a)
        before, share, step = size(r), 1.0, solved(slopes, r)
        if not math.isfinite(before):
            break
        for _ in range(40):
            b = [v - share * d for v, d in zip(a, step)]
            try:
                if size(equations(known, b)[0]) <= before:
                    break
            except ArithmeticError:  # there is no value there
                pass
            share /= 2
        a = b
        if max(map(abs, step)) <= 1e-10 * (1 + max(map(abs, a))):
            return a
    raise ArithmeticError("an algebraic loop does not converge")


def size(r):
    """Sum of squares."""
    return sum(v * v for v in r)


def solved(A, b):
    """Solution x of A x = b, by elimination with pivots."""
    rows, n = [[*row, v] for row, v in zip(A, b)], len(b)
    for k in range(n):
        p = max(range(k, n), key=lambda i: abs(rows[i][k]))
        rows[k], rows[p] = rows[p], rows[k]
        for i in range(k + 1, n):
            m = rows[i][k] / rows[k][k]
            rows[i] = [v - m * w for v, w in zip(rows[i], rows[k])]
    x = [0.0] * n
    for i in reversed(range(n)):
        x[i] = (rows[i][n] - sum(rows[i][j] * x[j] for j in range(i + 1, n))) / rows[i][i]
    return x'''

CHECKS = '''\
def computed(equations, *values):
    """What equations give, where it is finite; raises ArithmeticError elsewhere."""
    try:
        found = equations(*values)
    except (ArithmeticError, ValueError) as error:
        raise ArithmeticError(f"an equation has no finite value: {error}") from None
    if not all(map(math.isfinite, found)):
        raise ArithmeticError("an equation has no finite value")
    return found


def numbers(name, values, count):
    """Values as floats; raises ValueError where one is not finite, or there are not so many."""
    found = np.asarray(() if values is None else values, dtype=float)
    if found.shape != (count,):
        raise ValueError(f"{name} has the shape {found.shape}; expected {(count,)}")
    found = found.tolist()
    if not all(map(math.isfinite, found)):
        raise ValueError(f"{name} is not finite: {found}")
    return found


def instant(name, value):
    """Time as a float; raises ValueError where it is not finite."""
    value = float(value)
    if not math.isfinite(value):
        raise ValueError(f"{name} is not finite: {value}")
    return value'''
