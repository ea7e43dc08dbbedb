"""Poles that are imposed, and steps in which an observer is to be stable: closed forms, members, forgeries, units."""

import copy
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from flint import fmpq, fmpq_poly
from support.forging import put, scaled
from support.sweep import SWEEP, rng

import obsdesign as od
from obsdesign.dissipation.region import RK4, Region, slope_below
from obsdesign.lmi.formula import rational_number

SLOPE = [-0.5, 0.75]


def scalar(a=1.0, noise=0.2, slope=None, **sections):
    """Plant x' = a x + f(x) + w1, y = x + noise w2."""
    blocks = [{"type": {"slope": slope}, "Bf": [1], "Cq": [1]}] if slope else []
    system = {"A": [[a]], "B": [[1, 0]], "C": [[1]], "D": [[0, noise]]}
    sections.setdefault("observer", {"type": "l2", "alpha": 0.1})
    return od.Spec(name="scalar", system=system, nonlinearities=blocks, **sections)


def least(fast, a=1.0, noise=0.2, low=0.0, high=0.0, alpha=0.1):
    """Least gamma of l2 for the pole of the member `low` at -fast: gamma = |(1, l noise)| / (l - a - high - alpha)."""
    gain = fast + a + low
    return np.hypot(1, gain * noise) / (gain - a - high - alpha)


@pytest.mark.parametrize("radius", [3.0, 6.0])
@pytest.mark.parametrize("slope", [None, SLOPE])
def test_of_a_scalar_plant_the_radius_bounds_the_fastest_member(radius, slope):
    spec = scalar(slope=slope, observer={"type": "l2", "alpha": 0.1, "poles": {"radius": radius}})
    design, (low, high) = od.solve(spec), slope or (0.0, 0.0)
    assert design.limit_bounded["gamma"] == pytest.approx(least(radius, low=low, high=high), rel=1e-4)
    assert design.limit["gamma"] < design.limit_bounded["gamma"] < design.result["guarantee"]["gamma"]
    assert design.result["guarantee"]["poles"] == {"radius": radius}
    assert design.verify().holds


@pytest.mark.parametrize(("method", "reach"), [("euler", 2.0), ("rk4", float(RK4))])
def test_of_a_scalar_plant_imposed_steps_bound_the_fastest_member(method, reach):
    steps = {"period": 0.4, "method": method, "impose": True}
    design = od.solve(scalar(slope=SLOPE, implementation=steps))
    expected = least(reach / 0.4, low=SLOPE[0], high=SLOPE[1])
    assert design.limit_bounded["gamma"] == pytest.approx(expected, rel=1e-4)
    assert design.result["guarantee"]["implementation"] == {"period": 0.4, "method": method}
    assert design.analysis["largest_step"][method] >= 0.4


def test_of_a_scalar_plant_every_pole_is_damped():
    design = od.solve(scalar(observer={"type": "l2", "alpha": 0.1, "poles": {"damping": 0.99}}))
    assert design.limit_bounded["gamma"] == pytest.approx(design.limit["gamma"], rel=1e-4)


@pytest.mark.parametrize("damping", [0.3, 0.7, 0.95])
@pytest.mark.parametrize("family", ["l2", "lipschitz"])
def test_given_gains_are_held_against_the_damping_of_their_poles(family, damping):
    """Double integrator, poles of s^2 + 2 d w s + w^2; of lipschitz with an f that hardly acts."""
    w = 2.0
    gains = {"L1": [-2 * damping * w, -w * w], "L2": 0} if family == "l2" else {"L": [2 * damping * w, w * w]}
    blocks = [{"type": {"lipschitz": 1e-6}, "Bf": [0, 1], "Cq": [1, 0]}] if family == "lipschitz" else []
    more = {"alpha": 0.01} if family == "l2" else {"objective": "min-gamma"}
    for share, status in ((1 - 1e-3, "certified"), (1 + 1e-3, "infeasible")):
        poles = {"damping": damping * share, "radius": w * 1.001}
        observer = {"type": family, "gains": gains, "poles": poles, **more}
        system = {"A": [[0, 1], [0, 0]], "B": [[0], [1]], "C": [[1, 0]]}
        design = od.solve(od.Spec(name="integrators", system=system, nonlinearities=blocks, observer=observer))
        assert design.status == status, share
    assert "the pole" in design.diagnosis["reason"]


