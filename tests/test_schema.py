"""The JSON Schema and the reader of a spec take the same structures: an editor and `solve` never disagree on one."""

from pathlib import Path

import yaml
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from support.sweep import examples

from obsdesign.reading import json_schema
from obsdesign.reading.schema import read_file
from obsdesign.sections.document import compose
from obsdesign.sections.scalars import Number
from obsdesign.sections.values import Reader

SPECS = [p for p in sorted((Path(__file__).parent.parent / "specs").rglob("*.yaml")) if p.parent.name != "large"]
TREES = [yaml.safe_load(path.read_text()) for path in SPECS]
SCHEMA = json_schema()
VALID = Draft202012Validator(SCHEMA).is_valid


def keys_in(schema):
    """Every key that the schema knows."""
    if isinstance(schema, dict):
        yield from schema.get("properties", {}) if isinstance(schema.get("properties"), dict) else ()
        for inner in schema.values():
            yield from keys_in(inner)
    elif isinstance(schema, list):
        for inner in schema:
            yield from keys_in(inner)


KEYS = sorted({*keys_in(SCHEMA), "nonesuch", "q"})
WORDS = ["auto", "free", "l2", "linf", "lipschitz", "sporadic", "integrator", "sin", "x", "min-gamma", "a + b", ""]
single = st.one_of(st.integers(-2, 3), st.sampled_from([0.5, 1e-3]), st.sampled_from(WORDS), st.booleans())
values = st.recursive(
    single,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(KEYS), inner, max_size=2),
    max_leaves=5,
)


@st.composite
def changed(draw, tree):
    """The same tree with one value replaced, taken away or put in, however deep it stands."""
    inner = [key for key, value in pairs(tree) if isinstance(value, dict | list) and value]
    if inner and draw(st.integers(0, 4)):
        key = draw(st.sampled_from(inner))
        new = draw(changed(tree[key]))
    else:
        key = draw(st.sampled_from([key for key, _ in pairs(tree)]))
        new = draw(values)
    copy = dict(tree) if isinstance(tree, dict) else list(tree)
    if isinstance(copy, dict) and new is not tree[key]:
        kind = draw(st.sampled_from(["replace", "replace", "insert", "remove"]))
        if kind == "remove" and not isinstance(new, dict | list):
            del copy[key]
            return copy
        key = draw(st.sampled_from(KEYS)) if kind == "insert" and not isinstance(new, dict) else key
    copy[key] = new
    return copy


def pairs(tree):
    """Keys and values of a mapping, or of a list."""
    return list(tree.items()) if isinstance(tree, dict) else list(enumerate(tree))


def plain(value):
    """What a JSON Schema sees of a document."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [plain(item) for item in value]
    return (
        float(value)
        if isinstance(value, Number) and value.strip(".+-infINFaA")
        else str(value)
        if isinstance(value, str)
        else value
    )


def accepted(document):
    """Whether the structure of a document is that of a spec."""
    reader = Reader(document, list(document.problems))
    read_file(reader)
    return not reader.problems


@examples(400)
@given(st.sampled_from(TREES).flatmap(changed))
def test_schema_and_reader_agree_on_the_structure_of_a_spec(tree):
    document = compose(yaml.safe_dump(tree), "spec.yaml")
    assert VALID(plain(document.root.plain())) == accepted(document)


def test_both_kinds_of_answer_occur():
    trees = [dict(tree) for tree in TREES]
    assert all(VALID(tree) for tree in trees)
    assert not any(VALID(tree | {"observer": {"type": "nonesuch"}}) for tree in trees)


def test_the_type_alone_is_a_valid_observer_where_nothing_else_is_required():
    spec = {"obsdesign": 1, "system": {"A": 0, "C": 1}}
    for name in ("l2", "linf", "lipschitz"):
        assert VALID(spec | {"observer": {"type": name}})
    assert not VALID(spec | {"observer": {"type": "sporadic"}})
    assert not VALID(spec | {"observer": {}})
