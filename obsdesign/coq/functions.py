"""Functions of one variable whose difference quotients are known to the library in Coq, and sums of their values."""

from collections.abc import Sequence

from flint import fmpq

from obsdesign.coq.decimals import number
from obsdesign.records import dataclass

ONE, ZERO = fmpq(1), fmpq(0)
Limits = tuple[fmpq, fmpq]


@dataclass(frozen=True)
class Function:
    """A function of one variable in Coq, and its lemma: every difference quotient is within [least, most]."""

    value: str  # in Coq, with {} for the argument
    lemma: str
    least: fmpq
    most: fmpq | None  # None: infinite
    limits: Limits | None = None  # the quotients are those of arguments between them; None: of all
    lines: tuple[str, ...] = ()  # that define the function and prove the lemma, where the library does not

    @property
    def term(self) -> str:
        """The function itself."""
        name = self.value.removesuffix(" {}")
        return f"fun {'s' if '{' in self.value else '_'} => {self.value.format('s')}" if name == self.value else name

    @property
    def bounds(self) -> str:
        """Both ends of the quotients in Coq, the lower as Q and the upper as option Q."""
        return f"{number(self.least)} {'None' if self.most is None else f'(Some {number(self.most)}%Q)'}"

    def everywhere(self) -> "Function":
        """The function itself where it is known for all arguments; else it is continued by lines."""
        if self.limits is None:
            return self
        limits = " ".join(map(number, self.limits))
        value = f"continued {limits} {number(self.least)} {self.term}"
        lemma = f"(continued_secants {limits} {self.bounds} {self.term} eq_refl {self.lemma})"
        return Function(f"{value} {{}}", lemma, self.least, self.most)

    def at(self, argument: str) -> str:
        """Value of the function in the text of f."""
        return self.value.format(f"({argument})" if " " in argument else argument)


CONSTANT = Function("1", "one_secants", ZERO, ZERO)
IDENTITY = Function("{}", "id_secants", ONE, ONE)
RELU = Function("relu {}", "relu_secants", ZERO, ONE)
LAW = Function("law {}", "law_secants", ZERO, None)
KNOWN = {
    **{name: Function(f"{name} {{}}", f"{name}_secants", -ONE, ONE) for name in ("sin", "cos")},
    **{name: Function(f"{name} {{}}", f"{name}_secants", ZERO, ONE) for name in ("tanh", "atan", "sat")},
    "abs": Function("Rabs {}", "abs_secants", -ONE, ONE),
    "exp": Function("exp {}", "exp_secants", ZERO, None),
    "sinh": Function("sinh {}", "sinh_secants", ONE, None),
}
MAX_POWER = 15


def odd_power(exponent: int) -> Function:
    """s^(2 m + 1)."""
    return Function(f"{{}} ^ {exponent}", f"(odd_secants {exponent // 2})", ZERO, None)


def real(x: fmpq) -> str:
    """Literal of a number that is not negative, in the scope of reals."""
    text = number(x)
    return text.replace(" # ", " / ") if "#" in text else text


def added(terms: Sequence[tuple[fmpq, str]]) -> str:
    """Sum of terms with coefficients; the term of a number is 1."""
    text = ""
    for c, term in terms:
        size = abs(c)
        shown = real(size) if term == "1" else term if size == 1 else f"{real(size)} * {term}"
        sign = "- " if c < 0 else "+ " if text else ""
        text += f"{' ' if text else ''}{sign}{shown}"
    return text or "0"
