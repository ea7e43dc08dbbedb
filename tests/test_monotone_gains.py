"""Gains of large plants with monotone f: the equality P Bf = T exactly, and agreement with the inequalities."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from flint import fmpq
from support.rods import chain

import obsdesign as od
from obsdesign.dissipation.bounds import NO_BOUNDS
from obsdesign.dissipation.elimination import array, least_gamma
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.equality import tied
from obsdesign.dissipation.monotone import proved_monotone, unseparated
from obsdesign.families.incremental import design
from obsdesign.families.incremental.request import posed
from obsdesign.lmi.formula import in_floats, rational, rational_number
from obsdesign.riccati.form import UnclearError
from obsdesign.riccati.passive import gains
from obsdesign.riccati.silent import SilentBarrier, untied

SLOW = pytest.mark.slow
DAMPED = {"springs": (), "dampers": (0,)}
TIED = {"springs": (), "joints": ((0, 0.5), (1, 0.3)), "measured": (0, 1, 2)}
PLANTS = {
    "two dampers": {"springs": (), "dampers": (0, 2)},
    "a damper and a spring": {"springs": (1,), "dampers": (0,)},
    "dampers that share a mass": TIED,
}


def equality(certificate):
    """P Bf + (Cq + L2 C)' M12 for the f whose (f, f) vanishes, in rationals."""
    family = certificate.family
    _, M12, M22 = family.multiplier.matrix(certificate.multipliers)
    silent = ~M22.any(axis=1)
    assert silent.any()
    plant = family.plant
    return (certificate.P @ plant.Bf + (plant.Cq + family.L2 @ plant.C).T @ M12)[:, silent]


def by_riccati(made):
    """Whether the notes say that the gain is the central one, or comes from it."""
    return sum("central one of a Riccati equation" in note for note in made.notes) == 1


@pytest.mark.parametrize("n", [24, pytest.param(64, marks=SLOW)])
def test_a_damped_chain_is_certified_without_inequalities(n):
    made = od.solve(od.load(chain(n, **DAMPED)))
    assert made.proved
    assert made.verify().holds
    assert made.limit["gamma"] == pytest.approx(50 / 9, rel=1e-5)
    assert made.result["guarantee"]["gamma"] == pytest.approx(1.05 * 50 / 9, rel=1e-5)
    assert made.result["solver"]["solves"] == 0
    assert by_riccati(made)
    assert not equality(made.claim.certificate).any()


@pytest.mark.parametrize(
    "plant", [pytest.param("two dampers", marks=SLOW), "a damper and a spring", "dampers that share a mass"]
)
def test_gains_agree_with_inequalities_and_are_smaller(plant, monkeypatch):
    spec = od.load(chain(8, **PLANTS[plant]))
    monkeypatch.setattr(design, "LARGE", 8)
    made = od.solve(spec)
    engine = Engine()
    engine.eliminates = False
    other = design.design(spec, engine)
    assert by_riccati(made)
    assert not equality(made.claim.certificate).any()
    assert made.proved
    assert other.claim.holds
    assert made.limit["gamma"] == pytest.approx(other.limit["gamma"], rel=1e-5)
    assert made.result["guarantee"]["gamma"] == pytest.approx(float(other.claim.certificate.gamma), rel=1e-5)
    assert np.linalg.norm(made.gains["L1"], 2) < np.linalg.norm(other.gains["L1"], 2)


@pytest.fixture(scope="module")
def solved():
    """Design of a large plant with a damper and a spring of unknown laws."""
    return od.solve(od.load(chain(12, **PLANTS["a damper and a spring"])))


@SLOW
def test_given_gains_are_certified_without_inequalities():
    text = chain(12, **DAMPED)
    gain = od.solve(od.load(text)).gains["L1"].tolist()
    spec = od.load(text.replace("alpha: 0.02", f"alpha: 0.02, gains: {{L1: {gain}}}"))
    made = od.solve(spec)
    engine = Engine()
    engine.eliminates = False
    other = design.design(spec, engine)
    assert made.proved
    assert made.result["solver"]["solves"] == 0
    assert not equality(made.claim.certificate).any()
    assert float(made.claim.certificate.gamma) == pytest.approx(float(other.claim.certificate.gamma), rel=1e-3)


