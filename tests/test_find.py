"""Coordinates are found: those of closed form, in any names and units, and in words where there are none."""

import numpy as np
import pytest
from flint import fmpq, fmpq_mat
from scipy.linalg import solve_sylvester
from support.coordinates import (
    CHAIN,
    CUK,
    CUK_DOMAIN,
    CUK_NUMBERS,
    DUFFING,
    LORENZ,
    PROPOSITION_6,
    VAN_DER_POL,
    limits,
    plant,
    searched,
    value_at,
)  # fmt: skip

from obsdesign.errors import UndecidedError, UsageError
from obsdesign.expressions import Expression, constant, parse
from obsdesign.expressions.algebra import identical
from obsdesign.families.algebraic.coordinates import scheme
from obsdesign.families.algebraic.empirical import fit
from obsdesign.families.algebraic.forms import Estimator, Transformed
from obsdesign.families.algebraic.identity import Answer
from obsdesign.families.algebraic.rational import eigenvalues, kernel
from obsdesign.families.algebraic.regress import regressions
from obsdesign.families.algebraic.scheme import Plant
from obsdesign.model.equations import Typed


def same(expression, text, numbers=None):
    exact = {name: constant(value)[0] for name, value in (numbers or {}).items()}
    return identical(expression, parse(text, expression.names | set("yut") | {"y1", "y2", "i1", "i3"}, exact))


def cuk():
    return plant(CUK, {"y1": "v2", "y2": "i3"}, ("u",), CUK_NUMBERS)


def test_the_parameter_estimation_coordinates_of_the_cuk_converter():
    found = searched(cuk(), CUK_DOMAIN, negative=False)
    first, second = found.coordinates
    assert (first.phi.text, first.rate.text, second.rate.text) == ("i1", "0", "0")
    assert same(first.B, "(E-(1-u)*y1)/L1", CUK_NUMBERS)
    assert same(second.phi, "v4-(G*L3/C4)*i3", CUK_NUMBERS)
    assert same(second.B, "(y2+G*u*y1)/C4", CUK_NUMBERS)
    assert same(found.left_inverse["v4"], f"{second.name}+(G*L3/C4)*y2", CUK_NUMBERS)


@pytest.mark.parametrize("kappa", ["100", "637", "2.5"])
def test_the_coordinate_of_the_cuk_converter_for_every_gain(kappa):
    numbers = {**CUK_NUMBERS, "kappa": kappa}
    (found,) = searched(cuk(), CUK_DOMAIN, [f"-{kappa}*(1 - u)"]).coordinates
    assert same(found.phi, "i1 - kappa*C2*v2", numbers)
    assert same(found.B, "-kappa*(1-u)*kappa*C2*y1 - kappa*u*y2 + (E-(1-u)*y1)/L1", numbers)


@pytest.mark.parametrize("rate", ["-1", "-500", "-3000.5"])
def test_the_other_family_of_the_cuk_converter_for_every_lambda(rate):
    (found,) = searched(cuk(), CUK_DOMAIN, [rate]).coordinates
    assert same(found.phi, "v4 - L3*(lam + G/C4)*i3", {**CUK_NUMBERS, "lam": rate})


def test_the_cuk_converter_needs_no_estimator_on_a_domain_where_1_minus_u_is_positive():
    found = searched(cuk(), CUK_DOMAIN)
    assert [c.phi.text for c in found.coordinates][:1] == ["v4"]
    assert same(found.coordinates[0].rate, "-G/C4", CUK_NUMBERS)
    assert found.coordinates[1].rate.names == {"u"}
    assert found.missing == ()
    nowhere = searched(cuk(), zero=False)
    assert nowhere.missing == ("i1",)
    assert "1 - u is not proved to keep one sign on the domain" in " ".join(nowhere.remarks)
    assert "i1 solves its equation, but its lambda, 0, is not wanted" in " ".join(nowhere.remarks)


def test_proposition_6_is_found():
    equations = plant(PROPOSITION_6, {"y": "x1"}, ("u",))
    found = searched(equations)
    assert [(c.phi.text, c.rate.text) for c in found.coordinates] == [("x2", "-1"), ("x3", "0")]
    assert same(found.coordinates[0].B, "y**2 + sin(y)")
    assert same(found.coordinates[1].B, "1/(1 + y**2) + y*u")
    ((row,), powers) = regressions(found, Typed(equations, {}))
    assert (row.output, row.known.text, row.m["xi2"].text, powers) == ("y", "-y**3", "exp(xi2)", {"xi2"})


