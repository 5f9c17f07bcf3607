"""Bullet clients: empty, with one robot from its canonical URDF, or with one from the user's file.

**With a robot** everything is in Bullet's conventions: its world is the inertial frame of the root (centre of
mass, principal axes), joints and links have Bullet's indices, and joint values are lists of floats. The
module receives `pybullet` as an argument and does not import it.

Each robot has its own client, because Bullet caches the tree of its inverse dynamics by the address of a
body, even after the body is removed: a later robot at the same address would get the torques of the earlier
one.

The canonical robot is verified against what was written. Of a robot from the user's file, settings that do
not come from the file are set for rigid-body dynamics: no motors, no damping of the base, no speed limit,
steps of unit length. Joint damping and joint limits of the file stay as loaded.
"""

from __future__ import annotations

import re
import weakref
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Sequence
from math import isfinite
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import numpy as np

from dynx.engines.decimal_point import decimal_point
from dynx.engines.pybullet.canonical_urdf import BulletTree, write_bullet_urdf
from dynx.engines.silence import capture_output
from dynx.errors import DynxError, EngineError, EngineLimitError, NotFiniteError
from dynx.files.temporary import temporary_folder
from dynx.model.mechanism import ROOT
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat


class BulletClient:
    """A connection to Bullet about a robot or a scene, whose errors become EngineError."""

    def __init__(self, engine: ModuleType, subject: str) -> None:
        """`subject` is the name of the robot or the scene, for messages."""
        self.engine = engine
        self.errors = (SystemError, TypeError, ValueError, engine.error)
        """Exceptions that a failed call of Bullet raises."""
        self.subject = subject
        self.number = -1
        """Bullet's number of the client; negative before `connect`."""

    def connect(self, **parameters: float) -> None:
        """Open an empty world with these parameters of `setPhysicsEngineParameter`.

        Raises EngineError where Bullet has no client left.
        """
        self.number = int(self.engine.connect(self.engine.DIRECT))
        if self.number < 0:
            raise EngineError(
                "Bullet has no client left (1,024 at most); close backends and worlds that are not needed"
            )
        # Also called when the connection is garbage-collected.
        self._disconnect = weakref.finalize(self, _disconnect, self.engine, self.number)
        self.call(self.engine.setPhysicsEngineParameter, numSubSteps=0, enableFileCaching=0, **parameters)

    def call(self, function: Callable[..., Any], *args: Any, **options: Any) -> Any:
        """Call the engine and return the result. Raises EngineError, with its message, if it fails."""
        try:
            return function(*args, physicsClientId=self.number, **options)
        except self.errors as error:
            raise self.failure(function.__name__, error) from error

    def failure(self, function: str, error: BaseException) -> EngineError:
        """Return the error for a failed call."""
        return EngineError(f"pybullet failed in {function} for {self.subject}: {error.__cause__ or error}")

    def close(self) -> None:
        """Disconnect; closing twice is harmless."""
        self._disconnect()


def _disconnect(engine: ModuleType, client: int) -> None:
    if engine.isConnected(client):
        engine.disconnect(client)


Reals = list[float]
ORIGIN = [0.0, 0.0, 0.0]
_UPRIGHT = [0.0, 0.0, 0.0, 1.0]


