"""Lipschitz observers: least gammas and largest constants against closed forms, reference values and worst cases."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.linalg import solve_continuous_are
from support.plants import plant, zeros
from support.sweep import examples, seeds

from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UndecidedError
from obsdesign.families.lipschitz.reasons import gate, out_of_reach, too_small, useless
from obsdesign.families.lipschitz.relaxations import (
    RELAXATIONS,
    Lipschitz,
    NormBound,
    Theorem3,
    Theorem4,
    lipschitz_multiplier,
    proportions,
)
from obsdesign.families.lipschitz.request import LipschitzRequest
from obsdesign.families.lipschitz.suprema import cancels, ceiling, largest_constant, largest_for_gamma
from obsdesign.lmi.formula import Inequality, Problem, Unknown, he, in_floats, rational, rational_number
from obsdesign.lmi.solve import Answer, Status

ROOT2 = math.sqrt(2)
HALF = "0.5"


def family(cls, system, constant, decay, H=HALF, sizes=None):
    """One instance for a constant of every block; H is a multiple of the identity, or a matrix."""
    nq, n = system.Cq.shape
    sizes = sizes or [(nq, system.Bf.shape[1])]
    multiplier = lipschitz_multiplier([rational_number(constant)] * len(sizes), sizes)
    seen = rational(np.eye(n)) * rational_number(H) if isinstance(H, str) else rational(H)
    return cls(system, multiplier, seen, rational_number(decay), None, zeros(nq, len(system.C)))


def unit(system, decay, H=HALF, sizes=None):
    return family(Lipschitz, system, 1, decay, H, sizes)


SECOND = [[0, 1], [-1, -1]]
EXAMPLE1 = plant(SECOND, [[0, 1]])
EXAMPLE3 = plant(SECOND, [[1, 0]], [[1], [1]], [["0.2"]])
NOISES = plant(SECOND, [[1, 0]], [[1, 0], [1, 0]], [[0, "0.2"]])

ARM = [[0, 1, 0, 0], ["-48.6", "-1.25", "48.6", 0], [0, 0, 0, 1], ["19.5", 0, "-19.5", 0]]
SEES = [[1, 0, 0, 0], [0, 1, 0, 0]]
ARM_NOISE = [["0.1"], ["0.25"]]
T = rational(["1", "1", "4", "0.1"])
SCALED = rational(ARM) * T[:, None] / T
EXAMPLE2 = plant(ARM, SEES, [[1]] * 4, ARM_NOISE)
EXAMPLE2_T = plant(SCALED, SEES, [[1]] * 4, ARM_NOISE)  # B of the scaled coordinates
EXAMPLE2_TB = plant(SCALED, SEES, T[:, None], ARM_NOISE)
STRUCTURED = plant(ARM, SEES, [[1]] * 4, ARM_NOISE, [[0], [0], [0], [1]], [[0, 0, 1, 0]])


def supremum(system, decay, relaxation="norm-bound", **further):
    return largest_constant(Engine(), unit(system, decay, **further), relaxation).value


# Largest constants


@pytest.mark.parametrize(
    ("system", "decay", "theorem2", "scales"),
    [
        (EXAMPLE1, 0, 0.5, 1.0),
        (EXAMPLE3, 0, (1 + ROOT2) / 2, ROOT2),
        (EXAMPLE3, "0.05", (0.95 + math.sqrt(0.95**2 + 1)) / 2, math.sqrt(0.95**2 + 1)),
        (EXAMPLE3, "0.5", 0.5 * (0.5 + math.sqrt(1.25)), math.sqrt(1.25)),
    ],
)
def test_where_one_state_is_unseen_the_largest_constants_are_closed_forms_and_nothing_is_solved(
    system, decay, theorem2, scales
):
    engine = Engine()
    for relaxation, value in (("abbaszadeh", theorem2), ("norm-bound", theorem2), ("s-procedure", scales)):
        found = largest_constant(engine, unit(system, decay), relaxation)
        assert found.value == pytest.approx(value, rel=1e-12)
        assert found.closed
    assert ceiling(unit(system, decay)) == pytest.approx(scales, rel=1e-12)
    assert engine.solves == 0


def test_the_closed_forms_have_the_reference_values_of_example_3():
    found = [supremum(EXAMPLE3, decay) for decay in (0, "0.05", "0.5")]
    assert found == pytest.approx([1.2071068, 1.1646557, 0.8090170], rel=5e-8)
    found = [supremum(EXAMPLE3, decay, "s-procedure") for decay in ("0.05", "0.5")]
    assert found == pytest.approx([1.379311, 1.118034], rel=1e-6)


@pytest.mark.parametrize(
    ("system", "decay", "value", "accuracy"),
    [
        (EXAMPLE3, 0, 0.68443040, 1e-8),
        (EXAMPLE3, "0.05", 0.64971305, 1e-8),
        (EXAMPLE3, "0.5", 0.27538128, 1e-8),
        (EXAMPLE2_T, 0, 1.42971544, 1e-8),
        (EXAMPLE2_T, "0.2", 1.41819470, 1e-8),
        (EXAMPLE2, 0, 0.0, 0),
        (EXAMPLE2, "0.2", 0.0, 0),
    ],
)
def test_the_largest_constant_of_theorems_3_and_4_is_a_closed_form_in_that_of_theorem_2(system, decay, value, accuracy):
    assert largest_for_gamma(Engine(), unit(system, decay), "abbaszadeh").value == pytest.approx(value, rel=accuracy)


@pytest.mark.parametrize(
    ("system", "decay", "theorem2", "scales", "hard"),
    [
        (EXAMPLE2, 0, 0.4606927, 0.9997543, 1.0),
        (EXAMPLE2, "0.2", 0.3823364, 0.9956172, 1.0),
        (EXAMPLE2_T, 0, 2.5059626, 11.617108, 12.08),
        (EXAMPLE2_T, "0.2", 2.4802490, 11.598811, 12.08),
    ],
)
def test_the_reduced_problems_have_the_reference_values_of_example_2(system, decay, theorem2, scales, hard):
    assert supremum(system, decay) == pytest.approx(theorem2, abs=6e-8)
    assert supremum(system, decay, "s-procedure") == pytest.approx(scales, rel=6e-8)
    assert ceiling(unit(system, decay)) == pytest.approx(hard, rel=1e-3)


@pytest.mark.parametrize("decay", [0, "0.2", 5])
def test_the_structure_of_example_2_admits_every_constant(decay):
    engine = Engine()
    assert largest_constant(engine, unit(STRUCTURED, decay), "s-procedure").value == math.inf
    assert engine.solves == 0
    assert ceiling(unit(STRUCTURED, decay)) is None
    assert supremum(STRUCTURED, decay) < 1


def test_a_chain_of_integrators_whose_end_f_drives_admits_every_constant_whatever_f_depends_on():
    chain = plant([[0, 1, 0], [0, 0, 1], [0, 0, 0]], [[1, 0, 0]], Bf=[[0], [0], [1]])
    assert supremum(chain, "0.5", "s-procedure") == math.inf
    assert feasible(unit(chain, "0.5").stretched(rational_number(10)))
    moved = plant([[0, 1, 0], [0, 0, 1], [0, 0, 0]], [[1, 0, 0]], Bf=[[0], [1], [0]])
    assert supremum(moved, "0.5", "s-procedure") == pytest.approx(1, rel=1e-12)  # f = -x3 hides x3


def test_f_that_is_seen_by_a_decaying_zero_only_admits_every_constant():
    """y' = x2 - x1 + f hides f = x1 - x2 while x2' = -2 x2; f sees x2, and the mode decays."""
    system = plant([[-1, 1], [0, -2]], [[1, 0]], Bf=[[1], [0]], Cq=[[0, 1]])
    assert supremum(system, "1.5", "s-procedure") == math.inf
    assert supremum(system, "2.5", "s-procedure") == pytest.approx(1)
    assert feasible(unit(system, "1.5").stretched(rational_number(30)))


def test_several_blocks_admit_more_than_one_block_of_the_same_f():
    system = plant(
        [[0, 1, 0], [-1, -2, 1], [-1, 1, -3]],
        [[1, 0, 0]],
        Bf=[[1, 0], [1, 0], [0, 1]],
        Cq=[[0, 1, 1], [0, 1, -1]],
    )
    blocks = [(1, 1), (1, 1)]
    several, one = (supremum(system, "0.1", "s-procedure", sizes=sizes) for sizes in (blocks, [(2, 2)]))
    assert several == pytest.approx(3.9, rel=1e-7)
    assert one < 0.9 * several
    assert_supremum(unit(system, "0.1", sizes=blocks), several, 1e-3)


@pytest.mark.parametrize(
    ("A", "Bf", "Cq", "limit"),
    [
        ([[-1, 0], [0, -3]], [[1, 0], [0, 1]], [[1, 0], [0, 1]], 1),
        ([[-3, 0], [0, -1]], [[1, 0], [0, 1]], [[1, 0], [0, 1]], 1),
        ([[-2, 0], [1, -1]], [[1, 0], [0, 1]], [[1, 0], [0, 1]], 1),
        ([[-1, 0], [0, -1]], [[1, 0], [0, 1]], [[0, 1], [1, 0]], 1),
        ([[-1, 0], [0, -1]], [[1, 0], [0, "1e-6"]], [[0, 1], [1, 0]], 1e3),
        ([[-1, 0, 0], [0, -2, 0], [0, 0, -3]], [[1, 0], [0, 0], [0, 1]], [[0, 1, 0], [0, 0, 1]], 3),
        ([[-1, 0, 0], [0, -2, 0], [0, 0, -3]], [[1, 0], [0, 1], [0, 0]], [[0, 1, 0], [0, 0, 1]], math.inf),
    ],
    ids=["apart", "apart, reversed", "one after the other", "ring", "ring of uneven gains", "one decays", "cascade"],
)
def test_blocks_in_loops_admit_what_their_smallest_loop_gain_leaves_and_a_cascade_admits_every_constant(
    A, Bf, Cq, limit
):
    system = plant(A, zeros(0, len(A)), Bf=Bf, Cq=Cq)
    found = largest_constant(Engine(), unit(system, 0, sizes=[(1, 1), (1, 1)]), "s-procedure")
    assert found.value == pytest.approx(limit, rel=5e-6)
    assert not found.attained


def test_blocks_of_which_none_keeps_itself_going_where_y_is_zero_admit_every_constant():
    """A ring of three that the output opens: f1 is zero where x1 is, then x2 is left alone, then x3."""
    system = plant(-np.eye(3), [[1, 0, 0]], Bf=np.eye(3), Cq=np.roll(np.eye(3), 1, axis=0))
    assert supremum(system, 0, "s-procedure", sizes=[(1, 1)] * 3) == math.inf
    assert supremum(plant(-np.eye(3), zeros(0, 3), Cq=np.roll(np.eye(3), 1, axis=0)), 0, "s-procedure") < math.inf


def test_a_mode_on_the_axis_that_no_f_moves_counts_as_one_that_does_not_decay():
    """The closed form divides by |B_z|^2, which is zero, if the rounded mode -3e-17 is taken to decay."""
    system = plant(
        [[0, 1, 0], [0, 0, 1], [0, 0, 0]],
        [["-0.2", 0, "0.3"], ["0.4", -2, "0.3"]],
        Bf=[[0, 1], [1, 0], [0, 0]],
        Cq=[[1, 0, 0], [0, 0, 1]],
    )
    limit = supremum(system, 0, "s-procedure")
    assert limit == pytest.approx(math.sqrt(0.37), rel=1e-12)
    assert_supremum(unit(system, 0), limit, 1e-2)


def test_theorem_4_needs_room_even_where_f_does_not_enter():
    """l = 0 for every constant, but its xi is finite: 2 (1 - h) g > 1 with g = 0.5 (Example 1) and 1.2 (Example 3)."""
    for C, limit in (([[0, 1]], 0.0), ([[1, 0]], math.inf)):
        system = plant(SECOND, C, Bf=[[0], [0]], Cq=[[1, 0]])
        assert largest_for_gamma(Engine(), unit(system, 0), "abbaszadeh").value == limit
        assert supremum(system, 0) == math.inf


def test_a_reduced_problem_that_is_not_solved_is_an_error_that_a_person_sees_in_one_line():
    class Stuck(Engine):
        def minimise(self, *_, **__):
            return Answer(Status.UNDECIDED)

    for relaxation in RELAXATIONS:
        with pytest.raises(UndecidedError, match="largest Lipschitz constant"):
            largest_constant(Stuck(), unit(EXAMPLE2, 0), relaxation)


def test_where_every_state_is_measured_every_constant_will_do():
    whole = plant(SECOND, [[1, 0], [1, 1]])
    assert [supremum(whole, 1, relaxation) for relaxation in RELAXATIONS] == [math.inf] * 3
    assert ceiling(unit(whole, 1)) is None


def test_a_repeated_output_changes_nothing():
    again = plant(SECOND, [[1, 0], [-3, 0]])
    for relaxation in RELAXATIONS:
        assert supremum(again, "0.05", relaxation) == pytest.approx(supremum(EXAMPLE3, "0.05", relaxation), rel=1e-12)


def test_no_constant_will_do_where_a_mode_is_hidden():
    hidden = plant([[-1, 0, 0], [1, -2, 1], [0, 1, -1]], [[0, 1, 0]], Bf=[[0], [0], [1]], Cq=[[0, 0, 1]])
    slow = plant([[-1, 0], [0, 1]], [[0, 1]])
    for relaxation in RELAXATIONS:
        assert supremum(slow, 1, relaxation) == 0
        assert supremum(slow, "0.5", relaxation) > 0
        assert supremum(hidden, "0.5", relaxation) > 0


def test_the_constant_counts_f_as_a_whole_where_its_structure_is_not_used():
    doubled = plant(SECOND, [[1, 0]], Bf=[[2, 0], [0, 2]], Cq=[[3, 0], [0, 3]])
    for relaxation in RELAXATIONS:
        assert 6 * supremum(doubled, "0.05", relaxation) == pytest.approx(
            supremum(EXAMPLE3, "0.05", relaxation), rel=1e-12
        )
    assert 6 * ceiling(unit(doubled, "0.05")) == pytest.approx(ceiling(unit(EXAMPLE3, "0.05")), rel=1e-12)


# Against the whole problems


def feasible(problem):
    """Whether the inequalities of an instance have a strict solution."""
    return Engine().widest(in_floats(problem).feasible()).status is Status.OPTIMAL


def theorem2(system, decay):
    """Largest constant of Theorem 2 with its gain: He(P A + Y C) + 2 beta P <= t I, 0 <= P <= I."""
    p, n = in_floats(system), system.n
    A = p.A + float(rational_number(decay)) * np.eye(n)
    unknowns = (Unknown("P", (n, n), symmetric=True), Unknown("Y", p.C.T.shape), Unknown("t", (1, 1)))

    def inequalities(v):
        return (
            Inequality("", he(v["P"] @ A + v["Y"] @ p.C) - v["t"] * np.eye(n)),
            Inequality("P >= 0", -v["P"]),
            Inequality("P <= I", v["P"] - np.eye(n)),
        )

    return -Engine().minimise(Problem(unknowns, inequalities, lambda v: v["t"])).objective / 2


def assert_supremum(problem, limit, width):
    """Feasible just below, with its gain, and infeasible just above. (As an optimum the whole problem loses 1e-3.)"""
    assert feasible(problem.stretched(rational_number(limit * (1 - width))))
    assert not feasible(problem.stretched(rational_number(limit * (1 + width))))


def drawn(rng, n, unseen, rate=1, **further):
    """Random plant in two digits."""
    A, C = rate * rng.normal(size=(n, n)).round(2), rng.normal(size=(n - unseen, n)).round(2)
    return plant(A, C, **further)


@seeds(8)
def test_the_closed_forms_agree_with_the_whole_problems(seed):
    rng = np.random.default_rng(seed)
    system = drawn(rng, int(rng.integers(2, 5)), 1)
    assert supremum(system, "0.1") == pytest.approx(theorem2(system, "0.1"), rel=1e-5)
    assert_supremum(unit(system, "0.1"), supremum(system, "0.1", "s-procedure"), 2e-3)


@seeds(10)
def test_the_reduced_problems_agree_with_the_whole_ones(seed):
    rng = np.random.default_rng(100 + seed)
    k = 2 + seed % 2
    system = drawn(rng, k + 1 + int(rng.integers(0, 2)), k)
    assert supremum(system, "0.1") == pytest.approx(theorem2(system, "0.1"), rel=1e-5)
    assert_supremum(unit(system, "0.1"), supremum(system, "0.1", "s-procedure"), 1e-2)


def largest_by_riccati(system, decay):
    """Bisection for -He(P a) - P^2 + W'W - c^2 I = 0 to have a largest solution, with P > 0."""
    p = in_floats(system)
    A, V, ny = p.A + decay * np.eye(p.n), np.linalg.svd(p.C)[2].T, len(p.C)
    N, M = V[:, ny:], V[:, :ny]
    a, W, eye = N.T @ A @ N, M.T @ A @ N, np.eye(p.n - ny)

    def positive(c):
        Q = W.T @ W - c * c * eye
        try:
            P = solve_continuous_are(-a, eye, Q, eye)
        except np.linalg.LinAlgError:
            return False
        solves = np.linalg.norm(he(P @ a) + P @ P - Q) < 1e-11 * (1 + np.linalg.norm(P) ** 2)
        return solves and np.linalg.eigvalsh(P)[0] > 0

    low, high = 0.0, 10 * np.linalg.norm(A)
    while high - low > 1e-12 * high:
        middle = (low + high) / 2
        low, high = (middle, high) if positive(middle) else (low, middle)
    return low


