"""`init`: every spec that it writes solves and simulates, and what it has none of is refused."""

import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from support.commands import files, run

import obsdesign
from obsdesign.starters import PLANTS, pairs, text

PAIRS = list(pairs())
LIMIT = 60.0  # seconds that a user who waits for a prompt is given
GIVEN = ("simulation", "horizon")


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(("plant", "family"), PAIRS)
@pytest.mark.usefixtures("sketched")
def test_what_init_writes_solves_verifies_and_simulates(plant, family):
    written = run("init", "mine", "--plant", plant, "--family", family)
    assert (written.exit_code, written.stderr, files()) == (0, "", ["mine.yaml"])
    rows = dict(row.split(maxsplit=1) for row in written.stdout.splitlines())
    assert (rows["file"], rows["next"]) == ("mine.yaml", "obsdesign solve mine.yaml --simulate")
    assert rows["plant"].split()[0] == plant
    assert [*rows] == ["file", "plant", *["family"] * ("family" in rows), "next"]
    first = (plant, family) == next(pair for pair in PAIRS if pair[0] == plant)  # each plant is run once
    solved = run("solve", "mine.yaml", *["--simulate"] * first)
    assert solved.exit_code == 0, solved.output
    assert "VIOLATED" not in solved.stdout
    assert files() == ["mine.gains.json", *["mine.run.csv", "mine.run.png"] * first, "mine.yaml"]
    assert run("verify", "mine.gains.json", "mine.yaml", "-q").exit_code == 0
    spec = yaml.safe_load(Path("mine.yaml").read_text())
    assert spec["observer"]["type"] == family
    assert "#" in Path("mine.yaml").read_text()


def test_every_plant_has_a_spec_and_every_spec_a_plant_and_a_family():
    shipped = {path.name for path in (Path(obsdesign.__file__).parent / "starters").glob("*.yaml")}
    assert {f"{plant}.{family}.yaml" for plant, family in PAIRS} == shipped
    assert {plant for plant, _ in PAIRS} == set(PLANTS)


@pytest.mark.usefixtures("sketched")
def test_a_run_of_a_spec_with_a_guarantee_from_the_initial_error_holds_its_bounds():
    run("init", "--plant", "pendulum")
    solved = run("solve", "pendulum.yaml", "--simulate")
    assert solved.stdout.count("holds: ") >= 3


@pytest.mark.parametrize(
    ("options", "pair", "file"),
    [
        ((), ("pendulum", "l2"), "pendulum.yaml"),
        (("--family", "kkl"), ("converter", "kkl"), "converter.yaml"),
        (("--plant", "tank"), ("tank", "l2"), "tank.yaml"),
        (("mine.yml",), ("pendulum", "l2"), "mine.yml"),
        (("motor",), ("motor", "l2"), "motor.yaml"),
        (("tank.yml", "--family", "linf"), ("tank", "linf"), "tank.yml"),
        (("tank", "--plant", "fan"), ("fan", "l2"), "tank.yaml"),
    ],
)
def test_without_a_terminal_what_is_not_given_is_the_first_that_fits(options, pair, file):
    assert run("init", *options).exit_code == 0
    assert files() == [file]
    assert Path(file).read_text() == text(*pair)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--plant", "tank", "--family", "lipschitz"), "the families of tank: l2, linf, sporadic [OBS913]"),
        (("--plant", "tnak"), "unknown plant tnak; did you mean tank? allowed: pendulum, motor"),
        (("--family", "ekf"), "no spec to begin with is of the family ekf; allowed: l2, linf, sporadic"),
    ],
)
def test_what_there_is_no_spec_of_is_refused_in_one_line(options, said):
    outcome = run("init", *options)
    assert (outcome.exit_code, outcome.stdout, files()) == (2, "", [])
    assert said in outcome.stderr
    assert outcome.stderr.count("\n") == 1


