"""From the models of the format to the types of the design and of the simulation."""

import re
from collections.abc import Collection, Mapping
from typing import Any

from flint import fmpq

from obsdesign.errors import Problem, UsageError
from obsdesign.families import FAMILIES, Family
from obsdesign.families.asked import Estimation, ObserverSection
from obsdesign.lmi.formula import Array
from obsdesign.reading.discretise import discretised, with_defect
from obsdesign.reading.dynamics import read_equations
from obsdesign.reading.generator import Exogenous, read_disturbance
from obsdesign.reading.implementation import read_data, read_implementation
from obsdesign.reading.noise import beside, drawn, in_matrices, read_levels, require_outputs
from obsdesign.reading.performance import read_performance
from obsdesign.reading.period import read_period
from obsdesign.reading.plant import Layout, Reading, read_parameters, read_plant
from obsdesign.reading.plant_schema import Equations
from obsdesign.reading.schema import File, read_file
from obsdesign.reading.trial import read_simulation
from obsdesign.reading.typed import in_equations, read_typed
from obsdesign.sections.document import Document, Loc, dotted
from obsdesign.sections.forms import ENTRY, TEXT
from obsdesign.sections.scalars import AS_DOUBLE, Number, described
from obsdesign.sections.values import Axis, Reader, Size
from obsdesign.sections.words import unknown
from obsdesign.spec import Nonlinearity, Request, Spec, named_by, numbered
from obsdesign.trial import Implementation, Level

FORMAT = "1"
STATUSES = ("certified", "infeasible", "refuted", "uncertified")
PATH = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*(\.[A-Za-z0-9_-]+( [A-Za-z0-9_-]+)*|\[[0-9]+\])*")
RESULT = {"spec", "status"}  # keys that tell a result from a spec
TOLERANCES = ("rtol", "atol")
RECORD = ("verified", "printed", "rtol", "atol", "note")


def resolve(document: Document, *, judged: bool = True) -> Spec:
    """Read a document: its structure, then every value.

    `judged`: whether declared types are proved of their f, or refuted; a plant that is only run needs neither. Raises
    `UsageError` with everything that is wrong, in the order of the file.
    """
    require_spec(document)
    reader = Reader(document, list(document.problems), judged=judged)
    file, named = read_file(reader), document.find(("observer", "type"))[1].value
    family = FAMILIES.get(named) if isinstance(named, str) else None  # whatever else is wrong in its section
    if file is None or file.parameters is None:
        reader.stop()
    require_format(reader, file)
    read_parameters(reader, file.parameters)
    period = read_period(reader, file, family)
    levels = read_levels(reader, file.noise or {})
    channels = levels if family is not None and family.noise_in_w else {}
    plant = read_system(reader, file, family, channels)
    plant, continuous = discretised(reader, file.system, plant, period)
    layout = plant.layout
    require_outputs(reader, levels, layout)
    exogenous = read_disturbance(reader, file.disturbance, layout, period)
    in_plant = frozenset(reader.used)
    typed = family is not None and family.equations and not family.matrices
    asked = read_performance(reader, file.performance, layout, exogenous, kind=named if typed else "")
    steps = read_implementation(reader, file.implementation, file.simulation, period, family)
    observer, noisy = None, beside(exogenous, len(channels))
    blocks: tuple[Nonlinearity, ...] = ()
    if family is not None and file.observer is not None:
        split = isinstance(file.system, Equations) and not family.equations
        observer, blocks = read_observer(reader, family, file.observer, plant, noisy, asked.H, split, period, steps)
    running = read_running(reader, file, layout, exogenous, levels, family, period, steps, in_plant)
    expect = read_expectations(reader, file.expect or {})
    judge_parameters(reader)
    if reader.problems or plant.plant is None or noisy.generator is None or observer is None:
        reader.stop()
    assert layout.names is not None
    made = Spec(
        **heading(document, file),
        generator=noisy.generator,
        model_states=exogenous.states,
        drives=numbered("v", noisy.v.size or 0),
        inputs=layout.names.inputs,
        units=file.system.units if file.system else {},
        nonlinearities=blocks,
        **{name: getattr(plant, name) for name in ("plant", "gx", "gq", "gy", "typed")},
        **vars(asked),
        noise=levels,
        observer=observer,
        **running,
        expect=expect,
        notes=tuple(reader.notes),
        rounded=any(AS_DOUBLE in note and not note.startswith("simulation.") for note in reader.notes),
        unused=tuple(reader.unused),
        as_equations=isinstance(file.system, Equations) and plant.typed is None,
        period=period,
        continuous=continuous,
    )
    return with_defect(reader, file, made)


def read_running(
    reader: Reader,
    file: File,
    layout: Layout,
    exogenous: Exogenous,
    levels: Mapping[str, Level],
    family: Family | None,
    period: fmpq | None,
    steps: Implementation | None,
    in_plant: Collection[str],
) -> dict[str, Any]:
    """How the observer is tried, how it runs on a computer, and where its signals are in a log."""
    simulation = read_simulation(reader, file.simulation, layout, exogenous, family, period, in_plant)
    if simulation is not None and layout.names is not None:
        held = steps and steps.period
        simulation = drawn(reader, levels, layout.names.outputs, simulation, period, held, family)
    data = read_data(reader, file.data, layout, exogenous.states)
    return {"simulation": simulation, "implementation": steps, "data": data}


def heading(document: Document, file: File) -> dict[str, Any]:
    """What a spec says of itself, and where it stands."""
    return {
        "name": file.name or named_by(document.path),
        "source": file.source or "",
        "description": (file.description or "").strip(),
        "reproduces": tuple(file.reproduces or ()),
        "text": document.text,
        "path": document.path,
        "changes": document.changes,
    }


