"""The command line, as a person and a script meet it: exit codes, streams, files."""

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from support.commands import PNG, assert_answered, endless, files, interrupted, run

from obsdesign.lmi.solvers import Ending

UNDETECTABLE = """
obsdesign: 1
system: {A: [[1, 0], [0, -1]], B: [[0], [1]], C: [[0, 1]]}
observer: {type: l2, L2: 0, alpha: 0.1}
"""


@pytest.fixture(autouse=True)
def here(made, tmp_path, monkeypatch):
    """An empty working folder; the spec of the cart stands in ../specs, without gains."""
    home = tmp_path / "here"
    home.mkdir()
    (tmp_path / "specs").mkdir()
    shutil.copy(made / "cart.yaml", tmp_path / "specs")
    monkeypatch.chdir(home)
    return home


@pytest.fixture
def solved(here, made):
    """The working folder, with cart.gains.json in it."""
    shutil.copy(made / "cart.gains.json", here)
    return here


CART = "../specs/cart.yaml"


def process(*arguments, code="from obsdesign.cli import main; main()", **options):
    """A command in a process of its own."""
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        **options,
    )


def assert_refused(outcome, *words, code=2, quiet=True):
    """Exit code, nothing on standard output (if quiet), one line a problem on standard error, no traceback."""
    assert outcome.exit_code == code, outcome.output
    assert outcome.stdout == "" or not quiet
    assert outcome.stderr.strip()
    assert "Traceback" not in outcome.stderr
    for word in words:
        assert word in outcome.stderr


# solve


def test_solve_writes_its_gains_into_the_current_folder_and_says_so_on_standard_output():
    outcome = run("solve", CART)
    assert outcome.exit_code == 0
    assert files() == ["cart.gains.json"]
    assert outcome.stderr == ""
    assert outcome.stdout.splitlines()[-1].split() == ["file", "cart.gains.json"]
    assert "certified" in outcome.stdout
    assert "NOT PROVED" not in outcome.stdout
    table = dict(line.split(maxsplit=1) for line in outcome.stdout.splitlines())
    assert json.loads(table["L1"]) == json.loads(Path("cart.gains.json").read_text())["observer"]["L1"]
    assert json.loads(Path("cart.gains.json").read_text())["spec"]["path"] == CART


def test_a_dash_writes_the_file_to_standard_output_and_nothing_else_there():
    outcome = run("solve", CART, "-o", "-")
    assert outcome.exit_code == 0
    content = json.loads(outcome.stdout)
    assert content["status"] == "certified"
    assert outcome.stdout.startswith("{")
    assert outcome.stdout.endswith("}\n")
    assert files() == []


def test_json_prints_what_the_file_holds():
    outcome = run("solve", CART, "--json", "-o", "out.json")
    assert outcome.stdout == Path("out.json").read_text()
    assert files() == ["out.json"]


def test_quiet_prints_nothing_but_writes_everything_beside_the_gains():
    Path("results").mkdir()
    outcome = run("solve", CART, "-o", "results/g.json", "--simulate", "--quiet")
    assert outcome.exit_code == 0
    assert (outcome.stdout, outcome.stderr) == ("", "")
    assert files() == ["results"]
    assert files("results") == ["g.json", "g.run.csv", "g.run.png"]
    assert Path("results/g.run.png").read_bytes().startswith(PNG)


@pytest.mark.parametrize("gains", ["a.json", "a.gains.json"])
def test_a_run_has_the_name_of_its_gains_file_whichever_command_makes_it(gains):
    Path("dd").mkdir()
    outcome = run("solve", CART, "-o", f"dd/{gains}", "--simulate")
    assert files("dd") == sorted([gains, "a.run.csv", "a.run.png"])
    assert "dd/a.run.csv" in outcome.stdout
    assert run("simulate", f"dd/{gains}", "-q").exit_code == 0
    assert files() == ["a.run.csv", "a.run.png", "dd"]
    assert Path("a.run.csv").read_text() == Path("dd/a.run.csv").read_text()


