"""The engine: formula vocabulary, probe, reduction, solver, and the proof in rationals."""

from dataclasses import replace

import numpy as np
import pytest
from flint import fmpq, fmpz_mat
from hypothesis import given
from hypothesis import strategies as st
from support.sweep import examples

from obsdesign.errors import UsageError
from obsdesign.lmi import dominance
from obsdesign.lmi.formula import (
    Inequality,
    Injection,
    NextState,
    Problem,
    Unknown,
    block_diagonal,
    he,
    identity,
    in_floats,
    product,
    rational,
    rational_number,
    symmetric,
)
from obsdesign.lmi.probe import Block, Program, coordinates, matrices, probe
from obsdesign.lmi.proof import complete, holds, margin, pivots, prove, refuted, rounded
from obsdesign.lmi.reduce import balance, dense, diagonal, null_space, reduce, zero_diagonals
from obsdesign.lmi.solve import MARGIN, Status, minimise, widest
from obsdesign.lmi.spectrum import extremes, lower, upper

TINY = fmpq(1, 10**30)
SEEDS = st.integers(0, 2**32 - 1)
SIZES = st.integers(1, 5)


def integers(rng, *shape, high=4):
    return rng.integers(-high, high + 1, shape)


# Formula


@given(SIZES, SIZES, st.booleans(), SEEDS)
@examples(40)
def test_unpack_is_the_inverse_of_pack_in_floats_stacks_and_rationals(n, m, square, seed):
    unknown = Unknown("X", (n, n) if square else (n, m), symmetric=square)
    x = integers(np.random.default_rng(seed), 3, unknown.size)
    stack, exact = unknown.unpack(x.astype(float)), unknown.unpack(rational(x))
    assert stack.shape == (3, *unknown.shape)
    assert (stack == exact.astype(float)).all()
    assert (unknown.pack(stack) == x).all()
    assert (unknown.pack(exact) == rational(x)).all()
    assert all(isinstance(entry, fmpq) for entry in exact.ravel())
    assert (unknown.unpack(x[0].astype(float)) == stack[0]).all()
    if square:
        assert (stack == stack.mT).all()


@given(st.lists(st.integers(0, 3), min_size=1, max_size=4), SEEDS)
@examples(40)
def test_block_matrices_agree_in_floats_stacks_and_rationals(sizes, seed):
    rng = np.random.default_rng(seed)
    upper = [[integers(rng, 2, a, b) for b in sizes[i:]] for i, a in enumerate(sizes)]
    for i, row in enumerate(upper):
        row[0] = row[0] + row[0].mT
        upper[i] = [0 if j and rng.random() < 0.3 else block for j, block in enumerate(row)]
    read = {
        "stack": lambda b: b.astype(float),
        "float": lambda b: b[1].astype(float),
        "rational": lambda b: rational(b[1]),
    }
    made = {k: symmetric([[0 if np.ndim(b) == 0 else r(b) for b in row] for row in upper]) for k, r in read.items()}
    edges = np.cumsum([0, *sizes])
    assert (made["stack"] == made["stack"].mT).all()
    assert (made["stack"][1] == made["float"]).all()
    assert (made["rational"].astype(float) == made["float"]).all()
    for i, row in enumerate(upper):
        for j, block in enumerate(row, start=i):
            found = made["stack"][:, edges[i] : edges[i + 1], edges[j] : edges[j + 1]]
            assert (found == block).all()
    blocks = [row[-1] for row in upper if np.ndim(row[-1])]
    diagonal = {k: block_diagonal([r(b) for b in blocks]) for k, r in read.items()}
    assert (diagonal["stack"][1] == diagonal["float"]).all()
    assert (diagonal["rational"].astype(float) == diagonal["float"]).all()
    assert diagonal["float"].shape == (sum(b.shape[1] for b in blocks), sum(b.shape[2] for b in blocks))
    assert diagonal["float"].sum() == sum(b[1].sum() for b in blocks)


