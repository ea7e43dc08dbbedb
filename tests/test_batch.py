"""Folders of specs: found, designed once, held against what they expect, and summed up."""

import json
import re
from pathlib import Path

import pytest
from support.commands import files, run

import obsdesign as od
from obsdesign.batches import sweep
from obsdesign.batches.clash import clashes
from obsdesign.batches.find import Task, find, share
from obsdesign.batches.perform import perform
from obsdesign.batches.record import Options

GOOD = """
obsdesign: 1
name: Good
system: {A: [[-1]], B: [[1]], C: [[1]]}
observer: {type: l2, alpha: 0.1, bounds: {L1: 5}}
simulation: {horizon: 1, x0: [1], points: 5}
"""
HIDDEN = """
obsdesign: 1
system: {A: [[1, 0], [0, -1]], B: [[0], [1]], C: [[0, 1]]}
observer: {type: l2, L2: 0, alpha: 0.1}
"""
UNDECIDED = """
obsdesign: 1
system: {A: [[-1]], B: [[1]], C: [[1]]}
observer: {type: l2, alpha: 0.1, objective: {gamma: 1.0e-300}}
"""
EXPECTED = "expect: {status: infeasible}\n"
WRONG = "obsdesign: 1\nsystem: {A: [[-1]], C: [[1]]}\nobserver: {type: l2, alpa: 0.1}\n"
VOLATILE = {"created", "time_s", "up_to_date", "why", "recorded"}


def put(path, text=GOOD):
    """Write a spec."""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(text)


def summary(out="results"):
    """Content of a summary."""
    return json.loads(Path(out, "summary.json").read_text())


def entries(out="results"):
    """Entries of a summary by their paths."""
    return {entry["path"]: entry for entry in summary(out)["specs"]}


def lasting(out="results"):
    """What is the same in every run."""
    content = {key: value for key, value in summary(out).items() if key not in VOLATILE}
    content["specs"] = [{k: v for k, v in one.items() if k not in VOLATILE} for one in content["specs"]]
    return content


@pytest.fixture
def folder(here):
    """Specs of every kind in the working folder."""
    put("specs/good.yaml")
    put("specs/deep/good.yml")
    put("specs/deep/hidden.yaml", HIDDEN + EXPECTED)
    put("specs/no-spec.yaml", "name: a workflow\n")
    put("specs/.hidden/good.yaml")
    return here


# Finding


def test_specs_are_found_below_folders_by_globs_and_by_name_each_once(folder):
    all_three = ["specs/deep/good.yml", "specs/deep/hidden.yaml", "specs/good.yaml"]
    for paths in (["specs"], ["specs/deep", "specs/good.yaml", "specs"], ["specs/../specs"], [folder / "specs"]):
        assert [task.path for task in find(paths)] == all_three
    assert [task.path for task in find(["specs/**/*.yaml"])] == [
        "specs/deep/hidden.yaml",
        "specs/good.yaml",
        "specs/no-spec.yaml",  # a path that is given, or meant by a glob, is taken as it is
    ]
    assert [task.path for task in find(["specs"], ["deep"])] == ["specs/good.yaml"]
    assert [task.path for task in find(["specs"], ["specs/deep/*.yaml", "good.y?ml"])] == ["specs/deep/good.yml"]


def test_results_keep_the_path_of_a_spec_and_stay_in_their_folder(folder):
    outside = folder.parent / "outside" / "good.yaml"
    put(outside)
    places = {task.path: task.place for task in find(["specs/good.yaml", "../outside", str(outside)])}
    assert places == {"specs/good.yaml": "specs/good", str(outside): str(outside.with_suffix("")).removeprefix("/")}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["absent"], "absent: there is no such file or folder; give spec files, folders of them, or globs"),
        (["specs", "--exclude", "specs"], "no specs found: no *.yaml or *.yml with a key `obsdesign`"),
        (["/dev/null"], "/dev/null: is no file and no folder; a batch takes spec files and folders of them"),
        (["specs", "--shard", "4/3"], "--shard 4/3: expected I/N with 1 <= I <= N, such as 3/40"),
        (["specs", "--out", "specs/good.yaml"], "specs/good.yaml: cannot be made or written: File exists"),
        (["specs", "--output-file", "x"], "--output-file: nothing to write; --format says what"),
        (["specs", "--changed-since", "specs/good.yaml"], "specs/good.yaml: not JSON"),
        (["specs", "--changed-since", "list.json"], "list.json: is no summary of a batch"),
    ],
)
@pytest.mark.usefixtures("folder")
def test_what_cannot_be_run_is_refused_in_one_line(arguments, said):
    Path("list.json").write_text("[]")
    outcome = run("batch", *arguments)
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert outcome.stderr.startswith(said)
    assert len(outcome.stderr.splitlines()) == 1


