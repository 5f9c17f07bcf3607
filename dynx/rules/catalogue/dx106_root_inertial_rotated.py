"""DX106 root-inertial-rotated: On a fixed base PyBullet mistakes the axes of the root's inertial frame for
those of the world.

The ``<inertial>`` of the root link has an ``rpy`` that is not zero. With a fixed base the mass of the root
does not matter to the motion, so this should have no effect.

- PyBullet 3.2.7 calculates inverse dynamics and Jacobians in the axes of that inertial frame: the direction
  of gravity and the rows of the Jacobian are rotated. The kinematics and the mass matrix are right, which
  makes the error hard to find.
- Pinocchio 4.1.0, MuJoCo 4.0.0 and Drake 1.51.1 are not affected.

The effect is as large as the rotation: 2 sin(angle/2) of the weight. A rotation by 90 degrees makes gravity
horizontal. Products of inertia of the root have no effect on a fixed base.

What to do: give the root's tensor in the axes of its link.

``dynx doctor --fix`` does that: the tensor is rotated into the axes of the link and the ``rpy`` set to zero.
It is the same body. Nothing is done for a floating base, where there is no such difference.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from dynx.rules import Case, Detection, Remedy, Rule, links_of, measured_on
from dynx.rules.inertia import CentralInertia, line_of, with_inertials
from dynx.spatial.so3 import rotation_from_rpy

_ROUNDING = 4.0 * float(np.finfo(float).eps)


class RootInertialRotated(Rule):
    engines = measured_on("pybullet")
    advice = "Give the root's tensor in the axes of its link, with rpy zero."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the root, on the fixed base, where its inertial frame is rotated."""
        model = case.model
        inertial = case.inertials[model.root]
        if case.base != "fixed" or inertial is None:
            return []
        turn = rotation_from_rpy(np.array(inertial.origin.rpy)) - np.eye(3)
        if float(np.max(np.abs(turn))) <= _ROUNDING:
            return []
        rpy = " ".join(f"{angle:.6g}" for angle in inertial.origin.rpy)
        message = f"the inertial frame of the root is rotated by rpy {rpy}"
        return [Detection(model.root, None, line_of(case, model.root, "origin"), message)]

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy:
        """Return the tensor in the axes of the link."""
        found = {name: case.inertials[name] for name in links_of(detections)}
        new = {name: CentralInertia.of(inertial).aligned() for name, inertial in found.items() if inertial}
        done = "gave the tensor of the root in the axes of its link, with rpy zero"
        return Remedy(with_inertials(case, new), done)
