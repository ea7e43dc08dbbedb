"""The search over the scales of multipliers by Riccati equations: known limits, and agreement with the inequalities."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from support.rods import beam, chain, heat, noises, random_family, written

import obsdesign as od
from obsdesign.dissipation import gain
from obsdesign.dissipation.elimination import form_of, least_gamma, least_of
from obsdesign.dissipation.engine import Engine
from obsdesign.families.incremental.request import posed
from obsdesign.families.incremental.theorems import theorem
from obsdesign.lmi.formula import in_floats
from obsdesign.lmi.solve import Status
from obsdesign.model.multiplier import Multiplier, Scaled
from obsdesign.riccati.form import UnclearError
from obsdesign.riccati.least import least
from obsdesign.riccati.peak import least_peak, least_peak_scaled
from obsdesign.riccati.scaled import least_scaled

SLOW = pytest.mark.slow
LARGEST = [pytest.mark.slow, pytest.mark.sweep]
KNOWN = [  # by another program, and in part by matrix inequalities
    pytest.param(chain(4), 0.2251135, id="chain 4"),
    pytest.param(chain(8), 0.2253533, id="chain 8"),
    pytest.param(chain(16), 0.2253467, id="chain 16"),
    pytest.param(chain(32), 0.2253434, id="chain 32", marks=SLOW),
    pytest.param(chain(64), 0.232418, id="chain 64", marks=SLOW),
    pytest.param(chain(8, springs=(0, 1, 3)), 0.2685344, id="three springs"),
    pytest.param(heat(12), 0.0359169, id="heat 12"),
    pytest.param(heat(32), 0.0353804, id="heat 32", marks=SLOW),
    pytest.param(heat(128), 0.0352372, id="heat 128", marks=SLOW),
    pytest.param(heat(256), 0.0352298, id="heat 256", marks=LARGEST),
    pytest.param(beam(8), 0.2725422, id="beam 8"),
    pytest.param(beam(12), 0.4721457, id="beam 12"),
    pytest.param(beam(16), 0.480687, id="beam 16"),
    pytest.param(beam(64), 0.962, id="beam 64", marks=SLOW),
    pytest.param(chain(8, type="linf", alpha=0.05), 1.733928, id="peak of chain 8"),
    pytest.param(chain(32, type="linf", alpha=0.05), 1.733820, id="peak of chain 32"),
    pytest.param(chain(64, type="linf", alpha=0.05), 1.733810, id="peak of chain 64", marks=SLOW),
]
PEAK = theorem("linf", sampled=False)


def in_doubles(text):
    """Family of a spec in doubles."""
    return in_floats(posed(od.load(text)))


@pytest.mark.parametrize(("text", "known"), KNOWN)
def test_large_plants_have_their_limits(text, known):
    family = in_doubles(text)
    found, values = least_of(form_of(family), family)
    assert math.sqrt(found.mu) == pytest.approx(known, rel=1e-5)
    assert found.gap < 3e-5
    assert min(values.values()) > 0


def as_peak(family):
    """Same plant in linf."""
    return PEAK(family.plant, family.multiplier, family.H, family.rate, None, family.L2)


@pytest.mark.parametrize("name", ["l2", "linf"])
@pytest.mark.parametrize(("seeds", "least"), [(range(7), 2), pytest.param(range(100, 120), 9, marks=SLOW)])
def test_random_plants_have_the_limits_of_the_inequalities(name, seeds, least):
    """No limit where those are infeasible, and none below theirs."""
    compared = 0
    for seed in seeds:
        family = random_family(seed) if name == "l2" else as_peak(random_family(seed))
        answer = Engine().minimise(family.least_gamma())
        try:
            found, _ = least_of(form_of(family), family)
        except UnclearError:
            continue
        assert answer.status is not Status.INFEASIBLE
        if answer.status is Status.OPTIMAL:
            theirs = answer.objective
            if found.mu < theirs * (1 - 1e-4):  # a solver's optimum may be as wrong: at its scales an equation tells
                theirs = least_at(answer, family)
            assert math.sqrt(found.mu) == pytest.approx(math.sqrt(theirs), rel=5e-5)
            compared += 1
    assert compared >= least


def least_at(answer, family):
    """Least mu at the scales of an optimum."""
    form, shares = form_of(family), 1 if family.about.peak else answer.objective
    names = [unknown.name for unknown in family.multiplier.unknowns()]
    scaled = form.scaled(np.array([answer.values[name].item() for name in names]) * shares / answer.objective)
    return (least_peak(scaled, family.H) if family.about.peak else least(scaled)).mu


def test_no_scales_have_a_gamma_below_the_bound():
    form = form_of(in_doubles(chain(8, springs=(0, 1, 3))))
    found, scales = least_scaled(form)
    rng = np.random.default_rng(0)
    for _ in range(8):
        other = least(form.scaled(scales * np.exp(0.3 * rng.normal(size=3))))
        assert other.mu >= found.lower
    assert least(form.scaled(scales)).mu == pytest.approx(found.mu, rel=1e-5)


def test_no_scales_have_a_peak_below_the_bound():
    family = in_doubles(chain(8, springs=(0, 1, 3), type="linf"))
    form = form_of(family)
    found, scales = least_peak_scaled(form, family.H)
    rng = np.random.default_rng(0)
    for size in (0.1, 0.1, 0.3, 0.3, 1, 1):
        other = least_peak(form.scaled(scales / found.mu * np.exp(size * rng.normal(size=3))), family.H)
        assert other.mu >= found.lower
    assert least_peak(form.scaled(scales / found.mu), family.H).mu == pytest.approx(found.mu, rel=1e-7)


@pytest.mark.parametrize(("told", "known"), [({}, 0.2253533), ({"type": "linf", "alpha": 0.05}, 1.733928)])
def test_the_limit_does_not_depend_on_units_of_states_and_of_f(told, known):
    family = in_doubles(chain(8, **told))
    p, S = family.plant, np.diag(10.0 ** np.array([3, -2, 0, 1, 2, 4, -3, 0]))
    back = np.linalg.inv(S)
    plant = replace(p, A=S @ p.A @ back, Bf=1e-4 * S @ p.Bf, B=S @ p.B, C=p.C @ back, Cq=1e3 * p.Cq @ back)
    blocks = tuple(Scaled(b.member, 1e2 * b.M11, b.M12, b.M22) for b in family.multiplier.scaled_blocks())
    other = replace(family, plant=plant, H=family.H @ back, multiplier=Multiplier(blocks))
    found, _ = least_of(form_of(other), other)
    assert math.sqrt(found.mu) == pytest.approx(known, rel=1e-5)


@pytest.mark.parametrize(
    ("told", "known", "gain"), [({}, 0.2253467, 192), ({"type": "linf", "alpha": 0.05}, 1.7338655, 10)]
)
def test_a_design_of_a_large_plant_is_proved(told, known, gain):
    """Its gain is not larger than the smallest that inequalities find, 191.5 and 11."""
    made = od.solve(od.load(chain(16, **told)))
    assert made.proved
    assert made.verify().holds
    assert made.limit["gamma"] == pytest.approx(known, rel=1e-5)
    assert made.limit["gap"] < 3e-5
    solver = made.result["solver"]
    assert (solver["engine"], solver["solves"]) == ("riccati", 0)
    assert np.linalg.norm(made.gains["L1"], 2) < gain
    assert any("by descent from the central one" in note for note in made.notes)


@pytest.mark.slow
def test_where_axis_and_storage_bind_at_once_a_gain_is_proved():
    made = od.solve(od.load(chain(64)))
    assert made.proved
    assert made.limit["gamma"] == pytest.approx(0.232418, rel=1e-5)
    assert made.result["solver"]["solves"] == 0
    assert np.linalg.norm(made.gains["L1"], 2) < 180  # of the central one: 233


def test_what_the_search_does_not_find_the_inequalities_decide():
    """No scales have a solution, or doubles do not tell."""
    found = {}
    for seed in range(7):
        family = random_family(seed)
        if least_gamma(Engine(), family, smallest=0) is None:
            answer = gain.within(Engine(), family)
            assert answer.gap is None
            found[answer.status] = seed
    assert found


def in_units(family, units):
    """Family whose f are in other units: Bf times these, and M so that the class is the same."""
    units = np.resize(units, family.plant.Bf.shape[1])
    blocks = zip(family.multiplier.blocks, units, strict=True)
    changed = tuple(replace(block, M11=block.M11 / unit**2, M12=block.M12 / unit) for block, unit in blocks)
    plant = replace(family.plant, Bf=family.plant.Bf * units)
    return replace(family, plant=plant, multiplier=Multiplier(changed))


@pytest.mark.parametrize("units", [(1e-9, 1e-9), (1e8, 1e8), (1e-6, 1e6)])
@pytest.mark.parametrize("text", [heat(12), beam(8), chain(12)], ids=["heat", "beam", "chain"])
def test_the_units_of_nonlinearities_do_not_matter(text, units):
    """The part in e of a multiplier may be far below H'H."""
    family = in_doubles(text)
    (known, _), (found, _) = (least_of(form_of(each), each) for each in (family, in_units(family, units)))
    assert found.mu == pytest.approx(known.mu, rel=1e-8)


