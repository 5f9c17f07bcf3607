"""DX112 inertial-rotation-ignored: MuJoCo up to 3.13 ignores the rpy of an inertial.

The ``<origin>`` of an ``<inertial>`` may turn the axes about which the tensor is given.

- MuJoCo 3.3.7, 3.12 and 3.13 read the tensor and dropped the rotation: the link spins as if its principal
  axes lay along the link's own (issue 3559 of its repository). MuJoCo 4.0.0 is right.
- Pinocchio 4.1.0, PyBullet 3.2.7, Drake 1.51.1 are right.

The effect: as large as the difference between the principal moments, up to a factor of ten in the mass
matrix for long thin links. Mass and centre of mass are right, so gravity torques are, and poses.

What to do: use MuJoCo 4, or write the tensor in the axes of the link with rpy zero. The latter disagrees
with what PyBullet wants (DX105), by 1e-9.

dynx offers no remedy by edit: it would undo the one of DX105, and a newer MuJoCo needs none.
"""

from collections.abc import Iterable

import numpy as np

from dynx.rules import Case, Detection, Rule, measured_on
from dynx.rules.inertia.central import CentralInertia
from dynx.rules.inertia.edits import line_of
from dynx.rules.inertia.rigid_groups import rigid_groups

_VISIBLE = 1e-14
"""Share of the largest moment."""


class InertialRotationIgnored(Rule):
    engines = measured_on(mujoco=">=3.3.7,<=3.13.0")
    advice = "Use MuJoCo 4."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Links that can move and whose tensor changes where the rotation is left out."""
        groups = rigid_groups(case)
        for link in case.model.links:
            inertial = link.inertial
            if inertial is None or groups[link.name].static or not any(inertial.origin.rpy):
                continue
            change = np.max(np.abs(CentralInertia.of(inertial).tensor - inertial.tensor))
            size = float(np.max(np.abs(inertial.tensor)))
            if change > _VISIBLE * size:
                line = line_of(case, link.name, "origin")
                message = f"without its rpy the tensor is off by {float(change) / size:.2g} of its size"
                yield Detection(link.name, None, line, message)
