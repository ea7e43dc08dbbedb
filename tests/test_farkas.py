"""Exact proofs of infeasibility: textbook cases, observer inequalities, an independent check, tampering."""

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from flint import fmpq
from support.fractions import fractions, positive
from support.shipped import shipped
from support.sweep import SWEEP, rng

from obsdesign.families.incremental.absence import question, refuted
from obsdesign.families.incremental.theorems import L2, Linf
from obsdesign.lmi.faces import refutation, simplest
from obsdesign.lmi.farkas import CONSTANT, check, constraints
from obsdesign.lmi.formula import Inequality, Unknown, in_floats, rational, rational_number, symmetric
from obsdesign.lmi.solve import Status, minimise, widest
from obsdesign.model.plant import Plant
from obsdesign.nonlinearities.lipschitz import lipschitz
from obsdesign.nonlinearities.monotone import monotone
from obsdesign.nonlinearities.slope import slope


def plant(A, B, C, D, Bf, Cq):
    """Exact plant with f of one component."""
    A, B, C, D, Bf, Cq = map(rational, (A, B, C, D, Bf, Cq))
    (n, nw), ny = B.shape, len(C)
    empty = (rational(np.zeros(size)) for size in ((1, 1), (1, nw), (ny, 1)))
    Dqf, Dq, Df = empty
    labels = (tuple(f"{letter}{i + 1}" for i in range(size)) for letter, size in (("x", n), ("w", nw), ("y", ny)))
    return Plant(A, Bf, B, Cq, Dqf, Dq, C, Df, D, *labels)


AUGMENTED = shipped("corless2019-magnetic-bearing").augmented
FORCES = rational(np.eye(5)[3:])
CUBIC = plant(  # (47) of Chakrabarty et al. (2016)
    A=[[0, -1, 0], [0, -1, -1], [0, 1, -1]],
    B=[[1], [0], [0]],
    C=[[1, 0, 0]],
    D=[[0]],
    Bf=[[0], [1], [0]],
    Cq=[[1, -1, 0]],
)


def bearing(injection, alpha):
    return L2(AUGMENTED, monotone(None, 1, 1), FORCES, rational_number(alpha), None, rational([[0, injection]]))


def cubic(injection, alpha):
    gain = rational([[injection]])
    return Linf(CUBIC, monotone(None, 1, 1), rational(np.eye(3)), rational_number(alpha), None, gain)


X = (Unknown("x", (1, 1)),)
ONE = rational([[1]])


# textbook cases


def test_two_bounds_that_exclude_each_other_are_refuted_by_their_sum():
    def formula(v):
        return [Inequality("x <= -1", v["x"] + ONE), Inequality("x >= 0", -v["x"])]

    found = refutation(formula, X)
    assert found.holds
    below, above = (found.multipliers[name].item() for name in ("x <= -1", "x >= 0"))
    assert below == above > 0
    assert found.multipliers[CONSTANT].item() == below


def test_a_strict_inequality_is_refuted_at_its_edge_and_the_closed_one_is_not():
    def formula(strict):
        return lambda v: [Inequality("x < 0", v["x"], strict=strict), Inequality("x >= 0", -v["x"])]

    assert refutation(formula(True), X).holds
    assert refutation(formula(False), X) is None


def test_a_row_with_a_zero_diagonal_must_vanish():
    # [x, 1; 1, 0] <= 0 has no solution, but [x, 1; 1, -t] <= 0 has one for every t > 0
    def formula(v):
        return [Inequality("F", symmetric([[v["x"], ONE + 0 * v["x"]], [0 * v["x"]]]))]

    found = refutation(formula, X)
    assert found.holds
    assert found.multipliers["F"][1, 1] == 0 != found.multipliers["F"][0, 1]
    assert (
        refutation(lambda v: [Inequality("F", symmetric([[v["x"], ONE + 0 * v["x"]], [0 * v["x"] - ONE]]))], X) is None
    )


