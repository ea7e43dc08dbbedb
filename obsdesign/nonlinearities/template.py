"""A type of nonlinearity: what it assumes of f, what data it takes, and what follows from it."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.lmi.formula import Array
from obsdesign.model.multiplier import Multiplier
from obsdesign.nonlinearities.data import Data
from obsdesign.nonlinearities.evidence.automatic import Choice
from obsdesign.nonlinearities.evidence.claims import Claim, Quadratic, Worded, generators
from obsdesign.nonlinearities.evidence.proof import surely
from obsdesign.nonlinearities.evidence.restriction import Restriction
from obsdesign.records import dataclass

Slopes = list[tuple[fmpq, fmpq | None]]


@dataclass(frozen=True)
class Template:
    """A type; only its multiplier is needed, and the rest is what more is known of it."""

    multiplier: Callable[[Any, int, int], Multiplier]  # of (data, nq, nf)
    data: Data | None = None  # None: it takes none
    square: bool = True  # nf = nq
    inequalities: tuple[tuple[str, fmpq], ...] = ()  # of each scale: the inequality, as this factor times the form of M
    derive: Callable[[Restriction], Choice] | None = None  # data from f, for `auto`
    f: str | None = None  # the function itself, an expression of q, where the type names one
    slopes: Callable[[Any, int], Slopes] = lambda *_: []  # of (data, nq): of each f_i that depends on q_i only
    lipschitz: bool = False  # whether the data are a Lipschitz constant of f
    conditions: Callable[[Any, Multiplier], Iterable[Claim]] | None = None  # on a pair of arguments; None: of M

    def __call__(self, data: Any, nq: int, nf: int) -> Multiplier:
        """Multiplier of f with nf components of an argument with nq; raises `UsageError` if there is none."""
        return self.multiplier(data, nq, nf)

    def claims(self, data: Any, multiplier: Multiplier) -> Iterator[Claim]:
        """Conditions that a pair of arguments can violate; else inequalities, if M is a sum of scaled matrices."""
        if self.conditions is not None:
            yield from self.conditions(data, multiplier)
            return
        matrices = list(generators(multiplier))
        if len(self.inequalities) == len(matrices):
            yield from (Worded(M, *words) for M, words in zip(matrices, self.inequalities, strict=True))
        else:
            yield from map(Quadratic, matrices)

    def constants(self, data: Any, nq: int) -> tuple[fmpq, ...]:
        """Lipschitz constant of f, or one for each component with a slope of its own; empty if none is known."""
        if self.lipschitz:
            return (data,)
        slopes = self.slopes(data, nq)
        if not all(high is not None for _, high in slopes):
            return ()
        return tuple(max(abs(low), abs(high)) for low, high in slopes if high is not None)

    def proved(self, f: Restriction, data: Any) -> bool:
        """Whether f surely is of this type on its region; False says nothing."""
        claims = self.claims(data, self(data, f.nq, len(f.f)))
        return surely(f, lambda: all(claim.proved(f) for claim in claims))


def require_shape(what: str, matrix: Array, rows: int, columns: int) -> None:
    """Refuse, by a `UsageError`, a matrix of another shape than q and f make it."""
    if matrix.shape != (rows, columns):
        given = " x ".join(map(str, matrix.shape))
        raise UsageError(f"{what} is {given}, and q and f make it {rows} x {columns}", id="OBS209")


def require_matrices(what: str, missing: str, matrices: Sequence[Array], rows: int, columns: int) -> None:
    """Refuse, by a `UsageError`, an empty list of matrices, with what to list, and one of another shape."""
    if not matrices:
        raise UsageError(f"{what}: there is no matrix; list {missing}", id="OBS209")
    for i, matrix in enumerate(matrices, start=1):
        require_shape(f"{what}: matrix {i}", matrix, rows, columns)


def require_as_many(what: str, nq: int, nf: int) -> None:
    """Refuse, by a `UsageError`, an f of another size than q."""
    if nf != nq:
        raise UsageError(f"{what}: f has {nf} components and q has {nq}; it takes as many of both", id="OBS209")
