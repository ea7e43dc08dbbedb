"""The equality P Bf = T that f without an (f, f) part of their own ask of P, exactly in rationals.

With T = -Q_ef of (13), which P does not enter, K = Bf' T symmetric and regular, and R = I - Bf K^-1 T',

    P = T K^-1 T' + R' S R

solves it for every symmetric S, and is positive definite for K > 0 and S > 0: R' S R e = S e and T' e = 0 for e in the
range of R. In doubles `riccati.passive` finds S.
"""

import numpy as np
from flint import fmpq_mat

from obsdesign.dissipation.inequality import Incremental
from obsdesign.lmi.formula import Array, Values, identity, product, zeros


def with_equality(family: Incremental, values: Values) -> Values:
    """Values with the P that is made of theirs, S; as they are where there is no such f, or K is not symmetric.

    `family`, `values`: in rationals, with L2.
    """
    Bf, T = silent(family, values)
    K = Bf.T @ T
    if not len(K) or (K != K.T).any():
        return values
    try:
        back = np.array(fmpq_mat(K.tolist()).solve(fmpq_mat(T.T.tolist())).tolist(), dtype=object)
    except ZeroDivisionError:
        return values
    R = identity(len(Bf), Bf) - Bf @ back
    return {**values, "P": T @ back + product(R.T, product(values["P"], R))}


def tied(family: Incremental, scales: dict[str, Array]) -> dict[str, Array]:
    """Scales for which K is symmetric exactly, near to some that are so but for rounding; as they are without any."""
    zero = {name: zeros((1, 1), [scale]) for name, scale in scales.items()}
    skew = []
    for name in scales if len(scales) > 1 else ():
        Bf, T = silent(family, {**zero, name: identity(1, zero[name])}, scales)
        skew.append((Bf.T @ T - T.T @ Bf)[np.triu_indices(Bf.shape[1], 1)])
    if not skew or not np.array(skew).any():
        return scales
    rows, rank = fmpq_mat(np.array(skew).T.tolist()).rref()
    names, found = list(scales), dict(scales)
    for row in rows.tolist()[:rank]:
        lead, *others = (j for j, entry in enumerate(row) if entry)
        found[names[lead]] = sum((-row[j] * scales[names[j]] for j in others), zero[names[lead]])
    return found


def silent(family: Incremental, values: Values, told: Values | None = None) -> tuple[Array, Array]:
    """Bf and T for some scales, of the f without (f, f); `told`: for these scales."""
    n, Bf = family.plant.n, family.plant.Bf
    if not Bf.shape[1]:
        return Bf, Bf
    supplied = family.member_supply(values)
    whole = supplied if told is None else family.member_supply(told)
    chosen = ~whole[n:, n:].any(axis=1)
    return Bf[:, chosen], -supplied[:n, n:][:, chosen]
