"""Theorems of specs whose disturbance has a model: about plant and model as the spec has them, joined by Coq."""

import re

import numpy as np
import pytest
from support.coq import AXIOMS, compiled, compiled_library, needs_coq
from support.shipped import SPECS

import obsdesign as od
from obsdesign.coq.decimals import matrix
from obsdesign.coq.theorem import stated
from obsdesign.model.filtered import channels

PLANT = """
obsdesign: 1
system: {{{time}A: [[-0.5, 0.3], [0.1, 0.2]], B: [[0.1, 0.2], [1, 0]], C: [[1, 0.1]], D: [[0, 0.3]]}}
nonlinearities: [{{{f}, Bf: [0, 0.05], Cq: [1, 1], Dq: [0.1, 0]{out}}}]
disturbance:
  model:
    Am: [[0.2, 0.5], [-0.5, 0.2]]
    Bm: [[0, 0.1], [0.2, 0]]
    Cm: [[1, 0], [0, 0]]
    Dm: [[0, 0.4], [0.25, 0]]
    Bmf: [[0], [0.1]]
    Cq2: [[1, 0]]
    Dq2: [[0.1, 0]]
    Dwf: [[0.2], [{wf}]]
    Dq2f: [[0.05]]
    nonlinearities: [{{f: tanh(q), type: tanh}}]
observer: {{type: {type}, {rate}, bounds: {{L1: 50}}}}
"""
SINE, LOCAL = "f: sin(q), type: sin", "f: q**2/2, type: {slope: [0, 1]}, region: {q: [0, 1]}"
CONTINUOUS = {"time": "", "rate": "alpha: 0.05", "out": ", Df: 0.1, Dqf: 0.05", "wf": "0.1"}
CONTINUOUS_A = ("[[-0.5, 0.3], [0.1, 0.2]]", "[[-2, 0.3], [0.1, -1]]")
PREDICTED = {**CONTINUOUS, "time": "time: discrete, period: 1, ", "rate": "rho: 0.95"}
FILTERED = {**PREDICTED, "rate": "rho: 0.95, estimate: filtered", "out": "", "wf": "0"}
RUNS = {"driven": CONTINUOUS, "driven_predicted": PREDICTED, "driven_filtered": FILTERED}
CASES = {f"{run} {kind}": (run, kind, f) for run in RUNS for kind, f in (("l2", LOCAL), ("linf", SINE))}


def spec_of(run, kind, f):
    """Spec with a model of w that has every matrix."""
    text = PLANT.format(type=kind, f=f, **RUNS[run])
    return od.load(text.replace(*CONTINUOUS_A) if run == "driven" else text)


@pytest.fixture(scope="module")
def theorems(tmp_path_factory):
    """Spec and theorem of each case."""
    folder, found = tmp_path_factory.mktemp("joined"), {}
    for name, case in CASES.items():
        spec = spec_of(*case)
        design = od.solve(spec)
        assert design.status == "certified", name
        design.save(folder / "case.gains.json")
        found[name] = spec, od.theorem(folder / "case.gains.json")
    return found


def test_the_file_holds_the_matrices_of_the_spec_and_of_its_model(theorems):
    for name, (spec, text) in theorems.items():
        records = text.partition("Open Scope Z_scope")[0]
        plant, _, model = records.partition("Definition model : generator")
        for key in ("A", "Bf", "B", "C", "Df", "D", "Cq", "Dqf", "Dq"):
            assert f"\n  {key} := {matrix(getattr(spec.plant, key))};" in plant, (name, key)
        for key in ("Am", "Bmf", "Bm", "Cq2", "Dq2f", "Dq2", "Cm", "Dwf", "Dm"):
            assert re.search(rf"\n  {key} := {re.escape(matrix(getattr(spec.generator, key)))}( \|\}}\.|;)", model), key
        assert re.search(r"P := \[\[(.*)\]\];", plant)[1].count("];") == spec.augmented.n - 1


