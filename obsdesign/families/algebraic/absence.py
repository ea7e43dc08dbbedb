"""Refutations of observers without an LMI, proved anew."""

from obsdesign.families.algebraic.claim import refutation
from obsdesign.families.outcome import Proof, Verdict
from obsdesign.files import ResultFile
from obsdesign.spec import Spec


def read(spec: Spec, file: ResultFile) -> Proof:
    """Proof that an observer is none. Raises `UsageError`: the file is of coordinates that were not found."""
    if file.status == Verdict.INFEASIBLE:
        raise file.wrong("diagnosis", "holds no certificate, so there is nothing to be verified", id="OBS706")
    return refutation(spec, file)
