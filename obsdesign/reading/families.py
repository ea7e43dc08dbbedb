"""The observer section of a spec: which keys each family of observers takes, and what form their values have."""

from typing import Annotated, Any, get_args

from pydantic import Discriminator, Field, Tag
from pydantic import model_validator as validator

from obsdesign.families.incremental.request import Objective
from obsdesign.families.lipschitz.request import LipschitzObjective, LipschitzRelaxation
from obsdesign.families.sporadic.request import INJECTIONS, SporadicObjective
from obsdesign.reading.forms import Entry, Matrix, OneOf, Scalar, Section, told_apart
from obsdesign.reading.words import unavailable

SPORADIC, LIPSCHITZ = "sporadic", "lipschitz"
INCREMENTAL_KEYS = ("L2", "alpha", "objective", "slack", "bounds", "gains", "reconstruct")
SPORADIC_KEYS = (
    "T1", "T2", "decay", "injection", "relaxation", "delta", "objective", "slack", "bounds", "gains",
)  # fmt: skip
LIPSCHITZ_KEYS = ("relaxation", "objective", "weight", "decay", "slack", "bounds", "gains")
KEYS = {"l2": INCREMENTAL_KEYS, "linf": INCREMENTAL_KEYS, SPORADIC: SPORADIC_KEYS, LIPSCHITZ: LIPSCHITZ_KEYS}
FAMILIES = tuple(KEYS)
LATER_FAMILIES = ("kkl", "pebo", "kkl+pebo", "immersion-invariance", "high-gain")
LATER_KEYS = ("coordinates", "left_inverse", "estimator", "degree", "lambdas")
RELAXATIONS = tuple(sorted({name for names in INJECTIONS.values() for name in names}))


def hints_for(*families: str) -> dict[str, str]:
    """What to say of keys that only other families take, or none yet."""
    own = KEYS[families[0]]
    allowed = f"allowed here: type, {', '.join(own)}"
    owners = {key: [name for name in KEYS if key in KEYS[name]] for keys in KEYS.values() for key in keys}
    return unavailable(LATER_KEYS, own) | {
        key: f"does not belong to type {' or '.join(families)}, but to {' or '.join(names)}; {allowed}"
        for key, names in owners.items()
        if key not in own
    }


class Range(Section):
    """An interval that is searched."""

    min: Entry
    max: Entry
    points: Entry | None = Field(None, description="default 25")
    log: bool = Field(False, strict=True, description="spaced by a factor")


class Level(Section):
    """A performance level to reach."""

    gamma: Entry


class Frobenius(Section):
    """A bound on the Frobenius norm."""

    frobenius: Entry


LargestGain = Annotated[
    Scalar | Annotated[Frobenius, Tag("<mapping>")], told_apart("a number, or {frobenius: a number}")
]


class Bounds(Section):
    """What a design may use at most."""

    L1: LargestGain | None = Field(None, description="spectral norm of the gain")
    P: Entry | None = Field(None, description="P <= p I")
    gamma: Entry | None = None


class Gains(Section):
    """Gains to be analyzed instead of designed; they multiply (yhat - y)."""

    L1: Matrix
    L2: Matrix | None = None


Searched = Annotated[
    Scalar | Annotated[Range, Tag("<mapping>")],
    told_apart("a number, or a range {min: .., max: .., points: .., log: ..}"),
]
FamilyName = Annotated[str, OneOf("observer", FAMILIES, unavailable(LATER_FAMILIES, FAMILIES))]


class Observer(Section):
    """What is asked of the design of an observer with the gains L1 and L2."""

    hints = hints_for("l2", "linf")

    type: FamilyName
    L2: Matrix | None = Field(None, description="nq x ny, rows follow q, the plant's blocks first; or `free`")
    alpha: Searched | None = Field(None, description="decay rate")
    objective: Annotated[
        Annotated[Objective, OneOf("objective", get_args(Objective)), Tag("<scalar>")]
        | Annotated[Level, Tag("<mapping>")],
        told_apart("an objective, or {gamma: a number}"),
    ] = "min-gamma"
    slack: Entry | None = Field(None, description="relative, default 0.05")
    bounds: Bounds | None = None
    gains: Gains | None = None
    reconstruct: Annotated[str, OneOf("signal", ("w",))] | None = Field(
        None, description="w, by pinv(B) L1 (yhat - y); for linf, without a disturbance model"
    )

    @validator(mode="before")
    @classmethod
    def _this_family(cls, data: Any) -> Any:
        """Leave the keys of other families alone: that the family is not available says it all."""
        other = isinstance(data, dict) and "type" in data and data["type"] not in FAMILIES
        return {"type": data["type"]} if other else data


