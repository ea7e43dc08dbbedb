"""The command line with Lipschitz systems: exit codes, files, and what they promise."""

import json
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from support.commands import endless, files, interrupted, run

from obsdesign.lmi.formula import in_floats
from obsdesign.reading import load

pytestmark = pytest.mark.usefixtures("here", "sketched")

SPEC = """
obsdesign: 1
name: Noisy oscillator
system:
  states: [position, speed]
  A: [[0, 1], [-1, -1]]
  B: [[1, 0], [1, 0]]
  C: [1, 0]
  D: [[0, 0.2]]
nonlinearities:
  - type: {lipschitz: 0.4167}
performance: {H: [[0.5, 0], [0, 0.5]]}
observer:
  type: lipschitz
  decay: 0.05
  objective: min-gamma
simulation: {horizon: 3, x0: [1, 0], w: [sin(t), 0.1], points: 31}
"""
MIN_GAMMA, BLOCK, D = "  objective: min-gamma\n", "  - type: {lipschitz: 0.4167}\n", "  D: [[0, 0.2]]\n"
W = "  B: [[1, 0], [1, 0]]\n"
MEASURED = ("  C: [1, 0]\n" + D, "  C: [[1, 0], [0, 1]]\n  D: [[0, 0.2], [0, 0.1]]\n")
SEVERAL = """
obsdesign: 1
name: Two masses
system:
  A: [[0, 1, 0, 0], [-2, -1, 1, 0], [0, 0, 0, 1], [1, 0, -3, -1]]
  B: [[0, 0], [1, 0], [0, 0], [1, 0]]
  C: [1, 0, 0, 0]
  D: [[0, 0.1]]
nonlinearities:
  - {type: {lipschitz: 0.5}, Bf: [0, 1, 0, 0], Cq: [1, 0, 0, 0]}
  - {type: {slope: [-0.02, 0.1]}, Bf: [0, 0, 0, 1], Cq: [0, 0, 1, 0]}
  - {type: {lipschitz: 0.3}, Bf: [[1, 0], [0, 0], [0, 1], [0, 0]], Cq: [[0, 1, 0, 0], [0, 0, 1, 1]]}
performance: {H: [[0, 0, 1, 0]]}
observer:
  type: lipschitz
  decay: 0.1
"""
FREQUENCIES = np.array([0, *np.logspace(-3, 4, 150)])


def changed(*pairs, text=SPEC):
    """A spec with other lines."""
    for old, new in pairs:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def asking(*lines):
    """The spec with other lines in place of its objective."""
    return changed((MIN_GAMMA, "".join(f"  {line}\n" for line in lines)))


def solved(text, *options):
    """Outcome of a spec.yaml and what is in its gains file, in which every number is finite."""
    Path("spec.yaml").write_text(text)
    outcome = run("solve", "spec.yaml", *options)
    assert isinstance(outcome.exception, SystemExit | None), outcome.exception
    path = Path("spec.gains.json")
    return outcome, json.loads(path.read_text(), parse_constant=pytest.fail) if path.exists() else None


def certified(text, *options):
    """What is in the gains file of a spec that has a solution; `verify` proves it."""
    outcome, content = solved(text, *options)
    assert outcome.exit_code == 0, outcome.output
    assert content["status"] == "certified"
    assert all(check["holds"] for check in content["certificate"]["checks"])
    proof = run("verify", "spec.gains.json", "spec.yaml")
    assert proof.exit_code == 0, proof.output
    return content


def perturbed(content, seed, trials=12):
    """Error dynamics of the gains of a file, and w -> z, for linear f of the certified size."""
    claimed, spec, random = content["guarantee"], load("spec.yaml"), np.random.default_rng(seed)
    p, L = in_floats(spec.augmented), np.array(content["observer"]["L"])
    sizes = [(block.nq, block.nf) for block in spec.multiplier.blocks]
    constants = claimed.get("constants", [claimed["lipschitz"]])
    for k in range(trials):
        blocks = []
        for (nq, nf), constant in zip(sizes, constants, strict=True):
            rank = 1 if k % 2 else min(nq, nf)
            F = random.standard_normal((nf, rank)) @ random.standard_normal((rank, nq))
            blocks.append(F * constant / np.linalg.norm(F, 2))
        f = np.zeros((sum(nf for _, nf in sizes), sum(nq for nq, _ in sizes)))
        i = j = 0
        for F in blocks:
            f[i : i + F.shape[0], j : j + F.shape[1]] = F
            i, j = i + F.shape[0], j + F.shape[1]
        yield p.A - L @ p.C + p.Bf @ f @ p.Cq, p.B - L @ p.D, in_floats(spec.H)


