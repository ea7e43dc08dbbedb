"""Numbers of a spec from logs whose noise is known, and from logs that no number fits."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from support.commands import files, run

import obsdesign as od
from obsdesign.data import runner, trials
from obsdesign.data.criterion import Course, better
from obsdesign.data.free import chosen
from obsdesign.data.log import Log
from obsdesign.data.trials import Search, along, held
from obsdesign.data.tuning import MARK, hurried, warned
from obsdesign.errors import UsageError
from obsdesign.reading import loads
from obsdesign.sections.changes import opened
from obsdesign.sections.editing import edited, reads
from obsdesign.tables.tuning import tuning_table
from obsdesign.work import trial

H = 0.02
PENDULUM = """obsdesign: 1
name: Pendulum
system:
  time: discrete
  period: 0.02
  states: [angle, speed]
  inputs: [u]
  disturbances: [push]
  dynamics: {angle: angle + 0.02*speed, speed: 0.99*speed - 0.2*sin(angle) + 0.02*u + push}
  outputs: {y: angle}
"""
MOTOR = """obsdesign: 1
name: Motor
system: {time: discrete, period: 0.02, states: [angle, speed], inputs: [u], disturbances: [push], outputs: [y],
         A: [[1, 0.02], [0, 0.9]], B: [[0], [1]], C: [[1, 0]], gx: [0, 0.4*u]}
"""
FILTER = "observer: {type: ekf, Q: {push: 1.0e-4}, R: {y: 1.0e-4}}\n"
DESIGN = "noise: {y: 0.01}\nobserver: {type: l2, rho: 0.999, objective: min-gamma}\n"
TRUTH = [(0.01, 0.001), (0.01, 0.01), (0.01, 0.1)]  # standard deviations of push and of the noise of y


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """A folder, and a compiler that does not optimise: most of the time of a trial is its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(runner, "COMPILER", ("gcc", "-std=c99", "-O0", "-shared", "-fPIC"))


def swing(x, u):
    return np.array([x[0] + H * x[1], 0.99 * x[1] - 0.2 * np.sin(x[0]) + H * u])


def turn(x, u):
    return np.array([x[0] + H * x[1], 0.9 * x[1] + 0.4 * u])


def log(step, q, r, count=1500, seed=1, path="log.csv"):
    """Log of a plant with white noise: in its speed of deviation q, in its output r, which may change with the row."""
    rng, x, rows = np.random.default_rng(seed), np.array([0.5, 0.0]), []
    noise = np.broadcast_to(r, count)
    for k in range(count):
        u = np.sign(np.sin(1.3 * k * H))
        rows.append([k * H, u, x[0] + noise[k] * rng.normal()])
        x = step(x, u) + np.array([0, q * rng.normal()])
    np.savetxt(path, rows, delimiter=",", header="t,u,y", comments="", fmt="%.12g")
    return path


def level(part):
    """Rms of the innovations of the only output."""
    return part["innovation_rms"]["y"]


def assert_no_worse(report):
    assert level(report["test"]) <= level(report["before"]["test"]) * 1.0001


# known noise


@pytest.mark.parametrize(
    ("text", "step", "truth"),
    [
        (PENDULUM, swing, TRUTH[2]),
        *(pytest.param(PENDULUM, swing, truth, marks=pytest.mark.slow) for truth in TRUTH[:2]),
        *(pytest.param(MOTOR, turn, truth, marks=pytest.mark.slow) for truth in TRUTH),
    ],
)
def test_a_filter_finds_the_ratio_of_the_noises_and_their_sizes(text, step, truth):
    """Within a factor of 2. Where y is mostly noise, 16 s tell it to one of 2 (a deviation, by the bound of Cramer and
    Rao), and 130 s to one of 1.3.
    """
    weights = "observer: {type: ekf, Q: {push: 3.0e-3}, R: {y: 3.0e-3}}\n"
    count = 12000 if truth == TRUTH[2] else 1500
    report = od.tune(loads(text + weights), log(step, *truth, count=count)).report
    Q, R = (report["fitted"][key] for key in ("observer.Q.push", "observer.R.y"))
    assert 0.5 < (R / Q) / (truth[1] / truth[0]) ** 2 < 2
    assert 0.5 < R / truth[1] ** 2 < 2
    assert report["fits"]
    assert report["criterion"] == "likelihood"
    assert_no_worse(report)


