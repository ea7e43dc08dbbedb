"""A result that is there already: proved anew, with no solver, and held against what its spec expects.

Anyone may have written its record and its files, so nothing of them is told that is not found again here, but for
numbers of which nothing is proved: what was expected of these is told as recorded.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from obsdesign.batches.find import Task
from obsdesign.batches.form import Entry, is_number, parsed
from obsdesign.batches.perform import ended_by, expects_run, spec_of, told, tried
from obsdesign.batches.record import (
    ENDINGS,
    VOLATILE,
    Options,
    Result,
    differing,
    digest_of,
    entry_of,
    paths_of,
    read,
    sha256,
    to_bytes,
)
from obsdesign.design import Design, design_of
from obsdesign.errors import EXIT, ObsdesignError, UsageError
from obsdesign.expectation import PROVED, RUN, rests_on
from obsdesign.families import FAMILIES
from obsdesign.families.agreement import numerical
from obsdesign.families.outcome import Outcome, Verdict
from obsdesign.files import ResultFile
from obsdesign.spec import Spec
from obsdesign.work import require_expectable, trial

FAILURE = ("exit_code", "as_expected", "expected", "problems")  # parts that tell what failed, which is found again


def renewed(task: Task, out: Path) -> Entry | None:
    """Entry of the result of a spec, all that it claims proved anew; None where its record says otherwise."""
    record = read(out, task)
    if record is None:
        return None
    known = record["entry"]
    try:
        found = parsed(to_bytes(anew(task, record, out)))
    except (ObsdesignError, ValueError):  # files that were altered
        return None
    if found is None:
        return None
    failed = () if known["as_expected"] else FAILURE
    left_out = {**VOLATILE, **dict.fromkeys(failed)}
    if (failed and found["as_expected"]) or differing({**known, **left_out}, {**found, **left_out}):
        return None
    return {**known, **{part: found[part] for part in failed}, "recorded": found["recorded"], "up_to_date": True}


def anew(task: Task, record: Mapping[str, Any], out: Path) -> Entry | None:
    """What a result file proves and gives, as an entry; without one, what its spec gives that is not solved.

    None: it is to be solved. Raises `ObsdesignError`: the file is none of this spec.
    """
    files = {kind: str(Path(task.place, f"{task.name}{ENDINGS[kind]}")) for kind in ENDINGS}
    result = Result(entry_of(task, "invalid", 2, sha256=sha256(task)))
    result.entry["files"] = {kind: path for kind, path in files.items() if kind in record["hashes"]}
    try:
        spec = spec_of(task)
        require_expectable(spec)
    except UsageError as error:
        return result.entry | ended_by(error, result.entry, task, solved=False)
    if "gains" in record["hashes"]:
        design = recorded(spec, paths_of(task, out / task.place)["gains"], record["hashes"]["gains"])
    elif FAMILIES[spec.observer.type].proves:
        return undecided(record["entry"])
    else:
        design = trial(spec)
    result.entry |= told(design)
    tried(design, Options(), result)
    return result.entry | {"recorded": unproved(design, result.entry)}


def undecided(known: Entry) -> Entry | None:
    """Entry of a spec that the solver did not decide, which only another solve could: all of it is as recorded.

    None: it says another thing, which without a result file nothing shows.
    """
    if known["status"] != Verdict.UNCERTIFIED or known["as_expected"]:
        return None
    return {**known, "exit_code": EXIT[Verdict.UNCERTIFIED], "recorded": ["status"]}


def unproved(design: Design, entry: Entry) -> list[str]:
    """Dotted names of what was expected and held against an entry of the result file which nothing finds again.

    `status` is always expected; what is expected of a run is found again. Numbers that are proved of gains are not what
    a design would find: of other gains, or a weaker claim of these, other numbers are proved as well.
    """
    if design.recorded is None:
        return []
    proved = entry["verified"] is True
    computed = numerical(design.result, design.spec) if proved else []
    found = {one["key"]: one["found"] for one in entry["expected"] if not one["key"].startswith(f"{RUN}.")}
    return [
        name
        for name, value in {"status": "", **found}.items()
        if is_number(value) or rests_on(name, design.result, proved, computed) != PROVED
    ]


def recorded(spec: Spec, path: Path, digest: str) -> Design:
    """Design of a result file, with gains only where the spec expects something of a run.

    Raises `UsageError`: it is no result of this spec, with these changes, or not the one with this hash.
    """
    file = ResultFile.open(str(path))
    if digest_of(file.raw) != digest or file.changes() != spec.changes:
        raise file.wrong("spec", "is another file, or of other changes", id="OBS704")
    for part in {"guarantee", "diagnosis"} & file.content.keys():
        file.table(part)
    status = Verdict(file.status)
    if expects_run(spec) and status is not Verdict.INFEASIBLE:
        return design_of(file, spec)
    return Design.of(spec, Outcome(status, diagnosis=file.plain().get("diagnosis", {})), recorded=file)
