"""Errors of observers without an LMI that act on each other: which fall, which wait for others, which xhat shows."""

import json
from pathlib import Path

import pytest
from support.commands import run

import obsdesign as od

pytestmark = pytest.mark.usefixtures("here")

PROVED, REFUTED, OPEN = 0, 3, 4
PAIR = "{dynamics: {x1: x2-x1, x2: -x2+x1}, outputs: {y: x1}}"
MODES = "{name: a, phi: x2, lambda: -1, B: y}, {name: b, phi: x2-x1, lambda: -2, B: 0}"
INVERSES = "x2: 3*a-2*(b+y)"
RECAST = "recast: immersion-invariance"
CONVERTER = (
    "{inputs: [u], dynamics: {i1: 100*(12-(1-u)*v2), v2: 50*((1-u)*i1+u*i3), i3: -i3}, outputs: {y1: v2, y2: i3}, "
    "domain: {i1: [-3, 3], v2: [5, 50], i3: [-2, 2], u: [0.1, 0.9]}}"
)
CURRENT = "phi: i1-%s*v2, lambda: -%s*(1-u), B: 1200-100*(1-u)*y1-%s*u*y2-%s*(1-u)*%s*y1"
CURRENTS = ", ".join(
    f"{{name: {name}, {CURRENT % (k, 50 * k, 50 * k, 50 * k, k)}}}" for name, k in (("a", 1), ("b", 2))
)
WITH_CONSTANT = "{dynamics: {x1: x2-x1, x2: -x2+x1, p: r, r: 0}, outputs: {y: x1, z: p}}"
CONSTANT = "{name: xr, phi: r}, "

RECASTS = {  # of coordinates of which there are more than states that are sought
    "two modes": (PAIR, f"{{type: kkl, coordinates: [{MODES}], left_inverse: {{{INVERSES}}}, {RECAST}}}", OPEN,
                  "not known whether the observer that is recast converges, for it is not that of the coordinates: "
                  "recast: d/dt (x2) at xhat is that of a fails: 2*a - 2*y - 2*b", "obeys e' = -1 e"),
    "one mode": (PAIR, f"{{type: kkl, coordinates: [{MODES}], left_inverse: {{x2: a}}, {RECAST}}}", OPEN,
                 "recast: d/dt (x2 - x1) at xhat is that of b fails", "rate "),
    "a mode by itself": (PAIR, "{type: kkl, coordinates: [{name: a, phi: x2, lambda: -1, B: y}], left_inverse: "
                         f"{{x2: a}}, {RECAST}}}", PROVED, "a - (x2), obeys e' = -1 e", "not fall"),
    "currents": (CONVERTER, f"{{type: kkl, coordinates: [{CURRENTS}], left_inverse: {{i1: 3*(a+y1)-2*(b+2*y1)}}, "
                 f"{RECAST}}}", OPEN, "recast: d/dt (i1 - 2*v2) at xhat is that of b fails", "rate "),
    "with a constant": (WITH_CONSTANT, f"{{type: kkl+pebo, coordinates: [{CONSTANT}{MODES}], left_inverse: "
                        f"{{r: xr, {INVERSES}}}, estimator: {{method: proportional, K: {{xr: 2*z}}}}, {RECAST}}}", OPEN,
                        "that the errors of the observer that is recast fall: it is another one", "obeys e' = -2 e"),
}  # fmt: skip

CHAIN = "{dynamics: {x1: %s*x3-a-x1, a: 0, x3: -x3+a}, outputs: {y: x1}}"
CIRCLE = (
    "{type: kkl+pebo, coordinates: [{name: xa, phi: a}, {name: xc, phi: x3, lambda: -1, B: xa}], "
    "left_inverse: {a: xa, x3: xc}, estimator: {%s}}"
)
ROW = "regressions: [{output: y, known: 5*xc-xa-y, m: {xa: -1}}], alpha: 5, gamma: 0.2"
BY_OUTPUT = "method: proportional, K: {%s}"
TWO = "{dynamics: {x1: a, x2: b, a: 0, b: 0}, outputs: {y1: x1, y2: x2}}"
BOTH = (
    "{type: pebo, coordinates: [{name: xa, phi: a}, {name: xb, phi: b}], left_inverse: {a: xa, b: xb}, estimator: {%s}}"
)
SAME = (
    "{type: pebo, coordinates: [{name: xa, phi: a}, {name: xb, phi: a}], left_inverse: {a: 2*xa-xb}, estimator: {%s}}"
)
ONE = "{dynamics: {x1: a, a: 0}, outputs: {y: x1}}"

