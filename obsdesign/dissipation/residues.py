"""Responses of large systems as sums over their modes: C (s I - A)^-1 B is the sum of C v_k w_k' B / (s - s_k).

Once the modes are known, a frequency costs as many products as A has entries, and an output at a frequency of its own
as many as there are modes.
"""

import numpy as np

from obsdesign.lmi.formula import Array
from obsdesign.records import dataclass

ILL = 1e6  # condition of the modes, from which their sum is not used: it multiplies what a double rounds


@dataclass(frozen=True)
class Spectrum:
    """Modes of e' = A e, or of e+ = A e, that are well apart."""

    poles: Array  # (n,)
    V: Array  # (n, n), A V = V diag(poles)

    @classmethod
    def of(cls, A: Array) -> "Spectrum | None":
        """Of a matrix; None where the modes are too close to be told apart."""
        poles, V = np.linalg.eig(A)
        return cls(poles, V) if np.linalg.cond(V) < ILL else None

    def residues(self, B: Array, C: Array | None = None) -> "Residues":
        """Response of C e to v that enters by B; C is the identity if it is not given."""
        return Residues(self.poles, self.V if C is None else C @ self.V, np.linalg.solve(self.V, B))


@dataclass(frozen=True)
class Residues:
    """Response of z = C e to v, of e' = A e + B v or of e+ = A e + B v."""

    poles: Array  # (n,)
    outputs: Array  # C V, (nz, n)
    inputs: Array  # V^-1 B, (n, nv)

    def at(self, s: Array) -> Array:
        """Response at some s, (nv, nz, count).

        A pair of conjugate modes is (2 Re(r) s - 2 Re(r p')) / ((s - p) (s - p')), with r its residue and p' the
        conjugate of p: real factors of complex functions of s, which halves the products.
        """
        upper, real = self.poles.imag > 0, self.poles.imag == 0
        p = self.poles[upper]
        pairs = 1 / ((s - p[:, None]) * (s - p.conj()[:, None]))
        functions = np.concatenate([s * pairs, pairs, 1 / (s - self.poles[real][:, None])])
        found = np.empty((self.inputs.shape[1], len(self.outputs), len(s)), dtype=complex)
        for z, each in zip(found, self.inputs.T, strict=True):
            r, alone = self.outputs[:, upper] * each[upper], self.outputs[:, real] * each[real]
            factors = np.concatenate([2 * r.real, -2 * (r * p.conj()).real, alone.real], axis=1)
            np.matmul(factors, functions.view(float), out=z.view(float))
        return found

    def amplitudes(self, s: Array) -> Array:
        """Norm of the response of each z, (count, nz)."""
        z = self.at(s)
        return np.asarray(np.sqrt((z.real**2 + z.imag**2).sum(axis=0)).T)

    def own(self, s: Array) -> Array:
        """The same where each z has frequencies of its own, (count, nz) as they."""
        z = (self.outputs / (s[..., None] - self.poles)) @ self.inputs
        return np.asarray(np.sqrt((z.real**2 + z.imag**2).sum(axis=-1)))

    def gains(self, s: Array) -> Array:
        """Largest singular value of the response, (count, 1)."""
        z = self.at(s).transpose(2, 0, 1)
        if z.shape[1] > z.shape[2]:
            z = z.transpose(0, 2, 1)
        return np.sqrt(np.maximum(np.linalg.eigvalsh(z @ z.conj().transpose(0, 2, 1))[:, -1:], 0))

    def norms(self, overlap: Array) -> Array:
        """H2 norm of the response of each z to each v, (nz, nv).

        `overlap` (n, n): the integral over time, or the sum, of each mode times the conjugate of each.
        """
        products = [overlap * np.outer(each, each.conj()) for each in self.inputs.T]
        squares = [((self.outputs @ M) * self.outputs.conj()).sum(axis=1).real for M in products]
        return np.asarray(np.sqrt(np.maximum(np.stack(squares, axis=1), 0)))
