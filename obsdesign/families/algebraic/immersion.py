"""Immersion and invariance observers (Proposition 4): an attractive invariant manifold beta(y, chi) = phi(x).

xhat = phiL(beta(y, chi), y)
chi' = -[d beta/d chi]^+ (d beta/dy ydot(xhat, u) - phi_dot(xhat, u)) + (I - [..]^+ [..]) Q    (20), if none is given

d = beta - phi(x) obeys d' = d beta/dy (ydot(x) - ydot(xhat)) - phi_dot(x) + phi_dot(xhat)  (18)
with xhat = phiL(phi(x) + d, y), if the manifold is invariant, whatever Q is.
"""

from collections.abc import Sequence
from typing import Any

from flint import fmpq

from obsdesign.expressions import Expression
from obsdesign.expressions.algebra import identical, simplified
from obsdesign.families.algebraic.cascade import Block, Cascade, Error
from obsdesign.families.algebraic.estimator import determinant
from obsdesign.families.algebraic.forms import Immersion
from obsdesign.families.algebraic.high_gain import sensitivity
from obsdesign.families.algebraic.identity import Identity
from obsdesign.families.algebraic.scheme import (
    INVERTED,
    UNBOUNDED,
    ZERO,
    Plant,
    Scheme,
    added,
    inverses,
    less,
    multiplied,
    slope,
    smooth,
    values,
)
from obsdesign.families.observer import Observer
from obsdesign.model.equations import Named

Matrix = list[list[Expression]]
UNKNOWN = "whether chi comes there"


def scheme(plant: Plant, form: Immersion) -> Scheme:
    """What such an observer rests on, and its equations."""
    b = {f"b{i + 1}": side for i, side in enumerate(form.beta)}
    phi = {f"b{i + 1}": side for i, side in enumerate(form.phi)}
    estimates = plant.measured() | {name: side.substituted(b) for name, side in form.left_inverse.items()}
    estimates = {name: estimates[name] for name in plant.dynamics}
    dynamics = form.dynamics or by_default(plant, form, estimates)
    statements = inverses(plant, form.left_inverse, phi)
    statements += [one for side in form.phi for one in smooth("phi", side)]
    manifold = on_manifold(form, {name: Expression.variable(name) for name in plant.dynamics})
    leaves = "" if manifold else UNKNOWN
    invariant = [invariance(plant, form, dynamics, estimates, i, manifold, leaves) for i in range(len(form.phi))]
    statements += invariant
    statements += [one for side in form.beta for one in smooth("beta", side, manifold, leaves)]
    statements += [one for side in dynamics.values() for one in values("dynamics", side, manifold, leaves)]
    statements += plant.differentiable(*form.beta)
    errors = attraction(plant, form, [one for one in statements if isinstance(one, Identity)])
    blocks = errors.blocks()
    statements += [one for block in blocks for one in block.statements]
    numbers: dict[str, Any] = {
        "phi": [side.text for side in form.phi],
        "beta": [side.text for side in form.beta],
        "dynamics": {name: side.text for name, side in dynamics.items()},
    }
    stays = "where beta(y, chi) = phi(x) it stays so: the manifold is invariant"
    moves = [said(errors, block) for block in blocks]
    says = (stays, *moves, f"xhat = x where beta(y, chi) = phi(x), {INVERTED}")
    observer = Observer(dynamics, estimates, plant.inputs, tuple(plant.outputs))
    rates = {errors.errors[block.own[0]].name: block.rate for block in blocks if block.rate}
    depends = (UNBOUNDED, *(one for block in blocks for one in block.open))
    return Scheme(tuple(statements), observer, numbers, says, depends, rates)


def moved(plant: Plant, form: Immersion, estimates: Named, i: int) -> Expression:
    """D beta_i/dy ydot(xhat) - phi_i_dot(xhat): what chi has to follow, with the other sign."""
    return less(plant.driven(form.beta[i], estimates), plant.along(form.phi[i]).substituted(estimates))


def by_default(plant: Plant, form: Immersion, estimates: Named) -> dict[str, Expression]:
    """Equation (20), with the right inverse J' (J J')^-1 of J = d beta/d chi."""
    J = [[slope(side, name) for name in form.chi] for side in form.beta]
    right = pseudo_inverse(J)
    sides = [moved(plant, form, estimates, i) for i in range(len(form.beta))]
    found = {}
    for k, name in enumerate(form.chi):
        parts = [multiplied(right[k][i], side) for i, side in enumerate(sides)]
        found[name] = Expression.combination([fmpq(-1)] * len(parts), parts)
        if form.Q:
            seen = [multiplied(J[i][j], q) for i in range(len(J)) for j, q in enumerate(form.Q)]
            rows = [added(seen[i * len(form.Q) : (i + 1) * len(form.Q)]) for i in range(len(J))]
            hidden = less(form.Q[k], *(multiplied(right[k][i], row) for i, row in enumerate(rows)))
            found[name] = added([found[name], hidden])
    return {name: simplified(side) for name, side in found.items()}


