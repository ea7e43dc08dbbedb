"""Which estimates of an observer in coordinates have to be right before which others can be."""

from collections.abc import Collection

from obsdesign.families.algebraic.forms import Regression, Transformed
from obsdesign.families.algebraic.scheme import Plant, unbounded


def waits(form: Transformed, *names: str) -> set[str]:
    """Coordinates whose estimates must be right before what names these signals is, those before them included.

    In `B`, `K` and the left inverse the name of a coordinate is its estimate; one with lambda 0 is right once its
    constant is.
    """
    own = {c.name: c for c in form.coordinates}
    used = own.keys() & set(names)
    return used.union(*(waits(form, *own[name].B.names) for name in used))


def held(form: Transformed, regression: Regression) -> set[str]:
    """Coordinates whose estimates must be right before a regression is; of one with lambda 0, those it waits for."""
    own = {c.name: c for c in form.coordinates}
    used = named(regression) & own.keys()
    decaying = {name for name in used if not own[name].estimated}
    return decaying.union(*(waits(form, *own[name].B.names) for name in used))


def named(regression: Regression) -> set[str]:
    """Signals of a regression, and the coordinates whose constants it holds."""
    return set(regression.m).union(*(side.names for side in (regression.known, *regression.m.values())))


def together(form: Transformed, name: str) -> set[str]:
    """Constants that regressions hold with that of a coordinate, or with another of these."""
    rows = [set(row.m) for row in form.estimator.regressions] if form.estimator else []
    found = {name}
    while more := set().union(*(row for row in rows if row & found)) - found:
        found |= more
    return found


def needs(form: Transformed, name: str) -> set[str]:
    """Coordinates for whose estimates that of one waits: those in its B, and in the regressions of a constant."""
    own = {c.name: c for c in form.coordinates}
    rows = form.estimator.regressions if form.estimator else ()
    constants = together(form, name)
    used = set().union(*(named(row) & own.keys() for row in rows if constants & row.m.keys()))
    ahead = [own[one].B.names if own[one].estimated else {one} for one in used]
    return own.keys() & own[name].B.names.union(*ahead)


def circle(form: Transformed) -> list[str]:
    """Coordinates of which each waits for the next, and the last for the first; none in a cascade."""
    for first in form.coordinates:
        paths = [[first.name]]
        for path in paths:  # the shortest ones first
            if path[0] in (ahead := needs(form, path[-1])):
                return path
            met = {name for each in paths for name in each}
            paths += [[*path, name] for name in sorted(ahead - met)]
    return []


def circular(path: Collection[str]) -> str:
    """What is not decided of estimates that wait for each other."""
    names = [*path]
    said = (f"{name} waits for {after}" for name, after in zip(names, [*names[1:], names[0]], strict=True))
    return f"that estimates which wait for each other converge: {', '.join(said)}"


def once(names: Collection[str], turning: bool = False) -> str:
    """Clause on what has to be right before; `turning`: it waits for what it acts on."""
    right = f", {'as long as' if turning else 'once'} the estimate of {', '.join(sorted(names))} is right"
    return f"{right} (an error of it acts as a disturbance)" if names else ""


def couplings(plant: Plant, form: Transformed) -> list[str]:
    """What is not proved of errors that act on others: that they do so by a bounded factor."""
    own = {c.name: c for c in form.coordinates}
    sides = [(f"that of {c.name}", c.B, own.keys() & c.B.names) for c in form.coordinates]
    for k, row in enumerate(form.estimator.regressions if form.estimator else (), start=1):
        wrong = {name for name in own.keys() & named(row) if not own[name].estimated or waits(form, *own[name].B.names)}
        sides += [(f"regression {k}", side, wrong & side.names) for side in (row.known, *row.m.values())]
    factors = [(name, what, side.derivative(name)) for what, side, names in sides for name in sorted(names)]
    return [unbounded(f"the error of {name}", what, c) for name, what, c in factors if not plant.region.bounds(c)]
