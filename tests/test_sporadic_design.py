"""Designs for sporadic measurements: limits, edges, curves, bounded and certified gains, refusals, reasons."""

import math
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from support.shipped import shipped

from obsdesign.dissipation.bounds import Range
from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UsageError
from obsdesign.families.sporadic.certificate import certify_sporadic, jitter
from obsdesign.families.sporadic.exponential import design_sporadic
from obsdesign.families.sporadic.gains import Setting, reaching
from obsdesign.families.sporadic.request import SporadicRequest
from obsdesign.families.sporadic.study import Study, schemes
from obsdesign.lmi.formula import in_floats, rational, rational_number
from obsdesign.model.multiplier import Multiplier
from obsdesign.nonlinearities.lipschitz import lipschitz
from obsdesign.nonlinearities.slope import slope

OSCILLATOR, ROBOT, ARM = (shipped(f"ferrante2019-{name}").augmented for name in ("oscillator", "robot", "manipulator"))
LINEAR = Multiplier(())
ARM_OUTPUT = [[0, 0, 1, 0], [0, 0, 0, 1]]
L_OSCILLATOR = np.array([[2.067], [-3]])  # (51), with H = -1.384
L_ROBOT = np.array([[3.7, -2.194], [2.908, -2.075], [1.637, 0.1545]])
L2_ROBOT = np.array([[0.8079, 0.2555], [0.2071, 0.0550], [0.7609, 0.7714]])
L_ARM = np.array([[9.328, 1], [-48.78, 22.11], [-0.0524, 3.199], [19.41, -0.9032]])
TIGHTEST = {"dynamic": "proposition-2", "predictor": "proposition-2", "hold": "proposition-5"}  # of the paper
STABLE = replace(OSCILLATOR, A=rational([[-1, 1], [0, -2]]))
HIDDEN = replace(OSCILLATOR, A=rational([["-0.1", 0], [0, 1]]), C=rational([[0, 1]]))


def number(value):
    """Number, or a range of (low, high) or (low, high, points)."""
    if isinstance(value, tuple):
        return Range(rational_number(value[0]), rational_number(value[1]), *value[2:])
    return rational_number(value)


def request(T2, decay, T1="0.01", delta=("1", "100"), injections=("dynamic",), **further):
    return SporadicRequest(
        "sporadic",
        rational_number(T1),
        number(T2),
        number(decay),
        number(delta),
        injections,
        **{"relaxations": tuple(dict.fromkeys(TIGHTEST[name] for name in injections)), **further},
    )


def designed(made, multiplier, Cp, asked):
    return design_sporadic(made, multiplier, rational(Cp), asked, Engine())


@cache
def oscillator(T2="0.41", decay="0.05", **further):
    return designed(OSCILLATOR, LINEAR, np.eye(2), request(T2, decay, **further))


@cache
def robot(T2="0.3", decay="0.2", T1="0.1714", injections=("hold",), **further):
    return designed(ROBOT, LINEAR, [[0, 1, 0]], request(T2, decay, T1, injections=injections, **further))


@cache
def arm(T2="0.1", constant="3.33", **further):
    multiplier = lipschitz(rational_number(constant), 1, 1)
    return designed(ARM, multiplier, ARM_OUTPUT, request(T2, "0.01", **further))


def analyzed(made, multiplier, Cp, T2, decay, L, H, **further):
    gains = {"L": rational(np.vectorize(repr, otypes=[object])(L * 1.0)), "H": rational(H)}
    return designed(made, multiplier, Cp, request(T2, decay, gains=gains, **further))


def gamma(made):
    return float(made.claim.certificate.gamma)


def size(made):
    return np.linalg.norm(made.gains["L"], 2)


# Limits


def test_the_limit_of_the_oscillator_and_gains_near_the_published_ones():
    made = oscillator()
    assert made.status == "certified"
    assert made.limit["gamma"] == pytest.approx(32.149, rel=1e-4)
    assert gamma(made) <= 1.05 * made.limit["gamma"]
    np.testing.assert_allclose(made.gains["L"], L_OSCILLATOR, rtol=0.05)
    assert made.gains["H"].item() == pytest.approx(-1.384, rel=0.05)


