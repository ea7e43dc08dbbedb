"""Specs of Lipschitz systems: what the reader takes, and what it answers to wrong ones."""

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from support.sweep import examples
from support.wrong_specs import problem_of, wrong_in

from obsdesign.dissipation.bounds import Bounds, Range
from obsdesign.errors import UsageError
from obsdesign.families.lipschitz.relaxations import lipschitz_multiplier
from obsdesign.families.lipschitz.request import LipschitzRequest
from obsdesign.reading import json_schema, loads
from obsdesign.work import check

BASE = """\
obsdesign: 1
name: Pendulum
system:
  A: [[0, 1], [-1, -1]]
  B: [1, 1]
  C: [1, 0]
  D: 0.2
nonlinearities:
  - {type: {lipschitz: 0.4}, f: [0, 0.4*sin(q1)]}
observer:
  type: lipschitz
  slack: 0.05
"""
TYPE, SLACK, D, B, F = (
    "  type: lipschitz",
    "  slack: 0.05",
    "  D: 0.2",
    "  B: [1, 1]",
    "{type: {lipschitz: 0.4}, f: [0, 0.4*sin(q1)]}",
)
PARETO = "  objective: pareto\n"


wrong = wrong_in(BASE)


def asked(line, key, *words, place=None):
    return wrong(SLACK, f"  {line}", f"observer.{key}", *words, place=place)


def pareto(line, key, *words):
    return wrong(SLACK, f"{PARETO}  {line}", f"observer.{key}", *words)


CHOICES = [
    asked("relaxation: s-proceduer", "relaxation", "did you mean s-procedure?", place=(12, 15)),
    asked("relaxation: proposition-2", "relaxation", "unknown relaxation", "s-procedure, norm-bound, abbaszadeh"),
    asked("relaxation: [s-procedure, norm-bound]", "relaxation", "expected one of s-procedure", "found"),
    asked("objective: max-lipshitz", "objective", "did you mean max-lipschitz?"),
    asked("objective: feasibility", "objective", "unknown objective", "max-lipschitz, min-gamma, pareto"),
    asked("objective: {gamma: 1}", "objective", "found"),
    asked("objective: pareto", "weight", "is required for pareto", "[0, 1]", place=(10, 1)),
    asked("weight: 0.5", "weight", "belongs to objective pareto, not to max-lipschitz", place=(12, 3)),
    wrong(SLACK, "  objective: min-gamma\n  weight: 0.5", "observer.weight", "not to min-gamma", place=(13, 3)),
    pareto("weight: 1.5", "weight", "1.5 is above 1; a weight is in [0, 1]"),
    pareto("weight: -0.5", "weight", "give a number >= 0"),
    pareto("weight: heavy", "weight", "unknown name 'heavy'"),
    pareto("weight: {min: 0, max: 2}", "weight.max", "2 is above 1"),
    pareto("weight: {min: -1, max: 1}", "weight.min", "give a number >= 0"),
    pareto("weight: {min: 0.5, max: 0.5}", "weight", "a range needs min < max"),
    pareto("weight: {min: 0, max: 1, log: true}", "weight.min", "give a number > 0"),
    pareto("weight: [0, 1]", "weight", "a number, or a range"),
    asked("decay: -1", "decay", "give a number >= 0"),
    asked("decay: .nan", "decay", "not a finite number"),
    asked("decay: {min: 0, max: 1}", "decay", "max-lipschitz needs a number; a range is for pareto"),
    pareto("weight: 0.5\n  decay: {min: -1, max: 1}", "decay.min", "give a number >= 0"),
    pareto("weight: 0.5\n  decay: {min: 0, max: 1, log: true}", "decay.min", "give a number > 0"),
    asked("slack: -1", "slack", "give a number >= 0"),
]

