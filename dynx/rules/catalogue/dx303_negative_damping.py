"""DX303 negative-damping: a joint's damping is negative, so it drives itself

- Drake 1.51 refuses the file: "joint damping must be nonnegative".
- MuJoCo 4.0 and PyBullet 3.2.7 simulate a joint that is faster the faster it is.
- Pinocchio 4.1 stores the number and does not use it.

Nothing in the rigid-body dynamics depends on it; with ``joint_dynamics=True`` dynx uses the number as it
stands, with a note.

What to do: correct the sign. ``dynx doctor --fix`` takes it away. ``--choose DX303=zero`` writes 0 instead.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

from dynx.rules.case import Case
from dynx.rules.joints.elements import SINGLE, elements_in_joints
from dynx.rules.rule import Stage
from dynx.rules.text.attributes import number_or_none
from dynx.rules.text.editing import Correction, EditingRule, found_at


class NegativeDamping(EditingRule):
    """DX303."""

    id = "DX303"
    name = "negative-damping"
    title = "The damping of a joint is negative."
    stage: ClassVar[Stage] = "reading"
    advice = "Write a damping of at least 0."
    engines: ClassVar[Mapping[str, str]] = {"drake": ">=1.51.1"}
    choices: ClassVar[Mapping[str, str]] = {
        "absolute": "take the sign of a negative damping away",
        "zero": "make a negative damping zero",
    }
    changed = "made the damping of joints positive or zero"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Joints that move."""
        for _, dynamics in elements_in_joints(case, "dynamics", SINGLE):
            if (number_or_none(dynamics, "damping") or 0.0) >= 0.0:
                continue
            written = dynamics.attributes["damping"].strip()
            instead = "0" if self.chosen(case) == "zero" else written.removeprefix("-")
            edit = case.source.setting(dynamics, "damping", instead)
            yield Correction(found_at(dynamics, f"the joint has damping {written}"), (edit,))
