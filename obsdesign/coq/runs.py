"""Identities of an observer as a file of Coq: its run, what is stated of its errors, and the proof."""

from collections.abc import Iterator, Sequence
from textwrap import wrap

from obsdesign.coq.decimals import comment
from obsdesign.coq.identities import Identities
from obsdesign.coq.laws import TIME, Back, Falling, Stated, facts
from obsdesign.coq.signals import Ends, UnknownTermError, bounds, literal, operand, text
from obsdesign.coq.theorem import UnexportedError
from obsdesign.expressions.needs import Need
from obsdesign.records import dataclass

WIDTH = 120
IMPORTS = """\
Require Import Reals Lra.
From Coquelicot Require Import Coquelicot.
From Obs Require Import ObsIdentity.
Open Scope R_scope.
"""
SIGNS = {"is not 0": "{} <> 0", "> 0": "0 < {}", ">= 0": "0 <= {}"}
Part = Stated | Falling | Back


def exported(claim: Identities, heading: Sequence[str]) -> str:
    """File of Coq, headed by words. Raises `UnexportedError`: an identity is not one that field proves."""
    try:
        parts: list[Part] = [Stated(claim, law) for law in claim.laws]
        parts += [Falling(claim, fall) for fall in claim.falls]
        parts += [Back(claim, claim.inverse)] if claim.inverse.states else []
        body = "\n".join([*record(claim), "", *theorem(claim, parts), ""])
        return "\n".join([*map(comment, heading), IMPORTS, *map(wrapped, body.split("\n"))])
    except UnknownTermError as error:
        raise UnexportedError(str(error)) from None


@dataclass(frozen=True)
class Premise:
    """A field of the record of a run: its name, what it says, and how the proof calls it."""

    name: str
    text: str
    own: str


def wrapped(line: str) -> str:
    """Line that is no longer than can be read."""
    inner = " " * (len(line) - len(line.lstrip()) + 2)
    return "\n".join(wrap(line, WIDTH, subsequent_indent=inner, break_long_words=False, break_on_hyphens=False))


def premises(claim: Identities) -> list[Premise]:
    """The equations of plant and observer, ranges, and what is needed and not proved of these."""
    run, names, found = claim.run, claim.names, list[tuple[str, str, str]]()
    for kind, sides in (("plant", run.states), ("observer", run.observer)):
        for name, side in sides.items():
            found.append((kind, names[name], f"{TIME} is_derive {names[name]} t {operand(side, names)}"))
    found += [("held", names[u], f"{TIME} is_derive {names[u]} t 0") for u in run.held]
    found += [("output", names[y], f"forall t, {names[y]} t = {text(side, names)}") for y, side in run.outputs.items()]
    found += [("range", names[x], f"{TIME} {between(names[x], ends)}") for x, ends in limited(claim).items()]
    found += [("needed", str(i), f"{TIME} {signed(claim, one)}") for i, one in enumerate(premised(claim), start=1)]
    return [Premise(f"{kind}_{name}", said, f"{kind}_{name}'") for kind, name, said in found]


def record(claim: Identities) -> Iterator[str]:
    """Premises about a run."""
    yield "(* Plant and observer up to the time T: each signal is a function of time *)"
    yield f"Record run (T : R) ({signals(claim)} : R -> R) : Prop := {{"
    yield ";\n".join(f"  {one.name} : {one.text}" for one in premises(claim)) + " }."


def signals(claim: Identities) -> str:
    """Names in Coq of all signals of a run."""
    run = claim.run
    return " ".join(claim.names[n] for n in (*run.states, *run.inputs, *run.outputs, *run.observer, *run.free))


def limited(claim: Identities) -> dict[str, Ends]:
    """Ranges of signals that have some."""
    run, given = claim.run, claim.run.ranges.items()
    twins = {y for y, side in run.outputs.items() if side.text in run.ranges}
    return {name: ends for name, ends in given if name in claim.names and name not in twins}


def between(own: str, ends: Ends) -> str:
    """Range in Coq."""
    low, high = (None if end is None else literal(end).text for end in ends)
    if low is None or high is None:
        return f"{own} t <= {high}" if low is None else f"{low} <= {own} t"
    return f"{low} <= {own} t <= {high}"


def premised(claim: Identities) -> list[Need]:
    """Needs that are no consequences of ranges."""
    return [n for n in claim.needed.values() if not bounds(n.value, claim.run.ranges).shows(n.sign)]


def signed(claim: Identities, one: Need) -> str:
    """Need in Coq."""
    inner = text(one.value, claim.names)
    return SIGNS[one.sign].format(inner)


def theorem(claim: Identities, parts: Sequence[Part]) -> Iterator[str]:
    """The theorem and its proof."""
    names, run = claim.names, claim.run
    lets = {names[name]: side for name, side in claim.defined.items()}
    lets |= {names[f"rate {law.error}"]: law.rates[law.error] for law in claim.laws if law.alone}
    yield f"Theorem for_this_f : forall T {signals(claim)},"
    yield f"  run T {signals(claim)} ->"
    for name, side in lets.items():
        yield f"  let {name} t := {text(side, names)} in"
    yield "  " + "\n  /\\ ".join(one.statement for one in parts) + "."
    yield f"Proof. intros T {signals(claim)} [{' '.join(one.own for one in premises(claim))}]."
    for name in run.outputs:
        yield f" apply same in output_{names[name]}'. subst {names[name]}. cbv beta in *."
    yield from shown(claim)
    yield f" intros {' '.join(lets)}."
    yield f" {'split; [|' * (len(parts) - 1)}idtac{']' * (len(parts) - 1)}."
    for one in parts:
        yield from (f" {'- ' if i == 0 else '  '}{line}" for i, line in enumerate(one.proof()))
    yield "Qed."
    yield "Print Assumptions for_this_f."


def shown(claim: Identities) -> Iterator[str]:
    """Proofs of the needs that follow from ranges."""
    left = premised(claim)
    for i, one in enumerate((n for n in claim.needed.values() if n not in left), start=1):
        yield f" assert (shown_{i}' : {TIME} {signed(claim, one)})."
        last = "intros Z'; lra" if one.sign == "is not 0" else "lra"
        yield f" {{ intros t K'. {facts(claim, one.value)}{last}. }}"
