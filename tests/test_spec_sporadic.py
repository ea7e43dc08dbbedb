"""Specs with sporadic measurements: what the reader takes, and what it answers to wrong ones."""

import json
import re
from pathlib import Path

import pytest
from flint import fmpq
from support.commands import result_of, run
from support.forging import with_text
from support.wrong_specs import problem_of, wrong_in

from obsdesign.dissipation.bounds import Range
from obsdesign.errors import UsageError
from obsdesign.families.sporadic.request import SporadicRequest
from obsdesign.reading import loads

BASE = """\
obsdesign: 1
name: Oscillator
system:
  A: [[0, 1], [-4, 0]]
  B: [1, 0]
  C: [1, 0]
nonlinearities:
  - {f: sin(q), type: {lipschitz: 1}, Bf: [0, 0.1], Cq: [1, 0]}
observer:
  type: sporadic
  T1: 0.1
  T2: 0.2
  decay: 0.05
  delta: {min: 1, max: 8}
  bounds: {L: 10}
simulation:
  horizon: 4
  x0: [1, 0]
  sampling: periodic
  w: sin(t)
"""
CONTINUOUS = """\
obsdesign: 1
name: Oscillator
system:
  A: [[0, 1], [-4, 0]]
  C: [1, 0]
observer:
  type: l2
  alpha: 0.1
simulation:
  horizon: 4
  x0: [1, 0]
"""
T1, T2, DECAY, DELTA, BOUNDS = (
    "  T1: 0.1",
    "  T2: 0.2",
    "  decay: 0.05",
    "  delta: {min: 1, max: 8}",
    "  bounds: {L: 10}",
)
C, TYPE, SAMPLING, DATA = "  C: [1, 0]", "  type: sporadic", "  sampling: periodic", "Cq: [1, 0]}"


wrong, wrong_without_samples = wrong_in(BASE), wrong_in(CONTINUOUS)


def foreign(line, key):
    return wrong_without_samples("  alpha: 0.1", f"  alpha: 0.1\n  {line}", f"observer.{key}", "sporadic", "L2, alpha")


INTERVALS = [
    wrong(T1, "  T1: 0.3", "observer.T2", "0.2 is below T1 = 0.3", "at least T1", place=(12, 7)),
    wrong(T1, "  T1: -1", "observer.T1", "give a number >= 0", place=(11, 7)),
    wrong(T1, "  T1: .nan", "observer.T1", "not a finite number"),
    wrong(T1, "  T1: .inf", "observer.T1", "not a finite number"),
    wrong(T1, "  T1: soon", "observer.T1", "unknown name 'soon'"),
    wrong(T1, "  T1: {min: 0.1, max: 0.2}", "observer.T1", "expected a number", "found a mapping"),
    wrong(T1 + "\n", "", "observer.T1", "is required"),
    wrong(T2, "  T2: 0", "observer.T2", "0 is not allowed; give a number > 0", place=(12, 7)),
    wrong(T2, "  T2: -1", "observer.T2", "give a number > 0"),
    wrong(T2, "  T2: .inf", "observer.T2", "not a finite number"),
    wrong(T2, "  T2: [0.1, 0.2]", "observer.T2", "a range {min: .., max: .., points: .., log: ..}", "found a list"),
    wrong(T2, "  T2: {min: 0.3, max: 0.2}", "observer.T2", "min 0.3 is not below max 0.2"),
    wrong(T2, "  T2: {min: 0.2, max: 0.2}", "observer.T2", "a range needs min < max"),
    wrong(T2, "  T2: {min: 0, max: 0.2}", "observer.T2.min", "give a number > 0"),
    wrong(T2, "  T2: {min: 0.01, max: 0.05}", "observer.T2", "0.05 is below T1 = 0.1"),
    wrong(T2, "  T2: {max: 0.2}", "observer.T2.min", "is required"),
    wrong(T2, "  T2: {min: 0.2, max: 0.3, points: 1}", "observer.T2.points", "whole number from 2"),
    wrong(T2, "  T2: {min: 0.2, max: 0.3, step: 1}", "observer.T2.step", "unknown key step", "points"),
    wrong(
        T2 + "\n", "", "observer.T2", "is required; give a number, or a range {min: .., max: .., points: .., log: ..}"
    ),
    wrong(DECAY, "  decay: -0.05", "observer.decay", "give a number >= 0"),
    wrong(DECAY, "  decay: {min: 0, max: 1}", "observer.decay.min", "give a number > 0"),
    wrong(DECAY, "  decay: {min: 1, max: 0.5}", "observer.decay", "min 1 is not below max 0.5"),
]

