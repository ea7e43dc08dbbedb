"""Theorems about the reconstruction of an input: of linear plants, with the constants of the result."""

import json
import re

import pytest
from support.coq import AXIOMS, compiled, compiled_library, needs_coq
from support.shipped import SPECS

import obsdesign as od

PLANT = """
obsdesign: 1
system: {A: ENTRIES, B: [[2, 0], [0, 1], [1, 1]], C: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
observer: {type: linf, alpha: 0.5, reconstruct: w, bounds: {L1: 50}}
"""
SPEC = {
    "matched": SPECS / "chakrabarty2016-matched-input.yaml",
    "two inputs": PLANT.replace("ENTRIES", "[[-1, 0.5, 0], [0, -1, 0.2], [0.3, 0, -2]]"),
    "no drift": PLANT.replace("ENTRIES", "[[0, 0, 0], [0, 0, 0], [0, 0, 0]]"),
    "cubic": SPECS / "chakrabarty2016-cubic.yaml",
}


@pytest.fixture(scope="module")
def theorems(tmp_path_factory):
    """Guarantee and theorem of each spec."""
    folder, found = tmp_path_factory.mktemp("reconstruction"), {}
    for name, spec in SPEC.items():
        path = folder / "case.gains.json"
        od.solve(od.load(spec)).save(path)
        found[name] = json.loads(path.read_text())["guarantee"], od.theorem(path)
    return found


def test_the_bound_has_the_constants_of_the_result(theorems):
    for name, (guarantee, text) in theorems.items():
        stated = "Theorem reconstruction_bound" in text
        assert stated is (name != "cubic"), name
        if stated:
            told = [float(re.search(rf"Definition {key} : Q := ([\d.]+)\.\n", text)[1]) for key in ("c_w", "c_rate")]
            said = re.search(
                r"limsup \|what - w\| <= ([\d.e-]+) sup\|w\| \+ ([\d.e-]+) sup\|w'\|", guarantee["statement"]
            )
            assert told == [pytest.approx(float(number), rel=1e-12) for number in said.groups()]
            assert (told[0] == 0) is (name == "no drift")


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """The library, compiled."""
    return compiled_library(tmp_path_factory.mktemp("library"))


@pytest.mark.slow
@needs_coq
@pytest.mark.parametrize("name", [name for name in SPEC if name != "cubic"])
def test_the_kernel_accepts_the_bound(name, theorems, library):
    accepted, said = compiled(library, theorems[name][1])
    assert accepted, said
    assert set(re.findall(r"^\w+\.(\w+)", said, re.MULTILINE)) <= AXIOMS


FALSE = {
    "a smaller constant of w": (r"(c_w : Q := )([\d.]+)\.", lambda m: f"{m[1]}{float(m[2]) * 0.9:.12f}."),
    "a smaller constant of w'": (r"(c_rate : Q := )([\d.]+)\.", lambda m: f"{m[1]}{float(m[2]) * 0.9:.12f}."),
    "another left inverse": (r"(Bi : list \(list Q\) := \[\[)[^;]+", lambda m: f"{m[1]}3"),
    "a faster decay": (r"(level_alpha := )[\d.]+", lambda m: f"{m[1]}100"),
}


@pytest.mark.slow
@needs_coq
@pytest.mark.parametrize("what", FALSE)
def test_the_kernel_refuses_other_numbers(what, theorems, library):
    pattern, change = FALSE[what]
    text = theorems["two inputs"][1]
    other = re.sub(pattern, change, text, count=1)
    assert other != text
    accepted, said = compiled(library, other)
    assert not accepted
    assert "claims_reconstruction" in said
