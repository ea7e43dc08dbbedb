"""What every type of nonlinearity owes to the rest: a new one inherits all of it by its rows in INSIDE and OUTSIDE."""

import re
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support.contract import differences
from support.multipliers import ROTATION, difference, edge, form, smallest
from support.sweep import examples

import obsdesign as od
from obsdesign.expressions import parse
from obsdesign.lmi.formula import in_floats, rational
from obsdesign.model.multiplier import Multiplier
from obsdesign.nonlinearities import FUNCTIONS, TEMPLATES, combine
from obsdesign.reading import json_schema

ROUNDING = 1e-6  # relative to the terms of the quadratic form


@dataclass(frozen=True)
class Row:
    """A function, its type, and data of that.

    Attributes
    ----------
    words
        What tables and messages call the type with these data.
    """

    type: str
    f: tuple[str, ...]  # of q, or of q1, q2, ..
    data: Any = None
    words: str = ""

    @property
    def arguments(self):
        """Names of the arguments."""
        numbers = [int(n) for n in re.findall(r"q(\d)", " ".join(self.f))]
        return [f"q{i + 1}" for i in range(max(numbers))] if numbers else ["q"]

    @property
    def function(self):
        """The function, of an array."""
        parts = [parse(text, self.arguments).function(self.arguments) for text in self.f]
        return lambda q: np.array([part(*q) for part in parts])

    def spec(self, *, with_f=True):
        """A spec with this nonlinearity."""
        n, nf = len(self.arguments), len(self.f)
        block = {"type": self.type if self.data is None else {self.type: self.data}, "Cq": np.eye(n)}
        block |= {"Bf": np.ones((n, nf))} | ({"f": list(self.f)} if with_f else {})
        system = {"A": -np.eye(n), "C": np.eye(n)}
        return od.Spec(system=system, nonlinearities=[block], observer={"type": "l2", "L2": 0, "alpha": 0.1})

    @property
    def multiplier(self):
        """The multiplier of the type with these data."""
        (block,) = self.spec(with_f=False).nonlinearities
        return block.multiplier

    def __str__(self):
        """Name of a test."""
        return f"{', '.join(self.f)} is {self.words or self.type}"


