"""The performance section of a spec: what of the error must be small, z = H e."""

from collections.abc import Sequence

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import Array
from obsdesign.model.disturbance import Generator
from obsdesign.model.disturbance import empty as no_entries
from obsdesign.reading.generator import Exogenous
from obsdesign.reading.names import Names
from obsdesign.reading.plant import Layout
from obsdesign.reading.schema import Weight
from obsdesign.sections.document import Loc
from obsdesign.sections.values import Axis, Reader
from obsdesign.sections.words import unknown
from obsdesign.spec import numbered

GROUPS = ("x", "w", "all")
FEEDTHROUGH = "is no function of the augmented state; give it a disturbance model, such as integrator"


def read_performance(
    reader: Reader, section: str | Sequence[str] | Weight | None, layout: Layout, exogenous: Exogenous
) -> tuple[Array, tuple[str, ...]]:
    """H over the augmented state, and the names of z."""
    loc: Loc = ("performance",)
    if isinstance(section, Weight):
        return read_weight(reader, section, layout, exogenous)
    if isinstance(section, str) and section not in GROUPS:
        allowed = (*GROUPS, "a list of names", "{H: a matrix}")
        reader.wrong(loc, unknown("performance", section, allowed, {}))
    if layout.names is None or exogenous.generator is None or section is None:
        return no_entries(0, 0), ()
    x, w = layout.names.states, layout.names.w
    table = rows(layout.names, exogenous.states, exogenous.generator)
    groups = {"x": x, "w": w, "all": (*x, *exogenous.states)}
    chosen = groups.get(section, x) if isinstance(section, str) else section
    for i, name in enumerate(chosen):
        place = loc if isinstance(section, str) else (*loc, i)
        if name not in table:
            reader.wrong(place, unknown("state", name, tuple(table), {}))
        elif table[name] is None:
            reader.wrong(place, f"{name} {FEEDTHROUGH}")
    if not chosen:
        reader.wrong(loc, "there is nothing to estimate; name at least one state")
    H = [row for row in map(table.get, chosen) if row is not None]
    return np.array(H, dtype=object), tuple(chosen)


def rows(names: Names, xm: Sequence[str], generator: Generator) -> dict[str, Array | None]:
    """Row over the augmented state of each state and each w; None where w has a feedthrough from v or f."""
    n, size = len(names.states), len(names.states) + len(xm)
    basis = np.full((size, size), fmpq(0), dtype=object)
    np.fill_diagonal(basis, fmpq(1))
    table: dict[str, Array | None] = dict(zip((*names.states, *xm), basis, strict=True))
    for i, name in enumerate(names.w):
        row = np.concatenate([np.full(n, fmpq(0), dtype=object), generator.Cm[i]])
        feedthrough = np.any(generator.Dm[i] != 0) or np.any(generator.Dwf[i] != 0)
        table.setdefault(name, None if feedthrough else row)
    return table


def read_weight(reader: Reader, section: Weight, layout: Layout, exogenous: Exogenous) -> tuple[Array, tuple[str, ...]]:
    """H as given."""
    entries = reader.entries(section.H, ("performance", "H"))
    n, nm = layout.states.size, exogenous.xm.size
    augmented = Axis(None if n is None or nm is None else n + nm, "augmented state")
    nz = entries.shape(None, augmented.size)[0] or 1
    H = reader.matrix(entries, Axis(nz, "component of z"), augmented)
    return H, numbered("z", nz)
