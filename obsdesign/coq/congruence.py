"""Why a matrix S is not negative, for a kernel that knows integers: a triangular T with T' S T diagonally dominant.

T is found in doubles, as the inverse of a Cholesky factor of S, and rounded; or, where doubles do not see how positive
S is, in rationals, as the inverse of L in S = L D L'. The kernel believes nothing of it: it computes T' S T.
"""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import Array

BITS = (8, 14, 22)  # of the entries of T that are found in doubles: with fewer the kernel has less to do
Columns = list[list[int]]  # of a lower triangular matrix, without their leading zeros


def congruence(S: Array) -> Columns:
    """T in integers for a symmetric S in rationals; raises `ValueError`: S has a negative eigenvalue."""
    whole = integers(S)
    for bits in BITS:
        if (rough := in_doubles(whole, bits)) is not None and dominant(whole, rough):
            return rough
    if (exact := in_rationals(whole)) is None:
        raise ValueError("the matrix has a negative eigenvalue")
    return exact


def in_doubles(S: Columns, bits: int) -> Columns | None:
    """Inverse of a Cholesky factor, rounded to so many bits; a row of zeros gets a column of the identity."""
    order = len(S)
    live = [i for i in reversed(range(order)) if any(S[i])]  # last variable first, so that T is lower triangular
    if any(S[i][i] <= 0 for i in live):
        return None
    size = {i: (S[i][i].bit_length() + 1) // 2 for i in live}  # bits of the square root of a diagonal entry
    scaled = np.array([[shifted(S[i][j], -(size[i] + size[j])) for j in live] for i in live])
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


def in_rationals(S: Columns) -> Columns | None:
    """Inverse of L' in integers, S = L D L' from the last variable on: T' S T is diagonal; None if not D >= 0."""
    order = len(S)
    rest = [[fmpq(x) for x in row] for row in S]
    T = [[fmpq(int(i == j)) for i in range(order)] for j in range(order)]  # columns
    for k in reversed(range(order)):
        pivot = rest[k][k]
        if pivot < 0 or (pivot == 0 and any(rest[k][:k])):
            return None
        for i in range(k) if pivot else ():
            factor = rest[k][i] / pivot
            if factor:
                rest[i] = [x - factor * y for x, y in zip(rest[i], rest[k], strict=True)]
                T[i] = [x - factor * y for x, y in zip(T[i], T[k], strict=True)]
    scales = (math.lcm(*(int(x.q) for x in column)) for column in T)
    return [[int(x * scale) for x in column[j:]] for j, (column, scale) in enumerate(zip(T, scales, strict=True))]


def dominant(S: Columns, T: Columns) -> bool:
    """Whether no diagonal entry of T' S T is less than the sum of the other magnitudes in its row."""
    order = len(S)
    full = [[0] * j + column for j, column in enumerate(T)]
    image = [[sum(row[k] * column[k] for k in range(j, order)) for row in S] for j, column in enumerate(full)]

    @cache
    def entry(i: int, j: int) -> int:
        return sum(full[i][k] * image[j][k] for k in range(i, order))

    return all(
        entry(i, i) >= sum(abs(entry(max(i, j), min(i, j))) for j in range(order) if j != i) for i in range(order)
    )


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
