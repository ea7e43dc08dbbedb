"""Bounds on what a design may use: an answer that says what would do, and files that keep them, in every family."""

import json
import re
from pathlib import Path

import pytest
from support.commands import run

pytestmark = pytest.mark.usefixtures("here")

PENDULUM = """
obsdesign: 1
system: {A: [[0, 1], [0, -0.5]], B: [[0, 0], [1, 0]], C: [1, 0], D: [[0, 0.01]]}
nonlinearities: [{type: sin, Bf: [0, -9.81], Cq: [1, 0]}]
disturbance: [integrator, unknown]
performance: [w1]
observer: %s
"""
PLAIN = """
obsdesign: 1
system: {A: [[0, 1], [-1, -1]], B: [0, 1], C: [1, 0]}
nonlinearities: [{type: {lipschitz: 0.3}, Bf: [0, 1], Cq: [1, 0]}]
observer: %s
"""
NOISY = PLAIN.replace("B: [0, 1], C: [1, 0]", "B: [[0, 0], [1, 0]], C: [1, 0], D: [[0, 0.1]]")
FREE = """
obsdesign: 1
system: {A: [[0, 1], [-1, -1]], B: [0, 1], C: [1, 0]}
observer: %s
"""
TANKS = """
obsdesign: 1
parameters: {k: 0.01}
system:
  A: [[-k, 0, 0, 0], [k, -k, 0, 0], [0, k, -k, 0], [0, 0, k, -k]]
  B: [[1, 0], [0, 0], [0, 0], [0, 0]]
  C: [0, 0, 0, 1]
  D: [[0, 0.1]]
observer: {type: linf, alpha: %s, bounds: {L1: 0.05}}
"""
JARGON = re.compile(r"Primal|Dual|Almost|Solved|Insufficient|NumericalError|MaxIter|[Cc]larabel")


def solved(text, name="spec"):
    """Exit code, what was said, and the result if there is one."""
    Path(f"{name}.yaml").write_text(text)
    outcome, made = run("solve", f"{name}.yaml"), Path(f"{name}.gains.json")
    said = outcome.stdout + outcome.stderr
    assert not JARGON.search(said)
    return outcome.exit_code, said, json.loads(made.read_text()) if made.exists() else None


def forged(content, spec=None):
    """Verdict of `verify` on a changed file."""
    Path("forged.gains.json").write_text(json.dumps(content))
    return run("verify", "forged.gains.json", *([spec] if spec else []))


@pytest.mark.parametrize(
    ("observer", "bound"),
    [
        (f"{{type: {family}, L2: {L2}, alpha: {alpha}, bounds: {{L1: %s}}}}", bound)
        for family in ("l2", "linf")
        for L2, alpha, bound in ((0, 0.5, "1"), (0, 50, "1000"), ("free", 0.5, "1"), (0, 0.5, "{frobenius: 1}"))
    ],
)
def test_bounds_that_are_too_tight_are_proved_to_be_and_what_would_do_does(observer, bound):
    code, said, result = solved(PENDULUM % (observer % bound))
    found = result["diagnosis"]
    assert (code, found["condition"], found["proof"]) == (3, "bounds", "exact")
    assert "no solution within the bounds: |L1| <= " in said
    assert "needs |L1| above" in said
    proof = run("verify", "spec.gains.json")
    assert proof.exit_code == 0
    assert "no solution within the bounds" in proof.stdout
    enough = bound.replace(bound.strip("{}").split()[-1], repr(found["feasible"]["L1"]))
    code, _, wider = solved(PENDULUM % (observer % enough), "wider")
    assert (code, wider["status"]) == (0, "certified")
    if "alpha" in found["feasible"]:
        slower = re.sub(r"alpha: [0-9.]+", f"alpha: {found['feasible']['alpha']}", observer % bound)
        assert solved(PENDULUM % slower, "slower")[0] == 0


def test_a_bound_that_is_too_tight_for_every_alpha_of_a_range_is_told_so():
    code, said, _ = solved(PENDULUM % "{type: l2, bounds: {L1: 1}}")
    assert code == 3
    assert "at the slope -1 of f1, which the types allow, alpha = 0.001 needs |L1| above" in said


def test_a_bound_between_what_is_needed_and_what_was_found_is_undecided_with_the_size_that_does():
    code, said, result = solved(PENDULUM % "{type: l2, alpha: 0.5, bounds: {L1: 20}}")
    assert (code, result) == (4, None)
    size = float(re.search(r"allow \|L1\| up to (\S+),", said)[1])
    assert solved(PENDULUM % f"{{type: l2, alpha: 0.5, bounds: {{L1: {size}}}}}")[0] == 0