EXPONENTS = [
    wrong(DELTA, "  delta: 0", "observer.delta", "give a number > 0"),
    wrong(DELTA, "  delta: -1", "observer.delta", "give a number > 0"),
    wrong(DELTA, "  delta: auto", "observer.delta", "unknown name 'auto'"),
    wrong(DELTA, "  delta: {min: 8, max: 1}", "observer.delta", "min 8 is not below max 1"),
    wrong(DELTA, "  delta: {min: 0, max: 1}", "observer.delta.min", "give a number > 0"),
    *(
        wrong(DELTA, f"  delta: {delta}\n  {line}", "observer.delta", f"{name} needs delta above 2 decay = 0.1")
        for delta in ("0.05", "0.1", "{min: 0.01, max: 0.1}", "{min: 0.01, max: 0.10001}")
        for line, name in (
            ("injection: hold", "proposition-5"),
            ("injection: [dynamic, hold]", "proposition-5"),
            ("relaxation: proposition-3", "proposition-3"),
            ("relaxation: proposition-5", "proposition-5"),
            ("relaxation: [proposition-2, proposition-3]", "proposition-3"),
        )
    ),
]

CHOICES = [
    wrong(BOUNDS, "  objective: max-T2", "observer.T2", "max-T2 needs a range; give {min: .., max: ..}"),
    wrong(BOUNDS, "  objective: max-decay", "observer.decay", "max-decay needs a range"),
    wrong(BOUNDS, "  objective: pareto", "observer.objective", "needs a range of T2 or of decay"),
    wrong(BOUNDS, "  objective: max-alpha", "observer.objective", "unknown objective max-alpha", "max-decay"),
    wrong(BOUNDS, "  objective: min-gama", "observer.objective", "did you mean min-gamma?"),
    wrong(BOUNDS, "  objective: {gamma: 3}", "observer.objective", "found a mapping"),
    wrong(BOUNDS, "  injection: predictr", "observer.injection", "did you mean predictor?", "hold"),
    wrong(BOUNDS, "  injection: [hold, zoh]", "observer.injection[1]", "unknown injection zoh"),
    wrong(BOUNDS, "  injection: []", "observer.injection", "expected at least 1 item; found an empty list"),
    wrong(BOUNDS, "  injection: {hold: 1}", "observer.injection", "or a list of them", "found a mapping"),
    wrong(BOUNDS, "  relaxation: proposition2", "observer.relaxation", "did you mean proposition-2?"),
    wrong(BOUNDS, "  relaxation: 2", "observer.relaxation", "unknown relaxation 2", "proposition-5"),
    wrong(BOUNDS, "  relaxation: abbaszadeh", "observer.relaxation", "unknown relaxation", "proposition-2"),
    *(
        wrong(BOUNDS, f"  injection: {injection}\n  relaxation: {relaxation}", f"observer.{key}", *words)
        for injection, relaxation, key, words in (
            ("hold", "proposition-2", "relaxation", ("another injection than hold", "hold takes clock, proposition-5")),
            ("dynamic", "proposition-5", "relaxation", ("another injection than dynamic",)),
            ("predictor", "proposition-3", "relaxation", ("predictor takes clock, proposition-2",)),
            ("[hold, dynamic]", "proposition-2", "injection", ("hold has none of the relaxations",)),
            ("[hold, predictor]", "[proposition-5, proposition-4]", "relaxation", ("proposition-4",)),
        )
    ),
    wrong(BOUNDS, "  slack: -1", "observer.slack", "give a number >= 0"),
    wrong(BOUNDS, "  bounds: {L: 0}", "observer.bounds.L", "give a number > 0"),
    wrong(BOUNDS, "  bounds: {gamma: 0}", "observer.bounds.gamma", "give a number > 0"),
    wrong(BOUNDS, "  bounds: {L1: 3}", "observer.bounds.L1", "did you mean L?", "allowed: L, K, gamma"),
    wrong(BOUNDS, "  bounds: {P: 3}", "observer.bounds.P", "unknown key P", "allowed: L, K, gamma"),
    wrong(BOUNDS, "  bounds: {L: {frobenius: 3}}", "observer.bounds.L", "expected a number"),
    wrong(TYPE, "  type: sporadc", "observer.type", "did you mean sporadic?"),
]

