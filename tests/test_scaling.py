"""The units in which a problem is solved are told in `solver.scaling`; nothing that is proved depends on them."""

import json
from pathlib import Path

import pytest
from support.commands import run

SPEC = """
obsdesign: 1
system: {{A: [[0, {A12!r}], [{A21!r}, {A22!r}]], B: [[0, 0], [{B2!r}, 0]], C: [[{C1!r}, 0]]{D}}}
nonlinearities: [{{type: {{lipschitz: 0.5}}, Bf: [[0], [{B2!r}]], Cq: [[1, 0]]}}]
performance: {{H: [[1, 0], [0, {H2!r}]]}}
observer: {{{observer}}}
"""
FAMILIES = {
    "l2": "type: l2, L2: 0, alpha: {rate!r}",
    "linf": "type: linf, L2: 0, alpha: {rate!r}",
    "lipschitz": "type: lipschitz, objective: min-gamma, decay: {rate!r}",
    "sporadic": "type: sporadic, T1: {T1!r}, T2: {T2!r}, decay: {rate!r}, delta: {delta!r}",
}


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def solved(family, state, time, output):
    """Result with the second state, time and the output in such units."""
    rate, times = 0.1 * time, {"T1": 0.1 / time, "T2": 0.2 / time, "delta": 3.0 * time}
    A = {"A12": time / state, "A21": -2.0 * time * state, "A22": -1.0 * time}
    D = "" if family == "sporadic" else f", D: [[0, {0.2 * output!r}]]"
    parts = {**A, "B2": time * state, "C1": output, "D": D, "H2": 0.5 / state}
    observer = FAMILIES[family].format(rate=rate, **times)
    Path("spec.yaml").write_text(SPEC.format(**parts, observer=observer))
    outcome = run("solve", "spec.yaml", "-q")
    assert outcome.exit_code == 0, outcome.output
    return json.loads(Path("spec.gains.json").read_text())


@pytest.mark.parametrize("family", FAMILIES)
def test_other_units_of_a_plant_are_told_as_the_units_that_it_is_solved_in(family):
    near, far = (solved(family, 2.0**k, 2.0**10, 2.0**-k) for k in (20, 30))
    before, after = (made["solver"]["scaling"] for made in (near, far))
    assert before.keys() == {"states", "outputs", "disturbances", "time"}
    assert after["time"] == before["time"] < 2.0**-5
    assert after["states"] == [before["states"][0], 2.0**10 * before["states"][1]]
    assert 0.5 <= 2.0**10 * after["outputs"][0] / before["outputs"][0] <= 2  # of two factors, each of which is rounded
    assert after["disturbances"] == before["disturbances"]
    assert far["guarantee"]["gamma"] == pytest.approx(near["guarantee"]["gamma"], rel=1e-3)


def test_units_of_a_relaxation_that_states_two_inequalities_are_told(monkeypatch):
    monkeypatch.setitem(FAMILIES, "norm-bound", f"relaxation: norm-bound, {FAMILIES['lipschitz']}")
    before, after = (solved("norm-bound", 1.0, time, 1.0)["solver"]["scaling"] for time in (1.0, 2.0**-10))
    assert after["time"] == 2.0**10 * before["time"]
    assert (after["states"], len(after["disturbances"])) == (before["states"], 2)


def test_units_that_fit_already_are_not_told():
    assert "scaling" not in solved("sporadic", 1.0, 1.0, 1.0)["solver"]


@pytest.mark.parametrize("family", ["l2", "sporadic"])
def test_what_is_proved_does_not_depend_on_them(family):
    content = solved(family, 2.0**20, 2.0**10, 1.0)
    assert "solver.scaling" in content["numerical"]
    said = run("verify", "spec.gains.json").stdout.splitlines()[-1]
    content["solver"]["scaling"] = {"states": "whatever"}
    Path("other.gains.json").write_text(json.dumps(content))
    outcome = run("verify", "other.gains.json")
    assert (outcome.exit_code, outcome.stdout.splitlines()[-1]) == (0, said)
    content["numerical"].remove("solver.scaling")
    Path("other.gains.json").write_text(json.dumps(content))
    outcome = run("verify", "other.gains.json")
    assert outcome.exit_code == 2
    assert "numerical: does not name solver.scaling, which is not proved" in outcome.stderr
