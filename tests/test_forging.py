"""A forging sweep: every field of a result file of every family and objective, forged; nothing false is proved."""

import copy
import json
from fractions import Fraction
from functools import cache, partial

import numpy as np
import pytest
from support.forging import at, claiming, put
from support.shipped import solved
from support.sweep import SWEEP, rng

import obsdesign as od
from obsdesign.design import design_of, proof_of
from obsdesign.dissipation.decimals import square_below
from obsdesign.files import ResultFile
from obsdesign.lmi.formula import printed

PLANT = """
obsdesign: 1
name: Cart
system: {A: [[0, 1], [-2, -1]], B: [[0], [1]], C: [[1, 0]]}
nonlinearities: [{f: 0.5*sin(q), type: {lipschitz: 0.5}, Bf: [0, 1], Cq: [1, 0]}]
observer: %s
"""
OBSERVERS = {
    "l2 least gamma": "{type: l2, alpha: 0.1, bounds: {L1: 20}}",
    "l2 gamma": "{type: l2, alpha: 0.1, objective: {gamma: 0.2}}",
    "l2 largest alpha": "{type: l2, alpha: {min: 0.1, max: 2}, objective: max-alpha, bounds: {L1: 20}}",
    "l2 feasibility": "{type: l2, alpha: 0.1, objective: feasibility}",
    "l2 trade-off": "{type: l2, alpha: {min: 0.1, max: 1, points: 3}, objective: pareto, bounds: {L1: 20}}",
    "l2 placed": "{type: l2, alpha: 0.1, poles: {radius: 9, damping: 0.6}}",
    "linf stepped": "{type: linf, alpha: 0.3}\nimplementation: {period: 0.1, method: euler, impose: true}",
    "lipschitz placed": "{type: lipschitz, objective: min-gamma, decay: 0.1, poles: {damping: 0.6}}"
    "\nimplementation: {period: 0.1, method: rk4, impose: true}",
    "l2 given": "{type: l2, alpha: 0.1, gains: {L1: [-3, -2], L2: 0}}",
    "linf range": "{type: linf, alpha: {min: 0.1, max: 1, points: 3}, bounds: {L1: 20}}",
    "linf reconstruction": "{type: linf, L2: 0, alpha: 0.3, bounds: {L1: 20}, reconstruct: w}",
    "lipschitz least gamma": "{type: lipschitz, objective: min-gamma, decay: 0.1, bounds: {L: 20}}",
    "lipschitz largest constant": "{type: lipschitz, objective: max-lipschitz, bounds: {L: 20}}",
    "lipschitz weighed": "{type: lipschitz, objective: pareto, weight: 0.9, bounds: {L: 20}}",
    "lipschitz trade-off": "{type: lipschitz, objective: pareto, weight: {min: 0, max: 1, points: 3}, bounds: {L: 20}}",
    "lipschitz compared": "{type: lipschitz, relaxation: compare, objective: min-gamma, decay: 0.1, bounds: {L: 20}}",
    "lipschitz given": "{type: lipschitz, objective: min-gamma, gains: {L: [3, 2]}}",
    "sporadic least gamma": "{type: sporadic, T1: 0.1, T2: 0.2, decay: 0.05, bounds: {L: 20},"
    " relaxation: proposition-2}",
    "sporadic feasibility": "{type: sporadic, T1: 0.1, T2: 0.2, objective: feasibility, relaxation: proposition-2}",
    "sporadic given": "{type: sporadic, T1: 0.1, T2: 0.2, gains: {L: [2, 1], H: 0}, relaxation: proposition-2}",
    "sporadic largest T2": "{type: sporadic, T1: 0.1, T2: {min: 0.1, max: 2}, objective: max-T2,"
    " relaxation: proposition-5, injection: hold, decay: 0.4}",
    "sporadic trade-off": "{type: sporadic, T1: 0.1, T2: {min: 0.1, max: 0.2, points: 2}, objective: pareto,"
    " relaxation: proposition-2}",
    "clock least gamma": "{type: sporadic, T1: 0.1, T2: 0.2, decay: 0.05, bounds: {L: 20}}",
    "clock given": "{type: sporadic, T1: 0.1, T2: 0.2, gains: {L: [2, 1], H: 0}}",
    "clock of the gap": "{type: sporadic, T1: 0.1, T2: 0.2, injection: reset, clock: {gain: gap}, bounds: {K: 3}}",
    "clock ahead": "{type: sporadic, T1: 0.1, T2: 0.2, clock: {lookahead: 2}, gains: {L: [2, 1], H: 0}}",
    "clock reset": "{type: sporadic, T1: 0, T2: 0.2, injection: reset, bounds: {K: 3}}",
}
SHIPPED = (
    *("corless2019-magnetic-bearing", "harmonic-motor", "draining-tanks"),
    *("chakrabarty2016-matched-input", "ferrante2019-robot-free", "noisy-output", "nonlinear-disturbance"),
    *("infeasible/bearing-too-fast", "infeasible/chakrabarty2016-cubic-without-injection", "infeasible/unstable-zero"),
    *("infeasible/hidden-sensor-bias", "infeasible/undetectable-rate", "infeasible/pathological-sampling"),
)
COSTLY = {"sporadic given", "sporadic largest T2", "ferrante2019-robot-free"}  # to solve
COSTLY |= {"clock given", "clock of the gap", "clock ahead", "infeasible/undetectable-rate"}
CASES = [
    pytest.param(case, marks=[pytest.mark.xdist_group(case), *[pytest.mark.slow] * (case in COSTLY)])
    for case in (*OBSERVERS, *SHIPPED)
]

