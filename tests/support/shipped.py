"""The specs that are shipped, each solved once."""

from functools import cache
from pathlib import Path

import pytest

from obsdesign.reading import load
from obsdesign.work import solve

SPECS = Path(__file__).parents[2] / "specs"
FILTERS = ["cuk-ekf", "cuk-lqe", "discrete-pendulum-ukf"]  # of which nothing is proved: they are not solved
ALL = [str(p.relative_to(SPECS).with_suffix("")) for p in sorted(SPECS.glob("**/*.yaml"))]
NAMES = [name for name in ALL if name not in FILTERS]
SLOW = {  # others like them are solved in less time
    "ferrante2019-manipulator-clock",
    "ferrante2019-manipulator-clock-tradeoff",
    "ferrante2019-manipulator-predictor-clock",
    "ferrante2019-manipulator-tradeoff",
    "ferrante2019-robot-clock-tradeoff",
    "infeasible/undetectable-rate",
    "large/chain",
    "large/rod",
}


@cache
def shipped(name):
    """A spec."""
    return load(str(SPECS / f"{name}.yaml"))


@cache
def solved(name):
    """A spec and its design; a test that asks for it is `on` the name."""
    return shipped(name), solve(shipped(name))


def on(*values):
    """Values of parameters, the first of which is the name of a spec: its tests run in one process."""
    rows = [(value,) if isinstance(value, str) else value for value in values]
    return [pytest.param(*r, marks=[pytest.mark.xdist_group(r[0]), *[pytest.mark.slow] * (r[0] in SLOW)]) for r in rows]
