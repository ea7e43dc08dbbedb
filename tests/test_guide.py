"""The manual: every spec, command and program on its pages runs, and what they show printed is what is printed."""

import re
import shlex
from pathlib import Path

import pytest
from support.commands import run

from obsdesign.guide import MESSAGES, page, topics

PAGES = [topic for topic in topics() if topic != MESSAGES]  # those of the ids have a test of their own
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"[-+]?\d+(?:,\d{3})*(?:\.\d+)?(?:[eE][-+]?\d+)?")
ROUNDED = 0.02  # relative: a number on a page has four digits or so, and noise differs between processors
LONGEST = 120


def tokens(line):
    """Words and numbers of a line; its columns may be wider."""
    return line.split()


def agree(shown, printed):
    """Whether a line is as the page shows it, which may leave its end out by `..`."""
    if shown.endswith(".."):
        shown = shown[:-2]
        printed = " ".join(printed.split()[: len(shown.split())])
    words = [[NUMBER.sub("#", word) for word in line.split()] for line in (shown, printed)]
    numbers = [[float(text.replace(",", "")) for text in NUMBER.findall(line)] for line in (shown, printed)]
    return words[0] == words[1] and numbers[0] == pytest.approx(numbers[1], rel=ROUNDED, abs=1e-12)


def assert_shown(shown, printed):
    """The lines of a page are those printed, in their order; `..` stands for any number of them."""
    left, gap = printed.splitlines(), False
    for line in shown:
        if line == "..":
            gap = True
            continue
        found = [i for i, other in enumerate(left) if agree(line, other)]
        assert found, f"not printed: {line}\n{printed}"
        assert gap or found[0] == 0, f"something is printed before: {line}\n{printed}"
        left, gap = left[found[0] + 1 :], False
    assert gap or not left or not shown, f"something is printed after: {left}"


def typed(text):
    """Commands of a console, with the lines that it shows after each."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, *shown = part.rstrip("\n").split("\n")
        yield command, [line for line in shown if line.strip()]


def perform(text, code):
    """Type the commands of a console, and hold what is printed against what is shown; return the last exit code."""
    for command, shown in typed(text):
        if command == "echo $?":
            assert [str(code)] == shown
            code = 0
            continue
        assert code == 0, "the page does not say that the command before fails"
        program, *arguments = shlex.split(command, comments=True)
        assert program == "obsdesign"
        outcome = run(*arguments)
        assert outcome.exception is None or isinstance(outcome.exception, SystemExit), outcome.exception
        assert "Traceback" not in outcome.output
        code = outcome.exit_code
        assert_shown(shown, "\n".join(line for line in outcome.output.splitlines() if line.strip()))
    return code


@pytest.mark.parametrize("topic", PAGES)
def test_a_page_runs(topic, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names, code = {}, 0
    for kind, text in BLOCK.findall(page(topic)):
        if kind == "yaml" and (name := re.match(r"# (\S+\.ya?ml)\n", text)):
            Path(name[1]).parent.mkdir(parents=True, exist_ok=True)
            Path(name[1]).write_text(text)
        elif kind == "console":
            code = perform(text, code)
        elif kind == "python":
            exec(compile(text, topic, "exec"), names)
    assert code == 0, "the page does not say that the last command fails"


@pytest.mark.parametrize("topic", PAGES)
def test_a_page_is_short_and_fits_a_terminal(topic):
    lines = page(topic).splitlines()
    assert re.fullmatch(r"# \S.*[^.]", lines[0])
    assert [line for line in lines if len(line) > LONGEST and "|" not in line] == []
    assert len(lines) < 260
    assert all(kind in {"yaml", "console", "python", "sh", "text"} for kind, _ in BLOCK.findall(page(topic)))


@pytest.mark.parametrize("topic", topics())
def test_what_a_page_refers_to_exists(topic):
    for other in re.findall(r"obsdesign explain ([\w.+-]+)", page(topic)):
        assert other in {"nonesuch", "TOPIC"} or run("explain", other).exit_code == 0, other


def test_what_is_shown_is_held_against_what_is_printed():
    printed = "status  certified\ngamma   0.5001   and more\nfile    x"
    assert_shown(["status certified", "gamma 0.5 and ..", "file x"], printed)
    assert_shown(["..", "file x"], printed)
    assert_shown([], printed)
    for wrong in (["status certified"], ["gamma 0.5 and more", ".."], ["..", "gamma 0.6 and more", ".."]):
        with pytest.raises(AssertionError):
            assert_shown(wrong, printed)
