"""An observer along the rows of a log: as the C that is exported, compiled here, or as the same routines in Python."""

import ctypes
import shutil
import subprocess
import tempfile
from itertools import pairwise
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple, Protocol

import numpy as np

from obsdesign.data.driver import NAME, Engine, driver
from obsdesign.exports import c
from obsdesign.lmi.formula import Float
from obsdesign.stepping.implemented import Implemented
from obsdesign.stepping.open_loop import Mask, partial

RTOL = 1e-6  # of estimates between rows, where the spec tells no steps
COMPILER = ("gcc", "-std=c99", "-O2", "-shared", "-fPIC")


class Passed(NamedTuple):
    """What an observer makes of rows."""

    estimates: Float  # (K, ne), at each row, with its measurement where that is taken there
    expected: Float  # (K, ny), y before it is known
    arguments: Float  # (K, nq), of f in the observer, where they are watched
    rows: int  # how far it got: the equations have no value after that


def agree(one: Float, other: Float) -> bool:
    """Whether estimates are the same but for 1e-6 of the largest of each."""
    size = np.abs(other).max(axis=0, initial=1e-300)
    return bool((np.abs(one - other).max(axis=0, initial=0.0) <= RTOL * size).all())


class Runner(Protocol):
    """An observer between two rows, wherever it is."""

    engine: ClassVar[Literal["c", "numpy"]]
    one: Implemented

    def run(self, t: Float, u: Float, y: Float, begin: int, first: bool, h: float = 0.0) -> Passed:
        """Go along rows: t (K,), u (K, nu), y (K, ny), in which nothing is missing but what is not measured.

        `begin`: 0 at the first row of all, else 1, the first row being that where the last call ended; `first`: u and y
        go on straight lines between rows, instead of being held; `h`: longest step in s, in place of the period.
        """

    def copied(self) -> "Runner":
        """The same observer where it is now, which goes on by itself."""


def runner(one: Implemented) -> Runner:
    """Observer at its start: compiled where gcc is there."""
    from obsdesign.data.interpreted import Interpreted

    return Compiled.of(one) if shutil.which(COMPILER[0]) else Interpreted.of(one)


class Partial(Protocol):
    """A runner that can go on while some outputs are not known."""

    one: Implemented

    def open(self, mask: Mask | None) -> None:
        """Be the observer of which some outputs are not known, as `partial` makes it, where it makes one."""

    def go(self, t: Float, u: Float, y: Float, begin: int, first: bool, h: float) -> Passed:
        """Go along rows as the observer that it is now."""


def along(one: Partial, t: Float, u: Float, y: Float, begin: int, first: bool, h: float) -> Passed:
    """Way of a runner along rows, from the first hole on as an observer of which some outputs are not known.

    Where steps are exact, that is another one for each set of known outputs, from row to row. A row at which the set
    changes is the last of one of them, and is taken again as the first of the next.
    """
    known, K = np.isfinite(y), len(t)
    if not one.one.known and known.all():
        return one.go(t, u, y, begin, first, h)
    if one.one.method != "exact" or one.one.observer.jump:
        one.open(None)
        return one.go(t, u, y, begin, first, h)
    edges = [0, *(np.flatnonzero((known[1:] != known[:-1]).any(axis=1)) + 1).tolist(), K]
    made, rows = [np.full((K, n), np.nan) for n in one.one.width], 0
    for a, b in pairwise(edges):
        one.open(tuple(known[a].tolist()))
        to = slice(a, b + 1)
        passed = one.go(t[to], u[to], y[to], begin if a == 0 else 0, first, h)
        for part, found in zip(made, passed[:3], strict=True):
            part[a:b] = found[: b - a]
        rows = a + min(passed.rows, b - a)
        if passed.rows < len(t[to]):
            break
    return Passed(made[0], made[1], made[2], rows)


class Compiled:
    """The observer in C."""

    engine: ClassVar[Literal["c", "numpy"]] = "c"

    def __init__(
        self,
        plain: Implemented,
        one: Implemented,
        code: ctypes.CDLL,
        state: bytes,
        last: Float,
        kept: dict[Mask | None, "Compiled | None"],
    ) -> None:
        self.plain, self.one, self.code, self.last = plain, one, code, last
        self.kept = kept  # those of which some outputs are not known, by which these are, once they are needed
        self.state = ctypes.create_string_buffer(state, len(state))

    @classmethod
    def of(cls, one: Implemented) -> "Compiled":
        """Observer at its start."""
        subject = Engine(NAME, one, (), {})
        with tempfile.TemporaryDirectory(prefix="obsdesign-") as folder:
            path = Path(folder)
            (path / f"{NAME}.h").write_text(c.header(subject))
            (path / f"{NAME}.c").write_text(c.source(subject) + driver(subject))
            library = path / f"{NAME}.so"
            subprocess.run(
                [*COMPILER, str(path / f"{NAME}.c"), "-o", str(library), "-lm"], check=True, capture_output=True
            )
            code = ctypes.CDLL(str(library))
        code.observer_run.restype = ctypes.c_long
        state = ctypes.create_string_buffer(code.observer_size())
        code.observer_init(state, None)
        return cls(one, one, code, state.raw, np.full(len(one.observer.outputs), np.nan), {})

    def copied(self) -> "Compiled":
        """The same where it is now."""
        return Compiled(self.plain, self.one, self.code, self.state.raw, self.last.copy(), self.kept)

    def open(self, mask: Mask | None) -> None:
        """Be the observer of which some outputs are not known, as `partial` makes it, where it makes one."""
        if mask not in self.kept:
            made = partial(self.plain, mask)
            self.kept[mask] = Compiled.of(made) if made else None
        other = self.kept[mask]
        if other is None:
            return
        if not self.one.known:
            before, after = (8 * max(1, len(one.states)) for one in (self.one, other.one))
            raw = self.state.raw
            state = raw[:before] + other.state.raw[before:after] + raw[before:]
            self.state = ctypes.create_string_buffer(state, len(state))
        self.one, self.code = other.one, other.code

    def run(self, t: Float, u: Float, y: Float, begin: int, first: bool, h: float = 0.0) -> Passed:
        """Go along rows."""
        return along(self, t, u, y, begin, first, h)

    def go(self, t: Float, u: Float, y: Float, begin: int, first: bool, h: float) -> Passed:
        """Go along rows as the observer that it is now."""
        one, K = self.one, len(t)
        estimates, expected, arguments = (np.full((K, n), np.nan) for n in one.width)
        made = Passed(estimates, expected, arguments, K)
        given = [np.ascontiguousarray(part, dtype=float) for part in (t, u, y)]
        place = [part.ctypes.data_as(ctypes.c_void_p) for part in (*given, *made[:3], self.last)]
        period = ctypes.c_double(h or float(one.period.p) / float(one.period.q))
        done = self.code.observer_run(self.state, ctypes.c_long(K), begin, int(first), period, *place)
        return made._replace(rows=int(done))
