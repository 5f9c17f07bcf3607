"""DX102 inertia-broken-by-rounding: Principal moments on the edge of what a body can have; rounding decides
what engines do.

The principal moments of a rigid body are never negative, and none exceeds the sum of the other two. For
thin plates and rods, and for point masses seen from the joint, the two sides are equal; then the last
binary digit decides, and each engine rounds in its own way. A moment of 0.3 next to 0.1 and 0.2 is fine,
while 0.13 next to 0.1 and 0.03 is 3e-17 too much.

- PyBullet 3.2.7 compares to the last bit after its own diagonalisation. Where the test fails it prints
  "Bad inertia tensor properties" and sets the whole tensor to ZERO. Its inverse dynamics tests once more,
  about the origin of the link, and refuses the whole robot: inverse dynamics, mass matrix and Jacobian then
  fail.
- MuJoCo 4.0.0 refuses the file ("inertia must satisfy A + B >= C"), about two times in five where a plate
  is turned by the rpy of its inertial.
- Pinocchio 4.1.0 does not look; Drake 1.51.1 allows for 1e-14.

The effect: where PyBullet drops the tensor, its mass matrix is off by 1e-6 to 0.9 of its size.

What to do: nothing is wrong with the body. Move the moments inside the edge by less than anyone can measure.

``dynx doctor --fix`` adds the same amount, 16 units in the last place of the largest moment about the
link's origin, to all three moments; a point mass on a fixed joint is lumped with the link that carries it
instead. The equations of motion change by a few 1e-15 of their size.
"""

from collections.abc import Iterable, Sequence

from dynx.rules import Case, Detection, Remedy, Rule, measured_on
from dynx.rules.inertia.edits import line_of, with_inertials
from dynx.rules.inertia.merging import lumped_into
from dynx.rules.inertia.physical import lifted, on_the_edge, principal_moments
from dynx.rules.inertia.rigid_groups import rigid_groups

_ROUNDS = 4


class InertiaBrokenByRounding(Rule):
    engines = measured_on("pybullet", "mujoco")
    advice = "Raise the moments by a few units in the last place."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Links whose moments meet the triangle inequality with equality, to rounding, and fail a check."""
        groups = rigid_groups(case)
        for link in case.model.links:
            if link.inertial is None:
                continue
            group = groups[link.name]
            # A static link has no joint whose inverse dynamics would look at it.
            root = group.static or link.name == case.model.root
            if not on_the_edge(link.inertial, root=root, welded=link.name in group.parents):
                continue
            small, middle, large = principal_moments(link.inertial)
            message = (
                f"the principal moment {float(large):.6g} and the sum of the others, {float(small):.6g} and "
                f"{float(middle):.6g}, differ by rounding only: {float(small + middle - large):.2g}"
            )
            if large == 0.0:
                message = "a point mass: its inertia about the origin of the link has a moment of zero"
            yield Detection(link.name, None, line_of(case, link.name, "inertia"), message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy:
        """Each moved inside the edge, or lumped where it is a point on a fixed joint."""
        # What a lump makes may be on the edge in its turn.
        for _ in range(_ROUNDS):
            for detection in detections:
                assert detection.link is not None
                case = _moved_inside(case, detection.link)
            detections = self.detect(case)
            if not detections:
                break
        return Remedy(case, "raised moments on the edge of what a body can have by a few 1e-15 of them")


def _moved_inside(case: Case, name: str) -> Case:
    inertial, group = case.inertials[name], rigid_groups(case)[name]
    if inertial is None:
        return case
    if name in group.parents and not inertial.tensor.any():
        return with_inertials(case, lumped_into(case, group, (group.head, name), group.head))
    return with_inertials(case, {name: lifted(inertial)})
