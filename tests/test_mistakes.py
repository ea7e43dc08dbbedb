"""Mistakes of a newcomer on the command line: each is answered in one line that says what to do instead."""

from pathlib import Path

import pytest
from support.commands import run

from obsdesign import __version__
from obsdesign.cli import app

NAMES = [command.callback.__name__ for command in app.registered_commands]
SPEC = """
obsdesign: 1
system: {A: [[-1]], B: [[1]], C: [[1]]}
observer: {type: l2, alpha: 0.1, bounds: {L1: 5}}
simulation: {horizon: 1, x0: [1], points: 5}
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch, sketched, designed_once):  # noqa: ARG001
    monkeypatch.chdir(tmp_path)
    Path("mass.yaml").write_text(SPEC)
    assert run("solve", "mass.yaml", "--simulate", "-q").exit_code == 0


@pytest.mark.parametrize("name", ["", *NAMES])
def test_every_command_has_short_forms_of_help_and_version(name):
    command = [name] if name else []
    assert run(*command, "-h").stdout == run(*command, "--help").stdout
    for option in ("-V", "--version"):
        outcome = run(*command, option, *["nonesuch"] * bool(name))
        assert (outcome.exit_code, outcome.stdout) == (0, f"obsdesign {__version__}\n")


@pytest.mark.parametrize(
    ("mistake", "said"),
    [
        ("slove mass.yaml", "there is no command slove; did you mean obsdesign solve? allowed: init, solve, "),
        ("run mass.yaml", "there is no command run; did you mean obsdesign simulate? allowed: "),
        ("Design mass.yaml", "there is no command Design; did you mean obsdesign solve? allowed: "),
        ("help solve", "there is no command help; did you mean obsdesign explain? allowed: "),
        ("frobnicate", "there is no command frobnicate; allowed: init, "),
        ("mass.yaml", "mass.yaml is a file; write a command before it, such as solve, simulate, verify; see "),
        ("init --plant", "option '--plant' requires an argument; see obsdesign --help [OBS901]"),
        ("solve mass.yaml -o", "option '-o' requires an argument; see obsdesign --help [OBS901]"),
        ("solve mass.yaml --alpha 3", "no such option: --alpha; of a spec it is set by --set observer.alpha=VALUE; "),
        ("simulate --horizon=3", "no such option: --horizon; of a spec it is set by --set simulation.horizon=VALUE; "),
        ("verify mass.gains.json --alpha 3", "no such option: --alpha (Possible options: --help); see "),
        ("solve mass.yaml --set alpha=0.4", "alpha is a key of observer: write it there, as observer.alpha [OBS201]"),
        ("check mass.yaml --set x0=[1]", "x0 is a key of simulation: write it there, as simulation.x0 [OBS201]"),
        ("solve mas.yaml", "mas.yaml: cannot be read: No such file or directory; did you mean mass.yaml? [OBS101]"),
        ("verify mass", "mass: cannot be read: No such file or directory; did you mean mass.yaml? [OBS101]"),
        ("check absent/mass.yaml", "absent/mass.yaml: cannot be read: No such file or directory [OBS101]"),
        ("solve mass.gains.json", "is a result of `solve`, not a spec; `simulate` and `verify` take it, "),
        ("verify mass.yaml", "is a spec; `obsdesign solve` makes of it the result file that is expected here [OBS701]"),
        ("solve mass.run.csv", "is a table of samples; a spec is expected, a YAML file [OBS109]"),
        ("compare mass.run.csv", "is a table of samples; a spec is expected, a YAML file [OBS109]"),
        ("verify mass.run.csv", "no result of `obsdesign solve`, which writes NAME.gains.json: not JSON: "),
        ("solve mass.yaml -o a.yaml", "a.yaml: results are written here, whose names end with .json [OBS904]"),
        ("simulate -o a.png", "a.png: samples are written here, whose names end with .csv [OBS904]"),
        ("simulate --plot a.pdf", "a.pdf: figures are written here, whose names end with .png or .svg [OBS904]"),
        ("compare mass.yaml -o a.csv", "a.csv: figures are written here, whose names end with .png or .svg [OBS904]"),
        ("report mass.gains.json -o a.pdf", "a.pdf: pages are written here, whose names end with .html or .htm"),
    ],
)
def test_a_mistake_is_answered_in_one_line_that_says_what_to_do(mistake, said):
    before = sorted(Path().iterdir())
    outcome = run(*mistake.split())
    assert (outcome.exit_code, outcome.stdout) == (2, ""), outcome.output
    assert said in outcome.stderr
    assert outcome.stderr.count("\n") == 1
    assert sorted(Path().iterdir()) == before