@pytest.mark.slow
def test_outputs_have_noises_of_their_own():
    rng, x, rows = np.random.default_rng(3), np.zeros(2), []
    for k in range(1500):
        u = np.sign(np.sin(2 * k * H))
        rows.append([k * H, u, x[0] + 0.001 * rng.normal(), x[1] + rng.normal()])
        x = turn(x, u) + np.array([0, 0.1 * rng.normal()])
    np.savetxt("log.csv", rows, delimiter=",", header="t,u,encoder,tacho", comments="")
    text = MOTOR.replace("outputs: [y]", "outputs: [encoder, tacho]").replace("[[1, 0]]", "[[1, 0], [0, 1]]")
    weights = "observer: {type: ekf, estimate: filtered, Q: 0.1, R: {encoder: 1.0e-4, tacho: 1.0e-2}}\n"
    fitted = od.tune(loads(text + weights), "log.csv").report["fitted"]
    truth = {"observer.Q": 0.01, "observer.R.encoder": 1e-6, "observer.R.tacho": 1.0}
    assert fitted == pytest.approx(truth, rel=1.0)
    assert all(value > 0.5 * truth[key] for key, value in fitted.items())


def optimal(q, r):
    """Rms of the innovations of the Kalman filter of the motor."""
    A, C, B = np.array([[1, H], [0, 0.9]]), np.array([[1.0, 0]]), np.array([[0], [1.0]])
    P = solve_discrete_are(A.T, C.T, q**2 * B @ B.T, np.array([[r**2]]))
    return float(np.sqrt(P[0, 0] + r**2))


@pytest.mark.slow
def test_the_level_of_a_design_grows_with_the_noise_and_its_gain_predicts_nearly_as_well_as_can_be():
    """It is no rms of a sensor: the design bounds the worst case. What is best of its gains is found, and certified."""
    levels = []
    for truth in TRUTH[::2]:
        made = od.tune(loads(MOTOR + DESIGN), log(turn, *truth), "out.yaml")
        assert list(made.report["fitted"]) == ["noise.y"]
        assert made.report["criterion"] == "prediction error"
        assert level(made.report["train"]) < 1.1 * optimal(*truth)
        assert_no_worse(made.report)
        levels.append(made.report["fitted"]["noise.y"])
    assert levels[0] < levels[1] / 30
    design = od.solve(od.load("out.yaml"))
    assert float(design.spec.noise["y"].number) == levels[1]
    assert design.status == "certified"
    assert design.gains["L1"].tolist() == made.design.gains["L1"].tolist()
    found = od.estimate(design, "log.csv")["innov_y"]
    assert level(made.report["test"]) == pytest.approx(np.sqrt(np.mean(found[900:] ** 2)), rel=1e-9)
    assert level(made.report["train"]) == pytest.approx(np.sqrt(np.mean(found[90:900] ** 2)), rel=1e-9)


# what is held back


def test_what_is_worse_on_the_rows_that_are_held_back_is_not_taken(monkeypatch):
    """The noise falls where the rows begin that judge, and the level of the spec is right for these."""
    monkeypatch.setattr(trials, "TRIALS", 2)
    noise = np.where(np.arange(1500) < 900, 0.1, 0.001)
    Path("spec.yaml").write_text(MOTOR + DESIGN.replace("y: 0.01", "y: 1") + "expect: {status: certified}\n")
    log(turn, 0.01, noise)
    outcome = run("tune", "spec.yaml", "log.csv")
    assert outcome.exit_code == 0
    assert "kept       noise.y as before: nothing that was tried is better on the rows held back, " in outcome.stdout
    head, _, text = Path("spec.tuned.yaml").read_text().partition("\n")
    assert head.startswith(f"{MARK} as before; rows 91 to 900 of log.csv")
    assert text == Path("spec.yaml").read_text()


def test_a_log_that_no_number_fits_is_told_in_one_line():
    def other(x, u):  # gravity the other way round
        return np.array([x[0] + H * x[1], 0.99 * x[1] + 0.2 * np.sin(x[0]) + H * u])

    Path("spec.yaml").write_text(PENDULUM + FILTER)
    log(other, 0.01, 0.001)
    outcome = run("tune", "spec.yaml", "log.csv", "--json")
    assert outcome.exit_code == 0
    assert outcome.stderr.startswith("log.csv: innovations are not white at any setting that was tried: ")
    assert outcome.stderr.count("\n") == 1
    report = json.loads(outcome.stdout)
    assert report["fits"] is False
    assert_no_worse(report)


