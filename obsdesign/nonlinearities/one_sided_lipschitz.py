"""One-sided Lipschitz nonlinearities with quadratic inner boundedness."""

import numpy as np
from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.lmi.formula import rational
from obsdesign.model.multiplier import Multiplier, Scaled, Sum
from obsdesign.nonlinearities.data import Constants
from obsdesign.nonlinearities.template import Template, require_as_many
from obsdesign.sections.forms import ENTRY, Section, required


def one_sided_lipschitz(data: tuple[fmpq, fmpq, fmpq], nq: int, nf: int) -> Multiplier:
    """Inequalities dq'df <= rho dq'dq and df'df <= beta dq'dq + phi dq'df, with a scale for each.

    M = lambda_a [[2 rho I, -I], [-I, 0]] + lambda_b [[beta I, phi/2 I], [phi/2 I, -I]].

    All three constants may be negative (Abbaszadeh and Marquez, 2010): rho = -1 says that f contracts.

    `data`: rho, beta, phi. Raises `UsageError`: nf is not nq, or no f satisfies both inequalities.
    """
    require_as_many("one-sided-lipschitz", nq, nf)
    rho, beta, phi = data
    eye = rational(np.eye(nq))
    K = linear_member(rho, beta, phi) * eye
    one_sided = np.array([[2 * rho, fmpq(-1)], [fmpq(-1), fmpq(0)]], dtype=object)
    bounded = np.array([[beta, phi / 2], [phi / 2, fmpq(-1)]], dtype=object)
    return Multiplier((Sum(K, tuple(Scaled.of(np.kron(M, eye), nq, K) for M in (one_sided, bounded))),))


def linear_member(rho: fmpq, beta: fmpq, phi: fmpq) -> fmpq:
    """Find k with k <= rho and k^2 <= beta + phi k: zero if it will do, or else where k^2 - phi k is least.

    Where there is no such k there is no f: if df = k dq + n, n orthogonal to dq, satisfies both, so does k dq.
    """
    for k in (fmpq(0), min(rho, phi / 2)):
        if k <= rho and k * k <= beta + phi * k:
            return k
    raise UsageError(
        f"one-sided-lipschitz: no f satisfies both inequalities: they need a number k <= {rho} "
        f"with k^2 <= {beta} + {phi} k, and there is none",
        id="OBS404",
    )


class OneSidedLipschitz(Section):
    """dq'df <= rho dq'dq and df'df <= beta dq'dq + phi dq'df."""

    rho: str = required(ENTRY, "of dq'df <= rho dq'dq; may be negative", example="-1")
    beta: str = required(ENTRY, "of df'df <= beta dq'dq + phi dq'df; may be negative", example="4")
    phi: str = required(ENTRY, "of the same inequality; may be negative", example="2")


ONE_SIDED_LIPSCHITZ = Template(
    one_sided_lipschitz,
    Constants(
        OneSidedLipschitz,
        "dq'df <= rho dq'dq and df'df <= beta dq'dq + phi dq'df",
        "{rho: -1, beta: 4, phi: 2}",
    ),
    inequalities=(("rho dq' dq - dq' df", fmpq(1, 2)), ("beta dq' dq + phi dq' df - df' df", fmpq(1))),
)
