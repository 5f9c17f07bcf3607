"""DX530 quaternion-without-version: An origin has a quaternion, but the robot states no version that reads
it.

``<origin quat_xyzw="..."/>`` is part of URDF from version 1.1 on. Without ``<robot version="1.1">`` (or 1.2)
a file counts as version 1.0, and every engine ignores the quaternion without a warning: Pinocchio 4.1 too,
which alone would read it. The engines agree, on a robot whose origin has no rotation, or that of ``rpy``.

What to do: write the orientation as ``rpy``, which every engine reads. ``dynx doctor --fix`` does so with
``--choose DX530=rpy``, which changes the robot to what the quaternion states; by default it leaves the file
as it is. Adding the version alone would help in Pinocchio only, see DX418.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.model.urdf.elements import QUATERNION
from dynx.rules import Case, Correction, OptionalEditingRule, correction
from dynx.rules.attributes import orientation_edits, quaternions_count
from dynx.rules.numbers_in_text import origins_with_quaternion, quaternion_rpy


class QuaternionWithoutVersion(OptionalEditingRule):
    stage = "reading"
    advice = "Write the orientation as rpy."
    choices = {
        "keep": "leave quaternions that every engine ignores as they are",
        "rpy": "write quaternions that every engine ignores as roll, pitch and yaw",
    }
    changed = "wrote ignored quaternions of origins as roll, pitch and yaw"
    changes_physics = True

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield origins with a quaternion in a robot of URDF 1.0."""
        for origin in origins_with_quaternion(case):
            if quaternions_count(origin):
                continue
            rpy = quaternion_rpy(origin)
            edits = [] if rpy is None else orientation_edits(case.source, origin, rpy)
            message = f"every engine ignores {QUATERNION}={shown(origin.attributes[QUATERNION])}"
            yield correction(origin, message, *edits)
