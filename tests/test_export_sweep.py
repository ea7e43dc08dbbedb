"""Every shipped observer is exported to every language, and computes there what the simulator does."""

import numpy as np
import pytest
from support.exported import Reference, design_of, deviation, played, steps_of, subject, xhat0_of
from support.shipped import ALL, SLOW, on
from test_export_fmu import Slave, expected, fmpy, linux
from test_export_matlab import octave, ran
from test_export_python import imported

pytestmark = [pytest.mark.slow, pytest.mark.sweep]  # three minutes: run by hand
NAMES = on(*(name for name in ALL if not name.startswith("infeasible/") and name not in SLOW))


def exported(name):
    """What is exported of a spec, its vectors, and another start; skips where there is no f."""
    spec = design_of(name).spec
    if spec.typed is None and any(block.f is None for block in spec.nonlinearities):
        pytest.skip("the spec has no f")
    made, rows = subject(name, *steps_of(name))
    return made, rows, xhat0_of(made)


@pytest.mark.parametrize("name", NAMES)
def test_python(name, tmp_path):
    made, rows, xhat0 = exported(name)
    reference = played(Reference(made.implemented, xhat0), made, rows)
    assert deviation(played(imported(made, rows, tmp_path).Observer(xhat0), made, rows), reference) < 1e-12


@octave
@pytest.mark.parametrize("name", NAMES)
def test_matlab(name, tmp_path):
    made, rows, xhat0 = exported(name)
    reference = played(Reference(made.implemented, xhat0), made, rows)
    assert deviation(ran(made, rows, xhat0, tmp_path), reference) < 1e-12


@fmpy
@linux
@pytest.mark.parametrize("name", NAMES)
def test_fmu(name, tmp_path):
    made, rows, xhat0 = exported(name)
    found = Slave(made, tmp_path, xhat0).run(made, rows)
    assert np.isfinite(found).all()
    assert deviation(found, expected(made, rows, xhat0)) < 1e-12
