"""The export to C: it compiles without a warning, runs under sanitizers, and estimates what the simulator does."""

import ctypes
import json
import re
import shutil
import subprocess
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.commands import run
from support.shipped import SPECS, on, solved

import obsdesign as od
from obsdesign.errors import UsageError
from obsdesign.exports import c
from obsdesign.exports.c_language import RESERVED
from obsdesign.exports.code import identifiers
from obsdesign.exports.subject import identifier
from obsdesign.reading import loads
from obsdesign.simulate.stepped import passage

STRICT = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
SANITIZED = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")

OBSERVERS = on(  # spec, period, method: every family, time and method, loops, jumps and starts that depend on y
    ("pendulum-embedded", None, None),
    ("noisy-output", "1.0e-2", "exact"),
    ("corless2019-magnetic-bearing", "5.0e-6", "euler"),
    ("discrete-feedthrough", None, None),
    ("discrete-battery", None, None),
    ("lost-packets", "1.0e-2", "exact"),
    ("ferrante2019-oscillator-gap", "1.0e-2", "rk4"),
    ("cuk-kkl-pebo", "1.0e-5", "rk4"),
    ("cuk-immersion", "1.0e-6", "rk4"),
    ("saturated-spring", "1.0e-3", "rk4"),
    ("abbaszadeh2010-flexible-joint", "1.0e-3", "rk4"),
)


def design_of(name):
    """Design of a shipped spec."""
    return solved(name)[1]


def compiled(folder, ID, *options):
    """The self-test, compiled."""
    program = folder / "selftest"
    files = [folder / f"{ID}.c", folder / f"{ID}_selftest.c"]
    made = subprocess.run(
        [*STRICT, *options, *files, "-o", program, "-lm"], capture_output=True, text=True, check=False
    )
    assert made.returncode == 0, made.stderr
    return program


@pytest.mark.parametrize("single", [False, True], ids=["double", "float"])
@pytest.mark.parametrize(("name", "period", "method"), OBSERVERS)
def test_code_agrees_with_the_simulator(name, period, method, single, tmp_path):
    made = od.export(design_of(name), "c", period=period, method=method, single=single)
    made.write(tmp_path)
    program = compiled(tmp_path, made.subject.name, *SANITIZED)
    outcome = subprocess.run([program], capture_output=True, text=True, check=False)
    assert outcome.returncode == 0, outcome.stdout + outcome.stderr


@pytest.mark.parametrize("dialect", ["gnu99", "gnu17"])
def test_code_compiles_where_the_library_declares_more_names(dialect, tmp_path):
    od.export(design_of("discrete-feedthrough"), "c").write(tmp_path)
    command = ["gcc", f"-std={dialect}", "-Wall", "-Wextra", "-Werror", "-c", "discrete_feedthrough.c"]
    subprocess.run(command, cwd=tmp_path, check=True)


def test_a_self_test_fails_where_a_gain_is_another(tmp_path):
    made = od.export(design_of("pendulum-embedded"), "c")
    made.write(tmp_path)
    source = tmp_path / "pendulum_embedded.c"
    text = source.read_text()
    gain = text.split("rate1_hat_angle = hat_speed - ")[1].split("*")[0]
    source.write_text(text.replace(gain, str(float(gain) * 1.001)))
    assert subprocess.run([compiled(tmp_path, "pendulum_embedded")], check=False, capture_output=True).returncode == 1


class Library:
    """An exported observer, loaded."""

    def __init__(self, made, folder):
        made.write(folder)
        self.subject, ID = made.subject, made.subject.name
        path = folder / "lib.so"
        subprocess.run([*STRICT, "-O2", "-shared", "-fPIC", folder / f"{ID}.c", "-o", path, "-lm"], check=True)
        self.code = ctypes.CDLL(str(path))
        self.state = (ctypes.c_double * (len(made.subject.implemented.states) + 8))()
        self.names = tuple(
            name.decode() for name in (ctypes.c_char_p * len(made.subject.estimates)).in_dll(self.code, f"{ID}_names")
        )

    def __call__(self, which, *arguments):
        """Code that a function returns."""
        made = [a if a is None or isinstance(a, ctypes.Array) else ctypes.c_double(a) for a in arguments]
        return getattr(self.code, f"{self.subject.name}_{which}")(self.state, *made)


def doubles(*values):
    return (ctypes.c_double * max(1, len(values)))(*values)


@pytest.fixture
def pendulum(tmp_path):
    return Library(od.export(design_of("pendulum-embedded"), "c"), tmp_path)


def test_bad_input_changes_nothing(pendulum):
    assert pendulum.names == ("angle", "speed", "w1")
    out = doubles(0, 0, 0)
    assert pendulum("init", doubles(0.5, -1.0)) == 0
    assert pendulum("step", 0.0, None, doubles(0.3, 0.1)) == 0
    before = list(pendulum.state)
    for t, y in ((float("nan"), doubles(0, 0)), (0.0, doubles(float("inf"), 0)), (0.0, None)):
        assert pendulum("step", t, None, y) == 1
    assert pendulum("init", doubles(float("nan"), 0)) == 1
    assert pendulum("estimate", 0.0, None, None, None) == 1
    assert pendulum("estimate", 0.0, None, doubles(float("nan"), 0), out) == 1
    assert list(pendulum.state) == before
    assert pendulum("estimate", 0.0, None, None, out) == 0
    assert list(out) == before[:3]


