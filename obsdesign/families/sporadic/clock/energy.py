"""Gain from w to z of a linear estimation error whose intervals between measurements recur, in doubles.

Between measurements x' = A x + B w, z = C x, and at one x+ = U V x. The gain from |w|_2 to |z|_2 is at most gamma iff
|z|_2^2 <= gamma^2 |w|_2^2 from zero error over any time. The worst w is that of the Hamiltonian system of the states
and their costates p, which are scaled by gamma,

    [x; p]' = [A, B B' / gamma; -C' C / gamma, -A'] [x; p],    w = B' p / gamma,    p = V' U' p+ at a measurement,

so that over a stretch of time, from its beginning 0 to its end 1,

    x1 = a x0 + b p1,    p0 = c x0 + a' p1,    b, c >= 0.

Two stretches in a row are one of the same form as long as the eigenvalues of b c of the first b and the second c are
below 1; else gamma is too small. A stretch of the flow, a whole sequence, and twice the time again and again are put
together so: the structured doubling of a Riccati equation, in which a -> 0 where gamma is above the gain. See Chu, Fan
and Lin, A structure-preserving doubling algorithm for continuous-time algebraic Riccati equations (2005).
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from obsdesign.dissipation import scan
from obsdesign.families.sporadic.clock.linear import ROUNDING, LinearError
from obsdesign.lmi.formula import Float
from obsdesign.records import dataclass

STEP = 0.5  # of the Hamiltonian system, relative to its rates
DOUBLINGS = 40
FORGOTTEN = 1e-9  # of a state, after which a sequence that goes on adds nothing
FACTOR = 1.2  # between gammas, until one is above the gain and another is not
MOST = 100  # .. of these
SHARP = 1e-4  # relative, of a gain


@dataclass(frozen=True)
class Stretch:
    """x1 = a x0 + b p1, p0 = c x0 + a' p1 over some time."""

    a: Float
    b: Float
    c: Float

    def then(self, later: "Stretch") -> "Stretch | None":
        """One stretch and a later one; None where gamma is too small for them."""
        across = self.b @ later.c
        size = np.square(across).sum()  # bounds the square of its eigenvalues
        if not (size < 1 or (np.isfinite(size) and np.linalg.eigvals(across).real.max() < 1)):
            return None
        inner = np.linalg.inv(np.eye(len(across)) - across)
        first, second = inner @ self.a, inner @ self.b
        b, c = later.b + later.a @ second @ later.a.T, self.c + self.a.T @ later.c @ first
        return Stretch(later.a @ first, (b + b.T) / 2, (c + c.T) / 2)


def gain(error: LinearError, gaps: Sequence[float], guess: float | None = None) -> float:
    """Gain from w to z of a sequence of intervals that recurs, from below, to `SHARP`; infinite where it is unstable.

    w acts on z. The gain is 0 where doubles show none. `guess`: a gain that it is near to.
    """
    if error.growth(gaps) >= ROUNDING:
        return np.inf
    exceeded, start = partial(exceeds, error, gaps), guess or error.strength * max(gaps)
    inside, outside = scan.strides(exceeded, start, FACTOR, MOST) if start else (None, None)
    return 0.0 if inside is None or outside is None else scan.edge(exceeded, inside, outside, SHARP)


def exceeds(error: LinearError, gaps: Sequence[float], gamma: float) -> bool:
    """Whether the gain of a sequence that is stable is above gamma."""
    after = {T: interval(error, gamma, T) for T in set(gaps)}
    found = after[gaps[0]]
    for following in (after[T] for T in gaps[1:]):
        found = found.then(following) if found and following else None
    for _ in range(DOUBLINGS):
        if found is None or np.abs(found.a).max(initial=0.0) < FORGOTTEN:
            break
        found = found.then(found)
    return found is None


def interval(error: LinearError, gamma: float, T: float) -> Stretch | None:
    """Stretch from just after a measurement to just after the next one; None where gamma is too small for it."""
    from scipy.linalg import expm

    A, U, V, m = error.A, error.U, error.V, len(error.A)
    strength = error.strength / gamma
    B, C = (X / np.linalg.norm(X, 2) for X in (error.B, error.C))  # the states are scaled so that they act alike
    rate = float(np.linalg.norm(A, 2)) + strength
    halvings = int(np.ceil(np.log2(max(rate * T / STEP, 1.0))))
    S = expm(np.block([[A, strength * B @ B.T], [-strength * C.T @ C, -A.T]]) * (T / 2**halvings))
    inverse = np.linalg.inv(S[m:, m:])
    found: Stretch | None = Stretch(inverse.T, S[:m, m:] @ inverse, -inverse @ S[m:, :m])
    for _ in range(halvings):
        found = found and found.then(found)
    return found and Stretch(V @ found.a @ U, V @ found.b @ V.T, U.T @ found.c @ U)