def test_plot_draws_the_curve_of_a_range_of_alpha():
    text = Path(CART).read_text().replace("alpha: 0.1", "alpha: {min: 0.05, max: 0.2, points: 3}")
    Path("range.yaml").write_text(text)
    outcome = run("solve", "range.yaml", "--plot")
    assert outcome.exit_code == 0
    assert files() == ["range.curve.png", "range.gains.json", "range.yaml"]
    assert Path("range.curve.png").read_bytes().startswith(PNG)
    points = json.loads(Path("range.gains.json").read_text())["search"]["points"]
    assert [p["status"] for p in points] == ["optimal"] * 3
    assert [p["gamma"] for p in points] == sorted(p["gamma"] for p in points)


def test_plot_without_a_range_says_why_there_is_no_curve():
    outcome = run("solve", CART, "--plot")
    assert outcome.exit_code == 0
    assert "no curve" in outcome.stderr
    assert files() == ["cart.gains.json"]


def test_a_solver_that_is_not_installed_is_a_mistake_of_one_line():
    outcome = run("solve", CART, "--solver", "nonesuch")
    assert_refused(outcome, "nonesuch")
    assert len(outcome.stderr.splitlines()) == 1
    assert files() == []


def test_only_solvers_that_can_solve_it_are_offered():
    outcome = run("solve", CART, "--solver", "HIGHS")
    assert_refused(outcome, "HIGHS: knows no semidefinite matrices; available: clarabel, ")
    offered = set(outcome.stderr.strip().removesuffix(" [OBS506]").partition("available: ")[2].split(", "))
    assert offered >= {"clarabel", "cvxopt"}
    assert not offered & {"highs", "osqp", "scipy", "glpk"}
    assert run("solve", CART, "--solver", "CVXOPT", "-q").exit_code == 0


def test_a_timeout_leaves_the_question_open_and_the_folder_empty(monkeypatch):
    monkeypatch.setattr("obsdesign.families.incremental.design.Designer.outcome", endless)
    outcome = run("solve", CART, "--timeout", "1")
    assert_refused(outcome, "not finished after 1 s", "--timeout", code=4)
    assert len(outcome.stderr.splitlines()) == 1
    assert files() == []


def test_a_timeout_does_not_outlive_its_command():
    before = signal.getsignal(signal.SIGALRM)
    run("check", CART, "--timeout", "30")
    assert signal.getsignal(signal.SIGALRM) is before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_an_infeasible_spec_is_answered_with_a_diagnosis_and_exit_code_3(bearing):
    Path("rigid.yaml").write_text(bearing.read_text().replace("[[0, -110]]", "0"))
    outcome = run("solve", "rigid.yaml")
    assert outcome.exit_code == 3
    content = json.loads(Path("rigid.gains.json").read_text())
    assert content["status"] == "infeasible"
    assert content["diagnosis"]["condition"] == "passivity"
    assert "(Cq + L2 C) Bf" in content["diagnosis"]["reason"]
    assert "certificate" not in content
    assert content["diagnosis"]["reason"] in outcome.stdout
    proved = run("verify", "rigid.gains.json")
    assert proved.exit_code == 0
    assert proved.stdout.splitlines()[-1].startswith("proved: Theorem 1 has no solution at alpha = 0.71")
    assert_refused(run("simulate", "rigid.gains.json"))
    assert files() == ["rigid.gains.json", "rigid.yaml"]


def test_a_verdict_of_infeasibility_is_believed_only_where_its_certificate_proves_it(bearing):
    Path("rigid.yaml").write_text(bearing.read_text().replace("[[0, -110]]", "0"))
    run("solve", "rigid.yaml")
    content = json.loads(Path("rigid.gains.json").read_text())
    certificate = content["diagnosis"]["certificate"]

    def verified(changed):
        diagnosis = content["diagnosis"] | {"certificate": certificate | changed}
        Path("changed.json").write_text(json.dumps(content | {"diagnosis": diagnosis}))
        return run("verify", "changed.json")

    assert verified({}).exit_code == 0
    name, rows = next((n, z) for n, z in certificate["multipliers"].items() if len(z) > 1)
    other = [[f"{x}" if (i, j) != (0, 0) else "12345/7" for j, x in enumerate(row)] for i, row in enumerate(rows)]
    assert_refused(
        verified({"multipliers": certificate["multipliers"] | {name: other}}), "not proved", code=4, quiet=False
    )
    assert_refused(verified({"multipliers": {}}), "not proved", code=4, quiet=False)
    assert_refused(verified({"alpha": "60"}), "alpha: 60 is not what the spec asks for, ")
    assert_refused(verified({"multipliers": [1]}), "expected an object")
    assert_refused(verified({"multipliers": {name: "no rows"}}), name)
    Path("bare.json").write_text(json.dumps(content | {"diagnosis": {"reason": "because"}}))
    assert_refused(run("verify", "bare.json"), "no certificate")


