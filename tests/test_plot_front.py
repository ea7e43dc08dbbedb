"""The figures of trade-offs of Lipschitz observers: what is drawn, what is marked, what is left out."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.colors import same_color

from obsdesign.plot import front_figure, search_figure, surface_figure
from obsdesign.plot.axis import highest
from obsdesign.plot.canvas import COLORS
from obsdesign.plot.front import (
    ARBITRARY,
    LIMIT,
    ONE_DESIGN,
    OPEN,
    PROVED,
    UNBOUNDED,
    Front,
    front_sheet,
    pace,
    shipped_among,
)
from obsdesign.plot.panels import Signals
from obsdesign.plot.signals import Curve
from obsdesign.plot.surface import Field, Grid, surface_sheet
from obsdesign.plot.traded import NAMES, names
from obsdesign.reading import loads

STAR = "this design"
PNG = b"\x89PNG\r\n\x1a\n"


def point(weight, decay=0.05):
    """A point of a trade-off with a corner up to the weight 0.3, and limits that are not attained from 0.8 on."""
    free = max(weight - 0.3, 0.0)
    lipschitz, gamma = 0.4 + 0.3 * free - 0.2 * decay, 2 * free
    return {
        "weight": weight,
        "decay": decay,
        "lipschitz": lipschitz,
        **({"gamma": gamma} if weight < 1 else {}),
        "attained": weight < 0.8,
        "corner": weight <= 0.3,
        "status": "certified",
        "certified": {"lipschitz": 0.99 * lipschitz, "gamma": 1.01 * gamma, "L": 6 + 20 * free},
    }


def refused(weight, decay=0.05, status="infeasible"):
    return {"weight": weight, "decay": decay, "status": status}


WEIGHTS = [round(0.1 * k, 1) for k in range(11)]
CURVE = [point(w) for w in WEIGHTS]
SHIPPED = {"lipschitz": CURVE[5]["certified"]["lipschitz"], "gamma": CURVE[5]["certified"]["gamma"], "decay": 0.05}
SURFACE = [point(w, d) for d in (0.0, 0.1, 0.2) for w in WEIGHTS]


def labelled(axes):
    """Lines of a panel that have a label."""
    return {line.get_label(): line for line in axes.get_lines() if not line.get_label().startswith("_")}


def test_three_panels_share_the_weight_and_the_fourth_is_the_tradeoff():
    figure = front_sheet(CURVE, SHIPPED, "Cost $5")
    assert [axes.get_ylabel() for axes in figure.axes] == ["lipschitz", "γ", "|L|", NAMES["gamma"]]
    assert [axes.get_xlabel() for axes in figure.axes] == ["", "", NAMES["weight"], NAMES["lipschitz"]]
    assert [axes.get_yscale() for axes in figure.axes] == ["linear", "linear", "log", "linear"]
    assert figure.axes[0].get_shared_x_axes().joined(figure.axes[0], figure.axes[2])
    assert figure.get_suptitle() == "Cost $5\ndecay 0.05 1/s"


def test_limits_are_lines_and_certified_gains_are_dots_in_the_order_of_the_weight():
    top, _, gains, tradeoff = front_sheet(CURVE[::-1], None, "").axes
    line, dots = labelled(top)["limits"], labelled(top)["certified gains"]
    assert list(line.get_xdata()) == WEIGHTS
    assert list(line.get_ydata()) == [p["lipschitz"] for p in CURVE]
    assert (line.get_linestyle(), dots.get_linestyle()) == ("-", "None")
    assert list(labelled(gains)["certified gains"].get_ydata()) == [p["certified"]["L"] for p in CURVE]
    assert "limits" not in labelled(gains)
    assert list(labelled(tradeoff)["limits"].get_xdata()) == [p["lipschitz"] for p in CURVE]


def test_limits_that_are_not_attained_are_hollow_and_their_weights_shaded():
    top, *_, tradeoff = front_sheet(CURVE, None, "").axes
    for axes, x in ((top, [0.8, 0.9, 1.0]), (tradeoff, [p["lipschitz"] for p in CURVE[8:10]])):
        (hollow,) = [line for line in axes.get_lines() if same_color(line.get_markerfacecolor(), "white")]
        assert list(hollow.get_xdata()) == x
    assert list(Front.of(CURVE).bands()) == [pytest.approx((0.75, 1.0))]
    assert any(OPEN in patch.get_label() for patch in top.patches)
    assert not front_sheet(CURVE[:8], None, "").axes[0].patches


def test_a_corner_is_drawn_wide_and_named_once_with_its_weights():
    top, *_, tradeoff = front_sheet(CURVE, None, "").axes
    assert list(labelled(top)[ONE_DESIGN].get_xdata()) == WEIGHTS[:4]
    assert [text.get_text() for text in tradeoff.texts] == ["weight 0 to 0.3"]


def test_two_corners_beside_each_other_are_two():
    second = [{**point(w), "lipschitz": 0.3, "corner": True} for w in (0.4, 0.5)]
    assert list(Front.of([*CURVE[:4], *second, *CURVE[6:]]).corners()) == [slice(0, 4), slice(4, 6)]


def test_points_without_a_design_stand_at_the_foot_and_break_the_line():
    points = [refused(0.0), refused(0.1), *CURVE[2:5], refused(0.5, status="undecided"), *CURVE[6:]]
    for axes in front_sheet(points, None, "").axes[:3]:
        lines = labelled(axes)
        assert list(lines["infeasible"].get_xdata()) == [0.0, 0.1]
        assert list(lines["undecided"].get_xdata()) == [0.5]
        assert set(lines["infeasible"].get_ydata()) == {0.03}
    line = labelled(front_sheet(points, None, "").axes[0])["limits"]
    assert list(np.flatnonzero(np.isnan(line.get_ydata()))) == [0, 1, 5]


def test_an_unbounded_gain_is_a_triangle_at_the_top_and_does_not_flatten_the_rest():
    points = [*CURVE[:-1], {**CURVE[-1], "certified": {"lipschitz": 0.6, "gamma": 1e6, "L": 30}}]
    _, panel, _, tradeoff = front_sheet(points, None, "").axes
    for axes, x in ((panel, {1.0}), (tradeoff, {0.6, CURVE[-1]["lipschitz"]})):
        above = [line for line in axes.get_lines() if line.get_marker() == "^"]
        assert {line.get_label() for line in above} == {UNBOUNDED, "gain above the panel"}
        assert {color for line in above for color in [line.get_color()]} == {LIMIT, PROVED}
        assert {float(v) for line in above for v in line.get_xdata()} == x
        assert axes.get_ylim()[1] < 2
    assert highest(np.array([1.0, 2, np.inf, np.nan])) == 2
    assert highest(np.array([])) == 1


def test_an_unbounded_constant_is_a_triangle_at_the_top_too():
    points = [{k: v for k, v in p.items() if k != "lipschitz" or p["weight"] < 0.2} for p in CURVE]
    top = labelled(front_sheet(points, None, "").axes[0])
    assert list(top[UNBOUNDED].get_xdata()) == WEIGHTS[2:]
    assert "certified" not in top
    marked = labelled(surface_sheet([*points, *SURFACE[11:]], None, "").axes[0])[UNBOUNDED]
    assert list(marked.get_xdata()) == WEIGHTS[2:]


def test_the_shipped_point_is_a_star_at_its_weight():
    figure = front_sheet(CURVE, SHIPPED, "")
    x = [float(labelled(axes)[STAR].get_xdata()[0]) for axes in figure.axes]
    assert x == [0.5, 0.5, 0.5, SHIPPED["lipschitz"]]
    assert labelled(figure.axes[2])[STAR].get_ydata()[0] == CURVE[5]["certified"]["L"]
    elsewhere = front_sheet(CURVE, {"lipschitz": 0.1, "gamma": 0.1}, "")
    assert [STAR in labelled(axes) for axes in elsewhere.axes] == [False, False, False, True]
    assert shipped_among(CURVE, None) is None


def test_a_curve_over_the_decay_rate_is_drawn_over_it():
    figure = front_sheet([point(0.5, d) for d in (0.2, 0.0, 0.1)], None, "")
    assert list(labelled(figure.axes[0])["limits"].get_xdata()) == [0, 0.1, 0.2]
    assert figure.axes[2].get_xlabel() == "decay rate of the error [1/s]"
    assert "weight 0.5" in figure.get_suptitle()


def test_a_curve_without_any_design_says_so():
    tradeoff = front_sheet([refused(w) for w in WEIGHTS], None, "").axes[3]
    assert [text.get_text() for text in tradeoff.texts] == ["no design"]


def test_the_legend_has_every_mark_once():
    figure = front_sheet([refused(0.0), *CURVE[1:]], SHIPPED, "")
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert len(texts) == len(set(texts)) == 7


def test_a_surface_has_two_maps_with_bars_and_two_surfaces():
    figure = surface_sheet(SURFACE, None, "Cost $5")
    maps = [axes for axes in figure.axes if axes.get_xlabel() == NAMES["weight"] and axes.name == "rectilinear"]
    solids = [axes for axes in figure.axes if axes.name == "3d"]
    bars = [axes.get_ylabel() for axes in figure.axes if axes not in maps and axes not in solids]
    assert (len(maps), len(solids)) == (2, 2)
    assert len(bars) == 2
    titles = [axes.get_title(loc="left") for axes in maps]
    assert titles[0] == NAMES["lipschitz"]
    assert "γ" in titles[1]
    assert "cut at 1.2" in titles[1]  # the weight 1 does not ask for gamma
    assert [axes.get_zlabel() for axes in solids] == ["lipschitz", "γ"]
    assert all(axes.texts for axes in maps)
    assert list(labelled(maps[1])[UNBOUNDED].get_xdata()) == [1.0] * 3
    assert UNBOUNDED not in labelled(maps[0])


def test_the_order_of_the_points_does_not_matter_and_what_is_missing_is_masked():
    full = Field.of(Grid.of(SURFACE), "lipschitz", "")
    assert (Field.of(Grid.of(SURFACE[::-1]), "lipschitz", "").values == full.values).all()
    assert full.values.shape == (3, 11)
    assert len(full.quads) == 20
    holed = [refused(0.5, 0.1) if (p["weight"], p["decay"]) == (0.5, 0.1) else p for p in SURFACE[:-1]]
    field = Field.of(Grid.of(holed), "lipschitz", "")
    assert [tuple(at) for at in np.argwhere(np.isnan(field.values))] == [(1, 5), (2, 10)]
    assert len(field.quads) == 20 - 4 - 1
    maps = [axes for axes in surface_sheet(holed, None, "").axes if axes.get_xlabel() == NAMES["weight"]]
    assert list(labelled(maps[0])["infeasible"].get_xdata()) == [0.5]
    assert list(labelled(maps[0])["infeasible"].get_ydata()) == [0.1]
    assert [patch.get_label() for patch in maps[0].patches] == ["no value"]
    assert same_color(maps[0].patch.get_facecolor(), maps[0].patches[0].get_facecolor())


def test_regions_that_are_not_attained_and_corners_are_in_the_legend_only_if_there_are_some():
    def legend(points):
        return {text.get_text() for text in surface_sheet(points, None, "").legends[0].get_texts()}

    marks = {f"{OPEN} (ticked side)", f"{ONE_DESIGN} (ticked side)"}
    assert marks <= legend(SURFACE)
    assert not marks & legend([{**p, "attained": True, "corner": False} for p in SURFACE])
    nowhere = surface_sheet([{**p, "attained": False} for p in SURFACE], None, "").axes[0]
    assert nowhere.get_title(loc="right") == f"everywhere: {OPEN}"


def test_ticks_stand_on_the_side_on_which_the_limit_is_not_attained():
    axes = surface_sheet(SURFACE, None, "").axes[0]
    (line,) = [
        drawn for drawn in axes.collections if drawn.get_path_effects() and same_color(drawn.get_edgecolor(), COLORS[1])
    ]
    (path,) = [path for path in line.get_paths() if len(path.vertices)]
    along = path.vertices[-1] - path.vertices[0]
    left = np.array([-along[1], along[0]])
    assert left[0] > 0  # it is not attained from the weight 0.8 on


def test_at_the_weight_0_any_lipschitz_would_do():
    free = [{k: v for k, v in p.items() if k != "lipschitz" or p["weight"] > 0} for p in SURFACE]
    (line,) = [v for k, v in labelled(front_sheet(free[:11], None, "").axes[0]).items() if k == ARBITRARY]
    assert list(line.get_xdata()) == [0, 0]
    first, *_, second = [axes for axes in surface_sheet(free, None, "").axes if axes.get_xlabel() == NAMES["weight"]][
        :3:2
    ]
    assert list(labelled(first)[ARBITRARY].get_xdata()) == [0, 0, 0]
    assert ARBITRARY not in labelled(second)


def test_the_shipped_point_is_on_the_map():
    chosen = SURFACE[16]
    figure = surface_sheet(SURFACE, chosen["certified"], "")
    star = labelled(figure.axes[0])[STAR]
    assert (star.get_xdata()[0], star.get_ydata()[0]) == (chosen["weight"], chosen["decay"])


@pytest.mark.parametrize("points", [SURFACE[:1], SURFACE[:11], SURFACE[:14], [refused(0, 0), refused(1, 0.5)]])
def test_a_batch_that_was_stopped_early_still_has_a_picture(points):
    assert surface_figure(points, None, "Stopped").startswith(PNG)


@pytest.mark.parametrize(
    ("figure", "points"), [(front_figure, CURVE), (front_figure, CURVE[:1]), (surface_figure, SURFACE)]
)
def test_a_picture_is_the_same_for_the_same_points(figure, points):
    first = figure(points, SHIPPED, "Example")
    assert first.startswith(PNG)
    assert figure(points[::-1], SHIPPED, "Example") == first


@pytest.mark.parametrize(
    ("searched", "figure", "points"),
    [({}, front_figure, CURVE), ({"parameters": ["weight", "decay"]}, surface_figure, SURFACE)],
    ids=["curve", "surface"],
)
def test_the_figure_follows_from_what_was_searched(searched, figure, points):
    search = {"parameter": "weight", "points": points, **searched}
    result = {"name": "Example", "search": search, "guarantee": SHIPPED}
    assert search_figure(result) == figure(points, SHIPPED, "Example")
    text = "obsdesign: 1\nsystem: {A: [[-1]], B: [[1]], C: [[1]]}\nobserver: {type: l2, L2: 0, bounds: {L1: 20}}"
    spec = loads(text)
    told = figure(points, SHIPPED, "Example\n|L1| <= 20", names=names(spec))
    assert search_figure(result, spec) == told
    assert search_figure(result, spec, form="svg").startswith(b"<?xml")


def test_a_signal_that_escapes_is_readable_where_it_begins():
    from matplotlib.figure import Figure

    t = np.linspace(0, 1, 101)
    curve = Curve("x", 1 / (1.0001 - t) ** 2, np.zeros(101))
    panels = [Figure().add_subplot() for _ in range(2)]
    for axes, escapes in zip(panels, (False, True), strict=True):
        told = {"status": "escape" if escapes else "done", "spec": SimpleNamespace(period=None)}
        run = SimpleNamespace(t=t, time=1.0, schedule=None, **told)
        Signals(run, [curve], "x").draw(axes)
    share = [
        np.subtract(*axes.transAxes.inverted().transform(axes.transData.transform([(0, 4), (0, 1)]))[:, 1])
        for axes in panels
    ]
    assert share[0] < 1e-6
    assert share[1] > 0.05
    assert [axes.get_yscale() for axes in panels] == ["linear", "asinh"]
    drawn = panels[1].transData.transform(np.column_stack([t, curve.true]))[:, 1]
    slope = np.diff(drawn)
    assert (slope[1:] / slope[:-1])[:80].max() < 1.1  # no kink
    assert panels[1].get_ylim()[1] > 1e8


@pytest.mark.parametrize(("points", "figure"), [(CURVE, front_figure), (SURFACE, surface_figure)])
def test_points_in_samples_are_drawn_over_rho(points, figure):
    renamed = [{("rho" if key == "decay" else key): value for key, value in point.items()} for point in points]
    assert figure(renamed, SHIPPED, "Example") != figure(points, SHIPPED, "Example")
    assert pace(renamed) == "rho"
    assert pace(points) == "decay"
