"""The figure of a run with sporadic measurements: panels, marks, bounds, and what is shaded."""

from dataclasses import replace

import numpy as np
import pytest
from support.running import simulate_sporadic
from support.sporadic import DESIGN, OSCILLATOR_V

from obsdesign.plot.hybrid import lowest
from obsdesign.plot.run import run_figure, run_sheet
from obsdesign.reading import loads
from obsdesign.simulate import Sampling

SPEC = """
obsdesign: 1
name: Cost $5
observer: {type: l2, L2: 0, alpha: 0.1}
system: {A: [[0, 1], [-4, 0]], B: [[1], [0]], C: [[1, 0]], states: [angle, speed], units: {angle: rad}}
simulation: {horizon: 8, x0: [1, 1], w: ["where(t < 2, 1, 0)"], points: 200}
"""


def sheet(sampling, guarantee=OSCILLATOR_V, horizon=8.0, noise=0.0):
    """Spec, run and figure with every panel."""
    text = SPEC.replace("points", f"noise: {{type: uniform, amplitude: [{noise}], period: 1}}, points")
    spec = loads(text if noise else SPEC)
    spec = replace(spec, simulation=replace(spec.simulation, horizon=horizon))
    run = simulate_sporadic(spec, DESIGN, sampling, guarantee)
    return spec, run, run_sheet(run, every=True)


def lines(axes):
    """Lines of a panel by label."""
    return {line.get_label(): line for line in axes.get_lines()}


def marks(axes, marker):
    """Lines of a panel that are drawn with a marker."""
    return [line for line in axes.get_lines() if line.get_marker() == marker]


def panel(figure, what):
    """Panel with something in its label."""
    return next(axes for axes in figure.axes if what in axes.get_ylabel())


def test_every_panel_says_what_it_shows():
    _, run, figure = sheet(Sampling(0.205, 0.41))
    labels = [axes.get_ylabel() for axes in run_sheet(run).axes]
    assert labels == ["estimates", "|error|", "y1", "w1"]
    labels += ["V(e)", "correction θ", "|(e, d)|, d = C e - θ", "sampling interval [s]"]
    assert [axes.get_ylabel() for axes in figure.axes] == labels
    assert all(axes.get_xlabel() == "t [s]" for axes in figure.axes)
    below = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"true", "estimate", "measured", "proved bound on the error", "proved bound on |(e, d)|"} <= below
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == ["angle [rad]", "speed"]
    assert [text.get_text() for text in panel(figure, "θ").get_legend().get_texts()] == ["θ of y1"]
    title = figure.get_suptitle()
    assert title.startswith("Cost $5\n")
    assert "all 4 bounds hold" in title
    assert "from zero error" in title


def test_a_figure_is_a_png_that_is_the_same_every_time():
    _spec, run, _ = sheet(Sampling(0.205, 0.41))
    first = run_figure(run)
    assert first[:8] == b"\x89PNG\r\n\x1a\n"
    assert b"tEXtSoftware\0obsdesign" in first  # and no version, which changes
    assert run_figure(run) == first


def test_what_is_measured_is_a_dot_beside_the_output():
    _, run, figure = sheet(Sampling(0.205, 0.41, "random"), noise=0.1)
    (dots,) = [line for line in marks(panel(figure, "y1"), ".") if len(line.get_xdata())]
    assert list(dots.get_xdata()) == pytest.approx(run.schedule.received)
    off = dots.get_ydata() - np.interp(run.schedule.received, run.steps.t, run.steps.y_true[:, 0])
    assert 0.05 < np.abs(off).max() <= 0.1


def test_a_run_that_escapes_is_readable_where_it_begins():
    _spec, run, _ = sheet(Sampling(0.205, 0.41))
    growth = np.exp(4 * run.t)[:, None]
    escaped = replace(run, xi=run.xi + growth, xihat=run.xihat + growth, y_true=run.y_true + growth, status="escape")
    for each, scale in ((run, "linear"), (escaped, "asinh")):
        panels = run_sheet(each).axes
        assert [panels[k].get_yscale() for k in (0, 2)] == [scale] * 2