CIRCLES = {  # estimates that wait for each other, which are no cascade
    "of a regression": (CHAIN % 5, CIRCLE % ROW, OPEN, "neither proved nor refuted: that estimates which wait for each "
                        "other converge: xa waits for xc, xc waits for xa", "once"),
    "of an estimator that diverges": (CHAIN % 5, CIRCLE % (BY_OUTPUT % "xa: -0.2*y"), REFUTED,
                                      "estimate of theta of xa and error of xc are stable: -0.96 > 0 fails", "once"),
    "of an estimator that converges": (CHAIN % 0.5, CIRCLE % (BY_OUTPUT % "xa: -2*y"), PROVED,
        "the error of the estimate of theta of xa, the error of xc act on each other and fall exponentially, for "
        "e' = M e with a constant M: |e(t)| <= c exp(-0.", "once"),
    "of none": (CHAIN % 0, CIRCLE % (BY_OUTPUT % "xa: -0.2*y"), PROVED,
                "so that e(t) = e(0) exp(-t), once the estimate of xa is right", "act on each other"),
    "of two constants": (TWO, BOTH % (BY_OUTPUT % "xa: 5*y1-10*y2, xb: 10*y1-y2"), PROVED,
                         "act on each other and fall exponentially", "once"),
    "of two constants that diverge": (TWO, BOTH % (BY_OUTPUT % "xa: 5*y1-10*y2, xb: -10*y1-y2"), REFUTED,
                                      "estimate of theta of xa and estimate of theta of xb are stable", "once"),
    "of a constant that is estimated twice": (ONE, SAME % (BY_OUTPUT % "xa: 2*y, xb: 3*y"), OPEN,
                                              "not known whether xhat - x holds a part of this error", "once"),
    "of a constant twice, diverging": (ONE, SAME % (BY_OUTPUT % "xa: y, xb: 3*y"), REFUTED, "are stable: -1 > 0", ""),
}  # fmt: skip

DRIVEN = "{dynamics: {x1: -x1, x2: -x2+x1, x3: -0.5*x3+%s*x2}, outputs: {y: x1}}"
ORDERED = (
    "{type: kkl, coordinates: [{name: a, phi: x2, lambda: -1, B: y}, {name: b, phi: x3, lambda: -0.5, B: %s*a}], "
    "left_inverse: {x2: a, x3: b}}"
)
SENSED = "{dynamics: {x1: %s*c+a, a: 0, c: -c}, outputs: {y: x1}}"
ESTIMATED = (
    "{type: kkl+pebo, coordinates: [{name: xa, phi: a}, {name: xc, phi: c, lambda: -1}], left_inverse: {a: xa, c: xc}, "
    "estimator: {regressions: [{output: y, known: %s*xc+xa, m: {xa: 1}}], alpha: 1, gamma: 1}}"
)
ROWED, COPY = "{dynamics: {x1: -x1, x2: -x2+%s*x1}, outputs: {y: x1}}", "{type: high-gain, injection: {x1: {y: 1}}}"
FACTORS = {  # by which an error acts on another: the factor, the plant and the observer, what is not proved
    "of a coordinate": (DRIVEN, ORDERED, "that the error of a acts on that of b by a bounded factor, "),
    "of a regression": (SENSED, ESTIMATED, "that the error of xc acts on regression 1 by a bounded factor, "),
    "of a copy": (ROWED, COPY, "that the error of hat_x1 acts on that of hat_x2 by a bounded factor, "),
}  # fmt: skip

