"""A result file as the page shows it: what it says, what of that was proved anew, and how a run goes."""

import hashlib
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from obsdesign.batches.record import samples_of
from obsdesign.design import Design, design_of, proof_of, spec_of
from obsdesign.errors import ObsdesignError, Problem, TimeLimitError, UsageError
from obsdesign.families import FAMILIES
from obsdesign.families.outcome import BETTER, Outcome, Proof, Verdict
from obsdesign.files import ResultFile
from obsdesign.records import dataclass, field
from obsdesign.reports import curves
from obsdesign.reports.chart import Chart
from obsdesign.reports.expected import in_all, rows_of, told_of
from obsdesign.reports.problem import DesignProblem
from obsdesign.reports.trajectories import Signals, charts
from obsdesign.tables.design import analysis, background, limits
from obsdesign.tables.run import run_rows
from obsdesign.tables.text import at_least, at_most

Rows = list[tuple[str, str]]
TONES = {"certified": "good", "infeasible": "plain", "refuted": "plain"}  # others are a warning
RATES = ("alpha", "decay")
LARGER = {*(key for key, sense in BETTER.items() if sense > 0), "T2_max"}.difference(RATES)
COMPUTED = (
    "numerical",
    "figures",
    "points",
    "diagnosis",
    "checks",
    "origin",
    "numbers",
    "expected",
)  # as they are shown
SAID = ("reason", "suggestion")  # of a diagnosis, shown first


@dataclass(frozen=True)
class Gain:
    """A gain with the very decimals of its file, and how other tools write it."""

    name: str
    rows: tuple[tuple[str, ...], ...]

    @property
    def python(self) -> str:
        """List of rows."""
        return "[" + ", ".join(f"[{', '.join(row)}]" for row in self.rows) + "]"

    @property
    def matlab(self) -> str:
        """Rows between semicolons."""
        return "[" + "; ".join(", ".join(row) for row in self.rows) + "]"


