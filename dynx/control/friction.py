"""What joints lose: viscous damping and dry friction, one law for plants and for their compensation."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dynx.control.gains import checked_gain
from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.spatial.scalar import Array, Floats, sign, tanh

SLIP = 1e-2
"""Speed [rad/s or m/s] at which dry friction has 76 % of its size, by default."""

LEAST_SLIP = 1e-9
"""Least slip speed but 0: below it the division would overflow before it made a difference."""

Coefficients = bool | ArrayLike
"""True for those of the description, False for none, one number, or one for each joint with a coordinate."""


class JointFriction:
    """The torque that damping and dry friction take: d v + f tanh(v / slip), of each joint.

    With `slip` 0 it is d v + f sign(v), what ``joint_dynamics=True`` means in every backend. Such a jump
    makes a stepper of any kind rattle around rest: within one step the friction throws the joint back
    further than it went. Over the speed `slip` it does not, as long as dt f / (M slip) stays below 2.
    A mimic joint's coefficients act on its driver through its multiplier.
    """

    def __init__(
        self, model: Model, damping: Coefficients = True, friction: Coefficients = True, slip: float = SLIP
    ) -> None:
        """`damping` [N m s/rad or N s/m] and `friction` [N m or N] of the joints or given.

        Raises GainError for coefficients, ArgumentError for a slip speed, that cannot be used.
        """
        if not isinstance(slip, int | float) or not (slip == 0.0 or LEAST_SLIP <= slip < np.inf):
            raise ArgumentError(f"slip is {shown(slip)}; wanted a speed: 0, or {LEAST_SLIP:g} or more")
        self.slip = float(slip)
        moving = [joint.dynamics for joint in model.joints if joint.moves]
        of_model = damping is True, friction is True
        coupling = model.mechanism.coupling
        # The description's are those of the tree's joints, given ones those of the coordinates.
        through = coupling is not None and any(of_model)
        self._S = coupling.matrix() if coupling is not None and through else None
        base = [0.0] * (6 if model.floating else 0)
        own_damping = np.array(base + [joint.damping for joint in moving])
        own_friction = np.array(base + [joint.friction for joint in moving])
        self.damping = self._coefficients("damping", damping, own_damping, model, through)
        self.friction = self._coefficients("friction", friction, own_friction, model, through)
        self._dry = bool(self.friction.any())
        self.present = bool(self.damping.any()) or self._dry

    def __call__(self, v: Array) -> Array:
        """The torque (..., nv) that is lost at velocity `v` (..., nv), arrays of any scalar."""
        return self.lost(v, self.damping, self.friction)

    def lost(self, v: Array, damping: Array, friction: Array) -> Array:
        """The same with other coefficients, in the places of this one's."""
        speed = v if self._S is None else v @ self._S.T
        lost = damping * speed
        if self._dry:
            lost = lost + friction * (tanh(speed / self.slip) if self.slip else sign(speed))
        return np.asarray(lost if self._S is None else lost @ self._S)

    @staticmethod
    def _coefficients(name: str, given: Coefficients, own: Floats, model: Model, through: bool) -> Floats:
        if isinstance(given, bool):
            return own if given else np.zeros(model.mechanism.nv if through else model.nv)
        base = 6 if model.floating else 0
        asked = checked_gain(name, given, model.nv - base, per="one for each joint")
        # To the joints that own a coordinate: none to the base, and in the tree none to those that follow.
        owns = [joint.mimic is None for joint in model.joints if joint.moves]
        joints = np.zeros(len(owns) if through else len(asked))
        joints[owns if through else slice(None)] = asked
        return np.concatenate([np.zeros(base), joints])
