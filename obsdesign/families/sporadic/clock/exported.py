"""Clock-dependent claims as files of Coq: which observer and which storage functions a theorem is written of."""

from collections.abc import Mapping

import numpy as np
from flint import fmpq

from obsdesign.coq.clock import Observer, Storage
from obsdesign.coq.instants import KINDS, Part
from obsdesign.coq.theorem import UnexportedError
from obsdesign.families.sporadic.clock.witness import Witness
from obsdesign.lmi.formula import Array, identity, zeros
from obsdesign.model.multiplier import Multiplier
from obsdesign.model.plant import Plant

TERMS = 60  # of the series of exp(2 lambda T1) that Coq computes
NOISY = {"energy", "noise"}  # of the kinds, those where eta acts


def observer(
    plant: Plant[Array], Cp: Array, gains: Mapping[str, Array], multiplier: Multiplier, T1: fmpq, T2: fmpq
) -> Observer:
    """Observer of gains L and H, or K, with the error (e, C e - theta), or e. Raises `UnexportedError`."""
    if "K_of_gap" in gains:
        raise UnexportedError("a gain that depends on the interval is not exported yet, constant ones are")
    n, ny = plant.n, len(plant.C)
    eye, one = identity(n, plant.A), identity(ny, plant.A)

    def none(rows: int, columns: int) -> Array:
        return zeros((rows, columns), [plant.A])

    if "K" in gains:
        still = {"L": none(n, 0), "H": none(0, 0), "K": gains["K"], "G": none(0, ny), "Se": eye, "St": none(n, 0)}
        return Observer(plant, Cp, **still, multiplier=multiplier, T1=T1, T2=T2)
    Se, St = np.vstack([eye, plant.C]), np.vstack([none(n, ny), -one])
    return Observer(plant, Cp, gains["L"], gains["H"], none(n, ny), one, Se, St, multiplier, T1, T2)


def parts(witnesses: Mapping[str, Witness], constants: Mapping[str, fmpq]) -> dict[str, Part]:
    """Parts of a claim, with the constants of the statement, in its order. Raises `UnexportedError`."""
    found = {}
    for name, kind in KINDS.items():
        known = {**constants, **own(witnesses[name])} if name in witnesses else {}
        if name == "noise" and name in known and not shown(witnesses[name], known[name]):
            raise UnexportedError("the bound by sup|eta| is stated with a margin that the series of Coq does not see")
        if known.keys() >= set(kind.levels):
            found[name] = Part(kind, storage(name, witnesses[name]), {key: known[key] for key in kind.levels})
    return found


def shown(witness: Witness, noise: fmpq) -> bool:
    """Whether kappa <= (1 - 1 / p) noise^2 with a p below exp(2 lambda T1): its series as far as Coq takes it."""
    theorem, p = witness.theorem, fmpq(1)
    for k in range(TERMS, 0, -1):
        p = 1 + 2 * theorem.decay * theorem.T1 * p / k
    return bool(witness.numbers["kappa"] * p <= noise * noise * (p - 1))


def own(witness: Witness) -> dict[str, fmpq]:
    """Numbers of a witness that the statement has as they are."""
    names = {"energy_of_error": "r", "energy_of_w": "mu", "energy_of_noise": "kappa"}
    numbers = {name: witness.numbers[key] for name, key in names.items() if key in witness.numbers}
    return {"decay": witness.theorem.decay, **numbers}


def storage(name: str, witness: Witness) -> Storage:
    """Storage function of a witness; that of the energy of z at rate 0. Raises `UnexportedError`."""
    theorem, numbers, zero = witness.theorem, witness.numbers, fmpq(0)
    if theorem.lookahead > 1:
        raise UnexportedError("storage functions that look further ahead are not exported yet")
    goal, places = witness.goal, theorem.clock.places
    return Storage(
        rate=zero if goal.weighed else theorem.decay,
        weight=fmpq(int(goal.weighed)),
        mu=numbers.get("mu", zero) if goal.disturbed else zero,
        kappa=numbers.get("kappa", zero) if name in NOISY else zero,
        roof=numbers["r"] if "r" in numbers else roof(witness.P),
        driven=goal.disturbed,
        noisy=name in NOISY,
        knots=theorem.clock.knots,
        controls=witness.P[0][places],
        scales={key: values[0].reshape(places.shape) for key, values in witness.multipliers.items()},
        normal=goal.normal,
    )


def roof(P: Array) -> fmpq:
    """Whole number r with P <= r I, for stacks of P >= 0: no eigenvalue is above the trace."""
    return fmpq(max(fmpq(trace).ceil() for trace in np.trace(P, axis1=-2, axis2=-1).flat))