@pytest.mark.parametrize("rate", ["-0.5", "-2", "-3"])
def test_proposition_6_has_no_other_lambda_even_with_exponentials(rate):
    found = searched(plant(PROPOSITION_6, {"y": "x1"}, ("u",)), {}, [rate], ["exp(x3)", "exp(x2)"], degree=2)
    assert (found.coordinates, found.missing) == ((), ("x2", "x3"))


@pytest.mark.parametrize(("mu", "rate"), [("1", "-1"), ("0.5", "-4"), ("3", "-1/3")])
def test_van_der_pol_needs_degree_3(mu, rate):
    equations = plant(VAN_DER_POL, {"y": "x1"}, (), {"mu": mu})
    (found,) = searched(equations, {}, [rate]).coordinates
    assert same(found.phi, "x2 - mu*(x1 - x1**3/3) + lam*x1", {"mu": mu, "lam": rate})
    none = searched(equations, degree=2)
    assert none.missing == ("x2",)
    assert none.sentence.startswith("no coordinate was found that gives x2; searched: sums of products of x1, x2 up to")
    assert "but its lambda, " in none.remarks[0]  # x2 - mu x1 with -mu y^2, which is 0 where y is


def test_duffing_from_its_position_and_from_its_speed():
    (position,) = searched(plant(DUFFING, {"y": "x1"}, ("u",), {"delta": "0.3"}), {}, ["-2"]).coordinates
    assert same(position.phi, "x2 + (lam + delta)*x1", {"lam": "-2", "delta": "0.3"})
    speed = searched(plant(DUFFING, {"y": "x2"}, ("u",), {"delta": "0.3"}), degree=4)
    assert [(c.phi.text, c.rate.text, c.B.text) for c in speed.coordinates] == [("x1", "0", "y")]
    (energy,) = speed.others
    assert same(energy.phi, "4*(x2**2/2 - x1**2/2 + x1**4/4)")
    assert energy.rate.text == "0"


@pytest.mark.parametrize("outputs", [{"y": "a"}, {"y": "a + b"}, {"y": "2*a - c + u"}])
def test_a_linear_plant_by_the_sylvester_equation(outputs):
    found = searched(plant(CHAIN, outputs, ("u",)))
    T, B = (np.array(M.tolist(), dtype=float) for M in (found.sylvester.T, found.sylvester.B))
    A = np.array([[0, 1, 0], [0, 0, 1], [-1, -2, -3]])
    C = np.array(
        [[value_at(side.derivative(x), {}) for x in CHAIN] for side in plant(CHAIN, outputs, ("u",)).outputs.values()]
    )
    rates = [float(rate) for rate in found.sylvester.rates]
    assert solve_sylvester(-np.diag(rates), A, B @ C) == pytest.approx(T, rel=1e-9)
    assert found.sylvester.condition == pytest.approx(np.linalg.cond(np.vstack([T, C])))
    assert len(found.coordinates) == 2
    assert "no lambda is an eigenvalue of A; (Lambda, B) is controllable" in found.sylvester.sentence


def test_what_no_output_sees_has_a_lambda_that_is_an_eigenvalue():
    found = searched(plant({"a": "b - a", "b": "-2*b + a", "c": "-5*c + b"}, {"y": "a"}))
    assert found.missing == ()
    assert fmpq(-5) in found.sylvester.shared
    assert "eigenvalues of A" in found.sylvester.sentence
    unstable = searched(plant({"a": "b - a", "b": "-2*b + a", "c": "5*c + b"}, {"y": "a"}))
    assert unstable.missing == ("c",)
    assert "its lambda, 5, is not proved to be negative" in " ".join(unstable.remarks)
    irrational = searched(plant({"a": "-a", "c": "d", "d": "-c - 3*d"}, {"y": "a"}))
    assert irrational.missing == ("c", "d")
    assert "near -2.618, -0.382, which are not rational" in " ".join(irrational.remarks)


def test_a_cascade_takes_what_was_found_as_known():
    found = searched(plant(LORENZ, {"m": "x"}))
    first, second = found.coordinates
    assert same(first.phi, "z - x**2/20")
    assert first.rate.text == "-8/3"
    assert second.B.names == {"m", first.name}
    assert found.missing == ()
    assert "taken as known" in found.sentence


