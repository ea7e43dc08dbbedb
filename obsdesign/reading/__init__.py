"""Specs: from a YAML text to one estimation problem, or to everything that is wrong with it.

schema.py     the sections of the format (structure only), and its JSON Schema; trial_schema.py: `simulation:`
signals.py    what acts in a run: expressions, and columns of files, whose paths are below the folder of the spec
plant.py      a plant in matrices; dynamics.py: one as equations, split, with the types of its terms (terms.py)
resolve.py    the sections to the types of the design: exact values, derived sizes, names
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from obsdesign.errors import Problem, UsageError
from obsdesign.reading.resolve import FORMAT, resolve
from obsdesign.reading.schema import json_schema
from obsdesign.sections.changes import opened
from obsdesign.sections.document import compose
from obsdesign.sections.source import read
from obsdesign.sections.writing import written
from obsdesign.spec import Called, Nonlinearity, Spec
from obsdesign.trial import Noise, Simulation

__all__ = [
    "Noise",
    "Nonlinearity",
    "Simulation",
    "Spec",
    "build",
    "json_schema",
    "load",
    "loads",
    "varied",
    "with_simulation",
]

PYTHON = "<python>"  # in place of a file


def load(source: str | os.PathLike[str], changes: Sequence[str] = ()) -> Spec:
    """Read a spec from a file, or from its text, which has more than one line.

    `changes`: other values of single keys, such as `observer.alpha=0.5`, read as YAML; the spec keeps them. Raises
    `UsageError`: one problem for everything that is wrong, with file, line, column and key.
    """
    return resolve(read(source, changes))


def loads(text: str, path: str = "<text>", changes: Sequence[str] = ()) -> Spec:
    """Read a spec from its text, YAML of at most 4 MiB; `path`: what messages call it. Raises as `load`."""
    return resolve(opened(text, path, changes))


def varied(spec: Spec, values: Mapping[str, Any]) -> Spec:
    """Return the same spec with other values of parameters, whose types are not judged: to be run, not designed for.

    Raises `UsageError`: with these values the plant is none.
    """
    changes = (*spec.changes, *(f"parameters.{name}={value!r}" for name, value in values.items()))
    return resolve(opened(spec.text, spec.path, changes), judged=False)


def build(sections: Mapping[str, Any]) -> Spec:
    """Read a spec from its sections: `system`, `observer`, and the others of a spec file, by name.

    The sections are written as YAML, which is the `text` of the spec, and read as any file is.

    `sections`: numbers, text, numpy arrays, lists and mappings. A double is taken as the shortest decimal that prints
    it: 0.1 is 1/10. Raises `UsageError`: one problem for everything that is wrong, with its key.
    """
    text = written({"obsdesign": int(FORMAT), **sections}, PYTHON)
    try:
        return resolve(compose(text, PYTHON))
    except UsageError as error:
        raise UsageError(*(Problem(one.message, PYTHON, key=one.key, id=one.id) for one in error.problems)) from None


def with_simulation(spec: Spec, changes: Mapping[str, Any]) -> Spec:
    """Return the same spec, its text included, with other values of keys of `simulation:`; None takes a key away.

    Raises `UsageError`: a change is wrong, with its key.
    """
    sections = opened(spec.text, spec.path, spec.changes).root.plain()
    trial = {**sections.get("simulation", {}), **changes}
    return replace(spec, simulation=build({**sections, "simulation": trial}).simulation)


Called.build = staticmethod(build)
