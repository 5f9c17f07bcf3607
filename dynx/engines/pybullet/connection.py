"""A Bullet client with one robot in it, and the engine calls that dynx makes.

Everything is in Bullet's conventions: its world is the inertial frame of the root (centre of mass, principal
axes), joints and links have Bullet's indices, and joint values are lists of floats. The module receives
`pybullet` as an argument and does not import it.

Each robot has its own client, because Bullet caches the tree of its inverse dynamics by the address of a
body, even after the body is removed: a later robot at the same address would get the torques of the earlier
one.
"""

from __future__ import annotations

import weakref
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from math import isfinite
from types import ModuleType
from typing import Any, ClassVar

import numpy as np

from dynx.engines.decimal_point import decimal_point
from dynx.errors import DynxError, EngineError
from dynx.model.mechanism import ROOT
from dynx.spatial.scalar import Floats

Reals = list[float]
ORIGIN = [0.0, 0.0, 0.0]
_UPRIGHT = [0.0, 0.0, 0.0, 1.0]

_FAILURES = (SystemError, TypeError, ValueError)
"""Exceptions of engine calls, beside the engine's own."""


class BulletConnection(ABC):
    """One robot in a Bullet client. Of a floating base, angular components come before linear ones."""

    not_finite_error: ClassVar[type[DynxError]] = EngineError
    """Class of the error for an argument with NaN or infinity."""

    floating: bool
    links: list[int]
    """Numbers of all links but the root; each has the number of the joint that carries it."""

    moving: list[int]
    """Numbers of the joints that can move, in the order of Bullet's coordinates."""

    body: int

    def __init__(self, engine: ModuleType, robot: str) -> None:
        self.engine = engine
        self._robot = robot

    @abstractmethod
    def _load(self) -> None:
        """Load the robot into the new client."""

    def _connect(self) -> None:
        """Open a client and load the robot. Steps of unit length add the acceleration to the velocity."""
        self._client = int(self.engine.connect(self.engine.DIRECT))
        if self._client < 0:
            raise EngineError("Bullet has no client left (1,024 at most); close backends that are not needed")
        # Also called when the connection is garbage-collected.
        self._disconnect = weakref.finalize(self, _disconnect, self.engine, self._client)
        self._gravity: Reals = []
        self._at_origin = False
        try:
            self.call(
                self.engine.setPhysicsEngineParameter, fixedTimeStep=1.0, numSubSteps=0, enableFileCaching=0
            )
            with decimal_point():
                self._load()
        except BaseException:
            self.close()
            raise

    def _reopen(self) -> None:
        self.close()
        self._connect()

    def close(self) -> None:
        """Disconnect the client; closing twice is harmless."""
        self._disconnect()

    def call(self, function: Callable[..., Any], *args: Any, **options: Any) -> Any:
        """Call the engine and return the result. Raises EngineError, with its message, if it fails."""
        try:
            return function(*args, physicsClientId=self._client, **options)
        except (*_FAILURES, self.engine.error) as error:
            raise self._failure(function, error) from error

    def _failure(self, function: Callable[..., Any], error: BaseException) -> EngineError:
        message = error.__cause__ or error
        return EngineError(f"pybullet failed in {function.__name__} for {self._robot}: {message}")

    def check(self, *arguments: Sequence[float]) -> None:
        """Raise `not_finite_error` for NaN and infinity, which would survive every reset of Bullet."""
        if not isfinite(sum(map(sum, arguments))) and not all(isfinite(x) for xs in arguments for x in xs):
            raise self.not_finite_error(f"an argument for {self._robot} in pybullet holds NaN or infinity")

    # -- quantities ---------------------------------------------------------------------------

    def com_poses(self, joints: Reals) -> tuple[Floats, Floats]:
        """Return positions (n, 3) and attitudes, quat_xyzw (n, 4), of the inertial frames of all links."""
        self.reset_joints(joints)
        if not self.links:
            return np.zeros((0, 3)), np.zeros((0, 4))
        # Only entries 0 and 1 are used: the pose of the link frame in entries 4 and 5 is rounded to single
        # precision.
        states = self.call(self.engine.getLinkStates, self.body, self.links, 0, 1)
        return np.array([state[0] for state in states]), np.array([state[1] for state in states])

    def jacobian(self, joints: Reals, link: int, point: Reals) -> Floats:
        """Return the Jacobian (6, nv), linear rows first; columns angular base, linear base, joints.

        `point` is measured from the origin of the link frame along the link's principal axes.
        """
        self.check(joints)
        rest = [0.0] * len(joints)
        linear, angular = self.call(self.engine.calculateJacobian, self.body, link, point, joints, rest, rest)
        return np.array([*linear, *angular])

    def mass_matrix(self, joints: Reals) -> Floats:
        """Return the mass matrix (nv, nv); rows angular base, linear base, joints."""
        self.check(joints)
        return np.array(self.call(self.engine.calculateMassMatrix, self.body, joints))

    def inverse_dynamics(self, joints: Reals, v: Reals, a: Reals, gravity: Reals) -> Floats:
        """Return the force, torque (3 each, with a floating base only) and joint torques.

        `v` and `a` are angular base, linear base, joints; the linear acceleration is the classical one of
        the root's centre of mass.
        """
        # The root is at the identity, because Bullet misreads attitudes about several axes.
        q = [*ORIGIN, *_UPRIGHT, *joints] if self.floating else joints
        if not isfinite(sum(joints) + sum(v) + sum(a)):
            self.check(joints, v, a)
        if gravity != self._gravity:
            # NaN differs from itself.
            self.check(gravity)
            self.set_gravity(gravity)
        function = self.engine.calculateInverseDynamics
        try:
            # As `call` does, which takes a third of a microsecond more.
            return np.array(function(self.body, q, v, a, physicsClientId=self._client))
        except (*_FAILURES, self.engine.error) as error:
            raise self._failure(function, error) from error

    def velocity_step(self, joints: Reals, v: Reals, tau: Reals, gravity: Reals) -> Floats:
        """Return the change of the velocity `v` (angular base, linear base, joints) in one step of unit
        length.

        `tau` is torque and force on the base (with a floating base only), then joint torques.
        """
        base = 6 if self.floating else 0
        if not isfinite(sum(joints) + sum(v) + sum(tau) + sum(gravity)):
            self.check(joints, v, tau, gravity)
        try:
            self.set_gravity(gravity)
            self.reset_joints(joints, v[base:])
            if base:
                if not self._at_origin:
                    self._reset_base()
                self.call(self.engine.resetBaseVelocity, self.body, v[3:6], v[:3])
                self.push_base(tau[3:6], tau[:3], ORIGIN)
            if joints:
                self.control_motors(self.engine.TORQUE_CONTROL, forces=tau[base:])
            self.call(self.engine.stepSimulation)
            after = self._velocities()
            if base:
                self._reset_base()
        except EngineError:
            self._reopen()
            raise
        if not isfinite(sum(after)):
            # A state that is not finite would persist in the world, whatever is reset afterwards.
            self._reopen()
        # NumPy would warn of infinities, which the caller finds in the result.
        return np.array([new - old for new, old in zip(after, v, strict=True)])

    # -- state and forces ---------------------------------------------------------------------

    def reset_joints(self, joints: Reals, velocities: Reals | None = None) -> None:
        """Set the state of all joints; they are at rest by default."""
        self.check(joints, velocities or ())
        if joints:
            rates = [0.0] * len(joints) if velocities is None else velocities
            self.call(
                self.engine.resetJointStatesMultiDof,
                self.body,
                self.moving,
                [[x] for x in joints],
                [[x] for x in rates],
            )

    def place_base(self, position: Reals, quat_xyzw: Reals) -> None:
        """Set the pose of the root's inertial frame in Bullet's world."""
        self.check(position, quat_xyzw)
        self._at_origin = False
        self.call(self.engine.resetBasePositionAndOrientation, self.body, position, quat_xyzw)

    def base_pose(self) -> tuple[Reals, Reals]:
        """Return the position and quat_xyzw of the root's inertial frame in Bullet's world."""
        position, quat = self.call(self.engine.getBasePositionAndOrientation, self.body)
        return list(position), list(quat)

    def set_gravity(self, gravity: Reals) -> None:
        """Set gravity (3,) [m/s^2] along the axes of Bullet's world."""
        if gravity != self._gravity:
            self.call(self.engine.setGravity, *gravity)
            self._gravity = gravity

    def push_base(self, force: Reals, torque: Reals, point: Reals) -> None:
        """Apply a force at a point of Bullet's world, and a torque, to the base during the next step."""
        self.check(force, torque, point)
        frame = self.engine.WORLD_FRAME
        self.call(self.engine.applyExternalForce, self.body, ROOT, force, point, frame)
        self.call(self.engine.applyExternalTorque, self.body, ROOT, torque, frame)

    def add_torques(self, torques: Reals) -> None:
        """Apply joint torques during the next step, in addition to those of motors."""
        if not isfinite(sum(torques)):
            self.check(torques)
        if torques:
            engine, client = self.engine, self._client
            try:
                # As `control_motors` does, which takes a microsecond more.
                engine.setJointMotorControlArray(
                    self.body, self.moving, engine.TORQUE_CONTROL, forces=torques, physicsClientId=client
                )
            except (*_FAILURES, engine.error) as error:
                raise self._failure(engine.setJointMotorControlArray, error) from error

    def control_motors(self, mode: int, **targets: Reals) -> None:
        """Set the control mode of all joints, with the targets, gains and forces of their motors."""
        self.call(self.engine.setJointMotorControlArray, self.body, self.moving, mode, **targets)

    def release_motors(self) -> None:
        """Release the velocity motors that Bullet gives to every joint."""
        if self.moving:
            self.control_motors(self.engine.VELOCITY_CONTROL, forces=[0.0] * len(self.moving))

    def disable_damping(self) -> None:
        """Switch off the damping of the base and the limit of joint speeds, which are not the file's."""
        # This needs a separate call: together with a setting of a link, Bullet would apply that setting to
        # the root.
        options = {"linearDamping": 0.0, "angularDamping": 0.0, "maxJointVelocity": 1e300}
        self.call(self.engine.changeDynamics, self.body, ROOT, **options)

    def _reset_base(self) -> None:
        self.call(self.engine.resetBasePositionAndOrientation, self.body, ORIGIN, _UPRIGHT)
        self._at_origin = True

    def _velocities(self) -> Reals:
        base: Reals = []
        if self.floating:
            linear, angular = self.call(self.engine.getBaseVelocity, self.body)
            base = [*angular, *linear]
        if not self.moving:
            return base
        return base + [state[1] for state in self.call(self.engine.getJointStates, self.body, self.moving)]


def _disconnect(engine: ModuleType, client: int) -> None:
    if engine.isConnected(client):
        engine.disconnect(client)
