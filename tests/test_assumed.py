"""A type that is neither proved of its f nor refuted says that it is assumed, wherever something rests on it."""

import json

import pytest
from support.commands import run
from support.forging import with_spec

BUMP = "f: q*exp(-q**2)"  # its slope is 1 at q = 0, and close to it everywhere near
SPEC = """\
obsdesign: 1
system: {{inputs: [d], A: [[-1]], B: [[1]], C: [[1]]}}
nonlinearities:
  - {{{block}, Bf: [1], Cq: [1]}}
observer: {{{observer}}}
"""
L2 = "type: l2, alpha: 0.1, bounds: {L1: 10}"
FAMILIES = [
    L2,
    "type: linf, alpha: 0.1, bounds: {L1: 10}",
    "type: lipschitz, bounds: {L: 10}",
    "type: sporadic, T1: 0.1, T2: 0.2",
]


def solved(folder, block, observer=L2):
    """Outcome of `solve`, and the file that it writes."""
    (folder / "s.yaml").write_text(SPEC.format(block=block, observer=observer))
    outcome = run("solve", folder / "s.yaml", "-o", folder / "g.json")
    assert outcome.exit_code == 0, outcome.output
    return outcome.stdout, json.loads((folder / "g.json").read_text())


def refused(folder, content):
    """What `verify` says to a file that it refuses."""
    (folder / "forged.json").write_text(json.dumps(content))
    outcome = run("verify", folder / "forged.json")
    assert outcome.exit_code == 2, outcome.output
    return outcome.stderr


@pytest.mark.parametrize("observer", FAMILIES)
@pytest.mark.parametrize(
    ("block", "assumed"),
    [
        (f"{BUMP}, type: {{lipschitz: 1}}", "lipschitz 1 of f (searched on |q| <= 10000, not proved)"),
        ("type: {lipschitz: 0.5}", "lipschitz 0.5 of f (no f is given)"),
        (
            "f: d*q*exp(-q**2), type: {lipschitz: 1, region: {q: [-1, .inf], d: [0, 1]}}",
            "lipschitz 1 of f (searched on q in [-1, 10000] and d in [0, 1], not proved)",
        ),
    ],
)
def test_what_is_assumed_stands_in_statement_notes_and_table(tmp_path, observer, block, assumed):
    table, content = solved(tmp_path, block, observer)
    assert content["assumed"] == [assumed]
    assert content["guarantee"]["statement"].endswith(f"; assumed: {assumed}")
    assert any("is assumed" in note for note in content["notes"])
    assert f"assumed {assumed}" in " ".join(table.split())
    verified = run("verify", tmp_path / "g.json")
    assert verified.exit_code == 0, verified.output
    assert verified.stdout.splitlines()[-1].endswith(f"; assumed: {assumed}")
    assert "assumed: is not what" in refused(tmp_path, {**content, "assumed": []})


@pytest.mark.parametrize(
    "block",
    [
        "f: 3.33*sin(q), type: {lipschitz: 3.33}",
        "f: 2*q + sin(q), type: {slope: [1, 3]}",
        "f: (1 - d)*q, type: {slope: [0.2, 0.8], region: {d: [0.2, 0.8]}}",
        "f: 2*q + sin(q), type: {sector: {K1: 1, K2: 3}}",
        "f: sin(q), type: {ball: {K: 0, W: 1}}",
        "f: sin(q), type: {one-sided-lipschitz: {rho: 1, beta: 1, phi: 0}}",
        "f: sin(q), type: {jacobian: [-1, 1]}",
        "f: q**3, type: {cone: [1]}",
        "f: 0.6*sin(q), type: {multiplier: [[1, 0.5], [0.5, -1]]}",
        "f: 2*q + sin(q), type: {multiplier: [[-6, 4], [4, -2]]}",
        "f: sin(q), type: sin",
        "f: -sin(-q), type: sin",
    ],
)
def test_what_is_proved_from_f_is_not_assumed_and_a_note_that_says_so_is_proved_anew(tmp_path, block):
    (tmp_path / "s.yaml").write_text(SPEC.format(block=block, observer="type: l2, alpha: 0.1, objective: {gamma: 2}"))
    checked = json.loads(run("check", tmp_path / "s.yaml", "--json").stdout)
    assert [note for note in checked["notes"] if "assumed" in note] == []
    assert any("is proved from f" in note for note in checked["notes"])


