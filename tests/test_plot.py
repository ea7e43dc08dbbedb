"""The structure of the figures: axes, labels, legends, data; and that they are pictures."""

import struct
import zlib
from dataclasses import replace

import numpy as np
import pytest
from support.functions import exact
from support.running import simulate

from obsdesign.dissipation.guarantee import EnergyGuarantee
from obsdesign.families.incremental.guarantee import PeakGuarantee
from obsdesign.plot import run_figure, tradeoff_figure
from obsdesign.plot.axis import CLOSEST, growing_axis, linear_threshold, number, symlog_axis
from obsdesign.plot.canvas import ROW, legend_above
from obsdesign.plot.panels import Curve, limits
from obsdesign.plot.run import run_sheet
from obsdesign.plot.tradeoff import curves_sheet, tradeoff_sheet
from obsdesign.reading import loads

HEAD = "obsdesign: 1\nname: Cost $5\nobserver: {type: l2, L2: 0, alpha: 0.1}\n"
MASS = """
system:
  states: [p, s]
  outputs: [y]
  units: {p: m, s: m/s, y: m}
  A: [[0, 1], [-1, -1]]
  B: [[0], [1]]
  C: [[1, 0]]
disturbance: integrator
simulation: {horizon: 5, x0: [1, 0], w: [sin(t)], points: 101}
"""


@pytest.fixture(scope="module")
def mass():
    """A run of a mass with an unknown force, held against what is claimed of it."""
    spec = loads(HEAD + MASS)
    guarantee = EnergyGuarantee(gamma=2, alpha=0.05, mu1=1, mu2=4, P=np.eye(3))
    return simulate(spec, {"L1": np.array([[-5.0], [-8], [-6]]), "L2": np.zeros((0, 1))}, guarantee)


def size(png: bytes) -> tuple[int, int]:
    """Width and height of a PNG whose image data can be decompressed."""
    assert png[:8] == b"\x89PNG\r\n\x1a\n"
    assert b"IEND" in png[-12:]
    data, at = b"", 8
    while at < len(png):
        (length,) = struct.unpack(">I", png[at : at + 4])
        data += png[at + 8 : at + 8 + length] if png[at + 4 : at + 8] == b"IDAT" else b""
        at += 12 + length
    width, height = struct.unpack(">II", png[16:24])
    assert len(zlib.decompress(data)) > width * height
    return width, height


def test_a_run_is_a_png_that_is_the_same_every_time(mass):
    first = run_figure(mass)
    assert size(first) == (1575, int(150 * (1.2 + 3 * 2.35)))
    assert run_figure(mass) == first
    assert b"Software" not in first


def test_every_panel_says_what_it_shows(mass):
    figure = run_sheet(mass)
    panels = figure.axes
    labels = ["p [m]", "s [m/s]", "w1", "state errors", "unknown-input errors", "V(e) = e' P e"]
    assert [axes.get_ylabel() for axes in panels] == labels
    assert all(axes.get_xlabel() == "t [s]" for axes in panels)
    assert [axes.get_legend() is not None for axes in panels] == [False] * 3 + [True] * 2 + [False]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["true", "estimate", "proved bound"]
    assert [text.get_text() for text in panels[3].get_legend().get_texts()] == ["e_p [m]", "e_s [m/s]"]
    assert [axes.get_yscale() for axes in panels] == ["linear"] * 3 + ["symlog", "linear", "log"]
    title = figure.get_suptitle()
    assert title.startswith(r"Cost \$5")
    assert r"$\gamma$ = 2 from zero error (this run begins with an error)" in title
    assert [text.get_text() for text in panels[3].texts] == [r"logarithmic beyond ±0.1"]
    assert not panels[4].texts


def test_the_truth_is_solid_and_the_estimate_dashed(mass):
    run = mass
    true, estimate = run_sheet(mass).axes[0].get_lines()
    assert true.get_linestyle() == "-"
    assert estimate.get_linestyle() == "--"
    assert true.get_color() != estimate.get_color()
    assert (true.get_ydata() == run.xi[:, 0]).all()
    assert (estimate.get_ydata() == run.xihat[:, 0]).all()