@seeds(8)
def test_the_reduced_s_procedure_is_accurate_to_eight_digits(seed):
    rng = np.random.default_rng(100 + seed)
    k = 2 + seed % 2
    system = drawn(rng, k + 1 + int(rng.integers(0, 2)), k)
    assert supremum(system, 0.1, "s-procedure") == pytest.approx(largest_by_riccati(system, 0.1), rel=1e-8)


@seeds(8)
def test_a_structured_f_is_feasible_just_below_its_supremum_and_infeasible_just_above(seed):
    rng = np.random.default_rng(200 + seed)
    n = int(rng.integers(2, 5))
    system = drawn(
        rng, n, int(rng.integers(1, n)), Bf=rng.normal(size=(n, 2)).round(2), Cq=rng.normal(size=(2, n)).round(2)
    )
    sizes = [(2, 2)] if seed % 2 else [(1, 1), (1, 1)]
    problem = unit(system, "0.3", sizes=sizes)
    limit = largest_constant(Engine(), problem, "s-procedure").value
    assert limit >= supremum(system, "0.3", sizes=sizes)
    if math.isfinite(limit):
        assert_supremum(problem, limit, 2e-2)
    else:
        assert feasible(problem.stretched(rational_number(20)))


def noisy(rng, n, unseen):
    """Random fast plant with two disturbances."""
    return drawn(
        rng, n, unseen, rate=3, B=rng.normal(size=(n, 2)).round(2), D=rng.normal(size=(n - unseen, 2)).round(2)
    )


