"""Where a nonlinearity surely is defined and continuous in its argument.

A derivative bounds the difference quotients of f there only: that of a jump, such as sign(q), is zero beside it.
"""

from collections.abc import Callable, Collection, Mapping
from functools import reduce
from operator import and_

import numpy as np
import numpy.typing as npt

from obsdesign.expressions import Expression, Interval
from obsdesign.expressions.functions import COMPARISONS, OPERATIONS
from obsdesign.expressions.interval import point
from obsdesign.expressions.tree import Call, fold
from obsdesign.records import dataclass

Truth = npt.NDArray[np.bool_]
YES = np.array(True)


@dataclass(frozen=True)
class Part:
    """A part of an expression over boxes."""

    value: Interval
    sound: Truth  # where it surely is defined and continuous in q
    varies: bool  # with q


def nonzero(x: Interval) -> Truth:
    """Where no value is zero."""
    return (x.low > 0) | (x.high < 0)


def within_unit(x: Interval) -> Truth:
    """Where all values are in [-1, 1]."""
    return (x.low >= -1) & (x.high <= 1)


def power_is_sound(base: Interval, exponent: Interval) -> Truth:
    """Natural powers of all numbers, integer ones of all but zero, others of positive numbers (and of zero)."""
    integer: Truth = (exponent.low == exponent.high) & (np.floor(exponent.low) == exponent.low)
    natural = integer & (exponent.low >= 0)
    return natural | (integer & nonzero(base)) | (base.low > 0) | ((base.low >= 0) & (exponent.low > 0))


def decided(relation: str) -> Callable[[Interval, Interval], Truth]:
    """Rule of a comparison: it is true everywhere or false everywhere."""

    def rule(a: Interval, b: Interval) -> Truth:
        truth = COMPARISONS[relation].interval(a, b)
        same: Truth = truth.low == truth.high
        return same

    return rule


DOMAINS: dict[str, Callable[..., Truth]] = {  # where an operation surely has a value
    "/": lambda _, b: nonzero(b),
    "**": power_is_sound,
    "log": lambda x: x.low > 0,
    "sqrt": lambda x: x.low >= 0,
    "asin": within_unit,
    "acos": within_unit,
    "tan": lambda x: np.isfinite(OPERATIONS["tan"].interval(x).low),
}
JUMPS: dict[str, Callable[..., Truth]] = {  # where one that has a value everywhere surely does not jump
    "sign": nonzero,
    "atan2": lambda y, x: (x.low > 0) | nonzero(y),
    **{relation: decided(relation) for relation in COMPARISONS},
}


def continuous(f: Expression, box: Mapping[str, Interval], arguments: Collection[str]) -> Truth:
    """Boxes in which f surely is defined and continuous in q, one an entry.

    A jump in another variable alone does no harm: both arguments of a pair share it.
    """

    def variable(name: str) -> Part:
        return Part(box[name], YES, name in arguments)

    def of_call(node: Call, operands: list[Part]) -> Part:
        value = OPERATIONS[node.operation].interval(*(part.value for part in operands))
        return Part(value, soundness(node.operation, operands), any(part.varies for part in operands))

    with np.errstate(all="ignore"):
        return fold(f.order, lambda number: Part(point(number), YES, False), variable, of_call).sound


def soundness(operation: str, operands: list[Part]) -> Truth:
    """Where an operation is sound: of a choice, only the branch that is taken matters."""
    if operation == "where":
        condition, a, b = operands
        taken = nonzero(condition.value)
        passed = (condition.value.low == 0) & (condition.value.high == 0)
        either = a.sound & b.sound & (not condition.varies)
        choice: Truth = condition.sound & ((taken & a.sound) | (passed & b.sound) | either)
        return choice
    sound = reduce(and_, (part.sound for part in operands), YES)
    rules = DOMAINS | (JUMPS if any(part.varies for part in operands) else {})
    if operation in rules:
        sound = sound & rules[operation](*(part.value for part in operands))
    return sound
