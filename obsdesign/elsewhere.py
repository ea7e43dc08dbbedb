"""The same problem in other states, where a solver's word alone says that there is no gain, or no search decides.

A plant and x = T x' of it have the same gains, but for L = T L', and a solver tells more of the one whose numbers are
nearer to each other. In the states x' = V^-1 x, V the eigenvectors of A with f = K q of the class, the dynamics are
diagonal, whatever the states of the spec are. T is rational, so that nothing is approximated, and the gains that are
found so are proved for the plant of the spec.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np
from flint import fmpq_mat

from obsdesign.dissipation.decimals import significant
from obsdesign.dissipation.engine import Engine
from obsdesign.errors import UndecidedError, UsageError
from obsdesign.families import FAMILIES
from obsdesign.families.outcome import Outcome, Verdict
from obsdesign.lmi.formula import Array, Exact, Float, in_floats, printed, rational
from obsdesign.model.structure import linear
from obsdesign.spec import Spec

# conditions of a diagnosis that a solver may decide
NUMERICAL = {"inequality", "decay", "lipschitz", "gamma", "gains", "bounds"}
INJECTIONS = {"L1", "L", "K", "K_of_gap", "E"}  # gains that act on the states; the others do not depend on these
ALIKE = 10  # condition of T, and ..
NEAR = 1e3  # .. ratio of the numbers of a plant in the other states, up to which these tell nothing more
LARGEST = 1e12  # condition of T, in the best units, above which its inverse is rounding
ROUNDING = 1e-12  # relative, of zeros in other states
DIGITS = 12  # of T: with fewer, numbers of A that are far from its eigenvalues do not cancel
OF_GAINS = (6, 9, 12, 17)
SWEEPS = 4  # in which units are found
NOTE = "the gains were searched in other states, in which the numbers of the plant are nearer to each other"

FAR = (
    "a solver finds no gain in these states, and does not say so in those in which A is diagonal; none was proved: "
    "give the plant in states or units that bring its numbers nearer to each other"
)

Design = Callable[[Spec, Engine], Outcome]


class EndedError(Exception):
    """A trial ends where the search for a reason begins: it has no solution, as far as a solver tells."""


def designed(spec: Spec, engine: Engine, design: Design) -> Outcome:
    """Outcome of a design; where it has no proved gains and no proof that there are none, that of other states.

    Raises `UndecidedError`: no gains were found, and nothing says that there are none; or a solver says so in the
    states of the spec, and does not in others.
    """
    failed: UndecidedError | None = None
    try:
        outcome = design(spec, engine)
        if not doubtful(outcome):
            return outcome
    except UndecidedError as error:
        failed, outcome = error, Outcome(Verdict.UNDECIDED)
    T = None if fixed(spec) else states(spec)
    if T is not None and outcome.status is Verdict.INFEASIBLE and plain(spec, T):
        return outcome
    other = None if T is None else trial(turned(spec, T), engine, design)
    if T is not None and other is not None and other.claim and other.claim.holds and not placed(spec):
        S = whole(spec, inverse(T))
        for gains in [spec.observer.gains] if spec.observer.gains else back(whole(spec, T), other.gains):
            claim = FAMILIES[spec.observer.type].moved(spec, other.claim, gains, S)
            if claim and claim.holds:
                doubles = {name: in_floats(gain) for name, gain in gains.items()}
                return replace(other, gains=doubles, claim=claim, notes=(*map(unsized, other.notes), NOTE), scaling={})
    if failed:
        raise failed
    if T is None or outcome.status is not Verdict.INFEASIBLE or (other and other.status is Verdict.INFEASIBLE):
        return outcome
    raise UndecidedError(FAR, id="OBS507")


def unsized(note: str) -> str:
    """Note without the sizes of gains, which are those in other states."""
    return re.sub(r" \(\|.*?\| from .*?\)", "", note)


def doubtful(outcome: Outcome) -> bool:
    """Whether other states may tell more: of gains without a proof, or where a solver's word alone excludes any."""
    said = outcome.diagnosis
    exact = said.get("proof") == "exact" or said.get("condition") not in NUMERICAL
    return outcome.status is Verdict.UNCERTIFIED or (outcome.status is Verdict.INFEASIBLE and not exact)


def fixed(spec: Spec) -> bool:
    """Whether what is asked depends on the states: bounds on the gain, or on P; or there are no matrices."""
    asked, bounds = spec.observer, getattr(spec.observer, "bounds", None)
    bounded = asked.restrictions if bounds is None else replace(bounds, poles=None, gamma=None).restricted
    return bool((bounded and not asked.gains) or spec.typed or FAMILIES[asked.type].equations)


def placed(spec: Spec) -> bool:
    """Whether poles are bounded, of which a claim that is moved says nothing."""
    bounds = getattr(spec.observer, "bounds", None)
    return bounds is not None and bounds.poles is not None


