"""Plants whose coordinates are known, and what is found held against the equations in doubles."""

import numpy as np
import pytest

from obsdesign.expressions import constant, parse
from obsdesign.families.algebraic.find import Search, find
from obsdesign.model.equations import Equations, Typed

CUK = {
    "i1": "(E-(1-u)*v2)/L1", "v4": "(i3-G*v4)/C4", "v2": "((1-u)*i1+u*i3)/C2", "i3": "-(u*v2+v4)/L3",
}  # fmt: skip
CUK_NUMBERS = {"E": "12", "L1": "0.01", "L3": "0.01", "C2": "22.0e-6", "C4": "22.9e-6", "G": "0.0447"}
CUK_DOMAIN = {"i1": (-3, 3), "v4": (-30, 0), "v2": (5, 50), "i3": (-2, 2), "u": ("0.1", "0.9")}
PROPOSITION_6 = {"x1": "-x1**3 + exp(x3)", "x2": "-x2 + x1**2 + sin(x1)", "x3": "1/(1 + x1**2) + x1*u"}
VAN_DER_POL = {"x1": "x2", "x2": "mu*(1 - x1**2)*x2 - x1"}
DUFFING = {"x1": "x2", "x2": "-delta*x2 + x1 - x1**3 + u"}
LORENZ = {"x": "10*(y - x)", "y": "x*(28 - z) - y", "z": "x*y - 8/3*z"}
CHAIN = {"a": "b", "b": "c", "c": "-a - 2*b - 3*c + u"}


def plant(dynamics, outputs, inputs=(), numbers=None):
    names = {"t", *dynamics, *outputs, *inputs}
    exact = {name: constant(text)[0] for name, text in (numbers or {}).items()}
    sides = ({name: parse(str(text), names, exact) for name, text in part.items()} for part in (dynamics, outputs))
    return Equations(*sides, {}, tuple(inputs))


def limits(domain):
    return {name: tuple(constant(str(end))[0] for end in ends) for name, ends in domain.items()}


def searched(equations, domain=None, lambdas=(), functions=(), **changes):
    names = equations.signals
    parts = {"lambdas": lambdas, "functions": functions}
    expressions = {key: tuple(parse(text, names) for text in texts) for key, texts in parts.items()}
    found = find(Typed(equations, limits(domain or {})), Search(**expressions, **changes))
    everything_holds(equations, found)
    return found


def everything_holds(equations, found):
    """The equation of every coordinate and the left inverse, in doubles at random points."""
    random = np.random.default_rng(5)
    point = dict(zip(equations.signals, random.uniform(0.3, 0.9, 99), strict=False))
    point |= {name: value_at(side, point) for name, side in equations.outputs.items()}
    point |= {c.name: value_at(c.phi, point) for c in found.coordinates}
    rates = {name: value_at(side, point) for name, side in equations.dynamics.items()}
    for c in (*found.coordinates, *found.others):
        flow = sum(value_at(c.phi.derivative(name), point) * rate for name, rate in rates.items())
        kept = value_at(c.rate, point) * value_at(c.phi, point)
        assert flow == pytest.approx(kept + value_at(c.B, point), rel=1e-9, abs=1e-9), c
        assert c.rate.names | c.B.names <= {"t", *equations.outputs, *equations.inputs, *point} - rates.keys()
    for name, side in found.left_inverse.items():
        assert value_at(side, point) == pytest.approx(point[name], rel=1e-6), name
    shown = {side.text for side in equations.outputs.values()}
    assert {*found.left_inverse, *found.missing} == set(equations.states) - shown


def value_at(expression, point):
    names = sorted(expression.names)
    return float(expression.function(names)(*(point[name] for name in names)))
