"""The section `simulation:` of a spec: which keys there are and what form their values have."""

from typing import Literal, get_args

from obsdesign.families import FAMILIES
from obsdesign.sections.forms import (
    ENTRY,
    NUMBERS,
    VECTOR,
    Either,
    MapOf,
    Named,
    OneOf,
    Section,
    key,
    required,
)

SAMPLED = f"of the family {' or '.join(name for name, family in FAMILIES.items() if family.sampled)}"
STATE = Named("State", Either("a number, a list of numbers, or numbers by name", ENTRY, NUMBERS, mapping=MapOf(ENTRY)))
STATES = "over x, or over the augmented state; or by name, the others 0; default 0"
SIGNALS_BY_NAME = Named(
    "SignalsByName",
    Either(
        "an expression, a list of expressions (files are not read here), or expressions by name",
        ENTRY,
        NUMBERS,
        mapping=MapOf(ENTRY),
    ),
)
Numbers = str | list[str] | dict[str, str]
Signals = str | list[str] | dict[str, str]

NoiseName = Literal["uniform", "gaussian", "normal"]
SamplingName = Literal["periodic", "random"]


class Law(Section):
    """A law of the sampling instants."""

    law: str = required(ENTRY, "expression of t for the next interval")


class Noise(Section):
    """Extra measurement noise, constant over each period."""

    type: NoiseName = key(OneOf("noise", get_args(NoiseName)), default="uniform")
    amplitude: str | list[str] = required(VECTOR, "half width or standard deviation, one number or one for each output")
    period: str | None = key(
        ENTRY, f"s; {SAMPLED.replace('of the family', 'for type')} noise is drawn at each measurement"
    )


class Simulation(Section):
    """How to try the observer."""

    horizon: str = required(ENTRY, "s")
    x0: Numbers | None = key(STATE, STATES)
    xhat0: Numbers | None = key(STATE, STATES)
    w: Signals | None = key(SIGNALS_BY_NAME, "expressions of t and the states")
    v: Signals | None = key(SIGNALS_BY_NAME, "expressions of t: what drives the disturbance model")
    u: Signals | None = key(SIGNALS_BY_NAME, "known inputs: expressions of t and the states")
    events: dict[str, str] = key(MapOf(ENTRY), "conditions that end a run when they become true, by name", default={})
    noise: Noise | None = key(Noise)
    sampling: SamplingName | Law | None = key(
        Either(
            "periodic, random, or {law: an expression of t}",
            OneOf("sampling", get_args(SamplingName)),
            mapping=Law,
        ),
        f"{SAMPLED}: periodic (default, T2), random in [T1, T2], or a law",
    )
    period: str | None = key(ENTRY, "s, of periodic sampling; default T2")
    dropout: str | None = key(ENTRY, "share of the measurements that are lost, in [0, 1)")
    xi0: dict[str, str] | None = key(MapOf(ENTRY), "coordinates at t = 0, by name; default those of xhat0, or 0")
    theta0: str | list[str] | dict[str, str] | None = key(
        Either("a number, a list, or values by coordinate", ENTRY, NUMBERS, mapping=MapOf(ENTRY)),
        "correction before the first measurement, or estimated constants of coordinates; default 0",
    )
    seed: str | None = key(ENTRY)
    points: str | None = key(ENTRY, "samples kept, default 2000")
