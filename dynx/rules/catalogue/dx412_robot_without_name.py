"""DX412 robot-without-name: the ``<robot>`` has no name, or an empty one

URDF wants ``<robot name="...">``. Nothing in the dynamics depends on it, and still it decides whether the
file loads.

- Pinocchio 4.1 and PyBullet 3.2.7 refuse a robot without the attribute; an empty name is fine with both.
- Drake 1.51 refuses both.
- MuJoCo 4.0 reads both. So does dynx, which then names the robot after its file.

What to do: give the robot a name. ``dynx doctor --fix`` writes the name of the file, or ``robot`` for a text
that came from none.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import PurePath
from typing import ClassVar

from dynx.rules.case import Case
from dynx.rules.rule import Stage
from dynx.rules.text.editing import Correction, EditingRule, found_at


class RobotWithoutName(EditingRule):
    """DX412."""

    id = "DX412"
    name = "robot-without-name"
    title = "The robot has no name."
    stage: ClassVar[Stage] = "reading"
    advice = 'Write <robot name="...">.'
    engines: ClassVar[Mapping[str, str]] = {
        "pinocchio": ">=4.1.0",
        "pybullet": ">=3.2.7",
        "drake": ">=1.51.1",
    }
    changed = "gave the robot a name"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """The root element."""
        root = case.source.root
        if root.tag != "robot" or root.attributes.get("name"):
            return
        what = "an empty name" if "name" in root.attributes else "no name"
        source = PurePath(case.source.source)
        name = source.name.split(".")[0] if source.suffix in (".urdf", ".xacro", ".xml") else ""
        yield Correction(
            found_at(root, f"<robot> has {what}"), (case.source.setting(root, "name", name or "robot"),)
        )
