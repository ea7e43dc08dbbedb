"""The stationary Kalman filter (`lqe`): a constant gain, from the Riccati equation of the plant at one point.

Its prediction is the plant itself and not the linear one, as in the constant gain extended Kalman filter of Safonov and
Athans (1978), so that of a linear plant it is what the extended filter becomes in the end.
"""

from typing import Any

import numpy as np

from obsdesign.errors import InfeasibleError, Problem, UsageError
from obsdesign.expressions import Expression
from obsdesign.families.filters.extended import corrected, moved
from obsdesign.families.filters.frame import Frame
from obsdesign.families.filters.symbols import jacobian, numbers, times
from obsdesign.families.observer import Observer, Supposed
from obsdesign.lmi.formula import Array
from obsdesign.model.structure import Mode, modes
from obsdesign.records import dataclass

MARGIN = 1e-9  # of the size of A: a mode that is nearer to the edge of stability lies on it


@dataclass(frozen=True)
class Linear:
    """The plant at a point, and the noise that drives it: x' = A x + B w or x+ = .., y = C x + D w + v."""

    A: Array
    B: Array
    C: Array
    D: Array
    Q: Array
    R: Array
    states: tuple[str, ...]
    sampled: bool

    @property
    def S(self) -> Array:
        """Intensity, or covariance, of the noise of y, that of w included."""
        return np.asarray(self.R + self.D @ self.Q @ self.D.T)

    @property
    def covariance(self) -> Array:
        """Stabilising solution P of the Riccati equation, 0 = A P + P A' + B Q B' - K S K' or P = A P A' + ...

        Raises `InfeasibleError`: there is none.
        """
        from scipy.linalg import solve_continuous_are, solve_discrete_are

        if why := self.obstacle:
            raise self.failed(why)
        solve = solve_discrete_are if self.sampled else solve_continuous_are
        shared = self.B @ self.Q @ self.D.T
        try:
            P: Array = solve(self.A.T, self.C.T, self.B @ self.Q @ self.B.T, self.S, s=shared)
        except (np.linalg.LinAlgError, ValueError) as error:
            raise self.failed(str(error).splitlines()[0].lower()) from None
        if not self.left(self.A - self.predictor(P) @ self.C):
            raise self.failed("the gain that was found leaves a mode that does not decay")
        return P

    def predictor(self, P: Array) -> Array:
        """Gain K of the innovation in x' or in x+."""
        S = self.S + (self.C @ P @ self.C.T if self.sampled else 0)
        before = self.A @ P if self.sampled else P
        return np.asarray(np.linalg.solve(S, (before @ self.C.T + self.B @ self.Q @ self.D.T).T).T)

    def left(self, A: Array) -> bool:
        """Whether all modes decay."""
        found = np.linalg.eigvals(A)
        return bool((np.abs(found) < 1).all() if self.sampled else (found.real < 0).all())

    @property
    def obstacle(self) -> str:
        """Why no solution is stabilising: a mode that y does not show, or one at the edge that w does not reach."""
        hidden = [one for one in modes(self.A, self.C, self.states) if self.beyond(one) >= -MARGIN * self.size]
        if hidden:
            return f"{hidden[0].sentence}, and it does not decay: it is undetectable"
        gain = self.B @ self.Q @ self.D.T @ np.linalg.inv(self.S)
        rest = self.Q - self.Q @ self.D.T @ np.linalg.solve(self.S, self.D @ self.Q)
        reach = self.B @ rest @ self.B.T
        idle = modes((self.A - gain @ self.C).T, reach, self.states)
        if still := [one for one in idle if abs(self.beyond(one)) <= MARGIN * self.size]:
            value = still[0].eigenvalue
            where = f"{value:.4g}" if value.imag else f"{value.real + 0.0:.4g}"
            names = ", ".join(name for name, entry in still[0].along if abs(entry) >= 0.01)
            cure = "give Q or B an entry that drives it"
            return f"the mode lambda = {where} of {names} is not reached by the w of Q: {cure}"
        return ""

    @property
    def size(self) -> float:
        """Size of A."""
        return 1.0 if self.sampled else max(float(np.abs(self.A).max(initial=0.0)), 1e-300)

    def beyond(self, mode: Mode) -> float:
        """How far a mode is beyond the edge of stability."""
        return abs(mode.eigenvalue) - 1 if self.sampled else mode.eigenvalue.real

    @staticmethod
    def failed(why: str) -> InfeasibleError:
        """Error with a reason."""
        said = f"the Riccati equation of lqe has no stabilising solution: {why}"
        return InfeasibleError(Problem(said, key="observer.type", id="OBS940"))


