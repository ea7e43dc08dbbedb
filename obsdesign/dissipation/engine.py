"""One solver, the bounds of one request, and how many solves they took."""

from collections.abc import Callable

from obsdesign.lmi.formula import Problem, Values
from obsdesign.lmi.reduce import Reduced
from obsdesign.lmi.solve import Answer, marginless, minimise, widest

Report = Callable[[float, str], None]  # fraction done, what is being done


class Engine:
    """Solves with one solver, counted."""

    def __init__(self, solver: str = "clarabel", report: Report = lambda *_: None) -> None:
        self.solver = solver
        self.report = report
        self.solves = 0

    def minimise(
        self, problem: Problem, start: Values | None = None, reduced: Reduced | None = None, *, precise: bool = False
    ) -> Answer:
        """Optimum of a problem."""
        return self.counted(minimise(problem, self.solver, start, reduced, precise=precise))

    def widest(self, problem: Problem, start: Values | None = None) -> Answer:
        """Point of largest margin."""
        return self.counted(widest(problem, self.solver, start))

    def marginless(self, problem: Problem) -> bool:
        """Whether phase I finds no margin, in two scalings."""
        none, solves = marginless(problem, self.solver)
        self.solves += solves
        return none

    def counted(self, answer: Answer) -> Answer:
        """Add to the number of solves."""
        self.solves += answer.solves
        return answer
