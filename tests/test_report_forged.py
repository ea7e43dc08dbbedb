"""Result files whose unproved parts are forged: refused in one line, or shown as data; a status and a name are held."""

import json
import os
import subprocess

import pytest
from support.bounded import soon
from support.commands import run
from support.forging import with_text
from support.page import read
from test_report import SMALL, altered, reported, solved, summarised, texts

from obsdesign.batches.find import Task
from obsdesign.batches.record import entry_of
from obsdesign.errors import Problem

SPEC = """
obsdesign: 1
name: Small
system: {A: [[-1]], B: [[1]], C: [[1]]}
observer: {type: l2, alpha: {min: 0.1, max: 0.8, points: 3}, objective: pareto, bounds: {L1: 5}}
expect: {gamma: 0.5}
"""
NESTED = json.loads("[" * 300 + "1" + "]" * 300)
HOSTILE = (10**400, -(10**400), 1e308, 5e-324, "NaN", "certified ", "x" * 300_000, NESTED, [[[1]]], {}, [], None, True)
PARTS = (
    ("analysis",),
    ("analysis", "largest_step"),
    ("analysis", "worst_pole"),
    ("guarantee", "limit"),
    ("guarantee", "limit", "gamma"),
    ("search",),
    ("search", "points"),
    ("search", "points", 0),
    ("search", "points", 0, "alpha"),
    ("search", "points", 1, "gamma"),
    ("search", "points", 0, "certified"),
    ("certificate", "checks", 0, "margin"),
    ("solver",),
    ("solver", "name"),
    ("tool",),
    ("created",),
    ("notes",),
    ("numerical",),
    ("spec", "path"),
)


@pytest.fixture(scope="module")
def genuine(tmp_path_factory):
    """Result of a small spec."""
    return solved(tmp_path_factory.mktemp("forged"), SPEC)


def forged(content, part, value):
    """Text of a result with another value of a part."""
    *inner, last = part
    place = content
    for key in inner:
        place = place[key]
    place[last] = value
    return json.dumps(content)


@pytest.mark.parametrize("part", PARTS, ids=lambda part: ".".join(map(str, part)))
def test_a_part_that_is_not_proved_is_refused_or_shown(genuine, part, tmp_path):
    path = tmp_path / "x.gains.json"
    for value in HOSTILE:
        path.write_text(forged(json.loads(genuine.read_text()), part, value))
        for command in (("report", path, "-o", tmp_path / "x.html"), ("diff", genuine, path), ("verify", path)):
            with soon():
                outcome = run(*command)
            assert outcome.exit_code in {0, 2, 4}, (command, str(value)[:20], outcome.exception)
            assert isinstance(outcome.exception, SystemExit | None), (command, str(value)[:20])
            assert outcome.stderr.count("\n") == (outcome.exit_code != 0)


@pytest.mark.parametrize("text", ['{"points": [{"alpha": 1e999}]}', '{"points": [{"alpha": NaN}]}', "1e400"])
def test_numbers_beyond_doubles_are_not_drawn(genuine, text, tmp_path):
    path = tmp_path / "x.gains.json"
    path.write_text(forged(json.loads(genuine.read_text()), ("search",), "HERE").replace('"HERE"', text))
    outcome = run("report", path, "-o", tmp_path / "x.html")
    assert outcome.exit_code in {0, 2}
    assert isinstance(outcome.exception, SystemExit | None)


