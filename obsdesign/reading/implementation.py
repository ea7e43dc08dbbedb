"""The section `implementation:` of a spec: how the observer runs on a computer."""

from flint import fmpq

from obsdesign.reading.trial_schema import Implementation as Section
from obsdesign.sections.document import Loc
from obsdesign.sections.values import Reader
from obsdesign.trial import Implementation


def read_implementation(reader: Reader, section: Section | None, samples: fmpq | None) -> Implementation | None:
    """Steps of the observer; None where the spec says nothing of them. `samples`: period of a plant in samples."""
    if section is None:
        return None
    loc: Loc = ("implementation",)
    if samples is not None:
        said = f"this plant is in samples, {float(samples):g} s apart, and so is its observer: leave it out"
        reader.wrong(loc, said, at_key=True, id="OBS213")
    return Implementation(reader.number(section.period, (*loc, "period"), "> 0"), section.method)


def require_steps(reader: Reader, asked: str, implementation: Section | None, samples: fmpq | None) -> None:
    """Refuse a run in steps that the spec does not tell."""
    if asked == "implementation" and implementation is None and samples is None:
        said = "needs the section implementation; write implementation: {period: 1.0e-3, method: rk4}"
        reader.wrong(("simulation", "observer"), said, id="OBS205")
