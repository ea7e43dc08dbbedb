"""Disturbance models, which generate an exogenous input w from an unknown v, and the augmented plant.

Equations (2), (10) and (11) of Corless and Chakrabarty (2019).
"""

from collections.abc import Callable, Sequence
from dataclasses import fields
from math import cos, sin
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array, Exact, block_diagonal, identity, printed, rational, zeros
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass, replace


@dataclass(frozen=True)
class Generator:
    """Model of the exogenous input w, driven by an unknown v; of samples xm+ in place of xm'.

    xm' = Am xm + Bmf f2 + Bm v
    q2  = Cq2 xm + Dq2f f2 + Dq2 v
    w   = Cm xm + Dwf f2 + Dm v

    `inverse` holds, for each channel of w that determines its v, the coefficients c of v = c0 w + c1 w' + ..,
    or of v_k = c0 w_k + c1 w_{k+1} + ..; it is None where w does not determine v.
    """

    Am: Array  # (nm, nm)
    Bmf: Array  # (nm, nf2)
    Bm: Array  # (nm, nv)
    Cq2: Array  # (nq2, nm)
    Dq2f: Array  # (nq2, nf2)
    Dq2: Array  # (nq2, nv)
    Cm: Array  # (nw, nm)
    Dwf: Array  # (nw, nf2)
    Dm: Array  # (nw, nv)
    inverse: tuple[tuple[fmpq, ...] | None, ...]

    @property
    def direct(self) -> bool:
        """Whether w is v: there is no model."""
        return not (len(self.Am) or self.Bmf.shape[1]) and np.array_equal(self.Dm, identity(len(self.Dm), self.Dm))

    def drive(
        self, w: Sequence[Expression], following: Callable[[Expression], Expression]
    ) -> tuple[tuple[Expression, ...], tuple[Expression, ...]] | None:
        """Return v(t) and xm(t) that generate the given w(t), or None where w does not determine them.

        `following`: the derivative of a signal of time, or in discrete time the signal a sample later.
        """
        v: list[Expression] = []
        xm: list[Expression] = []
        for signal, coefficients in zip(w, self.inverse, strict=True):
            if coefficients is None:
                return None
            signals = [signal]
            for _ in coefficients[1:]:
                signals.append(following(signals[-1]))
            own = slice(len(xm), len(xm) + len(coefficients) - 1)
            xm += [Expression.combination(row, signals[: len(row)]) for row in chain(self.Am[own, own])]
            v.append(Expression.combination(coefficients, signals))
        return tuple(v), tuple(xm)


def chain(A: Array) -> list[list[fmpq]]:
    """States of a model of one channel, each by its coefficients in w, w', .. or in w, w+, .., given A (m, m) exact.

    The first is w, and the input drives the last: beside itself and those before it, each is driven by the next alone.
    """
    m = len(A)
    rows = identity(m, like=A)
    for i in range(m - 1):
        rows[i + 1] = (np.roll(rows[i], 1) - A[i, : i + 1] @ rows[: i + 1]) / A[i, i + 1]
    return [list(row[: i + 1]) for i, row in enumerate(rows)]


def linear(Am: Array, Bm: Array, Cm: Array, Dm: Array, inverse: tuple[fmpq, ...] | None) -> Generator:
    """Linear model of one channel of w."""
    nm, nv, nw = Am.shape[0], Bm.shape[1], Cm.shape[0]
    return Generator(
        Am, empty(nm, 0), Bm,
        empty(0, nm), empty(0, 0), empty(0, nv),
        Cm, empty(nw, 0), Dm,
        inverse=(inverse,),
    )  # fmt: skip


def unknown() -> Generator:
    """Model w = v."""
    return linear(empty(0, 0), empty(0, 1), empty(1, 0), rational([[1]]), (fmpq(1),))


def empty(rows: int, columns: int) -> Array:
    """Exact matrix without entries."""
    return np.empty((rows, columns), dtype=object)


def integrator(period: fmpq | None = None) -> Generator:
    """Model w' = v; of samples w+ = w + period v."""
    if period is None:
        return linear(rational([[0]]), rational([[1]]), rational([[1]]), rational([[0]]), (fmpq(0), fmpq(1)))
    return linear(rational([[1]]), rational([[period]]), rational([[1]]), rational([[0]]), (-1 / period, 1 / period))


def double_integrator(period: fmpq | None = None) -> Generator:
    """Model w'' = v; of samples (w_{k+2} - 2 w_{k+1} + w_k) / period^2 = v_k."""
    if period is None:
        return sinusoid(fmpq(0))
    inverse = tuple(c / (period * period) for c in (fmpq(1), fmpq(-2), fmpq(1)))
    return second_order([[1, period], [0, 1]], period, inverse)


