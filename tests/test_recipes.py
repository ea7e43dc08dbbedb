"""What the manual says of adding to it, done: registered and nothing else changed."""

import json
from pathlib import Path

import numpy as np
import pytest
from flint import fmpq
from support.commands import files, run
from support.luenberger.request import LuenbergerRequest
from support.wrong_specs import problem_of

from obsdesign.families import FAMILIES, Family
from obsdesign.lmi.formula import block_diagonal, rational
from obsdesign.model.multiplier import Multiplier, Scaled
from obsdesign.nonlinearities import TEMPLATES, Template
from obsdesign.nonlinearities.data import Constant
from obsdesign.reading import json_schema, loads
from obsdesign.work import solve

SPEC = """\
obsdesign: 1
system: {A: [[0, 1], [-2, -1]], B: [[0, 0], [1, 0]], C: [1, 0], D: [0, 1]}
nonlinearities:
  - {type: TYPE, f: 0.5*sin(q), Bf: [0, 1], Cq: [1, 0]}
observer: {type: l2, alpha: 0.2}
"""


def banded(k, nq, nf):
    """|df| <= k |dq|:  M = lambda [[k^2 I, 0], [0, -I]]."""
    M = block_diagonal([k * k * rational(np.eye(nq)), -rational(np.eye(nf))])
    return Multiplier((Scaled.of(M, nq),))


@pytest.fixture
def _a_nonlinearity(monkeypatch):
    words = (("k^2 dq' dq - df' df", fmpq(1)),)
    template = Template(banded, Constant("norm(df) <= banded norm(dq)", "> 0"), square=False, inequalities=words)
    monkeypatch.setitem(TEMPLATES, "banded", template)


def of_type(text):
    return SPEC.replace("TYPE", text)


@pytest.mark.usefixtures("_a_nonlinearity")
def test_a_nonlinearity_with_data_is_read_and_designed_with():
    spec = loads(of_type("{banded: 1/2}"))
    (block,) = spec.nonlinearities
    assert (block.type, block.nq, block.lipschitz) == ("banded 1/2", 1, ())
    assert (fmpq(1, 4) == spec.multiplier.blocks[0].M11).all()
    own, known = (solve(loads(of_type(text))) for text in ("{banded: 0.5}", "{lipschitz: 0.5}"))
    assert (own.claim.certificate.gamma, own.status) == (known.claim.certificate.gamma, known.status)


@pytest.mark.usefixtures("_a_nonlinearity")
@pytest.mark.parametrize(
    ("text", "name", "words"),
    [
        ("{banded: 0.25}", "type", ("banded 0.25 is refuted", "k^2 dq' dq - df' df = -")),
        ("{banded: -1}", "type.banded", ("give a number > 0",)),
        ("{banded: [1]}", "type.banded", ("expected a number or arithmetic; found a list",)),
        ("{banded: auto}", "type.banded", ("auto",)),
        ("banded", "type", ("banded needs data: {banded: ..}",)),
        ("{bandet: 1}", "type.bandet", ("did you mean banded?", "multiplier, banded, auto")),
    ],
)
def test_what_is_wrong_with_it_is_answered_like_any_other_type(text, name, words):
    problem = problem_of(of_type(text))
    assert problem.key == f"nonlinearities[0].{name}"
    assert all(part in problem.message for part in words), problem.message


@pytest.mark.usefixtures("_a_nonlinearity")
def test_the_json_schema_knows_the_nonlinearity():
    schema = json_schema()["$defs"]["TypeData"]["properties"]
    assert schema["banded"] == {"type": ["number", "string"], "description": "norm(df) <= banded norm(dq)"}


@pytest.fixture
def _a_family(monkeypatch):
    monkeypatch.setitem(FAMILIES, "luenberger", Family(("luenberger",), "support.luenberger"))


def asked(text):
    return of_type("sin").replace("0.5*sin(q)", "sin(q)").replace("{type: l2, alpha: 0.2}", text)


@pytest.mark.usefixtures("_a_family")
def test_a_family_reads_its_own_section():
    spec = loads(asked("{type: luenberger, poles: -2}"))
    assert spec.observer == LuenbergerRequest("luenberger", fmpq(-2))
    schema = json_schema()
    assert {"$ref": "#/$defs/LuenbergerSection"} in schema["properties"]["observer"]["oneOf"]
    section = schema["$defs"]["LuenbergerSection"]
    assert (set(section["properties"]), section["required"]) == ({"type", "poles", "speed"}, ["type", "poles"])
    assert section["properties"]["type"]["enum"] == ["luenberger"]


@pytest.mark.usefixtures("_a_family")
@pytest.mark.parametrize(
    ("text", "name", "words"),
    [
        ("{type: luenberger}", "poles", "is required"),
        ("{type: luenberger, poles: 2}", "poles", "must not be positive, for 2 states"),
        ("{type: luenberger, poles: -2, speed: -1}", "speed", "give a number > 0"),
        ("{type: luenberger, poles: -2, alpha: 1}", "alpha", "does not belong to type luenberger, but to l2 or linf"),
        ("{type: l2, speed: 1}", "speed", "does not belong to type l2 or linf, but to luenberger"),
        ("{type: luenbergr, poles: -2}", "type", "did you mean luenberger? allowed: l2, linf, sporadic, lipschitz"),
    ],
)
def test_what_is_wrong_with_its_section_is_answered_like_any_other(text, name, words):
    problem = problem_of(asked(text))
    assert problem.key == f"observer.{name}"
    assert words in problem.message


LINEAR = """\
obsdesign: 1
name: Cart
system: {A: [[0, 1], [-2, -1]], B: [[0], [1]], C: [1, 0]}
nonlinearities:
  - {type: sin, Bf: [0, 0.1], Cq: [1, 0]}
observer: {type: luenberger, poles: POLES}
simulation: {horizon: 5, x0: [1, 0], w: ["exp(-t)"]}
"""


@pytest.mark.usefixtures("_a_family")
def test_a_family_is_solved_verified_and_simulated_by_the_command_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("cart.yaml").write_text(LINEAR.replace("POLES", "-3"))
    solved = run("solve", "cart.yaml", "--simulate")
    assert solved.exit_code == 0, solved.output
    assert "decay rate" in solved.stdout
    assert "VIOLATED" not in solved.stdout
    assert solved.stdout.count("holds: ") == 4
    assert files() == ["cart.gains.json", "cart.run.csv", "cart.run.png", "cart.yaml"]
    assert Path("cart.run.csv").read_text().startswith("t,x1,x2,hat_x1,hat_x2,")
    assert run("check", "cart.yaml").exit_code == 0
    assert run("verify", "cart.gains.json").exit_code == 0
    content = json.loads(Path("cart.gains.json").read_text())
    content["guarantee"]["gamma"] /= 2
    Path("cart.gains.json").write_text(json.dumps(content))
    assert run("verify", "cart.gains.json").exit_code == 4


@pytest.mark.usefixtures("_a_family")
def test_a_family_says_why_it_has_no_gains(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = LINEAR.replace("POLES", "-0.01").replace("Bf: [0, 0.1]", "Bf: [0, 40]")
    Path("cart.yaml").write_text(text)
    assert run("solve", "cart.yaml").exit_code == 3
    assert "nothing is proved of poles at -0.01" in Path("cart.gains.json").read_text()
    refused = run("verify", "cart.gains.json")
    assert (refused.exit_code, refused.stderr.count("\n")) == (2, 1)
    assert "holds no certificate" in refused.stderr
