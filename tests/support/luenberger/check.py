"""What the structure allows."""

from obsdesign.dissipation.pace import Pace
from obsdesign.families.finding import detectability
from obsdesign.lmi.formula import in_floats
from obsdesign.model.edge import Edge


def check(spec, _):
    """Modes that no output shows."""
    return detectability(spec.augmented.doubles, in_floats(spec.multiplier.member), Edge(0.0), Pace("0"))
