"""An observer as a system of python-control, in continuous time or in samples."""

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from flint import fmpq

from obsdesign.errors import UsageError
from obsdesign.families.observer import Observer
from obsdesign.lmi.formula import Float
from obsdesign.model.equations import Named
from obsdesign.stepping.machine import compiled
from obsdesign.stepping.routine import routine

if TYPE_CHECKING:
    from control import NonlinearIOSystem

Function = Callable[[float, Float, Float, Any], Float]  # of t, the state, the inputs and parameters, of which none is


def to_control(observer: Observer, period: fmpq | None, name: str) -> "NonlinearIOSystem":
    """System with the inputs u and y, the states of an observer, and its estimates as outputs, `hat_` before each.

    s' = f(t, s, u, y), xhat = h(t, s, u, y); of a plant in samples, s+ = f and dt = period, s.

    Raises `UsageError`: python-control is not installed, or the observer has no such equations, since it jumps at
    measurements or an estimate knows y of its own sample.
    """
    if observer.jump or observer.following:
        why = "its state jumps at measurements" if observer.jump else "its estimate of a sample knows y of that sample"
        raise UsageError(f"no system of python-control: {why}; export it as code", id="OBS922")
    try:
        from control import NonlinearIOSystem
    except ImportError:
        raise UsageError("python-control is not installed; pip install 'obsdesign[control]'", id="OBS922") from None
    return NonlinearIOSystem(
        function(observer, observer.dynamics) if observer.states else None,
        function(observer, observer.estimates),
        inputs=[*observer.inputs, *observer.outputs],
        outputs=[f"hat_{estimate}" for estimate in observer.estimates],
        states=list(observer.states),
        dt=0 if period is None else float(period.p) / float(period.q),
        name=re.sub(r"\W", "_", name),
    )


def function(observer: Observer, results: Named) -> Function:
    """Right sides, or estimates, as python-control calls them."""
    names = ("t", *observer.states, *observer.inputs, *observer.outputs)
    made = routine(names, observer.algebraic, results)
    places, value = [names.index(known) for known in made.given], compiled(made)

    def of(t: float, s: Float, inputs: Float, _: Any) -> Float:
        known = (t, *s, *inputs)
        return np.array(value([float(known[i]) for i in places]))

    return of
