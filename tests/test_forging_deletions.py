"""Result files from which something was deleted: refused by name, or nothing of what is claimed is missing."""

import json
from functools import cache
from pathlib import Path

import pytest
from support.commands import run
from support.forging import at, put
from support.shipped import solved
from test_forging import OBSERVERS, PLANT, copied, dotted, places

import obsdesign as od
from obsdesign.design import proof_of
from obsdesign.files import ResultFile

pytestmark = pytest.mark.usefixtures("here", "sketched", "read_once")

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
COMPUTED = (  # what may be left out: labels, and what proves nothing and nothing is built from
    *("name", "created", "tool", "solver", "spec.path", "analysis", "search", "notes", "diagnosis"),
    *("guarantee.limit", "guarantee.limit_bounded", "guarantee.comparison", "guarantee.widened", "guarantee.ceiling"),
    "guarantee.kind",  # of a proposition: files from before there was another kind have none
)


@cache
def content_of(case):
    """What is in a genuine file."""
    if case not in OBSERVERS:
        return solved(case)[1].text().decode()
    return od.solve(od.load(PLANT % OBSERVERS[case] + SIMULATION)).text().decode()


def without(content, place):
    """A content without what is at a place."""
    forged = copied(content)
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
    """What is proved of a file, or why it is refused."""
    try:
        proof = proof_of(ResultFile("forged.gains.json", json.dumps(content).encode()))
    except (od.UsageError, od.UndecidedError) as error:
        return error
    return proof


@pytest.mark.parametrize("case", CASES)
def test_nothing_of_a_claim_can_be_left_out(case):
    content = json.loads(content_of(case))
    genuine = proved(content)
    accepted = set()
    for place in kinds(content):
        path, proof = dotted(place), proved(without(content, place))
        if isinstance(proof, od.ObsdesignError):
            assert [problem.key for problem in proof.problems if problem.key], path
            assert len(str(proof).splitlines()) == 1
        elif proof.holds:
            assert proof.claim == genuine.claim
            assert path.endswith(".margin") or any(f"{path}.".startswith(f"{part}.") for part in COMPUTED), path
            accepted.add(place)
    assert accepted
    show(content, accepted)


def show(content, accepted):
    """Hold what is accepted, one of each part, against the commands that read it: none ends in a traceback."""
    Path("genuine.gains.json").write_text(json.dumps(content))
    for place in {tuple(map(str, place[:2])): place for place in sorted(accepted, key=str)}.values():
        Path("forged.gains.json").write_text(json.dumps(without(content, place)))
        for command in (["report", "forged.gains.json"], ["diff", "genuine.gains.json", "forged.gains.json"]):
            outcome = run(*command)
            assert outcome.exit_code in {0, 2, 3, 4}, (place, command, outcome.exception)
    if content["status"] == "certified":
        assert run("simulate", "forged.gains.json").exit_code == 0


@pytest.mark.parametrize(
    ("place", "value", "name"),
    [
        (("guarantee", "comparison"), "forged", "numerical"),
        (("search",), "forged", "figures"),
        (("search", "points"), [1], "figures"),
        (("tool",), [], "origin"),
    ],
)
def test_a_report_refuses_what_is_not_proved_in_another_form(place, value, name):
    content = json.loads(content_of("lipschitz trade-off" if "search" in place else "lipschitz compared"))
    Path("forged.gains.json").write_text(json.dumps(put(content, place, value)))
    outcome = run("report", "forged.gains.json")
    assert outcome.exit_code == 2
    assert f"its {name}, of which nothing is proved, cannot be read" in outcome.stderr


@pytest.mark.parametrize("status", ["certified", "uncertified"])
def test_a_note_of_a_file_stands_outside_what_is_guaranteed(status):
    content, forged = json.loads(content_of("l2 least gamma")), "the gain from v to z is at most 1e-9, for every v"
    notes, computed = [*content.get("notes", []), forged], [*content["numerical"], "notes"]
    Path("forged.gains.json").write_text(json.dumps({**content, "status": status, "notes": notes}))
    assert run("report", "forged.gains.json").exit_code == (2 if status == "certified" else 0)
    Path("forged.gains.json").write_text(
        json.dumps({**content, "status": status, "notes": notes, "numerical": computed})
    )
    assert run("report", "forged.gains.json").exit_code == 0
    parts = {part.split(">")[0]: part for part in Path("report.html").read_text().split("<section id=")}
    ((name, own),) = ((name, part) for name, part in parts.items() if forged in part)
    assert '-notes"' in name
    assert 'Notes of the file <span class="mark">not proved</span>' in own
    known = next(part for name, part in parts.items() if '-guarantee"' in name)
    assert all(note in known for note in od.load(content["spec"]["text"]).notes)


def test_a_design_without_a_search_has_no_notes_but_those_on_its_spec():
    content = json.loads(content_of("cuk-pebo"))
    content |= {"notes": [*content.get("notes", []), "the search took long"], "numerical": ["notes"]}
    Path("forged.gains.json").write_text(json.dumps(content))
    outcome = run("verify", "forged.gains.json")
    assert outcome.exit_code == 2
    assert "is no note that is made of this spec" in outcome.stderr


def test_a_note_on_the_spec_stays():
    content = json.loads(content_of("l2 least gamma"))
    spec = od.load(content["spec"]["text"])
    assert spec.notes
    content["notes"] = [note for note in content["notes"] if note not in spec.notes]
    Path("forged.gains.json").write_text(json.dumps(content))
    outcome = run("verify", "forged.gains.json")
    assert outcome.exit_code == 2
    assert "notes: leaves out what is known of the spec" in outcome.stderr
