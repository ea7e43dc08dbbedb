"""Why a design is impossible: which reason is given, that it is right, and what is proved of it."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from flint import fmpq
from support.commands import run
from support.shipped import SPECS, shipped

from obsdesign.families.incremental.absence import absence, refuted
from obsdesign.families.incremental.extent import largest_class, reduced
from obsdesign.families.incremental.theorems import L2, THEOREMS
from obsdesign.lmi.formula import in_floats, rational, rational_number
from obsdesign.lmi.solve import Status, widest
from obsdesign.reading import loads
from obsdesign.work import solve

BEARING = (SPECS / "corless2019-magnetic-bearing.yaml").read_text().partition("observer:")[0]
CUBIC = """
obsdesign: 1
name: (47) of Chakrabarty et al. (2016)
system: {A: [[0, -1, 0], [0, -1, -1], [0, 1, -1]], B: [1, 0, 0], C: [1, 0, 0]}
nonlinearities:
  - {type: cubic, Bf: [0, 1, 0], Cq: [1, -1, 0]}
"""
PAIR = """
obsdesign: 1
name: x2 is not measured and f makes it unstable
system: {A: [[-1, 0], [0, -2]], B: [1, 0], C: [1, 0]}
nonlinearities:
  - {type: %s, Bf: [0, 1], Cq: [0, 1]}
observer: {type: l2, L2: 0, alpha: 0.5}
"""


def diagnosed(text, **request):
    lines = "".join(f"  {key}: {value}\n" for key, value in request.items())
    made = solve(loads(f"{text}observer:\n{lines}"))
    assert made.status == "infeasible"
    json.dumps(made.diagnosis, allow_nan=False)
    return made.diagnosis


def feasible(spec):
    """Whether the inequality of a spec has a solution with another multiplier."""
    r = spec.observer
    family = THEOREMS[r.type](spec.augmented, spec.multiplier, spec.H, r.rate, None, r.L2)

    def decide(multiplier):
        return widest(in_floats(replace(family, multiplier=multiplier)).feasible()).status is Status.OPTIMAL

    return decide


# nonlinearities without an upper slope bound


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("more", ["", ", D: [[1]]"])
@pytest.mark.parametrize(
    "asked", ["alpha: 0.1", "alpha: 0.1, objective: feasibility", "alpha: 1, objective: {gamma: 1}"]
)
def test_what_no_solver_decides_is_infeasible_where_that_is_proved(more, asked):
    """A larger gain pushes the infimum of the inequality to zero, where P Bf + lambda Cq' = 0 excludes P > 0."""
    system = f"system: {{A: [[-1]], B: [[1]], C: [[1]]{more}}}"
    block = "nonlinearities: [{type: monotone, Bf: [[1]], Cq: [[1]]}]"
    Path("steep.yaml").write_text(f"obsdesign: 1\n{system}\n{block}\nobserver: {{type: l2, L2: 0, {asked}}}\n")
    outcome = run("solve", "steep.yaml")
    assert outcome.exit_code == 3
    assert "that needs (Cq + L2 C) Bf < 0, and here that is 1" in outcome.stdout
    assert "ask for alpha" not in outcome.stdout  # the condition has no alpha in it
    proof = run("verify", "steep.gains.json")
    assert (proof.exit_code, "nor at a larger alpha" in proof.stdout) == (0, True)


@pytest.mark.parametrize("family", ["l2", "linf"])
@pytest.mark.parametrize("alpha", [0.01, 0.5, 1])
def test_the_cubic_example_without_injection_needs_l2_at_most_minus_alpha_and_alpha_at_most_one(family, alpha):
    found = diagnosed(CUBIC, type=family, L2=0, alpha=alpha, objective="feasibility")
    assert found["condition"] == "passivity"
    assert "that is L2 <= -alpha" in found["reason"]
    assert "alpha <= 1: the mode lambda = -1 along x3 remains" in found["reason"]
    assert found["feasible"]["L2_most"] == -alpha
    assert found["proof"] == "exact"


def test_what_the_diagnosis_of_the_cubic_example_calls_feasible_is():
    assert (
        solve(loads(f"{CUBIC}observer: {{type: linf, L2: -0.51, alpha: 0.5, objective: feasibility}}")).status
        == "certified"
    )
    assert (
        solve(loads(f"{CUBIC}observer: {{type: linf, L2: -1, alpha: 0.999, objective: feasibility}}")).status
        == "certified"
    )


@pytest.mark.parametrize("injection", [-2, "free"])
def test_a_mode_of_the_zero_dynamics_limits_alpha_whatever_the_gains(injection):
    found = diagnosed(CUBIC, type="linf", L2=injection, alpha=1.5, objective="feasibility")
    assert found["condition"] == "zero dynamics"
    assert found["feasible"]["alpha"] == pytest.approx(1)
    assert found["mode"] == {"eigenvalue": [-1, 0], "eigenvector": {"x3": [1, 0]}}
    assert found["proof"] == ("numerical" if injection == "free" else "exact")


