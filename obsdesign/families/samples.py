"""What a result says of samples, whatever the family: which estimate they give, how far apart they are, and gamma of v.

The inequality of filtered estimates is about (v_b at k, v_d at k + 1), b the channels that act on x, d those in y.
"""

from typing import Any, Literal

from flint import arb, fmpq

from obsdesign.families.rates import ESTIMATES
from obsdesign.files import ResultFile
from obsdesign.lmi.formula import above, printed
from obsdesign.lmi.spectrum import upper
from obsdesign.model.filtered import gain_of
from obsdesign.spec import Spec


def written(spec: Spec) -> dict[str, Any]:
    """Entries `estimate` and `period` (s) of an observer; none in continuous time."""
    if spec.period is None:
        return {}
    return {"estimate": ESTIMATES[spec.observer.filtered], "period": float(spec.period)}


def require(spec: Spec, file: ResultFile) -> None:
    """Hold these entries against what the spec asks for."""
    if spec.period is None:
        return
    if file.at("observer", "estimate") != ESTIMATES[spec.observer.filtered]:
        raise file.wrong("observer.estimate", f"the spec asks for {ESTIMATES[spec.observer.filtered]}", id="OBS707")
    if file.number("observer", "period") != printed(spec.period):
        raise file.wrong("observer.period", f"the spec says {float(spec.period)!r} s", id="OBS707")


def gamma_of_v(spec: Spec, gamma: fmpq, norm: Literal["norm2", "sup"]) -> float:
    """Gamma of v itself that follows from gamma of the inequality, rounded up: of filtered estimates it may be more."""
    square = gain_of(spec.augmented, peaks=norm == "sup") if spec.observer.filtered else 1
    return above(gamma) if square == 1 else upper((arb(gamma) * arb(gamma) * square).sqrt())