@pytest.mark.usefixtures("here")
def test_specs_that_would_share_a_place_of_results_are_invalid_and_the_others_run():
    for path in ("a.yaml", "a.yml", "b.yaml", "b/b.gains.json.yaml", "c.yaml", "c/c.yaml", "d/summary.json.yaml"):
        put(path)
    outcome = run("batch", ".", "--format", "json", "--jobs", 2)
    assert outcome.exit_code == 2
    statuses = {path: entry["status"] for path, entry in entries().items()}
    assert statuses == {
        **dict.fromkeys(("a.yaml", "a.yml", "b.yaml", "b/b.gains.json.yaml"), "invalid"),
        **dict.fromkeys(("c.yaml", "c/c.yaml", "d/summary.json.yaml"), "certified"),
    }
    assert json.loads(outcome.stdout)["counts"]["invalid"] == 4
    problems = {path: entry["problems"][0]["message"] for path, entry in entries().items() if entry["problems"]}
    assert problems == {
        "a.yaml": "its results would stand in a, as those of a.yml; rename one of them",
        "a.yml": "its results would stand in a, as those of a.yaml; rename one of them",
        "b.yaml": "its results would stand in b/b.gains.json, as those of b/b.gains.json.yaml; rename one of them",
        "b/b.gains.json.yaml": "its results would stand in b/b.gains.json, as those of b.yaml; rename one of them",
    }
    again = run("batch", ".", "--jobs", 2, "-v")
    assert again.exit_code == 2
    assert {path for path, entry in entries().items() if entry["up_to_date"]} == {
        *("c.yaml", "c/c.yaml", "d/summary.json.yaml")
    }
    Path("a.yml").unlink()
    Path("b/b.gains.json.yaml").unlink()
    assert run("batch", ".", "--jobs", 2, "-q").exit_code == 0


@pytest.mark.parametrize("form", ["json", "junit", "github", "sarif"])
@pytest.mark.usefixtures("here")
def test_a_batch_that_is_refused_says_that_nothing_is_written(form):
    outcome = run("batch", "absent", "--format", form)
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    first, second = outcome.stderr.splitlines()
    assert first.startswith("absent: there is no such file or folder")
    assert second == f"--format {form}: nothing is written [OBS101]"
    put("wrong.yaml", WRONG)
    assert run("batch", "wrong.yaml", "--format", form, "--output-file", "old", "-q", "--jobs", 1).exit_code == 2
    yesterday = Path("old").read_text()
    outcome = run("batch", "absent", "--format", form, "--output-file", "old")
    said = f"old: --format {form}: nothing is written; the file is of an earlier batch [OBS101]"
    assert outcome.stderr.splitlines()[1] == said
    assert Path("old").read_text() == yesterday


def test_shards_share_the_specs_out():
    tasks = [Task(f"{i}.yaml") for i in range(7)]
    shards = [share(tasks, f"{i}/3") for i in (1, 2, 3)]
    assert sorted(task for shard in shards for task in shard) == tasks
    assert max(map(len, shards)) - min(map(len, shards)) <= 1
    assert share(tasks, None) == tasks


# One spec


@pytest.mark.usefixtures("here")
def test_a_spec_is_solved_verified_simulated_and_held_against_what_it_expects():
    put("a.yaml", GOOD + "expect: {status: certified, observer.type: l2, simulation.status: done}\n")
    result = perform(Task("a.yaml"), Options(simulate=True))
    entry = result.entry
    assert (entry["status"], entry["exit_code"], entry["as_expected"], entry["verified"]) == (
        "certified",
        0,
        True,
        True,
    )
    assert [one["found"] for one in entry["expected"]] == ["certified", "l2", "done"]
    assert list(result.files) == ["gains", "csv", "png"]
    assert entry["guarantee"]["alpha"] == 0.1
    assert entry["problems"] == []


