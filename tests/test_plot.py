"""The structure of the figures: which panels, what is drawn, what is told; and that they are pictures."""

import struct
import zlib
from dataclasses import replace
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from flint import fmpq_mat
from support.commands import run as command
from support.functions import exact
from support.running import simulate

from obsdesign.families.incremental.guarantee import PeakGuarantee
from obsdesign.lmi.formula import approximate, rational
from obsdesign.plot import run_figure, search_figure, tradeoff_figure
from obsdesign.plot.axis import CELLS, CLOSEST, DECADES, finite, growing_axis, levels, plain, span, thinned
from obsdesign.plot.canvas import ROW, compose, legend_above, log_ticks, number, power, style
from obsdesign.plot.panels import BAND, BESIDE, MOST, SETTLED, cut_off, limits, scales
from obsdesign.plot.run import LINE, run_sheet
from obsdesign.plot.signals import Curve
from obsdesign.plot.traded import names
from obsdesign.plot.tradeoff import curves_sheet, tradeoff_sheet
from obsdesign.reading import loads
from obsdesign.tables.text import at_most
from obsdesign.work import solve

HEAD = "obsdesign: 1\nname: Cost $5\nobserver: {type: l2, L2: 0, alpha: 0.1, bounds: {L1: 40}}\n"
MASS = """
system:
  states: [p, s]
  outputs: [y]
  units: {p: m, s: m/s, y: m}
  A: [[0, 1], [-1, -1]]
  B: [[0], [1]]
  C: [[1, 0]]
disturbance: integrator
simulation: {horizon: 5, x0: [1, 0], w: [1 - exp(-t)], points: 101}
"""


@cache
def design():
    """Gains of a mass with an unknown force, and what is proved of them."""
    return solve(loads(HEAD + MASS))


@cache
def inverse():
    """Inverse of P, in doubles."""
    return np.linalg.inv(design().guarantee.doubles)


@pytest.fixture(scope="module")
def mass():
    """A run of the mass."""
    return design().simulate()


def tried(text, guarantee):
    """A run of the gains on another spec, against some guarantee."""
    return simulate(loads(text), design().gains, guarantee)


def trial(**changes):
    """A run of the mass with some sections of its spec changed, from a text that is to be replaced to another."""
    text = HEAD + MASS
    for old, new in changes.values():
        assert old in text
        text = text.replace(old, new)
    return tried(text, design().guarantee)


def wanting(performance):
    """A run of the mass whose spec asks for something else."""
    return trial(asked=("simulation:", f"performance: {performance}\nsimulation:"))


def curves(axes):
    """Lines of a panel that are data, not marks or entries of a legend."""
    return [line for line in axes.get_lines() if len(line.get_xdata()) > 1]


def dashed(axes):
    """Lines of a panel that are dashed."""
    return [line for line in curves(axes) if line.get_linestyle() == "--"]


def told(axes):
    """Legend of a panel, by lines."""
    return [text.get_text() for text in axes.get_legend().get_texts()]


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
    assert size(first) == (1575, 1050)
    assert run_figure(mass) == first
    assert b"tEXtSoftware\0obsdesign" in first  # and no version, which changes


def test_a_run_is_an_svg_where_the_file_ends_so(mass, tmp_path):
    path = tmp_path / "run.svg"
    drawn = mass.plot(str(path))
    assert drawn == path.read_bytes() == run_figure(mass, form="svg")
    assert b"<dc:date>" not in drawn
    texts = [node.text for node in ElementTree.fromstring(drawn).iter("{http://www.w3.org/2000/svg}text")]
    assert {"Cost $5", "t [s]", "true", "estimate"} <= set(texts)
    assert mass.plot(str(tmp_path / "run.png"))[:8] == b"\x89PNG\r\n\x1a\n"


def test_a_figure_has_the_estimates_their_errors_what_is_measured_and_the_inputs(mass):
    figure = run_sheet(mass)
    assert [axes.get_ylabel() for axes in figure.axes] == ["estimates", "|error|", "y [m]", "w1"]
    assert all((axes.get_xlabel(), axes.get_xscale()) == ("t [s]", "linear") for axes in figure.axes)
    assert told(figure.axes[0]) == ["p [m]", "s [m/s]"]
    below = [text.get_text() for text in figure.legends[0].get_texts()]
    assert below == ["true", "estimate", "proved bound on the error", SETTLED]
    gamma = at_most(mass.guarantee.gamma)
    assert figure.get_suptitle() == f"Cost $5\nproved: γ = {gamma} from zero error, α = 0.1 1/s; all 4 bounds hold"


