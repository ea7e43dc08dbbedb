"""Why a matrix S is not negative, for a kernel that knows integers: a triangular T with T' S T diagonally dominant.

T is found in doubles, as the inverse of a Cholesky factor of S, and rounded; where S is singular beside its rows of
zeros, or nearly so, in rationals. Nothing is believed of it: the kernel computes T' S T, and with a wrong T it accepts
nothing.
"""

import math
from collections.abc import Sequence

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import Array

BITS = (8, 14, 22)  # of the entries of T: with fewer the kernel has less to do


def congruence(S: Array) -> list[list[int]] | None:
    """Columns of a lower triangular T in integers, without their leading zeros; None if S is not positive.

    `S`: symmetric, in rationals.
    """
    tried = (rounded(S, bits) for bits in BITS)
    return next((found for found in tried if found and dominant(S, found)), None) or orthogonal(S)


def dominant(S: Array, columns: Sequence[Sequence[int]]) -> bool:
    """Whether no diagonal entry of T' S T is less than the sum of the others of its row, without their signs."""
    T = np.array([[0] * j + list(column) for j, column in enumerate(columns)], dtype=object).T
    turned = T.T @ np.array(integers(S), dtype=object) @ T
    return all(2 * row[i] >= sum(map(abs, row)) for i, row in enumerate(turned))


def orthogonal(S: Array) -> list[list[int]] | None:
    """Columns of a T that makes S diagonal, one after the other, in rationals; None if S is not >= 0."""
    order = len(S)
    columns: list[tuple[list[fmpq], list[fmpq], fmpq]] = []  # of T, the last one first; S times it; entry of T' S T
    for j in reversed(range(order)):
        column = [fmpq(int(i == j)) for i in range(order)]
        for other, image, size in columns:
            if size:
                share = image[j] / size
                column = [a - share * b for a, b in zip(column, other, strict=True)]
        image = [sum((x * a for x, a in zip(row, column, strict=True) if x and a), fmpq(0)) for row in S]
        size = image[j]
        if size < 0 or (size == 0 and any(image)):
            return None
        columns.append((column, image, size))
    found = [column for column, _, _ in reversed(columns)]
    return [integers(np.array([column[j:]]))[0] for j, column in enumerate(found)]


def rounded(S: Array, bits: int) -> list[list[int]] | None:
    """The same with a T of so many bits that is found in doubles; None if these do not see that S is positive.

    A row of zeros gets a column of the identity.
    """
    whole = integers(S)
    order = len(whole)
    live = [i for i in reversed(range(order)) if any(whole[i])]  # last variable first, so that T is lower triangular
    if any(whole[i][i] <= 0 for i in live):
        return None
    size = {i: (whole[i][i].bit_length() + 1) // 2 for i in live}  # bits of the square root of a diagonal entry
    scaled = np.array([[shifted(whole[i][j], -(size[i] + size[j])) for j in live] for i in live])
    try:
        inverse = np.linalg.inv(np.linalg.cholesky(scaled.reshape(len(live), len(live))))
    except np.linalg.LinAlgError:
        return None
    largest = max(size.values(), default=0)
    columns = [[int(i == j) for i in range(order)] for j in range(order)]
    for row, j in zip(inverse, live, strict=True):
        entry = {i: round(float(x) * 2.0**bits) << (largest - size[i]) for x, i in zip(row, live, strict=True)}
        columns[j] = [entry.get(i, 0) for i in range(order)]
    return [column[j:] for j, column in enumerate(columns)] if all(c[j] for j, c in enumerate(columns)) else None


def integers(S: Array) -> list[list[int]]:
    """Least multiple of a matrix of rationals that has integers only."""
    entries = [[fmpq(x) for x in row] for row in S]
    common = math.lcm(*(int(x.q) for row in entries for x in row))
    return [[int(x.p) * (common // int(x.q)) for x in row] for row in entries]


def shifted(x: int, power: int) -> float:
    """X 2^power in doubles, for x of any length."""
    spare = max(x.bit_length() - 60, 0)
    return math.ldexp(x >> spare, spare + power)


def triangle(columns: Sequence[Sequence[int]]) -> str:
    """The columns as a list of lists of integers in Coq."""
    return "[" + ";\n  ".join("[" + "; ".join(map(str, column)) + "]" for column in columns) + "]"
