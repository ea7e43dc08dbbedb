"""Exact proofs that the inequalities of a family have no solution."""

from collections.abc import Mapping
from typing import Any

from flint import fmpq

from obsdesign.dissipation.inequality import Incremental
from obsdesign.families.incremental.claim import require_alpha
from obsdesign.families.incremental.request import request_of
from obsdesign.families.incremental.theorems import THEOREMS
from obsdesign.families.outcome import Diagnosis, Proof
from obsdesign.files import ResultFile
from obsdesign.lmi.faces import refutation
from obsdesign.lmi.farkas import Refutation, check
from obsdesign.lmi.formula import Array, Unknown, Values, approximate, printed, rational
from obsdesign.lmi.proof import Formula
from obsdesign.spec import Spec


def question(family: Incremental, gamma: fmpq | None = None) -> tuple[Formula, tuple[Unknown, ...]]:
    """Inequalities of a family for a gamma, or (None) for any, and their unknowns: what a refutation refutes.

    `family`: in rationals, with L2; L1 may be given.
    """
    p, free = family.plant, [Unknown("mu", (1, 1))] if gamma is None else []
    gains = [Unknown("Y", p.C.mT.shape)] if family.L1 is None else []

    def formula(v: Values) -> Any:
        level = family.weights(v["mu"] if gamma is None else rational([[gamma * gamma]]))
        exact = {name: mu if mu.dtype == object else rational(mu) for name, mu in level.items()}
        return family.theorem({**v, **exact})

    return formula, (Unknown("P", p.A.shape, symmetric=True), *gains, *family.multiplier.unknowns(), *free)


def refuted(family: Incremental, gamma: fmpq | None, multipliers: Mapping[str, Array]) -> Refutation:
    """Decide, with no solver, whether the multipliers of a certificate prove that a family has no solution."""
    return check(*question(family, gamma), multipliers)


def absence(family: Incremental, known: dict[str, Any]) -> Diagnosis:
    """`proof` and, where it is exact, `certificate`: not for bounds, nor where the design has L2 to choose as well."""
    if family.L2 is None or "bounds" in known:
        return {"proof": "numerical"}
    gamma = printed(known["gamma"]["asked"]) if "gamma" in known else None
    found = refutation(*question(family, gamma))
    if found is None:
        return {"proof": "numerical"}
    level = {} if gamma is None else {"gamma": str(gamma)}
    return {"proof": "exact", "certificate": {**found.written(), "alpha": str(family.alpha), **level}}


def read(spec: Spec, file: ResultFile) -> Proof:
    """Prove anew that an infeasible result has no solution, and say what is proved.

    Raises `UsageError`: the file holds no dual certificate: its verdict is numerical or structural; or it is malformed.
    """
    root = ("diagnosis", "certificate")
    request, alpha = request_of(spec).printed(), file.number(*root, "alpha")
    require_alpha(file, request, alpha, "diagnosis.certificate.alpha")
    given = {"L1": None, "L2": request.L2} | dict(request.gains or {})
    family = THEOREMS[request.type](spec.augmented, spec.multiplier, spec.H, alpha, given["L1"], given["L2"])
    if family.L2 is None:
        raise file.wrong("diagnosis.certificate", "a certificate is for a given L2, and the spec leaves it free")
    gamma = file.number(*root, "gamma") if "gamma" in file.table(*root) else None
    refutation = refuted(family, gamma, file.matrices(*root, "multipliers"))
    level = "" if gamma is None else f" and gamma = {approximate(gamma):g}"
    words = f"Theorem 1 has no solution at alpha = {approximate(alpha):g}{level}, nor at a larger alpha"
    return Proof(words, refutation.checks)