def test_a_mixture_of_stacked_and_single_blocks_is_a_stack():
    matrix = symmetric([[np.ones((5, 2, 2)), np.zeros((2, 1))], [-np.ones((1, 1))]])
    assert matrix.shape == (5, 3, 3)
    assert (matrix[:, 2, 2] == -1).all()


def test_decimals_are_read_as_written_and_doubles_as_their_binary_value():
    assert rational_number("0.1") == fmpq(1, 10)
    assert rational_number("1/3") == fmpq(1, 3)
    assert rational_number(0.1) == fmpq(3602879701896397, 36028797018963968)
    assert (in_floats(rational([["0.1", 2]])) == [[0.1, 2.0]]).all()


# Probe


@given(SEEDS)
@examples(20)
def test_the_probe_of_an_affine_formula_reproduces_it(seed):
    rng = np.random.default_rng(seed)
    A, B, C = (rng.standard_normal(s) for s in ((3, 3), (3, 2), (2, 3)))

    def lyapunov(v):
        return [
            Inequality("decay", he(v["P"] @ A + B @ v["Y"] @ C) + v["s"] * np.eye(3)),
            Inequality("P > 0", np.eye(3) - v["P"], strict=True),
        ]

    unknowns = (Unknown("P", (3, 3), symmetric=True), Unknown("Y", (2, 2)), Unknown("s", (1, 1)))
    program = probe(Problem(unknowns, lyapunov, lambda v: 3 * v["s"] + 2))
    x = rng.standard_normal(11)
    point = matrices(unknowns, x)
    assert (coordinates(unknowns, point) == x).all()
    for block, inequality in zip(program.blocks, lyapunov(point), strict=True):
        assert block.at(x) == pytest.approx(inequality.matrix, abs=1e-12)
        assert (block.name, block.strict) == (inequality.name, inequality.strict)
    assert (program.constant, program.cost[-1]) == (2, 3)


@pytest.mark.parametrize(
    "formula", [lambda X: X @ X.mT, lambda X: abs(X) + abs(X.mT), lambda X: he(X) / (1 + X[..., :1, :1] ** 2)]
)
def test_a_formula_that_is_not_affine_is_refused(formula):
    problem = Problem((Unknown("X", (2, 2)),), lambda v: [Inequality("wrong", formula(v["X"]))])
    with pytest.raises(ArithmeticError, match="'wrong' is not affine"):
        probe(problem)


# Reduction


def passive(output, strict=True):
    """P A + A'P <= 0, P b = -c for the double integrator with damping: the positive real lemma without feedthrough."""
    A, b = np.array([[0.0, 1.0], [-1.0, -1.0]]), np.array([[0.0], [1.0]])
    c = np.array(output, dtype=float)[:, None]
    return Problem(
        (Unknown("P", (2, 2), symmetric=True),),
        lambda v: [
            Inequality("passive", symmetric([[he(v["P"] @ A), v["P"] @ b - c], [np.zeros((1, 1))]])),
            Inequality("P > 0", -v["P"], strict=strict),
        ],
    )


def test_a_zero_on_the_diagonal_becomes_equalities():
    reduced = reduce(passive([0.5, 1]))
    assert reduced.rows == (("passive", 2),)
    assert len(reduced.pivots) == 2
    assert [b.order for b in reduced.program.blocks] == [2, 2]
    point = matrices((Unknown("P", (2, 2), symmetric=True),), reduced.point(np.array([7.0])))
    assert point["P"] == pytest.approx(np.array([[7, 0.5], [0.5, 1]]))


def test_equalities_that_contradict_each_other_are_a_contradiction():
    b = np.array([[0.0], [1.0]])
    reduced = reduce(
        Problem(
            (Unknown("x", (1, 1)),),
            lambda v: [
                Inequality(
                    "tied",
                    symmetric([[-np.eye(2), (v["x"] - 1) * b, (v["x"] - 2) * b], [0 * v["x"], 0], [0 * v["x"]]]),
                )
            ],
        )
    )
    assert "contradict" in reduced.contradiction


