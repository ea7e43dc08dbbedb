"""The inequality of a certificate, as Coq is given it: weights, rate, and the inequalities of the class of f."""

from dataclasses import replace

from flint import fmpq

from obsdesign.coq.hulls import Hull
from obsdesign.dissipation.certificate import Certificate
from obsdesign.lmi.formula import Array, Inequality, Values, rational, rational_number, zeros
from obsdesign.lmi.proof import holds
from obsdesign.model.multiplier import Scaled, Sum
from obsdesign.nonlinearities.cone import Cone
from obsdesign.nonlinearities.jacobian import Polytope

FLOOR = 0.9  # of the least eigenvalue of P
PLACES = 31  # of the rates that are tried where none is claimed


def weights(certificate: Certificate) -> tuple[fmpq, fmpq]:
    """Weight of |z|^2 and supply in the inequality."""
    if certificate.guarantee.norm == "sup":
        return fmpq(0), certificate.family.loss * certificate.mu1
    return certificate.mu1, certificate.mu2


def least(certificate: Certificate) -> fmpq:
    """Number below the eigenvalues of P, which decay is told with."""
    return rational_number(f"{FLOOR * certificate.guarantee.spectrum[0]:.3g}")


def decrease(certificate: Certificate) -> Array:
    """Matrix of the inequality, which is not positive."""
    family, P = certificate.family, certificate.P
    weight, supply = weights(certificate)
    values = {**certificate.multipliers, "P": P, "Y": P @ family.L1}
    return family.dissipation(values, weight * (family.H.mT @ family.H), rational([[supply]]))


def decaying(certificate: Certificate) -> Certificate:
    """The same with a positive rate, where none is claimed and a strict inequality leaves room for one: then e -> 0."""
    family = certificate.family
    if family.rate or family.about.at_rest != "strict":
        return certificate
    rates = (fmpq(digit, 10**places) for places in range(1, PLACES) for digit in (5, 2, 1))
    tried = (replace(certificate, family=replace(family, rate=rate)) for rate in rates)
    return next((one for one in tried if holds(Inequality("", decrease(one)))), certificate)


def multipliers(certificate: Certificate) -> list[tuple[fmpq, Array, Array, Array]]:
    """Scale and matrices M11, M12, M22 of each inequality of the class that has a scale."""
    multiplier, rays = certificate.family.multiplier, []
    unknowns = multiplier.unknowns()
    for label, block in multiplier.labelled():
        for one in block.unknowns(label) if isinstance(block, Scaled | Sum) else ():
            none = {other.name: zeros(other.shape, [block.member]) for other in unknowns}
            unit: Values = none | {one.name: rational([[1]])}
            rays.append((certificate.multipliers[one.name].item(), *multiplier.matrix(unit)))
    return rays


def hulls(certificate: Certificate) -> list[Hull]:
    """Multipliers that are matrices."""
    multiplier, found, q, f = certificate.family.multiplier, [], 0, 0
    for label, block in multiplier.labelled():
        if isinstance(block, Cone | Polytope):
            M = block.matrix(certificate.multipliers, label)
            found.append(Hull.of(block, M, (q, f), multiplier.member.shape[::-1]))
        q, f = q + block.nq, f + block.nf
    return found
