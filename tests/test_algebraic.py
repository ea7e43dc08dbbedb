"""Observers without an LMI: what they rest on is proved or refuted, they run, and their files are proved anew."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.bounded import soon
from support.commands import run
from support.shipped import SPECS, shipped, solved

import obsdesign as od
from obsdesign import starters
from obsdesign.expressions.algebra import identical
from obsdesign.files import digest
from obsdesign.guide import page

pytestmark = pytest.mark.usefixtures("here", "sketched")

CERTIFIED = [
    "cuk-kkl", "cuk-pebo", "cuk-kkl-pebo", "cuk-immersion", "cuk-high-gain", "cuk-high-gain-linear",
    "cuk-proportional", "exponential-drift",
]  # fmt: skip
REFUTED = {  # what the one line of the answer names, and the residual
    "cuk-pebo-as-printed": ("regression 2", "-442530/229*i3"),
    "cuk-kkl-pebo-as-printed": ("regression 1", "500000/11*u*v4"),
    "cuk-immersion-as-printed": ("invariance: d/dt (c1", "100*u*y2"),
    "cuk-immersion-estimate-as-printed": ("invariance: d/dt (c2", "-2*u*y1"),
    "cuk-high-gain-as-printed": ("the error of hat_v4, hat_i3 is stable", "below 0"),
    "cuk-high-gain-linear-as-printed": ("xi2: d/dt", "u**2*v2"),
    "cuk-filtered-recast": ("condition (*)", "psi_xi1_1"),
    "cuk-wrong-inverse": ("left inverse of i1", "-0.99*i1"),
}
TIMES = {  # ms at which |error| is last above 5 % and 1 % of its start: i1, then v4 at 5 %
    "cuk-kkl": (55.0, 84.5, 1.52),
    "cuk-pebo": (39.1, 45.1, 33.1),
    "cuk-kkl-pebo": (39.1, 45.1, 1.52),
    "cuk-immersion": (109.9, 168.9, 1.52),
    "cuk-high-gain": (49.4, 74.1, 1.46),
    "cuk-high-gain-linear": (2.0, 6.9, 7.0),
}
FAMILIES_WITHOUT_LMI = {"kkl", "pebo", "kkl+pebo", "immersion-invariance", "high-gain"}
PLANT = """obsdesign: 1
name: a plant
system:
  dynamics: {x1: x2, x2: mu*(1 - x1**2)*x2 - x1}
  outputs: {y: x1}