NUMBERS = [
    asked("bounds: {L: 0}", "bounds.L", "give a number > 0"),
    asked("bounds: {L: {frobenius: -1}}", "bounds.L.frobenius", "give a number > 0"),
    asked("bounds: {L: {frobenius: 1, spectral: 1}}", "bounds.L.spectral", "allowed: frobenius"),
    asked("bounds: {L1: 3}", "bounds.L1", "did you mean L?"),
    asked("bounds: {P: 3}", "bounds.P", "a mapping with the keys min"),
    asked("bounds: {P: {min: 1, max: 3}}", "bounds.P.max", "unknown key max", "allowed: min"),
    asked("bounds: {P: {min: 0}}", "bounds.P.min", "give a number > 0"),
    asked("bounds: {gamma: -1}", "bounds.gamma", "give a number > 0"),
    asked("gains: {L: [1, 2, 3]}", "gains.L", "2 rows", "a vector of 3"),
    asked("gains: {L: [[1, 2], [3, 4]]}", "gains.L", "1 column (one for each output), found 2x2"),
    asked("gains: {L: [1, .inf]}", "gains.L[1]", "not a finite number"),
    asked("gains: {L1: [1, 2]}", "gains.L1", "did you mean L?"),
    asked("gains: {}", "gains.L", "is required"),
]

OTHERS = [
    asked("alpha: 1", "alpha", "is called decay in type lipschitz", place=(12, 3)),
    *(
        asked(f"{key}: 1", key, f"does not belong to type lipschitz, but to {owners}", "relaxation, objective, weight")
        for key, owners in (
            ("L2", "l2 or linf"),
            ("reconstruct", "l2 or linf"),
            ("T1", "sporadic"),
            ("T2", "sporadic"),
            ("delta", "sporadic"),
            ("injection", "sporadic"),
        )
    ),
    asked("degree: 2", "degree", "does not belong to type lipschitz, but to kkl"),
    asked("relaxatoin: abbaszadeh", "relaxatoin", "did you mean relaxation?"),
    wrong(TYPE, "  type: lipshitz", "observer.type", "did you mean lipschitz?", place=(11, 9)),
    wrong(TYPE, "  type: l2\n  weight: 0.5", "observer.weight", "does not belong to type l2 or linf, but to lipschitz"),
]

PLANTS = [
    *(
        wrong(F, f"{{type: {kind}, Bf: [0, 1], Cq: [1, 0]}}", "nonlinearities[0].type", "no Lipschitz constant", "auto")
        for kind in (
            "monotone",
            "cubic",
            "q|q|",
            "{slope: [0, .inf]}",
            "{ball: {W: 1}}",
            "{sector: {K2: 1}}",
            "{jacobian: [1, 2]}",
            "{one-sided-lipschitz: {rho: 1, beta: 1, phi: 0}}",
        )
    ),
    wrong(F, "{type: cubic, Bf: [0, 1], Cq: [1, 0]}", "nonlinearities[0].type", "give {lipschitz: k}", place=(9, 12)),
    wrong(F, "{type: {lipschitz: 0.1}, f: [0, 0.4*sin(q1)]}", "nonlinearities[0].type", "is refuted by"),
    wrong(F, "{type: {lipschitz: 1}, f: q1}", "nonlinearities[0].Bf", "f has 1 component", "2 states; give Bf"),
    wrong(F, "{type: {lipschitz: 3}, f: [q1, q2, q1]}", "nonlinearities[0].Bf", "f has 3 components"),
    wrong(F, "{type: {lipschitz: 1}, f: [q1, q3]}", "nonlinearities[0].f[1]", "unknown name 'q3'"),
    *(
        wrong(
            F, f"{{type: {{lipschitz: 1}}, {key}}}", "nonlinearities", f"{key[:3].strip(':')} must be zero", "type l2"
        )
        for key in ("Dqf: [[0, 0.1], [0, 0]]", "Dq: [0.1, 0]", "Df: [0.1, 0]")
    ),
    wrong(
        "observer:\n",
        "disturbance: {model: {Am: -1, Cm: 1, Dwf: 1, nonlinearities: [{type: sin}]}}\nobserver:\n",
        "disturbance",
        "D Dwf must be zero",
    ),
    wrong(
        "observer:\n",
        "disturbance: {model: {Am: -1, Bmf: 1, Cq2: 1, Cm: 1, nonlinearities: [{type: cubic}]}}\nobserver:\n",
        "disturbance",
        "cubic has no Lipschitz constant",
    ),
    wrong(f"nonlinearities:\n  - {F}\n", "", "nonlinearities", "needs at least one", "use type l2"),
]


