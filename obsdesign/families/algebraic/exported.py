"""What identities prove of an observer without an LMI, for a file of Coq: its run, its errors, and their laws."""

from collections.abc import Mapping, Sequence

import numpy as np
from flint import fmpq

from obsdesign.coq.identities import Fall, Identities, Inverse, Law, Resolved, Run
from obsdesign.coq.runs import exported
from obsdesign.coq.theorem import UnexportedError
from obsdesign.expressions import Expression
from obsdesign.expressions.tree import Number
from obsdesign.families.algebraic.cascade import Cascade
from obsdesign.families.algebraic.claim import Claim
from obsdesign.families.algebraic.coordinates import attraction
from obsdesign.families.algebraic.estimator import exponential, filtered
from obsdesign.families.algebraic.forms import Form, HighGain, Immersion, Transformed
from obsdesign.families.algebraic.high_gain import Matrix, blocks, linear, slowest
from obsdesign.families.algebraic.immersion import attraction as off_manifold
from obsdesign.families.algebraic.order import held, waits
from obsdesign.families.algebraic.scheme import ZERO, Plant, Scheme, added, less, multiplied
from obsdesign.lmi.formula import rational, rational_number
from obsdesign.model.equations import Named
from obsdesign.nonlinearities.evidence.restriction import EVERYWHERE
from obsdesign.spec import Spec

PLACES = (4, 6, 9)  # digits of a storage function: with fewer the kernel has less to do
LIMITS = """\
These words are checked by nothing here. What Coq proves is for_this_f, at the end of this file:
- Of the words it states how each error moves along a run, that it decays, or is constant, and that the left inverse
  gives the states where the errors are zero. e_x is the error of the estimate of x, with 1, 2, .. of beta; k_x the
  constant theta of x; r_1, .. what is left of Y - psi theta of a regression; theta_x any estimate of theta.
- Where an error decays without a number, at every c with rate <= - c, and other errors have to vanish where it says so.
- Its premises are those of run: up to a time T the equations hold, without disturbance and noise, x is in its ranges,
  inputs that stand there as held_ are constant, and divisors, roots and logarithms have what is needed_1, ..
- It does not state that there is such a run, a bound on xhat - x, or that estimates of constants converge. That errors
  which act on each other decay it states where a sum of squares is bounded.
- That the equations of run are those of the spec and of its observer is believed."""


def theorem(spec: Spec, claim: Claim) -> str:
    """Claim as a file of Coq; raises `UnexportedError`."""
    assert spec.typed
    plant = Plant.of(spec.typed)
    told = {name: rational_number(repr(rate)) for name, rate in claim.rates.items()}
    head = [
        f"obsdesign: the guarantee of {spec.name}, type {spec.observer.type}, as a theorem",
        f"in words: {claim.statement(spec).replace('**', '^').replace('*', ' ')}",
        *LIMITS.splitlines(),
    ]
    return exported(identities(plant, claim.form, claim.scheme, told), head)


def identities(plant: Plant, form: Form, scheme: Scheme, rates: Mapping[str, fmpq]) -> Identities:
    """What is exported of an observer; `rates`: of decay that the words tell, by name.

    Raises `UnexportedError`: a part of it has no such form.
    """
    if isinstance(form, HighGain):
        return of_copy(plant, form, scheme, rates)
    if isinstance(form, Immersion):
        return of_manifold(plant, form, scheme, rates)
    if form.estimator is not None and form.estimator.method == "proportional":
        return of_proportional(plant, form, scheme, rates)
    if form.recast:
        raise UnexportedError("an observer that is recast is another one than that of its coordinates")
    return of_coordinates(plant, form, rates)


def run(plant: Plant, observer: Named, free: tuple[str, ...] = (), constant: tuple[str, ...] = ()) -> Run:
    """Run of a plant and its observer."""
    ranges = {name: ends for name, ends in plant.region.ranges.items() if ends != EVERYWHERE and name != "t"}
    return Run(plant.dynamics, plant.outputs, plant.inputs, constant, observer, free, ranges)


