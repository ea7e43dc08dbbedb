"""What `verify --theorem` is asked for: an assistant, a path, and whether the theorem is compiled."""

from collections.abc import Sequence

from obsdesign.cli.steps import stem
from obsdesign.disk import require_ending, require_writable
from obsdesign.errors import UsageError
from obsdesign.records import dataclass


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
            from obsdesign.coq.kernel import version

            version()
        path = self.output or f"{stem(gains)}.theorem.v"
        require_ending(path, "theorems")
        return path, require_writable({path: "theorems"}, (gains,))[path]
