"""Bounds on the gain L1 and on P that a design keeps, as theorems of Coq."""

from flint import fmpq

from obsdesign.coq.congruence import congruence, triangle
from obsdesign.coq.decimals import number
from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.certificate import Certificate
from obsdesign.lmi.formula import Array, identity
from obsdesign.records import dataclass


def bounded(certificate: Certificate, bounds: Bounds, design: str) -> list[str]:
    """Theorems that |L1 y| <= kappa |y| and e' P e <= p |e|^2, of bounds that a design keeps; lines of Coq."""
    P, L1 = certificate.P, certificate.family.L1
    found = []
    if (kappa := bounds.L1) is not None and L1 is not None:
        S = kappa * kappa * identity(L1.shape[1], P) - L1.mT @ L1
        said = f"sq (L1 {design} ** x) <= Q2R kappa * Q2R kappa * sq x"
        found.append(Kept(design, "gain", "kappa", kappa, S, "ny", said))
    if (p := bounds.P) is not None:
        found.append(Kept(design, "storage", "p", p, p * identity(len(P), P) - P, "n", f"V {design} x <= Q2R p * sq x"))
    return [line for one in found for line in one.lines()]


@dataclass(frozen=True)
class Kept:
    """A bound that is kept: a number, the matrix that is not negative, and what it says of every x."""

    design: str
    name: str
    symbol: str
    bound: fmpq
    S: Array
    size: str
    said: str

    def lines(self) -> list[str]:
        """Theorem, and its proof by a form that the kernel computes."""
        T = f"T_{self.name}"
        return [
            f"Definition {self.symbol} : Q := {number(self.bound)}.",
            f"Definition {T} : list (list Z) := {triangle(congruence(self.S))}%Z.",
            f"Lemma {self.name}_proved :",
            f"  check false ({self.size} {self.design}) ({self.name}_form {self.design} {self.symbol}) {T} = true.",
            "Proof. vm_cast_no_check (eq_refl true). Qed.",
            f"Theorem {self.name}_bound : forall x, length x = {self.size} {self.design} -> {self.said}.",
            f"Proof. exact ({self.name}_bounded {self.design} {self.symbol} {T} {self.name}_proved). Qed.",
            f"Print Assumptions {self.name}_bound.",
            "",
        ]