def test_the_bound_on_an_error_is_that_of_v_with_the_matrix_of_the_error():
    _, run, figure = sheet(Sampling(0.205, 0.41))
    P1 = np.array(OSCILLATOR_V.P1, dtype=float)
    drawn = [line for line in figure.axes[1].get_lines() if line.get_linestyle() == "--" and len(line.get_xdata())]
    for line, reach, e in zip(drawn, np.sqrt(np.diag(np.linalg.inv(P1))), run.steps.e.T, strict=True):
        assert line.get_ydata() == pytest.approx(reach * np.sqrt(run.steps.V_bound), rel=1e-9)
        assert (np.abs(e) <= line.get_ydata()).all()


def test_the_distance_lies_below_its_bound_on_a_logarithmic_axis():
    _, run, figure = sheet(Sampling(0.205, 0.41))
    axes = panel(figure, "|(e, d)|")
    drawn = lines(axes)
    bound, distance = drawn["proved bound on |(e, d)|"], axes.get_lines()[1]
    assert axes.get_yscale() == "log"
    assert bound.get_linestyle() == "--"
    assert (distance.get_ydata() == run.steps.distance).all()
    assert (distance.get_ydata() <= bound.get_ydata()).all()


def test_theta_is_drawn_with_its_jumps():
    _, run, figure = sheet(Sampling(0.205, 0.41))
    t, theta = panel(figure, "θ").get_lines()[0].get_data()
    jump = np.flatnonzero((np.diff(t) == 0) & (np.diff(theta) != 0))
    assert t[jump] == pytest.approx(run.schedule.received)


def test_the_intervals_stand_between_t1_and_t2():
    _, run, figure = sheet(Sampling(0.205, 0.41, "random"))
    axes = panel(figure, "interval")
    (dots,) = marks(axes, ".")
    assert (dots.get_ydata() == np.diff(run.schedule.received, prepend=0)).all()
    limits = sorted(line.get_ydata()[0] for line in axes.get_lines() if line.get_linestyle() == "--")
    assert limits == [0.205, 0.41]


def test_lost_measurements_are_crossed_and_what_is_not_guaranteed_is_shaded():
    _, run, figure = sheet(Sampling(0.205, 0.41, dropout=0.3))
    assert len(run.schedule.lost)
    for axes in (panel(figure, "y1"), panel(figure, "interval")):
        assert (lines(axes)["measurement lost"].get_xdata() == run.schedule.lost).all()
    for axes in figure.axes:
        (shade,) = axes.patches
        assert shade.get_x() == run.until
        assert shade.get_x() + shade.get_width() == pytest.approx(8)
    bound = lines(panel(figure, "|(e, d)|"))["proved bound on |(e, d)|"]
    assert bound.get_xdata()[-1] < run.until
    (error, *_) = [
        line for line in figure.axes[1].get_lines() if line.get_linestyle() == "--" and len(line.get_xdata())
    ]
    assert error.get_xdata()[np.isfinite(error.get_ydata())][-1] < run.until
    said = f"nothing is guaranteed: a measurement is overdue at t = {run.until:.4g}"
    assert said in [text.get_text() for text in figure.legends[0].get_texts()]
    assert f"until t = {run.until:.4g}" in figure.get_suptitle()


def test_a_sampling_within_its_limits_shades_nothing():
    _, _, figure = sheet(Sampling(0.205, 0.41))
    assert not any(axes.patches for axes in figure.axes)


def test_a_broken_bound_is_said_in_the_title():
    _, _, figure = sheet(Sampling(0.205, 0.41), replace(OSCILLATOR_V, gamma=0.1))
    assert "VIOLATED" in figure.get_suptitle()


def test_without_a_guarantee_there_is_no_bound_and_the_title_says_so():
    _, _, figure = sheet(Sampling(0.205, 0.41, dropout=0.3), None)
    assert "proved bound on |(e, d)|" not in lines(panel(figure, "|(e, d)|"))
    assert "no guarantee" in figure.get_suptitle()
    assert not any(axes.patches for axes in figure.axes)


def test_a_run_without_measurements_is_drawn():
    _, run, figure = sheet(Sampling(9, 9.5), None)
    assert len(run.schedule.received) == 0
    assert [axes.get_ylabel() for axes in figure.axes[:4]] == ["estimates", "error", "y1", "w1"]


@pytest.mark.parametrize(
    ("distance", "foot"), [([1, 1e-6], 3e-7), ([0, 2, 1], 0.3), ([0, 0], 0.3), ([1, 1, 0], 0.3), ([1, 1e-40], 3e-17)]
)
def test_the_foot_of_the_distance_is_below_where_it_begins_and_ends(distance, foot):
    assert lowest(np.array(distance, dtype=float)) == pytest.approx(foot)
