"""A file of columns of numbers, read block by block, so that its length does not matter."""

import codecs
import csv
import io
import os
import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np

from obsdesign.errors import Problem, UsageError
from obsdesign.lmi.formula import Array, Float
from obsdesign.records import dataclass, field
from obsdesign.sections.words import nearest

BLOCK = 4 * 2**20  # bytes that are parsed at once
LONGEST = 2**18  # bytes of a header, or of a row
COMMENTS = 1000  # lines before the header that begin with #
DELIMITERS = ",;\t"
MOST_NAMED = 20  # heads that a message tells
SECONDS = ("s", "sec", "seconds", "")  # units of time that need no factor
MISSING = ("", "nan", "na", "null", "none")  # of a value, in whatever case
UNIT = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\])]*)[\])]$")


class Header(NamedTuple):
    """The head of a column: as it is written, its name, and its unit, which may be empty."""

    text: str
    name: str
    unit: str

    @classmethod
    def of(cls, text: str) -> "Header":
        """Of a text such as `theta [rad]` or `Current (A)`."""
        found = UNIT.match(text.strip())
        name, unit = (found["name"], found["unit"]) if found else (text, "")
        return cls(text.strip(), name.strip(), unit.strip())

    def differs(self, unit: str, *, time: bool = False) -> bool:
        """Whether it says another unit than a signal has, or, of a time, than seconds; none is no other."""
        return self.unit not in SECONDS if time else bool(self.unit and unit and self.unit != unit)


class Block(NamedTuple):
    """Some rows of a table."""

    rows: Float  # (K, columns); NaN where a value is missing
    lines: Array  # (K,), of the file, from 1