@seeds(40)
def test_theorem_3_is_feasible_exactly_below_its_closed_form(seed):
    rng = np.random.default_rng(300 + seed)
    n = int(rng.integers(2, 4))
    system, H = noisy(rng, n, int(rng.integers(1, n))), str(round(rng.uniform(0.1, 0.9), 2))
    limit = largest_for_gamma(Engine(), unit(system, "0.1", H), "abbaszadeh").value
    below, above = (limit * 0.98, limit * 1.02) if limit else (None, 0.3)
    assert not feasible(family(Theorem3, system, above, "0.1", H))
    assert below is None or feasible(family(Theorem3, system, below, "0.1", H))


# Least gammas


def least_gamma(problem):
    """Infimum over all gains; 1 + mu is minimised, for the solver knows mu to a relative accuracy that 0 has not."""
    answer = Engine().minimise(replace(in_floats(problem).least_gamma(), minimise=lambda v: 1 + v["mu"]))
    assert answer.status is Status.OPTIMAL
    return math.sqrt(max(answer.objective - 1, 0.0))


def gammas(system, constant, decay):
    """Least gammas of Theorem 3, variant 62 and the s-procedure; None where there is no solution."""
    problems = [family(cls, system, constant, decay) for cls in (Theorem3, NormBound, Lipschitz)]
    return [least_gamma(problem) if feasible(problem) else None for problem in problems]