def variable(name: str) -> Expression:
    """A signal."""
    return Expression.variable(name)


def of_coordinates(plant: Plant, form: Transformed, rates: Mapping[str, fmpq]) -> Identities:
    """Coordinates, whose constants are estimated by regressions, if any.

    The estimate of theta is any signal: the regressions are about theta, and theirs are the only equations.
    """
    constants = [c.name for c in form.coordinates if c.estimated]
    xi = {c.name: variable(c.name) for c in form.coordinates}
    theta = {name: variable(f"theta_{name}") for name in constants}
    right = {name: added([side, theta[name]]) if name in theta else side for name, side in xi.items()}
    observer = {c.name: added([multiplied(c.rate, xi[c.name]), c.B.substituted(right)]) for c in form.coordinates}
    defined: dict[str, Expression] = {}
    laws, solved = list[Law](), dict[str, Resolved]()
    for c in form.coordinates:
        before = tuple(f"e {name}" for name in ordered(form, waits(form, *c.B.names)))
        what = f"d/dt ({c.phi}) = ({c.rate}) phi + {c.B}"
        if c.estimated:
            defined[f"k {c.name}"] = less(c.phi, xi[c.name])
            laws.append(Law(f"k {c.name}", {}, what, before))
        else:
            laws.append(Law(f"e {c.name}", {f"e {c.name}": c.rate}, what, before, rates.get(c.name)))
        defined[f"e {c.name}"] = less(right[c.name], c.phi)
        solved[f"e {c.name}"] = (
            Resolved(f"theta_{c.name}", less(c.phi, xi[c.name])) if c.estimated else Resolved(c.name, c.phi)
        )
    if form.estimator is not None:
        observer |= regressed(form, defined, laws)
    inverse = {name: side.substituted(right) for name, side in form.left_inverse.items()}
    used = {name for side in form.left_inverse.values() for name in side.names}
    names = tuple(f"e {c.name}" for c in form.coordinates if c.name in used)
    back = Inverse(inverse, names)
    return Identities(
        run(plant, observer, tuple(s.text for s in theta.values())), defined, tuple(laws), back, solved, solved
    )


def ordered(form: Transformed, names: set[str]) -> list[str]:
    """Names of coordinates in their order."""
    return [c.name for c in form.coordinates if c.name in names]


def regressed(form: Transformed, defined: dict[str, Expression], laws: list[Law]) -> dict[str, Expression]:
    """Filters of regressions; what is left of Y = psi theta, which decays, is defined, and its law is added."""
    assert form.estimator
    estimator = form.estimator
    made, Y = filtered(estimator, {c.name: variable(c.name) for c in form.coordinates})
    for k, (each, one, psi) in enumerate(zip(estimator.regressions, Y, made.regressors, strict=True), start=1):
        sides = []
        for (name, _), p in zip(each.m.items(), psi, strict=True):
            theta = defined[f"k {name}"]
            sides.append(multiplied(variable(p), exponential(theta) if name in estimator.powers else theta))
        defined[f"r {k}"] = less(one, *sides)
        before = tuple(f"e {name}" for name in ordered(form, held(form, each)))
        rate = Expression.number(-estimator.alpha)
        laws.append(Law(f"r {k}", {f"r {k}": rate}, f"regression {k}", before, estimator.alpha))
    return made.dynamics


