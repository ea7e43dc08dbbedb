"""Theorems about the f of a spec: which f are shown to be in their class, and what the kernel of Coq says of them."""

import math
import re
from dataclasses import replace
from itertools import pairwise

import pytest
from flint import fmpq, fmpq_poly
from hypothesis import given
from hypothesis import strategies as st
from support.coq import compiled, compiled_library, needs_coq
from support.shipped import SPECS

import obsdesign as od
from obsdesign.coq.membership import NoMemberError, Words, ending, shown
from obsdesign.coq.regions import Piece, UnprovedError, pieces, rational_function, rounded_root, text
from obsdesign.coq.ridges import UnknownFunctionError, ridges
from obsdesign.coq.theorem import stated, subject
from obsdesign.expressions import parse
from obsdesign.lmi.formula import rational

PYTHON = {
    "law {}": lambda s: s * abs(s),
    "relu {}": lambda s: max(s, 0.0),
    "sat {}": lambda s: min(max(s, -1.0), 1.0),
    "Rabs {}": abs,
    "1": lambda _: 1.0,
    "{}": lambda s: s,
    **{f"{name} {{}}": getattr(math, name) for name in ("sin", "cos", "tanh", "atan", "exp", "sinh")},
    **{f"{{}} ^ {k}": lambda s, k=k: s**k for k in range(3, 16, 2)},
}
TERMS = [f"{name}({{}})" for name in ("sin", "cos", "tanh", "atan", "sat", "abs", "exp", "sinh")]
TERMS += ["({})*abs({})", "({})**3", "({})*({})**2*({})**2", "max({}, 2)", "min(-1, {})", "max({}, 0)", "{}", "1.5"]
numbers = st.integers(-5, 5)


@given(st.lists(st.tuples(numbers, st.sampled_from(TERMS), numbers, numbers, numbers), min_size=1, max_size=4))
def test_the_ridges_of_a_sum_of_known_functions_add_up_to_it(terms):
    text = " + ".join(
        f"({c})/4*({term.replace('{}', f'({a})*q1/2 + ({b})*q2/4 - ({s})')})" for c, term, a, b, s in terms
    )
    f = [parse(text, ("q1", "q2")), parse(f"q2 - ({text})/2", ("q1", "q2"))]
    found = ridges(f, {"q1": 0, "q2": 1}, {})
    for q in ((0.0, 0.0), (0.7, -0.3), (-1.1, 2.0)):
        value = [0.0, 0.0]
        for one in found:
            s = float(one.argument.shift) + sum(float(c) * q[k] for k, c in one.argument.coefficients)
            for i, c in one.column.items():
                value[i] += float(c) * PYTHON[one.function.value](s)
        assert value == pytest.approx([float(e.function(("q1", "q2"))(*q)) for e in f], rel=1e-9, abs=1e-9)


@given(st.sampled_from([name for name in PYTHON if name != "1"]), st.floats(-3, 3), st.floats(-3, 3))
def test_the_quotients_of_a_known_function_are_between_its_numbers(name, p, r):
    texts = {"law {}": "q*abs(q)", "relu {}": "max(q, 0)", "Rabs {}": "abs(q)", "{}": "q"}
    text = texts.get(name) or (name.replace("{}", "q").replace("^", "**") if "^" in name else name.format("(q)"))
    (one,) = ridges([parse(text, ("q",))], {"q": 0}, {})
    assert one.function.value == name
    if abs(p - r) > 1e-3:
        quotient = (PYTHON[name](p) - PYTHON[name](r)) / (p - r)
        assert float(one.function.least) - 1e-9 <= quotient
        assert one.function.most is None or quotient <= float(one.function.most) + 1e-9


@pytest.mark.parametrize(
    "text",
    ["q**2", "sqrt(q)", "sin(q**3)", "q1*q2", "q*abs(q)**3", "q*abs(q + 1)", "1/q", "q**17", "where(q > 0, q, 0)"],
)
def test_what_is_no_sum_of_known_functions_is_not_taken_for_one(text):
    names = {"q": 0, "q1": 0, "q2": 1}
    with pytest.raises(UnknownFunctionError):
        ridges([parse(text, names)], names, {})


