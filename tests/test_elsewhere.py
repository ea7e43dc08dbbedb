"""A plant in awkward states has the verdict that it has in its own: what is feasible is never called infeasible."""

from dataclasses import replace

import numpy as np
import pytest
from test_every_family import SMALL

import obsdesign as od
from obsdesign.dissipation.engine import Engine
from obsdesign.elsewhere import NOTE, designed, inverse, plain, states, turned, unsized
from obsdesign.errors import UndecidedError
from obsdesign.families import FAMILIES
from obsdesign.families.outcome import Outcome, Verdict
from obsdesign.lmi.formula import printed

AWKWARD = printed(np.array([[4e5, 5e5], [8.0, 10.5]]))  # in which numbers of A of the size 2e6 all but cancel
LONG = {"sporadic"}  # whose designs take seconds: gains that are given do not
NAMES = [
    pytest.param(name, marks=pytest.mark.slow if name in LONG | {"linf", "unknown-input"} else ())
    for name, family in FAMILIES.items()
    if not family.equations
]
NUMERICAL = {"id": "OBS603", "condition": "inequality", "reason": "as a solver says", "proof": "numerical"}


def awkward(name, i=0, **changes):
    """Small spec of a family in awkward states, with its gains, if there are some."""
    return turned(od.Spec(name=name, **SMALL[name][i].sections(**changes)), AWKWARD)


@pytest.mark.parametrize("name", NAMES)
def test_what_is_feasible_is_never_called_infeasible_in_other_states(name):
    try:
        design = od.solve(awkward(name, int(name in LONG)))
    except UndecidedError:
        assert name == "unknown-input"  # whose E is another in other states
        return
    assert design.status == "certified"
    assert design.claim.holds


@pytest.mark.parametrize("name", NAMES)
def test_what_is_infeasible_stays_so_in_other_states(name):
    assert od.solve(awkward(name, **SMALL[name][0].hopeless)).status == "infeasible"


def refusing(spec, otherwise):
    """Design that believes a solver in the states of a spec, and in others does something else."""
    return lambda asked, engine: (
        otherwise(asked, engine) if asked is not spec else Outcome(Verdict.INFEASIBLE, diagnosis=NUMERICAL)
    )


def test_gains_that_are_found_in_other_states_are_proved_in_those_of_the_spec():
    spec = awkward("l2")
    made = designed(spec, Engine(), refusing(spec, FAMILIES["l2"].design))
    assert made.status is Verdict.CERTIFIED
    assert made.notes[-1] == NOTE
    assert made.claim.holds
    assert made.claim.certificate.family.plant is spec.posed
    given = replace(spec, observer=replace(spec.observer, gains={n: printed(K) for n, K in made.gains.items()}))
    assert od.solve(given).guarantee.gamma == pytest.approx(made.claim.guarantee(spec).gamma, rel=0.05)


def test_a_word_that_does_not_hold_in_other_states_is_no_verdict():
    spec = awkward("l2")

    def undecided(*_):
        raise UndecidedError("not decided", id="OBS507")

    with pytest.raises(UndecidedError, match="in these states, and does not say so in those in which A is diagonal"):
        designed(spec, Engine(), refusing(spec, undecided))
    agreed = designed(spec, Engine(), lambda *_: Outcome(Verdict.INFEASIBLE, diagnosis=NUMERICAL))
    assert agreed.diagnosis == NUMERICAL
    exact = Outcome(Verdict.INFEASIBLE, diagnosis={**NUMERICAL, "proof": "exact"})
    assert designed(spec, Engine(), lambda asked, _: exact if asked is spec else undecided()) is exact


def test_a_plant_whose_numbers_are_near_each_other_is_not_looked_at_elsewhere():
    spec = od.Spec(name="plain", **SMALL["l2"][0].sections())
    asked = []

    def infeasible(spec, _):
        asked.append(spec)
        return Outcome(Verdict.INFEASIBLE, diagnosis=NUMERICAL)

    assert designed(spec, Engine(), infeasible).diagnosis == NUMERICAL
    assert asked == [spec]
    stiff = od.Spec(
        system={"A": [[-50001, 49999], [49999, -50001]], "C": [[1, 0]]}, observer={"type": "l2", "alpha": 0.1}
    )
    assert plain(spec, states(spec))
    assert not plain(stiff, states(stiff))  # eigenvalues -2 and -1e5, eigenvectors that are orthogonal
    assert not plain(awkward("l2"), states(awkward("l2")))


def test_a_plant_in_other_states_is_the_same_plant():
    spec = od.Spec(name="same", **SMALL["l2"][0].sections())
    again = turned(turned(spec, AWKWARD), inverse(AWKWARD))
    assert all((getattr(again.plant, name) == getattr(spec.plant, name)).all() for name in ("A", "B", "Bf", "C", "Cq"))
    assert (again.H == spec.H).all()
    diagonal = od.Spec(system={"A": [[-1, 0], [0, -2]], "C": [[1, 1]]}, observer={"type": "l2", "alpha": 0.1})
    assert states(diagonal) is None


def test_sizes_of_gains_in_other_states_are_not_told():
    found = "the gain was found by descent from the central one of a Riccati equation"
    assert unsized(f"{found} (|L1| from 66.27 to 7.861): it is large") == f"{found}: it is large"
    assert unsized("f is not given (q, w)") == "f is not given (q, w)"
