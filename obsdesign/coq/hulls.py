"""Multipliers that are matrices, as Coq has them: of Jacobians in a hull, or in a cone, of given matrices.

A matrix M of a hull is an inequality of the class where M22 <= 0 and

    [I; Th]' M [I; Th] >= 0    at each corner Th,

and of a cone where M22 = 0, M11 >= 0 and M12 Th + Th' M12' >= 0 for each direction Th. The file has M in the
coordinates of the whole q and f, and a T for each of these matrices.
"""

import numpy as np

from obsdesign.coq.congruence import congruence, triangle
from obsdesign.coq.decimals import matrix
from obsdesign.lmi.formula import Array, he, zeros
from obsdesign.model.multiplier import Matrix
from obsdesign.nonlinearities.cone import Cone
from obsdesign.nonlinearities.jacobian import Polytope
from obsdesign.records import dataclass


@dataclass(frozen=True)
class Hull:
    """M of one block, (nq, nq), (nq, nf), (nf, nf) of the whole, and the corners (nf, nq)."""

    M: Matrix
    corners: tuple[Array, ...]
    conic: bool
    first: int  # component of f
    count: int

    @classmethod
    def of(cls, block: Cone | Polytope, M: Matrix, corner: tuple[int, int], size: tuple[int, int]) -> "Hull":
        """Block with its M, from components of q and f on, among nq and nf of them."""
        conic = isinstance(block, Cone)
        (q, f), (nq, nf) = corner, size
        across, within = ((q, q), (q, f), (f, f)), ((nq, nq), (nq, nf), (nf, nf))
        whole = [placed(X, at, shape) for X, at, shape in zip(M, across, within, strict=True)]
        corners = block.directions if isinstance(block, Cone) else block.corners
        return cls(
            (whole[0], whole[1], whole[2]), tuple(placed(Th, (f, q), (nf, nq)) for Th in corners), conic, f, block.nf
        )

    def forms(self) -> list[Array]:
        """Matrices that must not be negative, in the order in which Coq asks for them."""
        M11, M12, M22 = self.M
        if self.conic:
            return [M11, *(he(M12 @ Th) for Th in self.corners)]
        return [-M22, *(M11 + he(M12 @ Th) + Th.mT @ M22 @ Th for Th in self.corners)]

    def written(self) -> str:
        """Record of Coq."""
        named = zip(("M11", "M12", "M22"), self.M, strict=True)
        M = "; ".join(f"{name} := {matrix(X)}" for name, X in named)
        corners = ";\n      ".join(map(matrix, self.corners))
        return (
            f"{{| form_of := {{| scaling := 1; {M} |}};\n      conic := {str(self.conic).lower()}; "
            f"first := {self.first}%nat; count := {self.count}%nat;\n      corners := [{corners}] |}}"
        )


def placed(X: Array, corner: tuple[int, int], shape: tuple[int, int]) -> Array:
    """Matrix of zeros with a block in it."""
    whole = zeros(shape, [X])
    whole[corner[0] : corner[0] + X.shape[0], corner[1] : corner[1] + X.shape[1]] = X
    return np.asarray(whole)


def of_hulls(hulls: list[Hull]) -> str:
    """For each hull a list of its T."""
    return (
        "["
        + ";\n ".join("[" + ";\n ".join(triangle(congruence(S)) for S in hull.forms()) + "]" for hull in hulls)
        + "]"
    )
