"""One request for an observer of a Lipschitz system, in the numbers of the design."""

import math
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import numpy as np
from flint import fmpq

from obsdesign.dissipation.analysis import Errors
from obsdesign.dissipation.bounds import Bounds
from obsdesign.dissipation.certificate import Certificate, certify
from obsdesign.dissipation.claim import DIGITS, best_claim, claim
from obsdesign.dissipation.decimals import round_up, significant, square_below
from obsdesign.dissipation.elimination import LARGE
from obsdesign.dissipation.engine import Engine
from obsdesign.dissipation.gain import ROOM, Solve, bounded, least_size, unplaced
from obsdesign.dissipation.modes import EXPONENTIALS, POWERS
from obsdesign.dissipation.scaling import Factors, scaling
from obsdesign.dissipation.scan import edge
from obsdesign.dissipation.smaller import candidates, proved_small
from obsdesign.families.lipschitz.claim import Claim, held, needed
from obsdesign.families.lipschitz.reasons import gate, too_small
from obsdesign.families.lipschitz.relaxations import KINDS, Lipschitz
from obsdesign.families.lipschitz.request import LipschitzRelaxation, LipschitzRequest
from obsdesign.families.lipschitz.stretch import Stretch
from obsdesign.families.noise import noise_of
from obsdesign.families.outcome import Diagnosis, Outcome, Verdict
from obsdesign.families.poles import eased
from obsdesign.families.reach import judged
from obsdesign.lmi.formula import Array, Values, in_floats, printed
from obsdesign.lmi.proof import rounded
from obsdesign.lmi.solve import Status
from obsdesign.records import dataclass, replace

K = TypeVar("K", bound=Lipschitz)
CLOSE = 1e-3  # relative, from the largest decay that does to what is suggested
CENTRAL = "the smallest takes long to find for so large a plant"
CENTRAL_DIGITS = 8  # of such a gain
MORE = 0.05  # relative, above the least gamma over all gains, of a gamma that is tried with larger gains


