"""The rms that white measurement noise makes of each error: against closed forms, sums of squares and runs."""

import numpy as np
import pytest
from scipy.linalg import expm, solve_continuous_lyapunov, solve_discrete_lyapunov

import obsdesign as od
from obsdesign.dissipation.analysis import Errors
from obsdesign.dissipation.modes import EXPONENTIALS, POWERS
from obsdesign.dissipation.residues import Spectrum

FIRST = {"A": [[-1]], "B": [[1, 0]], "C": [[1]], "D": [[0, 0.01]]}
SLOPED = [{"type": {"slope": [-0.5, 0.75]}, "f": "0.1*sin(q)", "Bf": [1], "Cq": [1]}]
PENDULUM = {
    "disturbances": ["torque"],
    "dynamics": {"angle": "speed", "speed": "-9.81*sin(angle) - 0.5*speed + torque"},
    "outputs": {"encoder": "angle"},
}


def analysed(system, gains, **further):
    """Analysis of given gains."""
    observer = {"type": "l2", "alpha": 0.01, "gains": gains}
    design = od.solve(od.Spec(system=system, observer=observer, **further))
    assert str(design.status) == "certified"
    return design


def density(design):
    """H2 norms, estimates by outputs."""
    return np.array([[*row.values()] for row in design.analysis["noise_density"].values()])


# Closed forms


def test_the_density_of_a_first_order_error_is_its_closed_form():
    """E' = -(1 + L) e + L n has the variance L^2 / (2 (1 + L)) for noise of density 1."""
    found = analysed(FIRST, {"L1": [[-3]]}).analysis
    assert found["noise_density"] == {"x1": {"y1": pytest.approx(np.sqrt(9 / 8), rel=1e-12)}}
    assert found["noise_rms"] is None


def test_the_worst_slope_counts():
    """With f = k q the pole is 1 + L - k: the slowest, k = .75, passes most of the noise."""
    found = analysed(FIRST, {"L1": [[-3]]}, nonlinearities=SLOPED)
    assert density(found) == pytest.approx(np.sqrt(9 / 2 / 3.25), rel=1e-9)


def test_a_worst_slope_inside_its_interval_counts_as_far_as_it_was_tried():
    errors = analysed(FIRST, {"L1": [[-3]]}, nonlinearities=SLOPED)
    slopes = np.linspace(-0.5, 0.75, 101)
    assert density(errors).max() >= max(np.sqrt(9 / 2 / (4 - k)) for k in slopes) * (1 - 1e-9)


@pytest.mark.parametrize("estimate", ["predicted", "filtered"])
def test_the_rms_in_samples_is_its_closed_form(estimate):
    """Predicted: e+ = (a + L) e - L n; filtered: e+ = (a + L a) e - L n."""
    a, L = 0.9, -0.4
    system = {"time": "discrete", "A": [[a]], "B": [[1, 0]], "C": [[1]], "D": [[0, 1]]}
    observer = {"type": "l2", "rho": 0.99, "estimate": estimate, "gains": {"L1": [[L]]}}
    found = od.solve(od.Spec(system=system, observer=observer)).analysis
    pole = a + L if estimate == "predicted" else a + L * a
    assert found["noise_density"]["x1"]["y1"] == pytest.approx(abs(L) / np.sqrt(1 - pole**2), rel=1e-9)
    assert found["noise_rms"] == found["noise_density"]


def test_the_estimate_of_a_disturbance_that_is_a_sum_of_states_has_a_density_of_its_own():
    """A bias and a sinusoid: neither is w, their sum is."""
    gains = {"L1": [[-12], [-50], [-100], [-5], [-200]]}
    model = {"bias+sinusoid": {"omega": 2}}
    design = analysed({"A": [[0, 1], [-1, -1]], "B": [[0], [1]], "C": [[1, 0]]}, gains, disturbance=model)
    rows, A = design.analysis["noise_density"], design.spec.augmented.doubles.A
    assert [*rows] == ["x1", "x2", "w1.bias", "w1.sine", "dw1.sine", "w1"]
    L = np.array(gains["L1"])
    X = solve_continuous_lyapunov(A + L @ [[1, 0, 0, 0, 0]], -L @ L.T)
    c = np.array([0, 0, 1, 1, 0])
    assert rows["w1"]["y1"] == pytest.approx(np.sqrt(c @ X @ c), rel=1e-9)
    assert density(design)[:5, 0] == pytest.approx(np.sqrt(np.diag(X)), rel=1e-9)


# Sums of squares


