"""An observer along the rows of a log: as the C that is exported, compiled here, or as the same routines in Python."""

import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import ClassVar, Literal, NamedTuple, Protocol

import numpy as np

from obsdesign.data.driver import NAME, Engine, driver
from obsdesign.exports import c
from obsdesign.lmi.formula import Float
from obsdesign.stepping.implemented import Implemented
from obsdesign.stepping.open_loop import partial

COMPILER = ("gcc", "-std=c99", "-O2", "-shared", "-fPIC")


class Passed(NamedTuple):
    """What an observer makes of rows."""

    estimates: Float  # (K, ne), at each row, with its measurement where that is taken there
    expected: Float  # (K, ny), y before it is known
    arguments: Float  # (K, nq), of f in the observer, where they are watched
    rows: int  # how far it got: the equations have no value after that


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


class Compiled:
    """The observer in C."""

    engine: ClassVar[Literal["c", "numpy"]] = "c"

    def __init__(
        self, one: Implemented, code: ctypes.CDLL, state: bytes, last: Float, kept: dict[str, "Compiled | None"]
    ) -> None:
        self.one, self.code, self.last = one, code, last
        self.kept = kept  # the same where some outputs are not known, once it is needed
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
        return cls(one, code, state.raw, np.full(len(one.observer.outputs), np.nan), {})

    def copied(self) -> "Compiled":
        """The same where it is now."""
        return Compiled(self.one, self.code, self.state.raw, self.last.copy(), self.kept)

    def open(self) -> None:
        """Be ready for rows in which outputs are missing, as the observer of which some are not known."""
        if self.one.known:
            return
        if "part" not in self.kept:
            made = partial(self.one)
            self.kept["part"] = Compiled.of(made) if made else None
        if other := self.kept["part"]:
            before, after = (8 * max(1, len(one.states)) for one in (self.one, other.one))
            raw = self.state.raw
            state = raw[:before] + other.state.raw[before:after] + raw[before:]
            self.one, self.code, self.state = other.one, other.code, ctypes.create_string_buffer(state, len(state))

    def run(self, t: Float, u: Float, y: Float, begin: int, first: bool, h: float = 0.0) -> Passed:
        """Go along rows."""
        if np.isnan(y).any():
            self.open()
        one, K = self.one, len(t)
        made = Passed(
            np.full((K, len(one.observer.estimates)), np.nan),
            np.full((K, len(one.observer.outputs)), np.nan),
            np.full((K, len(one.watched)), np.nan),
            K,
        )
        given = [np.ascontiguousarray(part, dtype=float) for part in (t, u, y)]
        place = [part.ctypes.data_as(ctypes.c_void_p) for part in (*given, *made[:3], self.last)]
        period = ctypes.c_double(h or float(one.period.p) / float(one.period.q))
        done = self.code.observer_run(self.state, ctypes.c_long(K), begin, int(first), period, *place)
        return made._replace(rows=int(done))
