"""What depends on a run of an observer that estimates constants: excitation, and guards that act; in doubles."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from obsdesign.families.algebraic.claim import Claim
from obsdesign.families.algebraic.estimator import LEAST
from obsdesign.families.algebraic.forms import Form
from obsdesign.families.algebraic.observer import beginning
from obsdesign.families.algebraic.scheme import Excitation
from obsdesign.lmi.formula import Array
from obsdesign.spec import Spec

WINDOWS = 10  # in a run: how long excitation has to last is told for a tenth of it


def report(spec: Spec, form: Form, t: Array, signals: Mapping[str, Array]) -> dict[str, Any]:
    """Where it began, and its excitation, at its steps t (M,) with the states of the observer (M,) by name.

    least_eigenvalue    of int sum psi psi' dt, over the whole run, and the least over a tenth of it
    delta_squared       int Delta^2 dt, of DREM: what it needs to grow without end
    largest_regressor   of |psi|, over the whole run and over its last tenth: psi has to stay bounded where it is said
    guard               how often exp(theta) has been kept from falling below its least value, for how long, and
                        whether it is at the end, where the estimate is not the one that was asked for
    """
    found, start = Claim.of(spec, form).scheme.excitation, beginning(spec, form)
    if found is None or len(t) < 2:
        return start
    excitation = {**gramian(found, t, signals), **memory(found, t, signals), "note": f"needed: {found.need}"}
    return {**start, "excitation": excitation, **guards(found, t, signals)}


def gramian(found: Excitation, t: Array, signals: Mapping[str, Array]) -> dict[str, Any]:
    """Least eigenvalues of the Gramian of the regressors."""
    still = np.zeros(len(t))
    rows = [np.array([signals[row[n]] if n in row else still for n in found.names]) for row in found.regressors]
    sizes = np.sqrt(sum((psi**2).sum(axis=0) for psi in rows))
    products = sum(np.einsum("im,jm->mij", psi, psi) for psi in rows)
    total = integrated(t, products)
    length = (t[-1] - t[0]) / WINDOWS
    starts = np.linspace(t[0], t[-1] - length, 10 * WINDOWS)
    windows = at(t, total, starts + length) - at(t, total, starts)
    return {
        "least_eigenvalue": float(np.linalg.eigvalsh(total[-1])[0]),
        "least_eigenvalue_of_a_window": float(np.linalg.eigvalsh(windows)[:, 0].min()),
        "window": float(length),
        "largest_regressor": float(sizes.max()),
        "largest_regressor_at_the_end": float(sizes[t >= t[-1] - length].max()),
    }


def memory(found: Excitation, t: Array, signals: Mapping[str, Array]) -> dict[str, Any]:
    """Integral of Delta^2."""
    if found.determinant is None:
        return {}
    names = sorted(found.determinant.names)
    delta = found.determinant.function(names)(*(signals[name] for name in names))
    return {"delta_squared": float(integrated(t, delta**2)[-1])}


def guards(found: Excitation, t: Array, signals: Mapping[str, Array]) -> dict[str, Any]:
    """How often each guard begins to act, and for which share of the run it does."""
    if not found.guarded:
        return {}
    told = {}
    for name in found.guarded:
        acts = signals[name] <= float(LEAST)
        begins = int(np.count_nonzero(acts[1:] & ~acts[:-1]) + acts[0])
        share = float(integrated(t, acts.astype(float))[-1] / (t[-1] - t[0]))
        told[name] = {"activations": begins, "share": share, "at_end": bool(acts[-1])}
    return {"guard": told}


def integrated(t: Array, values: Array) -> Array:
    """Integral from the start to each instant, by trapezoids."""
    steps = np.diff(t).reshape(-1, *[1] * (values.ndim - 1))
    parts = 0.5 * (values[1:] + values[:-1]) * steps
    return np.concatenate([np.zeros_like(values[:1]), np.cumsum(parts, axis=0)])


def at(t: Array, values: Array, times: Array) -> Array:
    """Values (M, ..) at other times, linear in between."""
    flat = values.reshape(len(t), -1)
    columns = [np.interp(times, t, column) for column in flat.T]
    return np.array(columns).T.reshape(len(times), *values.shape[1:])