@pytest.mark.parametrize(
    "observer",
    [
        "{type: lipschitz, objective: min-gamma, decay: 2, bounds: {L: %s}}",
        "{type: lipschitz, objective: max-lipschitz, decay: 2, bounds: {L: %s}}",
        "{type: lipschitz, objective: pareto, weight: 0.5, decay: 2, bounds: {L: %s}}",
        "{type: lipschitz, objective: pareto, weight: {min: 0, max: 1, points: 3}, decay: 2, bounds: {L: %s}}",
        "{type: sporadic, T1: 0.05, T2: 0.1, decay: 2, relaxation: proposition-2, bounds: {L: %s}}",
        "{type: sporadic, T1: 0.05, T2: 0.1, decay: 2, injection: predictor, relaxation: proposition-2,"
        " bounds: {L: %s}}",
    ],
)
def test_the_other_families_prove_it_as_well_and_name_a_size_that_does(observer):
    code, said, result = solved(PLAIN % (observer % 0.5))
    found = result["diagnosis"]
    assert (code, found["condition"], found["proof"]) == (3, "bounds", "exact")
    assert "|L| <= 0.5 was asked for, and" in said
    assert run("verify", "spec.gains.json").exit_code == 0
    assert solved(PLAIN % (observer % found["feasible"]["L"]), "wider")[0] == 0
    if "decay" in found["feasible"]:
        slower = (observer % 0.5).replace("decay: 2", f"decay: {found['feasible']['decay']}")
        assert solved(PLAIN % slower, "slower")[0] == 0


DRAG = """
obsdesign: 1
system: {A: [[0, 1], [0, -0.5]], B: [[0], [1]], C: [[1, 0]]}
nonlinearities: [{type: {lipschitz: 0.8}, Bf: [0, 1], Cq: [0, 1]}]
observer: {type: lipschitz, objective: min-gamma, decay: %s, bounds: {L: %s%s}}
"""


def test_a_smaller_decay_is_suggested_only_where_it_does():
    code, said, result = solved(DRAG % (0.3, 0.4, ""))
    assert (code, list(result["diagnosis"]["feasible"])) == (3, ["L"])
    assert "decay at most" not in said
    assert "smaller decay" not in said
    assert solved(DRAG % (0, 0.4, ""), "slowest")[0] != 0


def test_a_gain_that_is_suggested_beside_a_bound_on_gamma_reaches_it():
    code, _, result = solved(DRAG % (0.3, 0.4, ", gamma: 0.5"))
    size = result["diagnosis"]["feasible"]["L"]
    assert (code, size > solved(DRAG % (0.3, 0.4, ""))[2]["diagnosis"]["feasible"]["L"]) == (3, True)
    assert solved(DRAG % (0.3, size, ", gamma: 0.5"), "followed")[0] == 0


SWING = """
obsdesign: 1
system: {A: [[0, 1], [-1, -0.1]], B: [[0], [1]], C: %s}
nonlinearities: [{%stype: {lipschitz: 9.81}, Bf: [0, 1], Cq: [1, 0]}]
observer: {type: lipschitz, objective: min-gamma%s}
"""


def test_a_constant_that_f_refutes_is_not_suggested_but_the_state_to_measure():
    code, said, _ = solved(SWING % ("[[0, 1]]", "f: 9.81*sin(q), ", ""))
    assert code == 3
    assert "look at x1 as another measurement, with which every constant will do" in said
    assert "at a constant" not in said
    assert "look at a constant below 1, or look at x1 as" in solved(SWING % ("[[0, 1]]", "", ""))[1]
    assert solved(SWING % ("[[0, 1], [1, 0]]", "", ", bounds: {L: 100}"), "measured")[0] == 0


def test_a_proof_of_a_bound_is_held_against_the_spec():
    _, _, result = solved(PENDULUM % "{type: l2, alpha: 0.5, bounds: {L1: 1}}")
    certificate = result["diagnosis"]["certificate"]
    for change, code in (
        ({"size": "100"}, 4),
        ({"size": "1/2"}, 2),
        ({"at": "-1"}, 4),
        ({"at": "0"}, 4),
        ({"members": {"f1": [["-2"]]}}, 4),
        ({"members": {}}, 2),
        ({"kind": ["injection"]}, 2),
    ):
        result["diagnosis"]["certificate"] = {**certificate, **change}
        assert forged(result).exit_code == code, change