def hold(content, seed=0):
    """Decay and gamma that are claimed, for linear f of the certified size."""
    claimed = content["guarantee"]
    for A, B, H in perturbed(content, seed):
        assert -np.linalg.eigvals(A).real.max() >= claimed["decay"] * (1 - 1e-9)
        if "gamma" in claimed:
            inverses = np.linalg.inv(1j * FREQUENCIES[:, None, None] * np.eye(len(A)) - A)
            gains = np.linalg.norm(H @ inverses @ B, 2, axis=(1, 2))
            assert gains.max() <= claimed["gamma"] * (1 + 1e-9)


# What is claimed


@pytest.mark.parametrize("relaxation", ["s-procedure", "norm-bound", "abbaszadeh", "compare"])
@pytest.mark.parametrize(
    "lines",
    [
        ("objective: max-lipschitz",),
        ("objective: max-lipschitz", "bounds: {L: {frobenius: 2.15}}"),
        ("objective: min-gamma", "bounds: {L: 4, gamma: 2}"),
        ("objective: min-gamma", "bounds: {P: {min: 0.1}}"),
        ("objective: pareto", "weight: 0.5"),
    ],
)
def test_every_claim_holds_for_linear_f_of_the_certified_size(lines, relaxation):
    content = certified(asking(f"relaxation: {relaxation}", *lines))
    claimed = content["guarantee"]
    assert claimed["margin"] == pytest.approx(claimed.get("admissible", claimed["lipschitz"]) - 0.4167)
    if "limit_bounded" in claimed and "gamma" in claimed["limit"]:
        assert claimed["gamma"] >= claimed["limit_bounded"]["gamma"] * (1 - 1e-6)
        assert claimed["limit_bounded"]["gamma"] >= claimed["limit"]["gamma"] * (1 - 1e-6)
    hold(content)


def test_several_blocks_share_one_factor_and_have_a_finite_limit_though_the_output_sees_one_of_them():
    content = certified(SEVERAL)
    claimed = content["guarantee"]
    assert claimed["limit"]["lipschitz"] == pytest.approx(0.86105, rel=1e-4)  # |L| = 1e6 still reaches 0.861
    assert claimed["constants"] == pytest.approx([claimed["lipschitz"] * share for share in (1, 0.2, 0.6)])
    assert claimed["lipschitz"] >= claimed["limit"]["lipschitz"] / 1.05 * (1 - 1e-4)
    hold(content)


def test_with_a_disturbance_model_the_claim_is_about_what_drives_it():
    text = changed(("performance: {H: [[0.5, 0], [0, 0.5]]}", "performance: {H: [[0.5, 0, 0]]}"))
    content = certified(text + "disturbance: {type: [integrator, unknown]}\n")
    assert "norm2(v)" in content["guarantee"]["statement"]
    assert "where v = 0" in content["guarantee"]["statement"]
    assert "norm2(w)" not in content["guarantee"]["statement"] + run("solve", "spec.yaml").stdout
    assert "norm2(v)" in run("verify", "spec.gains.json").stdout
    hold(content)


def test_without_w_nothing_is_said_of_gamma():
    content = certified(changed((MIN_GAMMA, ""), (W, ""), (D, ""), (", w: [sin(t), 0.1]", "")))
    assert not {"gamma", "mu1", "mu2"} & content["guarantee"].keys()
    assert "norm2" not in content["guarantee"]["statement"]
    hold(content)


