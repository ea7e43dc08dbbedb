"""Attacks on what a result file says, from its JSON and the sections of its spec, with no formula of the package.

Members f = K q of the declared classes, frozen and switching, leave a linear system of the error. Its largest gains
over all inputs are computed as norms of its operators, and each is held against the number of the guarantee. Inputs are
held over steps, so that what is found is attained, and a violation is one.
"""

from fractions import Fraction
from itertools import pairwise
from math import comb
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag, expm
from scipy.optimize import minimize

ROUNDING = 1e-7  # relative, of what is computed here
TINY, HUGE = np.finfo(float).tiny, 1e30


class Step(NamedTuple):
    """x+ = F x + G u over a time, u held, integral |z|^2 = |Z (x, u)|^2; at its end x changes by eta through J."""

    time: float
    F: np.ndarray  # (n, n)
    G: np.ndarray  # (n, m)
    Z: np.ndarray  # (n + m, n + m)
    J: np.ndarray  # (n, k)


class Found(NamedTuple):
    """The largest value that was attained of what a guarantee bounds."""

    name: str
    value: float
    bound: float

    @property
    def broken(self):
        """Whether the guarantee is false."""
        return not self.value <= self.bound * (1 + ROUNDING) + 1e-9


def exact(rows):
    """A matrix of decimals, or of texts "p/q", in doubles."""
    return np.array([[float(Fraction(x)) for x in row] for row in rows])


# The plant of a spec


class Matrices(NamedTuple):
    """x' = A x + Bf f(q) + B v, y = C x + Df f(q) + D v, q = Cq x + Dqf f(q) + Dq v, z = H e."""

    A: np.ndarray
    B: np.ndarray
    Bf: np.ndarray
    C: np.ndarray
    D: np.ndarray
    Df: np.ndarray
    Cq: np.ndarray
    Dq: np.ndarray
    Dqf: np.ndarray
    H: np.ndarray


def plant_of(sections):
    """The plant of a spec, with its model of the disturbance: w' = v or w'' = -4 w + v for each channel, or none."""
    system, entries = sections["system"], sections["nonlinearities"]
    A, B, C = (np.array(system[key], dtype=float) for key in "ABC")
    n, nw, ny, nf = len(A), B.shape[1], len(C), sum(len(e["Bf"][0]) for e in entries)

    def stacked(key, rows, columns, across):
        """Matrices of the blocks, beside each other or one above another; zero where there are none."""
        empty = np.zeros((rows, 0) if across else (0, columns))
        shapes = [(rows, len(e["Bf"][0])) if across else (len(e["Cq"]), columns) for e in entries]
        parts = [np.array(e.get(key, np.zeros(shape))) for e, shape in zip(entries, shapes, strict=True)]
        return np.concatenate([empty, *parts], axis=int(across))

    Bf, Df = stacked("Bf", n, nf, True), stacked("Df", ny, nf, True)
    Cq, Dqf, Dq = stacked("Cq", 0, n, False), stacked("Dqf", 0, nf, False), stacked("Dq", 0, nw, False)
    D = np.array(system.get("D", np.zeros((ny, nw))), dtype=float)
    x, w = np.eye(n), np.zeros((nw, n))
    if model := sections.get("disturbance"):
        one = ([[0]], [[1]], [[1]]) if model == "integrator" else ([[0, 1], [-4, 0]], [[0], [1]], [[1, 0]])
        Am, Bm, Cm = (block_diag(*[X] * nw) for X in one)
        x, w = np.eye(n, n + len(Am)), np.hstack([w, Cm])
        A = np.vstack([A @ x + B @ w, np.hstack([np.zeros((len(Am), n)), Am])])
        C, Cq, Bf = C @ x + D @ w, Cq @ x + Dq @ w, x.T @ Bf
        B, D, Dq = np.vstack([0 * B, Bm]), 0 * D, 0 * Dq
    choice = sections.get("performance", "x")
    H = x[:1] if choice == ["x1"] else {"x": x, "w": w, "all": np.eye(len(A))}[choice]
    return Matrices(A, B, Bf, C, D, Df, Cq, Dq, Dqf, H)


