"""What a declared type says of every pair of arguments, as inequalities that a pair can violate."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from functools import cached_property
from math import inf
from typing import Any

import numpy as np
from flint import arb, fmpq, fmpq_mat

from obsdesign.errors import UsageError
from obsdesign.lmi.formula import Array, rational_number, zeros
from obsdesign.model.multiplier import Multiplier, Scaled, Sum
from obsdesign.nonlinearities.evidence.norm import norm_bound
from obsdesign.nonlinearities.evidence.proof import form_holds, in_hull, lipschitz_within, slope_within
from obsdesign.nonlinearities.evidence.restriction import Restriction
from obsdesign.records import dataclass
from obsdesign.tables.text import at_least, at_most

NEGLIGIBLE = 1e-6  # part of the typical change of f in which rounding errors matter


class Claim(ABC):
    """A condition on dq and df that holds for every pair of arguments."""

    @abstractmethod
    def violation(self, dq: Array, df: Array) -> Array:
        """Return how clearly pairs (N, nq), (N, nf) violate it, relative, from -1 (most) to 1; NaN is unknown.

        It is for a caller that ignores floating-point errors.
        """

    @abstractmethod
    def worst_direction(self, J: Array) -> tuple[Array, Array]:
        """Violation by close pairs around points with Jacobians J (N, nf, nq), and their directions (N, nq)."""

    @abstractmethod
    def refuted(self, dq: Array, df: Sequence[arb]) -> str | None:
        """Return why an exact dq with an enclosure of df surely violates it; None if it may not."""

    @abstractmethod
    def proved(self, f: Restriction) -> bool:
        """Whether every pair of a continuous f surely satisfies it; False says nothing."""

    def instead(self, f: Restriction) -> str:  # noqa: ARG002
        """What holds instead for an f that violates it, as an addition to the reason."""
        return ""


@dataclass(frozen=True)
class Quadratic(Claim):
    """The inequality [dq; df]' M [dq; df] >= 0."""

    M: Array  # exact

    def violation(self, dq: Array, df: Array) -> Array:
        """Value of the form, relative to that of the magnitudes."""
        length = np.linalg.norm(dq, axis=1, keepdims=True)
        slope = df / length
        return self.relative(dq / length, slope, typical(np.linalg.norm(slope, axis=1)))

    def relative(self, dq: Array, df: Array, slope: float) -> Array:
        """Value of the form for unit vectors dq, relative to that of the magnitudes.

        A df that is small for this typical slope is rated as if it were not as small: it is what rounding left.
        """
        s = np.hstack([dq, df])
        size = np.hstack([abs(dq), np.maximum(abs(df), NEGLIGIBLE * slope)])
        M = self.M.astype(float)
        with np.errstate(all="ignore"):
            value: Array = ((s @ M) * s).sum(axis=1) / ((size @ abs(M)) * size).sum(axis=1)
        return value

    def worst_direction(self, J: Array) -> tuple[Array, Array]:
        """Least eigenvalue of [I; J]' M [I; J], and its eigenvector."""
        nq = J.shape[2]
        M = self.M.astype(float)
        cross = M[:nq, nq:] @ J
        v = np.linalg.eigh(M[:nq, :nq] + cross + cross.mT + J.mT @ M[nq:, nq:] @ J)[1][..., 0]
        return self.relative(v, (J @ v[..., None])[..., 0], typical(np.linalg.norm(J, axis=(1, 2)))), v

    def refuted(self, dq: Array, df: Sequence[arb]) -> str | None:
        """Say what the form is if its enclosure is negative."""
        s = [*(arb(x) for x in dq), *df]
        value = sum((arb(self.M[i, j]) * s[i] * s[j] for i, j in np.argwhere(self.M != 0)), arb(0))
        return self.words(dq, df, value) if value < 0 else None

    def proved(self, f: Restriction) -> bool:
        """Prove it from the slopes of f, or from its Jacobian."""
        return form_holds(f, self.M)

    def words(self, dq: Array, df: Sequence[arb], value: arb) -> str:  # noqa: ARG002
        """Say what is negative."""
        return f"[dq; df]' M [dq; df] = {float(value):.6g} is negative"


