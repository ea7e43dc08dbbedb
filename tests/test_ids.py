"""Every refusal, finding and diagnosis names its kind: an id that has one cause, one cure, and one page."""

import ast
import pickle
import re
from pathlib import Path

import pytest

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import ExpressionError

ROOT = Path(__file__).parent.parent / "obsdesign"
FILES = sorted(ROOT.rglob("*.py"))
ERRORS = {"ObsdesignError", "ViolatedError", "UsageError", "InfeasibleError", "UndecidedError", "TimeLimitError"}
SITES = {*ERRORS, "ExpressionError", "Problem", "about", "finding", "wrong"}
ID = re.compile(r"OBS[1-9]\d\d")


def called(node):
    """Name of what a call calls, or of the method of something; cvxpy has a Problem too."""
    return getattr(node.func, "id", "") or getattr(node.func, "attr", "").replace("Problem", "")


def sites(source):
    """Calls that make a problem or a finding; an error of problems leaves their ids to them."""
    tree = ast.parse(source)
    imports = (node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom))
    foreign = {alias.name for node in imports if node.module == "obsdesign.lmi.formula" for alias in node.names}
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and called(node) in SITES - foreign:
            first = node.args[0] if node.args else None
            of_problems = isinstance(first, ast.Starred) or (
                isinstance(first, ast.Call) and called(first) in {"Problem", "located", "about"}
            )
            if not (called(node) in ERRORS and of_problems):
                yield node


def passes_on(node):
    """Whether an expression is the id of another problem, or of the caller."""
    if isinstance(node, ast.Attribute):
        return node.attr == "id"
    if isinstance(node, ast.Subscript):
        return isinstance(node.slice, ast.Constant) and node.slice.value == "id"
    return isinstance(node, ast.Name) and node.id == "id"


def unnamed(source):
    """Lines of the sites, and of the diagnoses, that name no id."""
    for node in sites(source):
        ids = [keyword.value for keyword in node.keywords if keyword.arg == "id"]
        named = [one for one in ids if isinstance(one, ast.Constant) and ID.fullmatch(one.value)]
        if len(ids) != 1 or not (named or passes_on(ids[0])):
            yield node.lineno
    for node in ast.walk(ast.parse(source)):
        keys = [key.value for key in node.keys if isinstance(key, ast.Constant)] if isinstance(node, ast.Dict) else ()
        if "condition" in keys and "id" not in keys:
            yield node.lineno


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_every_problem_finding_and_diagnosis_names_its_id(path):
    assert list(unnamed(path.read_text())) == []


@pytest.mark.parametrize(
    "source",
    [
        "raise UsageError('wrong')",
        "raise UsageError('wrong', id=said)",
        "raise UndecidedError('wrong', id='OBS')",
        "reader.wrong(loc, 'wrong')",
        "raise UsageError(Problem('wrong', key='observer.L2'))",
        "finding('decay', True, 'said')",
        "found = {'condition': 'decay'}",
    ],
)
def test_a_problem_without_an_id_is_found(source):
    assert list(unnamed(source)) == [1]


def test_a_problem_that_passes_an_id_on_is_none():
    source = "reader.wrong(loc, error.message, id=error.id)\nraise UsageError(*problems)\nProblem('x', id='OBS104')"
    assert list(unnamed(source)) == []


@pytest.mark.parametrize("error", [UsageError("wrong", id="OBS204"), ExpressionError("wrong", 3, id="OBS301")])
def test_an_error_keeps_its_problems_in_another_process(error):
    assert pickle.loads(pickle.dumps(error)).problems == error.problems


def test_a_message_that_would_forge_a_line_is_one_line():
    problem = Problem("what\x1b[31m is\nwrong", "a\nb.yaml", 1, 2, "key\u2028", id="OBS104")
    assert str(problem) == r"a\nb.yaml:1:2: key\u2028: what\x1b[31m is\nwrong [OBS104]"
