"""DX207 safety-controller-without-gain: A safety controller has no k_velocity.

The element belongs to the PR2's controllers and to ROS; no engine simulates it. URDF requires its attribute
``k_velocity``; the others are optional.

- Pinocchio 4.1 refuses the file: "joint safety: no k_velocity".
- PyBullet 3.2.7 and MuJoCo 4.0 ignore it; Drake 1.51 warns that it ignores it.

What to do: remove the element unless one of your programs reads it, or complete it. ``dynx doctor --fix``
adds ``k_velocity="0"``, with which the described controller has no effect. A number
under a misspelled name, ``k_velocty="20"``, is what was meant, and gets the right name.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, measured_on
from dynx.rules.attributes import completion
from dynx.rules.joints import elements_in_joints


class SafetyControllerWithoutGain(EditingRule):
    stage = "reading"
    advice = "Write k_velocity, or remove the <safety_controller>."
    engines = measured_on("pinocchio")
    changed = "gave safety controllers without k_velocity one of 0"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the first safety controller of every joint."""
        for _, controller in elements_in_joints(case, "safety_controller"):
            if "k_velocity" not in controller.attributes:
                message = "<safety_controller> has no k_velocity"
                yield completion(case, controller, message, ("k_velocity",), "0")