@pytest.mark.parametrize(
    ("system", "constant", "decay", "expected"),
    [
        (NOISES, "0.1", "0.05", (0.67238, 0.15367, 0.12874)),
        (NOISES, "0.4167", "0.05", (0.49423, 0.22565, 0.14675)),
        (NOISES, "0.5525", "0.05", (0.82222, 0.28236, 0.15855)),
        (EXAMPLE3, "0.4167", 0, (0.1481598, 0, 0)),
        (EXAMPLE3, "0.4167", "0.05", (0.43055, 0, 0)),
        (EXAMPLE3, "0.5525", "0.05", (1.16149, 0, 0)),
        (EXAMPLE3, "1.0", "0.05", (None, 2.0786, 0)),
        (EXAMPLE3, "0.4167", "0.5", (None, 0, 0)),
        (EXAMPLE2_T, "0.08325", 0, (1.35324, 0, 0)),
        (EXAMPLE2_T, "0.08325", "0.2", (1.38628, 0, 0)),
        (EXAMPLE2_TB, "0.08325", 0, (1.44282, 0, 0)),
        (EXAMPLE2_TB, "0.08325", "0.2", (1.46283, 0, 0)),
    ],
)
def test_the_least_gammas_have_their_reference_values(system, constant, decay, expected):
    for found, value in zip(gammas(system, constant, decay), expected, strict=True):
        assert (found is None) == (value is None)
        assert found is None or found == pytest.approx(value, rel=1e-4, abs=1e-4)


