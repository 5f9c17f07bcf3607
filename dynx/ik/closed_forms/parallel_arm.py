"""Three parallel revolute joints, alone or with one prismatic joint along them: SCARA arms.

The joints move the frame in four directions: a pose has solutions if its rotation is one about the axes, and
without a prismatic joint if its height is that of the arm.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from dynx.ik.closed_forms.planar_arm import PlanarArm
from dynx.ik.closed_forms.subproblems import Coordinate, Slide, dot
from dynx.spatial.scalar import Array, Floats, append_axis, where_less
from dynx.spatial.so3 import rotate


@dataclass(frozen=True, eq=False)
class ParallelArm:
    """Geometry at the zero configuration; lengths are relative. The joints are in any order."""

    axes: Floats
    """Directions (n, 3), n 3 or 4, all along the first revolute axis or opposite to it."""
    points: Floats
    """Points on the axes (n, 3)."""
    revolute: tuple[bool, ...]
    preferred: Floats
    """Angles (n,) [rad] that stand for arbitrary ones."""
    normal: Floats
    """A unit normal of the axes."""
    arbitrary: tuple[int, ...]
    """The first revolute joint, whose angle is arbitrary where the first axis and the third coincide."""
    case: str = "parallel arm"

    def angles(self, R: Array, p: Array, signs: Array) -> list[Coordinate]:
        """Return the coordinates of the branch `signs` (..., 3) for E_1 ... E_n = (R, p)."""
        arm, elbow, flip = signs[..., 0], signs[..., 1], signs[..., 2]
        exists = where_less(arm, flip, arm, flip)
        plane, lifted = self.plane, p
        slide: Slide | None = None
        if not all(self.revolute):
            axis = self.axes[self.revolute.index(False)]
            slide = Slide(dot(axis, p), separation=exists)
            lifted = p - axis * append_axis(slide.value)
        tip = rotate(R, plane.points[2]) + lifted
        first, second, third = plane.angles(
            rotate(R, self.normal), tip, elbow, self.preferred[self.arbitrary[0]]
        )
        least = where_less(second.separation, exists, second.separation, exists)
        angles = iter([first, replace(second, separation=least), third])
        return [next(angles) if turning or slide is None else slide for turning in self.revolute]

    @property
    def plane(self) -> PlanarArm:
        """The revolute axes."""
        turning = list(self.revolute)
        return PlanarArm(self.axes[turning], self.points[turning], self.normal)

    def reaches(self, least: float) -> bool:
        """Return whether both links are longer than `least`."""
        return self.plane.reaches(least)
