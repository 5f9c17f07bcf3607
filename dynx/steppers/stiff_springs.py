"""Springs of joints that are too stiff for the steps of a robot.

Every engine has the torque of a spring at the beginning of a step. A joint then obeys v' = v - h k q / I and
q' = q + h v', which is stable up to h^2 k / I = 4 (semi-implicit Euler); of several joints the largest
eigenvalue of h^2 M^-1 K counts. Damping at the end of a step raises the bound: the one without is given.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dynx.errors import shown
from dynx.model import Model
from dynx.model.elements import JointSprings
from dynx.spatial.scalar import Floats

SEMI_IMPLICIT = 4.0
"""Largest stable h^2 k / I of semi-implicit Euler."""

STABLE = {"rk4": 8.0, "adaptive": np.inf}
"""Largest stable h^2 k / I by integrator; `SEMI_IMPLICIT` for all others."""


def notes_on_springs(
    model: Model, springs: JointSprings, M: Floats, h: float, bound: float = SEMI_IMPLICIT, robot: str = ""
) -> Iterator[str]:
    """Yield the joint whose spring is unstable in steps of `h` [s], with the mass matrix `M` (nv, nv),
    armature included."""
    root = h * np.sqrt(np.maximum(springs.stiffness, 0.0))
    values, vectors = np.linalg.eigh(root[:, None] * np.linalg.pinv(M, hermitian=True) * root)
    ratio = float(values[-1])
    if ratio > bound:
        joint = model.coordinate_names[int(np.argmax(np.abs(vectors[6 * model.floating :, -1])))]
        most = h * np.sqrt(bound / ratio)
        yield (
            f"the spring of {shown(robot + joint)} is stiff for steps of {h:.3g} s: k dt^2 is {ratio:.3g} "
            f"times the inertia, and without damping it is unstable above {bound:g}; wanted steps of at most "
            f"{0.99 * most:.3g} s"
        )
