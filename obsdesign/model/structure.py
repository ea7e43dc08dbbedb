"""What the structure of a problem decides before any matrix inequality: hidden modes, ranks, zeros.

Corless and Chakrabarty (2019), section 4. All functions read plants in doubles, `plant.doubles`.
"""

from math import inf
from typing import Any

import numpy as np

from obsdesign.errors import UsageError
from obsdesign.lmi.formula import Array, Float
from obsdesign.model.disturbance import Generator
from obsdesign.model.edge import Edge
from obsdesign.model.pencil import (
    TOLERANCE,
    System,
    Zeros,
    invariant_zeros,
    output_nulling,
    scaled,
    spectrum,
    split,
    text,
)
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass

ALL = Edge.none(sampled=False)


@dataclass(frozen=True)
class Mode:
    """A mode that no output sees: A v = lambda v and C v = 0. A complex one stands for its conjugate too."""

    eigenvalue: complex
    along: tuple[tuple[str, complex], ...]  # states and entries of v, norm(v) = 1, the largest first and positive

    @property
    def sentence(self) -> str:
        """Mode in words, without the entries below 1 %."""
        value = self.eigenvalue
        entries = [(name, abs(entry) if value.imag else entry.real) for name, entry in self.along]
        direction = ", ".join(f"{name} ({size:.2f})" for name, size in entries if abs(size) >= 0.01)
        number = f"{value.real:.6g} +- {value.imag:.6g}j" if value.imag else text(value)
        return f"the mode lambda = {number} along {direction} is not seen by any output"


def modes(A: Array, C: Array, states: tuple[str, ...], edge: Edge = ALL) -> tuple[Mode, ...]:
    """Unobservable modes of (A, C) that decay no faster than they must, the slowest first.

    These are the eigenvalues at which [A - lambda I; C] has a rank below n (the test of Popov, Belevitch and
    Hautus). The unobservable subspace comes first, from a staircase of singular value decompositions, and
    then the eigenvalues of A on it: so a chain of integrators, whose eigenvalues a rounding error scatters,
    is judged by ranks.

    `A`, `C`, `states`: (n, n) and (ny, n) matrices, and the names of the n states; `edge`: modes that decay faster are
    left out.
    """
    return nulled_modes(System(A, np.zeros((len(A), 0)), C, np.zeros((len(C), 0))), states, edge)


def nulled_modes(system: System, states: tuple[str, ...], edge: Edge = ALL) -> tuple[Mode, ...]:
    """Modes of x while the one input that can do so keeps the output at zero, the slowest first.

    These are the eigenvalues at which the pencil of the system has no full column rank. Where more than one input keeps
    the output at zero there is no such list, and it is empty.
    """
    scaling = scaled(system)
    V, inner = output_nulling(scaling.system)
    if inner.D.shape[0] < inner.D.shape[1]:
        return ()
    dynamics = inner.A - inner.B @ np.linalg.solve(inner.D, inner.C)
    found = [
        mode(scaling.rate * value, scaling.states * vector, states)
        for value, _ in spectrum(dynamics, max(1.0, float(np.linalg.norm(dynamics))))
        if value.imag >= 0 and edge.slow(scaling.rate * value, scaling.rate * TOLERANCE)
        for vector in eigenvectors(V, dynamics, value)
    ]
    return tuple(sorted(found, key=lambda m: edge.of(m.eigenvalue)))


def eigenvectors(V: Array, S: Array, value: complex) -> Array:
    """Eigenvectors V x, S x = value x, as rows; each has an entry that is zero in all the others."""
    from scipy.linalg import qr

    decomposition = np.linalg.svd(S - value * np.eye(len(S)))
    count = max(1, int((decomposition.S <= TOLERANCE).sum()))
    X = V @ decomposition.Vh[-count:].conj().T
    pivots = qr(X.T, mode="r", pivoting=True)[1][:count]
    return np.asarray(np.linalg.solve(X[pivots].T, X.T))