def test_an_undetectable_mode_is_named_by_solve_and_check_alike():
    Path("hidden.yaml").write_text(UNDETECTABLE)
    outcome = run("solve", "hidden.yaml", "-q")
    assert (outcome.exit_code, outcome.stdout) == (3, "")
    diagnosis = json.loads(Path("hidden.gains.json").read_text())["diagnosis"]
    assert diagnosis["mode"]["eigenvalue"] == [1.0, 0.0]
    checked = run("check", "hidden.yaml")
    assert checked.exit_code == 3
    assert "lambda = 1" in checked.stdout


def test_simulate_with_an_infeasible_spec_writes_no_samples():
    Path("hidden.yaml").write_text(UNDETECTABLE + "simulation: {horizon: 1}\n")
    outcome = run("simulate", "hidden.yaml")
    assert outcome.exit_code == 3
    assert outcome.stdout == ""
    assert "lambda = 1" in outcome.stderr
    assert "Traceback" not in outcome.stderr
    assert files() == ["hidden.yaml"]


def test_two_solves_give_the_same_bytes_but_for_the_clock():
    texts = []
    for seed, name in enumerate(("a.json", "b.json")):
        different = os.environ | {"PYTHONHASHSEED": str(seed)}
        assert process("solve", CART, "-o", name, "-q", env=different).returncode == 0
        content = json.loads(Path(name).read_text())
        stamps = f'"created": "{content["created"]}"', f'"time_s": {content["solver"]["time_s"]}'
        text = Path(name).read_text()
        assert all(text.count(stamp) == 1 for stamp in stamps)
        texts.append(text.replace(stamps[0], "").replace(stamps[1], ""))
    assert texts[0] == texts[1]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("C: [[1, 0]]", "C: [[0, 0]]"),
        ("bounds: {L1: 40}", "objective: {gamma: 1.0e+200}"),
        ("bounds: {L1: 40}", "objective: {gamma: 1.0e-200}"),
        ("bounds: {L1: 40}", "slack: 1.0e+300, bounds: {L1: 40}"),
        ("L1: 40", "L1: 1.0e-12"),
        ("L1: 40", "L1: 1.0e+200"),
        ("alpha: 0.1", "alpha: 1.0e+300"),
        ("alpha: 0.1", "alpha: 1.0e-300"),
    ],
)
def test_an_extreme_spec_is_answered_without_a_traceback(old, new):
    text = Path(CART).read_text().replace("disturbance: integrator\n", "")
    assert text.count(old) == 1
    assert_answered(text.replace(old, new))


def test_no_slack_at_a_limit_that_is_attained_is_not_infeasible():
    Path("tight.yaml").write_text(Path(CART).read_text().replace("bounds:", "slack: 0, bounds:"))
    assert run("solve", "tight.yaml", "-q").exit_code in {0, 4}


# The contract of the result file


def is_exact(value):
    """A finite JSON number, or a text p/q in lowest terms or not."""
    if isinstance(value, str):
        p, _, q = value.partition("/")
        return int(q or 1) > 0 and int(p) is not None
    return isinstance(value, int | float)


def shape(rows):
    """Rows and columns of a rectangular matrix."""
    assert rows
    assert len({len(row) for row in rows}) == 1
    return len(rows), len(rows[0])


