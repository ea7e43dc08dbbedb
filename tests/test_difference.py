"""`diff`: what changed from one result file to another."""

import json
import shutil
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from support.commands import run


@pytest.fixture(autouse=True)
def here(made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(made / "cart.yaml", tmp_path)
    shutil.copy(made / "cart.gains.json", tmp_path / "old.json")


def solved(*changes, code=0):
    options = [part for change in changes for part in ("--set", change)]
    assert run("solve", "cart.yaml", "-q", "-o", "new.json", *options).exit_code == code


def difference():
    outcome = run("diff", "old.json", "new.json", "--json")
    assert outcome.exit_code == 0
    return json.loads(outcome.stdout)


def test_the_same_is_no_difference():
    solved()
    nothing = {key: [] for key in ("solver", "spec", "gains", "guarantee", "notes")}
    assert difference() == {"status": ["certified", "certified"], **nothing}
    assert run("diff", "old.json", "new.json").stdout.split() == ["status", "certified"]


def test_spec_gains_and_guarantee_are_told():
    solved("observer.alpha=0.05", "observer.bounds={L1: 30}", "simulation.seed=3")
    old, new = (json.loads(Path(name).read_text()) for name in ("old.json", "new.json"))
    found = difference()
    assert found["spec"] == [
        {"path": "observer.alpha", "old": "0.1", "new": "0.05"},
        {"path": "observer.bounds.L1", "old": "40", "new": "30"},
        {"path": "simulation.seed", "old": None, "new": "3"},
    ]
    gain = {one["name"]: one for one in found["gains"]}["L1"]
    L1 = [np.array(file["observer"]["L1"]) for file in (old, new)]
    assert gain["old"] == pytest.approx(np.linalg.norm(L1[0], 2), rel=1e-12)
    assert gain["relative"] == pytest.approx(np.linalg.norm(L1[1] - L1[0], 2) / gain["old"], rel=1e-12)
    gamma = {one["name"]: one for one in found["guarantee"]}["gamma"]
    assert [gamma["old"], gamma["new"]] == [file["guarantee"]["gamma"] for file in (old, new)]
    assert gamma["relative"] == pytest.approx(gamma["new"] / gamma["old"] - 1, rel=1e-9)
    text = run("diff", "old.json", "new.json").stdout
    assert "observer.alpha: 0.1 -> 0.05" in text
    assert "simulation.seed: nothing -> 3" in text


def test_a_result_without_gains_is_told_too():
    solved("system.C=[[0, 0]]", "nonlinearities=[]", "system.A=[[0, 1], [0, 1]]", code=3)
    found = difference()
    assert found["status"] == ["certified", "infeasible"]
    assert {k: v for k, v in found["guarantee"][0].items() if k in {"name", "new"}} == {"name": "gamma", "new": None}
    assert all(one["new"] is None and one["relative"] is None for one in found["gains"])
    assert run("diff", "old.json", "new.json").stdout.startswith("status     certified -> infeasible")


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda file: file["spec"].update(text="obsdesign: 1"), "the spec in the file was altered"),
        (lambda file: file["observer"].update(L1=[["1e999"]]), "is no finite number"),
        (lambda file: file["observer"].update(L1=[[1], [1, 2]]), "expected a 2x1 matrix"),
        (lambda file: file["guarantee"].update(gamma="1/0"), "is no finite number"),
        (lambda file: file.update(status="\x1b[31m"), "texts of one line"),
        (lambda file: file["observer"].update(L1=[[10**400], [1]]), "observer.L1: is beyond what doubles can hold"),
        (
            lambda file: file["observer"].update(L1=[["1.5e308"], ["1.5e308"]]),
            "observer.L1: is beyond what doubles can",
        ),
        (lambda file: file["guarantee"].update(gamma=10**400), "guarantee.gamma: is beyond what doubles can hold"),
    ],
)
def test_a_file_that_is_wrong_is_refused(change, word):
    file = json.loads(Path("old.json").read_text())
    change(file)
    Path("new.json").write_text(json.dumps(file))
    outcome = run("diff", "old.json", "new.json")
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert word in outcome.stderr
    assert run("diff", "old.json", "cart.yaml").exit_code == 2


def test_a_change_beyond_doubles_has_no_part():
    file = json.loads(Path("old.json").read_text())
    file["guarantee"]["gamma"] = 1e-320
    Path("new.json").write_text(json.dumps(file))
    outcome = run("diff", "new.json", "old.json", "--json")
    assert outcome.exit_code == 0, outcome.output
    (change,) = (one for one in json.loads(outcome.stdout)["guarantee"] if one["name"] == "gamma")
    assert change["relative"] is None


