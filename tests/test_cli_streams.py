"""Streams, signals and odd outputs: what a shell, a pipe and an impatient user do to a command."""

import errno
import json
import os
import random
import signal
import stat
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from support.commands import begin, files, hearing, interrupted, run

import obsdesign.__main__ as entry
from obsdesign.errors import TimeLimitError
from obsdesign.watch import limited

COMMAND = [sys.executable, "-m", "obsdesign"]
SAFE = {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(Path(entry.__file__).parent.parent)}


def started(*arguments, **options):
    """A command in a process of its own, which is under way."""
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return begin([*COMMAND, *map(str, arguments)], **{"env": os.environ | SAFE} | streams | options)


def ended(*arguments, **options):
    """Exit code and what a command said."""
    process = started(*arguments, **options)
    out, err = process.communicate(timeout=60)
    assert "Traceback" not in (err or "")
    return process.returncode, out, err


@pytest.fixture
def spec(here, made):
    """The spec of the cart in the working folder."""
    (here / "cart.yaml").write_bytes((made / "cart.yaml").read_bytes())
    return "cart.yaml"


@pytest.fixture
def gains(here, made):
    """Its gains."""
    (here / "cart.gains.json").write_bytes((made / "cart.gains.json").read_bytes())
    return "cart.gains.json"


# Outputs that are no regular files


def test_a_link_is_followed(spec):
    Path("real.json").write_text("")
    Path("link.json").symlink_to("real.json")
    Path("new.json").symlink_to("absent.json")
    for name in ("link.json", "new.json"):
        assert run("solve", spec, "-o", name, "-q").exit_code == 0
        assert Path(name).is_symlink()
        assert json.loads(Path(name).read_text())["status"] == "certified"
    assert files() == ["absent.json", "cart.yaml", "link.json", "new.json", "real.json"]


def test_a_pipe_is_written_through(spec):
    os.mkfifo("pipe")
    read = []
    reader = threading.Thread(target=lambda: read.append(Path("pipe").read_text()))
    reader.start()
    assert run("solve", spec, "-o", "pipe", "-q").exit_code == 0
    reader.join(10)
    assert json.loads(read[0])["status"] == "certified"
    assert stat.S_ISFIFO(Path("pipe").stat().st_mode)


@pytest.mark.usefixtures("sketched")
def test_a_device_is_written_through_and_stays_one(gains):
    for arguments in (["-o", "/dev/null"], ["--plot", "/dev/null"]):
        assert run("simulate", gains, *arguments, "-q").exit_code == 0
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


def test_what_is_drawn_beside_a_device_is_drawn_here(spec):
    text = Path(spec).read_text().replace("alpha: 0.1", "alpha: {min: 0.05, max: 0.2, points: 3}")
    Path("range.yaml").write_text(text)
    assert run("solve", "range.yaml", "-o", "/dev/null", "--plot", "-q").exit_code == 0
    assert "range.curve.png" in files()


def test_a_link_to_itself_cannot_be_written(spec):
    Path("loop").symlink_to("loop")
    outcome = run("solve", spec, "-o", "loop")
    said = "loop: cannot be written: Too many levels of symbolic links [OBS902]\n"
    assert (outcome.exit_code, outcome.stderr) == (2, said)


# Standard streams


@pytest.mark.parametrize("arguments", [["--help"], ["solve", "--help"], ["schema"], ["verify", "cart.gains.json"]])
@pytest.mark.usefixtures("gains")
def test_output_that_cannot_be_written_is_one_line_and_a_failure(arguments):
    with Path("/dev/full").open("w") as full:
        code, _, err = ended(*arguments, stdout=full)
    said = "standard output cannot be written: No space left on device [OBS906]\n"
    assert (code, err) == (1, said)


