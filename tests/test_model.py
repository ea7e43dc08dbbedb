"""The disturbance models and the augmented plant (10)-(11)."""

from dataclasses import fields

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from support.sweep import examples

from obsdesign.expressions import parse
from obsdesign.lmi.formula import rational
from obsdesign.model.disturbance import (
    Generator,
    augment,
    bias_and_sinusoid,
    double_integrator,
    integrator,
    sinusoid,
    stack,
    unknown,
)
from obsdesign.model.plant import Plant

OMEGA = fmpq(3, 2)
CATALOGUE = {
    "unknown": unknown(),
    "integrator": integrator(),
    "double-integrator": double_integrator(),
    "sinusoid": sinusoid(OMEGA),
    "bias+sinusoid": bias_and_sinusoid(OMEGA),
}
TIMES = np.linspace(0.1, 7.0, 50)


def integers(rng, *shape):
    return rational(rng.integers(-3, 4, shape))


def matrices(thing):
    return {f.name: getattr(thing, f.name) for f in fields(thing) if isinstance(getattr(thing, f.name), np.ndarray)}


def random_plant(rng, n, nf, nq, nw, ny):
    sizes = {"A": (n, n), "Bf": (n, nf), "B": (n, nw), "Cq": (nq, n), "Dqf": (nq, nf), "Dq": (nq, nw)}
    sizes |= {"C": (ny, n), "Df": (ny, nf), "D": (ny, nw)}
    labels = [tuple(f"{letter}{i}" for i in range(k)) for letter, k in (("x", n), ("w", nw), ("y", ny))]
    return Plant(
        **{name: integers(rng, *size) for name, size in sizes.items()},
        **dict(zip(("states", "exogenous", "outputs"), labels, strict=True)),
    )


def random_model(rng, nm, nf, nq, nv, nw):
    sizes = {
        "Am": (nm, nm),
        "Bmf": (nm, nf),
        "Bm": (nm, nv),
        "Cq2": (nq, nm),
        "Dq2f": (nq, nf),
        "Dq2": (nq, nv),
    }
    sizes |= {"Cm": (nw, nm), "Dwf": (nw, nf), "Dm": (nw, nv)}
    return Generator(**{name: integers(rng, *size) for name, size in sizes.items()}, inverse=(None,) * nw)


@examples(80)
@given(seed=st.integers(0, 10**6))
def test_the_augmented_plant_is_the_plant_fed_by_the_disturbance_model(seed):
    rng = np.random.default_rng(seed)
    n, ny = rng.integers(1, 4, 2)
    nf, nq, nw, nm, nf2, nq2, nv = rng.integers(0, 3, 7)
    p, m = random_plant(rng, n, nf, nq, nw, ny), random_model(rng, nm, nf2, nq2, nv, nw)
    whole = augment(p, m, tuple(f"m{i}" for i in range(nm)), tuple(f"v{i}" for i in range(nv)))
    x, xm, f, f2, v = (integers(rng, k, 1) for k in (n, nm, nf, nf2, nv))
    xi, both = np.vstack([x, xm]), np.vstack([f, f2])

    w = m.Cm @ xm + m.Dwf @ f2 + m.Dm @ v
    rates = np.vstack([p.A @ x + p.Bf @ f + p.B @ w, m.Am @ xm + m.Bmf @ f2 + m.Bm @ v])
    arguments = np.vstack([p.Cq @ x + p.Dqf @ f + p.Dq @ w, m.Cq2 @ xm + m.Dq2f @ f2 + m.Dq2 @ v])

    assert (whole.A @ xi + whole.Bf @ both + whole.B @ v == rates).all()
    assert (whole.Cq @ xi + whole.Dqf @ both + whole.Dq @ v == arguments).all()
    assert (whole.C @ xi + whole.Df @ both + whole.D @ v == p.C @ x + p.Df @ f + p.D @ w).all()
    assert len(whole.states) == whole.n == n + nm
    assert (len(whole.exogenous), whole.outputs) == (nv, p.outputs)


@examples(40)
@given(seed=st.integers(0, 10**6), names=st.lists(st.sampled_from(sorted(CATALOGUE)), min_size=1, max_size=3))
def test_every_entry_of_an_augmented_plant_is_rational_even_over_empty_dimensions(seed, names):
    rng = np.random.default_rng(seed)
    model = stack([CATALOGUE[name] for name in names])
    p = random_plant(rng, 2, rng.integers(0, 2), rng.integers(0, 2), len(names), 1)
    nm, nv = model.Bm.shape
    whole = augment(p, model, ("m",) * nm, ("v",) * nv)
    for name, matrix in matrices(whole).items():
        assert all(type(entry) is fmpq for entry in matrix.ravel()), name


def test_without_a_disturbance_model_the_plant_stays_what_it_is():
    p = random_plant(np.random.default_rng(0), 3, 1, 1, 2, 2)
    same = augment(p, stack([unknown(), unknown()]), (), ("v1", "v2"))
    for name, matrix in matrices(p).items():
        assert np.array_equal(matrix, matrices(same)[name]), name