def test_a_declared_constant_beyond_what_is_certified_is_a_warning_and_no_guarantee():
    outcome, content = solved(changed((MIN_GAMMA, ""), ("lipschitz: 0.4167", "lipschitz: 50")))
    assert outcome.exit_code == 0
    assert content["guarantee"]["margin"] < -48
    assert "NOT covered" in outcome.stdout
    assert "warning" in outcome.stdout
    assert "of which this says nothing" in content["guarantee"]["statement"]


@pytest.mark.parametrize("constant", ["0", "1e-9"])
def test_a_tiny_constant_costs_little_and_theorem_3_dearly(constant):
    text = changed((MIN_GAMMA, MIN_GAMMA + "  relaxation: compare\n"), ("0.4167", constant))
    content = certified(text)
    tight, _, printed = content["guarantee"]["comparison"]
    assert tight["limit"]["gamma"] == pytest.approx(0.12467, rel=1e-3)
    if constant == "0":
        assert printed["status"] == "infeasible"
        assert "divides by it" in printed["reason"]
    else:
        assert printed["limit"]["gamma"] > 6000
    hold(content)


def test_units_change_the_gain_and_not_what_is_achieved():
    pairs = [
        ("A: [[0, 1], [-1, -1]]", "A: [[0, 1.0e-3], [-1.0e+3, -1]]"),
        (W, "  B: [[1, 0], [1000, 0]]\n"),
        (BLOCK, "  - {type: {lipschitz: 0.4167}, Bf: [0, 1000], Cq: [1, 0]}\n"),
        ("[0, 0.5]]", "[0, 0.0005]]"),
    ]
    scaled = certified(changed(*pairs))
    hold(scaled)
    plain = certified(changed((BLOCK, "  - {type: {lipschitz: 0.4167}, Bf: [0, 1], Cq: [1, 0]}\n")))
    for key in ("gamma", "lipschitz"):
        assert scaled["guarantee"][key] == pytest.approx(plain["guarantee"][key], rel=1e-3)


@pytest.mark.parametrize("speed", [1e6, 1e-6])
def test_a_faster_clock_changes_rates_and_constants_alike(speed):
    gains = "gains: {L: [2, 1]}"
    slow = certified(asking(gains))
    pairs = [
        ("A: [[0, 1], [-1, -1]]", f"A: [[0, {speed}], [-{speed}, -{speed}]]"),
        ("0.4167", f"0.4167*{speed}"),
        ("decay: 0.05", f"decay: 0.05*{speed}"),
        (gains, f"gains: {{L: [2*{speed}, {speed}]}}"),
    ]
    fast = certified(changed(*pairs, text=asking(gains)))
    for key in ("lipschitz", "margin"):
        assert fast["guarantee"][key] == pytest.approx(speed * slow["guarantee"][key], rel=5e-3)


# What is searched


def test_a_curve_of_two_points_ends_at_the_least_gamma_and_at_the_largest_constant():
    content = certified(asking("objective: pareto", "weight: {min: 0, max: 1, points: 2}"), "--plot")
    first, last = content["search"]["points"]
    assert (first["weight"], last["weight"]) == (0, 1)
    assert first["gamma"] == pytest.approx(0.146750, rel=1e-4)
    assert "lipschitz" not in first
    assert last["lipschitz"] == pytest.approx(1.379311, rel=1e-5)
    assert "gamma" not in last
    assert Path("spec.curve.png").stat().st_size > 10_000


def test_a_surface_says_where_there_is_no_solution_and_ships_one_where_there_is():
    lines = ("objective: pareto", "relaxation: abbaszadeh", "weight: {min: 0, max: 1, points: 2}")
    text = asking(*lines).replace("decay: 0.05", "decay: {min: 0, max: 3, points: 2}")
    content = certified(text)
    assert [p["status"] for p in content["search"]["points"]] == ["certified", "certified", "infeasible", "infeasible"]
    outcome, content = solved(text.replace("min: 0, max: 3", "min: 2, max: 3"))
    assert outcome.exit_code == 3
    assert "Theorems 3 and 4 need" in content["diagnosis"]["reason"]


