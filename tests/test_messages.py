"""How problems are told: one line each, with the place on a terminal, and as one JSON document for a program."""

import json
import os
import pty
import re
import subprocess
import sys
import unicodedata
from pathlib import Path

import pytest
from support.commands import run

import obsdesign
from obsdesign.cli.problems import pointed
from obsdesign.errors import NOT_ONE_LINE, Excerpt

pytestmark = pytest.mark.usefixtures("here")

ROOT = str(Path(obsdesign.__file__).parent.parent)
SPEC = "obsdesign: 1\nsystem: {A: [[-1]], C: [[1]]}\nobserver:\n  type: l2\n  aplha: 0.5\n"
KEYS = {"id", "message", "file", "line", "column", "key"}


def on_terminal(*arguments, **variables):
    """What a command says on a terminal of 80 columns, as it is written there."""
    own, its = pty.openpty()
    environment = {k: v for k, v in os.environ.items() if k not in {"NO_COLOR", "TERM"}} | {"PYTHONPATH": ROOT}
    command = [sys.executable, "-m", "obsdesign", *arguments]
    process = subprocess.Popen(
        command, stderr=its, stdout=subprocess.DEVNULL, env=environment | {"COLUMNS": "80", "TERM": "xterm"} | variables
    )
    os.close(its)
    said = b""
    try:
        while part := os.read(own, 4096):
            said += part
    except OSError:  # the other end is closed
        pass
    os.close(own)
    assert process.wait(timeout=60) == 2
    return said.decode().replace("\r\n", "\n")


def test_a_terminal_shows_the_line_with_a_caret_under_the_column():
    Path("spec.yaml").write_text(SPEC)
    said = on_terminal("check", "spec.yaml", NO_COLOR="1")
    assert said.splitlines()[0].startswith("spec.yaml:5:3: observer.aplha: unknown key aplha; did you mean alpha?")
    assert said.splitlines()[1:] == [" 5 |   aplha: 0.5", "   |   ^"]
    assert "\x1b[" in on_terminal("check", "spec.yaml")
    assert "\x1b[" not in on_terminal("check", "spec.yaml", TERM="dumb")
    assert run("check", "spec.yaml").stderr == said.splitlines()[0] + "\n"


def test_a_bracket_that_is_not_closed_is_shown_where_it_opens():
    Path("spec.yaml").write_text("obsdesign: 1\nname: [x\n\n")
    assert on_terminal("check", "spec.yaml", NO_COLOR="1").splitlines()[1:] == [" 2 | name: [x", "   |       ^"]


def test_an_escape_in_a_spec_does_not_reach_the_terminal():
    Path("spec.yaml").write_text('obsdesign: 1\nname: "a\\e[2J"\nexpect: {"\\x9b1m": 1}\n')
    assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f]", on_terminal("check", "spec.yaml", NO_COLOR="1"))


def test_no_more_lines_are_shown_than_help():
    Path("spec.yaml").write_text("obsdesign: 1\n" + "".join(f"wrong{i}: 1\n" for i in range(30)))
    assert on_terminal("check", "spec.yaml", NO_COLOR="1").count("\n   ") <= 10


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        ("a: ", "[1]", " 7 | a: [1]\n   |    ^"),
        ("k: " + "x" * 300, "y" * 300, f" 7 | …{'x' * 16}{'y' * 17}…\n   | {' ' * 17}^"),
        ("", "y" * 300, f" 7 | {'y' * 34}…\n   | ^"),
        ("\x1b\t", "b", " 7 | \\x1b\\tb\n   |       ^"),
        ("名前", "b", " 7 | 名前b\n   |     ^"),
    ],
)
def test_a_line_is_cut_around_the_column_and_escaped(before, after, expected):
    assert re.sub("\x1b\\[[0-9]*m", "", pointed(Excerpt(7, before, after), 40)) == expected


def problems_of(outcome):
    """Problems of a command with --json, and what else it reported; each is a line on standard error too."""
    report = json.loads(outcome.stdout)
    problems = report.pop("problems")
    assert all(set(problem) == KEYS for problem in problems)
    assert [line.rpartition(" [")[2] for line in outcome.stderr.splitlines()] == [f"{p['id']}]" for p in problems]
    return problems, report


