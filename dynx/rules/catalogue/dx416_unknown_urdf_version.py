"""DX416 unknown-urdf-version: The version of the robot is not a version of URDF.

``<robot name="..." version="2.0">``: the author counts revisions of the file. In URDF the attribute is the
version of the format.

- Pinocchio 4.1 refuses a version that is not of the form x.y or not between 1.0 and 1.2.
- PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 ignore it.

What to do: remove the attribute, or write ``version="1.0"``. ``dynx doctor --fix`` removes it; without it a
file counts as version 1.0. Where an origin has a quaternion, which URDF has from version 1.1 on, and the
version is a later one, it writes ``version="1.2"`` instead.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.numbers_in_text import KNOWN_VERSIONS, corrected_version


class UnknownUrdfVersion(EditingRule):
    stage = "reading"
    advice = "Remove the attribute version, or write 1.0."
    engines = measured_on("pinocchio")
    changed = "removed or corrected the version of the robot"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the root element."""
        root = case.source.root
        version = root.attributes.get("version")
        if root.tag == "robot" and version is not None and version not in KNOWN_VERSIONS:
            corrected = corrected_version(case)
            edit = (
                case.source.attribute_removal(root, "version")
                if corrected == KNOWN_VERSIONS[0]
                else case.source.attribute_edit(root, "version", corrected)
            )
            yield correction(root, f"<robot> has version {shown(version)}", edit)
