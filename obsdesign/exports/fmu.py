"""An observer as a functional mock-up unit: FMI 2.0 for co-simulation, as source code."""

import hashlib
import io
import zipfile
from collections.abc import Iterable
from importlib.resources import files as packaged
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

from obsdesign import __version__
from obsdesign.errors import one_line
from obsdesign.exports import c
from obsdesign.exports.subject import Subject, comment, shortest
from obsdesign.exports.vectors import Vectors

EPOCH = (1980, 1, 1, 0, 0, 0)  # time of the files in an archive, so that its bytes are the same again


class Variable(NamedTuple):
    """A variable of the FMU; its place among those of its kind is its value reference."""

    name: str
    causality: str  # input, output or parameter
    said: str
    unit: str = ""
    start: float | None = None
    depends: tuple[int, ...] = ()  # places from 1 of the inputs that an output depends on by itself
    boolean: bool = False


def files(subject: Subject, _: Vectors) -> dict[str, bytes]:
    """Files of the export, by name."""
    ID = subject.name
    sources = {f"{ID}.h": c.header(subject), f"{ID}.c": c.source(subject), f"{ID}_fmu.c": wrapper(subject)}
    guid = identity(subject, sources.values())
    made = {"modelDescription.xml": description(subject, guid)}
    made |= {f"sources/{name}": text.replace("@GUID@", guid) for name, text in sources.items()}
    return {f"{ID}.fmu": archive(made)}