def test_rows_vanish_in_a_cascade():
    # the corner says y = 0, so that row of the second says x = 0, so the third cannot hold
    def formula(v):
        x, y, z = v["x"], v["y"], v["z"]
        return [
            Inequality("first", symmetric([[-z, y], [0 * z]])),
            Inequality("second", symmetric([[-z, x], [y]])),
            Inequality("third", x + ONE),
        ]

    unknowns = tuple(Unknown(name, (1, 1)) for name in "xyz")
    assert [c.vanishing.tolist() for c in constraints(formula, unknowns)][:2] == [[False, True], [False, True]]
    assert refutation(formula, unknowns).holds


def test_fractions_are_read_by_the_smallest_denominator():
    assert simplest(0.50003, 1e-3) == fmpq(1, 2)
    assert simplest(-0.3333, 1e-2) == fmpq(-1, 3)
    assert simplest(22.01, 1e-3) == 22
    assert simplest(1e-7, 1e-3) == 0


# observer inequalities


@pytest.mark.parametrize(("injection", "alpha"), [(0, "0.71"), (110, "0.71"), (-110, "60"), (-110, "55.001")])
def test_the_bearing_is_refuted_without_injection_with_its_sign_reversed_and_beyond_half_the_injection(
    injection, alpha
):
    assert refutation(*question(bearing(injection, alpha))).holds


@pytest.mark.parametrize("gamma", ["0.0153", "0.01", "0.0001", "0.000001"])
def test_a_gamma_below_the_limit_is_refuted(gamma):
    family = bearing(-110, "0.71")  # limit 0.0153161
    found = refutation(*question(family, rational_number(gamma)))
    assert found.holds
    assert found.multipliers[CONSTANT].item() > 0
    assert not refuted(family, None, found.multipliers).holds


def test_what_is_feasible_is_not_refuted():
    assert refutation(*question(bearing(-110, "54.9"))) is None
    assert refutation(*question(bearing(-110, "0.71"), rational_number("0.0154"))) is None
    assert refutation(*question(cubic(-1, "1"))) is None
    assert refutation(*question(cubic("-0.6", "0.5"))) is None


@pytest.mark.parametrize(("injection", "alpha"), [(0, "0.01"), (0, "1"), ("-0.4", "0.5"), (-1, "1.01"), (-2, "1.5")])
def test_the_cubic_example_is_refuted_unless_l2_is_at_most_minus_alpha_and_alpha_at_most_one(injection, alpha):
    assert refutation(*question(cubic(injection, alpha))).holds


def test_a_certificate_of_the_bearing_holds_in_a_few_independent_lines():
    # (13) of the bearing without injection, entry by entry: P Bf and P B are columns 2 and 4, 5 of P; kappa (Cq)' = e3
    found = refutation(*question(bearing(0, "0.71")))
    names = "V' + 2 alpha V + mu1 |z|^2 - mu2 |v|^2 <= 0", "P > 0", "lambda1 >= 0", CONSTANT
    Z, Zp, z, c = (fractions(found.multipliers[name]) for name in names)
    A = np.array([[0, 1, 0, 1, 0], [0, 0, 1, 0, 0], [0, 0, 0, 0, 1], [0] * 5, [0] * 5], dtype=object)
    C = np.array([[1, 0, 0, Fraction(1, 10), 0], [0, 1, 0, 0, 0]], dtype=object)
    E, f, v = Z[:5, :5], Z[:5, 5], Z[:5, 6:]
    outer = np.zeros((5, 5), dtype=object)
    outer[:, 1] += 2 * f
    outer[:, 3:] -= 2 * v
    by_P = 2 * (E @ A.T + Fraction(71, 100) * E) + outer - Zp
    assert not (by_P + by_P.T).any()  # the unknown P
    assert not (C @ E).any()  # Y; the output shows no v
    assert 2 * f[2] - z[0][0] == 0  # the scale
    assert np.trace(Z[6:, 6:]) == 0  # mu2
    assert E[3, 3] + E[4, 4] == c[0][0] >= 0  # the constant part
    keep = [0, 1, 2, 3, 4, 6, 7]  # the row of f is zero at every solution
    for matrix in (Z[np.ix_(keep, keep)], Zp):
        assert positive(matrix)
    assert np.trace(Zp) > 0


