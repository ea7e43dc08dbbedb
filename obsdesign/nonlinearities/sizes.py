"""Whether the data of a type fit the sizes of q and f."""

from obsdesign.errors import UsageError
from obsdesign.lmi.formula import Array


def require_shape(what: str, matrix: Array, rows: int, columns: int) -> None:
    """Refuse a matrix of another shape than q and f make it.

    Raises
    ------
    UsageError
        The matrix is not rows x columns.
    """
    if matrix.shape != (rows, columns):
        given = " x ".join(map(str, matrix.shape))
        raise UsageError(f"{what} is {given}, and q and f make it {rows} x {columns}")


def require_as_many(what: str, nq: int, nf: int) -> None:
    """Refuse an f of another size than q.

    Raises
    ------
    UsageError
        nf is not nq.
    """
    if nf != nq:
        raise UsageError(f"{what}: f has {nf} components and q has {nq}; it takes as many of both")
