"""Names that a spec expects of its result are checked before the design."""

import json
from pathlib import Path

import pytest
from support.commands import run

from obsdesign import load
from obsdesign.expectation import stray, strays
from obsdesign.families import FAMILIES

pytestmark = pytest.mark.usefixtures("here")

SPECS = sorted((Path(__file__).parents[1] / "specs").rglob("*.yaml"))
PLANT = "obsdesign: 1\nsystem: {A: [[0, 1], [-2, -3]], B: [0, 1], C: [1, 0]}\n"
CURVED = PLANT + "nonlinearities: [{f: sin(q), type: sin, Bf: [0, 1], Cq: [1, 0]}]\n"
TYPED = "obsdesign: 1\nsystem: {dynamics: {x1: x2, x2: -2*x1 - 3*x2}, outputs: {y1: x1}}\n"
TEXTS = {
    "l2": PLANT + "observer: {type: l2, alpha: 0.3, bounds: {L1: 9}}\n",
    "linf": PLANT + "observer: {type: linf, alpha: 0.3, bounds: {L1: 9}, reconstruct: w}\n",
    "lipschitz": CURVED + "observer: {type: lipschitz, bounds: {L: 9}}\n",
    "sporadic": PLANT + "observer: {type: sporadic, T1: 0.05, T2: 0.1, delta: 9}\n",
    "high-gain": TYPED + "observer: {type: high-gain, injection: {x1: {y1: 10}, x2: {y1: 30}}}\n",
    "kkl": TYPED
    + "observer: {type: kkl, coordinates: [{name: z, phi: x2, lambda: -3, B: -2*y1}], left_inverse: {x2: z}}\n",
}


@pytest.mark.parametrize(
    ("family", "key", "expected"),
    [
        (
            "l2",
            "guarantee.gama",
            "unknown entry of guarantee gama; did you mean gamma? allowed: statement, gamma, gamma_v, alpha",
        ),
        ("l2", "gama", "unknown entry of guarantee gama; did you mean gamma?"),
        ("l2", "limit.gamm", "unknown entry of limit gamm; did you mean gamma?"),
        ("l2", "stats", "unknown entry of guarantee stats; did you mean status?"),
        ("l2", "observer.L", "unknown entry of observer L; did you mean L2? allowed: type, L1, L2"),
        ("l2", "simulation.z_norm", "unknown entry of simulation z_norm; did you mean z_norm2?"),
        ("sporadic", "alpha", "unknown entry of guarantee alpha; did you mean"),
        ("kkl", "gamma", "unknown entry of guarantee gamma; did you mean"),
    ],
)
def test_a_name_that_no_result_has_is_refused_with_the_nearest(family, key, expected):
    Path("spec.yaml").write_text(f"{TEXTS[family]}expect:\n  {key}: {{verified: 3}}\n")
    outcome = run("check", "spec.yaml")
    assert outcome.exit_code == 2
    assert (run("solve", "spec.yaml").stderr, Path("spec.gains.json").exists()) == (outcome.stderr, False)
    line = Path("spec.yaml").read_text().count("\n")
    assert outcome.stderr.startswith(f"spec.yaml:{line}:3: expect.")
    assert expected.removesuffix("; did you mean") in outcome.stderr
    assert outcome.stderr.endswith("[OBS201]\n")


@pytest.mark.parametrize("family", TEXTS)
def test_every_number_of_a_result_can_be_expected(family):
    """Every name in the guarantee and the observer of a result is known, in full and without `guarantee.`."""
    keys = {"status": "certified", "simulation.status": "done"}
    Path("spec.yaml").write_text(TEXTS[family] + f"simulation: {{horizon: 1}}\nexpect: {json.dumps(keys)}\n")
    assert run("check", "spec.yaml", "-q").exit_code == 0
    assert run("solve", "spec.yaml", "-q").exit_code == 0
    result = json.loads(Path("spec.gains.json").read_text())
    run_of = json.loads(run("simulate", "spec.gains.json", "--json", "-q").stdout)
    parts = {"": result, "guarantee.": result["guarantee"], "observer.": result["observer"], "simulation.": run_of}
    names = [f"{part}{name}" for part, entries in parts.items() for name in entries]
    names += [*result["guarantee"], *(f"limit.{name}" for name in result["guarantee"].get("limit", ()))]
    assert not [name for name in names if stray(name, FAMILIES[family].results)]


@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_the_gallery_expects_what_results_have(path):
    assert not list(strays(load(path)))


@pytest.mark.parametrize(
    ("expected", "said"),
    [
        ("search.x: {printed: 3}", "expect.search.x: has no value to compare with; give verified: VALUE [OBS205]"),
        ("alpha: {}", "expect.alpha: has no value to compare with; give verified: VALUE [OBS205]"),
        ("search.x: {verified: 3, printed: 3}", "expect.search.x: expected 3.0, found nothing [OBS617]"),
        ("alpha: true", "expect.alpha: expected True, found 0.3 [OBS617]"),
        ("observer.poles: [true]", "expect.observer.poles: expected [True], found "),
        ("search.atol: {verified: true}", "expect.search.atol: expected True, found nothing [OBS617]"),
        ("limit.attained: 0", "expect.limit.attained: expected 0.0, found False [OBS617]"),
        ("limit.attained: {verified: 0, atol: 1}", "expect.limit.attained: expected 0.0, found False [OBS617]"),
    ],
)
def test_an_expectation_that_compares_nothing_does_not_hold(expected, said):
    Path("spec.yaml").write_text(f"{TEXTS['l2']}expect: {{{expected}}}\n")
    outcome = run("solve", "spec.yaml", "-q")
    assert outcome.stderr.count("\n") == 1
    assert said in outcome.stderr
    assert outcome.exit_code == (2 if "[OBS205]" in said else 0)


@pytest.mark.parametrize(
    ("record", "said"),
    [
        ("note: [a]", "expect.gamma.note: expected text; found a list [OBS204]"),
        ("note: {a: b}", "expect.gamma.note: expected text; found a mapping [OBS204]"),
        ("note: true", "expect.gamma.note: expected text; found true [OBS204]"),
        ("rtol: [1]", "expect.gamma.rtol: expected a number or arithmetic; found a list [OBS204]"),
        ("rtol: true", "expect.gamma.rtol: expected a number or arithmetic; found true [OBS204]"),
        ("atol: {a: 1}", "expect.gamma.atol: expected a number or arithmetic; found a mapping [OBS204]"),
        ("atol: -1", "expect.gamma.atol: -1 is not allowed; give a number >= 0 [OBS208]"),
        ("printed: {a: 1}", "expect.gamma.printed: expected a number, text or a list, found a mapping [OBS204]"),
    ],
)
def test_an_entry_of_an_expectation_of_another_type_is_refused_in_one_line(record, said):
    Path("spec.yaml").write_text(f"{TEXTS['l2']}expect: {{gamma: {{verified: 1, {record}}}}}\n")
    outcome = run("solve", "spec.yaml", "-q")
    assert (outcome.exit_code, outcome.stdout, outcome.stderr.count("\n")) == (2, "", 1)
    assert outcome.stderr.endswith(f": {said}\n")


@pytest.mark.parametrize("expected", ["limit.attained: false", "alpha: {verified: 0.3}", "observer.type: l2"])
def test_an_expectation_that_holds_says_nothing(expected):
    Path("spec.yaml").write_text(f"{TEXTS['l2']}expect: {{{expected}}}\n")
    outcome = run("solve", "spec.yaml", "-q")
    assert (outcome.exit_code, outcome.stderr) == (0, "")
