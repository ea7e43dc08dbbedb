"""Nonlinearities without an upper slope bound: f = K q is one of them for every K >= 0, which costs two conditions."""

import numpy as np

from obsdesign.dissipation.inequality import Incremental
from obsdesign.families.finding import described
from obsdesign.families.outcome import Diagnosis
from obsdesign.lmi.formula import Array, Float
from obsdesign.model.multiplier import Scaled
from obsdesign.model.pencil import text
from obsdesign.model.plant import Plant
from obsdesign.model.structure import Mode, stiff_modes
from obsdesign.spec import Spec
from obsdesign.tables.text import matrix_text

ROUNDING = 1e-12  # relative
QUIET = "bound the slope of f, or leave noise out of y (D = 0)"
BOUND = "bound the slope of f: C Bf = 0, so no L2 changes (Cq + L2 C) Bf"


def steep_blocks(family: Incremental, *, wider: bool = False) -> list[tuple[int, Scaled, slice, slice]]:
    """Blocks with M11 = M22 = 0 that act on x: number, block, components of q and of f.

    `wider`: those with any M11 >= 0 as well, whose classes contain that of M11 = 0.
    """
    q, f = 0, 0
    found: list[tuple[int, Scaled, slice, slice]] = []
    for i, block in enumerate(family.multiplier.blocks):
        rows, columns = slice(q, q + block.nq), slice(f, f + block.nf)
        q, f = rows.stop, columns.stop
        if not isinstance(block, Scaled) or block.M22.any() or (block.M11.any() and not wider):
            continue
        if block.M12.any() and family.plant.Bf[:, columns].any():
            found.append((i, block, rows, columns))
    return found


def stiff_blocks(family: Incremental, *, wider: bool = False) -> list[tuple[int, Scaled, slice, slice]]:
    """Those of them that no loop and no output involves."""
    through = np.vstack([family.plant.Dqf, family.plant.Df])
    return [found for found in steep_blocks(family, wider=wider) if not through[:, found[-1]].any()]


def rising(family: Incremental) -> bool:
    """Whether every block has one scale, and some a smallest slope above zero and no largest: M22 = 0, M11 not >= 0."""
    blocks = family.multiplier.blocks
    return all(isinstance(b, Scaled) for b in blocks) and any(
        isinstance(b, Scaled) and not b.M22.any() and np.linalg.eigvalsh(b.M11).min(initial=0.0) < 0 for b in blocks
    )


def may_rest(family: Incremental) -> bool:
    """Whether f = 0 is in every class, so that the inequalities hold along errors that only some blocks act on."""
    blocks = family.multiplier.blocks
    return all(isinstance(b, Scaled) and np.linalg.eigvalsh(b.M11).min(initial=0.0) >= 0 for b in blocks)


def failing_passivity(spec: Spec, family: Incremental) -> Diagnosis | None:
    """Blocks with M22 = M11 = 0 force P Bf + lambda M12' (Cq + L2 C) .. = 0, and with it three necessary conditions.

    With G = Cq + L2 C, P Bf + lambda G' M12 = 0 and P > 0:

    - the row of f has a zero on the diagonal, so M12' (Dq + L2 D) = 0, which noise in every output makes the only L2;

    - Bf' P Bf > 0 needs M12' G Bf < 0 (in its symmetric part, as below), and so lambda > 0;
    - where C Bf = 0, the error e = Bf d is not corrected by any L1, and e' P (A + alpha I) e <= 0 there needs
      M12' G (A + alpha I) Bf >= 0.

    Bf must have full column rank, and M12 an inverse; nothing is said otherwise, nor where L2 is free, not forced, and
    has an effect.
    """
    p, alpha = family.plant, float(family.rate)
    for i, block, rows, columns in stiff_blocks(family):
        Bf = p.Bf[:, columns]
        if np.linalg.matrix_rank(Bf) < Bf.shape[1] or np.linalg.matrix_rank(block.M12) < len(block.M12):
            continue
        steep = f"{block_name(spec, i)} has no upper slope bound"
        quiet, forced = silent_injection(p, rows)
        if quiet is None:
            return noisy(f"{steep}, so Dq + L2 D = 0 must hold, and no L2 makes it so: v reaches its argument at once")
        fixed, hidden = forced or family.L2 is not None, not (p.C @ Bf).any()
        given = quiet if forced or family.L2 is None else family.L2[rows]
        if not fixed and not hidden:
            continue
        must = f"{steep}, so the inequality needs P Bf + lambda (Cq + L2 C)' = 0 with P > 0 and lambda >= 0"
        if forced:
            must += f", and Dq + L2 D = 0, where the noise in y leaves only L2 = {matrix_text(given.tolist())}"
        G = p.Cq[rows] + given @ p.C
        largest = extreme(block.M12.T @ G @ Bf)
        if largest >= 0:
            return {
                "id": "OBS605",
                "condition": "passivity",
                "reason": f"{must}; that needs (Cq + L2 C) Bf < 0, and here that is {shown(largest, Bf)}",
                "value": largest,
                "feasible": {},
                "suggestion": BOUND if hidden else QUIET if forced else "(Cq + L2 C) Bf < 0 is necessary",
            }
        smallest = -extreme(-block.M12.T @ G @ (p.A @ Bf + alpha * Bf))
        if fixed and hidden and may_rest(family) and smallest < 0:
            found = slow_injection(must, family, block, rows, columns, smallest)
            return {**found, "feasible": {}, "suggestion": QUIET} if forced else found
        if family.L2 is not None and not vanishes(p.Dq[rows], family.L2[rows] @ p.D):
            found = noisy(f"{steep}, so Dq + L2 D = 0 must hold, which noise in y breaks for this L2")
            return {
                **found,
                "suggestion": f"L2 = {matrix_text(quiet.tolist())} is necessary" if forced else "look at another L2",
            }
    return None


