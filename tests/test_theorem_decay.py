"""Theorems of claims that e -> 0 without a rate: their strict inequality leaves room for one, which Coq proves."""

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