def test_a_strict_inequality_with_a_zero_on_the_diagonal_is_a_contradiction():
    assert "P > 0" in reduce(passive([1, 0])).contradiction
    assert minimise(passive([1, 0])).status is Status.INFEASIBLE


@pytest.mark.parametrize(
    ("output", "feasible"), [((0.5, 1), True), ((0, 1), True), ((2, 1), False), ((0.5, -1), False)]
)
def test_the_positive_real_lemma_decides_passivity(output, feasible):
    """(c1 s + c0) / (s^2 + s + 1) is positive real iff 0 <= c0 <= c1; for c0 = 0 two rows vanish in turn."""
    wide = widest(passive(output))
    assert (wide.status is Status.OPTIMAL) == feasible
    assert (wide.objective > MARGIN) == feasible


def spread(kappa):
    """A block whose entries span kappa^2, as the bound |L1| <= kappa gives."""
    terms = [np.zeros((2, 2)), [[-1, 0], [0, 0]], [[0, -1], [-1, 0]], [[0, 0], [0, -(kappa**2)]]]
    return Block("gain", np.array(terms, dtype=float), strict=False)


@pytest.mark.parametrize("kappa", [1.0, 1e3, 1e7])
def test_entries_spread_over_many_decades_are_not_mistaken_for_zeros(kappa):
    assert not zero_diagonals([spread(kappa)])[0].any()


def test_a_rounded_zero_on_the_diagonal_counts_as_zero():
    block = spread(1.0)
    noisy = replace(block, terms=block.terms * np.array([[1e-15, 1], [1, 1]]))
    assert [zero.tolist() for zero in zero_diagonals([block, noisy])] == [[False, False], [True, False]]


@given(SEEDS)
@examples(20)
def test_scaling_by_powers_of_two_is_undone_without_rounding(seed):
    rng = np.random.default_rng(seed)
    sizes = 10.0 ** rng.uniform(-4, 4, 3)

    def formula(v):
        return [Inequality("F", sizes[:, None] * (v["X"] - np.eye(3)) * sizes)]

    program = probe(
        Problem(
            (Unknown("X", (3, 3), symmetric=True),),
            formula,
            lambda v: np.trace(v["X"], axis1=-2, axis2=-1)[..., None, None],
        )
    )
    z = rng.standard_normal(6)
    for scaled, T in (balance(program), diagonal(program, z)):
        factors = np.diag(T)
        assert (np.diag(factors) == T).all()
        assert (np.exp2(np.round(np.log2(factors))) == factors).all()
        assert scaled.cost @ (z / factors) == pytest.approx(program.cost @ z, rel=1e-12)
        rows = np.sqrt(np.diag(scaled.blocks[0].at(z / factors)) / np.diag(program.blocks[0].at(z)))
        assert scaled.blocks[0].at(z / factors) == pytest.approx(program.blocks[0].at(z) * np.outer(rows, rows))


def test_a_dense_scaling_takes_a_point_to_the_identity_in_any_coordinates():
    rng = np.random.default_rng(3)
    terms = rng.standard_normal((7, 4, 4))
    terms += terms.transpose(0, 2, 1)
    z = rng.standard_normal(6)
    terms[0] -= Block("F", terms, False).at(z) + np.diag([1e-3, 1.0, 1e2, 1e4])
    change = rng.standard_normal((4, 4))
    for N in (np.eye(4), change):
        program = Program(np.ones(6), 0.0, (Block("F", terms, False).congruent(N),))
        scaled, T = dense(program, z)
        y = np.linalg.solve(T, z)
        assert scaled.cost @ y == pytest.approx(program.cost @ z, rel=1e-9)
        values = np.linalg.eigvalsh(-scaled.blocks[0].at(y))
        assert values.max() == pytest.approx(1, rel=1e-6)
        assert np.linalg.norm(y) < 10