def test_a_double_eigenvalue_that_no_output_sees_is_a_cascade():
    found = searched(plant({"a": "-a", "c": "d - c", "d": "-d + a"}, {"y": "a"}))
    assert [(c.phi.text, c.rate.text, c.B.text) for c in found.coordinates] == [
        ("d", "-1", "y"),
        ("c", "-1", "xi1"),
    ]
    assert found.sylvester is None


@pytest.mark.parametrize("factors", [("1", "1"), ("2", "-3"), ("1/1000", "7e4")])
def test_names_order_and_units_of_the_states_do_not_matter(factors):
    p, q = (constant(factor)[0] for factor in factors)
    change = {  # x1 = p second, x2 = q first
        "x1": Expression.combination([p], [Expression.variable("second")]),
        "x2": Expression.combination([q], [Expression.variable("first")]),
    }
    sides = {name: parse(text, ["x1", "x2", "mu"]).substituted(change) for name, text in VAN_DER_POL.items()}
    dynamics = {
        "first": Expression.combination([1 / q], [sides["x2"]]).text,
        "second": Expression.combination([1 / p], [sides["x1"]]).text,
    }
    usual = searched(plant(VAN_DER_POL, {"y": "x1"}, (), {"mu": "2"}))
    other = searched(plant(dynamics, {"y": f"{p}*second"}, (), {"mu": "2"}))
    (a,), (b,) = usual.coordinates, other.coordinates
    assert a.rate.text == b.rate.text
    scaled = Expression.combination([1 / q], [a.phi.substituted(change)])
    assert identical(scaled, b.phi)
    assert len(usual.others) == len(other.others)


@pytest.mark.parametrize("seed", range(5))
def test_a_coordinate_that_was_hidden_in_other_states_comes_back(seed):
    a, b, c = np.random.default_rng(seed).integers(-4, 5, 3)
    p, slope = f"({a}*x1 + {b}*x1**2 + {c}*x1**3)", f"({a} + {2 * b}*x1 + {3 * c}*x1**2)"
    z = f"(x2 + {p})"  # z' = -2 z + y^2, y' = z^2 - y
    equations = plant({"x1": f"{z}**2 - x1", "x2": f"-2*{z} + x1**2 - {slope}*({z}**2 - x1)"}, {"y": "x1"})
    (found,) = searched(equations, zero=False).coordinates
    assert same(found.phi, z)
    assert (found.rate.text, found.B.text) == ("-2", "y**2")


def test_where_there_is_nothing_the_states_and_the_ansatz_are_named():
    found = searched(plant({"x1": "x2*x3 - x1", "x2": "x3**2 - x2*x3", "x3": "x1*x2 - x3*x2"}, {"y": "x1"}))
    assert (found.coordinates, found.missing, dict(found.left_inverse)) == ((), ("x2", "x3"), {})
    assert found.sentence == (
        "no coordinate was found that gives x2, x3; searched: sums of products of x1, x2, x3 up to degree 3, "
        "lambda = k s for every rational k and s = 1, y, y**2"
    )


def test_an_output_that_is_linear_in_no_state_is_known_all_the_same():
    pendulum = plant({"angle": "w", "w": "-sin(angle) - w/10"}, {"m": "sin(angle)"})
    found = searched(pendulum)
    assert [(c.phi.text, c.B.text) for c in found.coordinates] == [("w", "-m"), ("angle + 10*w", "-10*m")]
    assert "m is linear in no state" in found.remarks[0]
    product = plant({"x1": "u - x1", "x2": "-x1*x2"}, {"m": "x1*x2"}, ("u",))
    assert searched(product, {"x1": (1, 2)}).left_inverse["x2"].text == "m/xi1"
    assert searched(product, {"x1": (0, 2)}, zero=False).missing == ("x2",)  # m says nothing of x2 where x1 = 0


def test_outputs_may_give_every_state_by_themselves():
    found = searched(plant({"a": "-a", "b": "a*b"}, {"y": "a", "z": "a + b"}))
    assert (found.coordinates, found.left_inverse["b"].text, found.missing) == ((), "z - y", ())
    assert found.sentence.startswith("the outputs give every state")