SHAPED = "{type: immersion-invariance, chi: [a, b], phi: [%s], beta: [%s], left_inverse: {%s}}"
LUENBERGER = "{dynamics: {x1: -%s*x1+10*x2, x2: -10*x1+x2, x3: x1}, outputs: {y: x3}}"
EXTRA = "{dynamics: {x1: x2, x2: -x1}, outputs: {y: x1}}"
FURTHER = (
    "{type: high-gain, states: {z1: x1, z2: x2, z3: x1+x2}, dynamics: {z1: z2, z2: -z1, z3: z2-z1}, "
    "left_inverse: {x2: %s}, injection: {z1: {y: 3}, z2: {y: 2}}}"
)
SWUNG = "{dynamics: {x1: %s*x1, x2: x1-x2}, outputs: {y: x2}}"
COPIED = "{type: high-gain, injection: {x2: {y: 1}}}"
SHOWN = {  # errors that do not fall, or not one after another
    "off a manifold, together": (LUENBERGER % 5, SHAPED % ("x1, x2", "a+y, b+y", "x1: b1, x2: b2"), PROVED,
        "(a + y) - (x1), (b + y) - (x2) act on each other and fall exponentially, for e' = M e with a constant M: "
        "|e(t)| <= c exp(-2.47*t) |e(0)| for some c"),
    "off a manifold, together while t passes": (LUENBERGER % "(5+sin(t))", SHAPED % (
        "x1, x2", "a+y, b+y", "x1: b1, x2: b2"), OPEN, "fall, which act on each other while t varies"),
    "off a manifold, diverging": (LUENBERGER % 5, SHAPED % ("x1, x2", "a-5*y, b+y", "x1: b1, x2: b2"), REFUTED,
                                  "off the manifold, 1 and off the manifold, 2 are stable"),
    "of more than there is": (PAIR, SHAPED % ("x2, x2-x1", "a, b", "x2: 1.5*b1-0.5*(b2+y)"), OPEN,
                              "not known whether xhat - x holds a part of this error that does not fall"),
    "of more than there is, diverging": (PAIR, SHAPED % ("x2, x2-x1", "a, b", "x2: 3*b1-2*(b2+y)"), REFUTED,
                                         "are stable: -1 > 0 fails"),
    "of what is not used": (PAIR, SHAPED % ("x2, x2-x1", "a, b", "x2: b1"), OPEN,
                            "holds a part of this error that does not fall: off the manifold, 2: 0 < 0 fails"),
    "of a quotient": ("{dynamics: {x: -x, z: -z}, outputs: {y: x}, domain: {x: [0.1, 1]}}",
        "{type: immersion-invariance, chi: [c], phi: [z/x], beta: [c], left_inverse: {z: b1*y}}", OPEN,
        "not known whether xhat - x holds a part of this error"),
    "of a copy that is not used": (EXTRA, FURTHER % "z2", OPEN, "the error of z3 is stable: 0 > 0 fails"),
    "of a copy that is used": (EXTRA, FURTHER % "z3-y", REFUTED, "the error of z3 is stable: 0 > 0 fails"),
    "of a coordinate that is not used": (PAIR, "{type: kkl, coordinates: [{name: a, phi: x2, lambda: -1, B: y}, "
        "{name: b, phi: x2+x1, lambda: 1, B: y}], left_inverse: {x2: a}}", OPEN,
        "not known whether it matters, since xhat does not depend on it: b: lambda = 1 < 0 fails"),
    "that falls in the mean": (SWUNG % "(sin(t)-0.5)", COPIED, OPEN,
                               "not known whether this error decays while t varies: the error of hat_x1 is stable"),
    "that grows at any time": (SWUNG % "(sin(t)+1.5)", COPIED, REFUTED, "the error of hat_x1 is stable"),
    "that grows, on another that varies": (
        "{dynamics: {x1: x1, x2: x1-(2+sin(t))*x2}, outputs: {y: x2}}", COPIED, REFUTED, "the error of hat_x1 is"),
}  # fmt: skip


