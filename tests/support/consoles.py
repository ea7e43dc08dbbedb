"""Consoles in Markdown: their commands typed, and what is printed held against what they show."""

import re
import shlex

import pytest

from support.commands import run

BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NUMBER = re.compile(r"[-+]?\d+(?:,\d{3})*(?:\.\d+)?(?:[eE][-+]?\d+)?")
ROUNDED = 0.02  # relative: a number on a page has four digits or so, and noise differs between processors


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
