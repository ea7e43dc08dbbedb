"""Records and summaries that anyone may have written, and names that are traps: nothing is believed or overwritten."""

import json
import os
from hashlib import sha256
from pathlib import Path
from xml.etree import ElementTree

import jsonschema
import pytest
from support.commands import run
from test_batch import GOOD, entries, put
from test_batch_formats import schema

pytestmark = pytest.mark.usefixtures("here", "at_once")
RECORD = Path("results/a/a.record.json")
FORGED = [
    ("options", []),
    ("tool", "x"),
    ("hashes", {}),
    ("hashes", None),
    ("entry.path", 5),
    ("entry.set", None),
    ("entry.files", {}),
    ("entry.files", {"gains": 5}),
    ("entry.status", "bogus"),
    ("entry.status", ["certified"]),
    ("entry.guarantee", {"gamma": "x"}),
    ("entry.guarantee", {"gamma": 10**400}),
    ("entry.guarantee", {"\u001b[31mX\n::error::y": 1}),
    ("entry.as_expected", "yes"),
    ("entry.exit_code", True),
    ("entry.problems", [{}]),
    ("entry.expected", [{}]),
    ("entry.time_s", "x"),
]


def changed(path, key, value):
    """Change one entry of a JSON file."""
    content = json.loads(path.read_text())
    part, *rest = key.split(".")
    if rest:
        content[part][rest[0]] = value
    else:
        content[part] = value
    path.write_text(json.dumps(content))


@pytest.mark.parametrize(("key", "value"), FORGED)
def test_a_record_of_another_form_is_none(key, value):
    put("a.yaml")
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    changed(RECORD, key, value)
    outcome = run("batch", "a.yaml", "--jobs", 1)
    assert (outcome.exit_code, outcome.exception is None or isinstance(outcome.exception, SystemExit)) == (0, True)
    assert entries()["a.yaml"]["status"] == "certified"
    assert entries()["a.yaml"]["up_to_date"] is False
    assert "::error::" not in outcome.output


@pytest.mark.parametrize("content", ["[" * 100_000, "[]", "5", ""])
def test_a_record_that_cannot_be_read_is_none(content):
    put("a.yaml")
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    RECORD.write_text(content)
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    assert entries()["a.yaml"]["why"] == "never run"


@pytest.mark.parametrize(
    ("key", "value"),
    [
        *(("options", []), ("options.shard", 5), ("options.shard", "1/9" * 10**6), ("options.shard", "0/5")),
        *(("time_s", "x"), ("time_s", 10**400), ("time_s", float("inf")), ("tool", 1)),
        *(("specs", [5]), ("specs", {}), ("counts", 1), ("exit_code", None), ("exit_code", "0"), ("exit_code", 7)),
    ],
    ids=lambda value: str(value)[:20],
)
def test_a_summary_of_another_form_is_refused(key, value):
    put("a.yaml")
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    changed(Path("results/summary.json"), key, value)
    for command in (("--merge", "results", "--out", "all"), ("a.yaml", "--changed-since", "results", "--out", "new")):
        outcome = run("batch", *command)
        assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
        assert "[OBS911]" in outcome.stderr


SPEC = {"path": "a.yaml", "status": "invalid", "exit_code": 2, "as_expected": False, "verified": None, "files": {}}
PROBLEM = {"id": "OBS104", "message": "wrong", "file": "a.yaml", "line": 3}
FORGED_ENTRIES = [
    {"expected": [{"key": "gamma", "expected": 1, "found": float("nan"), "holds": False}]},
    {"expected": [{"key": "gamma", "expected": 1, "found": float("inf"), "holds": False}]},
    {"expected": [{"key": "gamma", "expected": 10**400, "found": 1, "holds": False}]},
    {"problems": [{**PROBLEM, "column": 0}]},
    {"problems": [{**PROBLEM, "line": True}]},
    {"problems": [{**PROBLEM, "line": -1}]},
    {"status": "invalid\n::error::forged"},
    {"status": "\ud800"},
    {"path": "\ud800.yaml"},
]