def solved(plant, observer):
    """Outcome of a spec, and what its file holds."""
    Path("case.yaml").write_text(f"obsdesign: 1\nname: a plant\nsystem: {plant}\nobserver: {observer}\n")
    outcome = run("solve", "case.yaml")
    return outcome, json.loads(Path("case.gains.json").read_text())


def require_proved_again(outcome):
    """What is certified or refuted is proved anew, and nothing else is."""
    assert (run("verify", "case.gains.json").exit_code == PROVED) is (outcome.exit_code != OPEN)


@pytest.mark.parametrize(("plant", "observer", "code", "words", "unsaid"), RECASTS.values(), ids=RECASTS)
def test_an_observer_that_is_recast_is_certified_where_it_is_that_of_the_coordinates(
    plant, observer, code, words, unsaid
):
    outcome, file = solved(plant, observer)
    assert outcome.exit_code == code, outcome.output
    assert words in outcome.output
    assert unsaid not in outcome.output
    recast = file["guarantee"]["recast"]
    assert recast["holds"] is (code == PROVED)
    assert "phi_dot(xhat, u) = lambda xi + B for all arguments" in recast["condition"]
    assert bool(file["guarantee"]["rates"]) is (code == PROVED)
    require_proved_again(outcome)


@pytest.mark.parametrize(("plant", "observer", "code", "words", "unsaid"), CIRCLES.values(), ids=CIRCLES)
def test_estimates_that_wait_for_each_other_are_no_cascade(plant, observer, code, words, unsaid):
    outcome, _ = solved(plant, observer)
    assert outcome.exit_code == code, outcome.output
    assert words in outcome.output
    assert not unsaid or unsaid not in outcome.output
    require_proved_again(outcome)


@pytest.mark.parametrize(("plant", "observer", "words"), FACTORS.values(), ids=FACTORS)
@pytest.mark.parametrize(("factor", "bounded"), [("exp(t)", False), ("sin(t)", True), ("3", True)])
def test_an_error_that_acts_on_another_by_a_factor_without_bound_is_told(plant, observer, words, factor, bounded):
    outcome, file = solved(plant % factor, observer % factor if "%" in observer else observer)
    assert outcome.exit_code == PROVED, outcome.output
    assert (f"not proved: {words}{factor}" in file["guarantee"]["statement"]) is not bounded
    assert ("bounded factor" in file["guarantee"]["statement"]) is not bounded
    require_proved_again(outcome)


@pytest.mark.parametrize(("plant", "observer", "code", "words"), SHOWN.values(), ids=SHOWN)
def test_an_observer_is_refuted_by_errors_that_its_estimate_shows(plant, observer, code, words):
    outcome, _ = solved(plant, observer)
    assert outcome.exit_code == code, outcome.output
    assert words in outcome.output
    require_proved_again(outcome)


RUNS = {  # observers, and whether the estimate converges
    "of an estimator that diverges": False,
    "of an estimator that converges": True,
    "of two constants": True,
    "of a constant that is estimated twice": True,
    "of a constant twice, diverging": False,
    "off a manifold, together": True,
    "of more than there is": True,
    "of more than there is, diverging": False,
    "of what is not used": True,
    "of a quotient": True,
    "of a copy that is not used": True,
    "that falls in the mean": True,
    "that grows at any time": False,
}


@pytest.mark.parametrize(("name", "converges"), RUNS.items())
def test_what_is_refuted_does_not_converge_and_what_is_not_may(name, converges):
    plant, observer, code, *_ = {**CIRCLES, **SHOWN}[name]
    assert (code == REFUTED) is not converges
    spec = f"obsdesign: 1\nname: a plant\nsystem: {plant}\nobserver: {observer}\n"
    design = od.solve(od.load(spec))
    made = design.simulate(horizon=20, x0=[0.5, 0.7, 0.3, -0.4][: len(design.spec.plant.states)])
    assert (made.summary["final_error"] < 0.02 * made.summary["initial_error"]) is converges