def mode(eigenvalue: complex, vector: Array, states: tuple[str, ...]) -> Mode:
    """Mode of an eigenvector of any length and phase."""
    v = vector / np.linalg.norm(vector)
    order = np.argsort(-np.abs(v).round(9), kind="stable")  # equal entries in the order of the states
    v = v * np.abs(v[order[0]]) / v[order[0]]
    return Mode(eigenvalue, tuple((states[i], complex(v[i])) for i in order if abs(v[i]) > TOLERANCE))


def linear(plant: Plant[Float], K: Array) -> System:
    """Linear plant, from w (or v) to y, that f = K q makes of a plant.

    q = Cq x + Dqf f + Dq w gives f = (I - K Dqf)^-1 K (Cq x + Dq w).

    `plant`, `K`: the plant, and the (nf, nq) matrix of a linear map. Raises `UsageError`: I - K Dqf is singular.
    """
    loop = np.eye(len(K)) - K @ plant.Dqf
    if np.linalg.matrix_rank(loop) < len(loop):
        raise UsageError(
            "Dqf: q = Cq x + Dqf f has no unique solution for the linear f = K q that the types allow", id="OBS305"
        )
    F = np.linalg.solve(loop, K)
    return System(
        plant.A + plant.Bf @ F @ plant.Cq,
        plant.B + plant.Bf @ F @ plant.Dq,
        plant.C + plant.Df @ F @ plant.Cq,
        plant.D + plant.Df @ F @ plant.Dq,
    )


def undetectable(plant: Plant[Float], K: Array, edge: Edge) -> tuple[Mode, ...]:
    """Modes that no observer makes decay faster than they must, whatever its gains.

    The plant with f = K q is one of those that the observer must serve. If v is an unobservable eigenvector
    of it, then e = v exp(lambda t), or v lambda^k, df = K dq and dy = 0 satisfy the error equations: no gain
    acts on this error.

    `plant`, `K`: the plant, as a rule augmented, and the (nf, nq) matrix of a linear map in the class of f; `edge`:
    the decay to be reached.
    """
    system = linear(plant, K)
    return modes(system.A, system.C, plant.states, edge)


def decay_limit(plant: Plant[Float], K: Array, *, sampled: bool = False) -> float:
    """Supremum of the rates of decay that detectability allows: infinite if no mode is hidden."""
    every = Edge.none(sampled=sampled)
    return min((every.of(m.eigenvalue) for m in undetectable(plant, K, every)), default=inf)


@dataclass(frozen=True)
class Condition:
    """One condition of what a lemma or a theorem needs, in words and numbers."""

    name: str
    holds: bool
    sentence: str
    numbers: dict[str, Any]


def condition1(plant: Plant[Float], Am: Array, rest: Edge) -> tuple[Condition, ...]:
    """Condition 1 at each eigenvalue of Am that does not decay; a complex one stands for its conjugate.

    With (A, C) and (Am, Cm) detectable it is sufficient for the augmented plant to be detectable (Lemma 3),
    but not necessary: it fails wherever w has more channels than y. So it explains, and `undetectable`
    decides.

    `plant`, `Am`: the plant before augmentation, and the (nm, nm) matrix of its disturbance model; `rest`: no decay.
    """
    scaling = scaled(System(plant.A, plant.B, plant.C, plant.D))
    columns = plant.n + plant.B.shape[1]
    found = []
    for value, _ in spectrum(Am, float(np.linalg.norm(Am))):
        if rest.slow(value) and value.imag >= 0:
            rank = split(scaling.system.pencil(value / scaling.rate))[1].shape[1]
            said = f"Condition 1 {'holds' if rank == columns else 'fails'} at lambda = {text(value)}"
            sentence = f"{said}: [A - lambda I, B; C, D] has rank {rank} of {columns}"
            found.append(Condition("condition 1", rank == columns, sentence, {"eigenvalue": [value.real, value.imag]}))
    return tuple(found)


