"""Plant and observer as one flow, in the coordinates (state, estimation error)."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from obsdesign.expressions import Expression
from obsdesign.families.guarantee import Guarantee
from obsdesign.lmi.formula import Array, Float, block_diagonal
from obsdesign.model.plant import Plant
from obsdesign.simulate.integrate import Flow, Vector
from obsdesign.simulate.scenario import Scenario
from obsdesign.simulate.stack import Loop, Stack, Term
from obsdesign.spec import Spec

INTEGRALS = 3  # of |z|^2, of |v|^2, and the bound on V


class Instant(NamedTuple):
    """Everything at one time, or one row a time."""

    u: Array
    xi: Array  # true augmented state
    v: Array  # drive
    a: Array  # true arguments (y, q)
    phi: Array  # true nonlinear blocks and known terms
    ahat: Array  # measured y, and the q of the observer
    phihat: Array
    rates: Array  # (xi', e')


class Coupled:
    """The augmented plant and its observer, with e = xihat - xi.

    With phi = (f, gx, gq, gy) the stack of everything nonlinear or known, a = (y, q), and E, K where phi
    enters,

        xi' = A xi + B v + E phi(t, u, a),            a = [C; Cq] xi + [D; Dq] v + K phi(t, u, a)
        e'  = (A + L1 C) e + (E + L1 Ky) dphi - (B + L1 D) v - L1 noise
        dq  = (Cq + L2 C) e + (Kq + L2 Ky) dphi - (Dq + L2 D) v - L2 noise
        dphi = phi(t, u, y + noise, q + dq) - phi(t, u, y, q)

    which is the observer (12) of Corless and Chakrabarty (2019) with nothing neglected; xihat = xi + e. The
    error itself is integrated, since the difference of two large states has lost its digits.

    The flow has the state s = (integrated true states, e, integral of |z|^2, integral of |v|^2, b), with
    b' = -2 alpha b + c |v|^2, so that V(e(t)) <= exp(-2 alpha t) V(e(0)) + b(t).

    Parameters
    ----------
    spec, scenario
        The problem and what acts on the plant.
    gains
        L1 (n + nm, ny) and L2 (nq, ny).
    guarantee
        For b; without it b stays zero.
    """

    def __init__(self, spec: Spec, scenario: Scenario, gains: Mapping[str, Array], guarantee: Guarantee | None) -> None:
        plant = scenario.plant
        n, ny = plant.n, len(plant.outputs)
        self.scenario = scenario
        self.reconstructor = reconstructor(spec, gains["L1"])
        self.H = spec.H.astype(float)
        alpha, self.supply = guarantee.rates() if guarantee else (0.0, 0.0)
        self.decay = 2 * alpha
        self.ns, self.end = scenario.integrated, scenario.integrated + n
        self.signals = scenario.signals()
        terms = Terms.of(spec, scenario)
        Ky, Kq = terms.K[:ny], terms.K[ny:] + gains["L2"] @ terms.K[:ny]
        self.truth, self.observer = Loop(terms.truth, terms.K), Loop(terms.observer, np.vstack([0 * Ky, Kq]))
        self.linear = linear(plant, gains["L1"], gains["L2"])
        self.E = block_diagonal([terms.E, terms.E + gains["L1"] @ Ky])
        self.model_blocks = slice(spec.plant.Bf.shape[1], plant.Bf.shape[1])
        self.innovation = np.block([plant.C, -plant.D, -np.eye(ny), Ky])  # yhat - y on (e, v, noise, dphi)
        self.explicit = not terms.K.any()

    def instant(self, t: float, s: Vector, noise: Vector) -> Instant:
        """Signals, states and rates at one time."""
        n, nu, ns = self.scenario.plant.n, len(self.scenario.u), self.ns
        signals = self.signals.values([t, *s[: self.scenario.n].tolist()])
        u, known = signals[:nu], [t, *signals[:nu].tolist()]
        driven = np.concatenate((s[:ns], signals[nu:], s[ns : self.end], noise))
        linear = self.linear @ driven
        right, difference = linear[2 * n :].reshape(2, -1)
        phi = self.truth.solve(known, right)
        a = self.truth.argument(right, phi)
        right = self.observer.argument(a + difference, -phi)
        phihat = self.observer.solve(known, right)
        ahat = self.observer.argument(right, phihat)
        rates = linear[: 2 * n] + self.E @ np.concatenate((phi, phihat - phi))
        v = driven[n : len(driven) - n - len(noise)]
        return Instant(u, driven[:n], v, a, phi, ahat, phihat, rates)

    def rhs(self, t: float, s: Vector, noise: Vector) -> Vector:
        """Rate of s."""
        now = self.instant(t, s, noise)
        z = self.H @ s[self.ns : self.end]
        v2 = now.v @ now.v
        integrals = (z @ z, v2, self.supply * v2 - self.decay * s[-1])
        return np.concatenate((now.rates[: self.ns], now.rates[self.scenario.plant.n :], integrals))

    def jacobian(self, t: float, s: Vector, noise: Vector) -> Array:
        """Jacobian of `rhs` with respect to s."""
        now = self.instant(t, s, noise)
        n, nu, ns, end = self.scenario.plant.n, len(self.scenario.u), self.ns, self.end
        signals = np.zeros((len(self.signals.terms), end))
        signals[:, : self.scenario.n] = self.signals.jacobian([t, *s[: self.scenario.n].tolist()])[:, 1:]
        u, v = signals[:nu], signals[len(signals) - len(now.v) :]
        driven = np.vstack([np.eye(ns, end), signals[nu:], np.eye(n, end, ns), np.zeros((len(noise), end))])
        linear = self.linear @ driven
        right, difference = linear[2 * n :].reshape(2, -1, end)
        known = [t, *now.u.tolist()]
        phi = self.truth.sensitivity(known, now.a, u, right)
        a = self.truth.argument(right, phi)
        phihat = self.observer.sensitivity(known, now.ahat, u, self.observer.argument(a + difference, -phi))
        rates = linear[: 2 * n] + self.E @ np.concatenate((phi, phihat - phi))
        J = np.zeros((len(s), len(s)))
        J[:ns, :end] = rates[:ns]
        J[ns:end, :end] = rates[n:]
        J[end, ns:end] = 2 * self.H.T @ (self.H @ s[ns:end])
        J[end + 1, :end] = 2 * now.v @ v
        J[end + 2, :end] = 2 * self.supply * now.v @ v
        J[end + 2, end + 2] = -self.decay
        return J

    def instants(self, t: Array, s: Array) -> Instant:
        """Signals, states and rates along states s (N, ns) of the flow at times t; NaN outside the model's domain."""
        noise = self.noise(t)
        if not self.explicit:
            return self.one_by_one(t, s, noise)
        n, nu = self.scenario.plant.n, len(self.scenario.u)
        u, signals = np.split(self.signals.table(np.column_stack([t, s[:, : self.scenario.n]])), [nu], axis=1)
        driven = np.hstack([s[:, : self.ns], signals, s[:, self.ns : self.end], noise])
        linear = driven @ self.linear.T
        a, difference = np.split(linear[:, 2 * n :], 2, axis=1)
        phi = self.truth.stack.table(np.column_stack([t, u, a]))
        phihat = self.observer.stack.table(np.column_stack([t, u, a + difference]))
        rates = linear[:, : 2 * n] + np.hstack([phi, phihat - phi]) @ self.E.T
        v = driven[:, n : driven.shape[1] - n - noise.shape[1]]
        return Instant(u, driven[:, :n], v, a, phi, a + difference, phihat, rates)

    def one_by_one(self, t: Array, s: Array, noise: Array) -> Instant:
        """Return `instants` where each has an algebraic loop to solve."""
        each: list[Instant] = []
        for row in zip(t, s, noise, strict=True):
            try:
                each.append(self.instant(*row))
            except ArithmeticError:
                each.append(Instant(*(np.full_like(column, np.nan) for column in each[0])))
        return Instant(*(np.array(column).reshape(len(t), -1) for column in zip(*each, strict=True)))

    def reconstructed(self, t: Array, s: Array, now: Instant) -> Array:
        """Return what, (N, nw), with yhat - y from the errors, so that nothing cancels."""
        difference = np.hstack([s[:, self.ns : self.end], now.v, self.noise(t), now.phihat - now.phi])
        return np.asarray(difference @ self.innovation.T @ self.reconstructor.T)

    def amplification(self) -> float:
        """How much larger than the error the reconstruction of w is; at least 1."""
        of_e = self.reconstructor @ self.innovation[:, : self.scenario.plant.n]
        return max(1.0, float(np.abs(of_e).max(initial=0.0)))

    def noise(self, t: Array) -> Array:
        """Noise at times t, (N, ny)."""
        return np.array([self.scenario.held(instant) for instant in t])

    def flow(self) -> Flow:
        """Vector field of s."""
        return Flow(self.rhs, self.jacobian, watched=self.end)

    def start(self, x0: Vector, xhat0: Vector) -> Vector:
        """Return the initial s for x0, (n,) or (n + nm,), and xihat0, (n + nm,)."""
        known = self.signals.values([0.0, *x0[: self.scenario.n].tolist()])[len(self.scenario.u) :]
        xi = np.zeros(self.scenario.plant.n)
        xi[: len(x0)] = x0
        xi[self.ns :] = known[: len(xi) - self.ns]
        return np.concatenate((xi[: self.ns], xhat0 - xi, np.zeros(INTEGRALS)))


