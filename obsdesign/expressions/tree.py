"""The tree of an expression, its arithmetic and its text.

Arithmetic on nodes simplifies lightly: numbers are folded exactly, 0 and 1 are absorbed, sums and products
are flat with at most one number. What is built this way has a text that parses back to the same tree.
"""

from collections.abc import Callable, Iterator, Sequence
from decimal import Decimal
from typing import TypeVar

from flint import fmpq

from obsdesign.expressions.exact import MAX_EXPONENT, ExpressionError, bounded, rational_power
from obsdesign.records import dataclass, field

T = TypeVar("T")
MAX_DEPTH = 500  # of derived trees; what is parsed is shallower


@dataclass(frozen=True, eq=False)
class Node:
    """A number, a variable or an operation on nodes."""

    def __add__(self, other: "Node") -> "Node":
        return total((self, other))

    def __sub__(self, other: "Node") -> "Node":
        return total((self, -other))

    def __neg__(self) -> "Node":
        return product((number(-1), self))

    def __mul__(self, other: "Node") -> "Node":
        return product((self, other))

    def __truediv__(self, other: "Node") -> "Node":
        return quotient(self, other)

    def __pow__(self, other: "Node") -> "Node":
        return power(self, other)


@dataclass(frozen=True, eq=False)
class Number(Node):
    """An exact rational number."""

    value: fmpq


@dataclass(frozen=True, eq=False)
class Variable(Node):
    """A variable."""

    name: str


@dataclass(frozen=True, eq=False)
class Call(Node):
    """An operation of the table `functions.OPERATIONS` on its arguments."""

    operation: str
    arguments: tuple[Node, ...]
    depth: int = field(init=False)

    def __post_init__(self) -> None:
        depth = 1 + max((depth_of(a) for a in self.arguments), default=0)
        if depth > MAX_DEPTH:
            raise ExpressionError(f"an expression is nested deeper than {MAX_DEPTH} levels", id="OBS303")
        object.__setattr__(self, "depth", depth)


def depth_of(node: Node) -> int:
    """Levels of operations in a tree."""
    return node.depth if isinstance(node, Call) else 0


def number(value: int | fmpq) -> Number:
    """Return the node of an exact number."""
    return Number(bounded(fmpq(value)))


def equals(node: Node, value: int) -> bool:
    """Whether a node is this number."""
    return isinstance(node, Number) and bool(node.value == value)


def spliced(operation: str, nodes: Sequence[Node]) -> list[Node]:
    """Operands with those of the same (associative) operation in place of their node."""
    flat: list[Node] = []
    for node in nodes:
        flat.extend(node.arguments if isinstance(node, Call) and node.operation == operation else (node,))
    return flat


def total(terms: Sequence[Node]) -> Node:
    """Sum, with its numbers collected where the first one stands."""
    flat = spliced("+", terms)
    constant = sum((t.value for t in flat if isinstance(t, Number)), fmpq(0))
    kept = [t for t in flat if not isinstance(t, Number)]
    if constant != 0:
        first = next(i for i, t in enumerate(flat) if isinstance(t, Number))
        kept.insert(first, number(constant))
    if len(kept) < 2:
        return kept[0] if kept else number(0)
    return Call("+", tuple(kept))


def product(factors: Sequence[Node]) -> Node:
    """Product, with its numbers collected in front (of a quotient: in its numerator)."""
    flat = spliced("*", factors)
    coefficient = fmpq(1)
    for factor in flat:
        if isinstance(factor, Number):
            coefficient = bounded(coefficient * factor.value)
    kept = [f for f in flat if not isinstance(f, Number)]
    if coefficient == 0 or not kept:
        return number(coefficient)
    first = kept[0]
    if isinstance(first, Call) and first.operation == "/" and coefficient != 1:
        numerator, denominator = first.arguments
        kept[0] = quotient(product((number(coefficient), numerator)), denominator)
    elif coefficient != 1:
        kept.insert(0, number(coefficient))
    return kept[0] if len(kept) == 1 else Call("*", tuple(kept))


def quotient(a: Node, b: Node) -> Node:
    """Quotient; a division by zero stays as it is."""
    if isinstance(a, Number) and isinstance(b, Number) and b.value != 0:
        return number(a.value / b.value)
    if equals(b, 1) or (equals(a, 0) and not isinstance(b, Number)):
        return a
    return Call("/", (a, b))


