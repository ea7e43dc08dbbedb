"""Results of observers of Lipschitz systems on a terminal: every number once, and few lines for many points."""

import itertools
import re
from fractions import Fraction
from pathlib import Path

import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from support.commands import PNG, run
from support.sweep import examples

from obsdesign.reading import loads
from obsdesign.tables.design import design_rows
from obsdesign.tables.run import bound_text
from obsdesign.tables.text import at_least, at_most

DIGITS = st.integers(1, 12)

OBSERVER = {"type": "lipschitz", "relaxation": "compare", "L": [[3.0], [4.0]], "poles": [[-1.0, 2.0], [-1.0, -2.0]],
            "fastest": 2.236, "largest_step": 1.2, "noise_gain": {"x1": 0.5}, "condition_P": 7.0}  # fmt: skip
GUARANTEE = {"lipschitz": 0.5, "gamma": 0.75, "decay": 0.05, "mu1": 1.0, "mu2": 0.5625, "margin": 0.1,
             "limit": {"lipschitz": 0.6, "gamma": 0.7, "attained": False}}  # fmt: skip


def table(search=None, **guarantee):
    """Rows of a result."""
    content = {"name": "Example", "status": "certified", "observer": OBSERVER, "guarantee": GUARANTEE | guarantee}
    return design_rows(content | ({"search": search} if search else {}))


def texts(rows, key):
    """What stands beside a key."""
    return [text for name, text in rows if name == key]


def point(weight, decay, **numbers):
    """One certified point."""
    certified = {"lipschitz": round(0.5 + weight / 10 - decay, 6), "gamma": 1 + weight, "L": 10 * weight + 1}
    limit = {"lipschitz": 0.6 + weight / 10 - decay, "gamma": 1.1 + weight, "status": "optimal", "attained": True}
    return {"weight": weight, "decay": decay, **limit, "certified": certified, "corner": False, **numbers}


def test_the_claim_its_limit_and_the_gain_have_a_line_each():
    rows = table()
    assert texts(rows, "lipschitz") == ["0.5   for every f with this constant"]
    assert texts(rows, "margin") == ["0.1   left for an uncertainty of f"]
    assert texts(rows, "gamma") == ["0.75   norm2(z) <= gamma norm2(w) from zero error"]
    assert texts(rows, "decay rate") == ["0.05 1/s"]
    assert texts(rows, "limit") == ["lipschitz 0.6, gamma 0.7"]
    assert texts(rows, "gain") == ["|L| = 5"]
    assert texts(rows, "poles") == ["-1+2j, -1-2j   of the linear part, without f"]
    assert not texts(rows, "ceiling")
    assert not texts(rows, "widened")


def test_a_declared_constant_that_is_not_covered_is_said():
    assert texts(table(margin=-0.25), "margin") == ["-0.25   the declared constant is NOT covered"]


def test_a_limit_that_is_infinite_is_called_unbounded():
    assert texts(table(limit={"unbounded": True, "attained": False}), "limit") == ["unbounded"]


def test_what_the_relaxations_cost_is_a_line_each():
    comparison = [
        {"relaxation": "s-procedure", "limit": {"unbounded": True, "attained": False},
         "certified": {"lipschitz": 7.0, "L": 300.0}},
        {"relaxation": "abbaszadeh", "limit": {"lipschitz": 0.46, "attained": False}, "reason": "sigma(H) >= 1"},
        {"relaxation": "norm-bound", "limit": {}, "reason": "too large"},
    ]  # fmt: skip
    rows = table(comparison=comparison, ceiling=12.08, widened={"gamma": 0.849, "lipschitz": 0.4772})
    assert texts(rows, "relaxation") == [
        "s-procedure    limit unbounded   certified lipschitz 7, |L| = 300",
        "abbaszadeh     limit lipschitz 0.46   sigma(H) >= 1",
        "norm-bound     too large",
    ]
    assert texts(rows, "ceiling") == ["lipschitz 12.08   no gain tolerates more"]
    assert texts(rows, "widened") == ["gamma 0.849 as if the Lipschitz constant were 0.4772"]


def test_a_curve_is_a_line_a_point_with_what_is_special_about_it():
    points = [
        point(0.2, 0.05, corner=True),
        point(0.5, 0.05, attained=False),
        {"weight": 0.9, "decay": 0.05, "status": "infeasible"},
        {"weight": 1.0, "decay": 0.05, "lipschitz": 0.7, "attained": False, "status": "uncertified"},
    ]
    assert texts(table({"parameter": "weight", "points": points}), "curve") == [
        "weight 0.2     lipschitz 0.57, gamma 1.3   certified lipschitz 0.47, gamma 1.2, |L| = 3   corner",
        "weight 0.5     lipschitz 0.6, gamma 1.6   certified lipschitz 0.5, gamma 1.5, |L| = 6   not attained",
        "weight 0.9     infeasible",
        "weight 1       lipschitz 0.7   uncertified   not attained",
    ]


