"""DX415 material-defined-twice: two ``<material>`` of the robot have the same name

Materials are colours. Still a second definition of one decides whether the file loads:

- Pinocchio 4.1 ("material is not unique") and Drake 1.51 ("was previously defined") refuse the file.
- PyBullet 3.2.7 warns; MuJoCo 4.0 does not look.

It happens when the files of an arm and of a hand are put together.

What to do: keep one. ``dynx doctor --fix`` keeps the first and takes the others away, whatever their colour.
Materials inside ``<visual>`` are another matter and are left alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

from dynx.errors import shown
from dynx.rules.case import Case
from dynx.rules.rule import Stage
from dynx.rules.text.editing import Correction, EditingRule, found_at


class MaterialDefinedTwice(EditingRule):
    """DX415."""

    id = "DX415"
    name = "material-defined-twice"
    title = "Two materials of the robot have the same name."
    stage: ClassVar[Stage] = "reading"
    advice = "Define each material once."
    engines: ClassVar[Mapping[str, str]] = {"pinocchio": ">=4.1.0", "drake": ">=1.51.1"}
    changed = "took further definitions of materials away"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Materials directly in the robot whose name was there before."""
        seen = set()
        for material in case.source.root.all("material"):
            name = material.attributes.get("name", "")
            if name in seen:
                message = f"material {shown(name)} is defined a further time"
                yield Correction(found_at(material, message), (case.source.removing(material),))
            seen.add(name)
