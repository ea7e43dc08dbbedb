"""Detectability and Condition 1 against closed forms, invariants and exact arithmetic."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest
from flint import fmpq, fmpq_mat
from hypothesis import given
from hypothesis import strategies as st
from support.sweep import examples

import obsdesign as od
from obsdesign.errors import UsageError
from obsdesign.lmi.formula import in_floats, rational
from obsdesign.model.disturbance import augment, double_integrator, integrator, sinusoid, stack, unknown
from obsdesign.model.edge import Edge
from obsdesign.model.pencil import System, invariant_zeros
from obsdesign.model.plant import Plant
from obsdesign.model.structure import accuracy, condition1, decay_limit, linear, modes, stiff_modes, undetectable
from obsdesign.nonlinearities.slope import slope

REST = Edge(0.0)
NO_NONLINEARITY = np.zeros((0, 0))


def plant(A, B, C, D, Bf=None, Cq=None, Dqf=None, Dq=None, Df=None):
    """Exact plant; what is missing is zero."""
    A, B, C, D = map(rational, (A, B, C, D))
    n, nw, ny = len(A), B.shape[1], len(C)
    Bf = rational(np.zeros((n, 0)) if Bf is None else Bf)
    Cq = rational(np.zeros((0, n)) if Cq is None else Cq)
    nf, nq = Bf.shape[1], len(Cq)

    def or_zero(matrix, *shape):
        return rational(np.zeros(shape) if matrix is None else matrix)

    return Plant(
        A=A,
        Bf=Bf,
        B=B,
        Cq=Cq,
        Dqf=or_zero(Dqf, nq, nf),
        Dq=or_zero(Dq, nq, nw),
        C=C,
        Df=or_zero(Df, ny, nf),
        D=D,
        states=names("x", n),
        exogenous=names("w", nw),
        outputs=names("y", ny),
    )


def names(letter, count):
    return tuple(f"{letter}{i + 1}" for i in range(count))


def augmented(p, model):
    return in_floats(augment(p, model, names("m", len(model.Am)), names("v", model.Bm.shape[1])))


BEARING = plant(
    A=[[0, 1, 0], [0, 0, 1], [0, 0, 0]],
    B=[[1, 0], [0, 0], [0, 1]],
    C=[[1, 0, 0], [0, 1, 0]],
    D=[["0.1", 0], [0, 0]],
    Bf=[[0], [1], [0]],
    Cq=[[0, 0, 1]],
)
TWO_INTEGRATORS = stack([integrator(), integrator()])


# modes


def test_a_constant_force_and_a_constant_sensor_bias_cannot_be_told_apart_from_the_position():
    # x' = w1, y = x + w2: a bias of y is a constant shift of x
    p = augmented(plant([[0]], [[1, 0]], [[1]], [[0, 1]]), TWO_INTEGRATORS)
    (mode,) = undetectable(p, NO_NONLINEARITY, REST)
    assert mode.eigenvalue == 0
    assert dict(mode.along) == pytest.approx({"x1": 0.5**0.5, "m2": -(0.5**0.5)})
    assert mode.sentence == "the mode lambda = 0 along x1 (0.71), m2 (-0.71) is not seen by any output"
    assert decay_limit(p, NO_NONLINEARITY) == 0


def test_the_bearing_sees_every_mode():
    p = augmented(BEARING, TWO_INTEGRATORS)
    assert undetectable(p, np.zeros((1, 1)), REST) == ()
    assert decay_limit(p, np.zeros((1, 1))) == inf


@pytest.mark.parametrize(("fast", "hidden"), [(-1e9, -0.5004), (-1e6, -0.5000005), (-1e12, -0.9)])
def test_rounding_of_a_fast_mode_does_not_put_a_hidden_one_in_the_way(fast, hidden):
    """Only what is surely slower than asked for is in the way, where rounding moves a mode by more than that."""
    p = in_floats(plant(np.diag([fast, hidden, -1.0]), np.zeros((3, 1)), np.array([[1.0, 0.0, 1.0]]), [[0]]))
    assert undetectable(p, NO_NONLINEARITY, Edge(0.5)) == ()
    assert len(undetectable(p, NO_NONLINEARITY, Edge(abs(fast)))) == 1


def test_a_slow_hidden_mode_of_a_stiff_plant_is_in_the_way():
    p = in_floats(plant(np.diag([-1e9, -0.4, -1.0]), np.zeros((3, 1)), np.array([[1.0, 0.0, 1.0]]), [[0]]))
    assert [m.eigenvalue for m in undetectable(p, NO_NONLINEARITY, Edge(0.5))] == pytest.approx([-0.4], rel=1e-3)


def test_a_stable_hidden_mode_limits_the_decay_to_its_own():
    A, C = np.diag([-0.3, -2.0, 1.0]), np.array([[0.0, 0.0, 1.0]])
    p = in_floats(plant(A, np.zeros((3, 1)), C, [[0]]))
    assert decay_limit(p, NO_NONLINEARITY) == pytest.approx(0.3, rel=1e-12)
    assert undetectable(p, NO_NONLINEARITY, REST) == ()
    assert [m.eigenvalue for m in undetectable(p, NO_NONLINEARITY, Edge(0.3))] == pytest.approx([-0.3])
    assert [m.eigenvalue for m in undetectable(p, NO_NONLINEARITY, Edge(5.0))] == pytest.approx([-0.3, -2.0])


def test_two_hidden_modes_with_one_eigenvalue_are_reported_along_their_own_states():
    found = modes(np.zeros((3, 3)), np.array([[1.0, 0, 0]]), names("x", 3))
    assert {m.along[0] for m in found} == {("x2", 1.0), ("x3", 1.0)}
    assert all(len(m.along) == 1 for m in found)


def test_a_hidden_oscillation_is_one_mode_with_its_conjugate():
    A = np.array([[0, 1, 0], [-4, 0, 0], [1, 0, -1.0]])
    (oscillation,) = modes(A[:2, :2], np.zeros((1, 2)), names("x", 2))
    assert oscillation.eigenvalue == pytest.approx(2j)
    v = np.array([dict(oscillation.along)[s] for s in names("x", 2)])
    assert A[:2, :2] @ v == pytest.approx(2j * v)
    assert np.linalg.norm(v) == pytest.approx(1)
    assert oscillation.sentence == "the mode lambda = 0 +- 2j along x2 (0.89), x1 (0.45) is not seen by any output"
    assert modes(A, np.array([[0, 0, 1.0]]), names("x", 3)) == ()


@pytest.mark.parametrize("size", [2, 3, 5, 7])
@pytest.mark.parametrize("eigenvalue", [0.0, -0.5, 2.0])
@pytest.mark.parametrize("seed", range(4))
def test_a_hidden_chain_is_one_eigenvalue_in_any_coordinates(size, eigenvalue, seed):
    rng = np.random.default_rng(seed)
    n = size + 2
    A = rng.normal(size=(n, n))
    A[:2, 2:] = 0
    A[2:, 2:] = np.diag(np.full(size - 1, 1.0), 1) + eigenvalue * np.eye(size)
    C = np.concatenate([rng.normal(size=2), np.zeros(size)])[None]
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    (mode,) = modes(Q @ A @ Q.T, C @ Q.T, names("x", n))
    assert mode.eigenvalue == pytest.approx(eigenvalue, abs=1e-10)
    v = np.array([dict(mode.along).get(s, 0) for s in names("x", n)])
    assert np.abs(v @ Q[:, 2]) == pytest.approx(1)  # the head of the chain


def test_a_hidden_chain_of_integrators_is_not_called_stable_by_rounding():
    rng = np.random.default_rng(1)
    for _ in range(20):
        Q = np.linalg.qr(rng.normal(size=(6, 6)))[0]
        A = Q @ np.diag(np.ones(5), 1) @ Q.T
        (mode,) = modes(A, np.zeros((1, 6)), names("x", 6), edge=REST)
        assert mode.eigenvalue == 0


def test_a_chain_seen_at_its_head_hides_nothing_and_at_its_tail_all_but_one():
    A = np.diag(np.ones(4), 1)
    assert modes(A, np.eye(5)[:1], names("x", 5)) == ()
    (mode,) = modes(A, np.eye(5)[4:], names("x", 5))
    assert mode.along == (("x1", 1.0),)


@pytest.mark.parametrize("unit", [1e-9, 1e-3, 1e6])
def test_detectability_does_not_depend_on_units(unit):
    # position in other units, time in other units
    A = np.array([[0, 1 / unit, 0], [0, -0.1, unit], [0, 0, 0]]) / unit
    assert modes(A, np.array([[unit, 0, 0]]), names("x", 3)) == ()
    (mode,) = modes(A, np.array([[0, unit, 0]]), names("x", 3))
    assert (mode.eigenvalue, mode.along) == (0, (("x1", 1.0),))


@examples(60)
@given(seed=st.integers(0, 10**6))
def test_modes_agree_with_exact_ranks(seed):
    rng = np.random.default_rng(seed)
    n, ny = rng.integers(1, 6), rng.integers(1, 3)
    A = rng.integers(-2, 3, (n, n)) * (rng.random((n, n)) < 0.5)
    C = rng.integers(-2, 3, (ny, n)) * (rng.random((ny, n)) < 0.4)
    krylov = [C]
    for _ in range(n - 1):
        krylov.append(krylov[-1] @ A)
    hidden = n - fmpq_mat(n * ny, n, [int(e) for e in np.vstack(krylov).ravel()]).rank()
    found = modes(A.astype(float), C.astype(float), names("x", n))
    assert bool(found) == bool(hidden)
    for mode in found:
        v = np.array([dict(mode.along).get(s, 0) for s in names("x", n)])
        assert np.allclose(A @ v, mode.eigenvalue * v, atol=1e-7)
        assert np.allclose(C @ v, 0, atol=1e-9)


# members of the class of f


def test_a_known_slope_moves_the_modes_of_the_plant():
    # x2' = -x2 + f(x2), slope in [2, 3]: the member f = 2 q makes it x2' = x2, and nothing sees x2
    p = in_floats(plant([[-1, 0], [0, -1]], np.zeros((2, 1)), [[1, 0]], [[0]], Bf=[[0], [1]], Cq=[[0, 1]]))
    assert undetectable(p, np.zeros((1, 1)), REST) == ()
    K = in_floats(slope([(fmpq(2), fmpq(3))], 1, 1).member)
    (mode,) = undetectable(p, K, REST)
    assert mode.eigenvalue == pytest.approx(1)
    assert decay_limit(p, K) == pytest.approx(-1)


@examples(30)
@given(seed=st.integers(0, 10**6))
def test_the_linear_plant_of_a_member_solves_the_loop(seed):
    rng = np.random.default_rng(seed)
    n, nf, nq, nw, ny = rng.integers(1, 5, 5)
    sizes = {"A": (n, n), "B": (n, nw), "C": (ny, n), "D": (ny, nw), "Bf": (n, nf), "Cq": (nq, n)}
    sizes |= {"Dqf": (nq, nf), "Dq": (nq, nw), "Df": (ny, nf)}
    p = in_floats(plant(**{k: rng.normal(size=s) for k, s in sizes.items()}))
    K = 0.3 * rng.normal(size=(nf, nq))
    x, w = rng.normal(size=n), rng.normal(size=nw)
    q = np.linalg.solve(np.eye(nq) - p.Dqf @ K, p.Cq @ x + p.Dq @ w)
    s = linear(p, K)
    assert s.A @ x + s.B @ w == pytest.approx(p.A @ x + p.Bf @ K @ q + p.B @ w, rel=1e-6, abs=1e-6)
    assert s.C @ x + s.D @ w == pytest.approx(p.C @ x + p.Df @ K @ q + p.D @ w, rel=1e-6, abs=1e-6)


def test_a_member_without_a_solution_of_the_loop_is_an_error_about_dqf():
    p = in_floats(plant([[0]], [[1]], [[1]], [[0]], Bf=[[1]], Cq=[[1]], Dqf=[["0.5"]]))
    with pytest.raises(UsageError, match=r"^Dqf: .* no unique solution"):
        undetectable(p, np.array([[2.0]]), REST)


# Condition 1 and Lemma 3


def test_condition_1_holds_for_the_bearing_at_the_eigenvalue_of_the_integrators():
    (test,) = condition1(in_floats(BEARING), in_floats(TWO_INTEGRATORS.Am), REST)
    assert test.holds
    assert test.sentence == "Condition 1 holds at lambda = 0: [A - lambda I, B; C, D] has rank 5 of 5"


def test_condition_1_fails_at_the_frequency_of_a_zero():
    # y = x2' - w hides nothing but a sinusoid at the zero of w -> y: (s^2 + 4) / (s + 1)^2
    p = plant([[0, 1], [-1, -2]], [[0], [1]], [[3, -2]], [[1]])
    assert invariant_zeros(in_floats(System(p.A, p.B, p.C, p.D))).values == pytest.approx((2j, -2j))
    (test,) = condition1(in_floats(p), in_floats(sinusoid(fmpq(2)).Am), REST)
    assert test.numbers["eigenvalue"] == pytest.approx([0, 2])
    assert not test.holds
    assert test.sentence == "Condition 1 fails at lambda = 0 + 2j: [A - lambda I, B; C, D] has rank 2 of 3"
    (mode,) = undetectable(augmented(p, sinusoid(fmpq(2))), NO_NONLINEARITY, REST)
    assert mode.eigenvalue == pytest.approx(2j)
    assert undetectable(augmented(p, sinusoid(fmpq(3))), NO_NONLINEARITY, REST) == ()


def test_condition_1_says_nothing_of_stable_or_absent_disturbance_models():
    p = in_floats(BEARING)
    assert condition1(p, np.array([[-1.0]]), REST) == ()
    assert condition1(p, in_floats(unknown().Am), REST) == ()


def test_condition_1_is_only_sufficient():
    # two disturbances, one output: it cannot hold, yet a constant and a sinusoid are told apart
    p = plant([[-1]], [[1, 1]], [[1]], [[0, 0]])
    model = stack([integrator(), sinusoid(fmpq(2))])
    assert not any(t.holds for t in condition1(in_floats(p), in_floats(model.Am), REST))
    assert undetectable(augmented(p, model), NO_NONLINEARITY, REST) == ()


def full_rank_at(value, *matrices):
    """Exact column rank test of [A - value I, ..; ..] with the first n rows those of A."""
    A, B, C, D = matrices
    n = len(A)
    M = np.block([[A - value * np.eye(n, dtype=int), B], [C, D]])
    return fmpq_mat(*M.shape, [int(e) for e in M.ravel()]).rank() == M.shape[1]


@examples(150)
@given(seed=st.integers(0, 10**6))
def test_lemma_3_detectable_pairs_and_condition_1_make_the_augmented_plant_detectable(seed):
    rng = np.random.default_rng(seed)
    n, nw, ny = rng.integers(1, 4), rng.integers(1, 3), rng.integers(1, 4)

    def draw(*shape):
        return rng.integers(-2, 3, shape) * (rng.random(shape) < 0.7)

    A, B, C, D = draw(n, n), draw(n, nw), draw(ny, n), draw(ny, nw)
    model = stack([[integrator(), double_integrator(), sinusoid(fmpq(1))][i] for i in rng.integers(0, 3, nw)])
    p = plant(A, B, C, D)
    exact = in_floats(p)
    tests = condition1(exact, in_floats(model.Am), REST)
    for t in tests:
        if t.numbers["eigenvalue"] == [0, 0]:
            assert t.holds == full_rank_at(0, A, B, C, D)
    if not modes(exact.A, exact.C, p.states, edge=REST) and all(t.holds for t in tests):
        assert undetectable(augmented(p, model), NO_NONLINEARITY, REST) == ()


def test_a_plant_is_read_as_it_is_and_not_changed():
    p = in_floats(BEARING)
    before = replace(p, A=p.A.copy(), C=p.C.copy())
    undetectable(p, np.zeros((1, 1)), REST)
    condition1(p, np.zeros((1, 1)), REST)
    assert np.array_equal(p.A, before.A)
    assert np.array_equal(p.C, before.C)


def test_the_bearing_has_its_zero_at_minus_ten_with_and_without_the_disturbance_model():
    p = in_floats(BEARING)
    for zeros in (
        invariant_zeros(linear(p, np.zeros((1, 1)))),
        invariant_zeros(linear(augmented(BEARING, TWO_INTEGRATORS), np.zeros((1, 1)))),
    ):
        assert zeros.values == pytest.approx((-10,))
        assert zeros.left_invertible
        assert zeros.sentence == "invariant zeros -10"


def test_a_zero_of_high_multiplicity_is_called_uncertain():
    """From a load at one end of twelve inertias to the angle of the other: -80 eleven times; doubles do not tell it."""
    n = 12
    K = 2 * np.eye(n) - np.diag(np.ones(n - 1), 1) - np.diag(np.ones(n - 1), -1)
    K[0, 0] = K[-1, -1] = 1
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-40 * K, -0.2 * np.eye(n) - 0.5 * K]])
    B, C = np.zeros((2 * n, 1)), np.zeros((1, 2 * n))
    B[-1], C[0, 0] = 1, 1
    assert "uncertain" in invariant_zeros(System(A, B, C, np.zeros((1, 1)))).sentence


# slopes without a bound


@pytest.mark.parametrize("slope", [0, 1, -2])
def test_a_load_beside_a_steep_friction_is_out_of_reach_whatever_the_slope_begins_with(slope):
    system = {"A": [[0, 1, 0], [0, -1, 1], [0, 0, 0]], "B": [[0, 0], [0, 0], [1, 0]], "C": [[1, 0, 0]], "D": [[0, 0.1]]}
    friction = {"Bf": [[0], [-1], [0]], "Cq": [[0, 1, 0]], "type": {"slope": [slope, inf]}}
    made = od.solve(od.Spec(system=system, nonlinearities=[friction], observer={"type": "l2", "alpha": 0.05, "L2": 0}))
    assert made.status == "infeasible"
    assert made.diagnosis["condition"] == "zero dynamics"
    assert made.diagnosis["mode"]["eigenvalue"] == [0, 0]


def test_for_steep_slopes_the_zero_dynamics_from_f_to_q_and_y_remain():
    # (47) of Chakrabarty et al. (2016): e1 = 0 and q = 0 leave x3' = -x3
    p = in_floats(
        plant([[0, -1, 0], [0, -1, -1], [0, 1, -1]], [[1], [0], [0]], [[1, 0, 0]], [[0]], [[0], [1], [0]], [[1, -1, 0]])
    )
    (mode,) = stiff_modes(p, np.array([0]), np.array([0]))
    assert (mode.eigenvalue, mode.along) == (-1, (("x3", 1),))
    assert stiff_modes(augmented(BEARING, TWO_INTEGRATORS), np.array([0]), np.array([0])) == ()


@examples(30)
@given(seed=st.integers(0, 10**6))
def test_no_gain_moves_a_mode_that_remains_for_steep_slopes(seed):
    rng = np.random.default_rng(seed)
    n, ny = 5, int(rng.integers(1, 3))
    p = in_floats(
        plant(
            rng.normal(size=(n, n)),
            np.zeros((n, 1)),
            np.zeros((ny, n)),
            np.zeros((ny, 1)),
            rng.normal(size=(n, 1)),
            np.zeros((1, n)),
        )
    )
    # y and q miss an eigenvector z of A
    z = np.linalg.qr(rng.normal(size=(n, 1)))[0][:, 0]
    seen = np.linalg.svd(z[None])[2][1:]
    value = rng.normal()
    A = p.A + np.outer(value * z - p.A @ z, z)
    p = replace(p, A=A, Cq=rng.normal(size=(1, n - 1)) @ seen, C=rng.normal(size=(ny, n - 1)) @ seen)
    found = [m.eigenvalue for m in stiff_modes(p, np.array([0]), np.array([0]))]
    assert min(abs(e - value) for e in found) < 1e-6
    K, L1, L2 = 1e7 * np.sign((p.Cq @ p.Bf).item() or 1.0), rng.normal(size=(n, ny)), rng.normal(size=(1, ny))
    poles = np.linalg.eigvals(A + L1 @ p.C - K * p.Bf @ (p.Cq + L2 @ p.C))
    assert min(abs(poles - value)) < 1e-5


# any accuracy


@examples(60)
@given(seed=st.integers(0, 10**6))
def test_without_d_the_ranks_of_lemma_4_are_those_of_exact_arithmetic(seed):
    rng = np.random.default_rng(seed)
    n, nw, ny = (int(k) for k in rng.integers((2, 1, 1), (5, 3, 4)))
    A, B, C = (rng.integers(-2, 3, shape) for shape in ((n, n), (n, nw), (ny, n)))
    p = in_floats(plant(A, B, C, np.zeros((ny, nw))))
    rank, zeros, *_ = accuracy(p, None, unknown())

    def exact(M):
        return fmpq_mat(*M.shape, [int(e) for e in M.ravel()]).rank()

    assert (rank.numbers["rank"], rank.numbers["needed"]) == (exact(C @ B), exact(B))
    for real, imag in zeros.numbers["zeros"]:
        pencil = System(*(M.astype(float) for M in (A, B, C)), np.zeros((ny, nw))).pencil(complex(real, imag))
        assert np.linalg.svd(pencil, compute_uv=False).min() < 1e-6


def test_a_check_of_a_stiff_plant_says_nothing_that_rounding_leaves_open():
    """Every mode is seen; beside the fast one doubles find one at zero that is not."""
    A = np.diag([-(10.0**k) for k in (13, -2, -1, 0, 1, 2, 3, 4)])
    spec = od.Spec(
        system={"A": A, "C": [[1] * 8], "B": [[1, 0]] * 8, "D": [[0, 0.1]]}, observer={"type": "l2", "alpha": 0.005}
    )
    assert all(finding.holds for finding in od.check(spec) if finding.decides)