def states(spec: Spec) -> Exact | None:
    """Rational T of x = T x', the eigenvectors of the plant; None where these are no others, or all but dependent."""
    A = linear(spec.plant.doubles, in_floats(member(spec))).A
    values, vectors = np.linalg.eig(A)
    kept = values.imag >= 0
    parts = [
        part
        for value, v in zip(values[kept], vectors.T[kept], strict=True)
        for part in (v.real, v.imag)[: 1 + (value.imag > 0)]
    ]
    T = np.array(parts).T
    row, column = best_units(T)
    condition = np.linalg.cond(row[:, None] * T * column) if np.isfinite([*row, *column]).all() else np.inf
    if not condition < LARGEST or np.count_nonzero(T) == len(T):  # the same states, in another order
        return None
    found: Exact = printed(significant(T * column, DIGITS))
    return found


def plain(spec: Spec, T: Exact) -> bool:
    """Whether a plant is as well conditioned in its own states as in others, x = T x', in which a solver can tell more.

    T is all but orthogonal, and in the states x' the numbers of the plant other than zeros are near each other.
    """
    doubles = in_floats(T)
    V = doubles / np.linalg.norm(doubles, axis=0)
    if np.linalg.cond(V) > ALIKE:
        return False
    p, H = spec.plant.doubles, in_floats(spec.H)[:, : len(V)]
    on_states = (np.linalg.solve(V, M) for M in (p.A @ V, p.B, p.Bf))
    sizes = map(np.abs, (*on_states, p.C @ V, p.Cq @ V, H @ V))
    return all(M[M > 0].max(initial=0.0) <= NEAR * M[M > 0].min(initial=np.inf) for M in map(cleaned, sizes))


def cleaned(sizes: Float) -> Float:
    """Sizes without those that are rounding beside the largest."""
    return np.where(sizes > ROUNDING * sizes.max(initial=0.0), sizes, 0.0)


def member(spec: Spec) -> Array:
    """F = K q that the class allows, of the blocks of the plant alone."""
    rows, columns = spec.plant.Bf.shape[1], len(spec.plant.Cq)
    return spec.multiplier.member[:rows, :columns]


def best_units(T: Float) -> tuple[Float, Float]:
    """Powers of two for rows and columns that bring the sizes of these near 1."""
    row, column = np.ones(len(T)), np.ones(len(T))
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(SWEEPS):
            row = np.exp2(-np.rint(np.log2(np.linalg.norm(T * column, axis=1))))
            column = np.exp2(-np.rint(np.log2(np.linalg.norm(row[:, None] * T, axis=0))))
    return row, column


def inverse(T: Exact) -> Exact:
    """Inverse of a rational matrix."""
    return np.array(fmpq_mat(T.tolist()).inv().tolist(), dtype=object)


def whole(spec: Spec, T: Exact) -> Exact:
    """T for the states of the plant and those of a disturbance model, which stay."""
    made = rational(np.eye(spec.augmented.n))
    made[: len(T), : len(T)] = T
    return made


def turned(spec: Spec, T: Exact) -> Spec:
    """Same problem in the states x', x = T x' of the plant."""
    p, n, back = spec.plant, spec.plant.n, inverse(T)
    changed = {"A": back @ p.A @ T, **{name: back @ getattr(p, name) for name in ("B", "Bf")}}
    changed |= {name: getattr(p, name) @ T for name in ("C", "Cq")}
    H, asked, S = np.hstack([spec.H[:, :n] @ T, spec.H[:, n:]]), spec.observer, whole(spec, back)
    if asked.gains:
        gains = {name: S @ gain if name in INJECTIONS else gain for name, gain in asked.gains.items()}
        asked = replace(cast("Any", asked), gains=gains)
    plant = replace(p, **changed)
    return replace(spec, plant=plant, H=H, observer=asked, simulation=None, implementation=None)


def back(T: Exact, found: Mapping[str, Array]) -> Iterator[dict[str, Array]]:
    """Gains for the states of the spec, in more and more digits, as rationals."""
    gains = {name: in_floats(T @ printed(gain)) if name in INJECTIONS else gain for name, gain in found.items()}
    for digits in OF_GAINS if gains else ():
        yield {name: printed(significant(gain, digits)) for name, gain in gains.items()}


def trial(spec: Spec, engine: Engine, design: Design) -> Outcome | None:
    """Outcome of a trial, without a reason where there is no solution; None where it is not decided."""

    def report(_: float, doing: str) -> None:
        if doing == "diagnosis":
            raise EndedError

    inner = Engine(engine.solver, report)
    try:
        return design(spec, inner)
    except EndedError:
        return Outcome(Verdict.INFEASIBLE)
    except (UndecidedError, UsageError, OverflowError, ZeroDivisionError, np.linalg.LinAlgError):
        return None
    finally:
        engine.solves += inner.solves
