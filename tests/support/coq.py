"""The kernel of Coq: the library, compiled, and what coqc says of a file."""

import shutil
import subprocess

import pytest

from obsdesign.coq.library import QUIET
from support.commands import run

needs_coq = pytest.mark.skipif(shutil.which("coqc") is None, reason="needs Debian's coq and libcoq-coquelicot")


def compiled_library(folder):
    """The library, compiled in a folder as the command says."""
    assert run("theorem", "--library", folder).exit_code == 0
    subprocess.run("coq_makefile -f _CoqProject -o Makefile && make -s", shell=True, cwd=folder, check=True)
    return folder


def compiled(folder, text):
    """What coqc says of a file, and whether it accepts it."""
    (folder / "Theorem.v").write_text(text)
    call = ["coqc", *QUIET.split(), "-Q", ".", "Obs", "Theorem.v"]
    found = subprocess.run(call, cwd=folder, capture_output=True, text=True, timeout=60, check=False)
    return found.returncode == 0, found.stdout + found.stderr
