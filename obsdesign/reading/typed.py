"""A plant as equations for the families that take it as it is typed, with no matrices."""

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import Array
from obsdesign.model.equations import Equations, Typed
from obsdesign.model.plant import Plant
from obsdesign.reading import schema
from obsdesign.reading.dynamics import read_domain, read_sides
from obsdesign.reading.plant import F, Layout, Q, Reading, W, X, Y, read_names
from obsdesign.sections.values import Reader


def read_typed(reader: Reader, system: schema.Equations) -> Reading:
    """Equations and domain of a plant; every matrix of it is zero."""
    x, y, w = (
        axis.of(len(names or ()))
        for axis, names in ((X, system.states or system.dynamics), (Y, system.outputs), (W, system.disturbances))
    )
    for axis, what in ((x, "states"), (y, "outputs")):
        reader.limit(axis.size, what, ("system", what))
    layout = Layout(x, y, w, Q.of(0), F.of(0), read_names(reader, system, x, y, w))
    names = layout.names
    if names is None:
        return Reading(layout)
    dynamics, outputs = read_sides(reader, system, names)
    domain = read_domain(reader, system, names)
    if not reader.clean(("system",)):
        return Reading(layout)
    typed = Typed(Equations(dynamics, outputs, inputs=names.inputs, exogenous=names.w), domain)
    n, ny, nw = len(names.states), len(names.outputs), len(names.w)
    shapes = {"A": (n, n), "Bf": (n, 0), "B": (n, nw), "Cq": (0, n), "Dqf": (0, 0), "Dq": (0, nw)}
    shapes |= {"C": (ny, n), "Df": (ny, 0), "D": (ny, nw)}
    matrices: dict[str, Array] = {name: np.full(shape, fmpq(0), dtype=object) for name, shape in shapes.items()}
    plant = Plant(**matrices, states=names.states, exogenous=names.w, outputs=names.outputs)
    return Reading(layout, plant, typed=typed)
