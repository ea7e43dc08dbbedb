"""Whether the data of a type fit the sizes of q and f."""

from obsdesign.errors import UsageError
from obsdesign.lmi.formula import Array


def require_shape(what: str, matrix: Array, rows: int, columns: int) -> None:
    """Refuse, by a `UsageError`, a matrix of another shape than q and f make it."""
    if matrix.shape != (rows, columns):
        given = " x ".join(map(str, matrix.shape))
        raise UsageError(f"{what} is {given}, and q and f make it {rows} x {columns}")


def require_as_many(what: str, nq: int, nf: int) -> None:
    """Refuse, by a `UsageError`, an f of another size than q."""
    if nf != nq:
        raise UsageError(f"{what}: f has {nf} components and q has {nq}; it takes as many of both")
