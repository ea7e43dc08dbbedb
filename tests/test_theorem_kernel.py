"""What `verify --compile` makes of what coqc says: accepted on which axioms, refused, not installed; its record."""

import json
import os
import re
import stat
import subprocess
import sys

import pytest
from support.commands import run
from support.coq import CACHE, needs_coq

import obsdesign as od
from obsdesign.coq.kernel import AXIOMS, assumed, judged, refused
from obsdesign.coq.library import command as command_of

SPEC = """
obsdesign: 1
name: Tank
system: {A: [[-1]], B: [[1]], C: [[1]]}
observer: {type: l2, alpha: 0.1, bounds: {L1: 10}}
"""
COQC = """#!/bin/sh
if [ "$2" = --print-version ]; then echo 8.16.1 4.13.1; exit; fi
for last; do :; done
echo "$last" >> "{log}"
touch "${{last%.v}}.vo"
if [ "$last" = Theorem.v ]; then {theorem}; fi
"""
HEAD = "printf 'Axioms:\\nClassical_Prop.classic : P\\n'"  # of the bound of the gain
ACCEPTS = f"{HEAD}; printf 'Axioms:\\nClassicalDedekindReals.sig_forall_dec\\n  : forall P, P\\n'"
CHEATS = f"{HEAD}; printf 'Axioms:\\nTheorem.cheat : 0 = 1\\nClassical_Prop.classic : forall P : Prop, P\\n'"
RECORD = {"name": "for_the_class", "sha256": "0" * 64, "coq": "8.16.1", "accepted": "2026-01-01T00:00:00Z"}
REFUSES = "printf 'File \"./Theorem.v\", line 1000, characters 0-5:\\nError: no.\\n' >&2; exit 1"


@pytest.fixture
def coqc(tmp_path, monkeypatch):
    """A coqc that says what it is told to, and a list of what it compiled."""

    def made(theorem):
        program = tmp_path / "bin" / "coqc"
        program.parent.mkdir(exist_ok=True)
        program.write_text(COQC.format(log=tmp_path / "log", theorem=theorem))
        program.chmod(program.stat().st_mode | stat.S_IXUSR)
        return lambda: (tmp_path / "log").read_text().split()

    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:/usr/bin:/bin")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return made


@pytest.fixture
def gains(here):
    """A result, here."""
    od.solve(od.load(SPEC)).save(here / "tank.gains.json")
    return here / "tank.gains.json"


def test_an_accepted_theorem_is_told_and_recorded_in_the_result(gains, coqc):
    compiled = coqc(ACCEPTS)
    before = json.loads(gains.read_text())
    for _ in range(2):
        outcome = run("verify", gains, "--theorem", "coq", "--compile", "--json")
        assert outcome.exit_code == 0, outcome.stderr
    told, after = json.loads(outcome.stdout)["theorem"], json.loads(gains.read_text())
    assert told["accepted"] is True
    assert told["time_s"] > 0
    record = after.pop("theorem")
    assert after == before
    assert (record["name"], record["sha256"], record["coq"]) == ("for_this_f", told["sha256"], "8.16.1")
    assert compiled().count("ObsForm.v") == 1
    assert compiled().count("Theorem.v") == 2
    assert run("verify", gains).exit_code == 0
    assert "accepted by its kernel" in run("verify", gains, "--theorem", "coq", "--compile").stdout
    report = gains.parent / "report.html"
    assert run("report", gains, "-o", report).exit_code == 0
    assert f"for_this_f accepted by Coq 8.16.1 on {record['accepted'][:10]}" in report.read_text()
    coqc(REFUSES)
    assert run("verify", gains, "--theorem", "coq", "--compile").exit_code == 4
    assert json.loads(gains.read_text()) == before


@pytest.mark.parametrize(("says", "name"), [(REFUSES, "for_this_f"), (CHEATS, "Theorem.cheat")])
def test_what_is_refused_or_rests_on_another_axiom_is_exit_4_and_not_recorded(says, name, gains, coqc):
    coqc(says)
    before = gains.read_text()
    outcome = run("verify", gains, "--theorem", "coq", "--compile", "--json")
    assert outcome.exit_code == 4
    assert f"coqc 8.16.1 refuses {name}: " in outcome.stderr
    assert len(outcome.stderr.splitlines()) == 1
    assert json.loads(outcome.stdout)["theorem"]["accepted"] is False
    assert gains.read_text() == before


