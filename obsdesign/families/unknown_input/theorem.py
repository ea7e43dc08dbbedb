"""The inequality of an unknown-input observer: that of l2 for the plant that is left, with z = H eps + Z v."""

from obsdesign.dissipation.discrete import Discrete
from obsdesign.families.incremental.theorems import L2, DiscreteL2
from obsdesign.families.unknown_input.guarantee import Shifted, ShiftedOfSteps
from obsdesign.lmi.formula import Array, Inequality, Values, symmetric, zeros
from obsdesign.records import dataclass, replace

DIRECT = "eps = e - E D v"  # in a statement, where that is not e
OBSERVER = (
    "xi{next} = T (A xhat + Bf f(t, y, qhat) + gx) + L (y - yhat), xhat = xi + E (y - gy), "
    "qhat = Cq xhat + Dqf f(t, y, qhat) + gq, yhat = C xhat + Df f(t, y, qhat) + gy, T = I - E C, e = xhat - x, z = H e"
)


def gain_words(*, direct: bool) -> str:
    """What gamma bounds, from an error of zero; where v is in the estimates at once, of eps."""
    said = L2.about.gamma
    return said.replace("from zero error", "from eps(0) = 0") if direct else said


@dataclass(frozen=True)
class UnknownInput(L2):
    """(13) along the errors eps = xi - T x of `transform`, for the plant that is left.

        V' + 2 alpha V + mu1 |z|^2 - mu2 |v|^2 <= 0,    V = eps' P eps,    z = H eps + Z v,    Z = H E D,

    v being the channels of w that are not cancelled, so that norm2(z) <= sqrt(eps0' P eps0 / mu1) + gamma norm2(v).
    No gain has a gamma below |Z|.
    """

    about = replace(L2.about, name="unknown-input", guarantee=Shifted, gain="L", feedback=False)

    Z: Array | None = None  # (nz, nv); None: zero

    @property
    def direct(self) -> bool:
        """Whether v is in z at once."""
        return self.Z is not None

    def conditions(self, v: Values, weight: Array, supply: Array) -> list[Inequality]:
        """Those of the family l2, with what Z v adds to |z|^2."""
        first, *rest = super().conditions(v, weight, supply)
        if self.Z is None or not self.plant.B.shape[1]:
            return [first, *rest]
        return [replace(first, matrix=first.matrix + self.seen(weight, first.matrix.shape[-1])), *rest]

    def seen(self, weight: Array, size: int) -> Array:
        """Weight (|H eps + Z v|^2 - |H eps|^2) in (eps, f, v) and further rows, so many in all."""
        n, nf, nv = self.plant.n, self.plant.Bf.shape[1], self.plant.B.shape[1]
        eps, f, more = (zeros((k, k), [self.H]) for k in (n, nf, size - n - nf - nv))
        cross, square = weight * (self.H.mT @ self.Z), weight * (self.Z.mT @ self.Z)  # type: ignore[union-attr]
        return symmetric([[eps, 0, cross, 0], [f, 0, 0], [square, 0], [more]])


@dataclass(frozen=True)
class DiscreteUnknownInput(Discrete, UnknownInput):
    """The same of samples: V+ - rho^2 V + mu1 |z|^2 - mu2 |v|^2 <= 0."""

    about = replace(DiscreteL2.about, name="unknown-input", guarantee=ShiftedOfSteps, gain="L", feedback=False)