def require_format(reader: Reader, file: File) -> None:
    """Refuse a format that this version does not know."""
    if file.obsdesign is not None and file.obsdesign != FORMAT:
        said = f"format {described(file.obsdesign)} is not known; this version reads format {FORMAT}"
        reader.wrong(("obsdesign",), said, id="OBS207")


def judge_parameters(reader: Reader) -> None:
    """Note each parameter that nothing uses; one that only a change makes is refused, for its name is misspelt.

    Where something else is wrong, what is used is not known.
    """
    idle = [] if reader.problems else [name for name in reader.parameters if name not in reader.used]
    for name in idle:
        loc: Loc = ("parameters", name)
        if reader.document.find(loc)[0].origin:
            others = [one for one in reader.parameters if one not in idle]
            reader.wrong(loc, unknown("parameter", name, others, {}), id="OBS201")
        reader.unused.append(f"{dotted(loc)} has no effect: no number and no expression uses it")


def require_spec(document: Document) -> None:
    """Refuse a result file; raises `UsageError` with what takes it."""
    if isinstance(document.root.value, dict) and document.root.value.keys() >= RESULT:
        piped = document.path == "-"
        takers = "`verify -` takes it, and `simulate` as a file" if piped else "`simulate` and `verify` take it"
        said = f"is a result of `solve`, not a spec; {takers}, and spec.text in it is its spec"
        raise UsageError(Problem(said, document.path, id="OBS109"))


def read_system(reader: Reader, file: File, family: Family | None, noise: Mapping[str, Level]) -> Reading:
    """The plant, in matrices or as equations, with the channels of its noise; of no family nothing more is told."""
    sampled, typed = (family is not None and getattr(family, name) for name in ("sampled", "equations"))
    identity = family is not None and family.unstructured
    if isinstance(file.system, Equations):
        if file.nonlinearities:
            said = "are the terms of system.dynamics, which are found by themselves: leave this out"
            reader.wrong(
                ("nonlinearities",),
                f"{said}; the type of a term is declared under system.types",
                at_key=True,
                id="OBS213",
            )
            return Reading(Layout())
        if typed and file.system.types:
            said = "is for designs that split the equations into terms; this type of observer takes them as they are"
            reader.wrong(("system", "types"), said, at_key=True, id="OBS213")
        if typed:
            return read_typed(reader, file.system)
        return read_equations(reader, file.system, noise, sampled=sampled, constants=identity)
    plant = read_plant(reader, file.system, file.nonlinearities, identity=identity, sampled=sampled)
    plant = in_matrices(reader, plant, noise)
    return in_equations(reader, plant) if typed and family and not family.matrices else plant


def read_observer(
    reader: Reader,
    family: Family,
    section: ObserverSection,
    plant: Reading,
    exogenous: Exogenous,
    H: Array,
    as_equations: bool,
    period: fmpq | None,
    steps: Implementation | None,
) -> tuple[Request, tuple[Nonlinearity, ...]]:
    """What is asked of the observer, and the blocks of f as its family takes them."""
    layout = plant.layout
    blocks = family.nonlinearities(reader, plant.nonlinearities, exogenous.nonlinearities)
    states = Axis(total(layout.states, exogenous.xm), "augmented state")
    q = layout.q.of(total(layout.q, exogenous.q))
    model, noisy = exogenous.generator, exogenous.noisy
    inputs = layout.names.inputs if layout.names else ()
    known = states, layout.outputs, q, plant.plant, model, H, blocks
    problem = Estimation(*known, plant.typed, as_equations, period, noisy, steps, inputs)
    return family.request(reader, section, problem), blocks


def total(plant: Axis, model: Axis) -> Size:
    """Size of an augmented signal."""
    return None if plant.size is None or model.size is None else plant.size + model.size


def read_expectations(reader: Reader, written: Mapping[str, Any]) -> dict[str, Any]:
    """Read what the spec must give: a status, and values by their dotted path in the result."""
    expected: dict[str, Any] = {}
    for key, value in written.items():
        loc: Loc = ("expect", key)
        if not PATH.fullmatch(key):
            reader.wrong(
                loc, f"{described(key)} is no path into a result, such as limit.gamma", at_key=True, id="OBS201"
            )
        elif key == "status" and value not in STATUSES:
            reader.wrong(loc, unknown("status", value, STATUSES, {}), id="OBS202")
        elif isinstance(value, dict):
            if "verified" not in value and value.keys() <= {*RECORD}:  # else one is misspelt
                reader.wrong(loc, "has no value to compare with; give verified: VALUE", id="OBS205")
            expected[key] = {name: read_record(reader, name, item, (*loc, name)) for name, item in value.items()}
        else:
            expected[key] = read_plain(reader, value, loc)
    return expected


def read_record(reader: Reader, name: str, value: Any, loc: Loc) -> Any:
    """One entry of an expectation."""
    if name not in RECORD:
        reader.wrong(loc, unknown("key", name, RECORD, {}), at_key=True, id="OBS201")
    if name in TOLERANCES:
        text = ENTRY.read(reader, value, loc)
        return None if text is None else float(reader.number(text, loc, ">= 0"))
    if name == "note":
        return TEXT.read(reader, value, loc)
    return read_plain(reader, value, loc)


def read_plain(reader: Reader, value: Any, loc: Loc) -> Any:
    """Read a value with its numbers as doubles."""
    if isinstance(value, Number):
        return float(reader.number(value, loc))
    if isinstance(value, list):
        return [read_plain(reader, item, (*loc, i)) for i, item in enumerate(value)]
    if isinstance(value, dict):
        reader.wrong(loc, "expected a number, text or a list, found a mapping", id="OBS204")
    return value
