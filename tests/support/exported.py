"""Exported observers of shipped specs, and runs that they are held against."""

from functools import cache

import numpy as np
from flint import fmpq

import obsdesign as od
from obsdesign.exports.subject import Subject, subject_of
from obsdesign.exports.vectors import vectors
from obsdesign.expressions import parse
from obsdesign.families.observer import Observer
from obsdesign.stepping.implemented import Implemented
from obsdesign.stepping.machine import Machine
from obsdesign.work import trial
from support.shipped import FILTERS, SPECS, on, solved

OBSERVERS = on(  # spec, period, method: each method and time, loops, jumps, starts that depend on y, a filter
    ("pendulum-embedded", None, None),
    ("noisy-output", "1.0e-2", "exact"),
    ("corless2019-magnetic-bearing", "5.0e-6", "euler"),
    ("discrete-feedthrough", None, None),
    ("discrete-motor", None, None),
    ("discrete-battery", None, None),
    ("ferrante2019-oscillator-clock", "1.0e-2", "exact"),
    ("ferrante2019-oscillator-gap", "1.0e-2", "exact"),
    ("lost-packets", "1.0e-2", "rk4"),
    ("cuk-kkl-pebo", "1.0e-5", "rk4"),
    ("cuk-immersion", "1.0e-6", "rk4"),
    ("cuk-ekf", "1.0e-5", "rk4"),
    ("cuk-lqe", "1.0e-5", "rk4"),
    ("discrete-pendulum-ukf", None, None),
    ("saturated-spring", "1.0e-3", "rk4"),
    ("nonlinear-disturbance", "1.0e-2", "rk4"),
)
STATES = ("for", "class", "end", "lambda", "x", "y")
INPUTS = ("u", "s", "dt", "math", "out", "step", "self", "None", "newton", "_", "int", "double", "function", "NULL")


@cache
def hostile():
    """Design for a plant whose names mean something in the languages of the targets."""
    A = (-np.eye(6) + 0.1 * np.eye(6, k=1)).tolist()
    first = [1, 0, 0, 0, 0, 0]
    gx = [" + ".join(INPUTS), "0", "0", "0", "0", "0"]
    system = {"states": STATES, "inputs": INPUTS, "outputs": ["return"], "A": A, "B": first, "C": first, "gx": gx}
    steps = {"period": 0.01, "method": "rk4"}
    return od.solve(
        od.Spec(system=system, observer={"type": "l2", "alpha": 0.1, "bounds": {"L1": 10}}, implementation=steps)
    )


FUNCTIONS = (
    "sin(u)", "cos(u)", "tan(u)", "asin(u/3)", "acos(u/3)", "atan(u)", "sinh(u)", "cosh(u)", "tanh(u)", "exp(u)",
    "log(1 + u*u)", "sqrt(2 + u)", "abs(u)", "sign(u)", "sat(u)", "min(u, 1, v)", "max(u, -1, v)", "atan2(u, v)",
    "where(u > 0, log(u), v)", "where(u >= v, sqrt(u - v), -1)", "(2 + u)**1.7", "v**4", "(u - v)**2", "(u - v)**3",
    "u**2", "v**3", "pi*u", "1/(1 + exp(-1000*u))", "(u < v)*(u != 1)*v", "-u*v/(3 + u)/2 - (u - (v - u))",
    "where((u == 1) + (v <= 1), u, -v)", "where(u < 0, -u**2, u**0.5)/-7", "where(abs(u) > 1, u, acos(u))",
    # infinite on the way where u = v
    "1/(1 + 1/(u - v))", "max(u, log(abs(u - v)))", "exp(-1/(u - v)**2)", "tanh(log(abs(u - v)))",
    "1/(1 + (u - v)**-3)", "min(v, abs(u - v)**-0.5)", "atan(exp(1000*abs(u))*exp(abs(v)))",
    "1/(1 + (1000 + u)**(1000 + v))",
)  # fmt: skip


def functions():
    """Something whose estimates are all functions of the trade, of its inputs u and v."""
    estimates = {f"e{i}": parse(text, ("u", "v")) for i, text in enumerate(FUNCTIONS)}
    alone = Observer({}, estimates, ("u", "v"), ("y",))
    return Subject("functions", Implemented(alone, fmpq(1), "", (), np.zeros(0)), ("all functions",), {})


@cache
def design_of(name):
    """Design of a shipped spec."""
    return trial(SPECS / f"{name}.yaml") if name in FILTERS else solved(name)[1]


@cache
def subject(name, period=None, method=None):
    """What is exported of it, and the vectors of its simulation."""
    design = design_of(name)
    with design.spec.placed():
        made = subject_of(design, "", period, method, single=False)
        return made, vectors(design, made)


def xhat0_of(made):
    """An estimate at the start that is not that of the spec."""
    n = len(made.implemented.plant_states)
    return (np.array(made.implemented.xhat0, dtype=float)[:n] + 0.01 * np.arange(1, n + 1)).tolist()


def played(observer, made, rows):
    """Estimates of the rows by an observer with the methods of the interface, after the measurement of each row."""
    found = []
    for k, (t, u, y, on_) in enumerate(zip(rows.t, rows.u, rows.y, rows.on, strict=True)):
        if rows.measured[k]:
            observer.jump(t, u, y)
        found.append(np.array(observer.estimate(t, u, y)))
        if k + 1 == len(rows.t):
            break
        if made.ahead:
            observer.step(t, np.concatenate([u, rows.u[k + 1]]), rows.y[k + 1])
        elif not made.instants:
            observer.step(t, u, y)
        elif abs(on_ - made.period) < 1e-9 * made.period:
            observer.step(t, u, None)
        else:
            observer.flow(t, on_, u)
    return np.array(found)


class Reference(Machine):
    """The observer of the simulator, with the methods of the interface."""

    def step(self, t, u, y):
        super().step(t, u, () if y is None else y)

    def flow(self, t, dt, u):
        self.part(t, dt, u, ())


def deviation(found, expected):
    """Largest difference of estimates, relative to the size of each."""
    return (np.abs(found - expected) / np.maximum(np.abs(expected).max(axis=0), 1e-12)).max()


def steps_of(name):
    """Steps in which a shipped observer is exported in a sweep: a part of the largest with which rk4 is stable."""
    design = design_of(name)
    if design.spec.period is not None or design.spec.implementation is not None:
        return None, None
    largest = (design.analysis.get("largest_step") or {}).get("rk4") if design.gains else None
    return f"{largest / 20:.3g}" if largest else "1.0e-5", "rk4" if largest else "exact"
