"""What a right spec is read as: exact matrices, derived sizes, names, disturbance models, requests."""

import json
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
import yaml
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from support.sweep import examples

from obsdesign.dissipation.bounds import Range
from obsdesign.errors import UsageError
from obsdesign.expressions import parse
from obsdesign.families import FAMILIES
from obsdesign.reading import json_schema, load, loads
from obsdesign.spec import limited

ROOT = Path(__file__).parent.parent
SHIPPED = str(ROOT / "specs" / "corless2019-magnetic-bearing.yaml")


def spec(system="{A: [[0, 1], [-1, 0]], C: [1, 0]}", observer="{type: l2, alpha: 1}", **sections):
    """Spec of sections in YAML."""
    sections = {"obsdesign": 1, "system": system, "observer": observer} | sections
    return loads("".join(f"{key}: {value}\n" for key, value in sections.items()), "spec.yaml")


def values(matrix):
    return matrix.astype(float).tolist()


@pytest.fixture(scope="module")
def bearing():
    return load(SHIPPED)


def test_the_magnetic_bearing_is_read_whole(bearing):
    plant = bearing.plant
    assert (plant.states, plant.exogenous, plant.outputs) == (("x1", "x2", "x3"), ("w1", "w2"), ("y1", "y2"))
    assert values(plant.Bf) == [[0], [1], [0]]
    assert values(plant.Cq) == [[0, 0, 1]]
    assert plant.D[0, 0] == fmpq(1, 10)
    assert bearing.model_states == ("w1", "w2")
    assert bearing.drives == ("v1", "v2")
    assert (values(bearing.H), bearing.H_names) == ([[0, 0, 0, 1, 0], [0, 0, 0, 0, 1]], ("w1", "w2"))
    assert bearing.observer.rate == fmpq(71, 100)
    assert values(bearing.observer.L2) == [[0, -110]]
    assert bearing.expect["limit.gamma"]["rtol"] == 1e-3
    assert bearing.text == Path(SHIPPED).read_text()
    assert bearing.notes == ()


def test_the_augmented_magnetic_bearing_is_equation_60(bearing):
    augmented = bearing.augmented
    assert values(augmented.A)[0] == [0, 1, 0, 1, 0]
    assert values(augmented.C)[0] == [1, 0, 0, 0.1, 0]
    assert values(augmented.B) == [[0, 0], [0, 0], [0, 0], [1, 0], [0, 1]]


DECIMALS = st.decimals(min_value=-1000, max_value=1000, allow_nan=False, allow_infinity=False, places=6).map(str)


@examples(50, deadline=1000)
@given(
    st.integers(1, 4).flatmap(lambda n: st.lists(st.lists(DECIMALS, min_size=n, max_size=n), min_size=n, max_size=n))
)
def test_a_matrix_of_decimals_is_read_exactly(rows):
    text = ", ".join(f"[{', '.join(row)}]" for row in rows)
    A = spec(system=f"{{A: [{text}], C: [[{', '.join('1' * len(rows))}]]}}").plant.A
    for row, exact in zip(rows, A, strict=True):
        for decimal, entry in zip(row, exact, strict=True):
            numerator, denominator = Decimal(decimal).as_integer_ratio()
            assert entry == fmpq(numerator, denominator)


def test_an_irrational_entry_is_its_double_and_the_spec_says_so():
    read = spec(system="{A: [[0, 1], [sqrt(2), 0]], C: [1, 0]}")
    assert read.plant.A[1, 0] == fmpq(*(2**0.5).as_integer_ratio())
    assert read.notes == ("system.A[1][0] = sqrt(2) is read as the double 1.4142135623730951",)


def test_parameters_are_arithmetic_over_earlier_ones_and_stay_exact():
    read = spec(parameters="{m: 0.3, k: 2/m}", system="{A: [[0, 1], [-k/m, 0]], C: [1, 0]}")
    assert read.plant.A[1, 0] == fmpq(-200, 9)


