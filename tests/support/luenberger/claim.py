"""The claim, as a file holds it and as it is read."""

from dataclasses import dataclass

import numpy as np

from obsdesign.dissipation.certificate import Certificate, certify
from obsdesign.families.incremental.theorems import L2
from obsdesign.lmi.formula import approximate, rational
from obsdesign.lmi.proof import Proved


@dataclass(frozen=True)
class Claim(Proved):
    """The gain reaches gamma at a decay rate."""

    certificate: Certificate

    @property
    def checks(self):
        """Every condition."""
        return self.certificate.checks

    def guarantee(self, _):
        """That of the certificate."""
        return self.certificate.guarantee

    def headline(self, _):
        """Claim in one line."""
        return f"gamma {approximate(self.certificate.gamma):g}"

    def statement(self, spec):
        """Claim in words."""
        return f"norm2(z) <= gamma norm2(v) from zero error, {self.headline(spec)}"

    def written(self, spec, limits):
        """What is proved, and the witness."""
        c = self.certificate
        values = {"gamma": c.gamma, "alpha": c.rate, "mu1": c.mu1, "mu2": c.mu2}
        numbers = {key: approximate(value) for key, value in values.items()}
        return {
            "guarantee": {**numbers, **limits, "statement": self.statement(spec)},
            "certificate": c.written(),
        }


def written(_, outcome):
    """The gain."""
    return {"L1": outcome.gains["L1"].tolist()} if outcome.gains else {}


def read_gains(spec, file):
    """The gain of a file."""
    return {"L1": file.matrix((spec.augmented.n, len(spec.augmented.C)), "observer", "L1")}


def read(spec, file):
    """Claim of a file, checked."""
    plant = spec.augmented
    none = rational(np.zeros((len(plant.Cq), len(plant.C))))
    L1, alpha = read_gains(spec, file)["L1"], file.number("guarantee", "alpha")
    family = L2(plant, spec.multiplier, spec.H, alpha, L1, none)
    values = {"P": file.matrix((plant.n, plant.n), "certificate", "P")}
    values |= file.unknowns(spec.multiplier.unknowns(), "certificate", "multipliers")
    return Claim(certify(family, *(file.number("guarantee", key) for key in ("gamma", "mu1", "mu2")), values))
