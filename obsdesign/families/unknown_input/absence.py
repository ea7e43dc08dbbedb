"""Why there is no unknown-input observer: the rank of C B, and what the inequality of the plant that is left says."""

from dataclasses import replace
from typing import Any

from obsdesign.families.incremental import absence as incremental
from obsdesign.families.outcome import Diagnosis, Proof
from obsdesign.families.unknown_input import transform
from obsdesign.families.unknown_input.request import reduced, request_of
from obsdesign.files import ResultFile
from obsdesign.lmi.formula import Array
from obsdesign.lmi.proof import Check
from obsdesign.spec import Spec

KIND = "rank"
LEFT = {  # by whether gains are given
    False: "A, Bf and B are here T A, T Bf and T B, what is left of the plant by its E",
    True: "A, Bf and B are here T A, T Bf and T B, what is left by the E that is given; another E may leave more",
}


def ranks(spec: Spec) -> str:
    """The condition in words, with its numbers."""
    plant, channels = spec.augmented, list(request_of(spec).cancel)
    B, names = plant.B[:, channels], ", ".join(spec.cancelled)
    seen, acting = transform.rank(plant.C @ B), transform.rank(B)
    if seen == acting:
        return f"rank [C B, Df] shows f in y where it shows {names}, so that no E has E C B = B and E Df = 0"
    return f"C B has rank {seen} and must have {acting}, that of B, for {names}: y shows some of it too late"


def missing(spec: Spec) -> Diagnosis:
    """Answer that no E cancels the channels, with the direction in which they act and y does not show it at once."""
    found = transform.obstacle(spec.augmented, request_of(spec).cancel)
    assert found is not None
    w = {name: str(x) for name, x in zip(spec.cancelled, found[0], strict=True) if x != 0}
    said = ", ".join(w) if len(w) == 1 else " and ".join(f"{x} {name}" for name, x in w.items())
    seen = "C B w + Df f is 0 for some f" if spec.augmented.Df.any() else "C B w is 0"
    able = cancellable(spec)
    others = f"cancel: [{', '.join(able)}], which can be, or " if able else ""
    return {
        "id": "OBS950",
        "condition": "rank C B",
        "reason": f"no E has T B = 0, T = I - E C: {ranks(spec)}; along {said} {seen}, and B w is not",
        "feasible": {"cancel": able} if able else {},
        "suggestion": f"{others}another measurement, or type l2, which bounds the gain from it",
        "proof": "exact",
        "certificate": {"kind": KIND, "w": w, "f": [str(x) for x in found[1]]},
    }


def cancellable(spec: Spec) -> list[str]:
    """Channels among those that are asked for which can be cancelled together, taken in their order."""
    kept: list[int] = []
    for k in request_of(spec).cancel:
        if transform.chosen(spec.augmented, [*kept, k]) is not None and spec.augmented.B[:, k].any():
            kept.append(k)
    return [spec.plant.exogenous[k] for k in kept]


def read(spec: Spec, file: ResultFile) -> Proof:
    """Prove anew that an infeasible result has no solution.

    Raises `UsageError`: the certificate is malformed.
    """
    root = ("diagnosis", "certificate")
    if file.at(*root, "kind") != KIND:
        proof = incremental.read(reduced(spec), file)
        return replace(proof, claim=f"{proof.claim}; {LEFT[request_of(spec).gains is not None]}")
    table = file.table(*root, "w")
    if table.keys() - set(spec.cancelled):
        raise file.wrong("diagnosis.certificate.w", "names a channel that is not cancelled", id="OBS702")
    zero = transform.exact_zeros(1, 1).item()
    w: Array = transform.exact_zeros(1, len(spec.cancelled))[0]
    for i, name in enumerate(spec.cancelled):
        w[i] = file.number(*root, "w", name) if name in table else zero
    f = file.stack((spec.augmented.Df.shape[1],), *root, "f")
    holds = transform.hides(spec.augmented, request_of(spec).cancel, w, f)
    check = Check("C B w + Df f = 0 and B w != 0", holds, 1.0 if holds else -1.0)
    known: dict[str, Any] = {"used": ("kind", "w", "f")}
    return Proof(f"no solution: no E has T B = 0, T = I - E C: {ranks(spec)}", (check,), **known)
