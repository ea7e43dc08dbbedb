"""The format of a spec, version 1: which keys there are and what form their values have.

The sections hold structure only: sizes and meanings are for `resolve`. Every section of a file may be None,
which is what is left of a section whose structure is wrong. What each family of observers takes stands in its folder,
and the data of each type of nonlinearity in its file.
"""

import re
from collections.abc import Mapping
from typing import Any

from obsdesign.families import FAMILIES
from obsdesign.families.asked import FAMILY, ObserverSection
from obsdesign.reading.disturbance_schema import CHANNEL, CHANNEL_NAME, CHANNELWISE, ChannelData, Disturbance
from obsdesign.reading.plant_schema import MAX_BLOCKS, Equations, InMatrices, Nonlinearity, System
from obsdesign.reading.trial_schema import Data, Implementation, NoiseLevel, Simulation
from obsdesign.sections.document import Loc
from obsdesign.sections.forms import (
    ANYTHING,
    ENTRY,
    LINE,
    MATRIX,
    TEXT,
    Either,
    Entries,
    ListOf,
    MapOf,
    Schema,
    Section,
    key,
    refuse,
    required,
)
from obsdesign.sections.values import Reader
from obsdesign.sections.words import nearest


class Performance(Section):
    """z = H e, each error times its weight."""

    H: Entries | None = key(
        MATRIX, "nz x (nx + nm), over the augmented state (x, xm), alone", otherwise="by names", example="[[1, 0, 0]]"
    )
    signals: str | list[str] | None = key(
        Either("x, w, all or a list of names", TEXT, ListOf(TEXT)),
        "what must be estimated well",
        otherwise="what weights and scales name",
        example="[theta, w1]",
        name="of",
    )
    weights: dict[str, str] | None = key(
        MapOf(ENTRY), "factor of each error in z, > 0", otherwise="1", example="{theta: 1, w1: 100}"
    )
    scales: dict[str, str] | None = key(
        MapOf(ENTRY), "typical size of each error, > 0: its weight is 1/scale", otherwise="1", example="{theta: 0.01}"
    )


class Observer:
    """The section of the family that `type` names."""

    def read(self, reader: Reader, value: Any, loc: Loc) -> ObserverSection | None:
        """Return the section; where the family is not known that says it all."""
        name = value.get("type") if isinstance(value, dict) else None
        if isinstance(value, dict) and "type" in value and not (isinstance(name, str) and name in FAMILIES):
            FAMILY.read(reader, name, (*loc, "type"))
            return None
        section: type[ObserverSection] = FAMILIES[name or next(iter(FAMILIES))].Section
        return section.read(reader, value, loc)

    def schema(self, definitions: Schema) -> Schema:
        """One of the sections."""
        return {"oneOf": [section.schema(definitions) for section in self.sections()]}

    def sections(self) -> list[type[ObserverSection]]:
        """Sections that may stand here, one for each family."""
        return list(dict.fromkeys(family.Section for family in FAMILIES.values()))