def test_a_gamma_that_the_bounds_do_not_reach_is_told_with_the_size_that_does():
    text = "{type: l2, alpha: 0.5, objective: {gamma: 0.5}, bounds: {L1: %s}}"
    code, said, result = solved(PENDULUM % (text % 100))
    assert (code, result, "for gamma = 0.5" in said) == (4, None, True)
    size, level = (re.search(words, said)[1] for words in (r"allow \|L1\| up to (\S+),", r"gamma at least (\S+),"))
    assert solved(PENDULUM % (text % size), "wider")[0] == 0
    reached = text.replace("0.5}", f"{level}}}") % 100
    assert solved(PENDULUM % reached, "reached")[0] == 0


ATTACKED = """
obsdesign: 1
system: {A: [[2, 2], [1, 1]], B: [-1, 0], C: [[2, 0], [2, 2]], D: [1, 1]}
nonlinearities: [{type: {lipschitz: 0.5}, Bf: [0, 1], Cq: [1, 0]}]
performance: x
observer: %s
"""
MATRICES = "[[61.6344, -60.6344], [7.09863, -7.09863]]"


@pytest.mark.parametrize(
    "asked",
    [
        "{type: l2, alpha: 0.1, L2: 0, objective: {gamma: %s}, bounds: {L1: %s}}",
        "{type: l2, alpha: {min: 0.1, max: 2}, L2: 0, objective: max-alpha, bounds: {gamma: %s, L1: %s}}",
        "{type: linf, alpha: 0.1, L2: 0, objective: {gamma: %s}, bounds: {L1: %s}}",
        "{type: lipschitz, decay: 0.1, objective: min-gamma, bounds: {gamma: %s, L: %s}}",
    ],
)
def test_a_gamma_within_a_bound_that_some_gain_keeps_is_never_said_to_be_infeasible(asked):
    """It was, by the least gamma of a condition that is more than the bound."""
    code, said, result = solved(ATTACKED % (asked % (0.0027, 88)))
    assert (code, result) == (4, None)
    assert "was found" in said
    code, _, result = solved(ATTACKED % (asked % (0.0027, 0.5)), "impossible")  # A - L C grows for every such L
    assert (code, result["diagnosis"]["proof"]) == (3, "exact")


def test_the_gain_that_a_bound_and_a_gamma_leave_is_proved_where_it_is_given():
    text = f"{{type: l2, alpha: 0.1, L2: 0, objective: {{gamma: 0.0027}}, gains: {{L1: {MATRICES}, L2: [[0, 0]]}}}}"
    code, _, result = solved(ATTACKED % text)
    assert code == 0
    assert result["guarantee"]["gamma"] <= 0.0027
    assert run("verify", "spec.gains.json", "-q").exit_code == 0


def test_a_gamma_that_a_bound_on_the_storage_function_excludes_is_infeasible():
    """There the bound itself is convex: the least gamma is that of all gains."""
    _, _, result = solved(NOISY % "{type: l2, L2: 0, alpha: 0.1, bounds: {P: 1}}")
    level = 0.8 * result["guarantee"]["limit_bounded"]["gamma"]
    assert level > result["guarantee"]["limit"]["gamma"]
    asked = f"{{type: l2, L2: 0, alpha: 0.1, objective: {{gamma: {level}}}, bounds: {{P: 1}}}}"
    code, said, result = solved(NOISY % asked)
    assert (code, result["diagnosis"]["condition"], result["diagnosis"]["proof"]) == (3, "bounds", "numerical")
    assert "no solution within the bounds: no gain with P <= 1 I was found" in said


def test_of_a_bound_on_sporadic_gains_the_inequality_alone_is_said_to_have_no_solution():
    """L = 0.9 with H = 20 does make the error decay at the rate, which no Theorem 2 with so small an L proves."""
    plant = "obsdesign: 1\nsystem: {A: [[1]], B: [1], C: [1]}\nperformance: x\n"
    asked = "observer: {type: sporadic, T1: 0.1, T2: 0.1, decay: 0.1, bounds: {L: 0.9}, relaxation: proposition-2}\n"
    code, said, result = solved(plant + asked)
    proof = run("verify", "spec.gains.json")
    assert (code, result["diagnosis"]["proof"], proof.exit_code) == (3, "exact", 0)
    for words in (said, proof.stdout, result["diagnosis"]["reason"]):
        assert "the inequality of Theorem 2 has no solution with |L| at most 1.099 for decay = 0.1" in words
        assert "needs |L| above" not in words
    assert "at a member of the class Theorem 2 needs a larger gain" in proof.stdout


