"""What the structure allows."""

from obsdesign.families.finding import detectability
from obsdesign.lmi.formula import in_floats


def check(spec, _):
    """Modes that no output shows."""
    return detectability(spec.augmented.doubles, in_floats(spec.multiplier.member), 0.0, "0")