@pytest.mark.parametrize(("relaxation", "largest"), [("s-procedure", 1.3793105), ("norm-bound", 1.1646557)])
def test_where_gamma_does_not_grow_the_best_constant_is_the_largest_one(relaxation, largest):
    text = asking("objective: pareto", "weight: 0.5", f"relaxation: {relaxation}")
    silent = text.replace(W, "  B: [[0, 0], [0, 0]]\n").replace(D, "")
    found = certified(silent)["guarantee"]["limit"]
    assert found["gamma"] == 0
    assert found["lipschitz"] == pytest.approx(largest, rel=1e-4)


@pytest.mark.parametrize("lines", [("objective: max-lipschitz",), ("objective: pareto", "weight: 0.5")])
def test_a_constant_without_a_limit_is_refused_with_a_table_to_choose_a_gain_from(lines):
    text = asking(*lines)
    outcome, content = solved(text.replace(*MEASURED))
    assert outcome.exit_code == 2
    first, *table = outcome.stderr.splitlines()
    assert "grows without bound" in first
    assert content is None
    known = [float(line.split()[-1]) for line in table]
    assert len(known) >= 4
    assert all(math.isfinite(value) for value in known)
    assert all(low < high for low, high in pairwise(known))
    bounded = certified(asking(*lines, "bounds: {L: 10}").replace(*MEASURED))
    assert bounded["guarantee"]["lipschitz"] <= known[0] * (1 + 1e-6)


def test_a_comparison_has_no_solution_only_if_the_tightest_relaxation_has_none():
    lines = ("relaxation: compare", "objective: pareto", "weight: 0.5")
    large = ("performance: {H: [[0.5, 0], [0, 0.5]]}", "performance: {H: [[2, 0], [0, 2]]}")
    outcome, content = solved(asking(*lines).replace(*MEASURED).replace(*large))
    assert outcome.exit_code == 2  # sigma(H) >= 1 is in the way of abbaszadeh only; the others need a bound on L
    assert "grows without bound" in outcome.stderr
    assert content is None


# Gains that are given


def test_given_gains_keep_their_numbers_and_are_held_against_the_limit():
    content = certified(asking("objective: min-gamma", "gains: {L: [14, 10]}"))
    assert content["observer"]["L"] == [[14.0], [10.0]]
    assert content["guarantee"]["gamma"] >= content["guarantee"]["limit"]["gamma"]
    hold(content)


@pytest.mark.parametrize(
    ("gains", "words"),
    [("[-20, 1]", "slowest pole of the error is 19.9"), ("[0, 0]", "too slow for decay = 0.9")],
)
def test_gains_that_achieve_nothing_are_answered_with_the_pole(gains, words):
    text = asking("objective: min-gamma", f"gains: {{L: {gains}}}").replace("decay: 0.05", "decay: 0.9")
    outcome, content = solved(text)
    assert outcome.exit_code == 3
    assert words in content["diagnosis"]["reason"]
    assert run("verify", "spec.gains.json").exit_code == 2


# Files


def test_a_run_is_held_against_the_guarantee():
    outcome, _ = solved(SPEC.replace(BLOCK, "  - {f: 0.4*sin(q), type: {lipschitz: 0.4}, Bf: [0, 1], Cq: [0, 1]}\n"))
    assert outcome.exit_code == 0
    summary = json.loads(run("simulate", "spec.gains.json", "--json").stdout, parse_constant=pytest.fail)
    assert summary["status"] == "done"
    assert len(summary["bounds"]) >= 3
    assert all(bound["holds"] for bound in summary["bounds"])
    assert files() == ["spec.gains.json", "spec.run.csv", "spec.run.png", "spec.yaml"]