parameters: {mu: 1}
simulation: {horizon: 1, x0: [1, 1]}
observer: %s
"""
ONE = "{name: xi, phi: x2 - mu*(x1 - x1**3/3) - k*x1, lambda: -k, B: %s}"


def last_above(run, name, share):
    """Last time (ms) at which the error of an estimate is above a share of its start."""
    error = abs(run[f"hat_{name}"] - run[name])
    return 1e3 * run.t[np.flatnonzero(error > share * error[0])[-1]]


@pytest.mark.parametrize("name", CERTIFIED)
def test_an_observer_whose_statements_hold_is_certified_and_proved_again(name):
    _, design = solved(name)
    assert design.status == "certified"
    design.save("a.gains.json")
    outcome = run("verify", "a.gains.json")
    assert outcome.exit_code == 0
    domain = "stays in its domain (i1 in [-3, 3], " if name.startswith("cuk") else "has a solution and the observer"
    assert f"all of it without disturbance and noise, as long as the plant {domain}" in outcome.stdout
    assert od.read("a.gains.json").observer.dynamics == design.observer.dynamics


@pytest.mark.parametrize(("name", "words"), REFUTED.items())
def test_what_is_printed_wrong_is_refuted_with_its_residual(name, words):
    outcome = run("solve", str(SPECS / "infeasible" / f"{name}.yaml"))
    assert outcome.exit_code == 3
    reason = next(line for line in outcome.stdout.splitlines() if line.startswith("reason"))
    assert all(word in reason for word in words)
    assert "guarantee" not in json.loads(Path(f"{name}.gains.json").read_text())
    again = run("verify", f"{name}.gains.json")
    assert again.exit_code == 0
    assert "proved: refuted: " in again.stdout


@pytest.mark.parametrize(("name", "times"), TIMES.items())
def test_estimates_of_the_converter_settle_when_they_should(name, times):
    made = solved(name)[1].simulate(horizon=0.25, points=25001)
    found = last_above(made, "i1", 0.05), last_above(made, "i1", 0.01), last_above(made, "v4", 0.05)
    assert found == pytest.approx(times, rel=0.02, abs=0.06)  # they are known to .1 ms, or .01


def test_a_filtered_gradient_converges_as_exp_of_the_cube_of_time():
    """e(t) = e(0) exp(-gamma M^2 alpha^2 t^3/3), M = (1-u)/C2, for slow filters and u constant."""
    text = (SPECS / "cuk-kkl-pebo.yaml").read_text()
    start = text.index("  u: ")
    constant = text[:start] + '  u: "0.4545454545"' + text[text.index("\n", start) :]
    made = od.solve(od.load(constant)).simulate(horizon=0.06, points=6001)
    t, error = made.t, abs(made["hat_i1"] - made["i1"])
    rate = 0.001 * ((1 - 0.4545454545) / 22e-6 * 0.5) ** 2 / 3
    early = (t > 0.01) & (t < 0.045)
    assert np.log(error[early] / error[0]) == pytest.approx(-rate * t[early] ** 3, rel=0.03)


def observer_of(text):
    """Observer of a certified spec."""
    design = od.solve(od.load(text))
    assert design.status == "certified"
    return design.observer


def assert_same(one, other):
    """Two observers with the same names whose equations are proved to be identical."""
    assert one.dynamics.keys() == other.dynamics.keys()
    for part in ("dynamics", "estimates"):
        sides = getattr(one, part), getattr(other, part)
        assert all(identical(sides[0][name], sides[1][name]) for name in sides[0])


def test_a_coordinate_with_a_gain_is_immersion_and_invariance_with_this_gain():
    text = (SPECS / "cuk-immersion.yaml").read_text().replace("g2: 1", "g2: 0")
    head, tail = text[: text.index("observer:")], text[text.index("simulation:") :]
    kkl = (
        "observer:\n  type: kkl\n  coordinates:\n"
        "    - {name: c1, phi: i1 - g1*C2*v2, lambda: -g1*(1-u),"
        " B: -g1*(1-u)*g1*C2*y1 - g1*u*y2 + (E-(1-u)*y1)/L1}\n"
        "    - {name: c2, phi: v4, lambda: -G/C4, B: y2/C4}\n"
        "  left_inverse: {i1: c1 + g1*C2*y1, v4: c2}\n\n"
    )
    assert_same(observer_of(head + kkl + tail), observer_of(text))


@pytest.mark.parametrize("name", ["cuk-kkl", "cuk-proportional"])
def test_an_observer_that_is_recast_is_the_same(name):
    text = (SPECS / f"{name}.yaml").read_text().replace("  recast: immersion-invariance\n", "")
    recast = text.replace("\nsimulation:", "  recast: immersion-invariance\n\nsimulation:", 1)
    assert_same(observer_of(recast), observer_of(text))


def test_what_depends_on_a_run_is_told_of_it():
    summary = solved("exponential-drift")[1].simulate().summary
    assert summary["excitation"]["least_eigenvalue"] > 10 * summary["excitation"]["least_eigenvalue_of_a_window"] > 0
    assert summary["guard"] == {"theta_xi2": {"activations": 0, "share": 0.0, "at_end": False}}


def test_coordinates_and_constants_begin_where_a_simulation_says():
    design = solved("exponential-drift")[1]
    made = design.simulate(horizon=0.001, xi0={"xi1": 0.25, "xi2": 0.5}, theta0={"xi2": 2})
    assert made["hat_x2"][0] == pytest.approx(0.25)
    assert made["hat_x3"][0] == pytest.approx(2.5)
    with pytest.raises(od.UsageError, match="nothing is no coordinate here; allowed: xi1, xi2"):
        design.simulate(xi0={"nothing": 1})


def first_row(text):
    """First sample of a run through the command line, by column, and what is printed of the run."""
    Path("begun.yaml").write_text(text)
    outcome = run("simulate", "begun.yaml")
    assert outcome.exit_code == 0, outcome.output
    names, values, *_ = Path("begun.run.csv").read_text().splitlines()
    return dict(zip(names.split(","), map(float, values.split(",")), strict=True)), outcome.stdout


@pytest.mark.parametrize(
    "name", ["cuk-kkl", "cuk-pebo", "cuk-kkl-pebo", "cuk-immersion", "cuk-high-gain-linear", "cuk-proportional"]
)
def test_coordinates_begin_at_an_estimate_that_is_given(name):
    text = shipped(name).text.replace("horizon: 0.2", "horizon: 0.001\n  xhat0: {i1: 0.5, v4: -2}")
    row, said = first_row(text)
    found = [row[f"hat_{state}"] for state in ("i1", "v4", "v2", "i3")]
    assert found == pytest.approx([0.5, -2, row["v2"], row["i3"]], rel=1e-12)
    assert "at the estimate xhat0, in which states that outputs show are as they are measured" in said


def test_what_xi0_names_begins_there_and_the_rest_at_the_estimate():
    trial = "horizon: 0.001\n  xhat0: [0, 0.25, 0.5]\n  xi0: {%s}"
    text = shipped("exponential-drift").text
    row, said = first_row(text.replace("horizon: 10", trial % "xi1: 3"))
    assert (row["hat_x2"], row["hat_x3"]) == pytest.approx((3, 0.5))
    assert "start" in said
    assert "xi2 at the estimate xhat0" in said
    row, said = first_row(text.replace("horizon: 10", trial % "xi1: 3, xi2: 2"))
    assert (row["hat_x2"], row["hat_x3"]) == pytest.approx((3, 2))
    assert "xhat0 has no effect: simulation.xi0 says where every coordinate begins" in said


@pytest.mark.parametrize(("beta", "begun"), [("c**3+y", 2), ("y", 1)])
def test_an_estimate_that_says_nothing_of_where_an_observer_begins_is_told(beta, begun):
    text = """obsdesign: 1