def test_the_best_hold_of_the_robot():
    made = robot()
    assert made.status == "certified"
    assert made.limit["gamma"] == pytest.approx(1.51123, rel=1e-4)
    assert not made.gains["H"].any()
    assert made.scalars == {"hold proposition-5": {"printed": 64, "solved": 24}}
    proof = made.claim.certificate
    assert jitter(proof.T1, proof.T2) == {"jitter": pytest.approx(0.75029, rel=1e-4)}


@pytest.mark.parametrize(("T2", "limit"), [("0.3", 3.3700)])
def test_the_limit_of_the_arm(T2, limit):
    made = arm(T2, largest_gain=rational_number(100))
    assert made.status == "certified"
    assert made.limit["gamma"] == pytest.approx(limit, rel=5e-4)
    assert made.limit["gamma"] < gamma(made) <= 1.05 * made.limit_bounded["gamma"]
    assert size(made) <= 100


@pytest.mark.parametrize(
    ("name", "injection", "relaxation", "longest"),
    [
        ("oscillator", "hold", "proposition-5", 0.4190),
        ("oscillator", "dynamic", "proposition-4", 0.4002),
        ("oscillator", "dynamic", "proposition-3", 0.3517),
        ("oscillator", "predictor", "proposition-2", 0.4346),
        ("arm", "dynamic", "proposition-2", 0.3429),
        ("arm", "dynamic", "proposition-3", 0.1887),
        ("arm", "dynamic", "proposition-4", 0.1924),
        ("arm", "hold", "proposition-5", 0.1697),
        ("arm", "predictor", "proposition-2", 0.2607),
    ],
)
def test_the_longest_interval_of_each_relaxation(name, injection, relaxation, longest):
    arm = name == "arm"
    decay = 0.01 if arm else 0.05
    asked = request("0.1", repr(decay), injections=(injection,), relaxations=(relaxation,))
    multiplier = lipschitz(rational_number("3.3"), 1, 1) if arm else LINEAR
    Cp = rational(ARM_OUTPUT if arm else np.eye(2))
    setting = Setting(Engine(), ARM if arm else OSCILLATOR, multiplier, Cp, asked.delta, asked.T1)
    study = Study(setting, schemes(asked)[0], asked)
    assert study.missing(longest * 0.995, decay) < 0 < study.missing(longest * 1.005, decay)


def test_a_design_for_the_longest_interval():
    made = oscillator(("0.2", "1"), objective="max-T2")
    assert made.status == "certified"
    assert made.limit["T2"] == pytest.approx(0.4352, rel=1e-3)
    assert made.limit["T2"] / 1.05 * (1 - 1e-5) <= float(made.claim.certificate.T2) < made.limit["T2"]


def test_the_fastest_decay():
    made = oscillator(decay=("0.04", "0.4"), objective="max-decay")
    assert made.status == "certified"
    assert made.limit["decay"] > 0.0853  # that of the published gains
    assert made.limit["decay"] / 1.05 * (1 - 1e-5) <= float(made.claim.certificate.family.decay) < made.limit["decay"]


# Given gains


@pytest.mark.parametrize(
    ("L", "decay", "longest"),
    [(L_ROBOT, 0.2, 0.3674), (L_ROBOT, 1e-4, 0.432), (L2_ROBOT, 0.2, 0.5416), (L2_ROBOT, 1e-4, 0.682)],
)
def test_the_interval_that_given_gains_of_the_robot_tolerate(L, decay, longest):
    delta = number(("1", "100"))
    setting = Setting(Engine(), ROBOT, LINEAR, rational([[0, 1, 0]]), delta, rational_number("0.1"))
    landscape = setting.analysis((rational(L), rational(np.zeros((2, 2)))), decay)
    assert landscape.least_missing(longest * 0.995) < 0 < landscape.least_missing(longest * 1.005)


def test_a_rival_gain_of_the_robot():
    made = analyzed(ROBOT, LINEAR, [[0, 1, 0]], "0.3", "0.2", L2_ROBOT, np.zeros((2, 2)))
    assert made.status == "certified"
    assert gamma(made) == pytest.approx(7.6631, rel=1e-3)


