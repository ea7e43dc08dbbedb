"""Poles and gains in samples against scipy, dense grids and closed forms, over frozen members of a class."""

import numpy as np
import pytest
from scipy.signal import dfreqresp, dlsim, dlti
from support.samples import text

import obsdesign as od
from obsdesign.dissipation.analysis import Errors
from obsdesign.dissipation.modes import EXPONENTIALS, POWERS
from obsdesign.lmi.formula import in_floats
from obsdesign.reading import loads

CIRCLE = np.linspace(0, np.pi, 20001)


def system(spec, gains, K):
    """Error with f = K q from the equations of the observer: A, input matrix of v, that of noise in y."""
    p = spec.augmented.doubles
    L1, L2 = (np.reshape(gains[name], (-1, len(p.C))) for name in ("L1", "L2"))
    C, Df = (p.C @ p.A, p.C @ p.Bf) if spec.observer.filtered else (p.C, p.Df)
    F = np.linalg.solve(np.eye(len(K)) - K @ (p.Dqf + L2 @ Df), K)
    G = p.Bf + L1 @ Df
    A = p.A + L1 @ C + G @ F @ (p.Cq + L2 @ C)
    if spec.observer.filtered:  # v = (v at k, v at k + 1), whole
        none = np.zeros_like(p.B)
        B, D, Dq = np.hstack([p.B, none]), np.hstack([p.C @ p.B, p.D]), np.hstack([p.Dq, 0 * p.Dq])
    else:
        B, D, Dq = p.B, p.D, p.Dq
    return A, -(B + L1 @ D + G @ F @ (Dq + L2 @ D)), -(L1 + G @ F @ L2)


def response(A, B, theta=CIRCLE):
    return np.linalg.solve(np.exp(1j * theta)[:, None, None] * np.eye(len(A)) - A, B[None] + 0j)


def slopes(spec):
    """Members of the classes of K1, K5, K8 and R1: diagonal slopes on a grid."""
    ends = {"K1": [(0, 1), (-0.5, 0.5)], "K5": [(0, 2)], "Q1": [(0, 1)], "R1": []}[spec.name]
    grids = np.meshgrid(*(np.linspace(*pair, 5) for pair in ends)) if ends else []
    return [np.diag(k) for k in np.array([g.ravel() for g in grids]).T] if ends else [np.zeros((0, 0))]


def peak_of(spec, A, B, H):
    """Sum of the norms of the response of the largest z to v, each at its own sample."""
    h = np.array([H @ np.linalg.matrix_power(A, k) @ B for k in range(400)])
    if spec.observer.filtered:
        now, late = np.split(h, 2, axis=2)  # v at k is seen with v at k + 1, a sample later
        h = np.concatenate([late, 0 * now[:1]]) + np.concatenate([0 * now[:1], now])
    return max(np.linalg.norm(u @ h, axis=1).sum() for u in np.eye(len(H)))


CASES = [
    ("K1", "type: l2, rho: .95"),
    ("K1", "type: l2, rho: .95, estimate: filtered"),
    ("K5", "type: l2, rho: .95, L2: [[.5]]"),
    ("Q1", "type: linf, rho: .8"),
    ("Q1", "type: linf, rho: .8, estimate: filtered"),
    ("R1", "type: l2, rho: 1"),
]


