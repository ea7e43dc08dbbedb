"""The entries of the manual on the keys of a spec, which come from the sections that read them."""

import re

import pytest
from jsonschema import Draft202012Validator
from support.commands import run

from obsdesign.families import FAMILIES
from obsdesign.reading import json_schema
from obsdesign.reading.reference import entries, explained, listed, parts, walked
from obsdesign.reading.schema import File
from obsdesign.sections.document import compose
from obsdesign.sections.values import Reader

KEYS = list(walked(File, ""))
SCHEMA = json_schema()


def named(schema, path=()):
    """Dotted names of all keys that the JSON Schema has."""
    if "$ref" in schema:
        yield from named(SCHEMA["$defs"][schema["$ref"].rpartition("/")[2]], path)
    for inner in (*schema.get("oneOf", ()), *schema.get("anyOf", ())):
        yield from named(inner, path)
    if isinstance(schema.get("items"), dict):
        yield from named(schema["items"], path)
    for name, inner in schema.get("properties", {}).items():
        yield (*path, name)
        yield from named(inner, (*path, name))


def described():
    """Keys of every section of the JSON Schema."""
    sections = {"File": SCHEMA, **SCHEMA["$defs"]}
    for title, section in sections.items():
        for name, one in section.get("properties", {}).items():
            yield pytest.param(section, name, one, id=f"{title}.{name}")


def test_every_key_of_the_schema_has_an_entry():
    known = {tuple(re.split(r"\.", name)) for name in entries()}
    again = ("disturbance", "type")  # what may stand beside the type may stand in it
    assert {path for path in named(SCHEMA) if path[:2] != again or len(path) == 2} == known


@pytest.mark.parametrize(("section", "name", "one"), list(described()))
def test_a_key_of_the_schema_tells_what_it_is_its_default_and_an_example(section, name, one):
    assert len(one["description"]) > 3
    choice = any("required" in kind for kind in section.get("oneOf", ()))
    assert name in section.get("required", ()) or "default" in one or "default: " in one["description"] or choice
    (example,) = one["examples"]
    assert Draft202012Validator({**one, "$defs": SCHEMA["$defs"]}).is_valid(example)


@pytest.mark.parametrize(("name", "one"), [(name, one) for name, one, _ in KEYS])
def test_an_example_is_read_without_a_word(name, one):
    document = compose(one.example, name)
    reader = Reader(document, list(document.problems))
    assert one.form.read(reader, document.root.plain(), ()) is not None
    assert reader.problems == []


@pytest.mark.parametrize("name", sorted(entries()))
def test_the_entry_of_a_key_tells_form_and_default(name):
    outcome = run("explain", name)
    assert (outcome.exit_code, outcome.stderr) == (0, "")
    assert outcome.stdout.startswith(f"## {name}\n\n")
    for fact in ("form", "default", "example"):
        assert f"\n- {fact}: " in outcome.stdout


def test_the_entry_of_a_key_that_several_families_take_tells_it_of_each():
    said = run("explain", "observer.bounds").stdout
    assert "Type l2, linf: " in said
    assert "Type sporadic: " in said
    assert run("explain", "observer.type").stdout.startswith("## observer.type\n\nType l2, linf, sporadic, lipschitz, ")


def test_a_unit_and_a_default_are_those_that_the_design_takes():
    said = run("explain", "observer.alpha").stdout
    assert "- unit: 1/s\n" in said
    assert "- default: searched from 0.001 to 1000\n" in said
    assert "- default: min-gamma\n" in run("explain", "observer.objective").stdout
    assert run("explain", "nonlinearities[0].Bf").stdout.startswith("## nonlinearities[0].Bf\n\nnx x nf_i")


def test_the_page_on_specs_ends_with_all_keys():
    page = run("explain", "spec").stdout
    assert page.startswith("# The keys of a spec\n")
    for name, _ in listed():
        assert re.search(rf"^{re.escape(name)}  +\S", page, re.MULTILINE), name
    written = {(section, name.rpartition(".")[2]) for name, _, section in KEYS}
    shown = {(entry.section, name.rpartition(".")[2]) for name, _ in listed() for entry in entries()[name]}
    assert shown == written


@pytest.mark.parametrize(("wrong", "meant"), [("observer.alhpa", "observer.alpha"), ("tutrial", "tutorial")])
def test_what_was_probably_meant_is_said(wrong, meant):
    outcome = run("explain", wrong)
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert f"{wrong}: there is no page of it; did you mean {meant}? allowed: " in outcome.stderr


def test_sections_that_only_repeat_others_are_left_out():
    (disturbance,) = parts(File.forms()["disturbance"].form)
    assert {"sinusoid", "type"} < set(disturbance.forms())


def test_a_key_of_an_observer_names_all_types_that_have_it():
    for name, family in FAMILIES.items():
        for key in family.Section.forms():
            assert name in {known for entry in entries()[f"observer.{key}"] for known in entry.types}, key
    for key in ("Q", "R"):
        assert "\nType ekf, ukf, lqe: " in f"\n{explained(f'observer.{key}')}"
    assert "Type ekf, ukf: " in explained("observer.P0")