@pytest.mark.parametrize(
    ("system", "shapes"),
    [
        ("{A: 2, C: 1}", {"A": (1, 1), "B": (1, 0), "C": (1, 1), "D": (1, 0)}),
        ("{A: 2, B: [1, 2], C: [1, 2]}", {"B": (1, 2), "C": (2, 1), "D": (2, 2)}),
        ("{A: [[0, 1], [0, 0]], B: [0, 1], C: [1, 0]}", {"B": (2, 1), "C": (1, 2), "D": (1, 1)}),
        ("{A: [[0, 1], [0, 0]], C: [1, 0], D: [1, 2, 3]}", {"B": (2, 3), "D": (1, 3)}),
        ("{A: 0, C: [1, 0, 0], states: [a, b, c]}", {"A": (3, 3), "C": (1, 3)}),
        ("{A: [[0, 1], [0, 0]], B: 0, C: [1, 0], D: 0}", {"B": (2, 0), "D": (1, 0)}),
        ("{A: [[0, 1], [0, 0]], B: [[], []], C: [[1, 0], [0, 1]]}", {"B": (2, 0), "D": (2, 0)}),
        ("{A: [[0, 1], [0, 0]], B: [0, 1], C: [1, 0], D: [[0]]}", {"D": (1, 1)}),
    ],
)
def test_sizes_are_derived_and_what_is_missing_is_zero(system, shapes):
    plant = spec(system=system).plant
    assert {name: getattr(plant, name).shape for name in shapes} == shapes


def test_the_number_of_exogenous_inputs_may_come_from_the_argument_of_a_nonlinearity():
    plant = spec(nonlinearities="[{type: monotone, Bf: [0, 1], Cq: [1, 0], Dq: [1, 2]}]").plant
    assert values(plant.Dq) == [[1, 2]]
    assert plant.B.shape == (2, 2)


def test_blocks_are_stacked_in_order():
    blocks = """
  - {type: {lipschitz: 2}, f: [sin(q1), q2], Bf: [[1, 2], [3, 4]], Cq: [[1, 0], [0, 1]], Dqf: [[0, 0, 5], [0, 0, 6]]}
  - {type: tanh, Bf: [7, 8], Cq: [9, 10], Df: 11}"""
    read = spec(nonlinearities=blocks)
    assert values(read.plant.Bf) == [[1, 2, 7], [3, 4, 8]]
    assert values(read.plant.Cq) == [[1, 0], [0, 1], [9, 10]]
    assert values(read.plant.Dqf) == [[0, 0, 5], [0, 0, 6], [0, 0, 0]]
    assert values(read.plant.Df) == [[0, 0, 11]]
    assert [block.nq for block in read.nonlinearities] == [2, 1]
    assert read.nonlinearities[1].f == (parse("tanh(q)", ["q"]),)
    assert read.multiplier.matrix({"lambda1": np.array([[1]]), "lambda2": np.array([[1]])})[0].shape == (3, 3)


@pytest.mark.parametrize(
    ("kind", "columns", "scales"),
    [
        ("monotone", 2, 1),
        ("cubic", 2, 1),
        ("{lipschitz: 1/3}", 1, 1),
        ("{slope: [0, 2.5]}", 2, 2),
        ("{slope: [0, .inf]}", 1, 1),
        ("{slope: [[0, -1], [1, .inf]]}", 2, 2),
        ("{slope: [0, [1, 2]]}", 2, 2),
        ("{multiplier: [[4, 0, 0], [0, -1, 0], [0, 0, -1]]}", 2, 1),
        ("{sector: {K1: -1, K2: 1}}", 1, 1),
        ("{sector: {K2: [[1, 0], [0, 1]]}}", 2, 1),
        ("{cocoercive: 2}", 2, 1),
        ("{ball: {K: [[1, 0], [0, 1]], W: [1, 1]}}", 2, 1),
        ("{one-sided-lipschitz: {rho: 1, beta: 3, phi: 0}}", 2, 1),
        ("{jacobian: [-1, 1]}", 1, 1),
        ("{cone: [[[1, 0], [0, 0]], [[0, 0], [0, 1]]]}", 2, 1),
        ("sat", 2, 2),
    ],
)
def test_every_type_gives_a_multiplier_of_its_size(kind, columns, scales):
    Bf = "[0, 1]" if columns == 1 else "[[1, 0], [0, 1]]"
    Cq = "[1, 0]" if columns == 1 or "mult" in kind else "[[1, 0], [0, 1]]"
    (block,) = spec(nonlinearities=f"[{{type: {kind}, Bf: {Bf}, Cq: {Cq}}}]").nonlinearities
    assert len(block.multiplier.blocks) == scales
    assert block.multiplier.member.shape[0] == columns


def test_a_library_function_acts_on_each_component():
    (block,) = spec(nonlinearities="[{type: q|q|, Bf: [[1, 0], [0, 1]], Cq: [[1, 0], [0, 1]]}]").nonlinearities
    assert [f.text for f in block.f] == ["q1*abs(q1)", "q2*abs(q2)"]