class File(Section):
    """A spec of obsdesign, format 1: one estimation problem."""

    @classmethod
    def hinted(cls) -> Mapping[str, str]:
        """Keys of the sections below, which a newcomer writes beside them."""
        within: dict[str, list[type[Section]]] = {"simulation": [Simulation], "system": [InMatrices, Equations]}
        within["observer"] = [family.Section for family in FAMILIES.values()]
        keys = {key: name for name, sections in within.items() for section in sections for key in section.forms()}
        return {key: f"is a key of {name}: write it there, as {name}.{key}" for key, name in keys.items()}

    obsdesign: str | None = required(ENTRY, "version of the format: 1", example="1")
    name: str | None = key(LINE, "title, of tables and figures", otherwise="the name of the file", example="Pendulum")
    source: str | None = key(TEXT, "where the problem is from", otherwise="none", example="Author (2020), Example 1")
    description: str | None = key(TEXT, "free text", otherwise="none", example="What is estimated, and why.")
    reproduces: list[str] | None = key(
        ListOf(LINE), "figures and tables of `source` that this spec makes again", default=[], example="[Fig. 3]"
    )
    parameters: dict[str, str] | None = key(
        MapOf(ENTRY), "numbers, usable by name in entries and expressions", default={}, example="{b: 0.1, k: 2*pi}"
    )
    system: InMatrices | Equations | None = required(
        System(), "the plant, in matrices or as equations", example="{A: [[0, 1], [-2, -1]], C: [1, 0]}"
    )
    nonlinearities: list[Nonlinearity] | None = key(
        ListOf(Nonlinearity, most=MAX_BLOCKS),
        "the blocks f_i of a plant in matrices",
        default=[],
        example="[{f: sin(q), type: {slope: [-1, 1]}, Bf: [0, -1], Cq: [1, 0]}]",
    )
    disturbance: str | Disturbance | list[str | ChannelData] | None = key(
        Either(CHANNELWISE, CHANNEL_NAME, ListOf(CHANNEL), mapping=Disturbance),
        "how w is generated from v; one model, or a list with one for each channel of w",
        default="unknown",
        example="[integrator, unknown]",
    )
    noise: dict[str, str | NoiseLevel] | None = key(
        MapOf(Either("a number, {rms: .., period: ..} or {density: ..}", ENTRY, mapping=NoiseLevel)),
        "white noise of outputs, by its rms: each is a further channel of w, with that number in D; runs draw it",
        default={},
        example="{theta: 1.0e-3}",
    )
    performance: str | list[str] | Performance | None = key(
        Either("x, w, all, a list of names, {weights: ..}, or {H: a matrix}", TEXT, ListOf(TEXT), mapping=Performance),
        "what must be estimated well: z is the error of it",
        default="x",
        example="[torque]",
    )
    observer: ObserverSection | None = required(Observer(), "what is designed", example="{type: l2, alpha: 0.5}")
    simulation: Simulation | None = key(
        Simulation, "how to try the observer", otherwise="the spec cannot be simulated", example="{horizon: 10}"
    )
    implementation: Implementation | None = key(
        Implementation,
        "how the observer runs on a computer",
        otherwise="export asks for --period and --method; a discrete plant needs none",
        example="{period: 1.0e-3, method: rk4}",
    )
    data: Data | None = key(
        Data,
        "where the signals are in a log, for estimate",
        otherwise="columns have the names of the outputs and inputs, and t",
        example="{columns: {y1: Current (A)}, scale: {y1: 0.001}}",
    )
    expect: dict[str, Any] | None = key(
        MapOf(ANYTHING),
        "what this spec must give: dotted keys of the result file, each a value or {verified, rtol, atol, ..}",
        default={},
        example="{status: certified, limit.gamma: {verified: 0.0153, rtol: 1.0e-3}}",
    )


def read_file(reader: Reader) -> File | None:
    """Structure of a document; a section in which something is wrong, be it only as YAML, is None."""
    tree, keys = reader.document.root.plain(), File.forms()
    if not isinstance(tree, dict):
        refuse(reader, f"a mapping with the keys {', '.join(keys)}", tree, ())
        return None
    before = list(reader.problems)
    known = {problem.key for problem in before}
    found = File.values(reader, tree, ())
    reader.problems[:] = before + [problem for problem in reader.problems[len(before) :] if problem.key not in known]
    names = [re.split(r"[.\[]", problem.key)[0] for problem in reader.problems]
    broken = {nearest(name, tuple(keys)) for name in names}
    return File(**{name: None if name in broken else found.get(name, one.default) for name, one in keys.items()})


def json_schema() -> Schema:
    """JSON Schema of the format, for editors."""
    definitions: Schema = {}
    whole = File.object(definitions)
    return {"$defs": definitions, **whole}
