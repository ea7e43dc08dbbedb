"""Sizes at the edge of what there is, and zeros where numbers stand as a rule: every family answers them."""

from contextlib import suppress
from itertools import product

import numpy as np
import pytest

import obsdesign as od

REQUESTS = [
    {"type": "l2", "alpha": 0.1, "L2": 0, "objective": "feasibility"},
    {"type": "linf", "alpha": {"min": 0.05, "max": 0.4, "points": 3}, "L2": 0, "objective": "feasibility"},
    {"type": "linf", "alpha": {"min": 0.05, "max": 0.4, "points": 3}, "L2": 0, "objective": "max-alpha"},
    {"type": "lipschitz", "objective": "max-lipschitz", "decay": 0.05, "bounds": {"L": 20}},
    {"type": "sporadic", "T1": 0.05, "T2": 0.1, "decay": 0.05, "delta": 3, "objective": "feasibility"},
]
FULL = {"A": np.array([[0, 1], [-1, -0.5]]), "B": np.array([[0.5], [1]]), "Bf": np.array([[0.5], [1]])}


def plants():
    """One or two states, one or all of them measured, with and without w, D and f, and with f that does nothing."""
    sizes = ((1, True), (2, False), (2, True))  # states, whether all are measured
    for (n, all_measured), disturbance, block in product(sizes, ("none", "w", "w and D"), range(4)):
        C = np.eye(n) if all_measured else np.eye(1, n)
        system = {"A": FULL["A"][-n:, -n:], "C": C}
        if disturbance != "none":
            system["B"] = FULL["B"][:n]
        if disturbance == "w and D":
            system["D"] = np.full((len(C), 1), 0.1)
        sides = {"Bf": (block != 1) * FULL["Bf"][:n], "Cq": (block != 2) * np.eye(1, n)}
        blocks = [{"type": {"lipschitz": 0.2}, "f": "0.2*sin(q)", **sides}] if block else []
        yield system, blocks


