"""Frozen members of a class of nonlinearities, f = K q, and exact proofs that one hides a mode from every observer.

If an error e = v exp(lambda t) solves e' = A e + Bf df, 0 = C e + Df df with dq = Cq e + Dqf df and df = K dq, then two
solutions of the plant with f = K q, which the class allows, have the same y for ever and differ by e. So no observer
makes its error decay faster than -Re lambda, whatever its gains and however it is built.

Some blocks are fixed at a K, the others are free: what they must do to keep dy = 0 is found by output nulling, in
rationals, and that K is judged at the eigenvectors of what is left. An irrational lambda is enclosed in a ball.
"""

from collections.abc import Iterator, Sequence
from itertools import chain, islice
from itertools import product as combinations

import numpy as np
from flint import arb, ctx, fmpq_mat, fmpq_poly

from obsdesign.lmi.farkas import null_space
from obsdesign.lmi.formula import Array, Exact, Float, block_diagonal, identity, in_floats, product, rational, zeros
from obsdesign.model.edge import Edge, polynomial
from obsdesign.model.multiplier import Block, Multiplier
from obsdesign.model.pencil import System
from obsdesign.model.plant import Plant
from obsdesign.model.structure import Mode, mode
from obsdesign.records import dataclass

MOST, FEWEST = 300, 8  # combinations of vertices and free blocks that are looked at
LARGE = 12  # order from which these are fewer
RATES = 24  # values of lambda that are tried where there is one for each
DIGITS = 9  # of a direction that is searched in doubles
BITS = 200  # of a ball

Slopes = tuple[Array | None, ...]  # K of each block; None: what keeps y = 0, which must be in the class


@dataclass(frozen=True)
class Hidden:
    """A mode that y does not show for a member f = K q of the class."""

    slopes: Slopes  # exact: what proves it
    member: tuple[Array, ...]  # K of each block along the mode, in doubles
    mode: Mode


@dataclass(frozen=True)
class Motion:
    """Errors that y does not show, e = V xi with xi' = S xi, dq = Q xi and df = F xi; in rationals."""

    V: Array  # (n, r)
    S: Array  # (r, r)
    Q: Array  # (nq, r)
    F: Array  # (nf, r)


def hidden(plant: Plant[Exact], multiplier: Multiplier, edge: Edge) -> Hidden | None:
    """Slowest mode that a member of the class is found to hide and that does not decay as it must.

    The proof is that of `proved`; what is searched are the vertices, what the free blocks do to keep y = 0, and, where
    that is not unique, the directions in which the inequalities of the class leave most room.
    """
    blocks, found = multiplier.blocks, list[Hidden]()
    choices = [(*((None,) if block.generators else ()), *block.vertices) for block in blocks]
    first = tuple(block.member for block in blocks)
    for slopes in islice(chain([first], combinations(*choices)), looked_at(plant.n)):
        system, through = closed(plant, blocks, slopes)
        motion = unseen(plant, system, through) if system else None
        tried = [slopes] if motion else candidates(plant, blocks, slopes, system, through, edge) if system else ()
        found += [h for s in tried if (h := proved(plant, multiplier, s, edge))]
    return min(found, key=lambda h: edge.of(h.mode.eigenvalue), default=None)


def looked_at(n: int) -> int:
    """How many combinations are looked at for a plant of so many states: each takes of the order of n^3 rationals."""
    return max(FEWEST, int(MOST * min(1.0, (LARGE / n) ** 3)))