def test_a_step_without_a_finite_value_changes_nothing(tmp_path):
    text = (
        (SPECS / "pendulum-embedded.yaml").read_text().replace("sin(q)", "q*q*q").replace("{lipschitz: 1}", "monotone")
    )
    text = text.replace("[0, -g_over_l]", "[0, 0]").replace("observer: implementation", "observer: continuous")
    code = Library(od.export(od.solve(loads(text)), "c"), tmp_path)
    assert code("init", doubles(1e200, 0.0)) == 0
    before = list(code.state)
    assert code("step", 0.0, None, doubles(-1.7e308, 1.7e308)) == 2
    assert list(code.state) == before


def test_an_estimate_at_the_start_is_where_it_is_asked_for(tmp_path):
    """Coordinates of a transformed plant begin at phi(xhat0), with the states that outputs show as measured."""
    design = design_of("cuk-kkl")
    code = Library(od.export(design, "c", period="1.0e-6", method="rk4"), tmp_path)
    x = (0.4, -9.0, 21.0, -0.2)
    assert code("init", doubles(*x)) == 0
    out = doubles(0, 0, 0, 0)
    assert code("estimate", 0.0, doubles(0.4), doubles(x[2], x[3]), out) == 0
    assert list(out) == pytest.approx(list(x), rel=1e-12)


def test_many_steps_of_a_loop_are_those_of_the_simulator(tmp_path):
    """20,000 steps at 1 kHz; a million were run by hand."""
    spec, design = solved("pendulum-embedded")
    text = spec.text.replace("0.4 + 0.5*(1 - exp(8 - t))", "sin(0.3*t)")
    long = loads(text)
    made, _ = passage(long, design.observer)
    code = Library(od.export(design, "c"), tmp_path)
    assert code("init", None) == 0
    out, worst = doubles(0, 0, 0), 0.0
    size = np.abs(made.estimates).max(axis=0)
    for row, y, expected in zip(made.rows, made.y.tolist(), made.estimates, strict=True):
        assert code("estimate", row.t, None, None, out) == 0
        worst = max(worst, (np.abs(np.array(out) - expected) / size).max())
        assert code("step", row.t, None, doubles(*y)) == 0
    assert len(made.rows) == 20_001
    assert worst < 1e-12


NAMES = ("for", "int", "sin", "double", "x y", "naïve", "1st", "state", "t", "u", "NULL")


def test_hostile_names_become_identifiers(tmp_path):
    states = [name for name in NAMES if name not in ("t", "sin", "x y", "naïve", "1st")]
    n = len(states)
    A = (-np.eye(n) + 0.1 * np.eye(n, k=1)).tolist()
    system = {"states": states, "outputs": ["return"], "A": A, "B": [1] + [0] * (n - 1), "C": [1] + [0] * (n - 1)}
    observer = {"type": "l2", "alpha": 0.1, "bounds": {"L1": 10}}
    spec = od.Spec(system=system, observer=observer, implementation={"period": 0.01})
    made = od.export(od.solve(spec), "c", name="while_")
    made.write(tmp_path)
    assert subprocess.run([compiled(tmp_path, "while_")], check=False, capture_output=True).returncode == 0


@given(st.lists(st.text(), unique=True, max_size=12))
def test_identifiers_are_distinct_and_none_is_reserved(names):
    found = list(identifiers(tuple(names), RESERVED).values())
    assert len(set(found)) == len(names)
    assert all(name.isascii() and name.isidentifier() and name not in RESERVED for name in found)


@given(st.text())
def test_a_name_of_files_is_an_identifier(name):
    assert identifier(name).isascii()
    assert identifier(name).isidentifier()


