"""What is proved of an observer without an LMI, as a file holds it and as it is read: every statement, anew."""

import json
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from flint import fmpq

from obsdesign.families.agreement import require_agreement
from obsdesign.families.algebraic import coordinates, high_gain, immersion
from obsdesign.families.algebraic.forms import Form, Immersion, Sought, Transformed
from obsdesign.families.algebraic.found import found, read_found
from obsdesign.families.algebraic.identity import Answer, Verdict
from obsdesign.families.algebraic.region import Region
from obsdesign.families.algebraic.request import request_of
from obsdesign.families.algebraic.scheme import OPEN, Plant, Scheme
from obsdesign.families.outcome import Outcome, Proof
from obsdesign.families.outcome import Verdict as Status
from obsdesign.files import ResultFile
from obsdesign.lmi.formula import Array, below, printed, rational_number
from obsdesign.lmi.proof import Check
from obsdesign.records import dataclass, replace
from obsdesign.spec import Spec
from obsdesign.tables.text import at_least, at_most

KIND = "identities"
DIGITS = 6  # of a rate


@dataclass(frozen=True)
class Claim:
    """An observer, and what was found of every statement that it rests on."""

    form: Form
    scheme: Scheme
    region: Region
    stated: Mapping[str, float] | None = None  # rates of a file; None: those that are proved

    @classmethod
    def of(cls, spec: Spec, form: Form) -> "Claim":
        """Claim of a spec with an observer."""
        assert spec.typed
        plant = Plant.of(spec.typed)
        return cls(form, built(plant, form), plant.region)

    @cached_property
    def verdicts(self) -> tuple[Verdict, ...]:
        """What was found of each statement."""
        return tuple(statement.decided(self.region) for statement in self.scheme.statements)

    @property
    def checks(self) -> tuple[Check, ...]:
        """Every statement."""
        return tuple(Check(v.name, v.answer is Answer.PROVED, np.inf) for v in self.verdicts)

    @property
    def holds(self) -> bool:
        """Whether every statement is proved."""
        return all(verdict.answer is Answer.PROVED for verdict in self.verdicts)

    @property
    def refuted(self) -> tuple[Verdict, ...]:
        """Statements that are false."""
        return tuple(verdict for verdict in self.verdicts if verdict.answer is Answer.REFUTED)

    def guarantee(self, spec: Spec) -> None:  # noqa: ARG002
        """Nothing that a run could be held against: what is proved is algebra."""
        return

    @property
    def rates(self) -> Mapping[str, float]:
        """Proved rates of decay, 1/s, by the name of the coordinate: decimals, none above what is proved."""
        if self.stated is not None:
            return self.stated
        bounds = {verdict.name: verdict.bound for verdict in self.verdicts}
        found = {name: bounds.get(statement) for name, statement in self.scheme.rates.items()}
        proved = {name: rational_number(-bound) for name, bound in found.items() if bound is not None}
        return {name: float(at_least(rate, DIGITS)) for name, rate in proved.items()}

    def headline(self, spec: Spec) -> str:
        """Claim in one line."""
        return self.statement(spec)

    def statement(self, spec: Spec) -> str:
        """Claim in words, clause by clause, and what it does not say."""
        assert spec.typed
        rates = ", ".join(f"{at_least(rate)} 1/s of {name}" for name, rate in self.rates.items())
        fall = [f"these errors fall at least at the rate {rates}"] if rates else []
        kept = [f"{name} in {interval(*ends)}" for name, ends in spec.typed.domain.items()]
        domain = f"stays in its domain ({', '.join(kept)})" if kept else "has a solution"
        where = f"all of it without disturbance and noise, as long as the plant {domain} and the observer has a value"
        return "; ".join([*self.scheme.says, *fall, where, *(f"{OPEN}{said}" for said in self.scheme.depends)])

    def theorem(self, spec: Spec) -> str:
        """Claim as a file of Coq; raises `UnexportedError`."""
        assert spec.typed
        from obsdesign.families.algebraic.exported import theorem

        return theorem(spec, self)

    def written(self, spec: Spec, limits: Mapping[str, Any]) -> dict[str, Any]:  # noqa: ARG002
        """What is proved, and the statements that prove it."""
        if self.refuted:
            return {"certificate": {"kind": KIND, "checks": self.listed}}
        guarantee = {**self.scheme.numbers, "rates": dict(self.rates), "statement": self.statement(spec)}
        return {"guarantee": guarantee, "certificate": {"kind": KIND, "checks": self.listed}}

    @property
    def listed(self) -> list[dict[str, Any]]:
        """Statements of a certificate."""
        return [{"name": v.name, "holds": v.answer is Answer.PROVED, "answer": str(v.answer)} for v in self.verdicts]


def interval(low: fmpq | None, high: fmpq | None) -> str:
    """Range, in decimals that are within it."""
    return f"[{'-inf' if low is None else at_most(low)}, {'inf' if high is None else at_least(high)}]"