class RobotClient(BulletClient, ABC):
    """One robot in a Bullet client. Of a floating base, angular components come before linear ones."""

    not_finite_error: ClassVar[type[DynxError]] = EngineError
    """Class of the error for an argument with NaN or infinity."""

    floating: bool
    links: list[int]
    """Numbers of all links but the root; each has the number of the joint that carries it."""

    moving: list[int]
    """Numbers of the joints that can move, in the order of Bullet's coordinates."""

    body: int

    @abstractmethod
    def _load(self) -> None:
        """Load the robot into the new client."""

    def _connect(self) -> None:
        """Open a client and load the robot. Steps of unit length add the acceleration to the velocity."""
        self.connect(fixedTimeStep=1.0)
        self._gravity: Reals = []
        self._at_origin = False
        try:
            with decimal_point():
                self._load()
        except BaseException:
            self.close()
            raise

    def _reopen(self) -> None:
        self.close()
        self._connect()

    def check(self, *arguments: Sequence[float]) -> None:
        """Raise `not_finite_error` for NaN and infinity, which would survive every reset of Bullet."""
        if not isfinite(sum(map(sum, arguments))) and not all(isfinite(x) for xs in arguments for x in xs):
            raise self.not_finite_error(f"an argument for {self.subject} in pybullet holds NaN or infinity")

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
            return np.array(function(self.body, q, v, a, physicsClientId=self.number))
        except self.errors as error:
            raise self.failure(function.__name__, error) from error

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

    def control_motors(self, mode: int, **targets: Reals) -> None:
        """Set the control mode of all joints, with the targets, gains and forces of their motors."""
        self.call(self.engine.setJointMotorControlArray, self.body, self.moving, mode, **targets)

    def release_motors(self) -> None:
        """Release the velocity motors that Bullet gives to every joint."""
        if self.moving:
            self.control_motors(self.engine.VELOCITY_CONTROL, forces=[0.0] * len(self.moving))

    def disable_damping(self) -> None:
        """Switch off the damping of links and the limit of joint speeds, which are not the file's."""
        # Set for the root, the damping is that of all links. This needs a separate call: together with a
        # setting of a link, Bullet would apply that setting to the root.
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


MAX_JOINTS = 121
"""Largest number of moving joints. Bullet's state has room for 128 numbers, 7 of them for the base even if
it is fixed: joints from the 122nd on are read as 0, and above 128 inverse dynamics is silently wrong
(pybullet 3.2.7)."""


def refuse_many_joints(robot: str, count: int) -> None:
    """Raise EngineLimitError for a robot with more moving joints than Bullet supports."""
    if count > MAX_JOINTS:
        raise EngineLimitError(f"{robot} has {count} moving joints; Bullet supports at most {MAX_JOINTS}")


