"""A plant as equations for the families that take it as it is typed, with no matrices."""

from dataclasses import replace

import numpy as np
from flint import fmpq

from obsdesign.lmi.formula import Array
from obsdesign.model.equations import Equations, Typed, from_matrices
from obsdesign.model.plant import Plant
from obsdesign.reading import plant_schema as schema
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
    equations = Equations(dynamics, outputs, inputs=names.inputs, exogenous=names.w)
    return of_typed(layout, Typed(equations, domain))


def of_typed(layout: Layout, typed: Typed) -> Reading:
    """A plant whose matrices are zero: what counts is the equations."""
    plant = typed.equations
    states, outputs, exogenous = plant.states, tuple(plant.outputs), plant.exogenous
    n, ny, nw = len(states), len(outputs), len(exogenous)
    shapes = {"A": (n, n), "Bf": (n, 0), "B": (n, nw), "Cq": (0, n), "Dqf": (0, 0), "Dq": (0, nw)}
    shapes |= {"C": (ny, n), "Df": (ny, 0), "D": (ny, nw)}
    zero: dict[str, Array] = {name: np.full(shape, fmpq(0), dtype=object) for name, shape in shapes.items()}
    matrices = Plant(**zero, states=states, exogenous=exogenous, outputs=outputs)
    return Reading(replace(layout, q=Q.of(0), f=F.of(0)), matrices, typed=typed)


def in_equations(reader: Reader, found: Reading) -> Reading:
    """A plant in matrices as equations, with the arguments of its nonlinearities put in."""
    plant, names = found.plant, found.layout.names
    functions = [(block.f, block.nq) for block in found.nonlinearities if block is not None and block.f is not None]
    missing = any(block is not None and block.f is None for block in found.nonlinearities)
    if plant is None or names is None or len(functions) < len(found.nonlinearities):
        if missing and reader.clean(("nonlinearities",)):
            reader.wrong(("nonlinearities",), "need an f each: this observer takes the plant as equations", id="OBS402")
        return Reading(found.layout)
    made = from_matrices(plant, functions, (found.gx, found.gq, found.gy), names.inputs)
    for _ in made.algebraic:
        made = made.substituted(made.algebraic)
    if any(side.names.intersection(made.algebraic) for _, side in made.sides()):
        said = "depend on themselves (Dqf), and this observer takes the plant as equations; give system.dynamics"
        reader.wrong(("nonlinearities",), said, id="OBS305")
        return Reading(found.layout)
    return of_typed(found.layout, Typed(replace(made, algebraic={}), {}))
