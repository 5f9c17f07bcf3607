"""Gains of motors that are too stiff for the steps of a world.

A motor at the beginning of a step obeys v' = v - h (kp q + kd v) / I and q' = q + h v'. That is stable up to
h kd / I + h^2 kp / (2 I) = 2, with the inertia I of the joint where all others are free to move.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dynx.errors import shown
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import JointLaw


def stiff_gains(
    robot: str, names: Sequence[str], law: JointLaw, implicit: Floats, mobility: Floats, h: float
) -> Iterator[str]:
    """Yield the joint whose law at the beginning of the step is unstable: h kd + h^2 kp / 2 > 2 inertia."""
    damping = (1.0 - implicit) * h * law.kd * mobility
    stiffness = (1.0 - implicit) * h * h * law.kp * mobility
    k = int(np.argmax(damping + 0.5 * stiffness))
    if damping[k] + 0.5 * stiffness[k] <= 2.0:
        return
    if damping[k] >= 0.5 * stiffness[k]:
        gain, ratio, most = "kd dt", damping[k], 2
    else:
        gain, ratio, most = "kp dt^2", stiffness[k], 4
    yield (
        f"the gains of {shown(f'{robot}/{names[k]}')} are stiff for steps of {h:.3g} s: {gain} is "
        f"{ratio:.3g} times the inertia, and such a motor is unstable above {most}; use a PositionMotor, "
        "which has no such bound, smaller gains or more substeps"
    )


def mobility_of(M: Floats) -> Floats:
    """Return the acceleration of each coordinate (nv,) for a unit of its own torque."""
    return np.asarray(np.linalg.pinv(M, hermitian=True).diagonal().copy() if len(M) else np.zeros(0))
