"""The glossary: every name that a result file, a summary or a table may hold has an entry, with unit and place."""

import ast
import re
from pathlib import Path

import pytest
from support.commands import run

import obsdesign
from obsdesign.batches.form import STATUSES
from obsdesign.expectation import FILE, LIMIT, SUMMARY
from obsdesign.families import FAMILIES
from obsdesign.families.outcome import Verdict
from obsdesign.guide import GLOSSARY, page, words
from obsdesign.tables.comparison import HEADER

ENTRY = re.compile(r"## [^\n]+\n\n\S.*?\n\n- unit: \S[^\n]*\n- in the file: \S[^\n]*", re.DOTALL)
NO_ROWS = {"", "-.inf", "-> 0", "Bf f(q)", "identity", "least", "refused", "plant"}  # pairs that are no row of a result


def results():
    """Names that a result file or a summary may hold."""
    for family in FAMILIES.values():
        for names in family.results.values():
            yield from names
    yield from (*FILE, *LIMIT, *SUMMARY, *STATUSES, *map(str, Verdict), *HEADER)
    yield from (name for names in FILE.values() for name in names)


def rows():
    """Names of the rows of tables: first of two in a pair."""
    package = Path(obsdesign.__file__).parent
    for path in (*package.glob("tables/*.py"), *package.glob("families/*/table.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Tuple) and len(node.elts) == 2 and isinstance(node.elts[0], ast.Constant):
                yield node.elts[0].value


@pytest.mark.parametrize("name", sorted({*results(), *(r for r in rows() if isinstance(r, str))} - NO_ROWS))
def test_every_name_of_a_result_is_explained(name):
    outcome = run("explain", name)
    assert (outcome.exit_code, outcome.stderr) == (0, "")
    assert outcome.stdout.startswith("#")
    assert ENTRY.search(outcome.stdout) or name in {"spec", "obsdesign"}


@pytest.mark.parametrize("name", ["kappa", "lambda", "lambda1", "lambda2", "r", "mu"])
def test_every_number_that_verify_checks_is_explained(name):
    assert ENTRY.search(run("explain", name).stdout)


def test_names_of_rows_were_found():
    assert {"gamma", "noise gain", "settling", "contraction", "tolerated", "declared"} <= {*rows()}


def test_an_entry_has_unit_and_place_and_no_name_stands_twice():
    entries = re.split(r"^(?=## )", page(GLOSSARY), flags=re.MULTILINE)[1:]
    assert [entry[:40] for entry in entries if not ENTRY.fullmatch(entry.strip())] == []
    assert sum(entry.partition("\n")[0].count(", ") + 1 for entry in entries) == len(words())


@pytest.mark.parametrize(
    ("asked", "title", "said"),
    [
        (["noise", "gain"], "noise gain", "max over omega of |G(j omega)|"),
        (["settling time"], "settling time", "- unit: s\n"),
        (["Settling"], "settling, 5 %", "above 5 % (1 %) of |error(0)|"),
        (["guarantee.limit.gamma"], "limit", "guarantee.limit"),
        (["observer.largest_step"], "largest step", "- unit: s\n"),
        (["simulation.settling_time"], "settling time", "1 % of its largest"),
        (["V"], "certificate", "storage function"),
        (["v"], "signals", "what drives the model of w"),
        (["horizon"], "simulation.horizon", "length of the run"),
        (["alpha"], "decay rate", "As a key of a spec: obsdesign explain observer.alpha, observer."),
        (["disturbance"], "disturbance", "how w is generated from v"),
    ],
)
def test_a_word_is_explained_however_it_is_written(asked, title, said):
    outcome = run("explain", *asked)
    assert outcome.exit_code == 0
    assert outcome.stdout.startswith(f"## {title}")
    assert said in outcome.stdout


@pytest.mark.parametrize(
    ("word", "meant"), [("overshot", "overshoot"), ("noise gian", "noise gain"), ("uncertfied", "uncertified")]
)
def test_the_nearest_word_is_told_on_a_miss(word, meant):
    outcome = run("explain", word)
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert f"there is no page of it; did you mean {meant}? allowed: " in outcome.stderr
    assert outcome.stderr.count("\n") == 1
