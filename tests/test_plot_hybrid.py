"""The figure of a run with sporadic measurements: panels, marks, bounds, and what is shaded."""

from dataclasses import replace

import numpy as np
import pytest
from support.running import simulate_sporadic
from support.sporadic import DESIGN, OSCILLATOR_V

from obsdesign.plot.hybrid import hybrid_figure, hybrid_sheet, lowest
from obsdesign.reading import loads
from obsdesign.simulate import Sampling

SPEC = """
obsdesign: 1
name: Cost $5
observer: {type: l2, L2: 0, alpha: 0.1}
system: {A: [[0, 1], [-4, 0]], B: [[1], [0]], C: [[1, 0]], states: [angle, speed], units: {angle: rad}}
simulation: {horizon: 8, x0: [1, 1], w: ["where(t < 2, 1, 0)"], points: 200}
"""


def sheet(sampling, guarantee=OSCILLATOR_V, horizon=8.0):
    """Spec, run and figure."""
    spec = loads(SPEC)
    spec = replace(spec, simulation=replace(spec.simulation, horizon=horizon))
    run = simulate_sporadic(spec, DESIGN, sampling, guarantee)
    return spec, run, hybrid_sheet(run)


def lines(axes):
    """Lines of a panel by label."""
    return {line.get_label(): line for line in axes.get_lines()}


def marks(axes, marker):
    """Lines of a panel that are drawn with a marker."""
    return [line for line in axes.get_lines() if line.get_marker() == marker]


def test_every_panel_says_what_it_shows():
    _, run, figure = sheet(Sampling(0.205, 0.41))
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels[:3] == ["angle [rad]", "speed", "w1"]
    assert "theta" in labels[3]
    assert "|(e, d)|" in labels[4]
    assert "interval" in labels[5]
    assert len(labels) == 6
    assert all(axes.get_xlabel() == "t [s]" for axes in figure.axes)
    below = [text.get_text() for text in figure.legends[0].get_texts()]
    assert below == ["true", "estimate", "at a measurement", "proved bound"]
    assert [text.get_text() for text in figure.axes[3].get_legend().get_texts()] == ["theta_y1"]
    title = figure.get_suptitle()
    assert title.startswith("Cost \\$5")
    assert f"{len(run.schedule.received)} measurements" in title
    assert "all 4 bounds hold" in title
    assert "from zero error" in title


def test_a_figure_is_a_png_that_is_the_same_every_time():
    _spec, run, _ = sheet(Sampling(0.205, 0.41))
    first = hybrid_figure(run)
    assert first[:8] == b"\x89PNG\r\n\x1a\n"
    assert b"Software" not in first
    assert hybrid_figure(run) == first


def test_the_estimate_is_marked_where_a_measurement_is_received():
    _, run, figure = sheet(Sampling(0.205, 0.41, "random"))
    for i, axes in enumerate(figure.axes[:2]):
        (dots,) = marks(axes, ".")
        assert (dots.get_xdata() == run.schedule.received).all()
        assert dots.get_ydata() == pytest.approx(np.interp(run.schedule.received, run.t, run.xihat[:, i]))


def test_very_many_measurements_are_not_marked_on_the_estimate():
    _, run, figure = sheet(Sampling(0.02, 0.04))
    assert len(run.schedule.received) == 199
    assert not marks(figure.axes[0], ".")


def test_states_and_theta_of_a_run_that_escapes_are_readable_where_they_begin():
    _spec, run, _ = sheet(Sampling(0.205, 0.41))
    growth = np.exp(4 * run.t)[:, None]
    steps = replace(run.steps, theta=run.steps.theta + 1 + np.exp(4 * run.steps.t)[:, None])
    escaped = replace(run, xi=run.xi + growth, xihat=run.xihat + growth, steps=steps, status="escape")
    for each, scale in ((run, "linear"), (escaped, "asinh")):
        panels = hybrid_sheet(each).axes
        assert [panels[k].get_yscale() for k in (0, 1, 3)] == [scale] * 3


def test_the_distance_lies_below_its_bound_on_a_logarithmic_axis():
    _, run, figure = sheet(Sampling(0.205, 0.41))
    axes = figure.axes[4]
    drawn = lines(axes)
    bound, distance = drawn["proved bound"], axes.get_lines()[1]
    assert axes.get_yscale() == "log"
    assert bound.get_linestyle() == "--"
    assert (distance.get_ydata() == run.steps.distance).all()
    assert (distance.get_ydata() <= bound.get_ydata()).all()


def test_theta_is_drawn_with_its_jumps():
    _, run, figure = sheet(Sampling(0.205, 0.41))
    t, theta = lines(figure.axes[3])["theta_y1"].get_data()
    jump = np.flatnonzero((np.diff(t) == 0) & (np.diff(theta) != 0))
    assert t[jump] == pytest.approx(run.schedule.received)


def test_the_intervals_stand_between_t1_and_t2():
    _, run, figure = sheet(Sampling(0.205, 0.41, "random"))
    (dots,) = marks(figure.axes[5], ".")
    assert (dots.get_ydata() == np.diff(run.schedule.received, prepend=0)).all()
    limits = sorted(line.get_ydata()[0] for line in figure.axes[5].get_lines() if line.get_linestyle() == "--")
    assert limits == [0.205, 0.41]


def test_lost_measurements_are_crossed_and_what_is_not_guaranteed_is_shaded():
    _, run, figure = sheet(Sampling(0.205, 0.41, dropout=0.3))
    assert len(run.schedule.lost)
    for axes in (*figure.axes[:2], figure.axes[5]):
        assert (lines(axes)["measurement lost"].get_xdata() == run.schedule.lost).all()
    for axes in figure.axes:
        (shade,) = axes.patches
        assert shade.get_x() == run.until
        assert shade.get_x() + shade.get_width() == pytest.approx(8)
    bound = lines(figure.axes[4])["proved bound"]
    assert bound.get_xdata()[-1] < run.until
    assert "nothing is guaranteed" in [text.get_text() for text in figure.legends[0].get_texts()]
    title = figure.get_suptitle()
    assert f"until t = {run.until:.4g}" in title
    assert "overdue" in title


def test_a_sampling_within_its_limits_shades_nothing():
    _, _, figure = sheet(Sampling(0.205, 0.41))
    assert not any(axes.patches for axes in figure.axes)


def test_a_broken_bound_is_said_in_the_title():
    _, _, figure = sheet(Sampling(0.205, 0.41), replace(OSCILLATOR_V, gamma=0.1))
    assert "VIOLATED" in figure.get_suptitle()


def test_without_a_guarantee_there_is_no_bound_and_the_title_says_so():
    _, _, figure = sheet(Sampling(0.205, 0.41, dropout=0.3), None)
    assert "proved bound" not in lines(figure.axes[4])
    assert "no guarantee" in figure.get_suptitle()
    assert not any(axes.patches for axes in figure.axes)


def test_a_run_without_measurements_is_drawn():
    _, run, figure = sheet(Sampling(9, 9.5), None)
    assert len(run.schedule.received) == 0
    assert len(figure.axes) == 6


@pytest.mark.parametrize(
    ("distance", "foot"), [([1, 1e-6], 3e-7), ([0, 2, 1], 0.3), ([0, 0], 0.3), ([1, 1, 0], 0.3), ([1, 1e-40], 3e-17)]
)
def test_the_foot_of_the_distance_is_below_where_it_begins_and_ends(distance, foot):
    assert lowest(np.array(distance, dtype=float)) == pytest.approx(foot)