def test_a_result_file_holds_what_its_format_promises(made):
    spec, gains = made / "cart.yaml", made / "cart.gains.json"
    content = json.loads(gains.read_text(), parse_constant=pytest.fail)
    assert content["obsdesign"] == 1
    assert content["name"] == "Cart"
    assert content["spec"]["text"] == spec.read_text()
    assert content["spec"]["sha256"] == hashlib.sha256(spec.read_bytes()).hexdigest()
    assert content["status"] == "certified"
    observer, guarantee, proof = content["observer"], content["guarantee"], content["certificate"]
    assert shape(observer["L1"]) == (3, 1)
    assert shape(observer["L2"]) == (1, 1)
    assert all(real < 0 for real, _ in observer["poles"])
    assert observer["fastest"] == pytest.approx(max(abs(complex(*p)) for p in observer["poles"]))
    assert set(observer["noise_gain"]) == {"position", "speed", "w1"}
    assert guarantee["gamma"] ** 2 == pytest.approx(guarantee["mu2"] / guarantee["mu1"], rel=1e-12)
    assert guarantee["limit"].keys() == {"gamma", "attained"}
    assert guarantee["limit"]["gamma"] <= guarantee["limit_bounded"]["gamma"] <= guarantee["gamma"]
    assert guarantee["gamma"] <= 1.05 * guarantee["limit_bounded"]["gamma"]
    assert "norm2(z)" in guarantee["statement"]
    assert proof["kind"] == "exact"
    assert shape(proof["P"]) == (3, 3)
    assert all(is_exact(entry) for row in proof["P"] for entry in row)
    assert all(is_exact(scale) for scale in proof["multipliers"].values())
    assert all(check["holds"] is True and check["name"] for check in proof["checks"])
    assert content["solver"]["name"] == "clarabel"
    assert content["solver"]["solves"] > 0
    assert {"version", "python", "cvxpy"} <= content["tool"].keys()
    assert content["created"].endswith("+00:00")


# simulate


def test_a_spec_is_solved_before_it_is_simulated():
    outcome = run("simulate", CART, "--json")
    assert outcome.exit_code == 0
    summary = json.loads(outcome.stdout)
    assert {"z_norm2", "v_norm2", "ratio", "gamma", "bounds", "final_error"} <= summary.keys()
    assert summary["bounds"]
    for bound in summary["bounds"]:
        assert bound.keys() >= {"name", "value", "bound", "holds"}
        assert bound["holds"] is True
        assert bound["value"] <= bound["bound"] * (1 + 1e-6)
    assert files() == ["cart.run.csv", "cart.run.png"]
    assert Path("cart.run.png").read_bytes().startswith(PNG)


@pytest.mark.usefixtures("solved", "sketched")
def test_samples_have_the_columns_of_the_format():
    assert run("simulate", "cart.gains.json", "-o", "a.csv", "--plot", "a.png", "-q").exit_code == 0
    lines = Path("a.csv").read_text().splitlines()
    assert lines[0] == "t,position,speed,hat_position,hat_speed,w1,hat_w1,y1"
    rows = [[float(x) for x in line.split(",")] for line in lines[1:]]
    assert len(rows) == 21
    assert all(len(row) == 8 for row in rows)
    assert rows[0] == [0, 1, 0, 0, 0, 0, 0, 1]
    assert rows[-1][0] == 2
    assert all(row[7] == row[1] for row in rows)
    assert files() == ["a.csv", "a.png", "cart.gains.json"]


@pytest.mark.usefixtures("solved", "sketched")
def test_a_dash_writes_the_samples_to_standard_output_and_nothing_else_there():
    outcome = run("simulate", "cart.gains.json", "-o", "-")
    assert outcome.exit_code == 0
    assert outcome.stdout.startswith("t,position,")
    assert len(outcome.stdout.splitlines()) == 22
    assert "-" not in files()


@pytest.mark.usefixtures("solved", "sketched")
def test_gains_beside_a_spec_give_the_same_run_as_the_gains_alone():
    assert run("simulate", CART, "--gains", "cart.gains.json", "-o", "a.csv", "-q").exit_code == 0
    assert run("simulate", "cart.gains.json", "-o", "b.csv", "-q").exit_code == 0
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()


@pytest.mark.usefixtures("solved")
def test_gains_of_another_spec_are_refused():
    Path("other.yaml").write_text(Path(CART).read_text().replace("0.2]", "0.21]"))
    assert_refused(run("simulate", "other.yaml", "--gains", "cart.gains.json"), "sha256", "other.yaml")
    assert_refused(run("simulate", "cart.gains.json", "--gains", "cart.gains.json"), "--gains")
    assert files() == ["cart.gains.json", "other.yaml"]


