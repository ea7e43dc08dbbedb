"""What an observer of a Lipschitz system is not designed for."""

from typing import TYPE_CHECKING

import numpy as np

from obsdesign.families import asked
from obsdesign.lmi.formula import identity
from obsdesign.model.disturbance import augment
from obsdesign.sections.document import Loc
from obsdesign.sections.values import Reader

if TYPE_CHECKING:
    from obsdesign.families.lipschitz.request import LipschitzRequest

UNSTRUCTURED = ("norm-bound", "abbaszadeh", "compare")
ABSENT = ("Dqf", "Df", "Dq")
INSTEAD = "type l2 with L2: 0 takes it"


def require_lipschitz(reader: Reader, request: "LipschitzRequest", problem: asked.Estimation) -> None:
    """Refuse what the family does not know: no f, f of f or of w, f in y, no z, and an objective about no w."""
    plant, generator, H = problem.plant, problem.generator, problem.H
    if plant is None or generator is None:
        return
    if H.size and not (H != 0).any():
        reader.wrong(
            ("performance",), "z = H e is zero: nothing is to be estimated; leave it out for all states", id="OBS214"
        )
    place: Loc = ("system", "dynamics") if problem.as_equations else ("nonlinearities",)
    if not plant.Bf.shape[1] + generator.Bmf.shape[1] and reader.clean(place):
        term = "nonlinear term" if problem.as_equations else "nonlinearity"
        reader.wrong(place, f"type lipschitz needs at least one {term}; for a linear plant use type l2", id="OBS406")
    augmented = augment(plant, generator, (), ())
    acts = (augmented.Bf != 0).any() and (augmented.Cq != 0).any()
    if plant.Bf.shape[1] and not acts and reader.clean(place):
        said = "no nonlinear term acts on a state" if problem.as_equations else "Bf or Cq is zero, and f does not act"
        reader.wrong(place, f"{said}; for a linear plant use type l2", id="OBS406")
    for name in ABSENT:
        for where, said in problem.refused(name, "type lipschitz"):
            reader.wrong(where, f"{said}; {INSTEAD}", id="OBS406")
    if any((getattr(augmented, name) != 0).any() and not (getattr(plant, name) != 0).any() for name in ABSENT):
        reader.wrong(("disturbance",), f"Dq2f, Dq2 and D Dwf must be zero for type lipschitz; {INSTEAD}", id="OBS406")
    if request.objective != "max-lipschitz" and not augmented.B.shape[1]:
        key = "system.disturbances" if problem.as_equations else "system.B"
        reader.wrong(
            ("observer", "objective"), f"{request.objective} is about w, and there is none; give {key}", id="OBS405"
        )
    if request.relaxation in UNSTRUCTURED and not all(
        np.array_equal(M, identity(len(M), M)) for M in (augmented.Bf, augmented.Cq)
    ):
        reader.notes.append(
            f"observer.relaxation: f is treated as unstructured with the constant norm(Bf) lipschitz norm(Cq) "
            f"by {'norm-bound and abbaszadeh' if request.relaxation == 'compare' else request.relaxation}"
        )