def test_errors_are_drawn_at_the_steps_and_the_bound_lies_above_v(mass):
    run = mass
    panels = run_sheet(mass).axes
    assert (panels[3].get_lines()[1].get_ydata() == run.steps.e[:, 1]).all()
    assert (panels[4].get_lines()[0].get_ydata() == run.steps.w_error[:, 0]).all()
    bound, V = (line.get_ydata() for line in panels[5].get_lines())
    assert (bound * (1 + 1e-6) >= V).all()


def test_a_local_guarantee_is_drawn_with_its_region_and_up_to_where_the_run_leaves_it():
    text = (
        HEAD
        + """
system: {A: [[-1]], B: [[1]], C: [[1]]}
nonlinearities: [{f: q**3, type: monotone, Bf: [-0.01], Cq: [1]}]
simulation: {horizon: 4, x0: [0], w: [4*t], points: 101}
"""
    )
    spec = loads(text)
    spec = replace(spec, nonlinearities=(replace(spec.nonlinearities[0], region=(exact(-1.0, 1.0),)),))
    guarantee = PeakGuarantee(gamma=1, alpha=1, mu1=1, mu2=1, P=np.eye(1))
    run = simulate(spec, {"L1": np.array([[-2.0]]), "L2": np.zeros((1, 1))}, guarantee)
    figure = run_sheet(run)
    panels = {axes.get_ylabel(): axes for axes in figure.axes}
    argument, storage = panels["q1 of nonlinearities[0]"], panels["V(e) = e' P e"]
    bounds = [line for line in argument.get_lines() if line.get_label() == "limit of the region"]
    assert sorted(line.get_ydata()[0] for line in bounds) == [-1.0, 1.0]
    assert "limit of the region" in [text.get_text() for text in figure.legends[0].get_texts()]
    assert storage.get_lines()[0].get_xdata()[-1] < run.left[0].time < storage.get_lines()[1].get_xdata()[-1]
    title = figure.get_suptitle()
    assert "outside [-1, 1]" in title
    assert "local" in title
    assert r"$\sup|z|$" in title


def test_a_broken_bound_is_said_in_the_title(mass):
    spec, guarantee = mass.spec, mass.guarantee
    gains = {"L1": np.array([[-5.0], [-8], [-6]]), "L2": np.zeros((0, 1))}
    false = replace(guarantee, alpha=9.0, mu2=1e-4, gamma=1e-2)
    assert "VIOLATED" in run_sheet(simulate(spec, gains, false)).get_suptitle()


def test_without_a_guarantee_there_is_no_bound_and_the_title_says_so(mass):
    run = mass
    steps = replace(run.steps, V=None, V_bound=None)
    figure = run_sheet(replace(run, guarantee=None, V=None, V_bound=None, steps=steps))
    assert [axes.get_ylabel() for axes in figure.axes][-1] == "unknown-input errors"
    assert "no guarantee" in figure.get_suptitle()


@pytest.mark.parametrize(("status", "word"), [("escape", "ESCAPE"), ("stall", "STALLED")])
def test_a_run_that_ended_early_says_so(mass, status, word):
    title = run_sheet(replace(mass, status=status, time=1.25)).get_suptitle()
    assert f"{word} at t = 1.25 s: valid until then" in title


def damped(n):
    """Figure of n states, each of which decays."""
    A = (-np.eye(n)).tolist()
    C = [[1] + [0] * (n - 1)]
    text = f"system: {{A: {A}, C: {C}}}\nsimulation: {{horizon: 1, x0: {list(range(n))}}}"
    spec = loads(HEAD + text)
    run = simulate(spec, {"L1": np.zeros((n, 1)), "L2": np.zeros((0, 1))}, None)
    return run, run_sheet(run)


