"""The vocabulary in which a linear matrix inequality is written once and read three times.

A formula is a function from matrices to symmetric matrices that must be negative (semi)definite. It uses
`@`, `+`, `.mT` and the block builders below, so the same text is evaluated on float64 stacks (the solver's
affine map), on float64 matrices (margins) and on rationals (the proof). Rational matrices are numpy arrays of
`flint.fmpq`; a scalar unknown is a 1x1 matrix, so that `scale * M` broadcasts in all three readings.
"""

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from decimal import Decimal
from fractions import Fraction
from functools import cache, reduce
from operator import add
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt
from flint import fmpq, fmpq_mat

from obsdesign.records import dataclass, replace

Array = npt.NDArray[Any]
Exact = npt.NDArray[np.object_]  # of rationals: what a proof takes
Float = npt.NDArray[np.float64]  # of doubles: what a solver takes, and what judges structure
Values = Mapping[str, Array]
T = TypeVar("T")
CANCELLED = 1e-13  # of the terms of a sum of doubles: what is left of them where they cancel


@cache
def positions(shape: tuple[int, int], *, symmetric: bool) -> tuple[Array, Array]:
    """Row and column index of each coordinate of a matrix."""
    if symmetric:
        return np.triu_indices(shape[0])
    return np.divmod(np.arange(shape[0] * shape[1]), shape[1])


@dataclass(frozen=True)
class Unknown:
    """A matrix that the solver finds. Its coordinates are its entries (row by row; the upper triangle if symmetric)."""

    name: str
    shape: tuple[int, int]
    symmetric: bool = False

    @property
    def positions(self) -> tuple[Array, Array]:
        """Row and column index of each coordinate."""
        return positions(self.shape, symmetric=self.symmetric)

    @property
    def size(self) -> int:
        """Number of coordinates."""
        n, m = self.shape
        return n * (n + 1) // 2 if self.symmetric else n * m

    def unpack(self, coordinates: Array) -> Array:
        """Matrix (..., n, m) of the coordinates (..., size)."""
        rows, columns = self.positions
        matrix = np.zeros((*coordinates.shape[:-1], *self.shape), dtype=coordinates.dtype)
        if coordinates.dtype == object:
            matrix[...] = fmpq(0)
        matrix[..., rows, columns] = coordinates
        if self.symmetric:
            matrix[..., columns, rows] = coordinates
        return matrix

    def pack(self, matrix: Array) -> Array:
        """Coordinates of a matrix: the inverse of `unpack`."""
        return matrix[..., *self.positions]


@dataclass(frozen=True)
class Inequality:
    """`matrix` <= 0, or < 0 if strict. The name is what a certificate says holds."""

    name: str
    matrix: Array
    strict: bool = False


@dataclass(frozen=True)
class Injection:
    """The unknown enters the first inequality only, as He(left @ Y @ right), so it can be projected out."""

    unknown: str
    left: Array
    right: Array


@dataclass(frozen=True)
class NextState:
    """The first inequality is [[S, (P direct + Y output)'], [., -P]] with P and Y unknown; another is P > 0."""

    direct: Array  # (n, N)
    output: Array  # (ny, N)
    positive: str  # name of P > 0
    slow: bool  # whether V+ is near V, so that these rows are better taken out where Y is not projected out


Formula = Callable[[Values], Sequence[Inequality]]  # of the unknowns


@dataclass(frozen=True)
class Problem:
    """Minimise a linear function of the unknowns subject to `inequalities`, both affine in the unknowns.

    The units in which it is solved are those that fit the inequalities `data`; where it is None, those in which it is
    written, as long as these are not far from what fits it.
    """

    unknowns: tuple[Unknown, ...]
    inequalities: Formula
    minimise: Callable[[Values], Array] | None = None
    injection: Injection | None = None
    data: Formula | None = None
    next_state: NextState | None = None


def he(X: Array) -> Array:
    """Return X + X'."""
    return X + X.mT


def product(X: Array, Y: Array) -> Array:
    """Return X @ Y; of two rational matrices through integers over one denominator each, which large ones ask for."""
    if X.ndim != 2 or Y.ndim != 2 or X.dtype != object or Y.dtype != object or not X.size or not Y.size:
        return np.asarray(X @ Y)
    made = fmpq_mat(*X.shape, X.ravel().tolist()) * fmpq_mat(*Y.shape, Y.ravel().tolist())
    return np.array(made.entries(), dtype=object).reshape(len(X), Y.shape[1])


def combined(*pairs: tuple[Array, Array]) -> Array:
    """Sum of products; of doubles without what is left of terms that cancel, which has a size but no meaning."""
    made = reduce(add, (X @ Y for X, Y in pairs))
    if made.dtype == object:
        return np.asarray(made)
    return np.where(np.abs(made) > CANCELLED * reduce(add, (np.abs(X) @ np.abs(Y) for X, Y in pairs)), made, 0.0)


