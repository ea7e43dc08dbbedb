"""What is proved of an observer of a Lipschitz system."""

from dataclasses import dataclass
from typing import ClassVar

from obsdesign.dissipation.guarantee import EnergyGuarantee


@dataclass(frozen=True)
class LipschitzGuarantee(EnergyGuarantee):
    """V' + 2 decay V + |z|^2 - gamma^2 |v|^2 <= 0: that of the energy, with mu1 = 1, in the words of the paper."""

    rate: ClassVar[str] = "decay"
    weight: ClassVar[str] = ""
    symbol: ClassVar[str] = "decay"