def test_the_spec_that_the_wrong_ones_are_made_from_is_right():
    assert isinstance(loads(BASE).observer, LipschitzRequest)


@pytest.mark.parametrize("case", [*CHOICES, *NUMBERS, *OTHERS, *PLANTS])
def test_a_mistake_is_answered_in_one_line_at_its_place_with_what_is_allowed(case):
    assert case.is_answered_by(problem_of(case.text))


@pytest.mark.parametrize("objective", ["min-gamma", "pareto\n  weight: 0.5"])
def test_an_objective_about_w_needs_a_w(objective):
    text = BASE.replace(f"{B}\n", "").replace(f"{D}\n", "").replace(SLACK, f"  objective: {objective}")
    with pytest.raises(UsageError, match=r"observer\.objective: .* is about w, and there is none; give system\.B"):
        loads(text)
    loads(text.replace(f"  objective: {objective}", SLACK))


def test_mistakes_of_the_observer_do_not_hide_that_f_has_the_size_of_the_state():
    with pytest.raises(UsageError) as caught:
        loads(BASE.replace(SLACK, "  relaxation: none").replace(D, "  D: [1, 2]"))
    assert [p.key for p in caught.value.problems] == ["system.D", "observer.relaxation"]


# What is taken


def request_of(line):
    return loads(BASE.replace(SLACK, f"  {line}")).observer


def test_defaults():
    assert loads(BASE.replace(f"{SLACK}\n", "")).observer == LipschitzRequest("lipschitz", (fmpq(2, 5),))
    spec = loads(BASE)
    assert spec.plant.Bf.tolist() == spec.plant.Cq.tolist() == [[1, 0], [0, 1]]
    assert spec.nonlinearities[0].nq == 2


@pytest.mark.parametrize("relaxation", ["s-procedure", "norm-bound", "abbaszadeh", "compare"])
@pytest.mark.parametrize("objective", ["max-lipschitz", "min-gamma", "pareto"])
def test_every_relaxation_goes_with_every_objective(relaxation, objective):
    weight = "\n  weight: 1/3" if objective == "pareto" else ""
    found = request_of(f"relaxation: {relaxation}\n  objective: {objective}{weight}")
    assert (found.relaxation, found.objective) == (relaxation, objective)
    assert found.weight == (fmpq(1, 3) if weight else None)


def test_ranges_of_weight_and_decay_may_begin_at_zero():
    found = request_of(
        "objective: pareto\n  weight: {min: 0, max: 1, points: 41}\n  decay: {min: 0, max: 0.5, points: 11}"
    )
    assert found.weight == Range(fmpq(0), fmpq(1), 41)
    assert found.rate == Range(fmpq(0), fmpq(1, 2), 11)
    assert len(set(found.weight.grid())) == 41


@pytest.mark.parametrize("weight", [0, 1])
def test_the_ends_are_weights(weight):
    assert request_of(f"objective: pareto\n  weight: {weight}").weight == weight


def test_bounds_and_gains():
    assert request_of("objective: min-gamma\n  bounds: {L: 20, P: {min: 1e-3}, gamma: 2}").bounds == Bounds(
        fmpq(20), "spectral", None, fmpq(2), fmpq(1, 1000)
    )
    assert request_of("bounds: {L: {frobenius: 20}}").bounds == Bounds(fmpq(20), "frobenius")
    found = request_of("decay: 0.2\n  gains: {L: [23.7025, 13.7272]}")
    assert found.gains["L"].tolist() == [[fmpq(237025, 10000)], [fmpq(137272, 10000)]]
    assert found.rate == fmpq(1, 5)


