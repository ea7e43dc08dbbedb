"""What steep nonlinearities rule out of observers in discrete time, whatever the gains."""

from obsdesign.dissipation.inequality import Incremental
from obsdesign.families.incremental.stiffness import block_name, stiff_blocks
from obsdesign.families.outcome import Diagnosis
from obsdesign.spec import Spec

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
