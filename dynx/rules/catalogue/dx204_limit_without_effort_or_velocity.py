"""DX204 limit-without-effort-or-velocity: a ``<limit>`` has no ``effort`` or no ``velocity``

URDF demands both, though neither enters any equation of motion.

- Pinocchio 4.1 refuses the file: "limit has no effort". It does so for every type of joint, fixed ones
  included.
- PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 read the file. So does dynx: what is not given is unlimited.

Files with such limits are common, because nobody but urdfdom, the reader behind Pinocchio and ROS, looks at
them.

What to do: write both. They are not in the file, so ``dynx doctor --fix`` writes the largest double, which
every engine reads and which dynx takes for "no limit".
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

from dynx.rules.case import Case
from dynx.rules.joints.elements import elements_in_joints
from dynx.rules.rule import Stage
from dynx.rules.text.editing import Correction, EditingRule, found_at
from dynx.rules.text.number_text import LARGEST


class LimitWithoutEffortOrVelocity(EditingRule):
    """DX204."""

    id = "DX204"
    name = "limit-without-effort-or-velocity"
    title = "A limit does not say the largest effort or speed."
    stage: ClassVar[Stage] = "reading"
    advice = "Write effort and velocity into every <limit>."
    engines: ClassVar[Mapping[str, str]] = {"pinocchio": ">=4.1.0"}
    changed = "wrote the largest double for efforts and velocities that were not given"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """The first limit of every joint, moving or not."""
        for _, limit in elements_in_joints(case, "limit"):
            missing = [name for name in ("effort", "velocity") if name not in limit.attributes]
            if missing:
                edits = tuple(case.source.setting(limit, name, LARGEST) for name in missing)
                yield Correction(found_at(limit, f"<limit> has no {' and no '.join(missing)}"), edits)
