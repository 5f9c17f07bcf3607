"""DX306 limits-as-forces: A joint has equal limits, to which some engines push it back.

``<limit lower="-2" upper="2"/>`` says where a joint can be. What happens beyond is not in URDF, and a joint
whose limits are equal is beyond them everywhere else.

- Pinocchio 4.1 and Drake 1.51: nothing. Inverse and forward dynamics know of no limit (Drake's discrete
  simulation does).
- MuJoCo 4.0: a joint beyond its limit is pushed back by a constraint force, and ``mj_inverse`` adds that
  force to the torque. It is not small: a hundred times the torque was measured.
  MuJoCo takes equal limits for none, with a warning.
- PyBullet 3.2.7: ``stepSimulation`` pushes the joint back to the limit, equal ones included;
  ``calculateInverseDynamics`` knows of none. A limit of ``lower="0"`` without ``upper``, for which URDF has
  0, is none (see DX216 for other limits without ``upper``).

Within limits that leave a joint some room all engines agree, and doctor compares there. A joint with equal
limits is compared anywhere, because the equations of motion have no limits.

What to do: write the range of the joint, or ``type="fixed"`` (see DX508). Which of the two is not in the
file, so ``dynx doctor --fix`` does not change it; doctor prints the calls that switch limits off.
"""

from collections.abc import Iterable

from dynx.rules import CallingRule, Case, Detection, found_at, measured_on


class LimitsAsForces(CallingRule):
    advice = "Write the range of the joint, or switch its limits off."
    engines = measured_on("pybullet")
    calls = ("pybullet.no_limits", "mujoco.no_limits")
    changed = "compared without joint limits"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Joints with limits and no room between them."""
        for joint in case.model.joints:
            limit = case.joints[joint.name].first("limit")
            if limit is None or "upper" not in limit.attributes:
                continue
            if joint.moves and joint.limits.lower == joint.limits.upper:
                message = f"the lower and the upper limit of the joint are {joint.limits.lower:g}"
                yield found_at(limit, message)
