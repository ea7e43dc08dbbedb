"""How fast an error has to decay, as a section `observer:` asks for it: in 1/s, or by rho, what a sample leaves of it.

Either way it becomes the rate of a theorem: alpha or decay itself, or 1 - rho of samples.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

from flint import arb, fmpq

from obsdesign.dissipation.bounds import Range
from obsdesign.families import asked
from obsdesign.families.poles import Poles
from obsdesign.lmi.formula import rational_number
from obsdesign.lmi.spectrum import lower, upper
from obsdesign.sections.document import Loc
from obsdesign.sections.forms import OneOf, key
from obsdesign.sections.values import Reader, Sign
from obsdesign.tables.text import at_least, at_most

ESTIMATES = ("predicted", "filtered")
SLOWEST, FASTEST = fmpq(1, 10**12), fmpq(60)  # of a rate times the period
DIGITS = 6  # of a rho that follows from a rate in 1/s


class RateSection(asked.ObserverSection):
    """Keys of families that take plants in discrete time as well; their own one says how fast in 1/s."""

    hints: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("Ts", "ts", "dt", "period", "sample-time"), "belongs to the plant: write it as system.period, in s"
    )

    rho: str | asked.Interval | None = key(
        asked.SEARCHED,
        "decay a sample, |e_k| <= c rho^k, in (0, 1], or in [0, 1) for linf; of plants in discrete time",
        otherwise="1 for l2 and lipschitz, and searched in [0, 1) for linf",
        example="0.95",
    )
    estimate: str = key(
        OneOf("estimate", ESTIMATES),
        "in discrete time: predicted, xhat_k knows y_0 .. y_{k-1}; or filtered, it knows y_k as well",
        default="predicted",
        example="filtered",
    )

    poles: Poles | None = key(
        Poles,
        "region of the s-plane for every pole s of the error with f = K q, K constant; in continuous time",
        otherwise="any, left of -alpha",
        example="{radius: 2000, damping: 0.5}",
    )

    @property
    def filtered(self) -> bool:
        """Whether the estimate of a sample knows its y."""
        return self.estimate == "filtered"

    def written(self, name: str, period: fmpq | None) -> tuple[str, str | asked.Interval | None]:
        """Key that says how fast, and its value: `name` in 1/s, or rho of samples where that is not given."""
        value = getattr(self, name)
        return (name, value) if period is None or value is not None else ("rho", self.rho)


def read_rate(
    reader: Reader, section: RateSection, name: str, period: fmpq | None, sign: Sign, *, dead: bool = False
) -> fmpq | Range | None:
    """Rate of decay, or where to search it; None where nothing is said of it.

    `name`, `sign`: key of the rate in 1/s, and what it may be; `period`: s, of samples; `dead`: whether rho is in
    [0, 1) instead of (0, 1].
    """
    if period is None:
        refuse_samples(reader, section, name)
    elif section.rho is not None and getattr(section, name) is not None:
        said = f"stands beside observer.{name}, and both say how fast the error decays; leave one of them out"
        reader.wrong(("observer", "rho"), said, at_key=True, id="OBS206")
    said_by, value = section.written(name, period)
    if value is None:
        return None
    if said_by == "rho":
        return read_rho(reader, value, dead=dead)
    rate = asked.read_searched(reader, value, ("observer", name), sign, sign)
    if period is None:
        return rate
    loc: Loc = ("observer", name)
    if isinstance(rate, Range):
        low = in_samples(reader, rate.low, period, (*loc, "min"))
        return replace(rate, low=low, high=in_samples(reader, rate.high, period, (*loc, "max")))
    return in_samples(reader, rate, period, loc)


def refuse_samples(reader: Reader, section: RateSection, name: str) -> None:
    """Refuse what only samples have; where the section `system` is wrong, nothing is known of its time."""
    if not (reader.clean(("system",)) and reader.clean(("time",)) and reader.clean(("period",))):
        return
    if section.rho is not None:
        said = f"is the decay a sample, of a plant with time: discrete; in continuous time give {name} (1/s)"
        reader.wrong(("observer", "rho"), said, at_key=True, id="OBS213")
    if section.filtered:
        said = "is of a plant with time: discrete; in continuous time there is no next sample"
        reader.wrong(("observer", "estimate"), said, at_key=True, id="OBS213")


def read_rho(reader: Reader, written: str | asked.Interval, *, dead: bool) -> fmpq | Range:
    """1 - rho, or where to search it; in the order of 1 - rho, which a theorem has."""
    loc: Loc = ("observer", "rho")
    if not isinstance(written, asked.Interval):
        rho = reader.number(written, loc)
        require_rho(reader, rho, loc, dead=dead)
        return 1 - rho
    found = asked.read_range(reader, written, loc, ">= 0")
    for end, value in (("min", found.low), ("max", found.high)):
        require_rho(reader, value, (*loc, end), dead=dead)
    return replace(found, low=1 - found.high, high=1 - found.low, log=found.high < 1)


def require_rho(reader: Reader, rho: fmpq, loc: Loc, *, dead: bool) -> None:
    """Refuse a rho outside (0, 1], or [0, 1)."""
    open_end, allowed = (rho == 1, "[0, 1)") if dead else (rho == 0, "(0, 1]")
    if rho < 0 or rho > 1 or open_end:
        said = f"{float(rho):g} is not allowed; give a number in {allowed}, what is left of the error after a sample"
        reader.wrong(loc, said, id="OBS208")


def in_samples(reader: Reader, rate: fmpq, period: fmpq, loc: Loc) -> fmpq:
    """1 - rho of a rate in 1/s; one is refused whose rho a double does not tell from 0 or from 1."""
    slowest, fastest = SLOWEST / period, FASTEST / period
    if not rate or slowest <= rate <= fastest:
        return step(rate, period) if rate else fmpq(0)
    side = f"at most {float(fastest):.4g}" if rate > fastest else f"at least {float(slowest):.4g}"
    said = f"{float(rate):g} 1/s cannot be told in samples {float(period):g} s apart; give {side}, or rho"
    reader.wrong(loc, said, id="OBS208")
    return fmpq(0)


def step(rate: fmpq, period: fmpq) -> fmpq:
    """1 - rho of a rate in 1/s, rounded up to 6 digits, so that rho = exp(-rate period) is proved at least.

    Below rho = .5 rho is rounded down to 6 digits.
    """
    rho = (-arb(rate * period)).exp()
    if rho > fmpq(1, 2):
        return rational_number(at_most(upper(-(-arb(rate * period)).expm1()), DIGITS))
    return 1 - rational_number(at_least(lower(rho), DIGITS))
