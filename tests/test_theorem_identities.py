"""Observers without an LMI as theorems for Coq: what is stated of their errors, what is refused, what Coq says."""

import re

import pytest
from flint import fmpq
from support.commands import run
from support.coq import AXIOMS, compiled, needs_coq
from support.shipped import solved

import obsdesign as od
from obsdesign.coq import kernel
from obsdesign.coq.identities import Fall, factors
from obsdesign.coq.library import QUIET
from obsdesign.coq.library import library as files
from obsdesign.coq.runs import IMPORTS
from obsdesign.coq.signals import bounds, opaque, required, text, vanishes
from obsdesign.expressions import parse
from obsdesign.lmi.formula import rational

TYPES = ("cuk-kkl", "cuk-pebo", "cuk-kkl-pebo", "cuk-immersion", "cuk-high-gain")
OTHERS = (
    "cascade-gradient",
    "chain-found",
    "cuk-high-gain-linear",
    "cuk-proportional",
    "duffing-found",
    "exponential-drift",
    "fading-excitation",
    "van-der-pol-found",
)
NAMED = """
obsdesign: 1
name: Names that Coq has, roots, logarithms and divisors
system:
  states: [T, R, in, e_z]
  inputs: [K, is]
  dynamics: {T: "-T**3 + R*K", R: "-R/(1+T**2) + is", in: "-in + exp(-T)", e_z: "-2*e_z + in*sqrt(K) + log(K)*T"}
  outputs: {O: T}
  domain: {K: [0.5, 2], T: [-3, 3]}
observer:
  type: kkl
  coordinates:
    - {name: z, phi: R, lambda: "-1/(1+O**2)", B: is}
    - {name: run, phi: in, lambda: -1, B: exp(-O)}
    - {name: S, phi: e_z, lambda: -2, B: "run*sqrt(K) + log(K)*O"}
  left_inverse: {R: z, in: run, e_z: S}
"""
COPY = """
obsdesign: 1
name: Copy with constant errors
system:
  dynamics: {x1: x2 + sin(x1), x2: x3 - x1**3, x3: -x3 + u}
  inputs: [u]
  outputs: {y: x1}
observer: {type: high-gain, copy: outputs, injection: {x1: {y: 3}, x2: {y: 3}, x3: {y: 1}}}
"""
UNDONE = """
obsdesign: 1
name: Logarithm as a coordinate, and an input in another
system:
  dynamics: {x1: -x1 + 1 + log(x2), x2: -x2*(log(x2) - x1)}
  outputs: {y: x1}
  domain: {x1: [-1, 3], x2: [0.2, 9]}
observer:
  type: kkl
  coordinates: [{name: z, phi: log(x2), lambda: -1, B: y}]
  left_inverse: {x2: exp(z)}
"""
DIVIDED = """
obsdesign: 1
name: Rate that is a quotient
system:
  dynamics: {x1: -x1 + 3 + 0.1*sin(x2), x2: -2*x2/x1 + sqrt(x1)}
  outputs: {y: x1}
  domain: {x1: [1, 4]}
observer: {type: kkl, coordinates: [{name: z, phi: x2, lambda: -2/y, B: sqrt(y)}], left_inverse: {x2: z}}
"""
HELD = """
obsdesign: 1
name: High gain in coordinates with an input
system:
  dynamics: {x1: x2*(2 + u) - x1, x2: -x2}
  inputs: [u]
  outputs: {y: x1}
  domain: {u: [0, 1]}
observer:
  type: high-gain
  states: {z1: x1, z2: x2*(2 + u)}
  dynamics: {z1: z2 - y, z2: -z2}
  left_inverse: {x2: z2/(2 + u)}
  injection: {z1: {y: 3}, z2: {y: 2}}
"""
WAITING = """
obsdesign: 1
name: Immersion of two, of which one waits
system:
  dynamics: {x1: -x1 + x2, x2: -x2 + x3, x3: -2*x3 + x1}
  outputs: {y: x1}
observer:
  type: immersion-invariance
  chi: [c1, c2]
  phi: [x2, x3]
  beta: [c1 + 2*y, c2]
  left_inverse: {x2: b1, x3: b2}
  dynamics: {c1: -(c1+2*y) + c2 - 2*(-y + c1 + 2*y), c2: -2*c2 + y}
"""
OWN = {"names": NAMED, "copy": COPY, "undone": UNDONE, "divided": DIVIDED, "held": HELD, "waiting": WAITING}