def on_manifold(form: Immersion, estimate: Named) -> dict[str, Expression]:
    """Chi with beta(y, chi) = phi(xhat), the least if there are several; none where that is not linear, or has none."""
    J = [[slope(side, name) for name in form.chi] for side in form.beta]
    if any(not entry.names.isdisjoint(form.chi) for row in J for entry in row):
        return {}
    wanted = [side.substituted(estimate) for side in form.phi]
    rest = [side.substituted(dict.fromkeys(form.chi, ZERO)) for side in form.beta]
    gaps = [less(phi, beta) for phi, beta in zip(wanted, rest, strict=True)]
    found = {
        name: added([multiplied(c, gap) for c, gap in zip(row, gaps, strict=True)])
        for name, row in zip(form.chi, pseudo_inverse(J), strict=True)
    }
    met = (identical(beta.substituted(found), phi) for beta, phi in zip(form.beta, wanted, strict=True))
    return {name: simplified(side) for name, side in found.items()} if all(met) else {}


def pseudo_inverse(J: Matrix) -> Matrix:
    """J' (J J')^-1 by Cramer's rule."""
    m, n = len(J), len(J[0])
    gram = [[added([multiplied(J[i][k], J[j][k]) for k in range(n)]) for j in range(m)] for i in range(m)]
    whole = determinant(gram)
    inverse = [[Expression(cofactor(gram, j, i).root / whole.root) for j in range(m)] for i in range(m)]
    return [[added([multiplied(J[k][j], inverse[k][i]) for k in range(m)]) for i in range(m)] for j in range(n)]


def cofactor(rows: Matrix, i: int, j: int) -> Expression:
    """Signed minor without row i and column j; 1 of a number."""
    rest = [[entry for c, entry in enumerate(row) if c != j] for r, row in enumerate(rows) if r != i]
    minor = determinant(rest) if rest else Expression.number(1)
    return Expression.combination([fmpq(-1) ** (i + j)], [minor])


def invariance(
    plant: Plant, form: Immersion, dynamics: Named, estimates: Named, i: int, manifold: Named, leaves: str
) -> Identity:
    """d/dt beta_i = d/dt phi_i wherever beta = phi(xhat): an identity in y, chi and u; on the manifold it must hold."""
    followed = [multiplied(slope(form.beta[i], name), side) for name, side in dynamics.items()]
    residual = added([moved(plant, form, estimates, i), *followed])
    return Identity(f"invariance: d/dt ({form.beta[i]}) = d/dt ({form.phi[i]})", residual, leaves, manifold)


def attraction(plant: Plant, form: Immersion, given: Sequence[Identity]) -> Cascade:
    """How d = beta - phi(x) moves, (18); `given`: that the manifold is invariant, the left inverse."""
    d = [Expression.variable(f"δ{i + 1}") for i in range(len(form.phi))]
    off = {f"b{i + 1}": added([side, d[i]]) for i, side in enumerate(form.phi)}
    states = {name: Expression.variable(name) for name in plant.dynamics}
    shown = {name: side for name, side in states.items() if name in plant.measured()}
    estimates = {**shown, **{name: plant.on(side, off) for name, side in form.left_inverse.items()}}
    errors = {}
    for i, phi in enumerate(form.phi):
        pulled = plant.on(less(plant.driven(form.beta[i]), plant.driven(form.beta[i], estimates)))
        moving = less(added([pulled, plant.along(phi).substituted(estimates)]), plant.along(phi))
        name = f"({form.beta[i]}) - ({phi})"
        errors[d[i].text] = Error(name, "off the manifold", f"off the manifold, {i + 1}", moving)
    E = sensitivity(plant, form.left_inverse, {f"b{i + 1}": side for i, side in enumerate(form.phi)})
    return Cascade(plant, errors, E, tuple(given), frozenset(form.chi), UNKNOWN)


def said(cascade: Cascade, block: Block) -> str:
    """How the errors of a block fall, and which others have to be 0."""
    before = ", ".join(cascade.errors[name].name for name in block.before)
    return block.said + (f", where {before} is 0 (otherwise it acts as a disturbance)" if before else "")