@pytest.mark.parametrize(
    ("kind", "f"),
    [
        ("q|q|", "sign(q)*q**2"),
        ("cubic", "q*q*q"),
        ("tanh", "(exp(q) - exp(-q))/(exp(q) + exp(-q))"),
        ("relu", "(q + abs(q))/2"),
        ("deadzone", "q1 - sat(q1)"),
    ],
)
def test_a_function_that_is_its_type_in_other_words_is_accepted(kind, f):
    (block,) = spec(nonlinearities=f'[{{type: {kind}, f: "{f}", Bf: [0, 1], Cq: [1, 0]}}]').nonlinearities
    assert block.f == (parse(f, ["q", "q1"]),)


@pytest.mark.parametrize(("kind", "f"), [("cubic", "q**3 + 1e-6*q"), ("relu", "q"), ("sin", "sin(q + t)")])
def test_a_function_that_its_type_refutes_is_named_with_a_point(kind, f):
    with pytest.raises(UsageError, match=r"differs from its type \w+: .* at q = \S+, where f is "):
        spec(nonlinearities=f'[{{type: {kind}, f: "{f}", Bf: [0, 1], Cq: [1, 0]}}]')


def test_expressions_know_the_outputs_the_inputs_and_the_parameters():
    read = spec(
        parameters="{k: 3}",
        system="{A: [[0, 1], [0, 0]], B: [0, 1], C: [1, 0], inputs: [u], gx: [0, k*u + y1], gy: u*t}",
        nonlinearities="[{type: monotone, f: q + u*t, Bf: [0, 1], Cq: [1, 0], gq: y1}]",
        simulation="{horizon: 1, x0: [1, 2], u: -x1, w: 1}",
    )
    assert [g.text for g in read.gx] == ["0", "3*u + y1"]
    assert read.gy[0].names == {"u", "t"}
    assert read.gq[0].names == {"y1"}
    assert read.inputs == ("u",)
    assert read.simulation.u[0].names == {"x1"}


TWO_INPUTS = "{A: [[0, 1], [0, 0]], B: [[1, 0], [0, 1]], C: [1, 0]}"


@pytest.mark.parametrize(
    ("disturbance", "states", "drives"),
    [
        ("unknown", (), 2),
        ("integrator", ("w1", "w2"), 2),
        ("{type: integrator}", ("w1", "w2"), 2),
        ("double-integrator", ("w1", "dw1", "w2", "dw2"), 2),
        ("{sinusoid: {omega: 2}}", ("w1", "dw1", "w2", "dw2"), 2),
        ("{type: {sinusoid: {omega: 2}}}", ("w1", "dw1", "w2", "dw2"), 2),
        ("[integrator, unknown]", ("w1",), 2),
        ("{type: [unknown, {sinusoid: {omega: 2*pi}}]}", ("w2", "dw2"), 2),
        ("[{bias+sinusoid: {omega: 1}}, integrator]", ("w1.bias", "w1.sine", "dw1.sine", "w2"), 3),
        ("{model: {Am: 0, Bm: 1, Cm: [1, 2]}}", ("xm1",), 1),
        ("[integrator, {model: {Am: [[0, 1], [-1, 0]], Bm: [0, 1], Cm: [1, 0]}}]", ("w1", "xm2", "xm3"), 2),
    ],
)
def test_disturbance_models_stack_and_name_their_states(disturbance, states, drives):
    read = spec(system=TWO_INPUTS, disturbance=disturbance)
    assert read.model_states == states
    assert read.drives == tuple(f"v{i + 1}" for i in range(drives))
    assert read.generator.Cm.shape == (2, len(states))
    assert read.augmented.A.shape == (2 + len(states),) * 2


def test_the_frequency_of_a_sinusoid_is_exact():
    generator = spec(system=TWO_INPUTS, disturbance="{sinusoid: {omega: 0.1}}").generator
    assert generator.Am[1, 0] == fmpq(-1, 100)
    assert generator.inverse[0] == (fmpq(1, 100), fmpq(0), fmpq(1))


