"""The verbs of obsdesign, once, for the Python API and for the command line: from a spec to a design, a file, a run."""

import os
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign.advice import advised, within_bounds
from obsdesign.constants import constants
from obsdesign.design import Design, Solver, design_of, proof_of
from obsdesign.dissipation.engine import Engine, Report
from obsdesign.elsewhere import designed
from obsdesign.errors import InfeasibleError, Problem, UndecidedError, UsageError
from obsdesign.expectation import strays
from obsdesign.families import FAMILIES, hinted, rescaled
from obsdesign.families.finding import Finding, finding
from obsdesign.families.outcome import Outcome, Proof, Verdict
from obsdesign.files import ResultFile
from obsdesign.reading import load, loads
from obsdesign.sections.changes import require_distinct
from obsdesign.sections.scalars import described
from obsdesign.spec import Spec

if TYPE_CHECKING:
    from obsdesign.simulate.comparison import Comparison

__all__ = ["check", "compare", "lipschitz", "load", "read", "solve", "verify"]


def require_spec(spec: object) -> None:
    """Refuse what is no spec, such as its path; raises `UsageError` with what to write instead."""
    if not isinstance(spec, Spec):
        raise UsageError(f"a spec is expected, not {type(spec).__name__}; load(path or text) reads one", id="OBS904")


def require_expectable(spec: Spec) -> None:
    """Refuse a spec that expects an entry of its result which none of its family has; raises `UsageError`."""
    if wrong := tuple(strays(spec)):
        raise UsageError(*wrong)


def solve(spec: Spec, solver: str = "clarabel", report: Report = lambda *_: None) -> Design:
    """Design, or analyse, the observer that a spec asks for, and prove what its gains achieve.

    `solver`: clarabel, or another that cvxpy has for semidefinite programs; `report`: called with the fraction that is
    done, and with what is being done. Infeasible is an answer, with a `diagnosis`, and no exception.

    Raises `UsageError`: what is asked makes no sense for the family, nothing bounds a gain that would grow without end,
    or an entry is expected that no result of the family has; `UndecidedError`: the solver found neither a solution nor
    that there is none.
    """
    require_spec(spec)
    require_expectable(spec)
    started = time.perf_counter()
    engine = Engine(solver, report)
    with spec.placed():
        try:
            outcome = designed(spec, engine, FAMILIES[spec.observer.type].design)
            if outcome.status is Verdict.INFEASIBLE:
                outcome = advised(spec, outcome, engine)
        except UndecidedError as error:
            raise within_bounds(spec, error, engine) from None
        except (OverflowError, ZeroDivisionError, np.linalg.LinAlgError) as error:
            raise UndecidedError(f"the numbers are beyond what doubles can compute: {error}", id="OBS508") from None
    return Design.of(spec, outcome, solver=Solver(solver, engine.solves, time.perf_counter() - started, engine.method))


def check(spec: Spec) -> list[Finding]:
    """What the structure of a spec rules out, and what it allows, before any design; each with a sentence.

    Raises `UsageError`: the spec expects an entry of its result that none of its family has.
    """
    require_spec(spec)
    require_expectable(spec)
    with spec.placed():
        idle = [finding("acts", False, said, advice="use it or leave it out", id="OBS615") for said in spec.idle]
        return [*FAMILIES[spec.observer.type].check(spec, Engine()), *hinted(spec), *idle]


def lipschitz(spec: Spec, *, scaling: bool = False, T: Sequence[float | str] | None = None) -> Mapping[str, Any]:
    """Lipschitz constant of every f of a spec on its region, between two proved bounds; see `constants.constants`.

    `scaling`: whether to search coordinates T x in which the constant is small, f taken as any function of the states;
    `T`: diagonal of a T to try instead. Returns `name`, `blocks`, and `scaling` where it was asked for and every
    constant has an upper bound. Raises `UsageError`: no nonlinearity has an f, or T does not fit.
    """
    require_spec(spec)
    with spec.placed():
        report = constants(spec)
        if (scaling or T) and not any("reason" in block for block in report["blocks"]):
            report["scaling"] = rescaled(spec, Engine(), None if T is None else [str(entry) for entry in T])
        return report


def compare(
    sources: Sequence[Design | Spec | str | os.PathLike[str]],
    seeds: int = 10,
    solver: str = "clarabel",
    report: Report = lambda *_: None,
) -> "Comparison":
    """Run several observers on one plant, with one input and the noise of so many seeds; of any families.

    `sources`: designs, specs, which are solved first, or paths of spec and result files. Returns a comparison: `report`
    (as `--json`), `plot(path)`, and a table as its text. Raises `UsageError`: their plants, or what acts on them,
    differ; there are no gains; `InfeasibleError`: a spec has no solution.
    """
    from obsdesign.simulate.comparison import compare as compared

    if not sources:
        raise UsageError("nothing to compare; give at least one design, spec or path", id="OBS904")
    return compared([trial(source, "", solver, report) for source in sources], seeds, report)


