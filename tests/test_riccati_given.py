"""Riccati equations where gains are given, and for Lipschitz constants, of large plants."""

import json
import re

import numpy as np
import pytest
import yaml
from support.rods import chain, rod_spec

import obsdesign as od
from obsdesign.dissipation.claim import best_claim
from obsdesign.dissipation.engine import Engine
from obsdesign.families.incremental.request import posed
from obsdesign.families.lipschitz import stretch
from obsdesign.families.lipschitz.design import design
from obsdesign.families.lipschitz.relaxations import S_PROCEDURE, proportions
from obsdesign.families.lipschitz.request import request_of
from obsdesign.families.lipschitz.suprema import largest_constant
from obsdesign.lmi.formula import in_floats

LIPSCHITZ = "{type: lipschitz, objective: min-gamma, decay: 0.02}"


def lipschitz(text, constant, observer=LIPSCHITZ):
    """Spec of a large plant with a Lipschitz constant in place of a slope."""
    text = re.sub(r"type: \{slope: [^}]*\}", f"type: {{lipschitz: {constant}}}", text)
    return od.load(text[: text.rindex("observer:")] + f"observer: {observer}\n")


@pytest.mark.parametrize(
    ("name", "known"),
    [
        ("abbaszadeh2010-polynomial", 1.379311),
        ("abbaszadeh2010-flexible-joint", 0.9997543),
        ("abbaszadeh2010-flexible-joint-attenuation", 11.5988107),
        ("abbaszadeh2010-flexible-joint-structured", np.inf),
    ],
)
def test_the_largest_constant_is_the_least_supply_of_f(name, known, monkeypatch):
    """For the sizes in which matrix inequalities find it as well: they are told by both, and both say the same."""
    spec = od.load(f"specs/{name}.yaml")
    request = request_of(spec)
    shares = proportions(request.lipschitz)
    unit = S_PROCEDURE[request.pace].of(spec.posed, spec.multiplier, shares, spec.H, request.rates[0])
    by_inequalities = largest_constant(Engine(), unit, "s-procedure")
    monkeypatch.setattr(stretch, "LARGE", 1)
    engine = Engine()
    found = largest_constant(engine, unit, "s-procedure")
    assert found.value == pytest.approx(known, rel=1e-6)
    assert found.value == pytest.approx(by_inequalities.value, rel=1e-6)
    assert found.attained == by_inequalities.attained
    assert engine.solves == 0


def full(n, seed=0):
    """Spec with any f of all states, two of them measured, and its largest constant asked for."""
    rng = np.random.default_rng(seed)
    A, C = (rng.normal(size=(n, n)) / np.sqrt(n) - np.eye(n)).round(3), np.eye(n)[:2]
    told = "nonlinearities:\n  - {type: {lipschitz: 0.1}}\nobserver: {type: lipschitz, decay: 0.02}\n"
    return f"obsdesign: 1\nname: full\nsystem: {{A: {A.tolist()}, C: {C.tolist()}}}\n{told}"


@pytest.mark.parametrize("noise", [False, True])
def test_a_large_plant_has_its_largest_constant_and_a_proof_of_nearly_that(noise):
    text = full(12)
    if noise:
        B, D = np.hstack([np.ones((12, 1)), np.zeros((12, 2))]), np.hstack([np.zeros((2, 1)), 0.1 * np.eye(2)])
        text = text.replace(", C: ", f", B: {B.tolist()}, D: {D.tolist()}, C: ")
    engine = Engine()
    made = design(od.load(text), engine)
    assert made.claim.holds
    assert (engine.method, engine.solves) == ("riccati", 0)
    proved = float(made.claim.lipschitz)
    assert 0.94 * made.limit["lipschitz"] < proved < made.limit["lipschitz"] <= made.beyond["ceiling"]
    said = "the gain is the central one" if noise else "by descent from the central one"
    assert any(said in note for note in made.notes)


@pytest.mark.parametrize(
    ("springs", "gamma"), [((0,), 0.225348), pytest.param((0, 1), 0.242599, marks=pytest.mark.slow)]
)
def test_a_large_lipschitz_plant_has_its_limit_and_gains_that_are_proved(springs, gamma):
    made = od.solve(lipschitz(chain(12, springs=springs), 1))
    assert made.proved
    assert made.verify().holds
    assert made.limit["gamma"] == pytest.approx(gamma, rel=1e-3)
    assert made.limit["gap"] < 3e-5
    guarantee = made.result["guarantee"]
    assert guarantee["gamma"] <= 1.05 * made.limit["gamma"] * (1 + 1e-5)
    assert guarantee["admissible"] > guarantee["lipschitz"]
    assert made.result["solver"]["engine"] == "riccati"


@pytest.mark.parametrize("told", ["type: l2, alpha: 0.02", "type: linf, alpha: 0.05"])
@pytest.mark.parametrize("plant", [rod_spec, pytest.param(chain, marks=pytest.mark.slow)])
def test_given_gains_of_a_large_plant_are_proved_without_inequalities(plant, told):
    text = plant(12)
    text = text[: text.rindex("observer:")]
    made = od.solve(od.load(f"{text}observer: {{{told}}}\n"))
    gains = {name: L.tolist() for name, L in made.gains.items() if L.size}
    again = od.solve(od.load(text + "observer: " + json.dumps({**yaml.safe_load(f"{{{told}}}"), "gains": gains})))
    assert again.proved
    assert again.result["solver"]["solves"] == 0
    limit, gamma = made.limit["gamma"], again.result["guarantee"]["gamma"]
    assert limit <= gamma <= made.result["guarantee"]["gamma"]


def test_the_gamma_of_given_gains_is_that_of_the_inequalities(monkeypatch):
    family = posed(od.load(rod_spec(12)))
    family = type(family)(family.plant, family.multiplier, family.H, family.rate, -3 * family.plant.C.T, family.L2)
    _, found = best_claim(Engine(), family)
    monkeypatch.setattr("obsdesign.dissipation.claim.LARGE", 99)
    _, other = best_claim(Engine(), family)
    assert found.holds
    assert float(found.gamma) == pytest.approx(float(other.gamma), rel=2e-4)
    assert in_floats(found.family).L1 is not None
