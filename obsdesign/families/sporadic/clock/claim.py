"""Claims that clock-dependent certificates prove, as a file holds them and as they are read."""

import math
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from flint import fmpq

from obsdesign.coq.instants import exported
from obsdesign.families.sporadic.certificate import jitter, sequences, span
from obsdesign.families.sporadic.clock.exported import observer, parts
from obsdesign.families.sporadic.clock.guarantee import ClockGuarantee
from obsdesign.families.sporadic.clock.outage import Outage
from obsdesign.families.sporadic.clock.theorem import ErrorSystem, equations
from obsdesign.families.sporadic.clock.witness import Witness
from obsdesign.files import checks as listed
from obsdesign.lmi.formula import Array, above, approximate, below, printed
from obsdesign.lmi.proof import Check, Proved
from obsdesign.model.multiplier import Multiplier
from obsdesign.records import dataclass, replace
from obsdesign.spec import Spec
from obsdesign.tables.text import at_least, at_most

MEANING = "norm2(z) <= gamma norm2({w}) from zero error"  # of gamma
CONSTANTS = ("gamma", "overshoot", "initial", "disturbance", "noise")  # more of each holds too


@dataclass(frozen=True)
class ClockClaim(Proved):
    """What an observer achieves for every sequence of measurements that are T1 to T2 apart, a witness for each part."""

    system: ErrorSystem  # in rationals
    multiplier: Multiplier
    direct: bool  # whether w or f acts on the measured output, which the theorem does not know
    gains: Mapping[str, Array]  # L and H, or K; exact
    T1: fmpq
    T2: fmpq
    decay: fmpq
    witnesses: Mapping[str, Witness]  # by the names of GOALS
    longest: Witness | None = None  # of the largest T2 that given gains are proved to tolerate
    outage: Outage | None = None  # where measurements stay away for longer than T2
    asked: tuple[Check, ...] = ()  # that a designed gain keeps the bound of the spec
    stated: Mapping[str, fmpq] | None = None  # constants of a file; None: those that are proved

    @cached_property
    def checks(self) -> tuple[Check, ...]:
        """Every condition of every witness, and that each is about this claim."""
        more = self.longest.checks if self.longest else ()
        return (
            Check("D = 0 and Df = 0", not self.direct, 0.0),
            Check("0 <= T1 <= T2 and T2 > 0", 0 <= self.T1 <= self.T2 and self.T2 > 0, approximate(self.T2 - self.T1)),
            Check("there is a witness of gamma", "gamma" in self.witnesses, 0.0),
            Check("the decay is proved", self.rate >= self.decay >= 0, approximate(self.rate - self.decay)),
            *(check for witness in self.witnesses.values() for check in witness.checks),
            *(self.outage.checks if self.outage else ()),
            *self.asked,
            *self.keep(),
            *(replace(check, name=f"T2_max: {check.name}") for check in more),
            *self.reaches(),
        )

    def reaches(self) -> tuple[Check, ...]:
        """Whether the longest T2 is proved at the decay of the claim."""
        if self.longest is None:
            return ()
        room = self.longest.theorem.decay - self.decay
        return (Check("T2_max: the decay is proved", room >= 0, approximate(room)),)

    @property
    def rate(self) -> fmpq:
        """Rate at which the error is proved to decay; 0 without a witness of one."""
        found = self.witnesses.get("overshoot")
        return found.theorem.decay if found else fmpq(0)

    @cached_property
    def least(self) -> dict[str, fmpq]:
        """Constants that the witnesses prove, as decimals that print doubles, rounded up."""
        known = {name: x for w in self.witnesses.values() for name, x in w.constants().items()}
        found = {name: above(known[name]) for name in CONSTANTS if name in known}
        return {name: printed(value) for name, value in found.items() if math.isfinite(value)}

    @property
    def constants(self) -> Mapping[str, fmpq]:
        """Constants of the statement."""
        return self.least if self.stated is None else self.stated

    def keep(self) -> tuple[Check, ...]:
        """Whether the constants that are stated are no better than what is proved."""
        room = {name: self.constants[name] - x for name, x in self.least.items() if name in self.constants}
        found = ((name, room.get(name, fmpq(-1))) for name in self.constants)
        return tuple(Check(f"{name} is proved", left >= 0, approximate(left)) for name, left in found)

    @property
    def adds(self) -> bool:
        """Whether the bounds on |x| of an initial error, of w and of eta add where several act.

        Along a trajectory df = Theta(t) dq with a bounded member Theta(t) of the class at every t: of a class that is
        known by one quadratic form with M22 < 0, or of scalars. The error is that of a linear system that varies in
        time, of which all trajectories keep to the class; they add.
        """
        return all(
            block.bounded and (len(block.generators) == 1 or block.nq * block.nf == 1)
            for block in self.multiplier.blocks
        )

    @property
    def gamma(self) -> fmpq:
        """Gain from w to z."""
        return self.constants["gamma"]

    def guarantee(self, spec: Spec) -> ClockGuarantee:  # noqa: ARG002
        """Guarantee in doubles."""
        return ClockGuarantee(
            gamma=above(self.gamma),
            decay=below(self.decay),
            T1=above(self.T1),
            T2=below(self.T2),
            witness=self.witnesses.get("energy", self.witnesses["gamma"]),
            rate=below(self.rate),
            constants={name: above(x) for name, x in self.constants.items()},
            adds=self.adds,
        )

    def headline(self, spec: Spec) -> str:
        """Claim in one line."""
        meaning = MEANING.format(w=spec.observer.drive)
        gamma, decay = at_most(self.gamma), at_least(self.decay)
        return f"gamma {gamma}, {meaning}; decay rate {decay} 1/s, intervals {span(self.T1, self.T2)}"

    def statement(self, spec: Spec) -> str:
        """Guarantee in words, with the observer written out, and where it holds."""
        c, size, w = {name: at_most(x) for name, x in self.constants.items()}, self.system.size, spec.observer.drive
        parts = []
        if "overshoot" in c:
            decays = f"{c['overshoot']} exp(-{below(self.rate)!r} t) {size}(0)"
            parts.append(f"{size}(t) <= {decays} where {w} = 0 and eta = 0")
        if "disturbance" in c:
            parts.append(f"{size}(t) <= {c['disturbance']} sup|{w}| from zero error where eta = 0")
        if "noise" in c:
            parts.append(f"{size}(t) <= {c['noise']} sup|eta| from zero error where {w} = 0")
        if len(parts) > 1 and self.adds:
            parts[-1] += ", and these bounds add where several act"
        parts.append(f"|z|_2 <= {c['gamma']} |{w}|_2 + {c['initial']} {size}(0) where eta = 0")
        if "energy" in self.witnesses:
            numbers = {name: at_most(x) for name, x in self.witnesses["energy"].numbers.items()}
            initial, given = f"{numbers['r']} {size}(0)^2", f"{numbers['mu']} |{w}|_2^2"
            parts.append(f"|z|_2^2 <= {initial} + {given} + {numbers['kappa']} sum |eta_k|^2")
        if self.outage:
            parts.append(self.overdue(self.outage, w))
        told = "; ".join(f"(P{i}) {part}" for i, part in enumerate(parts, start=1))
        return "; ".join([f"{sequences(self.T1, self.T2)}: {told}; for {equations(self.system)}", *spec.provisos])

    def theorem(self, spec: Spec) -> str:
        """Claim as a file of Coq; raises `UnexportedError`."""
        made = observer(spec.augmented, spec.H, self.gains, self.multiplier, self.T1, self.T2)
        return exported(made, parts(self.witnesses, self.constants), spec, self.statement(spec))

    def overdue(self, outage: Outage, w: str) -> str:
        """What holds where measurements stay away, in words."""
        grows = f"V, that of (P1), grows by at most exp(2 {above(outage.growth)!r} X) while measurements are overdue"
        share = at_least(100 * outage.share, 4)
        still = f"the error still vanishes if that is less than {share} % of the time"
        return f"{grows} for a time X where {w} = 0 and eta = 0; {still}"

    def written(self, spec: Spec, limits: Mapping[str, Any]) -> dict[str, Any]:
        """What is proved, the limit it is near to, and the witnesses."""
        witnesses = {name: witness.written() for name, witness in self.witnesses.items()}
        if self.outage:
            witnesses["overshoot"]["outage"] = self.outage.written()
        witnesses |= {"T2_max": self.longest.written()} if self.longest else {}
        guarantee = {
            "kind": "clock",
            "gamma": above(self.gamma),
            "decay": below(self.decay),
            **({"rate": below(self.rate)} if self.rate else {}),
            **{name: above(value) for name, value in self.constants.items() if name != "gamma"},
            **jitter(self.T1, self.T2),
            "T1": above(self.T1),
            "T2": below(self.T2),
            **({"outage": overdue_numbers(self.outage)} if self.outage else {}),
            **({"T2_max": below(self.longest.theorem.clock.knots[-1])} if self.longest else {}),
            **limits,
            "statement": self.statement(spec),
        }
        return {
            "guarantee": guarantee,
            "certificate": {"kind": "exact", "witnesses": witnesses, "checks": listed(self.checks)},
        }


def overdue_numbers(outage: Outage) -> dict[str, float]:
    """Growth and share of an outage, on the safe side."""
    return {"growth": above(outage.growth), "share": below(outage.share)}
