"""DX416 unknown-urdf-version: The robot states a version that URDF does not have.

``<robot name="..." version="2.0">``: somebody counts his own revisions. The attribute is URDF's, and means
the version of the format.

- Pinocchio 4.1 refuses what is not of the form x.y or not between 1.0 and 1.2.
- PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 do not look at it.

What to do: take the attribute away, or write ``version="1.0"``. ``dynx doctor --fix`` takes it away; without
it a file counts as version 1.0.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.rules import Case, Correction, EditingRule, correction, measured_on

_KNOWN = ("1.0", "1.1", "1.2")


class UnknownUrdfVersion(EditingRule):
    stage = "reading"
    advice = "Take the attribute version away, or write 1.0."
    engines = measured_on("pinocchio")
    changed = "took the version of the robot away"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """The root element."""
        root = case.source.root
        version = root.attributes.get("version")
        if root.tag == "robot" and version is not None and version not in _KNOWN:
            edit = case.source.removing_attribute(root, "version")
            yield correction(root, f"<robot> has version {shown(version)}", edit)
