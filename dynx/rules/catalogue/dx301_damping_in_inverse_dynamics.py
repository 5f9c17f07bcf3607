"""DX301 damping-in-inverse-dynamics: a joint has damping, which some engines add to the torque

``<dynamics damping="0.5"/>`` resists the speed of a joint. Whether inverse dynamics contains it is a
convention, and there are two:

- Pinocchio 4.1 (``rnea``) and PyBullet 3.2.7 (``calculateInverseDynamics``): rigid bodies alone.
- MuJoCo 4.0 (``mj_inverse``): damping times velocity is added.
- Drake 1.51 (``CalcInverseDynamics`` with the plant's force elements): likewise.
- Forward dynamics: PyBullet's ``stepSimulation``, MuJoCo and Drake damp, Pinocchio's ``aba`` does not.

The effect is damping times velocity, often a few per cent of the torque, and all of it at low inertia.

What to do: decide which one you want, and add ``damping * v`` to Pinocchio's torque or switch it off in the
others. The file is right, so ``dynx doctor --fix`` does not change it. dynx gives the rigid-body answer
unless asked for ``joint_dynamics=True``; doctor compares that, and prints the calls that make each engine
leave damping out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

from dynx.rules.case import Case
from dynx.rules.joints.elements import SINGLE, elements_in_joints
from dynx.rules.rule import Detection
from dynx.rules.text.attributes import number_or_none
from dynx.rules.text.editing import CallingRule, found_at


class DampingInInverseDynamics(CallingRule):
    """DX301."""

    id = "DX301"
    name = "damping-in-inverse-dynamics"
    title = "A joint has damping, which some engines add to the torque and others do not."
    advice = "Decide whether torques include damping, and tell each engine."
    engines: ClassVar[Mapping[str, str]] = {
        "pybullet": ">=3.2.7",
        "mujoco": ">=4.0.0",
        "drake": ">=1.51.1",
    }
    calls: ClassVar[tuple[str, ...]] = ("pybullet.no_damping", "mujoco.no_damping", "drake.no_damping")
    changed = "compared without joint damping"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Joints that move with a damping that is not zero."""
        for _, dynamics in elements_in_joints(case, "dynamics", SINGLE):
            if damping := number_or_none(dynamics, "damping"):
                yield found_at(dynamics, f"the joint has damping {damping:g}")
