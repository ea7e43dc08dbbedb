"""What is exported: an observer in steps under an identifier, with what is proved of it in words."""

import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from obsdesign.expressions import Expression
from obsdesign.expressions.tree import Call, Number
from obsdesign.stepping.implemented import Implemented
from obsdesign.stepping.routine import Routine, Solve

ITERATIONS = 60  # of Newton's method in a loop
ARITHMETIC = {"+": "additions", "*": "products", "/": "quotients"}


@dataclass(frozen=True)
class Subject:
    """An observer in steps, and what is said of it."""

    name: str  # an identifier
    implemented: Implemented
    words: tuple[str, ...]  # where it comes from, and what is proved of it, in lines
    units: dict[str, str]  # of signals, where they have one
    single: bool = False  # numbers are floats of 32 bits

    @property
    def inputs(self) -> tuple[str, ...]:
        """Known inputs."""
        return self.implemented.observer.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        """Measured outputs."""
        return self.implemented.observer.outputs

    @property
    def estimates(self) -> tuple[str, ...]:
        """What is estimated."""
        return tuple(self.implemented.observer.estimates)

    @property
    def instants(self) -> bool:
        """Whether y is known at instants only."""
        return self.implemented.jump is not None

    @property
    def ahead(self) -> bool:
        """Whether a step takes u and y of the sample that it reaches."""
        return bool(self.implemented.observer.following)

    @cached_property
    def routines(self) -> dict[str, Routine]:
        """Routines that are exported, by name."""
        one = self.implemented
        start = {"begin": one.begin, "locate": one.locate}
        runs = {"step": one.step, "flow": one.part if self.instants else None, "jump": one.jump}
        found = {**start, **runs, "estimate": one.estimate}
        return {name: made for name, made in found.items() if made is not None}

    @property
    def begins(self) -> bool:
        """Whether some states begin at a function of t, u and y."""
        return "begin" in self.routines or "locate" in self.routines

    @property
    def period(self) -> float:
        """Period in s, as a double."""
        return float(self.implemented.period.p) / float(self.implemented.period.q)

    def cost(self, name: str = "step") -> dict[str, int]:
        """Operations of a routine by kind; of a loop, those of one of its iterations."""
        found = Counter[str]()
        for side in self.routines[name].expressions():
            for node in side.order:
                if not isinstance(node, Call) or node.operation == "pi":
                    continue
                last = node.arguments[-1]
                if node.operation == "**" and isinstance(last, Number) and last.value in (2, 3):
                    found["products"] += int(last.value.p) - 1
                elif kind := ARITHMETIC.get(node.operation):
                    found[kind] += len(node.arguments) - 1
                else:
                    found[node.operation] += 1
        return dict(found)

    @property
    def loops(self) -> bool:
        """Whether an algebraic loop is solved in each step."""
        return any(isinstance(one, Solve) for made in self.routines.values() for one in made.statements)


def identifier(name: str) -> str:
    """Name as an identifier: other characters are _, and x_ comes before what is no letter."""
    made = re.sub(r"[^A-Za-z0-9_]", "_", name) or "observer"
    return made if made[0].isalpha() else f"x_{made}"


def loops_of(routine: Routine) -> Iterator[tuple[Solve, tuple[str, ...]]]:
    """Algebraic loops of a routine, each with the known signals that it takes."""
    for one in routine.statements:
        if isinstance(one, Solve):
            sides: list[Expression] = [*one.residuals, *(slope for row in one.slopes for slope in row)]
            yield one, tuple(dict.fromkeys(n for side in sides for n in sorted(side.names) if n not in one.unknowns))


def shortest(value: float) -> str:
    """Shortest decimal of a double, with a point or an exponent."""
    assert math.isfinite(value)
    text = repr(float(value))
    return text if any(c in text for c in ".e") else f"{text}.0"
