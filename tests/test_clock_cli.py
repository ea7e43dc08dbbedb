"""Clock-dependent certificates through the command line: what is asked wrongly, what is claimed falsely, what holds."""

import copy
import json
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from flint import fmpq
from support.commands import result_of, run
from support.forging import at, put, scaled, with_spec
from support.fractions import fractions, positive

import obsdesign as od
from obsdesign.lmi.formula import rational

SPEC = """
obsdesign: 1
name: Oscillator
system: {A: [[0, 1], [-4, 0]], B: [1, 0], C: [1, 0]}
nonlinearities: [{f: 0.5*sin(q), type: {lipschitz: 0.5}, Bf: [0, 1], Cq: [1, 0]}]
observer: {type: sporadic, T1: 0.1, T2: 0.2, decay: 0.05, gains: {L: [2.067, -3], H: -1.384}}
"""
RESET = SPEC.replace("gains: {L: [2.067, -3], H: -1.384}", "injection: reset, bounds: {K: 2}")
AHEAD = SPEC.replace("gains:", "clock: {lookahead: 2, segments: 3}, gains:").replace(
    "{L: [2.067, -3], H: -1.384}", "{K: [0.7, 0.4]}"
)
LINEAR = """
obsdesign: 1
name: Oscillator
system: {A: [[0, 1], [-4, 0]], B: [1, 0], C: [1, 0]}
observer: {type: sporadic, %s}
"""
TIMES, GAINS = "T1: 0.1, T2: 0.2, decay: 0.05, ", "gains: {L: [2.067, -3], H: -1.384}"
GAP = "injection: reset, bounds: {K: 3}, clock: {gain: gap}"
WITNESSES = ("gamma", "overshoot", "disturbance", "noise", "T2_max")
pytestmark = [pytest.mark.xdist_group("clock-cli"), pytest.mark.usefixtures("designed_once")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder for results of this module."""
    return tmp_path_factory.mktemp("clock")


@pytest.fixture(scope="module")
def genuine(folder):
    """Text of the result for given gains."""
    return result_of(folder, SPEC, "given")


@pytest.fixture(scope="module")
def resets(folder):
    """Text of the result of a designed reset."""
    return result_of(folder, RESET, "reset")


@pytest.fixture(scope="module")
def looks_ahead(folder):
    """Text of the result with a look ahead."""
    return result_of(folder, AHEAD, "ahead")


def restated(text, tmp_path, change, respecify=None):
    """A file whose claim is changed, with a statement, constants and numbers that are those of the changed claim."""
    path, content = tmp_path / "genuine.json", json.loads(text)
    path.write_text(text)
    design = od.read(path)
    claim = change(replace(design.claim, stated=None))
    content |= json.loads(json.dumps(claim.written(design.spec, {"limit": content["guarantee"]["limit"]})))
    content["observer"] |= {name: content["guarantee"][name] for name in ("T1", "T2")}
    return with_spec(content, *respecify) if respecify else content


def rewitnessed(name, **changes):
    """Change of one witness of a claim: of its fields, or by what is said of them."""

    def change(claim):
        witness = claim.longest if name == "T2_max" else claim.witnesses[name]
        made = replace(witness, **{key: value(getattr(witness, key)) for key, value in changes.items()})
        if name == "T2_max":
            return replace(claim, longest=made)
        overdue = claim.outage and replace(claim.outage, overshoot=made) if name == "overshoot" else claim.outage
        return replace(claim, witnesses={**claim.witnesses, name: made}, outage=overdue)

    return change


def refused(outcome, code=4):
    """Whether a file is not believed, in lines and without a traceback."""
    assert outcome.exit_code == code, outcome.output
    assert outcome.stderr
    return True


# What holds


def bernstein_slopes(P, h):
    """Control values of the derivative on one segment."""
    d = len(P) - 1
    return [(k * (P[k] - P[k - 1] if k else 0) + (d - k) * (P[k + 1] - P[k] if k < d else 0)) / h for k in range(d + 1)]


@pytest.mark.parametrize("name", ["gamma", "disturbance", "noise"])
def test_the_numbers_of_a_file_prove_its_claim_by_hand(genuine, name):
    """(F) and (J) or (N) from the equations of the observer, in fractions that share nothing with the package."""
    content = json.loads(genuine)
    witness, guarantee = content["certificate"]["witnesses"][name], content["guarantee"]
    A, C, L, H = map(fractions, ([[0, 1], [-4, 0]], [[1, 0]], content["observer"]["L"], content["observer"]["H"]))
    rate = Fraction(witness["lambda"])
    mu, kappa = (Fraction(witness[key]) if key in witness else None for key in ("mu", "kappa"))
    knots = [Fraction(s) for s in witness["knots"]]
    P = fractions(witness["P"])
    scales = fractions(witness["multipliers"]["lambda1"])
    e, d, w, f = np.split(fractions(np.eye(5, dtype=int)), [2, 3, 4])
    x = np.vstack([e, d])
    e_rate = A @ e + fractions([[1], [0]]) @ w + fractions([[0], [1]]) @ f - L @ (C @ e - d)
    x_rate = np.vstack([e_rate, C @ e_rate - H @ (C @ e - d)])
    for i, (start, end) in enumerate(pairwise(knots)):
        for at_k, slope, scale in zip(P[i], bernstein_slopes(P[i], end - start), scales[i], strict=True):
            half = x.T @ at_k @ (x_rate + rate * x)
            supply = scale * (e[:1].T @ e[:1] / 4 - f.T @ f)
            flow = half + half.T - x.T @ slope @ x + supply - (mu or 0) * w.T @ w
            flow = flow + (e.T @ e if name == "gamma" else 0)
            kept = [0, 1, 2, 4] if mu is None else range(5)
            assert positive(-flow[np.ix_(kept, kept)])
            assert scale >= 0
        if end > Fraction("0.1"):
            for at_k in P[i]:
                y, eta = np.split(fractions(np.eye(4, dtype=int)), [3])
                after = np.vstack([y[:2], -eta])
                grows = after.T @ at_k @ after - y.T @ P[0, 0] @ y - (kappa or 0) * eta.T @ eta
                assert positive(-(grows if kappa is not None else grows[:3, :3]))
    eye = fractions(np.eye(3, dtype=int))
    floor, proved = (0, "gamma") if name == "gamma" else (1, name)
    assert all(positive(at_k - floor * eye) for at_k in (P[:1, 0] if name == "gamma" else P.reshape(-1, 3, 3)))
    square = Fraction(str(guarantee[proved])) ** 2
    if name == "gamma":
        assert square >= mu
        assert all(positive(Fraction(witness["r"]) * eye - at_k) for at_k in P.reshape(-1, 3, 3))
        assert Fraction(str(guarantee["initial"])) ** 2 >= Fraction(witness["r"])
    elif name == "disturbance":
        assert square >= mu / (2 * rate)
    else:
        assert float(square) >= float(kappa) / -np.expm1(-2 * float(rate) * 0.1) * (1 - 1e-12)


def test_the_genuine_files_are_proved_and_say_for_which_intervals(genuine, resets, looks_ahead, outcome_of):
    for text in (genuine, resets, looks_ahead):
        outcome = outcome_of(text)
        assert outcome.exit_code == 0
        assert outcome.stdout.splitlines()[-1].endswith("intervals 0.1 to 0.2 s")
        content = json.loads(text)
        assert content["guarantee"]["kind"] == "clock"
        assert "0.1 to 0.2 apart" in content["guarantee"]["statement"]
        assert {"gamma", "overshoot", "disturbance", "noise"} <= content["certificate"]["witnesses"].keys()
        assert "outage" in content["certificate"]["witnesses"]["overshoot"]
        assert "delta" not in content["observer"]
    assert json.loads(resets)["observer"].keys() >= {"K"}
    assert not json.loads(resets)["observer"].keys() & {"L", "H"}
    assert json.loads(looks_ahead)["certificate"]["witnesses"]["gamma"]["parts"].keys() == {"2"}


# What is claimed falsely


@pytest.mark.parametrize(
    ("name", "number", "factor"),
    [
        ("gamma", "mu", fmpq(99, 100)),
        ("gamma", "mu", fmpq(0)),
        ("gamma", "r", fmpq(99, 100)),
        ("energy", "kappa", fmpq(99, 100)),
        ("energy", "mu", fmpq(99, 100)),
        ("overshoot", "r", fmpq(99, 100)),
        ("disturbance", "mu", fmpq(99, 100)),
        ("noise", "kappa", fmpq(99, 100)),
        ("T2_max", "r", fmpq(1, 100)),
    ],
)
@pytest.mark.parametrize("which", ["genuine", "resets"])
def test_better_numbers_are_not_proved(request, outcome_of, tmp_path, which, name, number, factor):
    text = request.getfixturevalue(which)
    if which == "resets" and name == "T2_max":
        pytest.skip("of given gains only")
    change = rewitnessed(name, numbers=lambda numbers: {**numbers, number: factor * numbers[number]})
    assert refused(outcome_of(restated(text, tmp_path, change)))


@pytest.mark.parametrize("name", WITNESSES)
def test_a_faster_decay_is_not_proved(genuine, outcome_of, tmp_path, name):
    change = rewitnessed(name, theorem=lambda theorem: replace(theorem, decay=fmpq(1, 2)))
    assert refused(outcome_of(restated(genuine, tmp_path, change)))


@pytest.mark.parametrize("name", WITNESSES)
def test_no_control_value_turned_round_proves_anything(genuine, outcome_of, tmp_path, name):
    for k in (0, 3, -1):
        P = lambda P, k=k: np.concatenate([P[:, :k], -P[:, k : k + 1 or None], P[:, k + 1 or 99 :]], axis=1)  # noqa: E731
        assert refused(outcome_of(restated(genuine, tmp_path, rewitnessed(name, P=P))))
    turned = lambda M: {key: -X for key, X in M.items()}  # noqa: E731
    assert refused(outcome_of(restated(genuine, tmp_path, rewitnessed(name, multipliers=turned))))


def timed(factor):
    """Change of a claim whose every clock runs to so many times T2."""

    def slower(theorem):
        pieces = replace(theorem.clock, knots=tuple(factor * s for s in theorem.clock.knots))
        return replace(theorem, clock=pieces)

    def change(claim):
        for name in claim.witnesses:
            claim = rewitnessed(name, theorem=slower)(claim)
        return replace(claim, T2=factor * claim.T2, longest=None)

    return change


def test_longer_intervals_are_not_proved(genuine, outcome_of, tmp_path):
    content = restated(genuine, tmp_path, timed(fmpq(10)), ("T2: 0.2", "T2: 2"))
    assert "0.1 to 2.0 apart" in content["guarantee"]["statement"]
    assert refused(outcome_of(content))
    content = restated(genuine, tmp_path, timed(fmpq(6, 5)), ("T2: 0.2", "T2: 0.24"))
    assert refused(outcome_of(content))


@pytest.mark.parametrize("T1", ["0.0999", "0.01", "0"])
@pytest.mark.parametrize("which", ["genuine", "resets", "looks_ahead"])
def test_shorter_intervals_are_not_proved(request, outcome_of, tmp_path, which, T1):
    def change(claim):
        shortest = rational([[T1]]).item()
        for name in claim.witnesses:
            claim = rewitnessed(name, theorem=lambda theorem: replace(theorem, T1=shortest))(claim)
        return replace(claim, T1=shortest, longest=None)

    if which == "looks_ahead" and T1 == "0":
        pytest.skip("refused as a request")
    content = restated(request.getfixturevalue(which), tmp_path, change, ("T1: 0.1", f"T1: {T1}"))
    assert refused(outcome_of(content))


@pytest.mark.parametrize("factor", [fmpq(11, 10), fmpq(3)])
def test_a_longer_tolerated_interval_is_not_proved(genuine, outcome_of, tmp_path, factor):
    def slower(theorem):
        pieces = replace(theorem.clock, knots=tuple(factor * s for s in theorem.clock.knots))
        return replace(theorem, clock=pieces)

    assert refused(outcome_of(restated(genuine, tmp_path, rewitnessed("T2_max", theorem=slower))))


def test_an_outage_that_grows_less_is_not_proved(genuine, outcome_of, tmp_path):
    def change(claim):
        return replace(claim, outage=replace(claim.outage, growth=claim.outage.growth * fmpq(9, 10)))

    assert refused(outcome_of(restated(genuine, tmp_path, change)))
    for key, factor in (("growth", "0.9"), ("share", "1.1")):
        outcome = outcome_of(scaled(json.loads(genuine), ("guarantee", "outage", key), factor))
        assert refused(outcome, 2)
        assert "guarantee.outage: is better than what its witness proves" in outcome.stderr


@pytest.mark.parametrize("key", ["gamma", "overshoot", "initial", "disturbance", "noise"])
def test_a_constant_that_is_better_than_proved_is_refused(genuine, outcome_of, tmp_path, key):
    path = tmp_path / "read.json"
    path.write_text(genuine)
    design = od.read(path)
    for factor, code in ((fmpq(999, 1000), 4), (fmpq(11, 10), 0)):
        claim = replace(design.claim, stated={**design.claim.least, key: design.claim.least[key] * factor})
        content = json.loads(genuine)
        limits = {"limit": content["guarantee"]["limit"]}
        content |= json.loads(json.dumps(claim.written(design.spec, limits)))
        outcome = outcome_of(content)
        assert outcome.exit_code == code, outcome.output
        assert code == 0 or f"{key} is proved" in outcome.stderr


def test_another_rate_of_the_guarantee_than_that_of_its_witness_is_refused(genuine, outcome_of):
    content = json.loads(genuine)
    content["guarantee"]["rate"] = 0.4
    content["guarantee"]["statement"] = content["guarantee"]["statement"].replace("exp(-0.05 t)", "exp(-0.4 t)")
    assert refused(outcome_of(content), 2)


@pytest.mark.parametrize(
    "change",
    [
        ("A: [[0, 1], [-4, 0]]", "A: [[0, 1], [-9, 0]]"),
        ("B: [1, 0]", "B: [3, 0]"),
        ("C: [1, 0]}", "C: [2, 0]}"),
        ("lipschitz: 0.5}", "lipschitz: 2}"),
        ("Bf: [0, 1]", "Bf: [0, 4]"),
    ],
    ids=lambda change: change[1],
)
def test_witnesses_of_another_plant_prove_nothing(content, outcome_of, change):
    content["notes"] = []
    content["spec"]["text"] = content["spec"]["text"].replace("f: 0.5*sin(q), ", "")
    assert outcome_of(with_spec(content, *change)).exit_code in {2, 4}


def test_other_gains_are_not_proved(content, outcome_of):
    content["observer"] |= {"L": [[0], [0]], "H": [[0]]}
    assert refused(outcome_of(with_spec(content, GAINS, "gains: {L: [0, 0], H: 0}")))


def test_gains_that_the_spec_does_not_give_and_those_beyond_their_bound_are_refused(genuine, resets, outcome_of):
    content = json.loads(genuine)
    content["observer"]["L"][0][0] *= 2
    outcome = outcome_of(content)
    assert refused(outcome, 2)
    assert "observer.L: differs from the gain that the spec gives" in outcome.stderr
    content = json.loads(genuine)
    for key in ("L", "H"):
        del content["observer"][key]
    content["observer"]["K"] = [[0.7], [0.4]]
    assert "the spec gives L, H" in outcome_of(content).stderr
    content = json.loads(resets)
    outcome = outcome_of(with_spec(content, "K: 2", "K: 0.5"))
    assert refused(outcome)
    content = json.loads(resets)
    del content["observer"]["K"]
    content["observer"] |= {"L": [[0.7], [0.4]], "H": [[0]]}
    assert refused(outcome_of(content), 2)


# What is malformed


def places(value, keys=()):
    """Paths of all keys of a nested table, lists apart."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield (*keys, key)
            yield from places(part, (*keys, key))


def test_a_field_that_is_left_out_is_missed_or_says_less(genuine, looks_ahead, outcome_of):
    less = {
        ("certificate", "kind"),
        ("guarantee", "limit"),
        *(("guarantee", "limit", key) for key in ("gamma", "attained", "kind")),
    }
    less |= {("certificate", "witnesses", name, key) for name in WITNESSES for key in ("r", "kappa")}
    for text in (genuine, looks_ahead):
        content = json.loads(text)
        for section in ("guarantee", "certificate"):
            for keys in places(content[section], (section,)):
                forged = copy.deepcopy(content)
                del at(forged, keys[:-1])[keys[-1]]
                outcome = outcome_of(forged)
                assert outcome.exit_code in ({0, 2} if keys in less else {2, 4}), keys


HUGE = "9" * 400
WRONG = [
    *(None, True, "x", "1/0", "nan", "-inf", float("nan"), HUGE, f"1/{HUGE}", "1e400", -1, 0, [], {}, [1], [[1]]),
    *([[[[1]]]], {"a": 1}, [["1", "2"], ["3"]]),
]


@pytest.mark.parametrize("key", ["lambda", "mu", "r", "kappa", "knots", "P", "multipliers"])
def test_wrong_values_of_a_witness_are_answered_in_a_line(genuine, outcome_of, key):
    content = json.loads(genuine)
    kept = content["certificate"]["witnesses"]["energy"][key]
    for value in WRONG:
        if value != kept:
            content["certificate"]["witnesses"]["energy"][key] = value
            outcome = outcome_of(json.dumps(content))
            assert outcome.exit_code in {2, 4} or key in {"lambda", "kappa"}, value


@pytest.mark.parametrize("kind", ["P", "multipliers"])
def test_wrong_shapes_of_a_witness_are_answered_in_a_line(genuine, outcome_of, kind):
    content = json.loads(genuine)
    whole = at(content, ("certificate", "witnesses", "gamma", kind))
    whole = whole["lambda1"] if kind == "multipliers" else whole
    keys = ("certificate", "witnesses", "gamma", kind, *(["lambda1"] if kind == "multipliers" else []))
    for wrong in (
        whole[:1],
        [*whole, whole[-1]],
        [whole[0][:-1], whole[1]],
        [part[:1] for part in whole],
        [[*part, part[-1]] for part in whole],
        *([[[row[:2] for row in X] for X in part] for part in whole] for _ in range(kind == "P")),
        [[1] * 500] * 500,
    ):
        outcome = outcome_of(put(copy.deepcopy(content), keys, wrong))
        assert outcome.exit_code == 2, outcome.output


def test_a_storage_function_that_jumps_or_is_not_symmetric_is_refused(content, outcome_of):
    P = content["certificate"]["witnesses"]["gamma"]["P"]
    first = copy.deepcopy(P[1][0])
    P[1][0][0][0] = "5"
    outcome = outcome_of(content)
    assert refused(outcome, 2)
    assert "a segment does not begin with the matrix that the last one ends with" in outcome.stderr
    P[1][0] = first
    P[0][2][0][1] = "5"
    outcome = outcome_of(content)
    assert refused(outcome, 2)
    assert "certificate.witnesses.gamma.P: not symmetric" in outcome.stderr


@pytest.mark.parametrize(
    "knots",
    [["0", "1/5"], ["0", "1/5", "1/10"], ["0", "1/10", "1/10", "1/5"], ["0", "1/10", "3/10"], ["1/100", "1/10", "1/5"]],
)
def test_knots_that_are_not_those_of_the_segments_are_refused(content, outcome_of, knots):
    content["certificate"]["witnesses"]["gamma"]["knots"] = knots
    assert refused(outcome_of(content), 2)


def test_other_knots_than_the_shortest_interval_prove_less(content, outcome_of):
    content["certificate"]["witnesses"]["gamma"]["knots"] = ["0", "1/20", "1/5"]
    assert refused(outcome_of(content))


@pytest.mark.parametrize("kind", ["exponential", "clocks", 3])
def test_another_kind_of_guarantee_is_refused(content, outcome_of, kind):
    content["guarantee"]["kind"] = kind
    assert refused(outcome_of(content), 2)


def test_witnesses_of_nothing_that_is_known_are_refused(content, outcome_of):
    content["certificate"]["witnesses"]["speed"] = content["certificate"]["witnesses"]["gamma"]
    outcome = outcome_of(content)
    assert refused(outcome, 2)
    assert "certificate.witnesses.speed: expected gamma" in outcome.stderr


# What is asked wrongly

MISTAKES = {
    "degree": (f"{TIMES}clock: {{degree: 0}}, {GAINS}", "clock.degree: 0 is not allowed; give a whole number from 1"),
    "fraction": (f"{TIMES}clock: {{degree: 1.5}}, {GAINS}", "clock.degree: 1.5 is not allowed; give a whole number"),
    "segments": (f"{TIMES}clock: {{segments: 0}}, {GAINS}", "clock.segments: 0 is not allowed; give a whole number"),
    "lookahead": (f"{TIMES}clock: {{lookahead: 0}}, {GAINS}", "clock.lookahead: 0 is not allowed"),
    "key": (f"{TIMES}clock: {{order: 2}}, {GAINS}", "clock.order: unknown key order; allowed: degree, segments"),
    "gain": (f"{TIMES}injection: reset, clock: {{gain: both}}", "unknown gain both; allowed: constant, gap"),
    "gap": (f"{TIMES}injection: hold, clock: {{gain: gap}}", "clock.gain: gap is for injection reset"),
    "order": (f"T1: 0.3, T2: 0.2, {GAINS}", "observer.T2: 0.2 is below T1 = 0.3"),
    "negative": (f"T1: -1, T2: 0.2, {GAINS}", "observer.T1: -1 is not allowed; give a number >= 0"),
    "zero": (f"T1: 0, T2: 0, {GAINS}", "observer.T2: 0 is not allowed; give a number > 0"),
    "shape": (f"{TIMES}gains: {{K: [[0.7, 0.4]]}}", "gains.K: expected 2 rows"),
    "length": (f"{TIMES}gains: {{K: [0.7, 0.4, 1]}}", "gains.K: expected 2 rows"),
    "L of a reset": (f"{TIMES}injection: reset, gains: {{L: [1, 2]}}", "gains.L: is no gain of this injection"),
    "H of a reset": (f"{TIMES}injection: reset, gains: {{K: [1, 2], H: 0}}", "gains.H: is no gain of this injection"),
    "K of a hold": (f"{TIMES}injection: hold, gains: {{K: [1, 2]}}", "gains.K: is no gain of this injection"),
    "both": (f"{TIMES}gains: {{K: [1, 2], L: [1, 2]}}", "gains.L: is no gain of this injection"),
    "gap of one length": ("T1: 0.2, T2: 0.2, injection: reset, clock: {gain: gap}", "gap needs T2 above T1"),
    "gap and ahead": (f"T1: 0.1, T2: 0.2, {GAP[:-1]}, lookahead: 2}}", "lookahead: 2 is for a constant gain"),
    "gap of a given gain": (
        "T1: 0.1, T2: 0.2, gains: {K: [1, 0]}, clock: {gain: gap}",
        "gap is for a gain that is",
    ),
    "ahead of nothing": (f"T1: 0, T2: 0.2, clock: {{lookahead: 2}}, {GAINS}", "lookahead: 2 needs T1 > 0"),
    "delta": (f"{TIMES}relaxation: clock, delta: 3, {GAINS}", "observer.delta: is the exponent of a proposition"),
    "delta of a reset": (f"{TIMES}injection: reset, delta: 3", "observer.delta: is the exponent of a proposition"),
    "proposition": (f"{TIMES}injection: reset, relaxation: proposition-2", "reset takes clock"),
    "bound of K": (f"{TIMES}bounds: {{K: 3}}", "bounds.K: bounds K of injection reset, which is not asked for"),
    "bound of L": (f"{TIMES}injection: reset, bounds: {{L: 3}}", "bounds.L: bounds L, and injection reset has"),
}


@pytest.mark.parametrize("name", MISTAKES)
@pytest.mark.usefixtures("here")
def test_a_mistake_is_told_in_one_line_with_its_place(name, tmp_path):
    asked, said = MISTAKES[name]
    (tmp_path / "a.yaml").write_text(LINEAR % asked)
    outcome = run("solve", "a.yaml")
    assert outcome.exit_code == 2
    assert outcome.stdout == ""
    assert len(outcome.stderr.splitlines()) == 1
    assert outcome.stderr.startswith("a.yaml:5:")
    assert said in outcome.stderr


# What is asked


@pytest.fixture
def solved(here):
    """Solves and verifies an observer of the oscillator; returns the result and the lines on the screen."""

    def solved(asked, system="", code=0):
        (here / "a.yaml").write_text((LINEAR % asked).replace("observer:", f"{system}observer:"))
        outcome = run("solve", "a.yaml")
        assert outcome.exit_code == code, outcome.output
        content = json.loads((here / "a.gains.json").read_text())
        if not code:
            assert run("verify", "a.gains.json", "-q").exit_code == 0
        return content, outcome.stdout

    return solved


def test_given_gains_are_analysed_and_any_positive_interval_has_no_constant_of_noise(solved):
    content, said = solved(f"T1: 0, T2: 0.2, decay: 0.05, {GAINS}")
    assert "at most 0.2 apart" in content["guarantee"]["statement"]
    assert not {"noise", "jitter"} & content["guarantee"].keys()
    assert content["guarantee"]["T1"] == 0
    positive_, _ = solved(f"{TIMES}{GAINS}")
    assert positive_["guarantee"]["gamma"] < content["guarantee"]["gamma"]
    assert positive_["guarantee"]["noise"] > 0
    assert "tolerated" in said


def test_a_given_reset_is_analysed(solved):
    content, said = solved(f"{TIMES}gains: {{K: [0.7, 0.4]}}")
    assert "xhat+ = xhat + K (y - C xhat)" in content["guarantee"]["statement"]
    assert content["observer"]["K"] == [[0.7], [0.4]]
    assert "|K| = 0.8062" in said


def test_gains_for_too_long_intervals_are_told_with_a_shorter_one(solved):
    content, said = solved(f"T1: 0, T2: 1.4, decay: 0.05, {GAINS}", code=3)
    assert content["diagnosis"]["feasible"]["T2"] == pytest.approx(1.168, rel=2e-3)
    assert "ask for T2 at most about 1.16" in said
    assert "1.17005 s apart, again and again, the error" in said


def test_a_plant_without_w_is_designed_for_feasibility(here):
    text = (LINEAR % f"{TIMES}{GAINS}").replace("B: [1, 0], ", "")
    content = json.loads(result_of(here, text))
    assert content["guarantee"]["gamma"] == 0
    assert any("no disturbance acts" in note for note in content["notes"])
    assert {"overshoot", "noise"} <= content["guarantee"].keys()
    assert run("verify", "spec.gains.json", "-q").exit_code == 0


def test_where_no_clock_is_found_the_certificate_of_the_paper_serves_and_a_note_says_so(here):
    motor = LINEAR.replace("[[0, 1], [-4, 0]], B: [1, 0]", "[[0, 1], [0, -3]], B: [0, 1]")
    asked = "T1: 0.01, T2: 0.52, decay: 0.24, clock: {degree: %s, segments: 1}, gains: {L: [0, 3]}"
    content = json.loads(result_of(here, motor % (asked % 1)))
    assert content["guarantee"].get("kind", "exponential") == "exponential"
    assert content["observer"]["delta"] > 0
    assert any("the one of the paper serves" in note for note in content["notes"])
    assert run("verify", "spec.gains.json", "-q").exit_code == 0
    content = json.loads(result_of(here, motor % (asked % 4)))
    assert content["guarantee"]["kind"] == "clock"
    assert not any("the one of the paper serves" in note for note in content.get("notes", []))


@pytest.mark.parametrize(
    ("objective", "key"), [("max-T2", "T2: {min: 0.2, max: 3}"), ("max-decay", "decay: {min: 0.01, max: 5}")]
)
def test_the_farthest_of_given_gains_is_certified_within_the_slack(solved, objective, key):
    rest = {"max-T2": "T1: 0.1, decay: 0.05", "max-decay": "T1: 0.1, T2: 0.2"}[objective]
    content, _ = solved(f"{rest}, {key}, objective: {objective}, {GAINS}")
    name = "T2" if objective == "max-T2" else "decay"
    limit, proved = content["guarantee"]["limit"], content["guarantee"][name]
    assert limit["kind"] == "best-found"
    assert limit[name] / 1.0501 <= proved <= limit[name]
    truth = content["analysis"]["truth"]
    assert proved <= (truth["period_limit"] if name == "T2" else -truth["pattern"]["growth"])


@pytest.mark.usefixtures("here")
def test_a_curve_of_several_injections_with_a_proposition_beside(tmp_path):
    asked = (
        "T1: 0.1, T2: {min: 0.1, max: 0.3, points: 2}, decay: 0.05, objective: pareto, bounds: {L: 5, K: 2}, "
        "injection: [predictor, reset], relaxation: [clock, proposition-2]"
    )
    (tmp_path / "a.yaml").write_text(LINEAR % asked)
    outcome = run("solve", "a.yaml", "--json")
    assert outcome.exit_code == 0, outcome.output
    content = json.loads((tmp_path / "a.gains.json").read_text())
    curves = content["search"]["curves"]
    assert {(c["injection"], c["relaxation"]) for c in curves} == {
        ("predictor", "clock"),
        ("reset", "clock"),
        ("predictor", "proposition-2"),
    }
    by_name = {(c["injection"], c["relaxation"]): c["points"] for c in curves}
    for ours, theirs in zip(by_name["predictor", "clock"], by_name["predictor", "proposition-2"], strict=True):
        assert ours["status"] == "certified"
        assert ours["certified"]["gamma"] <= theirs["gamma"] * 1.001
    assert json.loads(outcome.stdout)["status"] == "certified"
    assert run("verify", "a.gains.json", "-q").exit_code == 0


# Found by attacks and newcomers

MOTOR = """
obsdesign: 1
parameters: {J: 1e-4, b: 1e-4, Kt: 0.05, R: 1, L: 1e-3, Tc: 0.02}
system:
  states: [theta, omega, i, TL]
  outputs: [enc, cur]
  A: [[0, 1, 0, 0], [0, -b/J, Kt/J, -1/J], [0, -Kt/L, -R/L, 0], [0, 0, 0, -0.1]]
  B: [0, 0, 0, 1]
  C: [[1, 0, 0, 0], [0, 0, 1, 0]]
nonlinearities: [{type: tanh, f: tanh(q), Bf: [0, -Tc/J, 0, 0], Cq: [0, 50, 0, 0]}]
performance: [TL]
observer:
  {type: sporadic, T1: 0.0005, T2: 0.0005, decay: 1, gains: {L: [[3962.83, 456.68], [-121081, -72366.6],
  [3795.17, -99.9295], [-2628.03, 930.388]], H: [[-4422.29, 976.767], [-2634.79, 1155.4]]}}
"""


def test_gains_whose_margin_is_smaller_than_a_solver_tells_from_none_are_proved(here):
    content = json.loads(result_of(here, MOTOR))
    guarantee, truth = content["guarantee"], content["analysis"]["truth"]
    assert guarantee["kind"] == "clock"
    assert max(x for x in truth["gamma"].values() if isinstance(x, float)) <= guarantee["gamma"] < 0.0085
    assert "T2_max" not in guarantee
    assert run("verify", "spec.gains.json", "-q").exit_code == 0


VEHICLE = """
obsdesign: 1
parameters: {m: 1500, Iz: 2500, Cf: 80000, Cr: 90000, lf: 1.2, lr: 1.5, v: 25}
system:
  states: [beta, r]
  disturbances: [wind]
  A: [[-(Cf+Cr)/(m*v), (Cr*lr-Cf*lf)/(m*v*v)-1], [(Cr*lr-Cf*lf)/Iz, -(Cf*lf*lf+Cr*lr*lr)/(Iz*v)]]
  B: [1000/(m*v), 300/Iz]
  C: [0, 1]
disturbance: integrator
performance: [beta]
observer: {type: sporadic, T1: 0.02, T2: 0.1, decay: 1}
"""


@pytest.mark.slow
def test_gains_without_a_bound_grow_as_long_as_gamma_is_proved(here):
    content = json.loads(result_of(here, VEHICLE))
    assert content["guarantee"]["kind"] == "clock"
    least = max(x for x in content["analysis"]["truth"]["gamma"].values() if isinstance(x, float))
    assert least <= content["guarantee"]["gamma"] <= 1.06 * least
    assert run("verify", "spec.gains.json", "-q").exit_code == 0


def test_the_clock_of_a_proposition_is_refused(here):
    (here / "spec.yaml").write_text(LINEAR % f"{TIMES}clock: {{degree: 6}}, relaxation: proposition-2")
    outcome = run("solve", "spec.yaml")
    assert outcome.exit_code == 2
    assert "observer.clock: is the storage function of relaxation clock, which is not asked for" in outcome.stderr


def test_a_proposition_takes_any_interval_up_to_the_longest(here):
    asked = "T2: 0.3, decay: 0.05, relaxation: proposition-2, bounds: {L: 8}"
    short, none = (json.loads(result_of(here, LINEAR % f"T1: {T1}, {asked}")) for T1 in ("0.1", "0"))
    assert none["guarantee"]["gamma"] == short["guarantee"]["gamma"]
    assert "at most 0.3 apart" in none["guarantee"]["statement"]
    assert "sup|eta|" not in none["guarantee"]["statement"]
    assert not {"noise", "jitter"} & none["guarantee"].keys()
    assert none["observer"]["contraction"].keys() == {"T2"}
    assert run("verify", "spec.gains.json", "-q").exit_code == 0


def test_a_gain_of_the_interval_in_a_file_has_a_longest_interval_no_more_than_another_has(here):
    genuine = json.loads(result_of(here, LINEAR % f"T1: 0.1, T2: 0.3, {GAP}"))
    forged = copy.deepcopy(genuine)
    forged["guarantee"]["T2_max"] = 0.9
    forged["certificate"]["witnesses"]["T2_max"] = forged["certificate"]["witnesses"]["overshoot"]
    Path("spec.gains.json").write_text(json.dumps(forged))
    outcome = run("verify", "spec.gains.json")
    assert outcome.exit_code == 2
    assert "guarantee.T2_max: is for a gain that does not depend on the interval" in outcome.stderr
    forged = copy.deepcopy(genuine)
    forged["observer"]["K_of_gap"]["knots"][0] = 0
    Path("spec.gains.json").write_text(json.dumps(forged))
    outcome = run("verify", "spec.gains.json")
    assert outcome.exit_code == 2
    assert "expected numbers that rise from T1 to T2" in outcome.stderr


def test_a_longest_interval_is_not_below_the_one_that_is_claimed(here):
    content = json.loads(result_of(here, LINEAR % f"{TIMES}{GAINS}"))
    content["guarantee"]["T2_max"] = 0.5 * content["guarantee"]["T2"]
    Path("spec.gains.json").write_text(json.dumps(content))
    outcome = run("verify", "spec.gains.json")
    assert outcome.exit_code == 2
    assert "guarantee.T2_max: is below T2" in outcome.stderr


@pytest.mark.parametrize(("segments", "degree"), [(1, 40), (60, 1)])
def test_a_file_holds_no_larger_storage_function_than_a_spec_may_ask_for(here, segments, degree):
    content = json.loads(result_of(here, LINEAR % f"{TIMES}{GAINS}"))
    witness, T2 = content["certificate"]["witnesses"]["gamma"], content["guarantee"]["T2"]
    witness["knots"] = [str(Fraction(str(T2)) * i / segments) for i in range(segments + 1)]
    witness["P"] = [[witness["P"][0][0]] * (degree + 1)] * segments
    Path("spec.gains.json").write_text(json.dumps(content))
    outcome = run("verify", "spec.gains.json")
    assert outcome.exit_code == 2
    assert "certificate.witnesses.gamma." in outcome.stderr


def test_a_constant_gain_that_is_better_than_one_of_the_interval_is_shipped(here):
    """On nearly periodic measurements a K of the interval gains nothing."""
    times = "T1: 0.299, T2: 0.3, bounds: {K: 3}, injection: reset, decay: 0.05"
    constant = json.loads(result_of(here, LINEAR % times))["guarantee"]["gamma"]
    content = json.loads(result_of(here, LINEAR % f"{times}, clock: {{gain: gap}}"))
    assert content["guarantee"]["gamma"] <= 1.06 * constant
    shipped = "K" in content["observer"]
    assert shipped == any("a constant K has a smaller gamma" in note for note in content.get("notes", []))
    assert run("verify", "spec.gains.json", "-q").exit_code == 0


def test_a_bound_on_gamma_below_what_is_found_is_named(here):
    (here / "spec.yaml").write_text(LINEAR % f"{TIMES}bounds: {{gamma: 0.01}}")
    outcome = run("solve", "spec.yaml")
    assert outcome.exit_code == 4
    assert "above `bounds.gamma` = 0.01; ask for" in outcome.stderr


def test_gains_that_diverge_at_the_shortest_interval_are_not_told_to_take_shorter_ones(here):
    (here / "spec.yaml").write_text(LINEAR % "T1: 0.1, T2: 0.2, gains: {K: [3, 0]}")
    assert run("solve", "spec.yaml", "-q").exit_code == 3
    diagnosis = json.loads(Path("spec.gains.json").read_text())["diagnosis"]
    assert "these gains are of no use: with measurements 0.1 s apart" in diagnosis["reason"]
    assert "feasible" not in diagnosis
