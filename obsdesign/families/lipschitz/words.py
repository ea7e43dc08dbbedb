"""What is proved of an observer of a Lipschitz system, in words, with the observer written out."""

from obsdesign.records import dataclass
from obsdesign.spec import Spec
from obsdesign.tables.text import at_least, at_most


@dataclass(frozen=True)
class Words:
    """Phrases about norms over [0, T] for every T, or over any first samples."""

    level: str  # for {gamma} and {drive}
    decays: str  # for {rate}, which is alpha or rho
    converges: str  # where no rate is claimed
    equations: str


OF_TIME = Words(
    "norm2(z) <= sqrt(e0' P e0) + {gamma!r} norm2({drive})",
    "|e(t)| <= sqrt(cond(P)) exp(-{rate!r} t) |e0|",
    "e(t) -> 0",
    "xhat' = A xhat + Bf f(Cq xhat) + g + L (y - C xhat), e = x - xhat, z = H e",
)
PREDICTED = Words(
    "sum |z|^2 <= e0' P e0 + {gamma!r}^2 sum |{drive}|^2 over any first samples",
    "|e_k| <= sqrt(cond(P)) {rate!r}^k |e0|",
    "e_k -> 0",
    "xhat+ = A xhat + Bf f(Cq xhat) + g + L (y - C xhat), e = x - xhat, z = H e",
)
FILTERED = Words(
    f"{PREDICTED.level}, of {{drive}} one sample more",
    PREDICTED.decays,
    PREDICTED.converges,
    "xbar = A xhat + Bf f(Cq xhat) + g, xhat+ = xbar + L (y+ - C xbar), e = x - xhat, z = H e",
)


def words(spec: Spec) -> Words:
    """Phrases for the time of a spec and for its estimates."""
    if spec.period is None:
        return OF_TIME
    return FILTERED if spec.observer.filtered else PREDICTED


def meaning(drive: str) -> str:
    """What gamma is, for the letter of what drives the plant with its disturbance model."""
    return f"norm2(z) <= gamma norm2({drive}) from zero error"


def pace(rate: float, spec: Spec) -> str:
    """How fast the error is proved to decay: alpha, or rho of samples, in few digits."""
    return f"decay rate {at_least(rate)} 1/s" if spec.period is None else f"rho {at_most(rate)}"
