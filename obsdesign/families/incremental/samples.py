"""What is told in discrete time of steep nonlinearities, and of modes that decay at the very rate that is asked for."""

from dataclasses import replace

import numpy as np

from obsdesign.dissipation.inequality import Incremental
from obsdesign.errors import UndecidedError
from obsdesign.families.finding import described
from obsdesign.families.incremental.stiffness import block_name, stiff_blocks
from obsdesign.families.outcome import Diagnosis
from obsdesign.model.structure import undetectable
from obsdesign.spec import Spec

SLOWER = 1e-3  # of rho, that is suggested
NONE = 1e-9  # of z along a mode of length 1

INSTEAD = (
    "declare a finite slope, or prove one on a region (auto); discretise by implicit Euler, which puts f into its own "
    "argument; or ask for filtered estimates with an L2 that has L2 C Bf < 0"
)


def explicit(spec: Spec, family: Incremental) -> Diagnosis | None:
    """A block without an upper slope bound, which no loop and no output involves: no gain serves it.

    With M11 = M22 = 0 and Gf = 0 the block (f, f) of the inequality is Nf' P Nf <= 0, and Nf = Bf + L1 Df = Bf.

    It is no conservatism: a pole of the error goes to infinity with the slope, for every pair of gains, unless
    Ge (zI - Ne)^-1 Nf = 0.
    """
    for i, *_ in stiff_blocks(family):
        return {
            "id": "OBS605",
            "condition": "explicit",
            "reason": f"{block_name(spec, i)} has no upper slope bound, and acts on the next sample alone: of an error "
            "that it multiplies by a slope without bound no gain makes a contraction",
            "feasible": {},
            "suggestion": INSTEAD,
        }
    return None


def at_the_edge(family: Incremental) -> Diagnosis:
    """Answer that a mode which no output shows decays at the very rate that is asked for, and z shows it; else empty.

    V+ - rho^2 V cannot be negative along it, so that z has to be zero there. Where it is, the inequality holds without
    any margin at best, and nothing is decided.

    `family`: in doubles. Raises `UndecidedError`: there is such a mode, and z does not show it.
    """
    if not family.edge.weak:
        return {}
    p, pace = family.plant, family.about.pace
    for mode in undetectable(p, family.multiplier.member, replace(family.edge, weak=False)):
        entries, here = dict(mode.along), pace.said(family.rate)
        z = family.H @ np.array([entries.get(name, 0) for name in p.states])
        if not family.about.monotone or np.abs(z).max(initial=0.0) <= NONE:
            slower = "leave it out of the plant" if not family.rate else f"ask for {pace.slower(family.rate - SLOWER)}"
            said = f"{mode.sentence}, and decays at {here} itself, where nothing is decided: {slower}, or measure it"
            raise UndecidedError(said, id="OBS507")
        slower = pace.necessary(family.edge.of(mode.eigenvalue))
        return {
            "id": "OBS601",
            "condition": "detectability",
            "reason": f"{mode.sentence}, and z shows it: at {here} itself that is too slow",
            "mode": described(mode),
            "feasible": {pace.bound: abs(mode.eigenvalue)} if family.rate else {},
            "suggestion": f"{f'{slower}; or ' if family.rate else ''}a measurement that shows it, or a performance "
            "without it, is needed",
        }
    return {}
