"""Completion in shells, by typer's own means."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import obsdesign

SHELLS = {  # what the script of a shell asks the program, and what it answers for "solve"
    "bash": {"COMP_WORDS": "obsdesign sol", "COMP_CWORD": "1"},
    "zsh": {"_TYPER_COMPLETE_ARGS": "obsdesign sol"},
    "fish": {"_TYPER_COMPLETE_ARGS": "obsdesign sol", "_TYPER_COMPLETE_FISH_ACTION": "get-args"},
}


@pytest.fixture
def program(tmp_path):
    """The program under its name, for a user with an empty home."""
    path = tmp_path / "obsdesign"
    path.write_text("from obsdesign.__main__ import main\nmain()\n")

    def called(*arguments, **environment):
        own = {
            **os.environ,
            "PYTHONPATH": str(Path(obsdesign.__file__).parent.parent),
            "HOME": str(tmp_path),
            "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1",
        }
        command = [sys.executable, str(path), *arguments]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env={**own, **environment})
        assert "Traceback" not in done.stderr
        return done.stdout

    return called


@pytest.mark.parametrize("shell", SHELLS)
def test_the_script_of_a_shell_is_shown(shell, program):
    script = program("--show-completion", shell)
    assert "_OBSDESIGN_COMPLETE=complete_" in script
    assert "obsdesign" in script


@pytest.mark.parametrize("shell", SHELLS)
def test_a_shell_is_told_how_a_command_goes_on(shell, program):
    told = program(_OBSDESIGN_COMPLETE=f"complete_{shell}", **SHELLS[shell])
    assert "solve" in told
    assert "verify" not in told


def test_options_are_completed(program):
    words = {"COMP_WORDS": "obsdesign solve --sim", "COMP_CWORD": "2"}
    assert program(_OBSDESIGN_COMPLETE="complete_bash", **words).split() == ["--simulate"]


@pytest.mark.parametrize("shell", SHELLS)
def test_completion_is_installed_for_a_user(shell, program, tmp_path):
    assert f"{shell} completion installed" in program("--install-completion", shell)
    written = [path for path in tmp_path.rglob("*") if path.is_file() and path.name != "obsdesign"]
    assert any("complete_" in path.read_text() for path in written)


def test_bash_takes_the_script(program):
    script = program("--show-completion", "bash")
    asked = ["bash", "--norc", "-c", f"{script}\ncomplete -p obsdesign"]
    done = subprocess.run(asked, capture_output=True, text=True, check=False)
    assert (done.returncode, "-F _obsdesign_completion obsdesign" in done.stdout) == (0, True), done.stderr
