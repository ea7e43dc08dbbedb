"""The pages of messages: every id has one, and the example on it gives it."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from support.commands import run

import obsdesign
from obsdesign.guide import explained, sections, topics

PACKAGE = Path(obsdesign.__file__).parent
PAGES = sections()
UNSEEN = {
    "OBS713",
    "OBS807",
    "OBS808",
    "OBS812",
    "OBS815",
    "OBS909",
    "OBS915",
    "OBS922",
}  # defects; machine, or Python, only
FILE = re.compile(r"```yaml\n# (\S+)\n(.*?)```", re.DOTALL)
COMMANDS = re.compile(r"```console\n(.*?)```", re.DOTALL)


def raised():
    """Ids that the package gives to its messages."""
    texts = (path.read_text() for path in PACKAGE.rglob("*.py"))
    return {id for text in texts for id in re.findall(r'"(OBS[0-9]{3})"', text)}


def performed(line, shell):
    """What a line of a console prints; what goes through a shell calls obsdesign there."""
    if line.startswith("obsdesign ") and not shell:
        return run(*shlex.split(line)[1:]).output
    script = f'obsdesign() {{ "{sys.executable}" -m obsdesign "$@"; }}\n{line}'
    environment = {"PYTHONPATH": str(PACKAGE.parent), "PATH": "/usr/bin:/bin"}
    done = subprocess.run(
        ["bash", "-c", script], capture_output=True, text=True, check=False, env=environment, timeout=60
    )
    return done.stdout + done.stderr


def test_every_id_has_a_page_and_every_page_an_id():
    assert set(PAGES) == raised()
    assert list(PAGES) == sorted(PAGES)


@pytest.mark.parametrize("id", PAGES)
def test_a_page_tells_cause_example_and_cure(id):
    page = PAGES[id]
    title, cause, *_, cure = page.strip().split("\n\n")
    assert re.fullmatch(rf"## {id} \S.*[^.]", title)
    assert re.fullmatch(r"[A-Z`].*\.", cause, re.DOTALL)
    assert re.fullmatch(r"Cure: \S.*\.", cure, re.DOTALL)
    assert bool(COMMANDS.search(page)) != (id in UNSEEN)


@pytest.mark.parametrize("id", [id for id in PAGES if id not in UNSEEN])
def test_an_example_gives_its_id(id, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in FILE.findall(PAGES[id]):
        Path(name).write_text(text)
    lines = [line.removeprefix("$ ") for line in COMMANDS.search(PAGES[id])[1].splitlines()]
    printed = [performed(line, re.search(r"[|>]", line)) for line in lines]
    assert id in printed[-1], printed
    assert "Traceback" not in "".join(printed)


def test_explain_prints_the_page_of_an_id():
    for id in ("OBS104", "obs104"):
        outcome = run("explain", id)
        assert (outcome.exit_code, outcome.stdout) == (0, PAGES["OBS104"].rstrip() + "\n")
    assert outcome.stdout.startswith("## OBS104 ")


def test_explain_lists_topics_and_prints_them():
    listed = run("explain").stdout
    assert topics()
    for name, title in topics().items():
        assert re.search(rf"^{re.escape(name)} +{re.escape(title)}$", listed, re.MULTILINE)
        assert run("explain", name).stdout.startswith(f"# {title}\n")


@pytest.mark.parametrize("topic", ["OBS999", "nonesuch", "../errors", "messages.md"])
def test_what_has_no_page_is_said(topic):
    outcome = run("explain", topic)
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert re.match(f"{topic}: there is no page of it; .*allowed: .*messages.*, .* \\[OBS907\\]\n", outcome.stderr)
    assert explained(topic) is None
