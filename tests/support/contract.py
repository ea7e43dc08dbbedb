"""The rules of a result file, from its JSON alone, which any reader of such a file may rely on; and what is equal."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from fractions import Fraction

import numpy as np

HEAD = ("obsdesign", "name", "spec", "status", "solver", "tool", "created")
VERDICTS = ("certified", "uncertified", "infeasible", "refuted")


def read(text):
    """Result of a text, which is JSON without NaN and infinities."""

    def refuse(constant):
        raise ValueError(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refuse)


def is_number(value):
    """Whether a value is a finite number of JSON."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def is_exact(value):
    """Whether a value is a number, or the text of a decimal or of "p/q"."""
    try:
        return is_number(value) or (isinstance(value, str) and math.isfinite(Fraction(value)))
    except (ValueError, ZeroDivisionError, OverflowError):
        return False


def is_matrix(value, entry):
    """Whether a value is a list of rows of equal length; a matrix without rows is []."""
    rows = value if isinstance(value, list) else [None]
    return all(isinstance(row, list) and len(row) == len(rows[0]) and all(map(entry, row)) for row in rows)


def broken_rules(result, gains):
    """Rules that a result does not keep, in words.

    Parameters
    ----------
    gains
        Names of the gains of its family.
    """
    broken = [f"{key} is missing" for key in HEAD if key not in result]
    rules = {
        "format 1": result.get("obsdesign") == 1,
        "spec.sha256 of spec.text": hashlib.sha256(result["spec"]["text"].encode()).hexdigest()
        == result["spec"]["sha256"],
        "status is a verdict": result["status"] in VERDICTS,
        "every point of a search has a status": all("status" in x for x in result.get("search", {}).get("points", [])),
    }
    if result["status"] in {"infeasible", "refuted"}:
        rules["an absence has a reason"] = bool(result.get("diagnosis", {}).get("reason"))
    else:
        rules |= rules_of_gains(result["observer"], gains)
        rules |= rules_of_guarantee(result["guarantee"])
        search = result.get("search", {})
        points = [p for curve in search.get("curves", [search]) for p in curve.get("points", []) if "certified" in p]
        rules["a point of a search is not better than its limit"] = not any(ahead(p, p["certified"]) for p in points)
        rules |= rules_of_certificate(result["certificate"], result["status"])
    return broken + [rule for rule, kept in rules.items() if not kept]


def rules_of_gains(observer, gains):
    """Gains are matrices of numbers, and the observer has a type; E is exact, and no decimal may be."""
    entry = {"E": is_exact}
    kept = {
        f"observer.{name} is a matrix of numbers": is_matrix(observer.get(name), entry.get(name, is_number))
        for name in gains
    }
    return kept | {"observer.type": isinstance(observer.get("type"), str)}


def rules_of_guarantee(guarantee):
    """It is said in words and in numbers, with a limit that no number is better than."""
    limit, rows = guarantee.get("limit", {}), guarantee.get("comparison", [])
    beside = [(guarantee.get(name, {}), guarantee) for name in ("limit", "limit_bounded")]
    beside += [(row["limit"], row["certified"]) for row in rows if "certified" in row]
    return {
        "guarantee.statement says something": len(guarantee.get("statement", "")) > 20,
        "guarantee.limit says whether it is attained": isinstance(limit.get("attained"), bool),
        "the numbers of the guarantee are numbers": all(
            is_number(value) for key, value in guarantee.items() if not isinstance(value, dict | list | str)
        ),
        "guarantee.limit.kind": limit.get("kind", "infimum") in {"infimum", "best-found", "not-computed"},
        "a limit that was not computed has no number": ("not-computed" in limit.values())
        == (not limit.keys() - {"attained", "kind"}),
        "nothing that is proved is better than the limit beside it": not any(ahead(*pair) for pair in beside),
        "gamma follows from mu1 and mu2": not {"gamma", "mu1", "mu2"} <= guarantee.keys()
        or abs(math.sqrt(guarantee["mu2"] / guarantee["mu1"]) / guarantee["gamma"] - 1) < 1e-6,
    }


def ahead(limit, proved):
    """Whether what is proved is better than a limit, in every number of both."""
    signs = {"gamma": -1, "lipschitz": 1, "T2": 1, "alpha": 1, "decay": 1}
    by = [sign * (proved[key] - limit[key]) for key, sign in signs.items() if key in limit and key in proved]
    return bool(by) and min(by) >= 0 and max(by) > 0


def is_clocked(witnesses):
    """Whether there is a witness of gamma, and each has matrices of exact numbers, a list of them for each segment."""
    return "gamma" in witnesses and all(
        len(witness["P"]) == len(witness["knots"]) - 1
        and all(is_matrix(value, is_exact) for segment in witness["P"] for value in segment)
        for witness in witnesses.values()
    )


def rules_of_certificate(certificate, status):
    """Its witness is exact, and its checks have names and answers, which are true if the claim is proved."""
    checks = certificate.get("checks", [])
    return {
        "certificate.kind": certificate.get("kind") in {"exact", "balls"},
        "a storage function is a matrix of exact numbers": any(
            is_matrix(value, is_exact) for name, value in certificate.items() if name.startswith("P")
        )
        or is_clocked(certificate.get("witnesses", {})),
        "a check has a name and an answer": bool(checks)
        and all(check.get("name") and isinstance(check.get("holds"), bool) for check in checks),
        "what is certified holds": status != "certified" or all(check["holds"] for check in checks),
    }


def differences(one, other, where=""):
    """Fields in which two dataclasses differ, and entries of what they hold."""
    if is_dataclass(one) and not isinstance(one, type) and type(one) is type(other):
        for part in fields(one):
            yield from differences(getattr(one, part.name), getattr(other, part.name), f"{where}.{part.name}")
    elif isinstance(one, tuple | list) and isinstance(other, tuple | list) and len(one) == len(other):
        for i, pair in enumerate(zip(one, other, strict=True)):
            yield from differences(*pair, f"{where}[{i}]")
    elif isinstance(one, Mapping) and isinstance(other, Mapping) and one.keys() == other.keys():
        for key in one:
            yield from differences(one[key], other[key], f"{where}.{key}")
    elif isinstance(one, np.ndarray):
        if np.shape(other) != one.shape or (one != other).any():
            yield where
    elif one != other:
        yield where