def test_the_bearing_augmented_with_integrators_is_the_printed_one():
    p = Plant(
        A=rational([[0, 1, 0], [0, 0, 1], [0, 0, 0]]),
        Bf=rational([[0], [1], [0]]),
        B=rational([[1, 0], [0, 0], [0, 1]]),
        Cq=rational([[0, 0, 1]]),
        Dqf=rational([[0]]),
        Dq=rational([[0, 0]]),
        C=rational([[1, 0, 0], [0, 1, 0]]),
        Df=rational([[0], [0]]),
        D=rational([["0.1", 0], [0, 0]]),
        states=("x1", "x2", "x3"),
        exogenous=("w1", "w2"),
        outputs=("y1", "y2"),
    )
    whole = augment(p, stack([integrator(), integrator()]), ("w1", "w2"), ("v1", "v2"))
    assert whole.states == ("x1", "x2", "x3", "w1", "w2")
    assert np.array_equal(whole.A, rational([[0, 1, 0, 1, 0], [0, 0, 1, 0, 0], [0, 0, 0, 0, 1], [0] * 5, [0] * 5]))
    assert np.array_equal(whole.B, rational([[0, 0], [0, 0], [0, 0], [1, 0], [0, 1]]))
    assert np.array_equal(whole.C, rational([[1, 0, 0, "0.1", 0], [0, 1, 0, 0, 0]]))
    assert np.array_equal(whole.Bf, rational([[0], [1], [0], [0], [0]]))
    assert np.array_equal(whole.Cq, rational([[0, 0, 1, 0, 0]]))
    assert not whole.D.any()


def transfer_at(value, model):
    """Transfer function C (s I - A)^-1 B + D of a disturbance model at s = value."""
    A, B, C, D = (np.array(getattr(model, name), dtype=float) for name in ("Am", "Bm", "Cm", "Dm"))
    return C @ np.linalg.solve(value * np.eye(len(A)) - A, B) + D


@pytest.mark.parametrize(
    ("name", "transfer"),
    [
        ("unknown", lambda s: [[s**0]]),
        ("integrator", lambda s: [[1 / s]]),
        ("double-integrator", lambda s: [[1 / s**2]]),
        ("sinusoid", lambda s: [[1 / (s**2 + 2.25)]]),
        ("bias+sinusoid", lambda s: [[1 / s, 1 / (s**2 + 2.25)]]),
    ],
)
def test_a_model_of_the_catalogue_has_its_transfer_function(name, transfer):
    for s in (0.7, 1 + 2j, -3 - 1j):
        assert transfer_at(s, CATALOGUE[name]) == pytest.approx(np.array(transfer(s)))


def at(expressions, times=TIMES):
    return np.array([e.function(["t"])(times) for e in expressions]).reshape(len(expressions), len(times))


SIGNALS = {
    "exp(-t)*sin(3*t)": lambda t: (
        np.exp(-t) * np.sin(3 * t),
        np.exp(-t) * (3 * np.cos(3 * t) - np.sin(3 * t)),
        np.exp(-t) * (-8 * np.sin(3 * t) - 6 * np.cos(3 * t)),
    ),
    "log(1+t)": lambda t: (np.log1p(t), 1 / (1 + t), -1 / (1 + t) ** 2),
    "t**3 - 2": lambda t: (t**3 - 2, 3 * t**2, 6 * t),
}


def rate(signal):
    return signal.derivative("t")


@pytest.mark.parametrize("text", SIGNALS)
@pytest.mark.parametrize(
    ("name", "coefficients", "order"),
    [
        ("unknown", [1, 0, 0], 0),
        ("integrator", [0, 1, 0], 1),
        ("double-integrator", [0, 0, 1], 2),
        ("sinusoid", [2.25, 0, 1], 2),
    ],
)
def test_the_drive_of_a_given_disturbance_is_found(text, name, coefficients, order):
    derivatives = np.array(SIGNALS[text](TIMES))
    drive, states = CATALOGUE[name].drive([parse(text, ["t"])], rate)
    assert at(drive) == pytest.approx(np.array([coefficients @ derivatives]), rel=1e-9, abs=1e-9)
    assert at(states) == pytest.approx(derivatives[:order], rel=1e-9, abs=1e-9)


def test_the_drives_and_states_of_stacked_channels_follow_their_order():
    model = stack([sinusoid(OMEGA), unknown(), integrator()])
    drive, states = model.drive([parse(text, ["t"]) for text in ("sin(t)", "t", "t**2")], rate)
    t = TIMES
    assert at(drive) == pytest.approx(np.array([1.25 * np.sin(t), t, 2 * t]))
    assert at(states) == pytest.approx(np.array([np.sin(t), np.cos(t), t**2]))


@pytest.mark.parametrize("text", SIGNALS)
def test_what_is_driven_satisfies_the_equations_of_the_model(text):
    model = stack([double_integrator(), sinusoid(OMEGA), integrator(), unknown()])
    signals = [parse(s, ["t"]) for s in (text, "sin(2*t)", "1/sqrt(1+t)", text)]
    drive, states = model.drive(signals, rate)
    v, xm, w = at(drive), at(states), at(signals)
    Am, Bm, Cm, Dm = (getattr(model, name).astype(float) for name in ("Am", "Bm", "Cm", "Dm"))
    assert at([x.derivative("t") for x in states]) == pytest.approx(Am @ xm + Bm @ v, rel=1e-9, abs=1e-9)
    assert Cm @ xm + Dm @ v == pytest.approx(w)


def test_a_bias_and_a_sinusoid_in_one_channel_are_not_determined_by_their_sum():
    w = [parse("1 + sin(t)", ["t"])]
    assert bias_and_sinusoid(OMEGA).drive(w, rate) is None
    assert stack([integrator(), bias_and_sinusoid(OMEGA)]).drive(w * 2, rate) is None
