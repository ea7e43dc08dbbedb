"""What several test files share: one small problem, solved once through the command line."""

import os
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: small matrices, two cores

import pytest
from typer.testing import CliRunner

from obsdesign.cli import app

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


@pytest.fixture(scope="session")
def bearing() -> Path:
    """The spec of the magnetic bearing."""
    return Path(__file__).parent.parent / "specs" / "corless2019-magnetic-bearing.yaml"


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> Path:
    """A folder with cart.yaml and the cart.gains.json that `solve` made of it."""
    folder = tmp_path_factory.mktemp("made")
    spec, gains = folder / "cart.yaml", folder / "cart.gains.json"
    spec.write_text(CART)
    outcome = CliRunner().invoke(app, ["solve", str(spec), "-o", str(gains)])
    assert outcome.exit_code == 0, outcome.output
    return folder