@pytest.mark.usefixtures("solved", "sketched")
def test_without_an_argument_the_newest_certified_gains_are_simulated():
    for age, name, text in (
        (300, "old.gains.json", Path("cart.gains.json").read_text()),
        (20, "lost.gains.json", '{"obsdesign": 1, "status": "infeasible"}'),
        (10, "broken.gains.json", "{"),
        (5, "list.gains.json", "[1]"),
        (3, "large.gains.json", '{"obsdesign": 1, "status": "certified"}'),
    ):
        Path(name).write_text(text)
        os.utime(name, (time.time() - age,) * 2)
    os.truncate("large.gains.json", 2**40)  # of holes, which no memory would hold
    os.utime("large.gains.json", (time.time() - 3,) * 2)
    os.utime("cart.gains.json", (time.time() - 100,) * 2)
    outcome = run("simulate")
    assert outcome.exit_code == 0
    assert outcome.stderr == "simulating cart.gains.json\n"
    assert {"cart.run.csv", "cart.run.png"} <= set(files())
    assert not set(files()) & {"old.run.csv", "lost.run.csv", "broken.run.csv"}


def test_without_an_argument_and_without_gains_simulate_asks_for_one():
    assert_refused(run("simulate"), "gains.json")
    assert files() == []


@pytest.mark.usefixtures("solved", "sketched")
def test_gains_whose_claim_is_not_proved_run_without_a_guarantee():
    content = json.loads(Path("cart.gains.json").read_text())
    content["observer"]["L1"][0][0] += 1
    Path("mine.gains.json").write_text(json.dumps(content))
    outcome = run("simulate", "mine.gains.json")
    assert outcome.exit_code == 0
    assert "no guarantee" in outcome.stdout


# check and verify


def test_check_finds_nothing_against_the_bearing(bearing):
    outcome = run("check", bearing)
    assert outcome.exit_code == 0
    assert "FAIL" not in outcome.stdout
    report = json.loads(run("check", bearing, "--json").stdout)
    assert report["possible"] is True
    assert any(f["decides"] for f in report["findings"])
    assert run("check", bearing, "--quiet").stdout == ""


def test_check_needs_no_nonlinearity():
    Path("linear.yaml").write_text(UNDETECTABLE.replace("[[0, 1]]", "[[1, 0]]"))
    assert run("check", "linear.yaml").exit_code == 0


@pytest.mark.usefixtures("solved")
def test_verify_proves_what_solve_wrote():
    outcome = run("verify", "cart.gains.json")
    assert outcome.exit_code == 0
    assert outcome.stdout.splitlines()[-1].startswith("proved: gamma ")
    answer = json.loads(run("verify", "cart.gains.json", CART, "--json").stdout)
    assert answer["proved"] is True
    assert {check["name"] for check in answer["checks"]} >= {"P > 0", "alpha > 0"}
    assert run("verify", "cart.gains.json", "-q").stdout == ""


def test_the_schema_is_json():
    outcome = run("schema")
    assert outcome.exit_code == 0
    assert "properties" in json.loads(outcome.stdout)


# A user's mistakes


@pytest.mark.parametrize("command", ["solve", "check", "simulate", "verify"])
@pytest.mark.parametrize("wrong", ["missing", "folder", "binary", "empty", "key"])
def test_a_file_that_is_no_input_is_refused_on_standard_error(command, wrong):
    name = f"{wrong}.json" if command == "verify" else f"{wrong}.yaml"
    if wrong == "folder":
        Path(name).mkdir()
    elif wrong != "missing":
        content = {"binary": bytes(range(256)), "empty": b"", "key": b"obsdesign: 1\nsytem: {A: 1}\n"}[wrong]
        Path(name).write_bytes(content)
    before = files()
    outcome = run(command, name)
    assert_refused(outcome, name)
    assert files() == before


@pytest.mark.parametrize("target", ["no/such/folder/g.json", ".", "/proc/g.json"])
def test_a_place_that_cannot_be_written_is_refused_by_name(target):
    outcome = run("solve", CART, "-o", target)
    assert_refused(outcome, target, "cannot be written")
    assert files() == []


