"""Lipschitz constants to 1e-6 take less than half a second of processor time each.

They run with the other tests; `pytest tests/benchmarks -v` shows the numbers.
"""

import pytest
from support.functions import within
from support.speed import processor_time, slowness

from obsdesign.expressions import parse
from obsdesign.nonlinearities.evidence.norm import largest_norm

POLYNOMIAL = ("q1**3", "-6*q1**5 - 6*q1**2*q2 - 2*q1**4 - 2*q1**2")
TRIGONOMETRIC = (("cos(a)*cos(b)", "cos(a+b)"), ("3*a**2 - a", "-6*a**2 + 2*a*b"))
LIMITS = (0.5, 1.0, 1.45, 2.0, 3.0)
BRANCHING = [((-0.25, 0.25), (-2.0, -1.0)), ((-0.25, 0.1), (0.1, 0.3)), ((-0.2, 0.0), (-0.4, -0.2))]


def polynomial(q1, q2):
    f = within(*POLYNOMIAL, nq=2, q1=q1, q2=q2)
    return f.jacobian, f.box


def trigonometric():
    return [[parse(text, ("a", "b")) for text in row] for row in TRIGONOMETRIC], {"a": (-1.0, 1.0), "b": (-2.0, 2.0)}


CASES = [
    *(polynomial((-0.25, 0.25), (-y, y)) for y in LIMITS),
    *(polynomial(*box) for box in BRANCHING),
    trigonometric(),
]


@pytest.mark.parametrize(("J", "box"), CASES)
def test_a_constant_to_one_part_in_a_million_takes_half_a_second_at_most(benchmark, J, box):
    seconds, found = benchmark.pedantic(lambda: processor_time(lambda: largest_norm(J, box)), rounds=1)
    benchmark.extra_info.update({"processor time [s]": round(seconds, 3), "boxes": found.boxes})
    assert found.bound <= found.attained * (1 + 1e-6)
    assert seconds < 0.5 * slowness()
