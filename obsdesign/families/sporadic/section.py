"""The section `observer` of a spec where measurements arrive sporadically."""

from collections.abc import Mapping
from typing import ClassVar, Literal, get_args

from obsdesign.families import asked
from obsdesign.sections.forms import ENTRY, MATRIX, Either, Entries, ListOf, OneOf, Section, key, required

CLOCK = "clock"  # storage functions that depend on the time left to the next measurement
INJECTIONS = {  # how the correction evolves between measurements, and its relaxations, the tightest first
    "dynamic": (CLOCK, "proposition-2", "proposition-3", "proposition-4"),
    "predictor": (CLOCK, "proposition-2"),
    "hold": (CLOCK, "proposition-5"),
    "reset": (CLOCK,),
}
RELAXATIONS = tuple(sorted({name for names in INJECTIONS.values() for name in names}))
SporadicObjective = Literal["min-gamma", "max-T2", "max-decay", "pareto", "feasibility"]
DELAYED = (
    "is not offered: a measurement is used at the instant at which it was taken; for a known delay tau run the "
    "observer tau late, with u of then: it estimates x(t - tau)"
)


class SporadicBounds(Section):
    """What a design may use at most."""

    L: str | asked.Sizes | None = key(
        asked.LARGEST_SPECTRAL,
        "largest spectral norm of L; or several for objective pareto: gamma against the gain",
        otherwise="none",
        example="20",
    )
    K: str | asked.Sizes | None = key(
        asked.LARGEST_SPECTRAL,
        "largest spectral norm of K, of injection reset; or several, likewise",
        otherwise="none",
        example="3",
    )
    gamma: str | None = key(ENTRY, "largest gamma", otherwise="none", unit="z per w", example="0.5")


class SporadicGains(Section):
    """Gains to be analyzed instead of designed: L and H of a correction L theta, theta' = H theta, or K of a reset."""

    L: Entries | None = key(MATRIX, "nx x ny", otherwise="none: K is given", example="[[1.4], [0.9]]")
    H: Entries | None = key(MATRIX, "ny x ny", otherwise="0", example="[[-0.5]]")
    K: Entries | None = key(
        MATRIX, "nx x ny, of injection reset", otherwise="none: L is given", example="[[0.8], [0.4]]"
    )


class ClockSection(Section):
    """Storage function of relaxation clock, a piecewise polynomial of the time left to the next measurement."""

    degree: str | None = key(ENTRY, "degree of each segment, 1 to 12", otherwise="4", example="6")
    segments: str | None = key(ENTRY, "segments of [0, T2], 1 to 32; T1 is an end of one", otherwise="2", example="4")
    lookahead: str | None = key(
        ENTRY,
        "parts of [T1, T2], 1 to 8, in which it tells the interval after the next measurement apart; above 1: T1 > 0",
        otherwise="1",
        example="2",
    )
    gain: Literal["constant", "gap"] = key(
        OneOf("gain", ("constant", "gap")),
        "whether K of injection reset depends on the interval that has just ended",
        default="constant",
        example="gap",
    )


def one_or_several(kind: str, words: tuple[str, ...]) -> Either:
    """Form of one of a few words, or of a list of them."""
    word = OneOf(kind, words)
    return Either(f"one of {', '.join(words)}, or a list of them", word, ListOf(word, least=1))


class SporadicObserver(asked.ObserverSection):
    """What is asked of an observer whose measurements arrive sporadically, T1 <= t_{k+1} - t_k <= T2."""

    hints: ClassVar[Mapping[str, str]] = {"delay": DELAYED}

    T1: str = required(ENTRY, "shortest interval between measurements; 0: any positive one", unit="s", example="0.05")
    T2: str | asked.Interval = required(
        asked.SEARCHED,
        "longest interval between measurements; a range for max-T2 and pareto",
        unit="s",
        example="0.1",
    )
    decay: str | asked.Interval | None = key(
        asked.SEARCHED,
        "decay rate lambda_t of the error; a range for max-decay and pareto",
        unit="1/s",
        otherwise="0",
        example="0.05",
    )
    injection: str | list[str] | None = key(
        one_or_several("injection", tuple(INJECTIONS)),
        "dynamic (H free), predictor (H = -C L), hold (H = 0) or reset (xhat+ = xhat + K (y - C xhat)); "
        "a list makes a curve each",
        otherwise="dynamic",
        example="predictor",
    )
    relaxation: str | list[str] | None = key(
        one_or_several("relaxation", RELAXATIONS),
        "the inequality that is solved; a list makes a curve each",
        otherwise="clock; with `delta` the tightest proposition for the injection",
        example="proposition-3",
    )
    clock: ClockSection | None = key(
        ClockSection, "storage function of relaxation clock", otherwise="degree 4, 2 segments", example="{degree: 6}"
    )
    delta: str | asked.Interval | None = key(
        asked.SEARCHED,
        "free exponent of the storage function of a proposition",
        unit="1/s",
        otherwise="searched",
        example="{min: 1, max: 100}",
    )
    objective: SporadicObjective = key(
        OneOf("objective", get_args(SporadicObjective)),
        "the least gamma; the largest T2; the fastest decay; a curve over the key that is a range; any solution",
        default="min-gamma",
        example="max-T2",
    )
    slack: str | None = key(
        ENTRY,
        "relative distance from the optimum, for a smaller gain",
        otherwise="0.05",
        example="0.05",
    )
    bounds: SporadicBounds | str | None = key(
        asked.bounds_of(SporadicBounds),
        "what a design may use at most; auto: the knee of gamma against |L|, or |K|",
        otherwise="none",
        example="{L: 20}",
    )
    gains: SporadicGains | None = key(
        SporadicGains,
        "gains that are analysed and certified as they are",
        otherwise="designed",
        example="{L: [[1.4], [0.9]]}",
    )