@pytest.mark.parametrize("S", [[[-1]], [[1, 2], [2, 1]], [[0, 1], [1, 1]], [[1, 1], [1, 0]], [[0, 1], [1, 0]]])
def test_no_T_is_given_for_a_matrix_that_is_negative_somewhere(S):
    with pytest.raises(NoMemberError):
        shown(rational(S))


# Functions on an interval


@given(st.lists(numbers, min_size=1, max_size=6), numbers, st.integers(1, 5))
def test_the_coefficients_in_pieces_are_those_of_the_polynomial_and_show_its_sign(coefficients, low, width):
    p, limits = fmpq_poly(coefficients), (fmpq(low), fmpq(low + width))
    try:
        found = pieces(p, limits)
    except UnprovedError:
        grid = [limits[0] + fmpq(width * k, 1000) for k in range(1001)]
        assert min(map(p, grid)) <= fmpq(1, 1000)
        return
    assert [found[0].low, found[-1].high] == list(limits)
    assert all(a.high == b.low for a, b in pairwise(found))
    for piece in found:
        n, s = len(piece.coefficients) - 1, fmpq(7, 11)
        terms = ((s - piece.low) ** k * (piece.high - s) ** (n - k) * b for k, b in enumerate(piece.coefficients))
        assert sum(terms, fmpq(0)) == p(s)
        assert min(piece.coefficients) >= 0


def test_a_polynomial_that_touches_zero_is_split_where_it_does():
    touching = fmpq_poly([fmpq(1, 4), -1, 1])
    assert [piece.high for piece in pieces(touching, (fmpq(0), fmpq(2)))] == [fmpq(1, 2), fmpq(2)]
    assert Piece.of(touching, fmpq(0), fmpq(1)).coefficients == (fmpq(1, 4), fmpq(-1, 2), fmpq(1, 4))


@given(st.fractions(min_value="1/1000", max_value=1000))
def test_a_root_is_rounded_to_the_side_that_is_asked_for(x):
    below, above = (rounded_root(fmpq(x.numerator, x.denominator), up=up) for up in (False, True))
    assert below**2 <= fmpq(x.numerator, x.denominator) <= above**2
    assert above - below <= fmpq(1, 10**12)
    assert rounded_root(fmpq(x.numerator, x.denominator) ** 2, up=False) == fmpq(x.numerator, x.denominator)


@pytest.mark.parametrize(
    ("f", "limits", "slopes", "words"),
    [
        ("q**2", (0, 1), (0, 1), "not shown to be within"),
        ("q**2", (0, 1), (1, 2), "not shown to be within"),
        ("abs(q)", (-1, 1), (-1, 1), "the sign of q is not known"),
        ("1/q", (0, 1), (-9, 0), "no value at an end"),
        ("1/(q - 1/2)", (0, 1), (-9, 0), "not shown to be within"),
        ("sin(q)", (0, 1), (-1, 1), "no quotient of polynomials: sin"),
        ("q**13", (0, 1), (0, 13), "no quotient of polynomials: q\\*\\*13"),
        ("(q**6 + 1)**6", (0, 1), (0, None), "a degree above"),
    ],
)
def test_bounds_that_are_not_shown_are_told(f, limits, slopes, words):
    with pytest.raises(UnprovedError, match=words):
        rational_function("phi", parse(f, ("q",)), tuple(map(fmpq, limits)), slopes)


@pytest.mark.parametrize(
    ("f", "plain", "positive", "negative"),
    [
        ("q*abs(q)/2", "s * Rabs s / 2", "s * s / 2", "s * (- s) / 2"),
        ("-q**2/3 - (q + 1)/(q*(2*q - 5))", "- s ^ 2 / 3 - (s + 1) / (s * (2 * s - 5))", None, None),
        ("abs(q - 4)**3", "(Rabs (s - 4)) ^ 3", "(- (s - 4)) ^ 3", "(- (s - 4)) ^ 3"),
        ("q**-2", "/ (s ^ 2)", None, None),
        ("(-q + 1)*(q - 2)/(-q)", "(- s + 1) * (s - 2) / (- s)", None, None),
    ],
)
def test_an_expression_is_told_in_the_words_of_Coq(f, plain, positive, negative):
    e, up, down = parse(f, ("q",)), (fmpq(1), fmpq(2)), (fmpq(-2), fmpq(-1))
    assert text(e, None) == plain
    assert text(e, up) == (positive or plain)
    assert text(e, down) == (negative or plain)