system: {dynamics: {x: a, a: 0}, outputs: {y: x}}
observer: {type: immersion-invariance, chi: [c], phi: [a], beta: [%s], left_inverse: {a: b1}, dynamics: {c: 0}}
simulation: {horizon: 1, x0: [1, 0.5], xhat0: [0, 0.1], xi0: {c: 1}}
"""
    row, said = first_row(text % beta)
    assert row["hat_a"] == pytest.approx(begun)
    assert "xhat0 has no effect: beta = phi(xhat0) is not solved for chi; name chi in simulation.xi0" in said


# Coordinates that are found


@pytest.mark.parametrize("kind", ["kkl", "pebo", "kkl+pebo"])
def test_found_coordinates_are_certified_and_read_from_the_file(kind):
    text = (SPECS / "cuk-kkl.yaml").read_text()
    estimator = "" if kind == "kkl" else ", estimator: {alpha: 50, gamma: 4.0e-7}"
    section = f"observer: {{type: {kind}, coordinates: find{estimator}}}\n\n"
    text = text[: text.index("observer:")] + section + text[text.index("simulation:") :]
    Path("found.yaml").write_text(text)
    assert run("solve", "found.yaml").exit_code == 0
    result = json.loads(Path("found.gains.json").read_text())
    assert len(result["observer"]["coordinates"]) == 2
    assert run("verify", "found.gains.json").exit_code == 0


@pytest.mark.parametrize(("degree", "status", "code"), [(3, "certified", 0), (2, "infeasible", 3)])
def test_an_oscillator_has_a_coordinate_of_degree_three(degree, status, code):
    Path("vdp.yaml").write_text(PLANT % f"{{type: kkl, coordinates: find, degree: {degree}}}")
    outcome = run("solve", "vdp.yaml")
    assert outcome.exit_code == code
    result = json.loads(Path("vdp.gains.json").read_text())
    assert result["status"] == status
    if code:
        assert result["diagnosis"]["missing"] == ["x2"]
        assert "no coordinate was found that gives x2; searched: sums of products" in outcome.stdout
        assert "empirical" not in result["diagnosis"]  # there is no bounded domain to fit one on


def test_where_no_coordinate_is_found_a_fitted_observer_is_told_as_empirical():
    text = PLANT % "{type: kkl, coordinates: find, degree: 2}"
    text = text.replace("  outputs: {y: x1}\n", "  outputs: {y: x1}\n  domain: {x1: [-3, 3], x2: [-3, 3]}\n")
    Path("vdp.yaml").write_text(text)
    outcome = run("solve", "vdp.yaml")
    assert outcome.exit_code == 3
    assert "empirical, no guarantee: rms error on runs that were not fitted" in outcome.stdout
    numeric = json.loads(Path("vdp.gains.json").read_text())["diagnosis"]["empirical"]
    assert numeric["errors"]["x2"]["transient"] < 1e-2


# Files, and what is written wrong


@pytest.mark.parametrize(
    ("keys", "value"),
    [
        (("guarantee", "rates", "xi1"), 1e5),
        (("guarantee", "statement"), "x is known at once"),
        (("guarantee", "coordinates"), []),
        (("observer", "dynamics", "xi1"), "0"),
        (("observer", "estimates", "v4"), "xi1 + 1"),
        (("observer", "coordinates", 0, "phi"), "2*v4"),
    ],
)
def test_a_file_that_says_otherwise_is_not_proved(keys, value):
    _, design = solved("cuk-kkl")
    content = json.loads(design.text())
    place = content
    for key in keys[:-1]:
        place = place[key]
    place[keys[-1]] = value
    Path("forged.gains.json").write_text(json.dumps(content))
    assert run("verify", "forged.gains.json").exit_code in (2, 4)


CHEMOSTAT = """obsdesign: 1
system:
  inputs: [D]
  dynamics: {X: 0.5*S*X - D*X, S: D*(5 - S) - S*X}
  outputs: {y: S}
  domain: {X: [0.1, 3], S: [0.01, 5], D: [%s, %s]}
observer:
  type: kkl
  coordinates: [{name: xi, phi: X + 0.5*S, lambda: -D, B: 2.5*D}]
  left_inverse: {X: xi - 0.5*y}