def test_a_folder_of_traps_is_walked_to_its_end(genuine, tmp_path, monkeypatch):
    """Pipes, devices, loops of links, and folders deeper than a path may be long or a function may recurse."""
    monkeypatch.chdir(tmp_path)
    for name in ("f/a.gains.json", "f/sub/b.gains.json", "f/.hidden/c.gains.json"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(genuine.read_bytes())
    for name in ("p.gains.json", "p.yaml", "summary.json", "a.run.csv"):
        os.mkfifo(f"f/{name}")
    links = {"loop": ".", "z.gains.json": "/dev/zero", "z.yaml": "/dev/zero", "own.yaml": "own.yaml"}
    for name, target in links.items():
        os.symlink(target, f"f/{name}")
    (tmp_path / "f" / "folder.gains.json").mkdir()
    (tmp_path / "f" / "spec.yml").write_text(SPEC)
    monkeypatch.chdir("f")
    for _ in range(1200):
        os.mkdir("d")
        monkeypatch.chdir("d")
    monkeypatch.chdir(tmp_path)
    outcome = run("report", "f", "--timeout", 60)
    assert (outcome.exit_code, outcome.stdout.splitlines()[0]) == (0, "2 certified")
    page = (tmp_path / "report.html").read_text()
    assert "f/sub/b.gains.json" in page
    assert ".hidden/" not in page
    outcome = run("verify", "f", "--timeout", 60)
    assert (outcome.exit_code, outcome.stdout.count("\nproved: ")) == (0, 2)
    outcome = run("check", "f", "--timeout", 60)
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
    assert outcome.stderr.startswith("f/own.yaml: cannot be read: Too many levels of symbolic links")
    outcome = run("batch", "f", "--jobs", 1, "--json", "-q")
    assert [entry["path"] for entry in json.loads(outcome.stdout)["specs"]] == ["f/own.yaml", "f/spec.yml"]
    subprocess.run(["rm", "-r", "f/d"], check=True)  # which pytest could not
    os.symlink("nowhere", "b.gains.json")
    os.mkfifo("c.gains.json")
    outcome = run("simulate", "--timeout", 60)
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
    assert "no certified *.gains.json in this folder" in outcome.stderr


def cited(genuine, status, tmp_path):
    """Page of a folder with a file that expects just what it says, of a paper, whose limit is forged too."""
    content = json.loads(genuine.read_text())
    gamma, limit = content["guarantee"]["gamma"], 1e-12
    expected = {"gamma": {"verified": gamma, "printed": 3}, "limit.gamma": {"verified": limit, "printed": 4}}
    spec = SPEC.replace("expect: {gamma: 0.5}", f"expect: {json.dumps({'status': status, **expected})}")
    spec += "source: 'Corless and Chakrabarty (2019)'\nreproduces: [Section 6]\n"
    content = with_text(content, spec) | {"status": status}
    content["guarantee"]["limit"] = {"gamma": limit, "attained": True}
    (tmp_path / "x.gains.json").write_text(json.dumps(content))
    page = tmp_path / "x.html"
    assert run("report", tmp_path, "-o", page).exit_code == 0
    tables = {table.attributes["class"]: table for table in read(page.read_text()).all("table")}
    cells = [[" ".join(c.text.split()) for c in row.all("td")] for row in tables["papers"].all("tr")]
    (made,) = (row for row in cells if "gamma" in " ".join(row))
    rows = [[" ".join(c.text.split()) for c in row.all("th", "td")] for row in tables["expected"].all("tr")]
    (met,) = (list(row.all("td"))[-1].text for row in next(tables["results"].all("tbody")).all("tr"))
    return gamma, met, made[-2:], {row[0]: (row[2], row[4]) for row in rows[1:]}


def test_only_what_is_proved_stands_under_verified(genuine, tmp_path):
    gamma, met, made, rows = cited(genuine, "certified", tmp_path)
    assert met == "met, in part numerical"
    assert made == [f"{gamma}–", "–1e-12"]
    assert rows == {
        "status": ("certified proved", "yes"),
        "gamma": (f"{gamma} proved", "yes"),
        "limit.gamma": ("1e-12 numerical", "yes"),
    }


def test_nothing_of_a_file_that_is_not_proved_is_verified_or_met(genuine, tmp_path):
    gamma, met, made, rows = cited(genuine, "uncertified", tmp_path)
    assert met == "not verified"
    assert made == ["not verifiednot verified", "––"]
    assert {met for _, met in rows.values()} == {"not verified"}
    assert rows["gamma"][0] == f"{gamma:.6g} not verified"


@pytest.mark.parametrize("status", ["certified", "uncertified"])
@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("limit.gamma", {"limit": {"gamma": -1, "attained": True}}),
        ("widened.lipschitz", {"widened": {"lipschitz": -1.5, "gamma": 1}}),
        ("ceiling", {"ceiling": -1}),
        ("comparison.limit.gamma", {"comparison": [{"relaxation": "x", "limit": {"gamma": -1}}]}),
    ],
)
def test_a_limit_is_not_negative(genuine, status, name, limit, tmp_path):
    content = json.loads(genuine.read_text())
    content |= {"status": status, "guarantee": content["guarantee"] | limit}
    path = tmp_path / "x.gains.json"
    path.write_text(json.dumps(content))
    outcome = run("report", path, "-o", tmp_path / "x.html")
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
    assert f"guarantee.{name}: -1" in outcome.stderr
    assert f"is negative, which no {name.rpartition('.')[2]} is [OBS702]" in outcome.stderr


def test_a_number_that_the_spec_does_not_ask_for_is_named_beside_what_it_asks_for(genuine, tmp_path):
    path = tmp_path / "x.gains.json"
    path.write_text(forged(json.loads(genuine.read_text()), ("guarantee", "alpha"), 0.8000000001))
    said = "guarantee.alpha: 0.8000000001 is not what the spec asks for, from 0.1 to 0.8 [OBS707]"
    assert said in run("verify", path).stderr


