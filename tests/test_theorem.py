"""Guarantees as theorems for Coq: what stands in the file, what is refused, what its kernel says of true and false."""

import json
import re
import shlex
import subprocess
import sys
from fractions import Fraction

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from support.commands import run
from support.coq import AXIOMS, compiled, compiled_library, needs_coq
from support.shipped import solved

import obsdesign as od
from obsdesign.coq.congruence import congruence, integers
from obsdesign.coq.decimals import comment, number
from obsdesign.coq.library import command
from obsdesign.coq.library import library as library_files
from obsdesign.lmi.formula import rational


def turned(S, columns):
    """T' S T in integers."""
    T = np.array([[0] * j + column for j, column in enumerate(columns)], dtype=object).T
    assert all(T[j, j] for j in range(len(T)))
    return T.T @ np.array(integers(S), dtype=object) @ T


@given(st.integers(1, 6), st.integers(0, 2**32 - 1), st.booleans())
def test_the_columns_of_T_are_triangular_and_make_a_positive_matrix_dominant(order, seed, silent):
    draw = np.random.default_rng(seed)
    F = rational(draw.integers(-9, 10, (order, order + 3)))
    S = F @ F.T + rational(np.eye(order, dtype=int))
    if silent:
        S[0, :], S[:, 0] = fmpq(0), fmpq(0)
    for i, row in enumerate(turned(S, congruence(S))):
        assert 2 * row[i] >= sum(map(abs, row))


@given(st.integers(1, 6), st.integers(1, 5), st.integers(0, 2**32 - 1), st.fractions(1, 10))
def test_a_singular_matrix_is_made_diagonal_in_rationals(order, rank, seed, size):
    F = rational(np.random.default_rng(seed).integers(-9, 10, (order, rank)))
    S = fmpq(size.numerator, size.denominator) * (F @ F.T)
    for i, row in enumerate(turned(S, congruence(S))):
        assert 2 * row[i] >= sum(map(abs, row))


def test_a_margin_that_no_double_sees_is_seen():
    S = rational([[1, 1], [1, 1]]) + fmpq(1, 10**40) * rational([[0, 0], [0, 1]])
    (first, second) = turned(S, congruence(S))
    assert first[1] == 0
    assert first[0] > 0 < second[1]


@pytest.mark.parametrize("S", [[[-1]], [[1, 2], [2, 1]], [[0, 1], [1, 1]], [[1, 1], [1, 0]]])
def test_there_is_no_T_for_a_matrix_that_is_not_positive(S):
    with pytest.raises(ValueError, match="negative eigenvalue"):
        congruence(rational(S))


@given(st.fractions())
def test_a_literal_is_the_very_rational(x):
    text = number(fmpq(x.numerator, x.denominator)).strip("()").replace(" # ", "/")
    assert Fraction(text) == x


@given(st.text())
def test_no_text_ends_its_comment(text):
    inner = comment(text).removeprefix("(*").removesuffix("*)")
    assert not re.search(r'[*"\n\r]', inner)


NAMES = (
    "corless2019-magnetic-bearing-bounded",
    "chakrabarty2016-cubic",
    "abbaszadeh2010-flexible-joint",
    "discrete-bearing",
    "discrete-peak",
    "discrete-flexible-joint",
)


PLANT = """
obsdesign: 1
system: {A: [[-1, 1, 0], [0, -2, 1], [0, 0, -1]], B: [[0], [0], [1]], C: [[1, 0, 0], [0, 1, 0]]}
nonlinearities:
  - {type: {slope: [0, 1]}, Bf: [0.1, 0, 0], Cq: [0, 0, 1]}
"""
BESIDE = "    Bf: [[-1, 0], [0, -1], [0, 0]]\n    Cq: [[1, 0, 0], [0, 1, 0]]\n"
MATRICES = {
    "cone": f"""{PLANT}
  - type: {{cone: [[[1, 0], [0, 0]], [[0, 0], [0, 1]], [[1, 1], [1, 1]]]}}
{BESIDE}
observer: {{type: l2, alpha: 0.1, L2: 0}}
""",
    "hull": f"""{PLANT}
  - type: {{jacobian: [[[0, 0], [0, 0]], [[1, 0], [0, 2]], [[0, 0.5], [0.5, 1]]]}}
{BESIDE}
observer: {{type: linf, alpha: 0.1, L2: 0, bounds: {{L1: 100}}}}
""",
    "slopes": """
obsdesign: 1
system: {A: [[-1, 1], [0, -1]], B: [[0], [1]], C: [[1, 0]]}
nonlinearities: [{type: {jacobian: [[[-1]], [[0]]]}, Bf: [0, 1], Cq: [0, 1]}]
observer: {type: l2, alpha: 0.1, bounds: {L1: 10}}
""",
}