def test_the_null_space_is_orthonormal_and_complete():
    rng = np.random.default_rng(1)
    factor = rng.standard_normal((4, 2)) @ rng.standard_normal((2, 6))
    N = null_space(factor)
    assert N.shape == (6, 4)
    assert np.allclose(N.T @ N, np.eye(4))
    assert factor @ N == pytest.approx(np.zeros((4, 4)), abs=1e-12)
    assert null_space(np.zeros((0, 3))).shape == (3, 3)


# Solver


def h_infinity(A, C, project):
    """Least mu2 of the observer e' = (A + L C) e - v, z = e, with Y = P L projected out or not."""
    n, ny = len(A), len(C)
    right = np.hstack([C, np.zeros((ny, n))])

    def formula(v):
        top = he(v["P"] @ A + v["Y"] @ C) + np.eye(n)
        corner = -v["mu2"] * np.eye(n)
        return [
            Inequality("bounded real", symmetric([[top, -v["P"]], [corner]])),
            Inequality("P > 0", -v["P"], strict=True),
        ]

    return Problem(
        (Unknown("P", (n, n), symmetric=True), Unknown("Y", (n, ny)), Unknown("mu2", (1, 1))),
        formula,
        lambda v: v["mu2"],
        Injection("Y", np.eye(2 * n, n), right) if project else None,
    )


@pytest.mark.parametrize(("a", "least"), [(-2.0, 1 / 13), (2.0, 1 / 9)])
def test_a_known_least_gain_with_and_without_projection(a, least):
    """With x1 measured the least mu2 is 1 / (3^2 + a^2), or 1 / 3^2 for a > 0, which is not attained."""
    A, C = np.array([[1.0, 3.0], [0.0, a]]), np.array([[1.0, 0.0]])
    projected, full = (minimise(h_infinity(A, C, project=p)) for p in (True, False))
    assert projected.status is Status.OPTIMAL
    assert projected.objective == pytest.approx(least, rel=1e-5)
    assert full.objective == pytest.approx(least, rel=1e-3)
    assert not projected.values["Y"].any()


def of_samples(A, C, D, form):
    """Least mu of the observer e+ = (A + L C) e + (v, 0) + L D v with |z|^2 <= mu |v|^2, z = e, |L| < 2 by a P >= I."""
    n, (ny, nv) = len(A), D.shape
    B, size = np.eye(n, nv), n + nv
    direct, output = np.hstack([A, B]), np.hstack([C, D])

    def formula(v):
        P, Y = v["P"], v["Y"]
        S = symmetric([[np.eye(n) - P, np.zeros((n, nv))], [-v["mu"] * np.eye(nv)]])
        return [
            Inequality("V+ - V", symmetric([[S, (P @ direct + Y @ output).mT], [-P]])),
            Inequality("P > 0", -P, strict=True),
            Inequality("gain", -symmetric([[P, Y], [4 * np.eye(ny)]])),
        ]

    unknowns = Unknown("P", (n, n), symmetric=True), Unknown("Y", (n, ny)), Unknown("mu", (1, 1))
    state = {"taken out": NextState(direct, output, "P > 0", slow=True)}
    state["wrong"] = replace(state["taken out"], output=np.eye(ny, size))
    return Problem(unknowns, formula, lambda v: v["mu"], next_state=state.get(form))


SHOWN = [
    ([[1, 0, 0, 0, 0.2]], [[0, 0.1]]),
    ([[1, 0, 0, 0, 0.2], [0, 1, 0, 0.1, 0]], [[0, 0.1], [0.1, 0]]),
    ([[1, 0, 0, 0, 0.2], [2, 0, 0, 0, 0.4]], [[0, 0.1], [0, 0.2]]),
    ([[0, 0, 0, 0, 0]], [[0, 0]]),
]


