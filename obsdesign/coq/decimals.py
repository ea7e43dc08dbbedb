"""Numbers and matrices as Coq has them: a decimal where a rational is one, a fraction elsewhere; names in comments."""

import re

from flint import fmpq

from obsdesign.lmi.formula import Array

UNSAFE = re.compile(r"[^\w .,:;=/+^|<>()\[\]{}~'%-]")  # what could end a comment, or begin a text within it


def number(x: fmpq) -> str:
    """Literal of a rational."""
    p, q = int(fmpq(x).p), int(fmpq(x).q)
    twos, rest = powers(q, 2)
    fives, rest = powers(rest, 5)
    if rest != 1:
        return f"({p} # {q})"
    places = max(twos, fives)
    digits = str(abs(p) * 10**places // q).rjust(places + 1, "0")
    text = f"{digits[:-places]}.{digits[-places:]}" if places else digits
    return f"(-{text})" if p < 0 else text


def powers(q: int, base: int) -> tuple[int, int]:
    """How often a base divides q, and what is left."""
    count = 0
    while q % base == 0:
        q, count = q // base, count + 1
    return count, q


def matrix(M: Array) -> str:
    """List of rows; a matrix without columns keeps its rows."""
    return "[" + "; ".join("[" + "; ".join(number(x) for x in row) + "]" for row in M) + "]"


def comment(text: str) -> str:
    """Comment of one line, in which every character that means something to Coq is replaced."""
    return f"(* {UNSAFE.sub('_', text)} *)"
