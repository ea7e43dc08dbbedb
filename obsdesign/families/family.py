"""What a family of observers is to the rest: all that a stage may know of it."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

from obsdesign.errors import Problem, UsageError
from obsdesign.records import dataclass

if TYPE_CHECKING:
    from obsdesign.dissipation.engine import Engine
    from obsdesign.families.asked import Estimation, ObserverSection
    from obsdesign.families.finding import Finding
    from obsdesign.families.frozen import Demand
    from obsdesign.families.observer import Observer
    from obsdesign.families.outcome import Claim, Outcome, Proof
    from obsdesign.files import ResultFile
    from obsdesign.lmi.formula import Array, Exact
    from obsdesign.sections.values import Reader
    from obsdesign.spec import Nonlinearity, Request, Spec

Rows = list[tuple[str, str]]  # a name and a text


@dataclass(frozen=True)
class Family:
    """A family of observers: its names, and the folder that does its work.

    What each method here asks for is a function of a module of the folder:

    request.py    `SECTION`, `RESULTS`, `request`, `demand`; `nonlinearities`, if f is unstructured
    check.py      `check`
    design.py     `design`
    claim.py      `written`, `read`, `read_gains`; a claim has a method `theorem(spec)`, if Coq is told of it
    absence.py    `read`, if it refutes
    observer.py   `observer`, `errors`; `sampled` and `beside` in place of it, if y is known at instants only
    table.py      `proved`, `figures`

    Where nothing is proved, `request`, `check` and `observer` do. A module is imported when it is first needed, so that
    a proof imports no solver.
    """

    names: tuple[str, ...]  # values of `observer.type`
    folder: str  # its module path
    section: str = "SECTION"  # name of its section in `request.py`
    unstructured: bool = False  # f acts on every state through every state, unless Bf and Cq are given
    sampled: bool = False  # y is known at instants only, and `simulation:` may say at which
    equations: bool = False  # the plant is taken as it is typed, not in matrices
    matrices: bool = False  # .. or in matrices, where it is written so
    proves: bool = True  # something can be proved of its observers; else they are there to compare with
    discrete: bool = False  # plants x+ = .. are taken as well
    defects: tuple[str, ...] = ()  # its types that bound the error of a continuous plant at its samples
    places: bool = False  # the poles of its observers may be imposed
    refutes: bool = False  # a file may hold a dual certificate that there is no solution
    obstacles: tuple[str, ...] = ()  # kinds of further certificates that there is none, which `absence` reads
    hints: bool = False  # `hint.py` says of specs of other families what this one could do

    def part(self, name: str) -> Any:
        """Module of the folder."""
        return import_module(f"{self.folder}.{name}")

    @property
    def noise_in_w(self) -> bool:
        """Whether noise of the outputs is a part of w in its designs, and not of the runs alone."""
        return not self.sampled and not self.equations

    @property
    def Section(self) -> "type[ObserverSection]":
        """Keys of the section `observer:`; what messages and the JSON Schema say of them comes from here."""
        section: type[ObserverSection] = getattr(self.part("request"), self.section)
        return section

    @property
    def results(self) -> Mapping[str, Sequence[str]]:
        """Names in the parts `guarantee` and `observer` of a result file, for what a spec expects of it."""
        names: Mapping[str, Sequence[str]] = self.part("request").RESULTS
        return names

    def nonlinearities(
        self, reader: "Reader", plant: "Sequence[Nonlinearity | None]", model: "Sequence[Nonlinearity | None]"
    ) -> "tuple[Nonlinearity, ...]":
        """Blocks of f, of the plant and of the disturbance model, as the family takes them; None: refused already."""
        if not self.unstructured:
            return tuple(block for block in (*plant, *model) if block is not None)
        blocks: tuple[Nonlinearity, ...] = self.part("request").nonlinearities(reader, plant, model)
        return blocks

    def request(self, reader: "Reader", section: Any, problem: "Estimation") -> "Request":
        """What a spec asks for, in its numbers; what the family cannot take is noted in the reader.

        The section is of the type `Section`; the problem is known as far as it was read.
        """
        asked: Request = self.part("request").request(reader, section, problem)
        return asked

    def demand(self, spec: "Spec") -> "Demand":
        """The least that a spec asks of the error, whatever the observer."""
        demand: Demand = self.part("request").demand(spec)
        return demand

    def check(self, spec: "Spec", engine: "Engine") -> "list[Finding]":
        """What the structure of a spec allows, before any design."""
        from obsdesign.families import frozen

        found: list[Finding] = self.part("check").check(spec, engine)
        if self.equations:
            return found
        seen = all(f.holds for f in found if f.name == "detectability")
        return [*found, *(frozen.findings(spec, self.demand(spec)) if seen else [])]

    def require_claims(self, spec: "Spec") -> None:
        """Refuse what nothing can be proved of; raises `UsageError`."""
        if not self.proves:
            from obsdesign.errors import Problem, UsageError

            said = f"{spec.observer.type} has no guarantee: nothing is solved or proved"
            said += "; simulate, compare, estimate and export take it"
            raise UsageError(spec.located(Problem(said, key="observer.type", id="OBS505")))

    def design(self, spec: "Spec", engine: "Engine") -> "Outcome":
        """Gains and what is proved of them, or why there are none; status and claim of the very decimals of a file."""
        from obsdesign.families import frozen, reach

        self.require_claims(spec)
        if self.equations:
            outcome: Outcome = self.part("design").design(spec, engine)
            return outcome
        demand = self.demand(spec)
        within = lambda: reach.designed(spec, demand, lambda: self.part("design").design(spec, engine))  # noqa: E731
        return frozen.designed(spec, demand, within).within_limits(spec)

    def written(self, spec: "Spec", outcome: "Outcome") -> dict[str, Any]:
        """Entry `observer` of a result file: gains, and what an engineer asks first of them; empty without gains."""
        entry: dict[str, Any] = self.part("claim").written(spec, outcome)
        return entry

    def gains(self, spec: "Spec", file: "ResultFile") -> "Mapping[str, Array]":
        """Exact gains of a result file."""
        gains: Mapping[str, Array] = self.part("claim").read_gains(spec, file)
        return gains

    def form(self, spec: "Spec", file: "ResultFile") -> Any:
        """Observer of a result file that has no gains; None of a family whose observers have some."""
        return self.part("claim").read_form(spec, file) if self.equations else None

    def claim(self, spec: "Spec", file: "ResultFile") -> "Claim":
        """Claim of a certified result file, checked with no solver."""
        claim: Claim = self.part("claim").read(spec, file)
        return claim

    def moved(self, spec: "Spec", claim: Any, gains: "Mapping[str, Array]", S: "Exact") -> "Claim | None":
        """Claim of the plant of a spec, with gains in rationals, from that of the same plant in the states S x.

        None of a family that moves none. It is checked anew, so that it holds or not whatever S is.
        """
        part = self.part("claim")
        return part.moved(spec, claim, gains, S) if hasattr(part, "moved") else None

    def theorem(self, spec: "Spec", claim: Any, path: str) -> str:
        """Claim that holds as a file of Coq, with its proof.

        Raises `UsageError`, about the file at a path: the claim cannot be exported.
        """
        from obsdesign.coq.theorem import UnexportedError

        try:
            if not hasattr(claim, "theorem"):
                raise UnexportedError(f"claims of type {spec.observer.type} are not exported yet")
            text: str = claim.theorem(spec)
            return text
        except UnexportedError as error:
            said = f"no theorem for Coq: {error}; `verify` without --theorem proves it in rationals"
            raise UsageError(Problem(said, path, id="OBS711")) from None

    def absence(self, spec: "Spec", file: "ResultFile") -> "Proof":
        """Proof that an infeasible result file has no solution, from the dual certificate that it holds.

        Raises `UsageError`: it holds none: its verdict is numerical or structural; or it is malformed.
        """
        from obsdesign.families import frozen, reach
        from obsdesign.lmi import farkas

        if self.equations:
            refuted: Proof = self.part("absence").read(spec, file)
            return refuted
        if "certificate" not in file.table("diagnosis"):
            raise file.wrong("diagnosis", "holds no certificate, so there is nothing to be verified", id="OBS706")
        kinds = {frozen.KIND: frozen.read, reach.KIND: reach.read}
        if (kind := str(file.table("diagnosis", "certificate").get("kind"))) in kinds:
            return kinds[kind](spec, self.demand(spec), file)
        if kind not in (*((farkas.KIND,) if self.refutes else ()), *self.obstacles):
            raise file.wrong(
                "diagnosis.certificate", f"there is none of this kind for type {spec.observer.type}", id="OBS706"
            )
        proof: Proof = self.part("absence").read(spec, file)
        return proof

    def observer(self, spec: "Spec", gains: Any) -> "Observer":
        """Equations of the observer with given gains, in doubles, or of its form, if it has none.

        Raises `UsageError` if a nonlinearity has no f, or needs what the observer does not know.
        """
        observer: Observer = self.part("observer").observer(spec, gains)
        return observer

    def report(self, spec: "Spec", form: Any, t: "Array", signals: "Mapping[str, Array]") -> dict[str, Any]:
        """Entries of the summary of a run on what an observer of this form depends on, from its own states."""
        if not (self.equations and self.proves):
            return {}
        entries: dict[str, Any] = self.part("report").report(spec, form, t, signals)
        return entries

    def analysis(self, spec: "Spec", outcome: "Outcome") -> dict[str, Any]:
        """Entry `analysis` of a result file, with the gains of an outcome: what is computed in doubles."""
        if self.equations:
            return {}
        from obsdesign.families.analysis import analysis, finite

        guarantee = outcome.claim.guarantee(spec) if outcome.claim and outcome.claim.holds else None
        part, gains = self.part("observer"), outcome.gains
        errors = part.sampled(spec, gains, guarantee) if self.sampled else part.errors(spec, gains)
        beside = part.beside(spec, gains, guarantee) if self.sampled else {}
        return {**analysis(spec, errors, guarantee), **finite(beside)}

    def proved(self, observer: Mapping[str, Any], guarantee: Mapping[str, Any]) -> Rows:
        """Lines of a table on what is proved, from the entries of these names of a result file."""
        rows: Rows = self.part("table").proved(observer, guarantee)
        return rows

    def figures(self, observer: Mapping[str, Any]) -> Rows:
        """Lines on what an engineer asks first of the gains, from its entry `observer`."""
        rows: Rows = self.part("table").figures(observer)
        return rows
