"""What identities of rational functions say of the errors of an observer: what a file of Coq is written of.

A run is a plant and its observer up to a time T, in their equations. Each error e of it is a function of their signals.
"""

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from flint import fmpq

from obsdesign.coq.signals import KEYWORDS, Ends, UnknownTermError, required
from obsdesign.coq.theorem import UnexportedError
from obsdesign.expressions import Expression
from obsdesign.expressions.needs import Need
from obsdesign.lmi.formula import Array, identity
from obsdesign.records import dataclass, field

Named = Mapping[str, Expression]


@dataclass(frozen=True)
class Run:
    """Plant and observer, each side over the signals of both and t."""

    states: Named
    outputs: Named  # over states, inputs and t
    inputs: tuple[str, ...]
    held: tuple[str, ...]  # inputs that are constant
    observer: Named
    free: tuple[str, ...]  # estimates, of which no equation is asked
    ranges: Mapping[str, Ends]


@dataclass(frozen=True)
class Law:
    """An error that obeys e' = sum of rate e_j over some errors, where those before it are zero.

    With e alone it decays, or is constant where the rate is 0. `bound`: decay that the words tell, in 1/s.
    """

    error: str
    rates: Named  # over the plant, by the names of the errors
    what: str  # the identity, in words
    before: tuple[str, ...] = ()
    bound: fmpq | None = None

    @property
    def alone(self) -> bool:
        """Whether the error moves by itself, and is not constant."""
        return [*self.rates] == [self.error]


@dataclass(frozen=True)
class Fall:
    """Errors that act on each other, e' = M e with a constant M, and fall as exp(-r t): V = e' P e shows it.

    M' P + P M + 2 r P <= 0 and I <= P <= most I.
    """

    laws: tuple[Law, ...]  # of e' = M e
    M: Array
    P: Array
    r: fmpq
    most: fmpq

    @property
    def dissipation(self) -> Array:
        """- M' P - P M - 2 r P."""
        return np.asarray(-(self.M.mT @ self.P) - self.P @ self.M - 2 * self.r * self.P)

    @property
    def holds(self) -> bool:
        """Whether the inequalities do."""
        eye = identity(len(self.P), self.P)
        try:
            for S in (self.dissipation, self.P - eye, self.most * eye - self.P):
                factors(S)
        except ValueError:
            return False
        return True


def factors(S: Array) -> list[list[fmpq]]:
    """Rows l of S = sum of d l' l with d > 0, from a symmetric S in rationals; raises `ValueError`: there are none."""
    rest, found = S.copy(), []
    for k in range(len(S)):
        pivot = rest[k, k]
        if pivot < 0 or (pivot == 0 and (rest[k] != 0).any()):
            raise ValueError("the matrix has a negative eigenvalue")
        if pivot > 0:
            row = rest[k] / pivot
            found.append([*row])
            rest = rest - pivot * np.outer(row, row)
    return found


@dataclass(frozen=True)
class Inverse:
    """States that functions of the observer give where some errors are zero."""

    states: Named
    right: tuple[str, ...]


@dataclass(frozen=True)
class Resolved:
    """A signal, or one that is defined, which an error that is zero gives."""

    signal: str
    value: Expression


@dataclass(frozen=True)
class Identities:
    """A run, signals that are defined in its terms, and what is stated of these.

    `solved`: for a law, `known`: for the inverse, what follows where an error is zero, by its name.
    """

    run: Run
    defined: Named  # each over those before it
    laws: tuple[Law, ...]
    inverse: Inverse
    solved: Mapping[str, Resolved]
    known: Mapping[str, Resolved] = field(default_factory=dict)
    falls: tuple[Fall, ...] = ()

    def whole(self, f: Expression, kept: frozenset[str] = frozenset()) -> Expression:
        """Function in terms of states, inputs, observer and t, but for defined signals that are kept."""
        for name, side in reversed([*self.defined.items()]):
            f = f if name in kept else f.substituted({name: side})
        return f.substituted(self.run.outputs)

    @cached_property
    def names(self) -> dict[str, str]:
        """Names in Coq of all signals; that of a keyword has a _."""
        run, found = self.run, dict[str, str]()
        keys = [*run.states, *run.inputs, *run.outputs, *run.observer, *run.free, *self.defined]
        for key in (*keys, *(f"rate {law.error}" for law in self.laws)):
            own = key.replace(" ", "_")
            while own in KEYWORDS or own in found.values():
                own += "_"
            found.setdefault(key, own)
        return found

    @cached_property
    def needed(self) -> Mapping[str, Need]:
        """What functions of the run and of its errors need; raises `UnexportedError`."""
        run = self.run
        sides = [*run.states.values(), *run.outputs.values(), *run.observer.values(), *self.inverse.states.values()]
        sides += [side for law in self.laws for side in law.rates.values()]
        derived = [self.defined[law.error] for law in self.laws]
        sides += [*derived, *(s.value for s in (*self.solved.values(), *self.known.values()))]
        try:
            return required([self.whole(side) for side in sides], [self.whole(side) for side in derived])
        except UnknownTermError as error:
            raise UnexportedError(str(error)) from None