@dataclass(frozen=True)
class Worded(Quadratic):
    """An inequality of the catalogue, a multiple of the quadratic form."""

    inequality: str
    factor: fmpq

    def words(self, dq: Array, df: Sequence[arb], value: arb) -> str:  # noqa: ARG002
        """Say what is negative."""
        return f"{self.inequality} = {float(arb(self.factor) * value):.6g} is negative"


@dataclass(frozen=True)
class Gain(Quadratic):
    """The inequality |df| <= k |dq|."""

    k: fmpq

    def proved(self, f: Restriction) -> bool:
        """Bound the norm of the Jacobian."""
        return lipschitz_within(f, self.k)

    def words(self, dq: Array, df: Sequence[arb], value: arb) -> str:  # noqa: ARG002
        """Compare the norms."""
        change = sum((x * x for x in df), arb(0)).sqrt()
        allowed = arb(self.k) * sum((arb(x) ** 2 for x in dq), arb(0)).sqrt()
        left, right = apart(float(change), float(allowed))
        return f"|df| = {left} exceeds {float(self.k):.12g} |dq| = {right}"

    def instead(self, f: Restriction) -> str:
        """What the Lipschitz constant is instead; nothing if no bound of it is proved."""
        try:
            norm = norm_bound(f)
        except UsageError:  # f may jump, or its derivative is too large
            return ""
        return (
            f"; the constant is between {at_least(norm.attained, 7)} and {at_most(norm.bound, 7)}"
            if norm.bound < inf
            else ""
        )


@dataclass(frozen=True)
class SlopeBounds(Quadratic):
    """Bounds of the slope of component i."""

    i: int
    low: fmpq
    high: fmpq | None

    def proved(self, f: Restriction) -> bool:
        """Bound the slope."""
        return slope_within(f, self.i, (self.low, self.high))

    def words(self, dq: Array, df: Sequence[arb], value: arb) -> str:  # noqa: ARG002
        """Say which bound is passed; without a change of q_i, that f_i depends on more."""
        name = "df/dq" if len(dq) == 1 else f"df{self.i + 1}/dq{self.i + 1}"
        if dq[self.i] == 0:
            return f"f{self.i + 1} changes by {float(df[self.i]):.6g} although q{self.i + 1} does not"
        ratio = df[self.i] / arb(dq[self.i])
        below = bool(ratio < arb(self.low))
        bound = self.low if below or self.high is None else self.high
        left, right = apart(float(ratio), float(bound))
        return f"{name} = {left} is {'below' if below else 'above'} {right}"


