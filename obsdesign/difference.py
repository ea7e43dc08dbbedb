"""Two result files, and what changed from one to the other: as the files say it; nothing is proved here."""

import os
import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from obsdesign.files import ResultFile
from obsdesign.lmi.formula import Array, approximate
from obsdesign.sections.changes import opened
from obsdesign.sections.document import Loc, dotted
from obsdesign.sections.scalars import described

Change = dict[str, Any]
ROUNDING = 1e-9  # relative: a change below it is none
NORMS = {  # of z in a statement, which gamma bounds, with the words for it
    "the energy norm2(z)": re.compile(r"norm2\(z\)|\|z\|_2 <="),
    "the peak sup|z|": re.compile(r"\|z\(t\)\| <= \S+ sup\|"),
}
FIGURES = re.compile(r"[-+]?\d[\d.]*([eE][-+]?\d+|/\d+)?")  # what is meant as a number; an equation is not


def diff(old: str | os.PathLike[str], new: str | os.PathLike[str]) -> dict[str, Any]:
    """What changed from one result file to another.

    Returns `status`: of both; `solver`: name and version; `spec`: values of keys, as texts, None where there is none;
    `gains`: spectral norms of those of both, and `relative`, the norm of the difference over that of the old one;
    `guarantee`: its numbers, and `relative`, the difference over the old one; `notes`: why numbers do not compare. What
    is the same, numbers to within rounding, is left out, `relative` is None where it has no meaning.

    Raises `UsageError`: a file is no result, or the spec in it was altered.
    """
    before, after = (ResultFile.open(os.fspath(path)) for path in (old, new))
    return {
        "status": [before.status, after.status],
        "solver": [*changes(solver_of(before), solver_of(after), "name")],
        "spec": [*changes(keys_of(before), keys_of(after), "path")],
        "gains": [*map(of_gains, changes(gains_of(before), gains_of(after), "name"))],
        "guarantee": [*map(of_numbers, changes(numbers_of(before), numbers_of(after), "name"))],
        "notes": [*notes(before, after)],
    }


def changes(old: Mapping[str, Any], new: Mapping[str, Any], key: str) -> Iterator[Change]:
    """Entries that differ, in the order of the old ones, then of the new ones."""
    for name in dict.fromkeys([*old, *new]):
        pair = old.get(name), new.get(name)
        if not same(*pair):
            yield {key: name, "old": pair[0], "new": pair[1]}


def same(old: Any, new: Any) -> bool:
    """Whether two values are the same, numbers but for what a solver leaves of rounding."""
    before, after = np.asarray(old), np.asarray(new)
    if before.dtype.kind not in "fi" or after.dtype.kind not in "fi" or before.shape != after.shape:
        return bool(np.array_equal(before, after))
    return bool(norm(after - before) <= ROUNDING * norm(before))


def solver_of(file: ResultFile) -> dict[str, str]:
    """Name and version of the solver of a file, as texts."""
    told = file.content.get("solver")
    return {key: shown(told[key]) for key in ("name", "version") if key in told} if isinstance(told, Mapping) else {}


def keys_of(file: ResultFile) -> dict[str, str]:
    """Values of the spec in a file, by their dotted keys."""
    document = opened(file.spec_text(), f"{file.path} (spec.text)", file.changes())
    return dict(leaves(document.root.plain(), ()))


def leaves(value: Any, loc: Loc) -> Iterator[tuple[str, str]]:
    """Values of a tree, a list of values in one."""
    if isinstance(value, Mapping):
        for key, entry in value.items():
            yield from leaves(entry, (*loc, key))
    elif isinstance(value, list) and any(isinstance(entry, Mapping) for entry in value):
        for i, entry in enumerate(value):
            yield from leaves(entry, (*loc, i))
    else:
        yield dotted(loc), shown(value)


def shown(value: Any) -> str:
    """Value of a spec in one line, whole."""
    return f"[{', '.join(map(shown, value))}]" if isinstance(value, list) else " ".join(str(value).split())


def gains_of(file: ResultFile) -> dict[str, Array]:
    """Gains in a file: the matrices of its observer, in doubles."""
    made, computed = file.content.get("observer"), file.content.get("numerical")
    found = {}
    for name, rows in made.items() if isinstance(made, dict) else ():
        told = isinstance(computed, list) and f"observer.{name}" in computed  # such as poles
        if isinstance(rows, list) and rows and all(isinstance(row, list) for row in rows) and not told:
            exact = file.matrix((len(rows), len(rows[0])), "observer", name)
            found[name] = np.vectorize(approximate, otypes=[float])(exact)
            require_finite(file, f"observer.{name}", found[name])
            require_finite(file, f"observer.{name}", norm(found[name]))
    return found


