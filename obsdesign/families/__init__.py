"""Families of observers, a folder each, and by name: the only place that names a family outside its folder.

Importing it imports no family's mathematics, no solver and no reader. To add one: a folder with the modules that
`Family` names, and a line in FAMILIES.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from obsdesign.families.family import Family

if TYPE_CHECKING:
    from obsdesign.dissipation.engine import Engine
    from obsdesign.families.finding import Finding
    from obsdesign.spec import Spec

ALGEBRAIC, FILTERS = "obsdesign.families.algebraic", "obsdesign.families.filters"
FAMILIES: dict[str, Family] = {  # by observer.type
    name: family
    for family in (
        Family(
            ("l2", "linf"),
            "obsdesign.families.incremental",
            discrete=True,
            defects=("linf",),
            places=True,
            refutes=True,
        ),
        Family(("sporadic",), "obsdesign.families.sporadic", sampled=True),
        Family(("lipschitz",), "obsdesign.families.lipschitz", unstructured=True, discrete=True, places=True),
        Family(
            ("unknown-input",),
            "obsdesign.families.unknown_input",
            discrete=True,
            places=True,
            refutes=True,
            obstacles=("rank",),
            hints=True,
        ),
        Family(("kkl", "pebo", "kkl+pebo"), ALGEBRAIC, "CoordinatesSection", equations=True),
        Family(("immersion-invariance",), ALGEBRAIC, "ImmersionSection", equations=True),
        Family(("high-gain",), ALGEBRAIC, "HighGainSection", equations=True),
        *(
            Family((name,), FILTERS, section, equations=True, matrices=True, proves=False, discrete=True)
            for name, section in (("ekf", "ExtendedSection"), ("ukf", "UnscentedSection"), ("lqe", "StationarySection"))
        ),
    )
    for name in family.names
}

__all__ = ["FAMILIES", "Family", "hinted", "rescaled"]


def hinted(spec: "Spec") -> "list[Finding]":
    """What other families could do for a spec, as far as its plant is given in matrices and y is known at all times."""
    own = FAMILIES[spec.observer.type]
    if own.sampled or spec.typed is not None:
        return []
    others = {id(family): family for family in FAMILIES.values() if family.hints and family is not own}
    return [found for family in others.values() for found in family.part("hint").hint(spec)]


def rescaled(spec: "Spec", engine: "Engine", T: Sequence[str] | None) -> dict[str, Any]:
    """Lipschitz constants in scaled coordinates: those that are given, or the best that are found."""
    from obsdesign.families.lipschitz.coordinates import scaling

    return scaling(spec, engine, T)