def test_the_norms_of_exponentials_are_integrals_of_squares_in_any_units():
    A = np.array([[0, 1, 0], [-100, -8, 500], [-10, -50, -1000.0]])
    N, E = np.array([[1.0, 0.2], [2e3, -3], [1e-3, 0]]), np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, -1, 2.0]])
    t = np.linspace(0, 6, 60001)
    h = np.array([E @ N, *(E @ M @ N for M in powers(expm(A * t[1]), len(t) - 1))])
    expected = np.sqrt(np.trapezoid(h**2, t, axis=0))
    assert EXPONENTIALS.norms(A, N, E) == pytest.approx(expected, rel=1e-3)
    units = np.array([1e9, 1, 1e-9])
    scaled = EXPONENTIALS.norms(units[:, None] * A / units, units[:, None] * N, E / units)
    assert scaled == pytest.approx(EXPONENTIALS.norms(A, N, E), rel=1e-9)


def powers(M, count):
    """M, M^2, .."""
    P = np.eye(len(M))
    for _ in range(count):
        P = M @ P
        yield P


def test_the_norms_of_powers_are_sums_of_squares():
    random = np.random.default_rng(0)
    for n in (1, 3, 12):
        A = random.normal(size=(n, n))
        A *= 0.97 / np.abs(np.linalg.eigvals(A)).max()
        N, E = random.normal(size=(n, 2)), random.normal(size=(4, n))
        h = np.array([E @ N, *(E @ M @ N for M in powers(A, 2000))])
        assert POWERS.norms(A, N, E) == pytest.approx(np.sqrt((h**2).sum(axis=0)), rel=1e-8)


@pytest.mark.parametrize("gains", [{"L": [[2], [1]], "H": [[0]]}, {"K": [[0.6], [0.3]]}])
def test_the_rms_of_sporadic_measurements_is_that_of_their_steps(gains):
    injection = "reset" if "K" in gains else "dynamic"
    observer = {"type": "sporadic", "T1": 0.1, "T2": 0.2, "injection": injection, "gains": gains}
    spec = od.Spec(
        system={"A": [[0, 1], [-1, -1]], "B": [[0], [1]], "C": [[1, 0]]},
        nonlinearities=[{"type": {"slope": [-0.4, 0.2]}, "f": "0.1*sin(q)", "Bf": [0, 0.5], "Cq": [1, 0]}],
        observer=observer,
    )
    found = od.solve(spec).analysis
    C, worst = np.array([[1, 0]]), np.zeros(2)
    for T in (0.1, 0.2):
        for slope in (-0.4, -0.1, 0.2):
            A = np.array([[0, 1], [-1 + 0.5 * slope, -1]])
            if "K" in gains:
                K = np.array(gains["K"])
                Phi, Gamma = expm(A * T) @ (np.eye(2) - K @ C), expm(A * T) @ K
            else:
                E = expm(T * np.block([[A, -np.array(gains["L"])], [np.zeros((1, 3))]]))
                Phi, Gamma = E[:2, :2] + E[:2, 2:] @ C, E[:2, 2:]
            h = np.array([Gamma, *(M @ Gamma for M in powers(Phi, 1000))])[:, :, 0]
            worst = np.maximum(worst, np.sqrt((h**2).sum(axis=0)))
    assert [row["y1"] for row in found["noise_rms"].values()] == pytest.approx(worst, rel=1e-8)
    assert found["noise_density"] == found["noise_rms"]


# Values that are held


@pytest.mark.parametrize("period", [1e-4, 0.01, 0.3, 5, 1e4])
def test_the_rms_of_values_that_are_held_is_its_closed_form(period):
    """E' = -a e - 3 n has the mean square 9 (h - (1 - exp(-a h)) / a) / (a^2 h) over time, for a rms of 1."""
    found = analysed(FIRST, {"L1": [[-3]]}, noise={"y1": {"rms": 0.01, "period": period}}).analysis
    a = 4.0
    expected = 9 * (period + np.expm1(-a * period) / a) / (a**2 * period)
    assert found["noise_error"]["x1"] == pytest.approx(0.01 * np.sqrt(expected), rel=1e-6)
    assert found["noise_error"]["x1"] <= 0.01 * 3 / a  # what it is for a constant
    assert found["noise_error"]["x1"] <= 0.01 * np.sqrt(9 / (2 * a) * period)  # .. and for white noise


