"""What the gains of an observer are proved to achieve."""

from dataclasses import dataclass

from obsdesign.lmi.formula import Array


@dataclass(frozen=True)
class Reconstruction:
    """limsup |what - w| <= w |w|_inf + w_rate |w'|_inf + x_rate |x'|_inf, for what = pinv(B) L1 (yhat - y).

    The storage functions e' P_i e of its levels are at most e' P e, and decay at the rate alpha at least: before the
    limit, (w |e|_P + w_rate |de/dt|_P) exp(-alpha t) is added, with e and its derivative at t = 0.
    """

    w: float
    w_rate: float  # s
    x_rate: float
    alpha: float  # 1/s
    P: Array  # (n, n)


@dataclass(frozen=True)
class Guarantee:
    """What holds along the error equations, with V = e' P e.

    Families l2 and lipschitz: V' + 2 alpha V + mu1 |z|^2 - mu2 |v|^2 <= 0, and gamma^2 = mu2 / mu1; for lipschitz
    mu1 = 1, alpha is the decay, and where that is zero the inequality is strict. Family linf:
    V' <= -2 alpha (V - mu1 |v|^2) and |z|^2 <= mu2 V, and gamma^2 = mu1 mu2.
    """

    gamma: float
    alpha: float
    mu1: float
    mu2: float
    P: Array  # (n, n), positive definite
    family: str = "l2"
    reconstruction: Reconstruction | None = None


@dataclass(frozen=True)
class SporadicGuarantee:
    """What holds of an observer whose measurements arrive sporadically, T1 <= t_{k+1} - t_k <= T2.

    With the error eps = z - zhat, theta~ = C eps - theta, and the time tau that is left to the next measurement,

        V = eps' P1 eps + exp(delta tau) theta~' P2 theta~

    satisfies V' <= -2 decay V - |yp|^2 + gamma^2 |w|^2 between measurements, and V+ <= V + exp(delta tau) eta' P2 eta
    at each, where eta is its noise. This is Theorem 2 of Ferrante, Gouaisbaut, Sanfelice and Tarbouriech on L2 state
    estimation in the presence of sporadic measurements. T1 plays a part in the bound on the effect of noise only.
    """

    gamma: float
    decay: float  # 1/s
    delta: float  # 1/s
    T1: float  # s
    T2: float  # s
    P1: Array  # (n, n), positive definite
    P2: Array  # (ny, ny), positive definite
