"""DX201 axis-not-unit: The axis of a joint is not a unit vector.

URDF says that ``<axis xyz="..."/>`` should have length 1. A wrong length does not change the direction, and
most readers normalise the axis. Typical are axes such as ``0 0 -2`` or ``1 1 0``, and axes that were rounded
to six digits, ``0.577350 0.577350 0.577350``, whose length is off by 1e-6.

- PyBullet 3.2.7 keeps the length. A prismatic joint then moves by length times its coordinate, and the
  positions of all links behind it are wrong in proportion. The simulation (``stepSimulation``) uses the long
  axis for every type of joint: accelerations are wrong in proportion. ``calculateInverseDynamics``,
  ``calculateMassMatrix`` and ``calculateJacobian`` scale it to 1, with a warning on stdout, so PyBullet
  contradicts itself.
- Pinocchio 4.1, MuJoCo 4.0 and Drake 1.51 scale it to 1. So does dynx.
- An axis shorter than about 1e-6 counts as zero in MuJoCo and Drake, which refuse the file.

The effect is the deviation of the length from 1: 1e-7 for a rounded axis, 1 for an axis of length 2.

What to do: write unit axes with 17 digits. ``dynx doctor --fix`` writes the axis that dynx uses.
"""

from collections.abc import Iterable

import numpy as np

from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.attributes import vector_of
from dynx.rules.joints import SINGLE, elements_in_joints
from dynx.rules.numbers_in_text import decimal

_ROUNDING = 1e-15
"""Distance from 1 of the length of a rounded unit vector; dynx does not change such an axis."""


class AxisNotUnit(EditingRule):
    advice = "Scale the axis to length 1 and write 17 digits."
    engines = measured_on("pybullet", "mujoco", "drake")
    changed = "scaled the axes of joints to length 1"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the axes of revolute, continuous and prismatic joints."""
        for joint, axis in elements_in_joints(case, "axis", SINGLE):
            written = vector_of(axis, "xyz")
            if written is None:
                continue
            largest = max(map(abs, written))
            length = largest * float(np.linalg.norm(np.array(written) / largest))
            if abs(length - 1.0) > _ROUNDING:
                message = f"the axis {axis.attributes['xyz']} has length {length:.9g}"
                unit = case.model.joint(joint.attributes["name"]).axis
                edit = case.source.attribute_edit(axis, "xyz", " ".join(map(decimal, unit)))
                yield correction(axis, message, edit)
