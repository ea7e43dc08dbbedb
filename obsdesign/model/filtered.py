"""Filtered estimates, xhat_k that know y_k, as predicted ones of another plant.

With  xbar = A xhat + Bf f(qhat) + gx,  yhat = C xbar + gy+,  xhat+ = xbar + L1 (yhat - y+)  the errors follow the
equations of a predicted observer, with C A in place of C, C Bf of Df, and [C B_b, D_d] of D for v = (v_b at k, v_d at
the next sample): b are the channels of v that B or Dq have, and d those of D. A channel in both is in v twice.

It needs Df = 0. Where Df = 0 and C Bf != 0 the observer solves an equation for qhat although the plant is explicit.
"""

from dataclasses import replace

import numpy as np

from obsdesign.lmi.formula import Array, Exact, zeros
from obsdesign.model.ahead import ahead
from obsdesign.model.plant import Plant


def channels(plant: Plant[Exact]) -> tuple[Array, Array]:
    """Channels of v that B or Dq have, and those of D, as masks (nv,); one that does nothing is of the former."""
    late = (plant.D != 0).any(axis=0)
    soon = (plant.B != 0).any(axis=0) | (plant.Dq != 0).any(axis=0)
    return soon | ~late, late


def apart(plant: Plant[Exact]) -> Plant[Exact]:
    """The same plant whose v holds the channels of B and Dq at k, and those of D, which act on y, at k + 1."""
    now, late = channels(plant)
    names, count = np.array(plant.exogenous, dtype=object), int(late.sum())

    def beside(X: Array) -> Array:
        return np.hstack([X[:, now], zeros((len(X), count), [plant.A])])

    return replace(
        plant,
        B=beside(plant.B),
        Dq=beside(plant.Dq),
        D=np.hstack([zeros((len(plant.C), int(now.sum())), [plant.A]), plant.D[:, late]]),
        exogenous=(*names[now], *map(ahead, names[late])),
    )


def filtered(plant: Plant[Exact]) -> Plant[Exact]:
    """Plant whose predicted estimates have the errors that filtered estimates of a plant with Df = 0 have."""
    p = apart(plant)
    return replace(p, C=p.C @ p.A, Df=p.C @ p.Bf, D=p.C @ p.B + p.D)


def gain_of(plant: Plant[Exact], peaks: bool) -> int:
    """Square of what the gain of the inequality is multiplied by for v itself: 1 or 2.

    In energy 2 where a channel is in v twice. In peaks, where |v_k| is that of one sample, 2 as soon as v has channels
    of both samples: for them sup|(v_b at k, v_d at k + 1)|^2 <= sup|v_b|^2 + sup|v_d|^2 <= 2 sup|v|^2.
    """
    now, late = channels(plant)
    acting = (plant.B != 0).any(axis=0) | (plant.Dq != 0).any(axis=0)
    if peaks:
        return 2 if (acting.any() and late.any()) else 1
    return 2 if (now & late).any() else 1
