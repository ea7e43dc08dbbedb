"""What people write in a spec who come from MATLAB or numpy: each is answered by what to write instead."""

from pathlib import Path

import pytest
from support.commands import run

pytestmark = pytest.mark.usefixtures("here")

MATRICES = """obsdesign: 1
parameters: {m: 2, K: 3}
system:
  A: [[0, 1], [-2, -3]]
  C: [1, 0]
observer: {type: sporadic, T1: 0.1, T2: 0.2}
simulation: {horizon: 3, sampling: {law: 0.15}, points: 100}
"""
EQUATIONS = """obsdesign: 1
parameters: {m: 2, k: 3}
system:
  disturbances: [force]
  dynamics:
    pos: vel
    vel: -k/m*pos - 0.4*vel + force
  outputs: {enc: pos}
disturbance: integrator
performance: [force]
observer: {type: l2, alpha: 0.3, bounds: {L1: 100}}
"""
A, LAW = "A: [[0, 1], [-2, -3]]", "law: 0.15"
LISTS = "system.A: a matrix is a list of its rows, without quotes: write "


def said_of(text):
    """Lines of `check` about a spec."""
    Path("spec.yaml").write_text(text)
    outcome = run("check", "spec.yaml", "-q")
    assert outcome.exit_code == 2
    assert not outcome.stdout
    return outcome.stderr.splitlines()


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ('"[0 1; -2 -3]"', "[[0, 1], [-2, -3]]"),
        ("[0 1; -2 -3]", "[[0, 1], [-2, -3]]"),
        ('"0 1; -2 -3"', "[[0, 1], [-2, -3]]"),
        ("|\n    0 1\n    -2 -3", "[[0, 1], [-2, -3]]"),
        ("[[0 1], [2 3]]", "[[0, 1], [2, 3]]"),
        ("[[0 1], [-2 -3]]", "[[0, 1], [-2, -3]]"),
        ("np.array([[0, 1], [-K/m, 3]])", "[[0, 1], [-K/m, 3]]"),
        ('"[[0, 1], [2, 3]]"', "[[0, 1], [2, 3]]"),
        ('"((0, 1), (2, 3))"', "[[0, 1], [2, 3]]"),
        ("zeros(2)", "[[0, 0], [0, 0]]"),
        ("np.zeros((2, 2))", "[[0, 0], [0, 0]]"),
        ("eye(2)", "[[1, 0], [0, 1]]"),
        ("diag([1, K])", "[[1, 0], [0, K]]"),
    ],
)
def test_a_matrix_in_another_notation_is_shown_as_lists(written, meant):
    said = said_of(MATRICES.replace(A, f"A: {written}"))
    assert said == [f"spec.yaml:4:6: {LISTS}{meant} [OBS209]"]
    Path("spec.yaml").write_text(MATRICES.replace(A, f"A: {meant}"))
    assert run("check", "spec.yaml", "-q").exit_code != 2


def test_a_large_matrix_is_not_shown_whole():
    row = " ".join(["0.125"] * 60)
    (said,) = said_of(MATRICES.replace(A, f'A: "[{row}]"'))
    assert said == "spec.yaml:4:6: system.A: a matrix is a list of its rows, without quotes [OBS209]"


@pytest.mark.parametrize(
    "written", ["(max(1, 2) + 3)", "|\n    1 +\n    2", "min(1, 2)", "(1 + 2)*(3)", f"({'1 + ' * 700}1)"]
)
def test_arithmetic_is_no_matrix(written):
    Path("spec.yaml").write_text(MATRICES.replace(A, f"A: {written}").replace("C: [1, 0]", "C: 1"))
    assert run("check", "spec.yaml", "-q").exit_code != 2


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        (A, "A: [[0, 1] [2, 3]]", "spec.yaml:4:14: the entries of a list, rows as well, are separated by commas"),
        (A, "A: [[0, 1]; [2, 3]]", "spec.yaml:4:13: the entries of a list, rows as well, are separated by commas"),
        (A, "A: [[sqrt(2) 1; 1 1]]", "spec.yaml:4:6: system.A: a matrix is a list of its rows, without quotes: write"),
        (A, "A: [[2 kg, 1], [0, 1]]", "spec.yaml:4:8: system.A[0][0]: a number has no unit, found 2 kg"),
        (
            A,
            "A: [[0, x1], [2, 3]]",
            "4:11: system.A[0][1]: unknown name 'x1'; allowed: K, m, pi; x1 is a state",
        ),
        (A, "A: [[0, x], [2, 3]]", "spec.yaml:4:11: system.A[0][1]: unknown name 'x'; allowed: K, m, pi; x is a state"),
        (A, f"inputs: [V]\n  {A.replace('-2', 'V')}", "unknown name 'V'; allowed: K, m, pi; V is a known input"),
        (A, "A: [[0, k], [2, 3]]", "unknown name 'k'; did you mean 'K'?; allowed: K, m, pi; a constant is declared"),
        (A, "A: [[0, 1], [2, NaN]]", "spec.yaml:4:19: system.A[1][1]: unknown name 'NaN': every number is finite"),
        ("T1: 0.1", "T1: -0.1", "spec.yaml:6:32: observer.T1: -0.1 is not allowed; give a number >= 0"),
        ("points: 100", "points: -1", "simulation.points: -1 is not allowed; give a whole number from 2"),
        (LAW, "law: -0.15", "simulation.sampling.law: -0.15 is not allowed; give the time to the next measurement"),
    ],
)
def test_an_entry_that_cannot_be_one_says_what_to_write(before, after, expected):
    (said,) = said_of(MATRICES.replace(before, after))
    assert expected in said


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        ("    pos: vel\n", "", "unknown name 'pos'; allowed: .*; a state has a line of its own under system.dynamics"),
        ("-k/m", "-K/m", "unknown name 'K'; did you mean 'k'?"),
        ("0.4*vel", "0.4*Vel", "unknown name 'Vel'; did you mean 'vel'?"),
        ("0.4*vel", "np.sin(vel)", "'np.' is not allowed here: a function has no module before it; write sin(..)"),
        ("0.4*vel", "0.4*vel.^2", "'.^' is not allowed here: values are single numbers; write *, / or **"),
        ("0.4*vel", "0.4*pos'", "a derivative or a transpose is written out"),
        ("0.4*vel", "0.4*x(2)", "unknown function 'x'; a product is written *"),
        ("0.4*vel", "0.4*x[2]", "subscripts are not allowed; each component has its own name, such as x1"),
        ("[force]\nobs", "force\nobs", "force is no group of signals; names stand in a list: write [force]"),
        ("[force]\nobs", "pos, Force\nobs", "names stand in a list: write [pos, force]"),
        ("[force]\nobs", "forze speed\nobs", "unknown performance forze speed; allowed: x, w, all, a list of names"),
    ],
)
def test_a_name_that_is_not_known_says_what_to_write(before, after, expected):
    assert before in EQUATIONS
    (said,) = said_of(EQUATIONS.replace(before, after, 1))
    assert all(part in said for part in expected.split(".*"))


@pytest.mark.parametrize("value", ["null", "~"])
def test_a_key_is_not_set_to_nothing(value):
    Path("spec.yaml").write_text(EQUATIONS)
    outcome = run("check", "spec.yaml", "--set", f"observer.alpha={value}")
    assert outcome.exit_code == 2
    expected = f"{value} is no value; give one, or take the key out of the spec [OBS110]"
    assert outcome.stderr == f"--set observer.alpha={value}: {expected}\n"