@pytest.mark.parametrize(
    ("block", "constants", "sizes"),
    [
        ("{type: {lipschitz: 0.4167}}", ["4167/10000"], [(2, 2)]),
        ("{type: sin, Bf: [0, 1], Cq: [1, 0]}", ["1"], [(1, 1)]),
        ("{type: tanh}", ["1", "1"], [(1, 1), (1, 1)]),
        ("{type: {slope: [-3, 2]}, Bf: [0, 1], Cq: [1, 0]}", ["3"], [(1, 1)]),
        ("{type: {slope: [[-2, 0.1], [1, 0.5]]}}", ["2", "1/2"], [(1, 1), (1, 1)]),
        ("{type: {cocoercive: 2.5}}", ["5/2"], [(2, 2)]),
        ("{type: auto, f: 0.5*q**2, region: {q: [-1, 3]}, Bf: [0, 1], Cq: [1, 0]}", ["3"], [(1, 1)]),
        (
            "{type: {lipschitz: auto, region: {q: [-1, 3]}}, f: 0.5*q**2, Bf: [0, 1], Cq: [1, 0]}",
            ["3"],
            [(1, 1)],
        ),
        ("{type: {lipschitz: 2}, f: [2*sin(q)], Bf: [0, 1], Cq: [1, 0]}", ["2"], [(1, 1)]),
        ("{type: {lipschitz: 2}, Cq: [1, 0]}", ["2"], [(1, 2)]),
        ("{type: {lipschitz: 2}, Bf: [1, 0]}", ["2"], [(2, 1)]),
        ("{type: sin, Bf: [0, 1], Cq: [1, 0]}\n  - {type: {lipschitz: 0}}", ["1", "0"], [(1, 1), (2, 2)]),
    ],
)
def test_types_with_a_finite_slope_are_read_as_their_constants(block, constants, sizes):
    spec = loads(BASE.replace(F, block))
    expected = tuple(fmpq(*map(int, (*k.split("/"), "1")[:2])) for k in constants)
    assert spec.observer.lipschitz == expected
    wanted = lipschitz_multiplier(expected, sizes)
    for found, block_ in zip(spec.multiplier.blocks, wanted.blocks, strict=True):
        for name in ("member", "M11", "M12", "M22"):
            assert (getattr(found, name) == getattr(block_, name)).all()
    declared = block.startswith("{type: {lipschitz")
    assert any("is read as lipschitz" in note for note in spec.notes) is not declared


def test_only_this_family_reads_missing_matrices_as_the_identity():
    text = BASE.replace(TYPE, "  type: l2\n  alpha: 0.1").replace(F, "{type: sin, f: sin(q)}")
    assert not loads(text).plant.Bf.any()
    assert not loads(text).plant.Cq.any()


def test_a_disturbance_model_appends_its_blocks_and_constants():
    model = "disturbance: {model: {Am: -1, Bm: 1, Bmf: 1, Cq2: 1, Cm: 1, nonlinearities: [{type: {slope: [-2, 0]}}]}}"
    spec = loads(BASE.replace("observer:\n", f"{model}\nobserver:\n").replace(SLACK, "  gains: {L: [1, 2, 3]}"))
    assert spec.observer.lipschitz == (fmpq(2, 5), fmpq(2))
    assert spec.observer.gains["L"].shape == (3, 1)
    assert spec.augmented.Bf.shape == (3, 3)


