"""A Bullet world with one robot in it, loaded from its file, and raw questions to it.

A client of its own for each robot, because Bullet keeps the tree of its inverse dynamics under the
address of a body, and a later body at that address would get the torques of the one before. What
belongs to a call rather than to the file is set as a careful user sets it: no motors, no damping of
the whole body, no speed clamp, steps of unit length, so that what a step adds to the velocity is the
acceleration. Joint damping and joint limits of the file are left as loaded.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from math import isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any

import numpy as np

from dynx.engines.silence import overhear
from dynx.errors import EngineError
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat

ROOT = -1
"""Bullet's number of the root link."""

Reals = list[float]
Setting = Callable[["BulletWorld"], None]
_ORIGIN = [0.0, 0.0, 0.0]
_UPRIGHT = [0.0, 0.0, 0.0, 1.0]


class BulletWorld:
    """One robot as `loadURDF` made it. Joints and links have Bullet's numbers; lists of floats."""

    def __init__(self, engine: ModuleType, path: Path, robot: str, *, fixed: bool) -> None:
        self.engine = engine
        self._robot, self._fixed = robot, fixed
        self._file = path.read_bytes()
        self._settings: list[Setting] = []
        self._refusal: EngineError | None = None
        self.said: list[str] = []
        """The lines that Bullet printed while it loaded."""
        self._open(path)
        self.n_joints = int(self.ask(engine.getNumJoints, self.body))
        self.joints = [self.ask(engine.getJointInfo, self.body, k) for k in range(self.n_joints)]
        """`getJointInfo` of every joint, as loaded."""
        self.moving = [k for k, info in enumerate(self.joints) if info[2] != engine.JOINT_FIXED]
        """Numbers of the joints that can move, in the order of Bullet's coordinates."""
        self.static = fixed or self.dynamics(ROOT)[0] == 0.0
        """Whether the base is nailed to the world."""

    def apply(self, setting: Setting) -> None:
        """Change something in the world, now and whenever it has to be opened anew."""
        self._settings.append(setting)
        setting(self)

    def close(self) -> None:
        """Give the client back; harmless when it was done before."""
        self._disconnect()

    def ask(self, question: Callable[..., Any], *args: Any, **options: Any) -> Any:
        """The answer of the engine; EngineError in its own words where it fails."""
        try:
            return question(*args, physicsClientId=self._client, **options)
        except (SystemError, TypeError, ValueError, self.engine.error) as error:
            words = error.__cause__ or error
            raise EngineError(f"pybullet failed in {question.__name__} for {self._robot}: {words}") from error

    def dynamics(self, link: int) -> Any:
        """`getDynamicsInfo` of a link."""
        return self.ask(self.engine.getDynamicsInfo, self.body, link)

    def com_frame(self, link: int) -> Floats:
        """T_link_com (4, 4), the inertial frame of a link as Bullet holds it."""
        info = self.dynamics(link)
        return homogeneous(rotation_from_quat(np.array(info[4])), np.array(info[3]))

    # -- questions ----------------------------------------------------------------------------

    def com_poses(self, joints: Reals) -> tuple[Floats, Floats]:
        """Positions (n, 3) and attitudes, quat_xyzw (n, 4), of the inertial frames of all links but the
        root, from the double-precision entries of `getLinkStates`."""
        self._reset_joints(joints, [0.0] * len(joints))
        if not self.n_joints:
            return np.zeros((0, 3)), np.zeros((0, 4))
        numbers = list(range(self.n_joints))
        states = self.ask(self.engine.getLinkStates, self.body, numbers, 0, 1)
        return np.array([state[0] for state in states]), np.array([state[1] for state in states])

    def base_pose(self) -> tuple[Reals, Reals]:
        """Position and quat_xyzw of the root's inertial frame in Bullet's world."""
        position, quat = self.ask(self.engine.getBasePositionAndOrientation, self.body)
        return list(position), list(quat)

    def place_base(self, position: Reals, quat_xyzw: Reals) -> None:
        """Put the root's inertial frame somewhere in Bullet's world."""
        self._check(position, quat_xyzw)
        self.ask(self.engine.resetBasePositionAndOrientation, self.body, position, quat_xyzw)

    def make_tree(self) -> None:
        """Let Bullet make the tree of its inverse dynamics; where it refuses, each question that needs
        the tree will raise the error."""
        rest = [0.0] * (len(self.moving) + (0 if self.static else 6))
        if not rest:
            return
        self._refusal = None
        try:
            with overhear(self.said):
                self.inverse_dynamics([0.0] * len(self.moving), rest, rest, _ORIGIN)
        except EngineError as error:
            self._refusal = error

    @property
    def refused(self) -> bool:
        """Whether Bullet refuses to make that tree."""
        return self._refusal is not None

    def _require_tree(self) -> None:
        # Asked again Bullet fails again, and prints.
        if self._refusal is not None:
            raise EngineError(str(self._refusal)) from self._refusal

    def jacobian(self, joints: Reals, link: int) -> Floats:
        """(6, nv) of the origin of a link frame, linear rows first; columns angular, linear, joints."""
        self._require_tree()
        self._check(joints)
        rest = [0.0] * len(joints)
        linear, angular = self.ask(
            self.engine.calculateJacobian, self.body, link, _ORIGIN, joints, rest, rest
        )
        return np.array([*linear, *angular])

    def mass_matrix(self, joints: Reals) -> Floats:
        """(nv, nv); rows angular base, linear base, joints."""
        self._require_tree()
        self._check(joints)
        return np.array(self.ask(self.engine.calculateMassMatrix, self.body, joints))

    def inverse_dynamics(self, joints: Reals, v: Reals, a: Reals, gravity: Reals) -> Floats:
        """Force, torque (with a free base only) and joint torques; v, a: angular, linear, joints."""
        self._require_tree()
        self._check(joints, v, a, gravity)
        # Attitudes about more than one axis are misread: the base stands upright and gravity turns.
        q = joints if self.static else [*_ORIGIN, *_UPRIGHT, *joints]
        self.ask(self.engine.setGravity, *gravity)
        return np.array(self.ask(self.engine.calculateInverseDynamics, self.body, q, v, a))

    def velocity_step(self, joints: Reals, v: Reals, tau: Reals, gravity: Reals) -> Floats:
        """What one step of unit length adds to `v`: angular, linear base, joints.

        `tau` is torque, force on the base (with a free base only), then joint torques.
        """
        base = 0 if self.static else 6
        self._check(joints, v, tau, gravity)
        self.ask(self.engine.setGravity, *gravity)
        self._reset_joints(joints, v[base:])
        if base:
            self.place_base(_ORIGIN, _UPRIGHT)
            self.ask(self.engine.resetBaseVelocity, self.body, v[3:6], v[:3])
            frame = self.engine.WORLD_FRAME
            self.ask(self.engine.applyExternalForce, self.body, ROOT, tau[3:6], _ORIGIN, frame)
            self.ask(self.engine.applyExternalTorque, self.body, ROOT, tau[:3], frame)
        if joints:
            self.ask(
                self.engine.setJointMotorControlArray,
                self.body,
                self.moving,
                self.engine.TORQUE_CONTROL,
                forces=tau[base:],
            )
        self.ask(self.engine.stepSimulation)
        after: Reals = []
        if base:
            linear, angular = self.ask(self.engine.getBaseVelocity, self.body)
            after = [*angular, *linear]
        if joints:
            after += [state[1] for state in self.ask(self.engine.getJointStates, self.body, self.moving)]
        if not isfinite(sum(after)):
            # What is not finite stays in the world whatever is reset afterwards.
            self._reopen()
        return np.subtract(after, v)

    # -- state --------------------------------------------------------------------------------

    def _reset_joints(self, joints: Reals, velocities: Reals) -> None:
        self._check(joints, velocities)
        if joints:
            self.ask(
                self.engine.resetJointStatesMultiDof,
                self.body,
                self.moving,
                [[x] for x in joints],
                [[x] for x in velocities],
            )

    def _reopen(self) -> None:
        """The same robot in a fresh client, though its file may be gone by now."""
        self.close()
        with TemporaryDirectory(prefix="dynx-", ignore_cleanup_errors=True) as folder:
            path = Path(folder) / "robot.urdf"
            path.write_bytes(self._file)
            self._open(path)
        for setting in self._settings:
            setting(self)
        self.make_tree()

    def _open(self, path: Path) -> None:
        engine = self.engine
        self._client = int(engine.connect(engine.DIRECT))
        if self._client < 0:
            raise EngineError("Bullet has no client left (1,024 at most)")
        self._disconnect = weakref.finalize(self, _disconnect, engine, self._client)
        try:
            self.ask(engine.setPhysicsEngineParameter, fixedTimeStep=1.0, numSubSteps=0, enableFileCaching=0)
            flags = engine.URDF_USE_INERTIA_FROM_FILE
            self.said.clear()
            with overhear(self.said):
                body = self.ask(engine.loadURDF, str(path), useFixedBase=self._fixed, flags=flags)
            self.body = int(body)
        except BaseException:
            self.close()
            raise

    def _check(self, *numbers: Sequence[float]) -> None:
        """NaN and infinity survive every reset, so Bullet is never given them."""
        if not all(isfinite(x) for xs in numbers for x in xs):
            raise EngineError(f"pybullet was to be asked about {self._robot} with NaN or infinity")


def _disconnect(engine: ModuleType, client: int) -> None:
    if engine.isConnected(client):
        engine.disconnect(client)