def archive(contents: dict[str, str]) -> bytes:
    """Archive of texts, the same for the same texts: no time, and nothing compressed."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED) as made:
        for name, text in contents.items():
            entry = zipfile.ZipInfo(name, EPOCH)
            entry.create_system, entry.external_attr = 3, 0o644 << 16
            made.writestr(entry, text.encode())
    return stream.getvalue()


def identity(subject: Subject, sources: Iterable[str]) -> str:
    """Identifier of the interface and of the sources, which both have."""
    texts = [*sources, *(repr(one) for one in variables(subject))]
    h = hashlib.sha256("\0".join(texts).encode()).hexdigest()
    return f"{{{h[:8]}-{h[8:12]}-{h[12:16]}-{h[16:20]}-{h[20:32]}}}"


def located(subject: Subject) -> list[int]:
    """Places of the states of the plant that an estimate at the start counts for."""
    one = subject.implemented
    known = {k for _, k in one.copied}
    known |= {one.plant_states.index(n) for n in (one.locate.given if one.locate else ()) if n in one.plant_states}
    return sorted(known)


def variables(subject: Subject) -> list[Variable]:
    """Variables of the FMU, in the order of their description."""
    taken: set[str] = set()

    def free(name: str) -> str:
        while name in taken:
            name += "_"
        taken.add(name)
        return name

    units, one = subject.units, subject.implemented
    sides = [(name, "known input") for name in subject.inputs] + [(name, "measured output") for name in subject.outputs]
    made = [Variable(free(name), "input", said, units.get(name, ""), 0.0) for name, said in sides]
    given = {i for i, (name, _) in enumerate(sides, start=1) if name in subject.routines["estimate"].given}
    depends = () if subject.ahead else tuple(range(1, len(made) + 1)) if subject.begins else tuple(sorted(given))
    if subject.instants:
        said = "true: the measured outputs are a measurement, which is taken at the beginning of the next step"
        made.append(Variable(free("measured"), "input", said, boolean=True))
    late = ", a period ago" if subject.ahead else ""
    made += [
        Variable(free(f"hat_{name}"), "output", f"estimate of {name}{late}", units.get(name, ""), depends=depends)
        for name in subject.estimates
    ]
    made += [
        Variable(free(f"xhat0_{name}"), "parameter", f"estimate of {name} at the start", units.get(name, ""), start)
        for name, start in ((one.plant_states[k], float(one.xhat0[k])) for k in located(subject))
    ]
    return made


def told(subject: Subject) -> list[str]:
    """What a user of the FMU needs to know of its steps, and what is proved."""
    step = f"{subject.period:g} s"
    if subject.instants:
        steps = f"a step may have any length; over a longer time than {step} it is several"
    else:
        steps = f"a step has a length of {step}, or of a multiple of it, over which inputs are held"
    late = ["an estimate knows the measured outputs of its sample, and is therefore that of the sample a period before"]
    return [*subject.words, steps, *(late if subject.ahead else [])]


def description(subject: Subject, guid: str) -> str:
    """File `modelDescription.xml`."""
    ID, known = subject.name, variables(subject)
    text = quoteattr("\n".join(map(one_line, told(subject))))
    units = sorted({one.unit for one in known if one.unit})
    references = {False: iter(range(len(known))), True: iter(range(len(known)))}
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="2.0" modelName="{ID}" guid="{guid}" description={text}',
        f'    generationTool="obsdesign {__version__}" variableNamingConvention="flat" numberOfEventIndicators="0">',
        f'  <CoSimulation modelIdentifier="{ID}" canGetAndSetFMUstate="true" canSerializeFMUstate="true"',
        f'      canHandleVariableCommunicationStepSize="{"true" if subject.instants else "false"}">',
        "    <SourceFiles>",
        *(f'      <File name="{name}"/>' for name in (f"{ID}.c", f"{ID}_fmu.c")),
        "    </SourceFiles>",
        "  </CoSimulation>",
    ]
    if units:
        lines += ["  <UnitDefinitions>", *(f"    <Unit name={quoteattr(unit)}/>" for unit in units)]
        lines += ["  </UnitDefinitions>"]
    lines += ["  <LogCategories>", '    <Category name="logStatusError"/>', "  </LogCategories>"]
    lines += [f'  <DefaultExperiment startTime="0" stepSize="{shortest(subject.period)}"/>', "  <ModelVariables>"]
    lines += [line for one in known for line in declared(one, next(references[one.boolean]))]
    outputs = [(i, one) for i, one in enumerate(known, start=1) if one.causality == "output"]
    lines += ["  </ModelVariables>", "  <ModelStructure>", "    <Outputs>"]
    lines += [f'      <Unknown index="{i}" dependencies="{" ".join(map(str, one.depends))}"/>' for i, one in outputs]
    lines += ["    </Outputs>", "    <InitialUnknowns>", *(f'      <Unknown index="{i}"/>' for i, _ in outputs)]
    return "\n".join([*lines, "    </InitialUnknowns>", "  </ModelStructure>", "</fmiModelDescription>", ""])


def declared(one: Variable, reference: int) -> list[str]:
    """Lines of a variable."""
    kind = {
        "input": 'variability="discrete"' if one.boolean else 'variability="continuous"',
        "output": 'variability="continuous" initial="calculated"',
        "parameter": 'variability="fixed" initial="exact"',
    }[one.causality]
    unit = f" unit={quoteattr(one.unit)}" if one.unit else ""
    start = "" if one.start is None else f' start="{shortest(one.start)}"'
    return [
        f'    <ScalarVariable name={quoteattr(one.name)} valueReference="{reference}" causality="{one.causality}"',
        f"        {kind} description={quoteattr(one.said)}>",
        '      <Boolean start="false"/>' if one.boolean else f"      <Real{unit}{start}/>",
        "    </ScalarVariable>",
    ]


def wrapper(subject: Subject) -> str:
    """Source `ID_fmu.c`: the functions of the interface, over those of `ID.c`."""
    ID, one, places = subject.name, subject.implemented, located(subject)
    start = ", ".join(shortest(float(value)) for value in one.xhat0[: len(one.plant_states)]) or "0"
    head = f"""\
{comment(subject)}
#include "{ID}.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define OBS(name) {ID}_##name
#define GUID "@GUID@"
#define AHEAD {int(subject.ahead)} /* whether a step takes y of the sample that it reaches */
#define INSTANTS {int(subject.instants)} /* whether y is known at instants */
#define PARAMETERS {len(places)}
#define START {{{start}}} /* where the states of the plant begin in the spec */
static const int PLACES[] = {{{", ".join(map(str, places)) or 0}}}; /* of the parameters among these */
"""
    return head + packaged("obsdesign.exports").joinpath("fmu.c").read_text("utf-8")
