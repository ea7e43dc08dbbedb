"""Observers without an LMI where they are not what they seem: what is proved, refuted or left open, and in which words.

A statement is refuted only at a point where the plant can be, and only if the observer is none where it fails.
"""

import json
from pathlib import Path

import pytest
from support.commands import run
from support.shipped import SPECS

import obsdesign as od

pytestmark = pytest.mark.usefixtures("here")

PROVED, INVALID, REFUTED, OPEN = 0, 2, 3, 4
KKL = "{type: kkl, coordinates: [{name: xi, phi: %s, lambda: %s, B: %s}], left_inverse: {%s}}"
PEBO = "{type: pebo, coordinates: [{name: xi, phi: a, B: 0}], left_inverse: {%s}, estimator: {%s}}"
ROW = "regressions: [{output: y, known: %s, m: {xi: 1}}], alpha: 5, gamma: 5"
PROPORTIONAL = "method: proportional, K: {xi: %s}"
SHAPED = "{type: immersion-invariance, chi: [%s], phi: [%s], beta: [%s], left_inverse: {%s}, dynamics: {%s}}"
ROTATING, AWAY = "dynamics: {x: -z, z: x, a: -a}, ", "domain: {x: [-2, 2], z: [0.1, 2]}"
TURNING = "{dynamics: {x: -z*a, z: x*a, a: 0}, outputs: {y1: x, y2: z}, domain: {x: [-2, 2], z: [%s, 2]}}"
CUT = "is not 0, or x > 0: not the cut of atan2(z, x)"
DRIFT = "{%sdynamics: {x: a, a: 0}, outputs: {y: x%s}}"
DECAYING = "{dynamics: {x: -x, a: -a}, outputs: {y: x}, domain: {x: [%s], a: [%s]}}"
SECOND = "{dynamics: {x: -x, a: %s}, outputs: {y: x}%s}"

OUTPUTS = {  # that depend on t or on inputs, where they are differentiated
    "t in a regression": (DRIFT % ("", " + 5*sin(t)"), PEBO % ("a: xi, x: y - 5*sin(t)", ROW % "xi"), REFUTED,
                          "regression 1: d/dt y = xi + (1) theta fails: 5*cos(t)"),
    "t in a regression that knows": (DRIFT % ("", " + 5*sin(t)"), PEBO % (
        "a: xi, x: y - 5*sin(t)", ROW % "xi + 5*cos(t)"), PROVED, "so that Y = psi theta holds"),
    "u in a regression": (DRIFT % ("inputs: [u], ", " + u"), PEBO % ("a: xi, x: y - u", ROW % "xi"), INVALID,
                          "system.outputs.y: y = x + u is differentiated here, and u' is not known"),
    "t in a proportional estimator": (DRIFT % ("", " + 5*sin(t)"), PEBO % (
        "a: xi, x: y - 5*sin(t)", PROPORTIONAL % "2*y"), PROVED, "theta of xi"),
    "u in a proportional estimator": (DRIFT % ("inputs: [u], ", " + u"), PEBO % (
        "a: xi, x: y - u", PROPORTIONAL % "2*y"), INVALID, "u' is not known"),
    "u, recast": (DRIFT % ("inputs: [u], ", " + u"), (PEBO % ("a: xi, x: y - u", PROPORTIONAL % "2*y")).replace(
        "pebo,", "pebo, recast: immersion-invariance,"), INVALID, "u' is not known"),
    "u of an output that is not differentiated": (DRIFT % ("inputs: [u], ", ", z: x + u"), PEBO % (
        "a: xi", PROPORTIONAL % "2*y"), PROVED, "theta of xi"),
    "u in a manifold": (DRIFT % ("inputs: [u], ", " + u"), SHAPED % (
        "c", "a", "c + 2*y", "a: b1, x: y - u", "c: -2*(c + 2*y)"), INVALID, "make u a parameter if it is constant"),
    "u in a copy": (DRIFT % ("inputs: [u], ", " + u"), "{type: high-gain, injection: {x: {y: 4}, a: {y: 4}}}", PROVED,
                    "falls exponentially, since M is constant"),
    "a scaled output": ("{dynamics: {x: x*a, a: -a}, outputs: {y: 2*x}, domain: {x: [0.1, 50]}}", SHAPED % (
        "c", "a", "c + log(y)", "a: b1, x: y/2", "c: -2*(c + log(y))"), PROVED, "exp(-2*t)"),
    "an output with a kink": (DRIFT % ("", ", z: abs(x)"), PEBO % ("a: xi", PROPORTIONAL % "z"), INVALID,
                              "abs(x) has a kink or a jump"),
}  # fmt: skip

