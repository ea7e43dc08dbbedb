"""What is proved of sporadic observers: kept along random runs, denied when tampered with, and ended where it must."""

import json
from dataclasses import replace

import numpy as np
import pytest
from support.functions import exact
from support.running import simulate_sporadic
from support.sporadic import DESIGN, LINK, LINK_V, OSCILLATOR, OSCILLATOR_V, PREDICTOR, free, paper, read
from support.sweep import seeds

from obsdesign.expressions import parse
from obsdesign.lmi.formula import printed
from obsdesign.simulate import Sampling, Schedule
from obsdesign.trial import Noise


def holds(run):
    return [bound["holds"] for bound in run.summary["bounds"]]


def inequality(spec, found, V, chi, ell, tau):
    """M(tau) of (30)."""
    A, N, C, B, S = (
        np.array(m, dtype=float) for m in (spec.plant.A, spec.plant.B, spec.plant.C, spec.plant.Bf, spec.plant.Cq)
    )
    L, H, Cp, e = found["L"], found["H"], spec.H.astype(float), np.exp(V.delta * tau)
    P1, P2, nw, ns = V.P1, V.P2, N.shape[1], B.shape[1]
    first = P1 @ (A - L @ C)
    second = P2 @ (C @ L + H)
    return np.block(
        [
            [
                first + first.T + 2 * V.decay * P1 + Cp.T @ Cp + chi * ell**2 * S.T @ S,
                P1 @ L + e * (C @ A - C @ L @ C - H @ C).T @ P2,
                P1 @ N,
                P1 @ B,
            ],
            [
                (P1 @ L + e * (C @ A - C @ L @ C - H @ C).T @ P2).T,
                e * (second + second.T + (2 * V.decay - V.delta) * P2),
                e * P2 @ C @ N,
                e * P2 @ C @ B,
            ],
            [N.T @ P1, e * N.T @ C.T @ P2, -(V.gamma**2) * np.eye(nw), np.zeros((nw, ns))],
            [B.T @ P1, e * B.T @ C.T @ P2, np.zeros((ns, nw)), -chi * np.eye(ns)],
        ]
    )


@pytest.mark.parametrize(
    ("text", "found", "V", "ell"), [(OSCILLATOR, DESIGN, OSCILLATOR_V, 0.0), (LINK, PREDICTOR, LINK_V, 3.33)]
)
def test_the_storage_functions_of_these_tests_satisfy_the_inequalities_of_theorem_2(text, found, V, ell):
    spec = read(text)

    def largest(chi):
        return max(np.linalg.eigvalsh(inequality(spec, found, V, chi, ell, tau))[-1] for tau in (0, V.T2))

    assert min(np.linalg.eigvalsh(P)[0] for P in (V.P1, V.P2)) > 0
    assert min(map(largest, np.geomspace(1e-2, 1e2, 200))) < 0


@seeds(20)
def test_along_random_sequences_v_falls_at_its_rate_and_the_gain_is_kept(seed):
    random = np.random.default_rng(seed)
    sampling = Sampling(0.205, 0.41, "random", theta0=random.normal(size=1))
    start = {"x0": random.normal(size=2), "xhat0": random.normal(size=2), "seed": seed, "points": 200}
    run = simulate_sporadic(free(**start), DESIGN, sampling, OSCILLATOR_V)
    descent = np.diff(np.log(run.steps.V) + 2 * OSCILLATOR_V.decay * run.steps.t)
    assert descent.max() < 1e-12
    assert (descent < -1e-6).any()
    assert holds(run) == [True] * 5
    assert (run.steps.distance <= run.steps.distance_bound).all()
    forced = simulate_sporadic(
        read(OSCILLATOR, seed=seed, points=200), DESIGN, Sampling(0.205, 0.41, "random"), OSCILLATOR_V
    )
    assert forced.summary["z_norm2"] <= OSCILLATOR_V.gamma * forced.summary["v_norm2"]
    assert holds(forced) == [True] * 4


