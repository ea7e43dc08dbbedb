"""Plants as equations that are wrong: each is answered in one line, at its place, in the names of the plant."""

import json
import re
from pathlib import Path

import pytest
from support.commands import run
from support.wrong_specs import problem_of, problems_of, wrong_in

BASE = """\
obsdesign: 1
parameters: {P: 3}
system:
  states: [a, b]
  inputs: [u]
  disturbances: [w]
  dynamics:
    a: b
    b: -a - sin(b) + u + w
  outputs:
    y: a + 0.1*w
  domain: {b: [-4, 4]}
  types: {sin(b): {slope: [-1, 1]}}
disturbance: integrator
performance: [a, w]
observer:
  type: l2
  alpha: 0.1
simulation:
  horizon: 5
  x0: {a: 1}
  u: {u: sin(t)}
  w: {w: "0.1"}
"""
wrong = wrong_in(BASE)
B, Y, STATES, DOMAIN = "    b: -a - sin(b) + u + w", "    y: a + 0.1*w", "  states: [a, b]", "  domain: {b: [-4, 4]}"
TYPES, OUTPUTS, X0, U, W = (
    "  types: {sin(b): {slope: [-1, 1]}}",
    "  outputs:\n    y: a + 0.1*w",
    "  x0: {a: 1}",
    "  u: {u: sin(t)}",
    '  w: {w: "0.1"}',
)
BOTH, DYNAMICS = (
    f"{DOMAIN}\n{TYPES}\n",
    f"  dynamics:\n    a: b\n{B}\n  outputs:\n    y: a + 0.1*w\n{DOMAIN}\n{TYPES}\n",
)


def instead(b, y="a + 0.1*w", further=""):
    """Other equations of b and y, with no domain or types but what is given further."""
    return f"  dynamics:\n    a: b\n    b: {b}\n  outputs:\n    y: {y}\n{further}"


