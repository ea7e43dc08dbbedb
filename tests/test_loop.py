"""The loop q = c + D f(q): one solution exactly where a closed form says so, in doubles and in rationals."""

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from support.functions import bounds, sat
from support.sweep import examples

from obsdesign.lmi.formula import in_floats, rational
from obsdesign.lmi.proof import holds, rounded
from obsdesign.lmi.solve import widest
from obsdesign.model.loop import contraction, proved, well_posed
from obsdesign.nonlinearities import TEMPLATES, Multiplier, combine
from obsdesign.nonlinearities.lipschitz import lipschitz
from obsdesign.nonlinearities.monotone import monotone
from obsdesign.nonlinearities.slope import slope


def polytope(*matrices):
    nf, nq = np.shape(matrices[0])
    return TEMPLATES["jacobian"]([rational(M) for M in matrices], nq, nf)


def cone(*matrices):
    nf, nq = np.shape(matrices[0])
    return TEMPLATES["cone"]([rational(M) for M in matrices], nq, nf)


def one_sided(rho, beta, phi, n=1):
    return TEMPLATES["one-sided-lipschitz"]((fmpq(rho), fmpq(beta), fmpq(phi)), n, n)


@pytest.mark.parametrize(
    ("multiplier", "D", "unique"),
    [
        (lipschitz(fmpq(2), 1, 1), [["0.49"]], True),
        (lipschitz(fmpq(2), 1, 1), [["-0.49"]], True),
        (lipschitz(fmpq(2), 1, 1), [["0.5"]], False),
        (lipschitz(fmpq(1), 2, 2), [["0.6", "0.6"], ["-0.6", "0.6"]], True),
        (lipschitz(fmpq(1), 2, 2), [["0.8", "0.8"], ["-0.8", "0.8"]], False),
        (monotone(None, 2, 2), [[-1, 5], [-5, -1]], True),
        (monotone(None, 2, 2), [[-1, 5], [5, -1]], False),
        (monotone(None, 1, 1), [[0]], True),
        (slope(bounds((0, 1)), 1, 1), [[-1000]], True),
        (slope(bounds((0, 1)), 1, 1), [["0.99"]], True),
        (slope(bounds((0, 1)), 1, 1), [["1.01"]], False),
        (slope(bounds((2, 3)), 1, 1), [["0.49"]], False),
        (slope(bounds((2, 3)), 1, 1), [["0.51"]], True),
        (polytope([[0]], [[1]]), [[-1000]], True),
        (polytope([[0]], [[1]]), [["0.99"]], True),
        (polytope([[0]], [[1]]), [["1.01"]], False),
        (polytope([[2]], [[3]]), [["0.51"]], True),
        (polytope([[-1, 1]], [[1, -1]]), [["0.9"], ["-0.09"]], True),
        (polytope([[-1, 1]], [[1, -1]]), [["0.9"], ["-0.11"]], False),
        (cone([[1]]), [["-0.01"]], True),
        (cone([[1]]), [["0.01"]], False),
        (cone([[1, -1]]), [[1], [2]], True),
        (cone([[1, -1]]), [[2], [1]], False),
        (one_sided(1, 1, 0), [["0.99"]], True),
        (one_sided(1, 1, 0), [["-1.01"]], False),
        (one_sided(-1, 25, 0), [["1"]], True),
        (one_sided(-1, 25, 0), [["-0.25"]], False),
    ],
)
def test_one_block_is_well_posed_exactly_where_its_closed_form_says_so(multiplier, D, unique):
    assert well_posed(rational(D), multiplier).unique is unique


@pytest.mark.parametrize(("gain", "unique"), [("0.99", True), ("1.01", False)])
def test_two_lipschitz_blocks_in_a_ring_are_well_posed_up_to_a_loop_gain_of_one(gain, unique):
    # equal scales fail by far: the cutting planes must find a ratio between 1e2 and 1e4
    ring = combine([lipschitz(fmpq(1), 1, 1), lipschitz(fmpq(1), 1, 1)])
    D = rational([[0, 100], [0, 0]])
    D[1, 0] = rational([gain]).item() / 100
    verdict = well_posed(D, ring)
    assert verdict.unique is unique
    assert "f1, f2" in verdict.sentence


