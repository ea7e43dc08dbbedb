"""Options and fixtures of several test files: a small problem, solved once, and the verification of result files."""

import gc
import json
import os
from functools import cache
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy, and for commands that are started: there is a process a core
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["MKL_NUM_THREADS"] = "1"
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # else every command that is started compiles what it imports

import pytest
from hypothesis import HealthCheck, settings
from support.bounded import soon
from support.commands import PNG, result_of, run
from support.schedule import Schedule, begin_with_the_longest
from support.sweep import SWEEP

from obsdesign.batches.perform import perform
from obsdesign.batches.record import kept
from obsdesign.batches.renew import renewed
from obsdesign.reading import loads
from obsdesign.work import solve

settings.register_profile(
    "repeatable",
    derandomize=True,
    deadline=None,  # time is measured in tests/benchmarks
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
settings.load_profile("repeatable")


CART = """
obsdesign: 1
name: Cart
system:
  states: [position, speed]
  A: [[0, 1], [-1, -1]]
  B: [[0], [1]]
  C: [[1, 0]]
nonlinearities:
  - {type: sin, Bf: [0, 0.2], Cq: [1, 0]}
disturbance: integrator
observer: {type: l2, L2: 0, alpha: 0.1, bounds: {L1: 40}}
simulation: {horizon: 2, x0: [1, 0], w: [1 - exp(-t)], points: 21}
"""


def pytest_addoption(parser):
    parser.addoption("--sweep", metavar="N[:SEED]", help="N times as many random examples, drawn from SEED")


def pytest_configure(config):
    if config.option.sweep:
        try:
            SWEEP.read(config.option.sweep)
        except ValueError:
            raise pytest.UsageError(f"--sweep {config.option.sweep}: expected N or N:SEED, N > 0") from None


def pytest_collection_finish():
    """What is imported lives as long as the tests: garbage is not looked for in it, nor often."""
    gc.freeze()
    gc.set_threshold(100_000, 50, 100)


def pytest_make_parametrize_id(val):
    """A long text is named by its beginning: names are sent, and compared, many times."""
    return f"{val[:80]!r}..." if isinstance(val, str | bytes) and len(val) > 200 else None


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Tests of a file, or of a group, go to one process."""
    return Schedule(config, log) if config.getoption("dist") == "loadgroup" else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """What takes longest begins first."""
    begin_with_the_longest(items)


@pytest.fixture(scope="session")
def bearing() -> Path:
    """The spec of the magnetic bearing."""
    return Path(__file__).parent.parent / "specs" / "corless2019-magnetic-bearing.yaml"


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> Path:
    """A folder with cart.yaml and the cart.gains.json that `solve` made of it."""
    folder = tmp_path_factory.mktemp("made")
    result_of(folder, CART, "cart")
    return folder


@pytest.fixture
def content(genuine):
    """What is in a genuine result file, whose text a test file gives; to be forged."""
    return json.loads(genuine)


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def sketched(monkeypatch):
    """Figures that take no time to draw."""
    for name in ("obsdesign.plot.run_figure", "obsdesign.plot.envelope.envelope_figure"):
        monkeypatch.setattr(name, lambda *_, **__: PNG + b"....tEXtSoftware\0obsdesign")


DESIGNS = {}


def solved_once(spec, solver="clarabel", *_):
    """Design of a spec; that of an earlier test, if it had the same."""
    asked = (spec.text, spec.path, spec.changes, solver)
    if asked not in DESIGNS:
        DESIGNS[asked] = solve(spec, solver)
    return DESIGNS[asked]


@pytest.fixture
def designed_once(monkeypatch):
    """Commands that solve a spec once: for tests of what is made of its design."""
    monkeypatch.setattr("obsdesign.work.solve", solved_once)


@pytest.fixture
def at_once(monkeypatch):
    """Batches that design in this process, each spec once; those of their own are tested in test_batch_trouble.py."""

    def run(tasks, options, out, _jobs, begun=lambda _: None):
        for task in tasks:
            begun(task)
            known = renewed(task, out) if task.kept else None
            yield task, known or kept(perform(task, options), task, options, out)

    monkeypatch.setattr("obsdesign.batches.workers.run", run)
    monkeypatch.setattr("obsdesign.batches.perform.solve", solved_once)


@pytest.fixture
def read_once(monkeypatch):
    """The spec that travels in the result files of a test is the same again and again, and is read once."""
    monkeypatch.setattr("obsdesign.design.loads", cache(loads))


@pytest.fixture
def outcome_of(tmp_path, read_once):  # noqa: ARG001
    """Writes a result file, verifies it, and holds the answer against what is true of every answer."""

    def outcome_of(forged, *spec):
        path = tmp_path / "forged.json"
        if isinstance(forged, bytes):
            path.write_bytes(forged)
        else:
            path.write_text(forged if isinstance(forged, str) else json.dumps(forged))
        with soon():
            outcome = run("verify", path, *spec)
        assert outcome.exit_code in {0, 2, 4}, outcome.exception
        assert "Traceback" not in outcome.output
        assert outcome.exit_code == 0 or str(path) in outcome.stderr
        if outcome.exit_code == 2:
            assert outcome.stdout == ""
            assert len(outcome.stderr.splitlines()) == 1
        return outcome

    return outcome_of