def test_many_states_share_panels_of_at_most_eight_curves():
    run, figure = damped(20)
    assert len(figure.axes) == 5 + 3
    assert max(len(axes.get_legend().get_texts()) for axes in figure.axes) <= 7
    shown = [text.get_text() for axes in figure.axes[:5] for text in axes.get_legend().get_texts()]
    assert shown == list(run.states)


@pytest.mark.parametrize(("n", "rows"), [(1, [1]), (2, [2]), (3, [3]), (4, [2, 2]), (6, [3, 3]), (8, [2, 3, 3])])
def test_panels_stand_in_rows_of_at_most_three_of_the_same_width(n, rows):
    _, figure = damped(n)
    cells = [axes.get_subplotspec() for axes in figure.axes if axes.get_ylabel() != "state errors"]
    assert [sum(cell.rowspan.start == row for cell in cells) for row in range(len(rows))] == rows
    assert max(rows) <= ROW
    assert all(len(cell.colspan) * rows[cell.rowspan.start] == cell.get_gridspec().ncols for cell in cells)


@pytest.mark.parametrize("n", [4, 8, 12])
def test_no_legend_or_label_touches_another_panel(n):
    _, figure = damped(n)
    figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in figure.axes] + [legend.get_window_extent() for legend in figure.legends]
    overlaps = [(a, b) for i, a in enumerate(boxes) for b in boxes[:i] if a.padded(-1).overlaps(b.padded(-1))]
    assert not overlaps
    assert all(box.x0 >= 0 and box.x1 <= figure.bbox.width for box in boxes)


def test_a_legend_with_long_names_has_fewer_columns():
    from matplotlib.figure import Figure

    columns = []
    for name in ("e", "error of the speed of the second joint of the arm"):
        axes = Figure(figsize=(10.5, 4)).add_subplot(1, 3, 1)
        for k in range(4):
            axes.plot([0, 1], label=f"{name}{k}")
        legend_above(axes)
        columns.append(axes.get_legend()._ncols)
    assert columns == [4, 1]


def test_an_initial_transient_does_not_hide_the_signal():
    t = np.linspace(0, 1, 1001)
    estimate = np.where(t < 0.01, 1e7, np.sin(t))
    low, high, note = limits([Curve("w", np.sin(t), estimate)])
    assert -0.2 < low < 0
    assert 0.84 < high < 1.1
    assert r"10^{7}" in note
    _, top, note = limits([Curve("w", np.sin(t), estimate / 1e7 * 1.2)])
    assert (top > 1.2, note) == (True, "")
    assert "reaches -9" in limits([Curve("w", np.sin(t), np.where(t < 0.01, -9.0, np.sin(t) + 0.01))])[2]
    assert limits([Curve("w", np.ones(3), None)])[:2] == pytest.approx((0.9, 1.1))


def test_an_initial_transient_beside_which_the_signal_is_seen_is_drawn_whole():
    t = np.linspace(0, 1, 1001)
    truth = 5 + np.sin(t)
    low, high, note = limits([Curve("x1", truth, truth * (1 - np.exp(-100 * t)))])
    assert (low < 0, high > 5.8, note) == (True, True, "")
    low, high, note = limits([Curve("x1", np.full_like(t, 5.0), np.where(t < 0.01, -40.0, 5.0))])
    assert (low < -40, note) == (True, "")


def test_a_symmetric_log_axis_reads_a_peak_of_1e7_and_an_error_of_1e_minus_6():
    t = np.linspace(0, 1, 500)
    error = 1e7 * np.exp(-30 * t) + 1e-6
    threshold = linear_threshold([error])
    assert 1e-6 <= threshold <= 1e-5
    assert linear_threshold([np.zeros(5)]) > 0


