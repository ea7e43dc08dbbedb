"""What a routine computes more than once, computed once."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

from obsdesign.expressions import Expression
from obsdesign.expressions.tree import Call, Node, Number, Variable
from obsdesign.model.equations import free
from obsdesign.stepping.routine import Let, Routine, Statement

CHEAP = ("+", "*", "<", "<=", ">", ">=", "==", "!=", "pi")
FEW = 4  # cheap operations that are written twice rather than named
Key = int  # of equal parts


class Parts:
    """Parts of expressions, the equal ones known as such."""

    def __init__(self) -> None:
        self.keys: dict[object, Key] = {}
        self.cost: dict[Key, int] = {}  # in operations

    def key(self, node: Node, below: dict[int, Key]) -> Key:
        """Key of a part, given those of its arguments by their identity."""
        match node:
            case Number(value):
                made: object = ("number", str(value))
            case Variable(name):
                made = ("variable", name)
            case Call(operation, arguments):
                made = (operation, *(below[id(a)] for a in arguments))
            case _:
                raise TypeError(node)
        found = self.keys.setdefault(made, len(self.keys))
        if isinstance(node, Call):
            own = 1 if node.operation in CHEAP else FEW
            self.cost[found] = min(FEW, own + sum(self.cost[below[id(a)]] for a in node.arguments))
        else:
            self.cost[found] = 0
        return found

    def of(self, side: Expression) -> dict[int, Key]:
        """Key of each part of an expression, by the identity of its node."""
        below: dict[int, Key] = {}
        for node in side.order:
            below[id(node)] = self.key(node, below)
        return below


def shared(routine: Routine, taken: set[str]) -> Routine:
    """The same with parts that occur more than once as signals of their own: functions, quotients, long sums.

    Parts of a branch of `where`, which may have no value where another is taken, stay where they are, and so do those
    of a loop.
    """
    parts = Parts()
    sides = [one.value for one in routine.statements if isinstance(one, Let)] + list(routine.results.values())
    keys = {id(side): parts.of(side) for side in sides}
    count = Counter(keys[id(side)][id(node)] for side in sides for node in looked_at(side.root))
    names: dict[Key, str] = {}
    statements: list[Statement] = []

    def written(side: Expression) -> Expression:
        return Expression(rewritten(side.root, keys[id(side)]))

    def rewritten(node: Node, below: dict[int, Key]) -> Node:
        key = below[id(node)]
        if key in names:
            return Variable(names[key])
        if not isinstance(node, Call):
            return node
        if node.operation == "where":
            made: Node = Call("where", (rewritten(node.arguments[0], below), *node.arguments[1:]))
        else:
            made = Call(node.operation, tuple(rewritten(a, below) for a in node.arguments))
        if count[key] > 1 and parts.cost[key] == FEW:
            names[key] = free(f"c{len(names) + 1}", taken)
            statements.append(Let(names[key], Expression(made)))
            return Variable(names[key])
        return made

    for one in routine.statements:
        made = Let(one.name, written(one.value)) if isinstance(one, Let) else one  # after what it names
        statements.append(made)
    results = {name: written(side) for name, side in routine.results.items()}
    return replace(routine, statements=tuple(statements), results=results)


def looked_at(root: Node) -> Iterator[Node]:
    """Parts that are computed whatever the conditions: the whole, and the arguments of each part."""
    yield root
    seen, waiting = {id(root)}, [root]
    while waiting:
        node = waiting.pop()
        if not isinstance(node, Call):
            continue
        for argument in node.arguments[:1] if node.operation == "where" else node.arguments:
            yield argument
            if id(argument) not in seen:
                seen.add(id(argument))
                waiting.append(argument)
