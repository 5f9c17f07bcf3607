"""DX418 orientation-as-quaternion: The orientation of an origin is a quaternion, which few engines read.

URDF 1.1 introduced ``<origin xyz="..." quat_xyzw="0 0 0.7071 0.7071"/>`` in place of ``rpy``. A file must ask
for it with ``<robot version="1.1">`` or ``1.2``.

- Pinocchio 4.1 reads the quaternion and scales it to length 1. So does dynx.
- PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 ignore the attribute without a warning: the origin has no
  rotation.

The effect is that of a missing rotation: of order 1 in the positions of all links behind a joint, and in the
mass matrix where the quaternion is in an ``<inertial>``.

What to do: write the orientation as ``rpy``, with all digits. ``dynx doctor --fix`` does so, from the
quaternion scaled to length 1; the orientation is the same to rounding. In a file that states no such version
every engine ignores the quaternion, see DX530.
"""

from collections.abc import Iterable

from dynx.model.urdf.elements import QUATERNION
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.attributes import orientation_edits, quaternions_count
from dynx.rules.numbers_in_text import decimal, is_plain, origins_with_quaternion, quaternion_rpy


class OrientationAsQuaternion(EditingRule):
    stage = "reading"
    advice = "Write the orientation as rpy with all digits."
    engines = measured_on("pybullet", "mujoco", "drake")
    changed = "wrote quaternions of origins as roll, pitch and yaw"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield origins with a quaternion that Pinocchio reads as a rotation."""
        for origin in origins_with_quaternion(case):
            rpy = quaternion_rpy(origin)
            if rpy is None or not quaternions_count(origin):
                continue
            if "rpy" in origin.attributes or not is_plain(case, origin):
                continue
            message = (
                f"the orientation is {QUATERNION}={origin.attributes[QUATERNION]!r}, "
                f'which is rpy="{" ".join(map(decimal, rpy))}"'
            )
            yield correction(origin, message, *orientation_edits(case.source, origin, rpy))
