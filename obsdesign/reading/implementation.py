"""The sections `implementation:` and `data:` of a spec: how the observer runs on a computer, and on a log."""

from collections.abc import Mapping, Sequence

from flint import fmpq

from obsdesign.families import FAMILIES, Family
from obsdesign.reading.plant import Layout
from obsdesign.reading.trial_schema import Data, Simulation
from obsdesign.reading.trial_schema import Implementation as Section
from obsdesign.sections.document import Loc
from obsdesign.sections.values import Reader
from obsdesign.sections.words import unknown
from obsdesign.trial import Implementation, Recorded


def read_implementation(
    reader: Reader, section: Section | None, simulation: Simulation | None, samples: fmpq | None, family: Family | None
) -> Implementation | None:
    """Steps of the observer; None where the spec says nothing of them, and its simulation does not ask for them.

    `samples`: period of a plant in samples; `family`: of the observer, None where it is unknown.
    """
    if section is None:
        if simulation and simulation.observer == "implementation" and samples is None:
            said = "needs the section implementation; write implementation: {period: 1.0e-3, method: rk4}"
            reader.wrong(("simulation", "observer"), said, id="OBS205")
        return None
    loc: Loc = ("implementation",)
    if samples is not None:
        said = f"this plant is in samples, {float(samples):g} s apart, and so is its observer: leave it out"
        reader.wrong(loc, said, at_key=True, id="OBS213")
    if section.impose:
        require_imposable(reader, section.method, family)
    return Implementation(reader.number(section.period, (*loc, "period"), "> 0"), section.method, section.impose)


def require_imposable(reader: Reader, method: str, family: Family | None) -> None:
    """Refuse steps that no inequality is known for."""
    loc: Loc = ("implementation", "impose")
    if family is not None and not family.places:
        said = f"is for type {', '.join(name for name, one in FAMILIES.items() if one.places)}; leave it out"
        reader.wrong(loc, f"{said}: `solve` tells the largest step that was found", id="OBS213")
    elif method == "exact":
        said = "is for euler and rk4; for exact steps write impose: false, and `solve` tells the largest that was found"
        reader.wrong(loc, said, id="OBS213")


def read_data(reader: Reader, section: Data | None, layout: Layout, xm: Sequence[str]) -> Recorded | None:
    """Where signals are in a log. `xm`: states of the disturbance model."""
    if section is None:
        return None
    loc: Loc = ("data",)
    names = layout.names
    known, states = ((*names.outputs, *names.inputs), (*names.states, *xm)) if names else ((), ())

    def named(key: str, written: Mapping[str, str], allowed: Sequence[str], what: str) -> None:
        for name in written if names else ():
            if name not in allowed:
                reader.wrong((*loc, key, name), unknown(what, name, allowed, {}), at_key=True, id="OBS203")

    seen = (*known, *names.states, *names.w) if names else known
    named("columns", section.columns, seen, "signal")
    named("scale", section.scale, (*seen, "time"), "signal")
    named("e0", section.e0, states, "state")
    return Recorded(
        time=section.time or "",
        columns=section.columns,
        scale={name: reader.number(text, (*loc, "scale", name), "> 0") for name, text in section.scale.items()},
        hold=section.hold,
        arrival=section.arrival or "",
        v_sup=None if section.v_sup is None else reader.number(section.v_sup, (*loc, "v_sup"), ">= 0"),
        eta_sup=None if section.eta_sup is None else reader.number(section.eta_sup, (*loc, "eta_sup"), ">= 0"),
        e0={name: reader.number(text, (*loc, "e0", name), ">= 0") for name, text in section.e0.items()},
    )
