"""Observers of Lipschitz systems, Abbaszadeh and Marquez (2010)."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from obsdesign.families.family import Family

if TYPE_CHECKING:
    from obsdesign.families.asked import Estimation
    from obsdesign.families.lipschitz.request import LipschitzObserver, LipschitzRequest
    from obsdesign.families.observer import Observer
    from obsdesign.lmi.formula import Array
    from obsdesign.sections.values import Reader
    from obsdesign.spec import Nonlinearity, Spec


class LipschitzFamily(Family):
    """The family, for the registry."""

    names = ("lipschitz",)
    unstructured = True

    @property
    def Section(self) -> "type[LipschitzObserver]":
        """Keys of the section `observer:`."""
        from obsdesign.families.lipschitz.request import LipschitzObserver

        return LipschitzObserver

    def nonlinearities(
        self,
        reader: "Reader",
        plant: "Sequence[Nonlinearity | None]",
        model: "Sequence[Nonlinearity | None]",
    ) -> "tuple[Nonlinearity, ...]":
        """Blocks with the multipliers of their Lipschitz constants."""
        from obsdesign.families.lipschitz.request import as_lipschitz

        return as_lipschitz(reader, plant, model)

    def request(self, reader: "Reader", section: "LipschitzObserver", problem: "Estimation") -> "LipschitzRequest":
        """What a spec asks for, in its numbers."""
        from obsdesign.families.lipschitz.request import read_request

        return read_request(reader, section, problem)

    def observer(self, spec: "Spec", gains: "Mapping[str, Array]") -> "Observer":
        """Equations of the observer with given gains."""
        from obsdesign.families.lipschitz.observer import observer

        return observer(spec, gains)


LIPSCHITZ = LipschitzFamily()
