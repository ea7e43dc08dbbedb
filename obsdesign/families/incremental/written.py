"""What a result holds of an observer with the gains L1 and L2."""

from typing import Any

from obsdesign.dissipation.certificate import Certificate, Reconstructed, statement
from obsdesign.dissipation.figures import figures
from obsdesign.families.incremental.design import Design
from obsdesign.files.text import checks, rows, written
from obsdesign.lmi.formula import approximate
from obsdesign.spec import Spec


def content(spec: Spec, design: Design) -> dict[str, Any]:
    """Observer, guarantee, certificate and search, whichever there are."""
    made: dict[str, Any] = {}
    if design.gains:
        made["observer"] = observer(spec, design)
    if design.certificate:
        made["guarantee"] = guarantee(spec, design)
        made["certificate"] = certificate(design.certificate)
    elif design.limit:
        made["guarantee"] = limits(design)
    if design.points:
        made["search"] = {"parameter": "alpha", "points": list(design.points)}
    return made


def observer(spec: Spec, design: Design) -> dict[str, Any]:
    """Gains and what an engineer asks first of them."""
    P = design.certificate.P.astype(float) if design.certificate else None
    L1, L2 = design.gains["L1"], design.gains["L2"]
    return {
        "type": spec.observer.type,
        "L1": L1.tolist(),
        "L2": L2.tolist(),
        **figures(spec.augmented.doubles, L1, P),
    }


def guarantee(spec: Spec, design: Design) -> dict[str, Any]:
    """What is proved, and the limit it is near to."""
    assert design.certificate
    g = design.certificate.guarantee
    bound = design.certificate.reconstruction and design.certificate.reconstruction.bound
    return {
        "gamma": g.gamma,
        "alpha": g.alpha,
        "mu1": g.mu1,
        "mu2": g.mu2,
        **limits(design),
        **({"reconstruction": {"w": bound.w, "w_rate": bound.w_rate, "x_rate": bound.x_rate}} if bound else {}),
        "statement": statement(spec, design.certificate),
    }


def limits(design: Design) -> dict[str, Any]:
    """Limits of the objective."""
    bounded = {"limit_bounded": design.limit_bounded} if design.limit_bounded else {}
    return {"limit": design.limit, **bounded}


def certificate(proof: Certificate) -> dict[str, Any]:
    """Witness and checks."""
    return {
        "kind": "exact",
        "P": rows(proof.P),
        "multipliers": {name: written(value) for name, value in proof.multipliers.items()},
        "checks": checks(proof.checks),
        **({"reconstruction": reconstruction(proof.reconstruction)} if proof.reconstruction else {}),
    }


def reconstruction(proof: Reconstructed) -> dict[str, Any]:
    """Witness and checks of the bound on the reconstruction of w."""
    levels = {
        name: {"gamma": approximate(level.gamma), "alpha": approximate(level.alpha), "mu1": approximate(level.mu1)}
        | {"mu2": approximate(level.mu2)}
        | certificate(level)
        for name, level in proof.levels.items()
    }
    slopes = {
        name: {"bound": approximate(slope.bound), "values": {n: written(v) for n, v in slope.values.items()}}
        | {"checks": checks(slope.checks)}
        for name, slope in proof.slopes.items()
    }
    return {"levels": levels, "slopes": slopes, "checks": checks(proof.checks)}
