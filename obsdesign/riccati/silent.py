"""The barrier of gains by descent where f are known to be monotone only: that of what `passive` leaves of the form.

The gain enters it twice: V' L in the state s2, and T' L in the row of s1. Along a signal of (s2, s1, v) the inequality
changes by 2 (P e)' dL y, P e = T s1 + V Pt s2, y = C e + D v, as it does in the form itself.
"""

import numpy as np

from obsdesign.lmi.formula import Float
from obsdesign.records import dataclass, replace
from obsdesign.riccati.descent import Barrier, Inside, Peak, Solutions, inverted, lyapunov, symmetric
from obsdesign.riccati.equation import Equation, FastError
from obsdesign.riccati.form import Eliminated, Form, UnclearError
from obsdesign.riccati.passive import Passive, reduced, without


@dataclass(frozen=True)
class Parts:
    """What makes P and its signals of Pt and those of the form that is left."""

    left: Passive
    Bf: Float  # (n, k)
    T: Float  # (n, k)

    def storage(self, Pt: Float) -> Float:
        """P = T K^-1 T' + V Pt V'."""
        return symmetric(self.T @ np.linalg.solve(self.Bf.T @ self.T, self.T.T) + self.left.V @ Pt @ self.left.V.T)


class SilentBarrier(Barrier):
    """-log det (Pt+ - Pt-) over gains and scales of a form whose scales are not tied to each other."""

    def __init__(self, form: Form, mu: float, peak: Peak | None, nf: int) -> None:
        left = reduced(form, nf)
        if left is None:
            raise UnclearError("the form has no f that is monotone only")
        super().__init__(without(form, left.silent), mu, peak)
        self.whole, self.nf = form, nf

    def at(self, L: Float, scales: Float) -> Inside | None:
        """Value and gradient; None where there is no solution."""
        self.evaluations += 1
        if not (np.isfinite(L).all() and np.isfinite(scales).all()):
            return None
        try:
            left = reduced(self.whole.injected(L), self.nf)
            if left is None:
                return None
            form = left.form.scaled(scales)
            given = Eliminated(form.A, form.B, form.Qc, form.Qm, form.Qs, np.eye(len(form.Qc)), form.supply)
            equation = Equation.of(given, self.mu)
            space = equation.subspace()
            return None if space is None else self.within(left, scales, Solutions.of(equation, space))
        except (FastError, UnclearError, np.linalg.LinAlgError):
            return None

    def within(self, left: Passive, scales: Float, found: Solutions) -> Inside:
        """Barrier of solutions."""
        n, order, Z, D = self.form.n, left.form.n, found.Z, symmetric(inverted(found.Z))
        T = -np.tensordot(scales, self.whole.Qs, 1)[:n, n:][:, left.silent]
        parts = Parts(left, self.whole.B[:, left.silent], T)
        last = order + T.shape[1]
        signals = (
            (found.P, lyapunov(found.T, -Z)),
            (found.P - D, symmetric(Z @ lyapunov(found.T, -D, transposed=True) @ Z)),
        )
        by_gain, by_scales = np.zeros((n, len(self.form.C))), np.zeros(len(scales))
        for P, S in signals:
            costate = found.inverse.T @ P
            moved = found.equation.back @ np.vstack([found.V, costate])  # (s2, s1, v) of the states
            s1 = moved[order:last]
            y = self.form.C @ (left.U @ moved[:order] + parts.Bf @ s1) + self.form.D @ moved[last:]
            by_gain += 2 * (T @ s1 + left.V @ costate) @ S @ y.T
            by_scales += [float(np.sum((moved @ S) * (Q @ moved))) for Q in left.form.Qs]
        largest, smallest = (parts.storage(found.inverse.T @ P @ found.inverse) for P in (found.P, found.P - D))
        value = float(np.linalg.slogdet(Z)[1] + 2 * np.linalg.slogdet(found.V)[1])
        return Inside(value, by_gain, by_scales, largest, smallest)


def untied(form: Form, nf: int, scales: Float) -> tuple[Form, Float, Float]:
    """Form whose scales are not tied to each other, these scales, and the ties by which they are those of the form.

    Raises `UnclearError`: there are none, or doubles do not tell.
    """
    left = reduced(form, nf)
    if left is None:
        raise UnclearError("the form has no f that is monotone only")
    free = np.linalg.lstsq(left.ties, scales, rcond=None)[0]
    return replace(form, Qs=np.tensordot(left.ties.T, form.Qs, 1)), np.asarray(free), left.ties