def test_gains_of_another_spec_are_refused():
    certified(SPEC)
    Path("spec.yaml").write_text(SPEC.replace("0.4167", "0.4"))
    for command in (
        ("simulate", "spec.yaml", "--gains", "spec.gains.json"),
        ("verify", "spec.gains.json", "spec.yaml"),
    ):
        outcome = run(*command)
        assert outcome.exit_code == 2
        assert "another spec" in outcome.stderr
        assert len(outcome.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("section", "key", "value", "code"),
    [
        ("guarantee", "gamma", 0.1, 2),
        ("guarantee", "lipschitz", 0.5, 2),
        ("guarantee", "decay", 0.5, 2),
        ("guarantee", "margin", 5.0, 2),
        ("guarantee", "admissible", 1.5, 2),
        ("guarantee", "statement", "z is as small as you like", 2),
        ("observer", "L", [[-14.0], [-10.0]], 4),
        ("observer", "L", [[14.0, 10.0]], 2),
        ("observer", "relaxation", "abbaszadeh", 2),
        ("certificate", "P", [[1, 0], [0, -1]], 4),
        ("certificate", "multipliers", {}, 2),
    ],
)
def test_an_edited_file_is_not_proved(edited, section, key, value, code):
    edited[section][key] = value
    Path("edited.gains.json").write_text(json.dumps(edited))
    outcome = run("verify", "edited.gains.json")
    assert outcome.exit_code == code, outcome.output
    assert "proved: Lipschitz" not in outcome.stdout.replace("NOT proved", "")
    assert len(outcome.stderr.splitlines()) == 1


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    """Text of a gains file."""
    folder = tmp_path_factory.mktemp("original")
    (folder / "spec.yaml").write_text(SPEC)
    assert run("solve", folder / "spec.yaml", "-q", "-o", folder / "spec.gains.json").exit_code == 0
    return (folder / "spec.gains.json").read_text()


@pytest.fixture
def edited(original):
    """What is in a gains file, to be edited."""
    return json.loads(original)


def test_a_dash_prints_the_file_and_nothing_else():
    Path("spec.yaml").write_text(SPEC)
    outcome = run("solve", "spec.yaml", "-o", "-")
    assert json.loads(outcome.stdout)["status"] == "certified"
    assert outcome.stderr == ""
    assert run("solve", "spec.yaml", "-q", "-o", "quiet.json").output == ""
    assert files() == ["quiet.json", "spec.yaml"]


@pytest.mark.parametrize(("outcome_of", "code"), [(interrupted, 130), (endless, 4)])
def test_a_design_that_is_stopped_leaves_nothing_behind(monkeypatch, outcome_of, code):
    monkeypatch.setattr("obsdesign.families.lipschitz.design.design", outcome_of)
    outcome, content = solved(SPEC, "--timeout", "1")
    assert outcome.exit_code == code
    assert len(outcome.stderr.splitlines()) == 1
    assert content is None
    assert files() == ["spec.yaml"]


def test_another_solver_finds_the_same_limit():
    pytest.importorskip("cvxopt")
    outcome, content = solved(SPEC, "--solver", "cvxopt")
    assert outcome.exit_code == 0, outcome.output
    assert content["solver"]["name"] == "cvxopt"
    assert content["guarantee"]["limit"]["gamma"] == pytest.approx(0.146750, rel=1e-3)
    assert run("verify", "spec.gains.json").exit_code == 0


# Mistakes