@pytest.mark.parametrize("left", ["[", '{"a":'])
def test_what_is_nested_too_deep_is_refused_and_the_rest_of_a_folder_shown(genuine, left, tmp_path):
    path, deep = tmp_path / "x.gains.json", left * 600 + "1" + {"[": "]"}.get(left, "}") * 600
    content = {**json.loads(genuine.read_text()), "status": "infeasible", "diagnosis": {"reason": "HERE"}}
    path.write_text(json.dumps(content).replace('"HERE"', deep))
    (tmp_path / "good.gains.json").write_bytes(genuine.read_bytes())
    for command in (("report", path), ("verify", path), ("diff", genuine, path), ("compare", genuine, path)):
        outcome = run(*command)
        assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
        assert "diagnosis.reason" in outcome.stderr
        assert "holds lists or objects more than 50 deep" in outcome.stderr
    page = tmp_path / "folder.html"
    assert run("report", tmp_path, "-o", page).exit_code == 2
    assert "Small</h1>" in page.read_text()


@pytest.mark.parametrize("status", ["certified ", "Certified", "no guarantee", "x" * 10_000, 5, None, [], [[]]])
def test_a_status_is_one_of_those_that_there_are(genuine, status, tmp_path):
    path = tmp_path / "x.gains.json"
    path.write_text(forged(json.loads(genuine.read_text()), ("status",), status))
    for command in (("report", path), ("verify", path), ("diff", genuine, path), ("simulate", path)):
        outcome = run(*command)
        assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
        assert "status: " in outcome.stderr
        assert "is none; expected certified, infeasible, refuted, uncertified [OBS702]" in outcome.stderr
        assert len(outcome.stderr) < 500
    page = tmp_path / "folder.html"
    assert run("report", tmp_path, "-o", page).exit_code == 2
    assert "certified </span>" not in page.read_text()


def test_the_name_in_a_file_is_that_of_its_spec(tmp_path):
    path = altered(solved(tmp_path, SPEC), name="Certified by others")
    for command in (("report", path), ("verify", path), ("verify", path, tmp_path / "small.yaml"), ("simulate", path)):
        outcome = run(*command)
        assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
        assert "name: is not that of the spec in the file; expected Small [OBS703]" in outcome.stderr


def test_a_spec_without_a_name_has_that_of_its_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = solved(tmp_path, SPEC.replace("name: Small\n", ""), "plain").rename("moved.gains.json")
    (tmp_path / "plain.yaml").rename("other.yaml")
    for command in (("verify", path), ("verify", path, "other.yaml"), ("report", path)):
        assert run(*command).exit_code == 0
    assert ">plain</h1>" in (tmp_path / "report.html").read_text()
    altered(path, name="other's")
    outcome = run("verify", path, "other.yaml")
    assert "name: is not that of the spec in the file; expected plain [OBS703]" in outcome.stderr


def test_what_a_summary_says_of_a_spec_without_a_result_stands_under_nothing_that_is_proved(tmp_path):
    solved(tmp_path, SMALL)
    problem = Problem("proved: gamma 1e-9, certified", "forged.yaml", id="OBS508")
    claims = entry_of(Task("forged.yaml"), "certified", 0, problem, as_expected=True, verified=True)
    summarised(tmp_path, claims, entry_of(Task("late.yaml"), "timeout", 4, problem))
    page, outcome = reported(tmp_path, tmp_path)
    assert outcome.stdout.startswith("1 certified, 1 no result, 1 no result: timeout\n")
    (table,) = (e for e in read(page).all("table") if e.attributes.get("class") == "results")
    heads = [cell.text.strip() for cell in next(table.all("thead")).all("th")][1:]
    rows = list(next(table.all("tbody")).all("tr"))[1:]
    forged, late = ({head: cell.text for head, cell in zip(heads, row.all("td"), strict=True)} for row in rows)
    said = "summary.json says certified, but names no result file: nothing of it is proved"
    assert (forged.pop("why it is not shown"), forged.pop("status")) == (said, "no result")
    assert late.pop("why it is not shown") == "summary.json says: proved: gamma 1e-9, certified"
    assert late.pop("status") == "no result: timeout"
    assert {*forged.values(), *late.values()} == {""}


def test_points_of_a_search_are_told_as_recorded(genuine, tmp_path):
    content = json.loads(genuine.read_text())
    point = {"alpha": 0.5, "gamma": 1e-9, "status": "certified", "certified": {"gamma": 1e-9}}
    path = tmp_path / "small.gains.json"
    path.write_text(json.dumps({**content, "search": {**content["search"], "points": [point]}}))
    root = read(reported(path, tmp_path)[0])
    heads = [head for head in texts(root, "th") if "certified" in head or "status" in head]
    assert heads == ["gamma, certified when designed, as recorded", "status, as recorded"]
    assert any(
        said.startswith("The points, and their statuses, are as the file records them.") for said in texts(root, "p")
    )