def reconstructor(spec: Spec, L1: Array) -> Array:
    """pinv(B) L1, (nw, ny), which makes what of yhat - y; no rows if w is not to be reconstructed."""
    if not spec.observer.reconstruct:
        return np.zeros((0, L1.shape[1]))
    return np.asarray(np.linalg.pinv(spec.plant.doubles.B) @ L1)


def linear(plant: Plant[Float], L1: Array, L2: Array) -> Array:
    """Linear part of (xi', e', a, ahat - a) as a matrix on (xi, v, e, noise)."""
    n, ny, nq = plant.n, len(plant.outputs), len(plant.Cq)
    truth = np.block([[plant.A, plant.B], [plant.C, plant.D], [plant.Cq, plant.Dq]])
    seen = np.block([plant.C, -plant.D, -np.eye(ny)])  # yhat - y on (e, v, noise)
    copied = np.zeros((n + ny + nq, seen.shape[1]))
    copied[:n, :-ny] = np.block([plant.A, -plant.B])
    copied[n : n + ny, -ny:] = np.eye(ny)
    copied[n + ny :, :-ny] = np.block([plant.Cq, -plant.Dq])
    error = copied + np.vstack([L1, np.zeros((ny, ny)), L2]) @ seen
    e, v, noise = np.split(error, [n, n + plant.B.shape[1]], axis=1)
    whole = np.block([[truth, np.zeros((len(truth), n + ny))], [np.zeros((len(e), n)), v, e, noise]])
    xi_rate, a, e_rate, difference = np.split(whole, [n, len(truth), len(truth) + n])
    return np.vstack([xi_rate, e_rate, a, difference])