@pytest.mark.parametrize(("C", "D"), SHOWN, ids=["one output", "two", "the same twice", "none"])
def test_an_inequality_without_the_rows_of_the_next_state_has_the_same_optimum(C, D):
    A = 0.9 * np.eye(5) + np.diag([0.3] * 4, 1)[:5, :5] - 0.2 * np.eye(5, k=-1)
    with_rows, without = (of_samples(A, np.array(C), np.array(D), form) for form in ("as written", "taken out"))
    known, found = minimise(with_rows), minimise(without)
    assert known.status is found.status is Status.OPTIMAL
    assert found.objective == pytest.approx(known.objective, rel=1e-6)
    again = minimise(without, start=known.values)
    assert (again.solves, again.objective) == (1, pytest.approx(known.objective, rel=1e-6))
    values = {**found.values, "mu": found.values["mu"] * (1 + 1e-4)}
    assert np.linalg.eigvalsh(with_rows.inequalities(values)[0].matrix)[-1] < 1e-6 * np.abs(values["P"]).max()
    assert max(b.order for b in reduce(without).program.blocks) < max(b.order for b in reduce(with_rows).program.blocks)


def test_rows_of_a_next_state_that_are_others_are_a_defect():
    A, C, D = np.diag([0.5, 0.8]), np.array([[1.0, 1.0]]), np.array([[0.0, 0.1]])
    with pytest.raises(ArithmeticError, match="'V\\+ - V' has other rows of the next state"):
        minimise(of_samples(A, C, D, "wrong"))


def test_an_unobservable_unstable_mode_is_infeasible():
    A, C = np.diag([1.0, 2.0]), np.array([[1.0, 0.0]])
    assert [minimise(h_infinity(A, C, project=p)).status for p in (True, False)] == [Status.INFEASIBLE] * 2


def test_the_widest_margin_is_normalised_and_inside():
    problem = Problem(
        (Unknown("X", (1, 1)),), lambda v: [Inequality("low", 1 - v["X"]), Inequality("high", v["X"] - 3)]
    )
    wide = widest(problem)
    assert wide.status is Status.OPTIMAL
    assert 0.1 < wide.objective <= 1
    assert 1.2 < wide.values["X"].item() < 2.8


def test_an_empty_interior_has_no_margin():
    problem = Problem(
        (Unknown("X", (1, 1)),), lambda v: [Inequality("low", 1 - v["X"]), Inequality("high", v["X"] - 1)]
    )
    assert widest(problem).status is Status.INFEASIBLE


def test_an_unbounded_problem_is_not_called_optimal():
    problem = Problem((Unknown("X", (1, 1)),), lambda v: [Inequality("one side", v["X"] - 1)], lambda v: v["X"])
    assert minimise(problem).status is Status.UNDECIDED


def test_a_solver_that_is_not_installed_is_a_wrong_argument():
    with pytest.raises(UsageError, match="available: clarabel"):
        minimise(passive([0.5, 1]), solver="mosekk")


@pytest.mark.parametrize("solver", ["cvxopt", "scs"])
def test_another_solver_agrees(solver):
    pytest.importorskip(solver)
    problem = h_infinity(np.array([[-1.0, 1.0], [0.0, -2.0]]), np.array([[1.0, 0.0]]), project=True)
    assert minimise(problem, solver).objective == pytest.approx(minimise(problem).objective, rel=1e-3)


# Proof


@st.composite
def congruences(draw):
    """T D T' with T invertible and D diagonal: by Sylvester's law the signs of D are its inertia."""
    n = draw(st.integers(1, 6))
    rng = np.random.default_rng(draw(SEEDS))
    signs = draw(st.lists(st.sampled_from([-1, 0, 1]), min_size=n, max_size=n))
    sizes = [s * fmpq(int(rng.integers(1, 9)), 10 ** int(rng.integers(0, 30))) for s in signs]
    lower = rational(np.tril(integers(rng, n, n), -1) + np.eye(n))
    upper = rational(np.triu(integers(rng, n, n), 1) + np.eye(n))
    T = (lower @ upper)[rng.permutation(n)]
    return T @ np.diag(np.array(sizes, dtype=object)) @ T.T if n > 1 else rational([[sizes[0]]]), signs