def of_proportional(plant: Plant, form: Transformed, scheme: Scheme, rates: Mapping[str, fmpq]) -> Identities:
    """Coordinates, whose constants are estimated by zeta + K(y)."""
    assert form.estimator
    K = form.estimator.K
    theta = {c.name: added([variable(f"zeta_{c.name}"), K[c.name]]) for c in form.coordinates if c.estimated}
    cascade = attraction(plant, form, theta, ())
    errors = {f"δ_{c.name}": f"e {c.name}" for c in form.coordinates}
    defined: dict[str, Expression] = {}
    solved: dict[str, Resolved] = {}
    right: dict[str, Expression] = {}
    constant: list[Law] = []
    for c in form.coordinates:
        e, xi = f"e {c.name}", variable(c.name)
        right[c.name] = added([xi, theta[c.name]]) if c.estimated else xi
        if c.estimated:
            defined[f"k {c.name}"] = less(c.phi, xi)
            before = tuple(f"e {name}" for name in ordered(form, waits(form, *c.B.names)))
            constant.append(Law(f"k {c.name}", {}, f"d/dt ({c.phi}) = {c.B}", before))
        defined[e] = less(right[c.name], c.phi)
        solved[e] = Resolved(f"zeta_{c.name}", less(c.phi, xi, K[c.name])) if c.estimated else Resolved(c.name, c.phi)
    told = {f"e {name.removeprefix('theta of ')}": rate for name, rate in rates.items()}
    laws = (*constant, *cascaded(cascade, errors, told))
    falls = together(cascade, errors)
    inverse = {name: side.substituted(right) for name, side in form.left_inverse.items()}
    used = {name for side in form.left_inverse.values() for name in side.names}
    names = tuple(f"e {c.name}" for c in form.coordinates if c.name in used)
    back = Inverse(inverse, names)
    return Identities(run(plant, scheme.observer.dynamics), defined, laws, back, solved, solved, falls)


def cascaded(cascade: Cascade, names: Mapping[str, str], rates: Mapping[str, fmpq]) -> list[Law]:
    """Laws of errors that move in a cascade, by the names that their symbols have here."""
    symbols, found = list(cascade.errors), list[Law]()
    for block in cascade.blocks():
        for symbol in block.own:
            row = dict(zip(symbols, cascade.M[symbols.index(symbol)], strict=True))
            own = {names[other]: row[other] for other in block.own if len(block.own) == 1 or row[other].text != "0"}
            before = tuple(names[other] for other in block.before)
            what = cascade.rows[symbols.index(symbol)].name
            found.append(Law(names[symbol], own, what, before, rates.get(names[symbol])))
    return found


def together(cascade: Cascade, names: Mapping[str, str]) -> tuple[Fall, ...]:
    """Falls of the blocks of a cascade with several errors."""
    symbols, found = list(cascade.errors), list[Fall | None]()
    for block in cascade.blocks():
        places = [symbols.index(symbol) for symbol in block.own]
        before = tuple(names[other] for other in block.before)
        found.append(fall(cascade.M, places, [names[symbol] for symbol in symbols], before))
    return tuple(one for one in found if one is not None)


def fall(M: Matrix, block: Sequence[int], names: Sequence[str], before: tuple[str, ...]) -> Fall | None:
    """Storage function of errors that act on each other by a constant M; None where it varies, or none was found."""
    part = [[M[i][j] for j in block] for i in block]
    values = [[entry.root.value for entry in row if isinstance(entry.root, Number)] for row in part]
    if len(block) == 1 or any(len(row) < len(block) for row in values) or (r := slowest(part)) <= 0:
        return None
    from scipy.linalg import solve_continuous_lyapunov

    own = [names[i] for i in block]
    rows = [{name: c for name, c in zip(own, row, strict=True) if c.text != "0"} for row in part]
    laws = tuple(Law(name, row, f"how {name} moves", before) for name, row in zip(own, rows, strict=True))
    exact = np.array(values, dtype=object)
    shifted = exact.astype(float) + float(r) * np.eye(len(block))
    P = solve_continuous_lyapunov(shifted.T, -np.eye(len(block)))
    P = 1.01 * P / np.linalg.eigvalsh(P).min()
    most = rational_number(f"{1.01 * np.linalg.eigvalsh(P).max():.3g}")
    for digits in PLACES:
        rounded = rational([[f"{x:.{digits}g}" for x in row] for row in (P + P.T) / 2])
        found = Fall(laws, exact, rounded, r, most)
        if found.holds:
            return found
    return None


