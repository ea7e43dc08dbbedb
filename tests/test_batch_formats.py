"""What other programs read of a batch, and what a hostile spec may not do to them."""

import json
import re
import sqlite3
import xml.etree.ElementTree as ET
from contextlib import closing
from importlib.metadata import distribution
from pathlib import Path

import jsonschema
import pytest
from support.commands import files, run

from obsdesign.batches.find import Task
from obsdesign.batches.formats import FORMATS
from obsdesign.batches.record import entry_of
from obsdesign.batches.summary import Tally, write
from obsdesign.batches.table import shown
from obsdesign.errors import Problem

GOOD = """obsdesign: 1
name: "<script>alert(1)</script> ::error::=1+1"
system: {A: [[-1]], B: [[1]], C: [[1]]}
observer: {type: l2, alpha: 0.1, bounds: {L1: 5}}
"""
BELL = "\x1b[31m\a"
WRONG = 'obsdesign: 1\n"</script>::error::%0A=1+1]]>": 1\nsystem: {A: [[-1]], C: [[1]]}\nobserver: {type: l2}\n'
NAMES = (
    "</script>.yaml".replace("/", "-"),
    "::error::bad.yaml",
    "##[error]bad.yaml",
    "=1+1,x%.yaml",
    f"{BELL}.yaml",
    "\udcff.yaml",
    "new\nline.yaml",
    "a b&\"'<>.yaml",
    "￾.yaml",
)


def schema():
    """The published schema of SARIF 2.1.0, as the package schemastore has it in its store of answers."""
    store = distribution("schemastore").locate_file("schemastore/cache.sqlite")
    with closing(sqlite3.connect(f"file:{store}?mode=ro&immutable=1", uri=True)) as answers:
        contents = [content.decode("latin-1") for (content,) in answers.execute("SELECT value FROM responses")]
    found = next(one for one in contents if "(SARIF) Version 2.1.0 JSON Schema" in one[:1000])
    return json.JSONDecoder().raw_decode(found[found.index('{\r\n  "$schema"') :])[0]


FINE = entry_of(Task("fine.yaml"), "certified", 0, as_expected=True, verified=True)


def made(tmp_path, *entries):
    """Summary of entries."""
    tally = Tally()
    for entry in entries:
        tally.add(Task(entry["path"], tuple(entry["set"])), entry)
    return write(
        tmp_path, tally, {"tool": {}, "options": {}, "list_sha256": "", "time_s": 1.5}, entries, tally.exit_code
    )


@pytest.fixture
def hostile(tmp_path):
    """Summary of one spec of each status, whose texts would harm who reads them as anything else."""
    entries = [FINE, entry_of(Task("left.yaml"), "skipped", None)]
    for i, name in enumerate(NAMES):
        status, code = (("invalid", 2), ("timeout", 4), ("infeasible", 3))[i % 3]
        problem = Problem(f"{name}: a,b%{BELL}\n::error::x", f"deep/{name}", 3, 7, name, id="OBS104")
        entries.append(entry_of(Task(f"deep/{name}"), status, code, problem, Problem("=1+1", id="OBS104")))
    return made(tmp_path, *entries)


def text(form, summary):
    """Summary in a format."""
    return "".join(FORMATS[form](summary))


def test_junit_counts_and_names_every_spec(hostile):
    root = ET.fromstring(text("junit", hostile))
    cases = root.findall("./testsuite/testcase")
    assert (root.tag, len(cases), root.get("tests")) == ("testsuites", len(NAMES) + 2, str(len(NAMES) + 2))
    for suite in (root, root.find("testsuite")):
        assert [suite.get(key) for key in ("failures", "errors", "skipped")] == ["3", "6", "1"]
    assert [child.tag for case in cases for child in case].count("error") == 6
    assert list(cases[0]) == []
    assert cases[2].get("name").startswith("<-script>") or "script" in cases[2].get("name")
    assert cases[2][0].get("type") == "invalid"
    assert cases[2][0].text.endswith("\n=1+1 [OBS104]")


@pytest.mark.usefixtures("here", "at_once")
def test_no_line_of_a_text_in_junit_is_one_that_a_runner_obeys():
    wrong = 'obsdesign: 1\n"##vso[task.complete]": 1\n"##teamcity[x]": 1\n"::error::y": 1\nsystem: {A: [[-1]]}\n'
    for name in ("::error::a.yaml", "##vso[task.complete]b.yaml", "##teamcity[c].yaml", " ::warning::d.yaml"):
        Path(name).write_text(wrong)
    arguments = ("--jobs", 1, "-q", "--format", "junit", "--output-file", "junit.xml")
    assert run("batch", ".", *arguments).exit_code == 2
    root = ET.parse("junit.xml").getroot()
    texts = [case.get(key) for case in root.iter("testcase") for key in ("name", "file")]
    texts += [text for error in root.iter("error") for text in (error.get("message"), *error.text.splitlines())]
    assert len(texts) > 20
    assert not [text for text in texts if re.match(r"\s*::", text) or re.search(r"##\w*\[", text)]
    assert any("vso[task.complete]" in text for text in texts)


