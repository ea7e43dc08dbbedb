"""The plant (1) of Corless and Chakrabarty (2019), which is also the shape of the augmented plant (10)."""

from typing import Generic, Protocol, TypeVar, cast, runtime_checkable

from obsdesign.lmi.formula import Array, Exact, Float, in_floats
from obsdesign.records import dataclass, replace

N = TypeVar("N", bound=Array)


@dataclass(frozen=True)
class Plant(Generic[N]):
    """Plant with exogenous input w, nonlinear blocks f(q) and measured output y.

    x' = A x + Bf f + gx + B w
    q  = Cq x + Dqf f + gq + Dq w
    y  = C x + Df f + gy + D w

    All matrices are exact as they come from a spec, `Plant[Exact]`; `plant.doubles` reads them as doubles,
    `Plant[Float]`. A formula takes either, `Plant[Array]`.
    The known terms gx, gq, gy cancel in the error equations and stay with the simulation.
    """

    A: N  # (n, n)
    Bf: N  # (n, nf)
    B: N  # (n, nw)
    Cq: N  # (nq, n)
    Dqf: N  # (nq, nf)
    Dq: N  # (nq, nw)
    C: N  # (ny, n)
    Df: N  # (ny, nf)
    D: N  # (ny, nw)
    states: tuple[str, ...]
    exogenous: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def n(self) -> int:
        """Number of states."""
        return int(self.A.shape[0])

    @property
    def doubles(self) -> "Plant[Float]":
        """Same plant in doubles."""
        return cast("Plant[Float]", in_floats(self))

    @property
    def undisturbed(self) -> "Plant[N]":
        """Same plant without w."""
        return replace(self, **{name: getattr(self, name)[:, :0] for name in ("B", "D", "Dq")}, exogenous=())


@runtime_checkable
class Cancelling(Protocol):
    """What is asked of an observer that takes some channels of w out of the equations of its error."""

    @property
    def cancel(self) -> tuple[int, ...]:
        """Places of these channels."""

    def posed(self, plant: Plant[Exact]) -> Plant[Exact]:
        """Plant whose predicted estimates have the errors that the observer has of the augmented plant."""
