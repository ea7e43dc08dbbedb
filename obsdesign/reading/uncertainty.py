"""What differs from run to run beside noise: where the plant starts, and the values of its parameters."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from flint import fmpq

from obsdesign.reading import trial_schema as schema
from obsdesign.sections.document import Loc, dotted
from obsdesign.sections.scalars import described
from obsdesign.sections.values import Axis, Entries, Reader
from obsdesign.sections.words import unknown
from obsdesign.trial import Tolerance, Vector


def read_widths(reader: Reader, written: schema.Numbers | None, x: Axis, names: Sequence[str]) -> Vector | None:
    """Half-widths of x0, as a list over x or by name, the others 0; None where none are given."""
    loc: Loc = ("simulation", "x0_width")
    if written is None:
        return None
    if isinstance(written, dict):
        for name in written:
            if names and name not in names:
                reader.wrong((*loc, name), unknown("state", name, names, {}), at_key=True, id="OBS203")
        read = {name: reader.number(text, (*loc, name), ">= 0") for name, text in written.items()}
        entries = Entries(loc, np.array([read.get(name, fmpq(0)) for name in names], dtype=object))
    else:
        entries = reader.entries(written, loc)
        for value in entries.values.ravel() if reader.clean(loc) else ():
            if value < 0:
                reader.wrong(loc, f"{float(value):g} is not allowed; a half-width is a number >= 0", id="OBS208")
    return reader.vector(entries, x).astype(float)


def read_uncertainty(reader: Reader, written: Mapping[str, str], in_plant: Collection[str]) -> dict[str, Tolerance]:
    """Relative half-widths of parameters by their names, with their nominal values.

    `in_plant`: parameters that stand in the plant or in its disturbance; another one would change nothing.
    """
    found: dict[str, Tolerance] = {}
    for name, text in written.items():
        loc: Loc = ("simulation", "uncertainty", name)
        if name not in reader.parameters:
            reader.wrong(loc, unknown("parameter", name, tuple(reader.parameters), {}), at_key=True, id="OBS203")
            continue
        nominal, share = reader.parameters[name], read_share(reader, text, loc)
        if not reader.clean(loc):
            continue
        if name not in in_plant:
            said = f"changes nothing: no number and no expression of the plant uses {dotted(('parameters', name))}"
            reader.wrong(loc, f"{said}; leave it out", at_key=True, id="OBS930")
        elif nominal == 0:
            said = f"is a share of {dotted(('parameters', name))}, which is 0, so that nothing would differ"
            reader.wrong(loc, f"{said}; leave it out, or give the parameter another value", id="OBS208")
        found[name] = Tolerance(nominal, share)
    return found


def read_share(reader: Reader, text: str, loc: Loc) -> fmpq:
    """A share of 1, or so many percent."""
    plain, percent, rest = text.strip().partition("%")
    share = reader.number(plain.strip() if percent and not rest else text, loc)
    share = share / 100 if percent else share
    if reader.clean(loc) and not 0 <= share <= 1:
        said = f"{described(text)} is not allowed; give a share of the parameter from 0 to 1, or 0 % to 100 %"
        reader.wrong(loc, said, id="OBS208")
    return share