SOFTMAX = tuple(f"exp(q{i})/(exp(q1) + exp(q2) + exp(q3))" for i in (1, 2, 3))
NORM = "max(1, sqrt(q1**2 + q2**2))"
CORNERS = [[[a, 0], [b, b]] for a in (-1, 1) for b in (0, 1)]
INSIDE = [
    Row("monotone", ("q**3",)),
    Row("monotone", ("q1*(q1**2 + q2**2)", "q2*(q1**2 + q2**2)")),
    Row("monotone", SOFTMAX),
    Row("lipschitz", ("sin(q)",), 1, "lipschitz 1"),
    Row("lipschitz", ("2*tanh(q)",), 2, "lipschitz 2"),
    Row("lipschitz", ("sin(q1) + cos(q2)",), 1.4143, "lipschitz 1.4143"),
    Row("lipschitz", ("sin(q1)", "cos(q2)/2", "q1/2"), 1.2, "lipschitz 1.2"),
    Row("slope", ("2*q + sin(q)",), [1, 3], "slope [1, 3]"),
    Row("slope", ("-2*q - sin(q)",), [-3, -1], "slope [-3, -1]"),
    Row("slope", ("tanh(q) - q",), [-1, 0], "slope [-1, 0]"),
    Row("slope", ("q + q**3",), [1, np.inf], "slope [1, .inf]"),
    Row("slope", ("q**3 - q",), [-1, np.inf], "slope [-1, .inf]"),
    Row("slope", ("tanh(q1)", "sat(q2)"), [0, [1, 1]], "slope [0, [1, 1]]"),
    Row(
        "slope",
        ("2*q1 + sin(q1)", "-2*q2 - sin(q2)", "q3/2 + 1.5*sin(q3)", "2*q4 + q4**3", "q5**3 - 2*q5"),
        [[1, -3, -1, 2, -2], [3, -1, 2, np.inf, np.inf]],
        "slope [[1, -3, -1, 2, -2], [3, -1, 2, .inf, .inf]]",
    ),
    Row("sector", ("tanh(q1)", "2*q2 + sin(q2)"), {"K1": [[0, 0], [0, 1]], "K2": [[1, 0], [0, 3]]}, "sector"),
    Row("sector", SOFTMAX, {"K1": np.zeros((3, 3)), "K2": np.eye(3)}, "sector"),
    Row("sector", ("2*(q1 + q2) + sin(q1 + q2)",), {"K1": [[1, 1]], "K2": [[3, 3]]}, "sector"),
    Row("cocoercive", ("sat(q)",), 1, "cocoercive 1"),
    Row("cocoercive", ("2*tanh(q1)", "2*tanh(q2)"), 2, "cocoercive 2"),
    Row("cocoercive", SOFTMAX, 1, "cocoercive 1"),
    Row("ball", ("q1 + q2 + sin(q1 + 2*q2)",), {"K": [[1, 1]], "W": [[1, 2]]}, "ball"),
    Row("ball", (f"q1/{NORM} - q2", f"q1 + q2/{NORM}"), {"K": ROTATION, "W": np.eye(2)}, "ball"),
    Row(
        "one-sided-lipschitz", ("sin(q)",), {"rho": 1, "beta": 1, "phi": 0}, "one-sided-lipschitz rho 1, beta 1, phi 0"
    ),
    Row(
        "one-sided-lipschitz",
        ("-2*q - sin(q)",),
        {"rho": -1, "beta": -3, "phi": -4},
        "one-sided-lipschitz rho -1, beta -3, phi -4",
    ),
    Row(
        "one-sided-lipschitz",
        ("sat(q1) - q1 - 5*q2", "5*q1 - q2 + sat(q2)"),
        {"rho": 0, "beta": 37, "phi": 0},
        "one-sided-lipschitz rho 0, beta 37, phi 0",
    ),
    Row("jacobian", ("sin(q)",), [[[-1]], [[1]]], "jacobian of 2 matrices"),
    Row("jacobian", ("q*exp(-q**2)",), [[[-0.4463]], [[1]]], "jacobian of 2 matrices"),
    Row("jacobian", ("sin(q1) + cos(q2)",), [[[a, b]] for a in (-1, 1) for b in (-1, 1)], "jacobian of 4 matrices"),
    Row("jacobian", ("sin(q1)", "tanh(q1 + q2)"), CORNERS, "jacobian of 4 matrices"),
    Row("cone", ("q**3",), [[[1]]], "cone of 1 matrices"),
    Row("cone", ("q1**3", "q1**3 + q2*abs(q2)"), [[[1, 0], [1, 0]], [[0, 0], [0, 1]]], "cone of 2 matrices"),
    Row("cone", ("(q1 - q2)**3",), [[[1, -1]]], "cone of 1 matrices"),
    Row("cone", ("3*q2", "-3*q1"), [ROTATION, np.transpose(ROTATION)], "cone of 2 matrices"),
    Row("multiplier", ("2*q + sin(q)",), [[-6, 4], [4, -2]]),
    Row("multiplier", ("q**3 + q/4",), [[-0.5, 1], [1, 0]]),
    Row(
        "multiplier",
        ("q1 + q1**3", "3*q2 + sin(q2)"),
        [[-2, 0, 1, 0], [0, -8, 0, 3], [1, 0, 0, 0], [0, 3, 0, -1]],
    ),
    *(Row(name, (template.f,)) for name, template in FUNCTIONS.items()),
]
OUTSIDE = [  # by little
    Row("monotone", ("q**3 - q/10",)),
    Row("monotone", ("-q1/10 - q2", "q1 - q2/10")),
    Row("lipschitz", ("sin(q)",), 0.95),
    Row("lipschitz", ("sin(q1) + cos(q2)",), 1.34),
    Row("slope", ("2*q + sin(q)",), [1, 2.9]),
    Row("slope", ("2*q + sin(q)",), [1.1, 3]),
    Row("slope", ("q**3 - q/2",), [0, np.inf]),
    Row("slope", ("tanh(q1)", "tanh(q1 + q2)"), [0, 1]),
    Row("sector", ("tanh(q1)", "2*q2 + sin(q2)"), {"K1": [[0, 0], [0, 1]], "K2": [[1, 0], [0, 2.8]]}),
    Row("sector", ("-q2", "q1"), {"K1": np.zeros((2, 2)), "K2": np.eye(2)}),
    Row("cocoercive", ("sat(q)",), 0.95),
    Row("cocoercive", ("-q2", "q1"), 1),
    Row("ball", ("q1 + q2 + sin(q1 + 2*q2)",), {"K": [[1, 1]], "W": [[0.95, 1.9]]}),
    Row("ball", ("sin(q1 + 2*q2) + sin(q2)/10",), {"K": [[0, 0]], "W": [[1, 2]]}),
    Row("one-sided-lipschitz", ("sin(q)",), {"rho": 0.95, "beta": 1, "phi": 0}),
    Row("one-sided-lipschitz", ("sin(q)",), {"rho": 1, "beta": 0.9, "phi": 0}),
    Row("one-sided-lipschitz", ("-2*q - sin(q)",), {"rho": -1, "beta": -3, "phi": -3.9}),
    Row("jacobian", ("sin(q)",), [[[-0.95]], [[0.95]]]),
    Row("jacobian", ("sin(q1)", "tanh(q1 + q2)"), [[[-1, 0], [0, 0]], [[-1, 0], [1, 1]], [[1, 0], [0, 0]]]),
    Row("cone", ("q**3 - q/10",), [[[1]]]),
    Row("cone", ("q1**3", "q2*abs(q2) - q1**3"), [[[1, 0], [1, 0]], [[0, 0], [0, 1]]]),
    Row("cone", ("(q1 - q2)**3 + q2/10",), [[[1, -1]]]),
    Row("multiplier", ("2*q + 1.05*sin(q)",), [[-6, 4], [4, -2]]),
    *(Row(name, (f"{template.f} - q/20",)) for name, template in FUNCTIONS.items()),
    *(Row(name, (f"{template.f} + q/20",)) for name, template in FUNCTIONS.items() if name not in {"q|q|", "cubic"}),
]
ALL_KINDS = combine(Row(*row).multiplier for row in (
    ("jacobian", ("q1", "q2"), CORNERS), ("cone", ("q1 - q2",), [[[1, -1]]]),
    ("one-sided-lipschitz", ("q",), {"rho": 1, "beta": 1, "phi": 0}), ("sin", ("q",)),
))  # fmt: skip
inside = pytest.mark.parametrize("row", INSIDE, ids=str)


