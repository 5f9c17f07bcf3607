"""Limits of effort along a path: torque as a function of the speed and the acceleration of its parameter.

Along a path q(s) inverse dynamics is tau = a(s) s'' + b(s) s'^2 + d(s) s' + c(s): a and b from the inertia, d
from viscous damping, c from gravity and dry friction (Bobrow, Dubowsky and Gibson, Time-optimal control of
robotic manipulators along specified paths, Int. J. Robotics Research 4(3), 1985).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends import Backend
from dynx.errors import ArgumentError, TrajectoryError
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory.displacement import Ends
from dynx.trajectory.motion_limits import checked_limit

NEGLIGIBLE = 1e-12
"""Part of the largest torque of an acceleration below which that of another joint is rounding."""


class PathTorque(NamedTuple):
    """Coefficients (n, nv) of torque along a path [N m or N]: a s'' + b s'^2 + viscous s' + dry + gravity."""

    a: Floats
    b: Floats
    viscous: Floats
    dry: Floats
    gravity: Floats


@dataclass(frozen=True)
class EffortLimits:
    """Limits of the torque of a robot along a path."""

    engine: Backend
    limit: Floats
    """Largest torque or force of each coordinate (nv,) [N m or N]; infinity means no limit."""
    joint_dynamics: bool
    """Whether damping, dry friction and armature of the description count."""

    @property
    def is_viscous(self) -> bool:
        """True if damping of the description counts."""
        return self.joint_dynamics and any(joint.dynamics.damping for joint in self.engine.model.joints)

    def along(self, q: Floats, slope: Floats, curvature: Floats) -> PathTorque:
        """Return the torque along a path with these q, dq/ds and d2q/ds2 (n, nv)."""
        rest = np.zeros_like(slope)
        gravity = self.engine.inverse_dynamics(q, rest, rest)
        a = self.engine.inverse_dynamics(q, rest, slope) - gravity
        b = self.engine.inverse_dynamics(q, slope, curvature) - gravity
        if not self.joint_dynamics:
            return PathTorque(a, b, rest, rest, gravity)
        # Viscous torque is linear in the speed, and dry friction depends on its sign alone.
        once, twice = self._losses(q, slope, rest), self._losses(q, 2.0 * slope, rest)
        armature = self._losses(q, rest, slope), self._losses(q, rest, curvature)
        return PathTorque(a + armature[0], b + armature[1], twice - once, 2.0 * once - twice, gravity)

    def _losses(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Return the torque (n, nv) of damping, dry friction and armature."""
        whole = self.engine.inverse_dynamics(q, v, a, joint_dynamics=True)
        return np.asarray(whole - self.engine.inverse_dynamics(q, v, a))

    def require_hold(self, torque: PathTorque) -> None:
        """Raise TrajectoryError if a joint cannot bear gravity and dry friction at some place of the path."""
        constant = np.abs(torque.gravity + torque.dry)
        with np.errstate(invalid="ignore"):
            ratio = constant / self.limit
        place, k = np.unravel_index(int(np.argmax(np.nan_to_num(ratio))), ratio.shape)
        if not ratio[place, k] < 1.0:
            # As many digits as tell the need from the limit.
            needed, limit = constant[place, k], self.limit[k]
            digits = next((n for n in (4, 6, 10) if f"{needed:.{n}g}" != f"{limit:.{n}g}"), 6)
            raise TrajectoryError(
                f"the effort limit of {self.engine.model.joint_names[k]} is {limit:.{digits}g}, but gravity "
                f"and dry friction along the path need {needed:.{digits}g}: no motion is slow enough"
            )

    def require_dependence(self, torque: PathTorque) -> None:
        """Raise ArgumentError if no limited torque depends on the acceleration between two grid points."""
        known = np.isfinite(self.limit)
        magnitude = np.abs(torque.a)
        smallest = NEGLIGIBLE * magnitude.max(axis=1, initial=0.0)
        free = (magnitude[:, known] <= smallest[:, None]).all(axis=1)
        unbounded = np.flatnonzero(free[:-1] & free[1:])
        if unbounded.size:
            k = int(np.argmax(magnitude[unbounded[0]]))
            raise ArgumentError(
                f"the effort of {self.engine.model.joint_names[k]} is unlimited, and nothing else limits its "
                "acceleration along the path; wanted acceleration= as well"
            )

    def slowdown(self, q: Floats, v: Floats, a: Floats) -> float:
        """Return the least factor of the duration, at least 1, with which a motion keeps the limits at these
        states (n, nv).

        Raises TrajectoryError if no factor is enough.
        """
        # At 1/u times the duration v is u v and a is u^2 a: as a path with parameter u t.
        torque = self.along(q, v, a)
        # Gravity can be largest between the grid points of TOPP-RA.
        self.require_hold(torque)
        constant = torque.dry + torque.gravity
        with np.errstate(invalid="ignore", divide="ignore"):
            fractions = [
                _least_root(sign * torque.b, sign * torque.viscous, sign * constant - self.limit)
                for sign in (1.0, -1.0)
            ]
        return 1.0 / min(1.0, *(float(each.min(initial=np.inf)) for each in fractions))


def effort_limits(
    effort: bool | ArrayLike, joint_dynamics: bool, ends: Ends, engine: Backend
) -> EffortLimits:
    """Return checked limits: True for those of the model, one number, or (nv,).

    Raises ArgumentError without a model, and TrajectoryError for a limit of 0.
    """
    limit = engine.model.effort_limit if effort is True else checked_limit("effort", effort, ends.nv)
    stuck = np.flatnonzero(~(limit > 0.0))
    if stuck.size:
        raise TrajectoryError(
            f"the limit of effort of {ends.name(int(stuck[0]))} is 0, so that nothing holds or moves it"
        )
    return EffortLimits(engine, np.asarray(limit), joint_dynamics)


def require_model(model: Model | None) -> Model:
    """Raise ArgumentError for limits of effort without a model."""
    if model is None:
        raise ArgumentError("effort is limited for a robot; wanted its model= as well")
    return model


def _least_root(square: Floats, linear: Floats, constant: Floats) -> Floats:
    """Return the least u > 0 at which square u^2 + linear u + constant is 0, where it is negative at u = 0;
    infinity if there is none."""
    discriminant = linear * linear - 4.0 * square * constant
    root = np.sqrt(np.maximum(discriminant, 0.0))
    # The form without cancellation: both roots from the larger sum.
    half = -0.5 * (linear + np.copysign(root, linear))
    candidates = np.stack([half / square, constant / half])
    valid = np.isfinite(candidates) & (candidates > 0.0) & (discriminant >= 0.0)
    return np.asarray(np.where(valid, candidates, np.inf).min(axis=0))
