"""Gains by descent from the central ones of Riccati equations."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.rods import beam, chain, family, heat, rod_spec

import obsdesign as od
from obsdesign.dissipation import smaller
from obsdesign.dissipation.elimination import ROOM, central_gains, form_of, least_of, of_one
from obsdesign.families.incremental.request import posed
from obsdesign.lmi.formula import in_floats
from obsdesign.riccati import descent
from obsdesign.riccati.descent import Barrier, Peak, descended

LINF = {"type": "linf", "alpha": 0.05}


def begun(problem):
    """Form, gamma^2, central gain, its scales and what the peak has to keep, 5 % above the least gamma."""
    form = form_of(problem)
    found, values = least_of(form, problem)
    gamma = 1.05 * math.sqrt(found.mu)
    scales = np.array([scale.item() for scale in of_one(problem, found.mu, values).values()])
    level = (gamma * (1 - ROOM)) ** 2
    first = next(central_gains(problem, gamma, scales))
    return form, level, first, scales, Peak(problem.H, level) if problem.about.peak else None


def in_doubles(text):
    return in_floats(posed(od.load(text)))


def test_between_the_solutions_of_one_state_is_their_difference():
    """2 (a + alpha + l c) P + P^2 (b^2 + l^2 d^2) / gamma^2 + 1 = 0."""
    a, alpha, b, c, d, gamma, gain = -1.0, 0.1, 1.0, 1.0, 0.3, 0.8, -0.5
    slope, square = 2 * (a + alpha + gain * c), (b**2 + gain**2 * d**2) / gamma**2
    small, large = sorted(np.roots([square, slope, 1]))
    form = form_of(family("l2", a, [[b, 0]], c, [[0, d]], alpha))
    found = Barrier(form, gamma**2).at(np.array([[gain]]), np.zeros(0))
    assert found.value == pytest.approx(-math.log(large - small))
    assert found.largest.item() == pytest.approx(large)
    assert found.smallest.item() == pytest.approx(small)
    assert Barrier(form, 0.1).at(np.array([[gain]]), np.zeros(0)) is None


@pytest.mark.parametrize("text", [chain(8), beam(8), chain(8, **LINF)], ids=["chain", "beam", "peak"])
def test_the_gradient_of_the_barrier_is_that_of_its_differences(text):
    problem = in_doubles(text)
    form, level, first, scales, peak = begun(problem)
    noisy = form.noisy(np.full(form.n, 0.01), np.zeros(len(form.C)))
    barrier = Barrier(noisy, 1.0 if peak else level, peak)
    at = barrier.at(first.L, scales)
    rng = np.random.default_rng(0)
    for _ in range(3):
        by_gain, by_scales = (
            1e-5 * rng.normal(size=first.L.shape) * first.L,
            1e-5 * rng.normal(size=len(scales)) * scales,
        )
        up = barrier.at(first.L + by_gain, scales + by_scales)
        down = barrier.at(first.L - by_gain, scales - by_scales)
        slope = float(np.sum(at.by_gain * by_gain) + at.by_scales @ by_scales)
        assert (up.value - down.value) / 2 == pytest.approx(slope, rel=2e-4, abs=1e-7)


@pytest.mark.parametrize(("text", "inequalities"), [(heat(12), 263.3), (beam(16), 158.6)], ids=["heat", "beam"])
def test_a_gain_by_descent_is_smaller_than_what_inequalities_find(text, inequalities):
    """At the same gamma; and its P solves the inequality with the gain given."""
    problem = in_doubles(text)
    form, level, first, scales, _ = begun(problem)
    made, others = descended(form, float(problem.rate), level, first, scales)
    assert made.size < inequalities < first.size
    given = form.injected(made.L).scaled(others)
    Q, across = given.at(level), made.P @ given.B
    rows = np.block([[made.P @ given.A + given.A.T @ made.P, across], [across.T, np.zeros((across.shape[1],) * 2)]]) + Q
    size = 1 / np.sqrt(np.abs(np.diag(rows)))
    assert np.linalg.eigvalsh(rows * np.outer(size, size))[-1] < 0
    assert np.linalg.eigvalsh(made.P)[0] > 0


def test_a_gain_by_descent_does_not_depend_on_units():
    """But for where the descent ends, and for the small noise, which is that of balanced units."""
    problem = in_doubles(beam(8))
    form, level, first, scales, _ = begun(problem)
    known, _ = descended(form, float(problem.rate), level, first, scales)
    s, y, f, z = 1e3, 1e-2, 1e2, 10.0  # of x, y, f and z
    rows = np.concatenate([np.full(form.n, 1 / s), np.full(3, f), np.ones(3)])
    Qc, Qm, Qs = (z**2 * Q * np.outer(rows, rows) for Q in (form.Qc, form.Qm, form.Qs))
    other = replace(
        form, B=s * form.B * rows[form.n :], C=y * form.C / s, D=y * form.D * rows[form.n :], Qc=Qc, Qm=Qm, Qs=Qs
    )
    made, _ = descended(other, float(problem.rate), level, replace(first, L=first.L * s / y), scales)
    assert made.size * y / s == pytest.approx(known.size, rel=0.05)
    assert known.size < 0.6 * first.size


def test_of_a_central_gain_without_a_solution_nothing_is_made():
    problem = in_doubles(chain(8))
    form, level, first, scales, _ = begun(problem)
    assert descended(form, float(problem.rate), level / 2, first, scales) is None


def test_a_peak_is_kept_by_a_solution_near_the_largest():
    problem = in_doubles(chain(8, **LINF))
    form, level, first, scales, peak = begun(problem)
    made, _ = descended(form, float(problem.rate), 1.0, first, scales, peak)
    assert made.size < 0.6 * first.size
    assert np.linalg.eigvalsh(problem.H @ np.linalg.solve(made.P, problem.H.T))[-1] <= level


def test_what_is_not_proved_is_not_shipped(monkeypatch):
    """A gain that is too small: the central one is in its place, and the note says so."""
    found = smaller.by_descent

    def wrong(*given):
        made = found(*given)
        return replace(made, gain=replace(made.gain, L=made.gain.L / 2))

    monkeypatch.setattr(smaller, "by_descent", wrong)
    made = od.solve(od.load(rod_spec(12)))
    assert made.proved
    assert any("the gain is the central one" in note for note in made.notes)


def test_digits_that_doubles_refute_are_not_proved_in_rationals(monkeypatch):
    """Of a gain that is too small only the most digits are, before the central one is taken."""
    made, tried, found = smaller.certify, [], smaller.by_descent

    def counted(family, *given):
        certificate = made(family, *given)
        tried.append((float(np.linalg.norm(in_floats(family.L1), 2)), certificate.holds))
        return certificate

    def wrong(*given):
        candidate = found(*given)
        return replace(candidate, gain=replace(candidate.gain, L=candidate.gain.L / 2))

    monkeypatch.setattr(smaller, "by_descent", wrong)
    monkeypatch.setattr(smaller, "certify", counted)
    assert od.solve(od.load(rod_spec(12))).proved
    (small, failed), *others = tried
    assert not failed
    assert all(size > 1.5 * small for size, _ in others)
    assert others[-1][1]


def test_the_quasi_newton_method_stays_in_its_domain(monkeypatch):
    """x - log x, and a curved valley beside it: the minimum is at 1."""
    monkeypatch.setattr(descent, "ENDED", 1e-10)

    def f(x):
        a, b = 1e-2 + x[0], x[1]  # from 0.01, near the edge
        if a <= 0:
            return None
        return a - math.log(a) + 50 * (b - a**2) ** 2, np.array([1 - 1 / a - 200 * a * (b - a**2), 100 * (b - a**2)])

    x = descent.minimised(f, 2, 300)
    assert (x[0] + 1e-2, x[1]) == pytest.approx((1, 1), abs=1e-4)
