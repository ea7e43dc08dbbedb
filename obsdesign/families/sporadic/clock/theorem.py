"""The inequalities of a clock-dependent certificate, for the flow and the jumps of an estimation error.

Between measurements the error x and the clock tau, the time left to the next measurement, obey

    x' = F x + Bx w + Bfx df,    tau' = -1,    dq = Cq x + Dq w + Dqf df,    z = Cp x,

and at a measurement with the noise eta, x+ = J x + Jn eta, with tau set to the interval that comes, in [T1, T2]. Let

    V = x' P(tau) x,    P continuous and piecewise polynomial on [0, T2],    M(tau) in the cone of the multiplier,

    (F)  -P' + He(P F) + 2 lambda P + .. <= 0 on [0, T2]: V' + 2 lambda V + |z|^2 - mu |w|^2 + [dq; df]' M [dq; df] <= 0
    (J)  J' P(tau) J <= P(0) for tau in [T1, T2]
    (N)  [P(0) - J' P(tau) J, -J' P(tau) Jn; ., kappa I - Jn' P(tau) Jn] >= 0 for tau in [T1, T2], which implies (J)
    (P)  P(0) >= 0.

Then, for every sequence of measurements that are T1 to T2 apart with a first one no later than T2 (T1 = 0: any positive
intervals that do not accumulate), and every f of its type,

    gain    |z|_2^2 <= V(0) + mu |w|_2^2 where eta = 0, and so it is with the weight exp(2 lambda t) in both integrals;
            with (N) plus kappa sum |eta_k|^2;
    rate    with rho1 I <= P <= rho2 I, |x(t)| <= sqrt(rho2 / rho1) exp(-lambda t) |x(0)| where w = 0 and eta = 0;
    bound   from zero error |x(t)| <= sqrt(mu / (2 lambda rho1)) sup|w| where eta = 0, and with (N)
            |x(t)| <= sqrt(kappa / ((1 - exp(-2 lambda T1)) rho1)) sup|eta| where w = 0.

Proof. Between measurements V' is the left side of (F), since tau' = -1, less a term that is not negative. At one of
them V goes from x'P(0)x to (J x + Jn eta)'P(g)(J x + Jn eta) for the interval g that comes, and grows by no more than
kappa |eta|^2. P >= 0 everywhere: some trajectory of the class without w leads from any state to the next measurement
(that of a linear member of it), and exp(2 lambda t) V does not increase along it to x'P(0)x >= 0. Integrate; the sum of
exp(-2 lambda (t - t_k)) is at most 1 / (1 - exp(-2 lambda T1)).

V looks ahead, at an interval that has not ended: the bounds hold of each trajectory in hindsight, and the gains do not
depend on this clock. With `lookahead` it looks one measurement further: P is one function for each part, of equal
length, of [T1, T2] in which the interval after the next measurement ends, and (J) and (N) are asked from each of these
functions to each that may follow.

A gain K(s) of a reset may depend on the interval s that has just ended. For it the clock is the time s since the last
measurement instead: P(s), P' with the other sign in (F), and J(s)' P(0) J(s) <= P(s) for s in [T1, T2], J = I - K C.
With K and P of the same degree on the same segments, this holds if it does for each pair of control values, since it
is convex in J where P(0) >= 0. Before the first measurement, at t1, the clock begins at max(0, T1 - t1).

(F), (J), (N) are affine in P, P' and M, so that they hold if they do for the control values (`bernstein`). For T1 = 0,
(J) at tau = 0 leaves no room in the rows where J = I: P(0) is block-diagonal then. This is not in the paper.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.families.sporadic.clock.bernstein import Clock
from obsdesign.families.sporadic.clock.tied import Tied
from obsdesign.lmi.formula import (
    Array,
    Inequality,
    Unknown,
    Values,
    block_diagonal,
    combined,
    he,
    identity,
    in_floats,
    symmetric,
    zeros,
)
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass, replace

HOLDING = (
    "xhat' = A xhat + Bf f(qhat) + g + L theta, theta' = H theta between measurements, "
    "theta+ = y - C xhat at a measurement, e = x - xhat, d = C e - theta, z = Cp e"
)
ADAPTING = (
    "xhat' = A xhat + Bf f(qhat) + g between measurements, xhat+ = xhat + K(s) (y - C xhat) at a measurement, "
    "s the time since the one before, e = x - xhat, z = Cp e"
)
RESETTING = (
    "xhat' = A xhat + Bf f(qhat) + g between measurements, xhat+ = xhat + K (y - C xhat) at a measurement, "
    "e = x - xhat, z = Cp e"
)
SETTLES = "V does not grow at a measurement"
DECREASE = "V' + 2 lambda V + |z|^2 - mu |w|^2 <= 0"


@dataclass(frozen=True)
class ErrorSystem:
    """Flow and jump of an estimation error, in rationals or in doubles."""

    F: Array  # (m, m)
    Bx: Array  # (m, nw)
    Bfx: Array  # (m, nf)
    J: Array  # (m, m), or the control values on the segments of [T1, T2], (k, m, m)
    Jn: Array  # (m, ny), or (k, m, ny)
    Cp: Array  # (nz, m)
    Cq: Array  # (nq, m)
    Dq: Array  # (nq, nw)
    Dqf: Array  # (nq, nf)
    kept: int  # the first entries of x, which a measurement leaves as they are; 0: none is known to be

    @property
    def order(self) -> int:
        """Number m of entries of x."""
        return len(self.F)

    @property
    def elapsed(self) -> bool:
        """Whether J depends on the interval that has ended: the clock is the time since the last measurement then."""
        return self.J.ndim > 2

    @property
    def size(self) -> str:
        """Length of x in words."""
        return "|(e, d)|" if self.kept else "|e|"

    @property
    def undisturbed(self) -> "ErrorSystem":
        """Same error without w and z."""
        return replace(self, Bx=self.Bx[:, :0], Dq=self.Dq[:, :0], Cp=self.Cp[:0])


def held(p: Plant[Array], Cp: Array, L: Array, H: Array) -> ErrorSystem:
    """Error (e, d) of the observer (4): e = x - xhat, d = C e - theta, theta' = H theta, theta+ = C e + eta."""
    n, ny = L.shape
    like = [p.A, L]
    beside, eye, one = zeros((len(p.Cq), ny), like), identity(n, L), identity(ny, L)
    correction = combined((p.C, L), (one, H))
    flow = [[combined((eye, p.A), (-L, p.C)), L], [combined((p.C, p.A), (-correction, p.C)), correction]]
    return ErrorSystem(
        F=np.block(flow),
        Bx=np.vstack([p.B, combined((p.C, p.B))]),
        Bfx=np.vstack([p.Bf, combined((p.C, p.Bf))]),
        J=block_diagonal([eye, zeros((ny, ny), like)]),
        Jn=np.vstack([zeros((n, ny), like), -one]),
        Cp=np.hstack([Cp, zeros((len(Cp), ny), like)]),
        Cq=np.hstack([p.Cq, beside]),
        Dq=p.Dq,
        Dqf=p.Dqf,
        kept=n,
    )


