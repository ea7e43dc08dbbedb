"""Signals at the next sample, in discrete time: s+ is s a period later, and t+ the time itself."""

from obsdesign.expressions import Expression

NEXT = "+"


def ahead(name: str) -> str:
    """Name of a signal at the next sample."""
    return f"{name}{NEXT}"


def later(side: Expression) -> Expression:
    """Right side a sample later: every signal in it, and t, is that of the next sample."""
    return side.substituted({name: Expression.variable(ahead(name)) for name in side.names})