# What may stand in a field of a file that is proved; a field that is not named has to be, before the tests pass again.
STANCES = {
    # nothing else than in the genuine file: it is proved
    "proved": "obsdesign name status spec spec.text spec.sha256 assumed observer observer.type observer.relaxation"
    " observer.T1 observer.T2 guarantee guarantee.gamma guarantee.alpha guarantee.decay guarantee.lipschitz"
    " guarantee.constants"
    " guarantee.margin guarantee.admissible guarantee.T1 guarantee.T2 guarantee.statement guarantee.reconstruction"
    " guarantee.jitter guarantee.poles guarantee.implementation"
    " certificate diagnosis.certificate diagnosis.certificate.kind diagnosis.certificate.alpha diagnosis.proof",
    # every condition of it, or none
    "listed": "certificate.checks diagnosis.certificate.checks",
    # what proves it: other matrices or gains may prove the same claim
    "witness": "observer.L1 observer.L2 observer.L observer.H observer.delta guarantee.mu guarantee.mu1 guarantee.mu2"
    " certificate.P certificate.P1 certificate.P2 certificate.multipliers certificate.poles certificate.reconstruction"
    " certificate.admissible certificate.T2_max certificate.witnesses observer.K observer.K_of_gap"
    " diagnosis.certificate.multipliers diagnosis.certificate.members"
    " diagnosis.certificate.gamma",
    # a part of it
    "part": "certificate.kind guarantee.kind guarantee.outage",
    # a smaller number, or a larger one: it says less
    "smaller": "guarantee.T2_max guarantee.rate guarantee.outage.share",
    "larger": "guarantee.overshoot guarantee.initial guarantee.disturbance guarantee.noise guarantee.outage.growth",
    # more than in the genuine file: it says what is not proved
    "more": "numerical",
    # what is near to that which is computed of the gains; `verify` names it among what it does not prove
    "figure": "observer.poles observer.fastest observer.largest_step observer.noise_gain observer.condition_P"
    " observer.multipliers observer.contraction",
    # anything; `verify` names it among what it does not prove
    "numerical": "analysis search notes guarantee.limit guarantee.limit_bounded guarantee.widened guarantee.ceiling"
    " guarantee.comparison certificate.checks.margin diagnosis diagnosis.id diagnosis.condition diagnosis.reason"
    " diagnosis.suggestion diagnosis.feasible diagnosis.mode diagnosis.slopes diagnosis.value diagnosis.nonlinearity"
    " diagnosis.member diagnosis.gamma diagnosis.accuracy diagnosis.interval diagnosis.within",
    # anything; it says nothing of the observer
    "label": "created solver tool spec.path",
}
STANCE = {path: stance for stance, paths in STANCES.items() for path in paths.split()}
NESTED = {"observer", "guarantee", "certificate", "diagnosis", "spec"}  # whose keys are decided one by one
STATED = {"gamma", "w", "w_rate", "x_rate"}  # what is less the larger it is
MISSING, TWICE = object(), "given twice"