ENDS = {  # where a derivative does not say how a function moves
    "a root": ("{dynamics: {x: -2*x - 2*sqrt(x), a: -a}, outputs: {y: a}, domain: {x: [0, 1]}}",
               KKL % ("sqrt(x)", -1, -1, "x: xi**2"), OPEN, "x > 0, where sqrt(x) is differentiated fails: -x is 0"),
    "a root off its end": ("{dynamics: {x: -2*x - 2*sqrt(x), a: -a}, outputs: {y: a}, domain: {x: [0.1, 1]}}",
                           KKL % ("sqrt(x)", -1, -1, "x: xi**2"), PROVED, "exp(-t)"),
    "an arc": ("{dynamics: {x: sqrt(1 - x**2)*(1 - asin(x)), a: -a}, outputs: {y: a}, domain: {x: [-1, 1]}}",
               KKL % ("asin(x)", -1, 1, "x: sin(xi)"), OPEN, "1 - x**2 > 0, where asin(x) is differentiated fails"),
    "an angle": (f"{{{ROTATING}outputs: {{y1: x, y2: z}}}}", KKL % (
        '"a + atan2(z, x)"', -1, '"1 + atan2(y2, y1)"', 'a: "xi - atan2(y2, y1)"'), OPEN, CUT),
    "an angle off its cut": (f"{{{ROTATING}outputs: {{y1: x, y2: z}}, {AWAY}}}", KKL % (
        '"a + atan2(z, x)"', -1, '"1 + atan2(y2, y1)"', 'a: "xi - atan2(y2, y1)"'), PROVED, "exp(-t)"),
    "an angle that is measured": (
        '{dynamics: {x: -z, z: x, b: a, a: 0}, outputs: {y1: x, y2: z, y: "b + atan2(z, x)"}}', PEBO % (
            'a: xi, b: "y - atan2(y2, y1)"', ROW % "1 + xi"), OPEN, f"output y: z {CUT}"),
    "an angle in an estimator": (TURNING % -2, PEBO % ("a: xi", PROPORTIONAL % '"2*atan2(y2, y1)"'), OPEN, "the cut"),
    "an angle in it off its cut": (TURNING % 0.1, PEBO % ("a: xi", PROPORTIONAL % '"2*atan2(y2, y1)"'), PROVED, "-2"),
    "a coordinate of a copy": ("{dynamics: {x: a, a: -a}, outputs: {y: x}, domain: {a: [0, 1]}}",
        "{type: high-gain, states: {p: x, r: sqrt(a)}, dynamics: {p: r**2, r: -r/2}, left_inverse: {a: r**2}, "
        "injection: {p: {y: 4}, r: {y: 4}}}", OPEN, "whether sqrt(a) moves as its derivative says"),
    "a power with a varying exponent": (SECOND % ("-a + x**(1 + x)", ", domain: {x: [0, 1]}"), KKL % (
        "a", -1, "y**(1 + y)", "a: xi"), OPEN, "not known whether y**(1 + y) has a value: xi: y > 0 fails: -x is 0"),
}  # fmt: skip

