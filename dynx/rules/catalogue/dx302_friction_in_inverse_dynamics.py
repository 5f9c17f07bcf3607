"""DX302 friction-in-inverse-dynamics: A joint has dry friction, which MuJoCo adds to the torque and others do
not.

``<dynamics friction="0.2"/>`` is a force against the motion, whatever the speed.

- MuJoCo 4.0 reads it as ``frictionloss``, a constraint. ``mj_inverse`` adds what the constraint takes, up to
  the friction times the sign of the velocity; at low speed, where the constraint can hold the joint, less.
- Pinocchio 4.1 stores it and leaves it to the user. PyBullet 3.2.7 does not use it in inverse dynamics.
  Drake 1.51 warns that it has no dry friction.

The effect is the friction itself, a few per cent of the torque for a geared arm.

What to do: decide which one you want. The file is right, so ``dynx doctor --fix`` does not change it. dynx
gives the rigid-body answer unless asked for ``joint_dynamics=True``; doctor compares that, and prints the
call that makes MuJoCo leave friction out.
"""

from collections.abc import Iterable

from dynx.rules import CallingRule, Case, Detection, found_at, measured_on
from dynx.rules.joints.elements import SINGLE, elements_in_joints
from dynx.rules.text.attributes import number_or_none


class FrictionInInverseDynamics(CallingRule):
    advice = "Decide whether torques include friction, and tell MuJoCo."
    engines = measured_on("mujoco")
    calls = ("mujoco.no_friction",)
    changed = "compared without dry friction"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Joints that move with a friction that is not zero."""
        for _, dynamics in elements_in_joints(case, "dynamics", SINGLE):
            if friction := number_or_none(dynamics, "friction"):
                yield found_at(dynamics, f"the joint has dry friction {friction:g}")
