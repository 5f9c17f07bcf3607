"""`OwnStepper`: robots and bodies of a scene moved by dynx itself, over any backend.

Each robot has a backend of its own, which computes its dynamics, and a body is a floating robot of one link.
What nothing touches takes the step of `dynx.simulate` (`dynx.steppers.robot_step`). Contacts and constraints
connect parts to islands (`dynx.engines.own.impulses`), whose impulses `dynx.rbd.constraints` solves, and with
them those of joint limits. Only where a scene has neither contacts nor constraints, joints stop as in
`dynx.simulate` (`dynx.steppers.joint_stops`), under any integrator.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from math import hypot
from typing import Any, ClassVar

import numpy as np

from dynx._version import __version__
from dynx.backends.registry import BUILT_IN as BACKENDS
from dynx.engines.own.impulses import CONSTRAINT, CONTACT, MAX_RESIDUAL, Island, Key, TouchImpulse, WarmStart
from dynx.engines.own.parts import OwnBody, OwnRobot, robot_of
from dynx.engines.own.touching import ContactFinder, PossibleContact
from dynx.errors import UnsupportedFeatureError, shown
from dynx.model.numbers import DIVERGENCE_SPEED
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.steppers.failures import translate_failures
from dynx.steppers.forces import NO_FORCES, Forces
from dynx.steppers.integrators import METHODS
from dynx.steppers.joint_stops import MOVES_NO_FURTHER
from dynx.steppers.layout import WORLD, Layout, Owner, RobotLayout
from dynx.steppers.materials import STRICT_MATERIALS
from dynx.steppers.robot_step import SCHEMES
from dynx.steppers.settings import Setting
from dynx.steppers.state import BodyState, RobotState
from dynx.steppers.stepper import Feature, Stepper, TouchingPoint

TOUCHING = 1e-9
"""Gap [m] up to which two surfaces touch, since poses are rounded."""

_singular_matrices = translate_failures(
    (np.linalg.LinAlgError,), lambda _: "a mass matrix is singular or not finite"
)

_WARM = struct.Struct("<5q8d")
"""Format of a key and its impulses in a saved state."""

_ADAPTIVE = ("integrator", ("adaptive",))


class OwnStepper(Stepper):
    """A scene moved by the integrators of dynx; contacts and constraints need `semi_implicit`."""

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
        "strict_materials": STRICT_MATERIALS,
    }
    takes_ball_joints: ClassVar[bool] = True
    contact_law: ClassVar[str] = (
        "rigid contacts with circular cones of Coulomb friction and Poisson's restitution, and joint limits "
        "at which joints stop without a rebound"
    )
    beyond_limits: ClassVar[str] = MOVES_NO_FURTHER

    def __init__(self, layout: Layout, dt: float, settings: Mapping[str, Any]) -> None:
        super().__init__(layout, dt, settings)
        self.closed = False
        self._version = f"dynx {__version__}"
        self._solves_motors = bool(settings["integrator"] == "semi_implicit")
        self._robots: list[OwnRobot] = []
        self._bodies: dict[int, OwnBody] = {}
        try:
            for robot in layout.robots:
                self._robots.append(robot_of(robot, dt, settings))
            for k, body in enumerate(layout.bodies):
                if not body.fixed:
                    self._bodies[k] = OwnBody(body, layout.gravity, dt, settings)
            self._prepare_islands(settings)
        except BaseException:
            self.close()
            raise

    def _prepare_islands(self, settings: Mapping[str, Any]) -> None:
        """Prepare what touches and what is constrained.

        Raises UnsupportedFeatureError for another integrator than semi-implicit Euler.
        """
        layout = self.layout
        self._finder = ContactFinder(layout, self.dt) if layout.collides.any() else None
        self._warm: WarmStart = {}
        self._touches: list[TouchImpulse] | None = None
        self._largest_residual, self._unsolved, self._contradictory = 0.0, 0, 0
        self._contradiction: tuple[Key, ...] = ()
        self._moving = self._parts()
        robots = len(self._robots)
        self._part_of: dict[Owner, int] = {}
        bodies = {body: robots + k for k, body in enumerate(self._bodies)}
        owners = [] if self._finder is None else self._finder.owners
        ends = [end.owner for each in layout.constraints for end in (each.a, each.b)]
        self._owners = tuple(dict.fromkeys([*owners, *ends]))
        for owner in self._owners:
            if not layout.is_fixed(owner):
                if owner.robot is not None:
                    _refuse_limited_ball_joints(layout.robots[owner.robot])
                self._part_of[owner] = bodies[owner.body] if owner.robot is None else owner.robot
        self._has_islands = self._finder is not None or bool(layout.constraints)
        integrator = settings["integrator"]
        if self._has_islands and integrator != "semi_implicit":
            what = "contacts" if self._finder is not None else "constraints"
            raise UnsupportedFeatureError(
                f"the scene {shown(layout.name)} has {what}, which the integrator {integrator} does not "
                "have; wanted semi_implicit"
            )

    @classmethod
    def provides(cls, layout: Layout) -> frozenset[Feature]:
        return frozenset(Feature)

    # -- motion -------------------------------------------------------------------------------

    @_singular_matrices
    def step(self, n: int, forces: Forces = NO_FORCES) -> None:
        torques = dict(forces.torques)
        for _ in range(n):
            if self._has_islands:
                self._step_islands(torques, forces)
                continue
            for k, robot in enumerate(self._robots):
                robot.step(torques.get(k), forces.motors.get(k))
            for k, body in self._bodies.items():
                body.step(None if forces.wrenches is None else body.push(forces.wrenches[k]))

    @property
    def solves_motors(self) -> bool:
        return self._solves_motors

    def motor_torque(self, robot: int) -> Floats | None:
        return self._robots[robot].motor_torque

    def _step_islands(self, torques: Mapping[int, Floats], forces: Forces) -> None:
        wrenches = forces.wrenches
        for k, robot in enumerate(self._robots):
            robot.begin(torques.get(k), forces.motors.get(k))
        for k, body in self._bodies.items():
            body.begin(None if wrenches is None else body.push(wrenches[k]))
        if not all(hypot(*part.free.tolist()) <= DIVERGENCE_SPEED for part in self._moving):
            # The world notices that the motion has diverged. A part that fast would touch all others.
            for part in self._moving:
                part.finish()
            return
        poses = self._poses()
        jacobians = {owner: self._moving[k].jacobian(owner.body) for owner, k in self._part_of.items()}
        contacts: Sequence[PossibleContact] = ()
        if self._finder is not None:
            speeds = dict.fromkeys(self._owners, (0.0, 0.0))
            for owner, J in jacobians.items():
                x, y, z, *omega = (J @ self._moving[self._part_of[owner]].free).tolist()
                speeds[owner] = hypot(x, y, z), hypot(*omega)
            contacts = self._finder.find(poses, speeds)
        touches: list[TouchImpulse] = []
        warm: WarmStart = {}
        alone = set(range(len(self._moving)))
        for island in self._islands(contacts, poses, jacobians):
            alone -= island.parts.keys()
            found, kept = island.step(self._warm)
            touches += found
            warm |= kept
            if not island.residual <= MAX_RESIDUAL:
                self._unsolved += 1
                self._largest_residual = max(self._largest_residual, island.residual)
            if island.contradiction:
                self._contradictory += 1
                self._contradiction = self._contradiction or island.contradiction
        for k in sorted(alone):
            self._moving[k].finish()
        self._touches, self._warm = touches, warm

    def _poses(self) -> dict[Owner, Floats]:
        """Return the pose (4, 4) of each owner of shapes and ends of constraints."""
        poses = {}
        for owner in self._owners:
            if owner in self._part_of:
                poses[owner] = self._moving[self._part_of[owner]].pose(owner.body)
            elif owner.robot is not None or owner.body == WORLD:
                poses[owner] = np.eye(4)
            else:
                poses[owner] = self.layout.bodies[owner.body].T
        return poses

    def _islands(
        self,
        contacts: Sequence[PossibleContact],
        poses: Mapping[Owner, Floats],
        jacobians: Mapping[Owner, Floats],
    ) -> Iterable[Island]:
        """Return the islands of parts that contacts and constraints connect, and of robots with joint limits,
        in the order of their parts."""
        leader = list(range(len(self._moving)))

        def find(k: int) -> int:
            while leader[k] != k:
                k = leader[k]
            return k

        links: list[tuple[int, int | PossibleContact]] = []
        ends: list[tuple[Owner, Owner, int | PossibleContact]] = [
            (each.pair.owner_a, each.pair.owner_b, each) for each in contacts
        ]
        ends += [(each.a.owner, each.b.owner, k) for k, each in enumerate(self.layout.constraints)]
        for a, b, what in ends:
            numbers = [self._part_of[owner] for owner in (a, b) if owner in self._part_of]
            if numbers:
                links.append((numbers[0], what))
                first, last = sorted((find(numbers[0]), find(numbers[-1])))
                leader[last] = first
        members: dict[int, list[int]] = {}
        for k in range(len(leader)):
            members.setdefault(find(k), []).append(k)
        # A robot that nothing touches has its joint limits.
        held: dict[int, list[int | PossibleContact]] = {
            find(k): [] for k, part in enumerate(self._moving) if part.limits is not None
        }
        for k, link in links:
            held.setdefault(find(k), []).append(link)
        for first in sorted(held):
            touching = [each for each in held[first] if isinstance(each, PossibleContact)]
            tied = {k: self.layout.constraints[k] for k in held[first] if isinstance(k, int)}
            parts = {k: self._moving[k] for k in members[first]}
            yield Island(self.dt, parts, self._part_of, touching, tied, poses, jacobians)

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
        self._forget_contacts()

    def set_body_state(self, body: int, T: Floats, twist: Floats) -> None:
        self._bodies[body].set_state(T, twist)
        self._forget_contacts()

    def _forget_contacts(self) -> None:
        self._touches, self._warm = None, {}

    def dump(self) -> bytes:
        state = b"".join(part.q.tobytes() + part.v.tobytes() for part in self._parts())
        warm = (_WARM.pack(*key, *values.tolist()) for key, values in self._warm.items())
        return state + b"".join(warm)

    def load(self, data: bytes) -> None:
        size = 8 * sum(len(part.q) + len(part.v) for part in self._parts())
        numbers = np.frombuffer(data[:size])
        for part in self._parts():
            q, v, numbers = np.split(numbers, np.cumsum([len(part.q), len(part.v)]))
            part.q, part.v = q.copy(), v.copy()
        self._forget_contacts()
        for kind, a, b, c, d, *values in _WARM.iter_unpack(data[size:]):
            self._warm[kind, a, b, c, d] = np.array(values)

    def _parts(self) -> list[OwnRobot]:
        return [*self._robots, *self._bodies.values()]

    # -- queries ------------------------------------------------------------------------------

    def contacts(self) -> Sequence[TouchingPoint]:
        if self._finder is None:
            return ()
        touches = self._touches
        if touches is None:
            for part in self._moving:
                part.forget_placements()
            found = self._finder.find(self._poses(), None)
            touches = [TouchImpulse(each, 0.0, np.zeros(3)) for each in found if not each.spare]
        points, h = [], self.dt
        for contact, normal, friction in touches:
            if normal > 0.0 or contact.gap <= TOUCHING:
                pair = contact.pair
                points.append(
                    TouchingPoint(
                        pair.collider_a,
                        pair.collider_b,
                        contact.point_a,
                        contact.point_b,
                        contact.normal,
                        contact.gap,
                        normal / h,
                        friction / h,
                    )
                )
        return points

    def notes(self) -> Sequence[str]:
        found = []
        if self._unsolved:
            found.append(
                f"impulses of contacts and constraints missed their conditions {_times(self._unsolved)} by "
                f"more than {MAX_RESIDUAL:g} m/s, at most by {self._largest_residual:.3g}"
            )
        if self._contradictory:
            first = " and ".join(map(self._named, self._contradiction))
            found.append(
                f"overlaps and errors of constraints contradicted each other {_times(self._contradictory)}, "
                f"first {first}, so that the step took them back in part only"
            )
        return found

    def _named(self, key: Key) -> str:
        """Return a noun phrase for what a key stands for."""
        kind, first, second, *_ = key
        if kind == CONSTRAINT:
            constraint = self.layout.constraints[first]
            kind_of = "weld" if constraint.kind == "weld" else "point-to-point constraint"
            return f"the {kind_of} of {' and '.join(map(shown, constraint.names))}"
        if kind == CONTACT and self._finder is not None:
            return f"the contact of {' and '.join(map(shown, self._finder.names(first, second)))}"
        robot = self.layout.robots[first]
        joint = robot.model.coordinate_names[second - (6 if robot.model.floating else 0)]
        return f"the limit of {shown(f'{robot.name}/{joint}')}"

    # -- end ----------------------------------------------------------------------------------

    @property
    def version(self) -> str:
        return self._version

    def close(self) -> None:
        self.closed = True
        for part in self._parts():
            part.engine.close()


def _refuse_limited_ball_joints(robot: RobotLayout) -> None:
    """Raise UnsupportedFeatureError, naming the joint, for a limit that impulses of an island do not have."""
    if robot.model.ball_joints and robot.limited:
        ball = robot.model.ball_joints[0]
        raise UnsupportedFeatureError(
            f"the robot {shown(robot.name)} has joint limits and the ball joint {shown(ball.name)}, which "
            "the engine 'dynx' does not have together with contacts and constraints; the engine 'mujoco' has "
            "them, and joint_limits=False (in dynx world: --set joint_limits=false) switches limits off"
        )


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