def test_the_half_disc_of_runge_kutta_is_stable_and_the_largest_but_for_4e_5():
    """|R|^2 - 1 on |z| = r in x = cos(arg z), by cos(m t) = T_m(x), in rationals: no root in [-1, 0], one beyond."""
    terms = [fmpq(1, k) for k in (1, 1, 2, 6, 24)]

    def chebyshev(m):
        before, here = fmpq_poly([1]), fmpq_poly([0, 1])
        for _ in range(m):
            before, here = here, fmpq_poly([0, 2]) * here - before
        return before

    def excess(r):
        pairs = product(range(5), repeat=2)
        total = sum((terms[j] * terms[k] * r ** (j + k) * chebyshev(abs(j - k)) for j, k in pairs), fmpq_poly([0]))
        return total - 1

    def real_roots(p):
        return [root.real for root, _ in p.complex_roots() if root.imag.contains(0)]

    inside, beyond = excess(RK4), excess(RK4 + fmpq(1, 10_000))
    assert not any(-1 <= float(root) <= 0 for root in real_roots(inside))
    assert inside(fmpq(-1)) < 0
    assert inside(fmpq(0)) < 0  # on the imaginary axis 1 - y^6 / 72 + y^8 / 576 <= 1 for y^2 <= 8
    assert RK4**2 < 8
    assert any(-1 <= float(root) <= 0 for root in real_roots(beyond))


@pytest.mark.parametrize("damping", ["0.5", "0.999", "1/3", "0.01"])
def test_the_slope_of_a_cone_is_below_that_of_its_damping_by_rounding(damping):
    d = rational_number(damping)
    k, square = slope_below(d), 1 / (d * d) - 1
    assert k * k <= square < (k + fmpq(1, 10**17)) ** 2


# Random designs


def random_spec(random, **sections):
    """A plant with one or two scalar slopes, in random numbers."""
    n = int(random.integers(2, 5))
    ny = int(random.integers(1, n))
    blocks = [
        {
            "type": {"slope": sorted(random.uniform(-0.5, 0.5, 2).round(3).tolist())},
            "Bf": random.normal(size=n).round(3).tolist(),
            "Cq": random.normal(size=n).round(3).tolist(),
        }
        for _ in range(random.integers(1, 3))
    ]
    system = {
        "A": random.normal(size=(n, n)).round(3).tolist(),
        "B": np.hstack([random.normal(size=(n, 1)).round(3), np.zeros((n, ny))]).tolist(),
        "C": random.normal(size=(ny, n)).round(3).tolist(),
        "D": np.hstack([np.zeros((ny, 1)), 0.1 * np.eye(ny)]).tolist(),
    }
    return od.Spec(name="random", system=system, nonlinearities=blocks, **sections)


def frozen_poles(spec, gains, points=7):
    """Poles of the error with slopes on a grid, ends included; L2 = 0."""
    plant, slopes = spec.plant.doubles, [block.multiplier.blocks[0].vertices for block in spec.nonlinearities]
    ends = [(min(float(K.item()) for K in some), max(float(K.item()) for K in some)) for some in slopes]
    A = plant.A + gains["L1"] @ plant.C
    members = product(*(np.linspace(*pair, points) for pair in ends))
    return np.concatenate([np.linalg.eigvals(A + plant.Bf @ np.diag(K) @ plant.Cq) for K in members])