def test_it_says_what_it_wrote_and_which_plants_and_families_there_are():
    assert run("init").stdout == (
        "file    pendulum.yaml\n"
        f"plant   pendulum   --plant has also {', '.join(PLANTS[1:])}\n"
        "family  l2   --family has also linf, sporadic, lipschitz, high-gain\n"
        "next    obsdesign solve pendulum.yaml --simulate\n"
    )


@pytest.mark.parametrize("name", ["below/", "below/."])
def test_in_a_folder_the_file_has_the_name_of_the_plant(name):
    Path("below").mkdir()
    assert run("init", name, "--plant", "fan").stdout.startswith("file    below/")
    assert files("below") == ["fan.yaml"]


def test_a_file_that_is_there_stays_as_it_is():
    Path("pendulum.yaml").write_text("mine")
    outcome = run("init")
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert outcome.stderr == "pendulum.yaml: is there already, and stays as it is; give another NAME [OBS914]\n"
    assert Path("pendulum.yaml").read_text() == "mine"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("a\n::error::b", "a\\n::error::b.yaml: the name holds the character U+000A; give another NAME [OBS902]"),
        ("a\x1b[31m", "a\\x1b[31m.yaml: the name holds the character U+001B; give another NAME [OBS902]"),
        ("a\u202eb", "the name holds the character U+202E"),
        ("\udcff", "\\udcff.yaml: the name holds the character U+DCFF"),
        ("n" * 251, "..: the name has more than 240 bytes; give a shorter NAME [OBS902]"),
        ("\u00fc" * 130, "..: the name has more than 240 bytes"),
        ("n/" * 3000, "cannot be written: "),
        ("absent/a", "absent/a.yaml: cannot be written: there is no folder absent; make it first [OBS902]"),
        ("absent/", "absent/pendulum.yaml: cannot be written: there is no folder absent; make it first [OBS902]"),
    ],
)
def test_a_name_that_no_file_should_have_is_refused_in_one_line(name, said):
    outcome = run("init", name)
    assert (outcome.exit_code, outcome.stdout, files()) == (2, "", [])
    assert said in outcome.stderr
    assert outcome.stderr.count("\n") == 1


def test_a_name_that_a_shell_would_read_otherwise_is_quoted():
    assert run("init", "a; b").stdout.splitlines()[-1] == "next    obsdesign solve 'a; b.yaml' --simulate"
    outcome = run("init", "--", "-x")
    assert (outcome.exit_code, files()) == (2, ["a; b.yaml"])
    assert outcome.stderr == "-x.yaml: a command would take it for an option; give another NAME [OBS902]\n"


def answered(*options, answers):
    """Code of `init` on a terminal whose user types these lines, and what was shown."""
    user, terminal = pty.openpty()
    started = [sys.executable, "-m", "obsdesign", "init", *options]
    environment = {**os.environ, "PYTHONPATH": str(Path(obsdesign.__file__).parent.parent)}
    with subprocess.Popen(started, stdin=terminal, stdout=terminal, stderr=terminal, env=environment) as process:
        os.close(terminal)
        os.write(user, answers.encode())
        shown = b""
        try:
            while part := os.read(user, 1000):
                shown += part
        except OSError:  # the other end is closed
            pass
        code = process.wait(LIMIT)
    os.close(user)
    return code, shown.decode()


def test_on_a_terminal_it_asks_until_the_answer_is_one_of_the_choices():
    code, shown = answered(answers="boat\nconverter\npebo\nmine\n")
    assert (code, files()) == (0, ["mine.yaml"])
    assert "choose one of pendulum, motor" in shown
    assert Path("mine.yaml").read_text() == text("converter", "pebo")


def test_on_a_terminal_it_asks_only_for_what_is_not_given():
    code, shown = answered("mine", "--family", "kkl", answers="")
    assert (code, files()) == (0, ["mine.yaml"])
    assert "plant (" not in shown
    code, shown = answered("other", "--plant", "tank", answers="\n")
    assert (code, files()) == (0, ["mine.yaml", "other.yaml"])
    assert "family (l2, linf, sporadic) [l2]" in shown
