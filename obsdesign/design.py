"""A design: an observer for a spec, with what is proved of it, as it is shown, saved, verified and simulated.

A result file is read and proved anew here too: from the spec, the gains and the witness in it, with no solver.
"""

import datetime
import html
import os
import platform
from collections.abc import Callable, Mapping
from functools import cached_property
from importlib.util import find_spec
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from obsdesign import __version__
from obsdesign.disk import write_whole
from obsdesign.errors import Problem, UndecidedError, UsageError
from obsdesign.expectation import at, meets
from obsdesign.families import FAMILIES
from obsdesign.families.agreement import numerical, require_agreement, require_dual, require_types
from obsdesign.families.analysis import mixed, useless
from obsdesign.families.guarantee import Guarantee
from obsdesign.families.implementation import remark
from obsdesign.families.observer import Observer
from obsdesign.families.outcome import Outcome, Proof, Verdict
from obsdesign.files import ResultFile, as_read, digest, release, to_json
from obsdesign.lmi.formula import in_floats
from obsdesign.reading import loads
from obsdesign.records import dataclass, replace
from obsdesign.sections.changes import opened
from obsdesign.spec import DOUBLES, Spec, named_by
from obsdesign.tables.split import entry
from obsdesign.tables.text import aligned

if TYPE_CHECKING:
    from control import NonlinearIOSystem

    from obsdesign.simulate import Run
    from obsdesign.simulate.montecarlo import MonteCarlo

FORMAT = 1
Progress = Callable[[float], None]  # called with the fraction that is done


@dataclass(frozen=True)
class Solver:
    """What solved a problem, and how much of it that took."""

    name: str
    solves: int
    time_s: float
    engine: str = "lmi"  # what found the limit: lmi or riccati

    def written(self) -> dict[str, Any]:
        """Entry of a result file."""
        its = release(self.name if find_spec(self.name) else "cvxpy")
        return {"name": self.name, "version": its} | vars(self) | {"time_s": round(self.time_s, 4)}


