"""The type of a nonlinearity: its data in exact numbers, and what they say of the sizes of q and f."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.reading.document import Loc, described
from obsdesign.reading.schema import TypeData
from obsdesign.reading.values import Axis, Reader, Size

UNEQUAL = ("lipschitz", "sector", "ball", "jacobian", "cone", "multiplier", "auto")  # nq and nf may differ
INFINITE = (".inf", "+.inf", ".Inf", "+.Inf", ".INF", "+.INF")
Slopes = tuple[list[fmpq | None], list[fmpq | None]]
AUTO = "auto"


@dataclass(frozen=True)
class Kind:
    """The type of a block, with its data as they are written."""

    name: str
    text: str
    data: Any = None  # exact numbers, slopes (low, high), Entries or a tuple of Entries, as the name requires
    automatic: bool = False  # the data follow from f

    def sizes(self, nq: Size, nf: Size) -> tuple[int, int]:
        """Sizes of q and f: those that are known, or else what the data say."""
        if self.name in ("sector", "ball", "jacobian", "cone") and not self.automatic:
            rows, columns = self.shape(nq, nf)
            nf, nq = nf or rows, nq or columns
        if self.name == "multiplier" and self.data.values.ndim == 2:
            total = len(self.data.values)
            nf = nf or total - (nq or total // 2)
            nq = nq or total - nf
        if self.name not in UNEQUAL:
            longest = max(map(len, self.data)) if self.name == "slope" and not self.automatic else 1
            nf = nf or nq or (longest if longest > 1 else None)
        nf = nf or 1
        nq = nq or (1 if self.name in UNEQUAL else nf)
        return max(nq, 1), max(nf, 1)

    def shape(self, nq: Size, nf: Size) -> tuple[Size, Size]:
        """Rows and columns of the first matrix that has them."""
        for entries in self.data[:1] if self.name == "ball" else self.data:
            rows, columns = entries.shape(nf, nq)
            if rows and columns:
                return rows, columns
        return None, self.data[1].shape(None, nq)[1] if self.name == "ball" else None

    def template_data(self, reader: Reader, nq: int, nf: int) -> Any:
        """Return the data as the template of this type takes them.

        Raises
        ------
        UsageError
            There are not as many lower as upper slopes.
        """
        q, f = Axis(nq, "component of q"), Axis(nf, "component of f")
        if self.name == "multiplier":
            return np.atleast_2d(self.data.values)
        if self.name == "ball":
            center, radius = self.data
            rows = Axis(radius.shape(None, nq)[0] or 1, "row of W")
            return reader.matrix(center, f, q), reader.matrix(radius, rows, q)
        if self.name in ("sector", "jacobian", "cone"):
            return tuple(reader.matrix(entries, f, q) for entries in self.data)
        if self.name != "slope":
            return self.data
        low, high = (bounds * nq if len(bounds) == 1 else bounds for bounds in self.data)
        if len(low) != len(high):
            raise UsageError(f"slope: {len(low)} lower and {len(high)} upper bounds; it takes as many of each")
        return list(zip(low, high, strict=True))


def read_kind(reader: Reader, written: str | TypeData, loc: Loc) -> Kind:
    """Type of a block with its data in exact numbers."""
    if isinstance(written, str):
        return Kind(written, written, automatic=written == AUTO)
    name = next(key for key in READERS if getattr(written, key.replace("-", "_")) is not None)
    value = getattr(written, name.replace("-", "_"))
    if AUTO in (name, value):
        return Kind(name, name if name == AUTO else f"{name} {AUTO}", automatic=True)
    return READERS[name](reader, value, (*loc, name))


def read_lipschitz(reader: Reader, written: str, loc: Loc) -> Kind:
    """Lipschitz constant."""
    return Kind("lipschitz", f"lipschitz {described(written)}", reader.number(written, loc, ">= 0"))


def read_cocoercive(reader: Reader, written: str, loc: Loc) -> Kind:
    """Constant of cocoercivity."""
    return Kind("cocoercive", f"cocoercive {described(written)}", reader.number(written, loc, "> 0"))


def read_slope(reader: Reader, written: Sequence[Any], loc: Loc) -> Kind:
    """Bounds of slopes."""
    low = read_bounds(reader, written[0], (*loc, 0))
    high = read_bounds(reader, written[1], (*loc, 1), infinite=True)
    return Kind("slope", described(f"slope {written}".replace("'", "")), (low, high))


def read_bounds(reader: Reader, written: str | Sequence[str], loc: Loc, *, infinite: bool = False) -> list[fmpq | None]:
    """Bounds of slopes; None is infinite."""
    if isinstance(written, str):
        return [None if infinite and written in INFINITE else reader.number(written, loc)]
    reader.limit(len(written), "bounds", loc)
    return [None if infinite and text in INFINITE else reader.number(text, (*loc, i)) for i, text in enumerate(written)]


def read_members(name: str, *keys: str) -> Callable[[Reader, Any, Loc], Kind]:
    """Reader of a type whose data are named matrices."""

    def read(reader: Reader, written: Any, loc: Loc) -> Kind:
        return Kind(name, name, tuple(reader.entries(getattr(written, key), (*loc, key)) for key in keys))

    return read


def read_one_sided(reader: Reader, written: Any, loc: Loc) -> Kind:
    """Constants rho, beta, phi."""
    keys = ("rho", "beta", "phi")
    for key in keys:
        if getattr(written, key) == AUTO:
            reader.wrong((*loc, key), f"{key} cannot be auto; give a number")
            return Kind("one-sided-lipschitz", "one-sided-lipschitz")
    numbers = tuple(reader.number(getattr(written, key), (*loc, key)) for key in keys)
    text = ", ".join(f"{key} {described(getattr(written, key))}" for key in keys)
    return Kind("one-sided-lipschitz", f"one-sided-lipschitz {text}", numbers)


def read_matrices(name: str) -> Callable[[Reader, Any, Loc], Kind]:
    """Reader of a type whose data are a list of matrices."""

    def read(reader: Reader, written: Any, loc: Loc) -> Kind:
        matrices = tuple(reader.entries(item, (*loc, i)) for i, item in enumerate(written))
        return Kind(name, f"{name} of {len(matrices)} matrices", matrices)

    return read


def read_multiplier(reader: Reader, written: Any, loc: Loc) -> Kind:
    """Matrix of the user's own."""
    return Kind("multiplier", "multiplier", reader.entries(written, loc))


READERS: dict[str, Callable[[Reader, Any, Loc], Kind]] = {
    "lipschitz": read_lipschitz,
    "slope": read_slope,
    "sector": read_members("sector", "K1", "K2"),
    "cocoercive": read_cocoercive,
    "ball": read_members("ball", "K", "W"),
    "one-sided-lipschitz": read_one_sided,
    "jacobian": read_matrices("jacobian"),
    "cone": read_matrices("cone"),
    "multiplier": read_multiplier,
    AUTO: lambda *_: Kind(AUTO, AUTO, automatic=True),
}
