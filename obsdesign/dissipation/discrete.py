"""Observers of plants x+ = A x + Bf f(q) + gx + B w, + the next sample: a second reading of the same inequality.

With e+ = Ne e + Nf f~ + Nv v and V = e' P e the inequality (13) becomes

    V+ - rho^2 V + z' W z - m |v|^2 <= 0,    rho = 1 - rate,

N' P N - .. <= 0 for given gains, N = [Ne Nf Nv]. For an L1 that is to be found P N = P [A Bf -B] + Y [C Df -D] stands
in rows of its own, by the complement of Schur on -P, which is an equivalence for P > 0.

Other than in continuous time, projecting Y out leaves two inequalities: the part without these rows has to be negative
as well, so that P has a floor, and L2 matters for the least gamma even where M22 < 0.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from obsdesign.dissipation.inequality import EQUATIONS, POSITIVE, Incremental, stored_and_supplied
from obsdesign.lmi.formula import (
    Array,
    Inequality,
    Injection,
    NextState,
    Problem,
    Unknown,
    Values,
    product,
    symmetric,
    zeros,
)

SLOW = 0.7  # rho from which the inequality has the wider margin without the rows of V+; it has less near dead beat

PREDICTED = EQUATIONS.replace("xihat' =", "xihat+ =")
FILTERED = (
    "xibar = A xihat + Bf f(t, y, qhat) + gx, yhat = C xibar + gy+, xihat+ = xibar + L1 (yhat - y+), "
    "qhat = Cq xihat + Dqf f(t, y, qhat) + gq + L2 (yhat - y+), e = xihat - xi, z = H e"
)


class Discrete(Incremental):
    """What is other of a family where time is counted in samples."""

    @property
    def loss(self) -> Any:
        """1 - rho^2, in which the inequality is affine."""
        return self.rate * (2 - self.rate)

    def dissipation(self, v: Values, Q: Array, m: Array) -> Array:
        """V+ - rho^2 V + e' Q e - m |v|^2 in (e, f, v), in u where L2 is free, and in + where L1 is to be found."""
        p, P, Y = self.plant, v["P"], v["Y"]
        left = ((0 if self.still else self.loss) - 1) * P
        S = self.supplied(v, Q + left, m)
        if self.L1 is not None:
            N = np.hstack([p.A + self.L1 @ p.C, p.Bf + self.L1 @ p.Df, -(p.B + self.L1 @ p.D)])
            return stored_and_supplied(product(product(N.mT, P), N), S)
        NP = np.concatenate([product(P, p.A) + Y @ p.C, P @ p.Bf + Y @ p.Df, -(P @ p.B + Y @ p.D)], axis=-1).mT
        below = zeros((*NP.shape[:-2], S.shape[-1] - NP.shape[-2], p.n), [P])  # rows of u
        return symmetric([[S, np.concatenate([NP, below], axis=-2)], [-P]])

    @property
    def injection(self) -> Injection | None:
        """Y enters (13) as He([0; I] Y [C Df -D 0]), I in the rows of V+, where it is unknown."""
        if self.L1 is not None:
            return None
        n, rows = self.plant.n, self.residual.shape[1]
        right = np.hstack([self.residual, np.zeros((len(self.residual), n))])
        return Injection("Y", np.eye(rows + n, n, -rows), right)

    def problem(
        self,
        unknowns: Sequence[Unknown],
        complete: Callable[[Values], Values],
        bounded: Callable[[Values], Sequence[Inequality]] = lambda _: (),
        minimise: str | None = None,
        injection: Injection | None = None,
    ) -> Problem:
        """The theorem, as in continuous time, and which of its rows are those of V+."""
        made = super().problem(unknowns, complete, bounded, minimise, injection)
        return made if self.L1 is not None else replace(made, next_state=self.next_state)

    @property
    def next_state(self) -> NextState:
        """P [A Bf -B] + Y [C Df -D], and nothing of u."""
        p, output = self.plant, self.residual
        nothing = np.zeros((p.n, output.shape[1] - p.n - p.Bf.shape[1] - p.B.shape[1]))
        return NextState(np.hstack([p.A, p.Bf, -p.B, nothing]), output, POSITIVE, slow=1 - self.rate >= SLOW)