@pytest.mark.parametrize(
    ("objective", "code"),
    [
        ("T2: 0.1, objective: min-gamma, bounds: {L: 1.0995}", 4),
        ("T2: 0.1, objective: min-gamma, bounds: {L: 30, gamma: 0.17}", 4),
        ("T2: 0.1, objective: min-gamma, bounds: {L: 30, gamma: 0.16}", 3),
        ("T2: {min: 0.1, max: 0.2}, objective: max-T2, bounds: {L: 30, gamma: 0.17}", 4),
        ("T2: {min: 0.1, max: 0.2, points: 2}, objective: pareto, bounds: {L: 30, gamma: 0.17}", 4),
    ],
)
def test_a_bound_that_sporadic_gains_were_not_found_within_is_undecided(objective, code):
    plant = "obsdesign: 1\nsystem: {A: [[1]], B: [1], C: [1]}\nperformance: x\n"
    section = f"{{type: sporadic, T1: 0.1, decay: 0.1, relaxation: proposition-2, {objective}}}"
    found, said, result = solved(f"{plant}observer: {section}\n")
    assert found == code, said
    assert (result is None) == (code == 4)
    assert code == 3 or "was found" in said or "was reached" in said


DAMPED = """
obsdesign: 1
system: {A: [[0, 1], [0, -2]], B: [[0, 0], [1, 0]], C: [[1, 0]], D: [[0, %s]]}
nonlinearities: [{type: %s, Bf: [0, -1], Cq: [0, 1]}]
observer: {type: linf, alpha: %s, %s}
"""


def test_where_neither_the_level_nor_the_bounds_do_both_that_do_are_told():
    asked = "objective: {gamma: %s}, bounds: {L1: %s}"
    code, said, result = solved(DAMPED % (0.01, "{slope: [0, 1]}", 3, asked % (0.05, 0.5)))
    found = result["diagnosis"]["feasible"]
    assert (code, list(found)) == (3, ["together"])
    assert "allow |L1| up to " in said
    enough = asked % (found["together"]["gamma"], found["together"]["L1"])
    assert solved(DAMPED % (0.01, "{slope: [0, 1]}", 3, enough), "followed")[0] == 0


def test_a_level_out_of_reach_within_bounds_is_answered_with_one_that_they_allow():
    asked = "objective: {gamma: %s}, bounds: {L1: 10}"
    code, said, _ = solved(DAMPED % (0.01, "{slope: [0, 1]}", 3, asked % 0.05))
    assert code == 3
    level = float(re.search(r"within the bounds gamma (\S+) is the least that was found", said)[1]) * (1 + 1e-3)
    assert solved(DAMPED % (0.01, "{slope: [0, 1]}", 3, asked % level), "followed")[0] == 0


def test_what_would_do_where_noise_forbids_the_injection_of_a_steep_f_does():
    bounds = "bounds: {L1: 60}"
    code, said, result = solved(DAMPED % (0.01, "monotone", 3, bounds))
    assert code == 3
    assert "L2 <= 2 - alpha; here (Cq + L2 C)(A + alpha I) Bf is -1" in said
    slower = float(re.search(r"ask for alpha at most ([0-9.]+),", said)[1])
    assert slower == pytest.approx(2, rel=2e-3)
    assert "leave noise out of y (D = 0) with `L2: free`, with which" in said
    steepest = result["diagnosis"]["feasible"]["slope"][1] * (1 - 1e-3)
    for changed in (
        (0.01, "monotone", slower, bounds),
        (0, "monotone", 3, f"L2: free, {bounds}"),
        (0.01, f"{{slope: [0, {steepest}]}}", 3, bounds),
    ):
        assert solved(DAMPED % changed, "followed")[0] == 0, changed


def test_a_curve_within_bounds_is_that_of_single_rates():
    """What was said to be infeasible there is undecided, as it is at one alpha."""
    code, _, result = solved(TANKS % "{min: 1.0e-3, max: 0.3, points: 5, log: true}")
    assert code == 0
    points = result["search"]["points"]
    for point in points[:2]:
        _, _, single = solved(TANKS % repr(point["alpha"]), "single")
        assert single["guarantee"]["limit_bounded"]["gamma"] == pytest.approx(point["gamma"], rel=1e-3)
    assert points[-1]["status"] != "optimal"
    _, _, single = solved(TANKS % repr(points[-1]["alpha"]), "last")
    assert points[-1]["status"] == "undecided" or single["status"] == "infeasible"


