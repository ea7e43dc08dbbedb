"""Every set of multipliers holds for the functions of its class, up to its edge, and not for those just outside."""

from functools import cache

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support.functions import sat, softmax
from support.multipliers import ROTATION, assembled, difference, exactly, form, made, matrices, smallest
from support.sweep import examples

from obsdesign.lmi.formula import Problem, block_diagonal, in_floats, rational, rational_number
from obsdesign.lmi.probe import coordinates
from obsdesign.lmi.probe import matrices as matrices_of
from obsdesign.lmi.proof import holds
from obsdesign.lmi.solve import Status, reduction, widest
from obsdesign.nonlinearities import combine


def edge(multiplier, draws=40):
    """Multipliers at the edge of the set, of unit size: shots in random directions from points inside (hit and run)."""
    multiplier, rng = in_floats(multiplier), np.random.default_rng(0)
    problem = Problem(multiplier.unknowns(), multiplier.inequalities)
    reduced = reduction(problem)
    inside = widest(problem)
    assert inside.status is Status.OPTIMAL
    z = coordinates(problem.unknowns, inside.values)[reduced.free]
    found = []
    for _ in range(draws):
        step = rng.standard_normal(z.shape) * np.linalg.norm(z)
        reach = (1 - 1e-6) * min([10.0, *(farthest(block.at(z), block.at(step)) for block in reduced.program.blocks)])
        M = assembled(multiplier, matrices_of(problem.unknowns, reduced.point(z + reach * step)))
        found.append(M / max(np.abs(M).max(), 1e-300))
        z = z + rng.uniform(0.2, 0.8) * reach * step
        z /= np.linalg.norm(z)
    return found


def farthest(F, G):
    """Largest s with F + s G <= 0, where F < 0."""
    half = np.linalg.inv(np.linalg.cholesky(-F))
    rate = np.linalg.eigvalsh(half @ G @ half.T)[-1]
    return 1 / rate if rate > 0 else np.inf


# name: multiplier, function, number of arguments
TRUE = {
    "(tanh, 2 q + sin q) is in a sector of diagonal matrices": (
        made("sector", matrices([[0, 0], [0, 1]], [[1, 0], [0, 3]]), 2, 2),
        lambda q: np.array([np.tanh(q[0]), 2 * q[1] + np.sin(q[1])]),
        2,
    ),
    "softmax is in the sector from 0 to I": (made("sector", matrices(np.zeros((3, 3)), np.eye(3)), 3, 3), softmax, 3),
    "a function of q1 + q2 is in a sector of rows": (
        made("sector", matrices([[1, 1]], [[3, 3]]), 2, 1),
        lambda q: 2 * (q[0] + q[1]) + np.sin(q[0] + q[1]),
        2,
    ),
    "sat is cocoercive": (made("cocoercive", fmpq(1)), sat, 1),
    "2 tanh is cocoercive": (made("cocoercive", fmpq(2), 2, 2), lambda q: 2 * np.tanh(q), 2),
    "softmax is cocoercive": (made("cocoercive", fmpq(1), 3, 3), softmax, 3),
    "q + sin(q1 + 2 q2) is in a ball": (
        made("ball", matrices([[1, 1]], [[1, 2]]), 2, 1),
        lambda q: q[0] + q[1] + np.sin(q[0] + 2 * q[1]),
        2,
    ),
    "a rotation and a saturation of the norm are in a ball": (
        made("ball", matrices(ROTATION, np.eye(2)), 2, 2),
        lambda q: np.array(ROTATION) @ q + q / max(1.0, np.linalg.norm(q)),
        2,
    ),
    "sin is one-sided Lipschitz": (made("one-sided-lipschitz", exactly(1, 1, 0)), np.sin, 1),
    "-2 q - sin q contracts": (made("one-sided-lipschitz", exactly(-1, -3, -4)), lambda q: -2 * q - np.sin(q), 1),
    "a damped rotation with a saturation is one-sided Lipschitz": (
        made("one-sided-lipschitz", exactly(0, 37, 0), 2, 2),
        lambda q: 5 * np.array(ROTATION) @ q - q + sat(q),
        2,
    ),
    "sin has its slopes between two vertices": (made("jacobian", matrices([[-1]], [[1]])), np.sin, 1),
    "q exp(-q^2) has its slopes between two vertices": (
        made("jacobian", matrices([["-0.4463"]], [[1]])),
        lambda q: q * np.exp(-(q**2)),
        1,
    ),
    "sin q1 + cos q2 has its gradient in a square": (
        made("jacobian", matrices([[-1, -1]], [[-1, 1]], [[1, -1]], [[1, 1]]), 2, 1),
        lambda q: np.sin(q[0]) + np.cos(q[1]),
        2,
    ),
    "(sin q1, tanh(q1 + q2)) has its Jacobian in a polytope": (
        made("jacobian", matrices(*([[a, 0], [b, b]] for a in (-1, 1) for b in (0, 1))), 2, 2),
        lambda q: np.array([np.sin(q[0]), np.tanh(q[0] + q[1])]),
        2,
    ),
    "q^3 has its slope on a ray": (made("cone", matrices([[1]])), lambda q: q**3, 1),
    "(q1^3, q1^3 + q2|q2|) has its Jacobian in a cone": (
        made("cone", matrices([[1, 0], [1, 0]], [[0, 0], [0, 1]]), 2, 2),
        lambda q: np.array([q[0] ** 3, q[0] ** 3 + q[1] * abs(q[1])]),
        2,
    ),
    "(q1 - q2)^3 has its gradient on a ray": (
        made("cone", matrices([[1, -1]]), 2, 1),
        lambda q: (q[0] - q[1]) ** 3,
        2,
    ),
    "a rotation either way is in a cone that contains both": (
        made("cone", matrices(ROTATION, np.transpose(ROTATION)), 2, 2),
        lambda q: -3 * np.array(ROTATION) @ q,
        2,
    ),
    "blocks of all kinds hold side by side": (
        combine(
            [
                made("jacobian", matrices(*([[a, 0], [b, b]] for a in (-1, 1) for b in (0, 1))), 2, 2),
                made("cone", matrices([[1, -1]]), 2, 1),
                made("one-sided-lipschitz", exactly(1, 1, 0)),
                made("sin", None),
            ]
        ),
        lambda q: np.array(
            [np.sin(q[0]), np.tanh(q[0] + q[1]), (q[2] - q[3]) ** 3, np.sin(q[4]), np.cos(q[5])],
        ),
        6,
    ),
}