def test_a_library_that_does_not_compile_is_told_and_not_kept(gains, coqc, tmp_path):
    coqc("true")
    (tmp_path / "bin" / "coqc").write_text(
        "#!/bin/sh\n[ $2 = --print-version ] && echo 7 3 || { echo Error >&2; exit 1; }"
    )
    outcome = run("verify", gains, "--theorem", "coq", "--compile")
    assert outcome.exit_code == 2
    assert "coqc 7 does not take the library" in outcome.stderr
    assert os.listdir(tmp_path / "cache" / "obsdesign") == []


def test_a_result_that_changes_meanwhile_is_not_overwritten(gains, coqc):
    coqc(f"echo >> '{gains}'; {ACCEPTS}")
    before = gains.read_text()
    outcome = run("verify", gains, "--theorem", "coq", "--compile")
    assert outcome.exit_code == 0
    assert "not recorded: the result was changed meanwhile" in outcome.stdout
    assert gains.read_text() == before + "\n"


def test_a_result_on_standard_input_is_compiled_and_has_no_record(gains, coqc):
    coqc(ACCEPTS)
    command = [sys.executable, "-m", "obsdesign", "verify", "-", "--theorem", "coq", "--compile", "-o", "a.v"]
    done = subprocess.run(command, input=gains.read_text(), capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    assert "accepted by its kernel" in done.stdout
    assert "recorded" not in done.stdout


def test_a_record_leaves_the_rights_of_the_file_as_they_were_and_one_of_another_text_is_told(gains, coqc):
    coqc(ACCEPTS)
    gains.chmod(0o600)
    assert run("verify", gains, "--theorem", "coq", "--compile").exit_code == 0
    assert stat.S_IMODE(gains.stat().st_mode) == 0o600
    assert "record of another" not in run("verify", gains, "--theorem", "coq").stdout
    content = json.loads(gains.read_text())
    content["theorem"]["sha256"] = "0" * 64
    gains.write_text(json.dumps(content))
    assert "the result holds a record of another text" in run("verify", gains, "--theorem", "coq").stdout


def test_a_coqc_that_is_killed_is_told(coqc):
    coqc("kill -9 $$")
    with pytest.raises(od.UndecidedError, match="signal 9 ended it"):
        judged("")


def test_a_folder_of_the_environment_that_is_relative_is_no_cache(gains, coqc, monkeypatch, tmp_path):
    coqc(ACCEPTS)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert run("verify", gains, "--theorem", "coq", "--compile").exit_code == 0
    assert (tmp_path / "home" / ".cache" / "obsdesign").is_dir()
    assert not (gains.parent / "relative").exists()


def test_a_coqc_that_says_nothing_is_told(gains, coqc, tmp_path):
    coqc("true")
    (tmp_path / "bin" / "coqc").write_text("#!/bin/sh\nexit 0")
    outcome = run("verify", gains, "--theorem", "coq", "--compile")
    assert outcome.exit_code == 2
    assert "coqc does not tell its version" in outcome.stderr


STALE = "printf 'Error: Compiled library Obs.ObsForm makes inconsistent assumptions over library C\n' >&2"


def test_a_library_that_was_altered_or_is_stale_is_compiled_anew_and_after_a_mere_refusal_it_is_not(
    gains, coqc, tmp_path
):
    def verified():
        return run("verify", gains, "--theorem", "coq", "--compile").exit_code

    compiled = coqc(ACCEPTS)
    assert (verified(), compiled().count("ObsForm.v")) == (0, 1)
    coqc(REFUSES)
    assert (verified(), compiled().count("ObsForm.v")) == (4, 1)
    coqc(f"[ -e '{tmp_path}/stale' ] && rm '{tmp_path}/stale' && {STALE} && exit 1; {ACCEPTS}")
    (tmp_path / "stale").touch()
    assert (verified(), compiled().count("ObsForm.v")) == (0, 2)
    next((tmp_path / "cache").rglob("ObsForm.vo")).write_text("altered")
    assert (verified(), compiled().count("ObsForm.v")) == (0, 3)


def test_without_coqc_nothing_is_compiled(gains, monkeypatch):
    monkeypatch.setenv("PATH", "")
    outcome = run("verify", gains, "--theorem", "coq", "--compile")
    assert outcome.exit_code == 2
    assert "coqc is not installed" in outcome.stderr
    assert run("verify", gains, "--compile").exit_code == 2


def test_a_lack_of_memory_is_told(coqc):
    coqc("echo 'Out of memory.' >&2; exit 2")
    with pytest.raises(od.UndecidedError, match="it lacked memory; it may take 12 GiB"):
        judged("")


@pytest.mark.parametrize(
    "record",
    [
        "yes",
        {},
        {key: text for key, text in RECORD.items() if key != "coq"},
        {**RECORD, "sha256": "0" * 63},
        {**RECORD, "name": "for_all"},
        {**RECORD, "by": "me"},
        {**RECORD, "coq": ["8"]},
    ],
)
def test_a_record_of_another_form_is_refused(record, gains):
    content = json.loads(gains.read_text())
    gains.write_text(json.dumps({**content, "theorem": record}))
    outcome = run("verify", gains)
    assert outcome.exit_code == 2
    assert "theorem: " in outcome.stderr


def test_the_statement_in_which_an_error_is_has_a_name():
    text = "Definition a := 1.\n\nLemma b : a = 1.\nProof. no. Qed.\nTheorem c : b.\n"
    warning = 'File "./Theorem.v", line 1, characters 0-3:\nWarning: old.\n'
    assert refused(text, f'{warning}File "./Theorem.v", line 4, characters 0-3:\nError: no') == "b"
    assert refused(text, 'File "./Theorem.v", line 5, characters 0-3:\nError:\nno') == "c"
    assert refused(text, "killed") == "the file"


CLASSIC = "Classical_Prop.classic"


@pytest.mark.parametrize(
    ("printed", "count", "axioms", "other"),
    [
        (f"Axioms:\n{CLASSIC} : forall P : Prop,\n  P\n", 1, {CLASSIC}, ""),
        (f"Axioms:\n{CLASSIC}\n  : Prop\nClosed under the global context\n", 2, {CLASSIC}, ""),
        ("Closed under the global context\n", 1, set(), ""),
        (f"Axioms:\n{CLASSIC} : P\nbad' : False\n", 1, {CLASSIC, "bad'"}, "bad'"),
        ("Axioms:\nbad is assumed to be guarded.\n", 1, {"bad is assumed to be guarded."}, "bad is assumed"),
        ("", 1, set(), "what is printed of 1 statements"),
        ("Closed under the global context\n", 2, set(), "what is printed of 2 statements"),
        ("", 0, set(), "what is printed of 0 statements"),
    ],
)
def test_only_what_rests_on_the_axioms_of_the_reals_is_accepted(printed, count, axioms, other):
    found, stranger = assumed(printed, count)
    assert found == axioms
    assert stranger.startswith(other)
    assert bool(stranger) is bool(other)


@pytest.mark.slow
@pytest.mark.sweep  # half a minute of coqc, as what follows; by hand
@needs_coq
def test_the_command_that_is_printed_compiles_library_and_theorem(gains):
    for command in ("obsdesign theorem --library library", "obsdesign verify tank.gains.json --theorem coq"):
        assert run(*command.split()[1:]).exit_code == 0
    script = command_of("library", "tank.theorem.v")
    done = subprocess.run(script, shell=True, capture_output=True, text=True, check=False, cwd=gains.parent)
    assert done.returncode == 0, done.stderr
    assert "Axioms:" in done.stdout


@pytest.mark.slow
@needs_coq
def test_coq_accepts_a_design_from_the_command_line_and_refuses_a_false_text(gains, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", CACHE)
    outcome = run("verify", gains, "--theorem", "coq", "--compile")
    assert outcome.exit_code == 0, outcome.stderr
    text = (gains.parent / "tank.theorem.v").read_text()
    assert judged(text).axioms <= AXIOMS
    false = judged(re.sub(r"gamma : Q := 0\.", "gamma : Q := 0.0", text))
    assert not false.accepted
    assert false.refused == "proved"
    cheat = judged(
        text.replace("Lemma gain_proved", "Axiom cheat : forall P : Prop, P.\nLemma gain_proved").replace(
            "Proof. vm_cast_no_check (eq_refl true). Qed.", "Proof. apply cheat. Qed."
        )
    )
    assert not cheat.accepted
    assert cheat.refused.endswith("cheat")
