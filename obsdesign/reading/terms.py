"""The nonlinear terms of a plant as equations, each with a type: as it is declared, or as it is found."""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from math import inf

import numpy as np
from flint import fmpq

from obsdesign.errors import Problem
from obsdesign.expressions import Expression, ExpressionError, parse
from obsdesign.lmi.formula import Array
from obsdesign.model.disturbance import empty
from obsdesign.model.split import Row, Term, combination
from obsdesign.nonlinearities import TEMPLATES
from obsdesign.nonlinearities.evidence.restriction import EVERYWHERE, Ends
from obsdesign.reading import plant_schema as schema
from obsdesign.reading.blocks import Block, read_block, read_nonlinearity
from obsdesign.reading.plant import Names, Part
from obsdesign.reading.plant_schema import AUTO
from obsdesign.records import dataclass, replace
from obsdesign.sections.document import Loc, dotted
from obsdesign.sections.values import Entries, Reader
from obsdesign.sections.words import unknown
from obsdesign.spec import Nonlinearity

Domain = Mapping[str, Ends]
Measured = Mapping[str, tuple[str, fmpq]]  # states that an output shows: its name, and the factor
INTERVAL = re.compile(r"(\S+) in \[(\S+), (\S+)\]")
NEAR = 1e-6  # width of an interval that reads as a point


@dataclass(frozen=True)
class Typed:
    """A term with what the design may assume of it."""

    term: Term
    block: Block
    found: Nonlinearity

    def part(self, names: Names, width: int) -> Part:
        """How it is connected, in a plant of `width` terms."""
        term = self.term

        def over(order: Sequence[str]) -> Array:
            return table([[row.get(name, fmpq(0)) for name in order] for row in term.arguments], len(order))

        matrices = {
            "Bf": table([[term.enters.get(name, fmpq(0))] for name in names.states], 1),
            "Cq": over(names.states),
            "Dqf": table([[fmpq(0)] * width for _ in term.arguments], width),
            "Dq": over(names.w),
            "Df": table([[term.enters.get(name, fmpq(0))] for name in names.outputs], 1),
        }
        return Part(self.block, {key: Entries(self.block.loc, matrix) for key, matrix in matrices.items()}, None)


Declared = str | schema.TypeData


def read_types(
    reader: Reader, written: Mapping[str, Declared], terms: Sequence[Term], names: Names
) -> dict[int, tuple[Term, Loc, Declared]]:
    """Types that the spec declares, by the number of the term, which it names by its text, or f1, f2, ..

    A type may be that of the negative of a term.
    """
    signed = [(i, side) for i, term in enumerate(terms) for side in (term, term.negated)]
    texts = {side.text: (i, side) for i, side in reversed(signed)}
    texts |= {f"f{i + 1}": (i, term) for i, term in enumerate(terms) if f"f{i + 1}" not in texts}
    declared: dict[int, tuple[Term, Loc, Declared]] = {}
    signals = ("t", *names.states, *names.inputs, *names.w, *names.outputs)
    for key, value in written.items():
        place: Loc = ("system", "types", key)
        found = texts.get(key)
        if found is None:
            with suppress(ExpressionError):
                found = texts.get(parse(key, signals, reader.parameters).text)
        if found is None:
            allowed = [term.text for term in terms] or ["none, for the plant is linear"]
            reader.wrong(place, unknown("term", key, allowed, {}), at_key=True, id="OBS203")
        elif not isinstance(value, str) and (value.region or getattr(value.data, "region", None)):
            reader.wrong(
                place,
                "a type has no region here: a term stays where system.domain keeps what it depends on",
                id="OBS213",
            )
        elif found[0] in declared:
            reader.wrong(place, f"{found[1].text} has a type already; give one", at_key=True, id="OBS206")
        else:
            declared[found[0]] = found[1], place, value
    return declared


