"""A plant as equations: what its matrices say, in continuous and in discrete time, with loops and without."""

import glob
from pathlib import Path

import numpy as np
import pytest
from support.equations import explicit, matrices, order, split

from obsdesign.errors import UsageError
from obsdesign.expressions import parse
from obsdesign.lmi.formula import rational
from obsdesign.model.equations import Equations
from obsdesign.reading import load, loads

SPECS = sorted(glob.glob(str(Path(__file__).parents[1] / "specs" / "*.yaml")))
MATRICES = ("A", "Bf", "B", "Cq", "Dqf", "Dq", "C", "Df", "D")
HEAD = "obsdesign: 1\nobserver: {type: l2, L2: 0, alpha: 0.1}\n"
LOOP = """
system: {A: [[0, 1], [-2, -3]], B: [0, 1], C: [1, 0], inputs: [u], gx: [y1*u, 0], gy: [u]}
nonlinearities:
  - {f: "q1*abs(q2) + sin(t)*q1", type: {multiplier: [[1, 0, 0], [0, 1, 0], [0, 0, 0]]}, Bf: [1, 0],
      Cq: [[1, 0], [1, 1]], Dqf: [[-0.3], [0]], gq: [u, 0]}
"""


def expressions(texts, names):
    return {name: parse(text, names) for name, text in texts.items()}


def plant(dynamics, outputs, algebraic=None, inputs=(), exogenous=(), time="continuous"):
    names = {"t", *dynamics, *outputs, *(algebraic or {}), *inputs, *exogenous}
    parts = (expressions(part, names) for part in (dynamics, outputs, algebraic or {}))
    return Equations(*parts, inputs, exogenous, time)


def value_of(expression, point):
    names = sorted(expression.names)
    return float(expression.function(names)(*(point[name] for name in names)))


def at(equations, point):
    """Right sides at a point that has a value for every signal, algebraic ones included."""
    return {name: value_of(side, point) for name, side in equations.sides()}


@pytest.mark.parametrize("path", SPECS, ids=lambda p: Path(p).stem)
def test_equations_say_what_the_matrices_of_a_spec_say(path):
    spec = load(path)
    if any(block.f is None for block in spec.nonlinearities):
        with pytest.raises(UsageError, match="has no `f`"):
            spec.equations(spec.augmented)
        return
    if spec.typed:
        written = spec.typed.equations
        assert spec.equations(spec.plant).dynamics == written.dynamics
        return
    p = spec.augmented
    equations = spec.equations(p)
    random = np.random.default_rng(3)
    point = {name: float(value) for name, value in zip(equations.signals, random.uniform(0.1, 1, 999), strict=False)}
    x, w, q = (np.array([point[n] for n in names]) for names in (p.states, equations.exogenous, equations.algebraic))
    f, first = [], 0
    for block in spec.nonlinearities:
        own = {f"q{k + 1}": q[first + k] for k in range(block.nq)} | {"q": q[first]}
        f += [value_of(e, point | own) for e in block.f]
        first += block.nq
    known = [
        float(e.function(sorted(e.names))(*(point[n] for n in sorted(e.names)))) for e in (*spec.gx, *spec.gq, *spec.gy)
    ]
    gx, gq, gy = np.split(known, np.cumsum([len(spec.gx), len(spec.gq)]))
    d, found = p.doubles, at(equations, point)
    for names, M, Mf, Mw, g in (
        (p.states, d.A, d.Bf, d.B, gx), (equations.algebraic, d.Cq, d.Dqf, d.Dq, gq), (p.outputs, d.C, d.Df, d.D, gy)
    ):  # fmt: skip
        expected = M @ x + Mf @ np.array(f) + Mw @ w
        expected[: len(g)] += g
        assert [found[name] for name in names] == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", ["corless2019-magnetic-bearing", "chakrabarty2016-cubic", "pendulum"])
def test_matrices_are_a_view_of_the_equations_that_they_make(name):
    spec = load(str(Path(SPECS[0]).parent / f"{name}.yaml"))
    view = matrices(spec.equations(spec.plant))
    for matrix in MATRICES:
        assert (getattr(view, matrix) == getattr(spec.plant, matrix)).all(), matrix


