"""Every multiplier holds for the functions of its class, and a slightly wrong one does not."""

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support.functions import bounds, sat, softmax
from support.multipliers import difference, form, smallest
from support.sweep import examples

from obsdesign.errors import UsageError
from obsdesign.expressions import parse
from obsdesign.lmi.formula import in_floats, rational
from obsdesign.nonlinearities import FUNCTIONS, TEMPLATES, Multiplier, combine
from obsdesign.nonlinearities.lipschitz import lipschitz
from obsdesign.nonlinearities.monotone import monotone
from obsdesign.nonlinearities.slope import slope
from obsdesign.nonlinearities.user import user

ROUNDING = 1e-9  # relative to the terms of the quadratic form


def whole(multiplier, scales=None):
    """M in the order (q, f), in doubles."""
    unknowns = in_floats(multiplier).unknowns()
    scales = np.ones(len(unknowns)) if scales is None else scales
    M11, M12, M22 = in_floats(multiplier).matrix(
        {u.name: np.array([[s]]) for u, s in zip(unknowns, scales, strict=True)}
    )
    return np.block([[M11, M12], [M12.T, M22]])


# name: multiplier, function, number of arguments
TRUE = {
    "sin is Lipschitz 1": (lipschitz(fmpq(1), 1, 1), np.sin, 1),
    "2 tanh is Lipschitz 2": (lipschitz(fmpq(2), 1, 1), lambda q: 2 * np.tanh(q), 1),
    "sin q1 + cos q2 is Lipschitz sqrt 2": (
        lipschitz(fmpq(14143, 10000), 2, 1),
        lambda q: np.sin(q[0]) + np.cos(q[1]),
        2,
    ),
    "saturation is Lipschitz 1": (lipschitz(fmpq(1), 1, 1), sat, 1),
    "q|q| is monotone": (monotone(None, 1, 1), lambda q: q * np.abs(q), 1),
    "q^3 is monotone": (monotone(None, 1, 1), lambda q: q**3, 1),
    "|q|^2 q is monotone": (monotone(None, 3, 3), lambda q: (q @ q) * q, 3),
    "softmax is monotone": (monotone(None, 3, 3), softmax, 3),
    "sin has slopes in [-1, 1]": (slope(bounds((-1, 1)), 1, 1), np.sin, 1),
    "2 q + sin q has slopes in [1, 3]": (slope(bounds((1, 3)), 1, 1), lambda q: 2 * q + np.sin(q), 1),
    "-2 q - sin q has slopes in [-3, -1]": (slope(bounds((-3, -1)), 1, 1), lambda q: -2 * q - np.sin(q), 1),
    "tanh q - q has slopes in [-1, 0]": (slope(bounds((-1, 0)), 1, 1), lambda q: np.tanh(q) - q, 1),
    "q + q^3 has slopes above 1": (slope(bounds((1, None)), 1, 1), lambda q: q + q**3, 1),
    "q^3 - q has slopes above -1": (slope(bounds((-1, None)), 1, 1), lambda q: q**3 - q, 1),
    "(tanh, sat) has slopes in [0, 1]": (
        slope(bounds((0, 1), (0, 1)), 2, 2),
        lambda q: np.array([np.tanh(q[0]), sat(q[1])]),
        2,
    ),
    "2 q + sin q satisfies the user's sector": (
        user(rational([[-6, 4], [4, -2]]), 1, 1),
        lambda q: 2 * q + np.sin(q),
        1,
    ),
}


@pytest.mark.parametrize("name", TRUE)
@examples(25)
@given(data=st.data())
def test_the_multiplier_holds_for_a_function_of_its_class(name, data):
    multiplier, f, nq = TRUE[name]
    argument = arrays(float, nq, elements=st.floats(-5, 5, width=32))
    scales = data.draw(arrays(float, len(multiplier.blocks), elements=st.floats(0.001, 1000)))
    found = form(whole(multiplier, scales), difference(f, data.draw(argument), data.draw(argument)))
    assert found >= -ROUNDING * (1 + scales.max())


@pytest.mark.parametrize("name", TRUE)
def test_the_multiplier_holds_for_many_pairs_close_and_far(name):
    multiplier, f, nq = TRUE[name]
    assert smallest([whole(multiplier)], f, nq) >= -1e-6