"""


@settings(max_examples=15)
@given(least=st.decimals("0.00001", 50, places=5), more=st.decimals("0.001", 50, places=5))
def test_the_file_of_a_certified_observer_is_proved_whatever_its_rate(least, more):
    Path("rate.yaml").write_text(CHEMOSTAT % (least, least + more))
    assert run("solve", "rate.yaml").exit_code == 0
    outcome = run("verify", "rate.gains.json")
    assert outcome.exit_code == 0, outcome.output
    rate = json.loads(Path("rate.gains.json").read_text())["guarantee"]["rates"]["xi"]
    assert float(least) * (1 - 1e-5) <= rate <= float(least)


@pytest.mark.parametrize(("rate", "code"), [("0.0499999", 0), ("0.04", 0), ("0.05", 2), ("0.04999991", 2)])
def test_a_rate_is_believed_if_it_is_no_better_than_the_one_that_is_proved(rate, code):
    Path("rate.yaml").write_text(CHEMOSTAT % ("0.05", "0.4"))
    assert run("solve", "rate.yaml").exit_code == 0
    Path("rate.gains.json").write_text(Path("rate.gains.json").read_text().replace("0.0499999", rate))
    outcome = run("verify", "rate.gains.json")
    assert outcome.exit_code == code, outcome.output
    said = f"these errors fall at least at the rate {rate} 1/s of xi"
    assert said in outcome.stdout or "is faster than the statements prove" in outcome.stderr


def test_a_rate_of_what_is_not_said_to_decay_is_refused():
    Path("rate.yaml").write_text(CHEMOSTAT % ("0.05", "0.4"))
    assert run("solve", "rate.yaml").exit_code == 0
    content = json.loads(Path("rate.gains.json").read_text())
    content["guarantee"]["rates"]["X"] = 0.01
    Path("rate.gains.json").write_text(json.dumps(content))
    assert "guarantee.rates.X: no rate of this is proved" in run("verify", "rate.gains.json").stderr


def test_found_coordinates_that_are_forged_are_not_proved():
    Path("vdp.yaml").write_text(PLANT % "{type: kkl, coordinates: find}")
    run("solve", "vdp.yaml")
    content = json.loads(Path("vdp.gains.json").read_text())
    many = " + ".join(f"sin(x1**{k})" for k in range(1, 60))
    for text in ("x2", "sign(x2)", "x1 +", f"x2 + {many}"):
        content["observer"]["coordinates"][0]["phi"] = text
        Path("forged.gains.json").write_text(json.dumps(content))
        outcome = run("verify", "forged.gains.json")
        assert outcome.exit_code in (2, 4)
        assert "Traceback" not in outcome.output


WRONG = {
    "a coordinate with a jump": ("{name: xi, phi: sign(x2), lambda: 0, B: 0}", "has a kink or a jump"),
    "a name that is taken": ("{name: x1, phi: x2, lambda: -1, B: 0}", "x1 is a signal already"),
    "no left inverse": ("{name: xi, phi: x2, lambda: -1, B: 0}", "gives no x2, which no output shows"),
    "an unknown name": ("{name: xi, phi: x3, lambda: -1, B: 0}", "unknown name 'x3'"),
    "a lambda of a state": ("{name: xi, phi: x2, lambda: x2, B: 0}", "unknown name 'x2'"),
}


@pytest.mark.parametrize(("coordinate", "words"), WRONG.values(), ids=WRONG)
def test_a_wrong_coordinate_is_one_line(coordinate, words):
    inverse = (
        "" if "gives no" in words else ", left_inverse: {x2: xi}" if "x1 is" not in words else ", left_inverse: {x2: y}"
    )
    estimator = ", estimator: {method: proportional, K: {xi: y}}" if "lambda: 0" in coordinate else ""
    kind = "pebo" if estimator else "kkl"
    Path("wrong.yaml").write_text(PLANT % f"{{type: {kind}, coordinates: [{coordinate}]{inverse}{estimator}}}")
    outcome = run("solve", "wrong.yaml")
    assert outcome.exit_code == 2
    lines = outcome.stderr.strip().splitlines()
    assert len(lines) == 1
    assert words in lines[0]


@pytest.mark.parametrize(
    ("lambda_", "domain", "code"),
    [("-(1 - u)", "[0.1, 0.9]", 0), ("-(1 - u)", "[0.1, 1.5]", 3), ("-(1 - u)", "[0, 1]", 3)],
)
def test_a_lambda_must_be_negative_on_the_whole_domain(lambda_, domain, code):
    text = f"""obsdesign: 1
system:
  inputs: [u]
  dynamics: {{x: "-(1 - u)*x", z: 0}}
  outputs: {{y: z}}
  domain: {{u: {domain}}}
