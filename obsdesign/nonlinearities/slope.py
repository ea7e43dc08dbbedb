"""Componentwise slope bounds: f_i(q) depends on q_i only."""

from collections.abc import Iterator, Sequence
from typing import Any

from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.lmi.formula import rational
from obsdesign.model.multiplier import Multiplier, Scaled
from obsdesign.nonlinearities.data import Data
from obsdesign.nonlinearities.evidence import automatic
from obsdesign.nonlinearities.evidence.claims import SlopeBounds, generators
from obsdesign.nonlinearities.template import Template
from obsdesign.sections.document import Loc
from obsdesign.sections.forms import VECTOR, Either, ListOf, auto
from obsdesign.sections.scalars import described
from obsdesign.sections.values import Reader, Size

INFINITE = (".inf", "+.inf", ".Inf", "+.Inf", ".INF", "+.INF")
FORM = "[lo, hi], or auto"


def slope(bounds: Sequence[tuple[fmpq, fmpq | None]], nq: int, nf: int) -> Multiplier:
    """Slopes a_i <= df_i / dq_i <= b_i: (df_i - a_i dq_i)(b_i dq_i - df_i) >= 0, with a scale for each i.

    M_i = lambda_i [[-2ab, a+b], [a+b, -2]]; without an upper bound (b = None) the limit of M_i / b,
    [[-2a, 1], [1, 0]].

    `bounds`: (a_i, b_i) for each of the nq = nf components. Raises `UsageError`: nf is not nq, there is not one pair
    for each component, or a_i > b_i.
    """
    if not nf == nq == len(bounds):
        sizes = f"{len(bounds)} bounds for {nq} components of q and {nf} of f"
        raise UsageError(f"slope: {sizes}; it takes as many of each", id="OBS209")
    for a, b in bounds:
        if b is not None and a > b:
            raise UsageError(f"slope: the lower bound {a} is above the upper bound {b}", id="OBS404")
    return Multiplier(tuple(component(a, b) for a, b in bounds))


def component(a: fmpq, b: fmpq | None) -> Scaled:
    """Set for one slope in [a, b]; the member is zero where the class contains it, or else the nearer end."""
    M = [[-2 * a, 1], [1, 0]] if b is None else [[-2 * a * b, a + b], [a + b, -2]]
    member = a if a > 0 else b if b is not None and b < 0 else fmpq(0)
    return Scaled.of(rational(M), 1, rational([[member]]))


class Bounds(Data):
    """Lower and upper bounds, each one number for all components or a list."""

    form = Either(FORM, auto(FORM), *[ListOf(VECTOR, 2, 2)] * 2)
    description = "[lo, hi], each a number or one for each component; .inf allowed for hi; or auto"
    example = "[0, 2.5]"

    def read(self, reader: Reader, written: Any, loc: Loc) -> Any:
        """Lists of lower and of upper bounds."""
        return read_bounds(reader, written[0], (*loc, 0)), read_bounds(reader, written[1], (*loc, 1), infinite=True)

    def words(self, name: str, written: Any) -> str:
        """Name and bounds."""
        return described(f"{name} {written}".replace("'", ""))

    def sizes(self, data: Any, nq: Size, nf: Size) -> tuple[Size, Size]:
        """As many as the longer list has, where it is one."""
        longest = max(map(len, data))
        return nq, nf or nq or (longest if longest > 1 else None)

    def fitted(self, reader: Reader, data: Any, nq: int, nf: int) -> Any:  # noqa: ARG002
        """Pairs of bounds, one for each component.

        Raises `UsageError`: there are not as many lower as upper bounds.
        """
        low, high = (bounds * nq if len(bounds) == 1 else bounds for bounds in data)
        if len(low) != len(high):
            raise UsageError(
                f"slope: {len(low)} lower and {len(high)} upper bounds; it takes as many of each", id="OBS209"
            )
        return list(zip(low, high, strict=True))

    def entry(self, data: Any) -> Any:
        """Both bounds: of one component numbers, else lists."""
        ends = [[".inf" if end is None else end for end in side] for side in zip(*data, strict=True)]
        return [side[0] for side in ends] if len(data) == 1 else ends


def read_bounds(reader: Reader, written: str | Sequence[str], loc: Loc, *, infinite: bool = False) -> list[fmpq | None]:
    """Bounds of slopes; None is infinite."""
    if isinstance(written, str):
        return [None if infinite and written in INFINITE else reader.number(written, loc)]
    reader.limit(len(written), "bounds", loc)
    return [None if infinite and text in INFINITE else reader.number(text, (*loc, i)) for i, text in enumerate(written)]


def slope_bounds(bounds: Sequence[tuple[fmpq, fmpq | None]], multiplier: Multiplier) -> Iterator[SlopeBounds]:
    """Condition on each component."""
    return (SlopeBounds(M, i, *bounds[i]) for i, M in enumerate(generators(multiplier)))


SLOPE = Template(
    slope,
    Bounds(),
    derive=automatic.slopes,
    slopes=lambda bounds, _: list(bounds),
    conditions=slope_bounds,
)