@pytest.mark.parametrize(
    ("performance", "estimates", "inputs"),
    [("w", "w1", "v1"), ("[s]", "s [m/s]", "w1"), ("all", "estimates", "v1"), ("{H: [[1, 0, 0]]}", "p [m]", "w1")],
)
def test_what_the_spec_asks_for_is_what_is_shown(performance, estimates, inputs):
    first, second, _, last = run_sheet(wanting(performance)).axes
    assert first.get_ylabel() == estimates
    assert second.get_ylabel() == ("|error|" if estimates == "estimates" else f"|error| of {estimates}")
    assert last.get_ylabel() == inputs


def test_a_combination_of_states_has_its_own_bound():
    run = wanting("{H: [[1, -2, 0.5]]}")
    first, second = run_sheet(run).axes[:2]
    h = np.array([1, -2, 0.5])
    assert first.get_ylabel() == "z1"
    assert (curves(first)[0].get_ydata() == run.xi @ h).all()
    assert curves(second)[0].get_ydata() == pytest.approx(np.abs(run.steps.e @ h))
    (bound,) = dashed(second)
    reach = np.sqrt(h @ inverse() @ h)
    assert bound.get_ydata() == pytest.approx(reach * np.sqrt(run.steps.V_bound), rel=1e-12)


def test_of_many_states_those_are_shown_that_settle_last():
    run, figure = damped(20)
    first, second = figure.axes[:2]
    assert first.get_ylabel() == "4 of 20 estimates"
    settled = {name: times["t1"] for name, times in run.summary["settling"].items()}
    last = {name for name, time in settled.items() if time is None}
    assert len(last) > 4  # they all decay at one rate
    assert set(told(first)) <= last
    assert [line.split(":")[0] for line in told(second)] == told(first)


def test_known_inputs_stand_beside_w_and_what_is_always_zero_is_left_out():
    known = ("outputs: [y]", "outputs: [y]\n  inputs: [u]\n  gx: [0, u]")
    run = trial(known=known, u=("points", "u: [2], points"))
    assert told(run_sheet(run).axes[3]) == ["u, known", "w1"]
    still = trial(w=("1 - exp(-t)", "0"))
    assert [axes.get_ylabel() for axes in run_sheet(still).axes] == ["estimates", "|error|", "y [m]"]


def test_names_and_units_of_w_are_on_the_axes():
    named = ("outputs: [y]", "outputs: [y]\n  disturbances: [force]")
    run = trial(named=named, unit=("y: m}", "y: m, force: N}"))
    assert run_sheet(run).axes[3].get_ylabel() == "force [N]"


def test_measurement_noise_is_seen_beside_the_output_without_it():
    noise = "noise: {type: uniform, amplitude: [0.1], period: 0.01}, points"
    run = trial(noise=("points", noise))
    axes = run_sheet(run).axes[2]
    measured, true = curves(axes)
    assert (measured.get_ydata() == run.y[:, 0]).all()
    assert (true.get_ydata() == run.y_true[:, 0]).all()
    assert 0.05 < np.abs(run.y - run.y_true).max() <= 0.1
    assert true.get_ydata() == pytest.approx(run.xi[:, 0])


def test_the_truth_is_solid_and_the_estimate_dashed(mass):
    run = wanting("[p]")
    true, estimate = curves(run_sheet(run).axes[0])[:2]
    assert true.get_linestyle() == "-"
    assert estimate.get_linestyle() == "--"
    assert true.get_color() != estimate.get_color()
    assert (true.get_ydata() == run.xi[:, 0]).all()
    assert (estimate.get_ydata() == run.xihat[:, 0]).all()
    several = curves(run_sheet(mass).axes[0])
    assert several[0].get_color() == several[1].get_color() != several[2].get_color()


def test_the_bound_that_is_drawn_is_the_one_that_is_proved(mass):
    """|e_i| <= sqrt((P^-1)_ii V) along the error, and V <= exp(-2 alpha t) V(0) + b."""
    axes = run_sheet(mass).axes[1]
    for line, error, weight in zip(dashed(axes), mass.steps.e.T[:2], np.diag(inverse())[:2], strict=True):
        assert line.get_ydata() == pytest.approx(np.sqrt(weight * mass.steps.V_bound), rel=1e-12)
        assert (line.get_ydata() >= np.abs(error) * (1 - 1e-9)).all()
        assert (line.get_xdata() == mass.steps.t).all()
    P = rational(np.array([[2, 1, 0], [1, 3, "1/7"], [0, "1/7", 5]], dtype=object))
    H = rational(np.array([[1, 0, 0], [1, "-1/3", 2]], dtype=object))
    for h, reach in zip(H, replace(mass.guarantee, P=P).reach(H), strict=True):
        column = fmpq_mat(P.tolist()).solve(fmpq_mat([[c] for c in h]))
        size = sum(c * column[i, 0] for i, c in enumerate(h))
        assert rational(reach) ** 2 >= size
        assert reach == pytest.approx(approximate(size) ** 0.5, rel=1e-12)


