"""DX301 damping-in-inverse-dynamics: A joint has damping, which some engines add to the torque and others do
not.

``<dynamics damping="0.5"/>`` resists the velocity of a joint. There are two conventions on whether inverse
dynamics includes it:

- Pinocchio 4.1 (``rnea``) and PyBullet 3.2.7 (``calculateInverseDynamics``): rigid bodies only.
- MuJoCo 4.0 (``mj_inverse``): damping times velocity is added.
- Drake 1.51 (``CalcInverseDynamics`` with the plant's force elements): likewise.
- Forward dynamics: PyBullet's ``stepSimulation``, MuJoCo and Drake damp, Pinocchio's ``aba`` does not.

The effect is damping times velocity, often a few per cent of the torque. Where the inertia is low, it is most
of the torque.

What to do: decide which convention you want, and add ``damping * v`` to Pinocchio's torque or switch damping
off in the others. The file is correct, so ``dynx doctor --fix`` does not change it. dynx returns the
rigid-body torque unless called with ``joint_dynamics=True``; doctor compares the rigid-body torque and prints
the calls that switch damping off in each engine.
"""

from collections.abc import Iterable

from dynx.rules import CallingRule, Case, Detection, found_at, measured_on
from dynx.rules.attributes import number_or_none
from dynx.rules.joints import SINGLE, elements_in_joints


class DampingInInverseDynamics(CallingRule):
    advice = "Decide whether torques include damping, and configure each engine accordingly."
    engines = measured_on("pybullet", "mujoco", "drake")
    calls = ("pybullet.no_damping", "mujoco.no_damping", "drake.no_damping")
    changed = "compared without joint damping"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints that move with a damping that is not zero."""
        for _, dynamics in elements_in_joints(case, "dynamics", SINGLE):
            if damping := number_or_none(dynamics, "damping"):
                yield found_at(dynamics, f"the joint has damping {damping:g}")