NAMES = {  # of signals that are those of states of the observer, or only look so
    "an output that is known": ("{dynamics: {x: -x + exp(a), a: x}, outputs: {known: x}}",
        "{type: pebo, coordinates: [{name: xi, phi: a, B: known}], left_inverse: {a: xi}, estimator: {regressions: "
        "[{output: known, known: -known, m: {xi: exp(xi)}}], as: {xi: exp}, alpha: 5, gamma: 10}}", PROVED,
        "filtered_known_1_'"),
    "an output b1": ("{dynamics: {x: -x, a: -a}, outputs: {b1: x}}", SHAPED % ("c", "a", "c", "a: b1", "c: -c"),
                     INVALID, "observer.left_inverse: b1 is a signal of the plant and the value of a beta"),
    "a state b1": ("{dynamics: {x: -x, b1: -b1}, outputs: {y: x}}", SHAPED % ("c", "b1", "c", "b1: b1", "c: -c"),
                   PROVED, "exp(-t)"),
    "an input hat_x": ("{inputs: [hat_x], dynamics: {x: -x + hat_x}, outputs: {y: x}}",
                       "{type: high-gain, injection: {x: {y: 2}}}", INVALID, "begins like the name of an estimate"),
    "an output phi": ("{dynamics: {x: -x, delta1: -delta1 + x}, outputs: {phi: x}}",
                      KKL % ("delta1", -1, "phi", "delta1: xi"), PROVED, "exp(-t)"),
}  # fmt: skip

LINEAR = {  # errors that need not be linear to decay
    "a pendulum": ("{dynamics: {x: v, v: -sin(x) - 0.1*v}, outputs: {y: x}}",
                   "{type: high-gain, injection: {x: {y: 20}, v: {y: 100}}}", OPEN,
                   "not known whether this error decays, which is not linear: error: ε_hat_v'"),
    "off a manifold": (SECOND % ("-a - a**3", ""), SHAPED % ("c", "a", "c", "a: b1", "c: -c - c**3"), OPEN,
                       "not known whether this error decays, which is not linear: off the manifold: δ1'"),
    "off a manifold, and not stable there": (SECOND % ("a - a**3", ""), SHAPED % (
        "c", "a", "c", "a: b1", "c: c - c**3"), OPEN, "neither proved nor refuted: off the manifold, 1"),
    "a manifold of more than there is": (SECOND % ("-a + x", ""), SHAPED % (
        "c, d", "a, a**2", "c, d", "a: b1", "c: y - c, d: 2*y*c - 2*d"), OPEN,
        "neither proved nor refuted: invariance"),
    "a manifold that is none": (SECOND % ("-a + x", ""), SHAPED % ("c", "a", "c", "a: b1", "c: y - 2*c"), REFUTED,
                                "invariance: d/dt (c) = d/dt (a) fails: -c is 2 at c = -2"),
    "a manifold that is not solved": (SECOND % ("-a", ""), SHAPED % ("c", "a", "c**3", "a: b1", "c: -c"), OPEN,
                                      "not known whether chi comes there: invariance"),
    "a root of chi": (SECOND % ("-a", ""), SHAPED % ("c", "a", "sqrt(c)", "a: b1", "c: -2*c"), OPEN,
                      "not known whether chi comes there: beta: c >= 0"),
    "a pendulum with a wrong gain": ("{dynamics: {x: v, v: -sin(x) - 0.1*v}, outputs: {y: x}}",
        "{type: high-gain, injection: {x: {y: 20}, v: {y: -100}}}", OPEN,
        "refuted: the error of hat_x, hat_v is stable"),
    "a wrong gain": ("{dynamics: {x: v, v: -x - 0.1*v}, outputs: {y: x}}",
        "{type: high-gain, injection: {x: {y: 20}, v: {y: -100}}}", REFUTED, "the error of hat_x, hat_v is stable"),
    "a rate of chi": ("{dynamics: {x: a, a: -a}, outputs: {y: x}, domain: {x: [1, 2]}}",
        '{type: immersion-invariance, chi: [c], phi: [a], beta: ["y*c + y"], left_inverse: {a: b1}}', OPEN,
        "not known whether chi comes there: off the manifold, 1: -c - 2 < 0 fails"),
    "theta": ("{dynamics: {x: x*a - a**3, a: 0}, outputs: {y: x}, domain: {x: [-1, 1], a: [-1, 1]}}",
              PEBO % ("a: xi", PROPORTIONAL % "y"), OPEN, "which is not linear: estimate of theta of xi"),
}  # fmt: skip

