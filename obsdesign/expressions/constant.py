"""The correctly rounded double of an irrational constant, by ball arithmetic of increasing precision."""

from collections.abc import Mapping, Sequence

from flint import arb, ctx, fmpq

from obsdesign.expressions.exact import ExpressionError, double
from obsdesign.expressions.functions import OPERATIONS
from obsdesign.expressions.tree import Call, Node, fold

PRECISIONS = (64, 128, 256, 512, 1024, 2048, 4096)  # bits; 2048 tell any double from zero


def ball(order: Sequence[Node], values: Mapping[str, fmpq], bits: int) -> arb:
    """Ball that holds the value of a tree; NaN where it is not defined."""

    def of_call(node: Call, operands: list[arb]) -> arb:
        if node.operation != "where":  # it ignores what its other branch is
            for operand in operands:
                if operand.is_nan():
                    return operand
        return OPERATIONS[node.operation].ball(*operands)

    with ctx.workprec(bits):
        return fold(order, arb, lambda name: arb(values[name]), of_call)


def rounded(order: Sequence[Node]) -> float:
    """Correctly rounded double of a tree without variables; raises `ExpressionError` if there is none."""
    for bits in PRECISIONS:
        value = ball(order, {}, bits)
        if value.is_finite():
            with ctx.workprec(bits):
                low, high = nearest(value.lower()), nearest(value.upper())
            if low == high:
                return low
    raise ExpressionError("the value is undefined, infinite, or cannot be decided", id="OBS304")


def nearest(end: arb) -> float:
    """Nearest double of an exact end of a ball, whose exponent may be huge."""
    if abs(end) < arb(2) ** -1080:
        return 0.0
    if not abs(end) < arb(2) ** 1030:
        raise ExpressionError("the value is not finite as a double", id="OBS304")
    mantissa, exponent = end.man_exp()
    return double(fmpq(mantissa) * fmpq(2) ** exponent)