class SporadicBounds(Section):
    """What a design may use at most."""

    L: Entry | None = Field(None, description="spectral norm of the gain")
    gamma: Entry | None = None


class SporadicGains(Section):
    """Gains to be analyzed instead of designed; L multiplies the correction theta, and theta' = H theta."""

    L: Matrix
    H: Matrix | None = Field(None, description="ny x ny; default 0")


InjectionName = Annotated[str, OneOf("injection", tuple(INJECTIONS))]
RelaxationName = Annotated[str, OneOf("relaxation", RELAXATIONS)]


class SporadicObserver(Section):
    """What is asked of an observer whose measurements arrive sporadically, T1 <= t_{k+1} - t_k <= T2."""

    tag = "<sporadic>"
    hints = hints_for(SPORADIC)

    type: FamilyName
    T1: Entry = Field(description="s, shortest interval between measurements")
    T2: Searched = Field(description="s, longest interval between measurements")
    decay: Searched | None = Field(None, description="lambda_t, 1/s; default 0")
    injection: (
        Annotated[
            Annotated[InjectionName, Tag("<scalar>")] | Annotated[list[InjectionName], Tag("<list>")],
            told_apart(f"one of {', '.join(INJECTIONS)}, or a list of them"),
        ]
        | None
    ) = Field(None, description="dynamic (H free, default), predictor (H = -C L) or hold (H = 0)")
    relaxation: (
        Annotated[
            Annotated[RelaxationName, Tag("<scalar>")] | Annotated[list[RelaxationName], Tag("<list>")],
            told_apart(f"one of {', '.join(RELAXATIONS)}, or a list of them"),
        ]
        | None
    ) = Field(None, description="default: the tightest for the injection")
    delta: Searched | None = Field(None, description="1/s, free exponent of the storage function")
    objective: Annotated[SporadicObjective, OneOf("objective", get_args(SporadicObjective))] = "min-gamma"
    slack: Entry | None = Field(None, description="relative, default 0.05")
    bounds: SporadicBounds | None = None
    gains: SporadicGains | None = None


class Least(Section):
    """A lower bound."""

    min: Entry


class LipschitzBounds(Section):
    """What a design may use."""

    L: LargestGain | None = Field(None, description="spectral norm of the gain at most")
    P: Least | None = Field(None, description="P >= min I, which keeps the gain finite")
    gamma: Entry | None = None


class LipschitzGains(Section):
    """Gain to be analyzed instead of designed; it multiplies (y - yhat)."""

    L: Matrix


class LipschitzObserver(Section):
    """What is asked of an observer of a Lipschitz system, xhat' = A xhat + Bf f(Cq xhat) + L (y - yhat)."""

    tag = "<lipschitz>"
    hints = hints_for(LIPSCHITZ) | {"alpha": f"is called decay in type {LIPSCHITZ}"}

    type: FamilyName
    relaxation: Annotated[LipschitzRelaxation, OneOf("relaxation", get_args(LipschitzRelaxation))] = Field(
        "s-procedure", description="of what is known of f; compare: all of them, beside each other"
    )
    objective: Annotated[LipschitzObjective, OneOf("objective", get_args(LipschitzObjective))] = "max-lipschitz"
    weight: Searched | None = Field(
        None, description="in [0, 1], for pareto: minimize weight / lipschitz + (1 - weight) gamma^2"
    )
    decay: Searched | None = Field(None, description="1/s; default 0; a range for pareto only")
    slack: Entry | None = Field(None, description="relative, default 0.05")
    bounds: LipschitzBounds | None = None
    gains: LipschitzGains | None = None


def family_of(section: Any) -> str:
    """Tag of the model that an observer section follows."""
    family = section.get("type") if isinstance(section, dict) else None
    if family == SPORADIC:
        return SporadicObserver.tag
    return LipschitzObserver.tag if family == LIPSCHITZ else Observer.tag


AnyObserver = Annotated[
    Annotated[Observer, Tag(Observer.tag)]
    | Annotated[SporadicObserver, Tag(SporadicObserver.tag)]
    | Annotated[LipschitzObserver, Tag(LipschitzObserver.tag)],
    Discriminator(family_of),
]