FALSE = {
    "a Lipschitz constant 5 % too small": (lipschitz(fmpq(95, 100), 1, 1), np.sin, 1),
    "a Lipschitz constant 5 % too small in two arguments": (
        lipschitz(fmpq(134, 100), 2, 1),
        lambda q: np.sin(q[0]) + np.cos(q[1]),
        2,
    ),
    "a decreasing function called monotone": (monotone(None, 1, 1), lambda q: -(q**3), 1),
    "a rotation by more than 90 degrees called monotone": (
        monotone(None, 2, 2),
        lambda q: np.array([-0.1 * q[0] - q[1], q[0] - 0.1 * q[1]]),
        2,
    ),
    "an upper slope too low": (slope(bounds((1, "2.9")), 1, 1), lambda q: 2 * q + np.sin(q), 1),
    "a lower slope too high": (slope(bounds(("1.1", 3)), 1, 1), lambda q: 2 * q + np.sin(q), 1),
    "a lower slope too high without an upper one": (
        slope(bounds((0, None)), 1, 1),
        lambda q: q**3 - q / 2,
        1,
    ),
    "componentwise slopes of coupled components": (
        slope(bounds((0, 1), (0, 1)), 2, 2),
        lambda q: np.array([np.tanh(q[0]), np.tanh(q[0] + q[1])]),
        2,
    ),
}


@pytest.mark.parametrize("name", FALSE)
def test_a_wrong_claim_is_refuted(name):
    multiplier, f, nq = FALSE[name]
    assert smallest([whole(multiplier)], f, nq) < -1e-3


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


MEMBERS = {
    "lipschitz": lipschitz(fmpq(2), 2, 3),
    "monotone": monotone(None, 2, 2),
    "slopes": slope(bounds((1, 3), (-3, -1), (-1, 2), (2, None), (-2, None)), 5, 5),
    "user sector": user(rational([[-6, 4], [4, -2]]), 1, 1),
    "user without upper bound": user(rational([["-0.5", 1], [1, 0]]), 1, 1),
    "user of two arguments": user(rational([[-2, 0, 1, 0], [0, -8, 0, 3], [1, 0, 0, 0], [0, 3, 0, -1]]), 2, 2),
}


@pytest.mark.parametrize("name", MEMBERS)
def test_the_member_belongs_to_the_class_and_the_loop_shift_to_it_leaves_a_positive_m11(name):
    for block in MEMBERS[name].blocks:
        K = block.member.astype(float)
        M = whole(Multiplier((block,)))
        graph = np.vstack([np.eye(K.shape[1]), K])
        assert np.linalg.eigvalsh(graph.T @ M @ graph).min() >= -1e-12
        shifted = block.shifted()
        assert np.allclose(shifted.M11.astype(float), graph.T @ M @ graph)
        assert not shifted.member.any()


@pytest.mark.parametrize("name", MEMBERS)
@examples(20)
@given(data=st.data())
def test_the_loop_shift_keeps_the_quadratic_form(name, data):
    for block in MEMBERS[name].blocks:
        nf, nq = block.member.shape
        number = st.integers(-9, 9)
        dq = rational(data.draw(arrays(int, (nq, 1), elements=number)))
        df = rational(data.draw(arrays(int, (nf, 1), elements=number)))

        def value(b, q, f):
            return (q.T @ b.M11 @ q + 2 * (q.T @ b.M12 @ f) + f.T @ b.M22 @ f).item()

        assert value(block, dq, df) == value(block.shifted(), dq, df - block.member @ dq)


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
def test_a_library_function_satisfies_its_template_which_is_as_narrow_as_can_be(name):
    f = parse(FUNCTIONS[name].f, ["q"]).function(["q"])
    a, b = SLOPES[name]
    M = whole(FUNCTIONS[name](None, 1, 1))
    assert np.array_equal(M, whole(slope(bounds((a, b)), 1, 1)))
    assert smallest([M], f, 1, span=8) >= -1e-6
    assert smallest([whole(slope(bounds((a + 0.05, b)), 1, 1))], f, 1, span=8) < -1e-3
    if b is not None:
        assert smallest([whole(slope(bounds((a, b - 0.05)), 1, 1))], f, 1, span=8) < -1e-3


def test_a_library_function_applies_to_each_component_with_a_scale_for_each():
    assert len(TEMPLATES["sat"](None, 3, 3).blocks) == 3
