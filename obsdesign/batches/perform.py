"""One spec of a batch: solved, verified, simulated where that is asked, and held against what it expects."""

import os
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from obsdesign.batches.find import Task
from obsdesign.batches.form import ended_as
from obsdesign.batches.record import Options, Result, digest_at, entry_of, failure, sha256, written
from obsdesign.design import Design
from obsdesign.errors import EXIT, ObsdesignError, Problem
from obsdesign.families import FAMILIES
from obsdesign.families.outcome import Verdict
from obsdesign.files import csv
from obsdesign.reading import loads
from obsdesign.sections.changes import OPTION, opened
from obsdesign.sections.source import require_name, text_of
from obsdesign.simulate.recorded import place
from obsdesign.simulate.validity import require_kept
from obsdesign.spec import Spec
from obsdesign.work import solve, trial

NOT_PROVED = 4  # exit code of a claim that is not proved


def perform(task: Task, options: Options) -> Result:
    """What comes of a spec. An error that a person can act on is told in the entry; a defect is raised."""
    started = time.perf_counter()
    result = Result(entry_of(task, "invalid", 2, sha256=sha256(task)))
    try:
        spec = spec_of(task)
        if FAMILIES[spec.observer.type].proves:
            design = solve(spec, options.solver)
            result.files = {"gains": design.text()}
        else:
            design = trial(spec)
        result.entry |= told(design)
        tried(design, options, result)
    except ObsdesignError as error:
        result.entry |= ended_by(error, result.entry, task, solved="gains" in result.files)
    result.entry["time_s"] = round(time.perf_counter() - started, 4)
    return result


def ended_by(error: ObsdesignError, entry: Mapping[str, Any], task: Task, *, solved: bool) -> dict[str, Any]:
    """What an entry says of an error that ended its spec, which has a status of its own where it was solved."""
    status = {} if solved else {"status": failure(error)}
    problems = [*entry["problems"], *(written(placed(one, task)) for one in error.problems)]
    return {**status, "exit_code": error.exit_code, "as_expected": False, "problems": problems}


def placed(problem: Problem, task: Task) -> Problem:
    """Problem at the file of a task: one of a change has no place there, only its key."""
    elsewhere = problem.file and not problem.file.startswith(OPTION)
    return problem if elsewhere else replace(problem, file=task.path)


def spec_of(task: Task) -> Spec:
    """Spec of a task, changed as it says. Raises `UsageError`: it is not valid, or its path would forge lines."""
    require_name(task.path)
    return loads(text_of(task.path) if task.text is None else task.text, task.path, task.changes)


def told(design: Design) -> dict[str, Any]:
    """What an entry says of a design before it runs."""
    if design.status is Verdict.NO_GUARANTEE:  # there is nothing to solve, and no claim: it ends well where it runs
        return {"status": str(Verdict.UNCERTIFIED), "exit_code": 0}
    status, guarantee = str(design.status), design.result.get("guarantee", {})
    numbers = {k: v for k, v in guarantee.items() if isinstance(v, int | float) and not isinstance(v, bool)}
    problems = list(reasons(design))
    claims = status in ("certified", "refuted") or "certificate" in design.diagnosis
    proof = design.verify() if claims else None
    if proof and not proof.holds:
        failed = ", ".join(repr(check.name) for check in proof.checks if not check.holds)
        problems.append(Problem(f"the claim is not proved: {failed}", design.spec.path, id="OBS708"))
    return {
        "status": status,
        "exit_code": EXIT[status] if proof is None or proof.holds else NOT_PROVED,
        "verified": None if proof is None else proof.holds,
        "guarantee": numbers,
        "problems": [written(problem) for problem in problems],
    }


def reasons(design: Design) -> Iterator[Problem]:
    """Why there are no gains, or none that are certified."""
    if design.status is Verdict.UNCERTIFIED:
        said = "these gains are not certified: no proof of them was found"
        yield design.spec.located(Problem(said, key="observer.type", id="OBS616"))
    elif design.diagnosis:
        found = design.diagnosis
        yield design.spec.located(Problem(str(found["reason"]), key="observer.type", id=found["id"]))


def tried(design: Design, options: Options, result: Result) -> None:
    """Run a design where that is asked or expected, and hold everything against what the spec expects.

    Raises `UsageError`: it cannot be simulated; `ViolatedError`: the run breaks a bound that is proved of it.
    """
    spec, summary = design.spec, None
    run = design.simulate() if (options.simulate or expects_run(spec)) and design.built and spec.simulation else None
    if run:
        summary, result.read = run.summary, followed(spec)
    if run and options.simulate:
        result.files = {**result.files, "csv": csv(*run.table()), "png": run.plot()}
    expected = design.expected(summary or {})
    result.entry |= {"expected": expected, "as_expected": as_expected(result.entry, spec.expect, expected)}
    result.entry["problems"] += [written(problem) for problem in unmet(spec, expected)]
    if run:
        require_kept(run.summary, spec.path)


def followed(spec: Spec) -> dict[str, str | None]:
    """Hashes of the files of signals of a spec, by their paths from its folder."""
    columns = spec.simulation.recorded.values() if spec.simulation else ()
    return {one.file: digest_at(Path(os.path.realpath(place(spec, one)))) for one in columns}


def expects_run(spec: Spec) -> bool:
    """Whether a spec expects something of a run."""
    return any(key.startswith("simulation.") for key in spec.expect)


def as_expected(entry: Mapping[str, Any], expect: Mapping[str, Any], expected: list[dict[str, Any]]) -> bool:
    """Whether a spec ended as it says, or certified where it says nothing, and what it expects holds."""
    ended = ended_as(expect.get("status", "certified"), entry["status"], entry["exit_code"])
    return ended and all(one["holds"] for one in expected)


def unmet(spec: Spec, expected: list[dict[str, Any]]) -> Iterator[Problem]:
    """What was found otherwise than expected, with its place in the spec."""
    failed = [one for one in expected if not one["holds"]]
    document = opened(spec.text, spec.path, spec.changes) if failed else None
    for one in failed:
        assert document
        found = "nothing" if one["found"] is None else one["found"]
        yield document.problem(("expect", one["key"]), f"expected {one['expected']}, found {found}", id="OBS617")