def test_an_output_that_sees_no_state_leaves_what_decays_by_itself():
    found = searched(plant({"a": "u - a"}, {"y": "u"}, ("u",)))
    assert [(c.phi.text, c.rate.text, c.B.text) for c in found.coordinates] == [("a", "-1", "u")]
    assert found.sylvester.shared == (-1,)


def test_products_that_are_too_large_are_said():
    large = {"a": " + ".join(f"sin({k}*a)*exp(b/{k})" for k in range(1, 12)), "b": "1/(2 + sin(7*a) + b**9)"}
    with pytest.raises(UndecidedError, match=r"products up to degree 3: .*; lower observer.degree"):
        searched(plant(large, {"y": "exp(a)*(1 + b**2)**12/(3 + sin(9*a))"}))


def test_a_lambda_that_is_not_negative_is_not_tried():
    found = searched(plant(VAN_DER_POL, {"y": "x1"}, (), {"mu": "1"}), {"x1": (-3, 3)}, ["2", "-y**2", "0"], zero=False)
    said = "is not proved to be negative on the domain, and was not tried"
    assert found.remarks == (
        f"lambda = 2 {said}",
        f"lambda = -y**2 {said}",
        "lambda = 0 is not wanted, and was not tried",
    )


def test_what_an_output_says_of_a_state_may_be_curved():
    found = searched(plant({"soc": "-i/3600", "v": "-v/2 + i"}, {"y": "3 + soc**3 - v - i/10"}, ("i",)))
    assert found.missing == ()
    assert {c.phi.text for c in found.coordinates} <= {"v", "soc"}


def test_jumps_at_places_that_are_not_known_must_cancel():
    rubbing = {"x": "v", "v": "u - v - sign(v)", "w": "-w - sign(v)"}
    found = searched(plant(rubbing, {"y": "x"}, ("u",)))
    assert ([c.phi.text for c in found.others], found.missing) == (["v - w"], ("v", "w"))
    seen = searched(plant({"a": "-a*b", "b": "sign(a + b) - 2*b"}, {"y": "a + b"}))
    assert [c.B.text for c in seen.coordinates] == ["sign(y)"]
    with pytest.raises(UsageError, match=r"sign\(v\) has a kink or a jump; phi must be smooth"):
        searched(plant(rubbing, {"y": "x"}, ("u",)), functions=["sign(v)"])


def test_user_functions_are_products_too():
    pendulum = plant({"angle": "w", "w": "-sin(angle) - w/10"}, {"y": "w"})
    found = searched(pendulum, functions=["cos(angle)", "sin(angle)"])
    (energy,) = found.others
    assert same(energy.phi, "2*(w**2/-4 + cos(angle)/2)")
    assert not any(c.phi.text == "1" for c in found.others)  # sin^2 + cos^2 is no coordinate


def test_a_large_plant_is_searched_up_to_a_lower_degree():
    dynamics = {f"x{i}": f"-x{i} + x{i % 12 + 1}*x{(i + 1) % 12 + 1}" for i in range(1, 13)}
    assert "up to degree 2 (not 3: there would be more than 300)" in searched(plant(dynamics, {"y": "x1"})).sentence


def test_table_1_has_the_regressions_that_are_found():
    found = searched(cuk(), CUK_DOMAIN, negative=False)
    rows, powers = regressions(found, Typed(cuk(), {}))
    assert powers == frozenset()
    assert same(rows[0].known, "((1-u)*xi1 + u*y2)/C2", CUK_NUMBERS)
    assert same(rows[0].m["xi1"], "(1-u)/C2", CUK_NUMBERS)
    assert same(rows[1].known, "-(u*y1 + xi2 + (G*L3/C4)*y2)/L3", CUK_NUMBERS)
    assert same(rows[1].m["xi2"], "-1/L3", CUK_NUMBERS)


def test_a_constant_that_no_derivative_is_linear_in_has_no_regression():
    equations = plant(DUFFING, {"y": "x2"}, ("u",), {"delta": "0.3"})
    assert regressions(searched(equations), Typed(equations, {})) == ((), frozenset())


CERTIFIED = {
    "Cuk": (cuk(), CUK_DOMAIN, {}),
    "Cuk, lambda 0": (cuk(), CUK_DOMAIN, {"negative": False}),
    "Proposition 6": (plant(PROPOSITION_6, {"y": "x1"}, ("u",)), {}, {}),
    "cascade": (plant(LORENZ, {"m": "x"}), {}, {}),
    "divisor": (plant({"x1": "u - x1", "x2": "-x1*x2"}, {"m": "x1*x2"}, ("u",)), {"x1": (1, 2)}, {}),
}


