"""The least gamma that central gains are proved to reach: where neither inequalities nor equations tell the limit.

Of an ill-conditioned plant the largest P is all but singular at the limit, and doubles do not tell where it ends. Above
it there are central gains all the same, and the proof of one in rationals asks no double. So gamma is lowered as long
as one is proved: an upper bound of the limit, and a gain that has it.
"""

import math

from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.certificate import Certificate
from obsdesign.dissipation.decimals import round_up
from obsdesign.dissipation.elimination import form_of, proved_central
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import sizes
from obsdesign.dissipation.inequality import Incremental
from obsdesign.dissipation.scan import edge, strides
from obsdesign.lmi.formula import in_floats
from obsdesign.riccati.form import UnclearError

START = 1e6  # times the size of gamma by the data of the plant, from where it is lowered or raised
STEP, STEPS = 1e-2, 12  # of gamma, down as long as a central gain is proved or up until one is
CLOSE = 0.02  # relative, to which the least is found
DIGITS = 6  # of gamma


def told(engine: Engine, family: Incremental) -> bool:
    """Whether central gains of a family may be tried: it has no scales, whose least gamma is not known here."""
    return engine.equations and not family.multiplier.unknowns() and form_of(in_floats(family)) is not None


def least_proved(engine: Engine, family: Incremental, bounds: Bounds) -> float | None:
    """About the least gamma that a central gain is proved to reach; None where none is proved, or it has no end.

    `family`: in rationals, without f; `bounds`: of the spec on P and on the poles.
    """
    if not told(engine, family):
        return None
    start = START * sizes(in_floats(family))[1]

    def holds(gamma: float) -> bool:
        return proved(engine, family, gamma, bounds) is not None

    inside, outside = strides(holds, start, STEP, STEPS)
    return None if inside is None or outside is None else round_up(edge(holds, inside, outside, CLOSE), DIGITS)


def proved(engine: Engine, family: Incremental, gamma: float, bounds: Bounds) -> Certificate | None:
    """Certificate of a central gain for a gamma; None where none is proved."""
    if not math.isfinite(gamma):
        return None
    try:
        return proved_central(engine, family, gamma, bounds)
    except UnclearError:
        return None