def test_the_least_gammas_near_the_largest_constant_of_example_2_have_their_reference_values():
    paper, norm, scales = gammas(EXAMPLE2_T, "2.4177", "0.2")
    assert paper is None
    assert norm == pytest.approx(23.3, rel=1e-2)
    assert scales == pytest.approx(0.392, rel=1e-2)


@pytest.mark.parametrize("constant", ["0.05", "0.2", "0.4607", "3.33"])
def test_theorem_3_has_no_solution_for_example_2_in_its_own_coordinates(constant):
    assert not feasible(family(Theorem3, EXAMPLE2, constant, 0))


@pytest.mark.parametrize(
    ("system", "decay", "expected"),
    [
        (EXAMPLE2_T, 0, 0.80609),
        (EXAMPLE2_T, "0.2", 0.81848),
        (EXAMPLE2_TB, 0, 0.83994),
        (EXAMPLE2_TB, "0.2", 0.84903),
    ],
)
def test_the_least_gamma_over_all_larger_constants_is_below_that_of_theorem_3(system, decay, expected):
    assert least_gamma(family(Theorem4, system, "0.08325", decay)) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(
    ("weight", "constant", "gamma"),
    [
        (0.4, 0.38644, 0.2093),
        (0.6, 0.46967, 0.6994),
        (0.8, 0.54027, 1.0812),
        (0.9, 0.57813, 1.36482),
        (0.98, 0.61701, 2.0374),
    ],
)
def test_the_pareto_optima_of_example_3_have_their_reference_values(weight, constant, gamma):
    answer = Engine().minimise(in_floats(family(Theorem4, EXAMPLE3, "0.3", "0.05")).pareto(weight))
    assert 1 / answer.values["xi"].item() == pytest.approx(constant, rel=2e-4)
    assert math.sqrt(answer.values["mu"].item()) == pytest.approx(gamma, rel=5e-4)
    assert answer.objective == pytest.approx(weight / constant + (1 - weight) * gamma**2, rel=1e-4)