@pytest.mark.parametrize("known", [False, True])
def test_the_rms_of_values_that_are_held_is_that_of_their_samples_over_a_period(known):
    A = np.array([[0, 1, 0], [-100, -8, 500], [-10, -50, -1000.0]])
    N, E, h, parts = np.array([[1.0, 0.2], [2e3, -3], [1e-3, 0]]), np.eye(3), 0.05, 4000
    step = expm(np.block([[A, N], [np.zeros((2, 5))]]) * h / parts)
    Phi, Gamma = np.eye(3), np.zeros((3, 2))
    courses = []
    for _ in range(parts):
        courses.append((Phi, Gamma))
        Phi, Gamma = step[:3, :3] @ Phi, step[:3, :3] @ Gamma + step[:3, 3:]
    expected = []
    for k in range(2):
        P = solve_discrete_lyapunov(Phi, np.outer(Gamma[:, k], Gamma[:, k]))
        expected.append(np.mean([np.diag(M @ P @ M.T) + G[:, k] ** 2 for M, G in courses], axis=0))
    spectrum = Spectrum.of(A) if known else None
    assert EXPONENTIALS.norms(A, N, E, spectrum, h) == pytest.approx(np.sqrt(np.transpose(expected)), rel=2e-3)


def test_each_output_has_a_period_of_its_own():
    system = {**FIRST, "C": [[1], [1]], "D": [[0], [0]], "B": [[1]], "outputs": ["fine", "coarse"]}
    each = {"fine": {"rms": 0.1, "period": 2}, "coarse": {"density": 0.03}}
    found = [
        analysed(system, {"L1": [[-3, -1]]}, noise=noise).analysis["noise_error"]["x1"]
        for noise in (each, {"fine": each["fine"]}, {"coarse": each["coarse"]})
    ]
    assert found[0] == pytest.approx(np.hypot(found[1], found[2]), rel=1e-9)


# What is not told


def test_nothing_is_told_where_slopes_are_not_bounded_or_a_pole_is_not_stable():
    blocks = [{"type": "monotone", "f": "q**3", "Bf": [0, -0.5], "Cq": [0, 1]}]
    spec = od.Spec(
        system={"A": [[0, 1], [-1, -1]], "B": [[0], [1]], "C": [[1, 0]]},
        nonlinearities=blocks,
        observer={"type": "l2", "L2": [[-2]], "alpha": 0.1},
    )
    found = od.solve(spec).analysis
    assert (found["noise_density"], found["noise_rms"]) == (None, None)
    still = od.Spec(system={"A": [[0]], "C": [[1]]}, observer={"type": "l2", "alpha": 0.1})
    assert Errors.of(still.posed, still.multiplier, still.H).noise_norms(np.eye(1)) is None


# Runs


def test_the_noise_of_a_run_has_the_rms_that_is_told():
    """The pendulum hangs, where sin has the slope 1; of another slope an error may be larger, not than what is told."""
    L1 = np.array([[-8], [-30], [-40]])
    noise = {"type": "normal", "amplitude": 0.01, "period": 0.01}
    simulation = {"horizon": 200, "noise": noise, "points": 20001}
    design = analysed(PENDULUM, {"L1": L1}, disturbance="integrator", simulation=simulation)
    run = design.simulate()
    errors = np.array([run[f"hat_{name}"] - run[name] for name in ("angle", "speed", "torque")])
    rms = np.sqrt((errors[:, 1000:] ** 2).mean(axis=1))
    size = 0.01 * np.sqrt(0.01)
    assert (rms <= density(design)[:, 0] * size * 1.05).all()
    p = design.spec.augmented.doubles
    hanging = EXPONENTIALS.norms(p.A + L1 @ p.C + p.Bf @ p.Cq, L1, np.eye(3))[:, 0]
    assert rms == pytest.approx(hanging * size, rel=0.08)


# What is shown


def test_the_density_is_shown_for_each_output_and_is_numerical():
    system = {**FIRST, "C": [[1], [1]], "D": [[0, 0.01], [0, 0]], "outputs": ["fine", "coarse"]}
    design = analysed(system, {"L1": [[-3, -1]]})
    rows = [text for name, text in design.table() if name == "noise density"]
    ends = [f"rms for 1 unit/sqrt(Hz) of {output}" for output in ("fine", "coarse")]
    assert rows == [f"x1 0.949   {ends[0]}", f"x1 0.316   {ends[1]}"]
    assert "analysis" in design.written()["numerical"]


def test_in_samples_one_row_says_both():
    system = {"time": "discrete", "A": [[0.9]], "B": [[1, 0]], "C": [[1]], "D": [[0, 1]]}
    design = od.solve(od.Spec(system=system, observer={"type": "l2", "rho": 0.99, "gains": {"L1": [[-0.4]]}}))
    rows = dict(design.table())
    assert "noise density" not in rows
    assert rows["noise rms"] == "x1 0.462   rms for 1 unit rms of y1"