# the criterion


def test_an_observer_that_follows_noise_is_worse_than_one_that_is_still():
    y = np.random.default_rng(0).normal(size=(4000, 1))
    still, following = Course(("y",), y[1:]), Course(("y",), y[1:] - y[:-1])
    assert following.error - still.error == pytest.approx(np.log(2) / 2, abs=0.03)
    assert following.correlated == pytest.approx(0.25, abs=0.05)
    assert still.wanting() < following.wanting() - 0.8
    assert still.white > 0.01
    assert following.white < 1e-9


def test_the_likelihood_is_that_of_normal_values_and_its_factor_the_best():
    rng = np.random.default_rng(1)
    S = np.array([[2.0, 0.5], [0.5, 1.0]])
    i = rng.multivariate_normal(np.zeros(2), 3 * S, 500)
    i[::7, 0] = np.nan
    i[::11] = np.nan
    course = Course(("a", "b"), i, np.broadcast_to(S, (500, 2, 2)))
    by_hand = 0.0
    for row in i:
        known = np.isfinite(row)
        if known.any():
            part = S[np.ix_(known, known)]
            by_hand += np.log(np.linalg.det(part)) + row[known] @ np.linalg.inv(part) @ row[known]
    assert course.surprise == pytest.approx(by_hand / 500)
    sized = [Course(("a", "b"), i, c * course.factor * course.spread).surprise for c in (0.9, 1, 1.1)]
    assert sized[1] < min(sized[0], sized[2])
    assert course.factor == pytest.approx(3, rel=0.15)
    assert Course(("a", "b"), i, 5 * course.spread).wanting() == pytest.approx(course.wanting())


def test_what_chance_may_win_is_not_better_and_what_is_worse_never():
    rng = np.random.default_rng(2)
    i, more = rng.normal(size=(2, 2000, 1))
    same, noisier = Course(("y",), i), Course(("y",), i + 0.3 * more)
    assert better(same, noisier)
    assert not better(noisier, same)
    assert not better(same, same)
    taken = sum(
        better(Course(("y",), rng.normal(size=(400, 1))), Course(("y",), rng.normal(size=(400, 1)))) for _ in range(400)
    )
    assert taken < 20  # 1 in 40 by chance
    assert better(Course(("y",), i, np.full((2000, 1, 1), 1.0)), Course(("y",), i, np.full((2000, 1, 1), 9.0)))


def test_the_covariance_that_a_filter_supposes_is_that_of_the_riccati_equation():
    spec = loads(MOTOR + FILTER)
    course = along(trial(spec), held(Log.of(log(turn, *TRUTH[1], count=400), spec, {})))
    assert course.spread[-1, 0, 0] == pytest.approx(optimal(0.01, 0.01) ** 2, rel=1e-6)
    text = """obsdesign: 1
system: {A: [[-1]], B: [[1]], C: [[1]]}
observer: {type: ekf, Q: 2, R: 0.5}
implementation: {period: 0.01}
"""
    Path("flow.csv").write_text("t,y1\n" + "".join(f"{k / 50},0\n" for k in range(400)))
    spec = loads(text)
    P = -0.5 + np.sqrt(0.25 + 2 * 0.5)  # 0 = -2 P + Q - P^2 / R
    found = along(trial(spec), held(Log.of("flow.csv", spec, {}))).spread
    assert found[-1, 0, 0] == pytest.approx(P + 0.5 / 0.02, rel=1e-3)