@dataclass(frozen=True)
class Study:
    """One relaxation at one rate.

    Every constant is the largest of those of the blocks, which grow in proportion to the declared ones.
    """

    engine: Engine
    unit: Lipschitz  # the s-procedure for the constant 1, in rationals; L1 is free
    request: LipschitzRequest  # of one relaxation
    tolerable: Callable[[float], bool] = bool  # whether f may have no larger constant than one

    @property
    def relaxation(self) -> LipschitzRelaxation:
        """One of `RELAXATIONS`."""
        return self.request.relaxation

    @property
    def declared(self) -> fmpq:
        """Declared constant, as far as a file can hold it."""
        return needed(self.request.lipschitz)

    @property
    def slack(self) -> float:
        """Relative slack of the objective."""
        return float(self.request.slack)

    @property
    def bounds(self) -> Bounds:
        """Bounds on the gain, on P and on gamma."""
        return self.request.bounds

    @property
    def restricted(self) -> bool:
        """Whether anything but gamma is bounded."""
        return self.bounds.restricted

    @property
    def closed(self) -> bool:
        """Whether a gain within bounds attains a positive limit: at the rate 0 the inequality is strict."""
        return bool(self.unit.rate > 0) and self.bounds.closed

    @property
    def disturbed(self) -> bool:
        """Whether there is a w; otherwise gamma means nothing."""
        return bool(self.unit.plant.B.shape[1])

    def noise(self, L1: Array) -> float | None:
        """Rms of z for white noise of density 1 in every output, of the worst member at the declared constant."""
        family = self.unit.stretched(self.declared)
        modes = POWERS if self.request.pace.sampled else EXPONENTIALS
        errors = Errors.of(family.plant, family.multiplier, family.H, L1, modes=modes)
        return noise_of(errors, in_floats(family.H))

    def obstacle(self) -> Diagnosis:
        """Why no gain will do, as far as it is seen before any search; empty if nothing stands in the way."""
        return gate(self.engine, self.unit, self.request, self.relaxation, self.tolerable)

    def constant_of(self, xi: float) -> float:
        """Constant of a l = 1 / xi for f as a whole."""
        return 1 / (in_floats(self.unit).lipschitz * xi)

    def attenuation(self, constant: float, kind: type[Lipschitz] | None = None, L: Array | None = None) -> Lipschitz:
        """Inequalities of the relaxation with w and z for a constant, in doubles; for a gain in rationals, or any."""
        kind = kind or KINDS.get(self.relaxation, type(self.unit))
        return in_floats(recast(self.unit, kind, L)).stretched(constant)

    @property
    def scaling(self) -> Factors:
        """Units in which the inequalities with w and z are solved; none where nothing was, or f is zero."""
        return scaling(self.attenuation(float(self.declared))) if self.engine.solves and self.declared else {}

    def stretch(self, L: Array | None = None) -> Stretch:
        """Search for the largest constant, without w and z, for a gain or over all."""
        kind = KINDS["norm-bound"] if self.relaxation in KINDS else type(self.unit)
        return Stretch(self.engine, in_floats(recast(self.unit, kind, L).undisturbed()))

    def proved(
        self, L: Array, constant: fmpq, gamma: float | None = None, values: Values | None = None
    ) -> Claim | None:
        """Proof that a gain (in rationals) tolerates a constant, with a gamma; None if there is none.

        `gamma`: level to prove; None for nearly the least that the gain has; `values`: a solution of the relaxation for
        about this gain, constant and gamma: it may be the proof already.
        """
        family = replace(self.unit, L1=-L).stretched(constant)
        if not self.disturbed:
            certificate = claim(self.engine, family, 1.0, bounds=self.request.placed)
        elif gamma is None:
            _, certificate = best_claim(self.engine, family, self.request.placed)
        else:
            found = self.at_once(family, gamma, values) if values else None
            certificate = found or claim(self.engine, family, gamma, bounds=self.request.storage)
        return Claim(constant, certificate) if certificate and certificate.holds else None

    @property
    def centered(self) -> bool:
        """Whether gains are those of Riccati equations: of large plants, where nothing bounds them."""
        large = self.unit.plant.n >= LARGE and self.engine.eliminates
        return large and self.relaxation == "s-procedure" and not self.restricted

    def central(self, gamma: float) -> tuple[Array, Claim, str] | None:
        """Gain of a Riccati equation that reaches a gamma at the declared constant, its proof, and a note on it."""
        family = self.unit.stretched(self.declared)
        found = proved_small(self.engine, family, gamma, self.request.storage) if self.centered else None
        if found is None or found[0].family.L1 is None:
            return None
        return -found[0].family.L1, Claim(self.declared, found[0]), found[1].said("L", CENTRAL)

    def central_for(self, constant: fmpq) -> tuple[Array, Claim, str] | None:
        """Same for a constant, with nearly the least gamma that it has; None if none is proved.

        A gain that just reaches the constant has a large gamma: one by descent is of use where there is no v.
        """
        if not self.centered or len(self.unit.multiplier.blocks) > 1:
            return None
        family = self.unit.undisturbed().stretched(constant)
        ones = {unknown.name: printed(np.ones((1, 1))) for unknown in family.multiplier.unknowns()}
        for found in candidates(family, 1.0, ones, smaller=not self.disturbed):
            L = printed(significant(-found.gain.L, CENTRAL_DIGITS))
            if claim := self.proved(L, constant):
                return L, claim, found.said("L", CENTRAL)
        return None

    def at_once(self, family: Lipschitz, gamma: float, values: Values) -> Certificate | None:
        """Proof by the storage function of a solution and the scales that go with it."""
        places = {unknown.name: values[unknown.name] for unknown in family.placing(self.request.placed)}
        witness = {"P": values["P"], **self.scales(family, values), **places}
        level = printed(gamma)
        square = square_below(level)
        rough = (rounded(witness, digits) for digits in DIGITS)
        tried = (certify(family, level, fmpq(1), square, values, self.request.storage) for values in rough)
        return next((certificate for certificate in tried if certificate.holds), None)

    def scales(self, family: Lipschitz, values: Values) -> dict[str, Array]:
        """Scales of the s-procedure; where f is known by one constant, those that make 2 e'P Bf df its bound."""
        names = [unknown.name for unknown in family.multiplier.unknowns()]
        if names[0] in values:
            return {name: values[name] for name in names}
        fixed = in_floats(family)
        into = float(np.linalg.norm(fixed.plant.Bf, 2))
        whole = fixed.lipschitz
        scale = np.linalg.norm(values["P"], 2) * into**2 / whole if whole else 1.0
        return {name: np.array([[scale]]) for name in names}

    def out_of_bounds(
        self,
        solve_of: Callable[["Study"], Solve],
        *,
        decided: bool,
        goal: float = math.inf,
        least: float = 0.0,
        **known: Any,
    ) -> Outcome:
        """Answer that nothing within the bounds was found, with what would do, tried against the whole request.

        `solve_of`: least objective within bounds, at the decay of a study; `goal`: what is asked of it; `least`: the
        least over all gains: above the goal, larger gains do only with a larger gamma.
        """
        above, pace = goal < least, self.unit.about.pace
        gamma = round_up(math.sqrt(least) * (1 + MORE), 4) if above else None
        size = least_size(solve_of(self), self.bounds, (gamma * (1 - ROOM)) ** 2 if gamma else goal)

        def inside(bounds: Bounds) -> bool:
            answer = bounded(solve_of(self), bounds)
            return answer.status is Status.OPTIMAL and answer.objective <= goal

        wider = eased(self.bounds, inside)
        found = too_small(self.bounds, pace, float(self.unit.rate), size, self.slower(solve_of, goal), gamma, wider)
        none = self.relaxation == "s-procedure" and unplaced(self.engine, self.hardest, self.bounds)
        return judged(found, decided=decided or above or none, **known)

    @property
    def hardest(self) -> Lipschitz:
        """Inequalities for the declared constant, or for none where the largest is asked for."""
        return self.attenuation(0.0 if self.request.objective == "max-lipschitz" else float(self.declared))

    def slower(self, solve_of: Callable[["Study"], Solve], goal: float) -> float | None:
        """Smaller rate, about the largest, at which the objective is at most a goal; None if 0 will not do either."""
        pace = self.unit.about.pace

        def reaches(rate: float) -> bool:
            study = replace(self, unit=replace(self.unit, rate=pace.found(rate)))
            answer = bounded(solve_of(study), self.bounds)
            return answer.status is Status.OPTIMAL and answer.objective <= goal

        if not self.unit.rate or not reaches(0.0):
            return None
        return pace.rounded(edge(reaches, 0.0, float(self.unit.rate), CLOSE) * (1 - CLOSE), 4)

    def first(self, candidates: Iterable[tuple[Array, Claim | None]]) -> tuple[Array | None, Claim | None]:
        """The first gain with a proof; or else the last one, without."""
        found: tuple[Array | None, Claim | None] = (None, None)
        for found in candidates:
            if found[1]:
                break
        return found

    def outcome(self, L: Array, claim: Claim | None, **further: Any) -> Outcome:
        """Outcome for a gain, in rationals, with a proof or without."""
        if claim:
            claim = replace(claim, bound=held(self.request, L, claim.certificate, disturbed=self.disturbed))
        return Outcome(Verdict.CERTIFIED if claim else Verdict.UNCERTIFIED, {"L": in_floats(L)}, claim, **further)


def recast(unit: Lipschitz, kind: type[K], L: Array | None = None) -> K:
    """Same problem in another relaxation, for a gain in rationals, or any."""
    return kind(unit.plant, unit.multiplier, unit.H, unit.rate, None if L is None else -L, unit.L2)
