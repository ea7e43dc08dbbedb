"""Gains by descent on the least gamma that they are proved to achieve.

The least mu of gains is smooth where its dual solution is unique, and the dual gives its gradient (`Analysis.slope`).
With F = [A - L C, L; C A - C L C - H C, C L + H], dF = ([I; C] dL + [0; I] dH) [-C, I]; with J = I - K C, dJ = -dK C.
"""

import math
from collections.abc import Callable, Mapping

import numpy as np

from obsdesign.families.sporadic.clock.analysis import Slope
from obsdesign.lmi.formula import Float
from obsdesign.records import dataclass

Gains = Mapping[str, Float]
BARRIER = 1e-2  # weight of -log(1 - |L|^2 / kappa^2) beside log mu
SETTLED = 1e-4  # decrease of a step below which the descent ends
ARMIJO = 0.1  # part of the decrease that the slope promises, which a step must bring
SHORTEST = 1e-6  # part of a step that is tried
CURVED = 1e-12  # least curvature along a step, relative, of which the next one takes account


@dataclass(frozen=True)
class Injection:
    """Which gains are free, as a vector, and how mu depends on them.

    The vector holds diag(left) L diag(right), whose norm is bounded, and H in some units.
    """

    name: str  # dynamic, predictor, hold or reset
    C: Float
    left: Float  # (n,)
    right: Float  # (ny,)
    turn: Float  # (ny, ny), or broadcast to it

    @property
    def ny(self) -> int:
        """Number of outputs."""
        return len(self.C)

    def vector(self, gains: Gains) -> Float:
        """Free entries."""
        first = self.weighed(gains["K" if self.name == "reset" else "L"])
        return np.concatenate([first.ravel(), *([(gains["H"] * self.turn).ravel()] if self.name == "dynamic" else [])])

    def weighed(self, gain: Float) -> Float:
        """diag(left) gain diag(right)."""
        return self.left[:, None] * gain * self.right

    def bounded(self, x: Float) -> Float:
        """What is bounded of a vector."""
        return x[: self.C.size].reshape(-1, self.ny)

    def gains(self, x: Float) -> dict[str, Float]:
        """Gains of a vector."""
        first = self.bounded(x) / (self.left[:, None] * self.right)
        if self.name == "reset":
            return {"K": first}
        free = x[self.C.size :].reshape(-1, self.ny) / self.turn
        return {"L": first, "H": {"dynamic": free, "predictor": -self.C @ first}.get(self.name, 0 * np.eye(self.ny))}

    def gradient(self, slope: Slope) -> Float:
        """Gradient of mu with respect to the vector."""
        C, n, unit = self.C, self.C.shape[1], self.left[:, None] * self.right
        if self.name == "reset":
            return np.asarray((-(slope.jump @ C.T) / unit).ravel())
        across = slope.flow @ np.hstack([-C, np.eye(self.ny)]).T
        by_L, by_H = across[:n] + C.T @ across[n:], across[n:]
        if self.name == "predictor":
            by_L = by_L - C.T @ by_H
        turned = [(by_H / self.turn).ravel()] if self.name == "dynamic" else []
        return np.concatenate([(by_L / unit).ravel(), *turned])


def walled(L: Float, kappa: float) -> tuple[float, Float]:
    """Barrier -log(1 - |L|^2 / kappa^2) of the spectral norm, and its gradient; infinite outside."""
    u, s, vt = np.linalg.svd(L, full_matrices=False)
    room = 1 - (s[0] / kappa) ** 2
    if room <= 0:
        return math.inf, 0 * L
    return -math.log(room), 2 * s[0] / kappa**2 / room * np.outer(u[:, 0], vt[0])


def descend(
    function: Callable[[Float], tuple[float, Float]], x: Float, steps: int, B: Float | None = None
) -> tuple[Float, float, Float]:
    """Local minimum, or as near as so many steps come, by the method of Broyden, Fletcher, Goldfarb and Shanno.

    Values may be infinite: steps are halved until they bring part of what the slope promises. `B`: what stands for the
    inverse of the second derivative, of a minimum nearby; it is returned with the point and its value.
    """
    value, g = function(x)
    if not math.isfinite(value):
        steps = 0
    if B is None:
        B = np.eye(len(x)) * (np.linalg.norm(x) or 1.0) / (10 * (np.linalg.norm(g) or 1.0))
    for _ in range(steps):
        step = -B @ g
        promised, part = float(g @ step), 1.0
        if promised >= 0:
            break
        tried, slope = function(x + step)
        while not tried <= value + ARMIJO * part * promised and part > SHORTEST:
            part /= 2 if math.isfinite(tried) else 4
            tried, slope = function(x + part * step)
        if not tried < value:
            break
        s, y = part * step, slope - g
        x, gained, value, g = x + s, value - tried, tried, slope
        if gained < SETTLED:
            break
        if (curvature := float(s @ y)) > CURVED * np.linalg.norm(s) * np.linalg.norm(y):
            E = np.eye(len(x)) - np.outer(s, y) / curvature
            B = E @ B @ E.T + np.outer(s, s) / curvature
    return x, value, B