GAINS = [
    wrong(BOUNDS, f"  gains: {gains}", f"observer.gains{key}", *words)
    for gains, key, words in (
        ("{L: [1, 2, 3]}", ".L", ("2 rows", "1 column", "a vector of 3")),
        ("{L: [[1, 2]]}", ".L", ("2 rows", "found 1x2")),
        ("{L: [[1, 2], [3, 4]]}", ".L", ("1 column (one for each output), found 2x2",)),
        ("{L: 1}", ".L", ("found a number",)),
        ("{L: []}", ".L", ("a vector of 0",)),
        ("{L: [.nan, 1]}", ".L[0]", ("not a finite number",)),
        ("{L: [1, 2], H: [[1, 2]]}", ".H", ("1 column (one for each output), found 1x2",)),
        ("{L: [1, 2], H: [1, 2]}", ".H", ("1 row (one for each output)", "a vector of 2")),
        ("{H: 1}", "", ("L is missing", "with injection reset")),
        ("{L1: [1, 2]}", ".L1", ("did you mean L?",)),
        ("[1, 2]", "", ("expected a mapping with the keys L, H", "found a list")),
    )
]

UNKNOWN = "needs y1, which the observer does not know between two measurements; write it in states"
NOT_BUILT = [
    wrong("f: sin(q), ", "f: sin(q)*cos(y1), ", "nonlinearities[0].f", UNKNOWN, place=(8, 9)),
    wrong("f: sin(q), ", "f: [sin(q)*cos(y1)], ", "nonlinearities[0].f[0]", UNKNOWN),
    wrong("f: sin(q), ", "f: sin(q), gq: y1**2, ", "nonlinearities[0].gq", UNKNOWN),
    wrong(C, C + "\n  gx: [0, y1**2]", "system.gx[1]", UNKNOWN, place=(7, 11)),
]
PLANTS = [
    wrong(C, C + "\n  D: 1", "system.D", "must be zero for type sporadic", "simulation.noise", place=(7, 6)),
    wrong(DATA, "Cq: [1, 0], Df: 0.1}", "nonlinearities", "Df must be zero for type sporadic"),
    wrong(DATA, "Cq: [1, 0], Dqf: 0.1}", "nonlinearities", "Dqf must be zero for type sporadic"),
    wrong(DATA, "Cq: [1, 0], Dq: 0.1}", "nonlinearities", "Dq must be zero for type sporadic"),
    wrong("observer:\n", "disturbance: integrator\nobserver:\n", "observer.type", "take no disturbance model"),
    wrong(
        "observer:\n",
        "disturbance: {sinusoid: {omega: 2}}\nobserver:\n",
        "observer.type",
        "relaxation clock does: leave `relaxation` and `delta` out",
    ),
]

