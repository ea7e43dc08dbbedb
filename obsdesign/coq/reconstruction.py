"""The bound on a reconstructed input of a linear plant, as a theorem of Coq.

With what = Bi L1 (yhat - y), Bi B = I, it is what - w = Bi e' - Bi A e, so that

    |what - w| <= c_w sup|w| + c_rate sup|w'| + what is left of two storage functions,

one for Bi A e, driven by w, and one for Bi e', driven by w'.
"""

from flint import fmpq

from obsdesign.coq.congruence import congruence, triangle
from obsdesign.coq.decimals import matrix, number
from obsdesign.coq.inequality import decrease, least
from obsdesign.dissipation.certificate import Certificate
from obsdesign.lmi.formula import Array, identity
from obsdesign.records import dataclass

FILE = "ObsInput"  # of the library
STATED = """\
Theorem reconstruction_bound : forall f x xh w q qh y yh g gq gy dw,
  trajectories {0} f x xh w q qh y yh g gq gy -> (forall t, 0 <= t -> moves w t (at_ dw t)) ->
  forall t w_sup rate_sup, 0 <= t -> 0 <= w_sup -> 0 <= rate_sup ->
  (forall s, 0 <= s <= t -> sq (at_ w s) <= w_sup * w_sup) ->
  (forall s, 0 <= s <= t -> sq (at_ dw s) <= rate_sup * rate_sup) ->
  let e := error_at x xh in
  size (vsubR (Bi ** (L1 {0} ** vsubR (yh t) (y t))) (at_ w t)) <=
    Q2R c_w * w_sup + Q2R c_rate * rate_sup
      + left_of from_w t (level_V from_w (e 0))
      + left_of from_rate t (level_V from_rate (err_dot {0} (e 0) [] (at_ w 0)))."""


@dataclass(frozen=True)
class Reconstruction:
    """Certificates of the two levels, for H = Bi A and H = Bi, the left inverse Bi of B, and the constants."""

    from_w: Certificate
    from_rate: Certificate
    inverse: Array
    c_w: fmpq
    c_rate: fmpq

    def lines(self, design: str) -> list[str]:
        """Theorem about a design, and its proof."""
        levels = {"from_w": self.from_w, "from_rate": self.from_rate}
        numbers = {"c_w": self.c_w, "c_rate": self.c_rate}
        names = [f"{T}_{name}" for name in levels for T in ("T", "TP", "TO")]
        data = f"{design} Bi from_w from_rate c_w c_rate {' '.join(names)}"
        return [
            f"Definition Bi : list (list Q) := {matrix(self.inverse)}%Q.",
            *(f"Definition {key} : Q := {number(c)}." for key, c in numbers.items()),
            *(line for name, level in levels.items() for line in told(name, level)),
            f"Lemma reconstruction_proved : claims_reconstruction {data} = true.",
            "Proof. vm_cast_no_check (eq_refl true). Qed.",
            STATED.format(design),
            f"Proof. exact (reconstructs {data} reconstruction_proved). Qed.",
            "Print Assumptions reconstruction_bound.",
            "",
        ]


def told(name: str, level: Certificate) -> list[str]:
    """Numbers of a level, and its T."""
    P, H, floor = level.P, level.family.H, least(level)
    numbers = {"floor": floor, "alpha": level.family.rate, "mu1": level.mu1, "mu2": level.mu2}
    forms = {"T": -decrease(level), "TP": P - floor * identity(len(P), P), "TO": level.mu2 * P - H.mT @ H}
    fields = "; ".join(f"level_{key} := {number(x)}" for key, x in numbers.items())
    return [
        f"Definition {name} : level := {{| level_P := {matrix(P)};",
        f"  {fields} |}}%Q.",
        *(f"Definition {T}_{name} : list (list Z) := {triangle(congruence(S))}%Z." for T, S in forms.items()),
    ]
