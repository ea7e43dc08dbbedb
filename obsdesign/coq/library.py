"""The library that a theorem is compiled with: definitions to be read, and proofs. It is data, in `theorem/`."""

import shlex
from importlib.resources import files

PROJECT = "_CoqProject"  # options of Coq, and the files in the order in which they need each other


QUIET = "-w -ambiguous-paths"  # a warning of every file that uses Coquelicot


def library() -> dict[str, bytes]:
    """Contents of the files of the library, by their names."""
    folder = files("obsdesign").joinpath("theorem")
    found = {PROJECT: folder.joinpath(PROJECT).read_bytes()}
    names = [line for line in found[PROJECT].decode().splitlines() if line.endswith(".v")]
    return found | {name: folder.joinpath(name).read_bytes() for name in names}


def command(folder: str, file: str) -> str:
    """Command for a shell that compiles the library in a folder, and a file with it.

    The file is copied beside the library, for the name of a result need not be one of Coq.
    """
    folder, file = word(folder), word(file)
    here = f"(cd {folder} && coq_makefile -f {PROJECT} -o Makefile && make -s)"
    return f"{here} && cp {file} {folder}/Theorem.v && coqc {QUIET} -Q {folder} Obs {folder}/Theorem.v"


def word(path: str) -> str:
    """Path as a word of a shell that is no option."""
    return shlex.quote(f"./{path}" if path.startswith("-") else path)