def test_the_truth_lies_in_the_band_around_the_estimate():
    near = ("x0: [1, 0]", "x0: [1, 0], xhat0: [0.99, 0, 0]")
    run = trial(asked=("simulation:", "performance: [p]\nsimulation:"), near=near, w=("1 - exp(-t)", "0.01*sin(t)"))
    figure = run_sheet(run)
    band = next(each for each in figure.axes[0].collections if len(each.get_paths()))
    corners = band.get_paths()[0].vertices
    ends = {t: corners[np.isclose(corners[:, 0], t), 1] for t in run.t}
    radius = np.sqrt(inverse()[0, 0] * run.V_bound)
    for t, estimate, true, r in zip(run.t, run.xihat[:, 0], run.xi[:, 0], radius, strict=True):
        assert ends[t].min() == pytest.approx(estimate - r)
        assert ends[t].max() == pytest.approx(estimate + r)
        assert ends[t].min() <= true <= ends[t].max()
    assert BAND in [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.parametrize("why", ["no guarantee", "noise", "unmodeled"])
def test_no_bound_is_drawn_that_is_not_proved(why):
    if why == "no guarantee":
        run = tried(HEAD + MASS, None)
    elif why == "noise":
        run = trial(noise=("points", "noise: {type: uniform, amplitude: [0.01], period: 0.1}, points"))
    else:
        run = trial(fed=("1 - exp(-t)", "sin(p)"))
    figure = run_sheet(run, every=True)
    assert not any("proved" in text.get_text() for text in figure.legends[0].get_texts())
    errors = [axes for axes in figure.axes if "error" in axes.get_ylabel()]
    assert errors
    assert not [line for axes in errors for line in dashed(axes)]
    if why == "no guarantee":
        assert why in figure.get_suptitle()


def test_errors_are_logarithmic_where_they_span_decades_and_linear_where_not(mass):
    axes = run_sheet(mass).axes[1]
    shown = [line for line in curves(axes) if line.get_linestyle() == "-"]
    assert axes.get_yscale() == "log"
    for line, error in zip(shown, mass.steps.e.T, strict=False):
        assert (line.get_ydata() == np.abs(error)).all()
    steady = tried(HEAD + MASS, None)
    late = replace(steady.steps, e=2 + np.sin(steady.steps.t)[:, None] * np.ones(3))
    axes = run_sheet(replace(steady, steps=late)).axes[1]
    assert (axes.get_ylabel(), axes.get_yscale()) == ("error", "linear")
    assert (curves(axes)[0].get_ydata() == late.e[:, 0]).all()


def test_an_error_spans_decades_by_its_largest_values_not_by_its_zeros():
    t = np.linspace(0, 10, 2001)
    wave, decay = np.abs(np.sin(7 * t)), np.exp(-t)
    assert span([levels(t, wave)], []) is None
    low, high = span([levels(t, decay)], [])
    assert (low, high) == (pytest.approx(np.exp(-9.5), rel=0.01), 1)
    assert span([levels(t, np.zeros(2001))], []) is None
    assert span([levels(t, wave)], [levels(t, 100 + wave)])[1] == pytest.approx(101, rel=0.01)
    assert span([levels(t, 10.0 ** (-3 * t))], [])[0] == 10.0**-DECADES


def test_the_annotated_settling_is_that_of_the_summary(mass):
    axes = run_sheet(mass).axes[1]
    times = mass.summary["settling"]["p"]
    line = told(axes)[0]
    assert f"5 % after {number(times['t5'])} s (◇)" in line
    assert f"1 % after {number(times['t1'])} s (□)" in line
    marks = {mark.get_marker(): mark for mark in axes.get_lines() if mark.get_color() == "#0072B2"}
    assert marks["D"].get_xdata()[0] == times["t5"]
    assert marks["D"].get_ydata()[0] == pytest.approx(0.05, rel=1e-3)  # of the error 1 at first
    peak = np.abs(mass.steps.e[:, 0])
    assert f"peak {number(peak.max())} at {number(mass.steps.t[peak.argmax()])} s" in line
    assert (marks["o"].get_xdata()[0], marks["o"].get_ydata()[0]) == (mass.steps.t[peak.argmax()], peak.max())
    assert "%" not in told(axes)[1]  # which begins without an error


def test_an_error_that_does_not_settle_says_so_and_one_that_is_zero_has_no_peak():
    run, figure = damped(2)
    assert run.summary["settling"]["x2"]["t5"] is None
    assert told(figure.axes[1]) == ["x1: no error", "x2: peak 1 at 0 s (○), 5 % not reached"]


def test_an_error_that_only_the_end_of_the_run_keeps_small_is_not_settled():
    """It falls below 1 % of the first one in the last twentieth of the run, and what comes then is not seen."""
    run = trial(ends=("horizon: 5", "horizon: 2.9"), quiet=("w: [1 - exp(-t)]", "w: [0]"))
    assert 0.95 * 2.9 < run.summary["settling"]["p"]["t1"] < 2.9
    axes = run_sheet(run).axes[1]
    assert told(axes)[0].endswith("5 % after 1.86 s (◇), 1 % not held before the end")
    assert "s" not in {line.get_marker() for line in axes.get_lines()}


def test_the_title_says_what_is_proved_of_an_observer_without_a_bound():
    plant = "system: {dynamics: {x1: x2, x2: -2*x1 - 3*x2}, outputs: {y1: x1}}\nsimulation: {horizon: 1, x0: [1, 0]}\n"
    gains = "observer: {type: high-gain, injection: {x1: {y1: 10}, x2: {y1: 30}}}\n"
    made = solve(loads(f"obsdesign: 1\nname: gain\n{plant}{gains}"))
    assert made.status == "certified"
    title = run_sheet(made.simulate()).get_suptitle().splitlines()
    assert title[1] == "proved: how it estimates without disturbance and noise; no bound on the error of a run"


def test_every_panel_is_drawn_on_demand(mass):
    figure = run_sheet(mass, every=True)
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == ["estimates", "|error|", "y [m]", "w1", "w1", "|error| of w1", "V(e)"]
    bound, V = curves(figure.axes[6])
    assert (V.get_ydata() == mass.steps.V).all()
    assert (bound.get_ydata() == mass.steps.V_bound).all()
    assert (bound.get_ydata() * (1 + 1e-6) >= V.get_ydata()).all()


@pytest.mark.usefixtures("here")
def test_the_command_line_has_every_panel_on_demand(made):
    gains = str(made / "cart.gains.json")
    assert command("simulate", gains, "-q", "--plot", "a.svg").exit_code == 0
    assert command("simulate", gains, "-q", "--plot", "b.svg", "--plot-all").exit_code == 0
    few, many = (Path(name).read_text() for name in ("a.svg", "b.svg"))
    assert few.startswith("<?xml")
    assert (few.count("t [s]"), "V(e)" in few, "V(e)" in many) == (4, False, True)
    assert command("solve", str(made / "cart.yaml"), "-q", "--simulate", "--plot-all").exit_code == 0
    assert size(Path("cart.run.png").read_bytes())[1] > 1050


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
    guarantee = PeakGuarantee(gamma=1, rate=1, mu1=1, mu2=1, P=np.eye(1))
    run = simulate(spec, {"L1": np.array([[-2.0]]), "L2": np.zeros((1, 1))}, guarantee)
    figure = run_sheet(run, every=True)
    panels = {axes.get_ylabel(): axes for axes in figure.axes}
    argument, storage = panels["q1 of nonlinearities[0]"], panels["V(e)"]
    bounds = [line for line in argument.get_lines() if line.get_label() == "limit of the region"]
    assert sorted(line.get_ydata()[0] for line in bounds) == [-1.0, 1.0]
    below = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "limit of the region" in below
    for bound, other in ((dashed(panels["|error| of x1"])[0], 0), (curves(storage)[0], 1)):
        known = np.isfinite(bound.get_ydata())
        assert bound.get_xdata()[known][-1] < run.left[0].time < curves(storage)[other].get_xdata()[-1] + 4
    for axes in figure.axes:
        (shade,) = axes.patches
        assert (shade.get_x(), shade.get_x() + shade.get_width()) == pytest.approx((run.left[0].time, run.time))
    assert any("local guarantee left: q1" in text and "leaves [-1, 1] at t" in text for text in below)
    assert figure.get_suptitle().endswith(f"bounds hold until t = {run.left[0].time:.4g}")
    assert "region of the declared types left" in run_sheet(replace(run, guarantee=None)).axes[0].patches[0].get_label()


def test_a_broken_bound_is_said_in_the_title(mass):
    false = replace(mass.guarantee, rate=9.0, mu2=1e-4, gamma=1e-2)
    assert "VIOLATED" in run_sheet(simulate(mass.spec, design().gains, false)).get_suptitle()


@pytest.mark.parametrize(
    ("status", "said"),
    [
        ("escape", "ESCAPE at t = 1.25 s: computed until then"),
        ("stall", "STALLED at t = 1.25 s: computed until then"),
        ("stopped", "STOPPED at t = 1.25 s (p < 0)"),
    ],
)
def test_a_run_that_ended_early_is_marked(mass, status, said):
    summary = {**mass.summary, "reason": "low: p < 0"}
    figure = run_sheet(replace(mass, status=status, time=1.25, summary=summary))
    assert f"\n{said}; " in figure.get_suptitle()
    assert said in [text.get_text() for text in figure.legends[0].get_texts()]
    for axes in figure.axes:
        (end,) = [line for line in axes.get_lines() if line.get_label() == said]
        assert list(end.get_xdata()) == [1.25, 1.25]
        assert axes.get_xlim() == (0, 1.25)


def test_the_title_has_two_lines_however_long_the_name_is():
    run = trial(name=("Cost $5", "'" + "very long name " * 40 + "'"))
    lines = run_sheet(run).get_suptitle().splitlines()
    assert len(lines) == 2
    assert len(lines[0]) == LINE
    assert lines[0].endswith("…")


def test_what_is_said_of_a_run_is_wrapped_and_not_cut_in_its_middle(mass):
    left = "every bound from then on: " + "the guarantee says nothing of such a run, " * 2 + "and that is the end"
    title = run_sheet(replace(mass, summary={**mass.summary, "bounds": [], "bounds_omitted": left})).get_suptitle()
    first, *said = title.splitlines()
    assert first == "Cost $5"
    assert "; no bound from then on: the guarantee says" in " ".join(said)
    assert [len(said), " ".join(said).endswith("that is the end")] == [2, True]
    assert max(map(len, said)) <= LINE


def test_a_long_name_stands_above_its_panel_and_is_cut_where_more_is_said_of_it():
    name = "temperature_of_the_inner_jacket_wall"
    run = trial(named=("states: [p, s]", f"states: [{name}, s]"), unit=("{p: m", f"{{{name}: m"))
    figure = run_sheet(run)
    assert told(figure.axes[0]) == [f"{name} [m]", "s [m/s]"]
    line = told(figure.axes[1])[0]
    assert line.startswith("temperature_of_")
    assert "…: peak 1 at 0 s" in line
    assert len(line) <= MOST + 2
    alone = replace(run, spec=replace(run.spec, H=run.spec.H[:1], H_names=run.spec.H_names[:1]))
    first, second = run_sheet(alone).axes[:2]
    assert len(f"{name} [m]") > BESIDE
    assert [first.get_ylabel(), second.get_ylabel()] == ["estimates", "|error|"]
    assert told(first) == [f"{name} [m]"]


def test_a_bound_looks_other_than_an_estimate(mass):
    figure = run_sheet(mass)
    looks = {text.get_text(): line._unscaled_dash_pattern for text, line in legend_entries(figure)}
    assert looks["estimate"] != looks["proved bound on the error"]


def legend_entries(figure):
    """Texts and handles of the legend below the panels."""
    (legend,) = figure.legends
    return zip(legend.get_texts(), legend.legend_handles, strict=True)


def test_a_band_that_is_no_wider_than_a_line_is_not_told_of(mass):
    wide = replace(
        mass, xi=1e6 * mass.xi, xihat=1e6 * mass.xihat, steps=replace(mass.steps, xihat=1e6 * mass.steps.xihat)
    )
    assert BAND not in [text.get_text() for text, _ in legend_entries(run_sheet(wide))]


def test_ticks_of_a_logarithmic_axis_are_written_alike_and_are_no_bar():
    from matplotlib.figure import Figure

    assert [power(10.0**k) for k in range(-4, 5)] == ["10⁻⁴", "10⁻³", "0.01", "0.1", "1", "10", "100", "10³", "10⁴"]
    assert [power(v) for v in (0.0, 0.003, 30.0)] == ["0", "0.003", "30"]
    for low, few in ((1e-2, False), (1e-8, True)):
        axes = Figure().add_subplot()
        axes.set(yscale="log", ylim=(low, 1))
        log_ticks(axes)
        assert (len(axes.get_yticks(minor=True)) == 0) == few


HOSTILE = ["$x$", "\\frac{1}{0}", "x_1^2", "_hidden", "%s {} <b>&amp;", "a" * 500, "tab\there", "\x1b[31mred", "日本"]


@pytest.mark.parametrize("name", HOSTILE)
def test_any_name_is_drawn_as_text(mass, name):
    spec = replace(mass.spec, name=name, units={"p": name, "y": "m"})
    run = replace(mass, spec=spec, states=(name, *mass.states[1:]), outputs=(name,), exogenous=(name,))
    told = run_figure(run, form="svg")
    texts = [node.text for node in ElementTree.fromstring(told).iter("{http://www.w3.org/2000/svg}text")]
    assert plain(name) in [text.strip() if plain(name)[0] != " " else text for text in texts if text]
    search = {"points": [{"alpha": 1.0, "gamma": 1.0, "status": "optimal"}]}
    assert size(search_figure({"name": name, "search": search}, spec))


@pytest.mark.parametrize(
    ("wrong", "where"),
    [(np.nan, slice(None)), (np.inf, slice(-1, None)), (-np.inf, slice(0, 1)), (1e308, slice(-1, None))],
)
def test_what_is_not_finite_breaks_no_figure(mass, wrong, where):
    def spoiled(samples):
        names = ("xi", "xihat", "e", "w", "what", "w_error", "y", "y_true", "V", "V_bound", "v")
        columns = {name: np.copy(getattr(samples, name)) for name in names}
        for column in columns.values():
            column[where] = wrong
        return replace(samples, **columns)

    for status in ("done", "escape"):
        with np.errstate(all="ignore"):
            run = replace(spoiled(mass), steps=spoiled(mass.steps), status=status)
            assert size(run_figure(run, every=True))


def test_a_curve_of_many_samples_looks_the_same_when_it_is_thinned():
    t = np.linspace(0, 1, 100_001)
    values = np.sin(2000 * t) * np.exp(-t)
    values[50_000], values[7] = 3.0, np.nan
    few, seen = thinned(t, values)
    assert len(few) <= 4 * CELLS
    for k in range(CELLS):
        cell, kept = (values[(x >= k / CELLS) & (x < (k + 1) / CELLS - 1e-9)] for x in (t, t)), few
        inside = (kept >= k / CELLS) & (kept < (k + 1) / CELLS - 1e-9)
        assert np.nanmax(next(cell)) == np.nanmax(seen[inside])
    assert thinned(t[:10], values[:10])[0] is not None
    assert list(finite(np.array([1.0, np.inf, 1e300]))[[0, 2]]) == [1.0, 1e150]


def test_signals_of_different_sizes_are_multiplied_by_powers_of_ten():
    t = np.linspace(0, 1, 11)
    small, large, tiny = (Curve("", size * np.sin(t)) for size in (0.02, 3.0, 1e-7))
    assert scales([small, large, tiny]) == [1e2, 1, 1e7]
    assert scales([large, large.scaled(0.1)]) == [1, 1]
    assert scales([Curve("", np.zeros(3)), large])[1] == 1
    known = ("outputs: [y]", "outputs: [y]\n  inputs: [u]\n  gx: [0, u]")
    run = trial(known=known, u=("points", "u: [2], points"), w=("1 - exp(-t)", "0.004*sin(t)"))
    assert told(run_sheet(run).axes[3]) == ["u, known", "w1 × 100"]


def damped(n):
    """Figure of n states, each of which decays."""
    A = (-np.eye(n)).tolist()
    C = [[1] + [0] * (n - 1)]
    text = f"system: {{A: {A}, C: {C}}}\nsimulation: {{horizon: 1, x0: {list(range(n))}}}"
    spec = loads(HEAD + text)
    run = simulate(spec, {"L1": np.zeros((n, 1)), "L2": np.zeros((0, 1))}, None)
    return run, run_sheet(run)


def test_many_states_share_panels_of_at_most_four_curves():
    run, _ = damped(20)
    figure = run_sheet(run, every=True)
    panels = [axes for axes in figure.axes if axes.get_legend() and "error" not in axes.get_ylabel()]
    assert max(len(told(axes)) for axes in panels) == 4
    assert sorted(name for axes in panels for name in told(axes)) == sorted(run.states)


@pytest.mark.parametrize(("n", "rows"), [(1, [1]), (2, [2]), (3, [3]), (4, [2, 2]), (6, [3, 3]), (8, [2, 3, 3])])
def test_panels_stand_in_rows_of_at_most_three_of_the_same_width(n, rows):
    figure = compose("", [[lambda _: None] * n])
    cells = [axes.get_subplotspec() for axes in figure.axes]
    assert [sum(cell.rowspan.start == row for cell in cells) for row in range(len(rows))] == rows
    assert max(rows) <= ROW
    assert all(len(cell.colspan) * rows[cell.rowspan.start] == cell.get_gridspec().ncols for cell in cells)


@pytest.mark.parametrize("n", [4, 8, 12])
def test_no_legend_or_label_touches_another_panel(n):
    run, _ = damped(n)
    with style():
        figure = run_sheet(run, every=True)
        figure.draw_without_rendering()
        assert all(
            each.get_window_extent().y0 >= axes.bbox.y1 - 1 for axes in figure.axes if (each := axes.get_legend())
        )
    boxes = [axes.get_tightbbox() for axes in figure.axes] + [legend.get_window_extent() for legend in figure.legends]
    overlaps = [(a, b) for i, a in enumerate(boxes) for b in boxes[:i] if a.padded(-1).overlaps(b.padded(-1))]
    assert not overlaps
    assert all(box.x0 >= 0 and box.x1 <= figure.bbox.width for box in boxes)


def test_a_legend_with_long_names_has_fewer_columns():
    from matplotlib.figure import Figure

    columns = []
    for name in ("e", "error of the speed of the second joint of the arm"):
        axes = Figure(figsize=(10.5, 4)).add_subplot(1, 3, 1)
        lines = [axes.plot([0, 1])[0] for _ in range(4)]
        legend_above(axes, lines, [f"{name}{k}" for k in range(4)])
        columns.append(axes.get_legend()._ncols)
    assert columns == [4, 1]


def limited(curves):
    """Limits of a panel, and the note of what they cut off."""
    return *limits(curves), cut_off(curves, [1.0] * len(curves), *limits(curves))


def test_an_initial_transient_does_not_hide_the_signal():
    t = np.linspace(0, 1, 1001)
    estimate = np.where(t < 0.01, 1e7, np.sin(t))
    low, high, note = limited([Curve("w", np.sin(t), estimate)])
    assert -0.2 < low < 0
    assert 0.84 < high < 1.1
    assert "10⁷" in note
    _, top, note = limited([Curve("w", np.sin(t), estimate / 1e7 * 1.2)])
    assert (top > 1.2, note) == (True, "")
    assert "reaches -9" in limited([Curve("w", np.sin(t), np.where(t < 0.01, -9.0, np.sin(t) + 0.01))])[2]
    assert limits([Curve("w", np.ones(3), None)]) == pytest.approx((0.9, 1.1))


def test_an_initial_transient_beside_which_the_signal_is_seen_is_drawn_whole():
    t = np.linspace(0, 1, 1001)
    truth = 5 + np.sin(t)
    low, high, note = limited([Curve("x1", truth, truth - 2 * np.exp(-100 * t))])
    assert (low < 3.1, high > 5.8, note) == (True, True, "")
    low, high, note = limited([Curve("x1", np.full_like(t, 5.0), np.where(t < 0.01, -14.0, 5.0))])
    assert (low < -14, note) == (True, "")


def test_what_is_cut_off_is_told_in_the_unit_of_its_signal():
    t = np.linspace(0, 1, 1001)
    load = Curve("load [N*m]", np.sin(t) / 100, np.where(t < 0.01, -1.25, np.sin(t) / 100)).scaled(1e4)
    curves = [Curve("speed", 100 * np.sin(t), 100 * np.sin(t)), load]
    assert cut_off(curves, [1.0, 1e4], *limits(curves)) == "estimate of load reaches -1.25"


@pytest.mark.parametrize(
    ("least", "low", "high"),
    [
        (1.0, -300.0, 0.1),
        (10.0, -2.0, 4e7),
        (1e-4, -1e7, 1e7),
    ],
)
def test_ticks_of_a_signed_logarithmic_axis_do_not_collide(least, low, high):
    from matplotlib.figure import Figure

    axes = Figure().add_subplot()
    axes.plot([0, 1], [low, high])
    growing_axis(axes, least, low, high)
    ticks = axes.get_yticks()
    heights = axes.transAxes.inverted().transform(axes.transData.transform([(0, tick) for tick in ticks]))[:, 1]
    assert 0 in ticks
    assert 3 <= len(ticks) <= 1 / CLOSEST + 1
    assert np.diff(heights).min() > 0.085
    assert min(ticks) >= low
    assert max(ticks) <= high


def test_numbers_are_written_with_powers_of_ten():
    assert [number(v) for v in (0.0211, -375, 114321.0)] == ["0.0211", "-375", "1.14 × 10⁵"]
    assert [number(v) for v in (1e-7, 0.0, 1.0)] == ["10⁻⁷", "0", "1"]


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
    assert list(lines) == ["best γ", "infeasible", "undecided", "this design: α = 1, γ = 0.31"]
    assert list(lines["best γ"].get_xdata()) == [0.1, 1.0]
    assert list(lines["infeasible"].get_xdata()) == [10.0]
    assert axes.get_xscale() == "log"
    assert axes.get_yscale() == "linear"
    assert figure.get_suptitle() == "Bearing"
    assert axes.get_xlabel() == "decay rate α of the error [1/s]"
    assert axes.get_ylabel() == "γ, gain from the disturbance to the error"
    assert axes.get_legend() is None  # it stands below the panel


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ("performance: [p]", "γ, gain from v of w1 to the error of p"),
        ("performance: w", "γ, gain from v of w1 to the error of w1"),
    ],
)
def test_a_tradeoff_names_what_is_traded_with_units(section, said):
    spec = loads(HEAD + MASS + section)
    assert names(spec)["gamma"] == said
    direct = MASS.replace("disturbance: integrator", section).replace("y: m}", "y: m, w1: N}")
    if section == "performance: [p]":
        assert names(loads(HEAD + direct))["gamma"] == "γ, gain from w1 to the error of p [m / (N)]"
    quiet = HEAD + "system: {A: [[-1]], C: [[1]]}"
    assert names(loads(quiet)) == names(None)


