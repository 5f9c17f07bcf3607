"""DX102 inertia-broken-by-rounding: Principal moments lie on the bound of what a body can have, so rounding
decides what engines do.

The principal moments of a rigid body are never negative, and none exceeds the sum of the other two. For thin
plates and rods, and for point masses seen from the joint, the two sides are equal; then the last binary digit
decides, and engines round differently. A moment of 0.3 next to 0.1 and 0.2 is fine, while 0.13 next to 0.1
and 0.03 is 3e-17 too much.

- PyBullet 3.2.7 compares to the last bit after its own diagonalisation. Where the test fails it prints "Bad
  inertia tensor properties" and sets the whole tensor to ZERO. Its inverse dynamics tests once more, about
  the origin of the link, and refuses the whole robot: inverse dynamics, mass matrix and Jacobian then fail.
- MuJoCo 4.0.0 refuses the file ("inertia must satisfy A + B >= C"), in about two of five cases where the rpy
  of the inertial rotates a plate.
- Pinocchio 4.1.0 does not look; Drake 1.51.1 has a tolerance of 1e-14.

The effect: where PyBullet drops the tensor, its mass matrix is off by 1e-6 to 0.9 of its size.

What to do: the body is correct. Raise the moments by less than anyone can measure.

``dynx doctor --fix`` adds the same amount, 16 units in the last place of the largest moment about the link's
origin, to all three moments; a point mass on a fixed joint is merged with the link that carries it instead.
The equations of motion change by a few 1e-15 of their size.
"""

from collections.abc import Iterable, Sequence

from dynx.rules import Case, Detection, Remedy, Rule, links_of, measured_on
from dynx.rules.inertia import (
    inertials_in_groups,
    is_borderline,
    line_of,
    merged_inertials,
    principal_moments,
    rigid_groups,
    with_inertials,
    with_raised_moments,
)

_ROUNDS = 4


class InertiaBrokenByRounding(Rule):
    engines = measured_on("pybullet", "mujoco")
    advice = "Raise the moments by a few units in the last place."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links that a check refuses because of rounding at the triangle inequality."""
        for name, inertial, group in inertials_in_groups(case):
            # Inverse dynamics checks no link that cannot move.
            root = group.static or name == case.model.root
            if not is_borderline(inertial, root=root, on_fixed_joint=name in group.parents):
                continue
            small, middle, large = principal_moments(inertial)
            message = (
                f"the principal moment {float(large):.6g} and the sum of the others, {float(small):.6g} and "
                f"{float(middle):.6g}, differ by rounding only: {float(small + middle - large):.2g}"
            )
            if large == 0.0:
                message = "a point mass: its inertia about the origin of the link has a moment of zero"
            yield Detection(name, None, line_of(case, name, "inertia"), message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy:
        """Raise the moments of each link, or merge a point mass on a fixed joint with its parent."""
        wrong = links_of(detections)
        kept = set(links_of(self.detect(case))).difference(wrong)
        # Merged inertias may need a correction in their turn.
        for _ in range(_ROUNDS):
            for name in wrong:
                case = _corrected(case, name)
            wrong = [name for name in links_of(self.detect(case)) if name not in kept]
            if not wrong:
                break
        return Remedy(case, "raised moments on the bound of what a body can have by a few 1e-15 of them")


def _corrected(case: Case, name: str) -> Case:
    inertial, group = case.inertials[name], rigid_groups(case)[name]
    if inertial is None:
        return case
    if name in group.parents and not inertial.tensor.any():
        return with_inertials(case, merged_inertials(case, group, (group.head, name), group.head))
    return with_inertials(case, {name: with_raised_moments(inertial)})
