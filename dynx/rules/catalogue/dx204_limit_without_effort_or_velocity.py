"""DX204 limit-without-effort-or-velocity: A limit does not state the largest effort or velocity.

URDF requires both up to version 1.1, although neither enters any equation of motion.

- Pinocchio 4.1 refuses the file: "limit has no effort". It does so for every type of joint, fixed ones
  included; not where the robot states ``version="1.2"``, see DX222.
- PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 read the file. So does dynx: what is not given is unlimited.

Files with such limits are common, because only urdfdom, the reader of Pinocchio and ROS, checks them.

What to do: write both. A number under a misspelled name, ``velocty="2"``, is what was meant, and
``dynx doctor --fix`` corrects the name. Otherwise the file does not contain them, and it writes the largest
double, which every engine reads and which dynx reads as "no limit".
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, measured_on
from dynx.rules.attributes import completion
from dynx.rules.joints import elements_in_joints
from dynx.rules.numbers_in_text import LARGEST, corrected_version


class LimitWithoutEffortOrVelocity(EditingRule):
    stage = "reading"
    advice = "Write effort and velocity into every <limit>."
    engines = measured_on("pinocchio")
    changed = "wrote the largest double for efforts and velocities that were not given"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the first limit of every joint, moving or not, in a robot of URDF 1.0 or 1.1."""
        if corrected_version(case) == "1.2":
            return
        for _, limit in elements_in_joints(case, "limit"):
            missing = [name for name in ("effort", "velocity") if name not in limit.attributes]
            if missing:
                message = f"<limit> has no {' and no '.join(missing)}"
                yield completion(case, limit, message, missing, LARGEST)