@pytest.mark.parametrize(
    ("relaxation", "blocks", "noted"),
    [
        ("s-procedure", "{type: sin, Bf: [0, 1], Cq: [1, 0]}", False),
        ("norm-bound", "{type: sin, Bf: [0, 1], Cq: [1, 0]}", True),
        ("abbaszadeh", "{type: {lipschitz: 1}, Cq: [[2, 0], [0, 2]]}", True),
        ("compare", "{type: {lipschitz: 1}, Bf: [[2, 0], [0, 2]]}", True),
        ("abbaszadeh", "{type: {lipschitz: 1}, Bf: [[1, 0], [0, 1]]}", False),
    ],
)
def test_what_an_unstructured_relaxation_ignores_is_noted(relaxation, blocks, noted):
    spec = loads(BASE.replace(F, blocks).replace(SLACK, f"  relaxation: {relaxation}"))
    found = any("unstructured with the constant norm(Bf) lipschitz norm(Cq)" in note for note in spec.notes)
    assert found is noted


def test_the_json_schema_knows_the_keys_of_the_family():
    definitions = json_schema()["$defs"]
    keys = definitions["LipschitzObserver"]["properties"]
    assert set(keys) == {
        "type",
        "relaxation",
        "objective",
        "weight",
        "decay",
        "rho",
        "estimate",
        "poles",
        "slack",
        "bounds",
        "gains",
    }
    assert keys["relaxation"]["enum"] == ["s-procedure", "norm-bound", "abbaszadeh", "compare"]
    assert keys["objective"]["enum"] == ["max-lipschitz", "min-gamma", "pareto"]
    assert set(definitions["LipschitzBounds"]["properties"]) == {"L", "P", "gamma"}


KEYS = ("relaxation", "objective", "weight", "decay", "slack", "bounds", "gains", "alpha", "T2", "Wieght")
VALUES = (
    "0", "0.5", "-1", "1e400", ".nan", "x", "[]", "[[1], [2]]", "{}", "{min: 0, max: 1}", "{min: 1, max: 0, log: true}",
    "{L: 1}", "{L: [1, 2]}", "{P: {min: 0}}", "{L: {frobenius: q}}", "pareto", "compare", "~", "true", "1/0",
)  # fmt: skip
TYPES = (
    "{lipschitz: 0}",
    "{lipschitz: auto}",
    "sin",
    "cubic",
    "auto",
    "{slope: [1, 0]}",
    "{slope: [[1, 2], [3]]}",
    "0",
)
MATRICES = (
    "",
    ", Bf: [0, 1]",
    ", Cq: [[1, 0]]",
    ", Bf: 0",
    ", Cq: []",
    ", f: [q1, q2]",
    ", f: 1/q",
    ", Dqf: 1",
    ", Df: 0",
)


@examples(80)
@given(
    st.dictionaries(st.sampled_from(KEYS), st.sampled_from(VALUES), max_size=4),
    st.lists(st.tuples(st.sampled_from(TYPES), st.sampled_from(MATRICES), st.sampled_from(MATRICES)), max_size=2),
    st.sampled_from(("", "disturbance: integrator\n", "disturbance: {model: {Am: 0, Dwf: 1}}\n")),
)
def test_whatever_a_spec_says_it_is_read_or_answered_in_plain_lines(keys, blocks, disturbance):
    lines = "".join(f"  {key}: {value}\n" for key, value in keys.items())
    functions = "".join(f"  - {{type: {kind}{one}{two}}}\n" for kind, one, two in blocks)
    system = BASE[: BASE.index("nonlinearities")]
    text = f"{system}nonlinearities:{functions and chr(10)}{functions or ' []' + chr(10)}{disturbance}"
    spec, problems = read(f"{text}observer:\n  type: lipschitz\n{lines}")
    assert (spec is None) is bool(problems)
    assert all(p.message and "\n" not in str(p) for p in problems)
    if spec is not None:
        assert len(spec.observer.lipschitz) == len(spec.multiplier.blocks) > 0
        assert all(k >= 0 for k in spec.observer.lipschitz)


def read(text):
    try:
        return loads(text), ()
    except UsageError as error:
        return None, error.problems


# What `check` finds


def feasible(found):
    """Whether nothing that was found rules every gain out."""
    return all(finding.stands for finding in found)


def findings(spec):
    return {finding.name: finding.written() for finding in check(spec)}