@seeds(3)
def test_along_random_sequences_a_nonlinear_plant_keeps_its_guarantee(seed):
    x0 = np.random.default_rng(seed).normal(size=4)
    still = read(LINK, x0=x0, w=None, horizon=3.0, seed=seed)
    assert holds(simulate_sporadic(still, PREDICTOR, Sampling(0.05, 0.1, "random"), LINK_V)) == [True] * 5
    forced = simulate_sporadic(read(LINK, horizon=3.0, seed=seed), PREDICTOR, Sampling(0.05, 0.1, "random"), LINK_V)
    assert 0 < forced.summary["z_norm2"] < LINK_V.gamma * forced.summary["v_norm2"]
    assert holds(forced) == [True] * 4


@seeds(4)
def test_noise_keeps_its_bounds_with_the_constants_of_the_corrected_theorem(seed):
    noise = Noise("gaussian" if seed % 2 else "uniform", np.array([0.5]), 1.0)
    run = simulate_sporadic(read(OSCILLATOR, seed=seed, noise=noise), DESIGN, paper(0.205, 0.41), OSCILLATOR_V)
    assert holds(run) == [True] * 3
    stability = run.summary["bounds"][-1]
    rate, T1 = OSCILLATOR_V.decay, OSCILLATOR_V.T1
    rho1 = np.linalg.eigvalsh(OSCILLATOR_V.P1)[0]
    omega2 = 49.1878 * np.exp(2.995 * 0.41)
    after = np.diff(run.steps.j, prepend=0) > 0
    eta = (run.steps.y[:, 0] - run.steps.xi[:, 0])[after]
    sup = np.abs(eta[run.schedule.received <= stability["time"]]).max(initial=0)
    w = 36 / np.sqrt(2 * rate * rho1)
    added = np.sqrt(omega2 * np.exp(2 * rate * T1) / (np.exp(2 * rate * T1) - 1) / rho1) * sup
    assert stability["bound"] == pytest.approx(w + added, rel=1e-3)


def test_the_sum_in_the_bound_on_noise_is_attained_by_measurements_every_t1():
    rate, T1 = 0.05, 0.205
    times = T1 * np.arange(1, 2001)
    discounted = np.exp(-2 * rate * (times[-1] - times)).sum()
    assert discounted == pytest.approx(1 / -np.expm1(-2 * rate * T1), rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "broken"),
    [({"decay": 2.0}, "never increases"), ({"delta": 0.0}, "never increases"), ({"P1": np.eye(2)}, "never increases")],
)
def test_a_guarantee_with_a_wrong_storage_function_is_denied(changes, broken):
    run = simulate_sporadic(free(), DESIGN, paper(0.205, 0.41), replace(OSCILLATOR_V, **changes))
    assert not all(holds(run))
    assert any(broken in bound["name"] and not bound["holds"] for bound in run.summary["bounds"])


def test_a_gain_that_is_too_small_is_denied():
    run = simulate_sporadic(read(OSCILLATOR), DESIGN, paper(0.205, 0.41), replace(OSCILLATOR_V, gamma=0.9))
    broken = [bound["name"] for bound in run.summary["bounds"] if not bound["holds"]]
    assert "norm2(z) <= sqrt(V(0) + gamma^2 norm2(w)^2)" in broken


def test_the_same_seed_gives_the_same_run_and_another_seed_another():
    noise = Noise("gaussian", np.array([0.1]), 1.0)
    first, again, other = (
        simulate_sporadic(free(seed=seed, noise=noise), DESIGN, Sampling(0.205, 0.41, "random", dropout=0.3), None)
        for seed in (1, 1, 2)
    )
    assert (first.table()[1] == again.table()[1]).all()
    assert (first.schedule.lost == again.schedule.lost).all()
    assert not np.isin(first.schedule.received, other.schedule.received).any()