@pytest.mark.parametrize(("plant", "observer"), CASES)
def test_poles_and_gains_are_those_of_the_worst_member_on_the_unit_circle(plant, observer):
    spec = loads(text(plant, observer))
    design = od.solve(spec)
    content, found = design.written(), design.analysis
    errors = [system(spec, content["observer"], K) for K in slopes(spec)]
    poles = np.concatenate([np.linalg.eigvals(A) for A, _, _ in errors])
    assert np.abs(complex(*found["worst_pole"])) == pytest.approx(np.abs(poles).max(), rel=1e-6)
    assert np.abs(complex(*found["worst_pole"])) <= content["guarantee"]["rho"] * (1 + 1e-9)
    noise = np.max([np.linalg.norm(response(A, N), axis=2).max(axis=0) for A, _, N in errors], axis=0)
    assert [*content["observer"]["noise_gain"].values()] == pytest.approx(noise, rel=1e-5)
    H = in_floats(spec.H)
    if observer.startswith("type: l2"):
        energy = max(np.linalg.norm(H @ response(A, B), 2, axis=(1, 2)).max() for A, B, _ in errors)
        assert energy <= content["guarantee"]["gamma"] * (1 + 1e-9)
    one = max(peak_of(spec, A, B, H) for A, B, _ in errors)
    assert found["peak_gain"]["least"] >= one * (1 - 1e-6)
    most = found["peak_gain"]["most"]
    assert (most is None) == (content["guarantee"]["rho"] == 1)
    assert most is None or found["peak_gain"]["least"] <= most * (1 + 1e-9)
    assert "largest_step" not in found
    assert {"fastest", "largest_step"}.isdisjoint(content["observer"])
    linear = np.linalg.eigvals(spec.posed.doubles.A + np.array(content["observer"]["L1"]) @ spec.posed.doubles.C)
    told = [complex(*pole) for pole in content["observer"]["poles"]]
    assert sorted(map(abs, told), reverse=True) == pytest.approx(list(map(abs, told)))
    assert np.sort_complex(told) == pytest.approx(np.sort_complex(linear))


def linear(A, B):
    """Errors of a copy of a plant without f that uses no y."""
    system = {"time": "discrete", "A": A, "B": B, "C": np.ones((1, len(A)))}
    spec = od.Spec(system=system, observer={"type": "l2", "rho": 1})
    return Errors.of(spec.posed, spec.multiplier, spec.H, modes=POWERS)


def test_the_gain_of_energy_is_the_norm_of_scipy_at_a_light_resonance():
    r, c, s = 0.999999, np.cos(1), np.sin(1)
    A, B, below = r * np.array([[c, -s], [s, c]]), np.array([[1.0], [0.0]]), [1, -2 * r * c, r * r]
    theta = 1 + np.linspace(-1e-5, 1e-5, 4001)
    (_, first), (_, second) = (dfreqresp(dlti(above, below), w=theta) for above in ([1, -r * c], [r * s]))
    peak = np.sqrt(np.abs(first) ** 2 + np.abs(second) ** 2).max()
    assert linear(A, B).energy_gain() == pytest.approx(peak, rel=1e-6)


def test_the_gain_of_energy_between_two_real_poles_far_apart_is_found():
    """A band pass (z - 1) / ((z - a)(z - b)) is the largest between the poles, where neither is near."""
    a, b = 1 - 1e-5, 1 - 1e-2
    A = np.array([[a + b, -a * b], [1, 0]])
    z = np.exp(1j * np.geomspace(1e-6, np.pi, 200001))
    H = np.array([[1.0, -1.0]])
    peak = np.abs((z - 1) / ((z - a) * (z - b))).max()
    found = POWERS.gain(A, np.array([[1.0], [0.0]]), H)
    assert found == pytest.approx(peak, rel=1e-4)


def test_a_mode_that_alternates_has_its_largest_gain_at_pi():
    assert linear([[-0.9]], [[1.0]]).energy_gain() == pytest.approx(10)
    assert linear([[-0.9]], [[1.0]]).peak_gain() == pytest.approx(10)
    assert linear([[-0.9]], [[1.0]]).worst_pole == [-0.9, 0]


@pytest.mark.parametrize("a", [0.0, 0.5, 0.9999, 1 - 1e-7])
def test_the_peak_gain_of_first_order_is_its_sum(a):
    assert linear([[a]], [[1.0]]).peak_gain() == pytest.approx(1 / (1 - a), rel=1e-5)


def test_the_peak_gain_of_dead_beat_is_told_although_its_modes_are_one():
    A = np.array([[0, 1.0, 0], [0, 0, 1], [0, 0, 0]])
    found = linear(A, np.array([[0], [0], [1.0]]))
    assert found.peak_gain() == pytest.approx(np.sqrt(3), rel=1e-2)  # (u2, u1, u0), the sum of |u_i| for |u| = 1
    assert found.peak_gain() <= np.sqrt(3) * (1 + 1e-12)
    assert found.energy_gain() == pytest.approx(np.sqrt(3))


