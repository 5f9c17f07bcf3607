"""DX306 limits-as-forces: A joint has equal limits, to which some engines pull the joint.

``<limit lower="-2" upper="2"/>`` defines the range of a joint. URDF does not define what happens beyond, and
a joint with equal limits violates them at every other position.

- Pinocchio 4.1 and Drake 1.51: no effect. Inverse and forward dynamics have no limits (Drake's discrete
  simulation does).
- MuJoCo 4.0: a joint beyond its limit is pushed back by a constraint force, and ``mj_inverse`` adds that
  force to the torque. Forces of a hundred times the torque were measured. MuJoCo ignores equal limits, with a
  warning.
- PyBullet 3.2.7: ``stepSimulation`` pushes the joint back to the limit, equal ones included;
  ``calculateInverseDynamics`` ignores limits. PyBullet ignores a limit of ``lower="0"`` without ``upper``
  (see DX216 for other limits without ``upper``).

Within limits all engines agree, and doctor compares there. A joint with equal limits is compared at any
position, because the equations of motion have no limits.

What to do: write the range of the joint, or ``type="fixed"`` (see DX508). The file does not say which, so
``dynx doctor --fix`` does not change it; doctor prints the calls that switch limits off.
"""

from collections.abc import Iterable

from dynx.rules import CallingRule, Case, Detection, found_at, measured_on


class LimitsAsForces(CallingRule):
    advice = "Write the range of the joint, or switch its limits off."
    engines = measured_on("pybullet")
    calls = ("pybullet.no_limits", "mujoco.no_limits")
    changed = "compared without joint limits"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints with equal limits."""
        for joint in case.model.joints:
            limit = case.joints[joint.name].first("limit")
            if limit is None or "upper" not in limit.attributes:
                continue
            if joint.moves and joint.limits.lower == joint.limits.upper:
                message = f"the lower and the upper limit of the joint are {joint.limits.lower:g}"
                yield found_at(limit, message)
