"""Expressions of a spec: from text to functions, derivatives, enclosures and exact numbers.

Text is read by a parser of its own over a whitelist of operations; nothing is ever evaluated as Python.
To add a function, add one entry to `functions.OPERATIONS`.
"""

from obsdesign.expressions.exact import ExpressionError
from obsdesign.expressions.expression import Expression, constant, parse, vector_function
from obsdesign.expressions.interval import Interval

__all__ = ["Expression", "ExpressionError", "Interval", "constant", "parse", "vector_function"]