@pytest.mark.parametrize(
    ("text", "status", "code", "verified", "problem"),
    [
        (GOOD + "expect: {status: infeasible}\n", "certified", 0, True, "expected infeasible, found certified"),
        (GOOD + "expect: {alpha: {verified: 7}}\n", "certified", 0, True, "expected 7.0, found 0.1"),
        (GOOD + "expect: {diagnosis.size: 1}\n", "certified", 0, True, "expected 1.0, found nothing"),
        (HIDDEN, "infeasible", 3, None, "no observer makes its error decay"),
        (WRONG, "invalid", 2, None, "alpa"),
        (GOOD.replace("-1", "0").replace("{L1: 5}", "{L1: 5, gamma: 1.0e-9}"), "uncertified", 4, None, ""),
    ],
)
@pytest.mark.usefixtures("here")
def test_a_spec_that_is_not_as_expected_says_why(text, status, code, verified, problem):
    put("a.yaml", text)
    entry = perform(Task("a.yaml"), Options()).entry
    assert (entry["status"], entry["exit_code"], entry["as_expected"]) == (status, code, False)
    assert verified is None or entry["verified"] is verified
    assert problem in entry["problems"][0]["message"] + entry["problems"][0].get("key", "")
    assert entry["problems"][0]["file"] == "a.yaml"


@pytest.mark.usefixtures("here")
def test_an_unmet_expectation_has_its_place():
    put("a.yaml", GOOD + "expect:\n  alpha: 7\n")
    (problem,) = perform(Task("a.yaml"), Options()).entry["problems"]
    assert problem == {
        "id": "OBS617",
        "message": "expected 7.0, found 0.1",
        "file": "a.yaml",
        "line": 8,
        "column": 10,
        "key": "expect.alpha",
    }


@pytest.mark.usefixtures("here", "at_once")
def test_a_filter_of_which_nothing_is_proved_is_run_and_held_against_what_it_expects():
    text = GOOD.replace("{type: l2, alpha: 0.1, bounds: {L1: 5}}", "{type: ekf, Q: [[1]], R: [[1]], P0: [[1]]}")
    put("a.yaml", text.replace("B: [[1]]", "B: [[1]], D: [[0]]") + "expect: {simulation.status: done}\n")
    result = perform(Task("a.yaml"), Options(simulate=True))
    entry = result.entry
    assert entry["problems"] == []
    assert (entry["status"], entry["exit_code"], entry["as_expected"], entry["verified"]) == (
        "uncertified",
        0,
        True,
        None,
    )
    assert list(result.files) == ["csv", "png"]
    for wanted, code in (("uncertified", 0), ("certified", 4), ("infeasible", 4)):
        put("a.yaml", text.replace("B: [[1]]", "B: [[1]], D: [[0]]") + f"expect: {{status: {wanted}}}\n")
        assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == code
        assert entries()["a.yaml"]["expected"][0]["found"] == "uncertified"
        assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == code  # and its record is believed
        assert entries()["a.yaml"]["up_to_date"] is True
        assert run("batch", "--merge", "results", "--out", "all", "-q").exit_code == code


# The whole


