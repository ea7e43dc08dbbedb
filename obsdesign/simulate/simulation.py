"""Try an observer on the scenario of a spec."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from obsdesign.errors import UsageError
from obsdesign.lmi.formula import Array, in_floats
from obsdesign.observers.guarantee import Guarantee
from obsdesign.simulate.coupled import Coupled
from obsdesign.simulate.integrate import Tolerance, Trajectory, Vector, finite, integrate
from obsdesign.simulate.run import Run, Samples
from obsdesign.simulate.scenario import Scenario, scenario
from obsdesign.simulate.summary import Errors, bounds, convergence, norm_to_infinity, storage
from obsdesign.spec.model import Simulation, Spec

RTOL = 1e-8
RTOL_NOISE = 1e-6  # every noise sample is a restart, and more digits would be digits of the noise
ATOL = 1e-12  # of the size of a state at the start


def simulate(
    spec: Spec,
    gains: Mapping[str, Array],
    guarantee: Guarantee | None,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Simulate the plant of a spec with the observer (12) of Corless and Chakrabarty (2019).

    xihat' = A xihat + Bf f(t, y, qhat) + gx + L1 (yhat - y)
    qhat   = Cq xihat + Dqf f(t, y, qhat) + gq + L2 (yhat - y)
    yhat   = C xihat + Df f(t, y, qhat) + gy

    Parameters
    ----------
    spec
        With a `simulation` section.
    gains
        L1 (n + nm, ny) and L2 (nq, ny), in doubles.
    guarantee
        What the gains are proved to achieve; None leaves the bounds out.
    progress
        Called now and then with the fraction that is done.

    Returns
    -------
    Run
        Up to the horizon, or to an escape or a stall, with its summary.

    Raises
    ------
    UsageError
        If the spec has no `simulation`, a nonlinearity no f, or a signal no value at t = 0.
    """
    simulation = spec.simulation
    if simulation is None:
        raise UsageError("the spec has no `simulation` section: give at least horizon, x0, and w or v")
    acting = scenario(spec, simulation)
    system = Coupled(spec, acting, gains, guarantee)
    breaks = acting.breaks([term.expression for term in system.observer.stack.terms])
    start = initial(system, simulation)
    trajectory = integrate(
        system.flow(),
        start,
        acting.segments(breaks, len(start)),
        np.linspace(0, simulation.horizon, simulation.points),
        tolerance(start, system),
        progress and (lambda t: progress(t / simulation.horizon)),
    )
    uncovered = why_not_covered(acting, guarantee, breaks)
    covering = None if uncovered else guarantee
    return Run(
        **vars(samples(spec, system, covering, trajectory.t, trajectory.s)),
        steps=samples(spec, system, covering, trajectory.path_t, trajectory.path_s),
        states=acting.plant.states,
        plant_states=acting.n,
        exogenous=spec.plant.exogenous,
        estimated=estimated(spec),
        outputs=acting.plant.outputs,
        status=trajectory.status,
        time=trajectory.time,
        summary=summarise(spec, system, trajectory, guarantee, uncovered),
    )


def initial(system: Coupled, simulation: Simulation) -> Vector:
    """Return the initial state of the flow, where every signal and nonlinearity must have a value."""
    try:
        with np.errstate(all="ignore"):
            start = finite(system.start(simulation.x0, simulation.xhat0))
            finite(system.rhs(0.0, start, system.scenario.held(0.0)))
    except ArithmeticError as error:
        raise UsageError(
            f"simulation: at t = 0 a signal, the v that w needs, or a nonlinearity has no value: {error}"
        ) from error
    return start


def tolerance(start: Vector, system: Coupled) -> Tolerance:
    """Tolerance of a step; the absolute one goes by the size of each state and its estimate at the start."""
    n, ns = system.scenario.plant.n, system.ns
    size = np.abs(start[ns : ns + n])
    size[:ns] = np.maximum(size[:ns], np.abs(start[:ns]))
    nonzero = size[size > 0]
    size[size == 0] = nonzero.min() if len(nonzero) else 1.0
    integrals = np.full(len(start) - ns - n, size.max() ** 2)
    absolute = ATOL * np.concatenate((size[:ns], size, integrals))
    return Tolerance(RTOL_NOISE if system.scenario.noise.any() else RTOL, absolute)


