"""What is proved of an L-infinity observer, and of the unknown input that it reconstructs."""

from typing import Any, ClassVar, Literal

import numpy as np

from obsdesign.dissipation.guarantee import Quadratic, Sampled
from obsdesign.families.guarantee import Bound, Course, Rates, Steps, bound, envelope, tightest
from obsdesign.lmi.formula import Array
from obsdesign.records import dataclass


@dataclass(frozen=True)
class Reconstruction:
    """limsup |what - w| <= w |w|_inf + w_rate |w'|_inf + x_rate |x'|_inf, for what = pinv(B) L1 (yhat - y).

    The storage functions e' P_i e of its levels are at most e' P e, and decay at the rate alpha at least: before the
    limit, (w |e|_P + w_rate |de/dt|_P) exp(-alpha t) is added, with e and its derivative at t = 0.
    """

    w: float
    w_rate: float  # s
    x_rate: float
    alpha: float  # 1/s
    P: Array  # (n, n)

    def check(
        self, course: Course, limsup: float, rates: tuple[Array, Array], w_rate: float
    ) -> tuple[dict[str, Any], Bound]:
        """Bound on limsup |what - w|, as Theorems 2 and 4 of the L-infinity paper prove it.

        |what - w| <= c_w |w| + c_w' |w'| + c_x' |x'| + (c_w sqrt(V(e(s))) + c_w' sqrt(V(e'(s)))) exp(-alpha (t - s))

        with the sup norms over the run. The last term is what is left of the transient, and vanishes; any s < t will
        do, and the best one is taken.

        `rates`: x' and e' along the run, (M, n) each; `w_rate`: largest |w'| of the run.
        """
        x_rates, e_rates = rates
        x_rate = float(np.linalg.norm(x_rates, axis=1).max())
        limit = self.w * course.v_sup[-1] + self.w_rate * w_rate + self.x_rate * x_rate
        V, V_rate = (np.sqrt(np.einsum("ti,ij,tj->t", s, self.P, s)) for s in (course.e, e_rates))
        before = course.t[course.late()][0] - course.t
        sizes = (self.w * V + self.w_rate * V_rate) * np.exp(-self.alpha * before)
        left = sizes[before >= 0].min()
        entry = bound(
            "last fifth: |what - w| <= c1 sup|w| + c2 sup|w'| + c3 sup|x'| + what is left of the transient",
            limsup,
            limit + left,
        )
        terms = {
            "bound": float(limit),
            "transient_left": float(left),
            "w_sup": float(course.v_sup[-1]),
            "w_rate_sup": w_rate,
            "x_rate_sup": x_rate,
            "holds": entry["holds"],
        }
        return terms, entry


@dataclass(frozen=True)
class PeakGuarantee(Quadratic):
    """V' <= -2 alpha (V - mu1 |v|^2) and |z|^2 <= mu2 V, and gamma^2 = mu1 mu2."""

    norm: ClassVar[Literal["norm2", "sup"]] = "sup"
    signals: ClassVar[str] = "bounded"
    supply: ClassVar[str] = "2 alpha mu1"  # of V', for |v| = 1

    def rates(self) -> Rates | Steps:
        """V' <= -2 alpha V + 2 alpha mu1 |v|^2."""
        return Rates(self.rate, 2 * self.rate * self.mu1)

    def bounds(self, course: Course) -> list[Bound]:
        """Check the bounds that both inequalities imply.

        |z(t)|^2     <= mu2 (exp(-2 alpha t) V(e(0)) + mu1 (1 - exp(-2 alpha t)) sup|v|^2)   for all t
        |z(t)|       <= gamma sup|v|                                                         for all t, if e(0) = 0
        |z(t)|       <= gamma sup|v| + sqrt(mu2 V(e(0))) exp(-alpha t)                       ultimately
        V(e(t))      <= exp(-2 alpha t) V(e(0)) + b(t)                                       for all t

        This is Lemma 1 of Chakrabarty, Corless, Buzzard, Zak and Rundell on exogenous inputs; the first bound
        also with lmax(P) |e(0)|^2 for V(e(0)). The sup is that over [0, t].
        """
        V = self.storage(course)
        largest_V = self.spectrum[1] * (course.e[0] @ course.e[0])
        left, words = self.rates().left(course.t), self.words
        gain = self.gamma * course.v_sup

        def peak(start: float) -> Array:
            return np.asarray(np.sqrt(self.mu2 * left * start + (1 - left) * gain**2))

        late = course.late()
        still = not course.e[0].any()
        zero = [tightest("|z(t)| <= gamma sup|v| from zero error", course.t, course.z, gain)] if still else []
        rate = words.twice.strip()
        return [
            *(
                tightest(
                    f"|z(t)| <= sqrt(mu2 ({rate} {start} + mu1 (1 - {rate}) sup|v|^2))", course.t, course.z, peak(size)
                )
                for start, size in (("V(e(0))", float(V[0])), ("lmax(P) |e(0)|^2", float(largest_V)))
            ),
            *zero,
            tightest(
                f"last fifth: |z(t)| <= gamma sup|v| + sqrt(mu2 V(e(0))) {words.once.strip()}",
                course.t[late],
                course.z[late],
                (gain + np.sqrt(self.mu2 * V[0] * left))[late],
                float(course.z.max()),
            ),
            tightest(
                f"sqrt(V(e(t))) <= sqrt({words.twice}V(e(0)) + {self.supply} {words.added.format(v='v')})",
                course.t,
                np.sqrt(V),
                np.sqrt(envelope(self, course, V)),
            ),
        ]


@dataclass(frozen=True)
class PeakOfSteps(Sampled, PeakGuarantee):
    """V+ <= rho^2 V + (1 - rho^2) mu1 |v|^2 and |z|^2 <= mu2 V, and gamma^2 = mu1 mu2."""

    supply: ClassVar[str] = "(1 - rho^2) mu1"

    def rates(self) -> Steps:
        """V+ <= rho^2 V + (1 - rho^2) mu1 |v|^2."""
        return Steps(self.rate, (1 - self.rate**2) * self.mu1, self.period)

    def bounds(self, course: Course) -> list[Bound]:
        """Check what both inequalities imply, as in continuous time, and the first itself."""
        said = "at each sample: V+ <= rho^2 V + (1 - rho^2) mu1 |v|^2"
        return [*super().bounds(course), self.step(course, said)]