@examples(25)
@given(seed=st.integers(0, 10**6), k=st.integers(2, 5))
def test_scales_are_found_for_rings_of_lipschitz_blocks_exactly_when_the_spectral_radius_is_below_one(seed, k):
    rng = np.random.default_rng(seed)
    D = np.where(rng.random((k, k)) < 0.7, rng.uniform(0, 1, (k, k)), 0.0)
    D *= rng.choice([0.9, 1.1]) / max(abs(np.linalg.eigvals(D)).max(), 1e-3)
    radius = abs(np.linalg.eigvals(D)).max()
    if 0.5 < radius < 1.5:  # a nonnegative D: diagonal scaling reaches the spectral radius
        blocks = combine([lipschitz(fmpq(1), 1, 1)] * k)
        assert well_posed(rational(D), blocks).unique is bool(radius < 1)


def test_a_loop_without_feedback_is_solved_block_by_block_however_large_its_gains():
    blocks = combine([monotone(None, 1, 1), lipschitz(fmpq(1), 2, 1), monotone(None, 1, 1)])
    D = rational(np.zeros((4, 3)))
    D[0, 1], D[1, 2], D[2, 2] = fmpq(100), fmpq(-7), fmpq(30)  # f3 -> q2 -> f2 -> q1
    verdict = well_posed(D, blocks)
    assert verdict.unique
    assert "block by block" in verdict.sentence


def test_a_feedback_in_one_block_decides_although_the_others_are_only_fed_forward():
    blocks = combine([monotone(None, 1, 1), lipschitz(fmpq(1), 1, 1)])
    assert well_posed(rational([[0, 100], [0, "0.9"]]), blocks).unique
    refused = well_posed(rational([[0, 100], [0, "1.1"]]), blocks)
    assert not refused.unique
    assert "f2 " in refused.sentence
    assert "f1" not in refused.sentence


def test_a_plant_without_nonlinearities_is_well_posed():
    assert well_posed(rational(np.zeros((0, 0))), Multiplier(())).unique


def test_the_solution_of_a_well_posed_loop_is_found_and_is_the_only_one():
    D, c = -3.0, 1.7
    assert well_posed(rational([[-3]]), slope(bounds((0, 1)), 1, 1)).unique
    q = np.linspace(-10, 10, 200001)
    assert (np.diff(np.sign(q - c - D * sat(q))) != 0).sum() == 1
    assert not well_posed(rational([[3]]), slope(bounds((0, 1)), 1, 1)).unique
    assert (np.diff(np.sign(q - 0.05 - 3 * sat(q))) != 0).sum() == 3


POLYTOPE = [[[a, 0], [b, b]] for a in (-1, 1) for b in (0, 2)]
MIXED = combine([polytope(*POLYTOPE), cone([[1, -1]]), one_sided(0, 4, 0), slope(bounds((0, 1)), 1, 1)])


@examples(25)
@given(seed=st.integers(0, 10**6), size=st.sampled_from([0.05, 0.2, 0.5]))
def test_a_verdict_for_blocks_of_all_kinds_is_sound_and_its_multiplier_is_proved_in_rationals(seed, size):
    rng = np.random.default_rng(seed)
    D = rational(rng.normal(0, size, (6, 5)).round(3))
    D[2, 2], D[3, 2] = D[2, 2] - 1, D[3, 2] + 1  # the cone needs damping in its own loop
    if not well_posed(D, MIXED).unique:
        return
    values = rounded(widest(contraction(in_floats(D), in_floats(MIXED))).values, 12)
    values["M2_12"][1] = -values["M2_12"][0]  # an equality of the cone [1, -1]
    assert all(holds(i) for i in MIXED.inequalities(values))
    assert proved(D, MIXED, values).unique
    assert not proved(D, MIXED, {name: -value for name, value in values.items()}).unique
    for _ in range(50):
        weights = rng.dirichlet(np.ones(4))
        K = np.zeros((5, 6))
        K[:2, :2] = np.tensordot(weights, np.array(POLYTOPE, dtype=float), axes=1)
        K[2, 2:4] = rng.exponential(3) * np.array([1, -1])
        K[3, 4], K[4, 5] = rng.uniform(-2, 0), rng.uniform(0, 1)
        assert np.linalg.det(np.eye(6) - in_floats(D) @ K) > 0


def test_a_multiplier_that_proves_one_group_does_not_prove_another():
    blocks = combine([slope(bounds((0, 1)), 1, 1), polytope([[0]], [[1]])])
    D = rational([["0.5", 0], [0, "0.5"]])
    good = {"lambda1": [[1]], "M2_11": [[0]], "M2_12": [[1]], "M2_22": [[-2]]}
    assert proved(D, blocks, {name: rational(value) for name, value in good.items()}).unique
    verdict = proved(D, blocks, {name: rational(value) for name, value in (good | {"M2_22": [[0]]}).items()})
    assert not verdict.unique
    assert "f2 " in verdict.sentence