def require_finite(file: ResultFile, key: str, value: Array | float) -> None:
    """Refuse numbers that are beyond doubles."""
    if not np.isfinite(value).all():
        raise file.wrong(key, "is beyond what doubles can hold, so that it cannot be compared", id="OBS508")


def of_gains(change: Change) -> Change:
    """Change of a gain, in norms."""
    old, new = change["old"], change["new"]
    norms = [None if gain is None else norm(gain) for gain in (old, new)]
    known = old is not None and new is not None and old.shape == new.shape and norm(old)
    relative = finite(norm(new - old) / known) if known else None
    return {"name": change["name"], "old": norms[0], "new": norms[1], "relative": relative}


def norm(gain: Array) -> float:
    """Spectral norm."""
    return float(np.linalg.norm(np.atleast_2d(gain), 2)) if gain.size else 0.0


def numbers_of(file: ResultFile) -> dict[str, float]:
    """Numbers of the guarantee in a file, by their dotted names."""
    parts: list[tuple[Loc, Any]] = [((), file.content.get("guarantee", {}))]
    found = {}
    for loc, value in parts:
        if isinstance(value, dict):
            parts += [((*loc, key), entry) for key, entry in value.items()]
        elif isinstance(value, list):
            parts += [((*loc, i), entry) for i, entry in enumerate(value)]
        elif isinstance(value, str) and FIGURES.fullmatch(value):
            found[dotted(loc)] = approximate(file.exact(value, f"guarantee.{dotted(loc)}"))
            require_finite(file, f"guarantee.{dotted(loc)}", found[dotted(loc)])
    return found


def notes(before: ResultFile, after: ResultFile) -> Iterator[str]:
    """Why numbers of two results do not compare: gammas that bound different norms, as the statements say them."""
    norms = [norm_of(file) for file in (before, after) if "gamma" in numbers_of(file)]
    if len(norms) == 2 and None not in norms and norms[0] != norms[1]:
        yield f"these gammas bound different norms, {norms[0]} and {norms[1]}: neither is better for being smaller"


def norm_of(file: ResultFile) -> str | None:
    """Which norm of z the gamma of a file bounds, by its statement; None where that does not say it."""
    claimed = file.content.get("guarantee")
    said = str(claimed.get("statement", "")) if isinstance(claimed, Mapping) else ""
    return next((name for name, words in NORMS.items() if words.search(said)), None)


def of_numbers(change: Change) -> Change:
    """Change of a number."""
    old, new = change["old"], change["new"]
    return {**change, "relative": finite((new - old) / abs(old)) if old and new is not None else None}


def finite(x: float | None) -> float | None:
    """Number, or None where doubles do not hold it."""
    return x if x is not None and np.isfinite(x) else None


def as_rows(found: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Table of what changed."""
    old, new = found["status"]
    rows = [("status", old if old == new else f"{old} -> {new}")]
    rows += [("solver", f"{one['name']}: {side(one['old'])} -> {side(one['new'])}") for one in found["solver"]]
    rows += [("spec", f"{one['path']}: {side(one['old'])} -> {side(one['new'])}") for one in found["spec"]]
    for part in ("gains", "guarantee"):
        for one in found[part]:
            label = f"|{one['name']}|" if part == "gains" else one["name"]
            by = (
                "" if one["relative"] is None else f"   ({apart(one) if part == 'gains' else percent(one['relative'])})"
            )
            rows.append((part, f"{label} {side(one['old'])} -> {side(one['new'])}{by}"))
    return [*rows, *(("note", said) for said in found["notes"])]


def apart(change: Change) -> str:
    """Change of the norm of a gain, with its sign, and the norm of the difference, both over the old one."""
    old, new = change["old"], change["new"]
    return f"{percent((new - old) / old)}, the difference is {100 * change['relative']:.3g} %"


def percent(share: float) -> str:
    """Share with its sign."""
    return f"{100 * share:+.3g} %"


def side(value: str | float | None) -> str:
    """Value of one side in a row."""
    return "nothing" if value is None else described(value) if isinstance(value, str) else f"{value:.6g}"
