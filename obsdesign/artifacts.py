"""Result files: written whole or not at all, and read back exactly.

A number in a result file is a decimal that is read as written, or a text "p/q" of any length.
"""

import datetime
import hashlib
import json
import os
import platform
import tempfile
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from obsdesign import __version__
from obsdesign.certificate import Certificate, Reconstructed, statement
from obsdesign.design import Design
from obsdesign.errors import UsageError
from obsdesign.lmi.formula import Array, approximate, in_floats
from obsdesign.lmi.proof import Check
from obsdesign.observers.linear import figures
from obsdesign.spec.model import Spec

FORMAT = 1


def write_whole(path: str | Path, content: bytes) -> None:
    """Write one file, whole or not at all.

    Raises
    ------
    UsageError
        If the folder does not exist or may not be written.
    """
    write_all({str(path): content})


def write_all(files: Mapping[str, bytes]) -> None:
    """Write files under temporary names beside them, and rename these when all are complete.

    Raises
    ------
    UsageError
        If a folder does not exist or may not be written; then none of the files is.
    """
    staged: dict[str, Path] = {}
    path = ""
    try:
        for path, content in files.items():
            if Path(path).is_dir():
                raise IsADirectoryError(0, "it is a folder")
            with tempfile.NamedTemporaryFile(dir=Path(path).parent, prefix=".obsdesign.", delete=False) as file:
                staged[path] = Path(file.name)
                file.write(content)
            staged[path].chmod(0o666 & ~umask())
        for path, temporary in staged.items():
            temporary.replace(path)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written: {error.strerror}") from None
    finally:
        for temporary in staged.values():
            temporary.unlink(missing_ok=True)


def require_writable(*paths: str) -> None:
    """Refuse paths that could not be written, before anything is computed.

    Raises
    ------
    UsageError
        If a folder does not exist or may not be written, or a path is a folder.
    """
    for path in paths:
        folder = Path(path).parent
        if Path(path).is_dir():
            raise UsageError(f"{path}: cannot be written: it is a folder")
        if not folder.is_dir():
            raise UsageError(f"{path}: cannot be written: there is no folder {folder}")
        if not os.access(folder, os.W_OK):
            raise UsageError(f"{path}: cannot be written: the folder {folder} may not be written")


def umask() -> int:
    """Permissions that the user withholds from new files."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def result(spec: Spec, design: Design, solver: str) -> dict[str, Any]:
    """Everything about a design, as the file holds it."""
    made: dict[str, Any] = {
        "obsdesign": FORMAT,
        "name": spec.name,
        "spec": {"path": spec.path, "sha256": digest(spec.text), "text": spec.text},
        "status": design.status,
    }
    if design.gains:
        made["observer"] = observer(spec, design)
    if design.certificate:
        made["guarantee"] = guarantee(spec, design)
        made["certificate"] = certificate(design.certificate)
    elif design.limit:
        made["guarantee"] = limits(design)
    if design.diagnosis:
        made["diagnosis"] = design.diagnosis
    if design.points:
        made["search"] = {"parameter": "alpha", "points": list(design.points)}
    notes = [*spec.notes, *design.notes]
    return {
        **made,
        **({"notes": notes} if notes else {}),
        "solver": {
            "name": solver,
            "version": version("clarabel" if solver == "clarabel" else "cvxpy"),
            "solves": design.solves,
            "time_s": round(design.time_s, 4),
        },
        "tool": {"version": __version__, "python": platform.python_version(), "cvxpy": version("cvxpy")},
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
    }


def observer(spec: Spec, design: Design) -> dict[str, Any]:
    """Gains and what an engineer asks first of them."""
    P = design.certificate.P.astype(float) if design.certificate else None
    L1, L2 = design.gains["L1"], design.gains["L2"]
    return {
        "type": spec.observer.type,
        "L1": L1.tolist(),
        "L2": L2.tolist(),
        **figures(in_floats(spec.augmented), L1, P),
    }


def guarantee(spec: Spec, design: Design) -> dict[str, Any]:
    """What is proved, and the limit it is near to."""
    assert design.certificate
    g = design.certificate.guarantee
    bound = g.reconstruction
    return {
        "gamma": g.gamma,
        "alpha": g.alpha,
        "mu1": g.mu1,
        "mu2": g.mu2,
        **limits(design),
        **({"reconstruction": {"w": bound.w, "w_rate": bound.w_rate, "x_rate": bound.x_rate}} if bound else {}),
        "statement": statement(spec, g),
    }


def limits(design: Design) -> dict[str, Any]:
    """Limits of the objective."""
    bounded = {"limit_bounded": design.limit_bounded} if design.limit_bounded else {}
    return {"limit": design.limit, **bounded}


def certificate(proof: Certificate) -> dict[str, Any]:
    """Witness and checks."""
    return {
        "kind": "exact",
        "P": rows(proof.P),
        "multipliers": {name: written(value) for name, value in proof.multipliers.items()},
        "checks": checks(proof.checks),
        **({"reconstruction": reconstruction(proof.reconstruction)} if proof.reconstruction else {}),
    }


def reconstruction(proof: Reconstructed) -> dict[str, Any]:
    """Witness and checks of the bound on the reconstruction of w."""
    levels = {
        name: {"gamma": approximate(level.gamma), "alpha": approximate(level.alpha), "mu1": approximate(level.mu1)}
        | {"mu2": approximate(level.mu2)}
        | certificate(level)
        for name, level in proof.levels.items()
    }
    slopes = {
        name: {"bound": approximate(slope.bound), "values": {n: written(v) for n, v in slope.values.items()}}
        | {"checks": checks(slope.checks)}
        for name, slope in proof.slopes.items()
    }
    return {"levels": levels, "slopes": slopes, "checks": checks(proof.checks)}


def checks(found: Iterable[Check]) -> list[dict[str, Any]]:
    """Conditions and whether they hold."""
    return [{"name": c.name, "holds": c.holds, "margin": c.margin if np.isfinite(c.margin) else None} for c in found]


def rows(matrix: Array) -> list[list[str]]:
    """Exact entries."""
    return [[str(entry) for entry in row] for row in matrix]


def written(value: Array) -> str | list[list[str]]:
    """Exact value of an unknown: a number, or rows."""
    return str(value.item()) if value.shape == (1, 1) else rows(value)


def digest(text: str) -> str:
    """SHA-256 of a spec's text."""
    return hashlib.sha256(text.encode()).hexdigest()


def to_json(value: Any) -> str:
    """JSON with one line for each key, row of a matrix, and flat object."""
    return render(value, "") + "\n"


def render(value: Any, indent: str) -> str:
    """JSON of a value whose first line stands at an indentation."""
    flat = json.dumps(value, ensure_ascii=False, allow_nan=False)
    entries = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    nested = any(isinstance(v, dict | list) and v for v in entries)
    if (
        not entries
        or (not nested and indent and len(flat) < 200)
        or (indent and not nested and isinstance(value, list))
    ):
        return flat
    inner = indent + "  "
    if isinstance(value, dict):
        lines = [f"{json.dumps(k)}: {render(v, inner)}" for k, v in value.items()]
    else:
        lines = [render(v, inner) for v in value]
    left, right = "{}" if isinstance(value, dict) else "[]"
    return f"{left}\n{inner}" + f",\n{inner}".join(lines) + f"\n{indent}{right}"


def csv(header: list[str], samples: Array) -> bytes:
    """Table of a run, one row a sample, 12 digits."""
    lines = [",".join(header), *(",".join(f"{x:.12g}" for x in row) for row in samples)]
    return ("\n".join(lines) + "\n").encode()
