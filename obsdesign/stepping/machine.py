"""Routines that run, on numbers: what a simulation of the implementation and the vectors of a self-test come from."""

from collections.abc import Callable, Sequence

import numpy as np

from obsdesign.errors import UndecidedError
from obsdesign.expressions import vector_function
from obsdesign.lmi.formula import Float
from obsdesign.model.ahead import ahead
from obsdesign.stepping.implemented import Implemented
from obsdesign.stepping.routine import Let, Routine, Solve

ITERATIONS = 60  # of Newton's method
HALVINGS = 40
LAST = 1e-10  # step of it after which the loop counts as solved; the error left is its square

Values = Sequence[float]
Function = Callable[[Values], list[float]]


class StuckError(UndecidedError):
    """An equation has no finite value, or a loop does not converge."""


def compiled(routine: Routine) -> Function:
    """Results of a routine, as a function of the signals that it is given, in their order."""
    names, lines = list(routine.given), list[Callable[[list[float]], None]]()
    for one in routine.statements:
        if isinstance(one, Let):
            value = vector_function([one.value], tuple(names))
            lines.append(lambda known, value=value: known.append(value(known)[0]))  # type: ignore[misc]
            names.append(one.name)
        else:
            lines.append(loop(one, tuple(names)))
            names += one.unknowns
    results = vector_function(list(routine.results.values()), tuple(names))

    def run(given: Values) -> list[float]:
        known = list(given)
        for line in lines:
            line(known)
        found = results(known)
        if not np.isfinite(found).all():
            raise StuckError("an equation has no finite value", id="OBS304")
        return found

    return run


def loop(one: Solve, names: tuple[str, ...]) -> Callable[[list[float]], None]:
    """Solve a loop, given the values of what is known before it, which its own are appended to."""
    size = len(one.unknowns)
    sides = vector_function([*one.residuals, *(slope for row in one.slopes for slope in row)], (*names, *one.unknowns))

    def solve(known: list[float]) -> None:
        a = np.zeros(size)
        for _ in range(ITERATIONS):
            found = np.array(sides([*known, *a]))
            r, J = found[:size], found[size:].reshape(size, size)
            try:
                d = np.linalg.solve(J, -r)
            except np.linalg.LinAlgError:
                break
            share = 1.0
            for _ in range(HALVINGS):
                if ((after := np.array(sides([*known, *(a + share * d)]))[:size]) @ after) <= r @ r:
                    break
                share /= 2
            a = a + share * d
            if np.abs(d).max() <= LAST * (1 + np.abs(a).max()):
                known += a.tolist()
                return
        raise StuckError("an algebraic loop does not converge", id="OBS304")

    return solve


class Machine:
    """An observer that runs in steps, from the start of its estimate.

    `state` holds the values of its states. Raises `StuckError`: an equation has no finite value.
    """

    def __init__(self, one: Implemented, xhat0: Values | None = None) -> None:
        self.one, self.xhat0 = one, xhat0
        self._functions: dict[str, Function] = {}
        self.state, self.begun = np.array(one.begins), False
        if xhat0 is not None:
            for i, k in one.copied:
                self.state[i] = xhat0[k]

    def copied(self) -> "Machine":
        """The same where it is now, which goes on by itself."""
        other = Machine(self.one, self.xhat0)
        other.state, other.begun, other._functions = self.state.copy(), self.begun, self._functions
        return other

    def function(self, which: str) -> Function:
        """One of the routines as a function."""
        if which not in self._functions:
            self._functions[which] = compiled(getattr(self.one, which))
        return self._functions[which]

    def step(self, t: float, u: Values, y: Values) -> None:
        """Go on by a period; of estimates that know their sample, u is that of both samples and y that of the next."""
        self.set(self.one.step, self.run("step", t, u, y))

    def part(self, t: float, dt: float, u: Values, y: Values) -> None:
        """Go on by a time of at most a period."""
        assert self.one.part
        self.set(self.one.part, self.run("part", t, u, y, dt))

    def jump(self, t: float, u: Values, y: Values) -> None:
        """Take a measurement."""
        assert self.one.jump
        self.set(self.one.jump, self.run("jump", t, u, y))

    def estimate(self, t: float, u: Values, y: Values) -> Float:
        """Estimates, in the order of the observer."""
        return np.array(self.run("estimate", t, u, y))

    def set(self, routine: Routine, values: Values) -> None:
        """Take the results of a routine as states."""
        for name, value in zip(routine.results, values, strict=True):
            self.state[self.one.states.index(name)] = value

    def run(self, which: str, t: float, u: Values, y: Values, dt: float = 0.0) -> list[float]:
        """Results of a routine."""
        if not self.begun:
            self.begin(t, u, y)
        return self.function(which)(self.given(which, t, u, y, dt))

    def begin(self, t: float, u: Values, y: Values) -> None:
        """Set the states that begin at a function of t, u and y."""
        self.begun = True
        for which in ("begin", "locate") if self.xhat0 is not None else ("begin",):
            if routine := getattr(self.one, which):
                self.set(routine, self.function(which)(self.given(which, t, u, y, 0.0)))

    def given(self, which: str, t: float, u: Values, y: Values, dt: float) -> list[float]:
        """Values of the signals that a routine is given."""
        one, known = self.one, {"t": t, self.one.dt: dt}
        inputs, outputs = one.observer.inputs, one.observer.outputs
        if one.observer.following:
            known |= dict(zip((*inputs, *map(ahead, inputs)), u, strict=False))
            outputs = tuple(map(ahead, outputs))
        known |= dict(zip(inputs, u, strict=False)) | dict(zip(outputs, y, strict=False))
        known |= dict(zip(one.states, self.state.tolist(), strict=True))
        if self.xhat0 is not None:
            known = {**dict(zip(one.plant_states, self.xhat0, strict=False)), **known}
        return [known[name] for name in getattr(one, which).given]