def hold_members(seed):
    """Every frozen member of a random design is where it is proved to be; whether there was a design."""
    random = rng(seed)
    region = {"radius": float(random.choice([8, 20])), "damping": float(random.choice([0.3, 0.6, 0.9]))}
    kept = dict([list(region.items())[i] for i in sorted({*random.integers(0, 2, 2).tolist()})])
    method = str(random.choice(["euler", "rk4"]))
    steps = {"period": 0.1, "method": method, "impose": bool(random.integers(2))}
    observer = {"type": ("l2", "linf")[seed % 2], "alpha": 0.3, "poles": kept}
    spec = random_spec(random, observer=observer, implementation=steps)
    try:
        design = od.solve(spec)
    except od.UndecidedError:
        return False
    if design.status != "certified":
        assert design.diagnosis["reason"]
        return False
    s = frozen_poles(spec, design.gains)
    assert np.abs(s).max() <= kept.get("radius", np.inf) * (1 + 1e-9)
    assert (-s.real / np.abs(s)).min() >= kept.get("damping", -1) - 1e-9
    if steps["impose"]:
        z = 0.1 * s
        assert np.abs(1 + z if method == "euler" else 1 + z * (1 + z / 2 * (1 + z / 3 * (1 + z / 4)))).max() < 1
    assert design.verify().holds
    return True


def test_frozen_members_of_random_designs_are_where_they_are_proved_to_be():
    assert sum(map(hold_members, range(4))) >= 2


@pytest.mark.sweep
@pytest.mark.slow
def test_frozen_members_of_many_random_designs_are_where_they_are_proved_to_be():
    count = SWEEP.size(60)
    assert sum(map(hold_members, range(100, 100 + count))) >= count // 2


def test_members_of_a_hull_of_matrices_are_where_they_are_proved_to_be():
    corners = [[[0.3, -0.4], [0, 0.2]], [[-0.3, 0.1], [0.2, 0]], [[0, 0.5], [-0.5, 0]]]
    system = {"A": [[0, 1], [-2, -1]], "B": [[0, 0], [1, 0]], "C": [[1, 0]], "D": [[0, 0.1]]}
    blocks = [{"type": {"jacobian": corners}, "Bf": [[1, 0], [0, 1]], "Cq": [[1, 0], [0, 1]]}]
    observer = {"type": "l2", "alpha": 0.2, "poles": {"radius": 7, "damping": 0.6}}
    design = od.solve(od.Spec(name="hull", system=system, nonlinearities=blocks, observer=observer))
    assert design.verify().holds
    A = np.array(system["A"]) + design.gains["L1"] @ np.array(system["C"])
    weights = np.random.default_rng(0).dirichlet([0.5] * 3, 200)
    s = np.concatenate([np.linalg.eigvals(A + np.tensordot(w, corners, 1)) for w in [*weights, *np.eye(3)]])
    assert np.abs(s).max() <= 7
    assert (-s.real / np.abs(s)).min() >= 0.6


# What an engineer is told

CART = {
    "system": {"A": [[0, 1], [-2, -1]], "B": [[0, 0], [1, 0]], "C": [[1, 0]], "D": [[0, 0.1]]},
    "nonlinearities": [{"f": "0.5*sin(q)", "type": {"slope": [-0.5, 0.5]}, "Bf": [0, 1], "Cq": [1, 0]}],
}
STEEP = [{"f": "q*abs(q)", "type": "monotone", "Bf": [0, -1], "Cq": [0, 1]}]


def cart(observer, **sections):
    """Design of the cart."""
    return od.solve(od.Spec(**{**CART, "name": "cart", "observer": observer, **sections}))


