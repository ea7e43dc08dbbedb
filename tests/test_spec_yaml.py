"""The YAML of specs: readings of YAML 1.2, and files that are refused before they do harm."""

import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from support.bounded import soon
from support.commands import run
from support.sweep import examples

from obsdesign.errors import UsageError
from obsdesign.reading import Spec, load, loads
from obsdesign.sections.document import compose

PLAIN = """\
obsdesign: 1
system: {{A: {a}, C: 1}}
observer: {{type: l2, alpha: 1}}
"""
BOMB = (
    PLAIN.format(a="*z12")
    + "z0: &z0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]\n"
    + "".join(f"z{i + 1}: &z{i + 1} [{', '.join([f'*z{i}'] * 10)}]\n" for i in range(12))
)
BOMB = BOMB[len(PLAIN.format(a="*z12")) :] + PLAIN.format(a="*z12")


def entry(text):
    return loads(PLAIN.format(a=text)).plant.A[0, 0]


def first_problem(text):
    with soon(), pytest.raises(UsageError) as caught:
        loads(text)
    return caught.value.problems[0]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", fmpq(1, 1000)),
        ("1E+2", fmpq(100)),
        ("1.0e+4", fmpq(10000)),
        ("0.1", fmpq(1, 10)),
        (".5", fmpq(1, 2)),
        ("5.", fmpq(5)),
        ("+3", fmpq(3)),
        ("-3", fmpq(-3)),
        ("010", fmpq(10)),
        ("-007", fmpq(-7)),
        ("00.5", fmpq(1, 2)),
        ("0x10", fmpq(16)),
        ("0o10", fmpq(8)),
        ("'1e-3'", fmpq(1, 1000)),
        ('"1/3"', fmpq(1, 3)),
        ("2*(3 - 1)", fmpq(4)),
        ("0.1234567890123456789", fmpq(1234567890123456789, 10**19)),
        ("1e-300", fmpq(1, 10**300)),
        ("sqrt(4)", fmpq(2)),
    ],
)
def test_a_number_is_exactly_what_is_written(text, value):
    assert entry(text) == value


@pytest.mark.parametrize("word", ["no", "on", "off", "yes", "y", "2001-12-10", "12:30", "1_000", "null island"])
def test_what_yaml_1_1_would_turn_into_something_else_is_text(word):
    spec = loads(PLAIN.format(a=1) + f"name: {word}\nsource: {word}\n")
    assert spec.name == spec.source == word


def test_a_number_is_also_text_where_text_is_expected():
    assert loads(PLAIN.format(a=1) + "name: 2019\nsource: 1.50\n").source == "1.50"


@pytest.mark.parametrize("text", ["0b11", "1__0", "1e", "0x", "0o8", "١", "1,5", "nan", "inf", "on"])
def test_what_is_no_number_is_refused_where_a_number_is_expected(text):
    assert first_problem(PLAIN.replace("{{", "{").replace("}}", "}").replace("{a}", f"'{text}'")).key == "system.A"


def test_an_anchor_may_be_used_where_a_value_repeats():
    spec = loads("obsdesign: 1\nsystem: {A: &m [[0, 1], [1, 0]], B: *m, C: *m}\nobserver: {type: l2, alpha: 1}\n")
    assert (spec.plant.A == spec.plant.C).all()


def test_a_byte_order_mark_and_windows_line_ends_do_not_matter(tmp_path):
    path = tmp_path / "spec.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + PLAIN.format(a=2).replace("\n", "\r\n").encode())
    assert load(str(path)).plant.A[0, 0] == 2


def test_a_block_or_quoted_text_is_placed_at_its_beginning():
    text = PLAIN.format(a=1) + "simulation:\n  horizon: >-\n    1 +\n    oops\n"
    problem = first_problem(text)
    assert (problem.key, problem.line, problem.column) == ("simulation.horizon", 5, 12)


def lines(*repeated):
    return PLAIN.format(a=1) + "".join(repeated)


