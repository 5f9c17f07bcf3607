"""Torques, external forces and motors of one call of `World.step`, as forces that an engine applies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from math import hypot
from typing import TypeVar

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from dynx.backends import Backend, backend
from dynx.backends.hooks import cholesky_solver
from dynx.errors import ArgumentError, ShapeError, UnknownNameError, nearest, shown
from dynx.model.numbers import checked_entries, real_array
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import ExternalForce
from dynx.steppers.layout import RobotLayout
from dynx.world.motors import JointLaw, Motor, combine

_FLOAT64 = np.dtype(np.float64)


class RobotLoads:
    """The generalised force on one robot: given torques, external forces on its links, and its motors."""

    def __init__(self, robot: RobotLayout, h: float) -> None:
        """`h` is the step of the engine [s]."""
        self.name = robot.name
        self.model = robot.model
        self._base = 6 if robot.model.floating else 0
        self._h = h
        self._nothing = np.zeros(robot.model.nv)
        self._motors: tuple[Motor, ...] = ()
        self.memory: tuple[Floats, Floats] | None = None
        """Velocity and generalised force (nv,) of the step before, on which motors at the end of a step
        depend; None if there was no such step."""

    @cached_property
    def dynamics(self) -> Backend:
        """The backend that computes mass matrices and Jacobians."""
        return backend(DEFAULT_ENGINE, self.model, validate=False)

    @property
    def has_motors(self) -> bool:
        """True if the robot has a motor in this call."""
        return bool(self._motors)

    @property
    def depends_on_joints(self) -> bool:
        """True if the motors depend on positions and velocities of joints alone, not on the whole motion."""
        return bool(self._motors) and not self._law.implicit

    @property
    def law(self) -> tuple[JointLaw | None, Floats | None]:
        """Law of the motors, and 1 for the joints where it holds at the end of a step, else 0."""
        return (self._law, self._implicit_joints) if self._motors else (None, None)

    def set_motors(self, motors: Sequence[Motor]) -> None:
        """Use these motors in the next calls of `torque`."""
        if [*map(id, motors)] != [*map(id, self._motors)]:
            law, implicit = self._law, self._implicit_joints = combine(self.model, motors)
            self._motors = tuple(motors)
            # At the end of the step: q + h v+ in place of q, v+ = v + h a in place of v.
            self._ahead = implicit * self._h * law.kp
            self._inertia = implicit * self._h * (law.kd + self._h * law.kp)
            self._metric = np.diag(np.concatenate([np.zeros(self._base), self._inertia]))
            self._saturates = bool(np.isfinite(law.max_force).any())

    def torque(
        self,
        q: Floats,
        v: Floats,
        tau: Floats | None,
        forces: Sequence[tuple[str, ExternalForce, float]],
    ) -> Floats:
        """Return the generalised force (nv,) in a step from q, v: `tau`, external forces on frames with their
        shares of the step, motors."""
        total = self._nothing if tau is None else tau
        for frame, force, share in forces:
            J, wrench = force.at_frame(self.dynamics, frame, q, share)
            total = total + J.T @ wrench
        if not self._motors:
            return total
        return self._with_motors(q, v, total)

    def torque_of_joints(self, positions: Floats, rates: Floats, tau: Floats | None) -> Floats:
        """Return `torque` without external forces where the motors depend on the joints alone.

        `positions` and `rates` (n,) are those of the joints."""
        total: Floats = (self._nothing if tau is None else tau).copy()
        total[self._base :] += self._saturated(self._motor_torque(positions, rates))
        return total

    def _motor_torque(self, positions: Floats, rates: Floats) -> Floats:
        law = self._law
        return law.torque + law.kp * (law.target - positions) + law.kd * (law.velocity - rates)

    def _saturated(self, motor: Floats) -> Floats:
        if not self._saturates:
            return motor
        return np.minimum(np.maximum(motor, -self._law.max_force), self._law.max_force)

    def _with_motors(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        base = self._base
        rates = v[base:]
        motor = self._motor_torque(q[7:] if base else q, rates)
        if self._law.implicit:
            motor = self._implicit(q, v, tau, motor - self._ahead * rates)
        total: Floats = tau.copy()
        total[base:] += self._saturated(motor)
        if self._law.implicit:
            self.memory = (v, total)
        return total

    def _implicit(self, q: Floats, v: Floats, tau: Floats, motor: Floats) -> Floats:
        """Return the torque of motors whose law holds at the end of the step.

        With the torque `motor` for the acceleration 0, that for the acceleration a is motor - K a, where
        (M + K) a = motor + all other forces. The other forces, except `tau`, are those of the step before.
        """
        M = self.dynamics.mass_matrix(q)
        if self.memory is None:
            others = -self.dynamics.bias_torque(q, v)
        else:
            v_before, tau_before = self.memory
            others = M.dot((v - v_before) / self._h) - tau_before
        others += tau
        others[self._base :] += motor
        return np.asarray(motor - self._inertia * _acceleration(M + self._metric, others)[self._base :])


def _acceleration(M: Floats, tau: Floats) -> Floats:
    """Return the solution a of M a = tau for a symmetric, positive definite M."""
    if not len(tau):
        return tau
    # NumPy's solver takes four times as long for matrices of this size.
    _, a, failed = cholesky_solver()(M, tau)
    # A joint that moves no mass keeps its velocity.
    return np.asarray(np.linalg.lstsq(M, tau)[0] if failed else a)


def checked_torques(
    torques: Mapping[str, ArrayLike], robots: Mapping[str, tuple[int, tuple[int]]]
) -> list[tuple[int, Floats]]:
    """Return the torque of each robot named; `robots` has the number of each and the shape of its torque.

    Raises UnknownNameError, ShapeError, DTypeError or NotFiniteError, naming the robot.
    """
    if type(torques) is not dict and not isinstance(torques, Mapping):
        raise ArgumentError(f"torques is of type {type(torques).__name__}; wanted a dict by robot")
    checked: list[tuple[int, Floats]] = []
    for name, tau in torques.items():
        try:
            number, shape = robots[name]
        except KeyError:
            number, shape = found_robot(name, robots)
        if type(tau) is not ndarray or tau.dtype is not _FLOAT64 or tau.shape != shape:
            tau = real_array(f"torque of {name}", tau)
            if tau.shape != shape:
                raise ShapeError(f"torque of {name} has shape {tau.shape}; wanted {shape}")
        # Entries are below the bound where their norm is, which of few numbers Python computes fastest.
        if not hypot(*tau.tolist()) < 1e50:
            checked_entries(f"torque of {name}", tau)
        checked.append((number, tau))
    return checked


_T = TypeVar("_T")


def found_robot(name: str, robots: Mapping[str, _T]) -> _T:
    """Return the entry of a robot; UnknownNameError for another name."""
    try:
        return robots[name]
    except (KeyError, TypeError):
        raise UnknownNameError(f"no robot {shown(name)}{nearest(str(name), robots)}") from None
