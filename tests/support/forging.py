"""Result files with other numbers in them, as one would forge them."""

import hashlib
import json
from fractions import Fraction

import numpy as np

from obsdesign.families import FAMILIES
from obsdesign.families.outcome import Outcome, Verdict
from obsdesign.reading import loads


def at(content, keys):
    """Entry at a path of keys."""
    for key in keys:
        content = content[key]
    return content


def put(content, keys, value):
    """Replace the entry at a path of keys."""
    at(content, keys[:-1])[keys[-1]] = value
    return content


def scaled(content, keys, factor):
    """Multiply the number at a path of keys, or every entry of a list or matrix there; texts are exact numbers."""

    def times(x):
        if isinstance(x, list):
            return [times(y) for y in x]
        return str(Fraction(x) * Fraction(factor)) if isinstance(x, str) else x * float(Fraction(factor))

    return put(content, keys, times(at(content, keys)))


def claiming(content, old, new, **numbers):
    """A content with other numbers in its guarantee, and a statement that says so in place of an old number or text."""
    guarantee = content["guarantee"]
    old, new = (x if isinstance(x, str) else repr(x) for x in (old, new))
    assert old in guarantee["statement"]
    content["guarantee"] = guarantee | numbers | {"statement": guarantee["statement"].replace(old, new)}
    return content


def with_figures(content):
    """A content with what is computed of its gains, such as poles."""
    made, spec = content["observer"], loads(content["spec"]["text"], "forged.yaml")
    gains = {name: np.array(made[name], dtype=float) for name in ("L1", "L2", "L", "H") if name in made}
    found = FAMILIES[made["type"]].written(spec, Outcome(Verdict.CERTIFIED, gains))
    content["observer"] = made | json.loads(json.dumps(found))
    return content


def with_spec(content, old, new):
    """A content whose spec is changed, and whose hash says so."""
    assert content["spec"]["text"].count(old) == 1
    return with_text(content, content["spec"]["text"].replace(old, new))


def with_text(content, text):
    """A content with another spec, and its hash."""
    content["spec"] |= {"text": text, "sha256": hashlib.sha256(text.encode()).hexdigest()}
    return content