TRIALS = [
    wrong(SAMPLING, f"  {line}", f"simulation.{key}", *words)
    for line, key, words in (
        ('sampling: {law: ""}', "sampling.law", ("found the end",)),
        ("sampling: {law: }", "sampling.law", ("has no value",)),
        ("sampling: {}", "sampling.law", ("is required",)),
        ("sampling: {law: x1}", "sampling.law", ("unknown name 'x1'", "allowed: pi, t")),
        ("sampling: {law: 1/0}", "sampling.law", ("division by zero",)),
        ("sampling: {law: [0.1, 0.2]}", "sampling.law", ("found a list",)),
        ("sampling: {lw: 0.1}", "sampling.lw", ("did you mean law?",)),
        ("sampling: perodic", "sampling", ("did you mean periodic?", "random")),
        ("sampling: 0.1", "sampling", ("unknown sampling 0.1",)),
        ("sampling: [0.1]", "sampling", ("{law: an expression of t}", "found a list")),
        ("period: 0", "period", ("give a number > 0",)),
        ("period: -1", "period", ("give a number > 0",)),
        ("dropout: 1", "dropout", ("give a number in [0, 1)",)),
        ("dropout: 1.5", "dropout", ("1.5 is no share below 1",)),
        ("dropout: -0.1", "dropout", ("give a number >= 0",)),
        ("dropout: .nan", "dropout", ("not a finite number",)),
        ("dropout: often", "dropout", ("unknown name 'often'",)),
        ("theta0: [1, 2]", "theta0", ("1 number (one for each output), found a vector of 2",)),
        ("theta0: []", "theta0", ("a vector of 0",)),
        ("theta0: oops", "theta0", ("unknown name 'oops'",)),
        ("noise: {amplitude: [0.1, 0.2]}", "noise.amplitude", ("1 number (one for each output), found 2",)),
        ("noise: {amplitude: -0.1}", "noise.amplitude", ("give a number >= 0",)),
        ("droput: 0.1", "droput", ("did you mean dropout?",)),
    )
]

OTHERS = [
    wrong(BOUNDS, f"  {line}", f"observer.{key}", "does not belong to type sporadic", "T1, T2, decay")
    for line, key in (("alpha: 0.5", "alpha"), ("L2: 0", "L2"), ("reconstruct: w", "reconstruct"))
] + [
    foreign("T1: 0.1", "T1"),
    foreign("T2: 0.1", "T2"),
    foreign("decay: 0.1", "decay"),
    foreign("injection: hold", "injection"),
    foreign("relaxation: proposition-2", "relaxation"),
    foreign("delta: 3", "delta"),
    wrong(BOUNDS, "  decya: 0.1", "observer.decya", "did you mean decay?"),
    wrong(BOUNDS, "  delay: 0.1", "observer.delay", "is not offered", "run the observer tau late"),
    *(
        wrong_without_samples("  x0: [1, 0]", f"  x0: [1, 0]\n  {key}: {value}", f"simulation.{key}", "type sporadic")
        for key, value in (("sampling", "periodic"), ("period", "0.1"), ("dropout", "0.1"), ("theta0", "1"))
    ),
    wrong_without_samples(
        "  x0: [1, 0]", "  x0: [1, 0]\n  noise: {amplitude: 1}", "simulation.noise.period", "is required"
    ),
]
CASES = [*INTERVALS, *EXPONENTS, *CHOICES, *GAINS, *PLANTS, *TRIALS, *OTHERS]


def request_of(**lines):
    """Request of BASE with some lines in place of others, by their keys."""
    text = BASE
    for key, line in lines.items():
        text, replaced = re.subn(rf"^  {key}: .*$", f"  {line}", text, flags=re.MULTILINE)
        assert replaced == 1
    spec = loads(text)
    assert isinstance(spec.observer, SporadicRequest)
    return spec.observer


def test_the_specs_that_the_wrong_ones_are_made_from_are_right():
    assert float(request_of().T2) == 0.2
    assert loads(CONTINUOUS).observer.type == "l2"


