"""The inequalities of each family of observers with the gains L1 and L2."""

from obsdesign.dissipation.inequality import Incremental
from obsdesign.families.incremental.l2 import L2
from obsdesign.families.incremental.linf import Linf

THEOREMS: dict[str, type[Incremental]] = {family.about.name: family for family in (L2, Linf)}