@dataclass(frozen=True)
class Table:
    """A file of comma-separated values, with a line of heads; separators may be ; or tabs too.

    Raises `UsageError`: there is no such file or no head, a row is incomplete, or a value is no number.
    """

    path: str
    progress: list[int] = field(default_factory=lambda: [0])  # bytes that are read

    @property
    def share(self) -> float:
        """Share of the file that is read."""
        size = os.path.getsize(self.path) if os.path.isfile(self.path) else 0
        return min(1.0, self.progress[0] / size) if size else 0.0

    @cached_property
    def top(self) -> tuple[str, int]:
        """Line of heads, and its number: the first without #; or the last with it, where numbers follow.

        Blank lines before it, or between both, are left out.
        """
        before, place = "", 0
        with self.opened() as file:
            for k in range(1, COMMENTS + 2):
                line = file.readline(LONGEST)
                if len(line) == LONGEST or not line:
                    break
                text = self.decoded(line, k).lstrip("\ufeff").rstrip("\r\n")
                if not text.strip():
                    continue
                if not text.startswith("#"):
                    named = before and all(number(one) is not None for one in re.split("[,;\t]", text) if one.strip())
                    return (before, place) if named else (text, k)
                before, place = text.lstrip("# "), k
        raise self.wrong("begins with no line of column names, such as t,y1,u", 1, id="OBS811")

    @property
    def head(self) -> str:
        """Line of heads."""
        return self.top[0]

    @property
    def heading(self) -> int:
        """Number of the line of heads."""
        return self.top[1]

    @cached_property
    def delimiter(self) -> str:
        """What separates columns."""
        return max(DELIMITERS, key=self.head.count)

    @cached_property
    def columns(self) -> tuple[Header, ...]:
        """Heads of the columns."""
        made = tuple(Header.of(text) for text in next(csv.reader([self.head], delimiter=self.delimiter)))
        texts = [one.text for one in made if one.text]
        if twice := sorted(text for text, count in Counter(texts).items() if count > 1):
            raise self.wrong(f"two columns have the head {twice[0]}; name them apart", self.heading, id="OBS811")
        if all(number(text) is not None for text in texts):
            raise self.wrong(
                "begins with numbers; the first line must name the columns, such as t,y1,u", self.heading, id="OBS811"
            )
        return made

    def column(self, text: str) -> int:
        """Number of a column by its head, as it is written or without its unit. Raises `UsageError`."""
        for key in ("text", "name"):
            found = [i for i, one in enumerate(self.columns) if getattr(one, key) == text]
            if len(found) == 1:
                return found[0]
        known = [one.name for one in self.columns]
        near = nearest(text, known)
        said = f"has no column {text}" + (f"; did you mean {near}?" if near else "")
        heads = [one.text for one in self.columns[:MOST_NAMED]]
        heads += [f"{len(self.columns) - MOST_NAMED} more"] if len(self.columns) > MOST_NAMED else []
        raise self.wrong(f"{said}; it has {', '.join(heads)}", self.heading, id="OBS811")

    def blocks(self, wanted: Sequence[int], times: Collection[int] = ()) -> Iterator[Block]:
        """Rows of some columns, block by block; `times`: those that may hold instants as ISO 8601 writes them."""
        with self.opened() as file:
            for _ in range(self.heading):
                file.readline(LONGEST)
            line, rest = self.heading + 1, b""
            while part := file.read(BLOCK):
                self.progress[0] += len(part)
                whole, newline, rest = (rest + part).rpartition(b"\n")
                if newline:
                    yield self.parsed(whole + newline, line, wanted, times)
                    line += whole.count(b"\n") + 1
                elif len(rest) > LONGEST:
                    raise self.wrong(f"a row is longer than {LONGEST:,} bytes; is this a text file?", line, id="OBS811")
            if rest.strip():
                yield self.slowly(rest, line, wanted, times)

    def finite(self, wanted: Sequence[int], times: Collection[int] = ()) -> Iterator[Block]:
        """The same, where no value is infinite; one that is missing is NaN."""
        for block in self.blocks(wanted, times):
            if len(wrong := np.argwhere(np.isinf(block.rows))):
                k, column = wrong[0]
                said = f"{self.columns[wanted[column]].text}: infinite; leave it empty where it is missing"
                raise self.wrong(said, int(block.lines[k]), id="OBS811")
            yield block

    def parsed(self, text: bytes, line: int, wanted: Sequence[int], times: Collection[int]) -> Block:
        """Rows of whole lines; where nothing is missing, at once."""
        lines = text.count(b"\n")
        if text.count(self.delimiter.encode()) == lines * (len(self.columns) - 1):
            try:
                rows = np.loadtxt(io.BytesIO(text), delimiter=self.delimiter, comments=None, ndmin=2, usecols=wanted)
                if len(rows) == lines:
                    return Block(rows, np.arange(line, line + lines))
            except ValueError:
                pass
        return self.slowly(text, line, wanted, times)

    def slowly(self, text: bytes, line: int, wanted: Sequence[int], times: Collection[int]) -> Block:
        """Rows of lines some of which are blank, have values missing, or are wrong."""
        rows, lines = list[list[float]](), list[int]()
        written = io.StringIO(self.decoded(text, line), newline="")
        for k, fields in enumerate(self.fields(written, line), start=line):
            if not any(field.strip() for field in fields):
                continue
            if len(fields) != len(self.columns):
                said = f"has {len(fields)} values and {len(self.columns)} columns have a name; is the log cut off here?"
                raise self.wrong(said, k, id="OBS811")
            rows.append([self.value(fields[i], i, k, timed=i in times) for i in wanted])
            lines.append(k)
        return Block(np.array(rows, dtype=float).reshape(-1, len(wanted)), np.array(lines, dtype=int))

    def fields(self, written: io.StringIO, line: int) -> Iterator[list[str]]:
        """Fields of each line."""
        try:
            yield from csv.reader(written, delimiter=self.delimiter)
        except csv.Error as error:
            raise self.wrong(f"is no table of comma-separated values: {error}", line, id="OBS811") from None

    def value(self, text: str, column: int, line: int, *, timed: bool) -> float:
        """A number, or an instant where there may be one; NaN where it is missing."""
        if text.strip().lower() in MISSING:
            return float("nan")
        found = number(text.replace(",", ".") if self.delimiter == ";" else text)
        if found is None and timed:
            found = instant(text.strip())
        if found is None:
            said = (
                f"{self.columns[column].text}: {text.strip()[:40]!r} is no number; leave it empty where it is missing"
            )
            raise self.wrong(said, line, id="OBS811")
        return found

    def opened(self) -> IO[bytes]:
        """The file."""
        try:
            return Path(self.path).open("rb")
        except IsADirectoryError:
            raise UsageError(Problem("is a folder; give a file", self.path, id="OBS101")) from None
        except OSError as error:
            raise UsageError(Problem(f"cannot be read: {error.strerror}", self.path, id="OBS101")) from None

    def decoded(self, text: bytes, line: int) -> str:
        """Text in UTF-8."""
        if line == 1 and text.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            said = "is text in UTF-16; save the file as UTF-8 (iconv -f utf-16 -t utf-8)"
            raise self.wrong(said, line, id="OBS811")
        try:
            return text.decode()
        except UnicodeDecodeError as error:
            found, at = text[error.start], line + text.count(b"\n", 0, error.start)
            said = f"the byte 0x{found:02X} is no text in UTF-8; save the file as UTF-8"
            raise self.wrong(f"{said} (iconv -f latin1 -t utf-8, where it is Latin-1)", at, id="OBS811") from None

    def wrong(self, said: str, line: int, *, id: str) -> UsageError:
        """Error about a line."""
        return UsageError(Problem(said, self.path, line, id=id))


def filled(values: Float, before: Float) -> Float:
    """Rows (K, m) with what is missing as it was in the row before, (m,); NaN where it was never known."""
    if not np.isnan(values).any():
        return values
    whole = np.vstack([before, values])
    for column in whole.T:
        known = np.maximum.accumulate(np.where(np.isnan(column), 0, np.arange(len(column))))
        column[:] = column[known]
    return whole[1:]


def not_rising(t: float, before: float, name: str = "t") -> str:
    """What is wrong with an instant, by its name, that is not after the one before."""
    if np.isnan(t):
        return "the time is missing"
    return f"{name} = {t:.9g} " + (
        "is that of the row before" if t == before else f"is before that of the row before, {before:.9g}"
    )


def instant(text: str) -> float | None:
    """Seconds since 1970-01-01 of an instant as ISO 8601 writes it, in UTC where it names no other; None of another.

    To 2e-7 s, as far as a double holds them.
    """
    try:
        found = datetime.fromisoformat(text)
    except ValueError:
        return None
    return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()


def number(text: str) -> float | None:
    """Number of a text; None where it is none."""
    try:
        return float(text) if text.isascii() and "_" not in text else None
    except ValueError:
        return None