def test_a_closed_output_is_no_success(gains):
    code, out, err = ended("verify", gains, preexec_fn=lambda: os.close(1))
    said = "standard output cannot be written: it is closed [OBS906]\n"
    assert (code, out, err) == (1, "", said)


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["verify", "cart.gains.json", "-q"], 0),
        (["verify", "cart.gains.json"], 0),
        (["verify", "absent.json"], 2),
        (["nonesuch"], 2),
        (["verify", "huge.json", "--timeout", "0.3"], 4),
    ],
)
def test_a_stream_of_errors_that_cannot_be_written_leaves_the_exit_code_as_it_is(gains, arguments, code):
    if "huge.json" in arguments:
        Path("huge.json").write_text(huge(gains, 49_900))
    found, out, err = ended(*arguments, preexec_fn=lambda: os.close(2))
    assert (found, err) == (code, "")
    assert out.startswith("holds") == (arguments == ["verify", "cart.gains.json"])
    with Path("/dev/full").open("w") as full:
        assert ended(*arguments, stderr=full)[:2] == (code, out)


@pytest.mark.usefixtures("spec")
def test_a_batch_goes_on_where_nobody_can_be_told():
    Path("wrong.yaml").write_text("obsdesign: 1")
    with Path("/dev/full").open("w") as full:
        code, out, _ = ended("batch", ".", "--jobs", "1", stderr=full)
    assert code == 2
    assert [line.split()[:2] for line in out.splitlines()[:2]] == [["ok", "certified"], ["FAIL", "invalid"]]


def test_a_reader_that_left_is_one_line_and_a_failure():
    process = started("schema")
    process.stdout.close()
    assert process.wait(60) == 1
    with process.stderr as said:
        assert said.read() == "standard output cannot be written: Broken pipe [OBS906]\n"


def test_standard_input_is_read_for_a_dash(spec, gains):
    with Path(spec).open() as text:
        code, out, _ = ended("solve", "-", "-o", "-", stdin=text)
    assert code == 0
    assert json.loads(out)["spec"]["path"] == "-"
    with Path(gains).open() as text:
        code, out, _ = ended("verify", "-", stdin=text)
    assert (code, out.splitlines()[-1][:7]) == (0, "proved:")
    with Path(spec).open() as text:
        assert ended("solve", "-", "-q", stdin=text)[0] == 0
    assert "stdin.gains.json" in files()
    code, _, err = ended("solve", "-", stdin=subprocess.DEVNULL)
    assert (code, err) == (2, "-: is empty; a spec begins with `obsdesign: 1` [OBS104]\n")


# Interrupts and limits of time


@pytest.mark.parametrize("moment", [0.0, 0.03, 0.08, 0.15, 0.25, 0.4, 0.6])
def test_an_interrupt_at_any_moment_is_130_and_leaves_nothing_half_written(spec, moment):
    process = started("solve", spec, "--simulate", "-q")
    while not begun(process.pid):
        assert process.poll() is None
    time.sleep(moment)
    over = process.poll() is not None
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == (0 if over else 130)
    assert "Traceback" not in err
    assert not [name for name in files() if name.startswith(".")]


def begun(pid):
    """Whether a process has its child, and so hears an interrupt itself; before, Python is still starting."""
    return bool(Path(f"/proc/{pid}/task/{pid}/children").read_text())


def huge(gains, digits):
    """The same claim with a P whose entries are quotients of very long numbers."""
    content, draw = json.loads(Path(gains).read_text()), random.Random(1)
    P = content["certificate"]["P"]
    for i, row in enumerate(P):
        for j in range(i, len(row)):
            number = f"{draw.randrange(10**8)}{'7' * digits}/{draw.randrange(10**8)}{'9' * digits}"
            P[i][j] = P[j][i] = number
    return json.dumps(content)


def test_a_limit_of_time_is_kept_while_compiled_code_computes(gains):
    Path("huge.json").write_text(huge(gains, 49_900))
    began = time.monotonic()
    code, out, err = ended("verify", "huge.json", "--timeout", "0.5")
    assert (code, out) == (4, "")
    assert err.endswith("not finished after 0.5 s; --timeout allows more [OBS905]\n")
    assert time.monotonic() - began < 0.5 + 2 + 2  # and the time to start a process on a busy machine