@dataclass(frozen=True, kw_only=True, repr=False)
class Design(Outcome):
    """What came of a spec: gains for its plant with what is proved of them, or why there are none."""

    spec: Spec
    solver: Solver | None = None  # None of a design that was read from a file
    recorded: ResultFile | None = None  # the file that it was read from
    elsewhere: Spec | None = None  # with another plant, on which it is run: nothing is proved of it there

    @classmethod
    def of(cls, spec: Spec, outcome: Outcome, **origin: Any) -> "Design":
        """Design of an outcome; its notes begin with those on the spec, and its gains cannot be changed any more."""
        gains = {name: gain.copy() for name, gain in outcome.gains.items()}
        for gain in gains.values():
            gain.setflags(write=False)
        further = {"gains": MappingProxyType(gains), "notes": (*spec.notes, *outcome.notes)}
        return cls(**{**vars(outcome), **further}, spec=spec, **origin)

    @property
    def path(self) -> str:
        """File that it was read from, or that of its spec."""
        return self.recorded.path if self.recorded else self.spec.path

    @property
    def proved(self) -> bool:
        """Whether its claim holds."""
        return self.status is Verdict.CERTIFIED and self.claim is not None and self.claim.holds

    @property
    def proof(self) -> Proof:
        """What is claimed of gains that have a claim, with the conditions that were checked of it."""
        assert self.claim
        return Proof("; ".join([self.claim.headline(self.spec), *self.spec.provisos]), self.claim.checks)

    def theorem(self) -> str:
        """What is proved of the gains as a file of Coq. See `work.theorem`.

        Raises `UsageError`: the claim cannot be exported; `UndecidedError`: nothing is proved.
        """
        if not self.proved:
            raise UndecidedError(Problem("nothing is proved that a theorem could state", self.path, id="OBS708"))
        return FAMILIES[self.spec.observer.type].theorem(self.spec, self.claim, self.path)

    @property
    def guarantee(self) -> Guarantee | None:
        """What a run is held against; None where nothing is proved, or nothing of the plant of the spec."""
        return self.claim.guarantee(self.spec) if self.proved and self.claim else None

    @property
    def observer(self) -> Observer:
        """Equations of the observer with these gains: what is simulated.

        Raises `UsageError`: there are no gains, or a nonlinearity has no f.
        """
        if not self.built:
            said = f"no gains to simulate: {self.diagnosis.get('reason', self.status)}"
            raise UsageError(Problem(said, self.spec.path, id="OBS709"))
        with self.spec.placed():
            return FAMILIES[self.spec.observer.type].observer(self.spec, self.gains or self.form)

    @cached_property
    def result(self) -> Mapping[str, Any]:
        """Result file as a dictionary: the one that `save` writes, or the one that was read, whatever it says."""
        return self.written() if self.recorded is None else self.recorded.plain()

    @cached_property
    def analysis(self) -> Mapping[str, Any]:
        """What is computed of the gains in doubles, over frozen members of the class; nothing of it is proved."""
        return FAMILIES[self.spec.observer.type].analysis(self.spec, self)

    @cached_property
    def made(self) -> Mapping[str, Any]:
        """Gains, and what an engineer asks first of them, as a result file holds them; empty without gains."""
        with np.errstate(all="ignore"):  # what is not finite is refused when it is written
            return FAMILIES[self.spec.observer.type].written(self.spec, self)

    def claimed(self) -> dict[str, Any]:
        """Parts `observer`, `guarantee` and `certificate` of a result file."""
        entries = {"observer": {"type": self.spec.observer.type, **self.made}} if self.made else {}
        if self.claim:
            return entries | self.claim.written(self.spec, self.limits())
        return entries | ({"guarantee": self.limits()} if self.limit else {})

    def contents(self) -> dict[str, Any]:
        """What is known of the design itself, as a result file holds it; of a file that was read, what is proved."""
        spec, entries = self.spec, self.claimed()
        if "observer" in entries:
            with np.errstate(all="ignore"):
                entries["analysis"] = self.analysis
        entries |= {"diagnosis": self.diagnosis} if self.diagnosis else {}
        entries |= {"search": self.search.written()} if self.search else {}
        entries |= {"assumed": spec.assumed} if spec.assumed else {}
        entries |= {"notes": notes} if (notes := self.remarks()) else {}
        paths = numerical({**entries, "solver": self.solved}, spec)
        return {"status": str(self.status), **entries, **({"numerical": paths} if paths else {})}

    @property
    def solved(self) -> dict[str, Any]:
        """Sizes and units of what was solved, as a result file holds them."""
        return {name: of for name, of in {"scalars": self.scalars, "scaling": self.scaling}.items() if of}

    def remarks(self) -> list[str]:
        """Notes, and one on a design that is no better than none, and one on the steps in which it is to run."""
        said = useless(self.guarantee.gamma, self.analysis) if self.guarantee and self.spec.disturbed else None
        units = mixed(self.spec) if self.guarantee else None
        steps = remark(self.spec, self.analysis, proved=self.proved) if self.gains else None
        return [*self.notes, *self.spec.idle, *filter(None, (said, units, steps))]

    def written(self) -> dict[str, Any]:
        """Everything about the design, as a result file holds it; numbers are finite."""
        spec = self.spec
        assert self.solver
        changed = {"set": list(spec.changes)} if spec.changes else {}
        return {
            "obsdesign": FORMAT,
            "name": spec.name,
            "spec": {"path": spec.path, "sha256": digest(spec.text), "text": spec.text, **changed},
            **entry(spec),
            **self.contents(),
            "solver": {**self.solver.written(), **self.solved},
            "tool": {"version": __version__, "python": platform.python_version(), "cvxpy": release("cvxpy")},
            "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the result file, whole or not at all.

        Raises `UsageError`: the folder does not exist or may not be written.
        """
        write_whole(os.fspath(path), self.text())

    def plot_search(self, path: str) -> bool:
        """Draw the points of its search, at a path (SVG, or PNG); False where there are none. Raises as `save`."""
        from obsdesign.plot import form_of, search_figure

        if (figure := search_figure(self.result, self.spec, form_of(path))) is not None:
            write_whole(path, figure)
        return figure is not None

    def text(self) -> bytes:
        """Result file as it is written, or as it was read; raises `UndecidedError` if a number is not finite."""
        if self.recorded is not None:
            return self.recorded.raw
        try:
            return to_json(self.result).encode()
        except ValueError:
            said = "the numbers are beyond what doubles can hold"
            raise UndecidedError(Problem(said, self.spec.path, id="OBS508")) from None

    def verify(self) -> Proof:
        """Prove the claim anew from what `save` writes, in rationals and with no solver.

        Raises `UsageError`: the design claims nothing that could be proved.
        """
        return proof_of(ResultFile("this design", self.text()), self.spec)

    def simulate(self, progress: Progress | None = None, /, **changes: Any) -> "Run":
        """Run plant and observer, and hold the run against every bound of the guarantee.

        `changes`: keys of the section `simulation` of a spec: `horizon=5`, `x0=[1, 0]`, `w=["sin(t)"]`, .. Raises
        `UsageError`: there are no gains, a nonlinearity has no f, or a change is not valid.
        """
        from obsdesign.simulate import simulate

        return simulate(self, changes, progress)

    def montecarlo(self, runs: int, jobs: int = 1, progress: Progress | None = None, **changes: Any) -> "MonteCarlo":
        """Runs with the seeds from that of the spec on; see `simulate.montecarlo.montecarlo`. Raises as `simulate`."""
        from obsdesign.simulate.montecarlo import montecarlo

        return montecarlo(self, runs, jobs, progress, changes)

    def to_control(self) -> "NonlinearIOSystem":
        """Observer as a system of python-control: inputs u and y, outputs `hat_..`, states by their names.

        Raises `UsageError`: there are no gains, python-control is not installed, or the observer has no such equations.
        """
        from obsdesign.exports.control import to_control

        return to_control(self.observer, self.spec.period, self.spec.name)

    def expected(self, summary: Mapping[str, Any] | None = None) -> list[dict[str, Any]]:
        """What the spec expects of its result (and of a run with this summary): `key`, `expected`, `found`, `holds`."""
        known = {"status": str(Verdict.UNCERTIFIED)} if self.status is Verdict.NO_GUARANTEE else self.result
        content = {**known, **(run := {} if summary is None else {"simulation": summary})}
        told = {key: value for key, value in self.spec.expect.items() if run or not key.startswith("simulation.")}
        return [
            {
                "key": key,
                "expected": value.get("verified") if isinstance(value, Mapping) else value,
                "found": (found := at(content, key)),
                "holds": meets(found, value),
            }
            for key, value in told.items()
        ]

    def unmet(self, summary: Mapping[str, Any] | None = None) -> list[Problem]:
        """What the spec expects of its result, or of a run with this summary, and does not get."""
        found = []
        for e in self.expected(summary):
            if e["key"].startswith("simulation.") == bool(summary) and not e["holds"]:
                said = f"expected {e['expected']}, found {'nothing' if e['found'] is None else e['found']}"
                found.append(Problem(said, self.spec.path, key=f"expect.{e['key']}", id="OBS617"))
        return found

    def table(self) -> list[tuple[str, str]]:
        """What an engineer wants to know of it, as rows of a name and a text."""
        from obsdesign.tables.design import design_rows

        local = {"local": self.spec.validity} if self.claim and self.spec.validity else {}
        local |= {"set": ", ".join(self.spec.changes)} if self.spec.changes else {}
        return design_rows({"name": self.spec.name, "signals": self.spec.signals, **self.contents(), **local})

    def __repr__(self) -> str:
        return f"<design of {self.spec.name!r}: {self.status}>"

    def __str__(self) -> str:
        return aligned(self.table())

    def _repr_html_(self) -> str:
        """Table of the design for a notebook."""
        rows = (f"<tr><th>{html.escape(name)}</th><td>{html.escape(text)}</td></tr>" for name, text in self.table())
        return f"<table>{''.join(rows)}</table>"


def design_of(file: ResultFile, spec: Spec | None = None) -> Design:
    """Design of a result file; a claim of one that says it is certified is proved anew. See `work.read`."""
    spec = spec_of(file, spec)
    family, status = FAMILIES[spec.observer.type], file.status
    if status == Verdict.INFEASIBLE:
        raise file.wrong("status", "infeasible: this result has no gains", id="OBS709")
    gains = {name: in_floats(gain) for name, gain in family.gains(spec, file).items()}
    claim = family.claim(spec, file) if status == Verdict.CERTIFIED else None
    proved = claim is not None and claim.holds
    verdict = Verdict.CERTIFIED if proved else Verdict.UNCERTIFIED
    made = Design.of(spec, Outcome(verdict, gains, claim, form=family.form(spec, file)), recorded=file)
    if proved:
        require_agreement(file, made.claimed(), spec)
    return made


def spec_of(file: ResultFile, spec: Spec | None) -> Spec:
    """Spec that travels in a file, unaltered, which must be the one that is given, if one is."""
    text, changes = file.spec_text(), file.changes()
    if spec is None:
        spec = replace(loads(text, f"{file.path} (spec.text)", changes), origin=str(file.at("spec", "path")))
    if spec.text != text:
        said = f"these gains belong to another spec than {spec.path}"
        if opened(spec.text, spec.path).root.plain() == opened(text, file.path).root.plain():
            said += ", of which only comments or layout differ"
        raise file.wrong("spec.sha256", f"{said}; solve it again, or verify the file alone", id="OBS704")
    if spec.changes != changes:
        spec = loads(text, spec.path, changes)
    spec = named(file, spec)
    FAMILIES[spec.observer.type].require_claims(spec)
    require_types(file, spec)
    found = as_read(entry(spec))
    if file.content.get("split") != found.get("split"):
        raise file.wrong("split", "is not how the equations of the spec are split", id="OBS705")
    if file.content.get("discretised") != found.get("discretised"):
        raise file.wrong("discretised", "is not the plant in samples that the spec asks for", id="OBS705")
    return spec


def named(file: ResultFile, spec: Spec) -> Spec:
    """Spec of a file with the name that it has there: that of its text, or else of its path."""
    name, known = file.at("name"), [spec.name]
    if spec.name == named_by(spec.path):  # the text may have none
        known.append(named_by(str(file.at("spec", "path"))))
    if name not in known:
        raise file.wrong("name", f"is not that of the spec in the file; expected {known[-1]}", id="OBS703")
    return replace(spec, name=name)


def proof_of(file: ResultFile, spec: Spec | None = None) -> Proof:
    """Prove the claim of a result file: its guarantee, or that there is no solution. See `work.verify`."""
    spec, status = spec_of(file, spec), file.status
    if status in (Verdict.INFEASIBLE, Verdict.REFUTED):
        proof = FAMILIES[spec.observer.type].absence(spec, file)
        if proof.holds and status == Verdict.INFEASIBLE:
            require_agreement(file, {}, spec)
            require_dual(file, proof)
        proof = replace(proof, claim="; ".join([proof.claim, *([DOUBLES] if spec.rounded else []), *spec.changed]))
    elif status != Verdict.CERTIFIED:
        raise file.wrong("status", f"{status!r} claims nothing; only a certified result can be verified", id="OBS706")
    else:
        proof = design_of(file, spec).proof
    return replace(proof, numerical=tuple(numerical(file.content, spec))) if proof.holds else proof
