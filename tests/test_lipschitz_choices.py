"""What a design of a Lipschitz observer chooses: levels, relaxations, points of a curve; and what a limit says."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from flint import fmpq
from support.plants import plant, zeros

from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.pace import DECAY
from obsdesign.dissipation.zero import Level
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.families.finding import hidden_mode
from obsdesign.families.lipschitz.claim import Claim, needed
from obsdesign.families.lipschitz.design import compared
from obsdesign.families.lipschitz.front import Optimum
from obsdesign.families.lipschitz.pareto import Spot, absent, alike, knee
from obsdesign.families.lipschitz.relaxations import RELAXATIONS, Lipschitz, lipschitz_multiplier
from obsdesign.families.lipschitz.request import LipschitzRequest
from obsdesign.families.lipschitz.study import Study
from obsdesign.families.lipschitz.suprema import ceiling, largest_constant, largest_for_gamma
from obsdesign.families.outcome import Outcome, Verdict
from obsdesign.lmi.formula import in_floats, printed, rational, rational_number
from obsdesign.lmi.solve import Status


def unit(system, decay="0", sizes=None):
    """S-procedure for the constant 1."""
    sizes = sizes or [(len(system.Cq), system.Bf.shape[1])]
    multiplier = lipschitz_multiplier([fmpq(1)] * len(sizes), sizes)
    still = zeros(len(system.Cq), len(system.C))
    return Lipschitz(system, multiplier, rational(np.eye(system.n)), rational_number(decay), None, still)


# Limits


@pytest.mark.parametrize(
    ("A", "C", "value", "attained"),
    [
        (np.diag([-1, -3]), [[0, 1]], 0.95, True),  # y sees nothing of the other state: P = I is the best
        (np.diag([-1, -2, -3]), [[0, 0, 1]], 0.95, True),
        ([[0, 1], [-1, -1]], [[1, 0]], 1.1646557, False),  # L grows without bound, and P becomes singular
        ([[0, 1, 0, 0], [-1, -1, 0, 0], [0, 0, 0, 1], [0, 0, -2, -3]], [[1, 0, 0, 0], [0, 0, 1, 0]], 1.1646557, False),
    ],
)
def test_a_limit_is_attained_where_the_storage_function_of_the_optimum_is_regular(A, C, value, attained):
    found = largest_constant(Engine(), unit(plant(A, C), "0.05"), "norm-bound")
    assert found.value == pytest.approx(value, rel=1e-6)
    assert found.attained == attained


@pytest.mark.parametrize("relaxation", RELAXATIONS[:2])
def test_at_the_decay_zero_no_limit_is_attained(relaxation):
    assert not largest_constant(Engine(), unit(plant(np.diag([-1, -3]), [[0, 1]])), relaxation).attained


def test_there_is_a_ceiling_only_where_f_is_any_function_of_the_state():
    A, C = [[0, 1], [-1, -1]], [[1, 0]]
    assert ceiling(unit(plant(A, C))) == pytest.approx(math.sqrt(2))
    assert ceiling(unit(plant(A, C), sizes=[(1, 1), (1, 1)])) is None
    assert ceiling(unit(plant(A, C, Bf=[[0], [1]]))) is None
    assert ceiling(unit(plant(A, C, Cq=[[1, 0], [0, 2]]))) is None
    assert ceiling(unit(plant(A, [[1, 0], [0, 1]]))) is None


@pytest.mark.parametrize("C", [[[1, 0]], [[1, 0], [0, 1]]])
def test_theorems_3_and_4_admit_no_constant_where_sigma_of_H_is_one_even_if_every_state_is_measured(C):
    system = plant([[0, 1], [-1, -1]], C)
    assert largest_for_gamma(Engine(), unit(system), "abbaszadeh").value == 0
    assert largest_for_gamma(Engine(), unit(system), "norm-bound").value > 1


def test_where_no_decay_will_do_none_is_suggested():
    family = in_floats(unit(plant(np.diag([1, -1]), [[0, 1]])))
    unstable = hidden_mode(family.plant, family.multiplier.member, family.edge, DECAY)
    assert unstable["feasible"] == {}
    assert "a measurement that shows it is needed" in unstable["suggestion"]


# Levels


@pytest.mark.parametrize("constant", ["2/3", "1/3", "0.3", "1e-7"])
def test_the_declared_constant_is_rounded_up_by_less_than_two_doubles(constant):
    exact = rational_number(constant)
    study = Study(Engine(), unit(plant([[-1]], [[1]])), LipschitzRequest("lipschitz", (fmpq(0), exact)))
    for found in (study.declared, needed((fmpq(0), exact))):
        assert exact <= found
        assert printed(math.nextafter(math.nextafter(float(found), 0), 0)) < exact


@pytest.mark.parametrize(
    ("bounds", "restricted"),
    [
        (Bounds(), False),
        (Bounds(gamma=fmpq(1)), False),
        (Bounds(L1=fmpq(1)), True),
        (Bounds(floor=fmpq(1)), True),
    ],
)
def test_bounds_on_the_gain_or_on_the_storage_function_restrict_a_design(bounds, restricted):
    request = LipschitzRequest("lipschitz", (fmpq(1),), bounds=bounds)
    assert Study(Engine(), unit(plant([[-1]], [[1]])), request).restricted == restricted


@pytest.mark.parametrize("slack", [0.01, 0.3])
def test_a_level_is_within_the_slack_of_the_least(slack):
    assert Level(0.4).target(slack) == pytest.approx(0.4 * (1 + slack), rel=1e-5)
    assert Level(0.4).target(slack) <= 0.4 * (1 + slack)
    assert Level(0.4).target(0.0) >= 0.4
    assert not Level(0.4).attained


def test_something_small_stands_in_for_a_level_of_zero():
    assert Level(0.0, 0.003).target(0.05) == pytest.approx(0.003, rel=1e-5)


# Relaxations side by side


def chosen(**outcomes):
    """What is chosen of outcomes by the names of the relaxations, an error is raised."""

    def design(relaxation):
        outcome = outcomes[relaxation.replace("-", "_")]
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    return compared(design, disturbed=True)


NONE = Outcome(Verdict.INFEASIBLE, diagnosis={"reason": "hidden"})
FIRST, SECOND = (Outcome(Verdict.CERTIFIED, {"L": k * np.eye(2)}, limit={"gamma": k}) for k in (1.0, 2.0))


def test_the_tightest_relaxation_that_has_a_design_is_chosen():
    made = chosen(s_procedure=NONE, norm_bound=FIRST, abbaszadeh=SECOND)
    assert made.gains is FIRST.gains
    assert [row["relaxation"] for row in made.beyond["comparison"]] == list(RELAXATIONS)
    assert [row["status"] for row in made.beyond["comparison"]] == ["infeasible", "certified", "certified"]
    assert made.beyond["comparison"][0]["reason"] == "hidden"


def test_what_was_refused_is_told_from_what_was_not_decided():
    made = chosen(
        s_procedure=UsageError("bound L", id="OBS502"),
        norm_bound=UndecidedError("stalled", id="OBS507"),
        abbaszadeh=SECOND,
    )
    assert made.gains is SECOND.gains
    assert [row["status"] for row in made.beyond["comparison"]] == ["refused", "undecided", "certified"]
    assert [row.get("reason") for row in made.beyond["comparison"]] == ["bound L", "stalled", None]


def test_there_is_no_solution_only_if_every_relaxation_says_so():
    assert chosen(s_procedure=NONE, norm_bound=NONE, abbaszadeh=NONE).status == "infeasible"
    with pytest.raises(UndecidedError, match="stalled"):
        chosen(s_procedure=UndecidedError("stalled", id="OBS507"), norm_bound=NONE, abbaszadeh=NONE)


# Points of a curve


def spot(weight, lipschitz, gamma):
    """Point with the numbers that are certified."""
    return Spot(weight, 0.0, proved=Claim(rational_number(lipschitz), SimpleNamespace(gamma=rational_number(gamma))))


def test_the_knee_weighs_gamma_and_the_constant_by_their_largest():
    fast, middle, quiet = spot(0.9, "4", "1"), spot(0.5, "2", "0.3"), spot(0.1, "1", "0.25")
    assert knee([fast, middle, quiet]) is middle
    assert knee([quiet, middle, fast]) is middle
    assert knee([Spot(0.6, 0.0), fast]) is fast


def test_the_ends_of_a_curve_are_shipped_only_if_there_is_nothing_between():
    best, between = spot(0.0, "4", "0.01"), spot(0.5, "2", "0.3")
    assert knee([best, between]) is between
    assert knee([best, spot(1.0, "4", "0.02")]) is best


def optimum(weight, lipschitz=0.5, gamma=0.2):
    return Optimum(weight, lipschitz, gamma, attained=True)


def test_neighbors_are_one_point_if_all_that_is_determined_is_the_same():
    assert alike(optimum(0.2), optimum(0.3))
    assert alike(optimum(0.2), optimum(0.3, 0.5 * (1 + 1e-6)))
    assert not alike(optimum(0.2), optimum(0.3, 0.501))
    assert not alike(optimum(0.2), optimum(0.3, gamma=0.201))
    assert not alike(optimum(0.0), optimum(0.1))
    assert not alike(optimum(0.9), optimum(1.0))
    assert not alike(optimum(0.2), Status.INFEASIBLE)


def test_what_has_no_weight_is_not_among_the_numbers_of_a_limit():
    assert optimum(0.0).numbers == {"gamma": 0.2, "objective": pytest.approx(0.04), "attained": True}
    assert optimum(1.0, gamma=math.inf).numbers == {"lipschitz": 0.5, "objective": 2.0, "attained": True}
    assert optimum(0.5).objective == pytest.approx(0.5 / 0.5 + 0.5 * 0.2**2)


def test_a_curve_on_which_a_point_was_not_decided_has_no_verdict():
    study = Study(Engine(), unit(plant([[-1]], [[1]])), LipschitzRequest("lipschitz", (fmpq(1),)))
    with pytest.raises(UndecidedError, match="no point was certified"):
        absent(study, [[Spot(0.5, 0.0, Status.UNDECIDED), Spot(0.6, 0.0)]])