# keys


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        (FILTER, ["observer.R.y"]),
        (FILTER.replace("{y: 1.0e-4}", "2*s"), ["observer.R"]),
        (DESIGN, ["noise.y"]),
        (DESIGN.replace("0.01", "{rms: 0.01}"), ["noise.y.rms"]),
        (DESIGN.replace("0.01", "{density: 0.01}"), ["noise.y.density"]),
        (DESIGN.replace("noise: {y: 0.01}", "performance: x"), ["observer.rho"]),
        (DESIGN.replace("noise: {y: 0.01}", "performance: [speed]"), ["observer.rho"]),
        (
            "performance: {of: [angle, speed], weights: {angle: 1, speed: 3}}\nobserver: {type: l2}",
            ["performance.weights.speed"],
        ),
        ("performance: {of: [angle, speed], weights: {angle: 2}}\nobserver: {type: l2}", ["performance.weights.angle"]),
    ],
)
def test_what_is_searched_is_what_the_spec_names(text, keys):
    spec = loads(f"{MOTOR}parameters: {{s: 1.0e-4}}\n{text}")
    assert [one.key for one in chosen(spec, ())] == keys
    for one in chosen(spec, ()):
        for x in (one.low, one.high):
            loads(spec.text, changes=(one.change(x),))


@pytest.mark.parametrize(
    ("key", "value", "ends"),
    [
        ("alpha", "0.5", (0.5 / 31.62, 0.5 * 31.62)),
        ("alpha", "{min: 0.1, max: 3}", (0.1, 3)),
        ("rho", "{min: 0.9, max: 0.99}", (0.99, 0.9)),
        ("rho", "1", (0.999, np.exp(-1))),
    ],
)
def test_a_rate_is_searched_by_its_logarithm(key, value, ends):
    text = f"{MOTOR}observer: {{type: l2, {key}: {value}, objective: min-gamma}}\n"
    (one,) = chosen(loads(text), ())
    assert [float(one.at(x)) for x in (one.low, one.high)] == pytest.approx(ends, rel=1e-3)


def test_other_keys_are_named_and_must_be_numbers_of_the_spec():
    spec = loads(MOTOR + DESIGN)
    assert [one.key for one in chosen(spec, ["observer.rho", "noise.y", "observer.rho"])] == ["observer.rho", "noise.y"]
    with pytest.raises(UsageError, match=r"--free noise.x: noise.x cannot be tuned; did you mean noise.y\?"):
        chosen(spec, ["noise.x"])


TEXT = """# head
a: {b: 1.0e-3, c: [1, 2]}  # flow
d:
  e: 0.5   # block
  f: "x, y"
g:
  min: 1
  max: 2
"""


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ("a.b=0.25", TEXT.replace("1.0e-3", "0.25")),
        ("a.c=[3, 4]", TEXT.replace("[1, 2]", "[3, 4]")),
        ("a.c[1]=7", TEXT.replace("[1, 2]", "[1, 7]")),
        ("a={b: 2}", TEXT.replace("{b: 1.0e-3, c: [1, 2]}", "{b: 2}")),
        ("d.e=1.5", TEXT.replace("0.5", "1.5")),
        ("d.f=z", TEXT.replace('"x, y"', "z")),
    ],
)
def test_a_value_is_replaced_where_it_stands(change, found):
    assert edited(TEXT, "", [change]) == (found, True)


@pytest.mark.parametrize("change", ["g=3", "d.h=4", "k.l=5"])
def test_what_cannot_be_replaced_where_it_stands_is_written_anew(change):
    text, kept = edited(TEXT, "", [change], ["a"])
    assert not kept
    wanted = opened(TEXT, "", [change]).root.plain()
    wanted.pop("a")
    assert opened(text, "").root.plain() == wanted


def test_a_section_is_left_out_with_its_lines():
    assert edited(TEXT, "", [], ["d"]) == (TEXT.replace('d:\n  e: 0.5   # block\n  f: "x, y"\n', ""), True)
    assert edited(TEXT, "", [], ["g"]) == (TEXT.partition("g:")[0], True)


# the command


def test_comments_stay_and_what_was_expected_goes_and_json_says_it_all():
    Path("spec.yaml").write_text(
        f"# first\n{PENDULUM}# guess\n{FILTER.strip()}  # weights\nexpect: {{status: certified}}\n"
    )
    log(swing, *TRUTH[2], count=600)
    outcome = run("tune", "spec.yaml", "log.csv", "-o", "out.yaml", "--json")
    assert (outcome.exit_code, outcome.stderr) == (0, "")
    report = json.loads(outcome.stdout)
    assert {"fitted", "train", "test", "before"} <= set(report)
    for part in (report["train"], report["test"], report["before"]["train"], report["before"]["test"]):
        assert set(part) == {"rows", "innovation_rms", "white"}
    assert (report["train"]["rows"], report["test"]["rows"]) == (324, 240)
    Q, R = report["fitted"]["observer.Q.push"], report["fitted"]["observer.R.y"]
    text = Path("out.yaml").read_text()
    assert text.startswith(f"{MARK} observer.Q.push 1.0e-4 -> {Q:g}, observer.R.y 1.0e-4 -> {R:g}; rows 37 to 360 of")
    assert f"observer: {{type: ekf, Q: {{push: {Q:g}}}, R: {{y: {R:g}}}}}  # weights\n" in text
    assert "# first\n" in text
    assert "expect" not in text