UNKNOWN = {"abbaszadeh2010-flexible-joint", *MATRICES}  # the first has a constant below that of f, the others no f


@pytest.fixture(scope="module")
def gains(tmp_path_factory):
    """Results of one design of each family whose claims are exported."""
    folder = tmp_path_factory.mktemp("gains")
    for name in NAMES:
        solved(name)[1].save(folder / f"{name}.gains.json")
    for name, spec in MATRICES.items():
        od.solve(od.load(spec)).save(folder / f"{name}.gains.json")
    return sorted(folder.glob("*.gains.json"))


def test_the_file_holds_the_numbers_of_the_result_and_ends_with_the_guarantee(gains):
    for path in gains:
        result, text = json.loads(path.read_text()), od.theorem(path)
        assert comment(f"in words: {result['guarantee']['statement']}") in text.splitlines()
        record, _, theorem = text.partition("Lemma proved")
        for row in result["certificate"]["P"]:
            for entry in row:
                assert number(fmpq(*map(int, entry.split("/")))) in record
        assert re.search(
            r"Theorem for_the_class : forall f, of_class (designed|\(joined designed model\)) f ->", theorem
        )
        last = "for_the_class" if path.name.partition(".")[0] in UNKNOWN else "for_this_f"
        assert theorem.endswith(f"Print Assumptions {last}.\n")
        assert not re.search(r"Admitted|Axiom|Parameter|admit", text)


def test_bounds_that_a_design_keeps_are_theorems_too(gains):
    for path in gains:
        bounds = json.loads(path.read_text())["spec"]["text"].partition("bounds:")[2]
        assert ("Theorem gain_bound" in od.theorem(path)) is ("L1" in bounds)
        assert ("Theorem storage_bound" in od.theorem(path)) is ("P:" in bounds)