def test_a_limit_of_time_is_told_whatever_it_became_on_its_way():
    class Slow:
        def __set_name__(self, owner, name):
            time.sleep(5)

    with pytest.raises(TimeLimitError, match=r"not finished after 0\.01 s"), limited(0.01):
        type("Made", (), {"attribute": Slow()})  # a RuntimeError of Python 3.11, where a class has failed
    with pytest.raises(ZeroDivisionError), limited(60):
        1 / 0  # noqa: B018


def unheard():
    """Hear interrupts where nobody can be told of them."""
    hearing()
    os.close(2)


@pytest.mark.parametrize(("heard", "said"), [(hearing, "interrupted\n"), (unheard, "")])
def test_a_child_that_hears_nothing_is_ended(heard, said):
    deaf = (
        "import signal,time; from obsdesign import watch\n"
        "def command():\n signal.signal(signal.SIGINT, signal.SIG_IGN); print('on', flush=True); time.sleep(60)\n"
        "raise SystemExit(watch.watched(command))"
    )
    process = begin(
        [sys.executable, "-c", deaf],
        env=os.environ | SAFE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=heard,
    )
    assert process.stdout.readline() == "on\n"
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert (process.returncode, err) == (130, said)


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8"])
def test_what_an_encoding_has_no_character_for_is_spelled_out(spec, encoding):
    text, name = Path(spec).read_text(), "Wózek ≤ \U0001f600"
    Path(spec).write_text(text.replace("name: Cart", f"name: {name}"))
    streams = {"env": os.environ | SAFE | {"PYTHONIOENCODING": encoding}, "encoding": encoding}
    code, out, _ = ended("solve", spec, "--json", **streams)
    assert (code, json.loads(out)["name"]) == (0, name)
    code, out, _ = ended("solve", spec, "-o", os.fsdecode(b"caf\xe9.json"), **streams)
    assert (code, name.encode(encoding, "ignore").decode(encoding)[:2] in out, "caf\\udce9.json" in out) == (
        0,
        True,
        True,
    )
    assert ended("explain", "algebraic", **streams)[0] == 0
    assert ended("solve", "--help", **streams)[0] == 0


@pytest.mark.parametrize(
    ("named", "said"), [([], ""), (["gone.txt"], "gone.txt: "), ([b"gone"], "gone: "), ([3], "")], ids=str
)
def test_what_the_system_refuses_is_not_blamed_on_an_output(gains, monkeypatch, named, said):
    def refuse(*_, **__):
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE), *named)

    monkeypatch.setattr("obsdesign.files.ResultFile.open", refuse)
    outcome = run("verify", gains, "--json")
    assert (outcome.exit_code, outcome.stderr) == (2, f"{said}the system refuses: Too many open files [OBS915]\n")
    assert json.loads(outcome.stdout)["problems"][0]["id"] == "OBS915"


# Exit codes and what stays behind


def test_json_is_printed_however_quiet(spec, gains):
    for arguments in (["solve", spec], ["verify", gains], ["check", spec], ["simulate", gains]):
        outcome = run(*arguments, "--json", "-q")
        assert outcome.exit_code == 0
        assert isinstance(json.loads(outcome.stdout), dict)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("simulation: {", "description: {", "simulation"),
        ("type: sin,", "type: {lipschitz: 1},", "has no `f`"),
        ("w: [1 - exp(-t)]", "w: [log(t)]", "no finite value"),
    ],
)
def test_a_run_that_is_refused_leaves_no_gains(spec, old, new, said):
    text = Path(spec).read_text()
    assert text.count(old) == 1
    changed = text.replace(old, new)
    if new.startswith("description"):
        changed = changed[: changed.index("description")]
    Path(spec).write_text(changed)
    outcome = run("solve", spec, "--simulate")
    assert outcome.exit_code == 2
    assert len(outcome.stderr.splitlines()) == 1
    assert outcome.stderr.startswith(f"{spec}:")
    assert said in outcome.stderr
    assert outcome.stdout == ""
    assert files() == [spec]


