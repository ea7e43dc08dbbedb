"""A polytope around the values that expressions take together over a box: tighter than the box of their ranges.

It is cut out of that box by half-spaces c' u <= h: c the normals of a hull of values that were seen, on as fine a grid
as leaves few vertices; h a proved bound of c' u, as one expression. The vertices are all solutions, in rationals, of as
many equations c' u = h as there are expressions that satisfy the other inequalities.
"""

from collections.abc import Sequence
from itertools import combinations, product
from math import comb

import numpy as np
from flint import fmpq, fmpq_mat

from obsdesign.expressions import Expression
from obsdesign.lmi.formula import Array, rational_number
from obsdesign.nonlinearities.evidence.enclosure import outward, supremum_of
from obsdesign.nonlinearities.evidence.refutation import spread
from obsdesign.nonlinearities.evidence.restriction import Restriction

ONE = Expression.number(1)
MAX_TOGETHER = 4  # expressions
MAX_VERTICES = 64  # an inequality each in a design
MAX_WORK = 10_000  # sets of equations
GRIDS = (7, 5, 4, 3)  # points in each variable of which a hull is tried
GRIDDED = 2  # variables at most: else there are as many points anywhere
DIGITS = 3  # of a normal
SHARE = 1 / 2  # of the work, for a bound
WORTH = 0.9  # of the box: what leaves more of it is not worth its vertices
INSIDE = 4096  # points by which a share of the box is measured

Point = tuple[fmpq, ...]
Cut = tuple[list[fmpq], fmpq]  # c' u <= h


def together(f: Restriction, g: Sequence[Expression], ranges: Sequence[tuple[fmpq, fmpq]]) -> tuple[list[Point], float]:
    """Vertices of a polytope that holds the values of g over the region of f, and its share of the box of their ranges.

    `ranges`: proved, of each g; u = (g - low) / (high - low).
    """
    sizes = [(low, high - low) for low, high in ranges]
    u = [Expression.combination([1 / size, -low / size], [e, ONE]) for e, (low, size) in zip(g, sizes, strict=True)]
    unit = [[fmpq(int(i == j)) for j in range(len(g))] for i in range(len(g))]
    cuts: list[Cut] = [(e, fmpq(1)) for e in unit] + [([-x for x in e], fmpq(0)) for e in unit]
    vertices, box = vertices_of(cuts), len(cuts)
    for count in GRIDS:
        normals = facets(values(f, u, count))
        if not normals or comb(box + len(normals), len(g)) > MAX_WORK:
            continue
        bounds = [supremum_of(Expression.combination(c, u), f, SHARE).bound for c in normals]
        if not np.isfinite(bounds).all():
            continue
        more = [*cuts, *zip(normals, (outward(bound, up=True) for bound in bounds), strict=True)]
        fewer, part = vertices_of(more), share(more)
        if len(fewer) <= MAX_VERTICES:
            cuts, vertices = (more, fewer) if part < WORTH else (cuts, vertices)
            break
    whole = [tuple(low + size * x for (low, size), x in zip(sizes, v, strict=True)) for v in vertices]
    return whole, share(cuts)


def share(cuts: Sequence[Cut]) -> float:
    """Part of the unit box that some half-spaces leave, by points of it."""
    points = np.random.default_rng(0).random((INSIDE, len(cuts[0][0])))
    return float(np.all([points @ np.array(c, dtype=float) <= float(h) for c, h in cuts], axis=0).mean())


def values(f: Restriction, g: Sequence[Expression], count: int) -> Array:
    """Values (N, d) of expressions on a grid of the region, or at points of it."""
    ends = [*f.box.values()]
    if len(ends) <= GRIDDED and np.isfinite(ends).all():
        points = np.array([*product(*(np.linspace(*limits, count) for limits in ends))]).T
    else:
        points = spread(f.box, np.random.default_rng(0), count**2)
    found = np.array([np.broadcast_to(e.function(tuple(f.box))(*points), points.shape[1]) for e in g]).T
    return np.asarray(found[np.isfinite(found).all(axis=1)])


def facets(points: Array) -> list[list[fmpq]]:
    """Outward normals of the convex hull of points (N, d), in few digits; none where they are in a plane."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        normals = ConvexHull(points).equations[:, :-1]
    except (QhullError, ValueError):
        return []
    found = {tuple(f"{x + 0.0:.{DIGITS}f}" for x in c): None for c in np.round(normals, DIGITS)}
    return [[rational_number(x) for x in c] for c in found]


def vertices_of(cuts: Sequence[Cut]) -> list[Point]:
    """Vertices of the bounded set {u: c' u <= h for every cut}, exactly."""
    found: dict[Point, None] = {}
    size = len(cuts[0][0])
    for some in combinations(cuts, size):
        A = fmpq_mat(size, size, [x for c, _ in some for x in c])
        if A.det() == 0:
            continue
        u = A.solve(fmpq_mat(size, 1, [h for _, h in some])).entries()
        if all(sum((a * b for a, b in zip(c, u, strict=True)), fmpq(0)) <= h for c, h in cuts):
            found[tuple(u)] = None
    return list(found)
