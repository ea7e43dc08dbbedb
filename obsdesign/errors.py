"""The tree of errors and the exit codes they carry.

ObsdesignError            anything a person can act on; never a traceback
    ViolatedError   1     a run breaks a bound that is proved of it: a defect of this tool
    UsageError      2     a wrong command, file, or spec: one line for each problem
    InfeasibleError 3     gains are needed, and the design has none
    UndecidedError  4     numerical failure, a certificate that could not be established
    TimeLimitError  4     the time that was allowed is over; no search goes on after this one

An infeasible design is an answer, not an error: `solve` writes it with its diagnosis and exits with 3.
"""

import json
import re
from collections.abc import Iterable
from typing import NamedTuple, overload

from obsdesign.records import dataclass, field, replace

EXIT = {"certified": 0, "infeasible": 3, "refuted": 3, "uncertified": 4}  # exit codes of answers, by their status

# Characters that end a line, change what stands in it, or cannot be seen: in a text of a user they would forge lines
FORMAT = (  # category Cf of Unicode
    "\u00ad\u0600-\u0605\u061c\u06dd\u070f\u0890\u0891\u08e2\u180e\u200b-\u200f\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\U000110bd\U000110cd\U00013430-\U0001343f\U0001bca0-\U0001bca3\U0001d173-\U0001d17a\U000e0000-\U000e007f"
)
NOT_ONE_LINE = re.compile(f"[\x00-\x1f\x7f-\x9f\u2028-\u202e\ud800-\udfff{FORMAT}]")
COMMAND = re.compile(r"(^|\r)([^\S\r\n]*):(?=:)", re.MULTILINE)  # of GitHub: ::error::, also after spaces
MOST_PLACES = 8  # of an unknown name, that are told
LOGGED = re.compile(r"##(?=\w*\[)")  # begins what a runner obeys anywhere in a log: ##[error], ##vso[, ##teamcity[


class Excerpt(NamedTuple):
    """Line of a file, as far as it is shown, cut at the place that a problem is about."""

    line: int  # from 1
    before: str
    after: str


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong, where it is, and what is allowed instead.

    `id`: its kind, which has one cause and one cure, and a page in the manual: `explain OBS104`.
    """

    message: str
    file: str = ""
    line: int = 0
    column: int = 0
    key: str = ""
    id: str = field(kw_only=True)
    rows: tuple[str, ...] = field(default=(), kw_only=True)  # of a table that belongs to it
    excerpt: Excerpt | None = field(default=None, kw_only=True, compare=False)

    def __str__(self) -> str:
        file = f"./{self.file}" if self.file.startswith("::") else self.file  # which a runner of CI would obey
        place = f"{file}:{self.line}:{self.column}" if self.line else file
        said = ": ".join(part for part in (place, self.key, self.message) if part)
        return "\n".join(map(one_line, (f"{said} [{self.id}]", *self.rows)))

    def written(self) -> dict[str, str | int | None]:
        """Entry of a report; null where there is no file, line, column or key."""
        return {
            "id": self.id,
            "message": "\n".join((self.message, *self.rows)),
            "file": self.file or None,
            "line": self.line or None,
            "column": self.column or None,
            "key": self.key or None,
        }


def listed(problems: Iterable[Problem]) -> str:
    """JSON of problems, as a command with --json prints it: no character in it that is not ASCII."""
    return json.dumps({"problems": [problem.written() for problem in problems]}, indent=2)


def one_line(text: str) -> str:
    """Text with escapes in place of what would end the line, or change what stands in it."""
    return NOT_ONE_LINE.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def unheeded(text: str) -> str:
    """Text whose lines the runners of GitHub, Azure and TeamCity do not obey.

    `::` at the beginning of a line and `##[` and `##word[` anywhere get an escape, which in JSON stands for the same.
    """
    return LOGGED.sub(r"#\\u0023", COMMAND.sub(r"\1\2\\u003a", text))


class ObsdesignError(Exception):
    """Base class of every error that a person can act on.

    `problems`: what is wrong, one text with its `id` or `Problem`s with their places; printed one line each.
    """

    exit_code = 1

    @overload
    def __init__(self, *problems: Problem) -> None: ...
    @overload
    def __init__(self, problem: str, /, *, id: str) -> None: ...
    def __init__(self, *problems: str | Problem, id: str = "") -> None:
        self.problems = tuple(Problem(p, id=id) if isinstance(p, str) else p for p in problems)
        super().__init__(*self.problems)

    def __str__(self) -> str:
        return "\n".join(map(str, self.problems))


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


def gathered(problems: list[Problem]) -> list[Problem]:
    """Problems in their order, an unknown name once: where it stands first, with its other places."""
    found: dict[str, list[Problem]] = {}
    for problem in problems:
        named = problem.id == "OBS302" and problem.line
        found.setdefault(problem.message.partition(";")[0] if named else str(problem), []).append(problem)
    return [repeated(*same) for same in found.values()]


def repeated(first: Problem, *others: Problem) -> Problem:
    """Problem with the other places where it is met."""
    also = ", ".join(f"{other.line}:{other.column}" for other in others[:MOST_PLACES])
    also += f" and {len(others) - MOST_PLACES} more" if len(others) > MOST_PLACES else ""
    return replace(first, message=f"{first.message}; also at {also}") if others else first
