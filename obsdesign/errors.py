"""The tree of errors and the exit codes they carry.

ObsdesignError            anything a person can act on; never a traceback
    ViolatedError   1     a run breaks a bound that is proved of it: a defect of this tool
    UsageError      2     a wrong command, file, or spec: one line for each problem
    InfeasibleError 3     gains are needed, and the design has none
    UndecidedError  4     numerical failure, a certificate that could not be established
    TimeLimitError  4     the time that was allowed is over; no search goes on after this one

An infeasible design is an answer, not an error: `solve` writes it with its diagnosis and exits with 3.
"""

import re
from dataclasses import dataclass

EXIT = {"certified": 0, "infeasible": 3, "refuted": 3, "uncertified": 4}  # exit codes of answers, by their status

# Characters that end a line, change what stands in it, or cannot be printed: in a text of a user they would forge lines
NOT_ONE_LINE = re.compile("[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong, where it is, and what is allowed instead."""

    message: str
    file: str = ""
    line: int = 0
    column: int = 0
    key: str = ""

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}:{self.column}" if self.line else self.file
        return ": ".join(part for part in (place, self.key, self.message) if part)


class ObsdesignError(Exception):
    """Base class of every error that a person can act on.

    `problems`: what is wrong, texts or `Problem`s with their places; printed one line each.
    """

    exit_code = 1

    def __init__(self, *problems: str | Problem) -> None:
        self.problems = tuple(Problem(p) if isinstance(p, str) else p for p in problems)
        super().__init__("\n".join(map(str, self.problems)))


class ViolatedError(ObsdesignError):
    """A run breaks a bound that is proved of it, which is a defect of this tool (exit code 1)."""


class UsageError(ObsdesignError):
    """A wrong command, an unreadable file, or a spec that is not valid (exit code 2)."""

    exit_code = 2


class InfeasibleError(ObsdesignError):
    """Gains are needed, but the design that should give them is infeasible (exit code 3)."""

    exit_code = 3


class UndecidedError(ObsdesignError):
    """Neither a solution nor a proof that there is none (exit code 4)."""

    exit_code = 4


class TimeLimitError(ObsdesignError):
    """The time that was allowed is over (exit code 4)."""

    exit_code = 4
