"""What a spec allows an observer whose measurements arrive sporadically."""

from obsdesign.dissipation.bounds import ends
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.pace import Pace
from obsdesign.families.finding import Finding, detectability, finding
from obsdesign.families.sporadic.reasons import hiding_interval
from obsdesign.families.sporadic.request import request_of
from obsdesign.lmi.formula import in_floats
from obsdesign.model.edge import Edge
from obsdesign.spec import Spec


def check(spec: Spec, _: Engine) -> list[Finding]:
    """Detectability at the decay that is asked for, and intervals that hide modes."""
    request = request_of(spec)
    plant, multiplier = spec.augmented, spec.multiplier
    decay, T2 = (float(ends(v)[0]) for v in (request.decay, request.T2))
    hiding = hiding_interval(plant, multiplier, decay, max(T2, float(request.T1)))
    seen = f"no interval up to T2 = {T2:g} hides the difference of two modes"
    seen += " with f = K q at the ends of the types" if multiplier.blocks else ""
    return [
        *detectability(plant.doubles, in_floats(multiplier.member), Edge(decay), Pace("lambda_t")),
        finding("sampling", not hiding, hiding.get("reason", seen), decides=True, id="OBS610"),
    ]