HOSTILE = {
    "an alias bomb": BOMB,
    "an alias bomb of mappings": "a: &a {x: 1, y: 1}\n"
    + "".join(f"a{i}: &a{i} {{x: *a{i - 1 if i else ''}, y: *a{i - 1 if i else ''}}}\n" for i in range(40)),
    "an alias of itself": "a: &a {b: *a}\n",
    "an alias chain": "a0: &a0 [1]\n" + "".join(f"a{i + 1}: &a{i + 1} [*a{i}]\n" for i in range(2000)),
    "a tower of brackets": "a: " + "[" * 2_000_000,
    "a tower of braces": "a: " + "{b: " * 500_000,
    "a tower of dashes": "- " * 1_000_000,
    "a staircase": "".join(f"{' ' * i}a:\n" for i in range(1000)),
    "an open quote": lines("name: '", "a\n" * 1_000_000),
    "a very long scalar": PLAIN.format(a="1" * 4_000_000),
    "very many values": PLAIN.format(a=f"[{'1,' * 2_000_000}]"),
    "very many keys": "".join(f"a{i}: 1\n" for i in range(300_000)),
    "one key very often": "a: 1\n" * 500_000,
    "very many documents": "---\n" * 1_000_000,
    "very many wrong entries": PLAIN.format(a=f"[{f'[{chr(44).join([chr(120)] * 300)}],' * 300}]"),
    "very many blocks": lines("nonlinearities:\n", "  - {type: monotone}\n" * 40_000),
    "very many duplicates": lines("system: 1\n" * 100_000),
    "very many tags": lines("x: [", "!a 1, " * 100_000, "]"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_text_is_refused_at_once(name):
    assert first_problem(HOSTILE[name]).message


FILES = {
    "empty": (b"", "is empty"),
    "blank": (b" \n\n  \n", "is empty"),
    "a comment": (b"# nothing\n", "is empty"),
    "a null": (b"~\n", "is empty"),
    "markers only": (b"---\n...\n", "is empty"),
    "a list": (b"- 1\n- 2\n", "expected a mapping"),
    "a word": (b"hello\n", "expected a mapping with the keys obsdesign"),
    "a PNG": (b"\x89PNG\r\n\x1a\n" + bytes(range(256)), "is not UTF-8 text"),
    "an ELF": (b"\x7fELF\x01\x01\x01\x00\x00", "U+007F"),
    "zeros": (bytes(1000), "U+0000"),
    "Latin-1": ("name: Lörd".encode("latin-1"), "is not UTF-8 text"),
    "UTF-16": ("name: x".encode("utf-16"), "is not UTF-8 text"),
    "a surrogate": (b'name: "\xed\xa0\x80"', "is not UTF-8 text"),
    "oversize": (b"#" * (4 * 2**20 + 1), "larger than 4 MiB"),
    "JSON that is no spec": (b'{"a": 1}', "is required"),
    "Python": (b"import os\nos.system('true')\n", "expected a mapping"),
    "HTML": (b"<!DOCTYPE html>\n<html><body>404</body></html>\n", "expected a mapping"),
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_is_no_spec_is_refused(tmp_path, name):
    content, words = FILES[name]
    path = tmp_path / "spec.yaml"
    path.write_bytes(content)
    with pytest.raises(UsageError, match=r".") as caught:
        load(str(path))
    assert words in caught.value.problems[0].message
    assert all(problem.file == str(path) for problem in caught.value.problems)


def test_a_file_of_just_4_mib_is_read(tmp_path):
    path = tmp_path / "spec.yaml"
    text = PLAIN.format(a=1)
    path.write_text(text + "#" * (4 * 2**20 - len(text)))
    assert load(str(path)).plant.n == 1


@pytest.mark.parametrize("path", ["no/such/file.yaml", ".", "a\0b", "/dev/zero"])
def test_what_is_no_readable_file_is_refused(path):
    with pytest.raises(UsageError) as caught:
        load(path)
    (problem,) = caught.value.problems
    assert problem.file == path


def test_a_file_without_permission_is_refused(tmp_path, monkeypatch):
    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(UsageError, match="cannot be read: Permission denied"):
        load(str(tmp_path / "spec.yaml"))


MEASURED = """
import re, sys
from pathlib import Path
from obsdesign.errors import UsageError
from obsdesign.reading import loads
try:
    loads(sys.stdin.read())
except UsageError as error:
    print(error.exit_code, *re.findall(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text()))
"""  # ru_maxrss would be that of the process that started this one, if that is larger


@pytest.mark.parametrize("name", ["an alias bomb", "very many values"])
def test_a_hostile_text_takes_little_memory(name):
    run = subprocess.run(
        [sys.executable, "-c", MEASURED],
        input=HOSTILE[name],
        capture_output=True,
        text=True,
        check=True,
        timeout=20,
    )
    code, kilobytes = map(int, run.stdout.split())
    assert code == 2
    assert kilobytes < 500_000
    assert run.stderr == ""


def read_or_refused(text):
    try:
        return isinstance(loads(text), Spec)
    except UsageError as error:
        return all(problem.message and "\n" not in str(problem) for problem in error.problems)


@examples(100, deadline=2000)
@given(st.text(max_size=200))
def test_any_text_is_a_spec_or_refused(text):
    assert read_or_refused(text)


SHIPPED = (Path(__file__).parent.parent / "specs" / "corless2019-magnetic-bearing.yaml").read_text()


@examples(200, deadline=2000)
@given(
    st.integers(0, len(SHIPPED)),
    st.integers(0, 12),
    st.text(alphabet="[]{}:,-&*!|>'\"#%@`?~ \n\t01.eqxyw", max_size=8),
)
def test_a_spec_with_random_damage_is_a_spec_or_refused(start, length, replacement):
    assert read_or_refused(SHIPPED[:start] + replacement + SHIPPED[start + length :])


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.sampled_from(["q", "t", "x1", "w", "all", "b*2", "0"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(["type", "H", "omega", "a"]), inner),
    max_leaves=6,
)
KEYS = [
    "system.A", "system.B", "system.C", "system.D", "system.gx", "system.states", "system.units", "parameters",
    "nonlinearities", "disturbance", "performance", "observer", "observer.L2", "observer.alpha", "observer.bounds",
    "observer.gains", "observer.objective", "simulation", "simulation.x0", "simulation.noise", "expect", "name",
]  # fmt: skip


@examples(100, deadline=2000)
@given(st.dictionaries(st.sampled_from(KEYS), VALUES, max_size=3))
def test_any_value_under_any_key_is_read_or_refused(changes):
    tree = yaml.safe_load(SHIPPED)
    for key, value in changes.items():
        section, _, name = key.partition(".")
        if name and isinstance(tree.get(section), dict):
            tree[section][name] = value
        else:
            tree[section] = value
    assert read_or_refused(yaml.safe_dump(tree))


FORGED = """obsdesign: 1
name: "Cart\\nproved     everything"
"sys\\ntem": {}
system: {A: [[0, 1], [-2, -1]], C: [[1, 0]], states: [p, v], units: {p: "m\\nproved"}}
observer: {type: l2, alpha: "0.1\\e[31m"}
expect: {status: "certified\\nproved", limit: {verified: ["a\\u2028b"]}}
description: "of more\\nthan one line"
"""


def test_texts_that_would_forge_lines_of_what_is_printed_are_refused(tmp_path):
    spec = tmp_path / "forged.yaml"
    spec.write_text(FORGED)
    outcome = run("solve", spec)
    lines = outcome.stderr.splitlines()
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert [line.removeprefix(f"{spec}:").split(": ")[0] for line in lines if line.startswith(f"{spec}:")] == [
        *("2:7", "3:1", "4:73", "5:29", "6:18", "6:46"),
    ]
    assert len(lines) == 6
    assert "name: expected one line of text" in lines[0]
    assert "a key is one line of text; this one holds the character U+000A" in lines[1]


# Rows of numbers, which are read in one go


ROWS = """\
obsdesign: 1
name: rows
system:
  A: [[0, -1.5, 2e-3],
      [ -0.25,1E+2,
   3.,
 -7 ], [1, +2, .5], [1, 2, 3], # a comment
    [0xF, 1/2, "3"], &r [4, 5, 6], *r, [7, 8, 9,], [1, # one
      2]]
  B: [1]
  C: []
"""


def places(node, loc=()):
    """Line, column, index and text of every scalar and list of a tree, as PyYAML itself composes it."""
    children = {}
    if isinstance(node, yaml.SequenceNode):
        children = dict(enumerate(node.value))
    elif isinstance(node, yaml.MappingNode):
        children = {key.value: value for key, value in node.value}
    mark = node.start_mark
    yield loc, (mark.line + 1, mark.column + 1, mark.index)
    for name, child in children.items():
        yield from places(child, (*loc, name))


def test_every_number_of_a_row_knows_its_place():
    document = compose(ROWS, "rows.yaml")
    expected = dict(places(yaml.compose(ROWS, yaml.SafeLoader)))
    found = {loc: document.find(loc)[1][1:4] for loc in expected}
    assert found == expected
    assert len(expected) > 30
    rows = document.root.plain()["system"]["A"]
    assert rows[:3] == [["0", "-1.5", "2e-3"], ["-0.25", "1E+2", "3.", "-7"], ["1", "+2", ".5"]]
    assert document.root.size == sum(1 for loc in expected)


def test_a_row_of_numbers_is_as_exact_as_one_of_expressions():
    texts = [
        "0",
        "-0",
        "1.",
        "-2.50",
        "1e-3",
        "-12.5E+2",
        "0.1234567890123456789",
        "9e99",
        "-1e-99",
        "1234567890123456789",
    ]
    one = [loads(PLAIN.format(a=f"[[{text}]]")).plant.A[0, 0] for text in texts]
    other = [loads(PLAIN.format(a=f"[['{text}']]")).plant.A[0, 0] for text in texts]
    assert one == other