observer: {{type: kkl, coordinates: [{{name: xi, phi: x, lambda: {lambda_}, B: 0}}], left_inverse: {{x: xi}}}}
"""
    Path("sign.yaml").write_text(text)
    outcome = run("solve", "sign.yaml")
    assert outcome.exit_code == code
    if code:
        assert "not below 0" in outcome.stdout


def test_a_transform_that_is_singular_on_the_domain_is_refuted():
    text = shipped("cuk-high-gain-linear").text.replace("u: [0.1, 0.9]", "u: [0.1, 1]")
    Path("singular.yaml").write_text(text)
    outcome = run("solve", "singular.yaml")
    assert outcome.exit_code == 3
    assert "1 - u is not 0 fails: 1 - u is 0 at u = 1" in outcome.stdout


# Constants that are hard to estimate


def error_of(name, states, at, **changes):
    """Largest error of some estimates at the end of a run."""
    text = shipped(name).text
    for old, new in changes.items():
        text = text.replace(old, new)
    made = od.solve(od.load(text)).simulate(horizon=at)
    return max(abs(made[f"hat_{state}"][-1] - made[state][-1]) for state in states)


def test_mixing_of_regressors_estimates_what_a_gradient_does_not():
    assert error_of("fading-excitation", "ab", 60) < 1e-9
    gradient = {"method: drem": "method: gradient", "    kappa: 1\n": ""}
    assert error_of("fading-excitation", "ab", 60, **gradient) > 1e-2


def test_a_rate_is_told_of_a_coordinate_that_waits_for_no_other():
    _, design = solved("cascade-gradient")
    assert design.result["guarantee"]["rates"] == {"xi2": pytest.approx(2, rel=1e-5)}
    statement = design.result["guarantee"]["statement"]
    assert "xi3 - (x3), obeys e' = -3 e, so that e(t) = e(0) exp(-3*t), once the estimate of xi2 is right" in statement
    assert error_of("cascade-mixing", "ab", 30) < 1e-6 < error_of("cascade-gradient", "ab", 30)


@pytest.mark.parametrize("name", ["van-der-pol-found", "duffing-found", "chain-found"])
def test_a_plant_whose_coordinates_are_found_is_estimated(name):
    _, design = solved(name)
    assert design.status == "certified"
    summary = design.simulate().summary
    assert summary["final_error"] < 1e-4 * summary["initial_error"]


@pytest.mark.parametrize("family", sorted(FAMILIES_WITHOUT_LMI))
def test_the_converter_to_begin_with_is_certified_and_estimated(family):
    Path("converter.yaml").write_text(starters.text("converter", family))
    outcome = run("solve", "converter.yaml", "--simulate")
    assert outcome.exit_code == 0
    assert ("excitation" in outcome.stdout) == ("pebo" in family)
    assert re.search(r"settling +i1: .* below 5 % after 0\.", outcome.stdout)


def test_the_manual_names_shipped_specs_of_every_type():
    (table,) = re.findall(r"\| shipped spec \| type \|.*?(?:\n\n|$)", page("algebraic"), re.DOTALL)
    rows = [[re.findall("`(.*?)`", cell) for cell in line.split("|")[1:3]] for line in table.strip().splitlines()[2:]]
    assert len(rows) == 8
    told = {name for names, _ in rows for name in names}
    assert all({shipped(name).observer.type for name in names} == set(types) for names, types in rows)
    ours = {path.stem for path in SPECS.glob("*.yaml") if shipped(path.stem).observer.type in FAMILIES_WITHOUT_LMI}
    assert told == ours


NOISY = {  # rms of the noise of the estimates of i1 (A) and v4 (V), over 20 seeds
    "cuk-kkl": (5.7e-4, 7.9e-4),
    "cuk-pebo": (2.3e-3, 5.2e-2),
    "cuk-kkl-pebo": (2.3e-3, 7.9e-4),
    "cuk-immersion": (7.9e-4, 7.9e-4),
    "cuk-high-gain": (6.1e-4, 7.8e-4),
    "cuk-high-gain-linear": (3.9e-4, 5.7e-3),
}
SET_POINT = "where(t < 0.2, 10, where(t < 0.4, 15, where(t < 0.6, 8, where(t < 0.8, 20, where(t < 1, 12, 6)))))"


def noisy(name):
    """A spec of the converter whose set point jumps five times, with noise that is held."""
    text = (SPECS / f"{name}.yaml").read_text()
    s = f"(G*{SET_POINT}*v2 + E*(i3 - i1))"
    trial = (
        f"simulation:\n  horizon: 1.2\n  x0: [1, -6, 20, -0.3]\n"
        f'  u: "{SET_POINT}/({SET_POINT} + E) + lam*{s}/(1 + {s}**2)"\n'
        "  noise: {type: uniform, amplitude: [0.02, 2.0e-4], period: 1.0e-4}\n"
    )
    return od.load(text[: text.index("simulation:")] + trial)


@pytest.mark.slow
def test_noise_of_the_estimates_of_the_converter():
    report = od.compare([noisy(name) for name in NOISY], seeds=20).report
    for each, known in zip(report["observers"], NOISY.values(), strict=True):
        found = [each["states"][state]["noise_rms"] for state in ("i1", "v4")]
        assert found == pytest.approx(known, rel=0.3), each["name"]


@pytest.mark.parametrize(
    ("alpha", "gamma", "swinging", "constant"),
    [(1, 1, 4.78, 8.57), (5, 1, 3.38, 6.97), (1, 10, 1.47, 1.57), (5, 10, 0.73, 0.75), (20, 100, 0.115, 0.115)],
)
def test_an_exponential_drift_is_estimated_when_it_should(alpha, gamma, swinging, constant):
    """Times after which |error| of x3 is below 1e-3, with u = -0.5 + 0.3 sin t and with u = -0.5; x2 takes ln 1000."""
    text = shipped("exponential-drift").text
    design = od.solve(od.load(text.replace("alpha: 5", f"alpha: {alpha}").replace("gamma: 10", f"gamma: {gamma}")))
    for u, known in ((None, swinging), ("-0.5", constant)):
        made = design.simulate(points=20001, **({"u": u} if u else {}))
        error = abs(made["hat_x3"] - made["x3"])
        assert made.t[np.flatnonzero(error > 1e-3)[-1]] == pytest.approx(known, rel=0.02, abs=0.006)
        error = abs(made["hat_x2"] - made["x2"])
        assert made.t[np.flatnonzero(error > 1e-3)[-1]] == pytest.approx(np.log(1000), rel=1e-3)


def test_a_plant_that_escapes_stops_at_its_event():
    made = solved("exponential-drift")[1].simulate(u="0.2", horizon=20, events={"escape": "x3 > 25"})
    assert made.summary["status"] == "stopped"
    assert made.summary["time"] == pytest.approx(9.5, rel=0.01)


@pytest.mark.parametrize(("inverse", "words"), [("sqrt(xi)*sqrt(xi)", "xi >= 0"), ("exp(log(xi))", "xi > 0")])
def test_a_left_inverse_that_has_no_value_on_a_part_of_the_domain_is_refuted(inverse, words):
    text = f"""obsdesign: 1
