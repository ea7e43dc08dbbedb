"""A file is held against what its spec asks: bounds, gamma, every alpha; and a verdict says only what it covers."""

import copy
import json
from pathlib import Path

import pytest
from support.commands import run

FAST = Path(__file__).parents[1] / "specs/infeasible/bearing-too-fast.yaml"
BOUNDED = """
obsdesign: 1
system: {A: [[0, 1], [-1, -1]], B: [[0, 0], [1, 0]], C: [[1, 0]], D: [[0, 0.1]]}
nonlinearities: [{type: {slope: [0, 1]}, Bf: [0, -1], Cq: [1, 0]}]
observer: %s
"""
SPARSE = """
obsdesign: 1
system: {A: [[0, 1], [-1, -1]], B: [[0], [1]], C: [[1, 0]]}
observer: {type: sporadic, T1: 0.1, T2: 0.2, decay: 0.05, bounds: {L: %s}}
"""


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def solved(text, name="spec"):
    Path(f"{name}.yaml").write_text(text)
    outcome = run("solve", f"{name}.yaml")
    return outcome.exit_code, json.loads(Path(f"{name}.gains.json").read_text())


def verified(content):
    Path("forged.gains.json").write_text(json.dumps(content))
    return run("verify", "forged.gains.json")


def of_another(asking, having):
    """Result of one spec under the text of another that asks for more."""
    return {**having, "spec": asking["spec"]}


@pytest.mark.parametrize("family", ["l2", "linf"])
@pytest.mark.parametrize("asked", ["bounds: {L1: 0.5}", "objective: {gamma: %s}", "bounds: {gamma: %s}"])
def test_gains_that_do_not_do_what_is_asked_are_not_proved_to(family, asked):
    _, wide = solved(BOUNDED % f"{{type: {family}, alpha: 0.2, L2: 0}}")
    close = 1.01 * wide["guarantee"]["limit"]["gamma"]
    code, asking = solved(BOUNDED % f"{{type: {family}, alpha: 0.2, L2: 0, {asked.replace('%s', repr(close))}}}")
    assert code == 0
    assert run("verify", "spec.gains.json").exit_code == 0
    outcome = verified(of_another(asking, wide))
    assert outcome.exit_code == 4
    assert outcome.stdout.splitlines()[-1].startswith("NOT proved: ")
    assert "FAILS  |L| <= kappa" in outcome.stdout or "FAILS  gamma is what is asked for" in outcome.stdout


def test_a_gain_of_sporadic_measurements_is_held_against_its_bound():
    _, wide = solved(SPARSE % 30)
    code, narrow = solved(SPARSE % 3)
    assert code == 0
    assert verified(of_another(narrow, wide)).exit_code == 4


def test_a_proof_at_one_alpha_says_nothing_of_a_larger_one_where_gamma_falls_with_it():
    """For linf gamma falls with alpha here: 1.5 is out of reach at 0.01, and reached at 0.2."""
    code, result = solved(BOUNDED % "{type: linf, alpha: 0.01, L2: 0, objective: {gamma: 1.5}}")
    assert (code, result["diagnosis"]["proof"]) == (3, "exact")
    said = run("verify", "spec.gains.json").stdout
    assert "no solution at alpha = 0.01 and gamma = 1.5" in said
    assert "larger alpha" not in said
    assert solved(BOUNDED % "{type: linf, alpha: 0.2, L2: 0, objective: {gamma: 1.5}}")[0] == 0


def test_a_proof_at_one_alpha_of_a_range_is_none_where_gamma_falls_with_it():
    """A range of alpha that is infeasible for a gamma is told without the word exact; l2 is proved at its lower end."""
    for family, proof in (("linf", "numerical"), ("l2", "exact")):
        text = f"{{type: {family}, alpha: {{min: 0.01, max: 0.02, points: 3}}, L2: 0, objective: {{gamma: 0.05}}}}"
        code, result = solved(BOUNDED % text)
        assert (code, result["diagnosis"]["proof"]) == (3, proof)


