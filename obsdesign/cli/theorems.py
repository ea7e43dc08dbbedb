"""What `verify --theorem` writes: the theorem of a claim, and, where it is compiled, what the kernel says of it."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from obsdesign.cli.printing import say
from obsdesign.cli.steps import stem
from obsdesign.coq.kernel import Judgement, judged, version
from obsdesign.coq.library import command
from obsdesign.coq.theorem import stated, subject
from obsdesign.disk import LARGEST, content_of, require_ending, require_writable, write_whole
from obsdesign.errors import Problem, UndecidedError, UsageError
from obsdesign.files import ResultFile, digest
from obsdesign.files.amended import amended


@dataclass(frozen=True)
class Export:
    """Where theorems are written, and whether they are compiled; nothing without an assistant."""

    assistant: str
    output: str
    compiled: bool

    def require(self, files: Sequence[str], *, as_json: bool) -> None:
        """Refuse an assistant that is not known, and a path of several theorems, or of none, or of two outputs."""
        if self.assistant not in {"", "coq"}:
            raise UsageError(f"--theorem {self.assistant}: no file is written for it; allowed: coq", id="OBS904")
        if self.compiled and not self.assistant:
            raise UsageError("--compile is for a theorem; write --theorem coq --compile", id="OBS904")
        if self.output and (not self.assistant or len(files) > 1):
            said = "is for --theorem coq of one result file; leave -o out, and each is written to NAME.theorem.v here"
            raise UsageError(f"-o {self.output} {said}", id="OBS904")
        if self.output == "-" and as_json:
            raise UsageError("-o - and --json cannot both be on standard output; name a file", id="OBS904")
        names = [stem(file) for file in files]
        if self.assistant and (twice := next((name for name in names if names.count(name) > 1), None)):
            said = f"{twice}.theorem.v would be written of several files; verify them one by one, each with -o"
            raise UsageError(said, id="OBS904")

    def target(self, gains: str) -> tuple[str, str] | None:
        """Path of the theorem of a result file, and what is said of it; None where none is asked for."""
        if not self.assistant:
            return None
        if self.compiled:
            version()
        path = self.output or f"{stem(gains)}.theorem.v"
        require_ending(path, "theorems")
        return path, require_writable({path: "theorems"}, (gains,))[path]


@dataclass(frozen=True)
class Exported:
    """A theorem that is written, and what the kernel says of it; None where it was not asked."""

    text: str
    path: str
    told: str  # its path, and whether it was replaced
    judgement: Judgement | None
    note: str = ""  # on the record in the result

    def lines(self) -> list[str]:
        """What is said of it on a terminal."""
        return [*self.said(), *([self.note] if self.note else [])]

    def said(self) -> list[str]:
        """The same without the note."""
        made, about = self.judgement, subject(self.text).words()
        if made is None:
            compile_it = f"to compile it: obsdesign theorem --library library; {command('library', self.path)}"
            return [f"theorem for Coq {about[0]}, not compiled  {self.told}", *about[1:], compile_it]
        if not made.accepted:
            return [f"theorem for Coq, REFUSED  {self.told}"]
        names = ", ".join(sorted(axiom.rpartition(".")[2] for axiom in made.axioms)) or "none"
        said = f"theorem for Coq {about[0]}, accepted by its kernel  {self.told}"
        return [said, *about[1:], f"by Coq {made.coq} in {made.seconds:.1f} s, on the axioms {names}"]

    def report(self) -> dict[str, Any]:
        """The same in JSON."""
        made = self.judgement
        words = "; ".join(subject(self.text).words())
        found = {"file": self.path, "sha256": digest(self.text), "statement": stated(self.text), "about": words}
        if made is None:
            return {**found, "accepted": None, "time_s": None}
        axioms = {"coq": made.coq, "axioms": sorted(made.axioms)}
        return {**found, "accepted": made.accepted, "time_s": round(made.seconds, 3), **axioms}

    @property
    def failure(self) -> UndecidedError | None:
        """That the kernel refuses it."""
        made = self.judgement
        if made is None or made.accepted:
            return None
        said = f"coqc {made.coq} refuses {made.refused}: {made.why[:300]}"
        return UndecidedError(Problem(said, self.path, id="OBS713"))


def exported(file: ResultFile, text: str, path: str, told: str, *, compiled: bool) -> Exported:
    """Write a theorem, and compile it where that is asked for."""
    if path == "-":
        say(text.rstrip())
    else:
        write_whole(path, text.encode())
    if not compiled:
        return Exported(text, path, told, None, outdated(file, text))
    judgement = judged(text)
    return Exported(text, path, told, judgement, recorded(file, text, judgement))


def outdated(file: ResultFile, text: str) -> str:
    """That the record in a result is of another theorem; empty if it is not."""
    record = file.content.get("theorem")
    if record is None or record["sha256"] == digest(text):
        return ""
    return "the result holds a record of another text of its theorem; --compile makes a new one"


def recorded(file: ResultFile, text: str, judgement: Judgement) -> str:
    """Record in a result that its theorem was accepted, or take such a record out; why not, where that cannot be."""
    if not (judgement.accepted or "theorem" in file.content):
        return ""
    record = {
        "name": subject(text).theorem,
        "sha256": digest(text),
        "coq": judgement.coq,
        "accepted": f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}",
    }
    try:
        if content_of(file.path, LARGEST) != file.raw:
            return "not recorded: the result was changed meanwhile"
        mode = os.stat(file.path).st_mode
        write_whole(file.path, amended(file, "theorem", record if judgement.accepted else None))
        os.chmod(file.path, mode)
    except (OSError, UsageError):
        return "not recorded: the result is no file that may be written"
    return ""