def proved(plant: Plant[Exact], multiplier: Multiplier, slopes: Slopes, edge: Edge) -> Hidden | None:
    """Prove in rationals, and in balls where lambda is irrational, that a member of the class hides a slow mode.

    A fixed K is in the class of its block, [I; K]' M [I; K] >= 0; a free one satisfies [dq; df]' M [dq; df] > 0 with
    dq != 0 along the mode, whose lambda is real. None if it is not proved.
    """
    blocks = multiplier.blocks
    if not all(allowed(*pair) for pair in zip(slopes, blocks, strict=True)):
        return None
    system, through = closed(plant, blocks, slopes)
    motion = unseen(plant, system, through) if system else None
    if motion is None or edge.kept(motion.S):
        return None
    free = [i for i, K in enumerate(slopes) if K is None]
    if not free:
        values = np.linalg.eigvals(in_floats(motion.S))
        return described(plant, blocks, slopes, motion, complex(min(values, key=edge.of)))
    for value in roots(polynomial(motion.S)):
        if edge.broken(value) and all(admitted(blocks, i, motion, value) for i in free):
            return described(plant, blocks, slopes, motion, complex(float(value.mid())))
    return None


def blind(plant: Plant[Exact], edge: Edge) -> Mode | None:
    """Slowest mode with dy = 0 and dq = 0, proved in rationals not to decay as it must: f plays no part in it.

    Then every member of every class hides it, and so does every f.
    """
    outputs, direct = np.vstack([plant.C, plant.Cq]), np.vstack([plant.Df, plant.Dqf])
    none = zeros((len(plant.Bf.T), 0), [plant.A])
    system = System(plant.A, plant.Bf @ none, outputs, direct @ none)
    motion = unseen(plant, system, (zeros((len(none), plant.n), [plant.A]), none))
    if motion is None or edge.kept(motion.S):
        return None
    values, vectors = np.linalg.eig(in_floats(motion.S))
    slowest = int(np.argmin([edge.of(value) for value in values]))
    value = complex(values[slowest].real, abs(values[slowest].imag))
    return mode(value, in_floats(motion.V) @ vectors[:, slowest], plant.states)


def allowed(K: Array | None, block: Block) -> bool:
    """Whether a fixed K is in the class of its block; a free one is judged along the mode."""
    return bool(block.generators) if K is None else block.contains(K)


def closed(plant: Plant[Exact], blocks: Sequence[Block], slopes: Slopes) -> tuple[System | None, tuple[Array, Array]]:
    """Plant with f = K q in the fixed blocks, the free ones as inputs u: f = through x + .. u; None: no unique q."""
    nf = plant.Bf.shape[1]
    K = block_diagonal([0 * b.member if k is None else k for k, b in zip(slopes, blocks, strict=True)])
    free = [np.full(b.nf, k is None) for k, b in zip(slopes, blocks, strict=True)]
    E = identity(nf, plant.A)[:, np.concatenate(free)] if blocks else zeros((0, 0), [plant.A])
    if not nf:
        return System(plant.A, plant.Bf, plant.C, plant.Df), (zeros((0, plant.n), [plant.A]), E)
    loop = matrix(identity(nf, plant.A) - K @ plant.Dqf)
    if loop.det() == 0:
        return None, (K, E)
    W = array(loop.inv())
    x, u = W @ K @ plant.Cq, W @ E
    return System(plant.A + plant.Bf @ x, plant.Bf @ u, plant.C + plant.Df @ x, plant.Df @ u), (x, u)


def unseen(plant: Plant[Exact], system: System, through: tuple[Array, Array]) -> Motion | None:
    """Largest subspace on which the one input that can do so keeps y = 0; None if several inputs can.

    As `pencil.output_nulling`, in rationals.
    """
    A, B, C, D = system.A, system.B, system.C, system.D
    V = identity(len(A), A)
    while True:
        rows = echelon(np.hstack([D, C]))
        direct = (rows[:, : D.shape[1]] != 0).any(axis=1)
        D, C, R = rows[direct, : D.shape[1]], rows[direct, D.shape[1] :], rows[~direct, D.shape[1] :]
        if not len(R):
            break
        basis = null_space(R)
        kept = [int(np.flatnonzero(row != 0)[-1]) for row in basis]  # where the basis is the identity
        K = basis.T
        AK = product(A, K)
        C, D = np.vstack([product(C, K), product(R, AK)]), np.vstack([D, product(R, B)])
        A, B, V = AK[kept], B[kept], product(V, K)
    if len(D) < D.shape[1]:
        return None
    U = -C  # D is the identity
    F = product(through[0], V) + product(through[1], U)
    return Motion(V, A + product(B, U), product(plant.Cq, V) + product(plant.Dqf, F), F)


