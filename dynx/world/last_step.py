"""The last step of the engine of a world: its acceleration, what acted, and what the joints transmitted."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dynx.backends import Backend, backend
from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.model import Model
from dynx.rbd.joint_wrenches import about_world
from dynx.spatial.plain import Vector3, minus, minus_cross, rotate, rotate_back, rotation_rows
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import NO_FORCES, Forces
from dynx.steppers.layout import Layout
from dynx.steppers.state import WorldState
from dynx.steppers.stepper import Stepper
from dynx.world.commands import Act, Commands
from dynx.world.contacts import Contact
from dynx.world.sensors.motion import RobotMotion

if TYPE_CHECKING:
    from dynx.world.constraint_wrenches import Reactions


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
    """The states before the last step of the engine, and what acted during it."""

    def __init__(self, layout: Layout, in_engine: Layout, commands: Commands, h: float) -> None:
        """`in_engine` is the layout with the joint dynamics that the engine has, `h` the length of the
        engine's steps [s]."""
        self._robots = {robot.name: k for k, robot in enumerate(layout.robots)}
        self._models = [robot.model for robot in layout.robots]
        self._commands, self._h = commands, h
        self.constrain(layout, in_engine)

    def constrain(self, layout: Layout, in_engine: Layout) -> None:
        """Go on with other constraints, and forget the step."""
        self._layout, self._in_engine = layout, in_engine
        self._ties = bool(layout.constraints)
        self.forget()

    def forget(self) -> None:
        """Forget the step: the state was set."""
        self._before: WorldState | None = None
        self._forces = NO_FORCES

    def watched(self, act: Act) -> Act:
        """Return `act`, which keeps what acts in each step of the engine and the states before it."""

        def act_and_keep(engine: Stepper) -> Forces | None:
            layout = self._layout
            # Without constraints nothing follows from the bodies of the scene.
            bodies = enumerate(layout.bodies if self._ties else ())
            self._before = WorldState(
                0.0,
                {robot.name: engine.robot_state(k) for k, robot in enumerate(layout.robots)},
                {body.name: engine.body_state(k) for k, body in bodies},
            )
            forces = act(engine)
            if forces is not None:
                self._forces = forces._replace(torques=[(k, tau.copy()) for k, tau in forces.torques])
            return forces

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
            raise UnknownNameError(f"no robot {shown(robot)}{nearest(robot, self._robots)}") from None

    def require(self) -> None:
        """Raise ArgumentError if no step was taken since the state was set."""
        _ = self._begun

    def wrenches(
        self,
        robot: str | None,
        engine: Stepper,
        after: WorldState,
        contacts: Sequence[Contact],
        quantity: str,
        **options: object,
    ) -> Floats:
        """Return `joint_wrenches` or `base_wrench` of a robot in the step, which led to the state `after`."""
        k = self.number(robot)
        motion = self.instant(k, engine, after, contacts)
        forces = {frame: wrench[0] for frame, wrench in motion.external_forces.items()}
        method = getattr(self._engines[k], quantity)
        state = motion.q[0], motion.v[0], motion.a[0]
        found: Floats = method(*state, external_forces=forces, force_reference="world", **options)
        return found

    def instant(
        self, k: int, engine: Stepper, after: WorldState, contacts: Sequence[Contact] | None
    ) -> RobotMotion:
        """Return robot k as the step began, which led to the state `after`, with the wrenches of contacts,
        external forces and constraints; without any where `contacts` is None."""
        q, v = self._begun.robots[self._layout.robots[k].name]
        forces = {} if contacts is None else self._all_wrenches(k, engine, after, contacts)
        rows = {frame: wrench[None] for frame, wrench in forces.items()}
        return RobotMotion(self._models[k], q[None], v[None], self._acceleration(k, after)[None], rows)

    def _all_wrenches(
        self, k: int, engine: Stepper, after: WorldState, contacts: Sequence[Contact]
    ) -> dict[str, Floats]:
        """Return the wrenches (6,) on the frames of a robot, about the origin of the world in its axes."""
        q, _ = self._begun.robots[self._layout.robots[k].name]
        forces = self._contact_forces(k, contacts)
        for frame, force, share in self._commands.on_frames(k):
            T = self._engines[k].forward_kinematics(q, frame)
            _add(forces, frame, about_world(force.at_center(T, np.zeros(3), share), T[:3, 3]))
        if self._ties:
            for link, wrench in self.reactions(engine, after, contacts).on_links(k):
                _add(forces, link, wrench)
        return forces

    def reactions(self, engine: Stepper, after: WorldState, contacts: Sequence[Contact]) -> Reactions:
        """Return the wrenches of constraints and the torques of joint limits in the step, which led to the
        state `after`."""
        # Imported here, because most scenes have neither constraints nor joints at a limit.
        from dynx.world.constraint_wrenches import StepRecord, reactions

        robots = range(len(self._models))
        step = StepRecord(
            self._begun,
            self._acting(engine),
            after,
            contacts,
            [engine.damps_at_end(k) for k in robots],
            self._h,
            [self._acceleration(k, after) for k in robots],
            self._engines,
            [self._contact_forces(k, contacts) for k in robots],
        )
        return reactions(self._layout, self._in_engine, step)

    def _acting(self, engine: Stepper) -> Forces:
        """Return what acted in the step, with the torques of the motors for which the engine solved."""
        torques = list(self._forces.torques)
        for k in self._forces.motors:
            own = engine.motor_torque(k)
            torques += [] if own is None else [(k, own)]
        return self._forces._replace(torques=torques)

    @cached_property
    def _engines(self) -> list[Backend]:
        return [backend("reference", model) for model in self._models]

    @property
    def _begun(self) -> WorldState:
        """State before the step. Raises ArgumentError if there is none."""
        if self._before is None:
            raise ArgumentError("no step was taken since the state of this world was set; call step first")
        return self._before

    def _acceleration(self, k: int, after: WorldState) -> Floats:
        name = self._layout.robots[k].name
        return MeanAcceleration(self._models[k], self._h)(*self._begun.robots[name], *after.robots[name])

    def _contact_forces(self, k: int, contacts: Sequence[Contact]) -> dict[str, Floats]:
        """Return the wrenches (6,) of contacts on the links of a robot, about the origin of the world in its
        axes."""
        total: dict[str, Floats] = {}
        for contact in contacts:
            wrench = about_world(np.array([*contact.force, 0.0, 0.0, 0.0]), contact.point)
            for part, sign in ((contact.a, 1.0), (contact.b, -1.0)):
                owner, slash, link = part.partition("/")
                if slash and owner == self._layout.robots[k].name:
                    _add(total, link, sign * wrench)
        return total


def _add(total: dict[str, Floats], frame: str, wrench: Floats) -> None:
    total[frame] = total.get(frame, 0.0) + wrench