def theorem(name, tmp_path):
    """Theorem of a shipped spec, or of one of these."""
    design = od.solve(od.load(OWN[name])) if name in OWN else solved(name)[1]
    assert design.status == "certified"
    design.save(tmp_path / "case.gains.json")
    return od.theorem(tmp_path / "case.gains.json")


def concluded(text):
    """What the theorem states, on one line."""
    return " ".join(text[text.index("Theorem for_this_f") : text.index("Proof.")].split())


STATED = {
    "cuk-kkl": (
        "let e_xi2 t := xi2 t - (0.01 * i1 t - 0.000022 * v2 t) in",
        "let rate_e_xi2 t := - ((1 - u t) / 0.01) in",
        "(obeys T e_xi1 rate_e_xi1 /\\ decays T e_xi1 1951.96)",
        "i1 t = (xi2 t + 0.000022 * y1 t) / 0.01",
    ),
    "cuk-pebo": ("(still T k_xi1)", "(obeys T r_1 rate_r_1 /\\ decays T r_1 0.5)", "theta_xi2"),
    "cuk-kkl-pebo": ("(still T k_xi1)", "decays T e_xi2 1951.96", "decays T r_1 0.5"),
    "cuk-immersion": ("let b_1 t := c1 t + 0.0011 * y1 t in", "decays T e_1 4.99999", "decays T e_2 1952.96"),
    "cuk-high-gain": ("is_derive e_hat_i1 t (",),
    "cuk-proportional": ("(still T k_xi1)", "decays T e_xi1 4.99999"),
    "cascade-gradient": (
        "(vanishes T e_xi2 -> obeys T e_xi3 rate_e_xi3 /\\ decays T e_xi3 3)",
        "(vanishes T e_xi2 -> vanishes T e_xi3 -> obeys T r_1 rate_r_1 /\\ decays T r_1 5)",
    ),
    "names": (
        "(forall c, below T rate_e_z c -> decays T e_z_ c)",
        "(vanishes T e_run -> obeys T e_S rate_e_S /\\ decays T e_S 2)",
    ),
    "copy": ("<= 494 * exp (- (2 * 0.989 * t)) * (e_hat_x1 0 ^ 2 + e_hat_x2 0 ^ 2 + e_hat_x3 0 ^ 2)",),
    "undone": ("let e_z t := z t - ln (x2 t) in", "e_z t = 0 -> x2 t = exp (z t)"),
    "divided": ("(obeys T e_z rate_e_z /\\ decays T e_z 0.5)",),
    "held": ("<= 6.99 * exp (- (2 * 1.97 * t)) * (e_z1 0 ^ 2 + e_z2 0 ^ 2)", "x2 t = z2 t / (2 + u t)"),
    "waiting": ("(vanishes T e_2 -> obeys T e_1 rate_e_1 /\\ decays T e_1 3)", "decays T e_2 2"),
}


@pytest.mark.parametrize("name", STATED)
def test_the_theorem_states_how_each_error_moves_and_decays(name, tmp_path):
    found = theorem(name, tmp_path)
    for words in STATED[name]:
        assert words in concluded(found)
    assert not re.search(r"Admitted|Axiom|Parameter|admit", found)
    assert all(len(line) <= 120 for line in found.splitlines() if not line.startswith("(*"))


