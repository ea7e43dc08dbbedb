"""What a spec allows an unknown-input observer."""

from dataclasses import replace
from typing import Any

from obsdesign.dissipation.engine import Engine
from obsdesign.families import poles
from obsdesign.families.finding import Finding, complex_pair, detectability, finding, frozen_at
from obsdesign.families.incremental.check import LOOPS, slopes
from obsdesign.families.incremental.request import posed, request_of
from obsdesign.families.unknown_input import transform
from obsdesign.families.unknown_input.absence import missing, ranks
from obsdesign.families.unknown_input.request import factor, reduced
from obsdesign.families.unknown_input.request import request_of as own_request
from obsdesign.lmi.formula import in_floats
from obsdesign.model.loop import well_posed
from obsdesign.model.pencil import System, invariant_zeros
from obsdesign.model.structure import linear
from obsdesign.spec import Spec


def check(spec: Spec, _: Engine) -> list[Finding]:
    """Rank of C B, zeros of the cancelled channels, detectability of what is left, loops, poles."""
    names = ", ".join(spec.cancelled)
    if factor(spec) is None:
        return [finding("rank C B", False, ranks(spec), decides=True, advice=missing(spec)["suggestion"], id="OBS950")]
    found = [
        finding("rank C B", True, f"C B has the rank of B for {names}, so that E exists", decides=True, id="OBS950")
    ]
    inner = reduced(spec)
    family, K = posed(inner), in_floats(spec.multiplier.member)
    modes = detectability(inner.posed.doubles, K, in_floats(family).edge, family.about.pace)
    unseen = f" while {names} keeps y at zero"
    if own_request(spec).gains is not None:
        unseen = ", of what the E that is given leaves of the plant; another E may leave more to be seen"
    found += [zeros(spec), *(m if m.holds else replace(m, sentence=m.sentence + unseen) for m in modes)]
    found += [*slopes(inner, family), *poles.findings(family, request_of(inner).bounds.poles)]
    verdict = well_posed(spec.augmented.doubles.Dqf, spec.multiplier)
    found.append(finding("loop of the plant", verdict.unique, verdict.sentence, advice=LOOPS["plant"], id="OBS305"))
    return found


def zeros(spec: Spec) -> Finding:
    """Zeros from the cancelled channels to y, which are modes of the error that no gain moves."""
    K, channels = in_floats(spec.multiplier.member), list(own_request(spec).cancel)
    system = linear(spec.augmented.doubles, K)
    zeros = invariant_zeros(System(system.A, system.B[:, channels], system.C, system.D[:, channels]))
    said = f"{', '.join(spec.cancelled)} to y{frozen_at(K)}: {zeros.sentence}"
    acting = transform.rank(spec.augmented.B[:, channels])
    numbers: dict[str, Any] = {"zeros": [complex_pair(z) for z in zeros.values], "normal_rank": zeros.normal_rank}
    return finding("zeros of the cancelled channels", zeros.normal_rank == acting, said, **numbers, id="OBS614")
