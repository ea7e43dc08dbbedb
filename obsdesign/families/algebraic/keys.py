"""Keys of `observer:` for observers without an LMI."""

from obsdesign.families import asked
from obsdesign.families.algebraic.forms import METHODS, Method
from obsdesign.sections.forms import ENTRY, TEXT, Either, ListOf, MapOf, OneOf, Section, key, required

FIND = "find"
RECAST = "immersion-invariance"
EXPRESSIONS = MapOf(ENTRY)


class CoordinateSection(Section):
    """A coordinate xi with phi(x)' = lambda phi(x) + B along the plant; lambda 0: up to a constant theta."""

    name: str = required(TEXT, "of the coordinate, which is a state of the observer", example="xi1")
    phi: str = required(ENTRY, "expression of the states", example="L1*i1 - C2*v2")
    rate: str = key(
        ENTRY,
        "expression of outputs and inputs, negative on the domain, or 0",
        unit="1/s",
        name="lambda",
        default="0",
        example="-(1-u)/L1",
    )
    B: str = key(
        ENTRY, "expression of outputs, inputs, t and earlier coordinates", default="0", example="(E-(1-u)*y1)/L1"
    )


class RegressionSection(Section):
    """d(output)/dt = known + sum m theta."""

    output: str = required(TEXT, "the output whose derivative it is", example="y1")
    known: str = key(
        ENTRY, "expression of outputs, inputs, t and coordinates", default="0", example="((1-u)*xi1+u*y2)/C2"
    )
    m: dict[str, str] = required(EXPRESSIONS, "factor of theta, by coordinate with lambda 0", example="{xi1: (1-u)/C2}")


class EstimatorSection(Section):
    """How theta is estimated from Y = W[output] - F[known] and psi = F[m], F = alpha/(p + alpha), W = p F."""

    regressions: list[RegressionSection] = key(
        ListOf(RegressionSection),
        "one for each output that shows a theta",
        default=[],
        example="[{output: y1, known: u*y2/C2, m: {xi1: (1-u)/C2}}]",
    )
    method: Method = key(OneOf("method", METHODS), "the law of theta", default="gradient", example="drem")
    alpha: str | None = key(
        ENTRY, "corner of the filters", unit="1/s", otherwise="required, but of proportional", example="50"
    )
    gamma: str | dict[str, str] | None = key(
        Either("a number, or one by coordinate", ENTRY, mapping=EXPRESSIONS),
        "gain of the law: speed of the estimates; of drem the rate in 1/s",
        otherwise="required, but of proportional",
        example="4.0e-7",
    )
    kappa: str | None = key(ENTRY, "forgetting of drem", unit="1/s", otherwise="0", example="5")
    epsilon: str | None = key(
        ENTRY, "what drem adds to the square of the determinant", otherwise="1e-10", example="1.0e-10"
    )
    K: dict[str, str] | None = key(
        EXPRESSIONS,
        "of proportional: theta = zeta + K(y), by coordinate",
        otherwise="none; proportional needs it",
        example="{xi1: 0.002*y1}",
    )
    powers: dict[str, str] = key(
        MapOf(OneOf("form", ("exp",))),
        "coordinates whose exp(theta) the regressions hold",
        name="as",
        default={},
        example="{xi2: exp}",
    )
    filters: str = key(
        OneOf("start", ("consistent", "zero")),
        "how the filters begin: that of an output at y(0), or all at 0",
        default="consistent",
        example="zero",
    )


class CoordinatesSection(asked.ObserverSection):
    """Coordinates that decay to those of the plant, or differ from them by a constant that is estimated."""

    coordinates: str | list[CoordinateSection] = required(
        Either("a list of coordinates, or find", OneOf("coordinates", (FIND,)), ListOf(CoordinateSection, least=1)),
        "the coordinates of the observer, or find: the tool solves their equation in an ansatz",
        example="[{name: xi1, phi: v4, lambda: -G/C4, B: y2/C4}]",
    )
    left_inverse: dict[str, str] = key(
        EXPRESSIONS,
        "states that are no outputs, of coordinates and outputs",
        default={},
        example="{i1: (xi2+C2*y1)/L1, v4: xi1}",
    )
    estimator: EstimatorSection | None = key(
        EstimatorSection,
        "how the constants of coordinates with lambda 0 are estimated",
        otherwise="none; lambda 0 needs it",
        example="{regressions: [{output: y1, m: {xi1: 1}}], alpha: 50, gamma: 1}",
    )
    degree: str | None = key(ENTRY, "of the products that coordinates: find tries", otherwise="3", example="4")
    lambdas: list[str] | None = key(
        ListOf(ENTRY),
        "that coordinates: find tries: expressions of outputs and inputs",
        unit="1/s",
        otherwise="chosen",
        example="[-1, -2*u]",
    )
    functions: list[str] | None = key(
        ListOf(ENTRY),
        "of the states that coordinates: find tries beside the products",
        otherwise="none",
        example="[sin(x1)]",
    )
    recast: str | None = key(
        OneOf("recast", (RECAST,)),
        "the same observer as one of immersion and invariance, or why it is none",
        otherwise="as it is given",
        example="immersion-invariance",
    )


class ImmersionSection(asked.ObserverSection):
    """States chi with beta(y, chi) = phi(x) on an attractive invariant manifold."""

    chi: list[str] = required(ListOf(TEXT, least=1), "names of the states of the observer", example="[c1, c2]")
    phi: list[str] = required(ListOf(ENTRY, least=1), "expressions of the states", example="[i1, v4]")
    beta: list[str] = required(
        ListOf(ENTRY, least=1), "expressions of outputs and chi, one for each of phi", example="[c1 + 50*C2*y1, c2]"
    )
    left_inverse: dict[str, str] = required(
        EXPRESSIONS,
        "states that are no outputs, of outputs and b1, b2, .., the values of beta",
        example="{i1: b1, v4: b2}",
    )
    dynamics: dict[str, str] | None = key(
        EXPRESSIONS,
        "derivatives of chi, of outputs, inputs and chi",
        otherwise="those that phi and beta imply, with Q",
        example="{c1: y1 - c1, c2: y2 - c2}",
    )
    Q: list[str] | None = key(
        ListOf(ENTRY), "of outputs, inputs, chi: motion that beta does not see", otherwise="0", example="['0', y1 - c1]"
    )


class HighGainSection(asked.ObserverSection):
    """A copy of the plant with large injections of y - yhat."""

    injection: dict[str, dict[str, str]] = required(
        MapOf(EXPRESSIONS),
        "factor of y - yhat, by state and by output: an expression of outputs and inputs",
        example="{v2: {y1: 400}, i1: {y1: 0.88}}",
    )
    copy: str = key(
        OneOf("copy", ("outputs", "estimates")),
        "from what the copy of the plant reads measured states",
        default="estimates",
        example="outputs",
    )
    states: dict[str, str] | None = key(
        EXPRESSIONS,
        "other coordinates: expressions of states and inputs",
        otherwise="those of the plant",
        example="{z1: x1, z2: x2 - x1**3}",
    )
    dynamics: dict[str, str] | None = key(
        EXPRESSIONS,
        "derivatives of other coordinates, of coordinates, outputs and inputs",
        otherwise="those of the plant",
        example="{z1: z2, z2: -y}",
    )
    left_inverse: dict[str, str] | None = key(
        EXPRESSIONS,
        "states, of coordinates, outputs and inputs",
        otherwise="the coordinates are the states",
        example="{x2: z2 + y**3}",
    )