@pytest.mark.parametrize("name", CERTIFIED)
def test_what_is_found_is_proved_like_what_is_given(name):
    equations, domain, changes = CERTIFIED[name]
    typed = Typed(equations, limits(domain))
    found = searched(equations, domain, **changes)
    rows, powers = regressions(found, typed)
    gamma = {c.name: fmpq(1) for c in found.coordinates if c.estimated}
    estimator = Estimator(rows, "gradient", fmpq(1), gamma, fmpq(0), fmpq(1), {}, powers, consistent=True)
    form = Transformed(found.coordinates, found.left_inverse, estimator if rows else None, recast=False)
    assert {name for row in rows for name in row.m} == set(gamma)
    plant = Plant.of(typed)
    for statement in scheme(plant, form).statements:
        assert statement.decided(plant.region).answer is Answer.PROVED, statement.name


@pytest.mark.parametrize("seed", range(8))
def test_eigenvalues_of_a_tall_pencil_are_those_that_were_put_in(seed):
    random = np.random.default_rng(seed)

    def drawn(rows, columns):
        return fmpq_mat(rows, columns, [int(n) for n in random.integers(-3, 4, rows * columns)])

    def block(*parts):
        rows, columns = sum(p.nrows() for p in parts), sum(p.ncols() for p in parts)
        M, i, j = fmpq_mat(rows, columns), 0, 0
        for p in parts:
            for a in range(p.nrows()):
                for b in range(p.ncols()):
                    M[i + a, j + b] = p[a, b]
            i, j = i + p.nrows(), j + p.ncols()
        return M

    free = seed % 2 == 0  # [lambda, 1] has a kernel for every lambda, its transpose for none
    put = [fmpq(int(n), 2) for n in random.integers(-4, 5, 2)]
    singular = ([[0, 1]], [[1, 0]]) if free else ([[0], [1]], [[1], [0]])
    M0 = block(fmpq_mat([[put[0], 1], [0, put[1]]]), fmpq_mat(singular[0]), fmpq_mat([[1, 0], [0, 1]]))
    M1 = block(fmpq_mat([[1, 0], [0, 1]]), fmpq_mat(singular[1]), fmpq_mat([[0, 1], [0, 0]]))
    left, right = drawn(M0.nrows() + 2, M0.nrows()), drawn(M0.ncols(), M0.ncols())
    if left.rank() < M0.nrows() or right.det() == 0:
        pytest.skip("a change of basis that is none")
    found = eigenvalues(left * M0 * right, left * M1 * right)
    assert (found.every, set(found.rational), found.others) == (free, set(put), ())
    usual = len(kernel(left * (M0 - fmpq(17) * M1) * right))
    assert all(len(kernel(left * (M0 - k * M1) * right)) > usual for k in put)


def test_a_fitted_left_inverse_is_judged_by_runs_that_were_not_fitted():
    equations = plant(VAN_DER_POL, {"y": "x1"}, (), {"mu": "1"})
    found = fit(Typed(equations, limits({"x1": (-3, 3), "x2": (-3, 3)})), {})
    assert found.sentence.startswith("empirical, no guarantee")
    assert found.errors["x2"].transient < 1e-4
    assert found.errors["x2"].settled < 1e-5
    with pytest.raises(UsageError, match="x2 has no bounded range"):
        fit(Typed(equations, limits({"x1": (-3, 3)})), {})


def test_a_fitted_left_inverse_needs_the_past_of_the_input():
    equations = plant(DUFFING, {"y": "x1"}, ("u",), {"delta": "0.3"})
    domain, names = limits({"x1": (-2, 2), "x2": (-2, 2)}), ["t"]
    found = fit(Typed(equations, domain), {"u": parse("cos(t)/2", names)}, degree=3)
    forced = plant({**DUFFING, "x2": DUFFING["x2"].replace("u", "cos(t)/2")}, {"y": "x1"}, (), {"delta": "0.3"})
    unfiltered = fit(Typed(forced, domain), {}, degree=3)
    assert found.errors["x2"].transient * 10 < unfiltered.errors["x2"].transient
    assert {name for side in found.dynamics.values() for name in side.names} > {"u", "y"}