def left(plant, E):
    """What is left of a plant without D whose first disturbance is cancelled by xhat = xi + E y."""
    T = np.eye(len(plant.A)) - E @ plant.C
    cut = {"B": T @ plant.B[:, 1:], "D": plant.D[:, 1:], "Dq": plant.Dq[:, 1:]}
    return plant._replace(A=T @ plant.A, Bf=T @ plant.Bf, **cut)


def members_of(kinds, rng, count, factor=1):
    """Matrices of members of all the classes, side by side; `factor`: of every Lipschitz constant."""
    return [block_diag(np.zeros((0, 0)), *(factor * kind.member(rng) for kind in kinds)) for _ in range(count)]


def closed(plant, L1, L2, K):
    """e' = A e + B v of the error xhat - x, for f = K q in the plant and in the observer."""
    p = plant
    through = (p.Bf + L1 @ p.Df) @ K @ np.linalg.inv(np.eye(len(p.Cq)) - (p.Dqf + L2 @ p.Df) @ K)
    return p.A + L1 @ p.C + through @ (p.Cq + L2 @ p.C), -(p.B + L1 @ p.D) - through @ (p.Dq + L2 @ p.D)


# Linear systems


def hinf(A, B, H):
    """H-infinity norm: levels rise to what is attained between the crossings of the last (Bruinsma and Steinbuch)."""
    if np.linalg.eigvals(A).real.max() >= 0:
        return np.inf

    def size(w):
        return np.linalg.norm(H @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B), 2)

    level = max(map(size, [0, *np.abs(np.linalg.eigvals(A))]))
    for _ in range(30):
        if level < 1e-12:
            break
        aim = level * (1 + 1e-8)
        poles = np.linalg.eigvals(np.block([[A, B @ B.T / aim**2], [-H.T @ H, -A.T]]))
        crossings = np.sort(np.abs(poles.imag[np.abs(poles.real) < 1e-8 * (1 + np.abs(poles))]))
        found = max([size((a + b) / 2) for a, b in pairwise([0, *crossings])], default=level)
        if found <= aim:
            break
        level = found
    return level


def step(A, B, H, time, after=None, J=None):
    """One step; `after`: change of x at its end."""
    n, m = B.shape
    M = np.block([[A, B], [np.zeros((m, n + m))]])
    Q = block_diag(H.T @ H, np.zeros((m, m)))
    halvings = max(0, int(np.ceil(np.log2(max(1e-9, time * np.linalg.norm(M)))))) + 1
    E = expm(np.block([[-M.T, Q], [0 * M, M]]) * time / 2**halvings)
    E, W = E[n + m :, n + m :], E[n + m :, n + m :].T @ E[: n + m, n + m :]
    for _ in range(halvings):
        W, E = W + E.T @ W @ E, E @ E
    values, vectors = np.linalg.eigh((W + W.T) / 2)
    jump = np.eye(n) if after is None else after
    J = np.zeros((n, 0)) if J is None else J
    return Step(time, jump @ E[:n, :n], jump @ E[:n, n:], np.sqrt(np.maximum(values, 0))[:, None] * vectors.T, J)


def largest(blocks):
    """Largest sum of |X' u| over unit vectors u: what inputs of length 1 do at most to a sum of X v; (N, n, m)."""
    best = 0.0
    for start in (*np.eye(blocks.shape[1]), np.ones(blocks.shape[1])):
        u = start / np.linalg.norm(start)
        for _ in range(20):
            parts = np.einsum("kij,i->kj", blocks, u)
            sizes = np.linalg.norm(parts, axis=1)
            best = max(best, sizes.sum())
            better = np.einsum("kij,kj->i", blocks, parts / np.maximum(sizes, TINY)[:, None])
            u = better / max(np.linalg.norm(better), TINY)
    return best