@pytest.mark.usefixtures("folder")
def test_a_batch_gives_a_table_a_summary_and_one_folder_a_spec():
    outcome = run("batch", "specs", "--simulate")
    assert outcome.exit_code == 0, outcome.output
    rows = outcome.stdout.splitlines()
    assert [row.split()[:3] for row in rows[:-1]] == [
        ["ok", "certified", "specs/deep/good.yml"],
        ["ok", "infeasible", "specs/deep/hidden.yaml"],
        ["ok", "certified", "specs/good.yaml"],
    ]
    assert rows[-1].startswith("specs 3: 2 certified, 1 infeasible; all as expected; ")
    assert [line[:5] for line in outcome.stderr.splitlines()] == ["[1/3]", "[2/3]", "[3/3]"]
    assert files("results/specs/good") == ["good.gains.json", "good.record.json", "good.run.csv", "good.run.png"]
    assert files("results/specs/deep/hidden") == ["hidden.gains.json", "hidden.record.json"]
    content = summary()
    assert list(content) == [
        "obsdesign",
        "tool",
        "options",
        "list_sha256",
        "created",
        "time_s",
        "exit_code",
        "counts",
        "specs",
    ]
    assert content["counts"] == {
        "total": 3,
        "as_expected": 3,
        "certified": 2,
        "infeasible": 1,
        **dict.fromkeys(["refuted", "uncertified", "invalid", "timeout", "memory", "crashed", "skipped"], 0),
    }
    assert list(content["specs"][0]) == [
        *(
            "path",
            "set",
            "sha256",
            "status",
            "exit_code",
            "as_expected",
            "verified",
            "up_to_date",
            "why",
            "expected",
            "recorded",
        ),
        *("guarantee", "problems", "files", "time_s"),
    ]
    assert content["specs"][2]["files"]["csv"] == "specs/good/good.run.csv"
    assert run("verify", "results/specs/good/good.gains.json", "specs/good.yaml").exit_code == 0


@pytest.mark.usefixtures("folder")
def test_the_summary_is_the_same_for_every_order_and_number_of_jobs():
    put("specs/wrong.yaml", WRONG)
    assert run("batch", "specs", "--out", "one", "--jobs", 1).exit_code == 2
    arguments = ["specs/wrong.yaml", "specs/good.yaml", "specs/deep", "--jobs", 3]
    assert run("batch", *arguments, "--out", "three").exit_code == 2
    assert lasting("one") == lasting("three")


@pytest.mark.parametrize(
    ("codes", "worst"),
    [
        ({"good": 0}, 0),
        ({"good": 0, "hidden": 3}, 3),
        ({"hidden": 3, "unmet": 4}, 4),
        ({"hidden": 3, "unmet": 4, "wrong": 2}, 2),
    ],
)
@pytest.mark.usefixtures("here")
def test_the_exit_code_is_the_worst_of_what_is_not_as_expected(codes, worst):
    texts = {"good": GOOD, "hidden": HIDDEN, "wrong": WRONG, "unmet": GOOD + "expect: {alpha: 7}\n"}
    for name in codes:
        put(f"{name}.yaml", texts[name])
    outcome = run("batch", ".", "-q")
    assert (outcome.exit_code, outcome.stdout) == (worst, "")
    assert summary()["exit_code"] == worst
    labels = {"hidden": "infeasible", "unmet": "not as expected", "wrong": "invalid"}
    told = {line.partition(":")[0] for line in outcome.stderr.splitlines()}
    assert told == {labels[name] for name in codes if name != "good"}


@pytest.mark.usefixtures("folder", "at_once")
def test_what_is_up_to_date_is_not_redone_and_v_says_why_another_is(monkeypatch):
    def whys(*options):
        outcome = run("batch", "specs", "-v", "--jobs", 1, *options)
        assert outcome.exit_code == 0, outcome.output
        found = {path: entry["why"] for path, entry in entries().items()}
        assert all((f"({why})" in outcome.stderr) == bool(why) for why in found.values())
        assert all(entry["up_to_date"] == (entry["why"] is None) for entry in entries().values())
        return [found[name] for name in ("specs/good.yaml", "specs/deep/good.yml", "specs/deep/hidden.yaml")]

    assert whys() == ["never run"] * 3
    before = lasting()
    assert whys() == [None] * 3
    assert lasting() == before
    assert whys("--force") == ["--force"] * 3
    assert whys("--timeout", 500) == [None] * 3  # a limit matters to what it ended
    put("specs/good.yaml", GOOD + "# a remark\n")
    Path("results/specs/deep/good/good.gains.json").unlink()
    Path("results/specs/deep/hidden/hidden.gains.json").write_text("{}")
    lost, altered = "specs/deep/good/good.gains.json is missing", "specs/deep/hidden/hidden.gains.json was changed"
    assert whys() == ["the spec changed", lost, altered]
    Path("results/specs/good/good.record.json").write_text("{")
    Path("results/specs/deep/hidden/.obsdesign.x").write_text("half-written")
    assert whys() == ["never run", None, None]
    assert whys("--solver", "clarabel", "--simulate") == ["simulate changed"] * 3
    monkeypatch.setattr("obsdesign.batches.record.__version__", "9")
    assert whys() == ["version of the tool changed"] * 3


