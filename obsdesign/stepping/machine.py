"""Routines that run, on numbers: what a simulation of the implementation and the vectors of a self-test come from."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from obsdesign.errors import UndecidedError
from obsdesign.expressions import numeric, vector_function
from obsdesign.lmi.formula import Float
from obsdesign.model.ahead import ahead
from obsdesign.stepping.implemented import Implemented
from obsdesign.stepping.routine import Let, Routine, Solve

ITERATIONS = 60  # of Newton's method
HALVINGS = 40
LAST = 1e-10  # step of it after which the loop counts as solved; the error left is its square

Values = Sequence[float]
Function = Callable[[Values], list[float]]
Line = Callable[[list[float]], None]  # adds to what is known


class StuckError(UndecidedError):
    """An equation has no finite value, or a loop does not converge."""


def compiled(routine: Routine) -> Function:
    """Results of a routine, as a function of the signals that it is given, in their order."""
    names, quick, careful = list(routine.given), list[Line](), list[Line]()
    for one in routine.statements:
        if isinstance(one, Let):
            quick.append(defined(one, tuple(names)))
            careful.append(carefully(one, tuple(names)))
            names.append(one.name)
        else:
            quick.append(loop(one, tuple(names)))
            careful.append(quick[-1])
            names += one.unknowns
    results = vector_function(list(routine.results.values()), tuple(names))

    def run(given: Values) -> list[float]:
        known = list(given)
        try:
            for line in quick:
                line(known)
        except (ArithmeticError, ValueError):
            known = list(given)
            for line in careful:
                line(known)
        found = results(known)
        if not all(map(math.isfinite, found)):
            raise StuckError("an equation has no finite value", id="OBS304")
        return found

    return run


def defined(one: Let, names: tuple[str, ...]) -> Line:
    """Append the value of a signal to what is known; raises what math raises."""
    value = numeric.compiled(one.value.order, names)
    return lambda known: known.append(value(known))


def carefully(one: Let, names: tuple[str, ...]) -> Line:
    """The same, NaN or infinite where math raises."""
    value = vector_function([one.value], names)
    return lambda known: known.append(value(known)[0])


def loop(one: Solve, names: tuple[str, ...]) -> Line:
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
        self._places: dict[str, list[int]] = {}
        self._homes = {name: i for i, name in enumerate(one.states)}
        late = bool(one.observer.following)
        self._inputs, self._outputs = len(one.observer.inputs) * (1 + late), len(one.observer.outputs)
        self.state, self.begun = np.array(one.begins), False
        if xhat0 is not None:
            for i, k in one.copied:
                self.state[i] = xhat0[k]

    def copied(self) -> "Machine":
        """The same where it is now, which goes on by itself."""
        other = Machine(self.one, self.xhat0)
        other.state, other.begun = self.state.copy(), self.begun
        other._functions, other._places = self._functions, self._places
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
            self.state[self._homes[name]] = value

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
        known = [t, dt, *self.state.tolist(), *u]
        known += [0.0] * (2 + len(self._homes) + self._inputs - len(known))
        known += [*y, *([0.0] * (self._outputs - len(y))), *(self.xhat0 or ())]
        return [known[place] for place in self.places(which)]

    def places(self, which: str) -> list[int]:
        """Where the signals of a routine are among time, states, u, y and the estimate at the start."""
        if which not in self._places:
            one, late = self.one, bool(self.one.observer.following)
            inputs, outputs = one.observer.inputs, one.observer.outputs
            names = ["t", one.dt, *one.states, *inputs, *(map(ahead, inputs) if late else ())]
            names += map(ahead, outputs) if late else outputs
            found = {name: i for i, name in reversed(list(enumerate((*names, *one.plant_states))))}
            found |= dict(zip(outputs, range(len(names) - len(outputs), len(names)), strict=True)) if late else {}
            self._places[which] = [found[name] for name in getattr(one, which).given]
        return self._places[which]
