"""Proves a result file anew: from its spec, its gains and its witness, in rationals, with no solver."""

import numpy as np

from obsdesign.dissipation.certificate import Certificate
from obsdesign.families.guarantee import Guarantee
from obsdesign.families.incremental import verify as incremental
from obsdesign.families.incremental.request import Request
from obsdesign.families.lipschitz import verify as lipschitz
from obsdesign.families.lipschitz.request import LipschitzRequest
from obsdesign.families.sporadic import verify as sporadic
from obsdesign.families.sporadic.certificate import SporadicCertificate
from obsdesign.families.sporadic.request import SporadicRequest
from obsdesign.files.read import Proof, ResultFile, Verified
from obsdesign.lmi.formula import Array, approximate
from obsdesign.spec import Spec

__all__ = ["Proof", "ResultFile", "prove", "recorded", "verify"]

GAINS = {Request: incremental.read_gains, LipschitzRequest: lipschitz.read_gains, SporadicRequest: sporadic.read_gains}
CLAIMS = {Request: incremental.verified, LipschitzRequest: lipschitz.verified, SporadicRequest: sporadic.verified}


def prove(path: str, spec: Spec | None = None) -> Proof:
    """Prove the claim of a result file anew: its guarantee, or that there is no solution.

    Raises
    ------
    UsageError
        If the file claims nothing that can be proved, is malformed, or belongs to another spec.
    """
    file = opened(path, spec)
    if file.at("status") == "infeasible":
        claim, refutation = incremental.verify_absence(file)
        return Proof(claim, refutation.checks)
    return verified(file)


def verify(path: str, spec: Spec | None = None) -> tuple[ResultFile, Certificate | SporadicCertificate]:
    """Prove the guarantee of a result file anew.

    Parameters
    ----------
    path
        The result file.
    spec
        The spec that it must belong to; without one, the spec in the file is believed.

    Raises
    ------
    UsageError
        If the file is no certified result, is malformed, or belongs to another spec.
    """
    file = opened(path, spec)
    return file, verified(file).certificate


def recorded(path: str, spec: Spec | None) -> tuple[Spec, dict[str, Array], Guarantee | None]:
    """Spec, gains in doubles, and guarantee of a result file; None where nothing is claimed, or proved.

    Raises
    ------
    UsageError
        If the file is malformed, has no gains, or belongs to another spec.
    """
    file = opened(path, spec)
    if file.at("status") == "infeasible":
        raise file.wrong("status", "infeasible: this result has no gains")
    gains = GAINS[type(file.spec.observer)](file)
    guarantee = None
    if file.at("status") == "certified":
        made = verified(file)
        guarantee = made.guarantee if made.holds else None
    doubles = {name: np.vectorize(approximate, otypes=[float])(gain) for name, gain in gains.items()}
    for name, gain in doubles.items():
        if not np.isfinite(gain).all():
            raise file.wrong(f"observer.{name}", "beyond the range of doubles")
    return file.spec, doubles, guarantee


def opened(path: str, spec: Spec | None) -> ResultFile:
    """Read a result file, which must belong to the spec if one is given."""
    file = ResultFile(path)
    if spec is not None and spec.text != file.spec.text:
        raise file.wrong("spec.sha256", f"these gains belong to another spec than {spec.path}")
    return file


def verified(file: ResultFile) -> Verified:
    """Claim of a file that says it is certified, checked."""
    if file.at("status") != "certified":
        raise file.wrong("status", f"{file.at('status')!r} claims nothing; only a certified result can be verified")
    return CLAIMS[type(file.spec.observer)](file)