def symmetric(rows: Sequence[Sequence[Array | int]]) -> Array:
    """Symmetric block matrix from its upper triangle: row i lists blocks (i, i), (i, i+1), ..; 0 is a zero block."""
    sizes = [np.shape(row[0])[-1] for row in rows]
    blocks = [np.asarray(b) for row in rows for b in row if np.ndim(b)]
    lead = np.broadcast_shapes(*(b.shape[:-2] for b in blocks))
    edges = np.cumsum([0, *sizes])
    matrix = zeros((*lead, edges[-1], edges[-1]), like=blocks)
    for i, row in enumerate(rows):
        for j, block in enumerate(row, start=i):
            if np.ndim(block):
                here, there = slice(edges[i], edges[i + 1]), slice(edges[j], edges[j + 1])
                matrix[..., here, there] = block
                if j > i:
                    matrix[..., there, here] = np.asarray(block).mT
    return matrix


def block_diagonal(blocks: Sequence[Array]) -> Array:
    """Block-diagonal matrix of (possibly rectangular, possibly empty) blocks."""
    lead = np.broadcast_shapes(*(b.shape[:-2] for b in blocks)) if blocks else ()
    down = np.cumsum([0, *(b.shape[-2] for b in blocks)])
    across = np.cumsum([0, *(b.shape[-1] for b in blocks)])
    matrix = zeros((*lead, down[-1], across[-1]), like=blocks)
    for i, block in enumerate(blocks):
        matrix[..., down[i] : down[i + 1], across[i] : across[i + 1]] = block
    return matrix


def zeros(shape: tuple[int, ...], like: Sequence[Array]) -> Array:
    """Zeros in the numbers of the given arrays: rational as soon as one of them is."""
    if any(a.dtype == object for a in like):
        return np.full(shape, fmpq(0), dtype=object)
    return np.zeros(shape)


def identity(n: int, like: Array) -> Array:
    """Identity matrix in the numbers of the given array."""
    if like.dtype != object:
        return np.eye(n)
    made = zeros((n, n), [like])
    np.fill_diagonal(made, fmpq(1))
    return made


def rational_number(value: Any) -> fmpq:
    """Exact rational of a decimal or "p/q" text, an integer, a fraction, or a double (its binary value)."""
    if isinstance(value, fmpq):
        return value
    if isinstance(value, float):
        return fmpq(*value.as_integer_ratio())
    fraction = Fraction(value)
    return fmpq(fraction.numerator, fraction.denominator)


def decimal_number(text: str) -> fmpq:
    """Exact rational of a decimal text, quicker than of any text. Raises `ValueError`: it is not finite."""
    number = Decimal(text)
    if not number.is_finite():
        raise ValueError(f"{text} is no finite number")
    return fmpq(*number.as_integer_ratio())


def rational(matrix: npt.ArrayLike) -> Array:
    """Exact rationals of a matrix of numbers or of decimal texts, entry by entry."""
    return np.asarray(np.vectorize(rational_number, otypes=[object])(np.asarray(matrix, dtype=object)))


def printed(value: Any) -> Any:
    """Rational, or matrix of rationals, of the decimals that print the nearest doubles: what a file can hold."""
    if isinstance(value, np.ndarray):
        return np.asarray(np.vectorize(printed, otypes=[object])(value))
    return decimal_number(repr(float(value)))


def approximate(value: fmpq) -> float:
    """Double of a rational; infinite beyond the range of doubles."""
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")


def below(x: fmpq) -> float:
    """Largest double, read as the decimal that prints it, that is not above x; minus infinity where there is none."""
    double = min(approximate(x), sys.float_info.max)
    while math.isfinite(double) and printed(double) > x:
        double = math.nextafter(double, -math.inf)
    return double


def above(x: fmpq) -> float:
    """Smallest double, read as the decimal that prints it, that is not below x; infinity where there is none."""
    return -below(-x) + 0.0


def in_floats(value: T) -> T:
    """Same object with every rational number and matrix in it (dataclass fields, tuples) read as doubles."""
    if isinstance(value, fmpq):
        return cast(T, float(value))
    if isinstance(value, np.ndarray) and value.dtype == object:
        return cast(T, value.astype(float))
    if isinstance(value, tuple):
        return cast(T, tuple(in_floats(v) for v in value))
    if is_dataclass(value) and not isinstance(value, type):
        return cast(T, replace(value, **{f.name: in_floats(getattr(value, f.name)) for f in fields(value) if f.init}))
    return value