# Many functions in one plant: x' = -10 x - sum f_i(x) / 10
BLOCKS = [
    ("sin", None),
    ("cos", None),
    ("tanh", None),
    ("atan", None),
    ("sat", None),
    ("deadzone", None),
    ("relu", None),
    ("q|q|", None),
    ("cubic", None),
    ("monotone", "exp(q/2) + q**5 + 2*sinh(q) - 1"),
    ("{slope: [-1, 2]}", "abs(q - 1/3) + max(q, 0.2) - 0.1"),
    ("{slope: [0.25, .inf]}", "q**3/3 + 0.5*q - 0.25*sin(q)"),
    ("{cocoercive: 2}", "2*min(q, 1)"),
    ("{lipschitz: 0.7}", "0.7*cos(q - 2)"),
    ("{ball: {K: 2, W: 0.4}}", "2*q + 0.4*atan(q)"),
    ("{sector: {K1: -1, K2: 3}}", "q + 2*sin(q)"),
    ("{multiplier: [[-6, 4], [4, -2]]}", "2*q + sin(q)"),
    ("{one-sided-lipschitz: {rho: -1, beta: -3, phi: -4}}", "-2*q - sin(q)"),
]
PLANT = """
obsdesign: 1
system: {A: [[-10, 0], [0, -10]], B: [[1], [0]], C: [[1, 0], [0, 1]]}
nonlinearities:
"""
OBSERVER = "\nobserver: {type: l2, alpha: 0.1, bounds: {L1: 100}}\n"
PAIR = ("  - {type: {lipschitz: 1}, f: ['0.6*sin(q1 + q2/3)', 0.8*tanh(q2)], "
        "Bf: [[0.1, 0], [0, 0.1]], Cq: [[1, 0], [0, 1]]}\n")  # fmt: skip


def spec_of(*blocks, more=""):
    """Spec with these types, and their f where it is not that of the type."""
    lines = (f"  - {{type: {kind}, Bf: [-0.1, 0], Cq: [1, 0]{f', f: {f!r}' if f else ''}}}\n" for kind, f in blocks)
    return od.load(PLANT + "".join(lines) + more + OBSERVER)


def theorem_of(spec, folder, name="case"):
    """Theorem of the design of a spec."""
    design = od.solve(spec)
    assert design.status == "certified"
    design.save(folder / f"{name}.gains.json")
    return od.theorem(folder / f"{name}.gains.json")


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    """Theorem about all functions at once."""
    return theorem_of(spec_of(*BLOCKS, more=PAIR), tmp_path_factory.mktemp("many"))


REGIONS = """
  - {f: 0.5*sqrt(q), type: {slope: [0.125, 0.5]}, region: {q: [0.25, 4]}, Bf: [-0.1, 0], Cq: [1, 0]}
  - {f: q**2 - 2*q**3/3, type: {slope: [0, 0.5]}, region: {q: [0, 1]}, Bf: [-0.1, 0], Cq: [1, 0]}
  - {f: q/(2 + q), type: {lipschitz: 1}, region: {q: [-0.5, 8]}, Bf: [-0.1, 0], Cq: [1, 0]}
  - {f: 1/q - q*abs(q), type: {slope: [-4.25, -3]}, region: {q: [-2, -1]}, Bf: [-0.1, 0], Cq: [1, 0]}
  - {f: q**3 - q, type: monotone, region: {q: [0.6, 2]}, Bf: [-0.1, 0], Cq: [1, 0]}
  - {f: tanh(q), type: {slope: [0, 1]}, region: {q: [-1, 1]}, Bf: [-0.1, 0], Cq: [1, 0]}
  - {f: ['sqrt(q1 + 2*q2)/4', sin(q2)/2], type: {lipschitz: 1}, region: {q1: [0.5, 1], q2: [0, 3]},
     Bf: [[0.1, 0], [0, 0.1]], Cq: [[1, 0], [0, 1]]}
"""


@pytest.fixture(scope="module")
def local(tmp_path_factory):
    """Theorem about functions that have their types on regions."""
    return theorem_of(spec_of(more=REGIONS), tmp_path_factory.mktemp("local"))


