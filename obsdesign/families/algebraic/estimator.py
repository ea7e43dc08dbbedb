"""Estimators of the constants theta of parameter-estimation-based coordinates."""

from collections.abc import Mapping, Sequence
from itertools import permutations

from flint import fmpq

from obsdesign.errors import Problem, UsageError
from obsdesign.expressions import Expression, parse
from obsdesign.families.algebraic.forms import Estimator
from obsdesign.families.algebraic.scheme import ZERO, added, less, multiplied, scaled
from obsdesign.model.equations import free
from obsdesign.records import dataclass, field

MOST = 6  # rows of a determinant
LEAST = fmpq(1, 10**6)  # of exp(theta), below which its logarithm is not taken


@dataclass(frozen=True)
class Estimation:
    """Equations of an estimator."""

    dynamics: dict[str, Expression] = field(default_factory=dict)
    theta: dict[str, Expression] = field(default_factory=dict)  # estimates, by coordinate
    initial: dict[str, Expression] = field(default_factory=dict)  # of its states, where not 0
    regressors: tuple[tuple[str, ...], ...] = ()  # names of psi, a row for each regression
    determinant: Expression | None = None  # Delta of DREM
    guarded: dict[str, str] = field(default_factory=dict)  # states that must stay positive, by coordinate


def filtered(estimator: Estimator, substitution: Mapping[str, Expression]) -> tuple[Estimation, list[Expression]]:
    """Filters of all regressions, and Y of each: W[output] - F[known].

    z' = alpha (output - z), f' = alpha (known - f), psi' = alpha (m - psi); Y = alpha (output - z) - f. With z(0) =
    output(0) and the rest 0, Y = psi theta exactly, since both sides obey the same equation from the same start.
    """
    alpha, made, rows, Y = estimator.alpha, Estimation(), [], []
    for k, regression in enumerate(estimator.regressions, start=1):
        output = Expression.variable(regression.output)
        z = f"filtered_{regression.output}_{k}"
        f = free(f"filtered_known_{k}", {z})
        sides = {z: output, f: regression.known.substituted(substitution)}
        row = []
        for name, m in regression.m.items():
            row.append(f"psi_{name}_{k}")
            sides[row[-1]] = m.substituted(substitution)
        rows.append(tuple(row))
        for state, side in sides.items():
            made.dynamics[state] = scaled(alpha, less(side, Expression.variable(state)))
        if estimator.consistent:
            made.initial[z] = output
        Y.append(less(scaled(alpha, less(output, Expression.variable(z))), Expression.variable(f)))
    return Estimation(made.dynamics, {}, made.initial, tuple(rows)), Y


def estimation(estimator: Estimator, substitution: Mapping[str, Expression], names: tuple[str, ...]) -> Estimation:
    """Estimator of the constants of these coordinates, by its method; `proportional` has none of these states.

    gradient      Theta' = gamma psi (Y - psi Theta)
    log-gradient  theta' = gamma psi (Y - psi g(theta)), g the identity, or exp
    drem          Omega' = -kappa Omega + psi psi', W' = -kappa W + psi Y, Delta = det Omega,
                  Theta' = gamma Delta / (epsilon + Delta^2) (adj(Omega) W - Delta Theta)

    Theta is theta, or exp(theta), whose logarithm is then taken of max(Theta, 1e-6).
    """
    made, Y = filtered(estimator, substitution)
    psi = [dict(zip(r.m, row, strict=True)) for r, row in zip(estimator.regressions, made.regressors, strict=True)]
    state = {name: Expression.variable(f"theta_{name}") for name in names}
    logarithmic = estimator.method == "log-gradient"
    value = {
        name: exponential(state[name]) if logarithmic and name in estimator.powers else state[name] for name in names
    }
    if estimator.method == "drem":
        rates, determinant, memory = mixed(estimator, psi, Y, value, names)
        made.dynamics.update(memory)
    else:
        determinant = None
        errors = [
            less(Yk, *(multiplied(Expression.variable(p), value[name]) for name, p in row.items()))
            for Yk, row in zip(Y, psi, strict=True)
        ]
        rates = {}
        for name in names:
            seen = [(row[name], e) for row, e in zip(psi, errors, strict=True) if name in row]
            steps = added([multiplied(Expression.variable(p), e) for p, e in seen])
            rates[name] = scaled(estimator.gain(name), steps)
    made.dynamics.update({f"theta_{name}": rates[name] for name in names})
    powers = [name for name in names if name in estimator.powers and not logarithmic]
    theta = {name: logarithm(state[name]) if name in powers else state[name] for name in names}
    guarded = {name: f"theta_{name}" for name in powers}
    initial = made.initial | dict.fromkeys(guarded.values(), Expression.number(1))  # exp(0)
    return Estimation(made.dynamics, theta, initial, made.regressors, determinant, guarded)