@pytest.mark.parametrize(
    ("axis", "least", "low", "high"),
    [
        (symlog_axis, 1e-5, -1e7, 1e7),
        (symlog_axis, 1e-5, 0.0, 1e7),
        (symlog_axis, 1e-4, -2e-4, 3.0),
        (symlog_axis, 0.1, -5.0, 0.02),
        (symlog_axis, 1e-14, -1.0, 1.0),
        (growing_axis, 1.0, -300.0, 0.1),
        (growing_axis, 10.0, -2.0, 4e7),
    ],
)
def test_ticks_of_a_signed_logarithmic_axis_do_not_collide(axis, least, low, high):
    from matplotlib.figure import Figure

    axes = Figure().add_subplot()
    axes.plot([0, 1], [low, high])
    axis(axes, least, low, high)
    ticks = axes.get_yticks()
    heights = axes.transAxes.inverted().transform(axes.transData.transform([(0, tick) for tick in ticks]))[:, 1]
    assert 0 in ticks
    assert 3 <= len(ticks) <= 1 / CLOSEST + 1
    assert np.diff(heights).min() > 0.085
    assert min(ticks) >= low
    assert max(ticks) <= high


def test_errors_of_about_one_size_are_drawn_on_a_linear_axis():
    from matplotlib.figure import Figure

    axes = Figure().add_subplot()
    axes.plot([0, 1], [2.0, -3.0])
    symlog_axis(axes, 1.0, -3.0, 2.0)
    assert axes.get_yscale() == "linear"
    assert len(axes.get_yticks()) > 3


def test_numbers_are_written_with_powers_of_ten():
    assert [number(v) for v in (0.0211, -375, 114321.0)] == ["0.0211", "-375", r"$1.14 \times 10^{5}$"]


POINTS = [
    {"alpha": 0.1, "gamma": 0.2, "status": "optimal"},
    {"alpha": 1.0, "gamma": 0.3, "status": "optimal"},
    {"alpha": 10.0, "gamma": None, "status": "infeasible"},
    {"alpha": 5.0, "status": "undecided"},
]


def test_a_tradeoff_shows_what_was_solved_what_was_refused_and_what_is_shipped():
    figure = tradeoff_sheet(POINTS, {"alpha": 1.0, "gamma": 0.31}, "Bearing", "alpha", "gamma")
    (axes,) = figure.axes
    lines = {line.get_label(): line for line in axes.get_lines()}
    assert list(lines) == [r"best $\gamma$", "infeasible", "undecided", "shipped"]
    assert list(lines[r"best $\gamma$"].get_xdata()) == [0.1, 1.0]
    assert list(lines["infeasible"].get_xdata()) == [10.0]
    assert axes.get_xscale() == "log"
    assert axes.get_yscale() == "linear"
    assert axes.get_title() == "Bearing"
    assert r"\alpha" in axes.get_xlabel()
    assert axes.get_ylabel() == r"$\gamma$"


def test_curves_are_told_apart_by_their_marks_also_where_they_coincide():
    points = [{"T2": t, "gamma": 2 + t, "certified": {"gamma": 1 + t}} for t in (0.1, 0.2)]
    curves = [{"injection": "dynamic", "relaxation": name, "points": points} for name in ("a", "b")]
    (axes,) = curves_sheet(curves, "T2", "Link").axes
    marks = [line for line in axes.get_lines() if list(line.get_ydata()) == [1.1, 1.2]]
    assert len({line.get_marker() for line in marks}) == 2
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["dynamic, a", "dynamic, b"]
    assert axes.get_ylabel() == r"$\gamma$"
    assert curves_sheet([{**curves[0], "points": []}], "T2", "Link").axes[0].get_legend() is None


@pytest.mark.parametrize("points", [POINTS, POINTS[2:], POINTS[:1]])
def test_a_tradeoff_is_a_png(points):
    assert size(tradeoff_figure(points, None, "Bearing")) == (960, 630)


def test_the_settings_of_the_user_are_left_alone():
    from matplotlib import rcParams

    rcParams["font.size"] = 17.0
    before = tradeoff_figure(POINTS, None, "Bearing")
    assert rcParams["font.size"] == 17.0
    rcParams["font.size"] = 10.0
    assert tradeoff_figure(POINTS, None, "Bearing") == before
