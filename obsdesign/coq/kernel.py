"""What the kernel of Coq says of a theorem: accepted, on which axioms, or refused, and which statement.

The library is compiled once for each version of it and of Coq, and kept in the cache of the user.
"""

import hashlib
import os
import re
import resource
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from obsdesign.coq.library import PROJECT, QUIET, library
from obsdesign.errors import UndecidedError, UsageError

AXIOMS = {  # of the real numbers of Coq's library
    "ClassicalDedekindReals.sig_not_dec",
    "ClassicalDedekindReals.sig_forall_dec",
    "FunctionalExtensionality.functional_extensionality_dep",
    "Classical_Prop.classic",
}
MEMORY = 12  # GiB of address space that coqc may take
INSTALL = "apt-get install coq libcoq-coquelicot"
NAME = "Theorem.v"
STATEMENT = re.compile(r"^(?:Lemma|Theorem|Definition) (\w+)", re.MULTILINE)


@dataclass(frozen=True)
class Judgement:
    """How a compilation ended."""

    accepted: bool
    coq: str  # its version
    seconds: float
    axioms: frozenset[str] = frozenset()
    refused: str = ""  # name of the statement that it refuses
    why: str = ""  # what coqc says, in one line


def judged(text: str) -> Judgement:
    """Compile a theorem, and see what its proof rests on.

    Raises `UsageError`: coqc is not installed, or lacks Coquelicot. Raises `UndecidedError`: it lacks memory.
    """
    if shutil.which("coqc") is None:
        raise UsageError(f"--compile: coqc is not installed; {INSTALL}", id="OBS712")
    known = re.match(r"[0-9][0-9.]*", run(".", "--print-version").stdout)
    if known is None:
        raise UsageError(f"--compile: coqc does not tell its version; {INSTALL}", id="OBS712")
    version = known[0]
    compiled = compiled_library(version)
    found, seconds = attempt(text, compiled)
    if found.returncode:
        shutil.rmtree(compiled)  # it may be damaged
        found, seconds = attempt(text, compiled_library(version))
    if found.returncode == 0:
        axioms = axioms_of(found.stdout)
        others = ", ".join(sorted(axioms - AXIOMS))
        return Judgement(not others, version, seconds, axioms, others, "an axiom that is none of the real numbers")
    return Judgement(False, version, seconds, refused=refused(text, found.stderr), why=" ".join(found.stderr.split()))


def attempt(text: str, compiled: Path) -> tuple[subprocess.CompletedProcess[str], float]:
    """Compile a theorem with a library; and the seconds that took."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, NAME).write_text(text)
        start = time.monotonic()
        found = run(folder, *QUIET.split(), "-Q", str(compiled), "Obs", NAME)
        return found, time.monotonic() - start


def axioms_of(printed: str) -> frozenset[str]:
    """Names that `Print Assumptions` lists: each begins a line, and its type goes on in indented ones."""
    return frozenset(re.findall(r"^([\w.]+)\s*:", printed.partition("Axioms:")[2], re.MULTILINE))


def refused(text: str, said: str) -> str:
    """Name of the statement in which an error of coqc is."""
    place = re.search(r"line (\d+)", said)
    before = "\n".join(text.splitlines()[: int(place[1])]) if place else ""
    return next((found[1] for found in reversed([*STATEMENT.finditer(before)])), "the file")


def compiled_library(version: str) -> Path:
    """Folder with the library, compiled; made if it is not in the cache, whole or not at all."""
    files = library()
    key = hashlib.sha256(b"\0".join([version.encode(), *files.values()])).hexdigest()[:16]
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "obsdesign")
    kept = home / f"coq-{key}"
    if kept.is_dir():
        return kept
    home.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=home) as folder:
        made = Path(folder, "library")
        made.mkdir()
        for name, content in files.items():
            (made / name).write_bytes(content)
        for name in modules(files[PROJECT].decode()):
            found = run(str(made), *QUIET.split(), "-Q", ".", "Obs", name)
            if found.returncode:
                said = " ".join(found.stderr.split())[-300:]
                raise UsageError(f"--compile: coqc {version} does not take the library: {said}; {INSTALL}", id="OBS712")
        with suppress(OSError):  # another process was faster
            os.rename(made, kept)
    return kept


def modules(project: str) -> Iterator[str]:
    """Files in the order in which they need each other."""
    return (line for line in project.splitlines() if line.endswith(".v"))


def run(folder: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """One call of coqc; raises `UndecidedError` where it lacks memory."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY << 30, MEMORY << 30))

    found = subprocess.run(
        ["coqc", *arguments], cwd=folder, capture_output=True, text=True, check=False, preexec_fn=limit
    )
    if found.returncode < 0 or "Out of memory" in found.stderr:
        raise UndecidedError(f"coqc needs more than {MEMORY} GiB of memory for this theorem", id="OBS908")
    return found