def test_a_lost_measurement_ends_the_guarantee_when_the_next_one_is_overdue():
    run = simulate_sporadic(free(seed=3), DESIGN, Sampling(0.205, 0.41, dropout=0.1), OSCILLATOR_V)
    sampling = run.summary["sampling"]
    assert sampling["lost"] == len(run.schedule.lost) > 0
    assert sampling["longest"] >= 2 * 0.41 - 1e-9
    lost = run.schedule.lost[0]
    assert run.until == pytest.approx(lost)  # T2 after the last one, just when the lost one should have come
    assert f"overdue at t = {lost:.6g}" in run.summary["bounds_omitted"]
    assert all(bound.get("time", 0) < lost for bound in run.summary["bounds"])
    assert all(holds(run))
    json.dumps(run.summary, allow_nan=False)


def test_a_random_law_beyond_the_t2_of_the_guarantee_is_overdue_at_some_time():
    run = simulate_sporadic(free(), DESIGN, Sampling(0.205, 0.6, "random"), OSCILLATOR_V)
    first = np.flatnonzero(run.schedule.intervals > 0.41)[0]
    assert run.until == pytest.approx(run.schedule.received[first] - run.schedule.intervals[first] + 0.41)
    assert run.summary["sampling"]["outside"] == (run.schedule.intervals > 0.41).sum() + (
        run.schedule.horizon - run.schedule.received[-1] > 0.41
    )


def test_intervals_below_t1_end_the_bound_on_noise_alone():
    noise = Noise("uniform", np.array([0.1]), 1.0)
    run = simulate_sporadic(
        read(OSCILLATOR, noise=noise), DESIGN, Sampling(0.205, 0.41, parse("0.1", ["t"])), OSCILLATOR_V
    )
    assert run.until == np.inf
    assert run.summary["sampling"]["outside"] == 395
    assert "voids the bound on the effect of noise" in run.summary["bounds_omitted"]
    assert "t = 0.51 on" in run.summary["bounds_omitted"]
    decay, gain, stability = run.summary["bounds"]
    assert decay["holds"]
    assert gain["holds"]
    assert stability["time"] < 0.51


def test_the_first_measurement_may_come_at_any_time_up_to_t2():
    assert Schedule(np.array([0.1, 0.4]), np.array([]), 0.2, 0.4, 0.5).crowded == np.inf
    assert Schedule(np.array([0.3, 0.4]), np.array([]), 0.2, 0.4, 0.5).crowded == 0.4
    assert Schedule(np.array([0.4]), np.array([]), 0.2, 0.4, 0.8).until == np.inf
    assert Schedule(np.array([0.5]), np.array([]), 0.2, 0.4, 0.8).until == 0.4
    assert Schedule(np.array([0.3]), np.array([]), 0.2, 0.4, 0.8).until == pytest.approx(0.7)


def test_the_bound_on_v_is_what_is_left_of_its_start_and_what_the_noise_has_added():
    still = simulate_sporadic(free(), DESIGN, paper(0.205, 0.41), OSCILLATOR_V)
    assert still.V_bound == pytest.approx(still.V[0] * np.exp(-0.1 * still.t), rel=1e-12)
    noise = Noise("uniform", np.array([0.5]), 1.0)
    noisy = free(x0=np.zeros(2), xhat0=np.zeros(2), noise=noise)
    run = simulate_sporadic(noisy, DESIGN, paper(0.205, 0.41), OSCILLATOR_V)
    steps, t = run.steps, run.schedule.received
    after = np.diff(steps.j, prepend=0) > 0
    eta = (steps.y[:, 0] - steps.xi[:, 0])[after]
    tau = np.append(t[1:], t[-1] + 0.41) - t
    added = np.exp(2.995 * tau) * 49.1878 * eta**2
    assert run.V_bound[-1] == pytest.approx((np.exp(-0.1 * (10 - t)) * added).sum(), rel=1e-9)
    assert run.summary["bounds"][1]["bound"] == pytest.approx(np.sqrt(added.sum()), rel=1e-9)
    assert (steps.V[after] <= (added + steps.V[np.flatnonzero(after) - 1]) * (1 + 1e-9)).all()