@pytest.mark.parametrize(
    ("lines", "place", "words"),
    [
        (["objektive: min-gamma"], "16:3: observer.objektive", "did you mean objective?"),
        (["objective: min-gama"], "16:14: observer.objective", "did you mean min-gamma?"),
        (["objective: max-alpha"], "16:14: observer.objective", "did you mean max-lipschitz?"),
        (["relaxation: theorem-3"], "16:15: observer.relaxation", "allowed: s-procedure"),
        (["alpha: 0.1"], "16:3: observer.alpha", "called decay"),
        (["T2: 0.1"], "16:3: observer.T2", "but to sporadic"),
        (["L2: free"], "16:3: observer.L2", "but to l2 or linf"),
        (["weight: 0.5"], "16:3: observer.weight", "belongs to objective pareto"),
        (["objective: pareto"], "13:1: observer.weight", "required for pareto"),
        (["objective: pareto", "weight: 1.5"], "17:11: observer.weight", "a weight is in [0, 1]"),
        (["objective: pareto", "weight: -1"], "17:11: observer.weight", "give a number >= 0"),
        (["objective: pareto", "weight: {min: 0.8, max: 0.2}"], "17:11: observer.weight", "min < max"),
        (["objective: pareto", "weight: {min: 0, max: 2}"], "17:25: observer.weight.max", "a weight is in [0, 1]"),
        (["objective: pareto", "weight: .nan"], "17:11: observer.weight", "not a finite number"),
        (["objective: pareto", "weight: heavy"], "17:11: observer.weight", "unknown name 'heavy'"),
        (["objective: pareto", "weight: 0.5", "gains: {L: [2, 1]}"], "18:3: observer.gains", "pareto designs gains"),
        (["objective: pareto", "weight: 0.5", "bounds: {gamma: 1}"], "18:12: observer.bounds.gamma", "weighs gamma"),
        (["bounds: {gamma: 1}"], "16:12: observer.bounds.gamma", "max-lipschitz knows no gamma"),
        (["bounds: {P: {min: 1}}"], "16:12: observer.bounds.P", "no scale in the s-procedure"),
        (["bounds: {L1: 1}"], "16:12: observer.bounds.L1", "did you mean L?"),
        (["bounds: {L: 0}"], "16:15: observer.bounds.L", "give a number > 0"),
        (["gains: {L: [1, 2, 3]}"], "16:14: observer.gains.L", "expected 2 rows"),
        (["gains: {L1: [1, 2]}"], "16:11: observer.gains.L1", "did you mean L?"),
        (
            ["relaxation: compare", "objective: pareto", "weight: {min: 0, max: 1}"],
            "18:3: observer.weight",
            "compare takes a number",
        ),
    ],
)
def test_a_wrong_observer_is_one_line_at_its_place(lines, place, words):
    outcome, content = solved(asking(*lines))
    assert outcome.exit_code == 2
    (line,) = outcome.stderr.splitlines()
    assert line.startswith(f"spec.yaml:{place}: ")
    assert words in line
    assert content is None


@pytest.mark.parametrize(
    ("block", "place", "words"),
    [
        ("{type: monotone, Bf: [0, 1], Cq: [1, 0]}", "11:12: nonlinearities[0].type", "no Lipschitz constant"),
        (
            "{type: {slope: [0, .inf]}, Bf: [0, 1], Cq: [1, 0]}",
            "11:12: nonlinearities[0].type",
            "no Lipschitz constant",
        ),
        ("{type: {lipschitz: -1}}", "11:24: nonlinearities[0].type.lipschitz", "give a number >= 0"),
        ("{type: {lipschitz: .nan}}", "11:24: nonlinearities[0].type.lipschitz", "not a finite number"),
        ("{type: {lipschitz: 1}, Bf: [0, 1, 2], Cq: [1, 0]}", "11:32: nonlinearities[0].Bf", "expected 2 rows"),
        ("{type: {lipschitz: 1}, Bf: [0, 1], Cq: [1, 0, 0]}", "11:44: nonlinearities[0].Cq", "2 columns"),
        ("{type: {lipschitz: 1}, Bf: [0, 0], Cq: [1, 0]}", "11:3: nonlinearities", "f does not act"),
        ("{type: {lipschitz: 1}, f: sin(q1)}", "11:5: nonlinearities[0].Bf", "1 component, not one for each"),
        ("{type: {lipschitz: 1}, f: 2*sin(q), Bf: [0, 1], Cq: [1, 0]}", "11:12: nonlinearities[0].type", "refuted"),
        ("{type: {lipschitz: auto}, Bf: [0, 1], Cq: [1, 0]}", "11:12: nonlinearities[0].type", "give f"),
    ],
)
def test_a_wrong_nonlinearity_is_one_line_at_its_place(block, place, words):
    outcome, content = solved(changed((BLOCK, f"  - {block}\n")))
    assert outcome.exit_code == 2, outcome.output
    (line,) = outcome.stderr.splitlines()
    assert line.startswith(f"spec.yaml:{place}: ")
    assert words in line
    assert content is None


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (BLOCK, "", "needs at least one"),
        (W + "  C: [1, 0]\n" + D, "  C: [1, 0]\n", "min-gamma is about w, and there is none"),
    ],
)
def test_what_is_missing_is_said(old, new, words):
    text = changed((old, new)).replace("nonlinearities:\nperf", "perf").replace(", w: [sin(t), 0.1]", "")
    outcome, _ = solved(text)
    assert outcome.exit_code == 2
    (line,) = outcome.stderr.splitlines()
    assert words in line