@cache
def design_for(case):
    """A design, solved once."""
    return od.solve(od.load(PLANT % OBSERVERS[case])) if case in OBSERVERS else solved(case)[1]


@cache
def text_of(case):
    """Its file, written once."""
    return design_for(case).text()


def content_of(case):
    """What is in its file."""
    return json.loads(text_of(case))


def copied(content):
    """Another content of the same, in a tenth of the time of copy.deepcopy."""
    return json.loads(json.dumps(content))


@cache
def genuine(case):
    """What is proved of it; None where nothing can be."""
    return proved(case, (), json.dumps(content_of(case)))


def proved(case, place, text):
    """What is proved of a file; None where it is refused, or not proved: there is no other ending.

    Where the spec in the file is not forged, the one that was read already is given beside it, which saves time.
    """
    spec = None if place[:1] in {(), ("spec",)} else design_for(case).spec
    try:
        proof = proof_of(ResultFile("forged.json", text.encode()), spec)
    except (od.UsageError, od.UndecidedError) as error:
        return None if len(str(error).splitlines()) == 1 else error
    return proof if proof.holds else None


def places(value, place=()):
    """Places of everything in a file."""
    for key in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
        yield (*place, key)
        yield from places(value[key], (*place, key))


def dotted(place):
    """Keys of a place, without the indices of lists."""
    return ".".join(key for key in place if isinstance(key, str))


def stance_of(place):
    """What may stand at a place, by the longest path to it that is named."""
    names = dotted(place).split(".")
    if names[0] == "certificate" and names[-1] == "margin":
        return "numerical"
    depths = range(len(names), 1 if names[0] in NESTED and len(names) > 1 else 0, -1)
    found = [STANCE[path] for path in (".".join(names[:k]) for k in depths) if path in STANCE]
    assert found, f"decide what may stand in {dotted(place)} of a file that is proved"
    return found[0]


def values(value):
    """Values to stand in the place of one."""
    yield from (None, True, "forged", [], {}, -7, [["0"]], float("nan"))
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int | float):
        yield from (2 * value, value / 2, -value, 0, 1e300, value * (1 + 1e-7), str(value), f"{value!r}0")
    elif isinstance(value, str):
        yield from ("", f"{value} ", value.upper(), "certified", "infeasible", "is proved from f", "1/0", "9" * 5000)
        if is_number(value):
            factors = (2, Fraction(1, 2), -1, 0, 1 + Fraction(1, 10**9))
            yield from (str(Fraction(value) * factor) for factor in factors)
    elif isinstance(value, list):
        yield from (value[:-1], value[1:], value + value, value[::-1], [value])
    elif isinstance(value, dict):
        yield from ({**value, "certified": {"gamma": 1e-9}}, list(value), value | dict.fromkeys(value))


def is_number(text):
    """Whether a text is an exact number."""
    try:
        return Fraction(text) == Fraction(text)
    except (ValueError, ZeroDivisionError):
        return False


def forgeries(content, place):
    """Makers of forged contents: other values, a key that is missing, renamed, or given twice, the words to match."""
    value, key = at(content, place), place[-1]

    def renamed(name):
        forged = copied(content)
        parent = at(forged, place[:-1])
        del parent[key]
        return forged if name is None else put(forged, (*place[:-1], name), value)

    yield from (partial(lambda other: put(copied(content), place, other), other) for other in values(value))
    if isinstance(key, str):
        yield from (partial(renamed, name) for name in (None, f"{key}_", key.swapcase(), "gamma_certified", TWICE))
    said = content.get("guarantee", {}).get("statement", "")
    if place[0] == "guarantee" and isinstance(value, float) and repr(value) in said:
        yield from (partial(stated, content, place, factor * value) for factor in (2, 0.5, 1 - 1e-6, 0, -1))


def stated(content, place, value):
    """A content with another number in its guarantee, in its statement, and where it follows from it."""
    forged, before = copied(content), at(content, place)
    put(claiming(forged, before, float(value)), place, float(value))
    if place[-1] == "gamma":
        square = float(square_below(printed(float(value))))
        forged["guarantee"] |= {key: square for key in ("mu", "mu2") if key in forged["guarantee"]}
    return forged


