"""Nonlinearities whose Jacobian stays in a polytope of matrices."""

from collections.abc import Sequence

import numpy as np

from obsdesign.lmi.formula import Array, Inequality, Unknown, Values, he
from obsdesign.model.multiplier import Block, Matrix, Multiplier, Scaled
from obsdesign.nonlinearities.data import MATRICES, MatrixList
from obsdesign.nonlinearities.evidence import automatic
from obsdesign.nonlinearities.evidence.claims import Hull
from obsdesign.nonlinearities.slope import component
from obsdesign.nonlinearities.template import Template, require_matrices
from obsdesign.records import dataclass, replace
from obsdesign.sections.forms import Either, auto


@dataclass(frozen=True)
class Polytope(Block):
    """All M with M22 <= 0 and [I; Th]' M [I; Th] >= 0 at each vertex Th.

    The form is concave in Th where M22 <= 0, so what holds at the vertices holds between them; without M22 <= 0 it
    need not: M = diag(-1, 1) does at Th = -1 and Th = 1, and not at 0.
    """

    corners: tuple[Array, ...]  # (nf, nq) each

    @property
    def generators(self) -> tuple[Scaled, ...]:
        """The bounds of a slope; there are none for matrices."""
        slopes = [Th.item() for Th in self.corners if Th.size == 1]
        return (component(min(slopes), max(slopes)),) if slopes else ()

    @property
    def vertices(self) -> tuple[Array, ...]:
        """The given matrices, and their mean."""
        return (self.member, *self.corners)

    @property
    def bounded(self) -> bool:
        """Whether it is, as a hull."""
        return True

    def one_scale(self) -> Scaled | None:
        """Of one number, the slope between the least and the largest: then the S-procedure is lossless."""
        if self.member.size > 1:
            return None
        numbers = [Th.item() for Th in self.vertices]
        return replace(component(min(numbers), max(numbers)), member=self.member)

    def unknowns(self, label: str) -> tuple[Unknown, ...]:
        """All of M."""
        return (
            Unknown(f"M{label}_11", (self.nq, self.nq), symmetric=True),
            Unknown(f"M{label}_12", (self.nq, self.nf)),
            Unknown(f"M{label}_22", (self.nf, self.nf), symmetric=True),
        )

    def matrix(self, v: Values, label: str) -> Matrix:
        """M as it is."""
        return v[f"M{label}_11"], v[f"M{label}_12"], v[f"M{label}_22"]

    def inequalities(self, v: Values, label: str) -> tuple[Inequality, ...]:
        """M22 <= 0 and one inequality for each vertex."""
        M11, M12, M22 = self.matrix(v, label)
        return (
            Inequality(f"M{label}_22 <= 0", M22),
            *(
                Inequality(f"[I; Th{i}]' M{label} [I; Th{i}] >= 0", -(M11 + he(M12 @ Th) + Th.mT @ M22 @ Th))
                for i, Th in enumerate(self.corners, start=1)
            ),
        )


def jacobian(vertices: Sequence[Array], nq: int, nf: int) -> Multiplier:
    """Jacobian in a polytope: df = Th dq with Th in the convex hull of the given matrices Th_i.

    It is so where every Jacobian of f is in it. M is any matrix with M22 <= 0 and
    [I; Th_i]' M [I; Th_i] >= 0 for each i.

    `vertices`: at least one matrix Th_i (nf, nq). Their mean is the member of the class. Raises `UsageError`: there is
    no matrix, or one has another size.
    """
    require_matrices("jacobian", "the vertices of the polytope", vertices, nf, nq)
    return Multiplier((Polytope(np.sum(vertices, axis=0) / len(vertices), tuple(vertices)),))


FORM = "a list of matrices, or auto"
JACOBIAN = Template(
    jacobian,
    MatrixList(
        "every Jacobian is in the convex hull of these nf x nq matrices; or auto",
        "[[[1.4]], [[0.6]]]",
        Either(FORM, auto(FORM), MATRICES, MATRICES),
    ),
    square=False,
    derive=automatic.polytope,
    conditions=lambda vertices, _: [Hull(np.array(vertices), conic=False)],
)
