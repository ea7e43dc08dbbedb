"""Every spec that is shipped: it solves, meets what it expects of itself, and the solvers agree on it."""

import numpy as np
import pytest
from flint import fmpq
from support.shipped import NAMES, on, shipped, solved

from obsdesign.dissipation.bounds import Bounds, Range
from obsdesign.dissipation.gain import searchable
from obsdesign.families.incremental.request import Request
from obsdesign.families.incremental.theorems import theorem
from obsdesign.families.lipschitz.request import LipschitzRequest
from obsdesign.families.sporadic.request import SporadicRequest
from obsdesign.lmi.solve import Status, minimise
from obsdesign.simulate import simulate

FEASIBLE = [name for name in NAMES if not name.startswith("infeasible/")]
REQUESTS = {name: shipped(name).observer for name in FEASIBLE}
INCREMENTAL, SPORADIC, LIPSCHITZ = (
    [name for name, request in REQUESTS.items() if isinstance(request, kind)]
    for kind in (Request, SporadicRequest, LipschitzRequest)
)
LARGE = {name for name in INCREMENTAL if shipped(name).posed.n >= 24}  # their inequalities take minutes to solve
CURVES = [name for name in SPORADIC if name.endswith("-tradeoff")]


def content_of(name):
    """The result of a spec; what is expected of a simulation is simulated."""
    spec, made = solved(name)
    content = dict(made.result)
    if any(key.startswith("simulation.") for key in spec.expect):
        content["simulation"] = simulate(made).summary
    return content


def proof_of(made):
    """What is proved in rationals: the claim itself, or the certificate in it."""
    return getattr(made.claim, "certificate", made.claim)


def at(content, path):
    """Value at a dotted path; the limits stand in the guarantee."""
    value = content if path.partition(".")[0] in content else content["guarantee"]
    for key in path.split("."):
        value = value[key]
    return value


def test_there_are_specs():
    assert len(FEASIBLE) >= 8
    assert len(NAMES) > len(FEASIBLE)


@pytest.mark.parametrize("name", on(*NAMES))
def test_a_spec_says_how_it_ends_and_ends_so(name):
    spec, made = solved(name)
    assert spec.expect["status"] == made.status
    without = "refuted" if spec.typed else "infeasible"
    assert made.status == ("certified" if name in FEASIBLE else without)
    assert bool(made.diagnosis) == (made.status != "certified")
    if made.status == "certified":
        proved = proof_of(made)
        assert proved.holds
        assert all(check.holds for check in proved.checks)


@pytest.mark.parametrize("name", on(*(name for name in NAMES if len(shipped(name).expect) > 1)))
def test_a_spec_gives_what_it_expects(name):
    spec, _ = solved(name)
    content = content_of(name)
    for path, expected in spec.expect.items():
        if isinstance(expected, dict):
            tolerance = {"rel": expected.get("rtol", 1e-3), "abs": expected.get("atol", 0.0)}
            assert at(content, path) == pytest.approx(expected["verified"], **tolerance), path
        else:
            assert at(content, path) == expected, path


@pytest.mark.parametrize("name", on(*SPORADIC))
def test_gains_for_sporadic_measurements_stay_within_their_bounds_and_their_slack(name):
    spec, made = solved(name)
    request, proof, limit = spec.observer, proof_of(made), made.limit_bounded or made.limit
    assert request.T1 <= proof.T1 <= proof.T2
    if request.objective == "min-gamma" and not request.gains:
        assert float(proof.gamma) <= limit["gamma"] * (1 + float(request.slack))
    for name, bound in (("L", request.largest_gain), ("K", request.largest_reset), ("K_of_gap", request.largest_reset)):
        if bound is not None and name in made.gains:
            assert np.linalg.norm(made.gains[name], 2, axis=(-2, -1)).max() <= float(bound)


