"""DX416 unknown-urdf-version: the ``version`` of the ``<robot>`` is none of URDF's

``<robot name="..." version="2.0">``: somebody counts his own revisions. The attribute is URDF's, and means
the version of the format.

- Pinocchio 4.1 refuses what is not of the form x.y or not between 1.0 and 1.2.
- PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 do not look at it.

What to do: take the attribute away, or write ``version="1.0"``. ``dynx doctor --fix`` takes it away; without
it a file counts as version 1.0.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

from dynx.errors import shown
from dynx.rules.case import Case
from dynx.rules.rule import Stage
from dynx.rules.text.editing import Correction, EditingRule, found_at

_KNOWN = ("1.0", "1.1", "1.2")


class UnknownUrdfVersion(EditingRule):
    """DX416."""

    id = "DX416"
    name = "unknown-urdf-version"
    title = "The robot states a version that URDF does not have."
    stage: ClassVar[Stage] = "reading"
    advice = "Take the attribute version away, or write 1.0."
    engines: ClassVar[Mapping[str, str]] = {"pinocchio": ">=4.1.0"}
    changed = "took the version of the robot away"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """The root element."""
        root = case.source.root
        version = root.attributes.get("version")
        if root.tag == "robot" and version is not None and version not in _KNOWN:
            edit = case.source.removing_attribute(root, "version")
            yield Correction(found_at(root, f"<robot> has version {shown(version)}"), (edit,))