def stiff_modes(plant: Plant[Float], q: Array, f: Array) -> tuple[Mode, ...]:
    """Modes of the error that no gain moves if some components of f have no upper slope bound.

    For df = K dq with K -> infinity in these components, dq = 0 there while df is whatever that takes. A mode with dy =
    0 as well is not changed by L1 (yhat - y), nor by L2 (yhat - y): it solves e' = A e + Bf df with 0 = Cq e + Dqf df
    and 0 = C e + Df df. The inequality demands V' + 2 alpha V <= 0 along it.

    `plant`, `q`, `f`: the plant, and the indices of the components of q and f.
    """
    zero = System(
        plant.A,
        plant.Bf[:, f],
        np.vstack([plant.Cq[q], plant.C]),
        np.vstack([plant.Dqf[np.ix_(q, f)], plant.Df[:, f]]),
    )
    return nulled_modes(zero, plant.states)


def accuracy(plant: Plant[Float], L2: Array | None, model: Generator) -> tuple[Condition, ...]:
    """Conditions for any gamma > 0 to be possible: (25) of Theorem 2, Lemmas 4 and 5, of Corless and Chakrabarty.

    P B + Y D = C'F' with F D = 0 and F Df = 0 needs rank T C B N = rank B N, where the rows of T span the combinations
    of outputs without D and Df, and the columns of N those of v that y does not show at once (for D = 0: C B has the
    rank of B). Lemma 4 needs a full column rank of [A - lambda I, B; C, D] for Re lambda >= 0. Without f and with D = 0
    both are sufficient too; with f the inequality (20) has to hold beside them.

    `plant`: the augmented plant: B, D act from v; `L2`: the given gain, or None where it is free; (25b) is Dq + L2 D =
    0; `model`: the disturbance model, for which C B is C B Dm + D Cm Bm in the terms of the plant.
    """
    system = scaled(System(plant.A, plant.B, plant.C, plant.D)).system
    silent, hidden = split(np.hstack([plant.D, plant.Df]).T)[0], split(system.D)[0]
    seen = int(np.linalg.matrix_rank(silent.T @ system.C @ system.B @ hidden, tol=TOLERANCE))
    inputs = int(np.linalg.matrix_rank(system.B @ hidden, tol=TOLERANCE))
    verdict = "as it must" if seen == inputs else f"and must have {inputs}: y shows some of v too late"
    terms = [term for term, there in (("C B Dm", model.Dm.any()), ("D Cm Bm", model.Cm.any())) if there]
    product = " + ".join(terms) if len(model.Am) else "C B"
    if plant.D.any() or plant.Df.any():
        product += ", for the outputs that show neither v nor f at once,"
    zeros = invariant_zeros(System(plant.A, plant.B, plant.C, plant.D))
    unstable = [z for z in zeros.values if z.real >= 0]
    return (
        Condition("rank C B", seen == inputs, f"{product} has rank {seen} {verdict}", {"rank": seen, "needed": inputs}),
        zeros_condition(zeros, unstable, "v to y with f = 0" if plant.Bf.size else "v to y"),
        *argument_condition(plant, L2),
    )


def zeros_condition(zeros: Zeros, unstable: list[complex], path: str) -> Condition:
    """No zero in the closed right half plane."""
    if not zeros.left_invertible:
        sentence = f"y determines {zeros.normal_rank} of the {zeros.inputs} components of v at most"
    elif unstable:
        at = ", ".join(map(text, unstable))
        sentence = f"{path} has a zero in the right half plane at lambda = {at}: y need not show v = exp(lambda t)"
    else:
        sentence = f"{path} has no zero in the closed right half plane"
    numbers = {"zeros": [[z.real, z.imag] for z in unstable], "normal_rank": zeros.normal_rank}
    return Condition("zeros", zeros.left_invertible and not unstable, sentence, numbers)


def argument_condition(plant: Plant[Float], L2: Array | None) -> tuple[Condition, ...]:
    """(25b), where v acts on q."""
    if not plant.Dq.any():
        return ()
    hidden = split(plant.D)[0]
    left = plant.Dq @ hidden if L2 is None else plant.Dq + L2 @ plant.D
    holds = bool(np.abs(left).max(initial=0) <= TOLERANCE * max(1.0, float(np.abs(plant.Dq).max())))
    said = "can be met by a choice of L2" if L2 is None else "holds"
    return (Condition("Dq + L2 D = 0", holds, f"Dq + L2 D = 0 {said if holds else 'fails'}", {}),)
