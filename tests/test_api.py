"""The Python API: one import designs, verifies and simulates; it is light, and its errors say what the command says."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.commands import run as command
from support.forging import scaled

import obsdesign as od

PENDULUM = Path(__file__).parent.parent / "specs" / "pendulum.yaml"
HEAVY = ("numpy", "scipy", "flint", "yaml", "pydantic", "clarabel", "cvxpy", "matplotlib", "typer")


def pendulum():
    """The plant and the request of specs/pendulum.yaml, from arrays."""
    return od.Spec(
        system={
            "states": ["angle", "speed"],
            "outputs": ["y_angle", "y_speed"],
            "A": np.array([[0, 1], [0, -1]]),
            "B": np.array([[0], [1]]),
            "C": np.eye(2),
            "D": np.array([0, 0.5]),
        },
        nonlinearities=[{"f": "sin(q)", "type": {"lipschitz": 1}, "Bf": np.array([0, -1]), "Cq": np.array([1, 0])}],
        disturbance="integrator",
        performance="all",
        observer={"type": "l2", "alpha": 0.15, "bounds": {"L1": 5}},
        simulation={"horizon": 20, "x0": np.array([1.2, 0]), "w": ["where(t < 8, 0.4, 0.4 + 0.5*(1 - exp(8 - t)))"]},
    )


@pytest.fixture(scope="module")
def design():
    """Its design."""
    return od.solve(pendulum())


def test_a_notebook_designs_verifies_and_simulates_the_pendulum(tmp_path):
    # a spec, from arrays or from the text of a file
    spec = pendulum()
    known = od.load(PENDULUM.read_text())
    assert (spec.plant.A == known.plant.A).all()
    assert spec.simulation.w == known.simulation.w
    assert [finding.name for finding in od.check(spec) if finding.decides and not finding.holds] == []
    (block,) = od.lipschitz(spec)["blocks"]
    assert (block["declared"], block["lower"], block["upper"], block["proved"]) == (1, 1, 1, True)

    # a design, the same as that of the file
    design = od.solve(spec)
    assert design.status == "certified"
    assert design.limit_bounded["gamma"] == pytest.approx(0.32224, rel=1e-3)
    assert design.gains.keys() == {"L1", "L2"}
    assert np.linalg.norm(design.gains["L1"], 2) <= 5
    np.testing.assert_array_equal(design.gains["L1"], od.solve(known).gains["L1"])
    assert "gamma" in str(design)
    assert "gamma" in design._repr_html_()

    # its proof, by itself and from a file
    assert design.verify().holds
    design.save(tmp_path / "pendulum.gains.json")
    proof = od.verify(tmp_path / "pendulum.gains.json")
    assert proof.holds
    assert all(check.holds for check in proof.checks)
    assert f"gamma {design.guarantee.gamma:g}" in proof.claim
    again = od.read(tmp_path / "pendulum.gains.json")
    assert again.result == design.result
    assert {name for name, _ in design.table()} - {name for name, _ in again.table()} == {"limit", "within bounds"}
    assert set(again.table()) <= set(design.table())  # what is proved anew

    # runs, as the spec says and otherwise
    run = design.simulate()
    assert run.t[-1] == 20
    assert run["hat_angle"][-1] == pytest.approx(run["angle"][-1], abs=0.02)
    assert run["hat_w1"][-1] == pytest.approx(0.9, abs=0.02)
    assert all(bound["holds"] for bound in run.summary["bounds"])
    longer = again.simulate(horizon=40, x0=[-2, 1])
    assert longer.summary["final_error"] < 0.1 * longer.summary["initial_error"]


def test_the_public_names_are_all_there():
    assert od.__all__ == sorted(od.__all__)
    assert {name for names in od.HOMES.values() for name in names} == set(od.__all__)
    assert set(dir(od)) == {*od.__all__, "__version__"}
    for name in od.__all__:
        assert getattr(od, name).__doc__
    with pytest.raises(AttributeError, match="no attribute 'sovle'"):
        getattr(od, "sovle")  # noqa: B009


def test_the_import_is_light():
    code = f"import sys, obsdesign; print(*[name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "\n"


# Errors


def said(use):
    """Message of the error that a call raises."""
    with pytest.raises(od.ObsdesignError) as caught:
        use()
    return type(caught.value), str(caught.value)


def test_every_error_is_one_of_ours():
    errors = [getattr(od, name) for name in od.__all__ if name.endswith("Error")]
    assert {error.exit_code for error in errors if error is not od.ObsdesignError} == {2, 3, 4}
    assert all(issubclass(error, od.ObsdesignError) for error in errors)


@pytest.mark.parametrize(
    ("old", "new"),
    [("alpha: 0.15", "alpha: fast"), ("type: l2", "type: l3"), ("  bounds: {L1: 5}\n", ""), ("D: [0, 0.5]", "D: [0]")],
)
@pytest.mark.usefixtures("here")
def test_a_wrong_spec_is_answered_as_by_the_command(old, new):
    text = PENDULUM.read_text().replace(old, new)
    Path("spec.yaml").write_text(text)
    outcome = command("solve", "spec.yaml", "-q")
    kind, message = said(lambda: od.solve(od.load("spec.yaml")))
    assert (kind, outcome.exit_code) == (od.UsageError, 2)
    assert outcome.stderr.strip().removeprefix("error: ") == message.strip()


@pytest.mark.usefixtures("here")
def test_a_file_that_is_missing_is_answered_as_by_the_command():
    for use, verb in ((od.load, "solve"), (od.verify, "verify")):
        kind, message = said(lambda use=use: use("nothing.here"))
        assert kind is od.UsageError
        assert message in command(verb, "nothing.here").stderr


@pytest.mark.usefixtures("here")
def test_a_forged_file_is_not_proved(design):
    forged = scaled(json.loads(json.dumps(design.result)), ("certificate", "P"), -1)
    Path("forged.json").write_text(json.dumps(forged))
    proof = od.verify("forged.json")
    assert not proof.holds
    failed = [check.name for check in proof.checks if not check.holds]
    assert failed
    outcome = command("verify", "forged.json")
    assert outcome.exit_code == 4
    assert all(name in outcome.stdout for name in failed)
    forged = scaled(json.loads(json.dumps(design.result)), ("guarantee", "limit_bounded", "gamma"), 2)
    Path("forged.json").write_text(json.dumps(forged))
    kind, message = said(lambda: od.verify("forged.json"))
    assert kind is od.UsageError
    assert message in command("verify", "forged.json").stderr


@pytest.mark.usefixtures("here")
def test_a_file_belongs_to_its_spec(design):
    design.save("pendulum.gains.json")
    assert od.verify("pendulum.gains.json", design.spec).holds
    for use in (od.verify, od.read):
        assert "belong to another spec" in said(lambda use=use: use("pendulum.gains.json", od.load(PENDULUM)))[1]


@pytest.mark.usefixtures("here")
def test_what_is_saved_is_what_the_command_writes():
    assert command("solve", PENDULUM, "-o", "command.json", "-q").exit_code == 0
    od.solve(od.load(os.fspath(PENDULUM))).save("api.json")
    results = [json.loads(Path(name).read_text()) for name in ("command.json", "api.json")]
    for result in results:
        del result["created"], result["solver"]["time_s"]
    assert results[0] == results[1]
    kind, message = said(lambda: od.read("api.json").save("absent/api.json"))
    assert (kind, message) == (od.UsageError, "absent/api.json: cannot be written: No such file or directory [OBS902]")


def test_a_wrong_change_of_a_run_is_answered_by_its_key(design):
    kind, message = said(lambda: design.simulate(horizen=3))
    assert kind is od.UsageError
    assert "simulation.horizen: unknown key horizen; did you mean horizon?" in message


def test_an_infeasible_spec_is_an_answer():
    spec = od.Spec(system={"A": [[1, 0], [0, -1]], "B": [1, 1], "C": [0, 1]}, observer={"type": "l2", "alpha": 0.1})
    design = od.solve(spec)
    assert (design.status, design.gains) == ("infeasible", {})
    assert "is not seen" in design.diagnosis["reason"]
    assert design.diagnosis["reason"] in said(design.simulate)[1]
    assert any("x1" in finding.sentence for finding in od.check(spec) if finding.decides and not finding.holds)


def test_the_lipschitz_constant_in_other_coordinates():
    spec = od.Spec(
        system={"A": -np.eye(2), "C": [1, 0]},
        nonlinearities=[{"f": ["0", "4*sin(q1)"], "type": {"lipschitz": 4}, "Bf": np.eye(2), "Cq": np.eye(2)}],
        observer={"type": "lipschitz", "decay": 0.1},
    )
    assert od.lipschitz(spec)["blocks"][0]["upper"] == 4
    assert "scaling" not in od.lipschitz(spec)
    other = od.lipschitz(spec, T=[4, 1])["scaling"]
    assert (other["identity"]["upper"], other["scaled"]["T"], other["scaled"]["upper"]) == (4, [4, 1], 1)
    assert od.lipschitz(spec, scaling=True)["scaling"]["scaled"]["upper"] < 1
    assert "T" in said(lambda: od.lipschitz(spec, T=[1, 2, 3]))[1]


@pytest.mark.usefixtures("here")
def test_what_a_forged_file_says_is_not_shown_of_its_design(design):
    content = json.loads(design.text())
    content["guarantee"]["gamma"] /= 10
    content["guarantee"]["mu2"] /= 100
    content["guarantee"]["statement"] = content["guarantee"]["statement"].replace(
        repr(design.guarantee.gamma), repr(content["guarantee"]["gamma"])
    )
    content["guarantee"]["limit_bounded"] = {"gamma": 1e-12}
    content["notes"] = ["proved for every f"]
    Path("forged.gains.json").write_text(json.dumps(content))
    forged = od.read("forged.gains.json")
    assert (forged.status, forged.guarantee) == ("uncertified", None)
    assert forged.simulate(horizon=1).summary["bounds"] == []
    for shown in (str(forged), forged._repr_html_()):
        assert "uncertified" in shown
        assert "NOT PROVED" in shown
        assert "1e-12" not in shown
        assert "for every f" not in shown
    assert forged.result == content


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("key", "value"),
    [("created", "1" * 5000), ("solver", "[]"), ("tool", "{}")],
)
def test_a_file_with_strange_entries_is_shown_as_far_as_it_is_proved(design, key, value):
    text = design.text().decode()
    old = json.dumps(json.loads(text)[key], ensure_ascii=False) if key in json.loads(text) else None
    if old is None or f'"{key}": {old}' not in text:
        text = text.replace('"status"', f'"{key}": {value}, "status"', 1)
    else:
        text = text.replace(f'"{key}": {old}', f'"{key}": {value}', 1)
    Path("strange.gains.json").write_text(text)
    read = od.read("strange.gains.json")
    assert read.status == "certified"
    assert str(read).splitlines()[1].split() == ["status", "certified"]
    assert read.verify().holds


@pytest.mark.filterwarnings("ignore:.*:RuntimeWarning")  # numpy's, of the gates before the design
def test_numbers_beyond_doubles_are_no_file(tmp_path):
    spec = od.Spec(system={"A": [[-1e160]], "B": [1], "C": [1e160], "D": [1]}, observer={"type": "l2", "alpha": 0.1})
    with pytest.raises(od.ObsdesignError):
        od.solve(spec).save(tmp_path / "x.gains.json")
    assert list(tmp_path.iterdir()) == []


def test_a_number_of_very_many_digits_is_refused():
    with pytest.raises(od.UsageError, match="digits"):
        od.Spec(system={"A": [[10**5000]], "C": [1]}, observer={"type": "l2"})


@pytest.mark.parametrize("call", [od.solve, od.check, od.lipschitz])
def test_what_is_no_spec_is_refused(call):
    with pytest.raises(od.UsageError, match="a spec is expected, not str"):
        call("pendulum.yaml")


def test_a_prompt_is_not_flooded(design):
    for shown in (repr(design), repr(design.spec), repr(design.simulate(horizon=1))):
        assert len(shown) < 100
        assert "\n" not in shown


def test_what_was_proved_of_gains_is_not_said_of_others(design):
    with pytest.raises(ValueError, match="read-only"):
        design.gains["L1"][0, 0] = 0
    with pytest.raises(TypeError):
        design.gains["L1"] = np.zeros((3, 2))


def test_a_claim_of_another_plant_bounds_no_run():
    system = {"A": [[0, 1], [-1, -1]], "B": [1, 1], "C": [1, 0], "D": [0.2]}
    f = [{"f": "5*sin(q)", "type": {"lipschitz": 5}, "Bf": [0, 1], "Cq": [0, 1]}]
    design = od.solve(
        od.Spec(
            system=system,
            nonlinearities=f,
            observer={"type": "lipschitz", "bounds": {"L": 20}},
            simulation={"horizon": 1, "x0": [1, 0]},
        )
    )
    assert (design.status, design.claim.holds, design.guarantee) == ("certified", True, None)
    summary = design.simulate().summary
    assert (summary["bounds"], summary["gamma"]) == ([], None)
    assert summary["bounds_omitted"] == "no guarantee: nothing is proved of these gains with this plant"
