"""The theorem of a claim, written, and, where it is compiled, what the kernel says of it and the record of that."""

import os
from datetime import UTC, datetime
from typing import Any

from obsdesign.cli.printing import say
from obsdesign.coq.kernel import Judgement, judged
from obsdesign.coq.library import command
from obsdesign.coq.theorem import stated, subject
from obsdesign.disk import LARGEST, content_of, write_whole
from obsdesign.errors import Problem, UndecidedError, UsageError
from obsdesign.files import ResultFile, digest
from obsdesign.files.amended import amended
from obsdesign.records import dataclass


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
    if file.path == "-" or not (judgement.accepted or "theorem" in file.content):
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
