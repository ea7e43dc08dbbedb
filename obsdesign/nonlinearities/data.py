"""The data that a type of nonlinearity takes: how they are written, and what they are in exact numbers."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from obsdesign.records import dataclass
from obsdesign.sections.document import Loc
from obsdesign.sections.forms import ENTRY, MATRIX, Form, ListOf, Named, Section
from obsdesign.sections.scalars import described
from obsdesign.sections.values import Axis, Reader, Sign, Size

MAX_MATRICES = 1024
MATRICES = Named("Matrices", ListOf(MATRIX, 1, MAX_MATRICES))


class Data(ABC):
    """Data beside the name of a type: `type: {name: data}`."""

    form: Form
    description: str = ""
    example: str = ""  # as YAML

    @abstractmethod
    def read(self, reader: Reader, written: Any, loc: Loc) -> Any:
        """Data in exact numbers, whatever the sizes of q and f."""

    def words(self, name: str, written: Any) -> str:  # noqa: ARG002
        """How tables and messages call a type with these data."""
        return name

    def sizes(self, data: Any, nq: Size, nf: Size) -> tuple[Size, Size]:  # noqa: ARG002
        """Sizes of q and f: those that are known, or else what the data say of them."""
        return nq, nf

    def fitted(self, reader: Reader, data: Any, nq: int, nf: int) -> Any:  # noqa: ARG002
        """Return the data as the multiplier takes them."""
        return data

    def entry(self, data: Any) -> Any:
        """Return the data that the multiplier takes as a spec has them, with exact numbers."""
        return data


@dataclass(frozen=True)
class Constant(Data):
    """One number."""

    description: str
    sign: Sign = "any"
    example: str = ""
    form = ENTRY

    def read(self, reader: Reader, written: Any, loc: Loc) -> Any:
        """Return the number."""
        return reader.number(written, loc, self.sign)

    def words(self, name: str, written: Any) -> str:
        """Name and number."""
        return f"{name} {described(written)}"


@dataclass(frozen=True)
class Constants(Data):
    """Numbers by name."""

    form: type[Section]
    description: str
    example: str

    def read(self, reader: Reader, written: Any, loc: Loc) -> Any:
        """Return the numbers, in the order of the keys."""
        for name in self.form.forms():
            if getattr(written, name) == "auto":
                reader.wrong((*loc, name), f"{name} cannot be auto; give a number", id="OBS403")
                return None
        return tuple(reader.number(getattr(written, name), (*loc, name)) for name in self.form.forms())

    def entry(self, data: Any) -> Any:
        """Return the numbers by name."""
        return dict(zip(self.form.forms(), data, strict=True))

    def words(self, name: str, written: Any) -> str:
        """Name and numbers."""
        return f"{name} {', '.join(f'{key} {described(getattr(written, key))}' for key in self.form.forms())}"


@dataclass(frozen=True)
class Matrices(Data):
    """Matrices by name; those of nf rows and nq columns say what nf and nq are."""

    form: type[Section]
    description: str
    example: str
    wide: tuple[str, ...] = ()  # with nq columns, and any number of rows

    def read(self, reader: Reader, written: Any, loc: Loc) -> Any:
        """Return their entries, in the order of the keys."""
        return tuple(reader.entries(getattr(written, name), (*loc, name)) for name in self.form.forms())

    def sizes(self, data: Any, nq: Size, nf: Size) -> tuple[Size, Size]:
        """Rows and columns of the first matrix that has them."""
        named = dict(zip(self.form.forms(), data, strict=True))
        nq, nf = first_sizes([entries for name, entries in named.items() if name not in self.wide], nq, nf)
        for name in self.wide:
            nq = nq or named[name].shape()[1]
        return nq, nf

    def fitted(self, reader: Reader, data: Any, nq: int, nf: int) -> Any:
        """Matrices of these sizes."""
        q, f = Axis(nq, "component of q"), Axis(nf, "component of f")
        rows = [Axis(e.shape(None, nq)[0] or 1, f"row of {n}") if n in self.wide else f
                for n, e in zip(self.form.forms(), data, strict=True)]  # fmt: skip
        return tuple(reader.matrix(entries, count, q) for entries, count in zip(data, rows, strict=True))

    def entry(self, data: Any) -> Any:
        """Return the matrices by name."""
        return {name: matrix.tolist() for name, matrix in zip(self.form.forms(), data, strict=True)}


@dataclass(frozen=True)
class MatrixList(Data):
    """A list of matrices with nf rows and nq columns."""

    description: str
    example: str
    form: Form = MATRICES

    def read(self, reader: Reader, written: Any, loc: Loc) -> Any:
        """Return their entries."""
        return tuple(reader.entries(item, (*loc, i)) for i, item in enumerate(written))

    def words(self, name: str, written: Any) -> str:
        """Name and number of matrices."""
        return f"{name} of {len(written)} matrices"

    def sizes(self, data: Any, nq: Size, nf: Size) -> tuple[Size, Size]:
        """Rows and columns of the first matrix that has them."""
        return first_sizes(data, nq, nf)

    def fitted(self, reader: Reader, data: Any, nq: int, nf: int) -> Any:
        """Matrices of these sizes."""
        q, f = Axis(nq, "component of q"), Axis(nf, "component of f")
        return tuple(reader.matrix(entries, f, q) for entries in data)

    def entry(self, data: Any) -> Any:
        """Return the matrices."""
        return [matrix.tolist() for matrix in data]


@dataclass(frozen=True)
class WholeMatrix(Data):
    """One matrix over (q, f), square."""

    description: str
    example: str
    form = MATRIX

    def read(self, reader: Reader, written: Any, loc: Loc) -> Any:
        """Return its entries."""
        return reader.entries(written, loc)

    def sizes(self, data: Any, nq: Size, nf: Size) -> tuple[Size, Size]:
        """What is known, and else half of its size each."""
        if data.values.ndim == 2:
            total = len(data.values)
            nf = nf or total - (nq or total // 2)
            nq = nq or total - nf
        return nq, nf

    def fitted(self, reader: Reader, data: Any, nq: int, nf: int) -> Any:  # noqa: ARG002
        """Return the matrix as it is; its multiplier says what size it needs."""
        return np.atleast_2d(data.values)

    def entry(self, data: Any) -> Any:
        """Return its rows."""
        return data.tolist()


def first_sizes(matrices: Sequence[Any], nq: Size, nf: Size) -> tuple[Size, Size]:
    """Sizes of q and f: those that are known, or else the columns and rows of the first matrix that has both."""
    shapes = (entries.shape(nf, nq) for entries in matrices)
    rows, columns = next((shape for shape in shapes if all(shape)), (None, None))
    return nq or columns, nf or rows