def test_where_a_type_holds_on_a_region_only_the_theorem_is_about_what_stays_there(local):
    inside = re.search(r"Definition region .*", local)[0].removesuffix(".").split(" := ")[1].split(" /\\ ")
    sizes = [(0.25, 4), (0, 1), (-0.5, 8), (-2, -1), (0.6, 2)]
    assert [one.split(" <= ")[1] for one in inside] == [f"nth {k} q 0" for k in (0, 1, 2, 3, 4, 6, 7)]
    found = [tuple(float(end.strip("()").replace(" ", "")) for end in one.split(" <= ")[::2]) for one in inside]
    assert found == [*sizes, (0.5, 1), (0, 3)]
    assert "(forall t, 0 <= t -> region (q t) /\\ region (qh t)) ->" in stated(local)
    assert "q and qhat stay inside" in local.partition("Require Import")[0]
    f = re.search(r"Definition f \(t : R\).*\n.*\n  \[(.*)\]\.", local)[1].split("; ")
    assert f == ["0.5 * sqrt q1", *(f"phi{k} q{k}" for k in (2, 3, 4, 5)), "tanh q6",
                 "0.25 * sqrt (q7 + 2 * q8)", "0.5 * sin q8"]  # fmt: skip


def test_f_is_in_the_file_as_the_spec_has_it(many):
    assert "Theorem for_this_f :" in many
    assert many.endswith("Print Assumptions for_this_f.\n")
    f = re.search(r"Definition f \(t : R\).*\n.*\n  \[(.*)\]\.", many)[1].split("; ")
    assert f[:9] == ["sin q1", "cos q2", "tanh q3", "atan q4", "sat q5", "- sat q6 + q6", "relu q7", "law q8", "q9 ^ 3"]
    assert f[11] == "(1 / 3) * q12 ^ 3 - 0.25 * sin q12 + 0.5 * q12"
    assert f[-2:] == ["0.6 * sin (q19 + (1 / 3) * q20)", "0.8 * tanh q20"]
    head = many.partition("Require Import")[0]
    assert "What Coq proves is for_this_f" in head
    assert "Its premises: f is the one that is defined below" in head


def test_what_is_told_as_stated_is_the_last_theorem(many):
    assert subject(many) == ("for_this_f", "")
    assert stated(many).startswith("Theorem for_this_f : forall x xh v q qh y yh g gq gy, trajectories designed f x")


UNKNOWN = {
    ("monotone", None): "f1 is not given",
    ("{lipschitz: 3}", "sin(q + sin(q))"): "of f1, the library has no lemma on sin(q + sin(q))",
    ("{slope: [0, 1]}", "sin(t)*0.5 + q*0.5"): "f1 depends on t",
}


@pytest.mark.parametrize(("block", "words"), UNKNOWN.items())
def test_where_f_is_not_known_the_theorem_is_about_its_class(block, words, tmp_path):
    text = theorem_of(spec_of(block), tmp_path)
    assert f"\n(* for_the_class is about every f of its class: {words}" in text
    assert subject(text).theorem == "for_the_class"
    assert subject(text).reason.startswith(words)
    assert text.endswith("Print Assumptions for_the_class.\n")
    assert "for_this_f" not in text
    assert "f satisfies the inequalities of multipliers" in text.partition("Require Import")[0]


WORDS = Words("t : R", "forall t, 0 <= t ->", "trajectories_of_region designed", "x ..", "..", "..")
OUTSIDE = {
    "q**3": "its slope has no bound",
    "1.01*sin(q)/2 + q/2": "its slopes reach beyond the class",
    "-tanh(q)": "its slopes reach beyond the class",
}


@pytest.mark.parametrize(("text", "words"), OUTSIDE.items())
def test_an_f_outside_its_class_gets_no_theorem(text, words):
    (block,) = spec_of(("{slope: [0, 1]}", "tanh(q)")).nonlinearities
    M11, M12, M22 = ([[fmpq(x)]] for x in (0, 1, -2))
    rays = [(fmpq(1), *map(rational, (M11, M12, M22)))]
    assert ending([block], rays, "designed", WORDS).theorem == "for_this_f"
    end = ending([replace(block, f=(parse(text, ("q",)),))], rays, "designed", WORDS)
    assert end.theorem == "for_the_class"
    assert words in end.lines[0]


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """The library, compiled."""
    return compiled_library(tmp_path_factory.mktemp("library"))