@pytest.mark.usefixtures("here", "at_once")
def test_what_was_undecided_is_up_to_date_without_a_result_file():
    put("a.yaml", UNDECIDED)
    for why in ("never run", None, None):
        outcome = run("batch", "a.yaml", "--set", "observer.alpha=0.1,0.2")
        assert outcome.exit_code == 4
        found = summary()["specs"]
        assert [(entry["status"], entry["files"], entry["why"]) for entry in found] == [("uncertified", {}, why)] * 2
        assert outcome.stderr.count("[OBS508]") == 2
    record = next(Path("results").rglob("a.record.json"))
    record.write_text(record.read_text().replace("uncertified", "infeasible"))
    run("batch", "a.yaml", "--set", "observer.alpha=0.1,0.2")
    assert [entry["why"] for entry in summary()["specs"]] == ["its gains file is missing", None]


@pytest.mark.usefixtures("folder", "at_once")
def test_only_what_differs_from_another_summary_is_run():
    run("batch", "specs", "--out", "before")
    put("specs/good.yaml", GOOD + "# a remark\n")
    put("specs/new.yaml")
    for source in ("before", "before/summary.json"):
        outcome = run("batch", "specs", "--out", "after", "--changed-since", source)
        assert outcome.exit_code == 0
        found = {path: (entry["status"], entry["as_expected"]) for path, entry in entries("after").items()}
        assert found == {
            "specs/deep/good.yml": ("skipped", None),
            "specs/deep/hidden.yaml": ("skipped", None),
            "specs/good.yaml": ("certified", True),
            "specs/new.yaml": ("certified", True),
        }
        assert (
            entries("after")["specs/deep/good.yml"]["why"]
            == f"unchanged since {source}, which says that it was as expected"
        )
    run("batch", "specs", "--out", "other", "--changed-since", "before", "--simulate")
    assert summary("other")["counts"]["skipped"] == 0


@pytest.mark.usefixtures("here")
def test_a_batch_may_end_with_the_first_that_is_not_as_expected():
    put("a.yaml")
    put("b.yaml", HIDDEN)
    put("c.yaml")
    for _ in range(2):  # the second finds it in its record
        assert run("batch", ".", "--fail-fast", "--jobs", 1).exit_code == 3
        assert [entry["status"] for entry in entries().values()] == ["certified", "infeasible", "skipped"]
        assert entries()["c.yaml"]["why"] == "--fail-fast"


# Changes


@pytest.mark.parametrize(
    ("changes", "combinations"),
    [
        ([], [()]),
        (["a=1, 2"], [("a=1",), ("a=2",)]),
        (["a=1,2,1", "b=0"], [("a=1", "b=0"), ("a=2", "b=0")]),
        (["a.b=1,2", "c=3,4"], [(a, c) for a in ("a.b=1", "a.b=2") for c in ("c=3", "c=4")]),
        (["a=[1, 2],{x: 1, y: [2, 3]}"], [("a=[1, 2]",), ("a={x: 1, y: [2, 3]}",)]),
        (["""a='x,y',"\\",",[f(1, 2)],f(1,2)"""], [("a='x,y'",), ('a="\\","',), ("a=[f(1, 2)]",), ("a=f(1,2)",)]),
        (["a=it's,so"], [("a=it's",), ("a=so",)]),
    ],
)
def test_commas_separate_values_outside_of_what_encloses_them(changes, combinations):
    assert sweep.combinations(changes) == combinations


