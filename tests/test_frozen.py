"""Frozen members of a class that hide a mode: no observer exists, and that is proved, in every family."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flint import fmpq
from support.commands import run
from support.sweep import SWEEP

from obsdesign.lmi.formula import in_floats
from obsdesign.model.edge import Edge
from obsdesign.model.frozen import hidden, proved
from obsdesign.model.structure import undetectable
from obsdesign.reading import loads

pytestmark = pytest.mark.usefixtures("here")

SEEN_BUT_FOR_ONE_SLOPE = """
obsdesign: 1
name: x2 is not seen at the slope -1
system: {A: [[-1, 1], [0, 0.1]], B: [1, 0], C: [1, 0]}
nonlinearities:
  - {type: {lipschitz: 1.5}, Bf: [1, 0], Cq: [0, 1]}
observer: %s
"""
FAMILIES = {
    "l2": "{type: l2, L2: 0, alpha: 0.01}",
    "l2, free L2": "{type: l2, L2: free, alpha: 0.01}",
    "l2, range": "{type: l2, L2: 0, alpha: {min: 0.01, max: 3, points: 4}}",
    "l2, given gains": "{type: l2, alpha: 0.01, gains: {L1: [-3, 0], L2: 0}}",
    "linf": "{type: linf, L2: 0, alpha: 0.01}",
    "lipschitz": "{type: lipschitz, objective: min-gamma, decay: 0.01}",
    "sporadic": "{type: sporadic, T1: 0.1, T2: 0.2, decay: 0.01}",
}
PLANTS = {  # A, C, Bf, Cq of each nonlinearity, its type, and lambda
    "an irrational lambda and slope": (
        "[[-1, 1, 0], [0, 0, 1], [0, 1.3, -0.7]]", "[1, 0, 0]", ["[1, 0, 0.2]", "[0, 1, 0.3]"], ["{slope: [-2, 3]}"],
        0.755667,
    ),
    "a complex mode at a vertex": (
        "[[-1, 0, 0], [0, 0, 1], [0, -4, 0.2]]", "[1, 0, 0]", ["[0, 0, 1]", "[0, 0, 1]"], ["tanh"], 0.6 + 1.9079j,
    ),
    "a matrix of a Lipschitz function": (
        "[[-1, 1], [0, -0.2]]", "[1, 0]", ["[[1, 0], [0, 1]]", "[[1, 0], [0, 1]]"], ["{lipschitz: 2}"], None,
    ),
    "two nonlinearities and one output": (
        "[[-1, 1, 0], [0, 0.1, 0], [0, 1.3, -0.7]]", "[1, 0, 0]", ["[1, 0, 0.1]", "[0, 1, 0.2]"] * 2, ["sin", "sat"],
        None,
    ),
    "a corner of a polytope": (
        "[[-1, 0], [0, -1]]", "[1, 0]", ["[[1, 0], [0, 1]]", "[[1, 0], [0, 1]]"],
        ["{jacobian: [[[0, 0], [0, 0]], [[1, 1], [0, 2]], [[0, 0], [0, 3]]]}"], 2,
    ),
    "a one-sided Lipschitz function": (
        "[[-1, 1], [0, 0.1]]", "[1, 0]", ["[1, 0]", "[0, 1]"], ["{one-sided-lipschitz: {rho: 1, beta: 2, phi: 0}}"],
        0.1,
    ),
}  # fmt: skip


def spec_of(A, C, through, types, alpha=0.05):
    blocks = "\n".join(
        f"  - {{type: {kind}, Bf: {Bf}, Cq: {Cq}}}"
        for kind, Bf, Cq in zip(types, through[::2], through[1::2], strict=True)
    )
    zeros = [0] * (C.count(",") + 1)
    return (
        f"obsdesign: 1\nname: hidden\nsystem: {{A: {A}, B: {[1, *zeros[1:]]}, C: {C}}}\nnonlinearities:\n{blocks}\n"
        f"observer: {{type: l2, L2: 0, alpha: {alpha}, objective: feasibility}}\n"
    )


def solved(text):
    Path("hidden.yaml").write_text(text)
    outcome = run("solve", "hidden.yaml", "-q")
    assert (outcome.exit_code, outcome.stdout) == (3, ""), outcome.output
    return json.loads(Path("hidden.gains.json").read_text())["diagnosis"]


@pytest.mark.parametrize("observer", FAMILIES.values(), ids=FAMILIES)
def test_a_slope_at_which_a_mode_is_hidden_is_named_and_proved_by_every_family(observer):
    found = solved(SEEN_BUT_FOR_ONE_SLOPE % observer)
    assert (found["condition"], found["proof"], found["slopes"]) == ("detectability", "exact", {"f1": -1})
    assert found["mode"] == {"eigenvalue": [pytest.approx(0.1), 0], "eigenvector": {"x2": [1, 0]}}
    assert found["reason"].startswith("at the slope -1 of f1, which the types allow, the mode lambda = 0.1 along x2")
    again = run("verify", "hidden.gains.json")
    assert again.exit_code == 0
    assert "no solution: at the slope -1 of f1" in again.stdout
    checked = run("check", "hidden.yaml")
    assert checked.exit_code == 3
    assert "at the slope -1 of f1" in checked.stdout


@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
def test_members_of_every_kind_of_class_are_found_and_proved(plant):
    *parts, value = plant
    found = solved(spec_of(*parts))
    real, imaginary = found["mode"]["eigenvalue"]
    assert real > 0
    if value is not None:
        assert complex(real, imaginary) == pytest.approx(value, abs=1e-4)
    assert (found["condition"], found["proof"]) == ("detectability", "exact")
    assert run("verify", "hidden.gains.json", "-q").exit_code == 0
    spec = loads(Path("hidden.yaml").read_text())
    K = np.zeros(spec.multiplier.member.shape)
    row = column = 0
    for block, slope in zip(spec.multiplier.blocks, found["slopes"].values(), strict=True):
        K[row : row + block.nf, column : column + block.nq] = slope
        row, column = row + block.nf, column + block.nq
    seen = undetectable(spec.augmented.doubles, K, Edge(0.0))
    assert any(abs(m.eigenvalue - complex(real, imaginary)) < 1e-6 for m in seen)


@pytest.mark.parametrize("plant", PLANTS.values(), ids=PLANTS)
def test_units_of_the_states_do_not_decide_whether_a_member_is_found(plant):
    spec = loads(spec_of(*plant[:-1]))
    p, units = spec.augmented, np.array([fmpq(10) ** k for k in (9, -6, 2)[: spec.augmented.n]], dtype=object)
    A, B, Bf = (units[:, None] * X for X in (p.A / units, p.B, p.Bf))
    scaled = replace(p, A=A, B=B, Bf=Bf, C=p.C / units, Cq=p.Cq / units)
    for posed in (p, scaled):
        assert hidden(posed, spec.multiplier, Edge(fmpq(1, 20))) is not None


def test_what_the_class_does_not_contain_proves_nothing():
    solved(SEEN_BUT_FOR_ONE_SLOPE % FAMILIES["l2"])
    content = json.loads(Path("hidden.gains.json").read_text())
    for members, code in (
        ({"f1": [["0"]]}, 4),  # in the class, and nothing is hidden
        ({"f1": [["-2"]]}, 4),  # not in the class
        ({"f1": [["-1"]]}, 0),
        ({"f1": [["-1", "0"]]}, 2),
        ({}, 2),
    ):
        content["diagnosis"]["certificate"]["members"] = members
        Path("forged.json").write_text(json.dumps(content))
        assert run("verify", "forged.json", "-q").exit_code == code


def test_a_rate_below_that_of_the_hidden_mode_is_not_ruled_out():
    stable = (SEEN_BUT_FOR_ONE_SLOPE % "{type: l2, L2: 0, alpha: %s}").replace("0.1]]", "-0.5]]")
    found = solved(stable % "{min: 0.6, max: 2, points: 2}")
    assert found["feasible"]["alpha_below"] == pytest.approx(0.5)
    assert "alpha below 0.5 is necessary" in found["suggestion"]
    for alpha in ("0.4", "{min: 0.4, max: 2}"):
        spec = loads(stable % alpha)
        assert hidden(spec.augmented, spec.multiplier, Edge(fmpq(2, 5))) is None
        assert proved(spec.augmented, spec.multiplier, (None,), Edge(fmpq(2, 5))) is None


def test_certified_designs_have_no_member_that_hides_a_mode():
    rng, certified = np.random.default_rng(3), 0
    for _ in range(SWEEP.size(6)):
        A, Bf, Cq = (np.round(rng.normal(size=shape), 1).tolist() for shape in ((3, 3), (3,), (3,)))
        text = spec_of(str(A), "[1, 0, 0]", [str(Bf), str(Cq)], ["{slope: [-0.5, 0.5]}"], alpha=0.1)
        Path("random.yaml").write_text(text)
        code = run("solve", "random.yaml", "-q").exit_code
        spec = loads(text)
        found = hidden(spec.augmented, spec.multiplier, Edge(fmpq(1, 10)))
        certified += code == 0
        assert code == 3 if found else code in (0, 3)
        if found:
            modes = undetectable(spec.augmented.doubles, in_floats(found.member[0]), Edge(0.1))
            assert any(abs(m.eigenvalue - found.mode.eigenvalue) < 1e-6 for m in modes)
    assert certified


def test_a_mode_that_no_slope_shows_is_reported_once():
    Path("hidden.yaml").write_text((SEEN_BUT_FOR_ONE_SLOPE % FAMILIES["l2"]).replace("[[-1, 1]", "[[-1, 0]"))
    checked = run("check", "hidden.yaml")
    assert checked.exit_code == 3
    assert checked.stdout.count("the mode lambda = 0.1") == 1


EVERY = """
obsdesign: 1
name: x1 is seen at no slope
system: {A: [[1, 0], [0, -1]], B: [0, 1], C: [0, %s]}
nonlinearities: [{f: 0.5*sin(q), type: {slope: [-0.5, 0.5]}, Bf: %s, Cq: %s}]
observer: %s
"""


@pytest.mark.parametrize("observer", FAMILIES.values(), ids=FAMILIES)
@pytest.mark.parametrize(
    ("places", "said"),
    [
        (("1", "[0, 1]", "[0, 1]"), "whatever f is, the mode lambda = 1 along x1"),
        (("1", "[1, 0]", "[1, 0]"), "at every other member that was tried there is such a mode"),
    ],
)
def test_a_mode_that_is_hidden_at_every_slope_is_told_as_that(observer, places, said):
    observer = observer.replace("gains: {L1: [-3, 0], L2: 0}", "gains: {L1: [0, -3], L2: 0}")
    Path("every.yaml").write_text(EVERY % (*places, observer))
    outcome = run("solve", "every.yaml", "-o", "every.gains.json")
    assert outcome.exit_code == 3
    found = json.loads(Path("every.gains.json").read_text())["diagnosis"]
    assert said in found["reason"]
    assert "a measurement that shows it is needed" in found["suggestion"]
    assert "tighter" not in found["suggestion"]
    checked = run("check", "every.yaml")
    assert checked.exit_code == 3
    assert "with f = 0" in checked.stdout