@pytest.mark.slow
@pytest.mark.sweep
@needs_coq
def test_the_kernel_accepts_every_known_function(many, library):
    accepted, said = compiled(library, many)
    assert accepted, said
    assert "Axioms" in said


@pytest.mark.slow
@needs_coq
def test_the_kernel_accepts_functions_on_their_regions_and_on_no_larger_ones(local, library):
    accepted, said = compiled(library, local)
    assert accepted, said
    false = {
        "a larger region": local.replace("Prop := 0.25 <= nth 0", "Prop := 0.2 <= nth 0"),
        "no region": re.sub(r"Prop := .*", "Prop := True.", local),
        "a smaller slope": local.replace("(Some 0.5%Q) phi2", "(Some 0.49%Q) phi2"),
        "another sign": local.replace("s * Rabs s", "(- s) * Rabs s", 1),
        "a root with a smaller slope": local.replace("(sqrt_secants 0.25 4 0.25 1", "(sqrt_secants 0.25 4 0.25 0.9"),
        "no premise": local.replace("(forall t, 0 <= t -> region (q t) /\\ region (qh t)) ->", "True ->"),
    }
    for what, changed in false.items():
        assert changed != local, what
        assert not compiled(library, changed)[0], what


SAMPLES = """
obsdesign: 1
system: {{time: discrete, A: [[0.5]], B: [[1]], C: [[1]]}}
nonlinearities:
  - {{f: q**2/4, type: {{slope: [0, 0.5]}}, region: {{q: [0, 1]}}, Bf: [0.1], Cq: [1]}}
  - {{type: sat, Bf: [0.1], Cq: [1]}}
observer: {{type: l2, rho: 0.9, estimate: {estimate}}}
"""


@pytest.mark.slow
@needs_coq
@pytest.mark.parametrize("estimate", ["predicted", "filtered"])
def test_the_kernel_accepts_functions_on_regions_in_samples(estimate, library, tmp_path):
    file = theorem_of(od.load(SAMPLES.format(estimate=estimate)), tmp_path)
    assert f"{estimate} designed f x xh" in stated(file)
    assert "(forall k, region (q k) /\\ region (qh k)) ->" in stated(file)
    accepted, said = compiled(library, file)
    assert accepted, said


@pytest.mark.slow
@needs_coq
def test_the_kernel_refuses_an_f_outside_its_class(library, tmp_path):
    text = theorem_of(spec_of(("{slope: [0, 1]}", "tanh(q)")), tmp_path)
    cube = text.replace("tanh q1", "q1 ^ 3").replace("[tanh]", "[fun s => s ^ 3]")
    lemma = cube.replace("tanh_secants", "(odd_secants 1)")
    infinite = lemma.replace("most := Some 1%Q", "most := None")
    false = {
        "the cubic with the lemma of tanh": cube,
        "the cubic as a slope in [0, 1]": lemma,
        "the cubic without a bound": infinite,
        "the same by a ray": infinite.replace("Both (Ends [[1]]) (Ends [[1]])", "Rising [[1]] (Ends [[1]])"),
        "another f than that of the ridges": text.replace("  [tanh q1]", "  [2 * tanh q1]"),
        "a steeper f": text.replace("  [tanh q1]", "  [2 * tanh q1]").replace("column := [[1]]", "column := [[2]]"),
        "no end": text.replace("Both (Ends [[1]]) (Ends [[1]])", "Ends [[1]]"),
        "one end only": text.replace("Both (Ends [[1]]) (Ends [[1]])", "Fixed (Ends [[1]])"),
        "silence": text.replace("Both (Ends [[1]]) (Ends [[1]])", "Silent (Ends [[1]])"),
    }
    assert compiled(library, text)[0]
    for what, changed in false.items():
        assert changed != text, what
        accepted, said = compiled(library, changed)
        assert not accepted, what
        assert "Error" in said


@pytest.mark.slow
@needs_coq
@pytest.mark.parametrize(
    "name", ["biased-sensor", "coupled-masses", "planar-arm", "hardening-structure", "discrete-polytope"]
)
def test_the_kernel_accepts_f_with_no_and_with_several_components_and_with_multipliers_that_are_matrices(
    name, library, tmp_path
):
    text = theorem_of(od.load(SPECS / f"{name}.yaml"), tmp_path, name)
    assert "for_this_f" in text
    accepted, said = compiled(library, text)
    assert accepted, said
