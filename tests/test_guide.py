"""The manual: every spec, command and program on its pages runs, and what they show printed is what is printed."""

import re
from pathlib import Path

import pytest
from support.commands import run
from support.consoles import BLOCK, assert_shown, perform

from obsdesign.guide import GLOSSARY, MESSAGES, page, topics

PAGES = [topic for topic in topics() if topic != MESSAGES]  # those of the ids have a test of their own
LONGEST = 120


@pytest.mark.parametrize("topic", PAGES)
@pytest.mark.usefixtures("sketched")
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
    written = re.sub(r"(?ms)^```console$.*?^```$", "", page(topic)).splitlines()  # what is printed is as long as it is
    assert [line for line in written if len(line) > LONGEST and "|" not in line] == []
    assert len(lines) < 260 or topic == GLOSSARY  # which has a test of its own
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
