"""Robots and bodies of a scene in motion: their state, their free motion, and their response to impulses."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from dynx.backends import backend
from dynx.backends.solvability import Solvability
from dynx.engines.own.end_motors import MotorsOfStep
from dynx.model import Model
from dynx.model.elements import Inertial, JointCoefficients, Link, Pose
from dynx.model.mechanism import ROOT
from dynx.rbd.displacement import floating_end_velocity
from dynx.rbd.integration import SemiImplicitEuler, moved_joints
from dynx.spatial.plain import rotation_rows
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import cross, quat_from_rotation, rotation_from_quat, skew
from dynx.steppers.forces import JointLaw
from dynx.steppers.joint_stops import JointStops, bounds_of_step
from dynx.steppers.layout import BodyLayout, RobotLayout, stop_positions
from dynx.steppers.robot_step import RobotStep
from dynx.steppers.state import BodyState

if TYPE_CHECKING:
    from dynx.simd.kernel import Workspace


class OwnRobot:
    """A robot in motion: its state q (nq,), v (nv,), and what steps it.

    In a scene without contacts and constraints `step` moves it, and its joints stop by `JointStops`.
    Otherwise `begin` computes its free motion. Either `finish` completes that with the bits of `step`, where
    no joint passes a limit, or `finish_at` moves it with the velocities that impulses give it, those of
    limits among them.
    Velocities of `free`, `jacobian`, `response` and `finish_at` are coordinates in the axes at the beginning
    of the step.
    """

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
        self._motors: MotorsOfStep | None = None
        self.motor_torque = self._no_torque
        """Torque (nv,) of motors at the end of the last step."""
        self._h = h
        self.nv = model.nv
        self._floating = model.floating
        mechanism = model.mechanism
        self._frames = [mechanism.frames[k].name for k in mechanism.body_frames]
        self._frame_numbers = list(mechanism.body_frames)
        self._base = 6 if model.floating else 0
        self._places: slice | list[int] = slice(7 if model.floating else 0, None)
        """Indices in q of the coordinates of joints, which motors read; those of ball joints have none."""
        if model.ball_joints:
            self._places = list(mechanism.places[self._base :])
        self.dry: Floats = joints.friction
        """Torque (nv,) of dry friction [N m or N]."""
        self.dry_joints = np.flatnonzero(joints.friction)
        has_rows = limited and not model.ball_joints
        self.limits: tuple[Floats, Floats] | None = stop_positions(model) if has_rows else None
        """Lowest and highest positions (n,) of the joints [rad or m], which are the last n coordinates, at
        which impulses stop them. None without limits, and with ball joints, where `JointStops` stop all."""
        self.free: Floats = self._no_torque
        """Velocity (nv,) at the end of the step without impulses."""

    def step(self, tau: Floats | None, motors: JointLaw | None = None) -> None:
        """Take one step under a generalised force (nv,) and motors at its end."""
        before = self.q
        if motors is None:
            self.q, self.v, _ = self._step(before, self.v, self._no_torque if tau is None else tau)
        else:
            self.begin(tau, motors)
            self._move_freely()
        self._stop(before)

    def _stop(self, before: Floats) -> None:
        stopped = None if self._stops is None else self._stops(before, self.q, self.v)
        if stopped is not None:
            self.q, self.v = stopped

    # -- a step with impulses -----------------------------------------------------------------

    def begin(self, tau: Floats | None, motors: JointLaw | None = None) -> None:
        """Compute the free motion of a step under a generalised force (nv,) and motors at its end."""
        self._given = self._no_torque if tau is None else tau
        self._motors = None
        if motors is not None:
            self._motors = MotorsOfStep(motors, self._h, self.q[self._places], self.v[self._base :])
        while True:
            self._apply_motors()
            self._motion = self._step.motion(self.q, self.v, self._tau, added=self._added)
            a, moves = self._motion
            self.free = self._end_velocity(a)
            if moves is not None:
                self.free = moves * self.free
            if self._motors is None or not self._motors.correct(self.free[self._base :]):
                break
        self.forget_placements()

    def _apply_motors(self) -> None:
        """Take torque and inertia of the motors as they are found so far."""
        self._tau, self._added = self._given, None
        if self._motors is not None:
            self._added = np.concatenate([np.zeros(self._base), self._motors.inertia])
            self._tau = self._given.copy()
            self._tau[self._base :] += self._motors.torque
        self._inertia: Floats | None = None
        self.__dict__.pop("_inverse", None)

    def correct_motors(self, end: Floats) -> bool:
        """Correct which motors are at their limits, if the step ends at the velocity `end` (nv,); return
        whether the free motion is another one."""
        if self._motors is None or not self._motors.correct(end[self._base :]):
            return False
        self._apply_motors()
        a, self._inertia = self._step.without_dry_friction(self.q, self.v, self._tau, self._added_inertia)
        self.free = self._end_velocity(a)
        return True

    @property
    def _added_inertia(self) -> Floats | float:
        return 0.0 if self._added is None else self._added

    def forget_placements(self) -> None:
        """Forget the poses of the last state."""
        for name in ("_placements", "_midpoint"):
            self.__dict__.pop(name, None)

    def _end_velocity(self, a: Floats) -> Floats:
        if not self._floating:
            return self.v + self._h * a
        return floating_end_velocity(self.v, a, self._h, self._scheme.center)

    @property
    def _scheme(self) -> SemiImplicitEuler:
        scheme = self._step.scheme
        assert isinstance(scheme, SemiImplicitEuler)
        return scheme

    def release_dry_friction(self) -> None:
        """Take dry friction out of the free motion, because it is among the impulses."""
        if self.dry_joints.size:
            a, self._inertia = self._step.without_dry_friction(self.q, self.v, self._tau, self._added_inertia)
            self.__dict__.pop("_inverse", None)
            self.free = self._end_velocity(a)

    @cached_property
    def _placements(self) -> Floats:
        return self.engine.forward_kinematics(self.q)

    def pose(self, body: int) -> Floats:
        """Return the pose (4, 4) in the world of a moving body, by its number in the mechanism."""
        if body == ROOT and not self._floating:
            return np.eye(4)
        T: Floats = self._placements[self._frame_numbers[body + 1]]
        return T

    def jacobian(self, body: int) -> Floats:
        """Return J (6, nv) of the origin of a moving body, in axes of the world."""
        J: Floats = self._step.dynamics.jacobian(self.q, self._frames[body + 1])
        return J

    def midpoint_pose(self, body: int) -> Floats:
        """Return the pose (4, 4) in the world of a moving body half a step after the beginning."""
        if body == ROOT and not self._floating:
            return np.eye(4)
        T: Floats = self._midpoint[1][self._frame_numbers[body + 1]]
        return T

    def midpoint_jacobian(self, body: int) -> Floats:
        """Return J (6, nv) as `jacobian` does, half a step after the beginning, for velocities in the axes in
        which the step begins."""
        q, _, base = self._midpoint
        J: Floats = self._step.dynamics.jacobian(q, self._frames[body + 1])
        return J if base is None else np.concatenate([J[:, :6] @ base, J[:, 6:]], axis=1)

    @cached_property
    def _midpoint(self) -> tuple[Floats, Floats, Floats | None]:
        """Configuration (nq,) half a step after the beginning, poses of its frames, and for a floating base
        the map (6, 6) from velocities in the axes of the beginning to those in its axes there.

        The map keeps the velocity of the base's centre of mass, as `dynx.rbd.displacement` does.
        """
        q: Floats = self.engine.model.integrate(self.q, 0.5 * self._h * self.v)
        placements: Floats = self.engine.forward_kinematics(q)
        if not self._floating:
            return q, placements, None
        turn = rotation_from_quat(q[3:7]).T @ rotation_from_quat(self.q[3:7])
        center = skew(self._scheme.center)
        base = np.zeros((6, 6))
        base[:3, :3] = base[3:, 3:] = turn
        base[:3, 3:] = center @ turn - turn @ center
        return q, placements, base

    def response(self, J: Floats) -> Floats:
        """Return A^-1 J' (nv, m), the changes of velocity by unit impulses on rows of J (m, nv)."""
        changes: Floats = self._inverse @ J.T
        return changes

    @cached_property
    def _inverse(self) -> Floats:
        A = self._inertia
        if A is None:
            A = self._step.inertia(self.q, self._added_inertia)
        inverse: Floats = np.asarray(np.linalg.inv(A))
        symmetric: Floats = 0.5 * (inverse + inverse.T)
        return symmetric

    @cached_property
    def _masses(self) -> Floats:
        """Mass (nv,) that each coordinate moves [kg]; a base moves the whole robot."""
        mechanism = self.engine.model.mechanism
        moved = [float(body.inertia.mass) for body in mechanism.bodies]
        for k in range(len(moved) - 1, -1, -1):
            if (parent := mechanism.bodies[k].parent) != ROOT:
                moved[parent] += moved[k]
        whole = float(mechanism.root.mass) + sum(float(body.inertia.mass) for body in mechanism.bodies)
        masses = np.array([*[whole] * self._base, *moved])
        if mechanism.coupling is not None:
            masses = np.abs(mechanism.coupling.matrix()).T @ masses
        return masses

    def mean_speeds(self, u: Floats) -> Floats:
        """Return the root of the mean square speed (nv,) [m/s] of what each coordinate moves, if it alone has
        its entry of the velocity u (nv,)."""
        M, masses = self._step.dynamics.mass_matrix(self.q), self._masses
        squares = np.divide(np.diag(M), masses, out=np.zeros(self.nv), where=masses > 0.0)
        speeds: Floats = np.abs(u) * np.sqrt(squares)
        return speeds

    def finish(self) -> None:
        """Complete the free motion."""
        before = self.q
        self._move_freely()
        if self.limits is None:
            self._stop(before)
        self._keep_within(before)

    def _move_freely(self) -> None:
        self._keep_motor_torque(self.free)
        self.q, self.v, _ = self._scheme.moved(self.q, self.v, *self._motion)

    def _keep_motor_torque(self, end: Floats) -> None:
        if self._motors is not None:
            torque = self._motors.torque_at(end[self._base :])
            self.motor_torque = np.concatenate([np.zeros(self._base), torque])

    def finish_at(self, u: Floats, w: Floats) -> None:
        """Move with the velocity u (nv,), and end at the velocity w (nv,)."""
        before = self.q
        self._keep_motor_torque(w)
        if self._floating:
            self.q, self.v = self._displaced(u, w)
        else:
            self.q, self.v = moved_joints(before, self._h * u, self._scheme.balls), w
        self._keep_within(before)

    def _keep_within(self, before: Floats) -> None:
        """Take back what rounding carries joints beyond limits that are rows."""
        if self.limits is not None:
            first = len(self.q) - len(self.limits[0])
            low, high = bounds_of_step(before[first:], *self.limits)
            self.q[first:] = np.clip(self.q[first:], low, high)

    def _displaced(self, u: Floats, w: Floats) -> tuple[Floats, Floats]:
        work = self._displacement
        numbers: Any = work.inputs
        place, displacement, end = work.input_slices[:3]
        numbers[place], numbers[displacement], numbers[end] = self.q[:7], u[:6], w[:6]
        work.run()
        pose, twist = work.results
        joints = moved_joints(self.q[7:], self._h * u[6:], self._scheme.balls)
        return np.concatenate([pose, joints]), np.concatenate([twist, w[6:]])

    @cached_property
    def _displacement(self) -> Workspace:
        # Imported here, because robots with a fixed base need no compiler.
        from dynx.engines.own.displacement_kernel import displacement_kernel

        work = displacement_kernel().workspace()
        work.input_rows[3][:], work.input_rows[4][:] = self._h, self._scheme.center
        return work


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

    @cached_property
    def _placements(self) -> Floats:
        T = np.eye(4)
        x, y, z, *quat = self.q.tolist()
        T[:3, :3], T[:3, 3] = rotation_rows(*quat), (x, y, z)
        return T

    def pose(self, body: int) -> Floats:
        return self._placements

    def jacobian(self, body: int) -> Floats:
        R, J = self._placements[:3, :3], np.zeros((6, 6))
        J[:3, :3] = J[3:, 3:] = R
        return J

    def midpoint_pose(self, body: int) -> Floats:
        return super().midpoint_pose(ROOT)

    def midpoint_jacobian(self, body: int) -> Floats:
        return super().midpoint_jacobian(ROOT)

    @cached_property
    def _body_inverse(self) -> Floats:
        """Inverse of the inertia in the axes of the body, in which it is constant."""
        return np.asarray(np.linalg.inv(self._step.inertia(self.q)))

    def response(self, J: Floats) -> Floats:
        changes: Floats = self._body_inverse @ J.T
        return changes


def robot_of(robot: RobotLayout, h: float, settings: Mapping[str, Any]) -> OwnRobot:
    """Return a robot of the scene at its start."""
    made = OwnRobot(robot.model, robot.coefficients(), h, settings, limited=robot.limited)
    made.q, made.v = robot.q.copy(), robot.v.copy()
    return made