@dataclass(frozen=True)
class Hull(Claim):
    """df is in the convex hull of the Th_i dq, or (conic) in their cone."""

    exact: Array  # the Th_i, (count, nf, nq)
    conic: bool

    @cached_property
    def approximate(self) -> Array:
        """Matrices in doubles."""
        return self.exact.astype(float)

    def proved(self, f: Restriction) -> bool:
        """Bound the entries of the Jacobian, where the hull is a box."""
        return in_hull(f, self.exact, conic=self.conic)

    def generators(self, dq: Array) -> Array:
        """Columns Th_i dq; for a hull with a last row of ones, so that it is a cone as well."""
        columns = ((self.exact if dq.dtype == object else self.approximate) @ dq).T
        return columns if self.conic else np.vstack([columns, 0 * columns[:1] + 1])

    def target(self, df: Sequence[Any]) -> list[Any]:
        """Point that must be in the cone of the generators."""
        return list(df) if self.conic else [*df, type(df[0])(1)]

    def violation(self, dq: Array, df: Array) -> Array:
        """Relative distance of df from the cone, negative."""
        return np.array([-self.distance(x, list(y))[0] for x, y in zip(dq, df, strict=True)])

    def distance(self, dq: Array, df: list[float]) -> tuple[float, Array, Array]:
        """Distance of df from the cone, relative (NaN is unknown), with the weights and the residual."""
        from scipy.optimize import nnls

        G, b = self.generators(dq), np.array(self.target(df))
        unknown = float("nan"), np.zeros(G.shape[1]), b
        if not (np.isfinite(b).all() and np.isfinite(G).all()):
            return unknown
        try:
            weights, distance = nnls(G, b)
        except RuntimeError:  # too many iterations
            return unknown
        reach = np.linalg.norm(df) + abs(G[: len(df)]).max()
        return float(distance / max(reach, 1e-300)), weights, b - G @ weights

    def worst_direction(self, J: Array) -> tuple[Array, Array]:
        """Distance of each Jacobian from the hull, negative, and the direction in which it lies outside most."""
        nf, nq = J.shape[1:]
        whole = Hull(self.exact.reshape(-1, nf * nq, 1), self.conic)
        one = np.ones(1)
        found = [whole.distance(one, list(entries)) for entries in J.reshape(-1, nf * nq)]
        outside = np.array([residual[: nf * nq] for _, _, residual in found]).reshape(J.shape)
        return -np.array([distance for distance, _, _ in found]), np.linalg.svd(outside)[2][:, 0]

    def refuted(self, dq: Array, df: Sequence[arb]) -> str | None:
        """Separate df from the cone by an exact plane: c' G <= 0 and c' b > 0."""
        G, b = self.generators(dq), self.target(df)
        _, weights, residual = self.distance(dq.astype(float), [float(x) for x in df])
        c = orthogonal(np.array([rational_number(float(x)) for x in residual], dtype=object), G[:, weights > 0])
        if c is None or any(c @ G > 0) or not sum((arb(x) * y for x, y in zip(c, b, strict=True)), arb(0)) > 0:
            return None
        change = ", ".join(f"{float(x):.6g}" for x in df)
        combination = "nonnegative" if self.conic else "convex"
        return f"df = [{change}] is no {combination} combination of the listed matrices times dq"


def orthogonal(c: Array, span: Array) -> Array | None:
    """Part of c that is orthogonal to the columns of a matrix, exactly; None if they are dependent."""
    count = span.shape[1]
    if not count:
        return c
    gram = fmpq_mat(count, count, list((span.T @ span).ravel()))
    if gram.det() == 0:
        return None
    weights = gram.inv() * fmpq_mat(count, 1, list(span.T @ c))
    rest: Array = c - span @ np.array(weights.tolist(), dtype=object).ravel()
    return rest


def generators(multiplier: Multiplier) -> Iterator[Array]:
    """Matrices M over all of (q, f) that generate the multipliers of blocks that are sums of scaled matrices."""
    nf, nq = multiplier.member.shape
    row = column = 0
    for block in multiplier.blocks:
        parts = block.parts if isinstance(block, Sum) else (block,)
        for part in parts:
            assert isinstance(part, Scaled)
            own = [*range(column, column + block.nq), *range(nq + row, nq + row + block.nf)]
            M = zeros((nq + nf, nq + nf), [part.M11])
            M[np.ix_(own, own)] = np.block([[part.M11, part.M12], [part.M12.mT, part.M22]])
            yield M
        row, column = row + block.nf, column + block.nq


def apart(a: float, b: float) -> tuple[str, str]:
    """Two numbers in as many digits as tell them apart."""
    for digits in range(6, 17):
        texts = f"{a:.{digits}g}", f"{b:.{digits}g}"
        if texts[0] != texts[1]:
            return texts
    return repr(a), repr(b)


def typical(values: Array) -> float:
    """Median of the values that are finite and not zero."""
    known = values[np.isfinite(values) & (values > 0)]
    return float(np.median(known)) if len(known) else 0.0
