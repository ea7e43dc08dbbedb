"""What given gains tolerate: the longest interval between measurements, with its proof, and the largest decay."""

from flint import fmpq

from obsdesign.dissipation import scan
from obsdesign.dissipation.bounds import Range
from obsdesign.dissipation.decimals import round_down
from obsdesign.families.sporadic.certificate import SporadicCertificate
from obsdesign.families.sporadic.gains import Gains, Setting, prove
from obsdesign.families.sporadic.study import EDGE
from obsdesign.lmi.formula import printed

SHORTER = 1e-3  # least T2 or decay, relative to the one that is asked for, that an answer looks for
LONGER = 10.0  # largest T2 that is tried for given gains, relative to the one that is asked for
BACKOFFS = (1e-4, 1e-3, 3e-3, 1e-2, 3e-2)  # from the largest T2 of given gains to one that is proved
PART = 1 / 7  # of a backoff, to which the longest proof is found


def tolerated(setting: Setting, gains: Gains, T2: float, highest: float, decay: float) -> float | None:
    """Largest T2 for which Theorem 2 has a solution with given gains, at any gamma; numerical.

    Parameters
    ----------
    T2, highest
        The T2 that is asked for, and the largest of its range.
    decay
        Rate lambda_t, 1/s.

    Returns
    -------
    Searched from `SHORTER` T2 to the larger of `LONGER` T2 and the highest; None if not even the first has one.
    """
    landscape = setting.analysis(gains, decay)
    return scan.zero(landscape.least_missing, SHORTER * T2, max(LONGER * T2, highest), EDGE * T2)


def sustained(setting: Setting, gains: Gains, T2: float, decays: Range) -> float:
    """Largest decay of a range for which it has one, or the lowest; numerical."""

    def missing(decay: float) -> float:
        return setting.analysis(gains, decay).least_missing(T2)

    low, high = float(decays.low), float(decays.high)
    found = scan.zero(missing, low, high, EDGE * high)
    return low if found is None else found


def longest_proof(setting: Setting, gains: Gains, edge: float, decay: fmpq) -> SporadicCertificate | None:
    """Proof for the longest T2 that is found, below the edge where solutions end numerically; None without one."""
    proofs: dict[float, SporadicCertificate] = {}
    above = edge

    def proved(T2: float) -> bool:
        certificate = prove(setting, gains, printed(round_down(T2, 6)), decay)
        if not certificate or not certificate.holds:
            return False
        proofs[T2] = certificate
        return True

    for backoff in BACKOFFS if edge else ():
        if proved(edge * (1 - backoff)):
            return proofs[scan.edge(proved, edge * (1 - backoff), above, backoff * PART)]
        above = edge * (1 - backoff)
    return None