def test_a_curve_over_the_decay_is_labeled_by_it():
    (line,) = texts(table({"parameter": "decay", "points": [point(0.9, 0.25)]}), "curve")
    assert line.startswith("decay 0.25 ")


def test_a_surface_is_summed_up():
    grid = itertools.product([k / 20 for k in range(21)], [k / 20 for k in range(11)])
    points = [
        {"weight": w, "decay": d, "status": "infeasible"} if d > 0.47 else point(w, d, attained=w < 1) for w, d in grid
    ]
    rows = table({"parameter": "weight", "parameters": ["weight", "decay"], "points": points})
    assert not texts(rows, "curve")
    assert texts(rows, "surface") == ["231 points, weight 0 to 1, decay 0 to 0.5: 210 certified"]
    assert texts(rows, "certified") == ["lipschitz 0.05 to 0.6, gamma 1 to 2, |L| 1 to 11"]
    assert texts(rows, "not attained") == ["at 10 of them"]
    assert texts(rows, "no solution") == ["at 21 of them, weight 0 to 1, decay 0.5"]


# Bounds


@examples(300)
@given(st.floats(allow_nan=False, allow_infinity=False) | st.fractions(), DIGITS)
def test_a_bound_is_shown_on_the_safe_side_and_as_tight_as_its_digits_allow(x, digits):
    exact = Fraction(repr(x)) if isinstance(x, float) else x  # a double is the decimal that prints it
    given_as = x if isinstance(x, float) else fmpq(x.numerator, x.denominator)
    high, low = Fraction(at_most(given_as, digits)), Fraction(at_least(given_as, digits))
    assert low <= exact <= high
    assert high - low <= abs(exact) * Fraction(10) ** (1 - digits)
    assert (high == low) == (low == exact)


def test_what_has_few_digits_is_shown_as_it_is():
    assert [at_most(x) for x in (0.1, 0.3, 20.0, 1e-7, -0.25, 0.0)] == ["0.1", "0.3", "20", "1e-07", "-0.25", "0"]
    assert (at_most(1e-320), at_least(1e-320), at_least(1.23e-318, 2)) == ("1e-320", "1e-320", "1.2e-318")
    assert (at_most(46.617914909), at_least(46.617914909), at_most(float("inf"))) == ("46.618", "46.6179", "inf")


def test_every_claim_of_a_table_is_rounded_to_the_safe_side():
    claims = {"lipschitz": 0.51234567, "gamma": 0.75123411, "decay": 0.05432178, "margin": 0.10123456, "mu1": 1.0}
    point = {"weight": 0.5, "decay": 0.1, "lipschitz": 0.6, "gamma": 0.7, "certified": claims | {"L": 2.0}}
    search = {"parameter": "weight", "points": [point | {"status": "optimal", "attained": True}]}
    rows = table(search, **claims, admissible=0.61234567, ceiling=1.23456712)
    assert [text.split(" ")[0] for name, text in rows if name in {"lipschitz", "gamma", "decay rate", "margin"}] == [
        "0.512345", "0.101234", "0.751235", "0.0543217",
    ]  # fmt: skip
    assert texts(rows, "tolerated") == ["a Lipschitz constant up to 0.612345"]
    assert texts(rows, "ceiling") == ["lipschitz 1.23457   no gain tolerates more"]
    assert "certified lipschitz 0.512345, gamma 0.751235, |L| = 2" in texts(rows, "curve")[0]
    run = {"holds": True, "value": 1.0, "bound": 1.23456712, "accuracy": 0.0, "name": "|z| <= gamma"}
    assert bound_text(run) == "holds: 1 <= 1.23457   |z| <= gamma"


PLANT = """obsdesign: 1
name: case
system: {states: [p, s], A: [[0, 1], [-2, -1]], B: [0, 1], C: [1, 0]}
nonlinearities: [{f: sin(q), type: sin, Bf: [0, 0.5], Cq: [1, 0]}]
simulation: {horizon: 2, x0: [1, 0], w: [sin(t)]}
"""
FAMILIES = {
    "l2": ("{type: l2, L2: 0, alpha: 0.1, bounds: {L1: 20}}", "v", "norm2"),
    "linf": ("{type: linf, L2: 0, alpha: 0.1, bounds: {L1: 20}}", "v", "sup"),
    "lipschitz": ("{type: lipschitz, objective: min-gamma, bounds: {L: 20}}", "w", "norm2"),
    "sporadic": ("{type: sporadic, T1: 0.05, T2: 0.1, decay: 0.05, delta: 5, bounds: {L: 10}}", "w", "norm2"),
}


