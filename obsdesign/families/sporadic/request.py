"""What a spec asks of an observer whose measurements arrive sporadically, in the numbers of the spec."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from flint import fmpq

from obsdesign.dissipation.bounds import SLACK, Range
from obsdesign.lmi.formula import Array

INJECTIONS = {  # how the correction evolves between measurements, and its relaxations, the tightest first
    "dynamic": ("proposition-2", "proposition-3", "proposition-4"),
    "predictor": ("proposition-2",),
    "hold": ("proposition-5",),
}

SporadicObjective = Literal["min-gamma", "max-T2", "max-decay", "pareto", "feasibility"]


@dataclass(frozen=True)
class SporadicRequest:
    """The `observer` section of a spec for the family whose measurements arrive sporadically."""

    type: str
    T1: fmpq  # s, shortest interval between measurements
    T2: fmpq | Range  # s, longest
    decay: fmpq | Range  # lambda_t, 1/s
    delta: Range  # where the free exponent of the storage function is searched; a number is a range of itself
    injections: tuple[str, ...]  # of INJECTIONS, a curve each
    relaxations: tuple[str, ...]  # of these injections, a curve each; empty: the tightest of each
    objective: SporadicObjective = "min-gamma"
    slack: fmpq = SLACK
    largest_gain: fmpq | None = None  # bounds.L, spectral
    largest_gamma: fmpq | None = None
    gains: Mapping[str, Array] | None = None  # L (n, ny) and H (ny, ny): analysis of these

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Injection and relaxation of each curve, in the order of the request, each once."""
        wanted = {name: self.relaxations or INJECTIONS[name][:1] for name in self.injections}
        found = ((name, r) for name, relaxations in wanted.items() for r in relaxations if r in INJECTIONS[name])
        return tuple(dict.fromkeys(found))

    def conflicts(self) -> Iterator[tuple[tuple[str, ...], str]]:
        """Relaxations that fit none of the injections, or else injections that have none of the relaxations."""
        known = "; ".join(f"{name} takes {', '.join(relaxations)}" for name, relaxations in INJECTIONS.items())
        fitting = {relaxation for _, relaxation in self.pairs}
        strays = [relaxation for relaxation in self.relaxations if relaxation not in fitting]
        for relaxation in strays:
            yield ("relaxation",), f"{relaxation} is for another injection than {', '.join(self.injections)}; {known}"
        for name in self.injections if not strays else ():
            if name not in {injection for injection, _ in self.pairs}:
                yield ("injection",), f"{name} has none of the relaxations that are listed; {known}"