def silent_injection(plant: Plant[Float], rows: slice) -> tuple[Array | None, bool]:
    """L2 of some components of q with Dq + L2 D = 0, None if there is none, and whether it is the only one."""
    D, Dq = plant.D, plant.Dq[rows]
    L2 = -np.linalg.lstsq(D.T, Dq.T, rcond=None)[0].T + 0.0
    return (L2 if vanishes(Dq, L2 @ D) else None), bool(np.linalg.matrix_rank(D) == len(D))


def vanishes(a: Array, b: Array) -> bool:
    """Whether a + b is zero up to rounding."""
    return bool((abs(a + b) <= ROUNDING * np.maximum(abs(a), abs(b)).max(initial=0)).all())


def noisy(reason: str) -> Diagnosis:
    """Answer that what v does at once to the argument of a steep f, or to y, is in the way."""
    return {"id": "OBS606", "condition": "noise", "reason": reason, "feasible": {}, "suggestion": QUIET}


def slow_injection(
    must: str, family: Incremental, block: Scaled, rows: slice, columns: slice, smallest: float
) -> Diagnosis:
    """Answer that the errors along Bf, which y does not show at once, decay too slowly."""
    p, alpha = family.plant, float(family.rate)
    Bf, Cq = p.Bf[:, columns], p.Cq[rows]
    needed = "(Cq + L2 C)(A + alpha I) Bf >= 0"
    found: Diagnosis = {"id": "OBS605", "condition": "passivity", "value": smallest, "feasible": {}}
    if Bf.shape[1] == 1 and p.C.shape[0] == 1 and (gain := (block.M12.T @ p.C @ p.A @ Bf).item()):
        constant, slope = (-(block.M12.T @ Cq @ X).item() / gain for X in (p.A @ Bf, Bf))
        side, bound = ("<=" if gain < 0 else ">="), constant + slope * alpha
        needed += f", that is L2 {side} {affine(constant, slope)}"
        found["feasible"] = {f"L2_{'most' if gain < 0 else 'least'}": bound + 0.0}
        found["suggestion"] = f"L2 {side} {bound + 0.0:g} is necessary"
    else:
        found["suggestion"] = "look at another L2, or a smaller alpha"
    mode = slowest(family)
    limit = f"; and {allowed(mode)}: {remaining(mode)}" if mode else ""
    here = f"here (Cq + L2 C)(A + alpha I) Bf is {shown(smallest, Bf)}"
    found["reason"] = f"{must}; y does not show an error along Bf, which decays only if {needed}; {here}{limit}"
    return found


def slowest(family: Incremental) -> Mode | None:
    """Slowest mode that remains where df is whatever keeps dq at zero, whatever the gains: see `stiff_modes`."""
    blocks = stiff_blocks(family, wider=True)
    if not blocks or not may_rest(family):
        return None
    q = np.concatenate([np.r_[rows] for _, _, rows, _ in blocks])
    f = np.concatenate([np.r_[columns] for _, _, _, columns in blocks])
    return next(iter(stiff_modes(family.plant, q, f)), None)


def remaining(mode: Mode) -> str:
    """Mode in words."""
    along = ", ".join(name for name, entry in mode.along if abs(entry) >= 0.01)
    return f"the mode lambda = {text(mode.eigenvalue)} along {along} remains for steep slopes whatever the gains"


def allowed(mode: Mode) -> str:
    """Decay rates that a mode allows, in words."""
    limit = -mode.eigenvalue.real
    return f"alpha <= {limit:g}" if limit > 0 else "no alpha > 0"


def too_stiff(family: Incremental) -> Diagnosis | None:
    """Modes that remain for steep slopes and are slower than alpha."""
    mode, alpha = slowest(family), float(family.rate)
    if mode is None or -mode.eigenvalue.real >= alpha:
        return None
    limit = -mode.eigenvalue.real
    return {
        "id": "OBS605",
        "condition": "zero dynamics",
        "reason": f"{remaining(mode)}, because a nonlinearity has no upper slope bound: it allows {allowed(mode)}, and "
        f"alpha = {alpha:g} was asked for",
        "mode": described(mode),
        "feasible": {"alpha": limit} if limit > 0 else {},
        "suggestion": f"alpha at most {limit:g} is necessary"
        if limit > 0
        else "look at a bound on the slope, or another measurement",
    }


def extreme(X: Array) -> float:
    """Largest eigenvalue of the symmetric part."""
    return float(np.linalg.eigvalsh(X + X.T).max()) / 2


def shown(value: float, Bf: Array) -> str:
    """Write a number, or what it is of a matrix."""
    return f"{value:g}" if Bf.shape[1] == 1 else f"a matrix with the eigenvalue {value:g}"


def affine(constant: float, slope: float) -> str:
    """Write constant + slope alpha."""
    product = {1.0: "alpha", -1.0: "-alpha"}.get(slope, f"{slope:g} alpha")
    if not constant:
        return product if slope else "0"
    if not slope:
        return f"{constant:g}"
    return f"{constant:g} {'-' if slope < 0 else '+'} {product.removeprefix('-')}"


def block_name(spec: Spec, index: int) -> str:
    """Nonlinearity that block `index` of the multiplier belongs to."""
    owners = [n for n in spec.nonlinearities for _ in n.multiplier.blocks]
    owner = owners[index]
    return f"{owner.term or f'nonlinearities[{spec.nonlinearities.index(owner)}]'} ({owner.type})"
