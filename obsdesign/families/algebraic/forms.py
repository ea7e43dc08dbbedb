"""Observers without an LMI as a spec gives them, in expressions of the signals of the plant."""

from collections.abc import Mapping
from typing import ClassVar, Literal, get_args

from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array
from obsdesign.records import dataclass

Method = Literal["gradient", "log-gradient", "drem", "proportional"]
METHODS = get_args(Method)
ANY = ""  # name of a gain that is that of every coordinate


@dataclass(frozen=True)
class Coordinate:
    """xi, with L_f phi = rate phi + B."""

    name: str
    phi: Expression
    rate: Expression  # lambda
    B: Expression

    @property
    def estimated(self) -> bool:
        """Whether xi differs from phi by a constant theta."""
        return self.rate.text == "0"


@dataclass(frozen=True)
class Regression:
    """d(output)/dt = known + sum m theta, or exp(theta)."""

    output: str
    known: Expression
    m: Mapping[str, Expression]


@dataclass(frozen=True)
class Estimator:
    """How theta is estimated."""

    regressions: tuple[Regression, ...]
    method: Method
    alpha: fmpq
    gamma: Mapping[str, fmpq]
    kappa: fmpq
    epsilon: fmpq
    K: Mapping[str, Expression]
    powers: frozenset[str]  # coordinates in whose exp(theta) the regressions are linear
    consistent: bool  # filters begin where the regression is exact

    def gain(self, name: str) -> fmpq:
        """Gain of a coordinate: its own, or that of all."""
        return self.gamma[name] if name in self.gamma else self.gamma[ANY]


@dataclass(frozen=True)
class Transformed:
    """Coordinates, with a left inverse and an estimator."""

    coordinates: tuple[Coordinate, ...]
    left_inverse: Mapping[str, Expression]
    estimator: Estimator | None
    recast: bool


@dataclass(frozen=True)
class Sought:
    """Coordinates that are to be found, and how their constants are to be estimated."""

    degree: int
    lambdas: tuple[Expression, ...]
    functions: tuple[Expression, ...]
    kind: str  # kkl, pebo or kkl+pebo
    estimator: Estimator | None  # without regressions
    recast: bool


@dataclass(frozen=True)
class Immersion:
    """Manifold beta(y, chi) = phi(x)."""

    chi: tuple[str, ...]
    phi: tuple[Expression, ...]
    beta: tuple[Expression, ...]
    left_inverse: Mapping[str, Expression]  # in b1, b2, ..
    dynamics: Mapping[str, Expression] | None
    Q: tuple[Expression, ...] | None


@dataclass(frozen=True)
class HighGain:
    """Copy of the plant, or of it in other coordinates, with injections."""

    injection: Mapping[str, Mapping[str, Expression]]
    measured: bool  # the copy reads measured states from the outputs
    states: Mapping[str, Expression] | None
    dynamics: Mapping[str, Expression] | None
    left_inverse: Mapping[str, Expression] | None


@dataclass(frozen=True)
class Request:
    """What is asked of an observer."""

    drive: ClassVar[str] = "v"
    restrictions: ClassVar[tuple[str, ...]] = ()
    reconstruct: ClassVar[bool] = False
    filtered: ClassVar[bool] = False
    gains: ClassVar[Mapping[str, Array] | None] = None

    type: str
    form: Transformed | Sought | Immersion | HighGain | None  # None after an error


Form = Transformed | Immersion | HighGain  # of an observer that can be built