def test_the_bearing_without_injection_is_not_passive_and_that_is_proved():
    found = diagnosed(BEARING, type="l2", L2=0, alpha=0.71)
    assert (found["condition"], found["value"], found["proof"]) == ("passivity", 0, "exact")
    spec = loads(f"{BEARING}observer: {{type: l2, L2: 0, alpha: 0.71}}\n")
    family = L2(
        spec.augmented, spec.multiplier, spec.H, rational_number(found["certificate"]["alpha"]), None, spec.observer.L2
    )
    multipliers = {name: rational(rows) for name, rows in found["certificate"]["multipliers"].items()}
    assert refuted(family, None, multipliers).holds
    assert not refuted(replace(family, L2=rational([[0, -110]])), None, multipliers).holds


# gammas that are out of reach


def test_a_gamma_below_the_limit_of_the_bearing_is_answered_with_the_rank_that_fails():
    found = diagnosed(BEARING, type="l2", L2="[[0, -110]]", alpha=0.71, objective="{gamma: 0.01}")
    assert found["feasible"]["gamma"] == pytest.approx(0.0153161, rel=1e-4)
    assert "D Cm Bm" in found["reason"]
    assert "has rank 1 and must have 2" in found["reason"]
    assert [(test["rank"], test["needed"]) for test in found["accuracy"]] == [(1, 2)]
    assert (found["proof"], found["certificate"]["gamma"]) == ("exact", "1/100")
    assert "zeros" not in found


def test_beyond_the_zero_of_the_bearing_the_zero_is_named():
    found = diagnosed(BEARING, type="l2", L2="[[0, -110]]", alpha=12, objective="{gamma: 0.05}")
    assert found["zeros"] == [[pytest.approx(-10), 0]]
    assert "the zero at lambda = -10 of v to y is no faster than alpha = 12" in found["reason"]
    slower = float(re.search(r"alpha at most ([0-9.]+), with which there is one$", found["suggestion"])[1])
    assert 9 < slower < 10
    reached = f"{BEARING}observer: {{type: l2, L2: [[0, -110]], alpha: {slower}, objective: {{gamma: 0.05}}}}\n"
    assert solve(loads(reached)).status == "certified"


def test_an_unstable_zero_is_named():
    found = solve(shipped("infeasible/unstable-zero")).diagnosis
    assert "a zero in the right half plane at lambda = 1.64575" in found["reason"]
    assert found["accuracy"][0]["zeros"] == [[pytest.approx(math.sqrt(7) - 1), 0]]


def test_a_bound_that_is_too_tight_is_not_claimed_to_be_proved():
    spec = loads(f"{BEARING}observer: {{type: l2, L2: 0, alpha: 0.71}}\n")
    family = L2(spec.augmented, spec.multiplier, spec.H, spec.observer.rate, None, spec.observer.L2)
    assert absence(family, {})["proof"] == "exact"
    assert absence(family, {"bounds": "no gain within the bounds"}) == {"proof": "numerical"}


# the largest class


@pytest.mark.parametrize(
    ("declared", "expected"),
    [
        ("{lipschitz: 4}", {"lipschitz": 1.5}),
        ("{slope: [0, 7]}", {"slope": [0, 1.5]}),
        ("{slope: [1, 7]}", {"slope": [1, 1.5]}),
        ("monotone", {"slope": [0, 1.5]}),
    ],
)
def test_the_largest_class_is_that_of_the_slopes_that_leave_the_decay(declared, expected):
    # x2' = -2 x2 + f(x2) and y shows x1 only: alpha = 1/2 needs slopes below 3/2
    spec = loads(PAIR % declared)
    found = largest_class(spec, feasible(spec))
    assert found["nonlinearity"] == 1
    (name, value), *_ = found["feasible"].items()
    assert name == next(iter(expected))
    assert value == pytest.approx(expected[name], rel=2e-3, abs=1e-6)
    assert max(value if isinstance(value, list) else [value]) < 1.5  # within the class, in the few digits that are told


def test_the_nonlinearity_that_can_be_blamed_is_named():
    second = "  - {type: {lipschitz: 0.1}, Bf: [1, 0], Cq: [1, 0]}\nobserver:"
    spec = loads((PAIR % "{lipschitz: 4}").replace("observer:", second))
    found = largest_class(spec, feasible(spec))
    assert found == {"nonlinearity": 1, "feasible": {"lipschitz": pytest.approx(1.4985, rel=2e-4)}}


def test_no_class_helps_where_a_mode_is_hidden():
    spec = loads((PAIR % "{lipschitz: 4}").replace("[0, -2]", "[0, 1]"))
    assert largest_class(spec, feasible(spec)) == {}


@pytest.mark.parametrize(
    ("declared", "slopes"),
    [
        ("{slope: [1, 7]}", (1, fmpq(5, 2))),
        ("{slope: [-2, 6]}", (fmpq(-1, 2), fmpq(3, 2))),
        ("{slope: [-6, -2]}", (-3, -2)),
        ("{lipschitz: 8}", (-2, 2)),
        ("monotone", (0, 2500)),
    ],
)
def test_a_quarter_of_a_class_is_a_quarter_of_its_slopes_about_the_member(declared, slopes):
    (block,) = loads(PAIR % declared).multiplier.blocks
    part = reduced(block, 0.25)
    for k in slopes:
        assert part.M11.item() + 2 * k * part.M12.item() + k * k * part.M22.item() == 0
    between = (slopes[0] + slopes[1]) / fmpq(2)
    assert part.M11.item() + 2 * between * part.M12.item() + between**2 * part.M22.item() > 0
