"""Nonlinearities whose Jacobian stays in a cone of matrices."""

from collections.abc import Sequence

import numpy as np
from flint import fmpq

from obsdesign.lmi.farkas import null_space
from obsdesign.lmi.formula import Array, Inequality, Unknown, Values, he, rational, symmetric, zeros
from obsdesign.model.multiplier import Block, Matrix, Multiplier, Scaled
from obsdesign.nonlinearities.data import MatrixList
from obsdesign.nonlinearities.evidence.claims import Hull
from obsdesign.nonlinearities.slope import component
from obsdesign.nonlinearities.template import Template, require_matrices
from obsdesign.records import dataclass, replace


@dataclass(frozen=True)
class Ray:
    """A direction Th of the cone, in coordinates T of dq that put the null space of Th last.

    There T' He(M12 Th) T has a zero diagonal for every M12, so that the engine sees which entries must vanish. Both
    ways (-Th is a direction too) all of them must.
    """

    image: Array  # Th T, (nf, nq)
    coordinates: Array  # T, (nq, nq)
    both_ways: bool

    def form(self, M12: Array) -> Array:
        """Matrix that must be negative semidefinite."""
        rate = he(self.coordinates.mT @ M12 @ self.image)
        return symmetric([[0 * rate, rate], [0 * rate]]) if self.both_ways else -rate


@dataclass(frozen=True)
class Cone(Block):
    """All M with M22 = 0, M11 >= 0 and He(M12 Th) >= 0 for each ray Th."""

    rays: tuple[Ray, ...]
    directions: tuple[Array, ...]  # Th, (nf, nq)

    @property
    def generators(self) -> tuple[Scaled, ...]:
        """None."""
        return ()

    @property
    def vertices(self) -> tuple[Array, ...]:
        """Zero, and a point of each ray."""
        return (self.member, *self.directions)

    def one_scale(self) -> Scaled | None:
        """Of one number of one sign, a slope without a bound on one side."""
        numbers = {Th.item() > 0 for Th in (ray.image for ray in self.rays) if Th.size == 1 and Th.any()}
        if self.member.size > 1 or len(numbers) != 1:
            return None
        up = component(fmpq(0), None)
        return up if True in numbers else replace(up, M12=-up.M12)

    def unknowns(self, label: str) -> tuple[Unknown, ...]:
        """M11 and M12."""
        return (
            Unknown(f"M{label}_11", (self.nq, self.nq), symmetric=True),
            Unknown(f"M{label}_12", (self.nq, self.nf)),
        )

    def matrix(self, v: Values, label: str) -> Matrix:
        """M with M22 = 0: a form that is quadratic in the length of Th could not be positive on a whole ray."""
        return v[f"M{label}_11"], v[f"M{label}_12"], zeros((self.nf, self.nf), [self.member])

    def inequalities(self, v: Values, label: str) -> tuple[Inequality, ...]:
        """M11 >= 0 and one inequality for each ray."""
        return (
            Inequality(f"M{label}_11 >= 0", -v[f"M{label}_11"]),
            *(
                Inequality(f"He(M{label}_12 Th{i}) {'= 0' if ray.both_ways else '>= 0'}", ray.form(v[f"M{label}_12"]))
                for i, ray in enumerate(self.rays, start=1)
            ),
        )


def cone(directions: Sequence[Array], nq: int, nf: int) -> Multiplier:
    """Jacobian in a cone: df = Th dq, Th = sum_i s_i Th_i, s_i >= 0.

    It is so where every Jacobian of f is such a sum. M is any matrix with M22 = 0, M11 >= 0 and He(M12 Th_i) >= 0
    for each i. The member of the class is zero.

    `directions`: at least one matrix Th_i (nf, nq). Raises `UsageError`: there is no matrix, or one has another size.
    """
    require_matrices("cone", "the directions of the cone", directions, nf, nq)
    rays = tuple(ray(Th, both_ways=any((Th == -other).all() for other in directions)) for Th in directions)
    return Multiplier((Cone(zeros((nf, nq), [rational([[0]])]), rays, tuple(directions)),))


def ray(Th: Array, *, both_ways: bool) -> Ray:
    """Ray of a matrix: T is the identity, with a column of the null space in place of each dependent one of Th."""
    null, T = null_space(Th), rational(np.eye(Th.shape[1]))
    T[:, [np.flatnonzero(v != 0)[-1] for v in null]] = null.T
    return Ray(Th @ T, T, both_ways)


CONE = Template(
    cone,
    MatrixList("every Jacobian is a nonnegative combination of these nf x nq matrices", "[[[1]]]"),
    square=False,
    conditions=lambda directions, _: [Hull(np.array(directions), conic=True)],
)
