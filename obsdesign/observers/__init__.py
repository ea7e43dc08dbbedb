"""Observer families, one file each, and what a spec asks of them.

To add one with the gains L1 and L2 of (12): a file with a subclass of Incremental, a line in FAMILIES, and a spec that
uses it.
"""

from obsdesign.observers.incremental import Incremental
from obsdesign.observers.l2 import L2
from obsdesign.observers.linf import Linf

FAMILIES: dict[str, type[Incremental]] = {family.name: family for family in (L2, Linf)}

__all__ = ["FAMILIES", "Incremental"]
