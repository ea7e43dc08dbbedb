"""An observer along the rows of a log in Python: the functions that are exported, and the way between rows."""

import importlib.util
import math
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from obsdesign.data.driver import NAME, ROUNDING, Engine
from obsdesign.data.runner import Passed, along
from obsdesign.exports import python
from obsdesign.lmi.formula import Float
from obsdesign.records import dataclass, field, replace
from obsdesign.stepping.implemented import Implemented
from obsdesign.stepping.open_loop import Mask, partial

Values = Sequence[float]
Function = Callable[..., tuple[float, ...]]


class StuckError(Exception):
    """An equation has no finite value."""


@dataclass
class Interpreted:
    """The observer in Python, with its state and the y that was known last, NaN where none was."""

    plain: Implemented  # all outputs of which are known
    one: Implemented
    functions: dict[str, Function]
    x: tuple[float, ...]
    last: tuple[float, ...]
    begun: bool
    kept: dict[Mask | None, "Interpreted | None"] = field(default_factory=dict)  # those of which some are not
    engine: ClassVar[Literal["c", "numpy"]] = "numpy"

    @classmethod
    def of(cls, one: Implemented) -> "Interpreted":
        """Observer at its start."""
        subject = Engine(NAME, one, (), {})
        code = loaded(python.functions(subject))
        functions = {which: finite(getattr(code, which)) for which in subject.routines}
        return cls(one, one, functions, one.begins, (math.nan,) * len(subject.outputs), one.begin is None)

    def copied(self) -> "Interpreted":
        """The same where it is now."""
        return replace(self)

    def open(self, mask: Mask | None) -> None:
        """Be the observer of which some outputs are not known, as `partial` makes it, where it makes one."""
        if mask not in self.kept:
            made = partial(self.plain, mask)
            self.kept[mask] = Interpreted.of(made) if made else None
        if other := self.kept[mask]:
            self.one, self.functions = other.one, other.functions
            self.x = (*self.x, *other.x[len(self.x) :])

    def run(self, t: Float, u: Float, y: Float, begin: int, first: bool, h: float = 0.0) -> Passed:
        """Go along rows."""
        return along(self, t, u, y, begin, first, h)

    def go(self, t: Float, u: Float, y: Float, begin: int, first: bool, h: float) -> Passed:
        """Go along rows as the observer that it is now."""
        T, U, Y, K = t.tolist(), u.tolist(), y.tolist(), len(t)
        found: tuple[list[Values], ...] = tuple([(math.nan,) * n] * K for n in self.one.width)
        k, done = 0, K
        try:
            for k in range(K):
                if k or not begin:
                    self.record(found, k, T[k], U[k], Y[k])
                if k + 1 < K:
                    self.advance(found, k, (T[k], T[k + 1]), (U[k], U[k + 1]), (Y[k], Y[k + 1]), first, h)
        except StuckError:
            done = k + (bool(begin and not k) or not math.isnan(sum(found[0][k])))
        estimates, expected, arguments = (np.array(part).reshape(K, -1) for part in found)
        return Passed(estimates, expected, arguments, done)

    def record(self, found: tuple[list[Values], ...], k: int, t: float, u: Values, y: Values) -> None:
        """Take a row."""
        f = self.functions
        u, full = self.filled(t, u, y)
        if self.one.observer.following:
            found[0][k] = f["estimate"](self.x, t, u, full)
            return
        if not self.begun:
            self.begun, self.x = True, f["begin"](self.x, t, u, full)
        found[1][k] = f["predict"](self.x, t, u, full)
        if self.one.jump and not all(map(math.isnan, y)):
            self.x = f["jump"](self.x, t, u, full)
        found[0][k] = f["estimate"](self.x, t, u, full)
        if self.one.watched:
            found[2][k] = f["arguments"](self.x, t, u, full)

    def filled(self, t: float, u: Values, y: Values) -> tuple[Values, Values]:
        """Known inputs and y, in which what is missing is what is expected, or is told to be."""
        if self.one.known:
            return self.told(u, y)
        if not any(map(math.isnan, y)) or self.one.observer.following:
            return u, y
        expected = self.functions["predict"](self.x, t, u, [0.0 if math.isnan(value) else value for value in y])
        return u, [hoped if math.isnan(new) else new for hoped, new in zip(expected, y, strict=True)]

    def told(self, u: Values, y: Values) -> tuple[Values, Values]:
        """Known inputs and which of y are known; and y, where it is not known as it was last, or 0."""
        if not self.one.known:
            return u, y
        self.last = tuple(old if math.isnan(new) else new for old, new in zip(self.last, y, strict=True))
        return [*u, *(0.0 if math.isnan(new) else 1.0 for new in y)], [0.0 if math.isnan(y) else y for y in self.last]

    def advance(
        self,
        found: tuple[list[Values], ...],
        k: int,
        t: tuple[float, float],
        u: tuple[list[float], list[float]],
        y: tuple[list[float], list[float]],
        first: bool,
        h: float,
    ) -> None:
        """Go on to the next row."""
        f, one = self.functions, self.one
        if one.observer.following:
            both = [*self.told(u[0], y[0])[0], *self.told(u[1], y[1])[0]]
            expected = found[1][k + 1] = f["predict"](self.x, t[0], both, ())
            full = [hoped if math.isnan(new) else new for hoped, new in zip(expected, y[1], strict=True)]
            self.x = f["step"](self.x, t[0], both, full)
        elif not one.method:
            self.x = f["step"](self.x, t[0], *self.filled(t[0], u[0], y[0]))
        else:
            period = float(one.period.p) / float(one.period.q)
            self.parts(t, u, y, first, h or period, period)

    def parts(
        self, t: tuple[float, float], u: Sequence[Values], y: Sequence[Values], first: bool, h: float, period: float
    ) -> None:
        """Go on to the next row in steps of at most h."""
        f, span, jumps = self.functions, t[1] - t[0], self.one.jump is not None
        if self.one.regain:
            self.x = f["regain"](self.x, t[0], *self.told(u[0], y[0]))
        slack = ROUNDING + 1e-15 * abs(t[1]) / h  # of a period: what is no step of its own
        for i in range(max(1, math.ceil(span / h - slack)) if span > 0 else 0):
            begin = t[0] + i * h
            left = t[1] - begin
            on = left if left <= h * (1 - slack) else h
            inputs, seen = u[0], y[0]
            if first:
                share = (begin + on / 2 - t[0]) / span
                inputs = [a + share * (b - a) for a, b in zip(*u, strict=True)]
                seen = [a + (0.0 if math.isnan(b) else share * (b - a)) for a, b in zip(*y, strict=True)]
            inputs, full = self.filled(begin, inputs, seen)
            if jumps:
                self.x = f["flow"](self.x, begin, on, inputs)
            elif on > period * (1 - ROUNDING):
                self.x = f["step"](self.x, begin, inputs, full)
            else:
                self.x = f["part"](self.x, begin, on, inputs, full)


def loaded(text: str) -> Any:
    """Module of a text that is written here."""
    with tempfile.TemporaryDirectory(prefix="obsdesign-") as folder:
        path = Path(folder, f"{NAME}.py")
        path.write_text(text)
        spec = importlib.util.spec_from_file_location(NAME, path)
        assert spec
        assert spec.loader
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    return module


def finite(function: Function) -> Function:
    """The function, which raises `StuckError` where it has no finite value."""

    def checked(*arguments: Any) -> tuple[float, ...]:
        try:
            found = function(*arguments)
        except (ArithmeticError, ValueError):
            raise StuckError from None
        if not all(map(math.isfinite, found)):
            raise StuckError
        return found

    return checked
