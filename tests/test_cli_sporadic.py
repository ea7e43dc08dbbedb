"""The command line with sporadic measurements: exit codes, files, and what they promise."""

import copy
import hashlib
import json
import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.commands import PNG, assert_answered, files, result_of, run
from support.forging import with_text

pytestmark = pytest.mark.usefixtures("here")

SPEC = """
obsdesign: 1
name: Oscillator
system: {states: [position, speed], A: [[0, 1], [-4, 0]], B: [1, 0], C: [1, 0]}
observer:
  type: sporadic
  T1: 0.1
  T2: 0.2
  decay: 0.05
  delta: {min: 1, max: 8, points: 5}
  bounds: {L: 10}
simulation:
  horizon: 4
  x0: [1, 0]
  w: sin(t)
  points: 41
"""
BOUNDS, TRIAL = "  bounds: {L: 10}", "  points: 41"
GIVEN = SPEC.replace(BOUNDS, "  gains: {L: [2.067, -3], H: -1.384}")


def number(value):
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def exact(value):
    """A finite number, or a text p or p/q."""
    if isinstance(value, str):
        p, _, q = value.partition("/")
        return bool(int(p) is not None and int(q or 1) > 0)
    return number(value)


def matrix(rows, entry, shape):
    assert len(rows) == shape[0]
    return all(len(row) == shape[1] and all(map(entry, row)) for row in rows)