@pytest.mark.parametrize("parts", FORGED_ENTRIES, ids=str)
def test_an_entry_of_another_form_is_refused_by_whoever_reads_a_summary(parts):
    put("a.yaml")
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    path = Path("results/summary.json")
    content = json.loads(path.read_text())
    content["specs"][0] |= SPEC | {"guarantee": {}} | parts
    path.write_text(json.dumps(content))
    RECORD.unlink()
    said = "results/summary.json: "
    outcome = run("batch", "--merge", "results", "--out", "all")
    assert (outcome.exit_code, outcome.stdout, outcome.stderr.startswith(said)) == (2, "", True)
    outcome = run("report", "results")  # which shows what else there is
    assert (outcome.exit_code, outcome.stderr.startswith(said), outcome.stderr.count("\n")) == (2, True, 1)
    assert outcome.stdout == "1 certified, 1 invalid\nreport  report.html\n"


def test_a_problem_without_a_column_is_placed_by_its_line():
    put("a.yaml", "obsdesign: [")
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 2
    for path in (RECORD, Path("results/summary.json")):
        content = json.loads(path.read_text())
        (content["entry"] if path == RECORD else content["specs"][0])["problems"] = [PROBLEM]
        path.write_text(json.dumps(content))
    outcome = run("batch", "--merge", "results", "--out", "all", "--format", "sarif")
    (result,) = json.loads(outcome.stdout)["runs"][0]["results"]
    assert result["locations"][0]["physicalLocation"]["region"] == {"startLine": 3}


def test_shards_that_are_missing_are_told_in_a_short_line():
    put("a.yaml")
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    changed(Path("results/summary.json"), "options.shard", "1/999999")
    outcome = run("batch", "--merge", "results", "--out", "all")
    assert outcome.exit_code == 2
    assert "2/999999, 3/999999" in outcome.stderr
    assert outcome.stderr.endswith("and 999988 more missing [OBS911]\n")


def test_a_pipe_in_place_of_a_summary_is_refused_and_not_waited_for():
    put("a.yaml")
    Path("base").mkdir()
    os.mkfifo("base/summary.json")
    outcome = run("batch", "a.yaml", "--changed-since", "base")
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
    assert "base/summary.json: is no file; give the summary of a batch, or its folder [OBS911]" in outcome.stderr


def test_a_summary_that_differs_from_its_records_is_not_merged():
    put("a.yaml")
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    path = Path("results/summary.json")
    content = json.loads(path.read_text())
    content["specs"][0]["guarantee"]["gamma"] = 1e-20
    path.write_text(json.dumps(content))
    outcome = run("batch", "--merge", "results", "--out", "all")
    assert outcome.exit_code == 2
    assert "differs from the record of a.yaml in guarantee" in outcome.stderr


def test_figures_that_were_made_stay_where_they_are_not_asked_for():
    put("a.yaml")
    assert run("batch", "a.yaml", "-q", "--jobs", 1, "--simulate").exit_code == 0
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    assert entries()["a.yaml"]["up_to_date"] is True
    assert Path("results/a/a.run.png").is_file()


def test_what_was_not_as_expected_is_run_again_though_it_is_the_same():
    put("a.yaml")
    put("b.yaml", GOOD + "expect: {status: infeasible}\n")
    assert run("batch", ".", "-q", "--jobs", 1, "--out", "base").exit_code == 4
    assert run("batch", "a.yaml", "b.yaml", "-q", "--jobs", 1, "--changed-since", "base").exit_code == 4
    assert [entry["status"] for entry in entries().values()] == ["skipped", "certified"]


def test_results_that_are_links_are_replaced_and_what_they_lead_to_is_kept():
    put("a.yaml")
    put("victim", "precious")
    put("results/a/x", "")
    for name in ("a.gains.json", "a.record.json", "a.run.csv"):
        Path("results/a", name).symlink_to(Path("victim").resolve())
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    assert Path("victim").read_text() == "precious"
    assert not Path("results/a/a.gains.json").is_symlink()


