"""Joint friction, external wrenches and armature of a plant.

Every plant uses this code: friction and wrenches become a torque, as a function of time and state, which is
added to that of the motors. So a push or a damper has the same effect in every engine and every integrator.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends import Backend
from dynx.backends.hooks import solve_mass_matrix
from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.control.dynamics import EngineDynamics
from dynx.control.friction import Coefficients, JointFriction
from dynx.control.gains import checked_gain
from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.model.configuration import checked_array, is_real
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED, REFERENCES
from dynx.spatial.scalar import Floats

TIME_ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
"""Relative difference of two times that counts as rounding."""

SLIVER = 1e-6
"""Largest part of a push that may be counted in the step before or after its own."""


@dataclass(frozen=True)
class Push:
    """A wrench (6,), force [N] then moment [N m], on `frame` from `start` [s] for `duration` [s].

    `reference` names the point and the axes of the wrench, as for `external_forces` of a backend. In each
    step of the plant the wrench is constant, multiplied by the share of the step in which the push lasts. So
    the impulse is exact for any start, duration and step, under every integrator.
    """

    frame: str
    wrench: ArrayLike
    start: float = 0.0
    duration: float = np.inf
    reference: str = LOCAL_WORLD_ALIGNED

    def checked(self, model: Model) -> Push:
        """Return a copy with its wrench as an array. Raises ArgumentError for an invalid push on `model`."""
        model.frame_index(self.frame)
        wrench = checked_array("wrench", self.wrench, 6)
        if wrench.ndim != 1 or self.reference not in REFERENCES:
            raise ArgumentError(
                f"a push on {shown(self.frame)} has a wrench of shape {wrench.shape} in "
                f"{shown(self.reference)}; wanted (6,) in one of {', '.join(REFERENCES)}"
            )
        seconds = is_real(self.start) and is_real(self.duration)
        if not seconds or not self.duration > 0.0 or not np.isfinite(self.start):
            raise ArgumentError(
                f"a push on {shown(self.frame)} starts at {shown(self.start)} and lasts "
                f"{shown(self.duration)}; wanted finite, and positive, seconds"
            )
        return Push(self.frame, wrench, float(self.start), float(self.duration), self.reference)

    def share(self, t: float, h: float) -> float:
        """Return the share, from 0 to 1, of the step of length `h` [s] from time `t` [s] in which it acts."""
        # Times on the grid are rounded; a step that begins with the push must not miss the last bit of it.
        rounding = min(TIME_ROUNDING * max(abs(t) + h, abs(self.start)), SLIVER * self.duration)
        since = t - self.start
        if since >= -rounding and since + h <= self.duration + rounding:
            return 1.0
        before, after = (
            0.0 if each <= rounding else self.duration if each >= self.duration - rounding else each
            for each in (since, since + h)
        )
        return (after - before) / h


class Disturbances:
    """Friction, armature and pushes that act on a plant, from the arguments of `dynx.simulate`.

    `step` is the time from one evaluation of `torque` to the next [s].
    """

    def __init__(
        self,
        model: Model,
        damping: Coefficients = False,
        friction: Coefficients = False,
        slip: float = 0.0,
        armature: Coefficients = False,
        pushes: Sequence[Push] = (),
        step: float = 0.0,
    ) -> None:
        """Raises GainError and ArgumentError for coefficients and pushes that `model` cannot have."""
        self.friction = JointFriction(model, damping, friction, slip)
        self.pushes = tuple(push.checked(model) for push in pushes)
        self.armature = _armature_matrix(model, armature)
        """Armature (nv, nv), added to the mass matrix."""
        self.has_armature = bool(self.armature.any())
        self._step = step

    @property
    def has_torque(self) -> bool:
        """Whether friction or pushes add any torque."""
        return self.friction.present or bool(self.pushes)

    @property
    def names(self) -> list[str]:
        """Names of the disturbances present: joint friction, pushes, armature."""
        present = {
            "joint friction": self.friction.present,
            "pushes": bool(self.pushes),
            "armature": self.has_armature,
        }
        return [name for name, is_present in present.items() if is_present]

    def torque(self, engine: Backend, t: float, q: Floats, v: Floats) -> Floats:
        """Return the torque (nv,) of pushes minus that of friction, in a step that began at `t`."""
        tau = -self.friction(v)
        for push in self.pushes:
            share = push.share(t, self._step)
            if share:
                J = engine.jacobian(q, push.frame, reference=push.reference)
                tau = tau + J.T @ (share * np.asarray(push.wrench))
        return tau


class DisturbedAcceleration:
    """Acceleration of a plant under a torque: forward dynamics of a backend, with the disturbances."""

    def __init__(self, engine: Backend, disturbances: Disturbances) -> None:
        self.dynamics = EngineDynamics(engine)
        self._engine = engine
        self._disturbances = disturbances

    @property
    def is_undisturbed(self) -> bool:
        """Whether there are no disturbances, so that it is the backend's forward dynamics alone."""
        return not (self._disturbances.has_torque or self._disturbances.has_armature)

    def __call__(self, q: Floats, v: Floats, tau: Floats, t: float) -> Floats:
        """Return the acceleration (nv,) at state q, v under `tau`, in a step that began at `t`."""
        if self._disturbances.has_torque:
            tau = tau + self._disturbances.torque(self._engine, t, q, v)
        if not self._disturbances.has_armature:
            a: Floats = self.dynamics.forward_dynamics(q, v, tau)
            return a
        M = self.dynamics.mass_matrix(q) + self._disturbances.armature
        return solve_mass_matrix(M, tau - self.dynamics.bias_torque(q, v))


def _armature_matrix(model: Model, armature: Coefficients) -> Floats:
    if isinstance(armature, bool):
        return JointDynamicsTerms(model).armature if armature else np.zeros((model.nv, model.nv))
    base = 6 if model.floating else 0
    joints = checked_gain("armature", armature, model.nv - base, per="one for each joint")
    return np.diag(np.concatenate([np.zeros(base), joints]))