system: {{dynamics: {{x: -x, z: 0}}, outputs: {{y: z}}, domain: {{x: [%s, 1]}}}}
observer: {{type: kkl, coordinates: [{{name: xi, phi: x, lambda: -1, B: 0}}], left_inverse: {{x: {inverse}}}}}
"""
    for low, code in (("-1", 3), ("0.1", 0)):
        Path("branch.yaml").write_text(text % low)
        outcome = run("solve", "branch.yaml")
        assert outcome.exit_code == code, outcome.output
        assert words in outcome.stdout or not code


ATTACKS = {  # what looked certified: the plant, the observer, the exit code
    "a signal with the name of the pole": (
        "{inputs: [s], dynamics: {x: (s**2-1)*x}, outputs: {y: x}, domain: {s: [2, 3]}}",
        "{type: high-gain, injection: {x: {y: 0}}}", 3,
    ),
    "a signal with the name of what is off the manifold": (
        "{inputs: [d1], dynamics: {x: a, a: 0, z: (1-d1)*b, b: 0}, outputs: {y: x, y2: z}, domain: {d1: [2, 3]}}",
        "{type: immersion-invariance, chi: [c, e], phi: [a, b], beta: [c+y, e+y2], left_inverse: {a: b1, b: b2}}", 3,
    ),
    "a signal with the name of a state of the estimator": (
        "{inputs: [theta_xi], dynamics: {x: a+theta_xi, a: 0}, outputs: {y: x}}",
        "{type: pebo, coordinates: [{name: xi, phi: a, lambda: 0}], left_inverse: {a: xi}, estimator: "
        "{regressions: [{output: y, known: xi, m: {xi: 2}}], alpha: 1, gamma: 1}}", 2,
    ),
    "a beta that has no value at a state": (
        "{dynamics: {x: a, a: 0}, outputs: {y: x}, domain: {x: [-2, 2]}}",
        '{type: immersion-invariance, chi: [c], phi: [a], beta: ["c+sqrt(y)**2"], left_inverse: {a: b1}}', 3,
    ),
    "a K that has no value at a state": (
        "{dynamics: {x: a, a: 0}, outputs: {y: x}, domain: {x: [-2, 2]}}",
        "{type: pebo, coordinates: [{name: xi, phi: a, lambda: 0}], left_inverse: {a: xi}, "
        'estimator: {method: proportional, K: {xi: "y+log(y)-log(y)"}}}', 3,
    ),
    "an injection that has no value at a state": (
        "{dynamics: {x: -x}, outputs: {y: x}, domain: {x: [-1, 1]}}",
        "{type: high-gain, injection: {x: {y: 1/y**2}}}", 3,
    ),
    "a rate that holds since t = 0": (
        "{dynamics: {x: (1+t)*a, a: 0}, outputs: {y: x}}",
        "{type: immersion-invariance, chi: [c], phi: [a], beta: [c+y], left_inverse: {a: b1}}", 0,
    ),
    "an injection by an output that no state is": (
        "{dynamics: {x: -x, z: -z}, outputs: {y: x, y2: x + z}}",
        "{type: high-gain, states: {p: x, r: z}, dynamics: {p: -p, r: -r}, left_inverse: {z: r}, "
        "injection: {p: {y2: 1}}}", 2,
    ),
}  # fmt: skip


@pytest.mark.parametrize(("plant", "observer", "code"), ATTACKS.values(), ids=ATTACKS)
def test_what_only_looks_proved_is_not(plant, observer, code):
    Path("attack.yaml").write_text(f"obsdesign: 1\nsystem: {plant}\nobserver: {observer}\n")
    outcome = run("solve", "attack.yaml")
    assert outcome.exit_code == code, outcome.output
    assert code != 2 or len(outcome.stderr.strip().splitlines()) == 1


def test_a_coordinate_that_takes_in_a_constant_waits_for_it():
    text = """obsdesign: 1
system: {dynamics: {x: -x+a*exp(-t), a: 0, c: -c+a}, outputs: {y: x}}
observer:
  type: kkl+pebo
  coordinates:
    - {name: xi, phi: a, lambda: 0}
    - {name: xc, phi: c, lambda: -1, B: xi}
  left_inverse: {a: xi, c: xc}
  estimator: {regressions: [{output: y, known: -y+xi*exp(-t), m: {xi: exp(-t)}}], alpha: 1, gamma: 0.01}
"""
    design = od.solve(od.load(text))
    assert design.status == "certified"
    assert design.result["guarantee"]["rates"] == {}
    assert (
        "xc - (c), obeys e' = -1 e, so that e(t) = e(0) exp(-t), once the estimate of xi is right"
        in design.result["guarantee"]["statement"]
    )


HIGH_GAIN = """obsdesign: 1
system: {inputs: [u], dynamics: %s, outputs: {y: x}, domain: {x: [-1, 1], v: [-1, 1], u: [0.1, 0.9]}}
observer: {type: high-gain, %s}
"""
STATES, MOVED = "injection: {x: {y: 8}, v: {y: 15}}", "injection: {p: {y: 8}, r: {y: 15}}, states: {p: x, r: v + u}"
MOTIONS = {  # the plant, the observer; what is said of the error, and what is not
    "constant": ("{x: v, v: -x**3 + u}", f"{STATES}, copy: outputs", "of hat_x, hat_v falls exponentially, since M is "
                 "constant: |e(t)| <= c exp(-2.96*t) |e(0)| for some c", ""),
    "of the inputs": ("{x: u*v, v: -x}", STATES, "of hat_x, hat_v falls exponentially for constant u, since M is "
                      "Hurwitz", "that the error of hat_x, hat_v falls for varying u"),
    "of the outputs": ("{x: (2+x)*v, v: -x}", f"{STATES}, copy: outputs", "M is Hurwitz for the error of hat_x, hat_v, "
                       "frozen at each point", "that the error of hat_x, hat_v falls for varying x"),
    "in a row": ("{x: -x, v: -2*v + x}", STATES, "of hat_x obeys e' = -9 e, so that e(t) = e(0) exp(-9*t)", ""),
    "in a row, the second": ("{x: -x, v: -2*v + x}", STATES, "the error of hat_v obeys e' = -2 e, so that e(t) = e(0) "
                             "exp(-2*t), where that of hat_x is 0 (otherwise it acts as a disturbance)", ""),
    "alone, of the inputs": ("{x: -u*x, v: -2*v}", STATES, "of hat_x obeys e' = lambda e, lambda = -u - 8 < 0", ""),
    "in coordinates of the inputs": (
        "{x: v, v: -v}", f"{MOVED}, dynamics: {{p: r - u, r: u - r}}, left_inverse: {{v: r - u}}",
        "the error of p, r falls exponentially for constant u", "that the error of p, r falls for varying u",
    ),
    "in coordinates of the inputs, alone": (
        "{x: -x, v: -v}", f"{MOVED}, dynamics: {{p: -p, r: u - r}}, left_inverse: {{v: r - u}}",
        "the error of p obeys e' = -9 e, so that e(t) = e(0) exp(-9*t) for constant u", "that the error of p falls for",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("dynamics", "further", "said", "missing"), MOTIONS.values(), ids=MOTIONS)
def test_a_high_gain_observer_says_which_errors_fall(dynamics, further, said, missing):
    Path("high.yaml").write_text(HIGH_GAIN % (dynamics, further))
    outcome = run("solve", "high.yaml")
    assert outcome.exit_code == 0, outcome.output
    assert said in outcome.stdout
    assert missing in outcome.stdout
    assert ("not proved" in outcome.stdout) == bool(missing)
    assert run("verify", "high.gains.json").exit_code == 0


def test_a_table_tells_what_is_proved_and_what_is_not_clause_by_clause():
    lines = [line.split(maxsplit=1) for line in run("solve", str(SPECS / "cuk-pebo.yaml")).stdout.splitlines()]
    said = [rest for name, rest in lines if name == "says"]
    assert said[0] == "theta of xi1, (i1) - xi1, is constant"
    assert "so that Y = psi theta holds of the filtered signals exactly" in said[2]
    assert said[3].startswith("xhat = x where the coordinates, theta included, are phi(x), for the left inverse holds")
    assert said[4].startswith(
        "all of it without disturbance and noise, as long as the plant stays in its domain (i1 in"
    )
    missing = [rest for name, rest in lines if name == "not" and rest.startswith("proved ")]
    assert "the least eigenvalue of int psi psi' dt over every window of one length exceeds c > 0" in missing[0]
    assert "a bound on xhat - x" in missing[1]


def test_a_state_off_a_manifold_that_waits_for_another_has_no_rate():
    text = """obsdesign: 1
