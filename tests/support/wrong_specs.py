"""Specs with one thing wrong, and what must be said about it."""

from dataclasses import dataclass

import pytest

from obsdesign.errors import UsageError
from obsdesign.reading import loads
from support.bounded import soon

JARGON = (
    *("pydantic", "Input should", "validation error", "http", "instance of", "Traceback", "\n"),
    *("<rows>", "<mapping>", "<sporadic>", "<lipschitz>"),
)


@dataclass(frozen=True)
class Wrong:
    """A spec with one line in place of another, and what must be said about it."""

    base: str
    old: str
    new: str
    key: str
    words: tuple[str, ...]
    place: tuple[int, int] | None

    @property
    def text(self) -> str:
        """The wrong spec."""
        assert self.base.count(self.old) == 1, self.old
        return self.base.replace(self.old, self.new)

    def is_answered_by(self, problem):
        """The place, the key and every word; a place that is not given is somewhere in the file."""
        assert (problem.file, problem.key) == ("spec.yaml", self.key), str(problem)
        for words in self.words:
            assert words in problem.message, str(problem)
        assert 1 <= problem.line <= self.text.count("\n") + 1
        assert problem.column >= 1
        assert self.place in (None, (problem.line, problem.column)), str(problem)
        return True


def wrong_in(base):
    """Maker of cases for a spec."""

    def wrong(old, new, key, *words, place=None):
        return pytest.param(Wrong(base, old, new, key, words, place), id=f"{key}<-{new.strip()[:50]!r}")

    return wrong


def problems_of(text):
    """What is answered to a spec that is wrong: soon, and in plain words."""
    with soon(), pytest.raises(UsageError) as caught:
        loads(text, "spec.yaml")
    for problem in caught.value.problems:
        assert not any(word in str(problem) for word in JARGON), str(problem)
        assert len(str(problem)) < 400
    return caught.value.problems


def problem_of(text):
    """What is answered to a spec with one mistake: one line."""
    problems = problems_of(text)
    assert len(problems) == 1, "\n".join(map(str, problems))
    return problems[0]