@pytest.mark.parametrize("name", on(*CURVES))
def test_every_curve_of_a_trade_off_has_five_certified_points_at_least(name):
    _, made = solved(name)
    for curve in made.search.curves:
        limits = [point["gamma"] for point in curve["points"] if "gamma" in point]
        assert len([point for point in curve["points"] if "certified" in point]) >= 5
        assert limits == sorted(limits)


@pytest.mark.parametrize("name", on(*LIPSCHITZ))
def test_a_gain_for_a_lipschitz_system_stays_within_its_bounds_and_its_slack(name):
    _, made = solved(name)
    request, limit, slack = REQUESTS[name], made.limit_bounded or made.limit, 1 + float(REQUESTS[name].slack)
    constant, gamma = float(made.claim.lipschitz), float(made.claim.certificate.gamma)
    if request.objective == "max-lipschitz":
        assert limit["lipschitz"] / slack * (1 - 1e-5) <= constant <= limit["lipschitz"]
    if request.objective == "min-gamma" and not request.gains:
        assert limit["gamma"] <= gamma <= limit["gamma"] * slack
        assert constant == float(max(request.lipschitz))
    if request.objective == "pareto" and not isinstance(request.weight, Range):
        weight = float(request.weight)
        assert weight / constant + (1 - weight) * gamma**2 <= slack * limit["objective"]
    for point in (p for p in (made.search.points if made.search else ()) if "certified" in p and 0 < p["weight"] < 1):
        claimed = point["certified"]
        cost = point["weight"] / claimed["lipschitz"] + (1 - point["weight"]) * claimed["gamma"] ** 2
        assert point["objective"] * (1 - 1e-6) <= cost <= slack * point["objective"] * (1 + 1e-9)
    if request.bounds.L1 is not None:
        assert np.linalg.norm(made.gains["L"], 2) <= float(request.bounds.L1)


@pytest.mark.parametrize("name", on(*INCREMENTAL))
def test_a_shipped_gain_stays_within_its_bounds_and_its_slack(name):
    spec, made = solved(name)
    request, limit = spec.observer, made.limit_bounded or made.limit
    if request.objective in {"min-gamma", "pareto"} and not request.gains:
        assert limit["gamma"] <= made.claim.certificate.guarantee.gamma <= limit["gamma"] * (1 + float(request.slack))
    if request.gamma is not None:
        assert made.claim.certificate.gamma <= request.gamma
    if request.bounds.L1 is not None:
        largest = {"spectral": 2, "frobenius": "fro"}[request.bounds.norm]
        assert np.linalg.norm(made.gains["L1"], largest) <= float(request.bounds.L1)


def bounded_problem(spec):
    """Least gamma of a spec within its bound on L1, or within 2000."""
    request = spec.observer
    rate = request.rate.low if isinstance(request.rate, Range) else request.rate
    gain = request.gains["L2"] if request.gains else request.L2
    kind = theorem("l2", sampled=request.pace.sampled)
    family = searchable(kind(spec.posed, spec.multiplier, spec.H, rate, None, gain))
    bounds = request.bounds if request.bounds.L1 is not None else Bounds(L1=fmpq(2000))
    return family.least_gamma(bounds)


@pytest.mark.parametrize("through", ["cvxpy", "cvxopt"])
@pytest.mark.parametrize("name", on(*(name for name in INCREMENTAL if "gains" not in name and name not in LARGE)))
def test_the_solvers_agree(name, through, monkeypatch):
    """Clarabel called directly, Clarabel through cvxpy (another reading of the same matrices), and CVXOPT."""
    pytest.importorskip(through)
    problem = bounded_problem(shipped(name))
    direct = minimise(problem)
    if through == "cvxpy":
        from obsdesign.lmi import solve, solvers

        monkeypatch.setattr(solve, "call", lambda _: solvers.through_cvxpy("clarabel"))
    other = minimise(problem, through)
    assert (direct.status, other.status) == (Status.OPTIMAL, Status.OPTIMAL)
    assert other.objective == pytest.approx(direct.objective, rel=1e-3)