def test_files_of_others_are_left_and_pipes_are_no_specs():
    put("specs/a.yaml")
    put("results/.obsdesign.notes", "mine")
    os.mkfifo("specs/pipe.yaml")
    assert run("batch", "specs", "-q", "--jobs", 1).exit_code == 0
    assert Path("results/.obsdesign.notes").read_text() == "mine"
    assert list(entries()) == ["specs/a.yaml"]


def test_a_name_that_leads_upward_is_refused_and_one_too_long_is_told():
    put("in/...yaml")
    outcome = run("batch", "in", "--jobs", 1)
    assert outcome.exit_code == 2
    assert "in/...yaml: a spec cannot have this name: its results would leave their folder" in outcome.stderr
    Path("in/...yaml").unlink()
    put("summary.json.yaml")
    assert "or stand in that of summary.json [OBS912]" in run("batch", "summary.json.yaml").stderr
    put(f"in/{'x' * 249}.yaml")
    put("in/a.yaml")
    assert run("batch", "in", "--jobs", 1).exit_code == 2
    assert [entry["status"] for entry in entries().values()] == ["certified", "invalid"]


def test_a_spec_whose_format_is_missing_is_not_left_out():
    put("a.yaml", GOOD.replace("obsdesign: 1", "obsdesing: 1"))
    assert run("batch", ".", "--jobs", 1).exit_code == 2
    assert entries()["a.yaml"]["status"] == "invalid"


