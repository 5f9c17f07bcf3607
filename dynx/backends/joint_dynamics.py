"""Joint dynamics: damping, Coulomb friction and armature of the description, the same for every backend.

They add ``armature a + damping v + friction sign(v)`` to the torque of each moving joint. Those of a mimic
joint act on its driver through its multiplier.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.model import Model
from dynx.spatial.scalar import Floats


class JointDynamicsTerms:
    """The `<dynamics>` of all moving joints: `damping` and `friction` in coordinates of the tree, the rest in
    those of the model."""

    def __init__(self, model: Model) -> None:
        moving = [joint.dynamics for joint in model.joints if joint.moves]
        base = [0.0] * (6 if model.floating else 0)
        self.damping = np.array(base + [d.damping for d in moving])
        self.friction = np.array(base + [d.friction for d in moving])
        armature = np.array(base + [d.armature for d in moving])
        coupling = model.mechanism.coupling
        self._S = np.eye(len(armature)) if coupling is None else coupling.matrix()
        self.armature: Floats = self._S.T @ np.diag(armature) @ self._S
        self.has_armature = bool(np.any(armature != 0.0))

    def friction_torque(self, v: Any) -> Floats:
        """Return the torque (..., nv) of damping and Coulomb friction at velocity v (..., nv)."""
        tree = np.asarray(v) @ self._S.T
        return np.asarray((self.damping * tree + self.friction * np.sign(tree)) @ self._S)

    def armature_torque(self, a: Any) -> Floats:
        """Return the torque (..., nv) of the armature at acceleration a (..., nv)."""
        return np.asarray(np.asarray(a) @ self.armature)