@pytest.mark.parametrize("option", ["-o", "--plot"])
@pytest.mark.usefixtures("solved", "sketched")
def test_a_run_that_cannot_be_written_is_refused_by_name(option):
    outcome = run("simulate", "cart.gains.json", option, "no/such/folder/run")
    assert_refused(outcome, "no/such/folder/run")
    assert files() == ["cart.gains.json"]


@pytest.mark.parametrize(
    "arguments",
    [["solve"], ["nonesuch"], ["solve", CART, "--nonesuch"], ["solve", CART, "--timeout", "soon"], ["verify"]],
)
def test_a_wrong_command_line_is_refused(arguments):
    assert_refused(run(*arguments))
    assert files() == []


def test_a_name_that_is_no_text_is_refused():
    name = os.fsdecode(b"\xff.yaml")
    shutil.copy(CART, name)
    outcome = process("solve", name)
    assert outcome.returncode in {0, 2}, outcome.stderr
    assert "Traceback" not in outcome.stderr


@pytest.mark.parametrize("seconds", ["0", "-1", "nan", "inf", "1e300"])
def test_a_timeout_is_a_positive_number_of_seconds(seconds):
    for command in (["check", CART], ["batch", "."]):
        assert_refused(run(*command, "--timeout", seconds), "timeout")


def test_every_mistake_of_a_spec_has_its_line():
    Path("wrong.yaml").write_text(
        Path(CART).read_text().replace("points: 21", "points: -1").replace("L1: 40", "L9: 40")
    )
    outcome = run("solve", "wrong.yaml")
    assert_refused(outcome)
    lines = outcome.stderr.splitlines()
    assert len(lines) == 2
    assert all(line.startswith("wrong.yaml:1") for line in lines)
    assert files() == ["wrong.yaml"]


@pytest.mark.parametrize(
    ("observer", "place"),
    [
        (
            "type: l2\n  alpha: 0.1\n  objective: min-gamma",
            "5:14: observer.objective: the least gamma at alpha = 0.1 is 0",
        ),
        ("type: linf\n  alpha: 0.1", "2:1: observer.objective: the least gamma at alpha = 0.1 is 0"),
    ],
)
def test_what_a_design_refuses_has_its_place_as_well(observer, place):
    Path("quiet.yaml").write_text(
        f"system: {{A: [[-1, 1], [0, -2]], B: [1, 1], C: [1, 0]}}\nobserver:\n  {observer}\nobsdesign: 1\n"
    )
    outcome = run("solve", "quiet.yaml")
    assert_refused(outcome, f"quiet.yaml:{place}")
    assert not any("observer.objective" in line for line in outcome.stderr.splitlines()[1:])


@pytest.mark.parametrize(
    "observer", ["type: l2\n  alpha: 0.1", "type: linf\n  alpha: 0.1", "type: sporadic\n  T1: 0.1\n  T2: 0.2"]
)
def test_without_a_disturbance_a_design_is_for_feasibility(observer):
    Path("quiet.yaml").write_text(
        f"obsdesign: 1\nsystem: {{A: [[-1, 1], [0, -2]], C: [1, 0]}}\nobserver:\n  {observer}\n"
    )
    outcome = run("solve", "quiet.yaml")
    assert outcome.exit_code == 0
    assert "no disturbance acts on this plant" in Path("quiet.gains.json").read_text()
    assert run("verify", "quiet.gains.json").exit_code == 0


def test_what_is_undecided_names_its_file(monkeypatch):
    monkeypatch.setattr(
        "obsdesign.lmi.solve.call", lambda _: lambda program: (Ending.FAILED, np.zeros(len(program.cost)), ())
    )
    assert_refused(run("solve", CART), f"{CART}: no gain with |L1| <= 40 was found at alpha = 0.1; ", code=4)


# Interrupts


@pytest.mark.parametrize("where", ["obsdesign.work.solve", "obsdesign.disk.os.replace"])
def test_an_interrupt_exits_with_130_and_leaves_nothing(monkeypatch, where):
    monkeypatch.setattr(where, interrupted)
    assert_refused(run("solve", CART), "interrupted", code=130)
    assert files() == []


def stopped_at(fraction, doing):
    """A design that the user stops when it is so far."""

    def outcome(spec, solver, report):  # noqa: ARG001
        report(fraction, doing)
        raise KeyboardInterrupt

    return outcome