def test_published_gains_of_the_oscillator_keep_the_published_gamma():
    made = analyzed(OSCILLATOR, LINEAR, np.eye(2), "0.41", "0.05", L_OSCILLATOR, [["-1.384"]])
    assert made.status == "certified"
    assert gamma(made) == pytest.approx(32.917, rel=1e-3)
    assert float(made.claim.longest.T2) == pytest.approx(0.4309, rel=3e-3)
    assert made.limit["gamma"] == pytest.approx(32.149, rel=1e-3)


@pytest.mark.parametrize(("constant", "longest"), [("3.33", 0.11446)])
def test_the_interval_that_the_gain_of_postoyan_tolerates(constant, longest):
    H = -in_floats(ARM).C @ L_ARM
    made = analyzed(ARM, lipschitz(rational_number(constant), 1, 1), ARM_OUTPUT, "0.1016", "0.01", L_ARM, rational(H))
    assert made.status == "certified"
    assert float(made.claim.longest.T2) == pytest.approx(longest, rel=3e-3)
    assert gamma(made) == pytest.approx(1.264, rel=2e-2)


def test_given_gains_that_achieve_nothing_are_told_what_they_would_tolerate():
    made = analyzed(OSCILLATOR, LINEAR, np.eye(2), "0.41", "0.05", np.array([[0.3648], [-0.4655]]), [["-0.3648"]])
    assert (made.status, made.claim) == ("infeasible", None)
    assert made.diagnosis["condition"] == "gains"
    assert made.diagnosis["feasible"]["T2"] == pytest.approx(0.3142, rel=1e-3)


def test_the_longest_interval_of_given_gains_is_certified():
    gains = {"L": rational([["2.067"], ["-3"]]), "H": rational([["-1.384"]])}
    asked = request(("0.3", "0.6"), "0.05", gains=gains, objective="max-T2", slack=rational_number("0.01"))
    made = designed(OSCILLATOR, LINEAR, np.eye(2), asked)
    assert made.status == "certified"
    assert float(made.claim.certificate.T2) == pytest.approx(0.4309 / 1.01, rel=5e-3)


# Bounds


def test_the_bound_on_the_gain_is_kept_and_nearly_used():
    made = arm(constant="3.3", largest_gain=rational_number(20))
    assert made.status == "certified"
    assert made.limit_bounded["gamma"] < 0.25  # the usual convex bound gives 0.525
    assert size(made) <= 20
    assert gamma(made) <= 1.05 * made.limit_bounded["gamma"]


def test_a_gamma_out_of_reach_is_told_the_least():
    made = oscillator(largest_gamma=rational_number(20))
    assert made.status == "infeasible"
    assert made.diagnosis["condition"] == "gamma"
    assert made.diagnosis["feasible"]["gamma"] == pytest.approx(32.149, rel=1e-3)


def test_a_gain_that_is_too_small_is_told_so():
    made = oscillator(largest_gain=rational_number("0.01"))
    assert (made.status, made.diagnosis["condition"]) == ("undecided", "bounds")


def test_bounds_shorten_the_longest_interval():
    bounds = {"largest_gamma": rational_number(10), "largest_gain": rational_number(5)}
    made = oscillator(("0.3", "0.45"), objective="max-T2", **bounds)
    assert made.status == "certified"
    assert made.limit_bounded["T2"] < made.limit["T2"]
    assert gamma(made) <= 10
    assert size(made) <= 5


# Curves


def test_a_curve_of_the_hold_against_the_published_one():
    made = robot(("0.1714", "0.2571", 2), objective="pareto")
    points = made.search.curves[0]["points"]
    for point, published in zip(points, (0.871, 1.276), strict=True):
        assert_published(point, published, 3e-3)
    assert {p["status"] for p in points} == {"certified"}
    assert all(p["certified"]["gamma"] <= 1.05 * p["gamma"] for p in points)


def assert_published(point, gamma, rel):
    """Hold a point against the limit of its relaxation, or below it, where its own gains are proved to be better."""
    if point.get("kind") == "best-found" and "certified" in point:
        assert point["certified"]["gamma"] == point["gamma"] <= gamma * (1 + rel)
    else:
        assert point["gamma"] == pytest.approx(gamma, rel=rel)