def found_at(content, place):
    """What stands at a place of a file that may have another shape."""
    try:
        return at(content, place)
    except (KeyError, IndexError, TypeError):
        return MISSING


def is_part(one, whole):
    """Whether a value says nothing that another does not say."""
    if isinstance(one, dict) and isinstance(whole, dict):
        return one.keys() <= whole.keys() and all(is_part(one[key], whole[key]) for key in one)
    if isinstance(one, list) and isinstance(whole, list):
        return all(any(is_part(x, y) for y in whole) for x in one)
    return same(one, whole)


def same(one, other):
    """Whether two values are the same; a number may be written as a text."""
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, bool) or isinstance(other, bool) or not is_number(str(one)) or not is_number(str(other)):
        return type(one) is type(other) and one == other
    return Fraction(str(one)) == Fraction(str(other))


def numbers(value):
    """Every number in a list."""
    if isinstance(value, list):
        return [x for part in value for x in numbers(part)]
    return [float(value)] if not isinstance(value, bool) and is_number(str(value)) else []


def is_near(one, other):
    """Whether a figure, or a part of it, is that of the gains."""
    if isinstance(one, dict) and isinstance(other, dict):
        return all(is_near(one[key], other[key]) for key in one)
    left, right = numbers(one), numbers(other)
    return len(left) == len(right) and np.allclose(left, right, rtol=0, atol=1.1e-3 * max(map(abs, right), default=0))


def judge(case, place, text):
    """Hold what is proved of a forged file against what is proved of the genuine one; return whether it is proved."""
    content, before, proof = content_of(case), genuine(case), proved(case, place, text)
    if proof is None:
        return False
    assert before, "nothing can be proved"
    forged = json.loads(text)
    now, then, stance = found_at(forged, place), at(content, place), stance_of(place)
    if proof.claim != before.claim or stated_anew(forged, content):
        assert place[-1] in STATED, "another claim"
        assert now > then, "a claim of more"
        return True
    named = now is MISSING or any(f"{dotted(place)}.".startswith(f"{path}.") for path in proof.numerical)
    assert {
        "proved": lambda: same(now, then),
        "listed": lambda: now is MISSING or same(bare(now), bare(then)),
        "witness": lambda: now is MISSING or place[0] != "observer" or achieves(text),
        "part": lambda: now is MISSING or is_part(now, then),
        "smaller": lambda: Fraction(str(now)) <= Fraction(str(then)),
        "larger": lambda: Fraction(str(now)) >= Fraction(str(then)),
        "more": lambda: is_part(then, now),
        "figure": lambda: named and (now is MISSING or is_near(now, then)),
        "numerical": lambda: named or (place[0] == "notes" and is_part(now, list(design_for(case).spec.notes))),
        "label": lambda: True,
    }[stance](), stance
    return True


def bare(value):
    """Conditions without their margins, which are computed in doubles."""
    if isinstance(value, list):
        return [bare(part) for part in value]
    return {key: part for key, part in value.items() if key != "margin"} if isinstance(value, dict) else value


def stated_anew(forged, content):
    """Whether the statement is another."""
    return found_at(forged, ("guarantee", "statement")) != found_at(content, ("guarantee", "statement"))


def achieves(text):
    """Whether the frozen members of the class keep what is proved of forged gains, computed in doubles."""
    design = design_of(ResultFile("forged.json", text.encode()))
    guarantee, found = design.guarantee, design.analysis
    if guarantee is None or "worst_pole" not in found:
        return True
    pole, least = found["worst_pole"], found["peak_gain"]["least"]
    slow = pole is None or pole[0] <= -guarantee.rates().alpha * (1 - 1e-6)
    return slow and (guarantee.norm != "sup" or least is None or least <= guarantee.gamma * (1 + 1e-6))


def swept(case, most):
    """Places of a file, two of those that have the same keys, with so many forgeries of each at most, drawn by lot."""
    random, kinds = rng(0), {}
    content = content_of(case)
    for place in places(content):
        kinds.setdefault(tuple(key if isinstance(key, str) else "" for key in place), []).append(place)
    for alike in kinds.values():
        for place in (alike[i] for i in random.permutation(len(alike))[:2]):
            made = list(forgeries(content, place))
            for k in random.permutation(len(made))[:most]:
                yield place, json.dumps(made[k]()).replace(json.dumps(TWICE), f'"{place[-1]}": 1e-9, "{place[-1]}"')