def test_curves_are_told_apart_by_their_marks_also_where_they_coincide():
    points = [{"T2": t, "gamma": 2 + t, "certified": {"gamma": 1 + t}} for t in (0.1, 0.2)]
    curves = [{"injection": "dynamic", "relaxation": name, "points": points} for name in ("a", "b")]
    figure = curves_sheet(curves, "T2", "Link")
    (axes,) = figure.axes
    marks = [line for line in axes.get_lines() if list(line.get_ydata()) == [1.1, 1.2]]
    assert len({line.get_marker() for line in marks}) == 2
    below = [text.get_text() for text in figure.legends[0].get_texts()]
    assert below == ["dynamic, a", "dynamic, b", "best found", "certified gains"]
    assert axes.get_xlabel() == "longest time T2 between measurements [s]"
    assert not curves_sheet([{**curves[0], "points": []}], "T2", "Link").legends


@pytest.mark.parametrize("points", [POINTS, POINTS[2:], POINTS[:1]])
def test_a_tradeoff_is_a_png(points):
    assert size(tradeoff_figure(points, None, "Bearing")) == (1020, 690)


def test_the_settings_of_the_user_are_left_alone():
    from matplotlib import rcParams

    rcParams["font.size"] = 17.0
    before = tradeoff_figure(POINTS, None, "Bearing")
    assert rcParams["font.size"] == 17.0
    rcParams["font.size"] = 10.0
    assert tradeoff_figure(POINTS, None, "Bearing") == before


def test_signals_in_samples_are_stairs_with_dots_as_long_as_there_is_room():
    text = """obsdesign: 1
name: samples
system: {time: discrete, period: 0.1, A: [[.9]], C: [[1]], B: [[0.1]]}
observer: {type: l2, rho: 1, gains: {L1: [-.5], L2: []}}
simulation: {horizon: HORIZON, x0: [1], w: [sin(t)], points: 50}
"""
    gains = {"L1": np.array([[-0.5]]), "L2": np.zeros((0, 1))}
    for horizon, dots, drawn in (("3", ".", 31), ("30", ".", 43)):
        run = simulate(loads(text.replace("HORIZON", horizon)), gains, None)
        first = run_sheet(run).axes[0].lines[0]
        assert (first.get_drawstyle(), first.get_marker()) == ("steps-post", dots)
        assert len(first.get_xdata()) == drawn
        errors = run_sheet(run).axes[1].lines[0]
        assert errors.get_drawstyle() == "steps-post"
        assert len(errors.get_xdata()) == len(run.t)
        assert errors.get_marker() == ("." if len(run.t) <= 120 else "None")
