"""Guarantees of observers with samples at instants as theorems for Coq: numbers, refusals, what is true and false."""

import json
import re
from dataclasses import replace

import pytest
from flint import fmpq
from support.coq import AXIOMS, compiled, compiled_library, needs_coq
from support.shipped import solved

import obsdesign as od
from obsdesign.coq.clock import forms
from obsdesign.coq.decimals import comment, number
from obsdesign.coq.instants import exported, rays, told
from obsdesign.coq.theorem import UnexportedError
from obsdesign.families.sporadic.clock.exported import observer, parts
from obsdesign.lmi.formula import Inequality, rational
from obsdesign.lmi.proof import holds

EXPORTED = {  # what is corrected, and the shortest interval
    "lost-packets": "xhat, T1 > 0",
    "ferrante2019-oscillator-clock": "theta, T1 > 0",
    "sampled-and-held": "theta, T1 = 0",
}
LEMMAS = {
    "overshoot": "decay_guarantee",
    "disturbance": "peak_guarantee",
    "noise": "noise_guarantee",
    "gamma": "gain_guarantee",
    "energy": "energy_guarantee",
}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Results of these specs, by their names."""
    folder = tmp_path_factory.mktemp("results")
    for name in EXPORTED:
        solved(name)[1].save(folder / f"{name}.gains.json")
    return {name: folder / f"{name}.gains.json" for name in EXPORTED}


def test_the_file_holds_the_numbers_of_the_result_and_ends_with_the_guarantee(results):
    for path in results.values():
        result, text = json.loads(path.read_text()), od.theorem(path)
        assert comment(f"in words: {result['guarantee']['statement']}") in text.splitlines()
        record, _, theorem = text.partition("Lemma proved")
        for name, witness in result["certificate"]["witnesses"].items():
            if name == "T2_max":
                continue
            for P in (P for segment in witness["P"] for P in segment):
                for entry in (entry for row in P for entry in row):
                    assert number(fmpq(*map(int, entry.split("/")))) in record
            assert f"of_{name} : witness" in record
            assert LEMMAS[name] in theorem
        for key in ("T1", "T2"):
            assert f"{key} := {number(rational(str(result['guarantee'][key])).item())}" in record
        for key in {"gamma", "initial", "overshoot", "disturbance", "noise"} & result["guarantee"].keys():
            assert f"Definition {key} : Q := {number(rational(str(result['guarantee'][key])).item())}." in record
        assert "Theorem for_the_class : forall f, of_class designed f ->" in theorem
        assert theorem.endswith("Print Assumptions for_this_f.\n")
        assert "What Coq proves is for_this_f" in text
        assert not re.search(r"Admitted|Axiom|Parameter|admit", text)


LOCAL = """
obsdesign: 1
system: {A: [[-1]], B: [[1]], C: [[1]]}
nonlinearities: [{f: -0.5*q/(1 + q**2), type: {auto: {region: {q: [-0.5, 0.8]}}}, Bf: [1], Cq: [1]}]
observer: {type: sporadic, T1: 0.2, T2: 0.4, decay: 0.1, gains: {K: 0.8}}
"""
UNGIVEN = LOCAL.replace("f: -0.5*q/(1 + q**2), type: {auto: {region: {q: [-0.5, 0.8]}}}", "type: {slope: [-1, 0]}")


def test_the_theorem_is_about_the_f_of_the_spec_where_it_is_known():
    text = od.solve(od.load(LOCAL)).theorem()
    assert "Definition region (q : list R) : Prop := (- 0.5) <= nth 0 q 0 <= 0.8." in text
    assert "(forall j s, t j <= s <= t (S j) -> region (q j s) /\\ region (qh j s)) -> let e" in text
    assert "qhat stay inside the region" in text.partition("Require Import")[0]
    assert text.endswith("Print Assumptions for_this_f.\n")


def test_the_theorem_is_about_the_class_where_f_is_not_given():
    text = od.solve(od.load(UNGIVEN)).theorem()
    assert "(* for_the_class is about every f of its class: f1 is not given *)" in text
    assert "What Coq proves is for_the_class" in text
    assert text.endswith("Print Assumptions for_the_class.\n")


def test_a_part_without_a_witness_is_not_stated(results):
    path = results["sampled-and-held"]
    text = od.theorem(path)
    assert "noise" not in json.loads(path.read_text())["guarantee"]
    assert "noise_guarantee" not in text
    assert "does not state the bound by sup|eta| from zero error where w = 0" in text.partition("Require Import")[0]


def test_the_matrices_for_which_T_is_searched_are_those_of_the_inequalities(results):
    for name in results:
        made, found = written_of(name)
        for part in found.values():
            for _, what, stack in forms(made, part.storage, rays(made.multiplier)):
                given = [S for row in stack for S in row if S is not None]
                assert given, what
                assert all(holds(Inequality(what, -S)) for S in given), what


def written_of(name):
    """Observer and parts that the theorem of a spec is written of."""
    spec, design = solved(name)
    claim = design.claim
    made = observer(spec.augmented, spec.H, claim.gains, claim.multiplier, claim.T1, claim.T2)
    return made, parts(claim.witnesses, claim.constants)


def casteljau(values, place):
    """Value of a polynomial at a place of its segment."""
    while len(values) > 1:
        values = (1 - place) * values[:-1] + place * values[1:]
    return values[0]


def test_shorter_segments_hold_the_same_polynomials():
    made, found = written_of("lost-packets")
    for part in found.values():
        storage, half = part.storage, part.storage.halved()
        assert half.knots[::2] == list(storage.knots)
        for place in (fmpq(1, 7), fmpq(5, 7)):
            late = place > fmpq(1, 2)
            for i in range(len(storage.controls)):
                for whole, parted in ((storage.controls, half.controls), *zip_scales(storage, half)):
                    expected = casteljau(whole[i], place)
                    assert (casteljau(parted[2 * i + late], 2 * place - late) == expected).all()
        for _, what, stack in forms(made, half, rays(made.multiplier)):
            assert all(holds(Inequality(what, -S)) for row in stack for S in row if S is not None), what


def zip_scales(storage, half):
    """Scales of the multipliers of both."""
    return [(storage.scales[name][..., None], half.scales[name][..., None]) for name in storage.scales]


def test_a_part_that_holds_on_shorter_segments_only_is_written_of_these():
    spec, (_, found) = od.load(FAST), written_of("lost-packets")
    gains = {"K": rational([[1]])}
    made = observer(spec.augmented, spec.H, gains, spec.multiplier, fmpq(1, 2), fmpq(1))
    P = rational([[[[1]], [[3]], [[1]]]])  # rises from 1 to 2
    bump = replace(found["overshoot"].storage, roof=fmpq(5, 2), knots=(fmpq(0), fmpq(1)), controls=P, scales={})
    part, _ = told("overshoot", made, replace(found["overshoot"], storage=bump), {})
    assert part.storage.controls.ravel().tolist() == [1, 2, 2, 2, 2, 1]
    with pytest.raises(UnexportedError, match="P <= roof I"):
        told("overshoot", made, replace(found["overshoot"], storage=replace(bump, roof=fmpq(19, 10))), {})


FAST = """
obsdesign: 1
system: {A: [[-100]], B: [[1]], C: [[1]]}
observer: {type: sporadic, T1: 0.5, T2: 1, decay: 0.1, gains: {K: 1}}
"""


def test_a_gain_that_depends_on_the_interval_is_refused(tmp_path):
    path = tmp_path / "case.gains.json"
    solved("ferrante2019-oscillator-gap")[1].save(path)
    with pytest.raises(od.UsageError, match="a gain that depends on the interval is not exported yet"):
        od.theorem(path)


def test_storage_functions_that_look_further_ahead_are_refused(tmp_path):
    path = tmp_path / "case.gains.json"
    design = od.solve(od.load(AHEAD))
    assert design.status == "certified"
    design.save(path)
    with pytest.raises(od.UsageError, match="look further ahead are not exported yet"):
        od.theorem(path)


AHEAD = """
obsdesign: 1
system: {A: [[0, 1], [-4, 0]], B: [1, 0], C: [1, 0]}
observer:
  type: sporadic
  T1: 0.205
  T2: 0.41
  decay: 0.05
  clock: {lookahead: 2}
  gains: {L: [2.067, -3], H: -1.384}
