"""A free L2, wherever a loop shift or an equal multiplier of one scale admits it; else what is in the way is said."""

import json

import pytest
from support.commands import run

import obsdesign as od

BATTERY = """\
obsdesign: 1
system: {{A: [[0, 0], [0, -5/3]], B: [[1/4680, 0], [1/20, 0]], C: [0, 1], D: [0, 0.01]}}
nonlinearities:
  - {{f: 2.52*q - 3.6644*q**2 + 2.2966*q**3, type: {type}, Bf: [0, 0], Cq: [1, 0], Df: [1]}}
observer: {{type: {family}, L2: free, alpha: 1.0e-4{more}}}
"""
REGION = "region: {q: [0, 1]}"
VAN_DER_POL = """\
obsdesign: 1
system: {{A: [[0, 1], [-1, 1]], B: [[0, 0], [1, 0]], C: [1, 0], D: [{D}]}}
nonlinearities:
  - {{f: y1**2*q, type: {type}, Bf: [0, -1], Cq: [0, 1]{Dq}}}
observer: {{type: l2, alpha: 0.5{L2}}}
"""


def solved(folder, text):
    """Exit code, output and result file of `solve`, which `verify` proves."""
    (folder / "s.yaml").write_text(text)
    outcome = run("solve", folder / "s.yaml", "-o", folder / "g.json")
    file = folder / "g.json"
    if outcome.exit_code == 0:
        assert run("verify", file).exit_code == 0
    return outcome.exit_code, outcome.output, json.loads(file.read_text()) if file.exists() else {}


@pytest.mark.parametrize(
    "type_",
    [
        f"{{auto: {{{REGION}}}}}",
        f"{{slope: [0.571, 2.521], {REGION}}}",
        f"{{jacobian: [0.571, 2.521], {REGION}}}",
        f"{{sector: {{K1: 0.571, K2: 2.521}}, {REGION}}}",
        f"{{multiplier: [[-2.878982, 3.092], [3.092, -2]], {REGION}}}",
    ],
)
def test_a_free_injection_is_found_for_any_slope_that_is_never_zero(tmp_path, type_):
    code, output, content = solved(tmp_path, BATTERY.format(type=type_, family="l2", more=""))
    assert code == 0, output
    assert content["guarantee"]["limit"]["gamma"] == pytest.approx(0.0179542, rel=2e-3)


def test_a_free_injection_of_the_other_family_is_found_too(tmp_path):
    spec = BATTERY.format(type=f"{{auto: {{{REGION}}}}}", family="linf", more=", bounds: {L1: 10}")
    code, output, content = solved(tmp_path, spec)
    assert code == 0, output
    assert content["observer"]["L2"] != [[0]]


@pytest.mark.parametrize("slopes", ["cone: [1]", "cone: [2, 3]", "slope: [0, .inf]"])
def test_a_cone_of_one_number_is_a_slope_without_an_upper_bound(tmp_path, slopes):
    spec = VAN_DER_POL.format(D="0, 0", type=f"{{{slopes}}}", Dq="", L2=", L2: free, bounds: {L1: 50}")
    code, output, _ = solved(tmp_path, spec)
    assert code == 0, output


def test_a_type_of_several_scales_says_so_and_what_has_one(tmp_path):
    (tmp_path / "s.yaml").write_text(
        "obsdesign: 1\nsystem: {A: [[-1, 0], [0, -1]], B: [1, 0], C: [1, 0]}\nnonlinearities:\n"
        "  - {type: {jacobian: [[[1, 0]], [[0, 1]]]}, Bf: [1, 0], Cq: [[1, 0], [0, 1]]}\n"
        "observer: {type: l2, alpha: 0.1, L2: free}\n"
    )
    outcome = run("solve", tmp_path / "s.yaml")
    assert outcome.exit_code == 2
    assert "the type of f1 has M1_11, M1_12, M1_22; a ball around it" in outcome.stderr


@pytest.mark.parametrize("L2", ["", ", L2: free", ", L2: 0", ", L2: -2"])
def test_noise_in_y_is_named_where_it_forbids_the_injection_that_a_steep_f_needs(tmp_path, L2):
    spec = VAN_DER_POL.format(D="0, 0.1", type="monotone", Dq="", L2=L2)
    code, output, content = solved(tmp_path, spec)
    assert code == 3
    assert "Dq + L2 D = 0, where the noise in y leaves only L2 = [[0]]" in content["diagnosis"]["reason"]
    assert "leave noise out of y (D = 0)" in content["diagnosis"]["suggestion"]
    assert ("D = 0) with `L2: free`, with which" in output) == (L2 in ("", ", L2: 0"))
    assert "another type" not in output
    assert run("check", tmp_path / "s.yaml").exit_code == 3
    free = ", L2: free" if "with `L2: free`" in output else L2
    for followed, done in ((free, 0), (L2, 0 if free == L2 else 3)):
        quiet = VAN_DER_POL.format(D="0, 0", type="monotone", Dq="", L2=f"{followed}, bounds: {{L1: 1000}}")
        assert solved(tmp_path, quiet)[0] == done


def test_what_v_does_at_once_to_the_argument_of_a_steep_f_is_named(tmp_path):
    spec = VAN_DER_POL.format(D="0, 0", type="monotone", Dq=", Dq: [1, 0]", L2=", L2: free")
    code, _, content = solved(tmp_path, spec)
    assert code == 3
    assert "no L2 makes it so: v reaches its argument at once" in content["diagnosis"]["reason"]


@pytest.mark.parametrize("noise", [True, False])
def test_no_injection_is_advised_where_none_can_change_what_a_steep_f_needs(noise):
    """Of a chain f acts between states that y does not show at once: C Bf = 0."""
    spec = od.Spec(
        system={
            "A": [[0, 1, 0, 0], [-2, -0.1, 1, 0], [0, 0, 0, 1], [1, 0, -1, -0.1]],
            "B": [[0, 0], [0, 0], [0, 0], [1, 0]],
            "C": [[1, 0, 0, 0]],
            **({"D": [[0, 0.01]]} if noise else {}),
        },
        nonlinearities=[{"type": {"slope": [0, float("inf")]}, "f": "q**3", "Bf": [0, 1, 0, -1], "Cq": [-1, 0, 1, 0]}],
        observer={"type": "l2", "L2": "free", "alpha": 0.01},
    )
    found = od.solve(spec).diagnosis
    assert found["suggestion"].startswith("bound the slope of f")
    assert "(D = 0)" not in found["suggestion"]