def test_the_premises_are_the_equations_and_ranges_of_the_spec(tmp_path):
    record = theorem("names", tmp_path).partition("Record run")[2].partition("Theorem")[0]
    for words in (
        "plant_R_ : forall t, 0 <= t <= T -> is_derive R_ t (- (R_ t / (1 + T_ t ^ 2)) + is_ t);",
        "observer_run_ : forall t, 0 <= t <= T -> is_derive run_ t (- run_ t + exp (- O t));",
        "output_O : forall t, O t = T_ t;",
        "range_K : forall t, 0 <= t <= T -> 0.5 <= K t <= 2;",
    ):
        assert words in record
    assert "needed_" not in record  # it follows from the ranges
    assert "held_u : forall t, 0 <= t <= T -> is_derive u t 0;" in theorem("held", tmp_path)
    without = OWN["undone"].replace(", x2: [0.2, 9]", "")
    assert "needed_1 : forall t, 0 <= t <= T -> 0 < x2 t }." in od.solve(od.load(without)).theorem()


UNPROVED = {
    "trig": ("x2", "-2*x2 + 1", "sin(y)**2 + cos(y)**2", "is no identity that ring and field of Coq prove"),
    "tangent": ("x2", "-2*x2 + tan(0*y) + sat(y)", "sat(y)", r"sat\(.*\) is no function that the library in Coq knows"),
    "branch": ("x2", "-2*x2 + where(y > 0, 1/y, 0)", "where(y > 0, 1/y, 0)", "asked on a branch only|no function"),
}


