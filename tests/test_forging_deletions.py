"""Result files from which something was deleted: refused by name, or nothing of what is claimed is missing."""

import copy
import json
from functools import cache
from pathlib import Path

import pytest
from support.commands import run
from support.forging import at, put
from support.shipped import SPECS
from test_forging import OBSERVERS, PLANT, dotted, places

import obsdesign as od
from obsdesign.design import proof_of
from obsdesign.files import ResultFile

pytestmark = pytest.mark.usefixtures("here")

SIMULATION = "simulation: {horizon: 1, x0: [1, 0]}"
FAMILY = {  # one file of each, and of each kind of answer
    "l2": "l2 least gamma",
    "linf": "linf reconstruction",
    "lipschitz": "lipschitz compared",
    "sporadic": "sporadic feasibility",
    "kkl": "chain-found",
    "pebo": "cuk-pebo",
    "kkl+pebo": "cuk-kkl-pebo",
    "immersion-invariance": "cuk-immersion",
    "high-gain": "cuk-high-gain-linear",
    "refuted": "infeasible/cuk-wrong-inverse",
    "infeasible": "infeasible/bearing-too-fast",
    "infeasible at a member": "infeasible/hidden-sensor-bias",
}
CASES = [pytest.param(case, marks=pytest.mark.xdist_group(case)) for case in FAMILY.values()]
LABELS = ("name", "created", "tool", "solver", "spec.path", "certificate.checks.margin", "analysis", "search", "notes")
COMPUTED = ("guarantee.limit", "guarantee.limit_bounded", "guarantee.comparison", "guarantee.widened", "diagnosis")


@cache
def content_of(case):
    """What is in a genuine file."""
    text = PLANT % OBSERVERS[case] + SIMULATION if case in OBSERVERS else str(SPECS / f"{case}.yaml")
    return od.solve(od.load(text)).text().decode()


def without(content, place):
    """A content without what is at a place."""
    forged = copy.deepcopy(content)
    del at(forged, place[:-1])[place[-1]]
    return forged


def kinds(content):
    """Places of everything in a file but the spec, one of those with the same keys."""
    found = {}
    for place in places(content):
        if place[0] != "spec" or len(place) == 2:
            found.setdefault(tuple("" if isinstance(key, int) else key for key in place), place)
    return found.values()


def proved(content):
    """What is proved of a file; None where it is refused, in one line that names a key."""
    file = ResultFile("forged.gains.json", json.dumps(content).encode())
    try:
        proof = proof_of(file)
    except (od.UsageError, od.UndecidedError) as error:
        assert len(str(error).splitlines()) == 1
        assert all(problem.key for problem in error.problems), error
        return None
    return proof if proof.holds else None


@pytest.mark.parametrize("case", CASES)
def test_nothing_of_a_claim_can_be_left_out(case):
    content = json.loads(content_of(case))
    genuine = proved(content)
    assert genuine
    accepted = set()
    for place in kinds(content):
        if proof := proved(without(content, place)):
            path = dotted(place)
            assert proof.claim == genuine.claim
            assert any(f"{path}.".startswith(f"{part}.") for part in (*LABELS, *COMPUTED)), path
            accepted.add(place)
    assert accepted
    show(content, accepted)


def show(content, accepted):
    """Hold what is accepted against the commands that read it: none ends in a traceback."""
    Path("genuine.gains.json").write_text(json.dumps(content))
    for place in accepted:
        Path("forged.gains.json").write_text(json.dumps(without(content, place)))
        for command in (["report", "forged.gains.json"], ["diff", "genuine.gains.json", "forged.gains.json"]):
            outcome = run(*command)
            assert outcome.exit_code in {0, 2, 3, 4}, (place, command, outcome.exception)
    if content["status"] == "certified":
        assert run("simulate", "forged.gains.json").exit_code == 0
