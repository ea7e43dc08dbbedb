"""The observer section of a spec for Lipschitz systems."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from flint import fmpq

from obsdesign.dissipation.bounds import Bounds, Range
from obsdesign.families.lipschitz.relaxations import lipschitz_multiplier
from obsdesign.families.lipschitz.request import LipschitzRequest
from obsdesign.lmi.formula import Array, Exact, rational
from obsdesign.model.disturbance import Generator, augment
from obsdesign.model.plant import Plant
from obsdesign.reading import families
from obsdesign.reading.document import Document, Loc, dotted
from obsdesign.reading.families import LIPSCHITZ, LipschitzBounds, LipschitzGains, LipschitzObserver
from obsdesign.reading.observer import read_bound, read_largest_gain, read_searched, read_slack, require_agreement
from obsdesign.reading.values import Axis, Reader
from obsdesign.spec import Nonlinearity

UNSTRUCTURED = ("norm-bound", "abbaszadeh", "compare")
ABSENT = ("Dqf", "Df", "Dq")
INSTEAD = "type l2 with L2: 0 takes it"


def is_lipschitz(document: Document) -> bool:
    """Whether the observer of a file is of this family, whatever else is wrong in its section."""
    return bool(document.find(("observer", "type"))[1].value == LIPSCHITZ)


def read_lipschitz(
    reader: Reader, section: LipschitzObserver, states: Axis, outputs: Axis, constants: tuple[fmpq, ...]
) -> LipschitzRequest:
    """Return the request.

    Parameters
    ----------
    states, outputs
        Augmented states and measured outputs.
    constants
        Declared Lipschitz constants of the blocks of f.
    """
    decay = read_searched(reader, section.decay or "0", ("observer", "decay"), ">= 0", ">= 0")
    if isinstance(decay, Range) and section.objective != "pareto":
        reader.wrong(("observer", "decay"), f"objective {section.objective} needs a number; a range is for pareto")
    request = LipschitzRequest(
        type=section.type,
        lipschitz=constants,
        relaxation=section.relaxation,
        objective=section.objective,
        weight=read_weight(reader, section),
        decay=decay,
        slack=read_slack(reader, section.slack),
        bounds=read_bounds(reader, section.bounds),
        gains=read_gains(reader, section.gains, states, outputs),
    )
    require_agreement(reader, request)
    return request


def read_weight(reader: Reader, section: LipschitzObserver) -> fmpq | Range | None:
    """Weight of 1 / lipschitz against gamma^2, or where it is scanned."""
    loc: Loc = ("observer", "weight")
    if section.weight is None:
        if section.objective == "pareto":
            reader.wrong(loc, "is required for pareto; give a number in [0, 1], or {min: 0, max: 1}")
        return None
    if section.objective != "pareto":
        reader.wrong(loc, f"belongs to objective pareto, not to {section.objective}", at_key=True)
    weight = read_searched(reader, section.weight, loc, ">= 0", ">= 0")
    place = (*loc, "max") if isinstance(section.weight, families.Range) else loc
    largest = weight.high if isinstance(weight, Range) else weight
    if largest > 1:
        reader.wrong(place, f"{float(largest):g} is above 1; a weight is in [0, 1]")
    return weight


def read_bounds(reader: Reader, section: LipschitzBounds | None) -> Bounds:
    """Largest gain and level, and least storage function."""
    if section is None:
        return Bounds()
    gain, norm = read_largest_gain(reader, section.L, "L")
    least = read_bound(reader, section.P.min, "P", "min") if section.P else None
    return Bounds(gain, norm, gamma=read_bound(reader, section.gamma, "gamma"), floor=least)


def read_gains(
    reader: Reader, section: LipschitzGains | None, states: Axis, outputs: Axis
) -> Mapping[str, Array] | None:
    """Gain to be analyzed."""
    if section is None:
        return None
    return {"L": reader.matrix(reader.entries(section.L, ("observer", "gains", "L")), states, outputs)}


def as_lipschitz(
    reader: Reader, plant: Sequence[Nonlinearity | None], model: Sequence[Nonlinearity | None]
) -> list[Nonlinearity]:
    """Blocks with the multipliers |df| <= k |dq| of their constants, for a block or for each of its components.

    Parameters
    ----------
    plant, model
        Blocks of the plant and of the disturbance model; None after an error.
    """
    found = []
    for i, block in enumerate((*plant, *model)):
        place: Loc = ("nonlinearities", i, "type") if i < len(plant) else ("disturbance",)
        if block is not None and not block.lipschitz:
            instead = "give {lipschitz: k}, or {lipschitz: auto} with f and a region"
            reader.wrong(place, f"{block.type} has no Lipschitz constant that type {LIPSCHITZ} knows; {instead}")
        elif block is not None:
            found.append(read_as_lipschitz(reader, block, place))
    return found


def read_as_lipschitz(reader: Reader, block: Nonlinearity, place: Loc) -> Nonlinearity:
    """One block with the multiplier of its constants, and a note where it was declared by another type."""
    constants = block.lipschitz
    whole = (block.multiplier.member.shape[1], block.multiplier.member.shape[0])
    sizes = [whole] if len(constants) == 1 else [(1, 1)] * len(constants)
    if not block.type.startswith("lipschitz"):
        values = ", ".join(f"{float(k):g}" for k in constants)
        reader.notes.append(f"{dotted(place)}: {block.type} is read as lipschitz {values}")
    return replace(block, multiplier=lipschitz_multiplier(constants, sizes))


def require_lipschitz(
    reader: Reader, request: LipschitzRequest, plant: Plant[Exact] | None, generator: Generator | None, H: Array
) -> None:
    """Refuse what the family does not know: no f, f of f or of w, f in y, no z, and an objective about no w."""
    if plant is None or generator is None:
        return
    if H.size and not (H != 0).any():
        reader.wrong(("performance",), "z = H e is zero: nothing is to be estimated; leave it out for all states")
    if not plant.Bf.shape[1] + generator.Bmf.shape[1] and reader.clean(("nonlinearities",)):
        reader.wrong(("nonlinearities",), f"type {LIPSCHITZ} needs at least one; for a linear plant use type l2")
    augmented = augment(plant, generator, (), ())
    acts = (augmented.Bf != 0).any() and (augmented.Cq != 0).any()
    if plant.Bf.shape[1] and not acts and reader.clean(("nonlinearities",)):
        reader.wrong(("nonlinearities",), "Bf or Cq is zero, and f does not act; for a linear plant use type l2")
    for name in ABSENT:
        if getattr(plant, name).any():
            reader.wrong(("nonlinearities",), f"{name} must be zero for type {LIPSCHITZ}; {INSTEAD}")
    if any((getattr(augmented, name) != 0).any() and not (getattr(plant, name) != 0).any() for name in ABSENT):
        reader.wrong(("disturbance",), f"Dq2f, Dq2 and D Dwf must be zero for type {LIPSCHITZ}; {INSTEAD}")
    if request.objective != "max-lipschitz" and not augmented.B.shape[1]:
        reader.wrong(("observer", "objective"), f"{request.objective} is about w, and there is none; give system.B")
    if request.relaxation in UNSTRUCTURED and not all(is_identity(M) for M in (augmented.Bf, augmented.Cq)):
        reader.notes.append(
            f"observer.relaxation: f is treated as unstructured with the constant norm(Bf) lipschitz norm(Cq) "
            f"by {'norm-bound and abbaszadeh' if request.relaxation == 'compare' else request.relaxation}"
        )


def is_identity(M: Array) -> bool:
    """Whether a matrix is the identity."""
    return M.shape[0] == M.shape[1] and bool((rational(np.eye(len(M))) == M).all())