@pytest.mark.parametrize("filler", ["\n", "\r", " ", "\t", ",", "{ ", ", \n"])
def test_a_large_file_of_blanks_is_looked_at_once(filler):
    put("blank.yaml", filler * (2**22 // len(filler) - 100))  # would take hours, were each blank a beginning
    put("late.yaml", "# a spec\r\n" + "\n" * 2**16 + '{\r\n\t "obsdesign" : 1}')
    assert run("batch", ".", "--jobs", 1).exit_code == 2
    empty = [] if filler.strip() else ["blank.yaml"]  # a spec that was lost, which is told
    assert list(entries()) == [*empty, "late.yaml"]


def test_results_that_were_changed_or_lost_are_not_merged():
    put("a.yaml")
    assert run("batch", "a.yaml", "-q", "--simulate", "--jobs", 1).exit_code == 0

    def refusal():
        outcome = run("batch", "--merge", "results", "--out", "all")
        assert (outcome.exit_code, Path("all/summary.json").exists()) == (2, False)
        return outcome.stderr

    gains, run_csv, whole = Path("results/a/a.gains.json"), Path("results/a/a.run.csv"), RECORD.read_text()
    good = gains.read_text()
    gains.write_text(good + " ")
    assert refusal() == "results: a/a.gains.json was changed; run its shard again [OBS911]\n"
    gains.unlink()
    assert refusal() == "results: a/a.gains.json is missing; run its shard again [OBS911]\n"
    gains.write_text(good)
    run_csv.rename("kept.csv")
    assert "a/a.run.csv is missing" in refusal()
    Path("kept.csv").rename(run_csv)
    summary = Path("results/summary.json").read_text()
    for path, place in ((RECORD, ("entry",)), (Path("results/summary.json"), ("specs", 0)), (RECORD, ("hashes",))):
        content = json.loads(path.read_text())
        part = content
        for key in place:
            part = part[key]
        del (part if place == ("hashes",) else part["files"])["gains"]
        path.write_text(json.dumps(content))
    assert "the gains file of a.yaml is missing" in refusal()
    RECORD.unlink()
    assert "the record of a.yaml is missing" in refusal()
    RECORD.write_text(whole)
    Path("results/summary.json").write_text(summary)
    assert run("batch", "--merge", "results", "--out", "all", "-q").exit_code == 0


def test_a_merge_leaves_no_file_of_an_earlier_run():
    put("a.yaml")
    put("b.yaml")
    long = "x" * 249
    put(f"{long}.yaml")  # the names of its results would be too long: it has none
    assert run("batch", "a.yaml", "b.yaml", "-q", "--simulate", "--jobs", 1, "--out", "all").exit_code == 0
    put("b.yaml", GOOD + "expekt: 1\n")
    assert run("batch", ".", "-q", "--jobs", 1).exit_code == 2
    for sources, out in (("results", "all"), ("all", "all")):
        assert run("batch", "--merge", sources, "--out", out, "-q").exit_code == 2
        assert sorted(path.name for path in Path("all/a").iterdir()) == ["a.gains.json", "a.record.json"]
        assert [path.name for path in Path("all/b").iterdir()] == ["b.record.json"]
    assert [entry["status"] for entry in entries("all").values()] == ["certified", "invalid", "invalid"]


@pytest.mark.parametrize("ending", ["gains.json", "record.json", "run.csv"])
def test_a_pipe_in_place_of_a_result_is_replaced_and_not_waited_for(ending):
    put("a.yaml")
    pipe = Path(f"results/a/a.{ending}")
    for out in ("results", "all"):
        Path(out, "a").mkdir(parents=True)
        os.mkfifo(f"{out}/a/a.{ending}")
    assert run("batch", "a.yaml", "-q", "--simulate", "--jobs", 1).exit_code == 0
    assert pipe.is_file()
    assert run("batch", "--merge", "results", "--out", "all", "-q").exit_code == 0
    assert Path(f"all/a/a.{ending}").read_bytes() == pipe.read_bytes()
    pipe.unlink()
    os.mkfifo(pipe)
    said = "record of a.yaml" if ending == "record.json" else f"a/a.{ending}"
    assert f"{said} is missing" in run("batch", "--merge", "results", "--out", "new").stderr
    assert run("batch", "a.yaml", "-q", "--simulate", "--jobs", 1).exit_code == 0
    assert entries()["a.yaml"]["up_to_date"] is False
    assert pipe.is_file()


CONTRADICTIONS = [
    {"status": "invalid"},
    {"status": "infeasible"},
    {"status": "skipped"},
    {"exit_code": 4},
    {"exit_code": 3, "status": "infeasible"},  # without a word on it in `expected`
    {"exit_code": None},
    {"as_expected": None},
    {"verified": False},
    {"verified": None},
    {"verified": False, "as_expected": False},
    {"expected": [{"key": "alpha", "expected": 1, "found": 0.1, "holds": False}]},
    {"expected": [{"key": "status", "expected": [], "found": "certified", "holds": True}]},
]


@pytest.mark.parametrize("parts", CONTRADICTIONS)
def test_an_entry_that_contradicts_itself_is_not_believed(parts):
    put("a.yaml")
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    for path in (RECORD, Path("results/summary.json")):
        content = json.loads(path.read_text())
        (content["entry"] if path == RECORD else content["specs"][0]).update(parts)
        path.write_text(json.dumps(content))
    outcome = run("batch", "--merge", "results", "--out", "all")
    said = "results: what it says of a.yaml contradicts itself; run its shard again [OBS911]\n"
    assert (outcome.exit_code, outcome.stderr) == (2, said)
    assert run("batch", "a.yaml", "-q", "--jobs", 1, "--changed-since", "results", "--out", "new").exit_code == 0
    assert entries("new")["a.yaml"]["status"] == "certified"
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    assert (entries()["a.yaml"]["status"], entries()["a.yaml"]["why"]) == ("certified", "never run")


IDLE = ["--jobs=3", "--force", "--simulate", "--exclude=x", "--fail-fast", "--shard=1/2", "--changed-since=results"]


@pytest.mark.parametrize("option", [*IDLE, "--set=observer.alpha=1", "--memory=5", "--timeout=9", "-v", "--jobs=0"])
def test_an_option_that_a_merge_would_ignore_is_refused(option):
    put("a.yaml")
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    outcome = run("batch", "--merge", "results", "--out", "all", option)
    name = {"-v": "--verbose"}.get(option, option.partition("=")[0])
    said = f"{name}: --merge runs no spec, and would ignore this; leave it out [OBS904]\n"
    assert (outcome.exit_code, outcome.stdout, outcome.stderr) == (2, "", said)
    told = ("--format", "sarif", "--output-file", "told", "-q", "--json")
    outcome = run("batch", "--merge", "results", "--out", "all", *told)
    assert (outcome.exit_code, json.loads(outcome.stdout)["counts"]["certified"]) == (0, 1)
    assert json.loads(Path("told").read_text())["version"] == "2.1.0"


def test_two_forms_are_not_printed_at_once():
    put("a.yaml")
    outcome = run("batch", "a.yaml", "--json", "--format", "junit")
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
    assert "--json and --format are both printed; write one with --output-file [OBS904]" in outcome.stderr


@pytest.mark.parametrize("form", ["junit", "github", "sarif", "json"])
@pytest.mark.parametrize(
    "lost",
    [
        *("specs/a.yaml", "link.yaml", "spec.txt", "results/summary.json", "base/summary.json", "kept.run.csv"),
        *("results/specs/a/a.gains.json", "results/specs/a/a.record.json", "./results/specs/../summary.json"),
    ],
)
def test_no_file_for_other_programs_stands_in_the_place_of_a_spec_or_a_result(form, lost):
    put("specs/a.yaml")
    put("spec.txt")
    put("kept.run.csv", "t,x1\n")
    Path("link.yaml").symlink_to("specs/a.yaml")
    for out in ("results", "base"):
        assert run("batch", "specs", "-q", "--jobs", 1, "--out", out).exit_code == 0
    before = Path(lost).read_bytes()
    sources = ("spec.*", "specs", "--changed-since", "base", "--jobs", 1)
    outcome = run("batch", *sources, "--format", form, "--output-file", lost)
    assert (outcome.exit_code, outcome.stderr.count("\n"), Path(lost).read_bytes()) == (2, 1, before)
    assert outcome.stderr.startswith(f"{lost}: ")
    assert "; name another" in outcome.stderr
    for _ in range(2):
        assert run("batch", "specs", "-q", "--format", form, "--output-file", "results/told").exit_code == 0


def test_the_summaries_that_are_merged_are_not_replaced():
    put("a.yaml")
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    for source in ("results", "results/summary.json"):
        told = ("--format", "sarif", "--output-file", "results/summary.json")
        assert run("batch", "--merge", source, "--out", "all", *told).exit_code == 2


EXPECTING = GOOD + "expect: {status: certified, gamma: {verified: 1.0e-3}, simulation.status: done}\n"


def test_a_forged_record_of_results_that_are_there_is_not_believed():
    put("a.yaml", EXPECTING)
    for _ in range(2):
        assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 4
    assert entries()["a.yaml"]["up_to_date"] is True
    honest = entries()["a.yaml"]["guarantee"]
    content = json.loads(RECORD.read_text())
    content["entry"] |= {"as_expected": True, "exit_code": 0, "expected": [], "problems": []}
    content["entry"]["guarantee"]["gamma"] = 1e-12
    RECORD.write_text(json.dumps(content))
    outcome = run("batch", "a.yaml", "-v", "--jobs", 1, "--format", "junit")
    assert outcome.exit_code == 4
    assert "its result does not prove what its record says" in outcome.stderr
    assert "<failure" in outcome.stdout
    entry = entries()["a.yaml"]
    assert (entry["guarantee"], entry["as_expected"], entry["up_to_date"]) == (honest, False, False)
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 4
    assert entries()["a.yaml"]["up_to_date"] is True


def test_what_failed_is_told_as_it_is_found_again_not_as_a_record_says():
    put("a.yaml", EXPECTING)
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 4
    honest, content = entries()["a.yaml"], json.loads(RECORD.read_text())
    content["entry"] |= {"exit_code": 3, "problems": [{**content["entry"]["problems"][0], "message": "unobservable"}]}
    content["entry"]["expected"] = [{**one, "holds": True} for one in content["entry"]["expected"]]
    RECORD.write_text(json.dumps(content))
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 4
    entry = entries()["a.yaml"]
    for part in ("exit_code", "expected", "problems"):
        assert entry[part] == honest[part]


def resolved(**parts):
    """Why a spec is solved again whose result file has other parts, which its record has the hash of."""
    gains, record = Path("results/a/a.gains.json"), json.loads(RECORD.read_text())
    gains.write_text(json.dumps({**json.loads(gains.read_text()), **parts}))
    record["hashes"]["gains"] = sha256(gains.read_bytes()).hexdigest()
    RECORD.write_text(json.dumps(record))
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    return entries()["a.yaml"]["why"]


def test_a_forged_result_whose_hash_is_in_its_record_is_solved_again():
    put("a.yaml")
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    genuine = json.loads(Path("results/a/a.gains.json").read_text())
    changed = {**genuine["spec"], "set": ["system.A=[[-1000]]"]}
    better = {**genuine["guarantee"], "gamma": genuine["guarantee"]["gamma"] / 2}
    for parts in ({"spec": changed}, {"guarantee": better}, {"guarantee": []}, {"status": "infeasible"}):
        assert resolved(**parts) == "its result does not prove what its record says"
    assert resolved() is None


LIMITED = GOOD + "expect: {status: certified, gamma: {verified: 0.177967}, limit.gamma: {verified: 1.0e-3}}\n"
NOT_AGAIN = "as recorded, not found again"


def forged_limit():
    """A result whose limit is the one that its spec expects, which nothing proves, with a record that says so."""
    put("a.yaml", LIMITED)
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 4
    assert entries()["a.yaml"]["recorded"] == []  # found just now
    gains, record = Path("results/a/a.gains.json"), json.loads(RECORD.read_text())
    content = json.loads(gains.read_text())
    content["guarantee"]["limit"]["gamma"] = 1e-3
    gains.write_text(json.dumps(content))
    record["hashes"]["gains"] = sha256(gains.read_bytes()).hexdigest()
    expected = [{**one, "found": 1e-3, "holds": True} for one in record["entry"]["expected"][2:]]
    expected = [*record["entry"]["expected"][:2], *expected]
    record["entry"] |= {"as_expected": True, "exit_code": 0, "expected": expected, "problems": [], "recorded": []}
    RECORD.write_text(json.dumps(record))


def test_an_expectation_that_a_recorded_number_meets_is_told_as_recorded_until_it_is_computed():
    forged_limit()
    outcome = run("batch", "a.yaml", "--jobs", 1)
    assert outcome.exit_code == 0
    entry = entries()["a.yaml"]
    assert (entry["as_expected"], entry["up_to_date"], entry["recorded"]) == (True, True, ["gamma", "limit.gamma"])
    first, last = outcome.stdout.splitlines()
    assert first.endswith(f"  ({NOT_AGAIN}: gamma, limit.gamma)")
    said = "; 2 expectations of 1 result are held against what is recorded, not found again: --force computes them; "
    assert said in last
    assert run("batch", "--merge", "results", "--out", "all", "-q").exit_code == 0
    assert entries("all")["a.yaml"]["recorded"] == ["gamma", "limit.gamma"]
    outcome = run("batch", "a.yaml", "--jobs", 1, "--force")
    assert (outcome.exit_code, entries()["a.yaml"]["recorded"]) == (4, [])
    assert "recorded" not in outcome.stdout


def test_other_programs_are_told_what_is_as_recorded():
    forged_limit()

    def told(form):
        outcome = run("batch", "a.yaml", "--jobs", 1, "-q", "--format", form)
        assert outcome.exit_code == 0
        return outcome.stdout

    said = f"{NOT_AGAIN}: gamma, limit.gamma"
    (case,) = ElementTree.fromstring(told("junit")).iter("testcase")
    assert [(child.tag, child.text) for child in case] == [("system-out", said)]
    assert told("github") == f"::notice file=a.yaml,title=obsdesign as recorded::{said}\n"
    for _ in range(2):  # the second replaces what the first has written
        assert run("batch", "a.yaml", "-q", "--format", "github", "--output-file", "told.txt").exit_code == 0
    content = json.loads(told("sarif"))
    jsonschema.Draft7Validator(schema()).validate(content)
    (run_of,) = content["runs"]
    assert run_of["results"] == []
    (invocation,) = run_of["invocations"]
    assert [one["message"]["text"] for one in invocation["toolExecutionNotifications"]] == [said]
    assert json.loads(told("json"))["specs"][0]["recorded"] == ["gamma", "limit.gamma"]


def test_an_expectation_on_a_number_is_told_as_recorded_unless_it_is_run_again():
    """What is proved of the gains in a file need not be what a design gives: a weaker claim is proved as well."""
    proved = "status: certified, gamma: {verified: 0.177967}, observer.type: l2, simulation.status: finished"
    put("a.yaml", f"{GOOD}expect: {{{proved}}}\n")
    put("b.yaml", GOOD + "expect: {alpha: {verified: 0.1}, limit.attained: true, analysis.poles: {verified: 1}}\n")
    for own, computed in (([], []), (["gamma"], ["alpha", "limit.attained", "analysis.poles"])):
        outcome = run("batch", "a.yaml", "b.yaml", "-q", "--jobs", 1)
        assert entries()["a.yaml"]["expected"], outcome.output
        assert {path: entry["recorded"] for path, entry in entries().items()} == {"a.yaml": own, "b.yaml": computed}
        assert entries()["b.yaml"]["up_to_date"] is bool(computed)


def test_a_record_of_old_says_nothing_of_what_is_recorded_and_stays_up_to_date():
    put("a.yaml")
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    for path, place in ((RECORD, "entry"), (Path("results/summary.json"), "specs")):
        content = json.loads(path.read_text())
        del (content[place] if place == "entry" else content[place][0])["recorded"]
        path.write_text(json.dumps(content))
    assert run("batch", "--merge", "results", "--out", "all", "-q").exit_code == 0
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    assert (entries()["a.yaml"]["up_to_date"], entries()["a.yaml"]["recorded"]) == (True, [])


LOST = {"as_expected": False, "verified": None, "guarantee": {}, "files": {}, "expected": []}


def test_a_forged_record_of_a_spec_that_is_fine_and_claims_nothing_is_not_believed():
    for parts in (
        {"status": "invalid", "exit_code": 2, "problems": [PROBLEM], **LOST},
        {"status": "skipped", "exit_code": None, **LOST, "as_expected": None},
    ):
        put("a.yaml")
        assert run("batch", "a.yaml", "-q", "--jobs", 1, "--force").exit_code == 0
        record = json.loads(RECORD.read_text())
        record["entry"] |= parts
        RECORD.write_text(json.dumps({**record, "hashes": {}}))
        assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
        assert (entries()["a.yaml"]["status"], entries()["a.yaml"]["up_to_date"]) == ("certified", False)


def test_why_a_spec_is_invalid_is_told_as_it_is_found_again():
    put("a.yaml", "obsdesign: [")
    put("b.yaml", GOOD + "expect: {gama: 1}\n")
    assert run("batch", "a.yaml", "b.yaml", "-q", "--jobs", 1).exit_code == 2
    honest = entries()
    for path in (RECORD, Path("results/b/b.record.json")):
        record = json.loads(path.read_text())
        record["entry"] |= {"problems": [PROBLEM], "exit_code": 3}
        path.write_text(json.dumps(record))
    assert run("batch", "a.yaml", "b.yaml", "-q", "--jobs", 1).exit_code == 2
    for path, entry in entries().items():
        assert (entry["problems"], entry["exit_code"]) == (honest[path]["problems"], 2)
        assert (entry["up_to_date"], entry["recorded"]) == (True, [])


def test_that_a_spec_is_undecided_without_a_result_is_told_as_recorded():
    put("a.yaml")
    assert run("batch", "a.yaml", "-q", "--jobs", 1).exit_code == 0
    record = json.loads(RECORD.read_text())
    record["entry"] |= {"status": "uncertified", "exit_code": 4, "problems": [PROBLEM], **LOST}
    RECORD.write_text(json.dumps({**record, "hashes": {}}))
    outcome = run("batch", "a.yaml", "--jobs", 1)
    assert (outcome.exit_code, entries()["a.yaml"]["recorded"]) == (4, ["status"])
    assert f"({NOT_AGAIN}: status)" in outcome.stdout
    assert run("batch", "a.yaml", "-q", "--jobs", 1, "--force").exit_code == 0


LISTED = "its list_sha256 is not that of the specs in these summaries: one is missing, or was changed"


@pytest.mark.parametrize("shards", [("1/2", "2/2"), ("",)])
def test_a_summary_that_lost_an_entry_is_not_merged(shards):
    for name in ("a.yaml", "b.yaml", "c.yaml"):
        put(name, "obsdesign: [")
    folders = [f"s{i}" for i in range(len(shards))]
    for folder, shard in zip(folders, shards, strict=True):
        assert run("batch", ".", "-q", "--jobs", 1, "--out", folder, *(["--shard", shard] if shard else [])).exit_code
    path = Path("s0/summary.json")
    whole = json.loads(path.read_text())
    one_less = {"specs": whole["specs"][1:], "counts": {**whole["counts"], "total": len(whole["specs"]) - 1}}
    emptied = {"specs": [], "counts": {**whole["counts"], "total": 0}}
    named = "; no summary names what is in s0/a/a.record.json"
    for parts, said in (
        ({"specs": whole["specs"][1:]}, f"says that there are {len(whole['specs'])} specs, and holds"),
        ({"specs": []}, f"says that there are {len(whole['specs'])} specs, and holds 0; run it again"),
        (one_less, f"{LISTED}{named}; run the shards again"),
        (emptied, f"{LISTED}{named}"),
        ({"list_sha256": "0" * 64}, "is a shard of other specs" if len(shards) > 1 else f"{LISTED}; run the shards"),
    ):
        path.write_text(json.dumps({**whole, **parts}))
        outcome = run("batch", "--merge", *folders, "--out", "all")
        assert (outcome.exit_code, outcome.stdout, outcome.stderr.count("\n")) == (2, "", 1)
        assert said in outcome.stderr
        assert outcome.stderr.endswith("[OBS911]\n")
        assert not Path("all/summary.json").exists()
    path.write_text(json.dumps(whole))
    assert run("batch", "--merge", *folders, "--out", "all", "-q").exit_code == 2
    assert len(entries("all")) == 3


def test_a_folder_with_the_name_of_a_file_that_is_half_written_is_left_alone():
    put(".obsdesign-staged-4194304-abc.yaml")
    put("in.yaml")
    put("in/.obsdesign-staged-4194304-abc.yaml")
    for _ in range(2):
        assert run("batch", ".", "in/.obsdesign-staged-4194304-abc.yaml", "-q", "--jobs", 1).exit_code == 0
    assert [entry["up_to_date"] for entry in entries().values()] == [True] * 3
    put("results/.obsdesign-staged-4194304-x", "half-written")
    assert run("batch", "in.yaml", "-q", "--jobs", 1).exit_code == 0
    assert not Path("results/.obsdesign-staged-4194304-x").exists()


def test_a_link_in_the_results_leads_to_no_folder_that_is_made():
    put("a/b/c.yaml")
    Path("victim").mkdir()
    Path("results/a").mkdir(parents=True)
    Path("results/a/b").symlink_to(Path("victim").resolve())
    assert run("batch", "a", "-q", "--jobs", 1).exit_code == 2
    assert "a link leads to" in entries()["a/b/c.yaml"]["problems"][0]["message"]
    assert list(Path("victim").iterdir()) == []