@pytest.mark.parametrize("observer", REQUESTS, ids=lambda request: f"{request['type']} {request['objective']}")
def test_every_size_is_certified(observer):
    for turn, (system, blocks) in enumerate(plants()):
        if (turn + turn // 4 + REQUESTS.index(observer)) % 2:
            continue  # half of them for each request, the others for the next
        if observer["type"] == "sporadic" and "D" in system:
            continue  # noise acts at the samples there
        if observer["type"] == "lipschitz" and (not blocks or not all(blocks[0][side].any() for side in ("Bf", "Cq"))):
            continue  # no constant is the largest
        design = od.solve(od.Spec(system=system, nonlinearities=blocks, observer=observer))
        assert design.status == "certified", (system, blocks)
        assert design.verify().holds


@pytest.mark.parametrize("family", ["l2", "linf"])
def test_a_strong_coupling_is_not_called_infeasible(family):
    system = {"A": [[-1, 1e8], [0, -2]], "B": [[0], [1]], "C": [[0, 1]], "D": [[1]]}
    observer = {"type": family, "alpha": 0.1, "objective": "feasibility"}
    assert od.solve(od.Spec(system=system, observer=observer)).status == "certified"


DIRECT = ({"A": [[-0.5, 1.7], [-0.4, -1.7]], "B": [[-0.6], [0.4]], "C": [[1.2, -0.1]]}, [[-0.5, -0.8]])
TINY = ({"A": [[-1.5, -0.2], [0.2, -1.2]], "B": [[0.8], [1]], "C": [[-0.6, 0.1]], "D": [[1e-7]]}, [[-0.1, -1]])


@pytest.mark.parametrize("plant", [DIRECT, TINY])
def test_a_limit_of_zero_that_no_finite_gain_has_is_not_called_attained(plant):
    """Without D, H B is not zero, nor is H (s I - A - L1 C)^-1 B; else B + L1 D = 0 makes A + L1 C unstable."""
    system, H = plant
    blocks = [{"type": {"lipschitz": 0.1}, "Bf": [[0.3], [0.2]], "Cq": [[0.5, 1]]}]
    observer = {"type": "l2", "alpha": 0.1}
    design = od.solve(od.Spec(system=system, nonlinearities=blocks, performance={"H": H}, observer=observer))
    assert design.status == "certified"
    assert not design.limit["attained"]


@pytest.mark.parametrize("power", [0, 9, 12, 15, 18])
def test_a_gain_that_cancels_the_disturbance_attains_the_limit_of_zero(power):
    """L1 D = -B, in every unit of w."""
    system = {"A": [[-1]], "B": [[10.0**power]], "C": [[1]], "D": [[0.1]]}
    design = od.solve(od.Spec(system=system, observer={"type": "l2", "alpha": 0.1, "L2": 0}))
    assert design.status == "certified"
    assert design.limit == {"gamma": 0.0, "attained": True}
    assert design.guarantee.gamma <= 1e-2 * 10.0**power


def test_a_limit_is_not_called_zero_where_w_acts_and_no_output_tells_of_it():
    """From w1 to e, with w2 = -C x / D and so y = 0, there is a gain that no L1 changes; by hand, in 60 digits, 269.6.

    Doubles hardly see it: w acts with 100, and y is told to 1e-4.
    """
    A, B = [[0, -2, -3], [-3, -2, -3], [-2, -1, 0]], [[0, 0], [100, 0], [-100, 0]]
    system = {"A": A, "B": B, "C": [[-2, 1, -2]], "D": [[0, 1e-4]]}
    design = od.solve(od.Spec(system=system, observer={"type": "l2", "alpha": 1}))
    assert design.status == "certified"
    assert design.limit["gamma"] == pytest.approx(269.608, rel=1e-5)
    design = od.solve(od.Spec(system=system, observer={"type": "l2", "alpha": 1, "bounds": {"L1": 1e5}}))
    assert design.status == "certified"
    assert 269.6 < design.limit_bounded["gamma"] < design.guarantee.gamma < 300


@pytest.mark.parametrize("kind", ["l2", "linf"])
def test_where_the_smallest_gain_is_not_proved_a_larger_one_on_the_way_to_it_is(kind):
    """A of rank 1 and no v: with P near singular a gain of nothing looks as if it moved the pole 0 to -0.6."""
    first, second = np.array([[1.3], [0.837]]), np.array([[-1.258, 0.967]])
    system = {"A": (first @ second).tolist(), "C": [[-0.85, 1.32], [0.3, -1.73]]}
    design = od.solve(od.Spec(system=system, observer={"type": kind, "L2": 0, "alpha": 0.6}))
    assert design.status == "certified"
    assert max(np.linalg.eigvals(system["A"] + np.array(design.gains["L1"]) @ system["C"]).real) < -0.6


@pytest.mark.parametrize("kind", ["l2", "linf"])
def test_a_plant_without_a_disturbance_has_gains_within_bounds(kind):
    system = {"A": [[-1, 0], [0, -2]], "C": [[1, 0]]}
    block = {"f": "tanh(q)", "type": "tanh", "Bf": [1, 0], "Cq": [0, 1]}
    section = {"type": kind, "L2": 0, "alpha": 0.5, "bounds": {"L1": 10}}
    design = od.solve(od.Spec(system=system, nonlinearities=[block], observer=section))
    assert design.status == "certified"
    assert design.verify().holds


ALMOST_EXACT = [
    {
        "A": [[0.579735, 2.58081e-06], [-0.18709, 0.312703]],
        "B": [[1.58436, 0, 0, 0], [-1.72463, 0, 0, 0]],
        "C": [[-1.93696, 0], [-0.394306, 0], [-0.44694, 0]],
        "D": [[0, 8.3e-4, 2.9e-4, 1e-4], [0, 1.2e-3, -1e-3, -1.2e-3], [0, 7.4e-4, -1.4e-3, -4.8e-4]],
    },
    {
        "A": [[-0.15, 0, -3.2], [3.3e5, -0.6, -2.8e6], [0.064, 0, -0.57]],
        "B": [[-0.003, 0.003, 0, 0], [-523, 791, 0, 0], [0, 6e-4, 0, 0]],
        "C": [[-472, 0, 956], [159, -6e-4, -1879]],
        "D": [[0, 0, 3.5e-7, 2.9e-8], [0, 0, 4e-8, 1.8e-7]],
    },
]


@pytest.mark.parametrize("system", ALMOST_EXACT)
@pytest.mark.parametrize("kind", ["l2", "linf"])
def test_a_linear_plant_without_a_slow_hidden_mode_is_never_called_infeasible(system, kind):
    """Units of states far apart, or a mode that is seen by a part in a million, and little noise."""
    spec = od.Spec(system=system, observer={"type": kind, "alpha": 0.2})
    with suppress(od.UndecidedError):  # as far as doubles tell
        assert od.solve(spec).status != "infeasible"
