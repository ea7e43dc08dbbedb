"""The steps of the GitHub action, run in bash as a runner of GitHub does, without a network."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from test_batch import GOOD, HIDDEN, WRONG, put

ROOT = Path(__file__).parent.parent
ACTION = yaml.safe_load((ROOT / ".github/actions/obsdesign/action.yml").read_text())
INSTALL, DESIGN = ACTION["runs"]["steps"]


def step(said, **inputs):
    """Run a step with inputs in place of their defaults; `said`: what it prints, and the variables that it sets."""
    given = {name: str(one.get("default", "")) for name, one in ACTION["inputs"].items()} | inputs
    values = {name: re.sub(r"\$\{\{ inputs\.(\w+) \}\}", lambda m: given[m[1]], v) for name, v in said["env"].items()}
    assert not any("${{" in value for value in values.values())
    Path("output").write_text("")
    programs = f"{Path('bin').absolute()}:{Path(sys.executable).parent}:{os.environ['PATH']}"
    python = {"PYTHONPATH": str(ROOT), "GITHUB_ACTIONS": "true", "GITHUB_OUTPUT": "output", "PATH": programs}
    command = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", said["run"]]
    return subprocess.run(command, env=os.environ | values | python, capture_output=True, text=True, check=False)


@pytest.fixture
def program(here):
    """The program, as an installation has it."""
    put("bin/obsdesign", f'#!/bin/sh\nexec {sys.executable} -m obsdesign "$@"\n')
    Path("bin/obsdesign").chmod(0o755)
    return here


def test_every_step_of_the_action_is_bash_and_takes_its_inputs_by_its_environment():
    assert ACTION["runs"]["using"] == "composite"
    for said in (INSTALL, DESIGN):
        assert said["shell"] == "bash"
        assert "${{" not in said["run"]  # an input there would be run as a program
    used = " ".join(value for said in (INSTALL, DESIGN) for value in said["env"].values())
    assert set(re.findall(r"inputs\.(\w+)", used)) == ACTION["inputs"].keys()
    assert ACTION["outputs"]["summary"]["value"] == f"${{{{ steps.{DESIGN['id']}.outputs.summary }}}}"


@pytest.mark.usefixtures("program")
def test_the_action_designs_a_folder_and_says_at_its_lines_what_is_wrong():
    put("specs/good.yaml")
    put("specs/hidden.yaml", HIDDEN)
    done = step(DESIGN, options="--exclude hidden.yaml --jobs 1")
    assert done.returncode == 0, done.stderr
    assert Path("output").read_text() == "summary=results/summary.json\n"
    assert json.loads(Path("results/summary.json").read_text())["counts"]["total"] == 1
    put("other/wrong.yaml", WRONG)
    done = step(DESIGN, paths="other specs/hidden.yaml", out="out of these", options="-q")
    assert done.returncode == 2
    assert "::error file=other/wrong.yaml,line=3,col=22,title=obsdesign invalid OBS201::" in done.stderr
    assert json.loads(Path("out of these/summary.json").read_text())["counts"]["total"] == 2


@pytest.mark.usefixtures("program")
def test_no_input_of_the_action_is_run_as_a_program():
    put("specs/good.yaml", GOOD)
    hostile = "$(touch harm) `touch harm` ; touch harm"
    assert step(DESIGN, paths=hostile, options=hostile, out="$(touch harm)").returncode == 2
    assert not Path("harm").exists()


def test_the_action_installs_what_it_is_told(here):
    put("bin/python", f'#!/bin/sh\nprintf "%s\\n" "$@" > {here}/told\n')
    Path("bin/python").chmod(0o755)
    told = {**INSTALL, "env": {"INSTALL": "${{ inputs.install }}"}}  # as the expression says where an input is given
    assert INSTALL["env"]["INSTALL"].startswith("${{ inputs.install || ")
    assert step(told, install="obsdesign==0.1 ; touch harm").returncode == 0
    assert Path("told").read_text().splitlines() == ["-m", "pip", "install", "--quiet", "obsdesign==0.1 ; touch harm"]
