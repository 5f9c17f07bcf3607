"""DX419 unreadable-quaternion: The quaternion of an origin is no rotation, or stands beside ``rpy``.

In URDF from version 1.1 on ``quat_xyzw`` takes four numbers separated by blanks, not all zero, and no ``rpy``
beside them. Only Pinocchio reads it, see DX418; so it is also the only engine that objects.

- Pinocchio 4.1 refuses the file where the origin is that of a ``<joint>``; in an ``<inertial>`` it drops the
  whole inertial with a line on stderr, so the link weighs nothing. A quaternion of length 0 is no rotation to
  it, without a warning.
- PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 use ``rpy``, or no rotation where there is none.

dynx refuses such an origin with its line.

What to do: write one orientation, as ``rpy``. Where there is an ``rpy``, ``dynx doctor --fix`` keeps it and
removes the quaternion. It writes four numbers that are separated by commas or tabs as ``rpy``, and removes
any other text, so that the origin has no rotation, as three engines read it.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.model.urdf.elements import QUATERNION
from dynx.rules import EVERY_ENGINE, Case, Correction, EditingRule, correction
from dynx.rules.attributes import orientation_edits, quaternions_count
from dynx.rules.numbers_in_text import is_plain, origins_with_quaternion, quaternion_rpy


class UnreadableQuaternion(EditingRule):
    stage = "reading"
    advice = "Write one orientation, as rpy."
    engines = EVERY_ENGINE
    changed = "removed quaternions that are no rotation or stand beside rpy, or wrote them as rpy"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield origins with such a quaternion."""
        for origin in origins_with_quaternion(case):
            if not quaternions_count(origin):
                continue
            text = shown(origin.attributes[QUATERNION])
            rpy = quaternion_rpy(origin)
            edits = [case.source.attribute_removal(origin, QUATERNION)]
            if "rpy" in origin.attributes:
                message = f"<origin> has both rpy and {QUATERNION}={text}"
            elif rpy is None:
                message = f"{QUATERNION} is {text}; wanted four numbers that are not all zero"
            elif not is_plain(case, origin):
                message = f"the numbers of {QUATERNION}, {text}, are not separated by blanks alone"
                edits = orientation_edits(case.source, origin, rpy)
            else:
                continue
            yield correction(origin, message, *edits)
