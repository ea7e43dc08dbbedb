"""A spec from Python values, without YAML."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from obsdesign.errors import Problem, UsageError
from obsdesign.reading.resolve import FORMAT, resolve
from obsdesign.sections.document import compose
from obsdesign.sections.writing import written
from obsdesign.spec import Called, Spec

PATH = "<python>"


def build(sections: Mapping[str, Any]) -> Spec:
    """Read a spec from its sections: `system`, `observer`, and the others of a spec file, by name.

    The sections are written as YAML, which is the `text` of the spec, and read as any file is.

    Parameters
    ----------
    sections
        Numbers, text, numpy arrays, lists and mappings. A double is taken as the shortest decimal that prints it:
        0.1 is 1/10.

    Raises
    ------
    UsageError
        One problem for everything that is wrong, with its key.
    """
    text = written({"obsdesign": int(FORMAT), **sections}, PATH)
    try:
        return resolve(compose(text, PATH))
    except UsageError as error:
        raise UsageError(*(Problem(one.message, PATH, key=one.key) for one in error.problems)) from None


def with_simulation(spec: Spec, changes: Mapping[str, Any]) -> Spec:
    """Return the same spec, its text included, with other values of keys of `simulation:`; None takes a key away.

    Raises
    ------
    UsageError
        A change is wrong, with its key.
    """
    sections = compose(spec.text, spec.path).root.plain()
    trial = {**sections.get("simulation", {}), **changes}
    return replace(spec, simulation=build({**sections, "simulation": trial}).simulation)


Called.build = staticmethod(build)
