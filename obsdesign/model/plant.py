"""The plant (1) of Corless and Chakrabarty (2019), which is also the shape of the augmented plant (10)."""

from dataclasses import dataclass

from obsdesign.lmi.formula import Array


@dataclass(frozen=True)
class Plant:
    """Plant with exogenous input w, nonlinear blocks f(q) and measured output y.

    x' = A x + Bf f + gx + B w
    q  = Cq x + Dqf f + gq + Dq w
    y  = C x + Df f + gy + D w

    All matrices are exact (arrays of rationals) as they come from a spec; `in_floats(plant)` reads them as doubles.
    The known terms gx, gq, gy cancel in the error equations and stay with the simulation.
    """

    A: Array  # (n, n)
    Bf: Array  # (n, nf)
    B: Array  # (n, nw)
    Cq: Array  # (nq, n)
    Dqf: Array  # (nq, nf)
    Dq: Array  # (nq, nw)
    C: Array  # (ny, n)
    Df: Array  # (ny, nf)
    D: Array  # (ny, nw)
    states: tuple[str, ...]
    exogenous: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def n(self) -> int:
        """Number of states."""
        return int(self.A.shape[0])