@pytest.mark.parametrize("case", NOT_BUILT)
def test_an_observer_that_cannot_be_built_is_refused_by_every_command(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    forged = with_text(json.loads(result_of(tmp_path, BASE)), case.text)
    Path("spec.gains.json").write_text(json.dumps(forged))
    Path("spec.yaml").write_text(case.text)
    for command, file in (("solve", "yaml"), ("check", "yaml"), ("verify", "gains.json"), ("simulate", "gains.json")):
        outcome = run(command, f"spec.{file}")
        assert outcome.exit_code == 2, outcome.output
        (line,) = outcome.stderr.splitlines()
        assert f": {case.key}: " in line
        assert UNKNOWN in line
    assert case.is_answered_by(problem_of(case.text))


@pytest.mark.parametrize("case", CASES)
def test_a_mistake_is_answered_in_one_line_at_its_place_with_what_is_allowed(case):
    assert case.is_answered_by(problem_of(case.text))


@pytest.mark.parametrize("case", [INTERVALS[0], EXPONENTS[5], CHOICES[0], GAINS[0], PLANTS[0], TRIALS[0], OTHERS[0]])
def test_the_command_line_answers_on_standard_error_and_writes_nothing(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "spec.yaml").write_text(case.text)
    for command in ("solve", "check", "simulate"):
        outcome = run(command, "spec.yaml")
        assert outcome.exit_code == 2, outcome.output
        assert outcome.stdout == ""
        (line,) = outcome.stderr.splitlines()
        assert re.match(rf"spec\.yaml:\d+:\d+: {re.escape(case.key)}: ", line)
    assert [p.name for p in tmp_path.iterdir()] == ["spec.yaml"]


def test_mistakes_of_the_observer_and_of_the_trial_are_found_together():
    text = BASE.replace(T1, "  T1: -1").replace(SAMPLING, "  dropout: 2").replace(C, C + "\n  D: 1")
    with pytest.raises(UsageError) as caught:
        loads(text)
    assert [p.key for p in caught.value.problems] == ["system.D", "observer.T1", "simulation.dropout"]


# What is taken


@pytest.mark.parametrize("objective", ["max-T2", "pareto"])
def test_a_range_of_T2_may_begin_below_T1_and_end_at_it(objective):
    request = request_of(T2="T2: {min: 0.01, max: 0.1}", bounds=f"objective: {objective}")
    assert (request.T2.low, request.T2.high) == (fmpq(1, 100), request.T1)


def test_equal_intervals_are_periodic_measurements():
    assert request_of(T1="T1: 0.2").T1 == request_of().T2


@pytest.mark.parametrize(
    ("lines", "injections", "relaxations"),
    [
        ("slack: 0.1", ("dynamic",), ("proposition-2",)),
        ("injection: hold", ("hold",), ("proposition-5",)),
        ("injection: [hold, predictor]", ("hold", "predictor"), ("proposition-5", "proposition-2")),
        ("relaxation: proposition-5", ("hold",), ("proposition-5",)),
        ("relaxation: proposition-4", ("dynamic",), ("proposition-4",)),
        ("relaxation: [proposition-3, proposition-5]", ("dynamic", "hold"), ("proposition-3", "proposition-5")),
    ],
)
def test_a_relaxation_chooses_its_injection(lines, injections, relaxations):
    request = request_of(bounds=lines)
    assert (request.injections, request.relaxations) == (injections, relaxations)


def test_one_delta_is_a_range_of_one_point():
    delta = request_of(delta="delta: 5").delta
    assert (delta.low, delta.high, delta.points) == (5, 5, 1)


def test_a_delta_below_2_decay_is_taken_where_nothing_needs_more():
    for line in ("relaxation: proposition-2", "relaxation: proposition-4", "injection: predictor"):
        assert request_of(delta="delta: {min: 0.01, max: 0.1}", bounds=line).delta.high == fmpq(1, 10)
    given = request_of(delta="delta: 0.05\n  injection: hold", bounds="gains: {L: [1, 0]}")
    assert given.delta.high == fmpq(1, 20)


def test_a_range_of_delta_is_not_cut_for_the_relaxations_that_do_not_need_it():
    request = request_of(delta="delta: {min: 0.01, max: 8}", bounds="relaxation: [proposition-2, proposition-3]")
    assert request.delta == Range(fmpq(1, 100), fmpq(8), 25)


def test_gains_without_H_hold_the_correction():
    gains = request_of(bounds="gains: {L: [1, 2.5]}").gains
    assert gains["L"].tolist() == [[1], [fmpq(5, 2)]]
    assert gains["H"].tolist() == [[0]]


def test_data_of_the_plant_that_are_zero_are_absent():
    text = BASE.replace(C, C + "\n  D: 0").replace(DATA, "Cq: [1, 0], Dq: 0, Dqf: 0, Df: 0}")
    assert not loads(text).plant.D.any()
    loads(BASE.replace("observer:\n", "disturbance: unknown\nobserver:\n"))


def test_noise_of_sporadic_measurements_needs_no_period():
    noise = loads(BASE.replace(SAMPLING, "  noise: {amplitude: 0.1}")).simulation.noise
    assert noise.amplitude.tolist() == [0.1]
