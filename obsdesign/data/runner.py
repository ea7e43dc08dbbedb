"""An observer along the rows of a log: as the C that is exported, compiled here, or as the same routines in Python."""

import ctypes
import math
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Literal, NamedTuple, Protocol

import numpy as np

from obsdesign.data.driver import NAME, ROUNDING, Engine, driver, foresees
from obsdesign.exports import c
from obsdesign.lmi.formula import Float
from obsdesign.stepping.implemented import Implemented
from obsdesign.stepping.machine import Machine, StuckError

COMPILER = ("gcc", "-std=c99", "-O2", "-shared", "-fPIC")


class Passed(NamedTuple):
    """What an observer makes of rows."""

    estimates: Float  # (K, ne), at each row, with its measurement where that is taken there
    expected: Float  # (K, ny), y before it is known
    arguments: Float  # (K, nq), of f in the observer, where they are watched
    rows: int  # how far it got: the equations have no value after that


class Runner(Protocol):
    """An observer between two rows, wherever it is."""

    engine: Literal["c", "numpy"]

    def run(self, t: Float, u: Float, y: Float, begin: int, first: bool, h: float = 0.0) -> Passed:
        """Go along rows: t (K,), u (K, nu), y (K, ny), in which nothing is missing but what is not measured.

        `begin`: 0 at the first row of all, else 1, the first row being that where the last call ended; `first`: u and y
        go on straight lines between rows, instead of being held; `h`: longest step in s, in place of the period.
        """

    def copied(self) -> "Runner":
        """The same observer where it is now, which goes on by itself."""


def runner(one: Implemented) -> Runner:
    """Observer at its start: compiled where gcc is there."""
    return Compiled.of(one) if shutil.which(COMPILER[0]) else Interpreted(one)


class Compiled:
    """The observer in C."""

    engine: Literal["c", "numpy"] = "c"

    def __init__(self, one: Implemented, code: ctypes.CDLL, state: bytes, last: Float) -> None:
        self.one, self.code, self.last = one, code, last
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
        return cls(one, code, state.raw, np.full(len(one.observer.outputs), np.nan))

    def copied(self) -> "Compiled":
        """The same where it is now."""
        return Compiled(self.one, self.code, self.state.raw, self.last.copy())

    def run(self, t: Float, u: Float, y: Float, begin: int, first: bool, h: float = 0.0) -> Passed:
        """Go along rows."""
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


class Interpreted:
    """The same in Python."""

    engine: Literal["c", "numpy"] = "numpy"

    def __init__(self, one: Implemented, machine: Machine | None = None, last: Float | None = None) -> None:
        self.one, self.machine, self.own = one, machine or Machine(one), foresees(one)
        self.last = np.full(len(one.observer.outputs), np.nan) if last is None else last
        self.period = float(one.period.p) / float(one.period.q)

    def copied(self) -> "Interpreted":
        """The same where it is now."""
        return Interpreted(self.one, self.machine.copied(), self.last.copy())

    def run(self, t: Float, u: Float, y: Float, begin: int, first: bool, h: float = 0.0) -> Passed:
        """Go along rows."""
        one, K = self.one, len(t)
        sizes = len(one.observer.estimates), len(one.observer.outputs), len(one.watched)
        estimates, expected, arguments = (np.full((K, size), np.nan) for size in sizes)
        made = Passed(estimates, expected, arguments, K)
        k = 0
        try:
            for k in range(K):
                if k > 0 or not begin:
                    self.record(made, k, float(t[k]), u[k].tolist(), y[k])
                if k + 1 < K:
                    self.advance(made, k, t, u, y, first, h or self.period)
        except StuckError:
            return made._replace(rows=k + bool(np.isfinite(made.estimates[k]).all() or begin))
        return made

    def record(self, made: Passed, k: int, t: float, u: list[float], y: Float) -> None:
        """Take a row."""
        if self.one.observer.following:
            made.estimates[k] = self.machine.estimate(t, u, y.tolist())
            return
        made.expected[k], full = self.filled(t, u, y)
        if self.one.jump and np.isfinite(y).any():
            self.machine.jump(t, u, full)
        made.estimates[k] = self.machine.estimate(t, u, full)
        if self.one.watched:
            made.arguments[k] = self.machine.run("arguments", t, u, full)

    def filled(self, t: float, u: list[float], y: Float) -> tuple[Float, list[float]]:
        """What is expected of y, and y with what is missing filled by it, or by what was known last."""
        known = np.isfinite(y)
        self.last[known] = y[known]
        guess = np.where(np.isfinite(self.last), self.last, 0.0)
        expected = np.array(self.machine.run("predict", t, u, guess.tolist()))
        full = np.where(known, y, expected if self.own else self.last)
        if not np.isfinite(full).all():
            raise StuckError("an output is missing that was never known", id="OBS304")
        return expected, full.tolist()

    def advance(self, made: Passed, k: int, t: Float, u: Float, y: Float, first: bool, h: float) -> None:
        """Go on to the next row."""
        one, machine = self.one, self.machine
        if one.observer.following:
            both = u[k : k + 2].ravel().tolist()
            made.expected[k + 1] = machine.run("predict", float(t[k]), both, ())
            full = np.where(np.isfinite(y[k + 1]), y[k + 1], made.expected[k + 1])
            machine.step(float(t[k]), both, full.tolist())
            return
        if not one.method:
            now, inputs = float(t[k]), u[k].tolist()
            machine.step(now, inputs, self.filled(now, inputs, y[k])[1])
            return
        span = float(t[k + 1] - t[k])
        for i in range(max(1, math.ceil(span / h - ROUNDING))):
            begin = float(t[k]) + i * h
            left = float(t[k + 1]) - begin
            on = left if left < h * (1 + ROUNDING) else h
            share = (begin + on / 2 - float(t[k])) / span if first else 0.0
            inputs = (u[k] + share * (u[k + 1] - u[k])).tolist()
            seen = y[k] + np.where(np.isfinite(y[k + 1]), share * (y[k + 1] - y[k]), 0.0) if first else y[k]
            _, full = self.filled(begin, inputs, seen)
            if on > self.period * (1 - ROUNDING):
                machine.step(begin, inputs, full)
            else:
                machine.part(begin, on, inputs, full)
