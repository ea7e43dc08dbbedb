"""What `check` says of plants in discrete time, and that nothing of continuous time is said of their designs."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from support.commands import run
from support.page import read
from support.samples import text

import obsdesign as od
from obsdesign.families.outcome import Verdict
from obsdesign.reading import loads

pytestmark = pytest.mark.usefixtures("here")

SCALAR = {"time": "discrete", "A": [[0.5]], "B": [[0.1]], "C": [[1]]}


def findings(spec):
    """Findings of a spec, by their names."""
    return {f.name: f for f in od.check(spec)}


def asked(system, blocks=(), **observer):
    """Spec of a system in samples."""
    parts = {"nonlinearities": list(blocks)} if blocks else {}
    return od.Spec(system={"time": "discrete", **system}, **parts, observer={"type": "l2", **observer})


def lipschitz(constant, n, **matrices):
    """Unstructured f, of every state through every state."""
    return {"type": {"lipschitz": constant}, "Bf": np.eye(n), "Cq": np.eye(n), **matrices}


@pytest.mark.parametrize(
    ("mode", "rho", "seen"), [(1.1, 0.95, False), (1.1, 1, False), (0.97, 0.95, False), (0.94, 0.95, True)]
)
def test_a_hidden_mode_has_to_be_inside_the_circle_of_radius_rho(mode, rho, seen):
    system = {"A": [[0.9, 0], [0, mode]], "B": [[0.1], [0.1]], "C": [[1, 0]]}
    found = findings(asked(system, rho=rho))
    assert found["detectability"].holds == seen
    if not seen:
        said = f"the mode lambda = {mode:g} along x2 (1.00) is not seen by any output, and it is outside |lambda| = rho"
        assert found["detectability"].sentence == f"{said} = {rho:g}"
    least = f"detectability limits rho to at least {mode:g}" if mode < 1 else "no rho < 1 can be had: a mode"
    assert found["decay"].sentence.startswith(least)
    assert od.solve(asked(system, rho=rho)).status is (Verdict.CERTIFIED if seen else Verdict.INFEASIBLE)


def test_nothing_is_said_of_arbitrary_accuracy_and_the_floor_is():
    spec = loads(text("K1", "type: l2, rho: .95"))
    found = findings(spec)
    assert not [name for name in found if "accuracy" in name or name == "rank B"]
    floor = found["floor of gamma"].numbers["floor"]
    assert floor == pytest.approx(np.hypot(0.1, 0.2) / 0.95)  # D shows w2 only, so that no L1 acts on what w1 does
    assert floor < od.solve(spec).limit["gamma"]


@pytest.mark.parametrize(
    ("kind", "rho", "factor"), [("l2", 0.9, 0.9), ("linf", 0.6, 0.8), ("linf", "{min: .28, max: .9, points: 5}", 0.96)]
)
def test_the_floor_is_below_the_limit_and_what_is_asked_below_it_fails(kind, rho, factor):
    """A scalar plant with a = 0, in which dead beat reaches the floor of l2: b / rho."""
    plant = "obsdesign: 1\nsystem: {time: discrete, A: 0, B: [[.3, 0]], C: 1, D: [[0, 1]]}\n"
    told = f"observer: {{type: {kind}, rho: {rho}%s}}\n"
    found = findings(loads(plant + told % ""))["floor of gamma"]
    assert found.holds
    assert found.numbers["floor"] == pytest.approx(0.3 / factor)
    limit = od.solve(loads(plant + told % "")).limit["gamma"]
    assert limit >= found.numbers["floor"] * (1 - 1e-6)
    assert kind == "linf" or limit == pytest.approx(0.3 / factor, rel=1e-6)
    below = findings(loads(plant + told % ", objective: {gamma: 0.2}"))["floor of gamma"]
    assert not below.stands
    assert "and gamma = 0.2 was asked for" in below.sentence


def test_there_is_no_floor_where_L1_undoes_v_or_f_is_not_zero():
    system = {"A": [[0.5]], "B": [[1]], "C": [[1]], "D": [[1]]}
    assert "floor of gamma" not in findings(asked(system))  # L1 = -1
    slope = {"type": {"slope": [0.1, 0.2]}, "Bf": [[1]], "Cq": [[1]]}
    assert "floor of gamma" not in findings(asked(SCALAR, [slope]))


@pytest.mark.parametrize("n", [1, 2])
@pytest.mark.parametrize(("constant", "rho", "possible"), [(1.01, 1, False), (0.99, 1, True), (0.8, 0.7, False)])
def test_an_unstructured_f_is_no_larger_than_rho(n, constant, rho, possible):
    system = {"A": 0.5 * np.eye(n), "B": np.full((n, 1), 0.1), "C": np.eye(n)}
    spec = asked(system, [lipschitz(constant, n)], rho=rho)
    found = findings(spec)
    assert ("width" in found) != possible
    if not possible:
        assert not found["width"].stands
        assert found["width"].numbers == {}
        assert f"may be {constant:g} times as large in the next sample whatever L1" in found["width"].sentence
        assert ("say by Bf and Cq" in found["width"].advice) == (n > 1)
        made = od.solve(spec)
        assert made.status is Verdict.INFEASIBLE
        assert made.diagnosis["id"] == "OBS618"
        assert made.diagnosis["value"] == pytest.approx(constant)
    for way in ({"L2": "free"}, {"L2": -np.eye(n)}, {"estimate": "filtered"}):
        assert "width" not in findings(asked(system, [lipschitz(constant, n)], rho=rho, **way))


def test_the_ways_out_lead_out():
    spec = {"rho": 1}
    assert od.solve(asked(SCALAR, [lipschitz(1.01, 1)], **spec)).status is Verdict.INFEASIBLE
    for way in ({"L2": "free"}, {"L2": [[-1]]}, {"estimate": "filtered"}):
        assert od.solve(asked(SCALAR, [lipschitz(1.01, 1)], **spec, **way)).status is Verdict.CERTIFIED, way


def test_a_free_L2_takes_only_what_y_shows():
    system = {"A": [[0.5, 0.1], [0, 0.5]], "B": [[0.1], [0.1]], "C": [[1, 0]]}
    assert "width" in findings(asked(system, [lipschitz(1.01, 2)], L2="free"))
    shown = {"type": {"lipschitz": 1.01}, "Bf": [[1], [0]], "Cq": [[1, 0]]}
    assert "width" not in findings(asked(system, [shown], L2="free"))
    assert "width" in findings(asked(system, [shown], L2=0))


@pytest.mark.parametrize(("slope", "id"), [(17.9, None), (18.5, "OBS602"), (19.1, "OBS618")])
def test_a_slope_is_too_wide_by_half_of_it(slope, id):
    """[P] Feasible iff k < 4 + sqrt(196.5) = 18.0178; the width alone gives k <= 2 rho / .1 = 19."""
    system = {"A": [[0.9, 0.1], [0, 0.8]], "C": [[1, 0]], "B": [[0.1], [0.1]]}
    block = {"type": {"slope": [0, slope]}, "Bf": [[0], [-0.1]], "Cq": [[0, 1]]}
    spec = asked(system, [block], rho=0.95)
    made = od.solve(spec)
    assert ("width" in findings(spec)) == (id == "OBS618")
    assert made.diagnosis.get("id") == id or (id == "OBS602" and made.status is Verdict.INFEASIBLE)


@pytest.mark.parametrize(("slope", "possible"), [(0.158, True), (0.162, False)])
def test_the_edge_of_a_hidden_mode_is_that_of_the_page(slope, possible):
    """A = diag(.5, .8), C = [1 0], f on x2 with slope [0, k], rho = .96: feasible iff k < .16."""
    system = {"A": [[0.5, 0], [0, 0.8]], "C": [[1, 0]], "B": [[0.1], [0.1]]}
    block = {"type": {"slope": [0, slope]}, "Bf": [[0], [1]], "Cq": [[0, 1]]}
    spec = asked(system, [block], rho=0.96)
    assert all(f.stands for f in od.check(spec)) == possible
    assert od.solve(spec).status is (Verdict.CERTIFIED if possible else Verdict.INFEASIBLE)


def test_a_steep_f_that_acts_in_the_next_sample_only_has_no_observer():
    system = {"A": [[0.9, 0.1], [0, 0.8]], "C": [[1, 0]], "B": [[0.1], [0.1]]}
    block = {"type": "monotone", "Bf": [[0], [-0.1]], "Cq": [[0, 1]]}
    for observer in ({"L2": 0}, {"L2": "free"}, {"rho": 0.9}):
        spec = asked(system, [block], **observer)
        assert not findings(spec)["explicit"].stands
        assert "implicit Euler" in findings(spec)["explicit"].advice
        assert od.solve(spec).diagnosis["id"] == "OBS605"


def test_a_steep_f_that_L1_cancels_hides_a_mode_and_an_L2_brings_it_back():
    """The bearing K8, filtered: with L2 = 0, L1 has to cancel f, and nothing shows x3 then."""
    spec = loads(text("K8", "type: l2, rho: .95, estimate: filtered, L2: 0"))
    found = findings(spec)["explicit"]
    assert "L1 has to cancel it, after which the mode lambda = 1 along x3 (1.00) is not seen" in found.sentence
    assert od.solve(spec).diagnosis["condition"] == "explicit"
    good = loads(text("K8", "type: l2, rho: .95, estimate: filtered, L2: [[0, -3]]"))
    assert all(f.stands for f in od.check(good))


@pytest.mark.parametrize(
    ("plant", "observer"),
    [
        ("K1", "type: l2, rho: .95"),
        ("K3", "type: l2, alpha: .2"),
        ("K4", "type: l2, rho: 1"),
        ("K8", "type: l2, rho: .95, estimate: filtered, L2: free"),
        ("Q1", "type: linf, rho: {min: .5, max: .95, points: 5}"),
        ("R1", "type: l2, rho: {min: .9, max: 1, points: 3}, objective: pareto"),
        ("R1", "type: l2, rho: {min: .1, max: 1}, objective: max-alpha"),
        ("K8", "type: l2, rho: .95"),
        ("R1", "type: l2, rho: .9, objective: {gamma: 0.01}"),
        ("K1", "type: l2, rho: .95, gains: {L1: [[0], [0], [0]], L2: [[0], [0]]}"),
    ],
)
def test_nothing_of_continuous_time_is_said_of_a_design_in_samples(plant, observer):
    Path("spec.yaml").write_text(text(plant, observer))
    printed = [run(*command).output for command in (("check", "spec.yaml"), ("solve", "spec.yaml", "--plot"))]
    content = json.loads(Path("spec.gains.json").read_text())
    sentences = [*content.get("notes", []), str(content.get("guarantee", {}).get("statement", ""))]
    sentences += [str(content.get("diagnosis", {}).get(key, "")) for key in ("reason", "suggestion")]
    run("report", "spec.gains.json", "-o", "spec.html")
    body = next(read(Path("spec.html").read_text()).all("main"))
    shown = body.text.replace(content["spec"]["text"], "")
    found = [each["sentence"] for each in json.loads(run("check", "spec.yaml", "--json").stdout)["findings"]]
    for said in (*printed, *sentences, *found, shown):
        assert not re.search(r"\b1/s\b|Runge|Theorem \d|\bx'|\bV'|largest step|integral|exp\(", said), said
    assert "fastest" not in content.get("observer", {})
    assert "largest_step" not in content.get("analysis", {})


def test_the_table_tells_rho_alpha_and_time_constants():
    Path("spec.yaml").write_text(text("K3", "type: l2, alpha: .2"))
    table = run("solve", "spec.yaml").stdout
    made = json.loads(Path("spec.gains.json").read_text())
    assert re.search(r"^rho +0\.980199 a sample: \|e_k\| <= c rho\^k \|e_0\| without a disturbance$", table, re.M)
    assert re.search(r"^alpha +0\.2 per second ", table, re.M)
    sizes = np.abs([complex(*pole) for pole in made["observer"]["poles"]])
    slow, fast = -0.1 / np.log([sizes.max(), sizes.min()])
    assert re.search(rf"^time constants +{slow:.3g} s to {fast:.3g} s ", table, re.M)
    assert re.search(r"^worst pole +\S+, \|pole\| = 0\.\d+ ", table, re.M)


def test_the_problem_of_a_report_is_written_in_samples():
    Path("spec.yaml").write_text(text("K3", "type: l2, rho: .98"))
    run("solve", "spec.yaml", "-q")
    assert run("report", "spec.gains.json", "-o", "spec.html").exit_code == 0
    page = Path("spec.html").read_text()
    assert "<msup><mi>x</mi><mo>+</mo></msup>" in page
    assert "<msup><msub><mi>x</mi><mi>m</mi></msub><mo>+</mo></msup>" in page
    assert "˙" not in page


def test_the_curve_of_a_search_is_over_rho():
    Path("spec.yaml").write_text(text("Q1", "type: linf, rho: {min: .5, max: .95, points: 4}"))
    assert run("solve", "spec.yaml", "--plot").exit_code == 0
    made = json.loads(Path("spec.gains.json").read_text())
    assert made["search"]["parameter"] == "rho"
    assert all("rho" in point for point in made["search"]["points"])
    assert Path("spec.curve.png").stat().st_size > 1000