def hold(case, place, text):
    """Judge a forged file, with what it is in the words of a failure."""
    try:
        return judge(case, place, text)
    except AssertionError as error:
        raise AssertionError(f"{place}: {error}\n{text}") from error


@pytest.mark.parametrize("case", CASES)
def test_what_may_stand_in_every_field_is_decided(case):
    assert {stance_of(place) for place in places(content_of(case))} <= set(STANCES)


@pytest.mark.parametrize("case", [case for case in CASES if case.values[0].endswith("least gamma")])
def test_a_field_that_is_forged_proves_nothing_that_is_false(case):
    assert {hold(case, place, text) for place, text in swept(case, 1)} == {False, True}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_no_field_that_is_forged_proves_anything_that_is_false(case, outcome_of):
    """A part of the files goes through the command line, and what is read back shows nothing that was forged."""
    found = set()
    most = 1 if case.startswith("clock") else 3  # a file with a witness for each claim takes longer to prove
    for i, (place, text) in enumerate(swept(case, SWEEP.size(most))):
        holds = hold(case, place, text)
        found.add(holds)
        if not i % 40:
            assert (outcome_of(text).exit_code == 0) == holds, text
        if not i % 40 and holds and design_for(case).gains and place[0] != "observer":
            shown = design_of(ResultFile("forged.json", text.encode()))
            assert shown._repr_html_() == read_back(case), text
    assert found == ({False} if genuine(case) is None else {False, True})


REFUSED = {  # by certificate: keys that stand in those of another kind, or in none
    "infeasible/bearing-too-fast": ("members", "at", "size", "forged"),
    "infeasible/hidden-sensor-bias": ("alpha", "gamma", "multipliers", "at", "size", "forged"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_certificate_that_there_is_no_solution_holds_what_proves_it_and_nothing_else(case, outcome_of):
    content = content_of(case)
    assert outcome_of(content).exit_code == 0
    for key in REFUSED[case]:
        outcome = outcome_of(put(copy.deepcopy(content), ("diagnosis", "certificate", key), "1"))
        assert outcome.exit_code == 2
        assert f"diagnosis.certificate.{key}: is nothing that is proved anew" in outcome.stderr
    outcome = outcome_of(put(copy.deepcopy(content), ("diagnosis", "proof"), "exact, and of every other observer too"))
    assert outcome.exit_code == 2
    assert "diagnosis.proof: is not what is proved anew; expected exact" in outcome.stderr


@pytest.mark.parametrize("case", ["l2 gamma", "lipschitz least gamma", "infeasible/bearing-too-fast"])
def test_the_conditions_in_a_file_are_those_that_are_proved(case, outcome_of):
    content = content_of(case)
    place = (*(("diagnosis",) if "diagnosis" in content else ()), "certificate", "checks")
    checks = at(content, place)
    for forged in (
        [{**checks[0], "name": "the observer is stable for every f"}, *checks[1:]],
        checks[1:],
        [*checks, checks[0]],
        [{"name": checks[0]["name"]}, *checks[1:]],
        [],
    ):
        outcome = outcome_of(put(copy.deepcopy(content), place, forged))
        assert (outcome.exit_code, ".".join(place) in outcome.stderr) == (2, True), forged


@pytest.mark.parametrize("character", ["\n", "\r", "\x1b", "\x85", "\u2028", "\u202e", "\ud800", "\u200b"])
def test_texts_and_keys_of_a_file_that_would_forge_lines_are_refused(character, outcome_of):
    content, forged = content_of("l2 gamma"), f"x{character}proved: everything"
    changes = [put(copy.deepcopy(content), (key,), forged) for key in ("name", "created", "search")]
    changes += [put(copy.deepcopy(content), ("notes",), [forged]), {**content, forged: 1}]
    changes += [put(copy.deepcopy(content), ("analysis", forged), 1)]
    for change in changes:
        outcome = outcome_of(change)
        assert (outcome.exit_code, len(outcome.stderr.splitlines()), outcome.stdout) == (2, 1, "")
        assert f"holds the character U+{ord(character):04X}" in outcome.stderr


@cache
def read_back(case):
    """What a design that is read from the genuine file shows of itself."""
    return design_of(ResultFile("genuine.json", text_of(case)))._repr_html_()