system: {dynamics: {x: a, a: 0, z: b*(1+a**2), b: 0}, outputs: {y: x, y2: z}}
observer:
  type: immersion-invariance
  chi: [c, e]
  phi: [a, b]
  beta: [c+0.001*y, e+y2]
  left_inverse: {a: b1, b: b2}
"""
    design = od.solve(od.load(text))
    assert design.status == "certified"
    assert len(design.result["guarantee"]["rates"]) == 1
    assert (
        "where (c + 0.001*y) - (a) is 0 (otherwise it acts as a disturbance)" in design.result["guarantee"]["statement"]
    )


def test_a_file_of_found_coordinates_is_never_refuted_nor_of_another_lambda():
    _, design = solved("chain-found")
    content = json.loads(design.text())
    content["status"] = "refuted"
    content["observer"]["coordinates"][0]["B"] = "7*y1"
    Path("forged.gains.json").write_text(json.dumps(content))
    assert run("verify", "forged.gains.json").exit_code == 2


CURVED = """obsdesign: 1
name: a plant with the coordinate x2 - exp(x1)
system: {dynamics: {x1: x2 - x1, x2: -2*(x2 - exp(x1)) + x1 + exp(x1)*(x2 - x1)}, outputs: {y: x1}}
observer: %s
"""
FIND, BOTH = "{type: kkl, coordinates: find%s}", "{type: %s, coordinates: find, estimator: {alpha: 1, gamma: 1}}"


@pytest.mark.parametrize(
    ("text", "made", "claimed", "code"),
    [
        (PLANT, FIND % "", FIND % ", degree: 4", 0),
        (PLANT, FIND % "", FIND % ", degree: 2", 2),
        (PLANT, FIND % "", FIND % ", lambdas: [-1]", 0),
        (PLANT, FIND % "", FIND % ", lambdas: [-2]", 2),
        (PLANT, FIND % ", lambdas: [-1 - y**2]", FIND % "", 2),  # no k s for any number k
        (PLANT, BOTH % "kkl+pebo", FIND % "", 0),
        (PLANT, BOTH % "kkl+pebo", BOTH % "pebo", 2),
        (CURVED, FIND % ", functions: [exp(x1)]", FIND % ", functions: [exp(x1), sin(x1)]", 0),
        (CURVED, FIND % ", functions: [exp(x1)]", FIND % ", functions: [sin(x1)]", 2),
        (CURVED, FIND % ", functions: [exp(x1)]", FIND % "", 2),
    ],
    ids=range(10),
)
def test_found_coordinates_must_be_among_what_their_spec_asks_to_be_searched(text, made, claimed, code):
    spec = {"made": text % made, "claimed": text % claimed}
    content = json.loads(od.solve(od.load(spec["made"])).text())
    content["spec"] |= {"text": spec["claimed"], "sha256": digest(spec["claimed"])}
    content["observer"]["type"] = claimed.removeprefix("{type: ").partition(",")[0]
    Path("forged.gains.json").write_text(json.dumps(content))
    outcome = run("verify", "forged.gains.json")
    assert outcome.exit_code == code, outcome.output
    if code:
        assert outcome.stderr.count("\n") == 1
        assert "observer.coordinates[0]: is not among what the spec asks for (type " in outcome.stderr


CART = """\
obsdesign: 1
parameters: {M: 1, m: 0.2, l: 0.5, g: 9.81, c: 0.1}
system:
  inputs: [F]
  dynamics:
    p: pd
    a: ad
    pd: (F - c*pd + m*l*ad**2*sin(a) - m*g*sin(a)*cos(a))/(M + m*sin(a)**2)
    ad: ((M+m)*g*sin(a) - cos(a)*(F - c*pd + m*l*ad**2*sin(a)))/(l*(M + m*sin(a)**2))
  outputs: {y1: p, y2: a}
  domain: {a: [-0.5, 0.5], ad: [-2, 2], pd: [-2, 2], F: [-5, 5], p: [-2, 2]}
