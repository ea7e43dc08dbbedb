"""Gamma against the size of the gain: certified points, the knee by its rule, and what is said where there is none."""

import math

import numpy as np
import pytest
from flint import fmpq
from matplotlib.figure import Figure

import obsdesign as od
from obsdesign.dissipation.bounds import Range, Trade
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.scan import knee
from obsdesign.errors import UsageError
from obsdesign.families.trade import Spot, Trader
from obsdesign.plot.gain import gain_sheet

SPRING = {"A": [[0, 1], [-2, -1]], "B": [[0], [1]], "C": [[1, 0]], "outputs": ["y"]}
SLOPE = [{"type": {"slope": [-0.5, 0.5]}, "f": "0.5*sin(q)", "Bf": [0, -1], "Cq": [1, 0]}]
LIPSCHITZ = [{"type": {"lipschitz": 0.5}, "f": "0.5*sin(q)", "Bf": [0, -1], "Cq": [1, 0]}]
NOISE = {"y": {"rms": "0.01", "period": 0.001}}
SIZES = {"min": 1, "max": 1000, "points": 7}
L2 = {"type": "l2", "alpha": 0.2}
PARETO = {"objective": "pareto", "bounds": {"L1": SIZES}}


def spec(observer, blocks=SLOPE, noise=NOISE, **further):
    return od.Spec(**{"system": SPRING, "nonlinearities": blocks, "observer": observer, "noise": noise, **further})


def certified(design, gain):
    """Certified points: norms of gains and gammas, the smallest first."""
    made = [point["certified"] for point in design.result["search"]["points"] if "certified" in point]
    return np.array(sorted((point[gain], point["gamma"]) for point in made)).T


def distances(gains, gammas):
    """How far each point is below the line between the ends, in logarithms."""
    x, y = np.log(gains), np.log(gammas)
    return y[0] + (y[-1] - y[0]) * (x - x[0]) / (x[-1] - x[0]) - y


# The curve


@pytest.mark.parametrize(
    ("observer", "blocks", "gain"),
    [
        ({**L2, **PARETO}, SLOPE, "L1"),
        ({**L2, "type": "linf", **PARETO}, SLOPE, "L1"),
        ({"type": "lipschitz", "decay": 0.2, "objective": "pareto", "bounds": {"L": SIZES}}, LIPSCHITZ, "L"),
    ],
    ids=["l2", "linf", "lipschitz"],
)
def test_every_point_of_a_range_is_certified_and_the_knee_is_shipped(observer, blocks, gain):
    design = od.solve(spec(observer, blocks))
    content = design.result
    points = content["search"]["points"]
    assert content["search"]["parameter"] == gain
    assert [point["status"] for point in points] == ["certified"] * 7
    assert [point[gain] for point in points] == pytest.approx(np.geomspace(1, 1000, 7))
    assert all(point["certified"][gain] <= point[gain] for point in points)
    gains, gammas = certified(design, gain)
    assert (np.diff(gammas) <= 0).all()
    below = distances(gains, gammas)
    near = gammas <= 1.1 * content["guarantee"]["limit"]["gamma"]
    best = int(below.argmax() if below.max() > math.log(1.05) else near.argmax())
    assert content["guarantee"]["gamma"] == gammas[best]
    assert np.linalg.norm(content["observer"][gain], 2) == pytest.approx(gains[best])
    assert design.verify().holds
    assert "search" in content["numerical"]
    noise = [point["noise_error"]["x1"] for point in points]
    assert np.diff(noise).min() >= 0 < noise[-1] - noise[0]
    shipped = next(p for p in points if p["certified"]["gamma"] == gammas[best])
    assert design.analysis["noise_error"] == pytest.approx(shipped["noise_error"])
    mixed = [note for note in design.notes if note.startswith(f"|{gain}| is in the units of the spec")]
    assert len(mixed) == (design.gains[gain].size > 1)


