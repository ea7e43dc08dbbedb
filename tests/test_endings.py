"""How a solve ended is told in words of the field: no name of a solver's status leaves lmi/solvers.py."""

import re
from pathlib import Path

import numpy as np
import pytest

from obsdesign.lmi import solve, solvers
from obsdesign.lmi.formula import Inequality, Problem, Unknown
from obsdesign.lmi.probe import probe
from obsdesign.lmi.solve import Answer, Status, minimise
from obsdesign.lmi.solvers import CLARABEL, CVXPY, Ending, Solved, through_cvxpy, with_clarabel

PACKAGE = Path(solvers.__file__).parent.parent
RAW = re.compile(rf"\b({'|'.join(CLARABEL)}|InsufficientProgress|MaxIterations|solver_error|optimal_inaccurate)\b")


def bounded(low, high, sign=1.0):
    """Minimise sign x for low <= x <= high."""

    def inequalities(v):
        limits = ((low, -v["x"]), (-high, v["x"])) if high is not None else ((low, -v["x"]),)
        return [Inequality(f"{i}", limit * np.ones((1, 1)) + x) for i, (limit, x) in enumerate(limits)]

    return Problem((Unknown("x", (1, 1)),), inequalities, lambda v: sign * v["x"])


CASES = {
    "solved": (bounded(-1, 1), {Ending.SOLVED}),
    "infeasible": (bounded(1, -1), {Ending.INFEASIBLE}),
    "unbounded": (bounded(-1, None, -1.0), {Ending.IMPROPER}),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("solver", ["clarabel", "through cvxpy"])
def test_every_solver_ends_in_the_same_words(case, solver):
    problem, endings = CASES[case]
    call = with_clarabel if solver == "clarabel" else through_cvxpy("clarabel")
    assert call(probe(problem))[0] in endings


def test_a_status_that_is_not_known_means_that_the_search_stalled(monkeypatch):
    monkeypatch.setattr(solvers, "CLARABEL", {})
    monkeypatch.setattr(solvers, "CVXPY", {})
    program = probe(bounded(-1, 1))
    assert with_clarabel(program)[0] is Ending.STALLED
    assert through_cvxpy("clarabel")(program)[0] is Ending.STALLED


def test_an_answer_says_why_there_is_no_optimum(monkeypatch):
    monkeypatch.setattr(solve, "call", lambda _: lambda program: Solved(Ending.FAILED, np.zeros(len(program.cost)), ()))
    answer = minimise(bounded(-1, 1))
    assert (answer.status, answer.reason) == (
        Status.UNDECIDED,
        "the search for its optimum broke down numerically",
    )
    assert Answer(Status.INFEASIBLE, contradiction="the rows contradict each other").reason.startswith("the rows")


@pytest.mark.parametrize("ending", [*Ending])
def test_an_ending_reads_as_a_sentence(ending):
    assert ending in {*CLARABEL.values(), *CVXPY.values(), Ending.STALLED}
    assert re.fullmatch(r"[a-z][a-z ,]+", ending)


def test_no_raw_status_of_a_solver_occurs_elsewhere():
    files = [p for p in PACKAGE.rglob("*.py") if p.name != "solvers.py"]
    assert [p.name for p in files if RAW.search(p.read_text())] == []