def test_the_pareto_optimum_covers_the_declared_constant():
    answer = Engine().minimise(in_floats(family(Theorem4, EXAMPLE3, "0.4167", "0.05")).pareto(0.4))
    assert 1 / answer.values["xi"].item() == pytest.approx(0.4167, rel=1e-6)


# Invariants


def turned(system, seed):
    """Same plant in other orthogonal coordinates of x, in doubles."""
    p = in_floats(system)
    U, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(p.n, p.n)))
    return plant(U @ p.A @ U.T, p.C @ U.T, U @ p.B, p.D, U @ p.Bf, p.Cq @ U.T)


@examples(15)
@example(14946, 2, 0.01)  # a constant that is small beside the data
@given(st.integers(0, 10**6), st.integers(1, 2), st.sampled_from([0.01, 3.0, 500.0]))
def test_the_limits_do_not_depend_on_orthogonal_coordinates_and_scale_with_the_unit_of_time(seed, k, rate):
    system = drawn(np.random.default_rng(seed), k + 1, k)
    faster = plant(rate * in_floats(system).A, in_floats(system).C)
    for relaxation in ("norm-bound", "s-procedure"):
        value = supremum(system, 0.1, relaxation)
        assert supremum(turned(system, seed), 0.1, relaxation) == pytest.approx(value, rel=1e-6)
        assert supremum(faster, 0.1 * rate, relaxation) == pytest.approx(rate * value, rel=1e-6)
    assert ceiling(unit(faster, 0.1 * rate)) == pytest.approx(rate * ceiling(unit(system, 0.1)), rel=1e-8)


@examples(15)
@given(st.integers(0, 10**6), st.integers(1, 3), st.integers(0, 2), st.floats(0, 2))
def test_no_relaxation_exceeds_a_tighter_one_nor_the_ceiling(seed, k, ny, decay):
    system = drawn(np.random.default_rng(seed), k + max(ny, 1), k)
    decay = round(decay, 2)
    most, (tight, norm, paper) = ceiling(unit(system, decay)), [supremum(system, decay, name) for name in RELAXATIONS]
    assert paper == norm <= tight * (1 + 1e-6)
    assert tight <= most * (1 + 1e-6)


@seeds(6)
def test_the_ceiling_is_the_size_of_a_linear_f_that_hides_a_mode_and_no_smaller_one_does(seed):
    rng = np.random.default_rng(400 + seed)
    k = 1 + seed % 3
    p = in_floats(drawn(rng, k + 1, k))
    most, decay = ceiling(unit(plant(p.A, p.C), "0.1")), 0.1
    N = np.linalg.svd(p.C)[2][len(p.C) :].T

    def shifted(s):
        return (p.A - s * np.eye(p.n)) @ N

    def size(s):
        return np.linalg.svd(shifted(s), compute_uv=False)[-1]

    grid = np.linspace(-decay, 10, 200_01)
    sizes = np.linalg.svd((p.A - grid[:, None, None] * np.eye(p.n)) @ N, compute_uv=False)[:, -1]
    s = grid[sizes.argmin()]
    assert size(s) * (1 - 1e-5) <= most <= size(s) * (1 + 1e-12)
    U, values, V = np.linalg.svd(shifted(s), full_matrices=False)
    K = -values[-1] * np.outer(U[:, -1], N @ V[-1])
    assert np.linalg.norm(K, 2) == pytest.approx(most, rel=1e-5)
    hidden = np.vstack([p.A + K - s * np.eye(p.n), p.C])
    assert np.linalg.svd(hidden, compute_uv=False)[-1] < 1e-12 * np.linalg.norm(p.A)


# Certified claims against linear f


def attenuates(A, B, H, gamma):
    """Whether |H (s I - A)^-1 B| <= gamma for each stable A (.., n, n): no imaginary eigenvalue of the Hamiltonian."""
    W, Q = np.broadcast_to(B @ B.T / gamma**2, A.shape), np.broadcast_to(-H.T @ H, A.shape)
    values = np.linalg.eigvals(np.block([[A, W], [Q, -A.mT]]))
    return (np.abs(values.real) > 1e-9 * np.abs(values).max(axis=-1, keepdims=True)).all(axis=-1)


def perturbations(rng, A, size, count):
    """Linear f of a size: of rank one along the worst directions at some frequency, and random orthogonal."""
    n = len(A)
    for i in range(count):
        if i % 2:
            yield size * np.linalg.qr(rng.normal(size=(n, n)))[0]
            continue
        u, _, v = np.linalg.svd(np.linalg.inv(1j * (i % 4) * rng.exponential() * np.eye(n) - A))
        phase = np.exp(1j * rng.uniform(0, 6))
        f, x = (v[0].conj() * phase).real, (u[:, 0] * phase).real
        yield rng.choice([-1, 1]) * size * np.outer(f, x) / np.linalg.norm(f) / np.linalg.norm(x)