def test_a_model_of_the_disturbance_has_nonlinearities_of_its_own():
    model = "{Am: [[0, 1], [0, 0]], Bm: [0, 1], Bmf: [[0, 0], [1, 1]], Cq2: [[1, 0], [0, 1]], Cm: [[1, 0], [0, 1]], \
        nonlinearities: [{type: cubic}, {type: {slope: [0, 1]}, f: tanh(q)}]}"
    read = spec(system=TWO_INPUTS, disturbance=f"{{model: {model}}}")
    assert [block.type for block in read.nonlinearities] == ["cubic", "slope [0, 1]"]
    assert read.generator.inverse == (None, None)
    assert read.augmented.Cq.shape == (2, 4)
    assert values(read.augmented.Bf) == [[0, 0], [0, 0], [0, 0], [1, 1]]


def test_a_single_nonlinearity_of_a_model_takes_all_of_q2():
    model = "{Am: 0, Bm: 1, Bmf: 1, Cq2: [1, 2], Cm: [1, 0], nonlinearities: [{type: {lipschitz: 1.5}, f: q1 + q2}]}"
    (block,) = spec(system=TWO_INPUTS, disturbance=f"{{model: {model}}}").nonlinearities
    assert block.nq == 2


@pytest.mark.parametrize(
    ("performance", "H", "names"),
    [
        ("x", [[1, 0, 0, 0], [0, 1, 0, 0]], ("x1", "x2")),
        ("w", [[0, 0, 1, 0], [0, 0, 0, 1]], ("w1", "w2")),
        ("all", np.eye(4).tolist(), ("x1", "x2", "w1", "w2")),
        ("[x2, w1]", [[0, 1, 0, 0], [0, 0, 1, 0]], ("x2", "w1")),
        ("{H: [1, 2, 3, 0.5]}", [[1, 2, 3, 0.5]], ("z1",)),
    ],
)
def test_performance_chooses_rows_of_the_augmented_state(performance, H, names):
    read = spec(system=TWO_INPUTS, disturbance="integrator", performance=performance)
    assert (values(read.H), read.H_names) == (H, names)


def test_a_disturbance_that_is_a_sum_of_model_states_can_be_estimated():
    read = spec(system="{A: 0, B: 1, C: 1}", disturbance="{bias+sinusoid: {omega: 1}}", performance="[w1, w1.bias]")
    assert values(read.H) == [[0, 1, 1, 0], [0, 1, 0, 0]]


def test_a_request_is_read_with_its_defaults():
    request = spec().observer
    assert request.L2.shape == (0, 1)
    assert (request.objective, request.slack, request.gains) == ("min-gamma", fmpq(1, 20), None)
    assert (request.bounds.L1, request.bounds.norm, request.bounds.P) == (None, "spectral", None)


def test_without_alpha_it_is_searched_and_the_spec_says_so():
    read = spec(observer="{type: l2}")
    assert isinstance(read.observer.rate, Range)
    assert "observer.alpha" in read.notes[0]


def test_a_request_is_read_in_full():
    request = spec(
        nonlinearities="[{type: monotone, Bf: [0, 1], Cq: [0, 1]}]",
        observer="""
  type: l2
  L2: free
  alpha: {min: 1e-2, max: 2, points: 7, log: true}
  objective: {gamma: 0.01}
  slack: 0.1
  bounds: {L1: {frobenius: 10}, P: 1e6, gamma: 2}
  gains: {L1: [1, 2]}""",
    ).observer
    assert request.L2 is None
    assert request.rate == Range(fmpq(1, 100), fmpq(2), 7, log=True)
    assert (request.objective, request.gamma, request.slack) == ("gamma", fmpq(1, 100), fmpq(1, 10))
    assert (request.bounds.L1, request.bounds.norm, request.bounds.P, request.bounds.gamma) == (
        10,
        "frobenius",
        10**6,
        2,
    )
    assert values(request.gains["L1"]) == [[1], [2]]
    assert values(request.gains["L2"]) == [[0]]


def test_the_rows_of_l2_follow_the_plant_first_and_then_the_model():
    model = "{Am: 0, Bm: 1, Bmf: 1, Cq2: 1, Cm: [1, 0], nonlinearities: [{type: cubic}]}"
    read = spec(
        system=TWO_INPUTS,
        nonlinearities="[{type: monotone, Bf: [0, 1], Cq: [0, 1]}]",
        disturbance=f"{{model: {model}}}",
        observer="{type: l2, alpha: 1, L2: [3, 4]}",
    )
    assert values(read.observer.L2) == [[3], [4]]


