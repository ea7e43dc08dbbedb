"""What the kernel of Coq says of a theorem: accepted, on which axioms, or refused, and which statement.

The library is compiled once for each version of it and of Coq, and kept in the cache of the user.
"""

import hashlib
import os
import re
import resource
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from obsdesign.coq.library import PROJECT, QUIET, library
from obsdesign.errors import Problem, UndecidedError, UsageError
from obsdesign.records import dataclass

AXIOMS = {  # of the real numbers of Coq's library
    "ClassicalDedekindReals.sig_not_dec",
    "ClassicalDedekindReals.sig_forall_dec",
    "FunctionalExtensionality.functional_extensionality_dep",
    "Classical_Prop.classic",
}
MEMORY = 12  # GiB of address space that coqc may take
INSTALL = "apt-get install coq libcoq-coquelicot"
NAME = "Theorem.v"
NONE, SOME = "Closed under the global context", "Axioms:"  # first lines of what `Print Assumptions` says
STATEMENT = re.compile(r"^(?:Lemma|Theorem|Definition) (\w+)", re.MULTILINE)
STALE = re.compile("compiled library|magic number|inconsistent assumptions", re.IGNORECASE)
DIGESTS = "compiled.sha256"  # of what coqc made of the library, beside it
PLACE = re.compile(r'^File "[^"]*", line (\d+), characters [^:]*:\s*Error', re.MULTILINE)


@dataclass(frozen=True)
class Judgement:
    """How a compilation ended."""

    accepted: bool
    coq: str  # its version
    seconds: float
    axioms: frozenset[str] = frozenset()
    refused: str = ""  # name of the statement that it refuses
    why: str = ""  # what coqc says, in one line


class Call(NamedTuple):
    """How a call of coqc ended, and what it printed."""

    code: int
    output: str
    errors: str


def version() -> str:
    """Version of coqc; raises `UsageError`: it is not installed, or does not tell it."""
    if shutil.which("coqc") is None:
        raise UsageError(f"--compile: coqc is not installed; {INSTALL}", id="OBS712")
    known = re.match(r"[0-9][0-9.]{0,19}", run(".", "--print-version").output)
    if known is None:
        raise UsageError(f"--compile: coqc does not tell its version; {INSTALL}", id="OBS712")
    return known[0]


def judged(text: str) -> Judgement:
    """Compile a theorem, and see what its proof rests on.

    Where coqc finds fault with the compiled library, as after an update of Coquelicot, that is compiled anew.

    Raises `UsageError`: coqc is not installed, or lacks Coquelicot. Raises `UndecidedError`: it was ended from outside.
    """
    coq = version()
    kept = compiled_library(coq)
    made = attempt(text, kept, coq)
    if made.accepted or not STALE.search(made.why):
        return made
    shutil.rmtree(kept, ignore_errors=True)
    return attempt(text, compiled_library(coq), coq)


def attempt(text: str, compiled: Path, coq: str) -> Judgement:
    """Compile a theorem with a library."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, NAME).write_text(text)
        start = time.monotonic()
        found = run(folder, *QUIET.split(), "-Q", str(compiled), "Obs", NAME)
        seconds = time.monotonic() - start
        made = Path(folder, NAME).with_suffix(".vo").is_file()
    if found.code or not made:
        why = " ".join(found.errors[found.errors.find("Error") :].split()) or "it says nothing"
        return Judgement(False, coq, seconds, refused=refused(text, found.errors), why=why)
    axioms, others = assumed(found.output, text.count("\nPrint Assumptions "))
    why = "is none of the axioms of the real numbers"
    return Judgement(not others, coq, seconds, axioms, others, why if others else "")


def assumed(printed: str, count: int) -> tuple[frozenset[str], str]:
    """Axioms that so many `Print Assumptions` list; and the first thing they say that is no known axiom, or "".

    The name of an axiom begins a line, and its type goes on in indented ones.
    """
    lines = [line for line in printed.splitlines() if line and not line.startswith(" ")]
    names = [line.split(" :")[0] for line in lines if line not in {NONE, SOME}]
    others = [name for name in names if name not in AXIOMS]
    told = sum(line in {NONE, SOME} for line in lines)
    if not others and (told != count or not count):
        others = [f"what is printed of {count} statements"]
    return frozenset(names), others[0] if others else ""


def refused(text: str, said: str) -> str:
    """Name of the statement in which an error of coqc is."""
    place = PLACE.search(said)
    before = "\n".join(text.splitlines()[: int(place[1])]) if place else ""
    return next((found[1] for found in reversed([*STATEMENT.finditer(before)])), "the file")


def compiled_library(coq: str) -> Path:
    """Folder with the library, compiled; made if it is not in the cache, whole or not at all.

    Raises `UsageError`: coqc does not take it, or it cannot be kept.
    """
    files = library()
    names = list(modules(files[PROJECT].decode()))
    key = hashlib.sha256(b"\0".join([coq.encode(), *files.values()])).hexdigest()[:16]
    kept = cache() / f"coq-{key}"
    with suppress(OSError):
        if (kept / DIGESTS).read_text() == digests(kept, names):
            return kept
    try:
        kept.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=kept.parent) as folder:
            made = Path(folder, "library")
            made.mkdir()
            for name, content in files.items():
                (made / name).write_bytes(content)
            for name in names:
                found = run(str(made), *QUIET.split(), "-Q", ".", "Obs", name)
                if found.code or not (made / name).with_suffix(".vo").is_file():
                    said = " ".join(found.errors.split())[-300:] or "it says nothing"
                    raise UsageError(f"--compile: coqc {coq} does not take the library: {said}; {INSTALL}", id="OBS712")
            (made / DIGESTS).write_text(digests(made, names))
            if kept.exists():  # damaged, or by another process
                shutil.rmtree(kept) if kept.is_dir() else kept.unlink()
            made.rename(kept)
    except OSError as error:
        raise UsageError(Problem(f"cannot be written: {error.strerror}", str(kept), id="OBS902")) from None
    return kept


def digests(folder: Path, names: Sequence[str]) -> str:
    """Lines of SHA-256 and name of the compiled files; raises `OSError`: one is missing."""
    compiled = [(folder / name).with_suffix(".vo") for name in names]
    return "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in compiled)


def cache() -> Path:
    """Folder of the user for what can be made again; a relative one of the environment counts as none."""
    given = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return Path(given if given.is_absolute() else Path.home() / ".cache", "obsdesign")


def modules(project: str) -> Iterator[str]:
    """Files in the order in which they need each other."""
    return (line for line in project.splitlines() if line.endswith(".v"))


def run(folder: str, *arguments: str) -> Call:
    """One call of coqc, without the settings of the user; it ends with all that it has started.

    Raises `UndecidedError`: a signal ended it, as where it lacks memory.
    """
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    most = MEMORY << 30 if hard == resource.RLIM_INFINITY else min(MEMORY << 30, hard)
    with subprocess.Popen(
        ["coqc", "-q", *arguments],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        start_new_session=True,
    ) as process:
        try:
            with suppress(ProcessLookupError):
                resource.prlimit(process.pid, resource.RLIMIT_AS, (most, hard))
            output, errors = process.communicate()
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    if process.returncode < 0 or "Out of memory" in errors:
        cause = "it lacked memory" if process.returncode >= 0 else f"signal {-process.returncode} ended it"
        raise UndecidedError(f"coqc did not finish: {cause}; it may take {MEMORY} GiB", id="OBS908")
    return Call(process.returncode, output, errors)