def stopped(_, report):
    """A run that the user stops half-way."""
    report(0.5)
    raise KeyboardInterrupt


def test_an_interrupt_says_how_far_it_came_what_is_kept_and_how_to_go_on(monkeypatch):
    def told(*arguments):
        outcome = run(*arguments)
        assert (outcome.exit_code, outcome.stdout) == (130, ""), outcome.output
        return outcome.stderr

    begun = f"interrupted; 40% done (alpha = 2); nothing of {CART} is written, and the same command begins it anew"
    scanned = "observer.alpha={min: 0.1, max: 1}"
    with monkeypatch.context() as patched:
        patched.setattr("obsdesign.work.solve", stopped_at(0.4, "alpha = 2"))
        assert told("solve", CART) == f"{begun}\n"
        assert told("solve", CART, "--set", scanned) == f"{begun}; with --set observer.alpha.points=5 it ends sooner\n"
        assert told("solve", CART, "other.yaml") == f"{begun}; 0 of 2 are done, and what they wrote is kept\n"
    monkeypatch.setattr("obsdesign.design.Design.simulate", stopped)
    kept = "cart.gains.json is kept; `obsdesign simulate` runs it"
    assert told("solve", CART, "--simulate") == f"interrupted; 50% done (simulation); {kept}\n"
    assert files() == ["cart.gains.json"]
    left = "no samples and no figure are written"
    assert told("simulate", "cart.gains.json") == f"interrupted; 50% done (simulation); {left}\n"
    assert files() == ["cart.gains.json"]


@pytest.mark.usefixtures("solved")
def test_an_interrupted_figure_leaves_the_samples_whole(monkeypatch):
    monkeypatch.setattr("obsdesign.plot.run_figure", interrupted)
    assert_refused(run("simulate", "cart.gains.json"), "interrupted", code=130)
    assert not [name for name in files() if name.startswith(".")]


# What a command costs

LOADED = """
import sys
from obsdesign.cli import app
try:
    app()
finally:
    print(*sys.modules, file=sys.stderr)
"""
RUNS = {"obsdesign.simulate", "obsdesign.stepping", "obsdesign.coq.kernel", "obsdesign.coq.theorem"}


@pytest.mark.parametrize(
    ("arguments", "without", "most"),
    [
        (["--help"], {"numpy", "scipy", "cvxpy", "clarabel", "matplotlib", "pydantic", "flint", "yaml"}, 60),
        (
            ["verify", "cart.gains.json"],
            RUNS | {"scipy", "clarabel", "matplotlib", "numpy.ma", "importlib.metadata"},
            190,
        ),
        (["solve", CART, "-q"], RUNS | {"cvxpy", "matplotlib", "scipy.optimize", "scipy.sparse"}, 250),
        (["solve", CART, "--set", "observer.alfa=1"], RUNS | {"scipy", "clarabel", "numpy.ma"}, 180),
    ],
)
@pytest.mark.usefixtures("solved")
def test_a_command_imports_only_what_it_needs(arguments, without, most):
    """`most`: modules of our own, each of which costs about half a millisecond."""
    outcome = process(*arguments, code=LOADED)
    loaded = set(outcome.stderr.splitlines()[-1].split())
    assert outcome.returncode == (2 if "--set" in arguments else 0)
    assert "typer" in loaded
    assert not loaded & without
    assert len([name for name in loaded if name.startswith("obsdesign")]) <= most


def test_importing_the_engine_imports_no_solver():
    outcome = process(code="import sys, obsdesign.lmi.solve; print(*sys.modules)")
    loaded = set(outcome.stdout.split())
    assert "obsdesign.lmi.solve" in loaded
    assert not loaded & {"clarabel", "cvxpy", "scipy", "matplotlib"}


def test_the_program_runs_as_a_module():
    outcome = subprocess.run(
        [sys.executable, "-m", "obsdesign", "solve", "absent.yaml"], capture_output=True, text=True, check=False
    )
    assert outcome.returncode == 2
    assert outcome.stdout == ""
    assert outcome.stderr.startswith("absent.yaml: ")
    assert len(outcome.stderr.splitlines()) == 1