@dataclass(frozen=True)
class Trial:
    """A term, or its negative, read with a type on a region; nothing is found where there are problems."""

    term: Term
    block: Block
    found: Nonlinearity | None
    problems: Sequence[Problem]
    notes: Sequence[str]


@dataclass(frozen=True)
class Types:
    """What the types of terms are read from."""

    reader: Reader
    names: Names
    known: Sequence[str]  # what a term may depend on besides states and disturbances
    domain: Domain
    measured: Measured
    constants: bool  # whether every term needs a Lipschitz constant

    def typed(self, term: Term, place: Loc, declared: Declared) -> Typed | None:
        """A term with its type; None after an error.

        It holds everywhere, or for all q, if that is as good as on the domain. The slope of a term that only its
        negative has bounded below is that of the negative.
        """
        region = self.region(term)
        known = {name: ends for name, ends in region.items() if not re.fullmatch(r"q\d+", name)}
        places = {str(written(limits, term.f, len(term.arguments))): limits for limits in (region, known, {})}
        signs = (term, term.negated) if declared == AUTO and len(term.arguments) == 1 else (term,)
        trials = [self.trial(signs, place, declared, limits) for limits in reversed(places.values())]
        found = [trial for trial in trials if trial.found is not None]
        if not found:
            self.reader.problems.append(self.renamed(trials[-1].problems[0], place, term, declared))
            return None
        best = next(trial for trial in found if same_type(trial, found[-1]))
        assert best.found
        self.reader.notes += [f"{best.term.text}: {note.partition(': ')[2]}" for note in best.notes]
        called = tuple(combination(row).text for row in term.arguments)
        return Typed(best.term, best.block, replace(best.found, term=best.term.text, arguments=called))

    def trial(self, signs: Sequence[Term], place: Loc, declared: Declared, region: Domain) -> Trial:
        """First sign of a term for which the type is found, or the first trial where there is none.

        Where constants are needed, a Lipschitz constant is sought beside any other type.
        """
        kinds: list[Declared] = [declared]
        if self.constants and declared == AUTO:
            kinds += [schema.TypeData(name, AUTO) for name, template in TEMPLATES.items() if template.lipschitz]
        trials: list[Trial] = []
        for kind in kinds:
            for side in signs:
                trials.append(self.attempt(side, place, kind, region))
                if trials[-1].found is not None:
                    return trials[-1]
        return trials[-len(signs)]

    def attempt(self, term: Term, place: Loc, declared: Declared, region: Domain) -> Trial:
        """Read a term as a block of its own; what is wrong is kept apart."""
        trial = Reader(self.reader.document, [], judged=self.reader.judged)
        trial.parameters, trial.exact, trial.used = self.reader.parameters, self.reader.exact, self.reader.used
        nq = len(term.arguments)
        section = schema.Function(type=declared, f=[term.f.text], region=written(region, term.f, nq))
        block = read_block(trial, section, place, nq, 1)
        found = read_nonlinearity(trial, block, self.known)
        if found is not None and self.constants and not found.lipschitz:
            trial.wrong(
                place, f"{found.type} has no Lipschitz constant, which this type of observer needs", id="OBS406"
            )
        return Trial(term, block, None if trial.problems else found, trial.problems, trial.notes)

    def region(self, term: Term) -> dict[str, Ends]:
        """Range of every variable of a term: its arguments, inputs, and outputs, which have that of what they show."""
        found = {f"q{i + 1}": over(row, self.domain) for i, row in enumerate(term.arguments)}
        seen = {output: over({state: factor}, self.domain) for state, (output, factor) in self.measured.items()}
        return {**found, **seen, **{name: ends for name, ends in self.domain.items() if name in term.f.names}}

    def renamed(self, problem: Problem, place: Loc, term: Term, declared: Declared) -> Problem:
        """Problem of a block as one of the term, in the names of the plant, at the equation in which it stands."""
        called = {f"q{i + 1}": combination(row).text for i, row in enumerate(term.arguments)}
        called["q"] = called["q1"]

        def of(match: re.Match[str]) -> str:
            return called[f"q{match[1]}"]

        found = problem.message.partition("; ")[0]
        found = re.sub(r"\bdf\d*/dq(\d*)\b", lambda match: f"its derivative by {of(match)}", found)
        found = re.sub(r"\bq(\d*)\b", of, found)
        found = re.sub(r"^f ", "it ", INTERVAL.sub(near, found))
        return replace(
            problem, key=dotted(place), message=f"the term {term.text}: {found}; {self.instead(term, declared)}"
        )

    def instead(self, term: Term, declared: Declared) -> str:
        """What to write for a term that has no type."""
        used = {name for row in term.arguments for name in row} | term.f.names.intersection(self.known)
        shown = {output: state for state, (output, _) in self.measured.items()}
        signals = [name for name in (*self.names.states, *self.names.w, *self.names.inputs, *self.names.outputs, "t")
                   if name in {shown.get(each, each) for each in used}]  # fmt: skip
        missing = [name for name in signals if name not in self.domain]
        kept = f"give system.domain of {', '.join(missing)}"
        kept = kept if missing else "give a smaller system.domain, without that"
        acting = [name for name in self.names.w if any(name in row for row in term.arguments)]
        if acting and len(term.arguments) > 1:
            said = f"it cannot be split: {acting[0]} enters it, and not by itself; write it as a disturbance of its own"
            return f"{said}, or {kept}"
        state = next((name for row in term.arguments for name in row if len(row) == 1 and name in self.measured), "")
        known = f", or write {self.measured[state][0]} for {state}, then it is known" if state else ""
        kind = ", or declare its type under system.types" if declared == AUTO else ", or another type"
        return f"{kept}{known or kind}"


