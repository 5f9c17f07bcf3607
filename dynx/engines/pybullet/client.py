"""One robot in one Bullet client of its own: loading, checking what was loaded, and raw questions.

Everything here is in Bullet's terms: its world is the inertial frame of the root (see
`dynx.engines.pybullet.canonical_urdf`), joints are lists of floats. The module receives `pybullet` as an
argument and does not import it.

A client of its own per robot, because Bullet caches the tree of its inverse dynamics by the address
of a body and keeps it when the body is removed: a second robot of equal size would get the first
one's torques.
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

from dynx.engines.pybullet.canonical_urdf import BulletTree, write_bullet_urdf
from dynx.errors import EngineError, EngineLimitError, NotFiniteError
from dynx.model.mechanism import ROOT
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_quat

MAX_JOINTS = 121
"""Bullet's state has room for 128 numbers, 7 of them for a base even where that is fixed: from the
122nd on joints read 0, and above 128 inverse dynamics is silently wrong (pybullet 3.2.7)."""

Reals = list[float]
_ORIGIN = [0.0, 0.0, 0.0]
_UPRIGHT = [0.0, 0.0, 0.0, 1.0]


class BulletClient:
    """A Bullet world that holds one robot, without motors, limits, damping or speed clamp."""

    def __init__(self, engine: ModuleType, tree: BulletTree, robot: str) -> None:
        """Raises EngineLimitError for a robot that Bullet cannot hold, EngineError if it fails."""
        if len(tree.links) > MAX_JOINTS:
            raise EngineLimitError(
                f"{robot} has {len(tree.links)} moving joints; Bullet answers for at most {MAX_JOINTS}"
            )
        self._engine = engine
        self._tree = tree
        self._robot = robot
        self._links = list(range(len(tree.links)))
        self._gravity: Reals = []
        self._open()

    def close(self) -> None:
        """Give the client back; harmless when it was done before."""
        self._disconnect()

    # -- questions ----------------------------------------------------------------------------

    def com_poses(self, joints: Reals) -> tuple[Floats, Floats]:
        """Positions (n, 3) and attitudes, quat_xyzw (n, 4), of the inertial frames of all links."""
        self._reset_joints(joints, None)
        # Entries 0 and 1 only: the pose of the link frame, 4 and 5, went through single precision.
        states = self._ask(self._engine.getLinkStates, self._body, self._links, 0, 1)
        return np.array([state[0] for state in states]), np.array([state[1] for state in states])

    def com_pose(self, joints: Reals, link: int) -> tuple[Reals, Reals]:
        """Position (3,) and attitude, quat_xyzw (4,), of the inertial frame of one link."""
        self._reset_joints(joints, None)
        state = self._ask(self._engine.getLinkState, self._body, link, 0, 1)
        return state[0], state[1]

    def jacobian(self, joints: Reals, link: int, point: Reals) -> Floats:
        """(6, nv), linear rows first; columns angular base, linear base, joints.

        `point` is measured from the origin of the link frame along the link's principal axes.
        """
        self._check(joints)
        rest = [0.0] * len(joints)
        linear, angular = self._ask(
            self._engine.calculateJacobian, self._body, link, point, joints, rest, rest
        )
        return np.array([*linear, *angular])

    def mass_matrix(self, joints: Reals) -> Floats:
        """(nv, nv); rows angular base, linear base, joints."""
        self._check(joints)
        return np.array(self._ask(self._engine.calculateMassMatrix, self._body, joints))

    def inverse_dynamics(self, joints: Reals, v: Reals, a: Reals, gravity: Reals) -> Floats:
        """Force, torque (3 each, with a floating base only) and joint torques.

        `v` and `a` are angular base, linear base, joints; the linear acceleration is the classical
        one of the root's centre of mass.
        """
        # The root stands upright at the origin: Bullet misreads every other attitude.
        q = [*_ORIGIN, *_UPRIGHT, *joints] if self._tree.floating else joints
        self._check(joints, v, a, gravity)
        self._set_gravity(gravity)
        return np.array(self._ask(self._engine.calculateInverseDynamics, self._body, q, v, a))

    def velocity_step(self, joints: Reals, v: Reals, tau: Reals, gravity: Reals) -> Floats:
        """What one step of unit length adds to the velocity `v`: angular, linear base, joints.

        `tau` is torque, force on the base (with a floating base only), then joint torques.
        """
        base = 6 if self._tree.floating else 0
        self._check(joints, v, tau, gravity)
        try:
            self._set_gravity(gravity)
            self._reset_joints(joints, v[base:])
            if base:
                self._ask(self._engine.resetBaseVelocity, self._body, v[3:6], v[:3])
                self._push_base(tau[:3], tau[3:6])
            if joints:
                control = self._engine.TORQUE_CONTROL
                self._ask(
                    self._engine.setJointMotorControlArray,
                    self._body,
                    self._links,
                    control,
                    forces=tau[base:],
                )
            self._ask(self._engine.stepSimulation)
            after = self._velocities()
            if base:
                self._ask(self._engine.resetBasePositionAndOrientation, self._body, _ORIGIN, _UPRIGHT)
        except EngineError:
            self._reopen()
            raise
        if not isfinite(sum(after)):
            # A state that is not finite stays in the world whatever is reset afterwards.
            self._reopen()
        return np.subtract(after, v)

    def inverse_kinematics(
        self,
        joints: Reals,
        link: int,
        position: Reals,
        quat_xyzw: Reals,
        limits: tuple[Reals, Reals] | None,
        iterations: int,
        residual: float,
    ) -> Floats:
        """Joints (n,) at which Bullet's damped least squares stopped, from `joints`.

        Position and attitude are those of the link's origin and principal axes. Selectively damped
        least squares is not offered: with an attitude it can end the process.
        """
        self._check(joints, position, quat_xyzw)
        options: dict[str, Any] = {}
        if limits is not None:
            lower, upper = limits
            options = {
                "lowerLimits": lower,
                "upperLimits": upper,
                "jointRanges": [high - low for low, high in zip(lower, upper, strict=True)],
                "restPoses": joints,
            }
        found = self._ask(
            self._engine.calculateInverseKinematics,
            self._body,
            link,
            position,
            quat_xyzw,
            currentPositions=joints,
            maxNumIterations=iterations,
            residualThreshold=residual,
            solver=self._engine.IK_DLS,
            **options,
        )
        return np.array(found)

    # -- state --------------------------------------------------------------------------------

    def _reset_joints(self, joints: Reals, velocities: Reals | None) -> None:
        self._check(joints, velocities or ())
        if joints:
            v = [0.0] * len(joints) if velocities is None else velocities
            self._ask(
                self._engine.resetJointStatesMultiDof,
                self._body,
                self._links,
                [[x] for x in joints],
                [[x] for x in v],
            )

    def _set_gravity(self, gravity: Reals) -> None:
        if gravity != self._gravity:
            self._ask(self._engine.setGravity, *gravity)
            self._gravity = gravity

    def _push_base(self, torque: Reals, force: Reals) -> None:
        frame = self._engine.WORLD_FRAME
        self._ask(self._engine.applyExternalForce, self._body, ROOT, force, _ORIGIN, frame)
        self._ask(self._engine.applyExternalTorque, self._body, ROOT, torque, frame)

    def _velocities(self) -> Reals:
        base: Reals = []
        if self._tree.floating:
            linear, angular = self._ask(self._engine.getBaseVelocity, self._body)
            base = [*angular, *linear]
        if not self._links:
            return base
        return base + [state[1] for state in self._ask(self._engine.getJointStates, self._body, self._links)]

    def _check(self, *numbers: Sequence[float]) -> None:
        """Bullet is never given NaN or infinity: they survive a reset."""
        if not isfinite(sum(map(sum, numbers))) and not all(isfinite(x) for xs in numbers for x in xs):
            raise NotFiniteError(
                f"Bullet was asked about {self._robot} with NaN or infinity; wanted finite numbers"
            )

    def _ask(self, question: Callable[..., Any], *args: Any, **options: Any) -> Any:
        try:
            return question(*args, physicsClientId=self._client, **options)
        except (SystemError, TypeError, ValueError, self._engine.error) as error:
            cause = error.__cause__ or error
            raise EngineError(f"Bullet failed in {question.__name__} for {self._robot}: {cause}") from error

    # -- loading ------------------------------------------------------------------------------

    def _reopen(self) -> None:
        self._disconnect()
        self._open()

    def _open(self) -> None:
        self._client = int(self._engine.connect(self._engine.DIRECT))
        if self._client < 0:
            raise EngineError("Bullet has no client left (1,024 at most); close backends that are done with")
        # Also when the backend is forgotten instead of closed.
        self._disconnect = weakref.finalize(self, _disconnect, self._engine, self._client)
        try:
            self._ask(
                self._engine.setPhysicsEngineParameter, fixedTimeStep=1.0, numSubSteps=0, enableFileCaching=0
            )
            self._gravity = []
            self._body = self._load()
            self._free_joints()
            self._verify()
        except BaseException:
            self._disconnect()
            raise

    def _load(self) -> int:
        flags = self._engine.URDF_USE_INERTIA_FROM_FILE
        try:
            with TemporaryDirectory(prefix="dynx-", ignore_cleanup_errors=True) as folder:
                path = Path(folder) / "robot.urdf"
                path.write_text(write_bullet_urdf(self._tree), encoding="ascii")
                fixed = not self._tree.floating
                body = self._ask(self._engine.loadURDF, str(path), useFixedBase=fixed, flags=flags)
        except OSError as error:
            raise EngineError(f"the file through which Bullet loads {self._robot}: {error}") from error
        return int(body)

    def _free_joints(self) -> None:
        """Inertias as they stand, and nothing that moves or holds a joint but what is asked."""
        # A setting of the whole body in the same call would send the link's settings to the root.
        self._ask(
            self._engine.changeDynamics,
            self._body,
            ROOT,
            linearDamping=0.0,
            angularDamping=0.0,
            maxJointVelocity=1e300,
        )
        if self._tree.floating:
            self._set_inertia(ROOT, self._tree.root.moments)
        for k, link in enumerate(self._tree.links):
            self._set_inertia(k, link.inertia.moments)
        if self._links:
            self._ask(
                self._engine.setJointMotorControlArray,
                self._body,
                self._links,
                self._engine.VELOCITY_CONTROL,
                forces=[0.0] * len(self._links),
            )

    def _set_inertia(self, link: int, moments: Floats) -> None:
        # Before the first inverse dynamics: the tree that is made then ignores later changes.
        self._ask(self._engine.changeDynamics, self._body, link, localInertiaDiagonal=moments.tolist())

    def _verify(self) -> None:
        """Bullet must hold what was written: it reads garbage as numbers and drops what it doubts."""
        if self._ask(self._engine.getNumJoints, self._body) != len(self._links):
            self._misread("the number of joints")
        if self._tree.floating:
            self._verify_inertia(ROOT, self._tree.root.mass, self._tree.root.moments)
        for k, link in enumerate(self._tree.links):
            info = self._ask(self._engine.getJointInfo, self._body, k)
            kind = self._engine.JOINT_REVOLUTE if link.revolute else self._engine.JOINT_PRISMATIC
            if (info[1], info[2], info[16]) != (f"j{k}".encode(), kind, link.parent):
                self._misread(f"joint {k}")
            self._expect("the axis", k, info[13], link.inertia.axes.T @ link.axis)
            self._verify_inertia(k, link.inertia.mass, link.inertia.moments)
        self._verify_placements()
        if self._links or self._tree.floating:
            rest = [0.0] * (len(self._links) + (6 if self._tree.floating else 0))
            # Makes the tree of the inverse dynamics, or fails where it refuses an inertia.
            self.inverse_dynamics([0.0] * len(self._links), rest, rest, _ORIGIN)

    def _verify_inertia(self, link: int, mass: float, moments: Floats) -> None:
        info = self._ask(self._engine.getDynamicsInfo, self._body, link)
        if info[0] != mass or list(info[2]) != moments.tolist():
            self._misread(f"the inertia of link {link}")

    def _verify_placements(self) -> None:
        """The inertial frames at zero, against the joint frames that were written."""
        if not self._links:
            return
        at: dict[int, tuple[Any, Any]] = {ROOT: (np.eye(3), np.zeros(3))}
        positions, quats = self.com_poses([0.0] * len(self._links))
        rotations = rotation_from_quat(quats)
        for k, link in enumerate(self._tree.links):
            R_parent, p_parent = at[link.parent]
            R, p = R_parent @ link.R, p_parent + R_parent @ link.p
            at[k] = R, p
            self._expect("the centre of mass", k, positions[k], p + R @ link.inertia.center)
            self._expect("the principal axes", k, rotations[k], R @ link.inertia.axes)

    def _expect(self, what: str, link: int, got: Any, wanted: Any) -> None:
        wanted = np.asarray(wanted, dtype=np.float64)
        # A misread number is off in its leading digits; this is no measure of accuracy.
        if not np.allclose(got, wanted, rtol=1e-6, atol=1e-6 * max(1.0, float(np.max(np.abs(wanted))))):
            self._misread(f"{what} of link {link}")

    def _misread(self, what: str) -> None:
        raise EngineError(f"Bullet does not hold {what} of {self._robot} as it was written")


def _disconnect(engine: ModuleType, client: int) -> None:
    if engine.isConnected(client):
        engine.disconnect(client)