@cache
def edge_of(name):
    return edge(TRUE[name][0])


@pytest.mark.parametrize("name", TRUE)
@examples(25)
@given(data=st.data())
def test_every_multiplier_of_the_set_holds_for_a_function_of_its_class(name, data):
    _, f, nq = TRUE[name]
    argument = arrays(float, nq, elements=st.floats(-5, 5, width=16))
    q1, q2 = data.draw(argument), data.draw(argument)
    assert form(data.draw(st.sampled_from(edge_of(name))), difference(f, q1, q2)) >= -1e-6


@pytest.mark.parametrize("name", TRUE)
def test_every_multiplier_of_the_set_holds_for_many_pairs_close_and_far(name):
    _, f, nq = TRUE[name]
    assert smallest(edge_of(name)[:8], f, nq) >= -1e-6


FALSE = {
    "an upper matrix too small": (
        made("sector", matrices([[0, 0], [0, 1]], [[1, 0], [0, "2.8"]]), 2, 2),
        lambda q: np.array([np.tanh(q[0]), 2 * q[1] + np.sin(q[1])]),
        2,
    ),
    "a rotation in the sector from 0 to I": (
        made("sector", matrices(np.zeros((2, 2)), np.eye(2)), 2, 2),
        lambda q: np.array(ROTATION) @ q,
        2,
    ),
    "a constant of cocoercivity 5 % too small": (made("cocoercive", rational_number("0.95")), sat, 1),
    "a rotation, monotone and Lipschitz 1, called cocoercive": (
        made("cocoercive", fmpq(1), 2, 2),
        lambda q: np.array(ROTATION) @ q,
        2,
    ),
    "a ball 5 % too small": (
        made("ball", matrices([[1, 1]], [["0.95", "1.9"]]), 2, 1),
        lambda q: q[0] + q[1] + np.sin(q[0] + 2 * q[1]),
        2,
    ),
    "a ball of rank one for a function of both arguments": (
        made("ball", matrices([[0, 0]], [[1, 2]]), 2, 1),
        lambda q: np.sin(q[0] + 2 * q[1]) + np.sin(q[1]) / 10,
        2,
    ),
    "a one-sided constant 5 % too small": (made("one-sided-lipschitz", exactly("0.95", 1, 0)), np.sin, 1),
    "an inner bound 5 % too small": (made("one-sided-lipschitz", exactly(1, "0.9", 0)), np.sin, 1),
    "an inner bound a little off its center": (
        made("one-sided-lipschitz", exactly(-1, -3, "-3.9")),
        lambda q: -2 * q - np.sin(q),
        1,
    ),
    "a polytope 5 % too small": (made("jacobian", matrices([["-0.95"]], [["0.95"]])), np.sin, 1),
    "a polytope without one of its vertices": (
        made("jacobian", matrices([[-1, 0], [0, 0]], [[-1, 0], [1, 1]], [[1, 0], [0, 0]]), 2, 2),
        lambda q: np.array([np.sin(q[0]), np.tanh(q[0] + q[1])]),
        2,
    ),
    "a slope that leaves its ray": (made("cone", matrices([[1]])), lambda q: q**3 - q / 10, 1),
    "a coupling that leaves its cone": (
        made("cone", matrices([[1, 0], [1, 0]], [[0, 0], [0, 1]]), 2, 2),
        lambda q: np.array([q[0] ** 3, -(q[0] ** 3) + q[1] * abs(q[1])]),
        2,
    ),
    "a gradient that turns off its ray": (
        made("cone", matrices([[1, -1]]), 2, 1),
        lambda q: (q[0] - q[1]) ** 3 + q[1] / 10,
        2,
    ),
}