def test_a_point_is_the_design_of_its_bound():
    points = od.solve(spec({**L2, **PARETO})).result["search"]["points"]
    alone = od.solve(spec({**L2, "bounds": {"L1": points[3]["L1"]}}))
    assert alone.guarantee.gamma == points[3]["certified"]["gamma"]


def test_the_largest_bound_of_a_range_is_kept_by_what_is_shipped_and_proved():
    design = od.solve(spec({**L2, **PARETO}))
    assert any("|L| <= kappa" in check.name for check in design.proof.checks)


def test_measurements_at_instants_have_a_curve_too():
    observer = {"type": "sporadic", "T1": 0.1, "T2": 0.2, "objective": "pareto",
                "bounds": {"L": {"min": 0.5, "max": 8, "points": 3}}}  # fmt: skip
    design = od.solve(spec(observer))
    gains, gammas = certified(design, "L")
    assert len(gains) == 3
    assert (np.diff(gammas) < 0).all()
    assert design.result["guarantee"]["limit"]["kind"] == "best-found"
    assert design.result["guarantee"]["limit"]["gamma"] <= gammas.min()
    assert design.verify().holds


# bounds: auto


def test_auto_goes_from_half_of_no_observer_up_to_near_the_limit():
    design = od.solve(spec({**L2, "bounds": "auto"}))
    content = design.result
    gains, gammas = certified(design, "L1")
    limit, unaided = content["guarantee"]["limit"]["gamma"], content["analysis"]["no_observer"]["open_loop"]
    assert gammas[0] <= 1.06 * unaided / 2  # the slack beyond the least gamma
    assert gammas[-1] <= 1.1 * limit < gammas[-2]
    sizes = [point["L1"] for point in content["search"]["points"]]
    assert np.diff(np.log10(sizes)) == pytest.approx(0.25, abs=2e-3)
    assert content["guarantee"]["gamma"] == gammas[distances(gains, gammas).argmax()]
    assert any("the knee of gamma against it" in note for note in design.notes)
    assert design.verify().holds


def test_auto_begins_at_twice_the_least_gain_where_a_plant_needs_one():
    """X' = x + w needs L > 1: at alpha = .2 the least is 1.2."""
    unstable = {"A": [[1]], "B": [[1]], "C": [[1]], "outputs": ["y"]}
    design = od.solve(od.Spec(system=unstable, observer={**L2, "bounds": "auto"}, noise={"y": "0.01"}))
    first = design.result["search"]["points"][0]["L1"]
    assert first == pytest.approx(2.4, rel=0.1)


def test_without_a_knee_the_middle_is_shipped_and_that_is_said():
    design = od.solve(spec({**L2, "bounds": "auto"}, noise={}))
    gains, gammas = certified(design, "L1")
    assert design.result["guarantee"]["limit"]["gamma"] == 0
    assert distances(gains, gammas).max() <= math.log(1.05)
    assert design.guarantee.gamma == gammas[len(gammas) // 2]
    assert any("the middle of a curve without a knee" in note for note in design.notes)


def test_auto_gives_the_same_twice():
    made = [od.solve(spec({**L2, "bounds": "auto"})).result for _ in range(2)]
    assert made[0]["observer"] == made[1]["observer"]
    assert made[0]["search"] == made[1]["search"]


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [
        ([0, 1, 2], [2, 0.5, 0], 1),
        ([0, 1, 2, 3], [3, 1.6, 0.2, 0], 2),
        ([0, 1, 2], [2, 1, 0], None),
        ([0, 1, 2], [2, 1.5, 0], None),
        ([0], [1], None),
    ],
)
def test_the_knee_is_the_farthest_point_below_the_line(x, y, expected):
    assert knee(x, y, 0.05) == expected


# The refusal that names it


def test_the_table_of_a_limit_of_zero_shows_the_noise_and_names_auto():
    with pytest.raises(UsageError) as caught:
        od.solve(spec(L2, noise={}))
    (problem,) = caught.value.problems
    assert "or `bounds: auto`, its knee" in problem.message
    rows = [row.split() for row in problem.rows]
    loud = [float(row[6]) for row in rows]
    assert "rms of z for white noise of density 1" in problem.rows[0]
    assert loud == sorted(loud)
    bound = float(rows[1][2])
    design = od.solve(spec({**L2, "bounds": {"L1": bound}, "slack": 0}, noise={}))
    z = np.linalg.norm([row["y"] for row in design.analysis["noise_density"].values()])
    assert loud[1] == pytest.approx(z, rel=0.1)