@pytest.mark.parametrize(
    ("x0", "xhat0", "sizes"),
    [("[1, 2]", "0", (2, 4)), ("[1, 2, 3, 4]", "[1, 2]", (4, 4)), ("0", "[1, 2, 3, 4]", (2, 4))],
)
def test_a_simulation_begins_in_the_plant_or_in_the_augmented_plant(x0, xhat0, sizes):
    trial = spec(
        system=TWO_INPUTS, disturbance="integrator", simulation=f"{{horizon: 1, x0: {x0}, xhat0: {xhat0}}}"
    ).simulation
    assert (len(trial.x0), len(trial.xhat0)) == sizes
    assert (trial.w, [v.text for v in trial.v]) == (None, ["0", "0"])


def test_a_simulation_is_read_in_full():
    trial = spec(
        system=TWO_INPUTS,
        simulation="""
  horizon: 2*pi
  v: [sin(t), 0]
  noise: {type: gaussian, amplitude: 0.1, period: 1e-3}
  seed: 7
  points: 100""",
    ).simulation
    assert trial.horizon == 2 * np.pi
    assert [v.text for v in trial.v] == ["sin(t)", "0"]
    assert (trial.noise.type, trial.noise.amplitude.tolist(), trial.noise.period) == ("gaussian", [0.1], 1e-3)
    assert (trial.seed, trial.points) == (7, 100)


def test_the_name_of_a_spec_is_that_of_its_file_by_default():
    assert spec().name == "spec"


def known_keys(schema, tree, definitions):
    """Whether every key of a tree is in a schema."""
    if "$ref" in schema:
        return known_keys(definitions[schema["$ref"].rpartition("/")[2]], tree, definitions)
    for union in ("anyOf", "oneOf"):
        if union in schema and any("$ref" in option or "type" in option for option in schema[union]):
            return any(known_keys(option, tree, definitions) for option in schema[union])
    if isinstance(tree, dict):
        inner = schema.get("properties", {})
        rest = schema.get("additionalProperties", schema.get("type") == "object")
        return all(
            known_keys(inner[key], value, definitions) if key in inner else rest is not False
            for key, value in tree.items()
        )
    return True


@pytest.mark.parametrize("path", sorted((ROOT / "specs").rglob("*.yaml")), ids=lambda path: path.stem)
def test_every_shipped_spec_is_read_and_its_keys_are_in_the_json_schema(path):
    assert load(str(path)).path == str(path)
    schema = json.loads(json.dumps(json_schema()))
    assert known_keys(schema, yaml.safe_load(path.read_text()), schema["$defs"])


def test_the_json_schema_knows_no_other_keys():
    schema = json_schema()
    tree = yaml.safe_load(Path(SHIPPED).read_text())
    assert not known_keys(schema, tree | {"observer": {"type": "l2", "aplha": 1}}, schema["$defs"])
    assert schema["required"] == ["obsdesign", "system", "observer"]


def test_the_json_schema_lets_nothing_be_null():
    assert '"null"' not in json.dumps(json_schema())


PLANE = "Bf: [0, 1], Cq: [[1, 0], [0, 1]]"


def test_the_type_tells_the_sections_of_an_observer_apart():
    schema = json_schema()
    sections = [one["$ref"].rsplit("/", 1)[1] for one in schema["properties"]["observer"]["oneOf"]]
    types = [name for one in sections for name in schema["$defs"][one]["properties"]["type"]["enum"]]
    assert sorted(types) == sorted(FAMILIES)


@pytest.mark.parametrize(
    ("block", "region", "others", "validity"),
    [
        ("type: {lipschitz: 1}", None, {}, None),
        ("type: {lipschitz: 1}, region: {q: [-.inf, .inf]}", None, {}, None),
        ("type: {lipschitz: 1, region: {q: [-1, 2]}}", ((-1, 2),), {}, "as long as q and its estimate stay in [-1, 2]"),
        (
            "type: monotone, region: {q1: [0, .inf]}",
            ((0, None),),
            {},
            "as long as q and its estimate stay in [0, inf]",
        ),
        ("type: monotone, f: u*q, region: {u: [0, 2]}", None, {"u": (0, 2)}, "as long as u stays in [0, 2]"),
        (
            "type: {auto: {region: {q: [-1, 1], y1: [0, 2]}}}, f: y1*q**3",
            ((-1, 1),),
            {"y1": (0, 2)},
            "as long as q and its estimate stay in [-1, 1] and y1 stays in [0, 2]",
        ),
    ],
)
def test_a_region_makes_the_guarantee_local_and_says_where(block, region, others, validity):
    read = spec(
        system="{A: [[0, 1], [-1, 0]], C: [1, 0], inputs: [u]}",
        nonlinearities=f"[{{{block}, Bf: [0, 1], Cq: [1, 0]}}]",
    )
    assert (read.nonlinearities[0].region, read.nonlinearities[0].others, read.validity) == (region, others, validity)