def why_not_covered(acting: Scenario, guarantee: Guarantee | None, breaks: list[tuple[float, float]]) -> str:
    """Why no bound can be stated, or nothing."""
    if guarantee is None:
        return "no guarantee: the gains are not certified"
    if acting.unmodeled:
        return acting.unmodeled
    if acting.noise.any():
        return "the guarantee does not cover simulation.noise, which no v generates"
    impulse = next((after for before, after in breaks if acting.steps_of_xm(before, after).any()), None)
    if impulse is not None:
        return f"w jumps at t = {impulse:.6g}, so that the v that generates it is not square integrable"
    return ""


def samples(spec: Spec, system: Coupled, guarantee: Guarantee | None, t: Array, s: Array) -> Samples:
    """States of the flow in the terms of the spec; V only where a guarantee covers the run."""
    acting, generator, seen = system.scenario, in_floats(spec.generator), system.outputs(t, s)
    channels, errors = estimated(spec), errors_of(system, t, s)

    def modeled(xi: Array, f2: Array) -> Any:
        """Output of the disturbance model without the direct v."""
        return xi[:, acting.n :] @ generator.Cm.T + f2 @ generator.Dwf.T

    direct = seen.v if acting.unmodeled else seen.v @ generator.Dm.T
    V, V_bound = storage(errors, guarantee) if guarantee else (None, None)
    return Samples(
        t=t,
        xi=seen.xi[:, : errors.e.shape[1]],
        xihat=seen.xi + seen.e,
        e=errors.e,
        w=direct if acting.unmodeled else modeled(seen.xi, seen.f2) + direct,
        what=modeled(seen.xi + seen.e, seen.f2hat)[:, channels],
        w_error=(modeled(seen.e, seen.f2hat - seen.f2) - direct)[:, channels],
        y=seen.y,
        v=None if acting.unmodeled else seen.v,
        z=errors.e @ system.H[:, : errors.e.shape[1]].T if has_z(spec, acting) else None,
        V=V,
        V_bound=V_bound,
    )


def estimated(spec: Spec) -> tuple[int, ...]:
    """Channels of w that the observer estimates: those without a direct v."""
    return tuple(np.flatnonzero(~(spec.generator.Dm != 0).any(axis=1)).tolist())


def has_z(spec: Spec, acting: Scenario) -> bool:
    """Whether z = H e has a true value: not if it needs an xm that has none."""
    return not (acting.unmodeled and (spec.H[:, acting.n :] != 0).any())


def errors_of(system: Coupled, t: Array, s: Array) -> Errors:
    """Error and integrals in states of the flow; without a true xm only the error of the plant's states."""
    acting = system.scenario
    width = acting.n if acting.unmodeled else acting.plant.n
    return Errors(t, s[:, system.ns : system.ns + width], s[:, -3], s[:, -2], s[:, -1])


def summarise(
    spec: Spec, system: Coupled, trajectory: Trajectory, guarantee: Guarantee | None, uncovered: str
) -> dict[str, Any]:
    """Everything that is said about a run; None where a quantity does not apply."""
    acting = system.scenario
    errors = errors_of(system, trajectory.path_t, trajectory.path_s)
    z = float(np.sqrt(errors.z2[-1])) if has_z(spec, acting) else None
    v = None if acting.unmodeled else float(np.sqrt(errors.v2[-1]))
    return {
        "status": trajectory.status,
        "time": trajectory.time,
        "reason": trajectory.reason or None,
        "z_norm2": z,
        "v_norm2": v,
        "v_norm2_infinite": norm_to_infinity(acting.v, trajectory.time, errors.v2[-1]) if v is not None else None,
        "ratio": z / v if z is not None and v else None,
        "gamma": guarantee.gamma if guarantee else None,
        "bounds": bounds(errors, guarantee) if guarantee and not uncovered else [],
        "bounds_omitted": uncovered or None,
        **convergence(errors, acting.plant.states),
    }
