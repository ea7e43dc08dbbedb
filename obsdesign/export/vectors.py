"""Vectors that an exported observer is tested with: what it is given, and what a run in the same steps estimates."""

from dataclasses import dataclass

from obsdesign.lmi.formula import Float


@dataclass(frozen=True)
class Vectors:
    """Rows of a run in steps of a period; `jumps`: rows at which a measurement is taken, of measurements at instants."""

    t: Float  # (K,)
    u: Float  # (K, nu)
    y: Float  # (K, ny)
    estimates: Float  # (K, ne), after the measurement of the row
    jumps: Float  # (K,), 1 or 0