def spec_of(system, observer, constant=0.4, performance="{H: [[0.5, 0], [0, 0.5]]}"):
    block = f"nonlinearities: [{{type: {{lipschitz: {constant}}}}}]"
    request = f"observer: {{type: lipschitz, {observer}}}"
    return loads(f"obsdesign: 1\nsystem: {system}\n{block}\nperformance: {performance}\n{request}\n")


SAME = "{A: [[0, 1], [-1, -1]], B: [1, 1], C: [1, 0], D: 0.2}"
OWN = "{A: [[0, 1], [-1, -1]], B: [[1, 0], [1, 0]], C: [1, 0], D: [[0, 0.2]]}"


@pytest.mark.parametrize(("decay", "ceiling"), [(0, 2**0.5), (0.05, 1.379311), (0.5, 1.118034)])
def test_the_ceiling_that_no_gain_exceeds_is_found(decay, ceiling):
    found = findings(spec_of(SAME, f"decay: {decay}"))["ceiling"]
    assert found["ceiling"] == pytest.approx(ceiling, rel=1e-6)
    assert found["holds"]


@pytest.mark.parametrize(("objective", "possible"), [("max-lipschitz", True), ("min-gamma", False)])
def test_a_constant_above_the_ceiling_rules_a_guaranteed_gamma_out(objective, possible):
    report = check(spec_of(SAME, f"objective: {objective}", constant=2))
    assert feasible(report) is possible


SUPREMA = {"s-procedure": 1.118034, "norm-bound": 0.80901699, "abbaszadeh": 0.27538128}


@pytest.mark.parametrize("relaxation", SUPREMA)
def test_the_suprema_of_all_relaxations_are_found_and_that_of_the_chosen_one_decides(relaxation):
    report = check(spec_of(SAME, f"decay: 0.5, objective: min-gamma, relaxation: {relaxation}", constant=0.4167))
    found = {f.name: f.written() for f in report}
    for name, value in SUPREMA.items():
        assert found[f"supremum, {name}"]["supremum"] == pytest.approx(value, rel=1e-6)
        assert found[f"supremum, {name}"]["decides"] is (name == relaxation)
    assert feasible(report) is (relaxation != "abbaszadeh")


def test_a_constant_that_may_be_of_any_size_has_no_supremum():
    found = findings(spec_of("{A: [[0, 1], [-1, -1]], C: [[1, 0], [0, 1]]}", "decay: 0"))["supremum, s-procedure"]
    assert found["holds"]
    assert "of any size" in found["sentence"]
    assert "supremum" not in found


def test_a_gain_that_cancels_w_is_found():
    assert findings(spec_of(SAME, "decay: 0"))["L D = B"]["holds"]
    assert not findings(spec_of(OWN, "decay: 0"))["L D = B"]["holds"]


@pytest.mark.parametrize("relaxation", ["s-procedure", "abbaszadeh"])
@pytest.mark.parametrize("objective", ["max-lipschitz", "min-gamma"])
@pytest.mark.parametrize("H", [0.5, 1])
def test_sigma_of_H_matters_to_the_printed_theorems_only(relaxation, objective, H):
    spec = spec_of(
        SAME, f"relaxation: {relaxation}, objective: {objective}", performance=f"{{H: [[{H}, 0], [0, 0.5]]}}"
    )
    report = check(spec)
    assert feasible(report) is not (relaxation == "abbaszadeh" and objective == "min-gamma" and H == 1)
    assert findings(spec)["sigma(H)"]["sigma"] == H


def test_a_mode_that_is_hidden_or_too_slow_is_named_in_the_words_of_the_family():
    spec = spec_of("{A: [[-1, 0], [0, -0.3]], C: [1, 0]}", "decay: 0.5")
    found = findings(spec)
    assert not feasible(check(spec))
    assert found["decay"]["sentence"] == "detectability limits decay to 0.3 with f = 0"
    assert "ceiling" not in found
    assert np.isclose(found["detectability"]["eigenvalue"][0], -0.3)
