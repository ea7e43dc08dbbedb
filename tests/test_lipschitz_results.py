"""What a result says of an observer of a Lipschitz system, beside what `verify` can check."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from flint import fmpq
from support.lipschitz import FRONT, PAIR, QUIET, QUIET_L, L, designed, written

from obsdesign.families.lipschitz.design import row
from obsdesign.families.outcome import Outcome, Search, Verdict
from obsdesign.files import to_json
from obsdesign.reading import loads

INFINITE = {"lipschitz": math.inf, "attained": False}
UNBOUNDED = {"unbounded": True, "attained": False}


def said(spec, outcome):
    """Content of a file, in which every number is finite."""
    return json.loads(to_json(written(spec, outcome)), parse_constant=pytest.fail)


@pytest.fixture(scope="module")
def pair():
    """Two blocks, and a larger constant that is tolerated."""
    return designed(PAIR, fmpq(3, 10), 0.72, admissible=(fmpq(9, 10), 1.5))


@pytest.fixture(scope="module")
def quiet():
    """No w."""
    return designed(QUIET, fmpq(1), gain=QUIET_L)


def test_every_limit_and_what_the_relaxations_cost_are_kept(pair):
    spec, design = pair
    bounded = {"gamma": 0.6, "attained": True}
    known = {"widened": {"gamma": 0.5, "lipschitz": 0.8}, "ceiling": 1.25}
    found = said(spec, replace(design, limit_bounded=bounded, beyond=known))["guarantee"]
    assert found["limit"] == UNBOUNDED
    assert found["limit_bounded"] == bounded
    assert all(found[key] == known[key] for key in known)
    assert not {*known, "limit_bounded"} & {*said(spec, design)["guarantee"]}


def test_a_comparison_without_w_has_no_gamma(quiet):
    _, design = quiet
    certified = {"lipschitz": 1.0, "L": pytest.approx(np.linalg.norm(QUIET_L))}
    expected = {"relaxation": "s-procedure", "status": "certified", "limit": UNBOUNDED, "certified": certified}
    assert row("s-procedure", design, disturbed=False) == expected
    assert row("s-procedure", design, disturbed=True)["certified"]["gamma"] == 1


def test_the_larger_constant_has_a_level_of_its_own_where_there_is_w(pair, quiet):
    assert said(*pair)["certificate"]["admissible"]["gamma"] == 1.5
    spec, design = quiet
    found = said(spec, replace(design, claim=replace(design.claim, admissible=design.claim)))["certificate"][
        "admissible"
    ]
    assert not {"gamma", "mu1", "mu2"} & found.keys()


def test_without_a_decay_the_error_is_said_to_vanish():
    still = said(*designed(QUIET.replace("decay: 0.05", "decay: 0"), fmpq(1), gain=QUIET_L, decay=0))
    noisy = said(*designed(PAIR.replace("decay: 0.05", "decay: 0"), fmpq(3, 10), 0.72, decay=0))
    for statement in (still["guarantee"]["statement"], noisy["guarantee"]["statement"]):
        assert "e(t) -> 0" in statement
        assert "exp(" not in statement


def test_what_has_no_solution_still_says_its_limits():
    found = said(loads(QUIET, "q.yaml"), Outcome(Verdict.INFEASIBLE, limit={"lipschitz": 0.5, "attained": False}))
    assert found["guarantee"] == {"limit": {"lipschitz": 0.5, "attained": False}}


def test_the_observer_is_the_one_that_was_asked_for_with_the_poles_of_A_minus_L_C(quiet):
    spec, design = quiet
    observer = said(spec, design)["observer"]
    poles = np.linalg.eigvals(np.array([[0, 1], [-1, -1]]) - QUIET_L @ np.array([[1, 0]]))
    assert sorted(re for re, _ in observer["poles"]) == pytest.approx(sorted(poles.real))
    assert (observer["type"], observer["relaxation"]) == ("lipschitz", "s-procedure")
    looser = loads(QUIET.replace("decay:", "relaxation: norm-bound, decay:"), "q.yaml")
    assert said(looser, design)["observer"]["relaxation"] == "norm-bound"


@pytest.mark.parametrize(
    ("weight", "ranges"), [("0.9", ["decay"]), ("{min: 0, max: 1, points: 3}", ["weight", "decay"])]
)
def test_a_search_names_its_parameters_and_its_points_are_finite(weight, ranges):
    spec, design = designed(FRONT.replace("weight: 0.9", f"weight: {weight}"), fmpq(1, 2), 0.9, 2 * L, decay=0.025)
    point = {"weight": 0.0, "decay": 0.1, "lipschitz": math.inf, "gamma": 0.2, "status": "uncertified"}
    found = said(spec, replace(design, search=Search(ranges[0], (point,), tuple(ranges) if len(ranges) > 1 else ())))[
        "search"
    ]
    assert found["parameter"] == ranges[0]
    assert found.get("parameters", ranges[:1]) == ranges
    assert found["points"] == [{k: v for k, v in point.items() if k != "lipschitz"} | UNBOUNDED]