def test_a_run_that_is_interrupted_leaves_the_gains(spec, monkeypatch):
    monkeypatch.setattr("obsdesign.simulate.run", interrupted)
    assert run("solve", spec, "--simulate").exit_code == 130
    assert files() == ["cart.gains.json", "cart.yaml"]


# What a spec expects of its result


def test_solve_holds_a_spec_against_what_it_expects(spec):
    right = "expect: {status: certified, limit.gamma: {verified: 0.6, rtol: 10}, simulation.z_norm2: 1e9}\n"
    wrong = right.replace("rtol: 10", "rtol: 1e-9").replace("certified, ", "infeasible, ")
    text = Path(spec).read_text()
    Path(spec).write_text(text + right)
    assert run("solve", spec, "-q").stderr == ""
    Path(spec).write_text(text + wrong)
    outcome = run("solve", spec, "--simulate")
    assert outcome.exit_code == 0
    lines = outcome.stderr.splitlines()
    assert [line.split(": ")[1] for line in lines] == [
        *("expect.status", "expect.limit.gamma", "expect.simulation.z_norm2"),
    ]
    assert lines[0] == f"{spec}: expect.status: expected infeasible, found certified [OBS617]"
    Path(spec).write_text(text + right.replace("certified, ", "certified, nothing.here: 3, "))
    outcome = run("solve", spec)
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert "expect.nothing.here: " in outcome.stderr


# A file in the place of another


def test_a_result_is_no_spec_and_a_spec_is_no_result(spec, gains):
    for command in ("solve", "check", "lipschitz"):
        outcome = run(command, gains)
        assert (outcome.exit_code, len(outcome.stderr.splitlines())) == (2, 1)
        assert "is a result of `solve`, not a spec" in outcome.stderr
    outcome = run("verify", spec)
    assert (outcome.exit_code, len(outcome.stderr.splitlines())) == (2, 1)
    assert "is a spec; `obsdesign solve` makes of it" in outcome.stderr


@pytest.mark.parametrize("key", ["gamma", "obsdesign", "holds"])
def test_a_key_that_is_given_twice_is_refused(gains, key):
    text = Path(gains).read_text()
    first = text.index(f'"{key}":')
    Path("twice.json").write_text(text[:first] + f'"{key}": 1e-9, ' + text[first:])
    outcome = run("verify", "twice.json")
    assert (outcome.exit_code, len(outcome.stderr.splitlines())) == (2, 1)
    assert f"{key}: is given twice" in outcome.stderr


# Where a run begins


def test_an_estimate_that_begins_outside_the_region_is_told_before_the_run(spec):
    text = Path(spec).read_text().replace("type: sin,", "type: sin, region: {q: [0.5, 3]},")
    Path(spec).write_text(text)
    outcome = run("simulate", spec)
    assert outcome.exit_code == 0
    first = outcome.stderr.splitlines()[0]
    assert first == (
        f"{spec}:13:1: simulation.xhat0: it sets q1 of nonlinearities[0] to 0, outside its region [0.5, 3], "
        "where nothing is proved; give an xhat0 within it [OBS806]"
    )
    Path(spec).write_text(text.replace("x0: [1, 0],", "x0: [1, 0], xhat0: [0.6, 0],"))
    assert "xhat0" not in run("simulate", spec).stderr


