"""DX415 material-defined-twice: Two materials of the robot have the same name.

Materials are only colours, but a second definition decides whether the file loads:

- Pinocchio 4.1 ("material is not unique") and Drake 1.51 ("was previously defined") refuse the file.
- PyBullet 3.2.7 warns; MuJoCo 4.0 does not check.

This happens when the files of an arm and of a hand are combined.

What to do: keep one. ``dynx doctor --fix`` keeps the first and removes the others, whatever their colour.
Materials inside ``<visual>`` are not changed.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.rules import Case, Correction, EditingRule, correction, measured_on


class MaterialDefinedTwice(EditingRule):
    stage = "reading"
    advice = "Define each material once."
    engines = measured_on("pinocchio", "drake")
    changed = "removed further definitions of materials"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield materials directly in the robot whose name an earlier material has."""
        seen = set()
        for material in case.source.root.all("material"):
            name = material.attributes.get("name", "")
            if name in seen:
                message = f"material {shown(name)} is defined again"
                yield correction(material, message, case.source.removal(material))
            seen.add(name)