def test_a_refutation_of_more_than_is_asked_is_none():
    """The dual certificate of gamma = 0.01, under a spec that asks for the least gamma."""
    _, asking = solved(BOUNDED % "{type: l2, alpha: 0.2, L2: 0}")
    code, refuted = solved(BOUNDED % "{type: l2, alpha: 0.2, L2: 0, objective: {gamma: 0.01}}")
    assert (code, refuted["diagnosis"]["proof"]) == (3, "exact")
    assert run("verify", "spec.gains.json").exit_code == 0
    outcome = verified(of_another(asking, refuted))
    assert outcome.exit_code == 2
    assert "diagnosis.certificate.gamma" in outcome.stderr


def test_a_refutation_at_the_upper_end_of_a_range_is_none():
    """The bearing has an observer up to alpha = 55."""
    text = Path(FAST).read_text()
    code, refuted = solved(text)
    assert (code, refuted["diagnosis"]["proof"]) == (3, "exact")
    code, asking = solved(text.partition("expect:")[0].replace("alpha: 60", "alpha: {min: 0.5, max: 60, points: 3}"))
    assert code == 0
    outcome = verified(of_another(asking, refuted))
    assert outcome.exit_code == 2
    assert "diagnosis.certificate.alpha" in outcome.stderr


WEIGHED = BOUNDED.replace("{slope: [0, 1]}", "{lipschitz: 0.4}")
COMPARED = WEIGHED % "{type: lipschitz, relaxation: compare, objective: min-gamma, bounds: {L: 20}}"


def test_verify_says_what_of_a_file_it_does_not_prove():
    code, content = solved(COMPARED)
    assert code == 0
    assert "certified" in content["guarantee"]["comparison"][0]
    outcome = run("verify", "spec.gains.json")
    said, last = outcome.stdout.splitlines()[-2:]
    assert last.startswith("proved: ")
    assert said == f"numerical, no part of what is proved: {', '.join(content['numerical'])}"
    assert "guarantee.comparison" in said
    assert json.loads(run("verify", "spec.gains.json", "--json").stdout)["numerical"] == content["numerical"]


@pytest.mark.parametrize("path", ["guarantee.comparison", "guarantee.limit", "observer.poles", "analysis", "notes"])
def test_what_is_not_proved_must_be_named(path):
    _, content = solved(COMPARED)
    content["notes"] = [*content.get("notes", []), "gamma = 1e-9 was reached"]
    content["numerical"] = sorted({*content["numerical"], "notes"} - {path})
    outcome = verified(content)
    assert outcome.exit_code == 2
    assert f"numerical: does not name {path}, which is not proved" in outcome.stderr


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("observer.poles", [[-50.0, 0.0], [-60.0, 0.0]]),
        ("observer.largest_step", 1e3),
        ("observer.noise_gain", {"x1": 1e-9}),
        ("observer.K", [[1.0]]),
        ("guarantee.T2_max", 1e9),
        ("guarantee.limit.gamma", 1e3),
        ("certificate.theorem", "gamma = 1e-9"),
        ("certificate.checks", [{"name": "gamma <= 1e-9", "holds": True, "margin": 1.0}]),
        ("theorem", {"accepted": True}),
        ("verdict", {"accepted": True}),
    ],
)
def test_what_contradicts_what_is_proved_or_is_not_proved_is_refused(key, value):
    _, content = solved(BOUNDED % "{type: l2, alpha: 0.2, L2: 0}")
    genuine = copy.deepcopy(content)
    part = content
    *path, last = key.split(".")
    for name in path:
        part = part[name]
    part[last] = value
    outcome = verified(content)
    assert outcome.exit_code == 2
    assert (key if key != "verdict" else "numerical") in outcome.stderr
    assert verified(genuine).exit_code == 0


def test_no_shipped_gamma_of_sporadic_measurements_is_better_than_its_limit():
    """Of gains that Theorem 2 proves better than their relaxation can, the best that was found is told."""
    text = (Path(FAST).parents[1] / "ferrante2019-robot-tradeoff.yaml").read_text()
    code, content = solved(text)
    limit = content["guarantee"]["limit"]
    assert code == 0
    assert (limit["gamma"], limit["kind"]) == (content["guarantee"]["gamma"], "best-found")