def linear(frame: Frame) -> Linear:
    """Plant of a frame at the point `at`: xhat0 where it says nothing, u = 0, w = 0, t = 0, y as it is there.

    Raises `UsageError`: a slope is not finite there.
    """
    spec, request = frame.spec, frame.request
    begin = spec.simulation.xhat0 if spec.simulation else np.zeros(len(frame.x))
    point = {
        "t": 0.0,
        **dict.fromkeys((*spec.inputs, *frame.w), 0.0),
        **dict(zip(frame.x, map(float, begin), strict=True)),
    }
    point |= request.at
    names = tuple(point)

    def at(side: Expression) -> float:
        return float(side.scalar(names)(*(point[name] for name in names)))

    point |= {name: at(frame.h[name]) for name in frame.y}
    names = tuple(point)

    def slopes(of: Any, by: tuple[str, ...]) -> Array:
        entries = jacobian(of, by, {})
        return np.array([[at(entry) for entry in row] for row in entries], dtype=float).reshape(entries.shape)

    A, B, C, D = (slopes(of, by) for of in (frame.f, frame.h) for by in (frame.x, frame.w))
    if not all(np.isfinite(part).all() for part in (A, B, C, D)):
        said = "the plant has no finite slopes where it is linearised; name another point: at: {x1: 1}"
        raise UsageError(Problem(said, key="observer.at", id="OBS941"))
    return Linear(A, B, C, D, request.Q, request.R, frame.x, spec.period is not None)


def of_flow(frame: Frame) -> Observer:
    """Stationary Kalman filter in continuous time, of a plant x' = f(t, x, u, w, y), y = h(t, x, u, w) + v.

    xhat' = f(t, xhat, u, 0, y) + K (y - h(t, xhat, u, 0)),    K = (P C' + B Q D') S^-1,    S = R + D Q D'
    0     = A P + P A' + B Q B' - K S K'                       A, B, C, D: slopes of f and h at one point

    Raises `InfeasibleError`: no solution P makes A - K C stable.
    """
    plant = linear(frame)
    P = plant.covariance
    K = numbers(plant.predictor(P))
    yhat = {frame.hats[name]: frame.copy.outputs[frame.hats[name]] for name in frame.y}
    return frame.of_flow(corrected(frame, K), yhat, {}, Supposed(numbers(plant.C @ P @ plant.C.T), plant.S))


def of_samples(frame: Frame) -> Observer:
    """Stationary Kalman filter in discrete time, of a plant x+ = f(t, x, u, w, y), y = h(t, x, u, w) + v.

    corrected   (x, w)(k|k) = (xhat, 0) + K (y - h(t, xhat, u, 0)),  K = [P C'; Q D'] S^-1,  S = C P C' + D Q D' + R
    predicted   xhat+       = f(t, x(k|k), u, w(k|k), y)
                P           = A P A' + B Q B' - L S L',  L = [A B] K         A, B, C, D: slopes of f and h at one point

    Raises `InfeasibleError`: no solution P makes A - L C stable.
    """
    plant = linear(frame)
    P = plant.covariance
    S = plant.S + plant.C @ P @ plant.C.T
    K = numbers(-np.linalg.solve(S, np.hstack([plant.C @ P, plant.D @ plant.Q])).T)
    prior, both = frame.prior, (*frame.x, *frame.w)
    missing = np.array([frame.measured([frame.h[name].substituted(prior) for name in frame.y])], dtype=object).T
    posterior = moved(frame, both, prior, list(times(K, missing)[:, 0]))
    steps = {frame.hats[name]: frame.f[name].substituted(posterior) for name in frame.x}
    return frame.of_samples(steps, posterior, {}, numbers(S))