def test_a_result_file_is_tuned_with_what_was_set_in_it_and_its_rate_in_its_range():
    head = "# obsdesign tune: as before; rows 1 to 2 of other.csv, with spec.yaml\n"
    observer = "observer: {type: l2, rho: 0.97, objective: min-gamma, bounds: {L1: 9}}\n"
    Path("spec.yaml").write_text(head + MOTOR + observer)
    ranged = "observer.rho={min: 0.9, max: 0.98, points: 3}"
    assert run("solve", "spec.yaml", "-q", "--set", ranged, "--set", "observer.bounds.L1=8").exit_code == 0
    log(turn, *TRUTH[2])
    outcome = run("tune", "spec.gains.json", "log.csv", "-o", "-")
    assert outcome.exit_code == 0
    assert outcome.stdout.count(MARK) == 1
    assert "bounds: {L1: 8}" in outcome.stdout
    rho = chosen(loads(outcome.stdout), ())[0].value
    assert rho == {"min": "0.9", "max": "0.98", "points": "3"} or 0.9 <= float(rho) <= 0.98
    outcome = run("tune", "spec.gains.json", "log.csv", "--set", "observer.rho=0.5")
    assert (outcome.exit_code, outcome.stdout) == (2, "")


@pytest.mark.parametrize(
    ("text", "content", "id"),
    [
        (DESIGN, lambda rows: rows[:100], "OBS960"),
        (DESIGN, lambda rows: ["t,u,z", *rows[1:]], "OBS811"),
        (DESIGN, lambda rows: [*rows[:200], rows[100], *rows[200:]], "OBS811"),
        (DESIGN, lambda rows: [*rows[:400], *(f"{row.rpartition(',')[0]}," for row in rows[400:])], "OBS960"),
        ("observer: {type: l2, gains: {L1: [[-0.5], [-1]]}}\n", lambda rows: rows, "OBS961"),
    ],
)
def test_a_log_that_cannot_be_tuned_to_is_refused_in_one_line(text, content, id):
    rows = Path(log(turn, *TRUTH[1], count=700)).read_text().splitlines()
    Path("log.csv").write_text("\n".join([*content(rows), ""]))
    Path("spec.yaml").write_text(MOTOR + text)
    outcome = run("tune", "spec.yaml", "log.csv")
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert outcome.stderr.count("\n") == 1
    assert id in outcome.stderr
    assert files() == ["log.csv", "spec.yaml"]


def test_innovations_that_know_their_y_are_refused():
    text = """obsdesign: 1
system: {A: [[-1]], B: [[1]], C: [[1]]}
observer: {type: l2, alpha: 0.1, bounds: {L1: 10}}
data: {hold: first}
"""
    Path("log.csv").write_text("t,y1\n" + "".join(f"{k / 50},{k % 3}\n" for k in range(400)))
    with pytest.raises(UsageError, match=r"hold: first leads the observer along straight lines") as caught:
        od.tune(loads(text), "log.csv")
    assert caught.value.problems[0].id == "OBS962"
    with pytest.raises(UsageError, match="no share"):
        od.tune(loads(text.replace("first", "zero")), "log.csv", share=1)


def test_a_limit_of_time_and_an_interrupt_leave_nothing(monkeypatch):
    Path("spec.yaml").write_text(MOTOR + DESIGN)
    log(turn, *TRUTH[1])
    outcome = run("tune", "spec.yaml", "log.csv", "--timeout", "0.4")
    assert (outcome.exit_code, outcome.stdout) == (4, "")
    assert "OBS905" in outcome.stderr
    tried = []

    def stopped(*arguments):
        tried.append(arguments)
        if len(tried) == 3:
            raise KeyboardInterrupt
        return 1.0

    monkeypatch.setattr(Search, "tried", stopped)
    outcome = run("tune", "spec.yaml", "log.csv")
    assert outcome.exit_code == 130
    assert re.fullmatch(r"interrupted; \d+% done \(noise.y=.*\); no spec is written\n", outcome.stderr)
    assert files() == ["log.csv", "spec.yaml"]


