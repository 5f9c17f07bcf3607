"""The last step of the engine of a world: its acceleration, what acted, and what the joints transmitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from dynx.backends import backend
from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.model import Model
from dynx.rbd.joint_wrenches import about_world
from dynx.spatial.plain import Vector3, minus, minus_cross, rotate, rotate_back, rotation_rows
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import Forces
from dynx.steppers.layout import Layout
from dynx.steppers.state import RobotState
from dynx.steppers.stepper import Stepper
from dynx.world.commands import Act, Commands
from dynx.world.contacts import Contact


class MeanAcceleration:
    """Acceleration of a robot from its states before and after one step of `h` [s].

    It is that at the beginning of a step of semi-implicit Euler. That of a floating base follows from the
    velocity of the root's centre of mass and from the angular velocity in axes of the world, as in
    `dynx.rbd.integration.floating_step`, because the axes in which v is given rotate with the base.
    """

    def __init__(self, model: Model, h: float) -> None:
        self._h, self._floating = h, model.floating
        x, y, z = model.mechanism.root_center.tolist()
        self._center: Vector3 = (float(x), float(y), float(z))

    def __call__(self, q: Floats, v: Floats, q_next: Floats, v_next: Floats) -> Floats:
        """Return the acceleration (nv,) between two states q (nq,), v (nv,)."""
        a: Floats = (v_next - v) / self._h
        if self._floating:
            a[:6] = self._of_base(q.tolist(), v.tolist(), q_next.tolist(), v_next.tolist())
        return a

    def _of_base(
        self, q: list[float], v: list[float], q_next: list[float], v_next: list[float]
    ) -> list[float]:
        h, center = self._h, self._center
        R, R_next = rotation_rows(*q[3:7]), rotation_rows(*q_next[3:7])
        w, w_next = v[3:6], v_next[3:6]
        at, at_next = minus_cross(v[:3], center, w), minus_cross(v_next[:3], center, w_next)
        alpha = [x / h for x in rotate_back(R, minus(rotate(R_next, w_next), rotate(R, w)))]
        rising = [x / h for x in rotate_back(R, minus(rotate(R_next, at_next), rotate(R, at)))]
        return [*minus_cross(minus_cross(rising, alpha, center), w, at), *alpha]


class LastStep:
    """The states of robots before the last step of the engine, and the external forces during it."""

    def __init__(self, layout: Layout, commands: Commands, h: float) -> None:
        """`h` is the length of the engine's steps [s]."""
        self._robots = {robot.name: k for k, robot in enumerate(layout.robots)}
        self._models = [robot.model for robot in layout.robots]
        self._commands, self._h = commands, h
        self._before: list[RobotState] = []

    def forget(self) -> None:
        """Forget the step: the state was set."""
        self._before = []

    def watched(self, act: Act) -> Act:
        """Return `act`, which keeps the states before each step of the engine."""

        def act_and_keep(engine: Stepper) -> Forces | None:
            self._before = [engine.robot_state(k) for k in range(len(self._models))]
            return act(engine)

        return act_and_keep

    def number(self, robot: str | None) -> int:
        """Return the number of a robot, of the only one for None."""
        if robot is None:
            if len(self._models) != 1:
                raise ArgumentError(f"wanted the name of a robot; known: {', '.join(self._robots)}")
            return 0
        try:
            return self._robots[robot]
        except (KeyError, TypeError):
            raise UnknownNameError(f"no robot {shown(robot)}{nearest(str(robot), self._robots)}") from None

    def torque(self, robot: str | None) -> Floats:
        """Return the torque (nv,) of the motors, and that given, on a robot in the step."""
        k = self.number(robot)
        self._require_step()
        return self._commands.driving(k)

    def wrenches(
        self,
        robot: str | None,
        after: RobotState,
        contacts: Sequence[Contact],
        quantity: str,
        **options: object,
    ) -> Floats:
        """Return `joint_wrenches` or `base_wrench` of a robot in the step, which led to the state `after`."""
        k = self.number(robot)
        self._require_step()
        q, v = self._before[k]
        a = MeanAcceleration(self._models[k], self._h)(q, v, *after)
        with backend("reference", self._models[k]) as engine:
            poses = dict(zip(self._models[k].frame_names, engine.forward_kinematics(q), strict=True))
            forces = self._external_forces(k, contacts, poses)
            method = getattr(engine, quantity)
            found: Floats = method(q, v, a, external_forces=forces, force_reference="world", **options)
        return found

    def _external_forces(
        self, k: int, contacts: Sequence[Contact], poses: Mapping[str, Floats]
    ) -> dict[str, Floats]:
        """Return the wrenches (6,) of external forces and contacts on the frames of a robot, about the origin
        of the world in its axes."""
        total: dict[str, Floats] = {}

        def add(frame: str, wrench: Floats) -> None:
            total[frame] = total.get(frame, 0.0) + wrench

        for frame, force, share in self._commands.on_frames(k):
            T = poses[frame]
            add(frame, about_world(force.at_center(T, np.zeros(3), share), T[:3, 3]))
        name = next(name for name, number in self._robots.items() if number == k)
        for contact in contacts:
            wrench = about_world(np.array([*contact.force, 0.0, 0.0, 0.0]), contact.point)
            for part, sign in ((contact.a, 1.0), (contact.b, -1.0)):
                owner, slash, link = part.partition("/")
                if slash and owner == name:
                    add(link, sign * wrench)
        return total

    def _require_step(self) -> None:
        if not self._before:
            raise ArgumentError("no step was taken since the state of this world was set; call step first")