@pytest.mark.parametrize("units", [(1e-12, 1e12), (1e12, 1e-12), (1e-12, 1.0)])
@pytest.mark.parametrize("seed", range(4))
def test_nor_do_those_of_monotone_ones(seed, units):
    rng, n = np.random.default_rng(seed), 8
    A = rng.normal(size=(n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.5) * np.eye(n)
    b, Bf, Cq, B = rng.normal(size=(4, n)).round(2)
    blocks = [(-b, b, "monotone"), (Bf, Cq, (0, 0.1))]
    B, D = noises(n, B, 0.1)
    family = in_doubles(written(A.round(3), B, rng.normal(size=(2, n)), D, blocks, 0.1))
    known, found = (least_gamma(Engine(), each, smallest=0) for each in (family, in_units(family, units)))
    assert found.objective == pytest.approx(known.objective, rel=2e-5)


BEARING = {0.1: 2.29891e-4, 0.71: 2.345855e-4, 9.9: 3.28207e-4, 12: 1e-2}


@pytest.mark.parametrize(("alpha", "known"), BEARING.items())
def test_monotone_blocks_have_their_limit(alpha, known):
    """By another program, and by matrix inequalities but for alpha = 12, where these are wrong."""
    family = replace(in_floats(posed(od.load("specs/corless2019-magnetic-bearing.yaml"))), rate=alpha)
    assert form_of(family) is None
    answer = least_gamma(Engine(), family, smallest=0)
    assert answer.objective == pytest.approx(known, rel=2e-5)
    assert answer.gap < 1e-5
    assert least_gamma(Engine(), family) is None


def test_a_damper_of_an_unknown_law_has_its_limit():
    """By another program; whatever the number of masses."""
    answer = least_gamma(Engine(), in_doubles(chain(8, springs=(), dampers=(0,))))
    assert math.sqrt(answer.objective) == pytest.approx(50 / 9, rel=1e-6)


def test_types_without_a_scale_each_and_small_plants_are_left_to_the_inequalities():
    text = chain(16)
    assert form_of(in_doubles(text)) is not None
    assert form_of(in_doubles(text.replace("slope: [-1, 1]", "slope: [0, .inf]"))) is None
    assert form_of(in_doubles(text.replace("type: l2", "type: l2, L2: free"))) is None
    assert least_gamma(Engine(), in_doubles(chain(4))) is None


def test_the_least_mu_of_scales_is_the_same_in_any_states():
    form = form_of(in_doubles(chain(8)))
    R = np.linalg.qr(np.random.default_rng(3).normal(size=(form.n,) * 2)).Q * 10.0 ** np.linspace(-2, 2, form.n)
    (one, _), (other, _) = least_scaled(form), least_scaled(form.moved(R))
    assert other.mu == pytest.approx(one.mu, rel=3e-5)


def test_a_rod_with_a_heat_where_a_source_is_has_its_limit():
    """Gamma hardly depends on the scale of the other source, which grows and grows: the level method stays in place."""
    names = [f"T{i}" for i in range(1, 41)]
    flows = {name: [f"-0.002*{name}"] for name in names}
    for one, other in pairwise(names):
        flows[one].append(f"0.6208*({other} - {one})")
        flows[other].append(f"0.6208*({one} - {other})")
    flows["T10"].append("heat0")
    flows["T15"].append("0.05*tanh(0.1*T15)")
    flows["T30"].append("heat1 - 0.02*atan(0.2*T30)")
    spec = od.Spec(
        system={
            "disturbances": ["heat0", "heat1"],
            "dynamics": {name: " + ".join(terms) for name, terms in flows.items()},
            "outputs": {"a": "T5", "b": "T20", "c": "T35"},
        },
        noise={name: {"rms": 0.05, "period": 1} for name in "abc"},
        disturbance="integrator",
        performance="w",
        observer={"type": "l2", "alpha": 5e-4},
    )
    family = gain.searchable(posed(spec))
    found = least_gamma(Engine(), family)
    assert found is not None
    assert found.gap < 3e-5
    below = found.objective * (1 - 2 * found.gap - 1e-4)
    form = form_of(family)
    for factors in np.random.default_rng(0).lognormal(0, 2, (20, 2)):
        scales = np.array([value.item() for value in found.values.values()]) * factors
        assert least(form.scaled(scales)).mu > below
