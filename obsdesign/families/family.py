"""What a family of observers is to the rest: all that a stage may know of it."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from obsdesign.dissipation.engine import Engine
    from obsdesign.families.asked import Estimation, ObserverSection
    from obsdesign.families.finding import Finding
    from obsdesign.families.observer import Observer
    from obsdesign.families.outcome import Claim, Outcome, Proof
    from obsdesign.files import ResultFile
    from obsdesign.lmi.formula import Array
    from obsdesign.sections.values import Reader
    from obsdesign.spec import Nonlinearity, Request, Spec

Rows = list[tuple[str, str]]  # a name and a text


class Family(Protocol):
    """A family of observers: one object, in the `__init__.py` of its folder; its methods import what they use."""

    unstructured: bool = False  # f acts on every state through every state, unless Bf and Cq are given
    sampled: bool = False  # y is known at instants only, and `simulation:` may say at which

    @property
    def names(self) -> tuple[str, ...]:
        """Values of `observer.type`."""

    @property
    def Section(self) -> "type[ObserverSection]":
        """Keys of the section `observer:`; what messages and the JSON Schema say of them comes from here."""

    def nonlinearities(
        self,
        reader: "Reader",  # noqa: ARG002
        plant: "Sequence[Nonlinearity | None]",
        model: "Sequence[Nonlinearity | None]",
    ) -> "tuple[Nonlinearity, ...]":
        """Blocks of f as the family takes them; a block that is None was refused already.

        Parameters
        ----------
        plant, model
            Those of the plant and of the disturbance model.
        """
        return tuple(block for block in (*plant, *model) if block is not None)

    def request(self, reader: "Reader", section: Any, problem: "Estimation") -> "Request":
        """What a spec asks for, in its numbers; what the family cannot take is noted in the reader.

        Parameters
        ----------
        section
            Of the type `Section`.
        problem
            The plant and what of its error must be small, as far as they were read.
        """

    def observer(self, spec: "Spec", gains: "Mapping[str, Array]") -> "Observer":
        """Equations of the observer with given gains, in doubles.

        Raises
        ------
        UsageError
            If a nonlinearity has no f, or needs what the observer does not know.
        """

    def check(self, spec: "Spec", engine: "Engine") -> "list[Finding]":
        """What the structure of a spec allows, before any design."""

    def design(self, spec: "Spec", engine: "Engine") -> "Outcome":
        """Gains and what is proved of them, or why there are none; status and claim of the very decimals of a file."""

    def written(self, spec: "Spec", outcome: "Outcome") -> dict[str, Any]:
        """Entry `observer` of a result file: gains, and what an engineer asks first of them; empty without gains."""

    def gains(self, spec: "Spec", file: "ResultFile") -> "Mapping[str, Array]":
        """Exact gains of a result file."""

    def claim(self, spec: "Spec", file: "ResultFile") -> "Claim":
        """Claim of a certified result file, checked with no solver."""

    def absence(self, spec: "Spec", file: "ResultFile") -> "Proof":
        """Proof that an infeasible result file has no solution; a `UsageError` where it holds none."""

    def proved(self, observer: Mapping[str, Any], guarantee: Mapping[str, Any]) -> Rows:
        """Lines of a table on what is proved, from the entries of these names of a result file."""

    def figures(self, observer: Mapping[str, Any]) -> Rows:
        """Lines on what an engineer asks first of the gains, from its entry `observer`."""
