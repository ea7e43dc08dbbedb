"""The scaled unscented transform: sigma points of a mean and a covariance, and what a function makes of them."""

from collections.abc import Mapping, Sequence

import numpy as np

from obsdesign.expressions import Expression, parse
from obsdesign.families.filters.request import FilterRequest
from obsdesign.families.filters.symbols import Signals, numbers, times
from obsdesign.lmi.formula import Array
from obsdesign.model.equations import Named
from obsdesign.records import dataclass

ROOT = parse("sqrt(p)", ["p"])
SURE_ROOT = parse("sqrt(max(p, 0))", ["p"])
QUOTIENT = parse("p/d", ["p", "d"])
SURE_QUOTIENT = parse("where(d > 0, p/d, 0)", ["p", "d"])


@dataclass(frozen=True)
class Transform:
    """Scaled unscented transform of m signals (Julier, 2002; Wan and van der Merwe, 2000).

    X_0 = mean, X_i = mean + sqrt(m + lambda) L_i, X_(m+i) = mean - sqrt(m + lambda) L_i, with cov = L L', L lower
    triangular, lambda = alpha^2 (m + kappa) - m, and the weights Wm_0 = lambda / (m + lambda), Wc_0 = Wm_0 + 1 -
    alpha^2 + beta, and 1 / (2 (m + lambda)) of all others.

    `sure`: a variance that rounding makes negative counts as 0, instead of having no root.
    """

    signals: Signals
    request: FilterRequest
    sure: bool

    def spread(self, m: int) -> float:
        """Return m + lambda = alpha^2 (m + kappa)."""
        return float(self.request.alpha**2 * (m + self.request.kappa))

    def root(self, cov: Array, letter: str) -> Array:
        """Return L, by Cholesky, its entries under names of a letter."""
        m = len(cov)
        L = np.full((m, m), Expression.number(0), dtype=object)
        root, quotient = (SURE_ROOT, SURE_QUOTIENT) if self.sure else (ROOT, QUOTIENT)
        for j in range(m):
            for i in range(j, m):
                rest = cov[i, j] - sum(map(Expression.__mul__, L[i, :j], L[j, :j]), Expression.number(0))
                side = root.substituted({"p": rest}) if i == j else quotient.substituted({"p": rest, "d": L[j, j]})
                L[i, j] = self.signals.named(f"{letter}_{i + 1}_{j + 1}", side)
        return L

    def points(self, mean: Named, L: Array, letter: str) -> list[dict[str, Expression]]:
        """Sigma points, 2 m + 1 of them, by the names of the signals; each value under a name of a letter."""
        steps = times(L, numbers(np.sqrt(self.spread(len(L))) * np.eye(len(L))))
        minus = times(steps, numbers(-np.eye(len(L))))
        found = [dict(mean)]
        for sign, moves in (("p", steps), ("m", minus)):
            for k, move in enumerate(moves.T, start=1):
                sides = zip(mean.items(), move, strict=True)
                found.append(
                    {name: self.signals.named(f"{letter}{sign}{k}_{name}", at + step) for (name, at), step in sides}
                )
        return found

    def images(self, of: Named, points: Sequence[Named], letter: str) -> Array:
        """Values of some right sides at the points, (2 m + 1, sides), under names."""
        return np.array(
            [
                [self.signals.named(f"{letter}{k}_{name}", side.substituted(point)) for name, side in of.items()]
                for k, point in enumerate(points)
            ],
            dtype=object,
        ).reshape(len(points), len(of))

    def mean(self, images: Array) -> list[Expression]:
        """Sum of Wm_k times the image of each point, as the first and what the others differ from it by."""
        weight = numbers(np.array([[0.5 / self.spread(len(images) // 2)]]))[0, 0]
        first, *others = images
        found: list[Expression] = []
        for i, centre in enumerate(first):
            found.append(centre + weight * sum((one[i] - centre for one in others), Expression.number(0)))
        return found

    def product(self, one: Array, mean: Sequence[Expression], other: Array, other_mean: Sequence[Expression]) -> Array:
        """Sum of Wc_k (one_k - mean) (other_k - its mean)'."""
        m, alpha = len(one) // 2, self.request.alpha
        total = self.spread(m)
        first = (total - m) / total + 1 - alpha**2 + self.request.beta
        weights = np.diag([first, *[0.5 / total] * (2 * m)])
        left = np.array([[a - b for a, b in zip(row, mean, strict=True)] for row in one], dtype=object)
        right = np.array([[a - b for a, b in zip(row, other_mean, strict=True)] for row in other], dtype=object)
        left, right = left.reshape(len(one), len(mean)), right.reshape(len(other), len(other_mean))
        return times(left.T, numbers(weights), right)


def values(points: Sequence[Mapping[str, Expression]], names: Sequence[str]) -> Array:
    """Points as rows."""
    return np.array([[point[name] for name in names] for point in points], dtype=object).reshape(
        len(points), len(names)
    )