CASES = [
    wrong(Y, "    y: a + c", "system.outputs.y", "unknown name 'c'; allowed: P, a, b, pi, t, u, w, y", place=(11, 12)),
    wrong(B, "    b: -a - sin(b) + u + w + d", "system.dynamics.b", "unknown name 'd'", "under system.disturbances"),
    wrong(B, "    b: -a - k*b", "system.dynamics.b", "unknown name 'k'", "a constant is declared under parameters"),
    wrong(B, "    c: -a", "system.dynamics.c", "unknown state c; allowed: a, b; b has no equation"),
    wrong(B, "", "system.dynamics", "b has no equation; give b: its derivative", place=(7, 3)),
    wrong(STATES, "  states: [a, b, a]", "system.states[2]", "a is a state already; choose another name"),
    wrong("    a: b\n", "    a: b\n    a: b\n", "system.dynamics.a", "duplicate key a"),
    wrong("[u]", "[a]", "system.inputs[0]", "a is a state already; choose another name"),
    wrong("[w]\n  dyn", "[b]\n  dyn", "system.disturbances[0]", "b is a state already; choose another name"),
    wrong("    y: a", "    a: a", "system.outputs.a", "a is a state already; choose another name"),
    wrong(Y, "    y: a + y", "system.outputs.y", "depends on itself: an algebraic loop; write it in states"),
    wrong(Y, "    y: a + z\n    z: b + y", "system.outputs.y", "depends on z, which depend on it: an algebraic loop"),
    wrong(DOMAIN, "  domain: {c: [0, 1], b: [-4, 4]}", "system.domain.c", "unknown signal c; allowed: a, b, u, w"),
    wrong(DOMAIN, "  domain: {b: [4, -4]}", "system.domain.b", "4 is not below -4; give [low, high]"),
    wrong(DOMAIN, "  domain: {b: 4}", "system.domain.b", "expected a list; found 4"),
    wrong(TYPES, "  types: {sin(a): monotone}", "system.types.sin(a)", "unknown term sin(a); did you mean sin(b)?"),
    wrong(TYPES, "  types: {f2: monotone}", "system.types.f2", "unknown term f2", "allowed: sin(b)"),
    wrong(TYPES, "  types: {sin(b): monoton}", "system.types.sin(b)", "did you mean monotone?"),
    wrong(
        TYPES,
        "  types: {sin(b): {slope: [0, 1]}}",
        "system.types.sin(b)",
        "the term sin(b): slope [0, 1] is refuted by b = ",
        "give a smaller system.domain",
    ),
    wrong(TYPES, "  types: {sin(b): {auto: {region: {q: [0, 1]}}}}", "system.types.sin(b)", "has no region here"),
    wrong(TYPES, "  types: {sin(b): {slope: [-1, 1], region: {q: [0, 1]}}}", "system.types.sin(b)", "no region here"),
    wrong(TYPES, "  types: {sin(b): cubic}", "system.types.sin(b)", "differs from its type cubic"),
    wrong(DYNAMICS, instead("a*w"), "system.dynamics.b", "the term a*w", "it cannot be split: w enters it"),
    wrong(DYNAMICS, instead("-b + w**2"), "system.dynamics.b", "w**2 is not linear in the disturbance"),
    wrong(DYNAMICS, instead("-a*w", "a"), "system.dynamics.b", "y*w is not linear in the disturbance"),
    wrong(
        DYNAMICS,
        instead("-P/b", further="  domain: {b: [-1, 1]}\n"),
        "system.dynamics.b",
        "the term 1/b: it may jump or be undefined at b near 0; give a smaller system.domain, without that",
    ),
    wrong(DYNAMICS, instead("-sqrt(b)"), "system.dynamics.b", "sqrt(b) has no value at b = ", "system.domain of b"),
    wrong(DYNAMICS, instead("-a*b"), "system.dynamics.b", "the term a*b", "give system.domain of a, b"),
    wrong(DYNAMICS, instead("-t*sin(b)"), "system.dynamics.b", "the term t*sin(b)", "give system.domain of b, t"),
    wrong(DYNAMICS, instead("-b**2"), "system.dynamics.b", "by b cannot be bounded below at any b; give system.domain"),
    wrong(DYNAMICS, instead("-sign(b)"), "system.dynamics.b", "term sign(b): it may jump or be undefined at b near 0"),
    wrong(DYNAMICS, instead("-a**2 - b", "a"), "system.dynamics.b", "the term a**2", "write y for a, then it is known"),
    wrong("  inputs", "  A: [[0, 1]]\n  inputs", "system.A", "A belongs to a plant in matrices"),
    wrong("  inputs", "  period: 0.1\n  inputs", "system.period", "goes with time: discrete"),
    wrong(OUTPUTS, "  outputs: [y]", "system.outputs", "expected a mapping; found a list"),
    wrong(OUTPUTS, "", "system.outputs", "is required"),
    wrong(OUTPUTS, "  outputs: {}", "system.outputs", "expected at least 1 entry"),
    wrong(
        OUTPUTS, "  outputs: {y: where(a > 0, 2*a, a) + w}", "system.outputs.2*a",
        "is a part of a text, cut at a comma: write the whole text in quotes",
    ),
    wrong(
        BASE[BASE.index(STATES) : BASE.index("disturbance: i")],
        "  dynamics: {a: -a, q: -q}\n  outputs: {y: a}\n",
        "system.dynamics.q",
        "q is kept for the argument of a nonlinearity, of a term of equations too; choose another name",
        place=(4, 21),
    ),
    wrong(
        "disturbance: integrator", "nonlinearities: [{type: monotone}]\ndisturbance: integrator", "nonlinearities",
        "are the terms of system.dynamics, which are found by themselves: leave this out",
    ),
    wrong("[a, w]", "[a, v]", "performance[1]", "unknown state v; allowed: a, b, w"),
    wrong(X0, "  x0: {c: 1}", "simulation.x0.c", "unknown state c; allowed: a, b, w"),
    wrong(U, "  u: {v: 1}", "simulation.u.v", "unknown input v; allowed: u"),
    wrong(W, "  w: {w: c}", "simulation.w.w", "unknown name 'c'"),
    wrong(W, f"{W}\n  events: {{stop: a}}", "simulation.events.stop", "a is no condition; write a comparison"),
    wrong(W, f"{W}\n  events: {{stop: c > 1}}", "simulation.events.stop", "unknown name 'c'"),
]  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_one_mistake_in_equations_gives_one_line_at_its_place(case):
    assert case.is_answered_by(problem_of(case.text.replace("\n\n", "\n")))