class Lifted(NamedTuple):
    """A sequence of steps as operators."""

    t: np.ndarray  # (N,): ends of the steps
    flow: np.ndarray  # (N, n, n): from x at 0
    initial: np.ndarray  # from x at 0 to z, in L2
    forced: np.ndarray  # from u to z, in L2
    inputs: np.ndarray  # (N, N, n, m): [j, k] from u of step k to x at the end of step j
    noise: np.ndarray  # likewise, from what comes at the ends of steps


def lifted(steps):
    """Operators of a sequence of steps, or of those that it takes to grow without end."""
    n, m = steps[0].G.shape
    k, N = steps[0].J.shape[1], len(steps)
    x = np.hstack([np.eye(n), np.zeros((n, N * (m + k)))])
    rows, states = [], []
    for i, s in enumerate(steps):
        at = n + i * m
        u = np.zeros((m, x.shape[1]))
        u[:, at : at + m] = np.eye(m)
        rows.append(s.Z @ np.vstack([x, u]))
        x = s.F @ x + s.G @ u
        x[:, n + N * m + i * k : n + N * m + (i + 1) * k] += s.J
        states.append(x)
        if np.abs(x).max() > HUGE:
            break
    z, x = np.vstack(rows), np.array(states)
    roots = np.repeat(np.sqrt([s.time for s in steps]), m)
    inputs, noise = (
        x[:, :, a : a + N * size].reshape(len(x), n, N, size).transpose(0, 2, 1, 3)
        for a, size in ((n, m), (n + N * m, k))
    )
    t = np.cumsum([s.time for s in steps[: len(x)]])
    return Lifted(t, x[:, :, :n], z[:, :n], z[:, n : n + N * m] / roots, inputs, noise)


def norm(X):
    """Largest singular value; 0 of nothing."""
    return np.linalg.norm(X, 2) if X.size else 0.0


def greedy(options, storage, x, peak=None, supply=1.0):
    """Choose of each step the member with the input that makes V + |z|^2 - supply |u|^2 largest; V(x) = x' S x.

    `options`: the members' steps, of each step; `storage`: S at their ends; `peak`: |u| <= peak in place of supply.
    """
    chosen = []
    for members, S in zip(options, storage, strict=True):
        best = (-np.inf, None, None)
        for s in members:
            n, m = s.G.shape
            Zx, Zu = (s.Z[:, :n], s.Z[:, n:]) if peak is None else (0 * s.Z[:, :n], 0 * s.Z[:, n:])
            pull = (s.G.T @ S @ s.F + Zu.T @ Zx) @ x
            if peak is None:
                cost = supply * s.time * np.eye(m) - s.G.T @ S @ s.G - Zu.T @ Zu
                safe = m and np.linalg.eigvalsh(cost)[0] > 0
                u = np.linalg.solve(cost, pull) if safe else np.zeros(m)
            else:
                u = peak * pull / max(np.linalg.norm(pull), TINY)
            after = s.F @ x + s.G @ u
            value = (
                after @ S @ after + np.sum((Zx @ x + Zu @ u) ** 2) - (supply * s.time * u @ u if peak is None else 0)
            )
            if value > best[0]:
                best = (value, s, after)
        chosen.append(best[1])
        x = best[2] / max(1.0, np.linalg.norm(best[2]) / 1e6)
    return chosen


# The guarantees


def attack(result, drawn, rng, members=6, length=60):
    """What was found of each claim of a certified result file, the worst of each name."""
    family, worst = result["observer"]["type"], {}
    for one in (sampled if family == "sporadic" else continuous)(result, drawn, rng, members, length):
        if one.name not in worst or one.value * worst[one.name].bound > worst[one.name].value * one.bound:
            worst[one.name] = one
    return list(worst.values())


class Copy(NamedTuple):
    """A claim of gains of a copy of the plant, with V = e' P e."""

    name: str
    L1: np.ndarray
    L2: np.ndarray
    P: np.ndarray
    rate: float
    energy: bool  # V' + 2 rate V + mu1 |z|^2 - mu2 |v|^2 <= 0; otherwise V' + 2 rate V - 2 rate mu1 |v|^2 <= 0
    gamma: float
    mu1: float
    mu2: float
    factor: float  # of the declared Lipschitz constants