@given(congruences())
@examples(150)
def test_the_exact_factorisation_decides_every_inertia(drawn):
    matrix, signs = drawn
    matrix = rational(matrix)
    found = pivots(matrix)
    assert (found is not None) == (min(signs) >= 0)
    assert holds(Inequality("F", -matrix)) == (min(signs) >= 0)
    assert holds(Inequality("F", -matrix, strict=True)) == (min(signs) > 0)
    if found is not None:
        assert sum(found) == sum(signs)


@given(st.integers(2, 6), SEEDS)
@examples(40)
def test_a_singular_matrix_is_semidefinite_until_it_is_lowered_by_1e_30(n, seed):
    rng = np.random.default_rng(seed)
    B = integers(rng, n, n - 1)
    B[-1] = -B[:-1].sum(axis=0)  # the vector of ones is in the kernel
    gram, ones = rational(B @ B.T), rational(np.ones((n, n)))
    assert holds(Inequality("F", -gram))
    assert not holds(Inequality("F", -gram, strict=True))
    assert not holds(Inequality("F", -(gram - TINY * ones)))
    assert not holds(Inequality("F", -(gram - TINY * rational(np.eye(n)))))
    shift = gram + TINY * rational(np.eye(n))
    assert holds(Inequality("F", -shift, strict=True))


@given(congruences(), st.sampled_from(["found", "identity", "random", "singular"]), SEEDS)
@examples(150)
def test_dominance_proves_nothing_false_whatever_the_congruence(drawn, kind, seed):
    matrix, signs = drawn
    n, rng = len(signs), np.random.default_rng(seed)
    given = {"identity": np.eye(n), "random": integers(rng, n, n), "singular": np.zeros((n, n))}
    taken = dominance.congruence if kind == "found" else lambda _: fmpz_mat(given[kind].astype(int).tolist())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dominance, "congruence", taken)
        assert not dominance.definite(rational(matrix)) or min(signs) > 0


@given(st.integers(1, 12), st.integers(0, 300), SEEDS)
@examples(60)
def test_dominance_proves_what_is_well_conditioned_in_any_units(n, decades, seed):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    units = np.diag(np.array([fmpq(10) ** int(k) for k in rng.integers(-decades, decades + 1, n)], dtype=object))
    S = units @ rational(np.round(A @ A.T + 1e-6 * np.eye(n), 12)) @ units
    assert dominance.definite(S)
    S[0, 0] = -S[0, 0]
    assert not dominance.definite(S)


def test_zero_pivots_need_zero_rows():
    assert pivots(rational([[0, 0], [0, 1]])) == [0, 1]
    assert pivots(rational([[0, 1], [1, 0]])) is None
    assert pivots(rational([[0, 1], [1, 5]])) is None
    assert pivots(rational([[1, 1, 2], [1, 1, 2], [2, 2, 5]])) == [1, 0, 1]
    assert pivots(rational([[1, 1, 2], [1, 1, 3], [2, 3, 9]])) is None
    assert pivots(rational(np.zeros((3, 3)))) == [0, 0, 0]
    assert pivots(rational(np.zeros((0, 0)))) == []


def test_a_matrix_that_is_not_symmetric_proves_nothing():
    skewed = -rational(np.eye(2))
    skewed[0, 1] = TINY
    assert not holds(Inequality("F", skewed))


def test_margins_are_relative_to_the_diagonal():
    assert margin(rational([[-4, 0], [0, "-1e-9"]])) == pytest.approx(1)
    assert margin(rational([[-1, 1], [1, -1]])) == pytest.approx(0, abs=1e-12)
    assert margin(rational([[-1, 2], [2, -1]])) == pytest.approx(-1)
    assert margin(rational([["-0.25"]])) == 0.25
    checks = prove([Inequality("yes", rational([[-1]])), Inequality("no", rational([[1]]))])
    assert [(c.name, c.holds, c.margin) for c in checks] == [("yes", True, 1.0), ("no", False, -1.0)]


