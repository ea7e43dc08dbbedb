"""What Coq says of files of theorems: the library compiled once, a file compiled with it."""

import shutil
import subprocess

import pytest

from obsdesign.coq.library import QUIET
from support.commands import run

AXIOMS = {"sig_not_dec", "sig_forall_dec", "functional_extensionality_dep", "classic"}
needs_coq = pytest.mark.skipif(shutil.which("coqc") is None, reason="needs Debian's coq and libcoq-coquelicot")


def compiled(folder, text):
    """What coqc says of a file, and whether it accepts it."""
    (folder / "Theorem.v").write_text(text)
    found = subprocess.run(
        ["coqc", *QUIET.split(), "-Q", ".", "Obs", "Theorem.v"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    return found.returncode == 0, found.stdout + found.stderr


def compiled_library(folder):
    """The library in a folder, compiled as the command says."""
    assert run("theorem", "--library", folder).exit_code == 0
    subprocess.run("coq_makefile -f _CoqProject -o Makefile && make -s", shell=True, cwd=folder, check=True)
    return folder