def test_a_nonlinear_plant_has_matrices_where_its_terms_have_arguments():
    text = {"x1": "x2", "x2": "-sin(q) - x2/2 + u + 2*w"}
    view = matrices(plant(text, {"y": "x1 + w"}, {"q": "x1 + 0.5*x2"}, ("u",), ("w",)))
    assert (rational([["0", "1"], ["0", "-0.5"]]) == view.A).all()
    assert (view.Bf == rational([[0], [-1]])).all()
    assert (view.Cq == rational([["1", "0.5"]])).all()
    assert (rational([[0], [2]]) == view.B).all()
    assert (rational([[1]]) == view.D).all()


@pytest.mark.parametrize(("side", "said"), [("-sin(x1)", "sin\\(x1\\)"), ("x1*w", "x1\\*w"), ("q", "by itself")])
def test_what_is_not_linear_in_states_has_no_matrices(side, said):
    with pytest.raises(UsageError, match=said):
        matrices(plant({"x1": side}, {"y": "x1"}, {"q": "x1"}, (), ("w",)))


def test_a_discrete_plant_is_iterated_as_it_is_written():
    logistic = plant({"x": "r*x*(1 - x)"}, {"y": "x + d"}, inputs=("r",), exogenous=("d",), time="discrete")
    assert explicit(logistic) == logistic
    x = 0.25
    for _ in range(3):
        x = at(logistic, {"t": 0.0, "x": x, "r": 2.0, "d": 0.0, "y": np.nan})["x"]
    assert x == 0.5 * (1 - 0.5**8)  # x_k = (1 - (1 - 2 x0)^(2^k)) / 2


@pytest.mark.parametrize("time", ["continuous", "discrete"])
def test_explicit_right_sides_are_in_states_and_inputs_alone(time):
    equations = plant(
        {"x1": "x2", "x2": "-a**3 + b"}, {"y": "x1 + b"}, {"a": "x1 + u", "b": "2*a + w"}, ("u",), ("w",), time
    )
    found = explicit(equations)
    assert (found.time, found.algebraic) == (time, {})
    assert all(side.names <= {"t", "x1", "x2", "u", "w"} for _, side in found.sides())
    point = {"t": 0.0, "x1": 0.3, "x2": -1.0, "u": 0.5, "w": 0.25}
    assert at(found, point) == pytest.approx({"x1": -1.0, "x2": -(0.8**3) + 1.85, "y": 0.3 + 1.85})


def test_an_algebraic_loop_has_no_order():
    spec = loads(HEAD + LOOP)
    equations = spec.equations(spec.plant)
    assert order(equations) is None
    with pytest.raises(UsageError, match="algebraic loop"):
        explicit(equations)
    assert {name: side.names for name, side in equations.algebraic.items()} == {
        "q1_1": {"t", "x1", "u", "q1_1", "q1_2"},
        "q1_2": {"x1", "x2"},
    }


def test_names_of_signals_are_told_apart_and_known():
    with pytest.raises(UsageError, match="x: two signals"):
        plant({"x": "1"}, {"y": "x"}, inputs=("x",))
    with pytest.raises(UsageError, match="z in z is no signal"):
        Equations({"x": parse("z", ["z"])}, {})


def test_names_that_a_user_took_are_left_to_him():
    spec = loads(HEAD + "system: {states: [x, v1], A: [[0, 1], [0, 0]], B: [[1, 0], [0, 1]], C: [1, 0]}\n"
                 "nonlinearities: [{f: q, type: monotone, Bf: [1, 0], Cq: [1, 0]}]\n")  # fmt: skip
    equations = spec.equations(spec.augmented)
    assert equations.exogenous == ("v1_", "v2")
    assert equations.dynamics["x"].names == {"v1", "q1", "v1_"}


def test_what_is_linear_is_split_off_exactly():
    sides = [parse(text, ["x", "y"]) for text in ("0.1*(x + 3*sin(y)) - x/10 + 2", "(x - y)/3 + x*y + sin(y)")]
    parts = split(sides, ["x", "y"])
    assert (parts.matrix == rational([["0", "0"], ["1/3", "-1/3"]])).all()
    assert [term.text for term in parts.terms] == ["sin(y)", "1", "x*y"]
    assert (parts.weights == rational([["0.3", "2", "0"], ["1", "0", "1"]])).all()
