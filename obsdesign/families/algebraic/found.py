"""Coordinates as a result file holds them: found for a spec, written, and read again."""

from dataclasses import replace
from typing import Any

from obsdesign.errors import UsageError
from obsdesign.families.algebraic.find import Finder, Found, Search, explicit, find
from obsdesign.families.algebraic.forms import Sought, Transformed
from obsdesign.families.algebraic.regress import regressions
from obsdesign.families.algebraic.request import request_of
from obsdesign.files import ResultFile
from obsdesign.model.equations import Typed
from obsdesign.sections.changes import opened
from obsdesign.spec import Spec


def search_of(asked: Sought) -> Search:
    """What a spec asks to be searched."""
    return Search(asked.degree, asked.lambdas, asked.functions, asked.kind != "pebo", asked.kind != "kkl")


def sought(typed: Typed, asked: Sought) -> tuple[Transformed | None, Found, tuple[str, ...]]:
    """Coordinates of a plant with all that an observer needs, if there are such, what was found, and what is missing.

    Missing are states that no coordinate gives, or coordinates whose constant no regression holds.
    """
    made = find(typed, search_of(asked))
    if made.missing:
        return None, made, made.missing
    estimated = [c.name for c in made.coordinates if c.estimated]
    estimator = None
    if estimated and asked.estimator:
        rows, powers = regressions(made, typed)
        held = {name for row in rows for name in row.m}
        if missing := tuple(name for name in estimated if name not in held):
            return None, made, missing
        estimator = replace(asked.estimator, regressions=rows, powers=powers)
    return Transformed(made.coordinates, made.left_inverse, estimator, asked.recast), made, ()


def found(form: Transformed) -> dict[str, Any]:
    """Entries of `observer` of a result file."""
    entries: dict[str, Any] = {
        "coordinates": [
            {"name": c.name, "phi": c.phi.text, "lambda": c.rate.text, "B": c.B.text} for c in form.coordinates
        ],
        "left_inverse": {name: side.text for name, side in form.left_inverse.items()},
    }
    if form.estimator and form.estimator.regressions:
        entries["regressions"] = [
            {"output": r.output, "known": r.known.text, "m": {name: m.text for name, m in r.m.items()}}
            for r in form.estimator.regressions
        ]
        entries["as"] = dict.fromkeys(sorted(form.estimator.powers), "exp")
    return entries


def read_found(spec: Spec, file: ResultFile) -> Transformed:
    """Coordinates of a file whose spec asks for them to be found: read as if the spec had given them."""
    sections = opened(spec.text, spec.path, spec.changes).root.plain()
    given = {key: value for key, value in sections["observer"].items() if key not in {"degree", "lambdas", "functions"}}
    given |= {name: file.at("observer", name) for name in ("coordinates", "left_inverse")}
    if not isinstance(given["coordinates"], list):
        raise file.wrong("observer.coordinates", "expected a list of coordinates", id="OBS702")
    estimated = [str(c.get("lambda")) == "0" for c in given["coordinates"] if isinstance(c, dict)]
    given["type"] = "kkl" if not any(estimated) else "pebo" if all(estimated) else "kkl+pebo"
    if not any(estimated):
        given.pop("estimator", None)
    if "estimator" in given:
        rows = {key: file.at("observer", key) for key in ("regressions", "as")}
        given["estimator"] = {**given["estimator"], **rows}
    try:
        form = request_of(Spec(**{**sections, "observer": given})).form
    except UsageError as error:
        raise file.wrong(error.problems[0].key, error.problems[0].message, id=error.problems[0].id) from None
    assert isinstance(form, Transformed)
    require_searched(spec, file, form)
    return form


def require_searched(spec: Spec, file: ResultFile, form: Transformed) -> None:
    """Refuse coordinates that the search of the spec does not look at: its degree, functions, lambdas and type.

    Those before one in a cascade may have been taken as known, or not.
    """
    asked = request_of(spec).form
    assert isinstance(asked, Sought)
    assert spec.typed
    finder = Finder(explicit(spec.typed), spec.typed.domain, search_of(asked))
    for i, c in enumerate(form.coordinates):
        if not any(replace(finder, earlier=form.coordinates[:k]).holds(c) for k in range(i + 1)):
            said = f"is not among what the spec asks for (type {asked.kind}; {finder.searched})"
            raise file.wrong(f"observer.coordinates[{i}]", said, id="OBS707")
