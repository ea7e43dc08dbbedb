"""Specs from Python values: the numbers and the messages of the same file, and a text that reads back to it."""

import subprocess
import sys
from dataclasses import fields, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import yaml
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st

from obsdesign.errors import UsageError
from obsdesign.reading import Spec, build, load, loads, with_simulation
from obsdesign.sections.document import compose
from obsdesign.sections.writing import written

ROOT = Path(__file__).parent.parent
SHIPPED = sorted((ROOT / "specs").rglob("*.yaml"))
A = np.array([[0, 1], [-2, -0.1]])


def same(one, other, *but):
    """Whether two specs are equal, field by field but for some."""
    names = [f.name for f in fields(one) if f.name not in but]
    return [name for name in names if repr(getattr(one, name)) != repr(getattr(other, name))] == []


def refused(**sections):
    """What is answered to sections that are wrong: no line, no column."""
    with pytest.raises(UsageError) as caught:
        Spec(**sections)
    assert all((p.file, p.line, p.column) == ("<python>", 0, 0) for p in caught.value.problems)
    return [f"{p.key}: {p.message}" for p in caught.value.problems]


def test_a_spec_of_arrays_is_that_of_the_same_yaml():
    spec = Spec(
        name="Pendulum",
        parameters={"b": 0.25},
        system={"A": A, "B": np.array([0, 1]), "C": [[1, 0]], "D": np.float32(0.1)},
        nonlinearities=[{"type": {"slope": [-1, np.inf]}, "f": "b*q**3", "Bf": (0, -1), "Cq": ["1/2", Fraction(1, 3)]}],
        observer={"type": "l2", "alpha": {"min": 0.1, "max": 2, "log": np.bool_(True)}, "gains": None},
        simulation={"horizon": np.int64(10), "x0": np.array([1e-3, 0]), "seed": 3},
    )
    text = """\
obsdesign: 1
name: Pendulum
parameters: {b: 0.25}
system: {A: [[0, 1], [-2, -0.1]], B: [0, 1], C: [[1, 0]], D: 0.1}
nonlinearities: [{type: {slope: [-1, .inf]}, f: b*q**3, Bf: [0, -1], Cq: [1/2, 1/3]}]
observer: {type: l2, alpha: {min: 0.1, max: 2, log: true}}
simulation: {horizon: 10, x0: [1.0e-3, 0], seed: 3}
"""
    assert same(spec, loads(text), "text", "path")
    assert spec.plant.A[1, 1] == fmpq(-1, 10)
    assert spec.plant.D[0, 0] == fmpq(1, 10)
    assert same(spec, loads(spec.text, "<python>"))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_every_shipped_spec_can_be_built_from_its_values(path):
    spec = load(str(path))
    again = build(compose(spec.text, "").root.plain())
    assert same(spec, again, "text", "path", "name")
    assert same(again, loads(again.text, "<python>"))


def test_the_first_name_that_is_used_may_be_that_of_the_spec():
    code = (
        "import obsdesign as od; print(od.Spec(system={'A': -1, 'C': 1}, observer={'type': 'l2', 'alpha': 1}).plant.A)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[[-1]]\n"


def test_the_dataclass_is_replaced_as_any_other():
    spec = Spec(system={"A": A, "C": [1, 0]}, observer={"type": "l2", "alpha": 1})
    assert replace(spec, name="other").name == "other"
    assert same(replace(spec, name="other"), spec, "name")


@pytest.mark.parametrize(
    ("sections", "answers"),
    [
        ({"sytem": {}}, ["unknown key sytem; did you mean system?", "observer: is required"]),
        ({"system": {"A": [[np.nan]], "C": 1}}, ["system.A[0][0]: .nan is not a finite number"]),
        ({"system": {"A": np.eye(2), "C": np.ones((1, 3))}}, ["expected 2 columns (one for each state), found 1x3"]),
        ({"system": {"A": [[1j]], "C": len}}, ["system.A[0][0]: expected a number", "system.C: expected a number"]),
        ({"system": {"A": 1, "C": 1, 3: 1}}, ["system: a key must be text, found 3"]),
        ({"system": {"A": "1 +", "C": 1}}, ["system.A: "]),
    ],
)
def test_what_is_wrong_is_said_with_its_key_alone(sections, answers):
    observer = {} if "sytem" in sections else {"observer": {"type": "l2", "alpha": 1}}
    found = refused(**sections, **observer)
    assert len(found) == len(answers)
    assert all(any(answer in message for message in found) for answer in answers)


def test_a_list_in_itself_is_refused():
    endless = []
    endless.append(endless)
    (answer,) = refused(system={"A": endless, "C": 1}, observer={"type": "l2"})
    assert "nested deeper than 32 levels" in answer


def test_keys_of_the_simulation_are_changed_and_nothing_else():
    spec = load(str(ROOT / "specs" / "corless2019-magnetic-bearing.yaml"))
    changed = with_simulation(spec, {"horizon": 3, "seed": 7, "w": None, "v": ["0", "sin(t)"]})
    assert (changed.simulation.horizon, changed.simulation.seed, changed.simulation.w) == (3, 7, None)
    assert same(changed, spec, "simulation")
    with pytest.raises(UsageError, match=r"simulation.horizen: unknown key horizen; did you mean horizon\?"):
        with_simulation(spec, {"horizen": 3})


@given(
    st.recursive(
        st.floats(allow_nan=False, allow_infinity=False)
        | st.integers()
        | st.text("ab01 #:'\"-*&!{}[],|>%@`~é\n.", max_size=8),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("ab-: 1", min_size=1, max_size=4), inner),
        max_leaves=8,
    )
)
def test_any_text_and_number_is_read_as_it_was_written(value):
    read = yaml.safe_load(written({"key": {"inner": value}}, ""))["key"]["inner"]
    tree = compose(written({"key": {"inner": value}}, ""), "").root.plain()["key"]["inner"]
    assert agree(tree, value)
    assert type(read) is type(value) or isinstance(value, float | str)


def agree(tree, value):
    """Whether a tree of texts has the values of Python."""
    if isinstance(value, dict):
        return set(tree) == set(value) and all(agree(tree[name], value[name]) for name in value)
    if isinstance(value, list):
        return len(tree) == len(value) and all(map(agree, tree, value))
    return tree == value if isinstance(value, str) else float(tree) == float(value)
