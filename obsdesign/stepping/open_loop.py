"""An observer some outputs of which are not known: in the place of these it goes on with what it expects of them."""

from collections.abc import Mapping
from functools import cached_property

from obsdesign.expressions import Expression, parse
from obsdesign.families.observer import Correction, Observer
from obsdesign.model.ahead import ahead
from obsdesign.model.equations import Named, free
from obsdesign.records import dataclass, replace
from obsdesign.stepping.implemented import Implemented
from obsdesign.stepping.method import taken_by
from obsdesign.stepping.motion import ZERO

CHOICE = parse("where(known > 0, a, b)", ["known", "a", "b"])


Mask = tuple[bool, ...]  # whether each output is known


def partial(one: Implemented, mask: Mask | None = None) -> Implemented | None:
    """Observer with further inputs that are 1 for each output that is known and else 0, by which it does so.

    In the place of y_j stands yhat_j wherever y_j is not known, in each stage of a step, so that nothing is injected;
    gains of a filter are 0 then, also in its covariance. An output that estimates hold at once goes on from where it
    was known last (`motion`). None where what is expected at the beginning of a step is all that a step needs.

    `mask`: which outputs are known, whatever these inputs say: the linear part, of which `exact` is, depends on it.
    """
    observer = one.observer
    if observer.jump or (not one.method and not observer.silent and one.foresees):
        return None
    return OpenLoop(one, mask).made


@dataclass(frozen=True)
class OpenLoop:
    """The observer, and the names of what is new in it."""

    one: Implemented
    mask: Mask | None

    @cached_property
    def taken(self) -> set[str]:
        """Names that are in use."""
        found = taken_by(self.one.observer) | {*self.one.plant_states}
        if one := self.one.observer.correction:
            found |= {*one.algebraic, *one.closing, *one.begin, *one.flow.algebraic}
        return found

    @cached_property
    def known(self) -> dict[str, str]:
        """Inputs that say whether an output is known, by its name."""
        return {name: free(f"known_{name}", self.taken) for name in self.one.observer.outputs}

    @cached_property
    def measured(self) -> dict[str, str]:
        """Name of an output in the equations: at the sample that a step reaches, where it waits for that."""
        late = bool(self.one.observer.following)
        return {name: ahead(name) if late else name for name in self.one.observer.outputs}

    @cached_property
    def heard(self) -> dict[str, str]:
        """Signals that stand in the place of the outputs, by the names of these in the equations."""
        return {name: free(f"heard_{name}", self.taken) for name in self.measured.values()}

    @cached_property
    def moving(self) -> dict[str, str]:
        """States of the outputs that the estimates hold at once."""
        return {name: free(f"moved_{name}", self.taken) for name in self.one.motions}

    def chosen(self, output: str, there: Expression, else_: Expression) -> Expression:
        """One of two, by whether an output is known."""
        if self.mask is not None:
            return there if self.mask[self.one.observer.outputs.index(output)] else else_
        flag = ahead(self.known[output]) if self.one.observer.following else self.known[output]
        return CHOICE.substituted({"known": Expression.variable(flag), "a": there, "b": else_})

    def over(self, part: Named) -> dict[str, Expression]:
        """Right sides with what stands in the place of the outputs."""
        there = {name: Expression.variable(other) for name, other in self.heard.items()}
        return {name: side.substituted(there) for name, side in part.items()}

    def silenced(self, part: Named, silent: Mapping[str, tuple[str, ...]]) -> dict[str, Expression]:
        """Gains that are 0 where their output is not known."""
        return {name: self.chosen(output, part[name], ZERO) for output, names in silent.items() for name in names}

    @cached_property
    def places(self) -> dict[str, Expression]:
        """What stands in the place of each output, by name."""
        found, expected = {}, self.over(self.one.expected)
        for name, measured in self.measured.items():
            y = Expression.variable(measured)
            guess = expected[name]
            if name in self.moving:
                moved = Expression.variable(self.moving[name])
                guess = self.one.motions[name].g + moved + (y if self.one.method else ZERO)
            found[self.heard[measured]] = self.chosen(name, y, guess)
        return found

    @cached_property
    def rates(self) -> dict[str, Expression]:
        """Of the states of outputs that the estimates hold at once; in discrete time their next values."""
        found = {}
        for name, state in self.moving.items():
            side = self.one.motions[name].side
            if side is None:
                here = Expression.variable(self.heard[name]) - self.one.motions[name].g
                found[state] = ZERO if self.one.method else here
            else:
                moved = self.over({name: side})[name]
                found[state] = self.chosen(name, ZERO, moved) if self.one.method else moved
        return found

    @cached_property
    def made(self) -> Implemented:
        """The observer in steps."""
        observer, one = self.one.observer, self.one
        algebraic = self.over(observer.algebraic)
        algebraic |= {**self.silenced(algebraic, observer.silent), **self.places}
        dynamics, own = self.over(observer.dynamics), {}
        for name in self.moving:  # what it injects is y - yhat, and yhat need not be what the estimates hold of y
            expected = self.over(one.expected)[name]
            if expected != Expression.variable(self.heard[name]):
                own[self.heard[name]] = Expression.variable(free(f"injected_{name}", self.taken))
                algebraic[own[self.heard[name]].text] = self.chosen(name, Expression.variable(name), expected)
        dynamics = {name: side.substituted(own) for name, side in dynamics.items()}
        following = (*observer.following, *(map(ahead, self.known.values()) if observer.following else ()))
        held = replace(
            observer,
            dynamics={**dynamics, **self.rates},
            algebraic=algebraic,
            estimates=self.over(observer.estimates),
            inputs=(*observer.inputs, *self.known.values()),
            following=following,
            correction=self.corrected(observer.correction) if observer.correction else None,
        )
        regained = {
            state: self.chosen(name, ZERO - one.motions[name].g, Expression.variable(state))
            for name, state in self.moving.items()
            if one.method
        }
        return replace(
            one,
            observer=held,
            expected=self.over(one.expected),
            watched=self.over(one.watched),
            motions={},
            known=tuple(self.known.values()),
            regained=regained,
        )

    def corrected(self, correction: Correction) -> Correction:
        """Correction that takes nothing of what is not known; a y in the rates after it stays as it is expected."""
        flow, observer = correction.flow, self.one.observer
        used = {name for part in (flow.dynamics, flow.algebraic) for side in part.values() for name in side.names}
        kept = {name: self.heard[name] for name in observer.outputs if name in used}
        expected = {name: written(side, observer.algebraic) for name, side in self.one.expected.items() if name in kept}
        begun = {kept[name]: self.chosen(name, Expression.variable(name), side) for name, side in expected.items()}
        return replace(
            correction,
            begin={**correction.begin, **begun},
            algebraic={**correction.algebraic, **self.silenced(correction.algebraic, correction.silent)},
            flow=self.flowing(flow, tuple(kept.values())),
        )

    def flowing(self, flow: Observer, kept: tuple[str, ...]) -> Observer:
        """Rates after a correction, with outputs that stay."""
        inputs = (*flow.inputs, *self.known.values())
        dynamics = {**self.over(flow.dynamics), **dict.fromkeys(kept, ZERO)}
        return replace(flow, dynamics=dynamics, algebraic=self.over(flow.algebraic), inputs=inputs)


def written(side: Expression, definitions: Named) -> Expression:
    """Right side in signals that are not defined, of definitions without a loop."""
    while inner := {name: definitions[name] for name in side.names if name in definitions}:
        side = side.substituted(inner)
    return side
