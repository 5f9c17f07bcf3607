"""DX216 upper-limit-missing: A limit has a lower end of -1 or less and no upper end, which PyBullet reads as
-1.

In URDF a missing end of the range is 0, so ``<limit lower="-2" .../>`` is the range -2 to 0. This is rarely
intended.

- PyBullet 3.2.7 reads a missing ``upper`` as -1. The range is -2 to -1, and a joint between -1 and 0 is
  beyond it: in ``stepSimulation`` it can move towards -1 but not away from it, as at a stop.
  ``calculateInverseDynamics`` has no limits.
- Pinocchio 4.1 has the range -2 to 0. So has dynx, with a note.
- Drake 1.51 has a lower limit of -2 and no upper one; MuJoCo 4.0 ignores a limit with one end.

Only PyBullet's range affects a motion that the file allows. Where ``lower`` is above -1, it is above
PyBullet's ``upper``, and PyBullet then ignores both, as it does where neither is given (DX508). A missing
``lower`` is 0 in PyBullet and in Pinocchio, and again no limit in Drake and MuJoCo.

The effect is a joint that does not move: in PyBullet's simulation, and only in the part of the range above
-1, its whole acceleration is lost.

What to do: write the intended end. A number under a misspelled name, ``uper="1"``, is what was meant, and
``dynx doctor --fix`` corrects the name. Otherwise the file does not contain the end, and it writes
``upper="0"``, as URDF, Pinocchio and dynx read it; the other three engines then have that range too.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, measured_on
from dynx.rules.attributes import completion, number_or_none
from dynx.rules.joints import elements_in_joints

_UPPER_OF_PYBULLET = -1.0
"""Upper limit that PyBullet uses where none is given; URDF has 0."""


class UpperLimitMissing(EditingRule):
    advice = "Write both ends of every range."
    engines = measured_on("pybullet")
    changed = 'wrote upper="0" where a limit has no upper end'
    depends_on_state = True

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield limits of joints that have a range: a continuous one has none in any engine's motion."""
        for _, limit in elements_in_joints(case, "limit", ("revolute", "prismatic")):
            lower = number_or_none(limit, "lower")
            if "upper" in limit.attributes or lower is None or lower > _UPPER_OF_PYBULLET:
                continue
            message = f"lower is {lower:g} and upper is not given, which is 0 in URDF and -1 in PyBullet"
            yield completion(case, limit, message, ("upper",), "0")
