"""Kernels and eigenvalues in rationals, of matrices that may have more rows than columns.

M(lambda) = M0 - lambda M1 has a kernel at every lambda, or at some: with V the largest space such that M0 V lies in
M1 V, N the kernel of M1 in V, and X a complement of N in V, it is that of [A - lambda I, B] where M0 X = M1 X A and
M0 N = M1 X B. So B = 0 leaves the eigenvalues of A, and any other B every lambda, with more at the eigenvalues that
(A, B) does not control (Popov, Belevitch and Hautus).
"""

from collections.abc import Iterable, Mapping, Sequence

from flint import fmpq, fmpq_mat, fmpq_poly

from obsdesign.records import dataclass

Vector = list[fmpq]


@dataclass(frozen=True)
class Eigenvalues:
    """Numbers lambda at which M0 - lambda M1 has a kernel that is none of M1."""

    every: bool  # it has one at every lambda
    rational: tuple[fmpq, ...] = ()  # where it has one, or more of one
    others: tuple[fmpq_poly, ...] = ()  # further ones are roots of these, and not rational


def table(columns: Sequence[Mapping[object, fmpq]]) -> fmpq_mat:
    """Matrix of columns that are given by their entries other than zero; equal rows stand once."""
    entries: dict[object, list[tuple[int, fmpq]]] = {}
    for j, column in enumerate(columns):
        for key, value in column.items():
            entries.setdefault(key, []).append((j, value))
    rows = dict.fromkeys(tuple(row) for row in entries.values())
    zero, places = fmpq(0), range(len(columns))
    return fmpq_mat(len(rows), len(columns), [row.get(j, zero) for row in map(dict, rows) for j in places])


def pivots(reduced: fmpq_mat, rank: int) -> list[int]:
    """Column of the first entry of each row of an echelon form."""
    places: list[int] = []
    for i in range(rank):
        first = places[-1] + 1 if places else 0
        places.append(next(j for j in range(first, reduced.ncols()) if reduced[i, j] != 0))
    return places


def kernel(M: fmpq_mat) -> list[Vector]:
    """Basis of the kernel, each vector 1 at the last of its entries and 0 at the last ones of the others."""
    reduced, rank = M.rref()
    places, vectors = pivots(reduced, rank), []
    for free in sorted(set(range(M.ncols())) - set(places)):
        vector = [fmpq(0)] * M.ncols()
        vector[free] = fmpq(1)
        for i, place in enumerate(places):
            vector[place] = -reduced[i, free]
        vectors.append(vector)
    return vectors


def independent(M: fmpq_mat) -> list[int]:
    """Columns that are no combination of those before them."""
    return pivots(*M.rref())


def columns(M: fmpq_mat, chosen: Iterable[int]) -> fmpq_mat:
    """Some columns of a matrix."""
    places = list(chosen)
    return fmpq_mat(M.nrows(), len(places), [M[i, j] for i in range(M.nrows()) for j in places])


def beside(*blocks: fmpq_mat) -> fmpq_mat:
    """Blocks in one row."""
    width = sum(block.ncols() for block in blocks)
    rows = [[block[i, j] for block in blocks for j in range(block.ncols())] for i in range(blocks[0].nrows())]
    return fmpq_mat(blocks[0].nrows(), width, [entry for row in rows for entry in row])


def basis(vectors: Sequence[Vector], size: int) -> fmpq_mat:
    """Vectors of so many entries as columns, those left out that depend on the ones before them."""
    M = fmpq_mat(size, len(vectors), [vector[i] for i in range(size) for vector in vectors])
    return columns(M, independent(M))


def identity(n: int) -> fmpq_mat:
    """I."""
    return fmpq_mat(n, n, [fmpq(int(i == j)) for i in range(n) for j in range(n)])


def invariant(M0: fmpq_mat, M1: fmpq_mat) -> fmpq_mat:
    """Largest V such that M0 V lies in M1 V (a Wong sequence), its basis as columns."""
    V = identity(M0.ncols())
    while True:
        size = V.ncols()
        images = kernel(beside(M0 * V, M1 * V)) if size else []
        inside = basis([vector[:size] for vector in images], size)
        if inside.ncols() == size:
            return V
        V = V * inside


def eigenvalues(M0: fmpq_mat, M1: fmpq_mat) -> Eigenvalues:
    """Where M0 - lambda M1 has a kernel that is none of M1, exactly."""
    V = invariant(M0, M1)
    image = M1 * V
    places = independent(image)
    if not places:
        return Eigenvalues(every=False)
    null = V * basis(kernel(image), V.ncols())
    images = beside(columns(image, places), M0 * columns(V, places), M0 * null).rref()[0]
    n = len(places)
    A = fmpq_mat(n, n, [images[i, n + j] for i in range(n) for j in range(n)])
    B = fmpq_mat(n, null.ncols(), [images[i, 2 * n + j] for i in range(n) for j in range(null.ncols())])
    reached = controlled(A, B)
    whole = basis([*listed(reached), *listed(identity(n))], n)
    k = reached.ncols()
    turned = whole.inv() * A * whole
    rest = fmpq_mat(n - k, n - k, [turned[i, j] for i in range(k, n) for j in range(k, n)])
    roots = rest.charpoly().factor()[1] if n > k else []
    lines = [factor for factor, _ in roots if factor.degree() == 1]
    return Eigenvalues(
        every=k > 0,
        rational=tuple(sorted(-line[0] / line[1] for line in lines)),
        others=tuple(factor for factor, _ in roots if factor.degree() > 1),
    )


def listed(M: fmpq_mat) -> list[Vector]:
    """Columns of a matrix."""
    return [[M[i, j] for i in range(M.nrows())] for j in range(M.ncols())]


def controlled(A: fmpq_mat, B: fmpq_mat) -> fmpq_mat:
    """Basis of the sum of the images of B, A B, A^2 B, .."""
    n = A.nrows()
    reached = basis(listed(B), n)
    while True:
        further = basis([*listed(reached), *listed(A * reached)], n) if reached.ncols() else reached
        if further.ncols() == reached.ncols():
            return reached
        reached = further
