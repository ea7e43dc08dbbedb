"""Random specs of every family: what is certified of them stands up to attacks, and what is said that there is not.

A guarantee is attacked by members of the declared classes, frozen, switching at random and switching against its own
storage function, with the inputs that are the worst for them. That the attacks can find what is false is shown by
guarantees that are changed.
"""

from collections import Counter
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
from support.attack import attack, solution
from support.commands import run
from support.contract import broken_rules, read
from support.random_specs import drawn
from support.sweep import SWEEP, rng

import obsdesign as od
from obsdesign.families import FAMILIES

CHANGES = {  # of a guarantee: its factor, and the least share of designs of each family of which it is found out
    "gamma": (0.5, {"l2": 0.5, "linf": 0.2, "lipschitz": 0.5, "sporadic": 0.2}),
    "alpha": (3, {"l2": 0.4, "linf": 0.3}),
    "decay": (3, {"lipschitz": 0.4, "sporadic": 0.1}),
    "lipschitz": (1.3, {"lipschitz": 0.3}),
}
SMALL = {"members": 3, "length": 30}  # of an attack
CODES = {"certified": 0, "infeasible": 3, "uncertified": 4}
QUICK = [("l2", 7), ("linf", 2), ("lipschitz", 3), ("sporadic", 0), ("sporadic", 3), ("l2", 2)]
QUICK.append(pytest.param("sporadic", 1, marks=pytest.mark.slow))
BROKEN_DOWN = """
obsdesign: 1
name: A solver breaks down, with a point near the largest double
system:
  A: [[1.26, -0.12, -2.12], [0.81, -1.77, -1.32], [0.75, 0.54, -1.78]]
  B: [[0], [0], [0]]
  C: [[-1.07, 0.4, -0.47]]
  D: [[-0.04]]
nonlinearities:
  - {type: {sector: {K1: 0.03, K2: -0.49}}, Bf: [-0.27, -0.57, -0.33], Cq: [1.31, -1.55, -0.08], Dqf: -0.03,
     Dq: -0.24, Df: 0.58}
disturbance: integrator
observer: {type: linf, alpha: {min: 0.22, max: 4.4, points: 4, log: true}, bounds: {L1: 13.22}, L2: free}
"""
UNREACHED = """
obsdesign: 1
name: No w reaches the plant
system: {A: -1.67, B: 0, C: [[0.33], [-1.29]]}
nonlinearities: [{type: {sector: {K1: 0.35, K2: -0.29}}, Bf: 0.02, Cq: -0.4}]
observer: {type: sporadic, T1: 0.2, T2: 0.52, decay: 0.27, bounds: {L: 40.13}, relaxation: proposition-2}
"""
pytestmark = pytest.mark.usefixtures("here")


def problem(family, seed, generator=rng):
    return drawn(generator([seed, *family.encode()]), family)


def answered(problem):
    """Result file of a spec, from its JSON, which keeps the rules of all files; the exit code of what has none."""
    try:
        design = od.solve(od.Spec(**problem.sections))
    except (od.UsageError, od.UndecidedError) as error:
        return error.exit_code
    design.save("random.gains.json")
    result = read(Path("random.gains.json").read_text())
    assert broken_rules(result, design.gains) == [], result["spec"]["text"]
    claimed = result["status"] == "certified" or "certificate" in result["diagnosis"]
    outcome = run("verify", "random.gains.json", "-q")
    assert (outcome.exit_code, outcome.stderr == "") == ((0, True) if claimed else (2, False)), outcome.output
    return result


def assert_true(result, problem, seed, generator=rng, **size):
    """Attack what a result file says."""
    if result["status"] == "certified":
        found = attack(result, problem, generator(seed), **size)
        assert [one for one in found if one.broken] == [], result["spec"]["text"]
    elif result["diagnosis"].get("proof") == "exact":
        best = solution(result, problem, generator(seed))
        assert best is None or best > -1e-6, result["spec"]["text"]


def changed(result, key):
    """A result file with another number in its guarantee."""
    false = deepcopy(result)
    false["guarantee"][key] *= CHANGES[key][0]
    return false


@pytest.mark.parametrize(("family", "seed"), QUICK)
def test_what_a_command_says_of_a_random_spec_stands_up_to_attacks(family, seed):
    fixed = np.random.default_rng
    made = problem(family, seed, fixed)
    result = answered(made)
    Path("random.yaml").write_text(result["spec"]["text"])
    outcome = run("solve", "random.yaml", "-q", "-o", "again.json")
    assert (outcome.exit_code, outcome.output) == (CODES[result["status"]], "")
    again = read(Path("again.json").read_text())
    for key in ("status", "observer", "guarantee", "certificate", "diagnosis"):
        assert again.get(key) == result.get(key)
    assert_true(result, made, seed, fixed, **SMALL)
    if result["status"] == "certified":
        assert any(one.broken for one in attack(changed(result, "gamma"), made, fixed(seed), **SMALL))


def test_a_solver_that_breaks_down_leaves_no_warning():
    Path("spec.yaml").write_text(BROKEN_DOWN)
    assert run("solve", "spec.yaml", "-q").exit_code == 3
    assert run("verify", "spec.gains.json", "-q").exit_code == 0


def test_no_limit_is_above_what_is_proved():
    Path("spec.yaml").write_text(UNREACHED)
    assert run("solve", "spec.yaml", "-q").exit_code == 0
    guarantee = read(Path("spec.gains.json").read_text())["guarantee"]
    assert guarantee["limit"]["gamma"] <= guarantee["limit_bounded"]["gamma"] <= guarantee["gamma"]


LONG = {"sporadic": pytest.mark.sweep}  # a minute by itself


@pytest.mark.slow
@pytest.mark.parametrize(
    "family",
    [pytest.param(name, marks=LONG.get(name, ())) for name, family in FAMILIES.items() if not family.equations],
)
def test_attacks_break_no_guarantee_of_random_specs_and_find_out_those_that_are_changed(family):
    outcomes, caught = Counter(), Counter()
    for seed in range(SWEEP.size(25)):
        made = problem(family, seed)
        result = answered(made)
        outcomes[result if isinstance(result, int) else CODES[result["status"]]] += 1
        if isinstance(result, int):
            continue
        assert_true(result, made, seed)
        for key in CHANGES.keys() & (result["guarantee"].keys() if result["status"] == "certified" else ()):
            caught[key] += any(one.broken for one in attack(changed(result, key), made, rng(seed), **SMALL))
    assert outcomes[0] >= 0.35 * outcomes.total(), outcomes
    assert outcomes[2] <= 0.1 * outcomes.total(), outcomes
    for key, (_, least) in CHANGES.items():
        assert caught[key] >= least.get(family, 0) * outcomes[0], (key, caught, outcomes)
