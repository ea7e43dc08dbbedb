"""Multipliers with several unknowns: names, readings, members, refusals, and designs with them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from support.multipliers import ROTATION, assembled, exactly, made, matrices
from support.shipped import shipped
from support.sweep import examples

from obsdesign.errors import UsageError
from obsdesign.families.incremental.theorems import L2
from obsdesign.lmi.formula import Inequality, in_floats, rational
from obsdesign.lmi.proof import holds
from obsdesign.lmi.solve import Status, minimise
from obsdesign.model.plant import Plant
from obsdesign.nonlinearities import combine
from obsdesign.work import solve


@examples(60)
@given(st.tuples(*[st.integers(-12, 12)] * 3))
def test_one_sided_lipschitz_constants_are_refused_exactly_where_no_slope_satisfies_them(numbers):
    rho, beta, phi = (n / 2 for n in numbers)
    slopes = np.linspace(-20, 20, 160001)
    possible = ((slopes <= rho) & (slopes**2 <= beta + phi * slopes + 1e-9)).any()
    if possible:
        k = made("one-sided-lipschitz", exactly(rho, beta, phi)).member.item()
        assert k <= exactly(rho)[0]
        assert k * k <= exactly(beta)[0] + exactly(phi)[0] * k
    else:
        with pytest.raises(UsageError, match="no f satisfies both"):
            made("one-sided-lipschitz", exactly(rho, beta, phi))


ALL_KINDS = combine(
    [
        made("sin", None),
        made("one-sided-lipschitz", exactly(1, 1, 0)),
        made("jacobian", matrices([[-1]], [[1]])),
        made("cone", matrices([[1]])),
    ]
)


def test_unknowns_and_inequalities_are_named_after_their_block():
    assert [(u.name, u.symmetric) for u in ALL_KINDS.unknowns()] == [
        ("lambda1", False),
        ("lambda2a", False),
        ("lambda2b", False),
        ("M3_11", True),
        ("M3_12", False),
        ("M3_22", True),
        ("M4_11", True),
        ("M4_12", False),
    ]
    values = {u.name: rational(np.ones(u.shape)) for u in ALL_KINDS.unknowns()}
    names = [i.name for i in ALL_KINDS.inequalities(values)]
    assert len(set(names)) == len(names) == 8


@examples(20)
@given(seed=st.integers(0, 10**6))
def test_the_three_readings_of_a_set_agree(seed):
    rng = np.random.default_rng(seed)
    points = [{u.name: rng.integers(-9, 9, u.shape) for u in ALL_KINDS.unknowns()} for _ in range(3)]
    stack = {name: np.stack([p[name] for p in points]).astype(float) for name in points[0]}
    doubles = in_floats(ALL_KINDS)
    for i, point in enumerate(points):
        exact = {name: rational(value) for name, value in point.items()}
        readings = (
            [*ALL_KINDS.matrix(exact), *(x.matrix for x in ALL_KINDS.inequalities(exact))],
            [*doubles.matrix(stack), *(x.matrix for x in doubles.inequalities(stack))],
        )
        for one, many in zip(*readings, strict=True):
            assert np.array_equal(one.astype(float), np.broadcast_to(many, (3, *one.shape))[i])


@pytest.mark.parametrize("position", range(3))
def test_a_free_l2_is_refused_where_a_block_has_more_than_one_scale(position):
    kinds = [
        (made("one-sided-lipschitz", exactly(1, 1, 0)), "lambda2a, lambda2b"),
        (made("jacobian", matrices([[-1, 0]], [[1, 1]]), 2, 1), "M2_11, M2_12, M2_22"),
        (made("cone", matrices([[1, 0]], [[0, 1]]), 2, 1), "M2_11, M2_12"),
    ]
    kind, unknowns = kinds[position]
    with pytest.raises(UsageError, match=f"the type of f2 has {unknowns}; a ball around it"):
        combine([made("sin", None), kind]).scaled_blocks()
    with pytest.raises(UsageError, match="one scale"):
        combine([made("sin", None), kind]).shifted()


@examples(30)
@given(seed=st.integers(0, 10**6))
def test_a_sector_is_the_ball_between_its_matrices(seed):
    rng = np.random.default_rng(seed)
    K1, K2 = (rational(rng.integers(-5, 5, (2, 3))) for _ in range(2))
    dq, df = rational(rng.integers(-9, 9, (3, 1))), rational(rng.integers(-9, 9, (2, 1)))
    d = np.vstack([dq, df])
    for pair in ((K1, K2), (K2, K1)):
        M = assembled(made("sector", pair, 3, 2), {"lambda1": rational([[2]])})
        assert (d.T @ M @ d == 2 * (df - K1 @ dq).T @ (K2 @ dq - df)).all()
    shifted = made("sector", (K1, K2), 3, 2).shifted().blocks[0]
    assert not shifted.M12.any()
    assert holds(Inequality("M11 >= 0", -shifted.M11))


@pytest.mark.parametrize(
    ("template", "data", "nq", "nf", "message"),
    [
        ("sector", matrices([[0, 1]], [[1]]), 1, 1, "K1 is 1 x 2, and q and f make it 1 x 1"),
        ("sector", matrices([[0]], [[1], [2]]), 1, 1, "K2 is 2 x 1"),
        ("cocoercive", fmpq(2), 2, 1, "f has 1 components and q has 2"),
        ("cocoercive", fmpq(0), 1, 1, "must be positive"),
        ("cocoercive", fmpq(-1), 1, 1, "must be positive"),
        ("ball", matrices([[1, 0]], [[1]]), 1, 1, "K is 1 x 2"),
        ("ball", matrices([[1]], [[1, 0]]), 1, 1, "W is 1 x 2, and q and f make it 1 x 1"),
        ("one-sided-lipschitz", exactly(1, 1, 1), 2, 1, "f has 1 components and q has 2"),
        ("one-sided-lipschitz", exactly(-2, 1, 0), 1, 1, "k <= -2 with k.2 <= 1 . 0 k"),
        ("one-sided-lipschitz", exactly(1, -1, 1), 1, 1, "no f satisfies both"),
        ("jacobian", [], 1, 1, "there is no matrix"),
        ("jacobian", matrices([[1]], [[1, 2]]), 1, 1, "matrix 2 is 1 x 2"),
        ("cone", [], 1, 1, "there is no matrix"),
        ("cone", matrices([[1]], [[1], [2]]), 1, 1, "matrix 2 is 2 x 1"),
    ],
)
def test_data_that_mean_nothing_are_an_error_in_one_line(template, data, nq, nf, message):
    with pytest.raises(UsageError, match=message) as raised:
        made(template, data, nq, nf)
    assert "\n" not in str(raised.value)


# Designs

SAME = {
    "pendulum": [
        ("lipschitz", fmpq(1)),
        ("slope", [exactly(-1, 1)]),
        ("ball", matrices([[0]], [[1]])),
        ("sector", matrices([[-1]], [[1]])),
        ("jacobian", matrices([[-1]], [[1]])),
        ("jacobian", matrices([[1]], [["0.3"]], [[-1]])),
    ],
    "noisy-output": [
        ("slope", [exactly("0.2", "1.5")]),
        ("ball", matrices([["0.85"]], [["0.65"]])),
        ("sector", matrices([["0.2"]], [["1.5"]])),
        ("jacobian", matrices([["0.2"]], [["1.5"]])),
    ],
    "corless2019-magnetic-bearing": [
        ("monotone", None),
        ("cone", matrices([[1]])),
        ("cone", matrices([["0.01"]], [[7]])),
    ],
}


@cache
def least_mu2(name, choice):
    """Of the plant and the bounds of a spec, with the type of its nonlinearity replaced; L2 is zero if free."""
    spec = shipped(name)
    gain = rational(np.zeros((1, len(spec.plant.C)))) if spec.observer.L2 is None else spec.observer.L2
    family = L2(spec.augmented, made(*SAME[name][choice]), spec.H, fmpq(1, 5), None, gain)
    answer = minimise(in_floats(family).least_gamma(spec.observer.bounds))
    assert answer.status is Status.OPTIMAL
    return answer.objective


@pytest.mark.parametrize(("name", "choice"), [(name, k) for name in SAME for k in range(1, len(SAME[name]))])
def test_types_that_say_the_same_of_a_scalar_function_reach_the_same_gamma(name, choice):
    assert least_mu2(name, choice) == pytest.approx(least_mu2(name, 0), rel=1e-4)


@pytest.mark.parametrize(
    ("name", "scalar", "row"),
    [
        ("corless2019-magnetic-bearing", ("monotone", None), ("cone", matrices([[1, -1]]))),
        ("noisy-output", ("slope", [exactly(0, 3)]), ("jacobian", matrices([[0, 0]], [[3, -3]]))),
    ],
)
def test_a_function_of_a_difference_is_designed_for_alike_in_one_argument_and_in_two(name, scalar, row):
    """The cone [1, -1] has no interior: M12 must be a multiple of [1; -1], which the engine finds by itself."""
    spec, rng = shipped(name), np.random.default_rng(0)
    p = spec.augmented
    gain, more, other = (rational(rng.integers(-3, 4, (1, n))) for n in (len(p.C), p.n, len(p.C)))
    gain = spec.observer.L2 if spec.observer.L2 is not None else gain
    one = L2(p, made(*scalar), spec.H, fmpq(1, 5), None, gain)
    pair = replace(
        p,
        Cq=np.vstack([p.Cq + more, more]),
        Dqf=np.vstack([p.Dqf, 0 * p.Dqf]),
        Dq=np.vstack([p.Dq, 0 * p.Dq]),
    )
    two = replace(one, plant=pair, multiplier=made(*row, nq=2), L2=np.vstack([gain + other, other]))
    first, second = (minimise(in_floats(family).least_gamma()) for family in (one, two))
    assert first.status is second.status is Status.OPTIMAL
    assert second.objective == pytest.approx(first.objective, rel=1e-4)


def test_a_rotation_of_unknown_speed_and_sense_costs_nothing():
    """x' = -x + s(t) J x + w, y = x1: P = p I is forced, and the unmeasured x2 gives mu2 = 1 / (1 - alpha)^2."""
    eye, zero = rational(np.eye(2)), rational(np.zeros((2, 2)))
    row = rational([[0, 0]])
    plant = Plant(-eye, eye, eye, eye, zero, zero, rational([[1, 0]]), row, row, ("x1", "x2"), ("w1", "w2"), ("y",))
    either = made("cone", matrices(ROTATION, np.transpose(ROTATION)), 2, 2)
    family = L2(plant, either, eye, fmpq(1, 5), None, rational(np.zeros((2, 1))))
    answer = minimise(in_floats(family).least_gamma())
    assert answer.status is Status.OPTIMAL
    assert answer.objective == pytest.approx(1 / 0.8**2, rel=1e-4)
    assert answer.values["P"] == pytest.approx(answer.values["P"][0, 0] * np.eye(2), abs=1e-4)


@pytest.mark.parametrize(
    ("name", "kind", "gamma"),
    [
        ("pendulum", ("jacobian", matrices([[-1]], [[1]])), 0.32224),
        ("pendulum", ("one-sided-lipschitz", exactly(1, 1, 0)), 0.32224),
        ("corless2019-magnetic-bearing", ("cone", matrices([[1]])), 0.015316),
    ],
)
def test_a_design_with_a_free_multiplier_is_certified_exactly(name, kind, gamma):
    spec = shipped(name)
    block = replace(spec.nonlinearities[0], multiplier=made(*kind))
    found = solve(replace(spec, nonlinearities=(block,)))
    assert found.status == "certified"
    assert (found.limit_bounded or found.limit)["gamma"] == pytest.approx(gamma, rel=1e-3)