@pytest.mark.usefixtures("folder", "at_once")
def test_changes_are_tried_in_every_combination_and_kept_apart():
    sets = "--set", "observer.alpha=0.1,0.2", "--set", "simulation={horizon: 1, points: 3},{horizon: 1, x0: [1]}"
    outcome = run("batch", "specs/good.yaml", *sets)
    assert outcome.exit_code == 0, outcome.output
    found = summary()["specs"]
    both = [["simulation={horizon: 1, points: 3}"], ["simulation={horizon: 1, x0: [1]}"]]
    assert [entry["set"] for entry in found] == [
        [f"observer.alpha={alpha}", *s] for alpha in ("0.1", "0.2") for s in both
    ]
    assert [entry["guarantee"]["alpha"] for entry in found] == [0.1, 0.1, 0.2, 0.2]
    assert summary()["options"]["set"] == list(sets[1::2])
    gains = Path("results", found[0]["files"]["gains"])
    assert str(gains.parent.parent) == "results/specs/good"
    assert json.loads(gains.read_text())["spec"]["set"] == found[0]["set"]
    assert run("verify", gains, "specs/good.yaml").exit_code == 0
    assert outcome.stdout.startswith(
        "ok    certified    specs/good.yaml observer.alpha=0.1 simulation={horizon: 1, points"
    )
    run("batch", "specs/good.yaml", "--set", "observer.alpha=0.2", "-v")
    assert files("results/specs/good/observer.alpha=0.2") == ["good.gains.json", "good.record.json"]
    run("batch", "specs/good.yaml", *sets, "-q")
    assert all(entry["up_to_date"] for entry in summary()["specs"])
    run(
        "batch", "specs/good.yaml", "--set", "observer.alpha=0.1", *sets[2:], "--changed-since", "results", "--out", "o"
    )
    assert summary("o")["counts"]["skipped"] == 2
    run("batch", "--merge", "results", "--out", "all")
    assert lasting("all") == lasting()


@pytest.mark.usefixtures("folder", "at_once")
def test_names_of_changes_do_not_leave_their_folder():
    hostile = ("name=../../x\n", "name=a,b")
    (task,) = find(["specs/good.yaml"], (), [hostile])
    assert task.place == "specs/good/name=..%2F..%2Fx%0A,name=a%2Cb"
    alike = [(f"name={'x' * 300}{i}",) for i in range(2)]
    places = {task.place for task in find(["specs/good.yaml"], (), alike)}
    assert all(re.fullmatch(r"specs/good/name=x{75}\.\.[0-9a-f]{16}", place) for place in places)
    assert len(places) == 2
    put("specs/good/observer.alpha=1.yaml")
    outcome = run("batch", "specs", "--set", "observer.alpha=1,2")
    assert outcome.exit_code == 0  # that spec has its results below specs/good/observer.alpha=1/observer.alpha=1
    put("specs/same/a=1.yaml")
    put("specs/same.yaml")
    refused = clashes(find(["specs"], (), [(), ("a=1",)]))
    assert {task.title: problem.message for task, problem in refused.items()} == {
        "specs/same.yaml a=1": "its results would stand in specs/same/a=1, as those of specs/same/a=1.yaml;"
        " rename one of them",
        "specs/same/a=1.yaml": "its results would stand in specs/same/a=1, as those of specs/same.yaml;"
        " rename one of them",
    }


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            "observer.alpha",
            "--set: expected KEY=VALUE with a dotted key, such as observer.alpha=0.5; found observer.alpha",
        ),
        ("observer.alpha=1,", "--set observer.alpha=: the value is empty; give one, or leave the option out"),
        ("observer.alpha=[1", "--set observer.alpha=[1: the value is not YAML"),
        ("observer.alpa=1", "good.yaml: observer.alpa: unknown key alpa; did you mean alpha?"),
    ],
)
@pytest.mark.usefixtures("here")
def test_what_is_no_change_is_refused(change, said):
    put("good.yaml")
    outcome = run("batch", "good.yaml", "-q", "--set", change)
    assert outcome.exit_code == 2
    (line,) = outcome.stderr.splitlines()
    assert line.removeprefix("invalid: ").startswith(said)
    if line.startswith("invalid"):
        assert line.endswith(f"(--set {change})")


@pytest.mark.usefixtures("folder")
def test_the_python_api_runs_a_batch():
    made = od.batch(["specs/good.yaml"], changes=["observer.alpha=0.2"], out="api", jobs=1)
    assert (made.exit_code, made.counts["certified"]) == (0, 1)
    assert [entry["path"] for entry in made.specs] == ["specs/good.yaml"]
    assert made.report == summary("api")
    assert str(made).splitlines()[0].split()[:4] == ["ok", "certified", "specs/good.yaml", "observer.alpha=0.2"]
    with pytest.raises(od.UsageError, match="absent"):
        od.batch(["absent"])