def content_of(path):
    """A result, in which every number is finite."""
    return json.loads(Path(path).read_text(), parse_constant=pytest.fail)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with osc.yaml and the osc.gains.json that `solve` made of it."""
    folder = tmp_path_factory.mktemp("osc")
    result_of(folder, SPEC, "osc")
    return folder


@pytest.fixture
def solved(made, here):
    """The working folder, with osc.yaml and osc.gains.json in it."""
    for name in ("osc.yaml", "osc.gains.json"):
        shutil.copy(made / name, here)
    return here


@pytest.fixture
def tried(solved, sketched):  # noqa: ARG001 - both prepare the folder
    """Simulates the gains of the oscillator by another trial; returns the summary, the header and the samples."""
    original = content_of("osc.gains.json")

    def tried(*lines):
        text = SPEC.replace(TRIAL, "\n".join(f"  {line}" for line in ("points: 41", *lines)))
        Path("other.gains.json").write_text(json.dumps(with_text(copy.deepcopy(original), text)))
        outcome = run("simulate", "other.gains.json", "--json", "-o", "run.csv")
        assert outcome.exit_code == 0, outcome.output
        header, *rows = Path("run.csv").read_text().splitlines()
        samples = np.array([[float(x) for x in row.split(",")] for row in rows])
        assert np.isfinite(samples).all()
        return json.loads(outcome.stdout, parse_constant=pytest.fail), header.split(","), samples

    return tried


# solve


def test_solve_writes_gains_and_a_table():
    Path("osc.yaml").write_text(SPEC)
    outcome = run("solve", "osc.yaml")
    assert outcome.exit_code == 0
    assert outcome.stderr == ""
    assert files() == ["osc.gains.json", "osc.yaml"]
    rows = dict(line.split(maxsplit=1) for line in outcome.stdout.splitlines() if not line.startswith("limit"))
    assert {"gamma", "intervals", "gain", "L", "H", "delta", "contraction", "file"} <= rows.keys()
    assert "NOT PROVED" not in outcome.stdout


def test_a_result_file_holds_what_its_format_promises(made):
    content = content_of(made / "osc.gains.json")
    assert content["obsdesign"] == 1
    assert content["name"] == "Oscillator"
    assert content["spec"]["text"] == SPEC
    assert content["spec"]["sha256"] == hashlib.sha256(SPEC.encode()).hexdigest()
    assert content["status"] == "certified"
    assert content["solver"]["name"] == "clarabel"
    assert content["solver"]["solves"] > 0
    assert content["solver"]["scalars"]["dynamic proposition-2"] == {"printed": 7, "solved": 4}
    assert {"version", "python", "cvxpy"} <= content["tool"].keys()
    assert content["created"].endswith("+00:00")


def test_a_result_file_holds_the_observer_its_guarantee_and_the_proof(made):
    content = content_of(made / "osc.gains.json")
    observer, guarantee, proof = content["observer"], content["guarantee"], content["certificate"]
    assert observer["type"] == "sporadic"
    assert matrix(observer["L"], number, (2, 1))
    assert matrix(observer["H"], number, (1, 1))
    assert all(number(observer[key]) for key in ("T1", "T2", "delta"))
    assert np.linalg.norm(observer["L"], 2) <= 10
    assert all(number(guarantee[key]) for key in ("gamma", "mu", "decay", "T1", "T2", "noise", "jitter"))
    assert (guarantee["T1"], guarantee["T2"], guarantee["decay"], guarantee["jitter"]) == (0.1, 0.2, 0.05, 1.0)
    assert guarantee["mu"] <= guarantee["gamma"] ** 2 * (1 + 1e-12)
    assert set(guarantee["limit"]) == set(guarantee["limit_bounded"]) == {"gamma", "attained", "kind"}
    assert guarantee["limit"]["gamma"] <= guarantee["limit_bounded"]["gamma"] <= guarantee["gamma"]
    assert guarantee["gamma"] <= 1.05 * guarantee["limit_bounded"]["gamma"]
    assert repr(guarantee["gamma"]) in guarantee["statement"]
    assert proof["kind"] in {"exact", "balls"}
    assert matrix(proof["P1"], exact, (2, 2))
    assert matrix(proof["P2"], exact, (1, 1))
    assert all(check["holds"] is True and check["name"] and number(check["margin"]) for check in proof["checks"])


def test_the_multipliers_are_the_eigenvalues_of_the_error_over_one_interval(made):
    observer = content_of(made / "osc.gains.json")["observer"]
    A, C, L, H = np.array([[0, 1], [-4, 0]]), np.array([[1, 0]]), np.array(observer["L"]), np.array(observer["H"])
    for name in ("T1", "T2"):
        X, steps = np.vstack([np.eye(2), C]), 2000  # e and theta = C e after a measurement
        h = observer[name] / steps
        flow = np.block([[A, -L], [np.zeros((1, 2)), H]])
        step = np.eye(3) + h * flow @ (np.eye(3) + h / 2 * flow)
        X = np.linalg.matrix_power(step, steps) @ X
        expected = sorted(abs(np.linalg.eigvals(X[:2])))
        assert sorted(abs(complex(*v)) for v in observer["multipliers"][name]) == pytest.approx(expected, rel=1e-5)
        assert max(expected) < math.exp(-0.05 * observer[name])


def test_json_and_a_dash_print_the_file():
    Path("osc.yaml").write_text(GIVEN)
    printed = run("solve", "osc.yaml", "--json", "-o", "out.json")
    assert printed.exit_code == 0
    assert printed.stdout == Path("out.json").read_text()
    dashed = run("solve", "osc.yaml", "-o", "-")
    assert json.loads(dashed.stdout)["observer"] == content_of("out.json")["observer"]
    assert files() == ["osc.yaml", "out.json"]


def test_two_solves_give_the_same_bytes_but_for_the_clock(made):
    different = os.environ | {"PYTHONHASHSEED": "7"}
    code = "from obsdesign.cli import main; main()"
    command = [sys.executable, "-c", code, "solve", str(made / "osc.yaml"), "-o", "again.json", "-q"]
    assert subprocess.run(command, env=different, check=False, timeout=60).returncode == 0
    texts = []
    for path in ("again.json", made / "osc.gains.json"):
        content, text = content_of(path), Path(path).read_text()
        for stamp in (f'"created": "{content["created"]}"', f'"time_s": {content["solver"]["time_s"]}'):
            assert text.count(stamp) == 1
            text = text.replace(stamp, "")
        texts.append(text)
    assert texts[0] == texts[1]


def test_given_gains_are_analyzed_and_kept():
    Path("given.yaml").write_text(GIVEN)
    assert run("solve", "given.yaml", "-q").exit_code == 0
    content = content_of("given.gains.json")
    assert content["observer"]["L"] == [[2.067], [-3.0]]
    assert content["observer"]["H"] == [[-1.384]]
    assert content["guarantee"]["gamma"] >= content["guarantee"]["limit"]["gamma"]
    assert content["guarantee"]["T2_max"] > 0.2
    assert run("verify", "given.gains.json", "given.yaml", "-q").exit_code == 0


@pytest.mark.parametrize("objective", ["max-T2", "pareto"])
def test_a_search_over_T2_ends_within_its_range_and_is_proved(objective):
    text = SPEC.replace("T2: 0.2", "T2: {min: 0.1, max: 0.8, points: 3}")
    Path("osc.yaml").write_text(text.replace(BOUNDS, f"  objective: {objective}"))
    assert run("solve", "osc.yaml", "-q", "--plot").exit_code == 0
    content = content_of("osc.gains.json")
    guarantee, limit = content["guarantee"], content["guarantee"]["limit"]
    assert 0.1 <= guarantee["T2"] <= 0.8
    if objective == "max-T2":
        assert limit["T2"] == pytest.approx(0.4352, rel=5e-3)  # Ferrante et al., Example 1
        assert limit["T2"] / 1.05 * (1 - 1e-5) <= guarantee["T2"] <= limit["T2"]
        assert "osc.curve.png" not in files()
    else:
        (curve,) = content["search"]["curves"]
        assert (curve["injection"], curve["relaxation"]) == ("dynamic", "proposition-2")
        assert [p["status"] for p in curve["points"]] == ["certified", "infeasible", "infeasible"]
        assert Path("osc.curve.png").read_bytes().startswith(PNG)
    assert run("verify", "osc.gains.json", "osc.yaml", "-q").exit_code == 0


@pytest.mark.parametrize(
    ("old", "new", "condition", "words"),
    [
        ("T2: 0.2", "T2: 1.2", "inequality", "the largest T2 is"),
        ("T2: 0.2", "T2: 1.6", "sampling", "every T = 1.5708"),
        ("C: [1, 0]", "C: 0", "detectability", "not seen by any output"),
        (BOUNDS, "  bounds: {L: 1.0e-6}", "bounds", "|L| <= 1e-06"),
        (BOUNDS, "  bounds: {gamma: 0.5}", "gamma", "the least that was found is"),
        (BOUNDS, "  gains: {L: [-20, 3]}", "gains", "these gains"),
    ],
)
def test_an_infeasible_spec_is_answered_with_a_diagnosis_and_exit_code_3(old, new, condition, words):
    assert SPEC.count(old) == 1
    Path("osc.yaml").write_text(SPEC.replace(old, new))
    outcome = run("solve", "osc.yaml")
    assert outcome.exit_code == 3
    content = content_of("osc.gains.json")
    assert content["status"] == "infeasible"
    assert content["diagnosis"]["condition"] == condition
    assert words in content["diagnosis"]["reason"]
    assert content["diagnosis"]["reason"] in outcome.stdout
    assert "observer" not in content
    assert "certificate" not in content
    for command in ("verify", "simulate"):
        refused = run(command, "osc.gains.json")
        if command == "verify" and condition in {"detectability", "bounds"}:  # that is proved
            assert refused.exit_code == 0
            continue
        assert refused.exit_code == 2
        assert len(refused.stderr.splitlines()) == 1
    assert files() == ["osc.gains.json", "osc.yaml"]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("decay: 0.05", "decay: 0"),
        ("decay: 0.05", "decay: 1.0e+6"),
        ("T2: 0.2", "T2: 1.0e+6"),
        ("T1: 0.1", "T1: 1.0e-12"),
        ("delta: {min: 1, max: 8, points: 5}", "delta: 1000"),
        ("delta: {min: 1, max: 8, points: 5}", "delta: 1.0e-9"),
        (BOUNDS, "  slack: 0"),
        (BOUNDS, "  bounds: {L: 1.0e+12}"),
        (BOUNDS, "  gains: {L: [1.0e+12, 0]}"),
        ("B: [1, 0]", "B: 0"),
        ("B: [1, 0]", "B: [1.0e+9, 0]"),
    ],
)
def test_an_extreme_spec_is_answered_without_a_traceback(old, new):
    assert SPEC.count(old) == 1
    if assert_answered(SPEC.replace(old, new)) == 3:
        assert content_of("extreme.gains.json")["diagnosis"]["reason"]


PENDULUM = """
obsdesign: 1
name: Pendulum
system: {A: [[0, 1], [0, -.1]], B: [0, 1], C: [1, 0]}
nonlinearities: [{f: 9.81*sin(q), type: {slope: [-9.81, 9.81]}, Bf: [0, 1], Cq: [1, 0]}]
observer: {type: sporadic, T1: .5, T2: 1.5, decay: .5, relaxation: proposition-2}
"""


def changed(*pairs):
    """The pendulum with other texts."""
    text = PENDULUM
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return text


STIFF = changed(("[0, -.1]", "[-9.81, -.1]"), ("9.81*", ".01*"), ("[-9.81, 9.81]", "[-.01, .01]"), ("1.5", ".9"))
SOFT = changed(
    ("[0, -.1]", "[0, .1]"),
    ("9.81", ".5"),
    ("T1: .5, T2: 1.5, decay: .5", "T1: .05, T2: .2, decay: .1, bounds: {L: .3}"),
)
KEYS = {"T2 at most": "T2", "decay at most": "decay", "|L| up to": "L", "gamma up to": "gamma"}


@pytest.mark.parametrize("text", [PENDULUM, STIFF, SOFT], ids=["pendulum", "stiff", "soft"])
def test_what_is_suggested_is_certified_when_it_is_followed(text):
    Path("asked.yaml").write_text(text)
    assert run("solve", "asked.yaml", "-q").exit_code == 3
    advice = content_of("asked.gains.json")["diagnosis"]["suggestion"].split(", or ")
    followed = 0
    for part in advice:
        for words, key in KEYS.items():
            if found := re.search(re.escape(words) + r" ([0-9.e-]+)", part):
                new = re.sub(rf"\b{key}: [0-9.]+", f"{key}: {found[1]}", text)
                if key == "T2" and float(found[1]) < 0.5 and "T1: .5" in text:
                    assert "T1, which is 0.5, no longer than T2" in part
                    new = new.replace("T1: .5", f"T1: {found[1]}")
                assert new != text
                Path("followed.yaml").write_text(new)
                assert run("solve", "followed.yaml", "-q").exit_code == 0, part
                followed += 1
    assert followed
    assert "ask for a smaller T2" not in advice


def test_where_no_gamma_is_found_the_advice_is_tried():
    Path("edge.yaml").write_text(changed(("T1: .5, T2: 1.5", "T1: .05, T2: .1322")))
    outcome = run("solve", "edge.yaml")
    assert outcome.exit_code == 4
    T2 = re.search(r"ask for T2 at most ([0-9.]+)", outcome.stderr)[1]
    Path("edge.yaml").write_text(changed(("T1: .5, T2: 1.5", f"T1: .05, T2: {T2}")))
    assert run("solve", "edge.yaml", "-q").exit_code == 0


FULL = "system: {A: [[0, 1], [%s, -1]], B: [0, 1], C: [[1, 0], [0, 1]]}\nobserver: {type: sporadic, T1: .1, %s}"
LAGS = "system: {A: [[0, 1], [-1, -1]], B: [0, 1], C: [1, 0]}\n"
LAGS += "nonlinearities: [{f: .3*sin(q), type: {lipschitz: .3}, Bf: [0, 1], Cq: [1, 0]}]\n"
APART = "system: {A: [[1, 0], [0, -2]], B: [0, 1], C: [1, 0]}\nperformance: {H: [[1, 0]]}\n"
TIMES = "observer: {type: sporadic, T1: .05, T2: .1%s}"
MOTOR = """
system:
  A: [[0, 1, 0, 0], [0, -1, 500, -10000], [0, -50, -1000, 0], [0, 0, 0, -.1]]
  B: [0, 0, 0, 1]
  C: [[1, 0, 0, 0], [0, 0, 1, 0]]