def test_curves_of_every_relaxation_of_the_oscillator():
    relaxations = tuple(f"proposition-{k}" for k in (2, 3, 4, 5))
    made = oscillator(("0.1", "0.43", 2), injections=("dynamic", "hold"), relaxations=relaxations, objective="pareto")
    found = {c["relaxation"]: c["points"] for c in made.search.curves}
    known = {
        "proposition-2": [1.0497, 170.3],
        "proposition-3": [1.2012, None],
        "proposition-4": [1.1994, None],
        "proposition-5": [1.2148, None],
    }
    assert found.keys() == known.keys()
    for name, (short, long) in known.items():
        first, second = found[name]
        assert_published(first, short, 2e-3)
        if long is None:
            assert "gamma" not in second
        else:
            assert_published(second, long, 5e-3)
    assert made.search.curves[3]["injection"] == "hold"


def test_a_curve_of_interval_against_decay():
    made = oscillator(("0.25", "0.5"), ("0.05", "0.4", 2), objective="pareto")
    points = made.search.curves[0]["points"]
    assert [p["T2"] for p in points] == pytest.approx([0.4352, 0.2932], rel=2e-3)
    assert {p["status"] for p in points} == {"certified"}


# Certificates, and other nonlinearities


def test_the_certificate_of_a_design_can_be_checked_anew_and_altered_gains_fail():
    made = oscillator()
    c = made.claim.certificate

    def again(L):
        values = {"P1": c.P1, "P2": c.P2}
        interval = c.T1, c.T2
        return certify_sporadic(
            OSCILLATOR, LINEAR, c.family.Cp, (L, c.H), interval, c.family.decay, c.family.delta, c.gamma, c.mu, values
        )

    assert again(rational(np.vectorize(repr, otypes=[object])(made.gains["L"]))).holds
    assert not again(c.L + rational([[0], ["0.5"]])).holds


def test_a_slope_of_either_sign_is_served():
    """The arm with a friction of a slope between 0 and 3 in place of the sine."""
    made = designed(
        ARM,
        slope(((rational_number(0), rational_number(3)),), 1, 1),
        ARM_OUTPUT,
        request("0.05", "0.01", delta=("40", "60"), injections=("hold",)),
    )
    assert made.status == "certified"
    assert gamma(made) <= 1.05 * made.limit["gamma"]


def test_without_a_disturbance_any_gains_that_decay_will_do():
    quiet = replace(OSCILLATOR, B=OSCILLATOR.B[:, :0], D=OSCILLATOR.D[:, :0], Dq=OSCILLATOR.Dq[:, :0])
    made = designed(quiet, LINEAR, np.eye(2), request("0.3", "0.05", objective="feasibility"))
    assert (made.status, gamma(made)) == ("certified", 0.0)


def test_without_a_rate_the_decay_of_corollary_2_is_proved():
    made = oscillator("0.2", "0")
    assert made.status == "certified"
    assert not made.claim.certificate.family.decay
    found = made.claim.constants
    assert 0 < float(found["rate"]) < 0.1
    assert found["noise"] > 0


def test_where_the_error_decays_by_itself_every_interval_will_do():
    made = designed(STABLE, LINEAR, np.eye(2), request(("0.1", "50"), "0.1", objective="max-T2"))
    assert made.status == "certified"
    assert made.limit == {"T2": 50.0, "attained": True, "unbounded": True}
    assert not made.gains["L"].any()
    assert any("unbounded" in note for note in made.notes)


# Reasons


def test_a_hidden_mode_is_named():
    made = designed(HIDDEN, LINEAR, np.eye(2), request("0.1", "0.2"))
    assert (made.status, made.diagnosis["condition"]) == ("infeasible", "detectability")
    assert made.diagnosis["feasible"] == {"decay_below": pytest.approx(0.1)}


@pytest.mark.parametrize("T2", ["1.6", "5"])
def test_an_interval_that_hides_the_oscillation_is_named(T2):
    made = oscillator(T2)
    assert (made.status, made.diagnosis["condition"]) == ("infeasible", "sampling")
    assert made.diagnosis["interval"] == pytest.approx(math.pi / 2)


