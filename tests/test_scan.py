"""Searches of one variable: minima, zeros, and the end of what is feasible; and how often they ask."""

import math

import pytest

from obsdesign.dissipation.scan import SHARP, Minimum, edge, strides, zero


def valley(minimum):
    return lambda x: 2 + math.log(x / minimum) ** 2 + 0.1 * abs(math.log(x / minimum)) ** 3


def counted(function):
    calls = []

    def asked(x):
        calls.append(x)
        return function(x)

    return asked, calls


@pytest.mark.parametrize("minimum", [1.0, 1.3, 7.0, 99.0, 100.0])
def test_a_minimum_is_found_by_a_grid_and_nearby(minimum):
    for search in (lambda m: m.everywhere(9), lambda m: m.near(3.0)):
        found = Minimum(valley(minimum), 1, 100)
        x, value = search(found)
        assert x == pytest.approx(minimum, rel=SHARP)
        assert value == pytest.approx(2, abs=1e-5)
        assert (x, value) == found.best
        assert len(found.values) <= 60


@pytest.mark.parametrize("guess", [6.0, 7.0, 8.0])
def test_a_good_guess_takes_few_values(guess):
    function, calls = counted(valley(7.0))
    assert Minimum(function, 1, 100).near(guess)[1] == pytest.approx(2, abs=1e-5)
    assert len(calls) <= 7


@pytest.mark.parametrize("end", [1.0, 100.0])
def test_a_guess_at_an_end_that_is_the_minimum_takes_two_values(end):
    function, calls = counted(lambda x: abs(math.log(x / end)))
    assert Minimum(function, 1, 100).near(end) == (end, 0.0)
    assert len(calls) == 2


def test_a_flat_function_ends_a_search():
    assert Minimum(lambda _: 3.0, 1, 100).near(7.0)[1] == 3.0


def test_a_minimum_between_walls_is_found():
    found = Minimum(lambda x: (x - 5) ** 2 if 4 < x < 7 else math.inf, 1, 100)
    assert found.everywhere(25)[1] == pytest.approx(0, abs=1e-2)


def test_a_function_that_is_nowhere_finite_has_no_minimum():
    assert Minimum(lambda _: math.inf, 1, 100).near(5.0)[1] == math.inf
    assert Minimum(lambda _: math.inf, 1, 100).everywhere(5)[1] == math.inf


def test_the_minimum_of_a_point_is_its_value():
    assert Minimum(float, 3.0, 3.0).near(2.0) == Minimum(float, 3.0, 3.0).everywhere(5) == (3.0, 3.0)


def test_a_minimum_is_the_same_wherever_the_search_begins():
    values = [Minimum(valley(7.0), 1, 100).near(guess)[1] for guess in (1.0, 6.0, 7.0, 20.0, 100.0)]
    assert values == pytest.approx([2.0] * 5, abs=1e-5)


@pytest.mark.parametrize("function", [lambda x: x**3 - 2, lambda x: math.inf if x > 2 ** (1 / 3) else x - 2])
def test_the_zero_of_an_increasing_function(function):
    found = zero(function, 0.0, 10.0, 1e-6)
    assert found == pytest.approx(2 ** (1 / 3), abs=1e-6)
    assert function(found) < 0


def test_a_zero_takes_few_values_and_each_once():
    function, calls = counted(lambda x: x**3 - 2)
    zero(function, 0.0, 10.0, 1e-6)
    assert len(calls) == len(set(calls)) <= 20


def test_a_zero_beyond_an_interval():
    assert zero(lambda x: x, 0.0, 1.0, 1e-6) is None
    assert zero(lambda x: x - 2, 0.0, 1.0, 1e-6) == 1.0


@pytest.mark.parametrize(("inside", "outside"), [(1.0, 100.0), (100.0, 1.0), (0.0, 100.0)])
def test_the_end_of_what_holds_is_on_its_inner_side(inside, outside):
    def holds(x):
        return (x < 7) == (inside < 7)

    found = edge(holds, inside, outside, 1e-6)
    assert holds(found)
    assert found == pytest.approx(7, rel=2e-6)


def test_strides_end_where_a_condition_does():
    assert strides(lambda x: x < 30, 1.0, 4.0, 10) == (16.0, 64.0)
    assert strides(lambda x: x < 30, 100.0, 4.0, 10) == (25.0, 100.0)
    assert strides(lambda x: x > 30, 100.0, 0.5, 10) == (50.0, 25.0)
    assert strides(lambda _: True, 1.0, 4.0, 2) == (16.0, None)
    assert strides(lambda _: False, 1.0, 4.0, 2) == (None, 1 / 16)