def candidates(
    plant: Plant[Exact],
    blocks: Sequence[Block],
    slopes: Slopes,
    system: System,
    through: tuple[Array, Array],
    edge: Edge,
) -> Iterator[Slopes]:
    """Members K, in rationals, for which a direction of the free f keeps y = 0 with a lambda of a grid."""
    n, free = plant.n, [i for i, K in enumerate(slopes) if K is None]
    A: Float = np.asarray(in_floats(plant.A))
    if not np.isfinite(A).all() or not A.size:  # beyond doubles
        return
    low, high = float(edge.end) * (1 - 1e-6), float(np.abs(balanced(A)).max() * plant.n + 1)
    for value in (rational([[repr(x)]]).item() for x in np.linspace(low, max(high, low + 1), RATES).tolist()):
        pencil = np.block([[system.A - value * identity(n, plant.A), system.B], [system.C, system.D]])
        Z = null_space(pencil).T
        F = through[0] @ Z[:n] + through[1] @ Z[n:]
        Q = plant.Cq @ Z[:n] + plant.Dqf @ F
        parts = [(blocks[i], *pair) for i, pair in zip(free, pairs(blocks, free, Q, F), strict=True)]
        forms = [g.form(q, f) for block, q, f in parts for g in block.generators]
        z = widest(forms, Z[:n]) if Z.size else None
        if z is None or any((z @ form @ z) < 0 for form in forms):
            continue
        chosen = [through_pair(block, q @ z, f @ z) for block, q, f in parts]
        if all(K is not None for K in chosen):
            named = dict(zip(free, chosen, strict=True))
            yield tuple(named.get(i, K) for i, K in enumerate(slopes))


def balanced(A: Float) -> Float:
    """A in units of the states in which its entries are of like sizes."""
    from scipy.linalg import matrix_balance

    return np.asarray(matrix_balance(A, permute=False)[0])


def widest(forms: Sequence[Array], X: Array) -> Array | None:
    """Direction, in few digits, in which the forms are largest beside |X z|^2, each in a size of its own."""
    weight = in_floats(X.T @ X)
    if not weight.any():
        return None
    total = sum(form / (np.abs(form).max() or 1.0) for form in map(in_floats, forms))
    scale = np.sqrt(np.maximum(np.diag(weight), np.abs(weight).max() * 1e-12))
    _, vectors = np.linalg.eigh(np.asarray(total) / np.outer(scale, scale))
    z = vectors[:, -1] / scale
    if not np.isfinite(z).all() or not z.any():
        return None
    return rational([f"{x:.{DIGITS}g}" for x in z / np.abs(z).max()])


def pairs(blocks: Sequence[Block], chosen: Sequence[int], Q: Array, F: Array) -> Iterator[tuple[Array, Array]]:
    """Rows of some blocks in q and in f."""
    q, f = (np.cumsum([0, *(getattr(b, size) for b in blocks)]) for size in ("nq", "nf"))
    for i in chosen:
        yield Q[q[i] : q[i + 1]], F[f[i] : f[i + 1]]