def sinusoid(omega: fmpq, period: fmpq | None = None) -> Generator:
    """Model w'' = -omega^2 w + v, omega in rad/s.

    Of samples xm+ = [c, s/omega; -omega s, c] xm + [0; period] v with c = cos(omega period), s = sin(omega period),
    rounded to doubles: the model is the rounded one. v_k is
    (w_{k+2} - 2 c w_{k+1} + (c^2 + s^2) w_k) omega / (s period); it needs omega period < pi.
    """
    if period is None:
        inverse = (omega * omega, fmpq(0), fmpq(1))
        Am = rational([[0, 1], [-omega * omega, 0]])
        return linear(Am, rational([[0], [1]]), rational([[1, 0]]), rational([[0]]), inverse)
    c, s = (printed(f(float(omega * period))) for f in (cos, sin))
    drive = omega / (s * period)
    inverse = ((c * c + s * s) * drive, -2 * c * drive, drive)
    return second_order([[c, s / omega], [-omega * s, c]], period, inverse)


def second_order(Am: list[list[Any]], period: fmpq, inverse: tuple[fmpq, ...]) -> Generator:
    """Linear model of one channel of w in samples, driven through its second state."""
    Bm = rational([[0], [period]])
    return linear(rational(Am), Bm, rational([[1, 0]]), rational([[0]]), inverse)


def bias_and_sinusoid(omega: fmpq, period: fmpq | None = None) -> Generator:
    """Model w = b + s, b' = v1, s'' = -omega^2 s + v2; w alone does not say how it splits."""
    parts = integrator(period), sinusoid(omega, period)
    Am, Bm = (block_diagonal([getattr(part, name) for part in parts]) for name in ("Am", "Bm"))
    return linear(Am, Bm, rational([[1, 1, 0]]), rational([[0, 0]]), None)


def stack(generators: Sequence[Generator]) -> Generator:
    """Independent models of the channels of w, one under the other."""
    matrices = [f.name for f in fields(Generator) if f.name != "inverse"]
    blocks = {name: block_diagonal([getattr(g, name) for g in generators]) for name in matrices}
    return Generator(**blocks, inverse=tuple(c for g in generators for c in g.inverse))


def augment(plant: Plant[Exact], model: Generator, names: tuple[str, ...], drives: tuple[str, ...]) -> Plant[Exact]:
    """Append a disturbance model to a plant: xi = (x, xm), driven by v, with f = (f1, f2) and q = (q1, q2).

    `plant`, `model`: n states and nw exogenous inputs; nm states, nv inputs and nw outputs; `names`, `drives`: names of
    the nm states xm and of the nv inputs v.
    """
    nm, nq2 = model.Am.shape[0], model.Cq2.shape[0]
    n, nf = plant.n, plant.Bf.shape[1]
    return Plant(
        A=blocks([[plant.A, plant.B @ model.Cm], [np.zeros((nm, n)), model.Am]]),
        Bf=blocks([[plant.Bf, plant.B @ model.Dwf], [np.zeros((nm, nf)), model.Bmf]]),
        B=blocks([[plant.B @ model.Dm], [model.Bm]]),
        Cq=blocks([[plant.Cq, plant.Dq @ model.Cm], [np.zeros((nq2, n)), model.Cq2]]),
        Dqf=blocks([[plant.Dqf, plant.Dq @ model.Dwf], [np.zeros((nq2, nf)), model.Dq2f]]),
        Dq=blocks([[plant.Dq @ model.Dm], [model.Dq2]]),
        C=blocks([[plant.C, plant.D @ model.Cm]]),
        Df=blocks([[plant.Df, plant.D @ model.Dwf]]),
        D=blocks([[plant.D @ model.Dm]]),
        states=plant.states + names,
        exogenous=drives,
        outputs=plant.outputs,
    )


def with_inputs(plant: Plant[Exact], model: Generator, names: tuple[str, ...]) -> Plant[Exact]:
    """Return a plant, to which its disturbance model was appended, with w among its outputs, after y.

    `names`: of these nw outputs.
    """
    nw, nm = model.Cm.shape
    beside_x = zeros((nw, plant.n - nm), [plant.A])
    beside_f = zeros((nw, plant.Bf.shape[1] - model.Dwf.shape[1]), [plant.A])
    return replace(
        plant,
        C=blocks([[plant.C], [np.hstack([beside_x, model.Cm])]]),
        Df=blocks([[plant.Df], [np.hstack([beside_f, model.Dwf])]]),
        D=blocks([[plant.D], [model.Dm]]),
        outputs=(*plant.outputs, *names),
    )


def rows_of(x: Sequence[str], xm: Sequence[str], w: Sequence[str], model: Generator) -> dict[str, Array | None]:
    """Row over (x, xm) of each state and each w by name; None where w has a feedthrough from v or f."""
    size = len(x) + len(xm)
    own = np.where(np.eye(size, dtype=bool), fmpq(1), fmpq(0))
    table: dict[str, Array | None] = dict(zip((*x, *xm), own, strict=True))
    for name, row, direct, curved in zip(w, model.Cm, model.Dm, model.Dwf, strict=True):
        whole = blocks([[np.zeros((1, len(x))), row[None]]])[0]
        table.setdefault(name, None if direct.any() or curved.any() else whole)
    return table


def blocks(rows: Sequence[Sequence[Array]]) -> Array:
    """Exact matrix of blocks; numpy gives integers for a product over an empty dimension."""
    return rational(np.block([list(row) for row in rows]))
