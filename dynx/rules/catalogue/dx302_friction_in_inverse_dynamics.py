"""DX302 friction-in-inverse-dynamics: A joint has dry friction, which MuJoCo adds to the torque and others do
not.

``<dynamics friction="0.2"/>`` is a force that opposes the motion at any speed.

- MuJoCo 4.0 reads it as ``frictionloss``, a constraint. ``mj_inverse`` adds the force of the constraint: the
  friction times the sign of the velocity, or less at low speed, where the constraint can hold the joint.
- Pinocchio 4.1 stores it and does not use it. PyBullet 3.2.7 does not use it in inverse dynamics. Drake 1.51
  warns that it does not support it.

The effect is the friction itself, a few per cent of the torque for a geared arm.

What to do: decide which convention you want. The file is correct, so ``dynx doctor --fix`` does not change
it. dynx returns the rigid-body torque unless called with ``joint_dynamics=True``; doctor compares the
rigid-body torque and prints the call that switches friction off in MuJoCo.
"""

from collections.abc import Iterable

from dynx.rules import CallingRule, Case, Detection, found_at, measured_on
from dynx.rules.attributes import number_or_none
from dynx.rules.joints import SINGLE, elements_in_joints


class FrictionInInverseDynamics(CallingRule):
    advice = "Decide whether torques include friction, and configure MuJoCo accordingly."
    engines = measured_on("mujoco")
    calls = ("mujoco.no_friction",)
    changed = "compared without dry friction"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints that move with a friction that is not zero."""
        for _, dynamics in elements_in_joints(case, "dynamics", SINGLE):
            if friction := number_or_none(dynamics, "friction"):
                yield found_at(dynamics, f"the joint has dry friction {friction:g}")