class CanonicalClient(RobotClient):
    """A Bullet world with one robot, without motors, joint limits, damping or a speed limit."""

    not_finite_error: ClassVar[type[DynxError]] = NotFiniteError

    def __init__(self, engine: ModuleType, tree: BulletTree, robot: str) -> None:
        """Raises EngineLimitError for a robot that Bullet cannot represent, EngineError if Bullet fails."""
        refuse_many_joints(robot, len(tree.links))
        super().__init__(engine, robot)
        self._tree = tree
        self.floating = tree.floating
        self.links = self.moving = list(range(len(tree.links)))
        self._connect()

    def com_pose(self, joints: Reals, link: int) -> tuple[Reals, Reals]:
        """Return the position (3,) and attitude, quat_xyzw (4,), of the inertial frame of one link."""
        self.reset_joints(joints)
        state = self.call(self.engine.getLinkState, self.body, link, 0, 1)
        return state[0], state[1]

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
        """Return the joints (n,) at which Bullet's damped least squares stopped, starting from `joints`.

        Position and attitude are those of the link's origin and principal axes. Selectively damped
        least squares is not offered: with an attitude it can end the process.
        """
        self.check(joints, position, quat_xyzw)
        options: dict[str, Any] = {}
        if limits is not None:
            lower, upper = limits
            options = {
                "lowerLimits": lower,
                "upperLimits": upper,
                "jointRanges": [high - low for low, high in zip(lower, upper, strict=True)],
                "restPoses": joints,
            }
        found = self.call(
            self.engine.calculateInverseKinematics,
            self.body,
            link,
            position,
            quat_xyzw,
            currentPositions=joints,
            maxNumIterations=iterations,
            residualThreshold=residual,
            solver=self.engine.IK_DLS,
            **options,
        )
        return np.array(found)

    # -- loading ------------------------------------------------------------------------------

    def _load(self) -> None:
        flags = self.engine.URDF_USE_INERTIA_FROM_FILE
        with temporary_folder() as folder:
            path = folder / "robot.urdf"
            path.write_text(write_bullet_urdf(self._tree), encoding="ascii")
            fixed = not self.floating
            self.body = int(self.call(self.engine.loadURDF, str(path), useFixedBase=fixed, flags=flags))
        self.disable_damping()
        if self.floating:
            self._set_inertia(ROOT, self._tree.root.moments)
        for k, link in enumerate(self._tree.links):
            self._set_inertia(k, link.inertia.moments)
        self.release_motors()
        self._verify()

    def _set_inertia(self, link: int, moments: Floats) -> None:
        # This must precede the first inverse dynamics, whose tree ignores later changes.
        self.call(self.engine.changeDynamics, self.body, link, localInertiaDiagonal=moments.tolist())

    def _verify(self) -> None:
        """Raise EngineError unless Bullet has the values that were written, because it can misread numbers
        and drop inertias."""
        if self.call(self.engine.getNumJoints, self.body) != len(self.links):
            self._misread("the number of joints")
        if self.floating:
            self._verify_inertia(ROOT, self._tree.root.mass, self._tree.root.moments)
        for k, link in enumerate(self._tree.links):
            info = self.call(self.engine.getJointInfo, self.body, k)
            kind = self.engine.JOINT_REVOLUTE if link.revolute else self.engine.JOINT_PRISMATIC
            if (info[1], info[2], info[16]) != (f"j{k}".encode(), kind, link.parent):
                self._misread(f"joint {k}")
            self._expect("the axis", k, info[13], link.inertia.axes.T @ link.axis)
            self._verify_inertia(k, link.inertia.mass, link.inertia.moments)
        self._verify_placements()
        if self.links or self.floating:
            rest = [0.0] * (len(self.links) + (6 if self.floating else 0))
            # This makes the tree of the inverse dynamics, or fails if Bullet refuses an inertia.
            self.inverse_dynamics([0.0] * len(self.links), rest, rest, ORIGIN)

    def _verify_inertia(self, link: int, mass: float, moments: Floats) -> None:
        info = self.call(self.engine.getDynamicsInfo, self.body, link)
        if info[0] != mass or list(info[2]) != moments.tolist():
            self._misread(f"the inertia of link {link}")

    def _verify_placements(self) -> None:
        """Compare the inertial frames at zero with the joint frames that were written."""
        at: dict[int, tuple[Any, Any]] = {ROOT: (np.eye(3), np.zeros(3))}
        positions, quats = self.com_poses([0.0] * len(self.links))
        rotations = rotation_from_quat(quats)
        for k, link in enumerate(self._tree.links):
            R_parent, p_parent = at[link.parent]
            R, p = R_parent @ link.R, p_parent + R_parent @ link.p
            at[k] = R, p
            self._expect("the centre of mass", k, positions[k], p + R @ link.inertia.center)
            self._expect("the principal axes", k, rotations[k], R @ link.inertia.axes)

    def _expect(self, property: str, link: int, found: Any, written: Any) -> None:
        written = np.asarray(written, dtype=np.float64)
        # A misread number differs in its leading digits, so a coarse comparison is enough.
        tolerance = 1e-6 * max(1.0, float(np.max(np.abs(written))))
        if not np.allclose(found, written, rtol=1e-6, atol=tolerance):
            self._misread(f"{property} of link {link}")

    def _misread(self, subject: str) -> None:
        raise EngineError(f"Bullet has not read {subject} of {self.subject} as it was written")


Setting = Callable[["LoadedClient"], None]


_SOURCE_PLACE = re.compile(r"b3(?:Error|Warning)\[[^\]]*\]:?")
"""Place in Bullet's source that precedes a message."""

_MAX_TOLD = 200
"""Largest number of characters of Bullet's messages, from the end, in an error."""


