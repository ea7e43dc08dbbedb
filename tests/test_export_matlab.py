"""The export to MATLAB: functions that compute what the simulator does, in GNU Octave."""

import shutil
import subprocess

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.exported import INPUTS, OBSERVERS, Reference, deviation, functions, hostile, played, subject, xhat0_of

import obsdesign as od
from obsdesign.exports import matlab
from obsdesign.exports.code import LONGEST, identifiers
from obsdesign.exports.matlab_language import RESERVED

octave = pytest.mark.skipif(shutil.which("octave-cli") is None, reason="octave is not installed")

PLAYED = """
rows = load('-ascii', 'rows.txt');
t = rows(:, 1); on = rows(:, 2); measured = rows(:, 3); u = rows(:, 4:3 + NU); y = rows(:, 4 + NU:end);
out = fopen('found.txt', 'w');
s = ID_init(XHAT0);
for k = 1:numel(t)
    if measured(k), s = ID_jump(s, t(k), u(k, :), y(k, :)); end
    fprintf(out, '%.17g ', ID_estimate(s, t(k), u(k, :), y(k, :)));
    fprintf(out, '\\n');
    if k == numel(t), break, end
    STEP
end
fclose(out);
"""
HELD = "s = ID_step(s, t(k), u(k, :), y(k, :));"
AHEAD = "s = ID_step(s, t(k), [u(k, :), u(k + 1, :)], y(k + 1, :));"
INSTANTS = """if abs(on(k) - PERIOD) < 1e-9*PERIOD, s = ID_step(s, t(k), u(k, :));
    else, s = ID_flow(s, t(k), on(k), u(k, :)); end"""


def performed(folder, script):
    """What Octave prints, of a script beside the exported files."""
    (folder / "script.m").write_text(script)
    command = ["octave-cli", "--norc", "--quiet", "script.m"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=100)
    assert done.returncode == 0, done.stderr
    return done.stdout


def exported(made, rows, folder):
    """The exported files, in a folder."""
    for name, content in matlab.files(made, rows).items():
        (folder / name).write_bytes(content)
    return folder


def ran(made, rows, xhat0, folder):
    """Estimates of the rows by the exported files, after the measurement of each."""
    np.savetxt(folder / "rows.txt", np.column_stack([rows.t, rows.on, rows.measured, rows.u, rows.y]), "%.17g")
    script = PLAYED.replace("STEP", INSTANTS if made.instants else AHEAD if made.ahead else HELD)
    script = script.replace("XHAT0", str(xhat0 or "")).replace("PERIOD", repr(made.period))
    script = script.replace("NU", str(rows.u.shape[1])).replace("ID_", f"{made.name}_")
    performed(exported(made, rows, folder), script)
    return np.loadtxt(folder / "found.txt", ndmin=2)


@octave
@pytest.mark.parametrize("elsewhere", [False, True], ids=["xhat0", "another"])
@pytest.mark.parametrize(("name", "period", "method"), OBSERVERS)
def test_code_computes_what_the_simulator_does(name, period, method, elsewhere, tmp_path):
    made, rows = subject(name, period, method)
    xhat0 = xhat0_of(made) if elsewhere else None
    expected = played(Reference(made.implemented, xhat0), made, rows)
    assert deviation(ran(made, rows, xhat0, tmp_path), expected) < 1e-12


WRONG = """
s = pendulum_embedded_init([0.5, -1]);
calls = {@() pendulum_embedded_step(s, NaN, [], [0, 0]), @() pendulum_embedded_step(s, 0, [], [Inf, 0]), ...
    @() pendulum_embedded_step(s, 0, [], 0), @() pendulum_embedded_step(s, 0, 1, [0, 0]), ...
    @() pendulum_embedded_step(s, 0, [], 'ab'), @() pendulum_embedded_init(1), ...
    @() pendulum_embedded_estimate(s, 0, [], [NaN, 0]), @() pendulum_embedded_step(s, 0, [], [-1.7e308, 1.7e308])};
for k = 1:numel(calls)
    try
        calls{k}();
        disp('accepted');
    catch e
        disp([e.identifier, ' ', e.message]);
    end
end
disp(pendulum_embedded_estimate(s, 0, [])');
"""


@octave
def test_bad_input_is_an_error(tmp_path):
    printed = performed(exported(*subject("pendulum-embedded"), tmp_path), WRONG).splitlines()
    wrong = ("t is not 1", "y is not 2", "y is not 2", "u is not 0", "y is not 2", "xhat0 is not 2", "y is not 2")
    said = [f"pendulum_embedded:input {what} finite numbers" for what in wrong]
    assert printed[:7] == said
    assert printed[7] == "pendulum_embedded:equation an equation has no finite value"
    assert printed[8].split() == ["0.5000", "-1.0000", "0"]


@octave
def test_times_between_measurements_are_within_a_period(tmp_path):
    made, rows = subject("ferrante2019-oscillator-clock", "1.0e-2", "exact")
    call = f"s = {made.name}_init(); try, {made.name}_flow(s, 0, 0.02, []); catch e, disp(e.message); end"
    assert performed(exported(made, rows, tmp_path), call) == "dt is 0.02 s; expected 0 to 0.01 s\n"


@octave
def test_hostile_names_become_identifiers(tmp_path):
    made = od.export(hostile(), "matlab", name="while_")
    made.write(tmp_path)
    reference, u = Reference(made.subject.implemented, range(6)), np.linspace(-1, 1, len(INPUTS))
    reference.step(0.0, u, (0.3,))
    script = f"s = while__step(while__init(0:5), 0, linspace(-1, 1, {len(u)}), 0.3);"
    printed = performed(tmp_path, f"{script} printf('%.17g ', while__estimate(s, 0, zeros(1, {len(u)})));")
    found = np.array(printed.split(), dtype=float)
    assert found == pytest.approx(reference.estimate(0.0, u, ()), rel=1e-12)


@octave
def test_every_function_is_that_of_the_simulator(tmp_path):
    made = functions()
    u = np.vstack([np.random.default_rng(1).uniform(-2, 2, (200, 2)), [[1.0, 1.0], [0.0, -1.0], [-1.0, 1.0]]])
    np.savetxt(tmp_path / "u.txt", u, "%.17g")
    script = "u = load('-ascii', 'u.txt'); s = functions_init();\nfor k = 1:rows(u)\n"
    script += "    printf('%.17g ', functions_estimate(s, 0, u(k, :))); disp('');\nend"
    found = np.loadtxt(performed(exported(made, None, tmp_path), script).splitlines())
    expected = [Reference(made.implemented).estimate(0.0, row, ()) for row in u.tolist()]
    assert found == pytest.approx(np.array(expected), rel=1e-13, abs=1e-300)


@given(st.lists(st.text(), unique=True, max_size=12))
def test_identifiers_are_distinct_short_and_none_is_reserved(names):
    long = [name * 40 for name in names]
    found = list(identifiers(tuple(long), RESERVED).values())
    assert len(set(found)) == len(set(long))
    assert all(name.isascii() and name.isidentifier() and name not in RESERVED for name in found)
    assert all(len(name) <= LONGEST + len(names) for name in found)


def test_each_file_says_what_it_is_about():
    made, rows = subject("cuk-kkl-pebo", "1.0e-5", "rk4")
    files = matlab.files(made, rows)
    assert list(files) == [f"cuk_kkl_pebo_{which}.m" for which in ("init", "step", "estimate")]
    for name, content in files.items():
        text = content.decode()
        assert text.startswith("function ")
        assert "SHA-256" in text
        assert f"% {name.removesuffix('.m')} " in text
        assert max(map(len, text.splitlines())) <= 120