nonlinearities: [{f: tanh(q), type: tanh, Bf: [0, -200, 0, 0], Cq: [0, 50, 0, 0]}]
performance: {H: [[0, 0, 0, 1]]}
observer: {type: sporadic, T1: .0005, T2: .0005, decay: 1}
"""


@pytest.mark.parametrize(
    ("text", "most"),
    [
        (FULL % (0, "T2: .2"), 0.2245),
        (FULL % (-1, "T2: .1, decay: .1"), 0.15),
        (LAGS + TIMES % ", injection: predictor", 0.3),
        pytest.param(APART + TIMES % "", 1e-3, marks=pytest.mark.slow),
        (APART + TIMES % ", bounds: {L: 10}", 100),
        pytest.param(MOTOR, 0.05, marks=[pytest.mark.slow, pytest.mark.sweep]),
    ],
    ids=["every state", "periodic", "predictor", "no gain", "no gain within a bound", "motor"],
)
def test_where_gains_grow_without_bound_the_best_that_is_proved_is_shipped_and_said_so(text, most):
    Path("near.yaml").write_text(f"obsdesign: 1\nname: near\n{text}\n")
    outcome = run("solve", "near.yaml")
    assert outcome.exit_code == 0, outcome.output
    guarantee = content_of("near.gains.json")["guarantee"]
    assert guarantee["gamma"] <= most
    reached = guarantee.get("limit_bounded", guarantee["limit"])["gamma"]
    missed = guarantee["gamma"] > max(1.05 * reached, 1e-6) * (1 + 1e-9)
    assert missed == ("all that the slack allows" in outcome.stdout)
    assert run("verify", "near.gains.json", "-q").exit_code == 0


# check and verify


def test_check_looks_at_the_ends_of_the_types_for_intervals_that_hide_modes():
    Path("asked.yaml").write_text(PENDULUM)
    outcome = run("check", "asked.yaml")
    assert outcome.exit_code == 3
    assert "at the slope -9.81 of f1, which the types allow, measurements every T = 1.00316" in outcome.stdout
    Path("asked.yaml").write_text(changed(("T2: 1.5", "T2: .9")))
    outcome = run("check", "asked.yaml")
    assert "no interval up to T2 = 0.9 hides the difference of two modes with f = K q at the ends" in outcome.stdout


def test_no_step_is_told_to_be_longer_than_the_gap_between_measurements():
    Path("slow.yaml").write_text(
        "obsdesign: 1\nname: slow\nsystem: {A: [[-.01, 0], [0, -.02]], B: [0, 1], C: [1, 0]}\n"
        "observer: {type: sporadic, T1: .1, T2: .3, gains: {L: [0, 0], H: -1}}\n"
    )
    assert run("solve", "slow.yaml", "-q").exit_code == 0
    steps = content_of("slow.gains.json")["analysis"]["largest_step"]
    assert (steps["euler"], steps["rk4"]) == (0.3, 0.3)


@pytest.mark.usefixtures("solved")
def test_a_run_names_z_and_the_error_as_the_statement_does():
    said = run("simulate", "osc.gains.json").stdout
    assert "norm2(z) <= " in said
    assert "|(e, d)(t)| <= " in said
    assert "yp" not in said


def test_check_says_what_the_structure_allows():
    Path("osc.yaml").write_text(SPEC)
    outcome = run("check", "osc.yaml", "--json")
    assert outcome.exit_code == 0
    report = json.loads(outcome.stdout)
    assert report["possible"] is True
    assert all(finding["holds"] for finding in report["findings"])
    for old, new in (("T2: 0.2", "T2: 1.6"), ("C: [1, 0]", "C: 0")):
        Path("osc.yaml").write_text(SPEC.replace(old, new))
        assert run("check", "osc.yaml", "-q").exit_code == 3
    assert files() == ["osc.yaml"]


@pytest.mark.usefixtures("solved")
def test_verify_proves_a_file_and_says_what():
    outcome = run("verify", "osc.gains.json", "osc.yaml")
    assert outcome.exit_code == 0
    assert outcome.stdout.splitlines()[-1].startswith("proved: gamma ")
    report = json.loads(run("verify", "osc.gains.json", "--json").stdout, parse_constant=pytest.fail)
    assert report["proved"] is True
    assert [check["name"] for check in report["checks"]] == [
        check["name"] for check in content_of("osc.gains.json")["certificate"]["checks"]
    ]


@pytest.mark.usefixtures("solved")
def test_gains_of_another_spec_are_refused():
    Path("other.yaml").write_text(SPEC.replace("T1: 0.1", "T1: 0.11"))
    for arguments in (
        ("verify", "osc.gains.json", "other.yaml"),
        ("simulate", "other.yaml", "--gains", "osc.gains.json"),
    ):
        outcome = run(*arguments)
        assert outcome.exit_code == 2
        assert "sha256" in outcome.stderr
        assert len(outcome.stderr.splitlines()) == 1


# simulate

COLUMNS = ["t", "position", "speed", "hat_position", "hat_speed", "w1", "y1", "received"]


@pytest.mark.usefixtures("solved")
def test_simulate_needs_the_gains_file_alone():
    os.remove("osc.yaml")
    outcome = run("simulate")
    assert outcome.exit_code == 0
    assert "simulating osc.gains.json" in outcome.stderr
    assert "VIOLATED" not in outcome.stdout
    assert files() == ["osc.gains.json", "osc.run.csv", "osc.run.png"]
    assert Path("osc.run.png").read_bytes().startswith(PNG)


@pytest.mark.usefixtures("solved", "sketched")
def test_a_spec_is_solved_first_and_gives_the_run_of_its_gains():
    for arguments in (("osc.yaml", "-o", "a.csv"), ("osc.gains.json", "-o", "b.csv")):
        assert run("simulate", *arguments, "-q").exit_code == 0
    dashed = run("simulate", "osc.yaml", "--gains", "osc.gains.json", "-o", "-")
    assert Path("a.csv").read_text() == Path("b.csv").read_text() == dashed.stdout


def test_samples_have_the_columns_of_the_format_and_y_holds_what_was_received(tried):
    summary, header, samples = tried()
    assert header == COLUMNS
    assert samples.shape == (41, 8)
    assert samples[0].tolist() == [0, 1, 0, 0, 0, 0, 0, 0]
    assert samples[-1, 0] == 4
    assert samples[:, 5] == pytest.approx(np.sin(samples[:, 0]), abs=1e-9)
    assert np.diff(samples[:, 7]).min() >= 0
    assert samples[3::2, 6] == pytest.approx(samples[2:-1:2, 1], abs=1e-9)  # at 0.3 what was measured at 0.2
    assert samples[3::2, 7].tolist() == list(range(1, 20))
    assert summary["sampling"]["received"] == 19
    assert summary["sampling"]["longest"] == pytest.approx(0.2)


@pytest.mark.parametrize(
    "lines",
    [
        (),
        ("period: 0.15",),
        ("sampling: random", "seed: 3"),
        ("sampling: {law: 0.05*sin(10*t) + 0.15}",),
        ("sampling: random", "theta0: 1", "xhat0: [0.5, 0.5]"),
        ("noise: {amplitude: 0.1}", "sampling: random"),
        ("noise: {type: gaussian, amplitude: [0.05]}",),
    ],
)
def test_a_run_within_the_intervals_keeps_every_bound(tried, lines):
    summary, _, _ = tried(*lines)
    assert summary["status"] == "done"
    assert summary["sampling"]["outside"] == 0
    assert len(summary["bounds"]) >= 2
    for bound in summary["bounds"]:
        assert bound["holds"] is True, bound["name"]
        assert bound["value"] <= bound["bound"] * (1 + 1e-6)
    assert summary["gamma"] == content_of("osc.gains.json")["guarantee"]["gamma"]


def test_from_zero_error_the_ratio_is_below_gamma(tried):
    summary, _, _ = tried("sampling: random", "xhat0: [1, 0]", "theta0: 0", "seed: 5")
    assert summary["initial_distance"] == 0
    assert 0 < summary["ratio"] <= summary["gamma"]


@pytest.mark.parametrize("lines", [("period: 0.3",), ("dropout: 0.5",), ("sampling: {law: 0.1 + t/10}",)])
def test_a_run_that_leaves_the_intervals_says_from_when_on_nothing_is_guaranteed(tried, lines):
    summary, _, _ = tried(*lines)
    assert summary["sampling"]["outside"] > 0
    assert "nothing is guaranteed from then on" in summary["sampling"]["note"]
    assert summary["bounds_omitted"]
    assert all(bound["holds"] for bound in summary["bounds"])
    assert (summary["sampling"]["lost"] > 0) == ("dropout: 0.5" in lines)


def test_a_seed_repeats_a_run_and_another_one_does_not(tried):
    runs = [tried("sampling: random", f"seed: {seed}")[2] for seed in (1, 1, 2)]
    assert (runs[0] == runs[1]).all()
    assert (runs[0] != runs[2]).any()


@pytest.mark.parametrize("law", ["-1", "0", "0.15 - t", "sqrt(-t)", "1/(t - 0.2)", "1.0e-9"])
@pytest.mark.usefixtures("solved", "sketched")
def test_a_law_without_positive_intervals_is_a_mistake_of_one_line(law):
    content = with_text(content_of("osc.gains.json"), SPEC.replace(TRIAL, f'  sampling: {{law: "{law}"}}'))
    Path("law.gains.json").write_text(json.dumps(content))
    before = files()
    outcome = run("simulate", "law.gains.json")
    assert outcome.exit_code == 2
    assert outcome.stdout == ""
    (line,) = outcome.stderr.splitlines()
    assert "simulation.sampling" in line
    assert files() == before


@pytest.mark.usefixtures("sketched")
def test_given_gains_that_prove_nothing_are_simulated_without_a_guarantee():
    Path("bad.yaml").write_text(SPEC.replace(BOUNDS, "  gains: {L: [-0.01, 0]}"))
    outcome = run("simulate", "bad.yaml")
    assert outcome.exit_code == 0
    assert "no guarantee" in outcome.stdout
    assert "holds" not in outcome.stdout
    assert files() == ["bad.run.csv", "bad.run.png", "bad.yaml"]


@pytest.mark.parametrize("objective", ["min-gamma", "feasibility"])
def test_a_far_coupling_is_designed_for(objective):
    """x1' = -x1 + 1e10 x2 is seen by nothing, and stable."""
    system, observer = "system: {A: [[-1, 1.0e10], [0, -2]], B: [0, 1], C: [0, 1]}", f"objective: {objective}"
    head = "obsdesign: 1\nname: far\nobserver: {type: sporadic, T1: 0.1, T2: 0.3, decay: 0.05, "
    Path("far.yaml").write_text(f"{head}{observer}}}\n{system}\n")
    outcome = run("solve", "far.yaml", "-o", "far.gains.json")
    assert outcome.exit_code == 0, outcome.output
    assert run("verify", "far.gains.json").exit_code == 0
    made = content_of("far.gains.json")
    assert any("units that fit the data" in note for note in made["notes"])
    if objective == "min-gamma":
        assert 1 <= made["guarantee"]["gamma"] / made["guarantee"]["limit"]["gamma"] <= 1.05


def test_a_bound_in_far_units_that_is_not_reached_is_no_proof_that_it_cannot_be():
    system = "system: {A: [[0, 1.0e+10], [-2.0e-10, -1]], B: [0, 1.0e-5], C: [1.0e-5, 0]}"
    tail = "observer: {type: sporadic, T1: 0.1, T2: 0.2, decay: 0.05, delta: 3, bounds: {L: 1.0e-3}}"
    Path("far.yaml").write_text(f"obsdesign: 1\nname: far\n{system}\n{tail}\n")
    outcome = run("solve", "far.yaml", "-o", "far.gains.json")
    assert (outcome.exit_code, "no gain was found" in outcome.stderr) == (4, True)