@pytest.mark.parametrize("command", ["solve", "check", "simulate", "compare", "lipschitz"])
def test_a_failure_is_one_document_of_problems(command):
    Path("spec.yaml").write_text(SPEC)
    outcome = run(command, "spec.yaml", "--json")
    (problem,), rest = problems_of(outcome)
    assert outcome.exit_code == 2
    assert rest == {}
    assert {**problem, "message": problem["message"][:17]} == {
        "id": "OBS201",
        "message": "unknown key aplha",
        "file": "spec.yaml",
        "line": 5,
        "column": 3,
        "key": "observer.aplha",
    }


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["check", "--nonesuch", "--json"], "obsdesign check: no such option: --nonesuch"),
        (["check", "--json"], "missing argument 'SPEC..'"),
        (["check", "spec.yaml", "--timeout", "soon", "--json"], "invalid value for '--timeout'"),
        (["chekc", "--json"], "obsdesign: there is no command chekc; did you mean obsdesign check? allowed: init, "),
        (["--nonesuch", "--json"], "no such option: --nonesuch"),
    ],
)
def test_a_command_line_that_is_wrong_is_one_problem(arguments, words):
    outcome = run(*arguments)
    (problem,), rest = problems_of(outcome)
    assert (outcome.exit_code, problem["id"], problem["file"], rest) == (2, "OBS901", None, {})
    assert words in problem["message"].replace("root check", "obsdesign check")
    assert run(*(a for a in arguments if a != "--json")).stdout == ""


def test_without_a_command_the_help_is_printed():
    assert "check" in run().output


def test_what_was_found_stands_beside_the_problem(made):
    content = json.loads((made / "cart.gains.json").read_text())
    content["guarantee"]["gamma"] /= 2
    Path("forged.json").write_text(json.dumps(content))
    outcome = run("verify", "forged.json", "--json")
    (problem,), report = problems_of(outcome)
    assert (outcome.exit_code, problem["id"], problem["file"]) == (4, "OBS708", "forged.json")
    assert report["proved"] is False


def test_an_error_after_the_result_leaves_one_document(made, monkeypatch):
    def broken(*_):
        raise obsdesign.UsageError("broken", id="OBS902")

    Path("cart.yaml").write_bytes((made / "cart.yaml").read_bytes())
    monkeypatch.setattr("obsdesign.design.Design.plot_search", broken)
    outcome = run("solve", "cart.yaml", "--plot", "--json")
    assert (outcome.exit_code, outcome.stderr) == (2, "broken [OBS902]\n")
    assert json.loads(outcome.stdout)["status"] == "certified"


def test_a_table_belongs_to_its_problem():
    Path("spec.yaml").write_text(
        "obsdesign: 1\nsystem: {A: [[-1]], B: [[1]], C: [[1]]}\nobserver: {type: l2, alpha: 0.1}\n"
    )
    outcome = run("solve", "spec.yaml", "--json")
    (problem,) = json.loads(outcome.stdout)["problems"]
    first, *rows = problem["message"].splitlines()
    assert (outcome.exit_code, problem["id"], "choose" in first) == (2, "OBS502", True)
    assert all(row.startswith("  |L1| <= ") for row in rows)
    assert outcome.stderr.splitlines()[1:] == rows


def test_findings_have_ids(made):
    Path("cart.yaml").write_bytes((made / "cart.yaml").read_bytes())
    findings = json.loads(run("check", "cart.yaml", "--json").stdout)["findings"]
    assert findings
    assert all(re.fullmatch(r"OBS[0-9]{3}", finding["id"]) for finding in findings)


def test_a_line_does_not_begin_with_what_a_runner_of_ci_obeys():
    Path("::error::bad.yaml").write_text("obsdesign: 1\n")
    outcome = run("check", "::error::bad.yaml")
    assert outcome.exit_code == 2
    assert all(line.startswith("./::error::bad.yaml:") for line in outcome.stderr.splitlines())