def claims(result, drawn, plant):
    """Claims of a file of l2, linf or lipschitz, whose constant may be another than the declared one."""
    observer, guarantee, certificate = (result[key] for key in ("observer", "guarantee", "certificate"))
    rate, rows, still = guarantee.get("alpha", guarantee.get("decay")), len(plant.Cq), {"gamma": 0, "mu1": 1, "mu2": 0}

    def claim(name, L1, L2, numbers, P, factor):
        levels = [numbers.get(key, value) for key, value in still.items()]
        return Copy(name, L1, L2, exact(P), rate, observer["type"] != "linf", *levels, factor)

    if observer["type"] == "unknown-input":
        yield claim("", -exact(observer["L"]), np.zeros((rows, len(plant.C))), guarantee, certificate["P"], 1)
        return
    if observer["type"] != "lipschitz":
        L1, L2 = exact(observer["L1"]), exact(observer["L2"]).reshape(rows, len(plant.C))
        yield claim("", L1, L2, guarantee, certificate["P"], 1)
        return
    L1, L2, declared = (
        -exact(observer["L"]),
        np.zeros((rows, len(plant.C))),
        max(k.type["lipschitz"] for k in drawn.kinds),
    )
    yield claim("", L1, L2, guarantee, certificate["P"], guarantee["lipschitz"] / declared)
    if more := certificate.get("admissible"):
        yield claim("admissible: ", L1, L2, more, more["P"], more["lipschitz"] / declared)