observer: {type: high-gain, copy: outputs, injection: {p: {y1: 20}, pd: {y1: 100}, a: {y2: 20}, ad: {y2: 100}}}
"""


def test_functions_of_many_operations_are_neither_written_out_nor_searched_without_end():
    Path("cart.yaml").write_text(CART)
    with soon():
        outcome = run("solve", "cart.yaml")
    assert outcome.exit_code == 4
    assert "claimed     what follows of these gains is their claim only: it is not proved" in outcome.stdout
    failing = [line for line in outcome.stdout.splitlines() if line.startswith(("NOT PROVED", "note"))]
    assert len(failing) == 4
    assert max(map(len, failing)) < 450
    assert all("error: ε_hat_" in line for line in failing)
    minors = [
        c for c in json.loads(Path("cart.gains.json").read_text())["certificate"]["checks"] if " > 0" in c["name"]
    ]
    assert [c["holds"] for c in minors if c["name"].endswith(" .. > 0")] == [True, True, True]


COUPLED = """\
obsdesign: 1
system:
  inputs: [u, v]
  dynamics:
    x1: u*x2 - x1
    x2: v*x3 + u*x6 - x2
    x3: u*x4 - v*x3 + sin(u)*x1
    x4: v*x5 - x4 + cos(v)*x2
    x5: u*v*x6 - x5*u**2
    x6: -x6 + exp(v)*x1
  outputs: {y: x1}
  domain: {u: [0.1, 0.2], v: [0.1, 0.2]}
observer: {type: high-gain, injection: {x1: {y: %s}, x2: {y: 3*v}, x3: {y: u*v}, x4: {y: 1/u}, x5: {y: u + v}}}
"""


@pytest.mark.parametrize(("gain", "code"), [("5*u", 4), ("-50*u", 3)])
def test_minors_of_many_operations_are_left_open_unless_a_small_one_decides(gain, code):
    Path("coupled.yaml").write_text(COUPLED % gain)
    with soon():
        outcome = run("solve", "coupled.yaml")
    assert outcome.exit_code == code
    said = "neither proved nor refuted: the error of hat_x1, hat_x2, hat_x3, hat_x4, hat_x5, hat_x6 is stable: leading"
    assert (f"{said} minor 4 of its matrix of Hurwitz > 0, too large to be decided" in outcome.stdout) == (code == 4)


def test_entries_of_a_matrix_that_are_all_different_are_not_multiplied_out():
    names = [f"x{i}" for i in range(6)]
    inputs = [f"u{i}{j}" for i in range(6) for j in range(6)]
    sides = {
        x: " + ".join(f"u{i}{j}/(2 + sin(u{j}{i}))*{other}" for j, other in enumerate(names))
        for i, x in enumerate(names)
    }
    domain = {u: [0, 1] for u in inputs}
    system = {"inputs": inputs, "dynamics": sides, "outputs": {"y": "x0"}, "domain": domain}
    spec = {"obsdesign": 1, "system": system, "observer": {"type": "high-gain", "injection": {"x0": {"y": 5}}}}
    Path("dense.yaml").write_text(json.dumps(spec))
    with soon():
        outcome = run("solve", "dense.yaml")
    assert outcome.exit_code == 4
    assert "minor 1 of its matrix of Hurwitz > 0, too large to be decided" in outcome.stdout


DISTURBED = """\
obsdesign: 1
system: {disturbances: [w1], dynamics: {x1: -x1 + x2, x2: -2*x2 - x1%s}, outputs: {y: x1%s}}
observer: {type: kkl, coordinates: [{name: a, phi: x2, lambda: -2, B: -y}], left_inverse: {x2: a}}
"""


@pytest.mark.parametrize(("acts", "idle"), [((" + w1*x2", ""), False), (("", " + w1*x2"), False), (("", ""), True)])
def test_a_disturbance_acts_on_nothing_where_no_equation_holds_it(acts, idle):
    Path("driven.yaml").write_text(DISTURBED % acts)
    for command in ("check", "solve"):
        outcome = run(command, "driven.yaml")
        assert outcome.exit_code == 0
        assert ("the disturbance w1 acts on nothing" in outcome.stdout) == idle


def test_a_model_of_the_disturbance_is_refused():
    Path("driven.yaml").write_text(DISTURBED % ("", "") + "disturbance: integrator\n")
    outcome = run("solve", "driven.yaml")
    assert outcome.exit_code == 2
    assert "type kkl estimates no disturbance; leave it out, or add its states" in outcome.stderr


@pytest.mark.parametrize("time", ["time: discrete, period: 1", "discretise: {period: 0.1, method: hold}"])
def test_of_a_plant_in_discrete_time_no_nonlinearity_is_missing(time):
    text = PLANT.replace("system:\n", f"system:\n  {time.replace(', period', chr(10) + '  period')}\n")
    Path("discrete.yaml").write_text(text % f"{{type: kkl, coordinates: [{ONE % 0}], left_inverse: {{x2: xi}}}}")
    outcome = run("check", "discrete.yaml")
    assert outcome.exit_code == 2
    assert "discrete time is not available for type kkl" in outcome.stderr
    assert "nonlinearities" not in outcome.stderr