PLACES = {  # where the plant can be, and where not
    "a range of an output": ("{dynamics: {x: 0, a: -a + 1/x**2}, outputs: {y: x**2, z: x}, domain: {y: [1, 2]}}",
                             KKL % ("a", -1, "1/y", "a: xi"), PROVED, "y in [1, 2]"),
    "a range of an output, and a false one": (
        "{dynamics: {x: 0, a: -a + 1/x**2}, outputs: {y: x**2}, domain: {y: [1, 2]}}",
        "{type: kkl, coordinates: [{name: xi, phi: a, lambda: -1, B: 1/y}, {name: xc, phi: x, lambda: -1, B: 0}], "
        "left_inverse: {a: xi, x: xc}}", REFUTED, "xc: d/dt (x) = (-1) phi + 0 fails: x is 1."),
    "a range of an output that is a state": ("{dynamics: {x: 0, a: -x*a}, outputs: {y: x}, domain: {y: [1, 2]}}",
                                             KKL % ("a", "-y", 0, "a: xi"), PROVED, "1 1/s of xi"),
    "ranges of a state and its output": ("{dynamics: {x: 0, a: -a}, outputs: {y: x}, domain: {x: [0, 1], y: [2, 3]}}",
                                         KKL % ("a", -1, 0, "a: xi"), INVALID, "y is x, and their ranges have nothing"),
    "a manifold within the range of y": ("{dynamics: {x: -x, a: -a + x**2}, outputs: {y: x**2, z: x}}", SHAPED % (
        "c", "a", "c", "a: b1", "c: -c + abs(y)"), OPEN, "neither proved nor refuted: invariance"),
    "a negative number": (DECAYING % ("-3, -1", "0, 1"), KKL % ("a", -1, "0*y + y**(-2) - y**(-2)", "a: xi"), PROVED,
                          "exp(-t)"),
    "a divisor that jumps over 0": (
        '{dynamics: {x: 0, z: 0, a: -a}, outputs: {y1: x, y2: z}, domain: {x: [-2, -1], z: [-1, 1]}}',
        KKL % ("a", -1, '"1/atan2(y2, y1) - 1/atan2(y2, y1)"', "a: xi"), OPEN,
        "neither proved nor refuted: xi: atan2(y2, y1) is not 0"),
    "a divisor that crosses 0": (DECAYING % ("-1, 2", "0, 1"), KKL % (
        "a", -1, "1/(y**3 - 2) - 1/(y**3 - 2)", "a: xi"), REFUTED, "y**3 - 2 is not 0 fails: x**3 - 2 is"),
    "a divisor that is 0 at a point": (SECOND % ("-a", ", domain: {x: [-1, 1]}"), KKL % (
        "a", -1, "1/(4*y - 1) - 1/(4*y - 1)", "a: xi"), REFUTED, "4*y - 1 is not 0 fails: 4*x - 1 is 0 at x = 0.25"),
    "a divisor with a pole": (SECOND % ("-a", ", domain: {x: [-1, 1]}"), KKL % (
        "a", -1, "1/(1/y) - 1/(1/y)", "a: xi"), REFUTED, "xi: y is not 0 fails: x is 0 at x = 0"),
    "a divisor beside a pole of the plant": (SECOND % ("-a + 1/x", ", domain: {x: [-1, 1]}"), KKL % (
        "a", -1, "1/y + 1/(4*y - 1) - 1/(4*y - 1)", "a: xi"), REFUTED, "4*x - 1 is 0 at x = 0.25"),
    "a lambda that vanishes far away": (SECOND % ("-a/(1 + x**2)", ""), KKL % (
        "a", "-1/(1 + y**2)", 0, "a: xi"), OPEN, "neither proved nor refuted: xi: lambda = -1/(1 + y**2) < 0"),
    "a divisor that is 0 everywhere": (SECOND % ("-a", ""), KKL % (
        "a", -1, "y/(sin(y)**2 + cos(y)**2 - 1) - y/(sin(y)**2 + cos(y)**2 - 1)", "a: xi"), REFUTED, "is not 0 fails"),
    "a pole of the plant": (SECOND % ("-a + 1/x", ", domain: {x: [-1, 1]}"), KKL % ("a", -1, "1/y", "a: xi"), PROVED,
                            "exp(-t)"),
    "ends of the plant": (SECOND % ("-a + sqrt(x) + log(x + 1)", ""), KKL % (
        "a", -1, "sqrt(y) + log(1 + y)", "a: xi"), PROVED, "exp(-t)"),
    "an end that is not that of the plant": (SECOND % ("-a + sqrt(x)", ""), KKL % (
        "a", -1, "sqrt(y) + log(y) - log(y)", "a: xi"), REFUTED, "xi: y > 0 fails: -x is 0 at x = 0"),
    "a branch of the plant": ('{dynamics: {x: -x, a: "-a + where(x > 1, log(x), 0)"}, outputs: {y: x}}', KKL % (
        "a", -1, '"where(y > 1, log(y), 0) + log(y) - log(y)"', "a: xi"), REFUTED, "y > 0 fails"),
    "poles of a copy": ("{dynamics: {x: 1/x, a: -a}, outputs: {y: x}, domain: {x: [-1, 1]}}",
                        "{type: high-gain, copy: outputs, injection: {x: {y: 2}}}", PROVED, "exp(-2*t)"),
    "branches": ("{dynamics: {x: -x, a: -a*(1 + x**2)}, outputs: {y: x**3}}",
        '{type: kkl, coordinates: [{name: xi, phi: a, lambda: "-(1 + (y**2)**(1/3))", B: 0}], left_inverse: '
        '{a: xi, x: "where(y > 0, y**(1/3), -(-y)**(1/3))"}}', OPEN, "neither proved nor refuted: left inverse of x"),
    "a branch that is looked at": (SECOND % ("-a", ""), KKL % (
        "a", -1, '"where(y > 0, log(y - 1) - log(y - 1), 0)"', "a: xi"), REFUTED, "y - 1 > 0 where y > 0 fails"),
    "a branch that divides by 0": (SECOND % ("-a", ""), KKL % (
        "a", -1, '"where(y > 0, 1/(y - y) - 1/(y - y), 0)"', "a: xi"), REFUTED, "y - y is not 0 where y > 0 fails"),
    "time begins at 0": (SECOND % ("-a + sqrt(t)", ", domain: {t: [-5, 5]}"), KKL % ("a", -1, "sqrt(t)", "a: xi"),
                         PROVED, "exp(-t)"),
    "a divisor that vanished before": (SECOND % ("-a + 1/(1 + t)", ""), KKL % ("a", -1, "1/(1 + t)", "a: xi"), PROVED,
                                       "exp(-t)"),
    "a divisor that vanishes at 0": (SECOND % ("-a", ""), KKL % ("a", -1, "1/t - 1/t", "a: xi"), REFUTED,
                                     "t is not 0 fails: t is 0 at t = 0"),
    "a time that is over": (SECOND % ("-a", ", domain: {t: [-5, -1]}"), KKL % ("a", -1, 0, "a: xi"), INVALID,
                            "t is time, and their ranges have nothing in common"),
    "a power of 0": (SECOND % ("-a", ""), KKL % ("a", -1, "y*0**(-1) - y*0**(-1)", "a: xi"), REFUTED, "0 is not 0"),
}  # fmt: skip

