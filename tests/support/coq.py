"""What Coq says of files of theorems: the library compiled once, a file compiled with it."""

import os
import shutil
import subprocess
import tempfile
from unittest import mock

import pytest

from obsdesign.coq import kernel
from obsdesign.coq.library import QUIET
from support.commands import run

AXIOMS = {"sig_not_dec", "sig_forall_dec", "functional_extensionality_dep", "classic"}
CACHE = f"{tempfile.gettempdir()}/obsdesign-tests-{os.getuid()}"
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
    """The library in a folder, as the command writes it, compiled; once for all tests of a user."""
    assert run("theorem", "--library", folder).exit_code == 0
    with mock.patch.dict(os.environ, XDG_CACHE_HOME=CACHE):
        made = kernel.compiled_library(kernel.version())
    for name in made.glob("*.vo"):
        shutil.copy(name, folder)
    return folder
