"""Random specs of every family, and linear members of the classes that they declare.

A spec is drawn as its sections. A class of f is its type, as a spec has it, with what draws a matrix K of it: f = K q
is in the class, and so is f = K(t) q for every function K(t) of such matrices.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_continuous_are


class Kind(NamedTuple):
    """A class of f."""

    type: Any
    nf: int
    nq: int
    member: Callable[[np.random.Generator], np.ndarray]  # (nf, nq)
    ball: tuple[Any, Any] | None = None  # K and W, where the class is |df - K dq| <= |W dq|


def decimals(x):
    """Numbers as a spec has them."""
    return (np.round(x, 2) + 0.0).tolist()


def contraction(rng, rows, columns):
    """A matrix of norm 1 at most: of full rank and on the edge, of rank one, or within."""
    U, s, Vt = np.linalg.svd(rng.normal(size=(rows, columns)), full_matrices=False)
    return U * [np.ones(len(s)), np.eye(len(s))[0], rng.uniform(size=len(s))][rng.integers(3)] @ Vt


def shares(rng, size):
    """Numbers from 0 to 1, the ends included, and many that are small."""
    return np.clip(rng.uniform(-0.5, 1.5, size), 0, 1) ** rng.choice([1, 4])


def lipschitz(rng, scale=None):
    constant, (nf, nq) = decimals(rng.uniform(0.1, 1)) if scale is None else scale, rng.integers(1, 3, 2)
    zero = np.zeros((nf, nq))
    return Kind(
        {"lipschitz": constant}, nf, nq, lambda rng: constant * contraction(rng, nf, nq), (zero, constant * np.eye(nq))
    )


def slope(rng):
    low, m = decimals(rng.uniform(-1, 0.8)), rng.integers(1, 3)
    high = decimals(low + rng.uniform(0.1, 1))
    return Kind({"slope": [low, high]}, m, m, lambda rng: np.diag(low + (high - low) * shares(rng, m)))


def half_line(rng):
    low = decimals(rng.uniform(-0.5, 0.5))
    return Kind({"slope": [low, ".inf"]}, 1, 1, lambda rng: np.array([[low + 10 ** rng.uniform(-3, 3)]]))


def monotone(rng):
    m = rng.integers(1, 3)

    def member(rng):
        U, X = rng.normal(size=(2, m, m))
        return 10 ** rng.uniform(-2, 2) * (U @ np.diag(rng.integers(2, size=m)) @ U.T + X - X.T)

    return Kind("monotone", m, m, member)


def centred(rng):
    """K and W, (nf, nq) both, and a `Kind` but for its type: K + U W, |U| <= 1."""
    (nf, nq), size = rng.integers(1, 3, 2), rng.uniform(0.1, 0.8)
    K, W = (np.array(decimals(size * rng.normal(size=(nf, nq)))) for _ in range(2))
    return K, W, (nf, nq, lambda rng: K + contraction(rng, nf, nf) @ W, (K, W))


def ball(rng):
    K, W, rest = centred(rng)
    return Kind({"ball": {"K": K.tolist(), "W": W.tolist()}}, *rest)


def sector(rng):
    K, W, rest = centred(rng)
    return Kind({"sector": {"K1": decimals(K - W), "K2": decimals(K + W)}}, *rest)


def multiplier(rng):
    """|df - K dq|^2 <= |W dq|^2."""
    K, W, rest = centred(rng)
    M = np.block([[W.T @ W - K.T @ K, K.T], [K, -np.eye(len(K))]])
    return Kind({"multiplier": np.round((M + M.T) / 2, 10).tolist()}, *rest)


def cocoercive(rng):
    k, m = decimals(rng.uniform(0.1, 2)), rng.integers(1, 3)
    return Kind(
        {"cocoercive": k}, m, m, lambda rng: k / 2 * (np.eye(m) + contraction(rng, m, m)), (k / 2 * np.eye(m),) * 2
    )


def one_sided(rng):
    """(K + K')/2 <= rho I and |K - phi/2 I|^2 <= beta + phi^2/4; too large a K is drawn to a member."""
    rho, phi, m = decimals(rng.uniform(-0.5, 1)), decimals(rng.uniform(-1, 1)), rng.integers(1, 3)
    middle = min(rho, phi / 2)
    beta = decimals(max(0, middle * (middle - phi)) + rng.uniform(0.1, 1))
    radius = np.sqrt(beta + phi**2 / 4)

    def member(rng):
        K = phi / 2 * np.eye(m) + radius * contraction(rng, m, m)
        excess = np.linalg.eigvalsh((K + K.T) / 2)[-1] - rho
        over = excess + rho - middle
        return K if excess <= 0 else K + (excess / over) * (middle * np.eye(m) - K)

    return Kind({"one-sided-lipschitz": {"rho": rho, "beta": beta, "phi": phi}}, m, m, member)


def jacobian(rng):
    nf, nq = rng.integers(1, 3, 2)
    corners = np.array(decimals(rng.uniform(0.2, 0.8) * rng.normal(size=(rng.integers(2, 4), nf, nq))))

    def member(rng):
        share = rng.dirichlet(np.ones(len(corners))) if rng.integers(2) else rng.permutation(np.eye(len(corners))[0])
        return np.tensordot(share, corners, 1)

    return Kind({"jacobian": corners.tolist()}, nf, nq, member)


def cone(rng):
    nf, nq = rng.integers(1, 3, 2)
    rays = np.array(decimals(rng.normal(size=(rng.integers(1, 3), nf, nq))))
    return Kind({"cone": rays.tolist()}, nf, nq, lambda rng: np.tensordot(10 ** rng.uniform(-3, 2, len(rays)), rays, 1))


def library(rng):
    name, (low, high) = [
        ("sin", (-1, 1)), ("cos", (-1, 1)), ("tanh", (0, 1)), ("atan", (0, 1)), ("sat", (0, 1)), ("relu", (0, 1)),
        ("deadzone", (0, 1)), ("q|q|", (0, 1e3)), ("cubic", (0, 1e3)),
    ][rng.integers(9)]  # fmt: skip
    return Kind(name, 1, 1, lambda rng: low + (high - low) * shares(rng, (1, 1)))


KINDS = (
    lipschitz, slope, half_line, monotone, ball, sector, multiplier, cocoercive, one_sided, jacobian, cone, library,
)  # fmt: skip


SHARES = dict.fromkeys(("l2", "linf", "sporadic", "unknown-input"), (0.1, 0.6, 0.3)) | {
    "lipschitz": (0, 0.7, 0.3)
}  # of 0, 1, 2 blocks


class Drawn(NamedTuple):
    """Sections of a spec, and the class of each block."""

    sections: dict[str, Any]
    kinds: list[Kind]


def drawn(rng, family):
    """A spec of a family, drawn so that about half of them have a solution."""
    n, nw, ny = int(rng.integers(1, 4)), int(rng.integers(1, 3)), int(rng.integers(1, 3))
    nw = 2 if family == "unknown-input" else nw  # of which the first is cancelled
    A = rng.normal(size=(n, n)) - rng.uniform(0.5, 2.5) * np.eye(n)
    through = rng.integers(2, size=nw) | (np.arange(nw) == 0) * (rng.uniform() < 0.95)  # disturbs states, or is noise
    system = {
        "A": decimals(A),
        "B": decimals(rng.normal(size=(n, nw)) * through),
        "C": decimals(rng.normal(size=(ny, n))),
    }
    if family not in ("sporadic", "unknown-input"):
        system["D"] = decimals(0.3 * rng.normal(size=(ny, nw)) * (rng.integers(2, size=nw) | (through == 0)))
    choice = (lipschitz,) if family == "lipschitz" else KINDS
    kinds = [choice[rng.integers(len(choice))](rng) for _ in range(rng.choice([0, 1, 2], p=SHARES[family]))]
    sections = {"name": f"a random {family}", "system": system, "nonlinearities": blocks(rng, kinds, n, nw, ny, family)}
    if family in ("l2", "linf") and not rng.integers(3):
        sections["disturbance"] = ["integrator", {"sinusoid": {"omega": 2}}][rng.integers(2)]
    if rng.integers(2):
        sections["performance"] = str(rng.choice(["all", "w"])) if "disturbance" in sections else ["x1"]
    sections["observer"] = {"type": family} | SECTIONS[family](rng, A, np.array(system["C"]), kinds)
    return Drawn(sections, kinds)


def in_samples(rng, family):
    """A spec of l2 or linf of a plant in samples, drawn so that most of them have a solution."""
    n, nw, ny = int(rng.integers(1, 4)), int(rng.integers(1, 3)), int(rng.integers(1, 3))
    A = rng.normal(size=(n, n))
    A *= rng.uniform(0.3, 1.05) / max(np.abs(np.linalg.eigvals(A)).max(), 1e-3)
    system = {"time": "discrete", "A": decimals(A), "C": decimals(rng.normal(size=(ny, n)))}
    system |= {"B": decimals(0.3 * rng.normal(size=(n, nw))), "D": decimals(0.3 * rng.normal(size=(ny, nw)))}
    kinds = [KINDS[rng.integers(len(KINDS))](rng) for _ in range(rng.choice(3, p=(0.1, 0.6, 0.3)))]
    kinds = [kind if kind.type != "monotone" else slope(rng) for kind in kinds] if rng.integers(4) else kinds
    sections = {"name": f"a random {family} in samples", "system": system}
    sections["nonlinearities"] = blocks(rng, kinds, n, nw, ny, family)
    for entry in sections["nonlinearities"]:
        entry["Bf"] = decimals(0.3 * np.array(entry["Bf"]))
    if not rng.integers(3):
        system["period"] = 0.1
        sections["disturbance"] = ["integrator", {"sinusoid": {"omega": 2}}][rng.integers(2)]
    if rng.integers(2):
        sections["performance"] = ["x1"]
    observer = {"type": family, "rho": decimals(rng.uniform(0.85, 0.99)), "objective": "feasibility"}
    if rng.integers(2):
        observer |= {"objective": "min-gamma", "bounds": {"L1": decimals(10 ** rng.uniform(0.3, 1))}}
    if not rng.integers(3) and not any("Df" in entry for entry in sections["nonlinearities"]):
        observer["estimate"] = "filtered"
    if not rng.integers(3) and not any("jacobian" in kind.type or "cone" in kind.type for kind in kinds):
        observer["L2"] = "free"
    return Drawn(sections | {"observer": observer}, kinds)


def blocks(rng, kinds, n, nw, ny, family):
    """Entries `nonlinearities`; f may act on its own argument, on y and through w where the family allows it."""
    width, entries = sum(kind.nf for kind in kinds), []
    for kind in kinds:
        size = rng.uniform(0.2, 1)
        entry = {"type": kind.type, "Bf": size * rng.normal(size=(n, kind.nf)), "Cq": rng.normal(size=(kind.nq, n))}
        if family in ("l2", "linf") and not rng.integers(4):
            entry["Dqf"], entry["Dq"] = (0.2 * rng.normal(size=(kind.nq, m)) for m in (width, nw))
            entry["Df"] = 0.3 * rng.normal(size=(ny, kind.nf))
        entries.append({key: value if key == "type" else decimals(value) for key, value in entry.items()})
    return entries


def kalman(rng, A, C):
    """A gain with A - L C stable where there is one, to be analysed."""
    n, ny = len(A), len(C)
    X = solve_continuous_are(A.T, C.T, 10 ** rng.uniform(-1, 2) * np.eye(n), np.eye(ny))
    return decimals(X @ C.T)


def incremental(rng, A, C, kinds):  # noqa: ARG001
    """Section of l2 or linf but for its type."""
    size = decimals(10 ** rng.uniform(0.3, 2))
    low = decimals(10 ** rng.uniform(-1.5, 0))
    span = {"min": low, "max": decimals(low * 20), "points": 4, "log": True}
    section = [
        {"alpha": low, "bounds": {"L1": size}},
        {"alpha": span, "bounds": {"L1": size}},
        {"alpha": low, "objective": "feasibility"},
        {"alpha": span, "objective": "max-alpha", "bounds": {"L1": size}},
        {"alpha": low, "objective": {"gamma": decimals(10 ** rng.uniform(-0.5, 1))}},
        {"alpha": low, "bounds": {"L1": {"frobenius": size}}, "slack": 0.01},
        {"alpha": span, "objective": "pareto", "bounds": {"L1": size}},
    ][rng.integers(7)]
    if not rng.integers(3) and not any("jacobian" in kind.type or "cone" in kind.type for kind in kinds):
        section["L2"] = "free"
    elif kinds and not rng.integers(2):
        section["L2"] = decimals(0.3 * rng.normal(size=(sum(kind.nq for kind in kinds), len(C))))
    return section


def lipschitz_section(rng, A, C, kinds):  # noqa: ARG001
    """Section of the family lipschitz but for its type."""
    decay, size = decimals(rng.uniform(0, 0.3)), decimals(10 ** rng.uniform(0.3, 2))
    section = [
        {"objective": "min-gamma", "bounds": {"L": size}},
        {"objective": "max-lipschitz", "bounds": {"L": size}},
        {"objective": "pareto", "weight": decimals(rng.uniform(0.2, 0.9)), "bounds": {"L": size}},
        {"objective": "min-gamma", "gains": {"L": kalman(rng, A, C)}},
    ][rng.choice(4, p=[0.4, 0.2, 0.2, 0.2])]
    relaxation = ["s-procedure", "norm-bound", "abbaszadeh"][rng.choice(3, p=[0.7, 0.2, 0.1])]
    return {"decay": decay, "relaxation": relaxation, **section}


def sporadic(rng, A, C, kinds):  # noqa: ARG001
    """Section of the family sporadic but for its type."""
    T1 = decimals(rng.uniform(0.02, 0.2))
    T2, decay = decimals(T1 * rng.uniform(1, 3)), decimals(rng.choice([0, rng.uniform(0.02, 0.5)]))
    size = decimals(10 ** rng.uniform(0.5, 1.7))
    changes = [
        {"bounds": {"L": size}},
        {"bounds": {"L": size}},
        {"objective": "feasibility"},
        {"objective": "max-T2", "T2": {"min": T1, "max": 4}, "bounds": {"L": size}},
        {"objective": "max-decay", "decay": {"min": 0.01, "max": 3}, "bounds": {"L": size}},
        {"gains": {"L": kalman(rng, A, C), "H": decimals(-np.diag(rng.uniform(0, 3, len(C))))}},
    ][rng.integers(6)]
    injection = ["dynamic", "predictor", "hold"][rng.choice(3, p=[0.5, 0.25, 0.25])]
    if "gains" in changes:
        return {"T1": T1, "T2": T2, "decay": decay, **changes}
    if rng.random() < 0.25 and "bounds" in changes:  # K is as large as what L does in an interval
        injection, changes["bounds"] = "reset", {"K": decimals(float(size) * float(T2))}
    elif rng.random() < 0.3:
        changes["relaxation"] = "proposition-5" if injection == "hold" else "proposition-2"
    return {"T1": T1, "T2": T2, "decay": decay, "injection": injection, **changes}


def cancelling(rng, A, C, kinds):  # noqa: ARG001
    """Section of the family unknown-input but for its type."""
    size, low = decimals(10 ** rng.uniform(0.3, 2)), decimals(10 ** rng.uniform(-1.5, 0))
    section = [
        {"bounds": {"L": size}},
        {"objective": "feasibility"},
        {"objective": {"gamma": decimals(10 ** rng.uniform(-0.5, 1))}},
        {"bounds": {"L": {"frobenius": size}}, "slack": 0.01},
    ][rng.integers(4)]
    return {"cancel": "w1", "alpha": low, **section}


SECTIONS = {"l2": incremental, "linf": incremental, "lipschitz": lipschitz_section, "sporadic": sporadic}
SECTIONS |= {"unknown-input": cancelling}