@pytest.mark.parametrize("case", UNPROVED)
def test_what_the_library_does_not_prove_is_refused_in_one_line(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    phi, side, B, words = UNPROVED[case]
    spec = f"""
obsdesign: 1
system: {{dynamics: {{x1: x2, x2: "{side}"}}, outputs: {{y: x1}}}}
observer: {{type: kkl, coordinates: [{{name: z, phi: {phi}, lambda: -2, B: "{B}"}}], left_inverse: {{x2: z}}}}
"""
    od.solve(od.load(spec)).save("case.gains.json")
    outcome = run("verify", "case.gains.json", "--theorem", "coq")
    assert outcome.exit_code == 2
    assert len(outcome.stderr.splitlines()) == 1
    assert re.search(words, outcome.stderr)
    assert not (tmp_path / "case.theorem.v").exists()


@pytest.mark.parametrize(
    ("typed", "written"),
    [
        ("-x**2 - (y - 3)", "- x t ^ 2 - (y t - 3)"),
        ("-2*x/(3*y)", "- (2 * x t / (3 * y t))"),
        ("x - 2*(y + 1)*x", "x t - 2 * (y t + 1) * x t"),
        ("(x/y)/(y/x)", "x t / y t / (y t / x t)"),
        ("exp(-x)*sin(2*y)**3", "exp (- x t) * (sin (2 * y t)) ^ 3"),
        ("x/7 - 0.25", "x t / 7 - 0.25"),
        ("sqrt(x)*t", "sqrt (x t) * t"),
    ],
)
def test_the_text_of_a_function_is_the_function(typed, written):
    f = parse(typed, ("x", "y", "t"))
    assert text(f, {"x": "x", "y": "y"}) == written


def test_ring_knows_exponentials_of_sums_and_no_more_of_functions():
    names = ("x", "y")
    assert vanishes(parse("exp(x - y)*exp(y) - exp(x)", names))
    assert vanishes(parse("exp(log(x) + y)/exp(y) - log(exp(x))", names))
    assert vanishes(parse("sin(x)*(x + 1)/(x + 1) - sin(x)", names))
    assert not vanishes(parse("sin(x)**2 + cos(x)**2 - 1", names))
    assert not vanishes(parse("sin(x + y) - sin(y + x)", names))
    assert not vanishes(parse("sqrt(x)**2 - x", names))
    assert opaque(parse("exp(2*x)", names)).names == {"exp(2*x)"}


def test_linear_arithmetic_knows_ranges_even_powers_and_few_functions():
    ranges = {"u": (fmpq(1, 10), fmpq(9, 10)), "x": (None, fmpq(3))}
    found = bounds(parse("-(1 - u)/0.01", ("u",)), ranges)
    assert (found.low, found.high, found.signals) == (fmpq(-90), fmpq(-10), ("u",))
    assert bounds(parse("1 + y**2", ("y",)), {}).shows("is not 0")
    assert bounds(parse("exp(y)", ("y",)), {}).shows("> 0")
    assert bounds(parse("2 + cos(y)", ("y",)), {}).shows("> 0")
    assert not bounds(parse("1 + cos(y)", ("y",)), {}).shows("> 0")
    assert bounds(parse("-x", ("x",)), ranges).low == -3
    assert not bounds(parse("x", ("x",)), ranges).shows("is not 0")
    assert not bounds(parse("y*u", ("y", "u")), ranges).shows("is not 0")
    assert bounds(parse("1 + t", ("t",)), {}).shows("> 0")


def test_a_divisor_is_needed_factor_by_factor():
    found = required([parse("1/(x*sqrt(y)*(1 + x)**2)", ("x", "y"))], [])
    assert {*found} == {"x is not 0", "y > 0", "1 + x is not 0", "y >= 0"}


def test_a_storage_function_that_does_not_fall_is_none():
    M, P = rational([[-1, 1], [0, -2]]), rational([[2, 0], [0, 2]])
    assert Fall((), M, P, fmpq(1, 2), fmpq(2)).holds
    assert not Fall((), M, P, fmpq(1), fmpq(2)).holds
    assert not Fall((), M, P, fmpq(1, 2), fmpq(1)).holds
    with pytest.raises(ValueError, match="negative eigenvalue"):
        factors(rational([[0, 1], [1, 1]]))


# What the kernel says


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """The file of the library that these theorems need, compiled."""
    folder, name = tmp_path_factory.mktemp("library"), "ObsIdentity.v"
    (folder / name).write_bytes(files()[name])
    assert kernel.run(str(folder), *QUIET.split(), "-Q", ".", "Obs", name).code == 0
    return folder


def together(texts):
    """Files as modules of one, so that the library is loaded once."""
    parts = [f"Module M{i}.\n{text.replace(IMPORTS, '')}\nEnd M{i}." for i, text in enumerate(texts)]
    return "\n".join([IMPORTS, *parts])


def accepted(library, texts):
    """Hold the kernel to accepting files, on the axioms of the reals."""
    holds, said = compiled(library, together(texts))
    assert holds, said
    assert said.count("Axioms:") == len(texts)
    assert {*re.findall(r"^\w+\.(\w+)", said, re.MULTILINE)} <= AXIOMS


@pytest.mark.slow
@needs_coq
def test_the_kernel_accepts_one_design_of_each_type(library, tmp_path):
    accepted(library, [theorem(name, tmp_path) for name in TYPES])


@pytest.mark.sweep
@pytest.mark.slow
@needs_coq
def test_the_kernel_accepts_the_other_designs(library, tmp_path):
    accepted(library, [theorem(name, tmp_path) for name in (*OTHERS, *OWN)])


FALSE = {
    "cuk-kkl": ("1.0022 * (1 - u t)", "1.0023 * (1 - u t)"),
    "cuk-pebo": ("psi_xi1_1 t (0.5 * ((1 - u t)", "psi_xi1_1 t (0.5 * ((1 + u t)"),
    "cuk-kkl-pebo": ("decays T e_xi2 1951.96", "decays T e_xi2 1951.97"),
    "cuk-immersion": ("v4 t = b_2 t", "v4 t = b_1 t"),
    "cuk-high-gain": ("400 * (y1 t - hat_v2 t)", "401 * (y1 t - hat_v2 t)"),
}


@needs_coq
@pytest.mark.parametrize("name", FALSE)
def test_the_kernel_refuses_what_is_false(name, library, tmp_path):
    right, wrong = FALSE[name]
    text = " ".join(theorem(name, tmp_path).split())
    assert right in text
    assert not compiled(library, text.replace(right, wrong))[0]