def test_annotations_of_github_have_a_place_and_stay_one_line_each(hostile):
    lines = text("github", hostile).splitlines()
    assert len(lines) == 2 * len(NAMES)
    pattern = r"::error file=[^:,]+,line=3,col=7,title=obsdesign (invalid|timeout|infeasible) OBS104::[^\x00-\x1f]+"
    assert all(re.fullmatch(pattern, line) for line in lines[::2])
    assert lines[2].startswith(
        "::error file=deep/%3A%3Aerror%3A%3Abad.yaml,line=3,col=7,title=obsdesign timeout OBS104::"
    )
    assert lines[1] == "::error file=deep/<-script>.yaml,title=obsdesign invalid OBS104::=1+1"
    assert "%25" in lines[0]


def test_sarif_keeps_the_published_schema(hostile, tmp_path):
    validator = jsonschema.Draft7Validator(schema(), format_checker=jsonschema.FormatChecker())
    content = json.loads(text("sarif", hostile))
    validator.validate(content)
    (run_,) = content["runs"]
    assert len(run_["results"]) == 2 * len(NAMES)
    assert {rule["id"] for rule in run_["tool"]["driver"]["rules"]} == {"OBS104"}
    place = run_["results"][2]["locations"][0]["physicalLocation"]
    assert place == {
        "artifactLocation": {"uri": "deep/%3A%3Aerror%3A%3Abad.yaml"},
        "region": {"startLine": 3, "startColumn": 7},
    }
    validator.validate(json.loads(text("sarif", made(tmp_path, FINE))))
    outside = made(
        tmp_path, entry_of(Task("/tmp/a b.yaml"), "invalid", 2, Problem("wrong", "/tmp/a b.yaml", id="OBS104"))
    )
    assert '"file:///tmp/a%20b.yaml"' in text("sarif", outside)
    assert not validator.is_valid({"version": "2.1.0", "runs": [{"tool": {}}]})


def test_json_is_the_summary(hostile):
    assert json.loads(text("json", hostile)) == hostile.report
    assert [entry["path"] for entry in hostile.report["specs"]] == [entry["path"] for entry in hostile.specs]


def test_no_line_obeys_a_name(hostile):
    lines = str(hostile).splitlines()
    assert len(lines) == len(NAMES) + 3
    assert all(line.startswith(("ok  ", "FAIL", "-   ", "specs ")) for line in lines)
    assert not any(re.search(r"[\x00-\x1f]|##\[", line) for line in lines)
    assert shown("a\x1b[0m") == "a\\u001b[0m"


def test_a_number_that_is_proved_is_rounded_to_the_safe_side(tmp_path):
    told = {"lipschitz": 0.7654321, "gamma": 0.123456712, "margin": -2.377854}
    summary = made(tmp_path, entry_of(Task("a.yaml"), "certified", 0, guarantee=told))
    assert str(summary).splitlines()[0].endswith("lipschitz 0.765432, gamma 0.123457, margin -2.37786")


def test_no_format_obeys_a_change(tmp_path):
    change = f"name=</script>]]>&%0A::error::x,{BELL}\n::error::y ##[error]=1+1"
    task = Task("../specs/a.yaml", (change,))
    summary = made(tmp_path, entry_of(task, "uncertified", 4, Problem("no proof", task.path, id="OBS616")))
    (case,) = ET.fromstring(text("junit", summary)).iter("testcase")
    name = shown(f"a.yaml (--set {change})")
    assert (case.get("name"), case.get("classname"), case[0].tag) == (name, "../specs", "failure")
    (line,) = text("github", summary).splitlines()
    said = shown(f"no proof (--set {change})").replace("%", "%25")
    assert line == f"::error file=../specs/a.yaml,title=obsdesign uncertified OBS616::{said}"
    (result,) = json.loads(text("sarif", summary))["runs"][0]["results"]
    assert result["message"]["text"] == shown(f"no proof (--set {change})")
    assert json.loads(text("json", summary))["specs"][0]["set"] == [change]
    for rendered in (*str(summary).splitlines(), line, result["message"]["text"]):
        assert not re.search(r"[\x00-\x1f]|##\[", rendered)
    assert str(summary).startswith(f"FAIL  uncertified  ../specs/a.yaml {shown(change)}")