@pytest.mark.parametrize("observer", [{"type": "l2", "alpha": 0.5}, {"type": "linf", "alpha": 0.5}])
def test_infeasible_means_within_the_poles_and_says_which_would_do(observer):
    design = cart({**observer, "poles": {"radius": 1.2, "damping": 0.7}})
    assert design.status == "infeasible"
    assert "within the bounds: no gain with |s| <= 1.2 1/s and damping >= 0.7" in design.diagnosis["reason"]
    radius = design.diagnosis["feasible"]["radius"]
    assert f"allow |s| up to {radius:g}" in design.diagnosis["suggestion"]
    assert cart({**observer, "poles": {"radius": radius, "damping": 0.7}}).status == "certified"


def test_a_slope_without_an_upper_bound_leaves_a_cone_but_no_disc():
    design = cart({"type": "l2", "alpha": 0.5, "poles": {"radius": 6}}, nonlinearities=STEEP)
    assert design.status == "infeasible"
    assert "f1 has no upper slope bound" in design.diagnosis["reason"]
    found = od.check(design.spec)
    assert [(finding.id, finding.holds) for finding in found if finding.name == "poles"] == [("OBS620", False)]
    damped = cart({"type": "l2", "alpha": 0.5, "poles": {"damping": 0.8}}, nonlinearities=STEEP)
    assert damped.verify().holds
    assert not any(finding.name == "poles" for finding in od.check(damped.spec))


def note_of(design):
    """What is said of the steps."""
    return next(iter(note for note in design.result.get("notes", []) if note.startswith("implementation: ")), "")


L2 = {"type": "l2", "alpha": 0.5}


def test_steps_are_held_against_the_largest_that_was_found():
    largest = cart(L2).analysis["largest_step"]
    for method in ("euler", "rk4"):
        fits = note_of(cart(L2, implementation={"period": largest[method] * 0.99, "method": method}))
        assert "are stable" in fits
        assert "computed, not proved" in fits
        long = note_of(cart(L2, implementation={"period": largest[method] * 1.01, "method": method}))
        assert "are too long" in long
        assert "impose: true" in long
    assert "any step of exact is stable" in note_of(cart(L2, implementation={"period": 0.1, "method": "exact"}))
    assert note_of(cart(L2)) == ""


def test_of_steep_slopes_no_largest_step_is_told():
    design = cart(L2, nonlinearities=STEEP, implementation={"period": 1e-6, "method": "rk4"})
    assert "no largest step is known for rk4: the slopes of f have no upper bound" in note_of(design)


def test_steps_that_are_imposed_are_told_as_proved_and_those_that_failed_otherwise():
    steps = {"period": 0.3, "method": "euler"}
    free, imposed = (cart(L2, implementation={**steps, "impose": impose}) for impose in (False, True))
    assert "too long" in note_of(free)
    assert note_of(imposed) == ""
    assert imposed.analysis["largest_step"]["euler"] >= 0.3 > free.analysis["largest_step"]["euler"]
    assert "two runs of the observer on the same y and u come nearer" in imposed.result["guarantee"]["statement"]
    assert "where poles lie, steps" in imposed.theorem()
    assert imposed.simulate(observer="implementation", horizon=20, x0=[1, 0]).summary["final_error"] < 1e-3


def test_two_runs_in_steps_of_euler_come_nearer_in_v():
    """Of x+ = x + h (A x + Bf f(x1) + L1 (x1 - y)), f = sin / 2, from any two states and with any y."""
    h, random = 0.3, rng(0)
    design = cart(L2, implementation={"period": h, "method": "euler", "impose": True})
    A, L1 = np.array(CART["system"]["A"]), design.gains["L1"][:, 0]
    P = design.claim.certificate.P.astype(float)

    def step(x, y):
        return x + h * (A @ x + np.array([0, 0.5 * np.sin(x[0])]) + L1 * (x[0] - y))

    for size in (1e-3, 1.0, 10.0):
        for _ in range(50):
            one, other, y = *random.normal(size=(2, 2)) * size, random.normal() * size
            before, after = one - other, step(one, y) - step(other, y)
            assert after @ P @ after < before @ P @ before


