"""What others install and run: the wheel, the archive of the sources, the hooks for pre-commit."""

import json
import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
import yaml
from support.commands import run

ROOT = Path(__file__).parent.parent
HOOKS = {hook["id"]: hook for hook in yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text())}


def command(*arguments, cwd, code=0, **environment):
    """A command that must end with this code; returns what it printed."""
    done = subprocess.run(
        [str(argument) for argument in arguments],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
        env={**os.environ, **environment},
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """A copy of what the project tracks."""
    tree = tmp_path_factory.mktemp("tree")
    tracked = ["git", "ls-files", "-co", "--exclude-standard"]
    names = subprocess.run(tracked, cwd=ROOT, capture_output=True, text=True, check=False)
    if names.returncode:  # no clone: all that is here
        left = shutil.ignore_patterns(".venv", ".*_cache", "__pycache__", "results")
        return Path(shutil.copytree(ROOT, tree, dirs_exist_ok=True, ignore=left))
    for name in filter((lambda one: (ROOT / one).exists()), names.stdout.splitlines()):
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tree / name)
    return tree


@pytest.fixture(scope="module")
def built(tree, tmp_path_factory):
    """Wheel and archive of the sources."""
    pytest.importorskip("hatchling")
    made = tmp_path_factory.mktemp("dist")
    command(sys.executable, "-m", "hatchling", "build", "-d", made, cwd=tree)
    return made


def test_the_wheel_holds_all_that_the_package_reads(built):
    names = set(zipfile.ZipFile(next(built.glob("*.whl"))).namelist())
    ours = {path.relative_to(ROOT).as_posix() for path in (ROOT / "obsdesign").rglob("*") if path.is_file()}
    ours = {name for name in ours if "__pycache__" not in name}
    assert ours <= names
    assert "obsdesign/py.typed" in names


@pytest.mark.slow
def test_the_wheel_works_and_the_archive_passes_its_tests_outside_the_tree(built, tmp_path):
    site, sources = tmp_path / "site", tmp_path / "sources"
    zipfile.ZipFile(next(built.glob("*.whl"))).extractall(site)
    with tarfile.open(next(built.glob("*.tar.gz"))) as archive:
        archive.extractall(sources, **({"filter": "data"} if hasattr(tarfile, "data_filter") else {}))  # as of 3.11.4
    tree = next(sources.iterdir())
    obsdesign, installed = (sys.executable, "-m", "obsdesign"), {"cwd": tmp_path, "PYTHONPATH": str(site)}
    place = command(sys.executable, "-c", "import obsdesign; print(obsdesign.__file__)", **installed)
    assert place.startswith(str(site))
    command(*obsdesign, "solve", tree / "specs" / "pendulum.yaml", "-q", **installed)
    command(*obsdesign, "verify", "pendulum.gains.json", "-q", **installed)
    shutil.rmtree(tree / "obsdesign")
    chosen = ["tests/test_verify.py", "tests/test_sources.py", "tests/test_l2.py"]
    told = command(sys.executable, "-m", "pytest", "-q", *chosen, cwd=tree, PYTHONPATH=str(site), PYTEST_ADDOPTS="")
    assert "passed" in told


# Hooks for pre-commit


def test_the_hooks_say_what_is_wrong_with_specs_and_gains(made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(made / "cart.yaml", tmp_path)
    verify = HOOKS["obsdesign-verify"]["entry"].split()[1:]
    check = HOOKS["obsdesign-check"]["entry"].split()[1:]
    assert run("solve", "cart.yaml", "-q").exit_code == 0
    assert run(*verify, "cart.gains.json").exit_code == 0
    assert run(*check, "cart.yaml").exit_code == 0
    Path("cart.yaml").write_text(Path("cart.yaml").read_text() + "# edited\n")
    outcome = run(*verify, "cart.gains.json")
    assert outcome.exit_code == 2
    assert "belong to another spec" in outcome.stderr
    Path("cart.yaml").write_text("obsdesign: 2\n")
    assert run(*check, "cart.yaml").exit_code == 2


@pytest.mark.parametrize("path", ["/etc/passwd", "../cart.yaml", "missing.yaml", "-", "<python>"])
def test_a_file_that_names_no_spec_below_here_is_refused(made, tmp_path, monkeypatch, path):
    monkeypatch.chdir(tmp_path)
    file = json.loads((made / "cart.gains.json").read_text())
    file["spec"]["path"] = path
    Path("cart.gains.json").write_text(json.dumps(file))
    outcome = run("verify", "--specs", "cart.gains.json")
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert "is no spec below the current folder" in outcome.stderr


@pytest.mark.slow
def test_pre_commit_runs_both_hooks_from_a_clone(tree, made, tmp_path):
    pytest.importorskip("pre_commit")
    home, clone = tmp_path / "home", tmp_path / "clone"
    shutil.copytree(tree, clone)
    (home / "specs").mkdir(parents=True)
    shutil.copy(made / "cart.yaml", home / "specs")
    command(sys.executable, "-m", "obsdesign", "solve", "specs/cart.yaml", "-q", cwd=home, PYTHONPATH=str(ROOT))
    for folder in (clone, home):
        command("git", "init", "-q", cwd=folder)
        command("git", "add", ".", cwd=folder)
        command("git", "-c", "user.name=x", "-c", "user.email=x@y", "commit", "-qm", "x", cwd=folder)
    cache = {"PRE_COMMIT_HOME": str(tmp_path / "cache"), "PYTHONPATH": "", "PIP_NO_COMPILE": "1"}
    told = command(sys.executable, "-m", "pre_commit", "try-repo", clone, "--all-files", cwd=home, **cache)
    assert told.count("Passed") == 2