# Refusals


@pytest.mark.parametrize(
    ("observer", "said"),
    [
        ({**L2, "bounds": {"L1": SIZES}}, "a range of bounds is for objective: pareto"),
        ({**L2, "bounds": "knee"}, "unknown bounds knee"),
        ({**L2, "bounds": "auto", "objective": "feasibility"}, "auto is the knee of gamma against the gain"),
        ({**L2, "objective": "pareto", "bounds": {"L1": {"min": 5, "max": 1}}}, "min is not below max"),
        ({**L2, **PARETO, "alpha": {"min": 0.1, "max": 1}}, "is a curve at one alpha: give a number"),
        ({"type": "linf", **PARETO}, "is a curve at one alpha: give a number"),
        ({"type": "sporadic", "T1": 0.1, "T2": 0.2, "injection": ["dynamic", "reset"], "bounds": "auto"},
         "a curve of one injection"),
        ({"type": "sporadic", "T1": 0.1, "T2": {"min": 0.1, "max": 0.3}, "objective": "pareto",
          "bounds": {"L": SIZES}}, "a curve at one T2"),
    ],
)  # fmt: skip
def test_what_makes_no_curve_is_refused(observer, said):
    with pytest.raises(UsageError) as caught:
        spec(observer)
    assert said in "; ".join(problem.message for problem in caught.value.problems)


def test_a_curve_of_gamma_needs_a_disturbance():
    with pytest.raises(UsageError, match="nothing disturbs this plant"):
        od.Spec(system={"A": [[-1]], "C": [[1]]}, observer={**L2, "bounds": "auto"})


# The figure


def test_the_figure_shows_gains_noise_and_the_knee(tmp_path):
    design = od.solve(spec({**L2, **PARETO}))
    assert design.plot_search(str(tmp_path / "curve.png"))
    points, claimed = design.result["search"]["points"], design.result["guarantee"]
    figure = gain_sheet(points, {**claimed, "L1": 50.0}, "title", "L1")
    assert isinstance(figure, Figure)
    top, below = figure.axes
    drawn = {line.get_label(): line for line in top.get_lines()}
    gains, gammas = certified(design, "L1")
    assert drawn["certified gains"].get_xdata() == pytest.approx(gains)
    assert drawn["certified gains"].get_ydata() == pytest.approx(gammas)
    assert drawn["between the ends"].get_xdata() == pytest.approx(gains[[0, -1]])
    assert [line.get_label() for line in below.get_lines()] == ["noise in x1", "noise in x2"]
    assert {axes.get_xscale() for axes in (top, below)} == {axes.get_yscale() for axes in (top, below)} == {"log"}


def test_a_point_of_the_curve_is_no_worse_than_those_of_smaller_bounds(monkeypatch):
    """Where the search within a larger bound finds a worse gain, or none, that of the smaller one is within both."""
    gammas = {1: math.nan, 10: 3.0, 100: 4.0, 1000: math.nan, 10000: 2.0}
    monkeypatch.setattr(Trader, "spot", lambda _, size: Spot(size, None, float(size) / 2, gammas[round(float(size))]))
    sizes = Range(fmpq(1), fmpq(10000), 5, log=True)
    trader = Trader(spec(L2), Engine(), Trade("L1", sizes), None, None, None, None)
    spots = list(trader.spots())
    assert [float(spot.size) for spot in spots] == pytest.approx(list(gammas))
    assert [spot.gamma for spot in spots[1:]] == [3.0, 3.0, 3.0, 2.0]
    assert [spot.gain for spot in spots[1:]] == [5.0, 5.0, 5.0, 5000.0]
    assert not spots[0].certified
