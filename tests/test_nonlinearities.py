"""Multipliers side by side, data that do not fit, and what would be wrong of a set of multipliers."""

import numpy as np
import pytest
from flint import fmpq
from support.functions import bounds, sat
from support.multipliers import assembled, edge, made, matrices, smallest

from obsdesign.errors import UsageError
from obsdesign.lmi.formula import block_diagonal, in_floats, rational
from obsdesign.lmi.proof import holds
from obsdesign.nonlinearities import FUNCTIONS, TEMPLATES, combine
from obsdesign.nonlinearities.lipschitz import lipschitz
from obsdesign.nonlinearities.monotone import monotone
from obsdesign.nonlinearities.slope import slope
from obsdesign.nonlinearities.user import user
from obsdesign.reading import loads


def whole(multiplier, scales=None):
    """M in the order (q, f), in doubles."""
    unknowns = in_floats(multiplier).unknowns()
    scales = np.ones(len(unknowns)) if scales is None else scales
    M11, M12, M22 = in_floats(multiplier).matrix(
        {u.name: np.array([[s]]) for u, s in zip(unknowns, scales, strict=True)}
    )
    return np.block([[M11, M12], [M12.T, M22]])


def test_blocks_with_several_arguments_are_interleaved_and_a_naive_block_diagonal_is_wrong():
    # f1 = sin q1 (Lipschitz 1), f2 = tanh(q2 + q3) (Lipschitz sqrt 2)
    parts = (lipschitz(fmpq(1), 1, 1), lipschitz(fmpq(3, 2), 2, 1))

    def f(q):
        return np.array([np.sin(q[0]), np.tanh(q[1] + q[2])])

    assert smallest([whole(combine(parts), [1.0, 3.0])], f, 3) >= -1e-6
    first, second = whole(parts[0]), whole(parts[1])
    naive = np.block([[first, np.zeros((2, 3))], [np.zeros((3, 2)), second]])
    assert smallest([naive], f, 3) < -0.1


def test_a_negative_scale_is_refused_by_the_inequalities_of_the_set():
    multiplier = combine([monotone(None, 1, 1), lipschitz(fmpq(1), 2, 1)])
    values = {"lambda1": np.array([[2.0]]), "lambda2": np.array([[-3.0]])}
    assert [(i.name, i.matrix.item()) for i in multiplier.inequalities(values)] == [
        ("lambda1 >= 0", -2.0),
        ("lambda2 >= 0", 3.0),
    ]


@pytest.mark.parametrize("M", [[[-1, 0], [0, -1]], [[-1, 0], [0, 1]]])
def test_a_multiplier_that_no_linear_map_satisfies_is_refused(M):
    with pytest.raises(UsageError, match="no f was found"):
        user(rational(M), 1, 1)


@pytest.mark.parametrize(
    ("template", "data", "nq", "nf", "message"),
    [
        ("monotone", None, 2, 1, "f has 1 components and q has 2"),
        ("slope", bounds((0, 1)), 2, 2, "1 bounds for 2 components"),
        ("slope", bounds((2, 1)), 1, 1, "lower bound 2 is above the upper bound 1"),
        ("sin", None, 2, 1, "slope"),
        ("multiplier", rational([[0, 1], [1, 0]]), 2, 1, "2 x 2, and q and f make it 3 x 3"),
        ("multiplier", rational([[0, 1], [2, 0]]), 1, 1, "not symmetric"),
    ],
)
def test_data_that_do_not_fit_the_nonlinearity_are_an_error_in_one_line(template, data, nq, nf, message):
    with pytest.raises(UsageError, match=message) as raised:
        TEMPLATES[template](data, nq, nf)
    assert "\n" not in str(raised.value)


SLOPES = {
    "q|q|": (0, None),
    "cubic": (0, None),
    "sin": (-1, 1),
    "cos": (-1, 1),
    "tanh": (0, 1),
    "atan": (0, 1),
    "sat": (0, 1),
    "deadzone": (0, 1),
    "relu": (0, 1),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_library_function_has_the_slopes_that_it_is_known_for(name):
    assert np.array_equal(whole(FUNCTIONS[name](None, 1, 1)), whole(slope(bounds(SLOPES[name]), 1, 1)))


def test_a_library_function_applies_to_each_component_with_a_scale_for_each():
    assert len(TEMPLATES["sat"](None, 3, 3).blocks) == 3


# What would be wrong of a set of multipliers


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


@pytest.mark.parametrize("margin", ["1.0e-3", "1.0e-13", "1.0e-200"])
def test_a_matrix_that_no_f_satisfies_is_refused_however_little_is_missing(margin):
    spec = f"""
obsdesign: 1
system: {{A: [[-1, 0.1], [0, -2]], B: [[1], [0]], C: [[1, 0]]}}
nonlinearities:
  - {{type: {{multiplier: [[1, 0, 0], [0, -{margin}, 0], [0, 0, -1]]}}, Bf: [0, 0.5], Cq: [[1, 0], [0, 1]]}}
observer: {{type: l2, alpha: 0.05, bounds: {{L1: 100}}}}
"""
    with pytest.raises(UsageError, match="no f was found that satisfies it"):
        loads(spec)