def test_what_is_assumed_of_f_cannot_be_left_out(tmp_path):
    _, content = solved(tmp_path, f"{BUMP}, type: {{lipschitz: 1}}")
    note = content["notes"][0]
    claimed = [note.split(" is assumed")[0] + " is proved from f", *content["notes"][1:]]
    assert "notes: leaves out what is known of the spec: " in refused(tmp_path, {**content, "notes": claimed})
    _, content = solved(tmp_path, "f: sin(q), type: {lipschitz: 1}")
    assert run("verify", tmp_path / "g.json").exit_code == 0
    forged = with_spec(content, "sin(q)", "q*exp(-q**2)")
    assert "assumed: is not what is neither proved nor refuted" in refused(tmp_path, forged)


@pytest.mark.parametrize(
    ("block", "words"),
    [
        ("f: 'sin(q) + max(0, abs(q) - 150)*5', type: sin", "f: differs from its type sin: sin(q) is"),
        ("f: 'sin(q) + max(0, abs(q) - 1e6)*5', type: sin", "type: sin is refuted by q = "),
        ("f: 'q + max(0, abs(q) - 1e6)*5', type: {slope: [0, 1]}", "type: slope [0, 1] is refuted by q = "),
        ("f: 'q + max(0, abs(q) - 1e6)', type: {lipschitz: 1}", "type: lipschitz 1 is refuted by q = "),
    ],
)
def test_a_type_is_refuted_far_out_too(tmp_path, block, words):
    (tmp_path / "s.yaml").write_text(SPEC.format(block=block, observer=L2))
    outcome = run("solve", tmp_path / "s.yaml")
    assert outcome.exit_code == 2
    assert words in outcome.stderr


def test_a_function_is_held_against_its_name_on_the_region_of_the_type_only(tmp_path):
    table, _ = solved(tmp_path, "f: sin(sat(q)), type: sin, region: {q: [-1, 1]}")
    assert "sin is proved from f" in table


@pytest.mark.parametrize("observer", FAMILIES)
@pytest.mark.parametrize("command", ["check", "solve", "simulate", "lipschitz"])
@pytest.mark.parametrize(
    ("f", "where"),
    [
        ("sqrt(-1)*q", "sqrt(-1)*q has no value anywhere"),
        ("acos(3) + exp(q)", "acos(3) + exp(q) has no value anywhere"),
        ("log(q)", "log(q) has no value at q = -0."),
        ("sqrt(d)*q", "sqrt(d)*q has no value at q = "),
        ("[asin(q)]", "asin(q) has no value at q = "),
    ],
)
def test_an_f_without_a_value_is_an_error_of_the_spec_at_its_place(tmp_path, command, observer, f, where):
    (tmp_path / "s.yaml").write_text(SPEC.format(block=f"f: {f}, type: {{lipschitz: 1}}", observer=observer))
    outcome = run(command, tmp_path / "s.yaml")
    assert outcome.exit_code == 2
    (line,) = outcome.stderr.splitlines()
    assert f"s.yaml:4:{9 + f.startswith('[')}: nonlinearities[0].f" in line
    assert where in line
    assert "give a region without that" in line


@pytest.mark.parametrize("type_", ["monotone", "{slope: [0, .inf]}", "auto", "{auto: {region: {q: [0.5, 2]}}}"])
def test_an_f_that_has_no_value_is_never_proved_to_be_of_a_type(tmp_path, type_):
    (tmp_path / "s.yaml").write_text(SPEC.format(block=f"f: acos(3) + exp(q), type: {type_}", observer=L2))
    outcome = run("check", tmp_path / "s.yaml")
    assert outcome.exit_code == 2
    assert "has no value anywhere" in outcome.stderr
