"""Entries of a spec to exact rationals, matrices that fit, and expressions.

A `Reader` collects what is wrong and goes on with a stand-in (1 for a number, 0 for a matrix), so that all
errors of a file are found at once. A size that an earlier error leaves open is None, and then anything fits.
"""

import re
from collections import Counter
from collections.abc import Collection, Sequence
from functools import cached_property
from typing import Any, Literal, NoReturn

import numpy as np
from flint import fmpq

from obsdesign.errors import Problem, UsageError, gathered
from obsdesign.expressions import Expression, ExpressionError, constant, parse
from obsdesign.expressions.exact import decimal
from obsdesign.expressions.functions import FUNCTIONS
from obsdesign.lmi.formula import Array
from obsdesign.records import dataclass, replace
from obsdesign.sections.document import MAX_PROBLEMS, Document, Loc, dotted
from obsdesign.sections.nodes import Row
from obsdesign.sections.notation import as_lists, meant
from obsdesign.sections.scalars import AS_DOUBLE, DATE, MAX_QUOTED, NOT_FINITE, described
from obsdesign.sections.units import misread

ZERO, ONE = fmpq(0), fmpq(1)
UNKNOWN = re.compile("unknown name '([^']+)'(?!:)")  # of a message
SIGNAL = {kind: re.compile(f"{letter}[0-9]*") for kind, letter in (("a state", "x"), ("an output", "y"))}
SIGNAL |= {"a known input": re.compile("u[0-9]*"), "a disturbance": re.compile("[wv][0-9]*")}
FACTORS = "matrices hold the factors of signals, a nonlinear term stands under nonlinearities or in system.dynamics"
SEVERAL = "expected one number; several values of a key are for `obsdesign batch --set`, a decimal point is a point"
LONGEST_SAID = 250  # characters of a message with a whole matrix
MAX_SIZE = 400  # of a signal, such as the augmented state

NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
ARGUMENT = re.compile(r"q[0-9]*")  # of a nonlinearity
RECORDED = re.compile(r"[\w./\\ -]+\.(csv|txt|dat|mat|xlsx?|json|npy|npz|parquet|h5)", re.IGNORECASE)  # a file

Size = int | None
Sign = Literal["any", ">= 0", "> 0"]


@dataclass(frozen=True)
class Axis:
    """How many rows, columns or items there must be, and what each of them stands for."""

    size: Size
    each: str

    def __str__(self) -> str:
        return f"one for each {self.each}"

    def of(self, size: Size) -> "Axis":
        """Return the same axis with another size."""
        return replace(self, size=size)

    def admits(self, count: int) -> bool:
        """Whether there can be so many."""
        return self.size is None or self.size == count


SINGLE = Axis(1, "vector")


def meaning(name: str) -> str | None:
    """Say what a name means already, or why it is none."""
    if not NAME.fullmatch(name):
        return "is not a name; use letters, digits and _, a letter first"
    if name == "t":
        return "is the time; choose another name"
    if name == "pi" or name in FUNCTIONS:
        return "is a function or a constant; choose another name"
    if ARGUMENT.fullmatch(name):
        return "is kept for the argument of a nonlinearity, of a term of equations too; choose another name"
    if name.startswith("hat_"):
        return "begins like the name of an estimate; choose another name"
    return None


@dataclass(frozen=True)
class Entries:
    """A matrix as it is written: a number, a vector, or rows (an array of 0, 1 or 2 dimensions)."""

    loc: Loc
    values: Array
    wrong: bool = False  # what is written is no matrix of numbers, which was said already

    @property
    def zero(self) -> bool:
        """Whether it is the number 0, which stands for a zero matrix of any size."""
        return self.values.ndim == 0 and self.values[()] == 0

    def shape(self, rows: Size = None, columns: Size = None) -> tuple[Size, Size]:
        """Rows and columns, from those that are known and from what is written."""
        if self.zero:
            return rows, columns
        if self.values.ndim == 2:
            return self.values.shape[0], self.values.shape[1]
        count = self.values.size
        fitting = {(i, j) for i, j in ((1, count), (count, 1)) if rows in (None, i) and columns in (None, j)}
        return fitting.pop() if len(fitting) == 1 else (rows, columns)

    def fits(self, rows: Axis, columns: Axis) -> bool:
        """Whether it can be read as a matrix of this size."""
        shape = self.values.shape
        if self.zero or self.wrong:
            return True
        if self.values.size == 0:
            return 0 in (rows.size, columns.size) or None in (rows.size, columns.size)
        if len(shape) == 2:
            return rows.admits(shape[0]) and columns.admits(shape[1])
        count = self.values.size
        return (rows.admits(count) and columns.admits(1)) or (rows.admits(1) and columns.admits(count))

    def mismatch(self, rows: Axis, columns: Axis) -> str:
        """Say which size was expected and which was found."""
        found, axes = self.values.shape, {"row": rows, "column": columns}
        wrong = [
            f"{counted(axis.size, unit)} ({axis})"
            for (unit, axis), count in zip(axes.items(), found if len(found) == 2 else (None, None), strict=True)
            if axis.size is not None and axis.size != count
        ]
        return f"expected {' and '.join(wrong)}, found {self}"

    def __str__(self) -> str:
        if self.values.ndim == 0:
            return "a number"
        if self.values.ndim == 1:
            return f"a vector of {self.values.size}"
        return "x".join(map(str, self.values.shape))


