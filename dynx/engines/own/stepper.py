"""`OwnStepper`: robots and bodies of a scene moved by dynx itself, over any backend.

Each robot has a backend of its own, which computes its dynamics, and a body is a floating robot of one link.
A step is that of `dynx.simulate`: `dynx.steppers.robot_step` and the stops of `dynx.steppers.joint_stops`.
Nothing touches: a scene in which colliders may touch is for another engine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from dynx._version import __version__
from dynx.backends import backend
from dynx.backends.registry import BUILT_IN as BACKENDS
from dynx.backends.solvability import Solvability
from dynx.model import Model
from dynx.model.elements import Inertial, JointCoefficients, Link, Pose
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import cross, quat_from_rotation, rotation_from_quat
from dynx.steppers.forces import NO_FORCES, Forces
from dynx.steppers.integrators import METHODS
from dynx.steppers.joint_stops import MOVES_NO_FURTHER, JointStops
from dynx.steppers.layout import BodyLayout, Layout, RobotLayout
from dynx.steppers.robot_step import SCHEMES, RobotStep
from dynx.steppers.settings import Setting
from dynx.steppers.state import BodyState, RobotState
from dynx.steppers.stepper import Feature, Stepper, TouchingPoint


class OwnRobot:
    """A robot in motion: its state q (nq,), v (nv,), and what steps it."""

    def __init__(
        self,
        model: Model,
        joints: JointCoefficients,
        h: float,
        settings: Mapping[str, Any],
        *,
        limited: bool = False,
    ) -> None:
        """`limited`: joints stop at the position limits of the model."""
        Solvability(model).refuse_singular(joint_dynamics=bool(joints.armature.any()))
        self.engine = backend(settings["backend"], model, validate=False)
        integrator = settings["integrator"]
        names = ("method", "rtol", "atol") if integrator == "adaptive" else ()
        options = {name: settings[name] for name in names}
        self._step = RobotStep(self.engine, joints, h, integrator=integrator, **options)
        mass_matrix, armature = self._step.dynamics.mass_matrix, np.diag(joints.armature)
        self._stops = JointStops(model, lambda q: mass_matrix(q) + armature) if limited else None
        self.q, self.v = model.neutral(), np.zeros(model.nv)
        self._no_torque = np.zeros(model.nv)

    def step(self, tau: Floats | None) -> None:
        """Take one step under a generalised force (nv,)."""
        before = self.q
        self.q, self.v, _ = self._step(before, self.v, self._no_torque if tau is None else tau)
        stopped = None if self._stops is None else self._stops(before, self.q, self.v)
        if stopped is not None:
            self.q, self.v = stopped


class OwnBody(OwnRobot):
    """A body of the scene as a floating robot of one link."""

    def __init__(self, body: BodyLayout, gravity: Floats, h: float, settings: Mapping[str, Any]) -> None:
        (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = body.inertia.tolist()
        x, y, z = body.center.tolist()
        inertial = Inertial(body.mass, Pose((x, y, z)), ixx, ixy, ixz, iyy, iyz, izz)
        model = Model.build(body.name, [Link("body", inertial)], [], base="floating", gravity=gravity)
        nothing = np.zeros(model.nv)
        super().__init__(model, JointCoefficients(nothing, nothing, nothing), h, settings)
        self._center = body.center
        self.set_state(body.T, body.twist)

    def set_state(self, T: Floats, twist: Floats) -> None:
        """Set the pose (4, 4) and twist (6,) of the body frame, in world axes."""
        R = T[:3, :3]
        self.q = np.concatenate([T[:3, 3], quat_from_rotation(R)])
        self.v = np.concatenate([R.T @ twist[:3], R.T @ twist[3:]])

    def state(self) -> BodyState:
        """Return pose and twist of the body frame, in world axes."""
        R = rotation_from_quat(self.q[3:])
        twist = np.concatenate([R @ self.v[:3], R @ self.v[3:]])
        return BodyState(homogeneous(R, self.q[:3]), twist)

    def push(self, wrench: Floats) -> Floats:
        """Return the generalised force (6,) of a force, and a moment about the centre of mass, in world
        axes."""
        R = rotation_from_quat(self.q[3:])
        force = R.T @ wrench[:3]
        return np.concatenate([force, R.T @ wrench[3:] + cross(self._center, force)])


_ADAPTIVE = ("integrator", ("adaptive",))


class OwnStepper(Stepper):
    """A scene without contacts, moved by the integrators of dynx."""

    name: ClassVar[str] = "dynx"
    settings: ClassVar[Mapping[str, Setting]] = {
        "backend": Setting(DEFAULT_ENGINE, "backend that computes the dynamics", choices=tuple(BACKENDS)),
        "integrator": Setting("semi_implicit", "integration scheme", choices=tuple(SCHEMES)),
        "method": Setting(
            "DOP853", "SciPy method of the integrator `adaptive`", choices=METHODS, needs=_ADAPTIVE
        ),
        "rtol": Setting(
            1e-10, "relative tolerance of the integrator `adaptive`", least=1e-14, needs=_ADAPTIVE
        ),
        "atol": Setting(
            1e-12, "absolute tolerance of the integrator `adaptive`", least=1e-300, needs=_ADAPTIVE
        ),
    }
    contact_law: ClassVar[str] = "no contacts, and joint limits at which joints stop without a rebound"
    beyond_limits: ClassVar[str] = MOVES_NO_FURTHER

    def __init__(self, layout: Layout, dt: float, settings: Mapping[str, Any]) -> None:
        super().__init__(layout, dt, settings)
        self._version = f"dynx {__version__}"
        self._robots: list[OwnRobot] = []
        self._bodies: dict[int, OwnBody] = {}
        try:
            for robot in layout.robots:
                self._robots.append(_robot_of(robot, dt, settings))
            for k, body in enumerate(layout.bodies):
                if not body.fixed:
                    self._bodies[k] = OwnBody(body, layout.gravity, dt, settings)
        except BaseException:
            self.close()
            raise

    @classmethod
    def provides(cls, layout: Layout) -> frozenset[Feature]:
        return frozenset(Feature) - {Feature.CONTACTS, Feature.CONSTRAINTS}

    # -- motion -------------------------------------------------------------------------------

    def step(self, n: int, forces: Forces = NO_FORCES) -> None:
        torques = dict(forces.torques)
        for _ in range(n):
            for k, robot in enumerate(self._robots):
                robot.step(torques.get(k))
            for k, body in self._bodies.items():
                body.step(None if forces.wrenches is None else body.push(forces.wrenches[k]))

    # -- state --------------------------------------------------------------------------------

    def robot_state(self, robot: int) -> RobotState:
        found = self._robots[robot]
        return RobotState(found.q.copy(), found.v.copy())

    def body_state(self, body: int) -> BodyState:
        if body in self._bodies:
            return self._bodies[body].state()
        return BodyState(self.layout.bodies[body].T.copy(), np.zeros(6))

    def set_robot_state(self, robot: int, q: Floats, v: Floats) -> None:
        found = self._robots[robot]
        found.q, found.v = q.copy(), v.copy()

    def set_body_state(self, body: int, T: Floats, twist: Floats) -> None:
        self._bodies[body].set_state(T, twist)

    def dump(self) -> bytes:
        return b"".join(part.q.tobytes() + part.v.tobytes() for part in self._parts())

    def load(self, data: bytes) -> None:
        numbers = np.frombuffer(data)
        for part in self._parts():
            q, v, numbers = np.split(numbers, np.cumsum([len(part.q), len(part.v)]))
            part.q, part.v = q.copy(), v.copy()

    def _parts(self) -> list[OwnRobot]:
        return [*self._robots, *self._bodies.values()]

    # -- queries ------------------------------------------------------------------------------

    def contacts(self) -> Sequence[TouchingPoint]:
        return ()

    # -- end ----------------------------------------------------------------------------------

    @property
    def version(self) -> str:
        return self._version

    def close(self) -> None:
        for part in self._parts():
            part.engine.close()


def _robot_of(robot: RobotLayout, h: float, settings: Mapping[str, Any]) -> OwnRobot:
    limited = bool(np.isfinite([robot.lower, robot.upper]).any())
    made = OwnRobot(robot.model, robot.coefficients(), h, settings, limited=limited)
    made.q, made.v = robot.q.copy(), robot.v.copy()
    return made
