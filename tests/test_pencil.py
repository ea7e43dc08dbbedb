"""Invariant zeros and multiple eigenvalues against closed forms and invariants."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.sweep import examples

from obsdesign.model.pencil import System, invariant_zeros, spectrum


def system(A, B, C, D):
    return System(*(np.array(X, dtype=float) for X in (A, B, C, D)))


KNOWN = {
    "(s + 2) / (s + 1)": (([[-1]], [[1]], [[1]], [[1]]), (-2,), 1),
    "(s - 3) / (s^2 + 3 s + 2)": (([[0, 1], [-2, -3]], [[0], [1]], [[-3, 1]], [[0]]), (3,), 1),
    "1 / s^3": ((np.diag([1, 1], 1), np.eye(3)[:, 2:], np.eye(3)[:1], [[0]]), (), 1),
    "s / (s + 1), twice": ((-np.eye(2), np.eye(2), -np.eye(2), np.eye(2)), (0, 0), 2),
    "tall, one zero in common": (([[0, 1], [0, 0]], [[0], [1]], [[5, 1], [10, 2]], [[0], [0]]), (-5,), 1),
    "tall, no zero in common": (([[0, 1], [0, 0]], [[0], [1]], [[5, 1], [4, 1]], [[0], [0]]), (), 1),
    "wide, one zero in common": (([[0, 0], [1, 0]], [[5, 10], [1, 2]], [[0, 1]], [[0, 0]]), (-5,), 1),
    "wide, none": (([[0, 0], [1, 0]], [[5, 4], [1, 1]], [[0, 1]], [[0, 0]]), (), 1),
    "two inputs that act alike": (([[-1]], [[1, 1]], [[1]], [[0, 0]]), (), 1),
    "no transfer at all": (([[-1, 0], [0, -4]], [[1], [0]], [[0, 1]], [[0]]), (), 0),
    "no input": ((np.diag([1, -2]), np.zeros((2, 0)), [[1, 0]], np.zeros((1, 0))), (-2,), 0),
    "no output": (([[-3]], [[0]], np.zeros((0, 1)), np.zeros((0, 1))), (-3,), 0),
    "a gain": ((np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((3, 0)), [[1, 0], [0, 1], [1, 1]]), (), 2),
}


@pytest.mark.parametrize("name", KNOWN)
def test_the_zeros_of_a_known_system(name):
    matrices, values, rank = KNOWN[name]
    zeros = invariant_zeros(system(*matrices))
    assert zeros.values == pytest.approx(values, abs=1e-9)
    assert zeros.normal_rank == rank
    assert zeros.left_invertible == (rank == zeros.inputs)


def test_an_input_that_no_output_determines_is_named():
    zeros = invariant_zeros(system([[-1]], [[1, 1]], [[1]], [[0, 0]]))
    assert zeros.sentence == "no invariant zeros; not left invertible: normal rank 1 with 2 inputs"


@examples(60)
@given(seed=st.integers(0, 10**6), zeros=st.lists(st.integers(-4, 4), min_size=1, max_size=3))
def test_the_zeros_of_a_transfer_function_are_found_with_their_multiplicities(seed, zeros):
    numerator = np.poly(zeros)
    n = len(zeros) + np.random.default_rng(seed).integers(0, 3)
    A = np.diag(np.ones(n - 1), 1)
    A[-1] = -np.poly(-1.0 - np.arange(n))[:0:-1]
    padded = np.concatenate([np.zeros(n + 1 - len(numerator)), numerator])  # descending powers s^n .. 1
    C = padded[:0:-1] + padded[0] * A[-1]
    found = invariant_zeros(System(A, np.eye(n)[:, -1:], C[None], padded[:1, None]))
    assert found.values == pytest.approx(sorted(zeros, reverse=True), abs=1e-6)


@examples(60)
@given(seed=st.integers(0, 10**6))
def test_zeros_and_normal_rank_do_not_change_with_coordinates_injection_feedback_and_units(seed):
    rng = np.random.default_rng(seed)
    n, m, p = rng.integers(2, 6), rng.integers(1, 4), rng.integers(1, 4)
    A, B, C = rng.normal(size=(n, n)), rng.normal(size=(n, m)), rng.normal(size=(p, n))
    D = rng.normal(size=(p, m)) * (rng.random() < 0.5)
    C[:, 0] = 0
    A[1:, 0] = 0  # x1 is hidden: its eigenvalue is a zero if the system is left invertible
    before = invariant_zeros(System(A, B, C, D))
    T, L, K = np.linalg.qr(rng.normal(size=(n, n)))[0], rng.normal(size=(n, p)), rng.normal(size=(m, n))
    A2, B2 = A + L @ C, B + L @ D
    A2, C2 = A2 + B2 @ K, C + D @ K
    units_y, units_w = 10.0 ** rng.integers(-3, 4, (p, 1)), 10.0 ** rng.integers(-3, 4, m)
    after = invariant_zeros(System(T @ A2 @ T.T, T @ B2 * units_w, units_y * (C2 @ T.T), units_y * D * units_w))
    assert after.normal_rank == before.normal_rank
    assert after.values == pytest.approx(before.values, rel=1e-5, abs=1e-5)
    if before.left_invertible:
        assert any(abs(z - A[0, 0]) < 1e-6 for z in before.values)


@examples(40)
@given(seed=st.integers(0, 10**6))
def test_the_pencil_loses_rank_at_every_zero_and_nowhere_else(seed):
    rng = np.random.default_rng(seed)
    n, m = rng.integers(2, 6), rng.integers(1, 3)
    s = System(rng.normal(size=(n, n)), rng.normal(size=(n, m)), rng.normal(size=(m, n)), rng.normal(size=(m, m)))
    for zero in invariant_zeros(s).values:
        assert np.linalg.svd(s.pencil(zero), compute_uv=False)[-1] < 1e-7
        assert np.linalg.svd(s.pencil(zero + 0.5j + 0.3), compute_uv=False)[-1] > 1e-7


# multiple eigenvalues


@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6])
def test_close_eigenvalues_that_are_well_conditioned_stay_apart(gap):
    Q = np.linalg.qr(np.random.default_rng(0).normal(size=(4, 4)))[0]
    found = spectrum(Q @ np.diag([-gap, 0.0, gap, 1.0]) @ Q.T, 1.0)
    assert sorted(v.real for v, _ in found) == pytest.approx([-gap, 0, gap, 1], abs=1e-12)


def test_two_defective_eigenvalues_that_are_far_apart_are_two():
    S = np.array([[0.0, 2, 0, 0], [0, 0, 0, 0], [0, 0, -2, -1], [0, 0, 1, 0]])
    found = dict(spectrum(S, np.linalg.norm(S)))
    assert found[0] == 2
    assert sorted(v.real for v in found) == pytest.approx([-1, 0], abs=1e-9)


def test_multiplicities_add_up_and_a_defective_pair_is_complex():
    block = np.array([[0.0, 2.0], [-2.0, 0.0]])
    S = np.block([[block, np.eye(2)], [np.zeros((2, 2)), block]])
    Q = np.linalg.qr(np.random.default_rng(3).normal(size=(4, 4)))[0]
    found = sorted(spectrum(Q @ S @ Q.T, 1.0), key=lambda pair: pair[0].imag)
    assert [v for v, _ in found] == pytest.approx([-2j, 2j])
    assert [k for _, k in found] == [2, 2]