class LoadedClient(RobotClient):
    """One robot as `loadURDF`, `loadMJCF` or `loadSDF` loads it."""

    def __init__(
        self,
        engine: ModuleType,
        path: Path,
        robot: str,
        *,
        fixed: bool,
        flags: Iterable[str],
        function: str = "loadURDF",
        parts: Collection[str] = (),
    ) -> None:
        """`flags` are names of constants of `engine` for ``loadURDF``, `parts` the names of the root and the
        joints, by which the robot is known among all bodies that another `function` loads."""
        super().__init__(engine, robot)
        self._fixed = fixed
        self._flags = sum(int(getattr(engine, flag)) for flag in flags)
        self._function = function
        self._parts = frozenset(parts)
        self._file = path.read_bytes()
        self._path = path
        self._settings: list[Setting] = []
        self._refusal: EngineError | None = None
        self._needs_tree = (
            engine.calculateInverseDynamics,
            engine.calculateMassMatrix,
            engine.calculateJacobian,
        )
        self.messages: list[str] = []
        """The lines that Bullet printed while it loaded."""
        self._connect()
        self.links = list(range(int(self.call(engine.getNumJoints, self.body))))
        self.joints = [self.call(engine.getJointInfo, self.body, k) for k in self.links]
        """`getJointInfo` of every joint, as loaded."""
        self.moving = [k for k, info in enumerate(self.joints) if info[2] != engine.JOINT_FIXED]
        if function != "loadURDF":
            refuse_many_joints(robot, len(self.moving))
        self.floating = not fixed and self.dynamics(ROOT)[0] != 0.0
        """True if the base moves: Bullet holds a root without mass still."""

    def apply(self, setting: Setting) -> None:
        """Change a setting now, and again whenever the client is reopened."""
        self._settings.append(setting)
        setting(self)

    def call(self, function: Callable[..., Any], *args: Any, **options: Any) -> Any:
        """Call the engine and return the result. Raises EngineError also if the call needs a tree that
        Bullet refused to make."""
        if self._refusal is not None and function in self._needs_tree:
            # A second call would fail again and print messages.
            raise EngineError(str(self._refusal)) from self._refusal
        return super().call(function, *args, **options)

    def dynamics(self, link: int) -> Any:
        """Call `getDynamicsInfo` for a link."""
        return self.call(self.engine.getDynamicsInfo, self.body, link)

    def com_frame(self, link: int) -> Floats:
        """Return T_link_com (4, 4), the inertial frame of a link as Bullet holds it."""
        info = self.dynamics(link)
        return homogeneous(rotation_from_quat(np.array(info[4])), np.array(info[3]))

    def make_tree(self) -> None:
        """Make the tree of Bullet's inverse dynamics. If Bullet refuses, calls that need it raise errors."""
        rest = [0.0] * (len(self.moving) + (6 if self.floating else 0))
        if not rest:
            return
        self._refusal = None
        try:
            with capture_output(self.messages):
                self.inverse_dynamics([0.0] * len(self.moving), rest, rest, ORIGIN)
        except EngineError as error:
            self._refusal = error

    @property
    def refused(self) -> bool:
        """True if Bullet refused to make that tree."""
        return self._refusal is not None

    def _reopen(self) -> None:
        super()._reopen()
        for setting in self._settings:
            setting(self)
        self.make_tree()

    def _load(self) -> None:
        if self._path.is_file() and self._path.read_bytes() == self._file:
            self._load_from(self._path)
            return
        # The file is gone or another when a robot is loaded again.
        with temporary_folder() as folder:
            path = folder / self._path.name
            path.write_bytes(self._file)
            self._load_from(path)

    def _load_from(self, path: Path) -> None:
        options = {"useFixedBase": self._fixed, "flags": self._flags}
        self.messages.clear()
        refusal: EngineError | None = None
        with capture_output(self.messages):
            if self._function == "loadURDF":
                self.body = int(self.call(self.engine.loadURDF, str(path), **options))
                return
            try:
                bodies = self.call(getattr(self.engine, self._function), str(path))
            except EngineError as error:
                refusal = error
                bodies = ()
        if refusal is not None:
            # Bullet prints the reason, and raises an exception without one.
            told = " ".join(_SOURCE_PLACE.sub(" ", " ".join(self.messages)).split())
            raise EngineError(f"{refusal} {told[-_MAX_TOLD:]}".rstrip()) from refusal
        if not bodies:
            raise EngineError(f"pybullet loads no body by {self._function} from {path.name}")
        self.body = max(map(int, bodies), key=self._count_known)

    def _count_known(self, body: int) -> int:
        """Count the root and the joints of a body that are the robot's."""
        joints = range(int(self.call(self.engine.getNumJoints, body)))
        names = [self.call(self.engine.getJointInfo, body, k)[1] for k in joints]
        names.append(self.call(self.engine.getBodyInfo, body)[0])
        return sum(name.decode("utf-8", "replace") in self._parts for name in names)