def counted(count: int | None, unit: str) -> str:
    """Count with its unit in the singular or plural."""
    return f"{count} {unit}" if count == 1 else f"{count} {unit}s"


class Reader:
    """Reads values and collects what is wrong and what a user should know."""

    def __init__(self, document: Document, problems: list[Problem], *, judged: bool = True) -> None:
        self.document = document
        self.judged = judged  # whether declared types are proved or refuted
        self.problems = problems
        self.notes: list[str] = []
        self.unused: list[str] = []  # keys that have no effect, with the reason
        self.parameters: dict[str, fmpq] = {}
        self.used: set[str] = set()  # parameters that stand in a number or an expression
        self.exact: dict[str, fmpq] = {}  # values of the texts read so far

    def wrong(self, loc: Loc, message: str, *, id: str, at_key: bool = False, column: int = 0) -> None:
        """Note that something is wrong; stop where too much is."""
        self.problems.append(self.document.problem(loc, message, at_key=at_key, column=column, id=id))
        if len(self.problems) > MAX_PROBLEMS:
            self.stop()

    def clean(self, loc: Loc) -> bool:
        """Whether nothing was wrong there so far."""
        return not any(
            f"{problem.key}.".startswith((f"{dotted(loc)}.", f"{dotted(loc)}[")) for problem in self.problems
        )

    def limit(self, count: Size, what: str, loc: Loc) -> None:
        """Stop at a size that no design can deal with, before there are matrices of it."""
        if count is not None and count > MAX_SIZE:
            self.wrong(loc, f"{count} {what}; at most {MAX_SIZE} are allowed", id="OBS210")
            self.stop()

    def stop(self) -> NoReturn:
        """Raise what was found wrong, in the order of the file."""
        problems = gathered(sorted(dict.fromkeys(self.problems), key=lambda problem: (problem.line, problem.column)))
        if len(problems) > MAX_PROBLEMS:
            problems = [*problems[:MAX_PROBLEMS], Problem("and more", self.document.path, id="OBS103")]
        raise UsageError(*problems)

    def number(self, text: str, loc: Loc, sign: Sign = "any") -> fmpq:
        """Exact value of a number or of arithmetic over the parameters.

        An irrational value is replaced by its correctly rounded double, with a note.
        """
        try:
            value = self.value(text, loc)
        except ExpressionError as error:
            several = SEVERAL if "," in text and "(" not in text and self.document.find(loc)[1].origin else ""
            said = several or error.message + self.undeclared(error.message)
            self.wrong(loc, said, column=error.column, id=error.id)
            return ONE
        if (sign == "> 0" and value <= 0) or (sign == ">= 0" and value < 0):
            self.wrong(loc, f"{described(text)} is not allowed; give a number {sign}", id="OBS208")
            return ONE
        return value

    def undeclared(self, message: str) -> str:
        """What to do about an unknown name in a number: what it is elsewhere in the spec, or where to declare it."""
        named = UNKNOWN.match(message)
        if not named:
            return ""
        for kind, names in self.signals.items():
            if named[1] in names or (not names and SIGNAL[kind].fullmatch(named[1])):
                return f"; {named[1]} is {kind}, and this is a number: {FACTORS}"
        return "; a constant is declared under parameters"

    @cached_property
    def signals(self) -> dict[str, list[str]]:
        """Names of the signals of the plant as they are written, by what they are; none where they are left out."""
        system = self.document.find(("system",))[1].plain()
        system = system if isinstance(system, dict) else {}
        keys = {"a state": ("states", "dynamics"), "an output": ("outputs",), "a known input": ("inputs",)}
        keys["a disturbance"] = ("disturbances",)
        return {kind: [str(name) for key in found for name in system.get(key) or ()] for kind, found in keys.items()}

    def value(self, text: str, loc: Loc) -> fmpq:
        """Exact value, or `ExpressionError`."""
        if text not in self.exact:
            if NOT_FINITE.fullmatch(text):
                raise ExpressionError(f"{text} is not a finite number", id="OBS212")
            if DATE.fullmatch(text):
                raise ExpressionError(
                    f"expected a number, found {described(text)}, which reads as a date or a time", id="OBS212"
                )
            self.require_plain(text, self.parameters)
            self.note_used(text)
            self.exact[text], was_rounded = constant(text, self.parameters)
            if was_rounded:
                self.notes.append(f"{dotted(loc)} = {described(text)} {AS_DOUBLE} {float(self.exact[text])!r}")
        return self.exact[text]

    def note_used(self, text: str) -> None:
        """Note which parameters stand in a text."""
        self.used.update(NAME.findall(text))

    def require_plain(self, text: str, names: Collection[str]) -> None:
        """Refuse a number with a unit that is none of the names, or with a decimal comma, by an `ExpressionError`."""
        if len(text) <= MAX_QUOTED and (said := misread(text, {*names, "pi"})):
            raise ExpressionError(said, id="OBS212")

    def integer(self, text: str | None, loc: Loc, default: int, low: int, high: int) -> int:
        """Whole number in a range."""
        if text is None:
            return default
        before = len(self.problems)
        value = self.number(text, loc)
        if len(self.problems) == before and not (value.q == 1 and low <= value <= high):
            self.wrong(loc, f"{described(text)} is not allowed; give a whole number from {low} to {high}", id="OBS208")
            return default
        return int(value.p)

    def entries(self, value: Any, loc: Loc) -> Entries:
        """Values of a matrix that may be a number, a vector or rows; zero if it is missing."""
        if value is None:
            return Entries(loc, np.array(ZERO))
        if rows := meant(value, self.parameters):
            said = f"a matrix is a list of its rows, without quotes: write {as_lists(rows)}"
            self.wrong(loc, said if len(said) < LONGEST_SAID else said.partition(": write")[0], id="OBS209")
            if isinstance(value, str):
                return Entries(loc, np.array(ONE), wrong=True)
            value = rows
        if isinstance(value, str):
            before = len(self.problems)
            number = np.array(self.number(value, loc))
            return Entries(loc, number, wrong=len(self.problems) > before)
        self.limit(len(value), "rows or entries", loc)
        if not any(isinstance(row, list) for row in value):
            return Entries(loc, np.array(self.items(value, loc), dtype=object))
        return self.rows(value, loc)

    def rows(self, value: Sequence[Sequence[str]], loc: Loc) -> Entries:
        """Rows of the same length; what is missing in a row is zero."""
        lengths = [len(row) for row in value]
        self.limit(max(lengths), "entries in a row", loc)
        ((usual, _),) = Counter(lengths).most_common(1)
        matrix = np.full((len(value), usual), ZERO, dtype=object)
        for i, row in enumerate(value):
            if len(row) != usual:
                self.wrong(
                    (*loc, i), f"expected a row of {usual} like the others, found a row of {len(row)}", id="OBS209"
                )
            items = self.items(row if len(row) <= usual else row[:usual], (*loc, i))
            matrix[i, : len(items)] = items
        return Entries(loc, matrix, wrong=min(lengths) < max(lengths))

    def items(self, row: Sequence[str], loc: Loc) -> list[fmpq]:
        """Values of a row or a vector."""
        if isinstance(row, Row):
            self.exact |= {text: decimal(text) for text in row if text not in self.exact}
            return [self.exact[text] for text in row]
        return [self.number(entry, (*loc, j)) for j, entry in enumerate(row)]

    def matrix(self, entries: Entries, rows: Axis, columns: Axis) -> Array:
        """Matrix of the size that there must be."""
        size = rows.size or 0, columns.size or 0
        if not entries.fits(rows, columns):
            self.wrong(entries.loc, entries.mismatch(rows, columns), id="OBS209")
        elif not entries.zero and not entries.wrong and None not in (rows.size, columns.size):
            return entries.values.reshape(size)
        return np.full(size, ZERO, dtype=object)

    def vector(self, entries: Entries, axis: Axis) -> Array:
        """Vector with so many entries; the number 0 is zero."""
        if entries.fits(axis, SINGLE):
            return self.matrix(entries, axis, SINGLE).ravel()
        self.wrong(entries.loc, f"expected {counted(axis.size, 'number')} ({axis}), found {entries}", id="OBS209")
        return np.full(axis.size or 0, ZERO, dtype=object)

    def expressions(
        self, value: str | Sequence[str] | None, loc: Loc, axis: Axis, names: Collection[str] | None, about: str = ""
    ) -> tuple[Expression, ...]:
        """As many expressions; none at all, or the number 0, is zero.

        `names`: those that may occur; None if an earlier error leaves them open; `about`: what to say of another name.
        """
        if value is None or value == "0":
            return (Expression.number(0),) * (axis.size or 0)
        texts = [value] if isinstance(value, str) else value
        if not axis.admits(len(texts)):
            self.wrong(loc, f"expected {counted(axis.size, 'expression')} ({axis}), found {len(texts)}", id="OBS209")
            return ()
        if names is None:
            return ()
        places = [loc] if isinstance(value, str) else [(*loc, i) for i in range(len(texts))]
        return tuple(self.expression(text, place, names, about) for text, place in zip(texts, places, strict=True))

    def expression(self, text: str, loc: Loc, names: Collection[str], about: str = "") -> Expression:
        """Expression of the given names; `about`: what to say of another one."""
        try:
            if NOT_FINITE.fullmatch(text) or DATE.fullmatch(text):
                raise ExpressionError(f"expected an expression, found {described(text)}", id="OBS212")
            if RECORDED.fullmatch(text):
                raise ExpressionError(
                    f"files are not read here, such as {described(text)}; write an expression", id="OBS212"
                )
            self.require_plain(text, {*names, *self.parameters})
            self.note_used(text)
            return parse(text, names, self.parameters)
        except ExpressionError as error:
            said = f"; {about}" if about and error.message.startswith("unknown name") else ""
            self.wrong(loc, error.message + said, column=error.column, id=error.id)
            return Expression.number(0)
