"""A scene prepared for an engine: numbers in place of names, every mesh read, every filter evaluated.

`dynx.world.World` builds it from a scene and passes it to the engine, so that no engine resolves a name,
reads a file, or sees a value that was not checked.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.model import Model
from dynx.model.elements import Joint, JointCoefficients, JointSprings
from dynx.model.geometry import Shape
from dynx.model.mechanism import springs_of
from dynx.spatial.scalar import Floats
from dynx.steppers.material import Material

WORLD = -1
"""Number of the body that is the world itself."""


class Owner(NamedTuple):
    """The rigid body to which a collider or an end of a constraint belongs."""

    robot: int | None
    """Number of the robot; None for a body of the scene or the world."""
    body: int
    """Number of the moving body in the robot's mechanism (ROOT = -1: its base); without a robot, number of
    the body of the scene, or WORLD."""


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A shape and its pose in the frame of its owner (4, 4).

    The frame is that of the mechanism's body, for the base of a robot its base frame, and for a fixed base
    the world. The hull of a mesh has been computed: `shape.hull` reads no file.
    """

    shape: Shape
    T: Floats


@dataclass(frozen=True, eq=False)
class Collider:
    """The collision shapes of one link of a robot, or of one body of the scene."""

    name: str
    """Name in contacts: ``robot/link``, or that of the body."""
    owner: Owner
    shapes: tuple[PlacedShape, ...]
    material: Material


def stop_positions(model: Model) -> tuple[Floats, Floats]:
    """Return the lowest and the highest value (n,) [rad or m] of each position of a joint, in q; infinite
    where it has no stop, as those of a quaternion (`joint_stops.BallStops` has those of ball joints)."""
    joints = slice(7 if model.floating else 0, None)
    return model.lower[joints], model.upper[joints]


