"""A summary for other programs: JUnit XML, annotations of GitHub, SARIF 2.1.0; texts of a spec are escaped for each.

Sources: testmoapp/junitxml (the common form of JUnit XML); GitHub, workflow commands, `error`; OASIS, Static Analysis
Results Interchange Format 2.1.0.
"""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path, PurePath
from typing import Any
from urllib.parse import quote
from xml.etree.ElementTree import Element, SubElement, tostring

from obsdesign import __version__
from obsdesign.batches.form import Entry
from obsdesign.batches.record import LIMITS
from obsdesign.batches.summary import INTERRUPTED, Summary
from obsdesign.batches.table import changed, label, remark, sentence, shown
from obsdesign.errors import unheeded

NO_ANSWER = ("invalid", "crashed", *LIMITS)  # statuses that are errors, not failures, of a test
NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"


def junit(summary: Summary) -> Iterator[str]:
    """JUnit XML: a test case a spec; an error is one that has no answer, a failure another answer than is expected."""
    kinds = [outcome(entry) for entry in summary.specs]
    counts = {kind: str(kinds.count(one)) for kind, one in OUTCOMES.items()} | {"tests": str(len(kinds))}
    told = {"name": "obsdesign", **counts, "time": f"{summary.time_s:.3f}"}
    head = tostring(Element("testsuites", told), encoding="unicode").removesuffix(" />")
    suite = tostring(Element("testsuite", told), encoding="unicode").removesuffix(" />")
    yield f'<?xml version="1.0" encoding="UTF-8"?>\n{head}>\n{suite}>\n'
    for entry, kind in zip(summary.specs, kinds, strict=True):
        path = PurePath(in_xml(entry["path"]))
        name = path.name + in_xml(changed(entry))
        told = {"classname": str(path.parent), "name": name, "file": str(path), "time": f"{entry['time_s']:.3f}"}
        case = Element("testcase", told)
        if kind:
            said = "\n".join(in_xml(sentence(problem)) for problem in entry["problems"]) or in_xml(entry["why"] or "")
            first = said.partition("\n")[0]
            kinds_of = [label(entry, problem) for problem in entry["problems"]] or [entry["status"]]
            SubElement(case, kind, {"type": kinds_of[0], "message": first}).text = said
        if entry["recorded"]:
            SubElement(case, "system-out").text = in_xml(remark(entry))
        yield tostring(case, encoding="unicode") + "\n"
    yield "</testsuite>\n</testsuites>\n"


OUTCOMES = {"failures": "failure", "errors": "error", "skipped": "skipped"}  # of JUnit, with their elements


def outcome(entry: Entry) -> str:
    """Element of a test case that is not passed; empty for one that is."""
    if entry["as_expected"] is None:
        return "skipped"
    if entry["as_expected"]:
        return ""
    return "error" if entry["status"] in NO_ANSWER else "failure"


def in_xml(text: str) -> str:
    """Line without characters that no XML may hold, and that no runner obeys in whose log its reader prints it."""
    return NOT_XML.sub("\ufffd", unheeded(shown(text)))


def github(summary: Summary) -> Iterator[str]:
    """Workflow commands that GitHub shows at the file, line and column of each problem; notices of what is recorded."""
    for entry, problem in unexpected(summary):
        place = {"file": problem.get("file", entry["path"]), "line": problem.get("line"), "col": problem.get("column")}
        title = f"obsdesign {label(entry, problem)} {problem['id']}"
        properties = {**place, "title": title}
        told = ",".join(f"{key}={in_property(str(value))}" for key, value in properties.items() if value)
        said = ": ".join(part for part in (problem.get("key"), problem["message"]) if part)
        yield f"::error {told}::{in_message(said + changed(entry))}\n"
    for entry in believed(summary):
        told = f"file={in_property(entry['path'])},title=obsdesign as recorded"
        yield f"::notice {told}::{in_message(remark(entry) + changed(entry))}\n"


def unexpected(summary: Summary) -> Iterator[tuple[Entry, dict[str, Any]]]:
    """Every problem of every spec that is not as expected."""
    for entry in summary.specs:
        if entry["as_expected"] is False:
            yield from ((entry, problem) for problem in entry["problems"])


def believed(summary: Summary) -> Iterator[Entry]:
    """Every spec of which an expectation is held against what is recorded, not found again."""
    return (entry for entry in summary.specs if entry["recorded"])


def in_message(text: str) -> str:
    """Text as the message of a workflow command."""
    return shown(text).replace("%", "%25")


def in_property(text: str) -> str:
    """Text as a value of a property of a workflow command."""
    return in_message(text).replace(":", "%3A").replace(",", "%2C")


def sarif(summary: Summary) -> Iterator[str]:
    """SARIF 2.1.0: a result for each problem of a spec that is not as expected, at its place.

    What is held against a record, and not found again, is a notification of the run: it is no alert.
    """
    results: list[dict[str, Any]] = []
    for entry, problem in unexpected(summary):
        said = ": ".join(part for part in (problem.get("key"), problem["message"]) if part)
        where: dict[str, Any] = {"artifactLocation": {"uri": uri(str(problem.get("file", entry["path"])))}}
        if "line" in problem:
            names = {"line": "startLine", "column": "startColumn"}
            where["region"] = {name: problem[key] for key, name in names.items() if key in problem}
        rule, place = problem["id"], {"physicalLocation": where}
        results.append(
            {"ruleId": rule, "level": "error", "message": {"text": shown(said + changed(entry))}, "locations": [place]}
        )
    rules = [{"id": rule} for rule in sorted({result["ruleId"] for result in results})]
    driver = {"name": "obsdesign", "version": __version__, "rules": rules}
    told = [
        {
            "level": "note",
            "message": {"text": remark(entry) + shown(changed(entry))},
            "locations": [{"physicalLocation": {"artifactLocation": {"uri": uri(entry["path"])}}}],
        }
        for entry in believed(summary)
    ]
    invocation = {"executionSuccessful": summary.exit_code != INTERRUPTED, "toolExecutionNotifications": told}
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "results": results,
        **({"invocations": [invocation]} if told else {}),
    }
    yield json.dumps({"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}, indent=1, ensure_ascii=False) + "\n"


def uri(path: str) -> str:
    """Path as a reference to a file."""
    return Path(path).as_uri() if PurePath(path).is_absolute() else quote(path)


def whole(summary: Summary) -> Iterator[str]:
    """`summary.json` itself."""
    with Path(summary.path).open(encoding="utf-8") as lines:
        yield from lines


FORMATS: dict[str, Callable[[Summary], Iterator[str]]] = {
    "junit": junit,
    "github": github,
    "sarif": sarif,
    "json": whole,
}