"""


# What the kernel says


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """The library, compiled."""
    return compiled_library(tmp_path_factory.mktemp("library"))


@pytest.mark.slow
@needs_coq
def test_the_kernel_accepts_each_on_the_axioms_of_the_reals(results, library):
    for path in results.values():
        accepted, said = compiled(library, od.theorem(path))
        assert accepted, said
        assert set(re.findall(r"^\w+\.(\w+)", said, re.MULTILINE)) <= AXIOMS


@pytest.mark.slow
@needs_coq
def test_the_kernel_accepts_an_f_on_a_region_and_refuses_a_larger_one(library):
    text = od.solve(od.load(LOCAL)).theorem()
    accepted, said = compiled(library, text)
    assert accepted, said
    larger = text.replace("continued (-0.5) 0.8", "continued (-0.5) 0.9")
    assert larger != text
    assert not compiled(library, larger)[0]


@pytest.mark.slow
@needs_coq
def test_the_kernel_accepts_shorter_segments(library):
    spec, design = solved("lost-packets")
    made, found = written_of("lost-packets")
    halved = {name: replace(part, storage=part.storage.halved()) for name, part in found.items()}
    accepted, said = compiled(library, exported(made, halved, spec, design.claim.statement(spec)))
    assert accepted, said


def scaled(text, start, factor):
    """The text with the first decimal after a start made larger."""
    found = re.search(rf"{re.escape(start)}(\d+\.?\d*)", text)
    digits = f"{float(found[1]) * factor:.12f}"
    return text[: found.start(1)] + digits + text[found.end(1) :]


@pytest.mark.slow
@needs_coq
def test_the_kernel_refuses_what_is_false(results, library):
    text = od.theorem(results["lost-packets"])
    false = {
        "a lower gamma": scaled(text, "Definition gamma : Q := ", 0.999),
        "a lower overshoot": scaled(text, "Definition overshoot : Q := ", 0.999),
        "a lower bound by sup|w|": scaled(text, "Definition disturbance : Q := ", 0.999),
        "a lower bound by sup|eta|": scaled(text, "Definition noise : Q := ", 0.999),
        "less for the noise": scaled(text, "Definition energy_of_noise : Q := ", 0.999),
        "a faster decay": text.replace("Definition decay : Q := 0.1.", "Definition decay : Q := 0.2."),
        "a longer T2": text.replace("T2 := 0.4;", "T2 := 0.5;"),
        "a shorter T1": text.replace("T1 := 0.1;", "T1 := 0.01;"),
        "another entry of P": scaled(text, "controls := [[[", 0.5),
        "a jump in P": scaled(text, "width := 0.3; controls := [[[", 1.001),
        "another gain": scaled(text, "K := [[", 0.5),
        "another sign of C": text.replace("C := [[1; 0]]", "C := [[(-1); 0]]"),
        "a negative scale": re.sub(r"scales := \[\[([\d.]+)", r"scales := [[(-\1)", text, count=1),
        "a steeper f": text.replace("M22 := [[(-2)]]", "M22 := [[(-1)]]"),
        "a premise less": text.replace("size 0%nat 0 = 0 -> (forall i r", "(forall i r"),
    }
    for what, changed in false.items():
        assert changed != text, what
        accepted, said = compiled(library, changed)
        assert not accepted, what
        assert "Error" in said
        assert "Syntax" not in said
