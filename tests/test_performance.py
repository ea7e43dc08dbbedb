"""The section `performance:` with weights or scales: z = weight times error, and what is told of units."""

import numpy as np
import pytest

import obsdesign as od
from obsdesign.errors import UsageError

SYSTEM = {
    "states": ["h", "v"],
    "units": {"h": "m", "v": "m/s"},
    "A": [[0, 1], [-2, -1]],
    "B": [[0], [1]],
    "C": [[1, 0]],
}
OBSERVER = {"type": "l2", "alpha": 0.2, "bounds": {"L1": 10}}


def spec(performance, **further):
    sections = {"system": SYSTEM, "observer": OBSERVER, "disturbance": "integrator", "noise": {"h_": 0.01}, **further}
    sections["system"] = {**SYSTEM, "outputs": ["h_"]}
    return od.Spec(performance=performance, **sections)


def rows(performance, **further):
    made = spec(performance, **further)
    return made.H_names, np.array(made.H, dtype=float).tolist()


@pytest.mark.parametrize(
    ("performance", "names", "H"),
    [
        ({"weights": {"h": 1, "w1": 100}}, ("h", "w1"), [[1, 0, 0], [0, 0, 100]]),
        ({"of": ["h", "w1"], "weights": {"w1": 100}}, ("h", "w1"), [[1, 0, 0], [0, 0, 100]]),
        ({"of": ["w1", "h"], "scales": {"h": 0.01}}, ("w1", "h"), [[0, 0, 1], [100, 0, 0]]),
        ({"scales": {"v": 4}}, ("v",), [[0, 0.25, 0]]),
        ({"of": "x", "weights": {"h": 3}, "scales": {"v": 0.5}}, ("h", "v"), [[3, 0, 0], [0, 2, 0]]),
        ({"of": "w", "weights": {"w1": 2}}, ("w1",), [[0, 0, 2]]),
        ({"of": ["v"]}, ("v",), [[0, 1, 0]]),
    ],
)
def test_z_is_each_error_times_its_weight(performance, names, H):
    assert rows(performance) == (names, H)


def test_a_weight_is_exact():
    assert str(spec({"scales": {"h": 3}}).H[0, 0]) == "1/3"


def test_gamma_is_that_of_the_same_matrix():
    weighed, matrix = (od.solve(spec(z)) for z in ({"weights": {"h": 9, "v": 1}}, {"H": [[9, 0, 0], [0, 1, 0]]}))
    assert weighed.guarantee.gamma == matrix.guarantee.gamma
    assert "z is each error times its weight: 9 h, 1 v" in weighed.notes
    assert weighed.verify().holds


def test_that_units_are_mixed_is_told_unless_the_errors_are_weighed():
    told = "z adds errors in m, m/s as they are"
    asked = ("x", ["h"], {"weights": {"h": 1, "v": 1}}, {"scales": {"h": 1, "v": 2}})
    said = [any(told in note for note in od.solve(spec(z)).remarks()) for z in asked]
    assert said == [True, False, False, False]


@pytest.mark.parametrize(
    ("performance", "said"),
    [
        ({}, "performance: expected weights, scales, of or H"),
        ({"weights": {"g": 1}}, "performance.weights.g: unknown state g"),
        ({"of": ["h"], "weights": {"v": 1}}, "performance.weights.v: unknown component of z v; allowed: h"),
        ({"of": ["h", "g"], "weights": {"h": 1}}, "performance.of[1]: unknown state g"),
        ({"weights": {"h": 0}}, "performance.weights.h: 0 is not allowed; give a number > 0"),
        ({"weights": {"h": 1}, "scales": {"h": 1}}, "performance.scales.h: h has a weight already"),
        ({"H": [[1, 0, 0]], "weights": {"h": 1}}, "performance.weights: stands beside H"),
    ],
)
def test_what_is_wrong_is_told_at_its_place(performance, said):
    with pytest.raises(UsageError) as caught:
        spec(performance)
    assert said in "; ".join(f"{problem.key}: {problem.message}" for problem in caught.value.problems)