def kept(problem, gamma, size, rng):
    """Whether the gain of the widest solution for a gamma keeps decay and gamma for 60 linear f of a size."""
    problem = in_floats(problem)
    answer = Engine().widest(problem.witness(gamma))
    assert answer.status is Status.OPTIMAL
    p, L1 = problem.plant, np.linalg.solve(answer.values["P"], answer.values["Y"])
    A = p.A + L1 @ p.C
    error = A + np.array(list(perturbations(rng, A, size, 60)))
    decays = np.linalg.eigvals(error).real < -problem.rate
    return decays.all() and attenuates(error, p.B + L1 @ p.D, problem.H, gamma).all()


@seeds(25)
def test_no_linear_f_violates_a_claim_and_the_relaxations_are_in_order(seed):
    rng = np.random.default_rng(500 + seed)
    n, decay = int(rng.integers(2, 4)), 0.1
    system = noisy(rng, n, int(rng.integers(1, n)))
    H = "0.3"
    paper = largest_for_gamma(Engine(), unit(system, decay, H), "abbaszadeh").value
    constant = 0.8 * (paper or supremum(system, decay))
    found = {
        cls: least_gamma(family(cls, system, constant, decay, H))
        for cls in ((Lipschitz, NormBound, Theorem3) if paper else (Lipschitz, NormBound))
    }
    levels = list(found.values())
    assert all(low <= high * (1 + 1e-4) + 1e-4 for low, high in pairwise(levels))
    for cls, least in found.items():
        assert kept(family(cls, system, constant, decay, H), 1.05 * least + 0.01, constant, rng)


def test_a_linear_f_of_twice_the_size_violates_a_claim():
    problem = family(Lipschitz, NOISES, "0.8", "0.05")
    gamma = 1.05 * least_gamma(problem)
    assert kept(problem, gamma, 0.8, np.random.default_rng(1))
    assert not kept(problem, gamma, 1.6, np.random.default_rng(1))


# Reasons


def asked(system, decay, constant, relaxation, objective="min-gamma", H=HALF):
    """Diagnosis, and how many problems were solved for it."""
    engine = Engine()
    request = LipschitzRequest("lipschitz", (rational_number(constant),), relaxation, objective)
    return gate(engine, unit(system, decay, H), request, relaxation), engine.solves


def test_example_3_at_the_decay_of_the_paper_is_refused_by_its_closed_form_and_what_would_do_is_said():
    found, solves = asked(EXAMPLE3, HALF, "0.4167", "abbaszadeh")
    assert solves == 0
    assert found["condition"] == "lipschitz"
    assert found["lipschitz"] == {"asked": 0.4167, "supremum": pytest.approx(0.27538128, rel=1e-8)}
    assert "0.27538128" in found["reason"]
    assert found["relaxations"]["norm-bound"]["lipschitz_below"] == pytest.approx(0.8090169944, rel=1e-9)
    assert found["relaxations"]["s-procedure"]["lipschitz_below"] == pytest.approx(math.sqrt(1.25), rel=1e-9)
    assert "smaller decay" in found["suggestion"]
    assert "0.6844304" in found["suggestion"]
    assert "ceiling" not in found


@pytest.mark.parametrize(
    ("decay", "constant", "relaxation", "objective"),
    [
        ("0.05", "0.4167", "abbaszadeh", "min-gamma"),
        ("0.05", "0.6497", "abbaszadeh", "pareto"),
        (HALF, "0.4167", "norm-bound", "min-gamma"),
        (HALF, "1.1", "s-procedure", "pareto"),
        (HALF, "9", "abbaszadeh", "max-lipschitz"),
        (0, 0, "abbaszadeh", "pareto"),
        (0, 0, "s-procedure", "min-gamma"),
    ],
)
def test_nothing_stands_in_the_way_of_what_is_possible(decay, constant, relaxation, objective):
    assert asked(EXAMPLE3, decay, constant, relaxation, objective) == ({}, 0)


def test_a_constant_above_the_ceiling_is_out_of_reach_of_every_method():
    found, solves = asked(EXAMPLE3, 0, "1.5", "norm-bound")
    assert solves == 0
    assert found["ceiling"] == pytest.approx(ROOT2)
    assert "no gain of any method" in found["reason"]
    assert "relaxations" not in found


def test_the_recipe_of_remark_3_is_refused():
    """Theorem 3 at the constant that Theorem 2 admits."""
    found, _ = asked(EXAMPLE2_T, "0.2", "2.4177", "abbaszadeh")
    assert found["feasible"]["lipschitz_below"] == pytest.approx(1.4181947, rel=1e-7)
    assert found["relaxations"]["s-procedure"]["lipschitz_below"] == pytest.approx(11.5988107, rel=1e-7)


