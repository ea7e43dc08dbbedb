"""One step of an observer: s(t + h) from s(t), with u and y held over it."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression, parse
from obsdesign.families.observer import Correction, Observer
from obsdesign.lmi.formula import Array, Exact, in_floats, rational
from obsdesign.model.equations import free, linear, total

METHODS = ("euler", "rk4", "exact")
SMALL = 2.0**-56  # terms of a series are left out below this
LONGEST = 2000  # statements of a part of an exact step
REACHED = parse("d >= least", {"d", "least"})

Step = tuple[dict[str, Expression], dict[str, Expression]]  # algebraic signals, and the next value of each state


def step(observer: Observer, method: str, h: Expression, period: fmpq) -> Step:
    """Step of a method over a time h, in s: a number, or a variable of at most the period.

    euler   s + h f(t, s)
    rk4     s + h/6 (k1 + 2 k2 + 2 k3 + k4),    k1 = f(t, s),                    k2 = f(t + h/2, s + h/2 k1),
                                                k3 = f(t + h/2, s + h/2 k2),     k4 = f(t + h, s + h k3)
    exact   s + G f(t, s),    G = integral over [0, h] of exp(A r) dr, with A the constant linear part of f in s:
            exact where the rest of f is constant over the step (exponential Euler)

    An observer that has a correction takes y by this at the beginning of the step, and goes on by the method.

    Raises `UsageError`: a part of an exact step would need too many terms of its series.
    """
    if observer.correction is not None:
        return corrected(observer.correction, taken_by(observer), method, h, period)
    if not observer.dynamics:
        return dict(observer.algebraic), {}
    return {"euler": euler, "rk4": runge_kutta, "exact": exact}[method](observer, h, period)


def corrected(one: Correction, taken: set[str], method: str, h: Expression, period: fmpq) -> Step:
    """Step that begins with a correction by y, under names that are free."""
    algebraic, following = step(one.flow, method, h, period)
    taken |= {*one.algebraic, *one.closing, one.span}
    first, last = ({name: free(f"{name}_{place}", taken) for name in one.begin} for place in ("begin", "end"))
    names = {name: free(name, taken) for name in algebraic}
    there = {name: Expression.variable(other) for name, other in (*first.items(), *names.items())}
    ended = {name: Expression.variable(other) for name, other in last.items()} | {one.span: h}
    made = {name: side.substituted({one.span: h}) for name, side in one.algebraic.items()}
    made |= {first[name]: side.substituted({one.span: h}) for name, side in one.begin.items()}
    made |= {names[name]: side.substituted(there) for name, side in algebraic.items()}
    made |= {last[name]: side.substituted(there) for name, side in following.items()}
    made |= {name: side.substituted(ended) for name, side in one.closing.items()}
    return made, {name: side.substituted(ended) for name, side in one.end.items()}


def euler(observer: Observer, h: Expression, _: fmpq) -> Step:
    """Step of Euler."""
    dynamics = observer.dynamics
    return dict(observer.algebraic), {name: Expression.variable(name) + h * side for name, side in dynamics.items()}


def runge_kutta(observer: Observer, h: Expression, _: fmpq) -> Step:
    """Step of the classical Runge-Kutta method."""
    taken, half = taken_by(observer), Expression.number(fmpq(1, 2)) * h
    states = {name: Expression.variable(name) for name in observer.states}
    algebraic, rates = dict(observer.algebraic), list[dict[str, Expression]]()
    for stage, after in enumerate((None, half, half, h), start=1):
        here: dict[str, Expression] = {}
        if after is not None:
            here = {free(f"{n}_{stage}", taken): states[n] + after * rates[-1][n] for n in states}
            algebraic |= here
        made, sides = renamed(observer, stage, dict(zip(states, here, strict=False)), after, taken)
        slopes = {name: free(f"rate{stage}_{name}", taken) for name in states}
        algebraic |= made | {slopes[name]: side for name, side in sides.items()}
        rates.append({name: Expression.variable(slope) for name, slope in slopes.items()})
    sixth, two = Expression.number(fmpq(1, 6)) * h, Expression.number(2)
    k1, k2, k3, k4 = rates
    return algebraic, {n: states[n] + sixth * (k1[n] + two * k2[n] + two * k3[n] + k4[n]) for n in states}


def renamed(
    observer: Observer, stage: int, states: Mapping[str, str], after: Expression | None, taken: set[str]
) -> tuple[dict[str, Expression], dict[str, Expression]]:
    """Algebraic signals of a stage under names of their own, as far as they move, and the rates of the states."""
    if after is None:
        return {}, dict(observer.dynamics)
    moving, before = {"t", *states}, -1
    while len(moving) > before:
        before = len(moving)
        moving |= {name for name, side in observer.algebraic.items() if side.names & moving}
    names = {name: free(f"{name}_{stage}", taken) for name in observer.algebraic if name in moving}
    there = {name: Expression.variable(other) for name, other in (*states.items(), *names.items())}
    there["t"] = Expression.variable("t") + after
    made = {other: observer.algebraic[name].substituted(there) for name, other in names.items()}
    return made, {name: side.substituted(there) for name, side in observer.dynamics.items()}


def exact(observer: Observer, h: Expression, period: fmpq) -> Step:
    """Step that is exact of the linear part."""
    taken, states = taken_by(observer), observer.states
    rates = {free(f"rate_{name}", taken): side for name, side in observer.dynamics.items()}
    algebraic, A = {**observer.algebraic, **rates}, linear_part(observer)
    if h.names:
        parts, changes = series(A, tuple(rates), h, period, taken)
        algebraic |= parts
    else:
        changes = linear(rational(integrated(in_floats(A), float(period.p) / float(period.q))), tuple(rates))
    return algebraic, dict(zip(states, total([Expression.variable(name) for name in states], changes), strict=True))


def integrated(A: Array, h: float) -> Array:
    """Integral over [0, h] of exp(A r) dr, in doubles; raises `UsageError` where it is too large for these."""
    from scipy.linalg import expm

    n = len(A)
    with np.errstate(all="ignore"):
        grown = expm(h * np.block([[A, np.eye(n)], [np.zeros((n, 2 * n))]]))
    if not np.isfinite(grown).all():
        said = f"exact over {h:g} s is beyond what doubles hold, so large is the linear part"
        raise UsageError(f"{said}; take a shorter period", id="OBS920")
    return np.asarray(grown[:n, n:])


def series(
    A: Exact, rates: Sequence[str], h: Expression, period: fmpq, taken: set[str]
) -> tuple[dict[str, Expression], list[Expression]]:
    """Integral over [0, h] of exp(A r) dr times the rates k, for any h up to the period: w' = A w + k from w = 0.

    Where |A| times the period is above 1, h is taken apart, h = sum of b_m d_m + d, with d_m = period/2^m, b_m 0 or 1,
    and |A| d <= 1: w + b_m G_m (A w + k) for each m, G_m the integral over [0, d_m] in doubles. What is left of h, all
    of it where |A| is small, goes by the series d (r + d/2 A (r + d/3 A (r + ..))), r = A w + k.
    """
    span = float(period.p) / float(period.q)
    size = float(np.abs(in_floats(A)).sum(axis=1).max(initial=0.0)) * span
    halvings = range(math.ceil(math.log2(size)) + 1 if size > 1 else 0)
    least = size / 2.0 ** max(0, len(halvings) - 1)
    terms = next(m for m in range(1, 100) if least**m / math.factorial(m + 1) < SMALL)
    if (2 * len(halvings) + terms) * len(A) > LONGEST:
        said = f"exact over a part of a period takes {(2 * len(halvings) + terms) * len(A)} sums; take method rk4, or a"
        raise UsageError(f"{said} shorter period", id="OBS920")
    k, made = [Expression.variable(name) for name in rates], dict[str, Expression]()
    w, d = [Expression.number(0)] * len(A), h

    def named(letter: str, sides: Sequence[Expression]) -> list[str]:
        names = [free(f"{letter}_{i}", taken) for i in range(1, len(sides) + 1)]
        made.update(zip(names, sides, strict=True))
        return names

    def variables(letter: str, sides: Sequence[Expression]) -> list[Expression]:
        return [Expression.variable(name) for name in named(letter, sides)]

    grown = list[str]()  # names of w
    for m in halvings:
        share = period / 2**m
        (b,) = variables(f"b{m}", [REACHED.substituted({"d": d, "least": Expression.number(share)})])
        r = named(f"r{m}", total(k, linear(A, grown)) if grown else k)
        G = rational(integrated(in_floats(A), span / 2.0**m))
        w = total(w, [b * side for side in linear(G, r)])
        grown = named(f"w{m}", w)
        w = [Expression.variable(name) for name in grown]
        (d,) = variables(f"d{m}", [d + Expression.number(-share) * b])
    r = named("r", total(k, linear(A, grown)) if grown else k)
    z = r
    for m in range(terms, 1, -1):
        part = d * Expression.number(fmpq(1, m))
        z = named(f"z{m}", [Expression.variable(a) + part * b for a, b in zip(r, linear(A, z), strict=True)])
    return made, total(w, [d * Expression.variable(name) for name in z])


def linear_part(observer: Observer) -> Exact:
    """A, (n, n): what each rate has of each state, by itself or through algebraic signals that are linear in it."""
    states, algebraic = observer.states, observer.algebraic

    def row(side: Expression, factor: fmpq, path: tuple[str, ...], into: dict[str, fmpq]) -> None:
        for c, term in side.summands():
            name = term.text
            if term.names != {name}:
                continue
            if name in into:
                into[name] += factor * c
            elif name in algebraic and name not in path:
                row(algebraic[name], factor * c, (*path, name), into)

    A = []
    for name in states:
        found = dict.fromkeys(states, fmpq(0))
        row(observer.dynamics[name], fmpq(1), (), found)
        A.append(list(found.values()))
    return np.array(A, dtype=object)


def taken_by(observer: Observer) -> set[str]:
    """Names that an observer uses."""
    return {"t", *observer.states, *observer.algebraic, *observer.inputs, *observer.outputs, *observer.following}