def test_a_number_that_the_log_does_not_tell_is_said_to_be_so():
    """Where nothing pushes, R/Q is as good large as very large; where it does, it is known to less than a decade."""
    weights = "observer: {type: ekf, Q: {push: 1.0e-4}, R: {y: 1.0e-4}}\n"
    told = od.tune(loads(PENDULUM + weights), log(swing, *TRUTH[0], count=1500)).report
    assert told["flat"] == {}
    Path("spec.yaml").write_text(MOTOR + weights)
    log(turn, 1e-7, 0.1, count=900)
    outcome = run("tune", "spec.yaml", "log.csv", "--json", "-q")
    report = json.loads(outcome.stdout)
    low, high = report["flat"]["observer.R.y"]
    assert low <= report["fitted"]["observer.R.y"] <= high
    assert high >= 9 * low
    assert "; the log does not tell it: values from " in tuning_table(report, "out.yaml")


def test_whiteness_that_is_lost_on_the_rows_held_back_is_told():
    part = {"rows": 60, "innovation_rms": {"y": 1.0}, "white": {"y": 0.4}}
    worse = part | {"white": {"y": 1e-5}}
    report = {"fitted": {"noise.y": 2.0}, "flat": {}, "kept": False, "ends": [], "criterion": "likelihood", "trials": 3}
    report |= {"status": "certified", "comments": True, "train": part, "test": worse}
    report["before"] = {"values": {"noise.y": 1.0}, "train": part, "test": part}
    remark = "; on the rows held back those of y were white before and are not now"
    assert remark in tuning_table(report, "out.yaml")
    report["test"] = part
    assert remark not in tuning_table(report, "out.yaml")


def test_a_filter_whose_steps_are_found_is_told_how_to_be_tuned_faster(monkeypatch):
    monkeypatch.setattr(trials, "TRIALS", 2)
    text = "obsdesign: 1\nsystem: {A: [[-1]], B: [[1]], C: [[1]]}\nobserver: {type: KIND}\n"
    ekf = text.replace("KIND", "ekf, Q: 1, R: 1")
    told = [*hurried(loads(ekf))]
    assert [problem.id for problem in told] == ["OBS964"]
    others = [ekf + "implementation: {period: 0.02}\n", text.replace("KIND", "l2"), PENDULUM + FILTER]
    assert not any(problem for other in others for problem in hurried(loads(other)))
    Path("spec.yaml").write_text(ekf)
    noise = np.random.default_rng(0).normal(size=200)
    Path("log.csv").write_text("t,y1\n" + "".join(f"{k / 50},{v:.6g}\n" for k, v in enumerate(noise)))
    lines = run("tune", "spec.yaml", "log.csv", "-o", "-").stderr.splitlines()
    assert lines[0].startswith("spec.yaml:3:")
    assert "observer.type: without implementation each setting looks for steps" in lines[0]
    assert run("tune", "spec.yaml", "log.csv", "-o", "-", "-q").stderr == ""


@pytest.mark.slow
def test_without_a_compiler_it_finds_the_same(monkeypatch):
    spec = loads(MOTOR + FILTER.replace("R: {y: 1.0e-4}", "R: {y: 1.0e-3}"))
    path = log(turn, *TRUTH[1], count=300)
    compiled = od.tune(spec, path).report
    monkeypatch.setattr(runner.shutil, "which", lambda _: None)
    assert od.tune(spec, path).report["fitted"] == pytest.approx(compiled["fitted"], rel=1e-2)
    assert not [*warned(od.tune(spec, path), path)]


def test_a_value_that_takes_an_anchor_with_it_has_the_whole_written_anew():
    text = "observer: {Q: {push: &a 0.01}, R: {y: *a}}\nexpect: {status: certified}\n"
    made, kept = edited(text, "spec.yaml", ["observer.Q.push=0.02"], ("expect",))
    assert not kept
    assert reads(made) == {"observer": {"Q": {"push": "0.02"}, "R": {"y": "0.01"}}}
