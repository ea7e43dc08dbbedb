"""What a design for a plant in samples says of the continuous plant that it stands for."""

from typing import Any

from flint import arb

from obsdesign.dissipation.certificate import Certificate
from obsdesign.lmi.formula import above
from obsdesign.lmi.spectrum import upper
from obsdesign.spec import MODEL, Spec

PLACE = "the error at the samples of the continuous plant is at most {error} = gamma sqrt({count}), from zero error"
WHERE = (
    "as long as every channel of {v} is within [-1, 1], |q'| <= {q_rate}{w_rate}, known inputs are constant over each "
    "period, and the matrices of the hold are exact"
)


def at_samples(spec: Spec, certificate: Certificate) -> dict[str, Any]:
    """Bound on |z_k| of the continuous plant at the samples, proved of an L-infinity design with the defect in v.

    The defect, of length `defect` at most, is one more channel of length 1: |v|^2 <= count, the channels of v and one.
    """
    known, n = spec.continuous, spec.plant.n
    assert known is not None
    assert known.defect is not None
    channels = spec.posed.B.shape[1] - (n if known.defect else 0)
    count = channels + 1
    error = upper(arb(certificate.gamma) * arb(count).sqrt())
    q_rate, w_rate = map(above, known.rates)
    moving = f", what of w acts on the states is absolutely continuous with |w'| <= {w_rate!r}" if w_rate else ""
    where = WHERE.format(v="v" if len(spec.generator.Am) else "w", q_rate=repr(q_rate), w_rate=moving)
    provisos = (proviso for proviso in spec.provisos if proviso != MODEL)
    said = "; ".join([PLACE.format(error=repr(error), count=count), where, *provisos])
    return {"defect": above(known.defect), "error": error, "statement": said}