@pytest.mark.usefixtures("here")
def test_no_output_replaces_what_is_read():
    """A file that is read is not written over, whichever command and option."""
    system = "system: {A: [[-1]], B: [[1]], C: [[1]]}"
    observer = "observer: {type: l2, alpha: 0.1, bounds: {L1: 10}}"
    trial = "simulation: {horizon: 1, x0: [1], w: [0]}"
    Path("cart.yaml").write_text(f"obsdesign: 1\n{system}\n{observer}\n{trial}\n")
    assert run("solve", "cart.yaml", "-q").exit_code == 0
    for kind in ("csv", "png", "html"):
        Path(f"link.{kind}").symlink_to("cart.gains.json")
    Path("link.json").symlink_to("cart.yaml")
    before = {path: path.read_bytes() for path in Path().iterdir()}
    for command in (
        ("solve", "cart.yaml", "-o", "link.json"),
        ("simulate", "cart.gains.json", "-o", "link.csv"),
        ("simulate", "cart.gains.json", "--plot", "./link.png"),
        ("simulate", "cart.yaml", "--gains", "cart.gains.json", "-o", "link.csv"),
        ("report", "cart.gains.json", "-o", "link.html"),
        ("compare", "cart.gains.json", "-o", "link.png"),
        ("batch", "cart.yaml", "--format", "json", "--output-file", "cart.yaml"),
    ):
        outcome = run(*command)
        assert outcome.exit_code == 2, command
        assert "is read here, and would be overwritten; name another [OBS904]" in outcome.stderr
    assert before == {path: path.read_bytes() for path in Path().iterdir()}


@pytest.mark.usefixtures("sketched")
def test_samples_and_figure_are_not_one_file_and_no_figure_is_printed(gains):
    Path("link").symlink_to("same")
    for other in ("same", "./same", str(Path("same").absolute()), "link"):
        outcome = run("simulate", gains, "-o", "same", "--plot", other)
        said = f"{other}: samples and figure cannot be one file; name another for one of them [OBS904]\n"
        assert (outcome.exit_code, outcome.stdout, outcome.stderr) == (2, "", said)
        assert not Path("same").exists()
    outcome = run("simulate", gains, "-q", "-o", "-", "--plot", "-")
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert outcome.stderr == "--plot -: a figure is not printed; name a file [OBS904]\n"
    assert run("simulate", gains, "-q", "-o", "/dev/null", "--plot", "/dev/null").exit_code == 0


@pytest.mark.usefixtures("sketched")
def test_no_output_replaces_a_file_of_another_kind(spec, gains):
    """A spec, a result, samples, a figure or a page that is there gives way only to one of its kind, empty or not."""
    assert run("simulate", gains, "-o", "b.csv", "--plot", "b.png", "-q").exit_code == 0
    assert run("report", gains, "-o", "b.html", "-q").exit_code == 0
    Path("b.gains.json").write_bytes(Path(gains).read_bytes())
    for name in ("a.yaml", "a.yml", "c.json", "c.csv", "c.png", "c.html"):
        Path(name).write_text("")
    names = [name for name in files() if name[:2] in ("a.", "b.", "c.")]
    kinds = {name: Path(name).read_bytes() for name in names}
    Path("link.txt").symlink_to("a.yaml")
    commands = {
        ("solve", spec, "-o"): {".json"},
        ("simulate", gains, "-o"): {".csv"},
        ("simulate", gains, "--plot"): {".png"},
        ("report", gains, "-o"): {".html"},
        ("compare", gains, "--seeds", "1", "-o"): {".png"},
        ("batch", spec, "--jobs", "1", "--format", "junit", "--output-file"): set(),
    }
    for command, own in commands.items():
        for name in (*kinds, "link.txt"):
            if Path(name).suffix not in own:
                outcome = run(*command, name)
                assert outcome.exit_code == 2, (command, name)
                assert outcome.stderr.startswith(f"{name}: ")
    for name, option in (("cart.run.png", "--simulate"), ("cart.run.csv", "--simulate"), ("cart.curve.png", "--plot")):
        Path(name).symlink_to("a.yaml")
        outcome = run("solve", spec, option)
        assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1)
        assert outcome.stderr.startswith(f"{name}: is there already, and holds no ")
        Path(name).unlink()
    assert {name: Path(name).read_bytes() for name in kinds} == kinds
    for command, own in commands.items():
        new = f"new-{command[0]}{command[-1]}"
        for name in (new, new, *(name for name in kinds if Path(name).suffix in own)):
            assert run(*command, name, "-q").exit_code == 0, (command, name)
