"""Plant and observer as definitions of an array program, in the coordinates (state, estimation error).

An estimate is written as the signal that it copies and an error, hat_x = x + error. With the numbers exact, the linear
parts of plant and observer then cancel wherever the observer is a copy of the plant, and its nonlinear terms pair off
with those of the plant: nothing is left but errors, inputs and differences of terms. The error of a state can be
integrated itself, since the difference of two large states has lost its digits.
"""

from collections import defaultdict
from collections.abc import Callable

from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.families.observer import Observer
from obsdesign.model.ahead import ahead
from obsdesign.model.equations import Equations, Named
from obsdesign.records import dataclass, field
from obsdesign.simulate.program import UNIT, Definition, Pair

ZERO = Expression.number(0)


# names of signals that go with another
error = "{} error".format  # of the estimate of a signal
rate = "{} rate".format  # of a state; in discrete time the state at the next sample
noise = "{} noise".format  # of an output
measured = "{} measured".format  # an output as it is measured
after = "{} after".format  # a state of the flow after a measurement
mismatch = "{} mismatch".format  # what a measurement without noise would add to a further state
event = "event {}".format  # a condition that ends a run


@dataclass
class Definitions:
    """Definitions of a plant with its observer."""

    plant: Equations
    observer: Observer  # over signals of the same names
    noisy: bool  # whether outputs are measured with noise, an input of the program
    added: bool = True  # whether it is added to them when they are measured; else they hold it, by channels of w
    next: Named = field(default_factory=dict)  # signals of the plant at the next sample, where the observer knows y+
    made: dict[str, Definition] = field(default_factory=dict)

    def __post_init__(self) -> None:
        plant, observer = self.plant, self.observer
        for name, side in self.sides.items():
            self.define(name, side)
        for name, side in plant.dynamics.items():
            self.define(rate(name), side)
        if self.noisy:
            self.made |= {measured(y): dict.fromkeys(self.seen(y), fmpq(1)) for y in self.measurable}
        self.made |= {hat: Pair(twin, error(twin), 1) for hat, twin in observer.twins.items()}
        self.made |= {name: {**self.weights(side), error(name): fmpq(1)} for name, side in observer.follows.items()}
        states = {name: Expression.variable(name) for name in plant.states}
        self.compare(observer.algebraic, {**self.sides, **states}, lambda name: name)
        self.compare(
            {k: side for k, side in observer.dynamics.items() if k not in observer.follows}, plant.dynamics, rate
        )
        self.follow()
        self.made |= {
            error(name): self.difference(observer.estimates[name], side)
            for name, side in states.items()
            if error(name) not in (*self.copied, *self.made)
        }
        self.made |= {name: self.difference(side, ZERO) for name, side in observer.received.items()}
        noises = set(map(noise, self.measurable))
        for name, place in zip(observer.jump, self.jumping, strict=True):
            twin = observer.twins.get(name)
            jumped = self.difference(observer.jump[name], Expression.variable(twin) if twin else ZERO)
            self.made[after(place)] = jumped
            if not twin:
                self.made[mismatch(name)] = {**{k: c for k, c in jumped.items() if k not in noises}, name: fmpq(-1)}

    def compare(self, estimates: Named, true: Named, named: Callable[[str], str]) -> None:
        """Define what the observer computes: as errors, where it is a copy."""
        for name, side in estimates.items():
            if (twin := self.observer.twins.get(name)) is None:
                self.made[named(name)] = self.difference(side, ZERO)
            else:
                self.made[named(error(twin))] = self.difference(side, true[twin])

    def follow(self) -> None:
        """Define the rates of the errors of states that follow a combination of those of the plant."""
        for name, side in self.observer.follows.items():
            pairs = [(c, self.plant.dynamics[term.text]) for c, term in side.summands() if c != 0]
            true = Expression.combination([c for c, _ in pairs], [moves for _, moves in pairs])
            self.made[rate(error(name))] = self.difference(self.observer.dynamics[name], true)

    @property
    def followed(self) -> tuple[str, ...]:
        """Names of these errors, which are integrated."""
        return tuple(map(error, self.observer.follows))

    @property
    def jumping(self) -> tuple[str, ...]:
        """Names of the states of the flow that a measurement changes: in place of a copy its error, by as much."""
        twins = self.observer.twins
        return tuple(error(twins[name]) if name in twins else name for name in self.observer.jump)

    @property
    def copied(self) -> tuple[str, ...]:
        """Names of the errors that are integrated, in the order of the states of the plant."""
        twins = {self.observer.twins.get(name) for name in self.observer.states}
        return tuple(error(name) for name in self.plant.states if name in twins)

    @property
    def further(self) -> tuple[str, ...]:
        """States of the observer that copy none of the plant."""
        return self.observer.own

    @property
    def sides(self) -> dict[str, Expression]:
        """Right sides of the algebraic signals and outputs of the plant."""
        return {**self.plant.algebraic, **self.plant.outputs, **self.next}

    @property
    def measurable(self) -> tuple[str, ...]:
        """Outputs that the observer knows: those of a sample, and those of the next where it waits for them."""
        outputs = self.observer.outputs
        return (*outputs, *(name for name in map(ahead, outputs) if name in self.observer.following))

    def define(self, name: str, side: Expression) -> None:
        """Define a signal by an expression."""
        self.made[name] = self.weights(side)

    def weights(self, side: Expression) -> dict[str, fmpq]:
        """Linear combination of signals and terms that an expression is."""
        found: defaultdict[str, fmpq] = defaultdict(fmpq)
        for c, term in side.summands():
            found[self.slot(term)] += c
        return dict(found)

    def slot(self, term: Expression) -> str:
        """Name of a variable or of the number 1, or of a term, which is defined once."""
        name = term.text
        if name != UNIT and term.names != {name}:
            self.made[name] = term
        return name

    def difference(self, estimate: Expression, true: Expression) -> dict[str, fmpq]:
        """A right side of the observer minus one of the plant, in signals of the plant and errors.

        A term of the observer that copies one of the plant with the same weight is replaced by their difference.
        """
        found: defaultdict[str, fmpq] = defaultdict(fmpq)
        pending: defaultdict[Expression, fmpq] = defaultdict(fmpq)
        for c, term in true.summands():
            if term.names == {term.text}:
                found[term.text] -= c
            else:
                pending[term] -= c
        back = {hat: Expression.variable(twin) for hat, twin in self.observer.twins.items()}
        seen = {y: Expression.variable(measured(y)) for y in self.measurable} if self.noisy else {}
        for c, term in estimate.summands():
            name = term.text
            if term.names == {name}:
                for part, weight in self.parts(name).items():
                    found[part] += c * weight
                continue
            twin, here = term.substituted(back), term.substituted(seen)
            if pending.get(twin) == -c:
                del pending[twin]
                if here != twin:
                    found[self.pair(here, twin)] += c
            else:
                found[self.slot(here)] += c
        for term, c in pending.items():
            found[self.slot(term)] += c
        return {name: c for name, c in found.items() if c != 0}

    def parts(self, name: str) -> dict[str, fmpq]:
        """Signals whose combination a signal of the observer is.

        Where its states follow T x and y is in the estimates at once, y is written out: then T x + E C x - x cancels.
        """
        one, follows = fmpq(1), self.observer.follows
        if name in follows:
            return {**self.weights(follows[name]), error(name): one}
        if twin := self.observer.twins.get(name):
            return {**self.written_out(twin), error(twin): one}
        noisy = dict.fromkeys(self.seen(name)[1:], one)
        return {**self.written_out(name), **noisy}

    def written_out(self, name: str) -> dict[str, fmpq]:
        """A signal of the plant; an output by its right side, where that is of use."""
        if self.observer.follows and name in self.plant.outputs:
            return self.weights(self.plant.outputs[name])
        return {name: fmpq(1)}

    def seen(self, name: str) -> tuple[str, ...]:
        """Signals whose sum an output is as it is measured; other signals are themselves."""
        return (name, noise(name)) if self.noisy and self.added and name in self.measurable else (name,)

    def pair(self, estimate: Expression, true: Expression) -> str:
        """Name of the difference of two terms."""
        first, second = self.slot(estimate), self.slot(true)
        name = f"({first}) - ({second})"
        self.made[name] = Pair(first, second, -1)
        return name