def printed(command, text, *options):
    """What a command prints for a spec, as rows."""
    Path("case.yaml").write_text(text)
    outcome = run(command, "case.yaml", *options)
    assert outcome.exit_code == 0, outcome.output
    return [tuple(line.split("  ", 1)) if "  " in line else (line, "") for line in outcome.stdout.splitlines()]


def beside(rows, key):
    """Texts beside a key."""
    return [text.strip() for name, text in rows if name == key]


@pytest.mark.usefixtures("here", "sketched")
@pytest.mark.parametrize("family", FAMILIES)
def test_both_tables_say_what_z_and_v_are_and_what_gamma_bounds(family):
    observer, letter, norm = FAMILIES[family]
    said = f"z: error of the estimated p, s; {letter}: w1"
    rows = printed("solve", f"{PLANT}observer: {observer}\n", "--simulate")
    assert beside(rows, "signals") == [said, said]
    (ratio,) = beside(rows, "ratio")
    assert ratio.endswith(f"{norm_of(norm, letter)}; at most gamma from zero error, and this run begins with an error")
    assert {name for name, _ in rows if name.endswith(" norm2")} == {"z norm2", f"{letter} norm2"}
    assert not any(words in text for _, text in rows for words in ("(yp)", "infinite", "holds True"))
    at_rest = PLANT.replace("x0: [1, 0]", "x0: [0, 0]")
    (ratio,) = beside(printed("simulate", f"{at_rest}observer: {observer}\n"), "ratio")
    assert ratio.endswith("; at most gamma from zero error")


def norm_of(norm, letter):
    """Ratio that gamma bounds."""
    return "sup|z| / sup|v|" if norm == "sup" else f"norm2(z) / norm2({letter})"


@pytest.mark.usefixtures("here", "sketched")
def test_z_and_v_are_told_where_a_model_or_a_matrix_makes_them():
    observer = f"observer: {FAMILIES['l2'][0]}\n"
    rows = printed("solve", f"{PLANT}{observer}disturbance: integrator\nperformance: w\n")
    assert beside(rows, "signals") == ["z: error of the estimated w1; v: v1, which drives the model of w1"]
    rows = printed("solve", f"{PLANT}{observer}performance: {{H: [[2, 0]]}}\n")
    assert beside(rows, "signals") == ["z: H e, e the error of the estimated p, s; v: w1"]


@pytest.mark.usefixtures("here", "sketched")
def test_a_rate_of_zero_says_whether_the_error_vanishes_and_a_gamma_that_was_not_sought_says_so():
    observer = "observer: {type: lipschitz, %s}\n"
    rows = printed("solve", PLANT + observer % "bounds: {L: 20}")
    assert beside(rows, "decay rate") == ["0 1/s   e(t) -> 0 without a disturbance; no rate is claimed"]
    assert beside(rows, "gamma")[0].endswith("from zero error; it was not minimised")
    rows = printed("solve", PLANT + observer % "objective: min-gamma, bounds: {L: 20}")
    assert beside(rows, "gamma")[0].endswith("from zero error")


@pytest.mark.usefixtures("here", "sketched")
def test_a_run_that_stalls_says_until_when_it_is_valid():
    stalling = (
        (
            "obsdesign: 1\nsystem: {A: [[0]], C: [[1]]}\nobserver: {type: l2, L2: 0, alpha: 0.1}\n"
            "nonlinearities: [{f: -1/sqrt(q), type: monotone, region: {q: [0.01, 9]}, Bf: [-1], Cq: [1]}]\n"
            "simulation: {horizon: 2, x0: [1], xhat0: [1]}\n"
        )
        .replace("f: -1/sqrt(q)", "f: 1/sqrt(q)")
        .replace("type: monotone", "type: {slope: [-500, 0]}")
    )
    (status,) = beside(printed("simulate", stalling), "status")
    assert re.fullmatch(r"stall at t = 0\.66\d+ s: computed until then", status)