def test_another_solver_is_told_with_its_own_version():
    Path("small.yaml").write_text(
        "obsdesign: 1\nsystem: {A: [[0, 1], [-2, -3]], C: [1, 0]}\nobserver: {type: l2, alpha: 0.3, bounds: {L1: 9}}\n"
    )
    for name, solver in (("old.json", "clarabel"), ("new.json", "scs")):
        assert run("solve", "small.yaml", "-q", "-o", name, "--solver", solver).exit_code == 0
    assert json.loads(Path("new.json").read_text())["solver"]["version"] == version("scs")
    assert difference()["solver"] == [
        {"name": "name", "old": "clarabel", "new": "scs"},
        {"name": "version", "old": version("clarabel"), "new": version("scs")},
    ]
    assert "name: clarabel -> scs" in run("diff", "old.json", "new.json").stdout


def test_a_change_has_its_sign_and_rounding_is_none():
    solved("observer.bounds={L1: 20}")
    gain = {one["name"]: one for one in difference()["gains"]}["L1"]
    (line,) = (row for row in run("diff", "old.json", "new.json").stdout.splitlines() if "|L1|" in row)
    assert gain["new"] < gain["old"]
    assert f"({100 * (gain['new'] / gain['old'] - 1):+.3g} %, the difference is" in line
    file = json.loads(Path("old.json").read_text())
    file["observer"]["L1"] = [[x * (1 + 1e-12) for x in row] for row in file["observer"]["L1"]]
    file["guarantee"]["gamma"] *= 1 - 1e-12
    Path("new.json").write_text(json.dumps(file))
    assert (difference()["gains"], difference()["guarantee"]) == ([], [])


def test_gains_of_other_sizes_have_norms_and_no_difference():
    solved("system.C=[[1, 0], [0, 1]]")
    gain = {one["name"]: one for one in difference()["gains"]}["L1"]
    assert (gain["relative"], gain["old"] > 0, gain["new"] > 0) == (None, True, True)
    (line,) = (row for row in run("diff", "old.json", "new.json").stdout.splitlines() if "|L1|" in row)
    assert line.endswith(f"|L1| {gain['old']:.6g} -> {gain['new']:.6g}")


def test_equations_of_a_guarantee_are_no_numbers():
    assert run("init", "a", "--plant", "converter", "--family", "kkl").exit_code == 0
    for name, G in (("old.json", "0.0447"), ("new.json", "0.05")):
        assert run("solve", "a.yaml", "-q", "-o", name, "--set", f"parameters.G={G}").exit_code == 0
    assert json.loads(Path("old.json").read_text())["guarantee"]["coordinates"][1]["phi"][:1].isdigit()
    assert run("diff", "old.json", "old.json").stdout.split() == ["status", "certified"]
    assert [one["name"] for one in difference()["guarantee"]] == ["rates.xi1", "coordinates[0].lambda"]


SMALL = "obsdesign: 1\nsystem: {A: [[0, 1], [-2, -3]], B: [0, 1], C: [1, 0]}\nobserver: %s\n"
OF_NORMS = {
    "energy": "{type: l2, alpha: 0.3, bounds: {L1: 9}}",
    "peak": "{type: linf, alpha: 0.3, bounds: {L1: 9}}",
    "sampled": "{type: sporadic, T1: 0.05, T2: 0.1, delta: 9}",
}


def test_gammas_that_bound_different_norms_are_told_so():
    for name, observer in OF_NORMS.items():
        Path(f"{name}.yaml").write_text(SMALL % observer)
        assert run("solve", f"{name}.yaml", "-q", "-o", f"{name}.json").exit_code == 0
    energy, peak = "the energy norm2(z)", "the peak sup|z|"
    for old, new, norms in (
        ("energy", "peak", (energy, peak)),
        ("peak", "sampled", (peak, energy)),
        ("energy", "sampled", None),
        ("peak", "peak", None),
    ):
        files = f"{old}.json", f"{new}.json"
        told = json.loads(run("diff", *files, "--json").stdout)["notes"]
        assert bool(told) == bool(norms)
        shown = [line for line in run("diff", *files).stdout.splitlines() if line.startswith("note")]
        assert [line.split(maxsplit=1)[1] for line in shown] == told
        for said in told:
            start = f"these gammas bound different norms, {norms[0]} and {norms[1]}: "
            assert said.startswith(start)
