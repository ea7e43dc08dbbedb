"""What proves is in rationals: a double is refused when it gets there, and by mypy before that.

Each call in `refused_by_mypy` is a type error: mypy is strict, so that an ignored error that is none is one itself.
"""

from fractions import Fraction

import numpy as np
import pytest
from flint import fmpq

from obsdesign.lmi.formula import Array, Exact, Inequality, rational
from obsdesign.lmi.proof import holds, prove
from obsdesign.model.edge import Edge
from obsdesign.model.plant import Plant
from obsdesign.model.structure import undetectable


@pytest.mark.parametrize("entry", [-1.0, np.float64(-1), -1, Fraction(-1), float("nan"), "-1", None])
def test_a_proof_refuses_an_entry_that_is_no_rational(entry: object) -> None:
    F = rational([[-2, 0], [0, -2]])
    F[1, 0] = F[0, 1] = entry
    with pytest.raises(TypeError, match=r"the proof of 'F < 0' takes rationals only, and the entry at \(1, 2\) is "):
        prove([Inequality("yes", rational([[-1]])), Inequality("F < 0", F, strict=True)])


def test_a_proof_refuses_a_matrix_of_doubles() -> None:
    with pytest.raises(TypeError, match="of type float64"):
        holds(Inequality("F", -np.eye(2)))


def test_a_matrix_without_rows_is_proved() -> None:
    (check,) = prove([Inequality("empty", np.full((0, 0), fmpq(0), dtype=object), strict=True)])
    assert check.holds


def refused_by_mypy(exact: Plant[Exact], either: Plant[Array], K: Array) -> None:
    """Structure is judged in doubles; a formula takes either."""
    undetectable(exact, K, Edge(0.0))  # type: ignore[arg-type]
    undetectable(exact.doubles, K, Edge(0.0))
    undetectable(either, K, Edge(0.0))
    wrong: Plant[Exact] = exact.doubles  # type: ignore[assignment]
    del wrong
