"""Paths that lead elsewhere than they seem, are too long, or may not be read: each is told, by whichever command."""

import json
import os
from pathlib import Path
from tempfile import TemporaryDirectory

import clarabel
import pytest
from support.commands import run
from test_batch import GOOD, entries, put

import obsdesign as od

LONG = f"{'x' * 300}.yaml"
NEEDED = [Path(package.__file__).parent for package in (od, clarabel)]
DENIED = "cannot be read: Permission denied [OBS101]\n"


@pytest.fixture
def user(monkeypatch, at_once):  # noqa: ARG001
    """A user who may not read everything, in a folder of specs one of which is kept from that user."""
    before = os.geteuid()
    with TemporaryDirectory() as folder:  # within folders that every user may search, as those of pytest are not
        monkeypatch.chdir(folder)
        for path in ("specs/a.yaml", "specs/private/b.yaml", "specs/private.yaml"):
            put(path)
        for path in (".", "specs"):
            Path(path).chmod(0o777)
        yield
        os.seteuid(before)
        Path("specs/private").chmod(0o755)
        monkeypatch.undo()


def kept_from(path, mode=0):
    """Let this process be an ordinary user, who may not use a folder."""
    Path(path).chmod(mode)
    if os.geteuid() == 0:
        os.seteuid(65534)
        if not all(os.access(folder, os.R_OK | os.X_OK, effective_ids=True) for folder in NEEDED):
            os.seteuid(0)
            pytest.skip("the package, or what it needs, lies in a folder that another user may not read")


@pytest.mark.usefixtures("here", "at_once")
def test_a_folder_above_a_link_is_that_of_what_it_leads_to():
    put("x.yaml", GOOD.replace("Good", "Here"))
    put("far/x.yaml", GOOD.replace("Good", "Far"))
    put("far/deep/y.yaml")
    Path("link").symlink_to("far/deep")
    assert run("batch", "link/../x.yaml", "-q", "--jobs", 1).exit_code == 0
    assert list(entries()) == ["far/x.yaml"]
    assert json.loads(Path("results/far/x/x.gains.json").read_text())["name"] == "Far"
    assert run("batch", "link/../*.yaml", "link/..", "./x.yaml", "-q", "--jobs", 1).exit_code == 0
    assert list(entries()) == ["far/deep/y.yaml", "far/x.yaml", "x.yaml"]


@pytest.mark.parametrize("path", ["specs", "specs/private", "specs/**/*.yaml", "specs/*/b.yaml"])
@pytest.mark.usefixtures("user")
def test_a_folder_that_cannot_be_read_is_a_finding_of_a_batch(path):
    kept_from("specs/private")
    outcome = run("batch", path, "--jobs", 1, "--format", "junit", "--output-file", "junit.xml")
    assert outcome.exit_code == 2
    found = entries()
    assert found.pop("specs/private")["status"] == "invalid"
    assert {entry["status"] for entry in found.values()} <= {"certified"}  # and the spec of this name is no clash
    said = "specs/private: this folder, or what is in it, cannot be read"
    assert said in outcome.stderr
    assert said in Path("junit.xml").read_text()
    assert run("batch", "specs", "--exclude", "specs/private", "-q", "--jobs", 1).exit_code == 0
    os.seteuid(os.getuid())
    Path("specs/private").chmod(0o755)
    assert run("batch", path, "-q", "--jobs", 1).exit_code == 0
    assert {entry["status"] for entry in entries().values()} == {"certified"}


@pytest.mark.parametrize("command", ["check", "solve", "verify", "report"])
@pytest.mark.usefixtures("user")
def test_a_folder_that_cannot_be_read_is_told_by_each_command_on_folders(command):
    assert run("solve", "specs/a.yaml", "-q", "-o", "specs/a.gains.json").exit_code == 0
    Path("specs/private.yaml").unlink()
    run(command, "specs/a.gains.json")  # what is imported may be out of reach of other users
    kept_from("specs/private")
    outcome = run(command, "specs")
    assert (outcome.exit_code, outcome.stderr) == (2, f"specs/private: {DENIED}")


@pytest.mark.parametrize("mode", [0o000, 0o444], ids=["closed", "listed"])
@pytest.mark.parametrize(
    "command",
    [
        ["check", "specs/private/b.yaml"],
        ["solve", "specs/private/b.yaml"],
        ["batch", "specs/private/b.yaml", "--jobs", "1"],
        ["batch", "specs/a.yaml", "--jobs", "1", "--changed-since", "specs/private/b.yaml"],
        ["batch", "--merge", "specs/private/b.yaml"],
        ["verify", "specs/private/b.yaml"],
        ["report", "specs/private/b.yaml"],
        ["compare", "specs/private/b.yaml"],
        ["diff", "specs/private/b.yaml", "specs/private/b.yaml"],
        ["simulate", "specs/a.yaml", "--gains", "specs/private/b.yaml"],
    ],
    ids=lambda words: " ".join(words[:2]),
)
@pytest.mark.usefixtures("user")
def test_a_file_in_a_folder_that_may_not_be_searched_is_one_line(command, mode):
    kept_from("specs/private", mode)
    outcome = run(*command)
    assert (outcome.exit_code, outcome.stderr) == (2, f"specs/private/b.yaml: {DENIED}")


