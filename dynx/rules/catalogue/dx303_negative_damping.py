"""DX303 negative-damping: The damping of a joint is negative.

- Drake 1.51 refuses the file: "joint damping must be nonnegative".
- MuJoCo 4.0 and PyBullet 3.2.7 simulate a joint that accelerates itself.
- Pinocchio 4.1 stores the number and does not use it.

Nothing in the rigid-body dynamics depends on it; with ``joint_dynamics=True`` dynx uses the number unchanged,
with a note.

What to do: correct the sign. ``dynx doctor --fix`` removes it. ``--choose DX303=zero`` writes 0 instead.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.attributes import number_or_none
from dynx.rules.joints import SINGLE, elements_in_joints


class NegativeDamping(EditingRule):
    stage = "reading"
    advice = "Write a damping of at least 0."
    engines = measured_on("drake")
    choices = {
        "absolute": "remove the sign of a negative damping",
        "zero": "make a negative damping zero",
    }
    changed = "made the damping of joints positive or zero"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield joints that move."""
        for _, dynamics in elements_in_joints(case, "dynamics", SINGLE):
            if (number_or_none(dynamics, "damping") or 0.0) >= 0.0:
                continue
            written = dynamics.attributes["damping"].strip()
            instead = "0" if self.chosen(case) == "zero" else written.removeprefix("-")
            edit = case.source.attribute_edit(dynamics, "damping", instead)
            yield correction(dynamics, f"the joint has damping {written}", edit)