@pytest.fixture
def gains(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    design_of("pendulum-embedded").save("pendulum.gains.json")
    return "pendulum.gains.json"


def test_the_c_holds_the_numbers_of_the_claim(gains):
    result, subject = json.loads(Path(gains).read_text()), od.export(gains, "c").subject
    for text in (c.header(subject), c.source(subject)):
        comment = text.split("*/")[0]
        written = re.search(r"\n   P = \[(.*)\]\n", comment)[1]
        P = [[Fraction(x) for x in row.split(", ")] for row in written.split("; ")]
        assert [[Fraction(x) for x in row] for row in result["certificate"]["P"]] == P
        assert f"gamma = {result['guarantee']['gamma']}" in comment
        assert "\n   H = [" in comment


CART = """
obsdesign: 1
name: Cart
system: {states: [place, speed], outputs: [y], A: [[0, 1], [-1, -0.5]], B: [[0], [1]], C: [[1, 0]]}
nonlinearities: [{type: {slope: [-1, 1]}, f: sin(q), Bf: [0, -0.1], Cq: [1, 0], region: {q: [-1, 1]}}]
observer: {type: l2, gains: {L1: [[-2], [-1]]}, alpha: 0.1}
implementation: {period: 1.0e-2, method: rk4}
simulation: {horizon: 1, x0: [1, 0], w: {w1: {file: push.csv}}}
"""


def test_a_file_of_the_simulation_may_be_gone(tmp_path, monkeypatch):
    """The self-test runs on waves then, which is said; and that a claim is local is said once."""
    monkeypatch.chdir(tmp_path)
    Path("cart.yaml").write_text(CART)
    assert run("solve", "cart.yaml", "-q").exit_code == 0
    outcome = run("export", "cart.gains.json", "--to", "c", "-o", "out")
    assert "waves in place of u and y: push.csv of the simulation is not there" in outcome.output.replace("\n", " ")
    assert subprocess.run([compiled(Path("out"), "cart")], check=False, capture_output=True).returncode == 0
    assert Path("out/cart.h").read_text().count("local:") == 1
    Path("push.csv").write_text("t,w1\n0,0\n2,0\n")
    assert "waves" not in run("export", "cart.gains.json", "--to", "c", "-o", "two").output


def test_the_command_writes_a_folder_and_says_what_is_proved(gains):
    outcome = run("export", gains, "--to", "c", "-o", "out")
    assert outcome.exit_code == 0, outcome.output
    assert "of its steps nothing is proved" in outcome.output
    assert "a step: 77 additions, 78 products, 4 sin" in outcome.output
    assert sorted(p.name for p in Path("out").iterdir()) == ["pendulum.c", "pendulum.h", "pendulum_selftest.c"]
    head = Path("out/pendulum.h").read_text()
    assert "norm2(z)" in head
    assert "SHA-256" in head
    report = json.loads(run("export", gains, "--to", "c", "-o", "two", "--json", "--float", "--name", "obs").stdout)
    assert report["files"] == ["two/obs.h", "two/obs.c", "two/obs_selftest.c"]
    assert "typedef float" in Path("two/obs.h").read_text()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--to", "java"], "'java' is no target; allowed: c, python, matlab, fmu"),
        (["--to", "python", "--float"], "--float is for C"),
        (["--to", "c", "--name", "2x"], "is no identifier of C"),
        (["--to", "python", "--name", "class"], "class is a word of Python"),
        (["--to", "c", "--method", "heun"], "'heun' is no method; allowed: euler, rk4, exact"),
        (["--to", "c", "--period", "-1"], "is no time in s"),
        (["--to", "c", "--period", "1e-3s"], "is no time in s"),
        (["--to", "c", "--period", "3"], "is above the largest with which rk4 is stable"),
        (["--to", "c", "-o", "full"], "is not empty"),
        (["--to", "c", "-o", "pendulum.gains.json"], "is a file"),
    ],
)
def test_bad_arguments_are_one_line(gains, arguments, said):
    Path("full").mkdir()
    Path("full/kept.txt").write_text("mine")
    outcome = run("export", gains, *arguments)
    assert outcome.exit_code == 2
    assert said in outcome.stderr
    assert len(outcome.stderr.strip().splitlines()) == 1
    assert sorted(p.name for p in Path().iterdir()) == ["full", "pendulum.gains.json"]


def test_what_has_no_gains_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    spec = SPECS / "infeasible" / "hidden-sensor-bias.yaml"
    outcome = run("solve", spec, "-o", "none.gains.json", "-q")
    assert outcome.exit_code == 3
    outcome = run("export", "none.gains.json", "--to", "c", "--period", "1e-3", "--method", "rk4")
    assert outcome.exit_code == 2
    assert "no gains" in outcome.stderr


def test_gains_without_a_certificate_are_labelled(tmp_path):
    text = (SPECS / "pendulum-embedded.yaml").read_text()
    file = json.loads(json.dumps(dict(od.solve(loads(text)).result)))
    file["status"] = "uncertified"
    for key in ("certificate", "guarantee"):
        file.pop(key)
    path = tmp_path / "loose.gains.json"
    path.write_text(json.dumps(file))
    made = od.export(od.read(path), "c")
    assert made.subject.words[-1] == "no guarantee: nothing is proved of these gains"


def test_a_filter_is_exported_without_a_claim(tmp_path):
    made = od.export(SPECS / "cuk-ekf.yaml", "c", period="1.0e-5", method="rk4")
    made.write(tmp_path)
    assert "no guarantee" in made.subject.words[-1]
    assert subprocess.run([compiled(tmp_path, "cuk_ekf")], check=False, capture_output=True).returncode == 0


def test_steps_are_asked_for():
    with pytest.raises(UsageError, match="give --period SECONDS and --method"):
        od.export(design_of("noisy-output"), "c")
    with pytest.raises(UsageError, match="is in samples"):
        od.export(design_of("discrete-battery"), "c", period=0.1, method="rk4")
    with pytest.raises(UsageError, match="escapes"):
        od.export(design_of("corless2019-magnetic-bearing"), "c", period="1.0e-3", method="exact")
