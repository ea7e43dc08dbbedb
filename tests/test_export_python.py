"""The export to Python: one file that runs without the package, and computes what the simulator does."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.exported import (
    INPUTS,
    OBSERVERS,
    STATES,
    Reference,
    design_of,
    deviation,
    functions,
    hostile,
    played,
    subject,
    xhat0_of,
)

import obsdesign as od
from obsdesign.exports import python
from obsdesign.exports.code import identifiers
from obsdesign.exports.python_language import RESERVED


def module_of(content, path):
    """A file as a module."""
    path.write_bytes(content)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def imported(made, rows, folder):
    """The exported file as a module."""
    ((name, content),) = python.files(made, rows).items()
    return module_of(content, folder / name)


@pytest.mark.parametrize("elsewhere", [False, True], ids=["xhat0", "another"])
@pytest.mark.parametrize(("name", "period", "method"), OBSERVERS)
def test_code_computes_what_the_simulator_does(name, period, method, elsewhere, tmp_path):
    made, rows = subject(name, period, method)
    xhat0 = xhat0_of(made) if elsewhere else None
    observer = imported(made, rows, tmp_path).Observer(xhat0)
    found = played(observer, made, rows)
    assert observer.names == made.estimates
    assert len(found) > 20
    assert deviation(found, played(Reference(made.implemented, xhat0), made, rows)) < 1e-12
    if not elsewhere:
        assert deviation(found, rows.estimates) < 1e-9


@pytest.fixture
def pendulum(tmp_path):
    made, rows = subject("pendulum-embedded")
    return imported(made, rows, tmp_path)


def test_bad_input_changes_nothing(pendulum):
    observer, nan, inf = pendulum.Observer([0.5, -1.0]), float("nan"), float("inf")
    observer.step(0.0, (), np.array([0.3, 0.1]))
    before = observer.x
    for t, u, y in ((nan, (), (0, 0)), (0, (), (inf, 0)), (0, (), (0,)), (0, (1,), (0, 0)), (0, (), None), (0, (), 0)):
        with pytest.raises(ValueError, match=r"is not finite|has the shape"):
            observer.step(t, u, y)
    with pytest.raises(ValueError, match="y is not finite"):
        observer.estimate(0.0, (), (nan, 0))
    assert observer.x == before
    assert observer.estimate(0.0, None).tolist() == list(before)
    for xhat0 in ((1.0,), (1.0, nan)):
        with pytest.raises(ValueError, match="xhat0"):
            pendulum.Observer(xhat0)


def test_what_has_no_finite_value_changes_nothing(pendulum, tmp_path):
    observer = pendulum.Observer([1e300, 1e300])
    before = observer.x
    with pytest.raises(ArithmeticError, match="no finite value"):
        observer.step(0.0, (), (-1.7e308, 1.7e308))
    assert observer.x == before
    made, rows = subject("discrete-feedthrough")
    observer = imported(made, rows, tmp_path).Observer([1e300, 1e300])
    before = observer.x
    with pytest.raises(ArithmeticError):
        observer.step(0.0, (), (0.0,))
    assert observer.x == before


def test_times_between_measurements_are_within_a_period(tmp_path):
    made, rows = subject("ferrante2019-oscillator-clock", "1.0e-2", "exact")
    observer = imported(made, rows, tmp_path).Observer()
    for dt in (-1e-3, 0.02, float("nan")):
        with pytest.raises(ValueError, match=r"^dt is"):
            observer.flow(0.0, dt, ())
    observer.jump(0.0, (), [1.0])
    before = observer.x
    observer.flow(0.0, 0.0, ())
    assert observer.x == before


def test_an_estimate_does_not_begin_the_observer(tmp_path):
    made, rows = subject("cuk-kkl-pebo", "1.0e-5", "rk4")
    observer = imported(made, rows, tmp_path).Observer()
    first = observer.estimate(0.0, [0.4], [20.0, -0.3])
    assert observer.estimate(0.0, [0.4], [25.0, -0.3])[2] == 25.0
    assert observer.estimate(0.0, [0.4], [20.0, -0.3]).tolist() == first.tolist()


@pytest.mark.parametrize("name", ["pendulum-embedded", "cuk-kkl-pebo", "lost-packets", "saturated-spring"])
def test_the_file_passes_the_linter_and_says_what_is_proved(name, tmp_path):
    period, method = (None, None) if name == "pendulum-embedded" else ("1.0e-5", "rk4")
    made, rows = subject(name, period, method)
    module = imported(made, rows, tmp_path)
    assert "of its steps nothing is proved" in module.__doc__
    done = subprocess.run(
        [sys.executable, "-m", "ruff", "check", "--isolated", "--no-cache", module.__file__],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    assert max(map(len, Path(module.__file__).read_text().splitlines())) <= 120


def test_hostile_names_become_identifiers(tmp_path):
    made = od.export(hostile(), "python", name="while_")
    observer = module_of(made.files["while_.py"], tmp_path / "hostile.py").Observer(range(6))
    reference, u = Reference(made.subject.implemented, range(6)), np.linspace(-1, 1, len(INPUTS))
    for k in range(5):
        observer.step(k, u, (0.3,))
        reference.step(k, u, (0.3,))
    assert observer.names[:6] == STATES
    assert observer.estimate(0.0, u).tolist() == pytest.approx(reference.estimate(0.0, u, ()).tolist(), rel=1e-12)


def test_every_function_is_that_of_the_simulator(tmp_path):
    made = functions()
    observer, reference = imported(made, None, tmp_path).Observer(), Reference(made.implemented)
    for u in [*np.random.default_rng(1).uniform(-2, 2, (200, 2)).tolist(), [1.0, 1.0], [0.0, -1.0], [-1.0, 1.0]]:
        assert observer.estimate(0.0, u) == pytest.approx(reference.estimate(0.0, u, ()), rel=1e-13, abs=1e-300)


@given(st.lists(st.text(), unique=True, max_size=12))
def test_identifiers_are_distinct_and_none_is_reserved(names):
    found = list(identifiers(tuple(names), RESERVED).values())
    assert len(set(found)) == len(names)
    assert all(name.isascii() and name.isidentifier() and name not in RESERVED for name in found)


@given(st.text())
def test_no_text_ends_a_docstring(text):
    line = python.quoted(text)
    assert '"""' not in line
    assert len(line.splitlines()) <= 1


def test_the_export_is_the_same_file_again():
    made, rows = subject("pendulum-embedded")
    assert od.export(design_of("pendulum-embedded"), "python").files == python.files(made, rows)
