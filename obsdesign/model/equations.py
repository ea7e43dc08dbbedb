"""A plant as equations over named signals."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array, Exact
from obsdesign.model.plant import Plant
from obsdesign.records import dataclass, field, replace

Named = Mapping[str, Expression]


@dataclass(frozen=True)
class Equations:
    """A plant over named signals, in continuous or in discrete time.

    x' = f(t, x, u, w, a, y)     or, in discrete time,    x+ = f(t, x, u, w, a, y)
    a  = g(t, x, u, w, a, y)
    y  = h(t, x, u, w, a, y)

    The algebraic signals a, such as the arguments q of nonlinearities, and the outputs y may stand in every right
    side; where they depend on themselves, the equations are implicit.

    Raises `UsageError`: two signals share a name, or a right side has one that is no signal.
    """

    dynamics: Named  # by the names of the states
    outputs: Named
    algebraic: Named = field(default_factory=dict)
    inputs: tuple[str, ...] = ()  # known
    exogenous: tuple[str, ...] = ()  # unknown
    time: Literal["continuous", "discrete"] = "continuous"

    def __post_init__(self) -> None:
        names = self.signals
        if len(set(names)) < len(names):
            twice = next(name for i, name in enumerate(names) if name in names[:i])
            raise UsageError(f"{twice}: two signals of the plant have this name", id="OBS211")
        for name, side in self.sides():
            if stray := sorted(side.names.difference(names)):
                raise UsageError(f"{name}: {stray[0]} in {side} is no signal of the plant", id="OBS203")

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return tuple(self.dynamics)

    def substituted(self, replacements: Named, **changes: Any) -> "Equations":
        """Same equations with other expressions in place of some signals."""
        dynamics, outputs, algebraic = (
            {signal: side.substituted(replacements) for signal, side in part.items()}
            for part in (self.dynamics, self.outputs, self.algebraic)
        )
        return replace(self, dynamics=dynamics, outputs=outputs, algebraic=algebraic, **changes)

    @property
    def signals(self) -> tuple[str, ...]:
        """Names that may stand in a right side."""
        return ("t", *self.states, *self.inputs, *self.exogenous, *self.algebraic, *self.outputs)

    def sides(self) -> Iterator[tuple[str, Expression]]:
        """Every name that is defined, with its right side."""
        for part in (self.dynamics, self.algebraic, self.outputs):
            yield from part.items()


@dataclass(frozen=True)
class Typed:
    """A plant as it is typed, x' = f(t, x, u, w) and y = h(t, x, u, w), with the range of each signal that has one."""

    equations: Equations
    domain: Mapping[str, tuple[fmpq | None, fmpq | None]]  # None: no limit

    @property
    def undisturbed(self) -> Equations:
        """The same with w = 0."""
        still = dict.fromkeys(self.equations.exogenous, Expression.number(0))
        return self.equations.substituted(still, exogenous=())


def linear(M: Array, signals: Sequence[str]) -> list[Expression]:
    """Rows of M times the named signals, as expressions; M is exact."""
    return weighted(M, [Expression.variable(name) for name in signals])


def weighted(M: Array, expressions: Sequence[Expression]) -> list[Expression]:
    """Rows of M times as many expressions as it has columns; M is exact."""
    rows = ([(c, e) for c, e in zip(row, expressions, strict=True) if c != 0] for row in M)
    return [Expression.combination([c for c, _ in row], [e for _, e in row]) for row in rows]


def total(*parts: Sequence[Expression]) -> list[Expression]:
    """Sum of lists of expressions, entry by entry."""
    return [Expression.combination([fmpq(1)] * len(column), column) for column in zip(*parts, strict=True)]


def from_matrices(
    plant: Plant[Exact],
    blocks: Sequence[tuple[Sequence[Expression], int]],
    known: Sequence[Sequence[Expression]],
    inputs: tuple[str, ...],
) -> Equations:
    """Equations of a plant in matrices: x' = A x + Bf f + gx + B w, q = .., y = ..; q are algebraic signals.

    `blocks`: each f_i, of t, outputs, inputs and q (or q1, ..), with nq_i; `known`: gx, gq and gy, with as many
    terms as there are states, components of q and outputs; `inputs`: names of u.
    """
    gx, gq, gy = known
    taken = {"t", *plant.states, *inputs, *plant.outputs}
    exogenous = tuple(free(name, taken) for name in plant.exogenous)
    q: list[str] = []
    f: list[Expression] = []
    for i, (block, nq) in enumerate(blocks, start=1):
        own = [free(f"q{i}" if nq == 1 else f"q{i}_{k + 1}", taken) for k in range(nq)]
        local = {f"q{k + 1}": Expression.variable(name) for k, name in enumerate(own)}
        if nq == 1:
            local["q"] = local["q1"]
        q += own
        f += [component.substituted(local) for component in block]

    def sides(on_x: Array, on_f: Array, on_w: Array, g: Sequence[Expression]) -> list[Expression]:
        return total(linear(on_x, plant.states), weighted(on_f, f), g, linear(on_w, exogenous))

    return Equations(
        dynamics=dict(zip(plant.states, sides(plant.A, plant.Bf, plant.B, gx), strict=True)),
        outputs=dict(zip(plant.outputs, sides(plant.C, plant.Df, plant.D, gy), strict=True)),
        algebraic=dict(zip(q, sides(plant.Cq, plant.Dqf, plant.Dq, gq), strict=True)),
        inputs=inputs,
        exogenous=exogenous,
    )


def free(name: str, taken: set[str]) -> str:
    """Name that no signal has yet, which it is given."""
    while name in taken:
        name += "_"
    taken.add(name)
    return name