@pytest.mark.parametrize("name", FALSE)
def test_a_function_just_outside_the_class_violates_some_multiplier_of_the_set(name):
    multiplier, f, nq = FALSE[name]
    assert smallest(edge(multiplier), f, nq) < -1e-3


# What would be wrong


def multiplier_of(M, nq):
    """Values of the unknowns of the first block for a whole matrix."""
    M = rational(M)
    return {"M1_11": M[:nq, :nq], "M1_12": M[:nq, nq:], "M1_22": M[nq:, nq:]}


def test_a_polytopic_multiplier_without_m22_negative_is_wrong_and_only_that_inequality_says_so():
    polytope = made("jacobian", matrices([[-1]], [[1]]))
    verdicts = {i.name: holds(i) for i in polytope.inequalities(multiplier_of([[-1, 0], [0, 1]], 1))}
    assert verdicts == {
        "M1_22 <= 0": False,
        "[I; Th1]' M1 [I; Th1] >= 0": True,
        "[I; Th2]' M1 [I; Th2] >= 0": True,
    }
    assert smallest([np.diag([-1.0, 1.0])], np.sin, 1) == pytest.approx(-1, abs=1e-3)


def test_a_conic_multiplier_with_m22_negative_is_wrong_and_has_no_unknown_for_it():
    cone = made("cone", matrices([[1]]))
    assert [u.name for u in cone.unknowns()] == ["M1_11", "M1_12"]
    assert not cone.matrix(multiplier_of([[0, 1], [1, 0]], 1))[2].any()
    assert smallest([np.array([[0, 1], [1, -0.2]])], lambda q: q**3, 1) < -0.1


@pytest.mark.parametrize("weight", [0, 0.9])
def test_a_sector_with_a_full_positive_definite_weight_is_wrong(weight):
    X = np.array([[1, weight], [weight, 1]])
    K1, K2 = np.zeros((2, 2)), np.eye(2)
    T = np.hstack([-K1, np.eye(2)]).T @ X @ np.hstack([K2, -np.eye(2)])
    value = smallest([T + T.T], lambda q: np.array([sat(q[0]), q[1] - sat(q[1])]), 2)
    assert bool(value >= -1e-9) is (weight == 0)
    assert weight == 0 or value < -0.3
    if weight == 0:
        M = assembled(in_floats(made("sector", (rational(K1), rational(K2)), 2, 2)), {"lambda1": np.array([[2.0]])})
        assert np.array_equal(M, T + T.T)


def test_a_naive_block_diagonal_of_a_cone_and_a_polytope_is_wrong():
    parts = (made("jacobian", matrices([[-1]], [[1]])), made("cone", matrices([[1]])))

    def f(q):
        return np.array([np.sin(q[0]), q[1] ** 3])

    assert smallest(edge(combine(parts)), f, 2) >= -1e-6
    first, second = (edge(part)[0] for part in parts)
    assert smallest([block_diagonal([first, second])], f, 2) < -0.1


@pytest.mark.parametrize("name", TRUE)
def test_the_member_satisfies_every_multiplier_of_the_set(name):
    K = in_floats(TRUE[name][0].member)
    assert smallest(edge_of(name), lambda q: K @ q, K.shape[1], pairs=20) >= -1e-6