@pytest.mark.parametrize("place", [(6, 6), (2, 6)])
def test_a_last_digit_of_p_that_f_sees_is_refused(solved, place, tmp_path):
    """The inequality has room for far more, and the equality has none."""
    content = json.loads(solved.text())
    P, (i, j) = content["certificate"]["P"], place
    P[i][j] = P[j][i] = str(rational_number(P[i][j]) + fmpq(1, 10**12))
    path = tmp_path / "forged.gains.json"
    path.write_text(json.dumps(content))
    failed = [check.name for check in od.verify(path).checks if not check.holds]
    assert failed == [solved.claim.certificate.theorem.about.decrease]


def test_proofs_do_not_depend_on_the_units_of_x(solved):
    family = posed(od.load(chain(12, **PLANTS["a damper and a spring"])))
    s = rational(2.0 ** np.random.default_rng(0).integers(-20, 20, 12))
    p = family.plant
    scaled = replace(p, A=p.A * s[:, None] / s, Bf=p.Bf * s[:, None], B=p.B * s[:, None], Cq=p.Cq / s, C=p.C / s)
    there = replace(family, plant=scaled, H=family.H / s)
    certificate, _ = proved_monotone(Engine(), there, 1.05 * solved.limit["gamma"], NO_BOUNDS)
    assert certificate.holds
    assert not equality(certificate).any()
    assert float(certificate.gamma) == pytest.approx(solved.result["guarantee"]["gamma"], rel=1e-5)
    limit = math.sqrt(least_gamma(Engine(), in_floats(there)).objective)
    assert limit == pytest.approx(solved.limit["gamma"], rel=1e-5)


@pytest.mark.parametrize("change", ["peak", "free L2", "f in y", "v in its argument"])
def test_other_plants_are_left_to_the_inequalities(change):
    assert unseparated(in_floats(posed(od.load(chain(8, **DAMPED))))) is not None
    family = in_floats(posed(od.load(chain(8, type="linf" if change == "peak" else "l2", **DAMPED))))
    if change == "free L2":
        family = replace(family, L2=None)
    acts = {"f in y": {"Df": np.ones((2, 1))}, "v in its argument": {"Dq": np.ones((1, 3))}}
    family = replace(family, plant=replace(family.plant, **acts.get(change, {})))
    assert unseparated(family) is None


@pytest.mark.parametrize("plant", ["a damper and a spring", "dampers that share a mass"])
def test_the_gradient_of_the_barrier_is_that_of_its_differences(plant):
    problem = in_floats(posed(od.load(chain(8, **PLANTS[plant]))))
    answer = least_gamma(Engine(), problem)
    form, mu, nf = unseparated(problem), 1.1 * answer.objective, problem.plant.Bf.shape[1]
    central, known = next(gains(form, nf, array(answer.values), problem.rate, mu))
    free, scales, ties = untied(form, nf, known)
    assert ties @ scales == pytest.approx(known)
    barrier = SilentBarrier(free.noisy(np.full(8, 0.01), np.zeros(len(form.C))), mu, None, nf)
    at = barrier.at(central.L, scales)
    rng = np.random.default_rng(0)
    for _ in range(3):
        gain = 1e-5 * rng.normal(size=central.L.shape) * central.L
        scale = 1e-5 * rng.normal(size=len(scales)) * scales
        more, less = (barrier.at(central.L + sign * gain, scales + sign * scale) for sign in (1, -1))
        slope = np.sum(at.by_gain * gain) + at.by_scales @ scale
        assert (more.value - less.value) / 2 == pytest.approx(slope, rel=1e-4)


def test_scales_are_tied_in_rationals():
    family = posed(od.load(chain(8, **TIED)))
    near = {"lambda1": rational([["1.5"]]), "lambda2": rational([["0.9000001"]])}
    exact = {name: scale.item() for name, scale in tied(family, near).items()}
    assert exact["lambda1"] * 3 == exact["lambda2"] * 5
    assert list(tied(posed(od.load(chain(8, **DAMPED))), {"lambda1": near["lambda1"]})) == ["lambda1"]


def test_where_a_descent_is_not_clear_the_central_gain_is_shipped(monkeypatch):
    def unclear(*_):
        raise UnclearError("numbers far from each other")

    monkeypatch.setattr("obsdesign.dissipation.monotone.untied", unclear)
    made = od.solve(od.load(chain(12, **DAMPED)))
    assert made.proved
    assert sum("the gain is the central one" in note for note in made.notes) == 1
