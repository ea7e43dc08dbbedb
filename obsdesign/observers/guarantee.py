"""What the gains of an observer are proved to achieve."""

from dataclasses import dataclass

from obsdesign.lmi.formula import Array


@dataclass(frozen=True)
class Guarantee:
    """V' + 2 alpha V + mu1 |z|^2 - mu2 |v|^2 <= 0 along the error equations, with V = e' P e, gamma^2 = mu2 / mu1."""

    gamma: float
    alpha: float
    mu1: float
    mu2: float
    P: Array  # (n, n), positive definite