def of_manifold(plant: Plant, form: Immersion, scheme: Scheme, rates: Mapping[str, fmpq]) -> Identities:
    """Distances from the manifold, beta(y, chi) - phi(x)."""
    places = range(1, len(form.phi) + 1)
    b = {f"b {i}": side for i, side in zip(places, form.beta, strict=True)}
    e = {f"e {i}": less(variable(f"b {i}"), side) for i, side in zip(places, form.phi, strict=True)}
    cascade = off_manifold(plant, form, ())
    names = dict(zip(cascade.errors, e, strict=True))
    told = {names[symbol]: rates[one.name] for symbol, one in cascade.errors.items() if one.name in rates}
    laws = tuple(cascaded(cascade, names, told))
    known = {f"e {i}": Resolved(f"b {i}", side) for i, side in zip(places, form.phi, strict=True)}
    solved, taken = dict[str, Resolved](), set[str]()
    for name, phi, beta in zip(e, form.phi, form.beta, strict=True):
        if (one := linear_in(beta, phi, [chi for chi in form.chi if chi not in taken])) is not None:
            solved[name] = one
            taken.add(one.signal)
    used = {name for side in form.left_inverse.values() for name in side.names}
    right = tuple(f"e {i}" for i in places if f"b{i}" in used)
    at = {f"b{i}": variable(f"b {i}") for i in places}
    back = Inverse({name: side.substituted(at) for name, side in form.left_inverse.items()}, right)
    return Identities(
        run(plant, scheme.observer.dynamics), {**b, **e}, laws, back, solved, known, together(cascade, names)
    )


def linear_in(beta: Expression, phi: Expression, chi: list[str]) -> Resolved | None:
    """A signal, the only one of several in beta, that beta = phi gives; None of none."""
    inside = [name for name in chi if name in beta.names]
    if len(inside) != 1 or beta.derivative(inside[0]).text != "1":
        return None
    return Resolved(inside[0], less(phi, beta.substituted({inside[0]: ZERO})))


def of_copy(plant: Plant, form: HighGain, scheme: Scheme, rates: Mapping[str, fmpq]) -> Identities:
    """Errors of a copy of the plant, or of it in other coordinates."""
    sides = scheme.observer.dynamics
    meaning: Named = form.states or {f"hat_{name}": variable(name) for name in plant.dynamics}
    rows, M = linear(plant, sides, meaning)
    inside = {name for side in meaning.values() for name in side.names}
    constant = tuple(u for u in plant.inputs if u in inside)
    defined = {f"e {name}": less(variable(name), side) for name, side in meaning.items()}
    solved = {f"e {name}": Resolved(name, side) for name, side in meaning.items()}
    laws = []
    for i, (name, row) in enumerate(zip(sides, M, strict=True)):
        terms = {f"e {other}": c for other, c in zip(sides, row, strict=True) if c.text != "0"}
        laws.append(Law(f"e {name}", terms, rows[i].name, bound=rates.get(name)))
        before = tuple(other for other in terms if other != f"e {name}")
        if before and single(M, i):
            laws.append(Law(f"e {name}", {f"e {name}": row[i]}, rows[i].name, before))
    inverse = dict(form.left_inverse or {})
    used = {name for side in inverse.values() for name in side.names}
    right = tuple(f"e {name}" for name in sides if name in used)
    back = Inverse(inverse, right)
    falls = []
    for block in blocks(M):
        acting = [j for j in range(len(M)) if j not in block and any(M[i][j].text != "0" for i in block)]
        falls.append(fall(M, block, [*defined], tuple([*defined][j] for j in acting)))
    proved = tuple(one for one in falls if one is not None)
    return Identities(run(plant, sides, constant=constant), defined, tuple(laws), back, solved, solved, proved)


def single(M: Matrix, i: int) -> bool:
    """Whether an error moves, and acts on none that acts on it."""
    return M[i][i].text != "0" and [i] in blocks(M)
