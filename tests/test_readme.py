"""README: its commands, its example and its figures are what the tool does today."""

import re
import shlex
import shutil
from pathlib import Path

import pytest
from matplotlib.image import imread
from support.commands import files, run
from support.consoles import BLOCK, perform

from obsdesign.cli import app
from obsdesign.guide import topics

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()
BLOCKS = BLOCK.findall(README)
FIGURES = re.findall(r"!\[.*?\]\(\.github/figures/(\S+?)\)", README)
ALIKE = 0.03  # mean difference of brightness, in [0, 1]: fonts differ a little
LARGEST = 400_000  # bytes


@pytest.fixture
def _specs(tmp_path, monkeypatch):
    """A folder with the specs in it, as a clone has them."""
    shutil.copytree(ROOT / "specs", tmp_path / "specs")
    monkeypatch.chdir(tmp_path)


def consoles():
    return [text for kind, text in BLOCKS if kind == "console"]


@pytest.mark.usefixtures("_specs")
def test_the_example_is_a_shipped_spec_and_prints_what_is_shown():
    ((_, spec),) = [block for block in BLOCKS if block[0] == "yaml"]
    name, _, text = spec.removeprefix("# ").partition("\n")
    assert Path(name).read_text() == text
    assert perform(consoles()[0], 0) == 0


@pytest.mark.slow
@pytest.mark.usefixtures("_specs")
def test_one_command_makes_all_figures_as_they_are_shown():
    assert perform(consoles()[1], 0) == 0
    assert set(FIGURES) == {name for name in files() if name.endswith(".png")}
    for name in FIGURES:
        shown, made = imread(ROOT / ".github" / "figures" / name), imread(name)
        assert shown.shape == made.shape
        assert abs(shown - made).mean() < ALIKE, f"{name} has changed: run the command in .github/figures"


def test_figures_are_small_and_there():
    assert len(FIGURES) == len(set(FIGURES)) == 5
    folder = ROOT / ".github" / "figures"
    assert set(FIGURES) == set(files(folder))
    assert all((folder / name).stat().st_size < LARGEST for name in FIGURES)


def test_the_commands_install_for_users_and_then_for_tests():
    first, second = [text for kind, text in BLOCKS if kind == "sh"]
    assert "pip install --quiet . " in first
    assert "'.[dev]'" in second
    for spec in re.findall(r"specs/\S+\.yaml", README):
        assert (ROOT / spec).exists()
    assert run(*shlex.split("solve --help")).exit_code == 0


def test_every_page_of_the_manual_is_linked_and_every_link_leads_somewhere():
    links = re.findall(r"\]\((\S+?\.md)\)", README)
    assert all((ROOT / link).exists() for link in links)
    assert sorted(Path(link).stem for link in links) == sorted(topics())


def test_every_command_is_named():
    commands = {command.callback.__name__ for command in app.registered_commands}
    told = re.search(r"lists the options of (.*?);", README, re.DOTALL)[1]
    assert set(re.findall("`(.*?)`", told)) == commands


def test_readme_is_short():
    assert len(README.splitlines()) < 130
