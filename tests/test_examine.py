"""What `check` finds: arbitrary accuracy, stiff nonlinearities, ranks, against worked examples and invariants."""

import math

import pytest
from support.shipped import shipped

from obsdesign.reading import loads
from obsdesign.work import check

EXAMPLES = {  # plants of which arbitrary accuracy was proved, or refuted, by hand
    "N1": "{A: [[0, 1], [0, -1]], B: [0, 1], C: [[1, 0], [0, 1]], D: [0, 0.5]}|integrator",
    "N2b": "{A: [[-1, 1], [0, -1]], B: [1, 0], C: [1, 0], D: 1}|integrator",
    "N3": "{A: [[0, 1], [-2, -3]], B: [0, 1], C: [[1, 0], [1, 1]]}|unknown",
    "N4": "{A: [[1, 1], [-2, -3]], B: [0, 1], C: [1, 0], D: 0.2}|integrator",
    "N5": "{A: [[1, 1], [-2, -3]], B: [0, 1], C: [1, 0], D: -0.2}|integrator",
}
CUBIC = """
obsdesign: 1
system: {A: [[0, -1, 0], [0, -1, -1], [0, 1, -1]], B: [1, 0, 0], C: [1, 0, 0]}
nonlinearities:
  - {type: cubic, Bf: [0, 1, 0], Cq: [1, -1, 0]}
"""


def example(name):
    system, _, disturbance = EXAMPLES[name].partition("|")
    text = f"obsdesign: 1\nsystem: {system}\ndisturbance: {disturbance}\nobserver: {{type: l2, L2: 0, alpha: 0.1}}\n"
    return loads(text)


def findings(spec):
    return {finding.name: finding.written() for finding in check(spec)}


@pytest.mark.parametrize("name", EXAMPLES)
def test_arbitrary_accuracy_is_possible_for_all_worked_examples_but_that_with_an_unstable_zero(name):
    found = findings(example(name))
    assert found["any accuracy"]["holds"] is (name != "N5")
    assert found["any accuracy: rank C B"]["holds"]
    assert not any(f["decides"] for key, f in found.items() if key.startswith("any accuracy"))


def test_the_unstable_zero_of_the_last_example_is_named():
    zeros = findings(example("N5"))["any accuracy: zeros"]
    assert zeros["zeros"] == [[pytest.approx(math.sqrt(7) - 1), 0]]
    assert "right half plane at lambda = 1.64575" in zeros["sentence"]


def test_theorem_2_does_not_cover_the_magnetic_bearing():
    found = findings(shipped("corless2019-magnetic-bearing"))
    rank = found["any accuracy: rank C B"]
    assert (rank["rank"], rank["needed"], rank["holds"]) == (1, 2, False)
    assert rank["sentence"].startswith("D Cm Bm has rank 1 and must have 2")
    assert found["any accuracy: zeros"]["holds"]
    assert found["rank B"]["rank"] == 2


def test_without_a_disturbance_model_the_classical_rank_of_c_b_counts():
    chain = (
        "obsdesign: 1\nsystem: {{A: [[0, 1], [0, 0]], B: [0, 1], C: {}}}\nobserver: {{type: l2, L2: 0, alpha: 0.1}}\n"
    )
    position, speed = (findings(loads(chain.format(C))) for C in ("[1, 0]", "[[1, 0], [0, 1]]"))
    assert position["any accuracy: rank C B"]["sentence"].startswith("C B has rank 0 and must have 1")
    assert speed["any accuracy"]["holds"]


def test_outputs_that_show_v_at_once_do_not_count_as_outputs_that_show_it_later():
    # y = x + v: P B + Y D = C'F' with F D = 0 gives F = 0, and Y = -P B solves it
    text = "obsdesign: 1\nsystem: {A: -1, B: 1, C: 1, D: 1}\nobserver: {type: l2, L2: 0, alpha: 0.1}\n"
    rank = findings(loads(text))["any accuracy: rank C B"]
    assert (rank["rank"], rank["needed"]) == (0, 0)


def test_a_disturbance_of_the_argument_of_f_must_be_cancelled_by_l2():
    text = """
obsdesign: 1
system: {A: -1, B: 1, C: [[1], [1]], D: [0, 1]}
nonlinearities:
  - {type: monotone, Bf: -1, Cq: 1, Dq: 0.5}
observer: {type: l2, L2: %s, alpha: 0.1}
"""
    for gain, holds in (("[[0, -0.5]]", True), ("0", False), ("free", True)):
        assert findings(loads(text % gain))["any accuracy: Dq + L2 D = 0"]["holds"] is holds


@pytest.mark.parametrize(
    ("request_", "condition"),
    [
        ("L2: 0, alpha: 0.5", "passivity"),
        ("L2: -2, alpha: 1.5", "zero dynamics"),
        ("L2: free, alpha: 1.5", "zero dynamics"),
        ("L2: -1, alpha: 0.9", None),
        ("L2: -1, alpha: {min: 0.1, max: 3}", None),
    ],
)
def test_what_a_slope_without_a_bound_rules_out_decides(request_, condition):
    found = check(loads(f"{CUBIC}observer: {{type: linf, {request_}}}\n"))
    deciding = [finding.name for finding in found if not finding.stands]
    assert deciding == [condition] * (condition is not None)


def test_a_reconstruction_needs_every_column_of_b():
    system = "{A: [[-1, 0], [0, -1]], B: [[1, 1], [1, 1]], C: [1, 0]}"
    text = f"obsdesign: 1\nsystem: {system}\nobserver: {{type: linf, L2: 0, alpha: 0.1}}\n"
    rank = findings(loads(text))["rank B"]
    assert (rank["rank"], rank["holds"], rank["decides"]) == (1, False, False)