@pytest.mark.usefixtures("user")
def test_specs_of_a_folder_that_may_be_listed_but_not_searched_are_told():
    kept_from("specs/private", 0o444)
    outcome = run("batch", "specs", "-q", "--jobs", 1)
    assert (outcome.exit_code, outcome.stderr) == (2, f"invalid: specs/private/b.yaml: {DENIED}")


@pytest.mark.usefixtures("here", "at_once")
def test_a_spec_of_which_nothing_is_left_is_counted_as_invalid_below_a_folder():
    put("specs/a.yaml")
    Path("specs/gone.yaml").symlink_to("nobody")
    Path("specs/.#a.yaml").symlink_to("user@host.1234")  # the lock of an editor
    Path("specs/empty.yaml").write_text("\n")
    Path("specs/binary.yaml").write_bytes(b"PK\3\4\0\0")
    Path("specs/wide.yaml").write_bytes("obsdesign: 1\n".encode("utf-16"))
    put("specs/CAPITAL.YAML")
    put("specs/foreign.yaml", "name: naïve\n")
    outcome = run("batch", "specs", "-q", "--jobs", 1)
    assert outcome.exit_code == 2
    lost = ["specs/binary.yaml", "specs/empty.yaml", "specs/gone.yaml", "specs/wide.yaml"]
    assert [line.split(":")[1].strip() for line in outcome.stderr.splitlines()] == lost
    assert {path: entry["status"] for path, entry in entries().items()} == {
        **dict.fromkeys(lost, "invalid"),
        "specs/CAPITAL.YAML": "certified",
        "specs/a.yaml": "certified",
    }


@pytest.mark.usefixtures("here", "at_once")
def test_what_is_no_file_is_told_where_it_is_given():
    outcome = run("batch", "nobody.yaml", "-q", "--jobs", 1)
    assert (outcome.exit_code, "there is no such file or folder" in outcome.stderr) == (2, True)
    Path("lock.yaml").symlink_to("nobody")
    outcome = run("batch", "lock.yaml", "-q", "--jobs", 1)
    said = "invalid: lock.yaml: cannot be read: No such file or directory [OBS101]\n"
    assert (outcome.exit_code, outcome.stderr) == (2, said)
    os.mkfifo("pipe")
    outcome = run("batch", "pipe")
    assert (outcome.exit_code, "pipe: is no file and no folder" in outcome.stderr) == (2, True)


@pytest.mark.parametrize(
    "command",
    [
        ["check", LONG],
        ["solve", LONG],
        ["lipschitz", LONG],
        ["compare", LONG],
        ["verify", LONG],
        ["report", LONG],
        ["diff", LONG, LONG],
        ["batch", LONG],
        ["batch", "--merge", LONG],
        ["batch", "a.yaml", "--changed-since", LONG],
        ["batch", "a.yaml", "--out", LONG],
        ["batch", "a.yaml", "--format", "junit", "--output-file", LONG],
        ["simulate", "a.yaml", "--gains", LONG],
        ["simulate", "a.yaml", "-o", LONG.replace("yaml", "csv")],
        ["solve", "a.yaml", "-o", LONG.replace("yaml", "json")],
    ],
    ids=lambda words: " ".join(words[:-1]),
)
@pytest.mark.usefixtures("here", "at_once")
def test_a_path_that_is_too_long_is_one_line(command):
    put("a.yaml")
    outcome = run(*command)
    assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
    assert outcome.stderr.startswith(f"{command[-1]}: cannot be ")
    assert "File name too long" in outcome.stderr


@pytest.mark.usefixtures("user")
def test_results_may_be_below_a_folder_that_may_be_searched_but_not_listed():
    Path("specs/private.yaml").unlink()
    Path("specs/private").chmod(0o777)
    kept_from("specs/private", 0o333)
    assert run("batch", "specs/a.yaml", "-q", "--jobs", 1, "--out", "specs/private/out").exit_code == 0
    outcome = run("batch", "specs/a.yaml", "-q", "--jobs", 1, "--out", "specs/private")
    said = "specs/private: cannot be made or written: Permission denied [OBS902]\n"
    assert (outcome.exit_code, outcome.stderr) == (2, said)


@pytest.mark.usefixtures("here")
def test_a_path_that_no_system_has_is_one_line():
    with pytest.raises(od.UsageError, match=r"cannot be read: .*null"):
        od.batch(["a\0b"])