def test_the_validity_of_several_nonlinearities_names_each():
    one = "{type: cubic, Bf: [0, 1], Cq: [1, 0]}"
    two = f"{{type: {{lipschitz: 2, region: {{q2: [-3, 3]}}}}, {PLANE}}}"
    read = spec(nonlinearities=f"[{one}, {two}]")
    assert read.validity == "as long as q2 of nonlinearities[1] and its estimate stay in [-3, 3]"
    assert [block.region for block in read.nonlinearities] == [None, ((None, None), (-3, 3))]


def test_a_decimal_limit_of_a_region_is_exact_and_in_doubles_it_is_rounded_outward():
    (block,) = spec(nonlinearities="[{type: cubic, region: {q: [-0.1, 0.3]}, Bf: [0, 1], Cq: [1, 0]}]").nonlinearities
    assert block.region == ((fmpq(-1, 10), fmpq(3, 10)),)
    ((_, _, _, (low, high)),) = limited([block])
    assert fmpq(*low.as_integer_ratio()) <= fmpq(-1, 10)
    assert fmpq(*high.as_integer_ratio()) >= fmpq(3, 10)
    assert high - low < 0.4 + 1e-15


@pytest.mark.parametrize(
    ("kind", "nq", "nf"),
    [
        ("{sector: {K1: [[0, 0, 0]], K2: [[1, 1, 1]]}}", 3, 1),
        ("{ball: {W: [[1, 0], [0, 1], [1, 1]]}}", 2, 1),
        ("{jacobian: [[[1, 0], [0, 1], [0, 0]]]}", 2, 3),
        ("{cone: [[[1, 2]]]}", 2, 1),
    ],
)
def test_the_data_of_a_type_give_the_sizes_that_are_left_open(kind, nq, nf):
    model = f"{{Am: 0, Bm: 1, Cm: [1, 0], nonlinearities: [{{type: {kind}}}]}}"
    (block,) = spec(system=TWO_INPUTS, disturbance=f"{{model: {model}}}").nonlinearities
    assert block.multiplier.member.shape == (nf, nq)


@pytest.mark.parametrize(
    ("block", "chosen"),
    [
        ("type: auto, f: sin(q)", "slope [-1, 1]"),
        ("type: {slope: auto}, f: tanh(q) - q", "slope [-1, 0]"),
        ("type: {auto: {region: {q: [-1, 1]}}}, f: q**3", "slope [0, 3]"),
        ("type: {auto: {region: {u: [0, 2]}}}, f: u*tanh(q)", "slope [0, 2]"),
        ("type: {lipschitz: auto, region: {q: [-1, 2]}}, f: q**3", "lipschitz 12"),
        ("type: {cocoercive: auto}, f: 2*atan(q)", "cocoercive 2"),
        ("type: {jacobian: auto}, f: sin(q)", "jacobian of 2 vertices"),
    ],
)
def test_auto_becomes_a_type_that_the_spec_names_with_the_reason(block, chosen):
    read = spec(
        system="{A: [[0, 1], [-1, 0]], C: [1, 0], inputs: [u]}",
        nonlinearities=f"[{{{block}, Bf: [0, 1], Cq: [1, 0]}}]",
    )
    assert read.nonlinearities[0].type == f"{chosen} (auto)"
    (note,) = read.notes
    assert note.startswith(f"nonlinearities[0].type: {chosen} is proved from f: ")


def test_a_declared_type_that_is_proved_is_said_to_be():
    read = spec(nonlinearities="[{type: {slope: [-1, 1]}, f: sin(q), Bf: [0, 1], Cq: [1, 0]}]")
    assert read.notes == ("nonlinearities[0].type: slope [-1, 1] is proved from f",)


def test_time_begins_at_zero():
    read = spec(nonlinearities="[{type: {lipschitz: 1}, f: exp(-t)*sin(q), Bf: [0, 1], Cq: [1, 0]}]")
    assert read.validity is None
    assert len(read.notes) == 1


def test_the_json_schema_describes_the_types_with_data():
    properties = json_schema()["$defs"]["TypeData"]["properties"]
    assert {"one-sided-lipschitz", "sector", "ball", "jacobian", "cone", "auto", "region"} <= set(properties)
    assert {"const": "auto"} in properties["slope"]["anyOf"]