def reset(p: Plant[Array], Cp: Array, K: Array) -> ErrorSystem:
    """Error e of a copy of the plant that is corrected at the measurements, xhat+ = xhat + K (y - C xhat)."""
    eye = identity(p.n, K)
    return ErrorSystem(p.A, p.B, p.Bf, combined((eye, eye), (-K, p.C)), -K, Cp, p.Cq, p.Dq, p.Dqf, 0)


def error_system(plant: Plant[Array], Cp: Array, gains: Mapping[str, Array]) -> ErrorSystem:
    """Error of an observer with the gains L and H, or K, or the control values of a K that depends on the interval."""
    if "K_of_gap" in gains:
        K = gains["K_of_gap"].reshape(-1, plant.n, len(plant.C))
        return reset(plant, Cp, K)
    if "K" in gains:
        return reset(plant, Cp, gains["K"])
    return held(plant, Cp, gains["L"], gains["H"])


def equations(system: ErrorSystem) -> str:
    """Observer and error in words."""
    return HOLDING if system.kept else ADAPTING if system.elapsed else RESETTING


@dataclass(frozen=True)
class ClockTheorem:
    """The inequalities for an error system, in its numbers; see the module."""

    system: ErrorSystem
    multiplier: Multiplier
    clock: Clock
    T1: fmpq
    decay: Any  # lambda, 1/s
    lookahead: int = 1
    tied: Tied | None = None  # what T1 = 0 asks of P(0) where no entry of x is kept

    @property
    def doubles(self) -> "ClockTheorem":
        """Same theorem in doubles; the clock stays as it is."""
        system, multiplier, tied = in_floats(self.system), in_floats(self.multiplier), in_floats(self.tied)
        return replace(self, system=system, multiplier=multiplier, decay=float(self.decay), tied=tied)

    @property
    def ahead(self) -> int:
        """Intervals to come that V depends on."""
        if self.system.elapsed:
            return 0
        return 2 if self.lookahead > 1 else 1

    # Unknowns

    @property
    def storage(self) -> list[tuple[Unknown, ...]]:
        """Unknowns of each control value of P, one function after the other: blocks of P where that is diagonal."""
        m, n = self.system.order, self.system.kept
        blocks = [("", m)] if self.T1 or not n else [("e", n), ("d", m - n)]
        return [
            (Unknown(f"P{place}", (len(self.tied.basis), 1)),)
            if self.tied and not j
            else tuple(
                Unknown(f"P{place}{part}", (k, k), symmetric=True) for part, k in (blocks if not j else [("", m)])
            )
            for place, j in self.named(self.clock.count)
        ]

    def named(self, count: int) -> Iterator[tuple[str, int]]:
        """Names and places of the control values of one thing, function by function."""
        for bin_ in range(self.lookahead):
            for j in range(count):
                yield (f"{bin_}_{j}" if self.lookahead > 1 else f"{j}"), j

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """P and the multiplier at every control value."""
        return (*(u for blocks in self.storage for u in blocks), *self.scales)

    @property
    def scales(self) -> tuple[Unknown, ...]:
        """Unknowns of the multiplier at every control value of the flow."""
        places = [place for place, _ in self.named(self.clock.places.size)]
        return tuple(replace(u, name=f"{u.name}_{place}") for u in self.multiplier.unknowns() for place in places)

    def P(self, v: Values) -> Array:
        """Control values of P, (.., lookahead, N d + 1, m, m)."""
        values = [
            block_diagonal([v[u.name] for u in blocks]) if len(blocks) > 1 else self.first(v[blocks[0].name])
            for blocks in self.storage
        ]
        return self.stacked(values, self.clock.count)

    def first(self, value: Array) -> Array:
        """P of its unknown: itself, or where P(0) is tied the sum of the matrices of the basis, (.., m, m)."""
        if value.shape[-1] > 1 or self.tied is None:
            return value
        return np.asarray(np.tensordot(value[..., 0], self.tied.basis, axes=1))

    def stacked(self, values: list[Array], count: int) -> Array:
        """Values of all functions, (.., lookahead, count, k, k)."""
        lead = np.broadcast_shapes(*(value.shape for value in values))
        stack = np.stack([np.broadcast_to(value, lead) for value in values], axis=-3)
        return stack.reshape(*lead[:-2], self.lookahead, count, *lead[-2:])

    def multipliers(self, v: Values) -> dict[str, Array]:
        """Unknowns of the multiplier at the control values of the flow, (.., lookahead, N (d + 1), k, k)."""
        size = self.clock.places.size
        return {
            u.name: self.stacked([v[f"{u.name}_{place}"] for place, _ in self.named(size)], size)
            for u in self.multiplier.unknowns()
        }

    # Inequalities

    def flow(self, P: Array, PF: Array, slope: Array, v: Values) -> Array:
        """The matrix of (F) in (x, w, df), with weight |z|^2; the product P F is affine in what is searched."""
        s = self.system
        M11, M12, M22 = self.multiplier.matrix(v)
        along = M11 @ s.Dqf + M12
        drift = he(PF) - slope + 2 * self.decay * P
        return symmetric(
            [
                [
                    drift + v["weight"] * (s.Cp.mT @ s.Cp) + s.Cq.mT @ M11 @ s.Cq,
                    P @ s.Bx + s.Cq.mT @ M11 @ s.Dq,
                    P @ s.Bfx + s.Cq.mT @ along,
                ],
                [s.Dq.mT @ M11 @ s.Dq - v["mu"] * identity(s.Bx.shape[1], s.Bx), s.Dq.mT @ along],
                [s.Dqf.mT @ M11 @ s.Dqf + he(s.Dqf.mT @ M12) + M22],
            ]
        )

    def jump(self, before: Array, after: Array) -> Array:
        """The matrices of (J), (.., k, m, m)."""
        return self.system.J.mT @ after @ self.system.J - before

    def noisy_jump(self, before: Array, after: Array, kappa: Array) -> Array:
        """The matrices of (N), of the other sign."""
        s = self.system
        own = s.Jn.mT @ after @ s.Jn - kappa * identity(s.Jn.shape[-1], s.Jn)
        return symmetric([[self.jump(before, after), s.J.mT @ after @ s.Jn], [own]])

    def inequalities(self, v: Values) -> list[Inequality]:
        """All of them, of the unknowns and of the numbers of `conditions`; without rows that must vanish and do."""
        found = self.conditions(self.P(v), self.multipliers(v), v)
        if self.tied is None:
            return found
        S, at_once = self.tied.across, f"{SETTLES} (1)"
        return [replace(i, matrix=S.mT @ i.matrix @ S) if i.name == at_once else i for i in found]

    def conditions(self, P: Array, M: Values, v: Values) -> list[Inequality]:
        """(F), (J) or where there is a kappa (N), and the bounds on P, at all control values.

        `P`: (.., lookahead, N d + 1, m, m); `M`: unknowns of the multiplier, (.., lookahead, N (d + 1), k, k); `v`: the
        numbers weight, of |z|^2, and mu, and floor, r and kappa where these are asked for, (.., 1, 1).
        """
        deep = {name: v[name][..., None, None, :, :] for name in ("weight", "mu")}
        on, slope = self.clock.on(P), self.clock.slope(P)
        F = self.flow(on, on @ self.system.F, -slope if self.system.elapsed else slope, {**M, **deep})
        return [
            *listed(DECREASE, F),
            *self.jumps(P, v.get("kappa")),
            *self.sizes(P, v),
            *(i for cone in self.multiplier.inequalities(M) for i in listed(cone.name, cone.matrix)),
        ]

    def sizes(self, P: Array, v: Values) -> Iterator[Inequality]:
        """(P), or where there is a `floor` P >= floor I, and where there is an r P <= r I."""
        eye = identity(self.system.order, self.system.F)
        if "floor" in v:
            yield from listed("P >= I", v["floor"][..., None, None, :, :] * eye - P)
        else:
            yield from listed("P(0) >= 0", -P[..., :1, :, :])
        if "r" in v:
            yield from listed("P <= r I", P - v["r"][..., None, None, :, :] * eye)

    def followed(self, P: Array) -> Iterator[tuple[Array, Array]]:
        """P before and after a measurement, for each function: P(0), (.., 1, m, m), and what may follow, (.., k, m, m).

        Of the time elapsed they are the control values in [T1, T2], segment by segment, and P(0).
        """
        T2 = self.clock.knots[-1]
        if self.system.elapsed:
            yield P[..., 0, self.clock.segments_within(self.T1), :, :], P[..., 0, :1, :, :]
            return
        ends = [self.T1 + (T2 - self.T1) * fmpq(i, self.lookahead) for i in range(self.lookahead + 1)]
        for i in range(self.lookahead):
            after = P[..., self.clock.within(ends[i], ends[i + 1]), :, :]
            yield P[..., i, :1, :, :], after.reshape(*after.shape[:-4], -1, *after.shape[-2:])

    def jumps(self, P: Array, kappa: Array | None) -> Iterator[Inequality]:
        """(J), or (N), from each function to each at the control values of the part of [T1, T2] that it stands for."""
        deep = None if kappa is None else kappa[..., None, :, :]
        for i, (before, after) in enumerate(self.followed(P)):
            if deep is None:
                name, matrix = SETTLES, self.jump(before, after)
            else:
                name, matrix = "V grows by kappa |eta|^2 at a measurement", self.noisy_jump(before, after, deep)
            yield from listed(f"{name}{self.part(i)}", matrix[..., None, :, :, :])

    def part(self, i: int) -> str:
        """Name of a part of [T1, T2]; empty where there is one."""
        return f" of part {i + 1}" if self.lookahead > 1 else ""


def listed(name: str, stack: Array) -> Iterator[Inequality]:
    """Inequalities of a stack (.., lookahead, count, k, k), numbered."""
    for i, j in np.ndindex(stack.shape[-4:-2]):
        place = f"{i + 1}, {j + 1}" if stack.shape[-4] > 1 else f"{j + 1}"
        yield Inequality(f"{name} ({place})", stack[..., i, j, :, :])
