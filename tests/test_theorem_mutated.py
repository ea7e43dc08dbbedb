"""The kernel of Coq and the proof in rationals come to one verdict of claims whose numbers are changed."""

import re
import subprocess
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from flint import fmpq
from support.coq import compiled_library, needs_coq
from support.shipped import solved
from support.sweep import SWEEP, rng

from obsdesign.coq import bounds, course, hulls, theorem
from obsdesign.coq.congruence import congruence, integers
from obsdesign.coq.library import QUIET
from obsdesign.dissipation.certificate import certify

NAMES = ("corless2019-magnetic-bearing", "chakrabarty2016-cubic", "planar-arm", "discrete-drift", "discrete-peak")
UNSTATED = "gamma >= 0|mu1 > 0|q = c"  # gamma^2 is meant; the theorem takes trajectories as they are
FACTORS = ("0", "-1", "999/1000", "1001/1000", "11/10", "9/10", "100", "1/100", "1000001/1000000")


def or_none(S):
    """T, or the identity for a matrix that has none."""
    try:
        return congruence(S)
    except ValueError:
        return [[1] + [0] * (len(integers(S)) - 1 - j) for j in range(len(S))]


def changed(array, draw):
    """Array with one entry multiplied."""
    made = array.copy()
    place = tuple(draw.integers(0, size) for size in made.shape)
    factor = Fraction(draw.choice(FACTORS))
    made[place] = made[place] * fmpq(factor.numerator, factor.denominator)
    symmetric = array.ndim == 2 and array.shape[0] == array.shape[1] and (array == array.T).all()
    return (made + made.T) / 2 if symmetric else made


def mutated(certificate, draw):
    """Certificate with one number changed, and what is proved of it in rationals."""
    family = certificate.family
    parts = {
        **{key: getattr(certificate, key) for key in ("gamma", "mu1", "mu2")},
        "P": certificate.P,
        **{f"plant.{key}": getattr(family.plant, key) for key in ("A", "Bf", "B", "C", "Cq", "D")},
        **{f"family.{key}": getattr(family, key) for key in ("L1", "L2", "H", "rate")},
        **{f"multipliers.{key}": value for key, value in certificate.multipliers.items()},
    }
    key = str(draw.choice([key for key, value in parts.items() if np.size(value)]))
    value = changed(np.atleast_1d(parts[key]) if np.ndim(parts[key]) == 0 else parts[key], draw)
    value = value.item() if np.ndim(parts[key]) == 0 else value
    where, _, name = key.rpartition(".")
    if where == "plant":
        certificate = replace(certificate, family=replace(family, plant=replace(family.plant, **{name: value})))
    elif where == "family":
        certificate = replace(certificate, family=replace(family, **{name: value}))
    elif where == "multipliers":
        certificate = replace(certificate, multipliers={**certificate.multipliers, name: value})
    else:
        certificate = replace(certificate, **{name: value})
    c = certificate
    checks = certify(c.family, c.gamma, c.mu1, c.mu2, {**c.multipliers, "P": c.P}).checks
    return c, all(check.holds for check in checks if not re.match(UNSTATED, check.name))


@pytest.mark.slow
@needs_coq
def test_the_kernel_accepts_what_is_proved_in_rationals_and_nothing_else(tmp_path, monkeypatch):
    monkeypatch.setattr(theorem, "congruence", or_none)
    monkeypatch.setattr(hulls, "congruence", or_none)
    monkeypatch.setattr(bounds, "congruence", or_none)
    compiled_library(tmp_path)
    draw = rng(17)
    written, expected = [], []
    for name in NAMES:
        spec, design = solved(name)
        certificate = design.claim.certificate
        over = course.PREDICTED if certificate.family.about.pace.sampled else course.CONTINUOUS
        for _ in range(SWEEP.size(16)):
            one, proved = mutated(certificate, draw)
            text, _ = theorem.written(theorem.Claimed(one, one.family.plant, over), spec)
            head, body = text.split("Open Scope Q_scope.", 1)
            claim = re.search(r"Lemma proved : (.*) = true\.", body)[1]
            data = body[: body.index("Lemma proved")]
            prelude = head.replace("From Obs Require Import ", "From Obs Require Import ObsSamples ")
            written += [] if written else [prelude]
            module = f"V{len(expected)}"
            written.append(f"Module {module}.\nOpen Scope Q_scope.{data}\nEval vm_compute in ({claim}).\nEnd {module}.")
            expected.append(proved)
    (tmp_path / "All.v").write_text("\n".join(written))
    call = ["coqc", *QUIET.split(), "-Q", ".", "Obs", "All.v"]
    found = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, timeout=500, check=False)
    assert found.returncode == 0, found.stderr
    verdicts = [word == "true" for word in re.findall(r"= (true|false)", found.stdout)]
    assert verdicts == expected
    assert 0.1 < np.mean(expected) < 0.9