@dataclass(frozen=True)
class Trial:
    """A run: its charts, what it achieved, and where it comes from; or why there is none."""

    charts: tuple[Chart, ...] = ()
    rows: tuple[tuple[str, str], ...] = ()
    origin: str = ""
    summary: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Entry:
    """A result file, read, proved anew, and tried."""

    anchor: str
    file: ResultFile
    design: Design
    proof: Proof | None  # made of the file now; None where it claims nothing that can be proved
    trial: Trial

    @classmethod
    def of(cls, file: ResultFile, anchor: str, samples: bool) -> "Entry":
        """Prove the claim of a file anew, and run its simulation, or read the run that a batch recorded with it.

        `samples`: whether that is read where there is one. Raises `UsageError`: the file is malformed, or says more
        than is proved.
        """
        spec, status = spec_of(file, None), file.status
        if status == Verdict.INFEASIBLE:
            outcome = Outcome(Verdict.INFEASIBLE, diagnosis=file.table("diagnosis"))
            design = Design.of(spec, outcome, recorded=file)
            proof = proof_of(file, spec) if "certificate" in file.table("diagnosis") else None
        else:
            design = design_of(file, spec)
            certified = status == Verdict.CERTIFIED
            proof = design.proof if certified else proof_of(file, spec) if status == Verdict.REFUTED else None
        return readable(cls(anchor, file, design, proof, trial_of(design, file.path, samples)))

    @property
    def broken(self) -> str:
        """What the file claims and is not proved anew; empty: nothing."""
        failed = [check.name for check in self.proof.checks if not check.holds] if self.proof else []
        return "" if self.proof is None or self.proof.holds else f"not proved: {', '.join(failed)}"

    @property
    def name(self) -> str:
        """Name of the spec."""
        return self.design.spec.name

    @property
    def family(self) -> str:
        """Type of the observer."""
        return self.design.spec.observer.type

    @property
    def status(self) -> str:
        """Status that the file has, unless its claim is not proved."""
        return "NOT PROVED" if self.broken else self.file.status

    @property
    def tone(self) -> str:
        """How the status is colored."""
        return TONES.get(self.status, "warn")

    @cached_property
    def content(self) -> Mapping[str, Any]:
        """The file as it was written."""
        return self.design.result

    @cached_property
    def problem(self) -> DesignProblem:
        """What is to be estimated."""
        return DesignProblem.of(self.design.spec)

    @property
    def statement(self) -> tuple[str, str]:
        """What is proved, unless the verdict says it in the same words, and of which observer."""
        said = str(self.content.get("guarantee", {}).get("statement", ""))
        claim, _, observer = said.partition("; for ")
        told = self.proof is not None and claim in self.proof.claim
        return "" if told else claim, observer

    @property
    def remarks(self) -> list[str]:
        """Sentences that are made of the spec anew, whatever the file says."""
        return [*self.design.spec.notes, *self.design.spec.idle]

    @property
    def notes(self) -> list[str]:
        """Further sentences of the file, which nothing holds against anything."""
        return [note for note in map(str, self.content.get("notes", [])) if note not in self.remarks]

    @property
    def local(self) -> str:
        """Where a guarantee holds; empty: everywhere."""
        return self.design.spec.validity or ""

    @property
    def numbers(self) -> Mapping[str, float]:
        """Numbers of the guarantee that are proved."""
        claimed = self.content.get("guarantee", {}) if self.proof and self.proof.holds else {}
        numerical = set(self.content.get("numerical", []))
        plain = {k: v for k, v in claimed.items() if isinstance(v, int | float) and not isinstance(v, bool)}
        rates = claimed.get("rates", {})
        slowest = {"alpha": min(rates.values())} if rates else {}
        return {k: float(v) for k, v in {**plain, **slowest}.items() if f"guarantee.{k}" not in numerical}

    @property
    def gamma(self) -> float | None:
        """Gain that is proved, for v itself."""
        return self.numbers.get("gamma_v", self.numbers.get("gamma"))

    @property
    def rate(self) -> float | None:
        """Rate of decay that is proved, 1/s."""
        return next((self.numbers[key] for key in RATES if key in self.numbers), None)

    @property
    def others(self) -> Rows:
        """Further numbers that are proved and are the better the larger they are, rounded down; rho rounded up."""
        rho = [("rho", at_most(self.numbers["rho"]))] if "rho" in self.numbers else []
        return rho + [(key, at_least(value)) for key, value in self.numbers.items() if key in LARGER]

    @property
    def proved(self) -> Rows:
        """What is proved, in the words of the family."""
        made, claimed = self.content.get("observer", {}), self.content.get("guarantee", {})
        if not made or not self.proof or self.status != Verdict.CERTIFIED:
            return []
        said = [row for row in FAMILIES[self.family].proved(made, claimed) if row[0] != "says"]
        return [*said, *([("signals", self.design.spec.signals)] if self.design.spec.signals else [])]

    @property
    def numerical(self) -> Rows:
        """What is computed in doubles and proves nothing."""
        made, claimed = self.content.get("observer", {}), self.content.get("guarantee", {})
        figures = FAMILIES[self.family].figures(made) if made and self.gains else []
        own = [row for row in figures if row[0] not in self.design.gains]
        computed = self.design.analysis if self.gains else {}  # anew: nothing of it has to stand in a file
        return [*limits(claimed), *background(claimed), *own, *analysis(computed, claimed)]

    @property
    def equations(self) -> Rows:
        """Equations of an observer that has no gains."""
        made = self.content.get("observer", {})
        return FAMILIES[self.family].figures(made) if made and not self.gains else []

    @cached_property
    def gains(self) -> list[Gain]:
        """Gains as they stand in the file."""
        made = self.file.content.get("observer", {})
        return [Gain(n, tuple(tuple(row) for row in made[n])) for n in self.design.gains if made.get(n)]

    @property
    def checks(self) -> list[tuple[str, bool, str]]:
        """Every condition of the proof, whether it holds, and its margin in doubles where the file has one."""
        told = {check.get("name"): check.get("margin") for check in conditions(self.content.get("certificate", {}))}
        margins = {name: f"{margin:.3g}" for name, margin in told.items() if isinstance(margin, int | float)}
        return [(c.name, c.holds, margins.get(c.name, "")) for c in (self.proof.checks if self.proof else ())]

    @property
    def diagnosis(self) -> Rows:
        """Why there are no gains as the file says it, the reason first: what is proved of it is the claim."""
        said = self.content.get("diagnosis", {})
        found = {key: value for key, value in said.items() if key not in ("proof", "certificate")}
        first = {key: found.pop(key) for key in SAID if key in found}
        return [(key, text) for key, value in {**first, **found}.items() for text in [told_of(value)] if text]

    @property
    def figures(self) -> list[Chart | curves.Map]:
        """Charts of a search."""
        return list(curves.figures(self.content.get("search", {})))

    @property
    def points(self) -> curves.Table | None:
        """Points of a search."""
        return curves.table(self.content.get("search", {}))

    @cached_property
    def expected(self) -> list[dict[str, Any]]:
        """What the spec expects of its result, with what a paper prints, what was found, and what that rests on."""
        return rows_of(self.design, self.proof, self.trial.summary)

    @property
    def meets(self) -> str:
        """Whether it is what the spec expects, as far as that is proved."""
        return in_all(self.expected)

    @property
    def origin(self) -> Rows:
        """Versions and hashes."""
        tool, solver, spec, theorem = (self.content.get(key, {}) for key in ("tool", "solver", "spec", "theorem"))
        rows = [
            ("result file", self.file.path),
            ("SHA-256 of it", hashlib.sha256(self.file.raw).hexdigest()),
            ("spec", spec.get("path")),
            ("SHA-256 of it", spec.get("sha256")),
            ("made by", f"obsdesign {tool.get('version')}, Python {tool.get('python')}, cvxpy {tool.get('cvxpy')}"),
            ("solver", f"{solver.get('name')} {solver.get('version')}, {solver.get('solves')} solves"),
            ("created", self.content.get("created")),
            *([("theorem", recorded(theorem))] if theorem else ()),
        ]
        return [(name, str(value)) for name, value in rows if value is not None]


