"""Theorems of Lipschitz observers: a rate where e -> 0 is claimed without one, and larger constants."""

import json
import re

import pytest
from support.coq import AXIOMS, compiled, compiled_library, needs_coq
from support.shipped import SPECS

import obsdesign as od

STEPS = """
obsdesign: 1
system: {time: discrete, A: [[0.9, 0.1], [-0.1, 0.9]], B: [[0], [0.1]], C: [[1, 0]]}
nonlinearities: [{f: 0.1*sin(q), type: {lipschitz: 0.1}, Bf: [0, 0.1], Cq: [0, 1]}]
observer: {type: KIND, rho: 1}
"""
CASES = {
    "time": (SPECS / "abbaszadeh2010-second-order.yaml", "alpha", "e(t) -> 0"),
    "samples": (STEPS.replace("KIND", "lipschitz"), "rho", "e_k -> 0"),
}


def theorem_of(spec, folder):
    """Guarantee and theorem of the design of a spec."""
    design = od.solve(od.load(spec))
    assert design.status == "certified"
    design.save(folder / "case.gains.json")
    return json.loads((folder / "case.gains.json").read_text())["guarantee"], od.theorem(folder / "case.gains.json")


@pytest.mark.parametrize("name", CASES)
def test_where_the_words_claim_convergence_the_theorem_has_a_rate(name, tmp_path):
    spec, key, words = CASES[name]
    guarantee, text = theorem_of(spec, tmp_path)
    assert words in guarantee["statement"]
    assert guarantee[{"alpha": "decay"}.get(key, key)] == (1 if key == "rho" else 0)
    told = float(re.search(r"\n  alpha := ([\d.]+);", text)[1])
    assert 0 < told < 1
    head = " ".join(text.partition("Require Import")[0].replace("*)", "").replace("(*", "").split())
    assert f"this {key} {'<' if key == 'rho' else '>'} {'1' if key == 'rho' else '0'} is one that" in head
    assert "hence e -> 0" in head
    assert "stays bounded" not in head


def test_where_no_decay_is_claimed_none_is_stated(tmp_path):
    _, text = theorem_of(STEPS.replace("KIND", "l2"), tmp_path)
    assert "\n  alpha := 1;" in text
    assert "says that e stays bounded" in text
    assert "-> 0 *)" not in text.partition("Require Import")[0]


GIVEN = SPECS / "abbaszadeh2010-polynomial-gains.yaml"


def test_larger_constants_that_are_tolerated_have_a_theorem_of_their_own(tmp_path):
    guarantee, text = theorem_of(GIVEN, tmp_path)
    before, larger, after = re.split(r"Module Larger\.|End Larger\.", text)
    for part, constant in ((before, guarantee["lipschitz"]), (larger, guarantee["admissible"])):
        squares = re.findall(r"M11 := \[\[([\d.]+);", part)
        assert [float(square) for square in squares] == [pytest.approx(constant**2, rel=1e-12)]
    assert "L1 := L1 designed;" in larger
    assert "Theorem larger_constants : forall f, of_class designed f ->" in larger
    assert after.startswith("\nPrint Assumptions Larger.larger_constants.\n")
    assert "admissible" not in theorem_of(CASES["time"][0], tmp_path)[0]
    assert "\nModule Larger." not in theorem_of(CASES["time"][0], tmp_path)[1]


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """The library, compiled."""
    return compiled_library(tmp_path_factory.mktemp("library"))


@pytest.mark.slow
@needs_coq
@pytest.mark.parametrize("name", CASES)
def test_the_kernel_accepts_this_rate_and_no_much_faster_one(name, library, tmp_path):
    _, text = theorem_of(CASES[name][0], tmp_path)
    accepted, said = compiled(library, text)
    assert accepted, said
    assert set(re.findall(r"^\w+\.(\w+)", said, re.MULTILINE)) <= AXIOMS
    faster = {"time": "alpha := 2;", "samples": "alpha := 0.3;"}[name]
    accepted, said = compiled(library, re.sub(r"alpha := [\d.]+;", faster, text))
    assert not accepted
    assert "claims_" in said


@pytest.mark.slow
@needs_coq
def test_the_kernel_accepts_the_larger_constants_and_none_beyond(library, tmp_path):
    _, text = theorem_of(GIVEN, tmp_path)
    accepted, said = compiled(library, text)
    assert accepted, said
    before, middle, after = re.split(r"(?<=Module Larger\.)|(?=End Larger\.)", text)
    beyond = re.sub(r"M11 := \[\[([\d.]+); 0\]; \[0; ([\d.]+)\]\]", "M11 := [[1.9; 0]; [0; 1.9]]", middle)
    assert beyond != middle
    accepted, said = compiled(library, before + beyond + after)
    assert not accepted
    assert "claims_" in said
