"""DX112 inertial-rotation-ignored: MuJoCo up to 3.13 ignores the rpy of an inertial.

The ``<origin>`` of an ``<inertial>`` may rotate the axes in which the tensor is given.

- MuJoCo 3.3.7, 3.12 and 3.13 read the tensor and dropped the rotation: the tensor is used as if it were given
  in the axes of the link (issue 3559 of its repository). MuJoCo 4.0.0 is right.
- Pinocchio 4.1.0, PyBullet 3.2.7, Drake 1.51.1 are right.

The effect: as large as the difference between the principal moments, up to a factor of ten in the mass matrix
for long thin links. Mass and centre of mass are right, so gravity torques are, and poses.

What to do: use MuJoCo 4, or write the tensor in the axes of the link with rpy zero. The latter costs PyBullet
an error of 1e-9 (DX105).

dynx offers no edit: it would undo the remedy of DX105, and newer versions of MuJoCo need none.
"""

from collections.abc import Iterable

import numpy as np

from dynx.rules import Case, Detection, Rule, measured_on
from dynx.rules.inertia import CentralInertia, inertials_in_groups, line_of

_MAX_CHANGE = 1e-14
"""Largest change, relative to the largest moment, that is not reported."""


class InertialRotationIgnored(Rule):
    engines = measured_on(mujoco=">=3.3.7,<=3.13.0")
    advice = "Use MuJoCo 4."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links that can move and whose tensor changes where the rotation is left out."""
        for name, inertial, group in inertials_in_groups(case):
            if group.static or not any(inertial.origin.rpy):
                continue
            change = np.max(np.abs(CentralInertia.of(inertial).tensor - inertial.tensor))
            size = float(np.max(np.abs(inertial.tensor)))
            if change > _MAX_CHANGE * size:
                line = line_of(case, name, "origin")
                message = f"without its rpy the tensor is off by {float(change) / size:.2g} of its size"
                yield Detection(name, None, line, message)
