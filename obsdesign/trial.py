"""How an observer is tried, implemented and fed: `simulation:`, `implementation:` and `data:` of a spec, read."""

import math
from collections.abc import Mapping
from typing import Literal

import numpy as np
import numpy.typing as npt
from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.records import dataclass, field

Vector = npt.NDArray[np.float64]
Hold = Literal["zero", "first"]


@dataclass(frozen=True)
class Level:
    """White noise of an output: its rms, that of a value that is held for a period h, or its density, rms sqrt(h)."""

    number: fmpq  # rms in the unit of the output, or density in unit/sqrt(Hz), two-sided: what stands in D
    period: fmpq | None = None  # s, of a rms that is given with it
    density: bool = False

    def rms(self, period: float) -> float:
        """Rms of a value that is held for a period, s."""
        return float(self.number) / (math.sqrt(period) if self.density else 1.0)

    def held(self, period: float | None) -> float | None:
        """How long a value of a rms is held, s: its own period, or else that of the measurements if there is one."""
        return period if self.period is None else float(self.period)


@dataclass(frozen=True)
class Noise:
    """Measurement noise held constant over each period (s)."""

    type: Literal["uniform", "gaussian"]
    amplitude: Vector  # (ny,), half width or standard deviation
    period: float
    trouble: str = ""  # why it cannot be drawn, with what to write in the section `noise`
    channels: Mapping[str, fmpq] = field(default_factory=dict)  # of w that it is, by output, with their number in D


@dataclass(frozen=True)
class Column:
    """A signal of a run that is in a file of rows, and what it is between two of them."""

    key: str  # of the spec, such as simulation.u.current
    name: str  # of the signal
    file: str  # relative to the folder of the spec, below it
    column: str  # head of its values; that of the time
    time: str = "t"
    hold: Hold = "zero"  # as in the row before, or on the line between both
    path: str = ""  # of the file, where it was found beside another spec

    @property
    def variable(self) -> str:
        """Name of the variable that stands for it: no signal of a spec has one like it."""
        return f"column {self.column} of {self.file} ({self.key})"


@dataclass(frozen=True)
class Tolerance:
    """Where a parameter lies: within so much of its nominal value."""

    nominal: fmpq
    share: fmpq  # relative half-width, 0 to 1


@dataclass(frozen=True)
class Simulation:
    """How to try the observer."""

    horizon: float
    x0: Vector  # (n,) or (n + nm,)
    xhat0: Vector  # (n + nm,)
    w: tuple[Expression, ...] | None  # of t and the states; None: v drives the disturbance model
    v: tuple[Expression, ...] | None  # of t; as w and u it may be the variable of a recorded signal
    u: tuple[Expression, ...]  # of t and the states
    noise: Noise | None
    seed: int
    points: int
    sampling: str | Expression = "periodic"  # of measurements at instants; or random, or a law of t
    period: float | None = None  # s, of the periodic law; None: T2
    dropout: float = 0.0  # share of these measurements that are lost
    theta0: Vector | None = None  # (ny,), the correction before the first of them; None: zero
    xi0: Mapping[str, fmpq] = field(default_factory=dict)  # coordinates of the observer at t = 0; others are 0
    constants: Mapping[str, fmpq] = field(default_factory=dict)  # theta of coordinates at t = 0; others are 0
    events: Mapping[str, Expression] = field(default_factory=dict)  # what ends a run where it becomes true
    silent: tuple[str, ...] = ()  # known inputs that are not given, and are zero
    stepped: bool = False  # the observer runs in the steps of its implementation
    recorded: Mapping[str, Column] = field(default_factory=dict)  # signals in files, by their variables
    x0_width: Vector | None = None  # (n,) half-widths of what is drawn about x0 with the seed; None: nothing is
    uncertainty: Mapping[str, Tolerance] = field(default_factory=dict)  # of parameters that are drawn with the seed


@dataclass(frozen=True)
class Implementation:
    """How an observer in continuous time runs on a computer: in steps of a period, with y held over each."""

    period: fmpq  # s
    method: Literal["euler", "rk4", "exact"]
    impose: bool = False  # whether the design has to be stable in them, for every member of the class


@dataclass(frozen=True)
class Recorded:
    """Where the signals of a spec are in a log, and what is known of the plant that made it."""

    time: str = ""  # column; empty: t
    columns: Mapping[str, str] = field(default_factory=dict)  # by signal, where its name is another
    scale: Mapping[str, fmpq] = field(default_factory=dict)  # factor from the unit of a column to that of the spec
    hold: Hold = "zero"  # of u and y between rows
    arrival: str = ""  # column of when a row became known
    v_sup: fmpq | None = None  # bound on |v|
    eta_sup: fmpq | None = None  # .. on the noise |eta| of each measurement at instants
    e0: Mapping[str, fmpq] = field(default_factory=dict)  # bounds on the error of each state at the start