@pytest.mark.parametrize(
    ("sections", "said"),
    [
        ({"implementation": {"period": 0.1, "method": "exact", "impose": True}}, "is for euler and rk4"),
        ({"observer": {**L2, "poles": {}}}, "says nothing; give radius"),
        ({"observer": {**L2, "poles": {"damping": 1}}}, "is not below 1"),
        ({"observer": {**L2, "poles": {"radius": 0}}}, "give a number > 0"),
        ({"observer": {**L2, "L2": "free", "poles": {"radius": 9}}}, "give L2 as a matrix"),
        ({"system": {**CART["system"], "time": "discrete"}, "observer": {"type": "l2", "poles": {"radius": 9}}}, "rho"),
        (
            {
                "nonlinearities": [{"type": {"lipschitz": 0.5}, "Bf": [0, 1], "Cq": [1, 0]}],
                "observer": {"type": "lipschitz", "relaxation": "norm-bound", "poles": {"radius": 9}},
            },
            "s-procedure only",
        ),
        (
            {
                "nonlinearities": [{"type": {"lipschitz": 0.5}, "Bf": [0, 1], "Cq": [1, 0]}],
                "observer": {"type": "sporadic", "T1": 0.1, "T2": 0.2},
                "implementation": {"period": 0.1, "impose": True},
                "system": {**CART["system"], "B": [[0], [1]], "D": [[0]]},
            },
            "is for type l2, linf, lipschitz",
        ),
    ],
)
def test_what_cannot_be_imposed_is_refused_in_one_line(sections, said):
    with pytest.raises(od.UsageError, match=said) as refused:
        od.Spec(**{**CART, "name": "cart", "observer": L2, **sections})
    assert len(refused.value.problems) == 1


# Forgeries

PLACED = {**L2, "poles": {"radius": 6, "damping": 0.7}}


@pytest.mark.parametrize("key", ["radius", "damping"])
def test_a_region_that_is_smaller_than_what_is_proved_is_refused(key, outcome_of):
    result = cart(PLACED).result
    for factor in ("0.9", "1.1"):
        forged = scaled(copy.deepcopy(result), ("guarantee", "poles", key), factor)
        assert outcome_of(forged).exit_code == 2
        said = {"radius": "|s| <= {!r}", "damping": "-Re s >= {!r}"}[key]
        before, after = (said.format(part["guarantee"]["poles"][key]) for part in (result, forged))
        assert before in result["guarantee"]["statement"]
        put(forged, ("guarantee", "statement"), result["guarantee"]["statement"].replace(before, after))
        assert outcome_of(forged).exit_code == 2


@pytest.mark.parametrize(("key", "value"), [("method", "rk4"), ("period", 0.4)])
def test_other_steps_than_those_that_are_proved_are_refused(key, value, outcome_of):
    result = cart(L2, implementation={"period": 0.3, "method": "euler", "impose": True}).result
    outcome = outcome_of(put(copy.deepcopy(result), ("guarantee", "implementation", key), value))
    assert (outcome.exit_code, f"guarantee.implementation.{key}" in outcome.stderr) == (2, True)


def test_a_witness_of_the_poles_is_read_and_proved(outcome_of):
    result = cart(PLACED).result
    names = result["certificate"]["poles"]
    assert set(names) == {"radius_lambda1", "damping_lambda1", "damping_g1"}
    for name in names:
        missing = copy.deepcopy(result)
        del missing["certificate"]["poles"][name]
        assert outcome_of(missing).exit_code == 2
        if "lambda" in name:
            outcome = outcome_of(scaled(copy.deepcopy(result), ("certificate", "poles", name), "-1"))
            assert outcome.exit_code == 4
            assert "NOT proved" in outcome.stdout
    far = put(copy.deepcopy(result), ("certificate", "poles", "damping_g1"), "1000000")
    assert outcome_of(far).exit_code == 4


