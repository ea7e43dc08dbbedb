"""The section `discretise:` of a plant: the plant in samples that stands for it, and what it leaves out."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import accumulate
from math import inf, isfinite, sqrt

import numpy as np
from flint import fmpq

from obsdesign.dissipation.decimals import round_up
from obsdesign.expressions import Expression
from obsdesign.families import FAMILIES
from obsdesign.lmi.formula import Array, identity, printed, rational, zeros
from obsdesign.model.discretise import Continuous, Discretised, defect, hold, implicit_euler
from obsdesign.model.disturbance import stack, unknown
from obsdesign.model.equations import free, weighted
from obsdesign.nonlinearities.evidence.enclosure import negative, supremum_of
from obsdesign.nonlinearities.evidence.restriction import Ends, Restriction
from obsdesign.reading.disturbance_schema import ChannelData
from obsdesign.reading.dynamics import read_domain
from obsdesign.reading.plant import Names, Reading
from obsdesign.reading.plant_schema import Defect, Equations, InMatrices
from obsdesign.reading.schema import File
from obsdesign.sections.document import Loc
from obsdesign.sections.values import Reader
from obsdesign.spec import Spec, numbered

LOC: Loc = ("system", "discretise")
AUTO = "auto"
SLOW = 2  # samples of w in v of an integrator


def discretised(
    reader: Reader, system: Equations | InMatrices | None, plant: Reading, period: fmpq | None
) -> tuple[Reading, Continuous | None]:
    """The plant in samples, and the continuous one; as it is where nothing is asked, or something is wrong."""
    section = system.discretise if system is not None else None
    if section is None or plant.plant is None or period is None or not reader.clean(("system",)):
        return plant, None
    known = Continuous(plant.plant, plant.gx, plant.gy, plant.gq, section.method)
    if section.method == "hold":
        made: Discretised | None = hold(plant.plant, period)
    elif plant.plant.Df.any():
        reader.wrong((*LOC, "method"), "implicit-euler takes no f in the outputs (Df); take hold", id="OBS406")
        return plant, None
    else:
        made = implicit_euler(plant.plant, period)
    if made is None:
        said = f"{float(period):g} makes I - period A singular; give another period, or method: hold"
        reader.wrong((*LOC, "period"), said, id="OBS208")
        return plant, None
    gx = combined(made.X, plant.gx)
    gq = tuple(
        Expression.combination([fmpq(1), fmpq(1)], pair)
        for pair in zip(plant.gq, combined(made.Q, plant.gx), strict=True)
    )
    return replace(plant, plant=made.plant, gx=gx, gq=gq if made.Q.any() else plant.gq), known


def combined(M: Array, terms: Sequence[Expression]) -> tuple[Expression, ...]:
    """M times a column of expressions; of a term that is zero nothing is left."""
    return tuple(weighted(M, terms))


def with_defect(reader: Reader, file: File, spec: Spec) -> Spec:
    """Spec with the channels of the defect beside those of w, in units of its bound; as it is where none is asked.

    Raises `UsageError`: what the bound rests on does not hold, with its place.
    """
    section = file.system.discretise if file.system is not None else None
    if section is None or spec.continuous is None:
        return spec
    if of_matrices(file.disturbance):
        said = "is in matrices, which discretise does not turn into samples: give integrator, sinusoid, .."
        reader.wrong(("disturbance",), f"{said}, or the whole plant in samples with time: discrete", id="OBS406")
        reader.stop()
    if section.defect is None:
        return spec
    made = bounded(reader, file.system, spec, section.defect)
    if reader.problems:
        reader.stop()
    return replace(made, notes=tuple(reader.notes))


def of_matrices(section: object) -> bool:
    """Whether a disturbance model is given in matrices, for some channel."""
    if isinstance(section, list):
        return any(map(of_matrices, section))
    if not isinstance(section, ChannelData):
        return False
    return section.model is not None or of_matrices(getattr(section, "type", None))


def bounded(reader: Reader, system: Equations | InMatrices | None, spec: Spec, section: Defect) -> Spec:
    """Spec with the bound on its defect, and its channels; as it is where that is refused."""
    known = spec.continuous
    assert known is not None
    assert spec.period is not None
    loc: Loc = (*LOC, "defect")
    for said in refusals(spec, known):
        reader.wrong(loc, said, at_key=True, id="OBS406")
    if not reader.clean(LOC):
        return spec
    w_rate = fmpq(0)
    if section.w_rate is not None:
        w_rate = reader.number(section.w_rate, (*loc, "w_rate"), "> 0")
    elif known.plant.B.any():
        reader.wrong(loc, "w_rate is required: the largest |w'|, of the w that act on the states", id="OBS205")
    q_rate = read_q_rate(reader, system, spec, section.q_rate)
    if not reader.clean(LOC):
        return spec
    firsts = accumulate((len(block.f or ()) for block in spec.nonlinearities), initial=0)
    sizes = [
        (slice(first, first + len(block.f or ())), max(block.lipschitz), q_rate)
        for first, block in zip(firsts, spec.nonlinearities, strict=False)
    ]
    bound = defect(known.plant, sizes, w_rate, spec.period)
    made = replace(spec, continuous=replace(known, defect=bound, rates=(q_rate, w_rate)))
    return widened(made, bound) if bound else made


def widened(spec: Spec, bound: fmpq) -> Spec:
    """Spec with one more channel of w for each state, bound I in B, that no simulation moves."""
    n, plant = spec.plant.n, spec.plant
    taken = {*plant.states, *plant.exogenous, *plant.outputs, *spec.inputs, *spec.model_states}
    names = tuple(free(f"defect_{state}", taken) for state in plant.states)
    D, Dq = (np.hstack([X, zeros((len(X), n), [plant.A])]) for X in (plant.D, plant.Dq))
    B = np.hstack([plant.B, rational(bound * identity(n, plant.A))])
    still = (Expression.number(0),) * n
    trial = spec.simulation
    if trial is not None:
        w, v = (None if signal is None else (*signal, *still) for signal in (trial.w, trial.v))
        trial = replace(trial, w=w, v=v)
    return replace(
        spec,
        plant=replace(plant, B=B, D=D, Dq=Dq, exogenous=(*plant.exogenous, *names)),
        generator=stack([spec.generator, *[unknown()] * n]),
        drives=numbered("v", len(spec.drives) + n),
        simulation=trial,
    )


def refusals(spec: Spec, known: Continuous) -> list[str]:
    """Why the defect of a spec has no bound."""
    varying = {*spec.plant.outputs, "t"}
    found = []
    takers = dict.fromkeys(name for family in FAMILIES.values() for name in family.defects)
    if spec.observer.type not in takers:
        found.append(f"is for type {', '.join(takers)}, which bounds the error by the largest values of what acts")
    if known.method != "hold":
        found.append("is for method: hold")
    if any(weights is None or len(weights) > SLOW for weights in spec.generator.inverse):
        found.append("is for w of no model (unknown) or an integrator, whose v at a sample is the mean over a period")
    if any(side.names & varying for side in (*known.gx, *known.gq)):
        found.append("takes known terms of inputs only, which are constant over a period; here one has t or an output")
    for i, block in enumerate(spec.nonlinearities):
        called = block.term or f"nonlinearities[{i}]"
        if not block.lipschitz:
            found.append(f"needs a Lipschitz constant of {called}")
        elif block.f is None or any(part.names & varying for part in block.f):
            found.append(f"needs {called} as an f of q and inputs alone")
    return found


def read_q_rate(reader: Reader, system: Equations | InMatrices | None, spec: Spec, text: str) -> fmpq:
    """Bound on |q_i'| of every nonlinearity, as given or found on the domain."""
    loc: Loc = (*LOC, "defect", "q_rate")
    if text != AUTO:
        return reader.number(text, loc, "> 0")
    found = fastest(spec, read_domain(reader, system, names_of(spec))) if isinstance(system, Equations) else None
    if found is None or not isfinite(found):
        said = "auto needs a plant as equations, and system.domain of every state, input and disturbance that moves q"
        reader.wrong(loc, f"{said}; give a number", id="OBS405")
        return fmpq(1)
    reader.notes.append(f"system.discretise.defect: |q_i'| is at most {found:g} on system.domain")
    return printed(found)


def names_of(spec: Spec) -> Names:
    """Names of the signals of the plant."""
    return Names(spec.plant.states, spec.plant.outputs, spec.inputs, spec.plant.exogenous)


def fastest(spec: Spec, domain: Mapping[str, Ends]) -> float | None:
    """Bound on |q_i'| of every block on a box, rounded up; None where q is moved by more than states."""
    known = spec.continuous
    if known is None or known.plant.Dq.any() or known.plant.Dqf.any() or any(side.names for side in known.gq):
        return None
    before = replace(spec, plant=known.plant, gx=known.gx, gq=known.gq, gy=known.gy)
    equations = before.equations(known.plant)
    sides = [side.substituted(equations.algebraic) for side in equations.dynamics.values()]
    rows, largest = iter(weighted(known.plant.Cq, sides)), 0.0
    for block in spec.nonlinearities:
        squares = 0.0
        for rate in (next(rows) for _ in range(block.nq)):
            box = Restriction.of([rate], 0, domain)
            ends = [supremum_of(side, box).bound for side in (rate, negative(rate))]
            squares += max(*ends, 0.0) ** 2
        largest = max(largest, round_up(sqrt(squares), 6) if isfinite(squares) else inf)
    return largest
