"""DX508 range-of-zero-width: The lower and upper limit of a joint are equal or absent, so it has no range to
move in.

A ``<limit>`` without ``lower`` and ``upper`` means 0 and 0: URDF's default for both is zero, not "none". So
the joint has a coordinate and cannot move.

Engines interpret it differently. Where the attributes are absent, Pinocchio has the range 0 to 0, and
PyBullet, MuJoCo and Drake have none, so there the joint moves freely. Where two equal numbers are written,
Pinocchio and Drake keep them as limits, PyBullet's stepper holds the joint still, and MuJoCo warns and
ignores them. The equations of motion are the same with all.

Whether ``fixed``, ``continuous`` or a range was meant is not known from the file, so no edit removes the
cause.
"""

from collections.abc import Iterable

from dynx.rules import Case, Detection, Rule


class RangeOfZeroWidth(Rule):
    kind = "practice"
    advice = 'Write the range of the joint, or type="continuous" if it has none, or type="fixed".'

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield revolute and prismatic joints with a coordinate of their own and no range."""
        for joint in case.model.coordinate_joints:
            if joint.type == "continuous" or joint.limits.lower != joint.limits.upper:
                continue
            limit = case.joints[joint.name].first("limit")
            absent = limit is not None and not {"lower", "upper"} & set(limit.attributes)
            why = "no lower and upper limit, which URDF reads as 0" if absent else "equal limits"
            message = f"the joint has {why}: its whole range is {joint.limits.lower:.6g}"
            yield Detection(None, joint.name, joint.line, message)
