"""What an expression needs to have a value, and further to have a derivative that says how it moves."""

from collections.abc import Callable, Iterator
from typing import Literal

from obsdesign.expressions.algebra import simplified
from obsdesign.expressions.expression import Expression
from obsdesign.expressions.functions import COMPARISONS, apply
from obsdesign.expressions.tree import Call, Node, Number, number, product, quotient, text, total
from obsdesign.records import dataclass, replace

Sign = Literal["is not 0", ">= 0", "> 0"]
Branch = tuple[Node, ...]  # conditions of `where` under which a part of an expression is looked at
OPPOSITE = {"<": ">=", ">=": "<", ">": "<=", "<=": ">", "==": "!=", "!=": "=="}
IMPLIED: dict[tuple[str, bool] | None, tuple[Sign, ...]] = {  # of r (a - b), by what is known of a, b, and if r > 0
    (">", True): ("> 0", ">= 0", "is not 0"),
    ("<", False): ("> 0", ">= 0", "is not 0"),
    (">", False): ("is not 0",),
    ("<", True): ("is not 0",),
    (">=", True): (">= 0",),
    ("<=", False): (">= 0",),
    **dict.fromkeys((("!=", True), ("!=", False)), ("is not 0",)),
    **dict.fromkeys((("==", True), ("==", False)), (">= 0",)),
}


@dataclass(frozen=True)
class Need:
    """A function whose sign is needed, on the branch where a part of an expression is looked at."""

    value: Expression
    sign: Sign
    text: str  # the same in words
    leaves: str = ""  # what is not known where it is not so; nothing: there is no value
    branch: tuple[Expression, ...] = ()  # conditions that hold there

    @property
    def implied(self) -> bool:
        """Whether a comparison of its branch says so."""
        return any(self.sign in IMPLIED.get(known, ()) for known in map(self.known, self.branch))

    def known(self, condition: Expression) -> tuple[str, bool] | None:
        """Comparison of a condition, if it compares a multiple of the value with 0, and whether this is positive."""
        compared = condition.root
        if not isinstance(compared, Call) or compared.operation not in COMPARISONS:
            return None
        a, b = compared.arguments
        ratio = simplified(Expression(quotient(self.value.root, a - b))).root
        return (compared.operation, bool(ratio.value > 0)) if isinstance(ratio, Number) and ratio.value != 0 else None


def need(value: Node, sign: Sign, said: str = "", leaves: str = "") -> Need:
    """Need of the sign of a function."""
    return Need(Expression(value), sign, f"{text(value)} {sign}{said}", leaves)


def of_value(node: Call) -> Iterator[Need]:
    """What an operation needs to have a value."""
    match node.operation, node.arguments:
        case "/", (_, divisor) if not isinstance(divisor, Number) or divisor.value == 0:
            yield need(divisor, "is not 0")
        case "tan", (x,):
            yield need(apply("cos", x), "is not 0")
        case "sqrt", (x,):
            yield need(x, ">= 0")
        case "log", (x,):
            yield need(x, "> 0")
        case (("asin" | "acos"), (x,)):
            yield need(number(1) - x ** number(2), ">= 0")
        case "**", (x, Number(exponent)) if exponent.q == 1:
            yield from [need(x, "is not 0")] if exponent < 0 else []
        case "**", (x, Number(exponent)):
            yield need(x, ">= 0" if exponent > 0 else "> 0")
        case "**", (x, _):
            yield need(x, "> 0", leaves=f"whether {text(node)} has a value")


def of_derivative(node: Call) -> Iterator[Need]:
    """What an operation needs besides to have a derivative; kinks and jumps have none anyway."""
    said, leaves = f", where {text(node)} is differentiated", f"whether {text(node)} moves as its derivative says"
    match node.operation, node.arguments:
        case "sqrt", (x,):
            yield need(x, "> 0", said, leaves)
        case (("asin" | "acos"), (x,)):
            yield need(number(1) - x ** number(2), "> 0", said, leaves)
        case "**", (x, Number(exponent)) if 0 < exponent < 1:
            yield need(x, "> 0", said, leaves)
        case "atan2", (y, x):
            cut = f"{text(y)} is not 0, or {text(x)} > 0: not the cut of {text(node)}{said}"
            yield Need(Expression(apply("max", x, apply("abs", y))), "> 0", cut, leaves)


def needs(expression: Expression) -> list[Need]:
    """What it needs to have a value: divisors that are not 0, arguments of roots, logarithms, arcs in their range."""
    return found(expression, of_value)


def further(expression: Expression) -> list[Need]:
    """What it needs besides to be differentiable: a root, a power or an arc not at its end, an angle off its cut."""
    return found(expression, of_derivative)


def found(expression: Expression, rule: Callable[[Call], Iterator[Need]]) -> list[Need]:
    """Needs of every part, on the branch where it is looked at."""
    branches = reached(expression)
    needed: dict[str, Need] = {}
    for node in expression.order:
        for one in rule(node) if isinstance(node, Call) else ():
            branch = tuple(map(Expression, branches[id(node)]))
            there = " where " + " and ".join(c.text for c in branch) if branch else ""
            needed[one.text + there] = replace(one, text=one.text + there, branch=branch)
    return [one for one in needed.values() if not one.implied]


def reached(expression: Expression) -> dict[int, Branch]:
    """Branch on which each part of an expression is looked at."""
    branches: dict[int, Branch] = {id(expression.root): ()}
    for node in reversed(expression.order):
        for i, part in enumerate(node.arguments if isinstance(node, Call) else ()):
            branch = branches[id(node)]
            if isinstance(node, Call) and node.operation == "where" and i:
                branch = (*branch, node.arguments[0] if i == 1 else opposite(node.arguments[0]))
            branches[id(part)] = either(branches.get(id(part), branch), branch)
    return branches


def either(a: Branch, b: Branch) -> Branch:
    """Branch that is taken where one of two is."""
    if a == b or not (a and b):
        return a and b
    return (total([product([apply("!=", condition, number(0)) for condition in branch]) for branch in (a, b)]),)


def opposite(condition: Node) -> Node:
    """Condition that holds where another does not."""
    if isinstance(condition, Call) and condition.operation in OPPOSITE:
        return apply(OPPOSITE[condition.operation], *condition.arguments)
    return apply("==", condition, number(0))