def continuous(result, drawn, rng, members, length):
    """Attack what has no jumps: members held and switched, at steps from the fastest pole to the slowest."""
    plant = plant_of(drawn.sections)
    if "E" in result["observer"]:
        E = exact(result["observer"]["E"])
        assert np.abs((np.eye(len(E)) - E @ plant.C) @ plant.B[:, 0]).max() < 1e-12 * (1 + np.abs(plant.B).max())
        plant = left(plant, E)
    for claim in claims(result, drawn, plant):
        systems = [
            closed(plant, claim.L1, claim.L2, K) for K in members_of(drawn.kinds, rng, 4 * members, claim.factor)
        ]
        shift = claim.rate * np.eye(plant.H.shape[1])
        slowest = [np.linalg.eigvals(A).real.max() for A, _ in systems]
        yield Found(f"{claim.name}rate", np.exp(max(slowest)), np.exp(-claim.rate))
        if claim.energy:
            yield Found(f"{claim.name}gamma", max(hinf(A + shift, B, plant.H) for A, B in systems), claim.gamma)
        order = np.argsort(slowest)[::-1]
        systems = [systems[i] for i in (*order[:2], *order[2 :: len(order) // members])]
        fast = max(np.abs(np.linalg.eigvals(A)).max() for A, _ in systems)
        for time in np.geomspace(0.2 / fast, max(0.1 / max(claim.rate, -max(slowest), 1e-6), 0.4 / fast), 3):
            options = [step(A + shift if claim.energy else A, B, plant.H, time) for A, B in systems]
            for steps in sequences(options, claim, rng, length):
                yield from held(lifted(steps), claim, plant.H)


def sequences(options, claim, rng, length):
    """Sequences of steps of one length in time: one member held, switched at random, often or seldom, and greedily."""
    yield from ([one] * length for one in options[:3])
    picks = rng.integers(len(options), size=length)
    yield from ([options[i] for i in np.repeat(picks, often)[:length]] for often in (1, rng.integers(2, 9)))
    S, peak = (claim.P / claim.mu1, None) if claim.energy else (claim.P, np.sqrt(claim.mu1))
    for _ in range(2):
        start = np.linalg.solve(np.linalg.cholesky(claim.P).T, rng.normal(size=len(claim.P)))
        yield greedy([options] * length, [S] * length, start, peak, claim.mu2 / claim.mu1)


def held(made, claim, H):
    """Hold a sequence of steps against a claim; that of an energy is of everything times exp(rate t)."""
    root, spectrum = np.linalg.cholesky(claim.P).T, np.linalg.eigvalsh(claim.P)
    left = np.ones(len(made.t)) if claim.energy else np.exp(-claim.rate * made.t)
    back, name = np.linalg.inv(root), claim.name
    yield largest_part(f"{name}|e(t)|, free", made.flow, np.sqrt(spectrum[-1] / spectrum[0]) * left)
    yield largest_part(f"{name}V(t), free", root @ made.flow @ back, left)
    if claim.energy:
        yield Found(f"{name}norm2(z), free", norm(made.initial @ back), 1 / np.sqrt(claim.mu1))
        yield Found(f"{name}norm2(z), forced", norm(made.forced), claim.gamma)
    else:
        yield Found("|z(t)|, forced", largest(H @ made.inputs[-1]), claim.gamma)
        yield Found("V(t), forced", largest(root @ made.inputs[-1]), np.sqrt(claim.mu1))


def largest_part(name, flows, bounds):
    """The largest part of a bound for all t that an error takes that nothing drives."""
    sizes = np.linalg.norm(flows, 2, axis=(1, 2))
    i = np.argmax(sizes / bounds)
    return Found(name, sizes[i], bounds[i])


def sampled(result, drawn, rng, members, length):
    """Attack `sporadic`, with all gaps the shortest, all the longest, alternating, and random ones."""
    plant, claim, observer = plant_of(drawn.sections), result["guarantee"], result["observer"]
    (ny, n), T1, T2, rate = plant.C.shape, claim["T1"], claim["T2"], claim["decay"]
    flows = [plant.A + plant.Bf @ K @ plant.Cq for K in members_of(drawn.kinds, rng, members)]
    if "K" in observer:
        x = change = np.eye(n)
        jump, J = x - exact(observer["K"]) @ plant.C, -exact(observer["K"])
    else:
        x, d = np.eye(n, n + ny), np.hstack([plant.C, -np.eye(ny)])  # of (e, theta): d = C e - theta
        change, jump, J = np.vstack([x, d]), np.vstack([x, plant.C @ x]), np.eye(n + ny)[:, n:]  # theta+ = C e + eta
        L, F = (exact(observer[key]) for key in ("L", "H"))
        flows = [np.block([[A, -L], [np.zeros((ny, n)), F]]) for A in flows]
    B, H = x.T @ plant.B, plant.H @ x
    for weight in {0, rate}:
        for gaps in gaps_of(T1, T2, rng, length):
            shift, options = weight * np.eye(len(change)), {}
            for T in set(gaps):
                options[T] = [step(M + shift, B, H, T, jump, J) for M in flows]
            storage = [change.T @ storage_at(result, T) @ change for T in [*gaps[1:], T2]]
            every = [options[T] for T in gaps]
            start = rng.normal(size=len(change))
            for steps in (
                [one[0] for one in every],
                [one[1] for one in every],
                [one[i] for one, i in zip(every, rng.integers(members, size=length), strict=True)],
                greedy(every, storage, start, None, claim.get("gamma", 0) ** 2),
            ):
                yield from kept(lifted(steps), claim, change, weight)


def storage_at(result, tau):
    """P at the time tau that is left to the next measurement, of (e, d), or of e where the observer is reset."""
    certificate = result["certificate"]
    if "P1" in certificate:
        P1, P2 = (exact(certificate[key]) for key in ("P1", "P2"))
        return block_diag(P1, np.exp(result["observer"]["delta"] * tau) * P2)
    knots, segments = (certificate["witnesses"]["gamma"][key] for key in ("knots", "P"))
    knots = [float(Fraction(knot)) for knot in knots]
    i = min(max(int(np.searchsorted(knots, tau)) - 1, 0), len(segments) - 1)
    s, degree = (tau - knots[i]) / (knots[i + 1] - knots[i]), len(segments[i]) - 1
    return sum(comb(degree, j) * s**j * (1 - s) ** (degree - j) * exact(P) for j, P in enumerate(segments[i]))


def gaps_of(T1, T2, rng, length):
    """Sequences of gaps between measurements, of which the first may be short."""
    for gaps in (
        [T1] * length, [T2] * length, [T1, T2] * (length // 2), [T2, T2, T1] * (length // 3),
        rng.uniform(T1, T2, length), rng.choice([T1, T2], length),
    ):  # fmt: skip
        yield [rng.choice([0.01 * T2, rng.uniform(0, T2), T2]), *gaps[1:]]


def kept(made, claim, change, weight):
    """Hold a sequence of measurements against (P1), (P2) and (P3), times exp(weight t)."""
    left, back = np.exp((weight - claim.get("rate", 0)) * made.t), np.linalg.inv(change)
    if "overshoot" in claim:
        yield largest_part("|(e, d)(t)|, free", change @ made.flow @ back, claim["overshoot"] * left)
    yield Found("norm2(z), free", norm(made.initial @ back), claim["initial"])
    yield Found("norm2(z), forced", norm(made.forced), claim.get("gamma", 0))
    for key, blocks in (("disturbance", made.inputs), ("noise", made.noise)):
        if key in claim and not weight:
            yield Found(f"|(e, d)(t)|, {key}", largest(change @ blocks[-1]), claim[key])


# No solution


def solution(result, drawn, rng):
    """The best that a search finds where a file says that there is nothing: below 0 it is a solution; None: no search.

    Of a mode that a member hides: the slowest pole over gains, with alpha added. Otherwise, for l2 with one ball of
    members: the norm from (sqrt(lambda) (f - K q), gamma v) to (sqrt(lambda) W q, z), less 1, which is negative exactly
    where the inequality holds for a gain and a lambda (the Kalman-Yakubovich-Popov lemma).
    """
    section, diagnosis, plant = drawn.sections["observer"], result["diagnosis"], plant_of(drawn.sections)
    if section["type"] == "unknown-input":
        b = plant.B[:, :1]
        if not (plant.C @ b).any():
            return None
        plant = left(plant, b @ np.linalg.pinv(plant.C @ b))
    alpha = section.get("alpha", section.get("decay", 0))
    shift = (alpha["min"] if isinstance(alpha, dict) else alpha) * np.eye(len(plant.A))
    shape, (rows, ny), free = (len(plant.A), len(plant.C)), (len(plant.Cq), len(plant.C)), section.get("L2") == "free"
    L2 = rng.normal(size=(rows, ny)) if free else np.zeros((rows, ny)) + np.array(section.get("L2", 0))
    objective = section.get("objective")
    gamma = objective["gamma"] if isinstance(objective, dict) else np.inf

    def slowest(x):
        return np.linalg.eigvals(closed(plant, x[1:].reshape(shape), L2, hidden)[0] + shift).real.max()

    def excess(x):
        A, B = closed(plant, x[1:].reshape(shape), L2, centre)
        late, scale = np.linalg.eigvals(A + shift).real.max(), np.exp(x[0] / 2)
        q = scale * W @ (plant.Cq + L2 @ plant.C)
        return (
            late + 1
            if late > -1e-9
            else hinf(A + shift, np.hstack([plant.Bf / scale, B / gamma]), np.vstack([q, plant.H])) - 1
        )

    if diagnosis["condition"] == "detectability":
        hidden = block_diag(np.zeros((0, 0)), *map(np.atleast_2d, diagnosis["slopes"].values()))
        miss = slowest
    else:
        balls = [kind.ball for kind in drawn.kinds] or [(np.zeros((0, 0)),) * 2]
        if section["type"] != "l2" or free or len(balls) > 1 or balls[0] is None or plant.Dqf.any() or plant.Df.any():
            return None
        (centre, W), miss = balls[0], excess
    starts = [np.append(0, 10 ** rng.uniform(-1, 2) * rng.normal(size=np.prod(shape))) for _ in range(3)]
    return min(minimize(miss, x, method="Nelder-Mead", options={"maxfev": 300}).fun for x in starts)
