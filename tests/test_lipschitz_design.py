"""Designs of Lipschitz observers: limits and reference values, slack, bounds, curves, and what is refused."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from flint import fmpq
from support.plants import plant, zeros

from obsdesign.dissipation.bounds import Bounds, Range
from obsdesign.dissipation.certificate import certify
from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UsageError
from obsdesign.families.lipschitz.design import design_lipschitz
from obsdesign.families.lipschitz.relaxations import RELAXATIONS, Lipschitz, lipschitz_multiplier, proportions
from obsdesign.families.lipschitz.request import LipschitzRequest
from obsdesign.lmi.formula import in_floats, printed, rational, rational_number

ROOM = 1 + 1e-4  # accuracy of a limit


def design(system, lipschitz="1", H=0.5, sizes=None, **asked):
    constants = tuple(map(rational_number, (lipschitz,) if isinstance(lipschitz, str) else lipschitz))
    multiplier = lipschitz_multiplier(constants, sizes or [(len(system.Cq), system.Bf.shape[1])])
    numbers = {k: rational_number(v) if isinstance(v, str) and k in {"rate", "weight"} else v for k, v in asked.items()}
    if "gains" in numbers:
        numbers["gains"] = {"L": rational(numbers["gains"])}
    weight = rational(H * np.eye(system.n)) if np.isscalar(H) else rational(H)
    return design_lipschitz(system, multiplier, weight, LipschitzRequest("lipschitz", constants, **numbers), Engine())


def bound(size, norm="spectral"):
    return Bounds(L1=rational_number(size), norm=norm)


def proved_again(system, made, lipschitz="1", H=0.5, decay="0", sizes=None):
    """Certificate for the gains as a file holds them, from the certificate's own P and scales."""
    constants = tuple(map(rational_number, (lipschitz,) if isinstance(lipschitz, str) else lipschitz))
    unit = lipschitz_multiplier(proportions(constants), sizes or [(len(system.Cq), system.Bf.shape[1])])
    weight, still = rational(H * np.eye(system.n)), zeros(len(system.Cq), len(system.C))
    L1 = -printed(made.gains["L"])
    family = Lipschitz(system, unit, weight, rational_number(decay), L1, still).stretched(made.claim.lipschitz)
    old = made.claim.certificate
    return certify(family, old.gamma, old.mu1, old.mu2, {"P": old.P, **old.multipliers})


def numbers(made):
    return float(made.claim.lipschitz), float(made.claim.certificate.gamma)


SECOND = plant([[0, 1], [1, -1]], [[1, 0]])
DEGENERATE = plant([[0, 1], [-1, -1]], [[1, 0]], [[1], [1]], [["0.2"]])  # L D = B has the solution [5, 5]
NOISES = plant([[0, 1], [-1, -1]], [[1, 0]], [[1, 0], [1, 0]], [[0, "0.2"]])
PRINTED = [["23.7025"], ["13.7272"]]
LINK = [[0, 1, 0, 0], ["-48.6", "-1.25", "48.6", 0], [0, 0, 0, 1], ["19.5", 0, "-19.5", 0]]
SENSORS = [[1, 0, 0, 0], [0, 1, 0, 0]]
JOINT = plant(LINK, SENSORS, [[1]] * 4, [["0.1"], ["0.25"]], [[0], [0], [0], [1]], [[0, 0, 1, 0]])
JOINT_GAIN = [["33.4865", "38.5694"], ["129.9249", "282.8603"], ["59.89713", "102.1561"], ["108.2134", "171.0910"]]