@pytest.mark.parametrize("family", ["l2", "linf"])
@pytest.mark.parametrize(
    "plant",
    [
        "{A: [[-1]], B: [[-0.3]], C: [[-1], [-1.2]], D: [[0.1], [0]]}",
        "{A: [[-1]], B: [[0.3, -0.2]], C: [[0.9], [-0.3]], D: [[0, -0.2], [0.1, 0]]}",
        "{A: [[-2.5, 0.4], [-0.2, -1]], B: [[0.5], [1]], C: [[-0.4, 1.3]], D: [[0.1]]}",
    ],
)
@pytest.mark.parametrize("bound", ["20", "{frobenius: 30}"])
def test_a_finite_gain_that_keeps_v_out_is_found_within_bounds(family, plant, bound):
    text = f"obsdesign: 1\nsystem: {plant}\nobserver: {{type: {family}, alpha: 0.05, bounds: {{L1: {bound}}}}}\n"
    code, _, result = solved(text)
    assert code == 0
    assert result["guarantee"]["limit"]["gamma"] == 0
    assert result["guarantee"]["gamma"] < 0.01
    assert run("verify", "spec.gains.json", "-q").exit_code == 0


def test_a_bound_below_the_gain_that_keeps_v_out_still_gives_the_best_within_it():
    plant = (
        "{A: [[-2.53, 0.38], [-0.16, -0.96]], B: [[-0.2], [0.7]], C: [[-0.4, 1.3], [-1.4, 0.2]], D: [[-0.1], [-0.1]]}"
    )
    f = "nonlinearities: [{type: tanh, Bf: [-1, 0], Cq: [-1, -1]}]"
    code, _, result = solved(
        f"obsdesign: 1\nsystem: {plant}\n{f}\nobserver: {{type: l2, alpha: 0.5, bounds: {{L1: 8}}}}\n"
    )
    guarantee = result["guarantee"]
    assert (code, guarantee["limit"]["gamma"]) == (0, 0)
    assert guarantee["gamma"] <= 1.05 * guarantee["limit_bounded"]["gamma"]


def test_a_certificate_for_a_gamma_is_refused_in_words_where_the_spec_asks_for_none():
    asked = "{type: l2, alpha: 0.5, L2: 0%s}"
    _, _, plain = solved(PENDULUM % (asked % ""))
    _, _, refuted = solved(PENDULUM % (asked % ", objective: {gamma: 0.01}"))
    outcome = forged({**refuted, "spec": plain["spec"]})
    assert outcome.exit_code == 2
    assert "the spec asks for no gamma" in outcome.stderr


def test_the_least_storage_function_and_the_gain_of_a_predictor_are_held_against_the_spec():
    floor = "{type: lipschitz, objective: min-gamma, decay: 0.1, bounds: {P: {min: %s}}}"
    code, _, small = solved(NOISY % (floor % 0.01))
    assert code == 0
    assert run("verify", "spec.gains.json", "-q").exit_code == 0
    code, _, large = solved(NOISY % (floor % 0.1), "large")
    assert code == 0
    outcome = forged({**small, "spec": large["spec"], "name": large["name"]})
    assert outcome.exit_code == 4
    assert "FAILS  P >= t I" in outcome.stdout
    sampled = "{type: sporadic, T1: 0.1, T2: 0.2, decay: 0.6, injection: %s, relaxation: proposition-2}"
    _, _, predictor = solved(FREE % (sampled % "predictor"), "predictor")
    assert run("verify", "predictor.gains.json", "-q").exit_code == 0
    _, _, dynamic = solved(FREE % (sampled % "dynamic"), "dynamic")
    outcome = forged({**dynamic, "spec": predictor["spec"], "name": predictor["name"]})
    assert outcome.exit_code == 2
    assert "observer.H: not that of predictor" in outcome.stderr


def test_another_slope_is_suggested_with_the_bound_that_it_keeps_and_is_certified():
    plant = "{A: [[-1, 0], [0, -2]], B: [1, 0], C: [1, 0]}"
    f = "nonlinearities: [{type: {lipschitz: %s}, Bf: [0, 1], Cq: [0, 1]}]"
    observer = "observer: {type: l2, L2: 0, alpha: 0.5, bounds: {L1: 20}}"
    text = f"obsdesign: 1\nsystem: {plant}\n{f}\n{observer}\n"
    code, said, _ = solved(text % 5)
    assert code == 3
    told = re.search(
        r"would be feasible at this alpha with lipschitz (1\.49\d*) within the bounds \(\|L1\| <= 20\)", said
    )
    assert told
    assert solved(text % told[1])[0] == 0
