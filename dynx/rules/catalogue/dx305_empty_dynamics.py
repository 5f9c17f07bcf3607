"""DX305 empty-dynamics: a ``<dynamics>`` has neither ``damping`` nor ``friction``

``<dynamics/>``, or one that holds only an extension such as ``armature="0.01"``. URDF makes both attributes
optional and says what they default to, but not that one must be there.

- Pinocchio 4.1 and PyBullet 3.2.7 refuse the file: "joint dynamics element specified with no damping and no
  friction". They do so for every type of joint, fixed ones included.
- MuJoCo 4.0 and Drake 1.51 read it.

What to do: write ``damping="0"``, or take the element away. ``dynx doctor --fix`` adds ``damping="0"``, which
keeps what else is there.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

from dynx.rules.case import Case
from dynx.rules.joints.elements import elements_in_joints
from dynx.rules.rule import Stage
from dynx.rules.text.editing import Correction, EditingRule, found_at


class EmptyDynamics(EditingRule):
    """DX305."""

    id = "DX305"
    name = "empty-dynamics"
    title = "A dynamics element has neither damping nor friction."
    stage: ClassVar[Stage] = "reading"
    advice = 'Write damping="0", or take the element away.'
    engines: ClassVar[Mapping[str, str]] = {"pinocchio": ">=4.1.0", "pybullet": ">=3.2.7"}
    changed = "wrote a damping of 0 into <dynamics> without damping and friction"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """The first ``<dynamics>`` of every joint, moving or not."""
        for _, dynamics in elements_in_joints(case, "dynamics"):
            if not {"damping", "friction"} & set(dynamics.attributes):
                edit = case.source.setting(dynamics, "damping", "0")
                yield Correction(found_at(dynamics, "<dynamics> has neither damping nor friction"), (edit,))
