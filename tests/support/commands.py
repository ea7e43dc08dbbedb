"""The command line, run within the process."""

import signal
import subprocess
import time
from functools import cache
from pathlib import Path

from typer import testing
from typer.main import get_command

from obsdesign.cli import app

testing._get_command = cache(get_command)  # else made anew for each call, of the signatures of all commands
PNG = b"\x89PNG\r\n\x1a\n"


def run(*arguments):
    """A command through the entry point of the application."""
    return testing.CliRunner().invoke(app, [str(a) for a in arguments])


def hearing():
    """Hear interrupts in a process that begins, whatever began the tests: what runs in the background ignores them."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)


def begin(command, **options):
    """A process that hears interrupts."""
    return subprocess.Popen(command, **{"preexec_fn": hearing} | options)


def files(folder="."):
    """Names in a folder, hidden ones too."""
    return sorted(p.name for p in Path(folder).iterdir())


def endless(*_):
    """A design that takes for ever, in place of the outcome of a designer."""
    while True:
        time.sleep(0.01)


def interrupted(*_args, **_options):
    """What the user stops."""
    raise KeyboardInterrupt


def result_of(folder, text, name="spec"):
    """Text of the result that `solve` makes of a spec."""
    spec, gains = folder / f"{name}.yaml", folder / f"{name}.gains.json"
    spec.write_text(text)
    outcome = run("solve", spec, "-o", gains)
    assert outcome.exit_code == 0, outcome.output
    return gains.read_text()


def assert_answered(text):
    """Hold the answer to a spec of extreme numbers against what is true of every answer; return its exit code."""
    Path("extreme.yaml").write_text(text)
    outcome = run("solve", "extreme.yaml", "-q")
    assert outcome.exit_code in {0, 2, 3, 4}, outcome.exception
    assert (outcome.stderr == "") == (outcome.exit_code in {0, 3})
    assert ("extreme.gains.json" in files()) == (outcome.exit_code in {0, 3})
    if outcome.exit_code == 0:
        assert run("verify", "extreme.gains.json", "-q").exit_code == 0
    return outcome.exit_code