def power(a: Node, b: Node) -> Node:
    """Power; raises `ExpressionError` if the exponent is a large number."""
    if isinstance(b, Number):
        if abs(b.value) > MAX_EXPONENT:
            raise ExpressionError(f"an exponent may be at most {MAX_EXPONENT} in magnitude", id="OBS303")
        if b.value in (0, 1):
            return a if b.value == 1 else number(1)
        if isinstance(a, Number) and (value := rational_power(a.value, b.value)) is not None:
            return Number(value)
    return Call("**", (a, b))


def summands(node: Node, factor: fmpq) -> Iterator[tuple[fmpq, Node]]:
    """Terms of a sum times a number, each as a number times a node that is no sum; 1 is the node of a number."""
    match node:
        case Number(value):
            yield factor * value, number(1)
        case Call("+", terms):
            for term in terms:
                yield from summands(term, factor)
        case Call("*", (Number(value), *others)):
            yield from summands(product(others), factor * value)
        case Call("/", (numerator, Number(value))) if value != 0:
            yield from summands(numerator, factor / value)
        case _:
            yield factor, node


def postorder(root: Node) -> tuple[Node, ...]:
    """Every node once, arguments before operations; iterative, since trees may be deep."""
    order: dict[int, Node] = {}
    stack = [root]
    while stack:
        node = stack[-1]
        waiting = [a for a in node.arguments if id(a) not in order] if isinstance(node, Call) else []
        if waiting:
            stack.extend(reversed(waiting))
        else:
            order[id(stack.pop())] = node
    return tuple(order.values())


def fold(
    order: Sequence[Node],
    number: Callable[[fmpq], T],
    variable: Callable[[str], T],
    call: Callable[[Call, list[T]], T],
) -> T:
    """Value of the last node of an order, each node's from its arguments' values."""
    values: dict[int, T] = {}
    for node in order:
        match node:
            case Number(value):
                values[id(node)] = number(value)
            case Variable(name):
                values[id(node)] = variable(name)
            case Call():
                values[id(node)] = call(node, [values[id(a)] for a in node.arguments])
    return values[id(order[-1])]


COMPARISON, SUM, PRODUCT, UNARY, POWER, ATOM = range(6)  # how tightly a text binds
BINDING = {"+": SUM, "*": PRODUCT, "/": PRODUCT, "**": POWER}
BINDING |= dict.fromkeys(("<", "<=", ">", ">=", "==", "!="), COMPARISON)

Written = tuple[str, int]  # text and binding


def text(root: Node) -> str:
    """Text that parses back to the same tree."""
    return fold(postorder(root), written_number, lambda name: (name, ATOM), written_call)[0]


def written_number(value: fmpq) -> Written:
    """Decimal if the number has one, else p/q."""
    rest, places = value.q, {2: 0, 5: 0}
    for prime in places:
        while rest % prime == 0:
            rest //= prime
            places[prime] += 1
    if rest != 1:
        return f"{value.p}/{value.q}", PRODUCT
    digits = max(places.values())
    decimal = str(Decimal(f"{(value * 10**digits).p}e-{digits}")).lower()
    return decimal, UNARY if value < 0 else ATOM


def written_call(node: Call, arguments: list[Written]) -> Written:
    """Text of an operation from the texts of its arguments."""
    binding = BINDING.get(node.operation)
    if binding is None:
        return (f"{node.operation}({', '.join(a for a, _ in arguments)})" if arguments else node.operation), ATOM
    first, *others = arguments
    if binding == SUM:
        terms = [enclosed(term, PRODUCT) for term in others]
        tail = "".join(f" - {t[1:]}" if t.startswith("-") else f" + {t}" for t in terms)
        return enclosed(first, PRODUCT) + tail, SUM
    if binding == POWER:
        return f"{enclosed(first, ATOM)}**{enclosed(others[0], POWER)}", POWER
    if binding == COMPARISON:
        return f"{enclosed(first, SUM)} {node.operation} {enclosed(others[0], SUM)}", COMPARISON
    tail = node.operation.join(enclosed(factor, UNARY) for factor in others)
    if node.operation == "*" and equals(node.arguments[0], -1):
        return f"-{tail}", PRODUCT
    return f"{enclosed(first, PRODUCT)}{node.operation}{tail}", PRODUCT


def enclosed(written: Written, least: int) -> str:
    """Text, in parentheses if it binds less tightly than its place needs."""
    content, binding = written
    return content if binding >= least else f"({content})"