@pytest.mark.parametrize(
    "command",
    [
        *(["solve"], ["check"], ["simulate"], ["compare"], ["lipschitz"], ["verify", "gains.json"]),
        *(["check", "--set", "observer.alpha=1"], ["solve", "."]),
    ],
)
def test_a_typing_error_is_told_before_anything_heavy_is_imported(command):
    Path("spec.yaml").write_text("obsdesign: 1\nname: [x\n")
    code = "import sys\nfrom obsdesign.cli import app\ntry:\n    app()\nfinally:\n    print(*sys.modules)"
    process = subprocess.run(
        [sys.executable, "-c", code, *command, *([] if "." in command else ["spec.yaml"])],
        env=os.environ | {"PYTHONPATH": ROOT},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (process.returncode, process.stderr.endswith("[OBS104]\n")) == (2, True)
    loaded = {name.partition(".")[0] for name in process.stdout.split()}
    assert "yaml" in loaded
    assert not loaded & {"numpy", "scipy", "flint", "cvxpy", "clarabel", "matplotlib"}


HOSTILE = """
obsdesign: 1
name: "::error::x ##[error]y ##teamcity[z]"
description: "  ::error::x"
system: {A: [[0, 1], [-2, -1]], B: [[0], [1]], C: [[1, 0]]}
observer: {type: l2, alpha: 0.1, bounds: {L1: 10}}
simulation: {horizon: 1, x0: [1, 0], points: 5}
"""
OBEYED = re.compile(r"^\s*::|##\w*\[", re.MULTILINE)  # by a runner of GitHub, of Azure or of TeamCity


@pytest.mark.usefixtures("sketched", "at_once")
def test_no_line_of_any_command_is_one_that_a_runner_obeys():
    names = ("::error::a", "  ::set-env name=b::c", "##[error]d", "##vso[task.setvariable]e")
    for name in names:
        Path(f"{name}.yaml").write_text(HOSTILE)
    specs, gains = [f"{name}.yaml" for name in names], [f"{name}.gains.json" for name in names]
    assert run("solve", *specs, "--simulate").exit_code == 0
    for arguments in (
        ("compare", *specs[:2], *gains),
        ("verify", *gains),
        ("diff", *gains[:2]),
        ("report", gains[0]),
        ("report", "."),
        ("check", *specs),
        ("check", *specs, "--json"),
        ("solve", specs[0], "-o", "-"),
        ("lipschitz", *specs),
        ("batch", "."),
        ("batch", ".", "--format", "junit"),
        ("batch", ".", "--json"),
        *(("explain", name) for name in names),
        *((name,) for name in names),
        *(("check", f"absent{name}") for name in names),
        *(("check", name) for name in names),
    ):
        outcome = run(*arguments)
        assert outcome.exit_code in {0, 2}
        assert outcome.output
        assert not OBEYED.search(outcome.output), arguments
    rows = run("compare", *specs[:2]).stdout.splitlines()
    assert any(re.match(r"\\u003a:error::a\.yaml +l2 ", row) for row in rows)


def test_what_is_escaped_for_a_runner_is_the_same_text_in_json():
    Path("a.yaml").write_text(HOSTILE)
    assert run("solve", "a.yaml").exit_code == 0
    printed = run("solve", "a.yaml", "-o", "-").stdout
    assert json.loads(printed)["spec"] == json.loads(Path("a.gains.json").read_text())["spec"]
    assert not OBEYED.search(printed)


def test_no_character_of_format_is_taken_for_a_line(tmp_path):
    kinds = {"Cc", "Cf", "Cs", "Zl", "Zp"}
    every = map(chr, range(sys.maxunicode + 1))
    assert [c for c in every if unicodedata.category(c) in kinds and not NOT_ONE_LINE.search(c)] == []
    assert not NOT_ONE_LINE.search("a b\u00a0é Ż 日本 α̂ 😀")
    spec = tmp_path / "a\u200bb.yaml"
    spec.write_text("obsdesign: 1\nsystem: {A: -1, C: 1}\nobserver: {type: l2, alpha: 0.1}\n")
    for command in ("solve", "check", "batch"):
        outcome = run(command, spec)
        assert outcome.exit_code == 2
        assert "the name of the file holds the character U+200B; rename it [OBS102]" in outcome.output