@cache
def edge_of(i):
    return edge(INSIDE[i].multiplier)


def test_every_type_is_held_to_its_contract():
    assert {row.type for row in INSIDE} == {row.type for row in OUTSIDE} == TEMPLATES.keys()


@inside
@examples(15)
@given(data=st.data())
def test_every_multiplier_holds_for_a_function_of_the_type(row, data):
    argument = arrays(float, len(row.arguments), elements=st.floats(-5, 5, width=16))
    pair = difference(row.function, data.draw(argument), data.draw(argument))
    assert form(data.draw(st.sampled_from(edge_of(INSIDE.index(row)))), pair) >= -ROUNDING


@inside
def test_every_multiplier_holds_for_many_pairs_close_and_far(row):
    assert smallest(edge_of(INSIDE.index(row))[:8], row.function, len(row.arguments)) >= -ROUNDING


@inside
def test_the_member_satisfies_every_multiplier(row):
    K = in_floats(row.multiplier.member)
    assert K.shape == (len(row.f), len(row.arguments))
    assert smallest(edge_of(INSIDE.index(row)), lambda q: K @ q, K.shape[1], pairs=20) >= -ROUNDING


@pytest.mark.parametrize("row", OUTSIDE, ids=str)
def test_a_function_just_outside_violates_some_multiplier_and_is_refuted_by_a_pair(row):
    assert smallest(edge(row.multiplier), row.function, len(row.arguments), span=8) < -1e-3
    answer = "differs from its type" if row.type in FUNCTIONS else "is refuted by"
    with pytest.raises(od.UsageError, match=answer) as caught:
        row.spec()
    assert "\n" not in str(caught.value)


@inside
def test_a_type_is_read_and_written_and_read_again(row):
    spec = row.spec()
    (block,) = spec.nonlinearities
    assert block.type == (row.words or row.type)
    assert block.nq == len(row.arguments)
    (again,) = od.load(spec.text).nonlinearities
    assert list(differences(again, block)) == []
    assert list(differences(row.multiplier, block.multiplier)) == []


@pytest.mark.parametrize("name", TEMPLATES)
def test_the_schema_knows_every_type(name):
    text = str(json_schema())
    assert f"'{name}'" in text
    data = TEMPLATES[name].data
    assert data is None or str(data.description) in text


@inside
@examples(10)
@given(data=st.data())
def test_the_loop_shift_keeps_the_form_and_leaves_a_member_that_is_zero(row, data):
    for cone in row.multiplier.blocks:
        block = cone.one_scale()
        if block is None:
            with pytest.raises(od.UsageError, match="one scale"):
                Multiplier((cone,)).shifted()
            continue
        assert (block.member == cone.member).all()
        shifted, K = block.shifted(), block.member
        nf, nq = K.shape
        number = st.integers(-9, 9)
        dq, df = (rational(data.draw(arrays(int, (size, 1), elements=number))) for size in (nq, nf))

        def value(part, q, f):
            return (q.T @ part.M11 @ q + 2 * (q.T @ part.M12 @ f) + f.T @ part.M22 @ f).item()

        assert value(block, dq, df) == value(shifted, dq, df - K @ dq)
        assert value(shifted, dq, 0 * df) >= 0
        assert not shifted.member.any()


def test_blocks_of_all_kinds_hold_side_by_side():
    def f(q):
        return np.array([np.sin(q[0]), np.tanh(q[0] + q[1]), (q[2] - q[3]) ** 3, np.sin(q[4]), np.sin(q[5])])

    assert smallest(edge(ALL_KINDS)[:8], f, 6) >= -ROUNDING