def test_verify_writes_the_theorem_and_says_how_to_compile_it(gains, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = run("verify", gains[0], "--theorem", "coq")
    name = gains[0].name.replace(".gains.json", ".theorem.v")
    assert said.exit_code == 0
    assert f"theorem for Coq about every f of the class, not compiled  {name}" in said.stdout
    assert "\nthat the f of the spec is one of them is not shown: " in said.stdout
    assert (tmp_path / name).read_text() == od.theorem(gains[0])
    report = json.loads(run("verify", gains[0], "--theorem", "coq", "-o", "here.v", "--json").stdout)
    assert report["theorem"].keys() == {"file", "sha256", "statement", "about", "accepted", "time_s"}
    assert report["theorem"]["statement"].startswith("Theorem for_the_class : forall f, of_class designed f ->")
    assert report["theorem"]["accepted"] is None
    assert run("verify", gains[0], "--theorem", "coq", "-o", "-").stdout.startswith("(* obsdesign: ")


def test_the_words_at_the_head_say_what_of_them_is_stated_and_what_is_a_premise(gains):
    for path in gains:
        head = od.theorem(path).partition("Require Import")[0]
        head = " ".join(head.replace("*)", "").replace("(*", "").split())
        own = ("is for_this_f", "f is the one that is defined below")
        if path.name.partition(".")[0] in UNKNOWN:
            own = ("is for_the_class", "for all arguments, also where")
        for words in (*own, "As floor is less", "does not state"):
            assert words in head
        assert ("anything of a plant in continuous time" in head) is path.name.startswith("discrete")


def test_the_library_is_written_to_be_read_and_holds_no_axiom():
    for name, content in library_files().items():
        text = content.decode()
        assert all(len(line) <= 120 for line in text.splitlines()), name
        assert not re.search(r"\b(Admitted|admit|Axiom|Axioms|Parameter|Parameters|Conjecture)\b", text), name
        assert name.startswith("_") or text.startswith("(* obsdesign: ")


def test_a_command_for_a_shell_takes_any_path():
    for path in ("-a.v", "a b.v", "a';b.v"):
        words = shlex.split(command("-library", path))
        assert words[words.index("cp") + 1] in {path, f"./{path}"}
        assert not words[words.index("cp") + 1].startswith("-")


def test_what_cannot_be_asked_or_exported_is_said_in_one_line(gains, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    asked = {
        ("verify", gains[0], "--theorem", "lean"): "OBS904",
        ("verify", gains[0], "-o", "a.v"): "OBS904",
        ("verify", *gains, "--theorem", "coq", "-o", "a.v"): "OBS904",
        ("verify", gains[0], "--theorem", "coq", "-o", "a.json"): "OBS904",
        ("verify", gains[0], "--theorem", "coq", "-o", "-", "--json"): "OBS904",
        ("theorem", "--library", gains[0]): "OBS904",
        ("theorem", "--library", ""): "OBS904",
        ("verify", gains[0], "--theorem", "coq", "-o", "nowhere/a.v"): "OBS902",
    }
    (tmp_path / "mine.v").write_text("(* mine *)")
    asked["verify", gains[0], "--theorem", "coq", "-o", "mine.v"] = "OBS914"
    for arguments, id in asked.items():
        outcome = run(*arguments)
        assert outcome.exit_code == 2
        assert id in outcome.stderr
        assert len(outcome.stderr.splitlines()) == 1
    assert (tmp_path / "mine.v").read_text() == "(* mine *)"
    assert not (tmp_path / "a.v").exists()


UNEXPORTED = {
    "ferrante2019-oscillator-gains": "claims of a proposition are not exported yet, those of relaxation clock are",
    "infeasible/discrete-hidden-mode": "this result has no gains",
}


@pytest.mark.parametrize(("name", "words"), UNEXPORTED.items())
def test_a_claim_that_has_no_theorem_is_refused(name, words, tmp_path):
    path = tmp_path / "case.gains.json"
    solved(name)[1].save(path)
    with pytest.raises(od.UsageError, match=words) as error:
        od.theorem(path)
    assert str(path) in str(error.value)


def test_no_part_of_a_false_claim_is_exported(gains, tmp_path):
    path = tmp_path / "forged.gains.json"
    content = json.loads(next(one for one in gains if "joint" in one.name).read_text())
    content["guarantee"]["lipschitz"] *= 1.01
    path.write_text(json.dumps(content))
    with pytest.raises((od.UndecidedError, od.UsageError)):
        od.theorem(path)
    outcome = run("verify", path, "--theorem", "coq", "-o", tmp_path / "forged.v")
    assert outcome.exit_code in {2, 4}
    assert not (tmp_path / "forged.v").exists()


@pytest.mark.parametrize("power", [*range(-340, 341, 17), 400])
def test_a_claim_at_the_ends_of_what_doubles_hold_is_exported_or_refused_in_one_line(power, gains, tmp_path):
    content = json.loads(next(one for one in gains if "bearing" in one.name).read_text())
    size = Fraction(10) ** power
    certificate, guarantee = content["certificate"], content["guarantee"]
    certificate["P"] = [[str(size * Fraction(x)) for x in row] for row in certificate["P"]]
    certificate["multipliers"] = {key: str(size * Fraction(x)) for key, x in certificate["multipliers"].items()}
    guarantee |= {key: str(size * Fraction(str(guarantee[key]))) for key in ("mu1", "mu2")}
    path = tmp_path / "far.gains.json"
    path.write_text(json.dumps(content))
    outcome = run("verify", path, "--theorem", "coq", "-o", tmp_path / "far.v")
    assert outcome.exit_code in {0, 2, 4}, outcome.exception
    assert (tmp_path / "far.v").exists() is (outcome.exit_code == 0)
    assert outcome.exit_code == 0 or len(outcome.stderr.splitlines()) == 1


def test_files_of_one_name_in_two_folders_do_not_share_a_theorem(gains, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "same.gains.json").write_bytes(gains[0].read_bytes())
    outcome = run("verify", "a/same.gains.json", "b/same.gains.json", "--theorem", "coq")
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert "same.theorem.v would be written of several files" in outcome.stderr
    assert not (tmp_path / "same.theorem.v").exists()


def test_a_result_on_standard_input_has_a_theorem_too(gains):
    command = [sys.executable, "-m", "obsdesign", "verify", "-", "--theorem", "coq", "-o", "-"]
    outcome = subprocess.run(
        command, input=gains[0].read_text(), capture_output=True, text=True, check=True, timeout=60
    )
    assert outcome.stdout == od.theorem(gains[0])


# What the kernel says


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """The library, compiled."""
    return compiled_library(tmp_path_factory.mktemp("library"))


@pytest.mark.slow
@needs_coq
def test_the_kernel_accepts_one_design_of_each_family_on_the_axioms_of_the_reals(gains, library):
    for path in gains:
        accepted, said = compiled(library, od.theorem(path))
        assert accepted, said
        assert set(re.findall(r"^\w+\.(\w+)", said, re.MULTILINE)) <= AXIOMS


FALSE = {
    "a lower gamma": lambda text: re.sub(
        r"(gamma : Q := )(\d+\.\d+)", lambda m: f"{m[1]}{float(m[2]) * 0.98:.9f}", text
    ),
    "another sign of C": lambda text: text.replace("C := [[1;", "C := [[-1;"),
    "another entry of P": lambda text: re.sub(r"( P := \[\[)[^;\]]+", r"\g<1>0.0001", text),
    "less supply": lambda text: re.sub(r"supply := (\d+\.\d+)", lambda m: f"supply := {float(m[1]) * 0.9:.15f}", text),
    "a negative scale": lambda text: re.sub(r"scaling := [^;]+;", "scaling := (-1);", text, count=1),
    "another gain": lambda text: re.sub(r"(L1 := \[\[)[^;\]]+", r"\g<1>1000", text),
}
FASTER = {"trajectories": "alpha := 40", "predicted": "alpha := 0.1", "filtered": "alpha := 0.1"}


@pytest.mark.slow
@needs_coq
def test_the_kernel_refuses_what_is_false(gains, library):
    text = od.theorem(next(path for path in gains if "discrete-flexible-joint" in path.name))
    run = re.search(r"g gq gy, (\w+) designed", text)[1]
    false = {what: change(text) for what, change in FALSE.items()}
    false["a faster decay"] = re.sub(r"alpha := \d+\.?\d*", FASTER[run], text)
    casts = "Proof. vm_cast_no_check (eq_refl true). Qed."  # of the claim, and of bounds on gains and P
    computed = {str(i) for i, line in enumerate(text.splitlines(), start=1) if line == casts}
    for what, changed in false.items():
        assert changed != text, what
        accepted, said = compiled(library, changed)
        assert not accepted, what
        assert re.search(r"line (\d+), characters", said)[1] in computed, (what, said)


@pytest.mark.slow
@needs_coq
@pytest.mark.parametrize(
    ("name", "changes"),
    {
        "cone": {
            "count := 2": "count := 1",
            "[[0; 0; 0]; [0; 1; 1]": "[[0; 0; 0]; [0; -1; 1]",
        },
        "hull": {"conic := false": "conic := true", "first := 1": "first := 0", "[0; 0; 2]": "[0; 0; 40]"},
    }.items(),
)
def test_the_kernel_refuses_what_is_false_of_a_matrix(name, changes, gains, library):
    text = od.theorem(next(path for path in gains if path.name.startswith(name)))
    for true, false in changes.items():
        assert true in text
        accepted, said = compiled(library, text.replace(true, false))
        assert not accepted, false
        assert "claims_" in said, said


@pytest.mark.slow
@needs_coq
def test_filtered_estimates_are_not_taken_for_predicted_ones(gains, library):
    text = od.theorem(next(path for path in gains if "discrete-flexible-joint" in path.name))
    other = text.replace("(ahead designed)", "designed").replace("of_filtered", "of_predicted")
    other = other.replace("filtered designed", "predicted designed")
    accepted, said = compiled(library, other)
    assert not accepted
    assert "Error" in said