CASES = {**OUTPUTS, **ENDS, **NAMES, **LINEAR, **PLACES}
assert len(CASES) == sum(map(len, (OUTPUTS, ENDS, NAMES, LINEAR, PLACES)))


def written(plant, observer):
    """Text of a spec, which is written to a file."""
    text = f"obsdesign: 1\nname: a plant\nsystem: {plant}\nobserver: {observer}\n"
    Path("case.yaml").write_text(text)
    return text


@pytest.mark.parametrize(("plant", "observer", "code", "words"), CASES.values(), ids=CASES)
def test_an_observer_is_what_can_be_proved_of_it(plant, observer, code, words):
    written(plant, observer)
    outcome = run("solve", "case.yaml")
    assert outcome.exit_code == code, outcome.output
    assert words in outcome.output
    if code == INVALID:
        assert outcome.stderr.count("\n") == 1
    elif code != OPEN:
        assert run("verify", "case.gains.json").exit_code == 0
    said = run("check", "case.yaml").output
    assert ("fails" in said) == (code == REFUTED or (code == OPEN and "fails" in outcome.output))


STARTS = {  # of runs within the domain
    "t in a proportional estimator": [0.9, 0.7],
    "t in a regression that knows": [0.9, 0.7],
    "a scaled output": [0.9, 0.7],
    "an angle in it off its cut": [1, 1.2, 0.05],
    "a range of an output": [1.2, 0.7],
    "a range of an output that is a state": [1.2, 0.7],
    "a divisor that vanished before": [1.2, 0.7],
}