def random_plant(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    A, C = rng.standard_normal((n, n)).round(2), rng.standard_normal((1, n)).round(2)
    B, D = rng.standard_normal((n, 2)).round(2), rng.standard_normal((1, 2)).round(2)
    return plant(A - np.eye(n), C, B, D)


# The largest constant


@pytest.mark.parametrize(("relaxation", "supremum"), [("s-procedure", math.sqrt(2)), ("norm-bound", 1.2071067811865)])
def test_the_largest_constant_is_shipped_within_its_slack(relaxation, supremum):
    made = design(SECOND, "1", relaxation=relaxation)
    assert made.limit["lipschitz"] == pytest.approx(supremum, rel=1e-8)
    assert supremum / 1.05 * (1 - 1e-5) <= float(made.claim.lipschitz) <= supremum / 1.05
    assert proved_again(SECOND, made).holds
    assert made.beyond["ceiling"] == pytest.approx(math.sqrt(2), rel=1e-8)


def test_a_largest_constant_below_the_declared_one_is_an_answer_with_a_warning():
    made = design(SECOND, "2")
    assert made.status == "certified"
    assert any("below the declared 2" in note for note in made.notes)


@pytest.mark.parametrize("norm", ["spectral", "frobenius"])
@pytest.mark.parametrize("relaxation", RELAXATIONS)
def test_a_bound_on_the_gain_costs_part_of_the_constant(relaxation, norm):
    made = design(DEGENERATE, "1", relaxation=relaxation, bounds=bound("2", norm))
    assert np.linalg.norm(made.gains["L"]) <= 2
    best = made.limit_bounded["lipschitz"]
    assert best < made.limit["lipschitz"]
    assert best / 1.05 * (1 - 1e-5) <= float(made.claim.lipschitz) <= best
    assert proved_again(DEGENERATE, made).holds


def test_the_constant_falls_with_the_bound_on_the_storage_function_as_published():
    """P >= delta I of Theorem 1: 1.2066 and 1.2021 for delta = 1e-3 and 1e-2."""
    for delta, constant in (("0.001", 1.2066), ("0.01", 1.2021)):
        made = design(SECOND, "1", relaxation="norm-bound", bounds=Bounds(floor=rational_number(delta)))
        assert made.limit_bounded["lipschitz"] == pytest.approx(constant, abs=1e-4)
        assert proved_again(SECOND, made).holds


def test_bounds_that_mean_nothing_are_refused():
    with pytest.raises(UsageError, match="no scale in the s-procedure"):
        design(SECOND, bounds=Bounds(floor=fmpq(1, 100)))
    with pytest.raises(UsageError, match="max-lipschitz knows no gamma"):
        design(SECOND, bounds=Bounds(gamma=fmpq(1)))


def test_an_unbounded_constant_is_refused_with_a_table_unless_the_gain_is_bounded():
    with pytest.raises(UsageError, match="no largest Lipschitz constant") as refusal:
        design(JOINT, "3.33")
    table = [float(row.split(" = ")[1]) for row in refusal.value.problems[0].rows]
    assert len(table) > 3
    assert table == sorted(table)
    made = design(JOINT, "3.33", bounds=bound("300"))
    assert made.limit["lipschitz"] == math.inf
    assert np.linalg.norm(made.gains["L"], 2) <= 300
    assert float(made.claim.lipschitz) > 100


def test_a_hidden_unstable_mode_is_said_and_nothing_is_solved():
    made = design(plant([[1, 0], [0, -1]], [[0, 1]]))
    assert (made.status, made.diagnosis["condition"]) == ("infeasible", "detectability")


def test_several_blocks_grow_in_proportion_and_tolerate_more_than_one_block():
    A, C = [[0, 1], [-1, -1]], [[1, 0]]
    whole = plant(A, C)
    parted = design(whole, ("1", "0.5"), sizes=[(1, 1), (1, 1)], bounds=bound("5"))
    assert parted.status == "certified"
    assert proved_again(whole, parted, ("1", "0.5"), sizes=[(1, 1), (1, 1)]).holds
    together = design(whole, "1", bounds=bound("5"))
    assert parted.limit_bounded["lipschitz"] > together.limit_bounded["lipschitz"]
    assert parted.limit_bounded["lipschitz"] <= parted.limit["lipschitz"] * ROOM


# The least gamma


@pytest.mark.parametrize(
    ("relaxation", "gamma"), [("s-procedure", 0.14675), ("norm-bound", 0.22565), ("abbaszadeh", 0.49423)]
)
def test_least_gamma_of_each_relaxation_is_that_of_the_reference(relaxation, gamma):
    made = design(NOISES, "0.4167", relaxation=relaxation, objective="min-gamma", rate="0.05")
    assert made.limit["gamma"] == pytest.approx(gamma, rel=1e-4)
    assert made.limit["gamma"] <= numbers(made)[1] <= 1.05 * made.limit["gamma"]
    assert proved_again(NOISES, made, "0.4167", decay="0.05").holds
    assert float(made.claim.admissible.lipschitz) > 0.4167
    assert made.claim.admissible.certificate.holds


def test_what_a_gain_tolerates_is_that_of_the_s_procedure_whatever_it_was_designed_by():
    made = design(NOISES, "0.4167", relaxation="abbaszadeh", objective="min-gamma", rate="0.05")
    analyzed = design(NOISES, "0.4167", rate="0.05", gains=made.gains["L"])
    assert float(made.claim.admissible.lipschitz) == pytest.approx(numbers(analyzed)[0], rel=1e-5)


def test_theorem_3_is_not_monotone_and_the_best_over_larger_constants_is_reported():
    scaled = [[0, 1, 0, 0], ["-48.6", "-1.25", "12.15", 0], [0, 0, 0, 40], ["1.95", 0, "-0.4875", 0]]
    system = plant(scaled, SENSORS, [[1]] * 4, [["0.1"], ["0.25"]])
    made = design(system, "0.08325", relaxation="abbaszadeh", objective="min-gamma", rate="0.2")
    assert made.limit["gamma"] == pytest.approx(1.38628, rel=1e-4)
    assert made.beyond["widened"]["gamma"] == pytest.approx(0.81848, rel=1e-4)
    assert made.beyond["widened"]["lipschitz"] > 0.4


@pytest.mark.parametrize("relaxation", ["s-procedure", "norm-bound"])
def test_a_gain_that_cancels_the_disturbance_is_told_and_certified_at_a_small_level(relaxation):
    made = design(DEGENERATE, "0.4167", relaxation=relaxation, objective="min-gamma", rate="0.05")
    assert made.limit == {"gamma": 0.0, "attained": True}
    assert made.status == "certified"
    assert numbers(made)[1] < 0.01
    assert any("L D = B" in note for note in made.notes)


def test_a_gamma_that_falls_without_end_is_refused_with_a_table():
    """Without noise in the output, the zero of w to y is stable and a larger gain always attenuates more."""
    silent = plant([[-1, 1], [0, -2]], [[0, 1]], [[0], [1]], [[0]])
    with pytest.raises(UsageError, match=r"least gamma is 0.*bounds: \{L"):
        design(silent, "0.1", objective="min-gamma")
    made = design(silent, "0.1", objective="min-gamma", bounds=bound("10"))
    assert made.limit["gamma"] == 0
    assert made.limit_bounded["gamma"] <= numbers(made)[1] <= 1.05 * made.limit_bounded["gamma"]


@pytest.mark.parametrize("relaxation", RELAXATIONS)
def test_bounds_on_the_gain_and_on_gamma_are_kept(relaxation):
    asked = {"relaxation": relaxation, "objective": "min-gamma", "rate": "0.05"}
    made = design(NOISES, "0.4167", bounds=bound("3", "frobenius"), **asked)
    assert np.linalg.norm(made.gains["L"]) <= 3
    assert made.limit["gamma"] < made.limit_bounded["gamma"] <= numbers(made)[1] <= 1.05 * made.limit_bounded["gamma"]
    between = made.limit_bounded["gamma"] * 1.02
    within = design(NOISES, "0.4167", bounds=replace(bound("3", "frobenius"), gamma=printed(between)), **asked)
    assert numbers(within)[1] <= between
    short = design(NOISES, "0.4167", bounds=replace(bound("3"), gamma=fmpq(1, 100)), **asked)
    assert (short.status, short.diagnosis["condition"]) == ("infeasible", "gamma")


def test_a_constant_beyond_the_closed_form_is_answered_without_a_solver():
    engine = Engine()
    constants = (rational_number("0.4167"),)
    request = LipschitzRequest("lipschitz", constants, "abbaszadeh", "min-gamma", rate=fmpq(1, 2))
    multiplier = lipschitz_multiplier(constants, [(2, 2)])
    made = design_lipschitz(DEGENERATE, multiplier, rational(0.5 * np.eye(2)), request, engine)
    assert (made.status, engine.solves) == ("infeasible", 0)
    assert made.diagnosis["lipschitz"]["supremum"] == pytest.approx(0.27538128, rel=1e-7)


@pytest.mark.parametrize("seed", range(6))
def test_the_relaxations_are_ordered_on_random_plants_and_their_designs_keep_the_slack(seed):
    system = random_plant(seed)
    largest = {name: design(system, "1", relaxation=name) for name in RELAXATIONS[:2]}
    limits = [made.limit["lipschitz"] for made in largest.values()]
    assert limits[0] >= limits[1] / ROOM
    for made in largest.values():
        assert made.limit["lipschitz"] / 1.05 * (1 - 1e-5) <= numbers(made)[0] <= made.limit["lipschitz"] * ROOM
        assert proved_again(system, made).holds
    constant = repr(round(0.4 * limits[1], 4))
    gammas = []
    for name in RELAXATIONS:
        made = design(system, constant, 0.1, relaxation=name, objective="min-gamma", bounds=bound("100"))
        if made.status == "infeasible":
            assert name == "abbaszadeh"
            continue
        gammas.append(made.limit["gamma"])
        best = made.limit_bounded["gamma"]
        assert best / ROOM <= numbers(made)[1] <= 1.05 * best
        assert np.linalg.norm(made.gains["L"], 2) <= 100
        assert proved_again(system, made, constant, 0.1).holds
    assert all(tight <= loose * ROOM for tight, loose in pairwise(gammas))


# Given gains


@pytest.mark.parametrize(("C", "constant"), [([[1, 0]], 1.20046), ([[0, 1]], 0.34585)])
def test_theorem_1_certifies_the_published_gain_for_the_constant_of_the_reference(C, constant):
    made = design(plant([[0, 1], [1, -1]], C), relaxation="abbaszadeh", gains=[["56.8334"], ["21.9074"]])
    assert made.status == "certified"
    assert numbers(made)[0] == pytest.approx(constant, rel=3e-4)


@pytest.mark.parametrize(
    ("decay", "gamma"), [("0", 0.26933), ("0.05", 0.28259), ("0.2", 0.33114), ("0.3", 0.37335), ("0.5", 0.49766)]
)
def test_the_s_procedure_certifies_the_published_gain_for_the_gamma_of_the_reference(decay, gamma):
    made = design(DEGENERATE, "0.4167", objective="min-gamma", rate=decay, gains=PRINTED)
    assert numbers(made)[1] == pytest.approx(gamma, rel=2e-4)
    assert made.limit == {"gamma": 0.0, "attained": True}
    assert proved_again(DEGENERATE, made, "0.4167", decay=decay).holds


@pytest.mark.parametrize(("constant", "decay", "gamma"), [("0.4167", "0", 0.7244), ("0.5525", "0.05", 1.16498)])
def test_theorem_3_certifies_the_published_gain_for_the_gamma_of_the_reference(constant, decay, gamma):
    made = design(DEGENERATE, constant, relaxation="abbaszadeh", objective="min-gamma", rate=decay, gains=PRINTED)
    assert numbers(made)[1] == pytest.approx(gamma, rel=3e-4)


def test_structure_certifies_the_published_gain_of_the_flexible_joint():
    made = design(JOINT, "3.33", objective="min-gamma", rate="0.2", gains=JOINT_GAIN)
    assert numbers(made)[1] == pytest.approx(0.2724, rel=3e-4)
    assert float(made.claim.admissible.lipschitz) > 50


def test_gains_that_achieve_nothing_are_said_to():
    for objective in ("max-lipschitz", "min-gamma"):
        made = design(DEGENERATE, "0.3", objective=objective, gains=[[-50], [3]])
        assert (made.status, made.diagnosis["condition"]) == ("infeasible", "gains")
    slow = design(DEGENERATE, "1.4", objective="min-gamma", gains=PRINTED, rate="0.3")
    assert slow.diagnosis["feasible"]["lipschitz"] == pytest.approx(1.12478, rel=1e-3)


@pytest.mark.parametrize("sizes", [[(2, 2)], [(1, 1), (1, 1)]])
def test_gains_that_tolerate_any_constant_are_certified_for_an_example(sizes):
    """f drives a state that neither its argument nor the other state depends on."""
    system = plant([[-1, 1], [0, -1]], [[1, 0]], Bf=[[1, 1], [0, 0]], Cq=[[0, 1], [0, 2]])
    constants = ("1",) * len(sizes)
    made = design(system, constants, sizes=sizes, gains=[[1], [0]])
    assert any("any Lipschitz constant" in note for note in made.notes)
    assert float(made.claim.lipschitz) > 100
    assert proved_again(system, made, constants, sizes=sizes).holds


@pytest.mark.parametrize("slack", ["0.01", "0.3"])
def test_the_slack_is_the_one_that_is_asked_for(slack):
    made = design(SECOND, relaxation="norm-bound", slack=rational_number(slack))
    assert numbers(made)[0] == pytest.approx(made.limit["lipschitz"] / (1 + float(slack)), rel=1e-5)
    made = design(NOISES, "0.4167", objective="min-gamma", rate="0.05", slack=rational_number(slack))
    assert numbers(made)[1] == pytest.approx(made.limit["gamma"] * (1 + float(slack)), rel=1e-4)


@pytest.mark.parametrize("relaxation", ["s-procedure", "norm-bound"])
def test_within_bounds_the_weight_one_asks_for_the_largest_constant(relaxation):
    asked = {"relaxation": relaxation, "rate": "0.05", "bounds": bound("5")}
    largest = design(NOISES, "0.2", **asked).limit_bounded["lipschitz"]
    found = design(NOISES, "0.2", objective="pareto", weight="1", **asked).limit_bounded["lipschitz"]
    assert 0.995 * largest <= found <= ROOM * largest


# Pareto

CURVE = {"relaxation": "abbaszadeh", "objective": "pareto", "rate": "0.05"}
TABLE = {
    0.4: (0.38644, 0.2093),
    0.5: (0.43272, 0.5173),
    0.6: (0.46967, 0.6994),
    0.7: (0.50367, 0.8703),
    0.8: (0.54027, 1.0812),
    0.9: (0.57813, 1.36482),
    0.94: (0.59400, 1.5529),
    0.98: (0.61701, 2.0374),
}


def test_the_curve_is_that_of_the_reference_and_every_point_is_certified():
    made = design(DEGENERATE, "0.3", weight=Range(fmpq(0), fmpq(1), 51), **CURVE)
    points = {round(point["weight"], 3): point for point in made.search.points}
    for weight, (lipschitz, gamma) in TABLE.items():
        assert points[weight]["lipschitz"] == pytest.approx(lipschitz, rel=1e-4)
        assert points[weight]["gamma"] == pytest.approx(gamma, rel=1e-3 if weight < 0.5 else 1e-4)
    for weight, point in points.items():
        assert point["status"] == "certified"
        done = point["certified"]
        reached = weight / done["lipschitz"] + (1 - weight) * done["gamma"] ** 2
        assert point["objective"] / ROOM <= reached
        assert reached <= 1.05 * point["objective"] * ROOM or weight in {0, 1}
        assert point["attained"] == (weight < 0.8453)
        assert point["corner"] == (0 < weight <= 0.36) or weight == 0.38
    assert points[0.2]["lipschitz"] == pytest.approx(0.37652, rel=1e-4)
    assert points[0.2]["gamma"] == 0
    assert points[1]["lipschitz"] == pytest.approx(0.64971305, rel=1e-7)
    assert "gamma" not in points[1]
    assert "lipschitz" not in points[0]
    assert proved_again(DEGENERATE, made, "0.3", decay="0.05").holds


def test_a_surface_has_no_points_where_the_closed_form_forbids_them():
    decays = Range(fmpq(0), fmpq(1, 2), 3)
    made = design(DEGENERATE, "0.4167", weight=Range(fmpq(1, 2), fmpq(9, 10), 3), **{**CURVE, "rate": decays})
    assert [point["status"] for point in made.search.points] == ["certified"] * 6 + ["infeasible"] * 3
    assert {"weight", "decay", "status"} == set(made.search.points[-1])
    assert float(made.claim.certificate.rate) == 0
    constants = [point["lipschitz"] for point in made.search.points[:6]]
    assert all(slow > fast for slow, fast in zip(constants[:3], constants[3:], strict=True))


@pytest.mark.parametrize("relaxation", RELAXATIONS)
@pytest.mark.parametrize("weight", ["0", "0.6", "1"])
def test_one_weight_ships_a_gain_within_the_slack_of_the_objective(relaxation, weight):
    made = design(NOISES, "0.2", relaxation=relaxation, objective="pareto", rate="0.05", weight=weight)
    assert proved_again(NOISES, made, "0.2", decay="0.05").holds
    constant, gamma = numbers(made)
    share = float(weight)
    reached = (share / constant if share else 0) + (1 - share) * gamma**2
    assert made.limit["objective"] / ROOM <= reached or weight == "1"
    if weight != "1":
        assert reached <= 1.05 * made.limit["objective"] * ROOM
    assert any("arbitrary" in note for note in made.notes) == (weight in {"0", "1"})


@pytest.mark.parametrize("relaxation", ["s-procedure", "norm-bound"])
def test_the_searched_optimum_is_no_worse_than_any_constant_on_a_fine_grid(relaxation):
    asked = {"relaxation": relaxation, "rate": "0.05"}
    made = design(NOISES, "0.2", objective="pareto", weight="0.6", **asked)
    constants = np.linspace(0.2, 0.98, 8) * design(NOISES, "0.2", **asked).limit["lipschitz"]
    for constant in constants[constants > 0.2]:
        gamma = design(NOISES, repr(float(constant)), objective="min-gamma", **asked).limit["gamma"]
        assert made.limit["objective"] <= (0.6 / constant + 0.4 * gamma**2) * ROOM


@pytest.mark.parametrize("relaxation", ["abbaszadeh", "s-procedure"])
def test_pareto_keeps_a_bound_on_the_gain(relaxation):
    made = design(
        NOISES, "0.2", relaxation=relaxation, objective="pareto", rate="0.05", weight="0.6", bounds=bound("2.5")
    )
    assert np.linalg.norm(made.gains["L"], 2) <= 2.5
    constant, gamma = numbers(made)
    best = made.limit_bounded["objective"]
    assert made.limit["objective"] < best
    assert best / ROOM <= 0.6 / constant + 0.4 * gamma**2 <= 1.05 * best * ROOM


def test_what_pareto_does_not_know_is_refused():
    for wrong in ({"gains": PRINTED}, {"bounds": Bounds(gamma=fmpq(1))}):
        with pytest.raises(UsageError, match="pareto"):
            design(DEGENERATE, "0.3", objective="pareto", weight="0.5", **wrong)
    with pytest.raises(UsageError, match="compare takes a number"):
        design(DEGENERATE, "0.3", objective="pareto", relaxation="compare", weight=Range(fmpq(0), fmpq(1), 3))


# Side by side


def test_compare_ships_the_tightest_and_shows_what_the_others_cost():
    made = design(NOISES, "0.4167", relaxation="compare", objective="min-gamma", rate="0.05")
    rows = {row["relaxation"]: row for row in made.beyond["comparison"]}
    assert [rows[name]["limit"]["gamma"] for name in RELAXATIONS] == pytest.approx(
        [0.14675, 0.22565, 0.49423], rel=1e-4
    )
    assert numbers(made)[1] == rows["s-procedure"]["certified"]["gamma"]
    assert made.beyond["ceiling"] == pytest.approx(1.379311, rel=1e-6)


def test_compare_says_which_relaxations_have_no_solution_and_why():
    made = design(DEGENERATE, "0.4167", relaxation="compare", objective="min-gamma", rate="0.5")
    assert made.status == "certified"
    last = made.beyond["comparison"][-1]
    assert (last["relaxation"], last["status"]) == ("abbaszadeh", "infeasible")
    assert "0.27538128" in last["reason"]
    assert in_floats(made.claim.lipschitz) == 0.4167


def test_compare_goes_on_where_a_relaxation_is_refused():
    made = design(JOINT, "0.3", relaxation="compare")
    assert made.beyond["comparison"][0]["status"] == "refused"
    assert made.status == made.beyond["comparison"][1]["status"] == "certified"
