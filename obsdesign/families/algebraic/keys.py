"""Keys of `observer:` for observers without an LMI."""

from obsdesign.families import asked
from obsdesign.families.algebraic.forms import METHODS, Method
from obsdesign.sections.forms import ENTRY, TEXT, Either, ListOf, MapOf, OneOf, Section, key, required

FIND = "find"
RECAST = "immersion-invariance"
EXPRESSIONS = MapOf(ENTRY)


class CoordinateSection(Section):
    """A coordinate xi with phi(x)' = lambda phi(x) + B along the plant; lambda 0: up to a constant theta."""

    name: str = required(TEXT)
    phi: str = required(ENTRY, "expression of the states")
    rate: str = key(ENTRY, "expression of outputs and inputs, negative on the domain, or 0", name="lambda", default="0")
    B: str = key(ENTRY, "expression of outputs, inputs, t and earlier coordinates", default="0")


class RegressionSection(Section):
    """d(output)/dt = known + sum m theta."""

    output: str = required(TEXT)
    known: str = key(ENTRY, "expression of outputs, inputs, t and coordinates", default="0")
    m: dict[str, str] = required(EXPRESSIONS, "by coordinate with lambda 0")


class EstimatorSection(Section):
    """How theta is estimated from Y = W[output] - F[known] and psi = F[m], F = alpha/(p + alpha), W = p F."""

    regressions: list[RegressionSection] = key(ListOf(RegressionSection), default=[])
    method: Method = key(OneOf("method", METHODS), default="gradient")
    alpha: str | None = key(ENTRY, "1/s, of the filters")
    gamma: str | dict[str, str] | None = key(Either("a number, or one by coordinate", ENTRY, mapping=EXPRESSIONS))
    kappa: str | None = key(ENTRY, "1/s, forgetting of drem, default 0")
    epsilon: str | None = key(ENTRY, "of drem, default 1e-10")
    K: dict[str, str] | None = key(EXPRESSIONS, "of proportional: theta = zeta + K(y), by coordinate")
    powers: dict[str, str] = key(
        MapOf(OneOf("form", ("exp",))),
        "coordinates whose exp(theta) the regressions hold",
        name="as",
        default={},
    )
    filters: str = key(OneOf("start", ("consistent", "zero")), default="consistent")


class CoordinatesSection(asked.ObserverSection):
    """Coordinates that decay to those of the plant, or differ from them by a constant that is estimated."""

    coordinates: str | list[CoordinateSection] = required(
        Either("a list of coordinates, or find", OneOf("coordinates", (FIND,)), ListOf(CoordinateSection, least=1))
    )
    left_inverse: dict[str, str] = key(
        EXPRESSIONS, "states that are no outputs, of coordinates and outputs", default={}
    )
    estimator: EstimatorSection | None = key(EstimatorSection)
    degree: str | None = key(ENTRY, "of the products that coordinates: find tries, default 3")
    lambdas: list[str] | None = key(ListOf(ENTRY), "that it tries: expressions of outputs and inputs")
    functions: list[str] | None = key(ListOf(ENTRY), "of the states that it tries beside the products")
    recast: str | None = key(OneOf("recast", (RECAST,)))


class ImmersionSection(asked.ObserverSection):
    """States chi with beta(y, chi) = phi(x) on an attractive invariant manifold."""

    chi: list[str] = required(ListOf(TEXT, least=1), "names of the states of the observer")
    phi: list[str] = required(ListOf(ENTRY, least=1), "expressions of the states")
    beta: list[str] = required(ListOf(ENTRY, least=1), "expressions of outputs and chi")
    left_inverse: dict[str, str] = required(EXPRESSIONS, "states that are no outputs, of b1, b2, .. and outputs")
    dynamics: dict[str, str] | None = key(EXPRESSIONS, "of outputs, inputs, chi; default: equation (20)")
    Q: list[str] | None = key(ListOf(ENTRY), "of outputs, inputs, chi: motion that beta does not see, default 0")


class HighGainSection(asked.ObserverSection):
    """A copy of the plant with large injections of y - yhat."""

    injection: dict[str, dict[str, str]] = required(MapOf(EXPRESSIONS), "by state, by output")
    copy: str = key(OneOf("copy", ("outputs", "estimates")), "whose measured states it reads", default="estimates")
    states: dict[str, str] | None = key(EXPRESSIONS, "other coordinates: expressions of states and inputs")
    dynamics: dict[str, str] | None = key(EXPRESSIONS, "their derivatives, of coordinates, outputs and inputs")
    left_inverse: dict[str, str] | None = key(EXPRESSIONS, "states, of coordinates, outputs and inputs")
