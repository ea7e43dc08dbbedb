"""Whether a result file says no more than what is proved of it anew: what else stands in it is named under `numerical`.

A result file holds what is proved (its observer, `guarantee` and `certificate`, or the certificate of a diagnosis) and
what was computed in doubles. The first must be what is written of the claim when it is proved again; of the second,
what is cheap to compute again must agree, a limit must not be worse than what is proved, and its path must be listed.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.families.outcome import Proof
from obsdesign.files import ResultFile
from obsdesign.lmi.formula import approximate
from obsdesign.spec import Spec

LIMITS = ("limit", "limit_bounded", "widened", "ceiling", "comparison")  # found by a search, which is not repeated
NUMERICAL = {  # entries of parts of a result file that prove nothing
    "observer": ("poles", "fastest", "largest_step", "noise_gain", "condition_P", "multipliers", "contraction"),
    "guarantee": LIMITS,
}
HELD = ("observer", "guarantee", "certificate")  # parts that are held against what is proved
HEAD = ("obsdesign", "name", "spec", "status", "solver", "tool", "created")  # claims nothing
KNOWN = (*HEAD, "diagnosis", "assumed", "notes", "numerical", "split", "discretised", "theorem")
RECORD = {
    "name": r"for_(the_class|this_f)",
    "sha256": r"[0-9a-f]{64}",
    "coq": r"[0-9.]{1,20}",
    "accepted": r"[0-9TZ:-]{20}",
}  # of a theorem
EXACT = "exact"  # what a diagnosis with a certificate says of its proof
REASON = ("id", "condition", "reason")  # what every diagnosis has
POSITIVE = ("gamma", "lipschitz", "T2", "alpha", "decay", "rho", "ceiling")  # what is never negative
LEAST = ("gamma", "rho")  # less is better
CLOSE = 1e-3  # relative: how well what is computed in doubles is met again
BETTER = 1e-6  # relative: how much better than its limit a number may be, by rounding


def numerical(entries: Mapping[str, Any], spec: Spec) -> list[str]:
    """Dotted paths of what is not proved in a result file with these entries.

    Of notes, those on the types of the spec are proved, or say what is assumed.
    """
    held = {part: entries.get(part, {}) for part in NUMERICAL}
    paths = [f"{part}.{key}" for part, keys in NUMERICAL.items() for key in keys if key in held[part]]
    paths += margins(entries.get("certificate", {}), "certificate")
    if "observer" in entries and "certificate" not in entries:
        paths = ["observer", *(path for path in paths if not path.startswith("observer."))]
    paths += [f"diagnosis.{key}" for key in entries.get("diagnosis", {}) if key not in {"proof", "certificate"}]
    paths += [name for name in entries if name not in (*HELD, *KNOWN)]
    solver = entries.get("solver")
    paths += ["solver.scaling"] if isinstance(solver, Mapping) and "scaling" in solver else []
    return [*paths, *(["notes"] if any(note not in spec.notes for note in entries.get("notes", [])) else [])]


def margins(certificate: Mapping[str, Any], path: str) -> list[str]:
    """Paths of the margins of conditions, which are computed in doubles, in a certificate and in those within it."""
    found = [f"{path}.checks.margin"] if "checks" in certificate else []
    parts = ((key, part) for key, part in certificate.items() if isinstance(part, Mapping))
    return found + [inner for key, part in parts for inner in margins(part, f"{path}.{key}")]


def require_types(file: ResultFile, spec: Spec) -> None:
    """Refuse a file that does not say what is assumed of the types, or whose notes or limits are none."""
    notes = file.content.get("notes", [])
    if not isinstance(notes, list) or not all(isinstance(note, str) for note in notes):
        raise file.wrong("notes", "expected a list of sentences", id="OBS702")
    if file.content.get("assumed", []) != spec.assumed:
        raise file.wrong("assumed", "is not what is neither proved nor refuted of the types of the spec", id="OBS705")
    require_limits(file)


def require_limits(file: ResultFile) -> None:
    """Refuse limits that are negative, in files that claim nothing as well: what has a limit is a size or a rate."""
    claimed = file.content.get("guarantee")
    parts = [(name, claimed[name]) for name in LIMITS if name in claimed] if isinstance(claimed, dict) else []
    for path, value in parts:
        name = path.rpartition(".")[2]
        if isinstance(value, dict):
            parts += [(f"{path}.{key}", part) for key, part in value.items()]
        elif isinstance(value, list):
            parts += [(path, part) for part in value]
        elif name in POSITIVE and str(value).startswith("-") and file.exact(value, f"guarantee.{path}") < 0:
            raise file.wrong(f"guarantee.{path}", f"{value} is negative, which no {name} is", id="OBS702")


def require_notes(file: ResultFile, spec: Spec) -> None:
    """Refuse notes that leave out what is known of the spec; others prove nothing and are listed as numerical."""
    notes, own = file.content.get("notes", []), [*spec.notes, *spec.idle]
    if missing := next((note for note in own if note not in (*notes, *spec.unused)), None):
        raise file.wrong("notes", f"leaves out what is known of the spec: {missing}", id="OBS705")


def require_agreement(file: ResultFile, anew: Mapping[str, Any], spec: Spec) -> None:
    """Refuse a file that says more or other than is proved of it, or does not name what is not.

    `anew`: the parts of a result file as they are written of the claim that was proved. Raises `UsageError`.
    """
    require_notes(file, spec)
    require_record(file)
    for part in (part for part in (*HELD, "diagnosis") if part in file.content):
        for key, found in file.table(part).items():
            if part in HELD:
                require_entry(file, anew.get(part, {}), part, key, found)
    for part in HELD:
        later = ("kind",) if part == "guarantee" else ()  # older files have none
        for key in (key for key in anew.get(part, {}) if key not in (*LIMITS, *later)):
            require_whole(file, anew[part][key], (part, key))
    for name in ("limit", "limit_bounded"):
        require_limit(file, name)
    listed = file.content.get("numerical", [])
    for path in numerical(file.content, spec):
        if not isinstance(listed, list) or path not in listed:
            raise file.wrong("numerical", f"does not name {path}, which is not proved", id="OBS705")


def require_record(file: ResultFile) -> None:
    """Refuse a record of a theorem of another form than `verify --compile` writes; whether it is true is not seen."""
    if "theorem" not in file.content:
        return
    record = file.table("theorem")
    told = {key: value for key, value in record.items() if isinstance(value, str)}
    known = file.status == "certified" and record.keys() == told.keys() == RECORD.keys()
    if not known or not all(re.fullmatch(RECORD[key], told[key], re.ASCII) for key in told):
        said = "is no record of `verify --theorem coq --compile`; of a certified result; leave it out"
        raise file.wrong("theorem", said, id="OBS702")


def require_whole(file: ResultFile, anew: Any, path: tuple[str, ...]) -> None:
    """Refuse a part that leaves out what is written of the claim, by its name; margins are computed in doubles."""
    found = file.at(*path)
    if isinstance(anew, Mapping) and isinstance(found, dict):
        for key in anew:
            require_whole(file, anew[key], (*path, key))


def require_entry(file: ResultFile, anew: Mapping[str, Any], part: str, key: str, found: Any) -> None:
    """Refuse an entry of a part that is not what is written of the claim."""
    if key not in anew or key in LIMITS:
        if key not in NUMERICAL.get(part, ()) and (part, anew) != ("observer", {}):
            raise file.wrong(
                f"{part}.{key}", "is nothing that is proved anew; a result holds nothing else there", id="OBS705"
            )
        return
    close = part == "observer" and key in NUMERICAL[part]
    same = decimal if part == "guarantee" else double
    if not (meets(file, found, anew[key]) if close else agree(file, found, anew[key], same)):
        raise file.wrong(f"{part}.{key}", f"is not what is {'computed' if close else 'proved'} anew", id="OBS705")


def meets(file: ResultFile, found: Any, anew: Any) -> bool:
    """Whether a figure is met again, as near as doubles allow; `CLOSE` is relative to the largest number of a list."""
    if isinstance(anew, Mapping):
        return isinstance(found, dict) and all(key in anew and meets(file, found[key], anew[key]) for key in found)
    within = CLOSE * max(map(abs, numbers(anew)), default=0.0)
    return agree(file, found, anew, lambda one, other: abs(approximate(one) - approximate(other)) <= within)


Same = Callable[[fmpq, fmpq], bool]  # whether a number says what one that is written anew says


def decimal(found: fmpq, anew: fmpq) -> bool:
    """Whether numbers are equal."""
    return bool(found == anew)


def double(found: fmpq, anew: fmpq) -> bool:
    """Whether numbers are one double."""
    return approximate(found) == approximate(anew)


def agree(file: ResultFile, found: Any, anew: Any, same: Same) -> bool:
    """Whether an entry as it was read, with its numbers as texts, says what is written anew."""
    if isinstance(anew, Mapping):
        known = isinstance(found, dict) and {*found, "margin"} == {*anew, "margin"}  # of a condition, in doubles
        return known and all(key == "margin" or agree(file, found[key], anew[key], same) for key in found)
    if isinstance(anew, list):
        fits = isinstance(found, list) and len(found) == len(anew)
        return fits and all(agree(file, *pair, same) for pair in zip(found, anew, strict=True))
    if anew is None or isinstance(anew, bool) or not isinstance(found, str):
        return found is anew
    try:
        return same(file.exact(found, ""), file.exact(str(anew), ""))
    except UsageError:  # words
        return bool(found == anew)


def numbers(value: Any) -> Sequence[float]:
    """Every number in a list."""
    if isinstance(value, list):
        return [x for part in value for x in numbers(part)]
    return [float(value)] if isinstance(value, int | float) and not isinstance(value, bool) else []


def require_limit(file: ResultFile, name: str) -> None:
    """Refuse a limit that is worse than what is proved; one that weighs several numbers limits none by itself."""
    if name not in file.content.get("guarantee", {}):
        return
    limit, proved = file.table("guarantee", name), file.table("guarantee")
    if "objective" in limit:
        return
    for key in (limit.keys() & proved.keys()) - {"kind"}:
        best, reached = (approximate(file.number(*path, key)) for path in (("guarantee", name), ("guarantee",)))
        beyond = best - reached if key in LEAST else reached - best
        if beyond > BETTER * abs(best):
            raise file.wrong(f"guarantee.{name}.{key}", f"{best:g} is no limit: {reached:g} is proved", id="OBS705")


def require_dual(file: ResultFile, proof: Proof) -> None:
    """Refuse a certificate that there is no solution which says more than was checked of it."""
    root = ("diagnosis", "certificate")
    checks = [{"name": check.name, "holds": check.holds} for check in proof.checks]
    for path in (*(("diagnosis", key) for key in REASON), *((*root, key) for key in proof.used)):
        file.at(*path)
    for key, value in file.table(*root).items():
        if key not in proof.used if key != "checks" else not agree(file, value, checks, double):
            raise file.wrong(f"diagnosis.certificate.{key}", "is nothing that is proved anew", id="OBS705")
    if file.at("diagnosis", "proof") != EXACT:
        raise file.wrong("diagnosis.proof", f"is not what is proved anew; expected {EXACT}", id="OBS705")