@pytest.mark.parametrize(("name", "x0"), STARTS.items())
def test_what_is_certified_converges(name, x0):
    design = od.solve(od.load(written(*CASES[name][:2])))
    made = design.simulate(horizon=20, x0=x0)
    assert made.summary["final_error"] < 1e-3 * made.summary["initial_error"]


FALSE = SPECS / "infeasible" / "cuk-immersion-as-printed.yaml"
FORGERIES = {
    "nothing of a diagnosis": (("diagnosis",), None),
    "nothing of a certificate": (("certificate",), None),
    "nothing of an observer": (("observer",), None),
    "no list of what is not proved": (("numerical",), None),
    "a point elsewhere": (("diagnosis", "point", "u"), 7),
    "no point": (("diagnosis", "point"), {}),
    "another value": (("diagnosis", "value"), 1e-9),
    "another residual": (("diagnosis", "residual"), "u"),
    "another reason": (("diagnosis", "reason"), "the observer fails nowhere"),
    "more": (("diagnosis", "gamma"), 1e-9),
    "another statement": (("certificate", "checks", 0, "name"), "every state converges"),
    "other equations": (("observer", "dynamics", "c1"), "0"),
    "a guarantee": (("guarantee",), {"rates": {"c1": 1e9}, "statement": "xhat converges to x"}),
}


@pytest.mark.parametrize(("keys", "value"), FORGERIES.values(), ids=FORGERIES)
def test_a_refutation_is_the_one_that_is_found_anew(keys, value):
    run("solve", FALSE, "-o", "false.gains.json")
    content = json.loads(Path("false.gains.json").read_text())
    place = content
    for key in keys[:-1]:
        place = place[key]
    place[keys[-1]] = value
    Path("forged.gains.json").write_text(json.dumps(content))
    outcome = run("verify", "forged.gains.json")
    assert outcome.exit_code == INVALID, outcome.output
    assert outcome.stderr.count("\n") == 1


def test_an_observer_whose_statements_are_true_is_not_refuted():
    written(*PLACES["a negative number"][:2])
    assert run("solve", "case.yaml").exit_code == PROVED
    content = json.loads(Path("case.gains.json").read_text())
    del content["guarantee"]
    Path("forged.gains.json").write_text(json.dumps({**content, "status": "refuted"}))
    outcome = run("verify", "forged.gains.json")
    assert outcome.exit_code == INVALID
    assert "status: refuted: every statement of the observer that could be decided is true" in outcome.stderr


def test_found_coordinates_that_are_no_list_are_one_line():
    run("solve", SPECS / "duffing-found.yaml")
    content = json.loads(Path("duffing-found.gains.json").read_text())
    content["observer"]["coordinates"] = None
    Path("forged.gains.json").write_text(json.dumps(content))
    outcome = run("verify", "forged.gains.json")
    assert outcome.exit_code == INVALID
    assert "observer.coordinates: expected a list of coordinates" in outcome.stderr