def through_pair(block: Block, q: Array, f: Array) -> Array | None:
    """Linear map of the class that takes q to f, in rationals; None if none is found.

    Either k I and a rotation, or of rank one beside the center of an ellipsoid of matrices.
    """
    size = q @ q
    if not size:
        return None if f.any() else block.member
    tried = []
    if block.nq == block.nf:
        k = (q @ f) / size
        rest = f - k * q
        tried.append(k * identity(len(q), q) + (np.outer(rest, q) - np.outer(q, rest)) / size)
    for g in block.generators:
        inner = matrix(-g.M22)
        if inner.det():
            center = array(inner.inv()) @ g.M12.mT
            seen = q @ (g.M11 + g.M12 @ center)
            tried.append(center + np.outer(f - center @ q, seen) / (seen @ q) if seen @ q else center)
    return next((K for K in tried if (K @ q == f).all() and block.contains(K)), None)


def admitted(blocks: Sequence[Block], i: int, motion: Motion, value: arb) -> bool:
    """Whether a free block does, along the eigenvector of a real eigenvalue, what its class surely allows."""
    with ctx.workprec(BITS):
        xi = eigenvector(motion.S, value)
        if xi is None:
            return False
        ((Q, F),) = pairs(blocks, [i], motion.Q, motion.F)
        q, f = (balls(X) @ xi for X in (Q, F))
        if not any(x != 0 for x in q):
            return False
        signs = (q @ balls(g.M11) @ q + 2 * (q @ balls(g.M12) @ f) + f @ balls(g.M22) @ f for g in blocks[i].generators)
        return all(bool(sign > 0) for sign in signs)


def eigenvector(S: Array, value: arb) -> Array | None:
    """Column of the adjugate of lambda I - S, in balls, that is surely not zero; None if there is none.

    adj(lambda I - S) = sum_k lambda^(r - 1 - k) M_k, M_0 = I, M_k = S M_(k-1) + c_k I (Faddeev and Le Verrier).
    """
    r, M = len(S), identity(len(S), S)
    adjugate = balls(M)
    for k in range(1, r):
        M = S @ M
        M = M - np.trace(M) / k * identity(r, S)
        adjugate = value * adjugate + balls(M)
    columns = [column for column in adjugate.T if any(x != 0 for x in column)]
    return max(columns, key=lambda c: max(abs(float(x.mid())) for x in c)) if columns else None


def described(plant: Plant[Exact], blocks: Sequence[Block], slopes: Slopes, motion: Motion, value: complex) -> Hidden:
    """Mode in doubles, with K along it; of a free block of several components that of least norm."""
    S, V, Q, F = (in_floats(X) for X in (motion.S, motion.V, motion.Q, motion.F))
    values, vectors = np.linalg.eig(S)
    nearest = int(np.argmin(np.abs(values - value)))
    xi = vectors[:, nearest]
    parts = pairs(blocks, range(len(blocks)), Q @ xi, F @ xi)
    member = tuple(
        in_floats(K) if K is not None else np.real(np.outer(f, q.conj()) / np.vdot(q, q))
        for K, (q, f) in zip(slopes, parts, strict=True)
    )
    return Hidden(slopes, member, mode(complex(values[nearest].real, abs(values[nearest].imag)), V @ xi, plant.states))


def roots(p: fmpq_poly) -> list[arb]:
    """Real roots in balls, the largest first."""
    with ctx.workprec(BITS):
        found = [root.real for root, _ in p.numer().complex_roots() if root.imag == 0]
    return sorted(found, key=lambda x: -float(x.mid()))


def balls(X: Array) -> Array:
    """Rationals as balls."""
    return np.asarray(np.vectorize(arb, otypes=[object])(X))


def matrix(X: Array) -> fmpq_mat:
    """Rational matrix of flint."""
    return fmpq_mat(*X.shape, X.ravel().tolist())


def array(X: fmpq_mat) -> Array:
    """Array of a rational matrix of flint."""
    made: Array = np.array(X.entries(), dtype=object).reshape(X.nrows(), X.ncols())
    return made


def echelon(X: Array) -> Array:
    """Reduced echelon form of the rows, without zeros."""
    if not X.size:
        return X[:0]
    reduced, rank = matrix(X).rref()
    return array(reduced)[:rank]
