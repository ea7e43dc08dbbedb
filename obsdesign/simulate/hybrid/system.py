"""Plant and observer with sporadic measurements: what flows between them and jumps at each."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression
from obsdesign.families.guarantee import SampledGuarantee
from obsdesign.lmi.formula import Array
from obsdesign.simulate.coupled import block_terms
from obsdesign.simulate.hybrid.sampling import Schedule
from obsdesign.simulate.integrate import Flow, Vector
from obsdesign.simulate.scenario import switch_times
from obsdesign.simulate.stack import Stack, Term
from obsdesign.spec import Simulation, Spec

COUNTED = 4  # integrals of |yp|^2 and of |w|^2, b, and j


class Instant(NamedTuple):
    """What acts at one time, or one row a time."""

    u: Array
    w: Array
    q: Array  # argument of f in the plant
    qhat: Array  # in the observer


class Hybrid:
    """The plant and the observer (4) of Ferrante, Gouaisbaut, Sanfelice and Tarbouriech, with eps = z - zhat.

    Between measurements, with f = f(t, u, q) and known terms gx, gq of t and u,

        z'     = A z + Bf f(q) + gx + B w                        q    = Cq z + gq
        eps'   = A eps + Bf (f(q) - f(qhat)) + B w - L theta     qhat = q - Cq eps
        theta' = H theta

    and at the k-th measurement theta+ = C eps + eta_k. The error itself is integrated, since the difference of two
    large states has lost its digits. The flow has the state

        s = (z, eps, theta, integral of |yp|^2, integral of |w|^2, b, j, y)

    with b' = -2 alpha b + c |w|^2 between measurements and, at each, b+ = b + what its noise adds to V, so that
    V(t) <= exp(-2 alpha t) V(0) + b(t), the number j of measurements received, and the last of them, y.

    Parameters
    ----------
    spec, simulation
        The problem and what acts on the plant.
    gains
        L (n, ny) and H (ny, ny).
    schedule, noise
        Instants of the measurements and the noise (K, ny) of each.
    guarantee
        For b; without it b stays zero.

    Raises
    ------
    UsageError
        If the spec has what this observer has no place for, or a nonlinearity no f.
    """

    def __init__(
        self,
        spec: Spec,
        simulation: Simulation,
        gains: Mapping[str, Array],
        schedule: Schedule,
        noise: Array,
        guarantee: SampledGuarantee | None,
    ) -> None:
        require_simulable(spec)
        self.spec, self.schedule, self.noise, self.guarantee = spec, schedule, noise, guarantee
        self.plant = spec.plant.doubles
        self.L, self.H, self.Cp = gains["L"], gains["H"], spec.H.astype(float)
        self.n, self.ny, self.nw = self.plant.n, len(self.plant.outputs), self.plant.B.shape[1]
        nq = len(self.plant.Cq)
        self.end = 2 * self.n + self.ny  # of (z, eps, theta)
        self.last = self.end + 2 * nq  # of these, q and qhat
        self.w = simulation.w or simulation.v or (Expression.number(0),) * self.nw
        self.u = simulation.u
        places = {name: i for i, name in enumerate(("t", *self.plant.states))}
        self.signals = Stack([Term(e, places) for e in (*self.u, *self.w)], len(places))
        known = {name: i for i, name in enumerate(("t", *spec.inputs))}
        self.gy = Stack([Term(g, known) for g in spec.gy], len(known))
        terms = [Term(g, known) for g in (*spec.gx, *spec.gq)]
        kept = [i for i, term in enumerate(terms) if not term.is_zero()]
        self.known = Stack([terms[i] for i in kept], len(known))
        self.place = np.eye(len(terms))[:, kept]  # of the known terms in (gx, gq)
        self.f = Stack(both(block_terms(spec, known), len(known), nq), len(known) + 2 * nq)
        self.still = np.zeros(1 + self.ny)  # rates of j and y
        self.matrix, self.E = self.linear(), self.nonlinear()
        self.decay, self.supply = guarantee.rates() if guarantee else (0.0, 0.0)
        self.kicks = self.storage_of_noise()

    def linear(self) -> Array:
        """Linear part of (z', eps', theta', q, qhat, yp) as a matrix on (z, eps, theta, w)."""
        p, n, ny, nw, nq = self.plant, self.n, self.ny, self.nw, len(self.plant.Cq)
        return np.block(
            [
                [p.A, np.zeros((n, n + ny)), p.B],
                [np.zeros((n, n)), p.A, -self.L, p.B],
                [np.zeros((ny, 2 * n)), self.H, np.zeros((ny, nw))],
                [p.Cq, np.zeros((nq, n + ny + nw))],
                [p.Cq, -p.Cq, np.zeros((nq, ny + nw))],
                [0 * self.Cp, self.Cp, np.zeros((len(self.Cp), ny + nw))],
            ]
        )

    def nonlinear(self) -> Array:
        """Matrix that takes (f(q), f(qhat)) into (z', eps', theta')."""
        Bf = self.plant.Bf
        return np.vstack([np.hstack([Bf, 0 * Bf]), np.hstack([Bf, -Bf]), np.zeros((self.ny, 2 * Bf.shape[1]))])

    def storage_of_noise(self) -> Vector:
        """What the noise of each measurement adds to V, (K,)."""
        if self.guarantee is None:
            return np.zeros(len(self.noise))
        count = np.arange(1, len(self.noise) + 1)
        return self.guarantee.added(self.noise, self.schedule.timer(self.schedule.received, count))

    def start(self, z0: Vector, zhat0: Vector, theta0: Vector) -> Vector:
        """Return the initial s; y is what the observer supposes, C zhat + gy + theta."""
        y = self.plant.C @ zhat0 + self.offset(0.0, z0) + theta0
        return np.concatenate((z0, z0 - zhat0, theta0, np.zeros(COUNTED), y))

    def reset(self, t: float, s: Vector) -> Vector:
        """Return s after the next measurement, at t."""
        n, end = self.n, self.end
        k = int(s[end + 3])
        after = s.copy()
        after[2 * n : end] = self.plant.C @ s[n : 2 * n] + self.noise[k]
        after[end + 2 : end + 4] += self.kicks[k], 1
        after[end + 4 :] = self.plant.C @ s[:n] + self.offset(t, s[:n]) + self.noise[k]
        return after

    def offset(self, t: float, z: Vector) -> Vector:
        """Known term gy of the output."""
        u = self.signals.values([t, *z.tolist()])[: len(self.u)]
        return self.gy.values([t, *u.tolist()])

    def rhs(self, t: float, s: Vector, _: Vector) -> Vector:
        """Rate of s between measurements."""
        n, nu, end = self.n, len(self.u), self.end
        signals = self.signals.values([t, *s[:n].tolist()])
        u, w = [t, *signals[:nu].tolist()], signals[nu:]
        linear = self.matrix @ np.concatenate((s[:end], w))
        flow, arguments, yp = linear[:end], linear[end : self.last], linear[self.last :]
        if self.known.terms:
            gx, gq = np.split(self.place @ self.known.values(u), [n])
            flow[:n] += gx
            arguments += np.tile(gq, 2)
        flow += self.E @ self.f.values(u + arguments.tolist())
        w2 = w @ w
        integrals = (yp @ yp, w2, self.supply * w2 - 2 * self.decay * s[end + 2])
        return np.concatenate((flow, np.array(integrals), self.still))

    def jacobian(self, t: float, s: Vector, _: Vector) -> Array:
        """Jacobian of `rhs` with respect to s."""
        n, nu, end = self.n, len(self.u), self.end
        state = [t, *s[:n].tolist()]
        signals, slopes = self.signals.values(state), np.zeros((len(self.signals.terms), end))
        slopes[:, :n] = self.signals.jacobian(state)[:, 1:]
        u, w = [t, *signals[:nu].tolist()], signals[nu:]
        gx, gq = np.split(self.place @ self.known.jacobian(u)[:, 1:] @ slopes[:nu], [n])
        q = self.matrix[end : self.last] @ np.concatenate((s[:end], w)) + np.tile(
            (self.place @ self.known.values(u))[n:], 2
        )
        linear = self.matrix[: self.last] @ np.vstack([np.eye(end), slopes[nu:]])
        inner = np.vstack([slopes[:nu], linear[end:] + np.tile(gq, (2, 1))])
        J = np.zeros((len(s), len(s)))
        J[:end, :end] = linear[:end] + self.E @ self.f.jacobian(u + q.tolist())[:, 1:] @ inner
        J[:n, :end] += gx
        J[end, n : 2 * n] = 2 * self.Cp.T @ (self.Cp @ s[n : 2 * n])
        J[end + 1, :end] = 2 * w @ slopes[nu:]
        J[end + 2, :end] = self.supply * J[end + 1, :end]
        J[end + 2, end + 2] = -2 * self.decay
        return J

    def flow(self) -> Flow:
        """Vector field of s."""
        return Flow(self.rhs, self.jacobian, watched=self.end)

    def instants(self, t: Array, s: Array) -> Instant:
        """Signals along states s (M, ns) at times t."""
        n, nu = self.n, len(self.u)
        u, w = np.split(self.signals.table(np.column_stack([t, s[:, :n]])), [nu], axis=1)
        gq = (self.known.table(np.column_stack([t, u])) @ self.place.T)[:, n:]
        q = s[:, :n] @ self.plant.Cq.T + gq
        return Instant(u, w, q, q - s[:, n : 2 * n] @ self.plant.Cq.T)

    def breaks(self) -> list[tuple[float, float]]:
        """Instants at which a signal or a term jumps or bends: the last double before, the first after."""
        terms = (*self.u, *self.w, *(term.expression for term in (*self.known.terms, *self.f.terms)))
        return switch_times(terms, self.schedule.horizon)

    def stepwise(self) -> bool:
        """Whether the plant is linear and everything that acts on it constant between breaks."""
        gx = self.spec.gx
        alone = all(e.names <= {"t"} for e in (*self.u, *self.w))
        return not self.f.terms and alone and all(constant(e.derivative("t")) for e in (*self.u, *self.w, *gx))


def both(terms: Sequence[Term], first: int, nq: int) -> list[Term]:
    """Terms of q, which begins at a place of the arguments, and the same terms of the qhat that follows it."""

    def shifted(term: Term) -> Term:
        return Term(term.expression, {name: i + nq if i >= first else i for name, i in term.places.items()})

    return [*terms, *map(shifted, terms)]


def constant(rate: Expression) -> bool:
    """Whether the rate of something is zero throughout."""
    return Term(rate, {}).is_zero()


def require_simulable(spec: Spec) -> None:
    """Refuse what the observer cannot compute between two measurements, and what the simulation does not know."""
    p = spec.plant
    for matrix, name in ((p.D, "D"), (p.Df, "Df"), (p.Dq, "Dq"), (p.Dqf, "Dqf")):
        if (matrix != 0).any():
            raise UsageError(f"{name} is not zero: y = C z and q = Cq z are all that a sporadic observer can use")
    if spec.model_states:
        raise UsageError("a sporadic observer has no disturbance model: leave out `disturbance`")
    for i, block in enumerate(spec.nonlinearities, start=1):
        if block.f is None:
            raise UsageError(f"nonlinearities[{i}] has no `f`, which a simulation needs (a design does not)")
    terms: Sequence[Expression] = [*spec.gx, *spec.gq, *spec.gy, *(f for b in spec.nonlinearities for f in b.f or ())]
    for term in terms:
        if measured := sorted(term.names & set(p.outputs)):
            raise UsageError(f"{term} needs {measured[0]}, which the observer does not know between two measurements")
