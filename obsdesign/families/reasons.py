"""What every answer about an impossible design has in common."""

from typing import Any

from obsdesign.model.structure import Mode


def described(mode: Mode) -> dict[str, Any]:
    """Eigenvalue and eigenvector of a mode, by the names of the states."""
    return {
        "eigenvalue": [mode.eigenvalue.real + 0.0, mode.eigenvalue.imag + 0.0],
        "eigenvector": {name: [entry.real + 0.0, entry.imag + 0.0] for name, entry in mode.along},
    }