def test_gains_outside_the_region_are_not_proved(outcome_of):
    result, fast = cart(PLACED).result, [[-9.0], [-60.0]]
    assert outcome_of(put(copy.deepcopy(result), ("observer", "L1"), fast)).exit_code == 4
    assert Region(radius=fmpq(6)).outside(np.array([-5.9 + 0j, -6.1 + 0j])).tolist() == [-6.1]


# Units


@pytest.mark.parametrize("factor", [Fraction(1, 1000), Fraction(8)])
def test_time_and_states_in_other_units_change_nothing_but_numbers(factor):
    """Of 1 / factor seconds: A, B, Bf, alpha and the radius are multiplied; x in other units as well."""
    scale, T = float(factor), np.diag([8.0, 0.01])
    system = {
        "A": (scale * T @ CART["system"]["A"] @ np.linalg.inv(T)).tolist(),
        "B": (scale * T @ np.array(CART["system"]["B"])).tolist(),
        "C": (np.array(CART["system"]["C"]) @ np.linalg.inv(T)).tolist(),
        "D": CART["system"]["D"],
    }
    block = {"type": {"slope": [-0.5, 0.5]}, "Bf": (scale * T @ [0, 1]).tolist(), "Cq": [1 / 8, 0]}
    H = np.linalg.inv(T).tolist()
    observer = {"type": "l2", "alpha": 0.5 * scale, "poles": {"radius": 6 * scale, "damping": 0.7}}
    steps = {"period": 0.2 / scale, "method": "euler", "impose": True}
    other = cart(observer, system=system, nonlinearities=[block], performance={"H": H}, implementation=steps)
    plain = cart(PLACED, implementation={**steps, "period": 0.2})
    assert other.verify().holds
    for name in ("limit", "limit_bounded"):
        assert getattr(other, name)["gamma"] == pytest.approx(getattr(plain, name)["gamma"], rel=1e-4)


@pytest.mark.parametrize(
    "observer",
    [
        {"type": "lipschitz", "poles": {"radius": 6, "damping": 0.7}},
        {"type": "lipschitz", "objective": "min-gamma", "poles": {"radius": 6}},
        {"type": "lipschitz", "objective": "pareto", "weight": 0.5, "poles": {"radius": 6, "damping": 0.7}},
        {"type": "l2", "alpha": {"min": 0.1, "max": 4}, "objective": "max-alpha", "poles": {"radius": 6}},
        {"type": "l2", "alpha": {"min": 0.1, "max": 2, "points": 3}, "objective": "pareto", "poles": {"radius": 6}},
        {"type": "l2", "alpha": 0.5, "objective": {"gamma": 0.5}, "poles": {"radius": 6}},
        {"type": "l2", "alpha": 0.5, "objective": "feasibility", "poles": {"radius": 6}},
        {"type": "l2", "alpha": 0.5, "bounds": {"L1": 9}, "poles": {"radius": 6}},
        {"type": "linf", "alpha": {"min": 0.1, "max": 2, "points": 3}, "poles": {"radius": 6, "damping": 0.7}},
    ],
)
def test_every_objective_keeps_the_poles(observer):
    kind = {"lipschitz": 0.5} if observer["type"] == "lipschitz" else {"slope": [-0.5, 0.5]}
    design = cart(observer, nonlinearities=[{**CART["nonlinearities"][0], "type": kind}])
    assert design.status == "certified"
    assert design.verify().holds
    assert design.result["guarantee"]["poles"] == observer["poles"]
    L1 = design.gains["L1"] if "L1" in design.gains else -design.gains["L"]
    system, most = CART["system"], design.result["guarantee"].get("lipschitz", 0.5)
    members = [np.array(system["A"]) + np.array([[0, 0], [K, 0]]) for K in np.linspace(-most, most, 9)]
    s = np.concatenate([np.linalg.eigvals(A + L1 @ np.array(system["C"])) for A in members])
    assert np.abs(s).max() <= 6
    assert (-s.real / np.abs(s)).min() >= observer["poles"].get("damping", 0)