def near(match: re.Match[str]) -> str:
    """Interval in words, a short one as a point."""
    name, low, high = match[1], float(match[2]), float(match[3])
    if low == -inf and high == inf:
        return f"any {name}"
    if max(abs(low), abs(high)) <= NEAR:
        return f"{name} near 0"
    return f"{name} near {low:.4g}" if high - low <= NEAR * abs(low) else match[0]


def same_type(wide: Trial, local: Trial) -> bool:
    """Whether a type on a larger region is the one on the domain, and is proved there: nothing more is assumed."""
    assert wide.found
    assert local.found
    same = (wide.found.type, wide.term.f) == (local.found.type, local.term.f)
    return wide is local or (same and not wide.found.assumed)


def written(region: Mapping[str, Ends], f: Expression, nq: int) -> dict[str, list[str]] | None:
    """Limits of the variables of f as a spec has them; those of q are q1, q2, .."""
    names = {"q" if nq == 1 and name == "q1" else name: ends for name, ends in region.items()}
    used = {name: ends for name, ends in names.items() if name in f.names and ends != EVERYWHERE}
    return {name: [limit(low, "-.inf"), limit(high, ".inf")] for name, (low, high) in used.items()} or None


def limit(value: fmpq | None, otherwise: str) -> str:
    """Limit as a spec has it."""
    return otherwise if value is None else str(value)


def over(row: Row, domain: Domain) -> Ends:
    """Range of a linear combination of signals."""
    low, high = fmpq(0), fmpq(0)
    ends: list[fmpq | None] = [low, high]
    for name, c in row.items():
        limits = domain.get(name, EVERYWHERE)
        if c < 0:
            limits = limits[1], limits[0]
        ends = [
            None if total is None or each is None else total + c * each
            for total, each in zip(ends, limits, strict=True)
        ]
    return ends[0], ends[1]


def table(rows: Sequence[Sequence[fmpq]], columns: int) -> Array:
    """Rows as a matrix."""
    return np.array(rows, dtype=object).reshape(len(rows), columns) if rows and columns else empty(len(rows), columns)