@dataclass(frozen=True, eq=False)
class RobotLayout:
    """A robot at its start; arrays over joints have an entry for each body of `model.mechanism`."""

    name: str
    model: Model
    q: Floats
    """Configuration (nq,) at the start, in the coordinates of the model."""
    v: Floats
    """Velocity (nv,) at the start."""
    lower: Floats
    """Lower limits (n,) of the joints [rad or m]; minus infinity where there is none."""
    upper: Floats
    """Upper limits (n,) of the joints [rad or m]; infinity where there is none."""
    damping: Floats
    """Viscous damping (n,) of the joints [N m s/rad or N s/m]."""
    friction: Floats
    """Coulomb friction (n,) of the joints [N m or N]."""
    armature: Floats
    """Armature (n,) of the joints [kg m^2 or kg]."""
    stiffness: Floats
    """Stiffness (n,) of the joints' springs [N m/rad or N/m]."""
    spring_reference: Floats
    """Positions (n,) at which the springs do not pull [rad or m]."""
    largest_angles: tuple[float, ...] = ()
    """Largest angle [rad] of each ball joint, infinite where it has none; in the arrays over joints the three
    entries of a ball joint have no limit."""

    @property
    def limited(self) -> bool:
        """True if a joint has a limit."""
        angles = np.isfinite(self.largest_angles).any()
        return bool(angles or np.isfinite([self.lower, self.upper]).any())

    def joint_positions(self, q: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the position of each moving joint at q (nq,), its lower and its upper limit, (n,) each; of a
        ball joint the angle of its rotation, with minus infinity as the lower limit."""
        model = self.model
        if not model.ball_joints:
            return model.mechanism.tree_q(q)[7 if model.floating else 0 :], self.lower, self.upper
        from dynx.model.limited_positions import limited_positions  # most robots have no ball joints

        firsts = [k for k, body in enumerate(model.mechanism.bodies) if not body.ball]
        lower, upper = self.lower[firsts], self.upper[firsts]
        balls = [k for k, joint in enumerate(model.coordinate_joints) if joint.type == "ball"]
        upper[balls] = self.largest_angles
        return limited_positions(model, q), lower, upper

    @property
    def springs(self) -> JointSprings | None:
        """Springs of the model's coordinates; None if no joint has one."""
        if not self.stiffness.any():
            return None
        return springs_of(self.model.mechanism, self.stiffness, self.spring_reference)

    def coefficients(self) -> JointCoefficients:
        """Return the coefficients (nv,) of the model's coordinates: those of a mimic joint act on its driver
        through its multiplier."""
        base = np.zeros(6 if self.model.floating else 0)
        tree = (np.concatenate([base, each]) for each in (self.damping, self.friction, self.armature))
        damping, friction, armature = tree
        coupling = self.model.mechanism.coupling
        if coupling is None:
            return JointCoefficients(damping, friction, armature, self.springs)
        S = coupling.matrix()
        return JointCoefficients((S**2).T @ damping, abs(S).T @ friction, (S**2).T @ armature, self.springs)


@dataclass(frozen=True, eq=False)
class BodyLayout:
    """A body of the scene at its start; one without mass is fixed in the world."""

    name: str
    mass: float
    center: Floats
    """Centre of mass (3,) in the body frame [m]."""
    inertia: Floats
    """Inertia (3, 3) about the centre of mass, in the axes of the body frame [kg m^2]."""
    T: Floats
    """Pose of the body frame in the world (4, 4)."""
    twist: Floats
    """Linear velocity of the origin of the body frame, then angular velocity (6,), in world axes."""

    @property
    def fixed(self) -> bool:
        """True if the body is fixed in the world."""
        return self.mass == 0.0


class Anchor(NamedTuple):
    """One end of a constraint: a frame in the frame of its owner (4, 4)."""

    owner: Owner
    T: Floats


@dataclass(frozen=True, eq=False)
class ConstraintLayout:
    """A weld makes the frames of both anchors coincide, a ``point`` their origins only."""

    kind: Literal["weld", "point"]
    a: Anchor
    b: Anchor
    names: tuple[str, str]
    """Names of the parts at the ends, for messages."""
    active: bool = True
    """False if it does nothing until it is switched on; engines are given active ones only."""
    collides: bool = True
    """False if its ends do not collide with each other while it is active; `Layout.collides` of the layout
    that an engine is given has that."""
    held: bool = field(default=False, compare=False)
    """True for a weld that keeps the pose in which it is switched on."""
    name: str = field(default="", compare=False)


@dataclass(frozen=True, eq=False)
class SensorLayout:
    """A sensor, for an engine with sensors of its own; it changes nothing that moves."""

    name: str
    kind: str
    """``imu``, ``force_torque``, ``joint_torque``, ``encoder``, ``contact`` or ``ray``."""
    part: str
    """Link (``robot/link``) or body in whose frame `T` is."""
    T: Floats
    """Pose of the sensor's frame (4, 4)."""
    joint: Joint | None = None
    """The joint that is measured; None for the foundation."""


@dataclass(frozen=True, eq=False)
class Layout:
    """A scene in numbers; robots, bodies and colliders are in the order of the scene."""

    name: str
    gravity: Floats
    robots: tuple[RobotLayout, ...]
    bodies: tuple[BodyLayout, ...]
    colliders: tuple[Collider, ...]
    """Links and bodies that have shapes; empty if the world has no collisions."""
    collides: NDArray[np.bool_]
    """Matrix (n, n), True for colliders that may touch: symmetric, False on the diagonal, between colliders
    of one owner, between fixed ones, and where the scene ignores the pair."""
    constraints: tuple[ConstraintLayout, ...]
    sensors: tuple[SensorLayout, ...] = field(default=(), compare=False)

    def is_fixed(self, owner: Owner) -> bool:
        """Check whether a body cannot move: the world, a fixed base, or a body without mass."""
        if owner.robot is not None:
            return owner.body == WORLD and not self.robots[owner.robot].model.floating
        return owner.body == WORLD or self.bodies[owner.body].fixed


EMPTY = Layout("empty", np.zeros(3), (), (), (), np.zeros((0, 0), dtype=np.bool_), ())
"""A scene of nothing."""