def mixed(
    estimator: Estimator,
    psi: list[dict[str, str]],
    Y: list[Expression],
    value: Mapping[str, Expression],
    names: tuple[str, ...],
) -> tuple[dict[str, Expression], Expression, dict[str, Expression]]:
    """Rates of DREM with the memory of Kreisselmeier, the determinant, and the equations of the memory."""
    kappa, n = estimator.kappa, len(names)
    memory: dict[str, Expression] = {}
    omega = [[f"omega_{min(i, j) + 1}_{max(i, j) + 1}" for j in range(n)] for i in range(n)]

    def collected(i: int, sides: list[Expression]) -> Expression:
        """Sum over the regressions of psi_i times a side."""
        rows = zip(psi, sides, strict=True)
        return added([multiplied(Expression.variable(row[names[i]]), side) for row, side in rows if names[i] in row])

    for i in range(n):
        for j in range(i, n):
            sides = [Expression.variable(row[names[j]]) if names[j] in row else ZERO for row in psi]
            memory[omega[i][j]] = less(collected(i, sides), scaled(kappa, Expression.variable(omega[i][j])))
        memory[f"memory_{i + 1}"] = less(collected(i, Y), scaled(kappa, Expression.variable(f"memory_{i + 1}")))
    full = [[Expression.variable(entry) for entry in row] for row in omega]
    delta = determinant(full)
    rates = {}
    for i, name in enumerate(names):
        column = [Expression.variable(f"memory_{k + 1}") for k in range(n)]
        swapped = [[column[r] if c == i else full[r][c] for c in range(n)] for r in range(n)]  # Cramer's rule
        error = less(determinant(swapped), multiplied(delta, value[name]))
        gain = Expression(delta.root / (Expression.number(estimator.epsilon).root + multiplied(delta, delta).root))
        rates[name] = scaled(estimator.gain(name), multiplied(gain, error))
    return rates, delta, memory


def determinant(rows: list[list[Expression]]) -> Expression:
    """Determinant by Leibniz' formula; there are few parameters."""
    n = len(rows)
    if n > MOST:
        raise UsageError(
            Problem(f"{n} constants; at most {MOST} are mixed at once", key="observer.estimator", id="OBS210")
        )
    parts, signs = [], []
    for order in permutations(range(n)):
        inversions = sum(order[i] > order[j] for i in range(n) for j in range(i + 1, n))
        signs.append(fmpq(-1) ** inversions)
        parts.append(multiplied(*(rows[i][order[i]] for i in range(n))))
    return Expression.combination(signs, parts)


def needed(estimator: Estimator, names: Sequence[str], before: Sequence[str]) -> str:
    """What the estimates of the constants of these coordinates need to converge.

    One is right at the rate of int psi^2, several are by the theorem on persistent excitation, whose psi is bounded.
    With W = Omega Theta + eta, DREM ends at Theta + eta/Omega: with kappa 0, eta keeps what was wrong before: errors of
    the filters, and of the coordinates `before`. By the inequality of Cauchy and Schwarz |eta/Omega|^2 is at most the
    integral of their square over the least eigenvalue of Omega.
    """
    need = "int psi^2 dt must grow without end, for an exponential rate by c > 0 over every window of one length"
    if estimator.method == "drem":
        need = "int Delta^2 dt must grow without end"
        kept = [] if estimator.consistent else ["of the filters at the start"]
        kept += [f"of the estimate of {', '.join(before)}"] if before else []
        if kept and not estimator.kappa:
            need += (
                f", and, since the memory forgets nothing (kappa is 0) and keeps the error {' and '.join(kept)}, what "
                f"this adds must vanish, for which it suffices that the error is square integrable and the least "
                f"eigenvalue of int psi psi' dt grows without end"
            )
        elif kept:
            need += f", and psi must stay bounded for the memory to forget the error {' and '.join(kept)}"
    elif len(names) > 1:
        need = (
            "it suffices that the least eigenvalue of int psi psi' dt over every window of one length exceeds c > 0 "
            "and psi stays bounded"
        )
    return need


def assumed(estimator: Estimator, names: Sequence[str]) -> list[str]:
    """What has to be assumed of the constants of these coordinates, whose logarithm has a least value."""
    low = [name for name in names if name in estimator.powers and estimator.method != "log-gradient"]
    least = f"{float(LEAST):g}"
    said = f"that exp(theta) of {', '.join(low)} exceeds {least}, which is assumed"
    return [f"{said}: the estimate is log(max(Theta, {least})), and a smaller theta is never reached"] if low else []


def excited(need: str) -> str:
    """Clause on what a run needs."""
    return f"which takes excitation: {need} (`simulate` reports it of a run)"


def exponential(e: Expression) -> Expression:
    """Exponential."""
    return parse("exp(p)", ("p",)).substituted({"p": e})


def logarithm(e: Expression) -> Expression:
    """Logarithm of what is not below its least value."""
    return parse("log(max(p, least))", ("p",), {"least": LEAST}).substituted({"p": e})
