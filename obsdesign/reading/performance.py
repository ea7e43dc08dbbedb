"""The section `performance:` of a spec: z = H e, by names, with weights, or as a matrix."""

from collections.abc import Mapping, Sequence

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import Array
from obsdesign.model.disturbance import empty, rows_of
from obsdesign.reading.generator import Exogenous
from obsdesign.reading.plant import Layout
from obsdesign.reading.schema import Performance
from obsdesign.records import dataclass, field
from obsdesign.sections.document import Loc
from obsdesign.sections.forms import Entries as MatrixEntries
from obsdesign.sections.values import Axis, Reader
from obsdesign.sections.words import nearest, unknown
from obsdesign.spec import numbered

ONE = fmpq(1)
GROUPS = ("x", "w", "all")
NOT_ESTIMATED = "is unknown, and this type of observer estimates states only; name states, or leave it out"
FEEDTHROUGH = "is no function of the augmented state; give it a disturbance model, such as integrator"


@dataclass(frozen=True)
class Asked:
    """What must be estimated well."""

    H: Array  # (nz, n + nm), over the augmented state
    H_names: tuple[str, ...]  # of z
    weights: Mapping[str, fmpq] = field(default_factory=dict)  # of its components, where some are given


def read_performance(
    reader: Reader,
    section: str | Sequence[str] | Performance | None,
    layout: Layout,
    exogenous: Exogenous,
    kind: str = "",
) -> Asked:
    """What z is; `kind`: the family, if it estimates states whatever z is."""
    loc: Loc = ("performance",)
    if kind and section not in (None, "x"):
        said = "the observer does not depend on it; it says what figures of a run show, and of what the run tells z"
        reader.unused.append(f"performance has no effect on the design by type {kind}: {said}")
    if not isinstance(section, Performance):
        return Asked(*read_names(reader, section, layout, exogenous, loc, kind))
    given = {name: (key, name) for key in ("weights", "scales") for name in getattr(section, key) or ()}
    if section.H is not None:
        for key, beside in (("of", section.signals), ("weights", section.weights), ("scales", section.scales)):
            if beside is not None:
                reader.wrong((*loc, key), "stands beside H, which says all of it; leave out one of both", id="OBS206")
        return Asked(*read_matrix(reader, section.H, layout, exogenous))
    if section.signals is None and not given:
        reader.wrong(loc, "expected weights, scales, of or H", id="OBS205")
        return Asked(empty(0, 0), ())
    if section.signals is not None:
        H, names = read_names(reader, section.signals, layout, exogenous, (*loc, "of"), kind)
    else:
        H, names = read_names(reader, [*given], layout, exogenous, loc, kind, given)
    known = layout.names is not None and reader.clean(loc)
    weights = read_weights(reader, section, names, known=known) if given else {}
    rows = [weights.get(name, ONE) * row for name, row in zip(names, H, strict=False)]
    reader.notes += [f"z is each error times its weight: {told(weights)}"] if weights else []
    return Asked(np.array(rows, dtype=object).reshape(H.shape), names, weights)


def read_weights(reader: Reader, section: Performance, names: Sequence[str], *, known: bool) -> dict[str, fmpq]:
    """Weight of each component of z, 1 where none is given; `known`: whether the names are."""
    found = dict.fromkeys(names, ONE)
    for key, given in (("weights", section.weights or {}), ("scales", section.scales or {})):
        for name, text in given.items():
            loc: Loc = ("performance", key, name)
            number = reader.number(text, loc, "> 0")
            if known and name not in names:
                reader.wrong(loc, unknown("component of z", name, names, {}), at_key=True, id="OBS203")
            elif key == "scales" and name in (section.weights or {}):
                reader.wrong(loc, f"{name} has a weight already; give one of both", at_key=True, id="OBS206")
            else:
                found[name] = number if key == "weights" else ONE / number
    return found


def told(weights: Mapping[str, fmpq]) -> str:
    """Weights by name."""
    return ", ".join(f"{float(weight):g} {name}" for name, weight in weights.items())


def read_names(
    reader: Reader,
    section: str | Sequence[str] | None,
    layout: Layout,
    exogenous: Exogenous,
    loc: Loc,
    kind: str,
    keys: Mapping[str, Loc] | None = None,
) -> tuple[Array, tuple[str, ...]]:
    """Rows of H of a group of signals, or of those that are listed, and their names.

    `keys`: where each name stands within `loc`, where they are keys of a mapping.
    """
    direct_said = NOT_ESTIMATED if kind else FEEDTHROUGH
    if isinstance(section, str) and section not in GROUPS:
        allowed = (*GROUPS, "a list of names", "{H: a matrix}", "{weights: ..}")
        reader.wrong(loc, unknown("performance", section, allowed, listed(section, layout, exogenous)), id="OBS202")
    if layout.names is None or exogenous.generator is None or section is None:
        return empty(0, 0), ()
    x, w = layout.names.states, layout.names.w
    table = rows_of(x, exogenous.states, w, exogenous.generator)
    groups = {"x": x, "w": w, "all": (*x, *exogenous.states)}
    chosen = groups.get(section, x) if isinstance(section, str) else section
    if section == "w" and (modelled := [name for name in w if table[name] is not None]) and len(modelled) < len(w):
        others = ", ".join(name for name in w if name not in modelled)
        reader.wrong(
            loc, f"{others} {FEEDTHROUGH.partition(';')[0]}; name the rest: [{', '.join(modelled)}]", id="OBS214"
        )
        chosen = modelled
    if isinstance(section, str) and (direct := [name for name in chosen if name in table and table[name] is None]):
        said = f"each of {', '.join(direct)}" if len(direct) > 1 else direct[0]
        reader.wrong(loc, f"{said} {direct_said}", id="OBS214")
        return empty(0, 0), ()
    for i, name in enumerate(chosen):
        place = loc if isinstance(section, str) else (*loc, *(keys[name] if keys else (i,)))
        if name not in table:
            estimated = tuple(known for known, row in table.items() if row is not None)
            reader.wrong(place, unknown("state", name, estimated, {}), at_key=bool(keys), id="OBS203")
        elif table[name] is None:
            reader.wrong(place, f"{name} {direct_said}", at_key=bool(keys), id="OBS214")
        elif name in chosen[:i]:
            reader.wrong(place, f"{name} is named already; name it once, with a weight if it counts more", id="OBS206")
    if not chosen:
        reader.wrong(loc, "there is nothing to estimate; name at least one state", id="OBS214")
    H = [row for row in map(table.get, chosen) if row is not None]
    return np.array(H, dtype=object), tuple(chosen)


def listed(section: str, layout: Layout, exogenous: Exogenous) -> dict[str, str]:
    """What to say of names that are written without brackets."""
    known = (*layout.names.states, *exogenous.states, *layout.names.w) if layout.names else ()
    names = [near for name in section.split(",") if (near := nearest(name.strip(), known))]
    said = f"is no group of signals; names stand in a list: write [{', '.join(names)}]"
    return {section: said} if len(names) == section.count(",") + 1 else {}


def read_matrix(
    reader: Reader, written: MatrixEntries, layout: Layout, exogenous: Exogenous
) -> tuple[Array, tuple[str, ...]]:
    """H as given."""
    entries = reader.entries(written, ("performance", "H"))
    n, nm = layout.states.size, exogenous.xm.size
    augmented = Axis(None if n is None or nm is None else n + nm, "augmented state")
    nz = entries.shape(None, augmented.size)[0] or 1
    H = reader.matrix(entries, Axis(nz, "component of z"), augmented)
    return H, numbered("z", nz)
