"""From the models of the format to the types of the design and of the simulation."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from obsdesign.errors import Problem
from obsdesign.families.incremental.request import Request
from obsdesign.families.lipschitz.request import LipschitzRequest
from obsdesign.families.sporadic.request import SporadicRequest
from obsdesign.lmi.formula import Array
from obsdesign.reading.document import Document, Loc, Number, described
from obsdesign.reading.families import LipschitzObserver, Observer, SporadicObserver
from obsdesign.reading.generator import Exogenous, read_disturbance
from obsdesign.reading.lipschitz import as_lipschitz, is_lipschitz, read_lipschitz, require_lipschitz
from obsdesign.reading.names import numbered, read_parameters
from obsdesign.reading.observer import read_incremental, require_reconstructible
from obsdesign.reading.performance import read_performance
from obsdesign.reading.plant import Reading, read_plant
from obsdesign.reading.schema import File
from obsdesign.reading.sporadic import read_sporadic, require_sporadic
from obsdesign.reading.trial import read_simulation
from obsdesign.reading.values import Axis, Reader, Size
from obsdesign.reading.words import unknown
from obsdesign.spec import Nonlinearity, Spec

FORMAT = "1"
STATUSES = ("certified", "infeasible")
PATH = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*(\.[A-Za-z0-9_-]+|\[[0-9]+\])*")
TOLERANCES = ("rtol", "atol")
RECORD = ("verified", "printed", "rtol", "atol", "note")


def resolve(document: Document, file: File | None, problems: list[Problem]) -> Spec:
    """Read every value of a file.

    Parameters
    ----------
    file
        The structure; a section that is None is wrong and among the `problems` already.

    Raises
    ------
    UsageError
        With everything that is wrong, in the order of the file.
    """
    reader = Reader(document, problems)
    if file is None or file.parameters is None:
        reader.stop()
    if file.obsdesign is not None and file.obsdesign != FORMAT:
        reader.wrong(
            ("obsdesign",),
            f"format {described(file.obsdesign)} is not known; this version reads format {FORMAT}",
        )
    read_parameters(reader, file.parameters)
    plant = read_plant(reader, file.system, file.nonlinearities, identity=is_lipschitz(document))
    layout = plant.layout
    exogenous = read_disturbance(reader, file.disturbance, layout)
    H, H_names = read_performance(reader, file.performance, layout, exogenous)
    blocks = [block for block in (*plant.nonlinearities, *exogenous.nonlinearities) if block is not None]
    if isinstance(file.observer, LipschitzObserver):
        blocks = as_lipschitz(reader, plant.nonlinearities, exogenous.nonlinearities)
    observer = read_observer(reader, file.observer, plant, exogenous, blocks, H) if file.observer else None
    simulation = read_simulation(
        reader, file.simulation, layout, exogenous.xm, exogenous.v, sporadic=isinstance(file.observer, SporadicObserver)
    )
    expect = read_expectations(reader, file.expect or {})
    if reader.problems or plant.plant is None or exogenous.generator is None or observer is None:
        reader.stop()
    assert layout.names is not None
    return Spec(
        name=file.name or Path(document.path).stem,
        source=file.source or "",
        description=(file.description or "").strip(),
        text=document.text,
        path=document.path,
        plant=plant.plant,
        generator=exogenous.generator,
        model_states=exogenous.states,
        drives=numbered("v", exogenous.v.size or 0),
        inputs=layout.names.inputs,
        units=file.system.units if file.system else {},
        nonlinearities=tuple(blocks),
        gx=plant.gx,
        gq=plant.gq,
        gy=plant.gy,
        H=H,
        H_names=H_names,
        observer=observer,
        simulation=simulation,
        expect=expect,
        notes=tuple(reader.notes),
    )


def read_observer(
    reader: Reader,
    section: Observer | SporadicObserver | LipschitzObserver,
    plant: Reading,
    exogenous: Exogenous,
    blocks: Sequence[Nonlinearity],
    H: Array,
) -> Request | SporadicRequest | LipschitzRequest:
    """Request of the family that a section names, held against what the family knows."""
    layout, generator = plant.layout, exogenous.generator
    states = Axis(total(layout.states, exogenous.xm), "augmented state")
    if isinstance(section, SporadicObserver):
        require_sporadic(reader, plant.plant, generator)
        return read_sporadic(reader, section, states, layout.outputs)
    if isinstance(section, LipschitzObserver):
        constants = tuple(constant for block in blocks for constant in block.lipschitz)
        lipschitz = read_lipschitz(reader, section, states, layout.outputs, constants)
        require_lipschitz(reader, lipschitz, plant.plant, generator, H)
        return lipschitz
    q = layout.q.of(total(layout.q, exogenous.q))
    incremental = read_incremental(reader, section, states, layout.outputs, q)
    if incremental.reconstruct:
        require_reconstructible(reader, incremental, plant.plant, generator)
    return incremental


def total(plant: Axis, model: Axis) -> Size:
    """Size of an augmented signal."""
    return None if plant.size is None or model.size is None else plant.size + model.size


def read_expectations(reader: Reader, written: Mapping[str, Any]) -> dict[str, Any]:
    """Read what the spec must give: a status, and values by their dotted path in the result."""
    expected: dict[str, Any] = {}
    for key, value in written.items():
        loc: Loc = ("expect", key)
        if not PATH.fullmatch(key):
            reader.wrong(loc, f"{described(key)} is no path into a result, such as limit.gamma", at_key=True)
        elif key == "status" and value not in STATUSES:
            reader.wrong(loc, unknown("status", value, STATUSES, {}))
        elif isinstance(value, dict):
            expected[key] = {name: read_record(reader, name, item, (*loc, name)) for name, item in value.items()}
        else:
            expected[key] = read_plain(reader, value, loc)
    return expected


def read_record(reader: Reader, name: str, value: Any, loc: Loc) -> Any:
    """One entry of an expectation."""
    if name not in RECORD:
        reader.wrong(loc, unknown("key", name, RECORD, {}), at_key=True)
    if name in TOLERANCES and isinstance(value, str):
        return float(reader.number(value, loc, ">= 0"))
    return read_plain(reader, value, loc)


def read_plain(reader: Reader, value: Any, loc: Loc) -> Any:
    """Read a value with its numbers as doubles."""
    if isinstance(value, Number):
        return float(reader.number(value, loc))
    if isinstance(value, list):
        return [read_plain(reader, item, (*loc, i)) for i, item in enumerate(value)]
    if isinstance(value, dict):
        reader.wrong(loc, "expected a number, text or a list, found a mapping")
    return value