def test_the_peak_gain_is_reached_by_the_worst_input():
    A, B = np.array([[0.9, 0.4], [-0.4, 0.85]]), np.array([[0.0], [1.0]])
    h = [np.linalg.matrix_power(A, k) @ B for k in range(300)]
    v = np.sign([part[0, 0] for part in h[::-1]])
    _, z, _ = dlsim((A, B, np.eye(2), np.zeros((2, 1)), 1), np.append(v, 0)[:, None])
    assert linear(A, B).peak_gain() >= abs(z[-1, 0]) * (1 - 1e-9)
    assert linear(A, B).peak_gain() <= sum(np.linalg.norm(part) for part in h) * (1 + 1e-9)


@pytest.mark.parametrize(
    ("a", "b", "c", "d", "rho", "gamma"),
    [(0.9, 1, 1, 0.5, 1, 1.096585610), (0.5, 0.2, 1, 2, 1, 0.392232270), (1.2, 0.3, 2, 1, 1, 0.670820393)],
)
def test_the_limit_of_a_scalar_plant_is_the_gain_of_its_error_on_the_unit_circle(a, b, c, d, rho, gamma):
    """The closed form of first order: dead beat, or the Riccati equation."""
    system = {"time": "discrete", "A": [[a]], "B": [[b, 0]], "C": [[c]], "D": [[0, d]]}
    design = od.solve(od.Spec(system=system, observer={"type": "l2", "rho": rho, "slack": 1e-4}))
    assert design.written()["guarantee"]["limit"]["gamma"] == pytest.approx(gamma, rel=1e-6)
    L = design.written()["observer"]["L1"][0][0]
    pole = a + L * c
    worst = np.hypot(b, L * d) / (1 - abs(pole))
    assert Errors.of(
        design.spec.posed, design.spec.multiplier, design.spec.H, np.array([[L]]), np.zeros((0, 1)), modes=POWERS
    ).energy_gain() == pytest.approx(worst)
    assert gamma * (1 - 1e-9) <= worst <= gamma * (1 + 1e-4)


def test_no_observer_of_samples_has_the_gain_of_the_plant():
    system = {"time": "discrete", "A": [[0.5, 0], [0, 0.2]], "B": [[1], [0]], "C": [[0, 1]]}
    found = od.solve(od.Spec(system=system, performance=["x1"], observer={"type": "l2", "rho": 0.9})).analysis
    assert found["no_observer"] == {"zero": pytest.approx(2), "open_loop": pytest.approx(2)}
    peaks = od.solve(od.Spec(system=system, performance=["x1"], observer={"type": "linf", "rho": 0.9})).analysis
    assert peaks["no_observer"]["open_loop"] == pytest.approx(2)


def test_modes_decay_in_the_left_half_plane_and_in_the_unit_disc():
    poles = np.array([0.5 + 0.2j, -0.99, 0])
    assert POWERS.stable(poles)
    assert not EXPONENTIALS.stable(poles)
    assert not POWERS.stable(np.array([1.0]))
    assert not POWERS.stable(np.array([-1.0, 0.5]))
    assert EXPONENTIALS.slowest(np.array([-3.0, -1 + 2j, -1 - 2j])) == [-1, 2]
    assert POWERS.slowest(np.array([0.3, -0.4j, 0.4j])) == [0, 0.4]


def test_the_peak_gain_of_filtered_estimates_is_of_v_itself():
    """A = 0, B = [1 0], C = 1, D = [0 1], L1 = -.5: v = (1, 0), (0, 1) reaches |e| = 1, sqrt(2) times gamma."""
    system = {"time": "discrete", "A": [[0]], "B": [[1, 0]], "C": [[1]], "D": [[0, 1]]}
    observer = {"type": "linf", "rho": 0.01, "estimate": "filtered", "gains": {"L1": [[-0.5]], "L2": []}}
    design = od.solve(od.Spec(system=system, observer=observer))
    assert design.analysis["peak_gain"]["least"] == pytest.approx(1)
    assert design.analysis["peak_gain"]["most"] == pytest.approx(1, rel=1e-3)
    assert design.written()["guarantee"]["gamma"] == pytest.approx(np.sqrt(0.5), rel=1e-3)