def test_an_interval_that_hides_nothing_is_not_blamed():
    """Two outputs see both phases of the oscillation; the inequality fails all the same."""
    seen = replace(OSCILLATOR, C=rational(np.eye(2)), D=rational(np.zeros((2, 1))), Df=rational(np.zeros((2, 0))))
    made = designed(seen, LINEAR, np.eye(2), request("1.6", "0.05", injections=("hold",)))
    assert (made.status, made.diagnosis["condition"]) == ("infeasible", "inequality")
    assert 0 < made.diagnosis["feasible"]["T2"] < 1.6


def test_too_long_an_interval_is_told_the_longest():
    made = oscillator("0.5")
    assert (made.status, made.diagnosis["condition"]) == ("infeasible", "inequality")
    assert made.diagnosis["feasible"]["T2"] == pytest.approx(0.4352, rel=1e-3)


# Refusals


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"T1": "0.5"}, "T1"),
        ({"T1": "-0.1"}, "T1"),
        ({"decay": "-1"}, "negative"),
        ({"delta": ("0.01", "0.09"), "injections": ("hold",)}, "delta > 2 decay"),
        ({"injections": ("hold",), "relaxations": ("proposition-2",)}, "hold takes clock, proposition-5"),
        ({"relaxations": ("proposition-2", "proposition-9")}, "proposition-9"),
        ({"objective": "pareto"}, "needs a range"),
        ({"gains": {"L": rational([[1]]), "H": rational([[1]])}}, "2x1"),
        ({"gains": {"L": rational([[1], [1]]), "H": rational([[1, 1]])}}, "1x1"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(changed, message):
    with pytest.raises(UsageError, match=message) as refusal:
        designed(OSCILLATOR, LINEAR, np.eye(2), request(**{"T2": "0.41", "decay": "0.05", **changed}))
    assert "\n" not in str(refusal.value)


def test_a_direct_term_is_refused():
    with pytest.raises(UsageError, match="D = 0"):
        designed(replace(OSCILLATOR, D=rational([[1]])), LINEAR, np.eye(2), request("0.1", "0.05"))


def test_gamma_without_a_disturbance_is_feasibility_and_a_curve_of_it_is_refused():
    quiet = replace(OSCILLATOR, B=OSCILLATOR.B[:, :0], D=OSCILLATOR.D[:, :0], Dq=OSCILLATOR.Dq[:, :0])
    made = designed(quiet, LINEAR, np.eye(2), request("0.3", "0.05"))
    assert made.status == "certified"
    assert any("no disturbance" in note for note in made.notes)
    with pytest.raises(UsageError, match="no disturbance"):
        designed(quiet, LINEAR, np.eye(2), request("0.3", "0.05", objective="pareto"))


def test_a_range_of_delta_that_is_cut_is_mentioned():
    made = oscillator("0.1", delta=("0.05", "100"), injections=("hold",))
    assert any("begins at" in note for note in made.notes)


@pytest.mark.parametrize(
    ("gammas", "kept"),
    [((3, 1.5, 9, 9), 1.5), ((3, 2.5, 2.9, None), 2.5), ((None, 3, None, None), 3), ((None,) * 4, None)],
)
def test_of_the_roundings_of_a_gain_a_proved_one_is_kept_and_the_first_that_reaches_gamma_at_once(
    gammas, kept, monkeypatch
):
    proofs = iter([g and SimpleNamespace(holds=True, gamma=g) for g in gammas])
    monkeypatch.setattr("obsdesign.families.sporadic.gains.prove", lambda *_: next(proofs))
    relaxation = SimpleNamespace(injection="dynamic")
    setting = SimpleNamespace(plant=SimpleNamespace(C=rational(np.zeros((1, 1)))))
    candidate = SimpleNamespace(relaxation=relaxation, gains=(np.eye(1) / 3, np.eye(1)), delta=1.0)
    _, made = reaching(setting, candidate, 1, 0, 2.0, None)
    assert (made and made.gamma) == kept
