"""DX222 limit-incomplete-in-urdf-1-2: A robot states URDF 1.2, and a limit lacks its lower or upper end.

Up to URDF 1.1 a missing ``lower`` or ``upper`` is 0. From version 1.2 on the ``<limit>`` of every joint that
is not continuous needs both, and ``effort`` and ``velocity`` may be missing.

- Pinocchio 4.1 (its reader is urdfdom) refuses the file: "revolute and prismatic joints must have both lower
  and upper position limits specified in URDF version 1.2 or later". A fixed joint with a ``<limit>`` counts.
- PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 ignore the version. dynx reads a missing end as 0.

What to do: write both ends. ``dynx doctor --fix`` writes 0 for the missing one, as earlier versions of URDF
define it; a number under a misspelled name, ``uper="1"``, is what was meant, and gets the right name.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, measured_on
from dynx.rules.attributes import completion
from dynx.rules.joints import elements_in_joints
from dynx.rules.numbers_in_text import corrected_version

_TYPES = ("revolute", "prismatic", "fixed", "floating", "planar")


class LimitIncompleteInUrdf12(EditingRule):
    stage = "reading"
    advice = "Write the lower and the upper limit."
    engines = measured_on("pinocchio")
    changed = "wrote 0 for ends of limits that URDF 1.2 requires"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield limits without one of the ends, in a robot of URDF 1.2."""
        if corrected_version(case) != "1.2":
            return
        for _, limit in elements_in_joints(case, "limit", _TYPES):
            missing = [end for end in ("lower", "upper") if end not in limit.attributes]
            if missing:
                message = f"the <limit> has no {' and no '.join(missing)}"
                yield completion(case, limit, message, missing, "0")