@pytest.mark.usefixtures("here", "sketched")
@pytest.mark.parametrize("family", ["l2", "linf", "sporadic"])
def test_a_nonlinearity_that_acts_on_nothing_is_pointed_out(family):
    text = PLANT.replace("Bf: [0, 0.5]", "Bf: [0, 0]") + f"observer: {FAMILIES[family][0]}\n"
    said = "nonlinearities[0] acts on nothing: its columns of Bf, Df and Dqf are zero"
    assert said in beside(printed("solve", text), "note")
    assert f"{said}; use it or leave it out [OBS615]" in beside(printed("check", text), "note")
    assert f"{said}; use it or leave it out [OBS615]" not in beside(
        printed("check", f"{PLANT}observer: {FAMILIES[family][0]}\n"), "note"
    )


IDLE = """\
obsdesign: 1
system:
  disturbances: %s
  dynamics: {x1: x2, x2: -sin(x1) - 0.2*x2}
  outputs: {y: x1%s}
observer: {type: %s, alpha: 0.5}
"""


@pytest.mark.usefixtures("here", "sketched")
@pytest.mark.parametrize("family", ["l2", "linf"])
def test_a_disturbance_that_acts_on_nothing_is_pointed_out(family):
    said = "the disturbance d acts on nothing: it enters neither the dynamics nor an output"
    for command in ("check", "solve"):
        notes = beside(printed(command, IDLE % ("[d, n]", " + 0.1*n", family)), "note")
        assert said in [note.removesuffix("; use it or leave it out [OBS615]") for note in notes]
        assert said not in beside(printed(command, IDLE % ("[d]", " + 0.1*d", family)), "note")


@pytest.mark.usefixtures("here", "sketched")
@pytest.mark.parametrize("family", ["l2", "linf"])
def test_where_no_disturbance_acts_no_row_says_how_much_of_it_reaches_the_error(family):
    attenuation = ("gamma", "limit", "peak gain")
    quiet, driven = (printed("solve", IDLE % (w, part, family)) for w, part in (("[]", ""), ("[n]", " + 0.1*n")))
    assert not any(beside(quiet, row) for row in attenuation)
    assert beside(quiet, "decay rate")
    assert any("no disturbance acts on this plant" in note for note in beside(quiet, "note"))
    assert beside(driven, "gamma")


@pytest.mark.usefixtures("here", "sketched")
def test_what_is_left_out_of_the_bounds_is_told_from_when_on():
    local = PLANT.replace("type: sin", "type: sin, region: {q: [-1.5, 1.05]}").replace("w: [sin(t)]", "w: [6]")
    rows = printed("simulate", f"{local}observer: {FAMILIES['l2'][0]}\n")
    assert beside(rows, "bound")
    (left,) = beside(rows, "left out")
    assert re.fullmatch(
        r"every bound from then on: the guarantee is local, and the run left its region at t = [\d.]+", left
    )


@pytest.mark.parametrize("family", FAMILIES)
def test_a_figure_of_a_search_names_the_bounds_and_the_region(family):
    observer, _, _ = FAMILIES[family]
    local = PLANT.replace("type: sin", "type: {lipschitz: 1, region: {q: [-1, 1]}}")
    bounded, region = loads(f"{local}observer: {observer}\n").conditions
    assert (
        bounded == {"l2": "|L1| <= 20", "linf": "|L1| <= 20", "lipschitz": "|L| <= 20", "sporadic": "|L| <= 10"}[family]
    )
    assert region == "local: as long as q and its estimate stay in [-1, 1]"
    assert loads(f"{PLANT}observer: {observer.replace('bounds', '#')}".split(", #")[0] + "}").conditions == []


@pytest.mark.usefixtures("here", "sketched")
def test_the_curve_of_a_search_is_drawn_with_what_bounds_it(monkeypatch):
    titles = []
    monkeypatch.setattr("obsdesign.plot.tradeoff_figure", lambda *args, **_: titles.append(args[2]) or PNG)
    observer = "{type: l2, L2: 0, alpha: {min: 0.1, max: 0.2, points: 2}, objective: pareto, bounds: {L1: 20}}"
    printed("solve", f"{PLANT}observer: {observer}\n", "--plot")
    assert titles == ["case\n|L1| <= 20"]


@pytest.mark.usefixtures("here", "sketched")
def test_the_accuracy_of_a_reconstruction_is_told_in_words():
    observer = "{type: linf, L2: 0, alpha: 0.3, bounds: {L1: 20}, reconstruct: w}"
    (said,) = beside(
        printed("simulate", f"{PLANT}observer: {observer}\n".replace("C: [1, 0]", "C: [0, 1]")), "reconstruction"
    )
    assert re.match(r"\|what - w\| is at most [\d.e-]+ in the last fifth of the run, [\d.e-]+ at its peak; ", said)
    assert not any(words in said for words in ("limsup", "True", "x rate"))