@pytest.mark.parametrize("constant", ["0.1", "1"])
def test_the_theorems_that_need_sigma_h_below_one_say_so_and_which_relaxation_does_not(constant):
    found, solves = asked(EXAMPLE3, 0, constant, "abbaszadeh", H="1")
    assert solves == 0
    assert found["condition"] == "sigma(H)"
    assert set(found["relaxations"]) == {"norm-bound", "s-procedure"}
    assert asked(EXAMPLE3, 0, constant, "norm-bound", H="1") == ({}, 0)


def test_the_theorems_that_need_room_for_some_constant_say_so():
    found, solves = asked(EXAMPLE1, 0, "0.1", "abbaszadeh")
    assert solves == 0
    assert found["condition"] == "room"
    assert found["room"] == pytest.approx(0.75)
    assert asked(EXAMPLE2, 0, "0.1", "abbaszadeh")[0]["condition"] == "room"
    assert asked(STRUCTURED, 0, "3.33", "abbaszadeh")[0]["relaxations"] == {"s-procedure": {"unbounded": True}}


def test_theorem_3_cannot_divide_by_a_constant_of_zero():
    assert asked(EXAMPLE3, 0, 0, "abbaszadeh")[0]["condition"] == "lipschitz"


def test_a_hidden_mode_is_named():
    slow = plant([[-1, 0], [0, 1]], [[0, 1]])
    found, solves = asked(slow, 2, "0.1", "s-procedure", "max-lipschitz")
    assert solves == 0
    assert found["condition"] == "detectability"
    assert found["mode"]["eigenvalue"] == [-1.0, 0.0]
    assert found["feasible"] == {"decay_below": pytest.approx(1.0)}
    assert asked(slow, "0.5", "0.1", "s-procedure", "max-lipschitz") == ({}, 0)


def test_bounds_and_gains_that_will_not_do_are_named():
    assert out_of_reach({"asked": 0.1, "least": 0.25}, 1.0)["feasible"] == {"gamma": 0.25}
    found = too_small(Bounds(L1=rational_number(3), norm="frobenius", floor=rational_number(2)))
    assert found["bounds"] == {"L": 3.0, "P.min": 2.0}
    assert "|L|_F <= 3" in found["reason"]
    assert "P >= 2 I" in found["reason"]


def with_gain(L, decay):
    return replace(family(Lipschitz, EXAMPLE3, 1, decay), L1=-rational(L))


def test_gains_that_are_too_slow_are_told_from_gains_that_are_not_proved():
    """A - L C has the poles (-1.1 +- sqrt(0.81 - 4) j) / 2 for L = (0.1, 0), and -3 +- j for L = (5, 5)."""
    slow = useless(with_gain([["0.1"], [0]], "0.6"), 1.0, None)
    assert "slowest pole" in slow["reason"]
    assert slow["pole"][0] == pytest.approx(-0.55)
    assert slow["feasible"] == {"decay_below": pytest.approx(0.55)}
    unproved = useless(with_gain([[5], [5]], "0.6"), 2.0, 1.2)
    assert "constant 2" in unproved["reason"]
    assert unproved["feasible"] == {"lipschitz": 1.2}
    assert "up to 1.2" in unproved["suggestion"]
    unstable = useless(with_gain([[-5], [0]], 0), 1.0, None)
    assert unstable["pole"][0] > 0
    assert unstable["feasible"] == {}


# The degenerate disturbance


def test_a_finite_gain_cancels_the_disturbance_of_examples_2_and_3_and_not_independent_noises():
    assert all(cancels(system) for system in (EXAMPLE3, EXAMPLE2, EXAMPLE2_TB, STRUCTURED))
    assert not cancels(NOISES)
    assert not cancels(plant(SECOND, [[1, 0]]))
    nearly = plant(SECOND, [[1, 0]], [[1, 1], [1, 1]], [["0.2", "0.2000000000000000000001"]])
    assert not cancels(nearly)


def test_the_cancelling_gain_of_example_3_leaves_no_disturbance_and_converges():
    p, L = in_floats(EXAMPLE3), np.array([[5.0], [5.0]])
    assert not (p.B - L @ p.D).any()
    assert np.linalg.eigvals(p.A - L @ p.C).real == pytest.approx([-3, -3])


# The family


def test_the_constants_of_the_blocks_keep_their_proportions():
    declared = [rational_number(x) for x in ("0.5", "2", 0)]
    assert proportions(declared) == (rational_number("1/4"), 1, 0)
    assert proportions([rational_number(0)] * 2) == (1, 1)


def test_a_stretched_family_is_the_family_of_the_stretched_constants():
    stretched = unit(STRUCTURED, 0).stretched(rational_number("3.33"))
    declared = family(Lipschitz, STRUCTURED, "3.33", 0)
    pairs = zip(stretched.multiplier.blocks, declared.multiplier.blocks, strict=True)
    assert all((a.M11 == b.M11).all() and (a.M22 == b.M22).all() for a, b in pairs)
    assert in_floats(family(NormBound, EXAMPLE3, "0.3", 0)).stretched(2.0).lipschitz == pytest.approx(0.6)
