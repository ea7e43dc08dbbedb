"""What a designer trades: names of the quantities of a search, with units, for the axes of its figure."""

from collections.abc import Mapping, Sequence

from obsdesign.plot.axis import plain
from obsdesign.spec import Spec

TITLE = 76  # letters of a line of the title
NAMES: Mapping[str, str] = {
    "alpha": "decay rate α of the error [1/s]",
    "rho": "ρ, what a sample leaves of the error",
    "gamma": "γ, gain from the disturbance to the error",
    "omega": "frequency ω of the disturbance [rad/s]",
    "T2": "longest time T2 between measurements [s]",
    "decay": "decay rate of the error [1/s]",
    "delta": "δ [1/s]",
    "weight": "weight of 1/lipschitz against γ²",
    "lipschitz": "Lipschitz constant that is tolerated",
    "L": "gain |L|",
    "L1": "gain |L1|",
    "K": "gain |K|",
}
SHORT: Mapping[str, str] = {
    **{"alpha": "α", "rho": "ρ", "gamma": "γ", "omega": "ω", "delta": "δ"},
    **{name: f"|{name}|" for name in ("L", "L1", "K")},
}


def names(spec: Spec | None) -> Mapping[str, str]:
    """Names of the quantities, with the signals and units of a spec."""
    if spec is None or not spec.disturbed:
        return NAMES
    w = spec.plant.exogenous
    modelled = len(spec.generator.Am) > 0
    drive = f"{spec.observer.drive} of {', '.join(w)}" if modelled else ", ".join(w)
    units = {spec.units.get(name) for name in spec.H_names}, {None if modelled else spec.units.get(name) for name in w}
    known = [unit for (unit, *others) in map(list, units) if unit and not others]
    ratio = f" [{plain(known[0], 12)} / ({plain(known[1], 12)})]" if len(known) == 2 and not spec.weights else ""
    z = plain(", ".join(spec.H_names), 30)
    return {**NAMES, "gamma": f"γ, gain from {plain(drive, 30)} to the error of {z}{ratio}"}


def short(key: str) -> str:
    """Symbol of a quantity."""
    return SHORT.get(key, plain(key))


def heading(name: str, conditions: Sequence[str]) -> str:
    """Name of a spec, and below it what all points keep to; in two lines."""
    return "\n".join(plain(line, TITLE) for line in (name, "; ".join(conditions)) if line)
