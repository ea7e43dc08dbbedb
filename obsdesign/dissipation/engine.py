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
        self.equations = solver == "clarabel"  # whether Riccati equations take part: not in its cross-check
        self.eliminates = self.equations  # whether they may find a limit
        self.eliminated = False  # whether one did
        self.recalled: dict[tuple[bytes, ...], Answer] = {}  # what they told of which numbers

    @property
    def method(self) -> str:
        """What found the limits: lmi, or riccati where such equations told."""
        return "riccati" if self.eliminated else "lmi"

    def distrust(self) -> bool:
        """Leave Riccati equations out from now on; False if none found a limit so far."""
        found, self.eliminated = self.eliminated, False
        self.eliminates = self.eliminates and not found
        return found

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
