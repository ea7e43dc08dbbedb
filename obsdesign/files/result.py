"""Result files: what stands in them, and how it is read back exactly.

A number in a result file is a decimal that is read as written, or a text "p/q" of any length.
"""

import hashlib
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from decimal import Decimal
from fractions import Fraction
from typing import Any, Self

import numpy as np
from flint import fmpq, fmpz

from obsdesign.disk import LARGEST, content_of
from obsdesign.errors import EXIT, NOT_ONE_LINE, Problem, UsageError
from obsdesign.expressions.exact import decimal
from obsdesign.lmi.formula import Array, Unknown, approximate, printed, rational, rational_number
from obsdesign.lmi.proof import Check

LONGEST = 100_000  # characters of one number
LEGIBLE = 60  # .. in a message
DEEPEST = 50  # objects and lists within each other
LARGEST_POWER = 400  # of ten
SHORT = re.compile(r"-?[0-9]{1,50}(\.[0-9]{1,50})?", re.ASCII)  # a decimal that needs no care
SUMMARY = {"specs", "counts"}  # keys that tell the summary of a batch from a result
NUMBER = re.compile(r"-?\d+/0*[1-9]\d*|-?\d+(\.\d+)?([eE][-+]?\d{1,9})?", re.ASCII)


class ResultFile:
    """A result file, read exactly.

    Raises `UsageError` if it is unreadable, no result of this format, or holds what is no number where one must stand.
    """

    def __init__(self, path: str, raw: bytes) -> None:
        self.path, self.raw = path, raw
        self.content = self.parsed(raw)
        if self.content.keys() >= SUMMARY:
            said = "is the summary of a batch; give a gains file of it (specs[..].files.gains), or `report` its folder"
            raise self.wrong("", said, id="OBS701")
        if self.content.get("obsdesign") != "1":
            raise self.wrong("obsdesign", "not a result of format 1", id="OBS701")

    @classmethod
    def open(cls, path: str) -> Self:
        """Read a file."""
        return cls(path, content_of(path, LARGEST))

    def parsed(self, raw: bytes) -> dict[str, Any]:
        """JSON with every number kept as the text that was written."""
        if len(raw) > LARGEST:
            raise self.wrong("", f"larger than {LARGEST} bytes", id="OBS701")
        try:
            content = json.loads(
                raw, parse_float=str, parse_int=str, parse_constant=self.no_number, object_pairs_hook=self.unique
            )
        except (ValueError, RecursionError) as error:
            if re.search(rb"^obsdesign\s*:", raw, re.MULTILINE):
                said = "is a spec; `obsdesign solve` makes of it the result file that is expected here"
                raise self.wrong("", said, id="OBS701") from None
            said = f"no result of `obsdesign solve`, which writes NAME.gains.json: not JSON: {error}"
            raise self.wrong("", said, id="OBS701") from None
        if not isinstance(content, dict):
            raise self.wrong("", "not a result file: an object is expected", id="OBS701")
        self.require_lines(content)
        return content

    def require_lines(self, content: dict[str, Any]) -> None:
        """Refuse a key, or a text besides that of the spec, of more than one line: it would forge what is printed.

        And what is nested deeper than anything that is written, so that whoever reads it may recurse.
        """
        parts: list[tuple[str, Any, int]] = [("", content, 0)]
        while parts:
            path, value, depth = parts.pop()
            if depth > DEEPEST:
                said = f"holds lists or objects more than {DEEPEST} deep; a result holds what `solve` writes"
                raise self.wrong(".".join(path.split(".")[:2]), said, id="OBS702")
            entries = value if isinstance(value, list) else (value,)
            texts = "".join(entry for entry in entries if isinstance(entry, str)) if path != "spec.text" else ""
            if found := NOT_ONE_LINE.search(texts):
                raise self.wrong(
                    path, f"holds the character U+{ord(found[0]):04X}; a result holds texts of one line", id="OBS702"
                )
            keys = value if isinstance(value, dict) else ()
            if found := NOT_ONE_LINE.search("".join(keys)):
                raise self.wrong(
                    path or "a key", f"a key holds the character U+{ord(found[0]):04X}; expected one line", id="OBS702"
                )
            parts += [(f"{path}.{key}".removeprefix("."), value[key], depth + 1) for key in keys]
            inner = value if isinstance(value, list) else ()
            parts += [(path, part, depth + 1) for part in inner if isinstance(part, dict | list)]

    def plain(self) -> dict[str, Any]:
        """JSON with numbers as doubles and integers, as it is written and nothing more."""
        try:
            content: dict[str, Any] = json.loads(self.raw)
        except ValueError as error:  # an integer of more digits than are converted
            raise self.wrong("", str(error), id="OBS702") from None
        return content

    def unique(self, pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        """Object of its entries; one that is given twice would mean one thing to one reader, another to the next."""
        made = dict(pairs)
        if len(made) < len(pairs):
            twice = next(key for i, (key, _) in enumerate(pairs) if key in dict(pairs[:i]))
            raise self.wrong(
                twice[:40], "is given twice in the same object; a result holds every key once", id="OBS702"
            )
        return made

    def no_number(self, text: str) -> None:
        """Refuse NaN and infinities."""
        raise self.wrong("", f"{text} is no number; a result holds finite numbers only", id="OBS702")

    def wrong(self, key: str, message: str, *, id: str) -> UsageError:
        """Error about one key, or about the whole file without one."""
        return UsageError(Problem(message, self.path, key=key, id=id))

    def require_asked(self, ends: tuple[fmpq, fmpq | None], *keys: str) -> None:
        """Refuse a number that is not between the ends, printed, that the spec asks for; None: no upper one."""
        low, high = (None if end is None else printed(end) for end in ends)
        found = self.number(*keys)
        if found < low or (high is not None and found > high):
            raise self.unasked(ends, *keys)

    def unasked(self, ends: tuple[fmpq, fmpq | None], *keys: str) -> UsageError:
        """Error about a number that is not what the spec asks for, each as it is written."""
        low, high = (None if end is None else repr(approximate(end)) for end in ends)
        asked = low if low == high else f"at least {low}" if high is None else f"from {low} to {high}"
        said = f"{str(self.at(*keys))[:LEGIBLE]} is not what the spec asks for, {asked}"
        return self.wrong(".".join(keys), said, id="OBS707")

    def at(self, *keys: str) -> Any:
        """Entry at a path of keys, which must exist."""
        value: Any = self.content
        for i, key in enumerate(keys):
            if not isinstance(value, dict) or key not in value:
                raise self.wrong(".".join(keys[: i + 1]), "missing", id="OBS702")
            value = value[key]
        return value

    @property
    def status(self) -> str:
        """How the design ended."""
        found = self.at("status")
        if found not in [*EXIT]:
            raise self.wrong("status", f"{str(found)[:40]!r} is none; expected {', '.join(EXIT)}", id="OBS702")
        return str(found)

    def spec_text(self) -> str:
        """Text of the spec that travels in the file, if its hash is right."""
        text, found = self.at("spec", "text"), self.at("spec", "sha256")
        try:
            right = isinstance(text, str) and digest(text) == found
        except UnicodeEncodeError:
            raise self.wrong(
                "spec.sha256", "not the hash of spec.text, which is not valid Unicode", id="OBS703"
            ) from None
        if not right:
            raise self.wrong("spec.sha256", "not the hash of spec.text: the spec in the file was altered", id="OBS703")
        if further := self.table("spec").keys() - {"path", "sha256", "text", "set"}:
            raise self.wrong(f"spec.{min(further)}", "is not known; expected path, sha256, text and set", id="OBS703")
        return str(text)

    def changes(self) -> tuple[str, ...]:
        """Changes of single keys of the spec that travels in the file."""
        found = self.table("spec").get("set", [])
        if not isinstance(found, list) or not all(isinstance(change, str) for change in found):
            raise self.wrong("spec.set", "expected a list of texts such as observer.alpha=0.5", id="OBS703")
        return tuple(found)

    def number(self, *keys: str) -> fmpq:
        """Exact value of one number."""
        return self.exact(self.at(*keys), ".".join(keys))

    def numbers(self, *keys: str) -> list[fmpq]:
        """Exact values of one number or of a list of them."""
        found = self.at(*keys)
        return [self.exact(x, ".".join(keys)) for x in (found if isinstance(found, list) else [found])]

    def matrix(self, shape: tuple[int, int], *keys: str) -> Array:
        """Exact matrix of a given shape."""
        rows, name = self.at(*keys), ".".join(keys)
        regular = isinstance(rows, list) and all(isinstance(r, list) and len(r) == shape[1] for r in rows)
        if not regular or len(rows) != shape[0]:
            raise self.wrong(name, f"expected a {shape[0]}x{shape[1]} matrix", id="OBS702")
        entries = [[self.exact(x, name) for x in row] for row in rows]
        return rational(np.array(entries, dtype=object).reshape(shape))

    def stack(self, shape: tuple[int, ...], *keys: str) -> Array:
        """Exact numbers of a given shape, in lists of lists."""
        name = ".".join(keys)

        def entries(part: Any, shape: tuple[int, ...]) -> Iterator[fmpq]:
            if not shape:
                yield self.exact(part, name)
            elif isinstance(part, list) and len(part) == shape[0]:
                for each in part:
                    yield from entries(each, shape[1:])
            else:
                raise self.wrong(name, f"expected numbers in lists of {' x '.join(map(str, whole))}", id="OBS702")

        whole = shape
        return np.array([*entries(self.at(*keys), shape)], dtype=object).reshape(shape)

    def unknowns(self, unknowns: Iterable[Unknown], *keys: str) -> dict[str, Array]:
        """Exact values of unknowns: a number for a 1x1 one, else rows."""
        values = {}
        for unknown in unknowns:
            path = (*keys, unknown.name)
            if unknown.shape == (1, 1):
                values[unknown.name] = rational([[self.number(*path)]])
                continue
            values[unknown.name] = matrix = self.matrix(unknown.shape, *path)
            if unknown.symmetric and (matrix != matrix.T).any():
                raise self.wrong(".".join(path), "not symmetric", id="OBS702")
        return values

    def matrices(self, *keys: str) -> dict[str, Array]:
        """Exact square matrices by name, of whatever size they have."""
        made = {}
        for name, rows in self.table(*keys).items():
            size = len(rows) if isinstance(rows, list) else 0
            made[name] = self.matrix((size, size), *keys, name)
        return made

    def table(self, *keys: str) -> dict[str, Any]:
        """Object at a path of keys."""
        found = self.at(*keys)
        if not isinstance(found, dict):
            raise self.wrong(".".join(keys), "expected an object", id="OBS702")
        return found

    def exact(self, text: Any, name: str) -> fmpq:
        """Rational of a decimal or of "p/q"."""
        if isinstance(text, str) and len(text) > LONGEST:
            raise self.wrong(name, f"a number of {len(text):,} characters; at most {LONGEST:,} are read", id="OBS702")
        if isinstance(text, str) and SHORT.fullmatch(text):
            return decimal(text)
        try:
            if not isinstance(text, str) or not NUMBER.fullmatch(text):
                raise ValueError
            if "/" in text:
                found = fmpq(*(fmpz(part) for part in text.split("/")))
            else:
                number = Decimal(text)
                if abs(number.adjusted()) > LARGEST_POWER:
                    raise ValueError
                found = rational_number(Fraction(number))
        except (ValueError, ArithmeticError):
            raise self.wrong(name, f"{str(text)[:40]!r} is no finite number", id="OBS702") from None
        if math.isinf(approximate(found)):
            raise self.wrong(name, "is beyond what doubles can hold", id="OBS508")
        return found


def rows(matrix: Array) -> list[list[str]]:
    """Exact entries."""
    return [list(map(str, row)) for row in matrix]


def written(value: Array) -> str | list[list[str]]:
    """Exact value of an unknown: a number, or rows."""
    return str(value.item()) if value.shape == (1, 1) else rows(value)


def checks(found: Iterable[Check]) -> list[dict[str, Any]]:
    """Conditions and whether they hold."""
    return [{"name": c.name, "holds": c.holds, "margin": c.margin if np.isfinite(c.margin) else None} for c in found]


def witness(storage: Mapping[str, Array], multipliers: Mapping[str, Array], found: Iterable[Check]) -> dict[str, Any]:
    """Exact matrices of a storage function and multipliers, and what was checked of them."""
    matrices = {name: rows(P) for name, P in storage.items()}
    scales = {name: written(value) for name, value in multipliers.items()}
    return {"kind": "exact", **matrices, "multipliers": scales, "checks": checks(found)}


def digest(text: str) -> str:
    """SHA-256 of a spec's text."""
    return hashlib.sha256(text.encode()).hexdigest()


def release(package: str) -> str:
    """Version of an installed package; what reads it is imported here, for no proof needs it."""
    from importlib.metadata import version

    return version(package)


def to_json(value: Any) -> str:
    """JSON with one line for each key, row of a matrix, and flat object."""
    return render(value, "") + "\n"


def as_read(value: Any) -> Any:
    """Value as `ResultFile` reads it from what is written, every number as its text."""
    return json.loads(json.dumps(value), parse_float=str, parse_int=str)


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