def trial(
    source: Design | Spec | str | os.PathLike[str],
    gains: str = "",
    solver: str = "clarabel",
    report: Report = lambda *_: None,
    changes: Sequence[str] = (),
    *,
    labelled: bool = False,
) -> Design:
    """Design that is to be simulated: of a result file, or of a spec, with the gains of a file or solved first.

    `changes`: of single keys of the spec, as `load` takes them; beside a result file, of keys of `simulation:` only.
    `labelled`: whether the gains may be those of another spec; nothing is proved of them on another plant. Raises
    `UsageError`: gains go with a spec, and do not fit it; `InfeasibleError`: there are none.
    """
    if labelled and not gains:
        raise UsageError("--labelled goes with --gains GAINS.json and the spec of another plant", id="OBS904")
    if isinstance(source, Design):
        return source
    path = "" if isinstance(source, Spec) else os.fspath(source)
    if path.endswith(".json"):
        if gains:
            raise UsageError(Problem("already a gains file; --gains goes with a spec", path, id="OBS904"))
        return otherwise(read(path), changes)
    problem = source if isinstance(source, Spec) else load(source, () if gains and not labelled else changes)
    if labelled:
        return on_plant_of(read(gains), problem)
    if gains:
        return otherwise(of_spec(gains, problem), changes)
    if not FAMILIES[problem.observer.type].proves:
        require_expectable(problem)
        return Design.of(problem, Outcome(Verdict.NO_GUARANTEE, form=problem.observer))
    design = solve(problem, solver, report)
    if not design.built:
        raise InfeasibleError(
            Problem(f"no gains to simulate: {design.diagnosis.get('reason', design.status)}", problem.path, id="OBS709")
        )
    return design


def of_spec(gains: str, spec: Spec) -> Design:
    """Design of the gains of a spec; raises `UsageError`, of those of another one with the option that takes them."""
    try:
        return read(gains, spec)
    except UsageError as error:
        if error.problems[0].id != "OBS704":
            raise
        said = "`simulate --labelled` runs them with this plant, with no guarantee where it is another"
        raise UsageError(*(replace(one, message=f"{one.message}; {said}") for one in error.problems)) from None


def on_plant_of(design: Design, other: Spec) -> Design:
    """Design that is run with the plant of another spec; with what is proved of it, if that is its own.

    Raises `UsageError`: the gains do not fit that plant.
    """
    from obsdesign.simulate.drawing import require_fitting, same_plant

    own = design.spec
    require_fitting(own, other, design.path)
    if not same_plant(own, other):
        return replace(design, elsewhere=other)
    tried = replace(own, simulation=other.simulation or own.simulation, data=other.data)
    there = {name: getattr(other, name) for name in ("text", "path", "changes", "origin")}
    return replace(design, spec=replace(tried, **there))


def otherwise(design: Design, changes: Sequence[str]) -> Design:
    """Design with another run or log; raises `UsageError` if a change is not of a key of `simulation:` or `data:`."""
    for change in changes:
        if not re.match(r"\s*(simulation|data)[.=]", change):
            said = "these gains belong to their spec as it is; beside a result only keys of simulation: and data: can"
            said += " be set"
            raise UsageError(Problem(said, f"--set {described(change)}", id="OBS904"))
    if not changes:
        return design
    require_distinct(changes)
    spec = design.spec
    changed = loads(spec.text, spec.path, (*spec.changes, *changes))
    tried = replace(spec, simulation=changed.simulation, data=changed.data, changes=changed.changes)
    return replace(design, spec=tried)


def read(path: str | os.PathLike[str], spec: Spec | None = None) -> Design:
    """Design of a result file, its claim proved anew.

    `spec`: the spec that it must belong to; without one, the spec in the file is believed. Raises `UsageError`: the
    file is malformed, has no gains, or belongs to another spec.
    """
    return design_of(*opened(path, spec))


def verify(path: str | os.PathLike[str] | ResultFile, spec: Spec | None = None) -> Proof:
    """Prove the claim of a result file anew: its guarantee, or that there is no solution; with no solver.

    Raises `UsageError`: the file claims nothing that can be proved, is malformed, or belongs to another spec.
    """
    return proof_of(*opened(path, spec))


def theorem(path: str | os.PathLike[str] | ResultFile, spec: Spec | None = None) -> str:
    """Guarantee of a result file as a file of Coq: its numbers, the theorem for its f or its class, and the proof.

    The kernel of Coq accepts it with the library that `obsdesign theorem --library DIR` writes; see `explain theorem`.
    Raises `UsageError`: the file is malformed or belongs to another spec, or its claim is one that is not exported;
    `UndecidedError`: its claim is not proved.
    """
    return design_of(*opened(path, spec)).theorem()


def opened(path: str | os.PathLike[str] | ResultFile, spec: Spec | None) -> tuple[ResultFile, Spec | None]:
    """Result file, and the spec that it must belong to, if there is one."""
    if spec is not None:
        require_spec(spec)
    return path if isinstance(path, ResultFile) else ResultFile.open(os.fspath(path)), spec
