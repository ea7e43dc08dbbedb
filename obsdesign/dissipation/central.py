"""The least gamma that central gains are proved to reach: where neither inequalities nor equations tell the limit.

Of an ill-conditioned plant the largest P is all but singular at the limit, and doubles do not tell where it ends. Above
it there are central gains all the same, and the proof of one in rationals asks no double. So gamma is lowered as long
as one is proved: an upper bound of the limit, and a gain that has it.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.certificate import Certificate, certify
from obsdesign.dissipation.decimals import round_up, significant, square_below
from obsdesign.dissipation.elimination import central_gains, form_of
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.inequality import ONE, Incremental
from obsdesign.dissipation.scan import edge, strides
from obsdesign.lmi.equilibrate import units
from obsdesign.lmi.formula import Array, Float, Values, in_floats, printed
from obsdesign.lmi.proof import rounded
from obsdesign.riccati.central import sizes, solution
from obsdesign.riccati.form import UnclearError

START = 1e9  # times the size of gamma by the data of the plant, from where it is lowered or raised
STEP, STEPS = 1e-2, 12  # of gamma, down as long as a central gain is proved or up until one is
CLOSE = 0.02  # relative, to which the least is found
DIGITS = 6  # of gamma
OF_GAIN, OF_P = (6, 8, 12), (12, 15, 17)  # digits
ON_STATES, ON_OUTPUTS = 1e-4, (0.0, 1e-2)  # noises with which scales are tried
DECADES = (0, -1, 1, -2, 2, -3, 3)  # of 100: scales of multipliers that are tried, times what the data suggest
MOST, KEPT = 2, 4  # scales of a family, and choices of them that are kept
BREAKDOWN = (UnclearError, np.linalg.LinAlgError, ValueError, OverflowError)  # the last two of numbers beyond doubles
Scales = dict[str, Array]


def scaled(family: Incremental) -> Iterator[Float]:
    """Scales with which there is a solution for a large gamma, per mu, those that the data suggest first.

    `family`: in doubles. What f_j does is weighed against what v does: lambda_j = mu (|Bf_j| / |B|)^2 by the data.
    """
    names, p = family.multiplier.unknowns(), family.plant
    try:
        form = form_of(family) if len(names) <= MOST and p.B.shape[1] else None
        if form is None or len(form.Qs) != len(names):
            return
        ends = np.cumsum([0, *(block.nf for block in family.multiplier.blocks)])
        if len(ends) != len(names) + 1:
            return
        acts = np.array([np.linalg.norm(p.Bf[:, a:b]) for a, b in pairwise(ends)])
        data, mu = (acts / (np.linalg.norm(p.B) or 1.0)) ** 2, largest(family) ** 2
        weight = 1.0 if family.about.peak else mu
        for powers in sorted(product(DECADES, repeat=len(names)), key=lambda tried: sum(map(abs, tried))):
            chosen = np.where(data > 0, data, 1.0) * 100.0 ** np.array(powers, dtype=float)
            balanced, _ = form.scaled(weight * chosen).balanced()
            on_states, on_outputs = sizes(balanced)
            for outputs in ON_OUTPUTS:
                noisy = balanced.noisy(np.full(form.n, ON_STATES * on_states), outputs * on_outputs)
                with np.errstate(all="ignore"):
                    solved = solution(noisy, weight, lambda _: True) is not None
                if solved:
                    yield chosen
                    break
    except BREAKDOWN:
        return


def largest(family: Incremental) -> float:
    """Gamma from where it is lowered or raised: far above its size by the data."""
    return START * float(np.sqrt(units(family.least_gamma())["mu"].item()))


@np.errstate(all="ignore")
def least_proved(engine: Engine, family: Incremental, bounds: Bounds) -> tuple[float, Scales] | None:
    """About the least gamma that a central gain is proved to reach, and its scales, by name and for mu1 = 1.

    None where none is proved, or gamma has no end. `family`: in rationals; `bounds`: on P and on the poles.
    """
    fixed = in_floats(family)
    if not engine.equations or form_of(fixed) is None:
        return None
    names = [unknown.name for unknown in family.multiplier.unknowns()]
    choices = [np.zeros(0)] if not names else [s for s, _ in zip(scaled(fixed), range(KEPT), strict=False)]
    found: dict[float, Scales] = {}

    def holds(gamma: float) -> bool:
        for chosen in choices:
            weight = 1.0 if family.about.peak else gamma**2
            scales = {n: printed(significant(weight * s * ONE, DIGITS)) for n, s in zip(names, chosen, strict=True)}
            if proved(engine, family, gamma, bounds, scales) is not None:
                found[gamma] = scales
                return True
        return False

    inside, outside = strides(holds, largest(fixed), STEP, STEPS) if choices else (None, None)
    if inside is None or outside is None:
        return None
    least = edge(holds, inside, outside, CLOSE)
    return round_up(least, DIGITS), found[least]


@np.errstate(all="ignore")
def proved(engine: Engine, family: Incremental, gamma: float, bounds: Bounds, scales: Values) -> Certificate | None:
    """Certificate of the first central gain that is proved to reach gamma; None where none is.

    `family`: in rationals; `bounds`: on P and on the poles; `scales`: by name, in rationals and for mu1 = 1.
    """
    if not engine.equations:
        return None
    level, mu = printed(gamma), square_below(printed(gamma))
    chosen = np.array([float(scale.item()) for scale in scales.values()])
    try:
        for found in central_gains(family, gamma, chosen):
            for digits, of_P in zip(OF_GAIN, OF_P, strict=True):
                values = {**rounded({"P": found.P}, of_P), **scales}
                candidate = replace(family, L1=printed(significant(found.L, digits)))
                certificate = certify(candidate, level, fmpq(1), mu, values, bounds)
                if certificate.holds:
                    return certificate
    except BREAKDOWN:
        pass
    return None