class Terms(NamedTuple):
    """phi = (f, gx, gq, gy) without the terms that are zero, and where it enters."""

    truth: Stack
    observer: Stack
    E: Array  # (n, nphi)
    K: Array  # (na, nphi)

    @classmethod
    def of(cls, spec: Spec, scenario: Scenario) -> "Terms":
        """Stacks over the arguments (t, u, y, q)."""
        plant = scenario.plant
        n, ny, nq, nf = plant.n, len(plant.outputs), len(plant.Cq), plant.Bf.shape[1]
        places = {name: i for i, name in enumerate(("t", *spec.inputs, *plant.outputs))}
        width = len(places) + nq
        known = [Term(g, places) for g in (*spec.gx, *spec.gq, *spec.gy)]
        enters = np.eye(n + ny + nq)
        rows = [
            *range(spec.plant.n),
            *(n + ny + i for i in range(len(spec.gq))),
            *(n + i for i in range(len(spec.gy))),
        ]
        kept = [(term, row) for term, row in zip(known, rows, strict=True) if not term.is_zero()]
        blocks = block_terms(spec, places)
        columns = np.hstack([np.vstack([plant.Bf, plant.Df, plant.Dqf]), enters[:, [row for _, row in kept]]])
        terms = [*blocks, *(term for term, _ in kept)]
        quiet = len(spec.plant.Bf[0]) if scenario.unmodeled else nf
        true_terms = [t if i < quiet or i >= nf else Term(Expression.number(0), {}) for i, t in enumerate(terms)]
        return cls(Stack(true_terms, width), Stack(terms, width), columns[:n], columns[n:])


def block_terms(spec: Spec, places: Mapping[str, int]) -> list[Term]:
    """Components of f, each with its own argument under the names q, or q1, q2, ..."""
    terms: list[Term] = []
    first = len(places)
    for block in spec.nonlinearities:
        own = {f"q{i + 1}": first + i for i in range(block.nq)} | ({"q": first} if block.nq == 1 else {})
        terms += [Term(f, {**places, **own}) for f in block.f or ()]
        first += block.nq
    return terms