def test_completing_a_rounded_witness_makes_the_structural_rows_vanish_exactly():
    def exact(v):
        A, b, c = (rational(m) for m in ([[0, 1], [-1, -1]], [[0], [1]], [["1/3"], ["1/7"]]))
        top = he(v["P"] @ A)
        return [
            Inequality("passive", symmetric([[top, v["P"] @ b - c], [0 * c[:1]]])),
            Inequality("P > 0", -v["P"], strict=True),
        ]

    unknowns = (Unknown("P", (2, 2), symmetric=True),)
    reduced = reduce(passive([1 / 3, 1 / 7]))
    start = rounded({"P": np.array([[1.0, 1 / 3 + 1e-7], [1 / 3 + 1e-7, 1 / 7]])}, 6)
    assert exact(start)[0].matrix[2].any()
    done = complete(exact, unknowns, start, reduced.rows, reduced.pivots)
    assert not exact(done)[0].matrix[2].any()
    assert done["P"][0, 1] == fmpq(1, 3)
    assert done["P"][0, 0] == 1
    assert complete(exact, unknowns, start, (), ()) == start


def test_rounding_keeps_so_many_significant_digits():
    values = rounded({"P": np.array([[1 / 3, -2e-20], [12345.678, 0.0]])}, 4)
    assert (values["P"] == rational([["0.3333", "-2e-20"], ["12350", "0"]])).all()


def test_the_identity_takes_the_numbers_of_its_model():
    assert identity(2, rational([[1]])).dtype == object
    assert identity(2, np.ones((1, 1))).dtype == float


# Eigenvalues


@examples(60)
@given(SEEDS, SIZES, st.integers(0, 25))
def test_extreme_eigenvalues_are_enclosed_whatever_the_condition(seed, n, power):
    rng = np.random.default_rng(seed)
    steep = np.diag([fmpq(10) ** int(k) for k in rng.integers(-power, power + 1, n)])
    X = rational(integers(rng, n, n))
    P = (X @ X.T + fmpq(int(rng.integers(0, 2))) * identity(n, X)) if seed % 2 else steep
    P = steep @ P @ steep
    low, high = (rational_number(repr(end(x))) for end, x in zip((lower, upper), extremes(P), strict=True))
    eye = identity(n, P)
    assert holds(Inequality("low", low * eye - P))
    assert holds(Inequality("high", P - high * eye))
    assert not holds(
        Inequality("low is tight", low * (1 + fmpq(1, 10**12)) * eye + (TINY * eye if not low else 0 * eye) - P)
    )
    assert not holds(Inequality("high is tight", P - high * (1 - fmpq(1, 10**12)) * eye)) or not high


@examples(30)
@given(SEEDS, SIZES, st.integers(-60, 60))
def test_powers_of_two_scale_eigenvalues_and_nothing_else(seed, n, power):
    X = rational(integers(np.random.default_rng(seed), n, n))
    for ball, scaled in zip(extremes(X @ X.T), extremes(fmpq(2) ** power * X @ X.T), strict=True):
        assert upper(scaled) == pytest.approx(upper(ball) * 2.0**power, rel=1e-15)


@given(st.integers(0, 4), st.integers(1, 4), st.integers(1, 4), st.integers(0, 2**32 - 1))
def test_a_product_of_rationals_is_exact(n, m, k, seed):
    draw = np.random.default_rng(seed).integers
    X, Y = (np.vectorize(fmpq, otypes=[object])(draw(-9, 9, shape), draw(1, 9, shape)) for shape in ((n, m), (m, k)))
    made = product(X, Y)
    assert made.shape == (n, k)
    assert (made == X @ Y).all()


@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_what_is_refuted_is_not_definite_by_its_pivots_either(n, seed):
    random = np.random.default_rng(seed)
    M = random.integers(-5, 6, (n, n))
    S = rational(M @ M.T + random.integers(-4, 5) * np.eye(n, dtype=int))
    assert refuted(S) == (pivots(S) is None)