def built(plant: Plant, form: Form) -> Scheme:
    """Scheme of an observer."""
    if isinstance(form, Transformed):
        return coordinates.scheme(plant, form)
    return immersion.scheme(plant, form) if isinstance(form, Immersion) else high_gain.scheme(plant, form)


def read(spec: Spec, file: ResultFile) -> Claim:
    """Claim of a file, every statement decided anew: what the file says of it must be what they say."""
    claim = Claim.of(spec, read_form(spec, file))
    if claim.refuted:
        return claim
    if not isinstance(request_of(spec).form, Sought):
        require_no_search(spec, file)
    claim = replace(claim, stated=read_rates(file, claim.rates))
    said = claim.written(spec, {})["guarantee"]
    found = file.table("guarantee")
    for name in said.keys() - {"rates"}:
        if as_text(found.get(name)) != as_text(said[name]):
            raise file.wrong(f"guarantee.{name}", "does not say what the statements of the observer say", id="OBS705")
    return claim


def require_no_search(spec: Spec, file: ResultFile) -> None:
    """Refuse notes on a search where there was none: all that is noted then is known of the spec."""
    for i, note in enumerate(file.content.get("notes", [])):
        if note not in (*spec.notes, *spec.idle):
            raise file.wrong(f"notes[{i}]", "is no note that is made of this spec and its observer", id="OBS705")


def read_rates(file: ResultFile, proved: Mapping[str, float]) -> dict[str, float]:
    """Rates of decay of a file, each the decimal that it holds: one that is not above what is proved is believed."""
    rates = {}
    for name in file.table("guarantee", "rates"):
        rate = file.number("guarantee", "rates", name)
        if name not in proved:
            raise file.wrong(f"guarantee.rates.{name}", "no rate of this is proved", id="OBS705")
        if rate > printed(proved[name]):
            raise file.wrong(f"guarantee.rates.{name}", "is faster than the statements prove", id="OBS705")
        rates[name] = below(rate)
    return rates


def as_text(value: Any) -> str:
    """Entry of a file as text."""
    return json.dumps(value, sort_keys=True)


def refutation(spec: Spec, file: ResultFile) -> Proof:
    """Proof that an observer is none: a statement that it rests on is false."""
    if isinstance(request_of(spec).form, Sought):
        raise file.wrong("status", "refuted: coordinates that are found are proved, or there are none", id="OBS705")
    claim = Claim.of(spec, read_form(spec, file))
    refuted = claim.refuted
    if not refuted:
        said = "refuted: every statement of the observer that could be decided is true"
        raise file.wrong("status", said, id="OBS705")
    require_no_search(spec, file)
    outcome = Outcome(Status.REFUTED, claim=claim, form=claim.form)
    observer = {"type": spec.observer.type, **written(spec, outcome)}
    require_agreement(file, {"observer": observer, **claim.written(spec, {})}, spec)
    require_found(file, diagnosis(claim))
    return Proof(
        f"refuted: {refuted[0].sentence}",
        tuple(Check(f"it is false that {v.sentence}", True, abs(v.value)) for v in refuted),
    )


def diagnosis(claim: Claim) -> dict[str, Any]:
    """What is false, and where."""
    first, *others = claim.refuted
    also = f"; {len(others)} further statements fail" if others else ""
    reason = f"{first.sentence}{also}"
    return {"id": "OBS612", "condition": "identity", "reason": reason, **first.written(), "feasible": {}}


def require_found(file: ResultFile, said: Mapping[str, Any]) -> None:
    """Refuse a file whose diagnosis is not the one that is found anew."""
    keys = {*file.table("diagnosis"), *said}
    found = file.plain()["diagnosis"]
    for key in sorted(keys):
        if as_text(found.get(key)) != as_text(said.get(key)):
            words = "is not what is found anew of the statements of the observer"
            raise file.wrong(f"diagnosis.{key}", words, id="OBS705")


def read_form(spec: Spec, file: ResultFile) -> Form:
    """Observer of a file: that of its spec, or the coordinates that were found for it."""
    asked = request_of(spec).form
    assert asked is not None
    return read_found(spec, file) if isinstance(asked, Sought) else asked


def read_gains(spec: Spec, file: ResultFile) -> Mapping[str, Array]:  # noqa: ARG001
    """No gains: these observers have none."""
    return {}


def written(spec: Spec, outcome: Outcome) -> dict[str, Any]:  # noqa: ARG001
    """Entry `observer` of a result file: its equations, as they run."""
    if not isinstance(outcome.claim, Claim):
        return {}
    observer = outcome.claim.scheme.observer
    form = outcome.claim.form
    return {
        "order": len(observer.dynamics),
        **(found(form) if isinstance(form, Transformed) else {}),
        "dynamics": {name: side.text for name, side in observer.dynamics.items()},
        "estimates": {name: side.text for name, side in observer.estimates.items()},
        **({"initial": {name: side.text for name, side in observer.initial.items()}} if observer.initial else {}),
    }