def test_types_of_terms_are_refused_where_the_equations_are_not_split():
    observer = "observer: {type: kkl, coordinates: [{phi: a, lambda: -1, B: 0}], left_inverse: {b: xi1}}\n"
    text = BASE[: BASE.index("disturbance: i")] + observer
    problems = [problem for problem in problems_of(text) if problem.key == "system.types"]
    assert "is for designs that split the equations into terms" in problems[0].message


PLANT = """obsdesign: 1
system:
  disturbances: [w1, n]
  dynamics: {x: v, v: -sin(x) - v + w1}
  outputs: {y: x}
observer: %s
"""
SPORADIC = "{type: sporadic, T1: 0.1, T2: 0.2, relaxation: proposition-2}"
NO_W = (("  disturbances: [w1, n]\n", ""), (" + w1", ""))
IN_THE_WORDS_OF_EQUATIONS = {  # observer, changes of the plant, key, what is said of it
    "noise of y at instants": (
        SPORADIC, [("y: x", "y: x + 0.1*n")], "system.outputs.y",
        "holds the disturbance n, which type sporadic does not take; a w of finite energy has no value at an instant: "
        "what disturbs a sample is simulation.noise",
    ),
    "a curved y at instants": (SPORADIC, [("y: x", "y: x + sin(v)")], "system.outputs.y", "the nonlinear term sin(v)"),
    "a term of w at instants": (
        SPORADIC, [("-sin(x)", "-sin(x + n)")], "system.dynamics.v",
        "holds the term sin(x + n), a function of the disturbance n, which type sporadic does not take",
    ),
    "a curved y": (
        "{type: lipschitz}", [("y: x", "y: x + sin(v)")], "system.outputs.y",
        "holds the nonlinear term sin(v), which type lipschitz does not take; type l2 with L2: 0 takes it",
    ),
    "a term of w": ("{type: lipschitz}", [("-sin(x)", "-sin(x + n)")], "system.dynamics.v", "the term sin(x + n), a"),
    "no term": ("{type: lipschitz}", [("-sin(x)", "-x")], "system.dynamics", "needs at least one nonlinear term"),
    "no disturbance": (
        "{type: lipschitz, objective: min-gamma}", NO_W, "observer.objective", "is none; give system.disturbances",
    ),
    "nothing to generate": (
        "{type: l2}\ndisturbance: integrator", NO_W, "disturbance", "no w to generate; give system.disturbances",
    ),
    "two disturbances in one": (
        "{type: linf, reconstruct: w, alpha: 1}", [("+ w1", "+ w1 + n")], "observer.reconstruct",
        "needs disturbances that act on the states independently; 1 of 2 do",
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    ("observer", "changes", "key", "said"), IN_THE_WORDS_OF_EQUATIONS.values(), ids=IN_THE_WORDS_OF_EQUATIONS
)
def test_what_a_type_does_not_take_is_told_in_the_words_of_the_equations(
    observer, changes, key, said, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    text = PLANT % observer
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    Path("plant.yaml").write_text(text)
    for command in ("solve", "check"):
        outcome = run(command, "plant.yaml")
        assert (outcome.exit_code, outcome.stderr.count("\n")) == (2, 1), outcome.stderr
        assert f" {key}: " in outcome.stderr
        assert said in outcome.stderr
        assert not re.search(r"system\.[ABCD]\b|\b(D|Df|Dq|Bf|Cq)\b|nonlinearities", outcome.stderr)


def test_a_plant_whose_terms_act_on_no_state_is_told_so():
    text = (PLANT % "{type: lipschitz}").replace("-sin(x)", "-x").replace("y: x", "y: x + sin(v)")
    first, other = problems_of(text)
    assert (first.key, other.key) == ("system.dynamics", "system.outputs.y")
    assert "no nonlinear term acts on a state; for a linear plant use type l2" in first.message


def test_a_note_on_the_type_of_a_term_names_the_term(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("plant.yaml").write_text(PLANT % "{type: lipschitz, bounds: {L: 10}}")
    outcome = run("solve", "plant.yaml", "--json")
    assert outcome.exit_code == 0, outcome.output
    notes = json.loads(outcome.stdout)["notes"]
    assert any(note.startswith("sin(x): ") and note.endswith("is read as lipschitz 1") for note in notes)
