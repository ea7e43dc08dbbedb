"""Coordinates of the plants of the paper are found in less than two seconds of processor time each.

They run with the other tests; `pytest tests/benchmarks -v` shows the numbers.
"""

import pytest
from support.coordinates import (
    CHAIN,
    CUK,
    CUK_DOMAIN,
    CUK_NUMBERS,
    DUFFING,
    PROPOSITION_6,
    VAN_DER_POL,
    plant,
    searched,
)  # fmt: skip
from support.speed import processor_time, slowness

CASES = {
    "Cuk": ((CUK, {"y1": "v2", "y2": "i3"}, ("u",), CUK_NUMBERS), CUK_DOMAIN, {}),
    "Cuk, lambda 0": ((CUK, {"y1": "v2", "y2": "i3"}, ("u",), CUK_NUMBERS), CUK_DOMAIN, {"negative": False}),
    "Proposition 6": ((PROPOSITION_6, {"y": "x1"}, ("u",)), {}, {"functions": ("exp(x3)", "exp(x2)")}),
    "Van der Pol": ((VAN_DER_POL, {"y": "x1"}, (), {"mu": "1"}), {}, {}),
    "Duffing, position": ((DUFFING, {"y": "x1"}, ("u",), {"delta": "0.3"}), {}, {}),
    "Duffing, speed": ((DUFFING, {"y": "x2"}, ("u",), {"delta": "0.3"}), {}, {"degree": 4}),
    "linear": ((CHAIN, {"y": "a"}, ("u",)), {}, {}),
}


@pytest.mark.parametrize("name", CASES)
def test_coordinates_are_found_in_two_seconds_at_most(benchmark, name):
    given, domain, changes = CASES[name]
    equations = plant(*given)
    run = lambda: processor_time(lambda: searched(equations, domain, **changes))  # noqa: E731
    seconds, found = benchmark.pedantic(run, rounds=1)
    benchmark.extra_info.update({"processor time [s]": round(seconds, 3)})
    assert found.missing == ()
    assert seconds < 2 * slowness()