def test_a_run_that_diverges_after_its_guarantee_has_ended_keeps_it():
    run = simulate_sporadic(free(horizon=100.0), DESIGN, Sampling(0.205, 0.41, period=1.4), OSCILLATOR_V)
    assert run.distance[-1] > 5 * run.distance[0]
    assert all(holds(run))


def test_a_period_beyond_t2_is_overdue_from_t2_on():
    run = simulate_sporadic(free(), DESIGN, Sampling(0.205, 0.41, period=0.5), OSCILLATOR_V)
    assert run.until == pytest.approx(0.41)
    assert run.summary["sampling"]["outside"] == 20  # the interval to the end of the run is whole, too
    assert run.schedule.received == pytest.approx(0.5 * np.arange(1, 20))


def test_a_run_that_leaves_the_region_of_a_nonlinearity_leaves_its_guarantee():
    spec = read(LINK, x0=np.array([0, 0, 0.5, 0]), w=None, horizon=3.0)
    block = replace(spec.nonlinearities[0], region=(exact(-0.1, 0.6),))
    local = replace(spec, nonlinearities=(block,))
    run = simulate_sporadic(local, PREDICTOR, Sampling(0.05, 0.1), LINK_V)
    assert run.left[0].time == run.until < 3
    assert run.xi[run.t < run.until, 2].min() > -0.1
    assert not run.summary["validity"]["holds"]
    assert "left its region" in run.summary["bounds_omitted"]
    assert all(bound.get("time", 0) < run.until for bound in run.summary["bounds"])


def test_what_an_exact_run_says_is_plain_json():
    run = simulate_sporadic(read(OSCILLATOR), DESIGN, paper(0.205, 0.41), OSCILLATOR_V)
    assert json.loads(json.dumps(run.summary, allow_nan=False)) == run.summary


@pytest.mark.parametrize(
    "powers", [(28, 28, 28, 28), (-20, -20, -20, -20), (0, 0, 0, 28), (20, 0, -20, 0), (28, 0, 0, 0)]
)
@pytest.mark.parametrize(
    ("text", "found", "V"), [(OSCILLATOR, DESIGN, OSCILLATOR_V), (LINK, PREDICTOR, LINK_V)], ids=["linear", "nonlinear"]
)
@pytest.mark.parametrize("w", [True, False])
def test_a_run_is_the_same_in_every_unit_of_the_states(text, found, V, powers, w):
    plain = read(text, horizon=10.0, **({} if w else {"w": None, "x0": np.eye(len(V.P1))[0]}))
    plant = plain.plant
    unit = 2.0 ** np.array(powers[: plant.n])
    A, B, C, Bf, Cq = (np.array(M, float) for M in (plant.A, plant.B, plant.C, plant.Bf, plant.Cq))
    scaled = replace(
        plain,
        plant=replace(
            plant,
            A=printed(A * unit[:, None] / unit),
            B=printed(B * unit[:, None]),
            C=printed(C / unit),
            Bf=printed(Bf * unit[:, None]),
            Cq=printed(Cq / unit),
        ),
        H=printed(plain.H.astype(float) / unit),
        simulation=replace(plain.simulation, x0=plain.simulation.x0 * unit, xhat0=plain.simulation.xhat0 * unit),
    )
    gains = found | {"L": found["L"] * unit[:, None]}
    law = paper(V.T1, V.T2)
    one = simulate_sporadic(plain, found, law, V)
    other = simulate_sporadic(scaled, gains, law, replace(V, P1=V.P1 / unit / unit[:, None]))
    assert (other.status, holds(other)) == ("done", holds(one))
    assert other.e / unit == pytest.approx(one.e, abs=1e-7 * np.abs(one.e).max())
