"""DX412 robot-without-name: The robot has no name.

URDF requires ``<robot name="...">``. Nothing in the dynamics depends on it, but it decides whether the file
loads.

- Pinocchio 4.1 and PyBullet 3.2.7 refuse a robot without the attribute; both accept an empty name.
- Drake 1.51 refuses both.
- MuJoCo 4.0 reads both. So does dynx, which then names the robot after its file.

What to do: give the robot a name. ``dynx doctor --fix`` writes the name of the file, or ``robot`` for a text
without a file.
"""

from collections.abc import Iterable
from pathlib import PurePath

from dynx.rules import Case, Correction, EditingRule, correction, measured_on


class RobotWithoutName(EditingRule):
    stage = "reading"
    advice = 'Write <robot name="...">.'
    engines = measured_on("pinocchio", "pybullet", "drake")
    changed = "gave the robot a name"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the root element."""
        root = case.source.root
        if root.tag != "robot" or root.attributes.get("name"):
            return
        what = "an empty name" if "name" in root.attributes else "no name"
        source = PurePath(case.source.source)
        name = source.name.split(".")[0] if source.suffix in (".urdf", ".xacro", ".xml") else ""
        yield correction(
            root, f"<robot> has {what}", case.source.attribute_edit(root, "name", name or "robot")
        )
