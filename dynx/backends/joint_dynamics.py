"""Joint dynamics: damping, Coulomb friction, armature and springs of the description, the same for every
backend.

They add ``armature a + damping v + friction sign(v) + stiffness (q - spring_reference)`` to the torque of
each moving joint. Those of a mimic joint act on its driver through its multiplier.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from dynx.model import Model
from dynx.model.elements import JointSprings
from dynx.model.mechanism import springs_of
from dynx.spatial.scalar import Floats


class JointDynamicsTerms:
    """The joint dynamics of all moving joints: `damping`, `friction` and `rotors`, the armature, in
    coordinates of the tree, with zeros for a floating base, `stiffness` (n,) without; the rest in those of
    the model."""

    def __init__(self, model: Model) -> None:
        moving = [joint.dynamics for joint in model.joints for _ in range(joint.n_rates)]
        base = [0.0] * (6 if model.floating else 0)
        self.damping = np.array(base + [d.damping for d in moving])
        self.friction = np.array(base + [d.friction for d in moving])
        self.rotors = np.array(base + [d.armature for d in moving])
        coupling = model.mechanism.coupling
        self._to_tree = None if coupling is None else coupling.matrix()
        self._tree_q = model.mechanism.tree_q
        self._places = list(model.mechanism.places[6 if model.floating else 0 :])
        self.stiffness = np.array([d.stiffness for d in moving])
        self._references = np.array([d.spring_reference for d in moving])
        self.springs: JointSprings | None = None
        """Springs of the model's coordinates; None if no joint has one."""
        if self.stiffness.any():
            self.springs = springs_of(model.mechanism, self.stiffness, self._references)
        self.has_armature = bool(np.any(self.rotors != 0.0))

    @cached_property
    def armature(self) -> Floats:
        """What the armature adds to the mass matrix (nv, nv)."""
        if self._to_tree is None:
            return np.diag(self.rotors)
        return np.asarray(self._to_tree.T @ (self.rotors[:, None] * self._to_tree))

    def friction_torque(self, v: Any) -> Floats:
        """Return the torque (..., nv) of damping and Coulomb friction at velocity v (..., nv)."""
        tree = self._in_tree(v)
        return self._in_model(self.damping * tree + self.friction * np.sign(tree))

    def passive_torque(self, q: Any, v: Any) -> Floats:
        """Return the torque (..., nv) that overcomes damping, Coulomb friction and springs."""
        friction = self.friction_torque(v)
        return friction if self.springs is None else np.asarray(friction - self.springs.torque(q))

    def elastic_energy(self, q: Any) -> Floats:
        """Return the energy of the springs (...,) at q (..., nq) [J]."""
        joints = self._tree_q(q)[..., self._places]
        return np.asarray(0.5 * np.sum(self.stiffness * (joints - self._references) ** 2, axis=-1))

    def armature_torque(self, a: Any) -> Floats:
        """Return the torque (..., nv) of the armature at acceleration a (..., nv)."""
        return self._in_model(self.rotors * self._in_tree(a))

    def _in_tree(self, rates: Any) -> Floats:
        return np.asarray(rates if self._to_tree is None else np.asarray(rates) @ self._to_tree.T)

    def _in_model(self, torque: Floats) -> Floats:
        return torque if self._to_tree is None else np.asarray(torque @ self._to_tree)
