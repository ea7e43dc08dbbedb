"""Coefficients of a right side that are irrational, as doubles: sqrt(2)*w is linear in w, with a number in B."""

from collections.abc import Collection, Sequence

from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.expressions.constant import rounded
from obsdesign.expressions.tree import Call, Node, Number, number, product, quotient, total
from obsdesign.model.split import names


class Coefficients:
    """Reads the constant factors and divisors of summands that hold a signal as numbers; functions keep theirs.

    So pi*(x + w)/sqrt(2) is a number times x and the same times w, and sin(pi*x) stays.
    """

    def __init__(self, signals: Collection[str]) -> None:
        self.signals = frozenset(signals)
        self.read: dict[str, float] = {}  # the correctly rounded doubles, by the text of what was irrational

    def in_numbers(self, side: Expression) -> Expression:
        """Right side with such coefficients as exact numbers; raises `ExpressionError`: one is not finite."""
        return Expression(self.visited(side.root))

    def visited(self, node: Node) -> Node:
        """The same of a summand."""
        if not isinstance(node, Call) or not names(node) & self.signals:
            return node
        match node.operation, node.arguments:
            case "+", terms:
                return total([self.visited(term) for term in terms])
            case "*", factors:
                others: Sequence[Node] = [factor for factor in factors if names(factor)]
                if len(others) == 1:
                    others = [self.visited(others[0])]
                return product([*(self.number(factor) for factor in factors if not names(factor)), *others])
            case "/", (above, below):
                return quotient(self.visited(above), below if names(below) else self.number(below))
        return node

    def number(self, node: Node) -> Number:
        """Value of a constant, rounded to a double where it is no fraction."""
        if isinstance(node, Number):
            return node
        whole = Expression(node)
        self.read[whole.text] = value = rounded(whole.order)
        return number(fmpq(*value.as_integer_ratio()))