def test_the_theorem_is_about_x_xm_w_and_v(theorems):
    for name, (spec, text) in theorems.items():
        run = name.split()[0]
        assert f"forall x xm xh xmh v w wh q qh y yh g gq gy, {run} designed model f x xm xh xmh v w" in stated(text)
        assert ("acting now late v k" in stated(text)) is (run == "driven_filtered")
        masks = re.findall(r"Definition (?:now|late) : list bool := \[(.*)\]", text)
        if run == "driven_filtered":
            assert [mask.split("; ") for mask in masks] == [
                [str(bool(x)).lower() for x in mask] for mask in channels(spec.augmented)
            ]
        head = " ".join(text.partition("Require Import")[0].replace("*)", "").replace("(*", "").split())
        assert "that plant and model of w make the matrices of the inequality is proved" in head
        assert "e = (xhat, xmhat) - (x, xm)" in head


def test_where_w_is_unknown_itself_no_model_is_joined(tmp_path):
    spec = od.load(SPECS / "contracting-drag.yaml")
    assert spec.generator.direct
    od.solve(spec).save(tmp_path / "case.gains.json")
    text = od.theorem(tmp_path / "case.gains.json")
    assert "trajectories designed f x xh v q" in stated(text)
    assert "generator" not in text
    assert "joined" not in text


@pytest.mark.parametrize(("Dm", "direct"), [("[[1, 0], [0, 1]]", True), ("[[0, 1], [1, 0]]", False)])
def test_a_model_without_states_is_one_unless_w_is_v(Dm, direct):
    spec = od.load(
        "obsdesign: 1\nsystem: {A: [[-1]], B: [[1, 0]], C: [[1]], D: [[0, 1]]}\nobserver: {type: l2, alpha: 0.1}\n"
        f"disturbance: {{model: {{Dm: {Dm}}}}}\nperformance: all\n"
    )
    assert spec.generator.direct is direct


# What the kernel says


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """The library, compiled."""
    return compiled_library(tmp_path_factory.mktemp("library"))


@pytest.mark.slow
@needs_coq
@pytest.mark.parametrize("name", CASES)
def test_the_kernel_joins_plant_and_model_of_every_kind(name, theorems, library):
    text = theorems[name][1]
    assert "Theorem for_this_f" in text
    accepted, said = compiled(library, text)
    assert accepted, said
    assert set(re.findall(r"^\w+\.(\w+)", said, re.MULTILINE)) <= AXIOMS


def changed(M, i, j):
    """The same matrix with another entry, as Coq has it."""
    other = np.array(M, dtype=object)
    other[i, j] = other[i, j] * 3 + 2
    return matrix(other)


@pytest.mark.slow
@needs_coq
def test_the_kernel_refuses_another_model_than_that_of_the_design(theorems, library):
    spec, text = theorems["driven_filtered linf"]
    g = spec.generator
    places = {"Am": (0, 1), "Bmf": (1, 0), "Bm": (1, 0), "Cm": (0, 0), "Dwf": (0, 0), "Dm": (1, 0), "Cq2": (0, 0)}
    texts = {}
    for key, (i, j) in places.items():
        M = getattr(g, key)
        texts[key] = text.replace(f"\n  {key} := {matrix(M)}", f"\n  {key} := {changed(M, i, j)}")
    texts["a mask"] = text.replace("now : list bool := [true; true]", "now : list bool := [true; false]")
    texts["a size"] = text.replace("mq := 1%nat", "mq := 0%nat")
    for what, other in texts.items():
        assert other != text, what
        accepted, said = compiled(library, other)
        assert not accepted, what
        assert "claims_" in said, (what, said)


@pytest.mark.slow
@needs_coq
def test_filtered_estimates_of_a_model_are_not_taken_for_predicted_ones(theorems, library):
    text = theorems["driven_filtered l2"][1]
    other = text.replace("energy_of_filtered_model designed model now late", "energy_of_sampled_model designed model")
    other = other.replace(
        "energy_of_driven_filtered designed model now late", "energy_of_driven_predicted designed model"
    )
    other = other.replace("driven_filtered", "driven_predicted").replace("acting now late v k", "v k")
    accepted, said = compiled(library, other)
    assert not accepted
    assert "Error" in said