def recorded(theorem: Mapping[str, str]) -> str:
    """That the kernel of a proof assistant accepted the theorem of a result, as the file has it."""
    said = f"{theorem['name']} accepted by Coq {theorem['coq']} on {theorem['accepted']}"
    return f"{said}, SHA-256 of it {theorem['sha256']}; as recorded: `verify --theorem coq --compile` checks it"


def readable(entry: Entry) -> Entry:
    """Entry whose parts that are not proved have the form that they are shown in; raises `UsageError`: one has not."""
    for name in COMPUTED:
        try:
            getattr(entry, name)
        except (AttributeError, IndexError, KeyError, OverflowError, TypeError, ValueError):
            said = f"its {name}, of which nothing is proved, cannot be read; expected what `solve` writes"
            raise entry.file.wrong("", said, id="OBS702") from None
    return entry


def conditions(certificate: Any) -> Iterator[Mapping[str, Any]]:
    """Conditions of a certificate and of those within it."""
    if isinstance(certificate, Mapping):
        yield from (check for check in certificate.get("checks", []) if isinstance(check, Mapping))
        for part in certificate.values():
            yield from conditions(part)


def trial_of(design: Design, path: str, samples: bool) -> Trial:
    """Run of a design, made now or read where a batch recorded it with this file; the reason where there is none."""
    if design.spec.simulation is None or not design.built:
        return Trial()
    try:
        if samples and (beside := samples_of(Path(path))):
            signals, origin = Signals.read(str(beside), design.spec), f"read from {beside.name}, not run anew"
            return Trial(tuple(charts(signals, design.spec)), origin=origin)
        run = design.simulate()
    except TimeLimitError:
        raise
    except ObsdesignError as error:
        return Trial(origin=f"no run: {'; '.join(str(problem) for problem in error.problems)}")
    rows = run_rows(run.summary, design.spec, bool(design.guarantee or (design.proved and design.form)))
    return Trial(tuple(charts(Signals.of(run), design.spec)), tuple(rows), "run while this page was made", run.summary)


@dataclass(frozen=True)
class Missing:
    """A spec or a file of which there is no report, and why."""

    name: str
    status: str
    problem: str
    problems: tuple[Problem, ...] = ()  # of a file that cannot be read


def opened(path: str, anchor: str, samples: bool) -> Entry | Missing:
    """Entry of a file, or why it has none."""
    try:
        return Entry.of(ResultFile.open(path), anchor, samples)
    except UsageError as error:
        return unread(path, error)


def unread(path: str, error: UsageError) -> Missing:
    """File that cannot be read."""
    return Missing(path, "invalid", "; ".join(map(str, error.problems)), error.problems)