def test_a_certificate_survives_being_written_and_no_change_of_it_holds():
    family = bearing(-110, "60")
    written = refutation(*question(family)).written()
    multipliers = {name: rational(rows) for name, rows in written["multipliers"].items()}
    assert refuted(family, None, multipliers).holds
    for name, Z in multipliers.items():
        for place in np.ndindex(Z.shape):
            if name.startswith("V'") and place == (5, 5):
                continue  # the entry (f, f) is zero for every x
            changed = Z.copy()
            changed[place] += fmpq(1, 10**9)
            assert not refuted(family, None, {**multipliers, name: changed}).holds, (name, place)
    assert not refuted(bearing(-110, "59"), None, multipliers).holds
    assert not refuted(family, None, {}).holds
    assert not refuted(family, None, {name: 0 * Z for name, Z in multipliers.items()}).holds
    assert not refuted(family, None, {name: -Z for name, Z in multipliers.items()}).holds
    assert not refuted(family, None, {**multipliers, "P > 0": multipliers["P > 0"][:4, :4]}).holds
    assert not refuted(family, None, {**multipliers, "another": ONE}).holds


def test_a_multiplier_of_a_row_that_need_not_vanish_must_not_be_indefinite():
    def formula(v):
        return [Inequality("F", symmetric([[v["x"], ONE + 0 * v["x"]], [0 * v["x"] - ONE]]))]

    indefinite = {"F": rational([[0, 1], [1, 0]]), CONSTANT: rational([[2]])}
    made = check(formula, X, indefinite)
    assert [c.name for c in made.checks if not c.holds] == ["Z >= 0 for F"]


def families(count):
    """Random observer problems with small integers, and what phase I says of them."""
    random = rng(5)

    def draw(*shape):
        return random.integers(-3, 4, shape)

    for _ in range(count):
        n, ny, nw = (int(k) for k in random.integers((2, 1, 1), (5, 3, 3)))
        p = plant(
            draw(n, n), draw(n, nw), draw(ny, n), draw(ny, nw) * int(random.integers(2)), Bf=draw(n, 1), Cq=draw(1, n)
        )
        kinds = (monotone(None, 1, 1), lipschitz(fmpq(5), 1, 1), slope([(fmpq(0), fmpq(9))], 1, 1))
        kind, alpha = kinds[int(random.integers(3))], fmpq(int(random.integers(1, 80)), 10)
        cls = (L2, Linf)[int(random.integers(2))]
        yield cls(p, kind, rational(np.eye(n)), alpha, None, rational(draw(1, ny)))


@pytest.mark.sweep
def test_of_random_problems_most_infeasible_ones_are_refuted_and_no_feasible_one_is():
    outcomes, size = Counter(), SWEEP.size(36)
    for family in families(size):
        status = widest(in_floats(family).feasible()).status
        gamma = None
        if status is Status.OPTIMAL:
            assert refutation(*question(family)) is None
            least = minimise(in_floats(family).least_gamma())
            if least.status is not Status.OPTIMAL or least.objective < 1e-3:
                continue
            assert refutation(*question(family, rational_number(f"{1.05 * least.objective**0.5:.6g}"))) is None
            gamma = rational_number(f"{0.9 * least.objective**0.5:.6g}")
        elif status is Status.UNDECIDED:
            continue
        outcomes[refutation(*question(family, gamma)) is not None] += 1
    assert outcomes[True] > size / 2.25
    assert outcomes[True] > 3 * outcomes[False]