def test_a_hostile_spec_does_no_harm(here):
    Path("specs/::error::").mkdir(parents=True)
    for name in ("::error::/=1+1.yaml", "<script>.yaml", "..yaml"):
        Path("specs", name).write_text(GOOD)
    for name in (f"{BELL}.yaml", "new\nline.yaml", "\udcff.yaml"):
        Path("specs", name).write_text(GOOD)
    Path("specs/wrong.yaml").write_text(WRONG)
    Path("elsewhere").mkdir()
    Path("results/specs").mkdir(parents=True)
    Path("results/specs/link").symlink_to(here / "elsewhere")
    Path("specs/link.yaml").write_text(GOOD)
    outcome = run("batch", "specs", "--jobs", 2)
    assert outcome.exit_code == 2
    found = {entry["path"]: entry["status"] for entry in json.loads(Path("results/summary.json").read_text())["specs"]}
    assert found == {
        "specs/::error::/=1+1.yaml": "certified",
        "specs/<script>.yaml": "certified",
        "specs/..yaml": "certified",
        f"specs/{BELL}.yaml": "invalid",
        "specs/new\nline.yaml": "invalid",
        "specs/\\udcff.yaml": "invalid",
        "specs/wrong.yaml": "invalid",
        "specs/link.yaml": "invalid",
    }
    assert files("elsewhere") == []
    assert files() == ["elsewhere", "results", "specs"]
    for line in outcome.output.splitlines():
        assert re.match(r"ok  |FAIL|specs |\[|invalid: ", line)
        assert not re.search(r"[\x00-\x1f]", line)
    assert run("verify", "results/specs/::error::/=1+1/=1+1.gains.json").exit_code == 0
    again = run("batch", "specs", "--jobs", 1, "-q")  # only what could not be written is tried once more
    specs = json.loads(Path("results/summary.json").read_text())["specs"]
    assert [entry["path"] for entry in specs if entry["why"]] == ["specs/link.yaml"]
    assert again.exit_code == 2


@pytest.mark.usefixtures("here", "at_once")
def test_formats_are_printed_or_written_and_github_is_told_by_itself(monkeypatch):
    Path("wrong.yaml").write_text(WRONG)
    outcome = run("batch", ".", "--format", "junit", "-q")
    assert outcome.stdout.startswith('<?xml version="1.0"')
    assert ET.fromstring(outcome.stdout).get("errors") == "1"
    outcome = run("batch", ".", "--format", "sarif", "--output-file", "found.sarif")
    assert json.loads(Path("found.sarif").read_text())["version"] == "2.1.0"
    assert outcome.stdout.startswith("FAIL  invalid")
    assert json.loads(run("batch", ".", "--json", "-q").stdout)["exit_code"] == 2
    assert not re.search(r"^\s*::", outcome.output, re.MULTILINE)
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    outcome = run("batch", ".")
    assert "::error file=wrong.yaml,line=2,col=1,title=obsdesign invalid OBS201::" in outcome.stderr
    assert "::error" not in outcome.stdout
    assert run("batch", ".", "--format", "github", "-q").stdout.startswith("::error file=wrong.yaml,line=2")


@pytest.mark.usefixtures("here", "at_once")
def test_a_run_that_cannot_start_and_an_expectation_that_nothing_meets_are_labelled_so():
    spec = "obsdesign: 1\nsystem: {A: -1, B: 1, C: 1}\nobserver: {type: l2, alpha: 0.1, bounds: {L1: 5}}\n"
    Path("run.yaml").write_text(f"{spec}simulation: {{horizon: 1, w: 1/(t - t)}}\n")
    Path("word.yaml").write_text(f"{spec}expect: {{gama: 0.05}}\n")
    outcome = run("batch", ".", "--simulate", "--jobs", 1)
    assert outcome.exit_code == 2
    assert "not as expected: run.yaml:4:" in outcome.stderr
    assert (
        "invalid: word.yaml:4:10: expect.gama: unknown entry of guarantee gama; did you mean gamma?" in outcome.stderr
    )
    assert "certified:" not in outcome.stderr


@pytest.mark.usefixtures("here", "at_once")
def test_an_expectation_that_does_not_hold_is_labelled_so():
    Path("spec.yaml").write_text(
        "obsdesign: 1\nsystem: {A: [[0, 1], [-2, -3]], C: [1, 0]}\n"
        "observer: {type: l2, alpha: 0.3, bounds: {L1: 9}}\nexpect: {observer.type: linf}\n"
    )
    outcome = run("batch", "spec.yaml")
    assert "not as expected: spec.yaml:4:" in outcome.stderr
    assert "certified:" not in outcome.stderr
    assert "title=obsdesign not as expected OBS617" in run("batch", "spec.yaml", "--format", "github", "-q").stdout
    (case,) = ET.fromstring(run("batch", "spec.yaml", "--format", "junit", "-q").stdout).iter("testcase")
    assert case[0].get("type") == "not as expected"
