"""Tree of links, joints and frames: what a description states, with names, sizes and limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, UnknownNameError, shown
from dynx.model.elements import (
    IDENTITY,
    Frame,
    Inertial,
    Joint,
    Link,
    Note,
    Pose,
    Vector,
)
from dynx.model.geometry.links import ContactFilter, Geometry
from dynx.registry import door
from dynx.spatial.scalar import Floats

if TYPE_CHECKING:
    from dynx.model.stated_parts import (
        Actuator,
        NamedConfiguration,
        StatedEquality,
        StatedGravityCompensation,
        StatedSensor,
        StatedTendon,
    )

Base = Literal["fixed", "floating"]
Part = TypeVar("Part")
STANDARD_GRAVITY: Vector = (0.0, 0.0, -9.81)
NO_GEOMETRY = Geometry({})


@dataclass(frozen=True, eq=False, repr=False)
class Tree:
    """Links and joints in depth-first order, the base and gravity; `Model` adds what is computed from them.

    Coordinates (`q`, `v`) list the moving joints in the order of `joint_names`, after those of a floating
    base. A ball joint has four entries of q, a unit quaternion (x, y, z, w), and three of v.
    """

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    base: Base = "fixed"
    gravity: Vector = STANDARD_GRAVITY
    extra_frames: tuple[Frame, ...] = ()
    base_pose: Pose = IDENTITY
    notes: tuple[Note, ...] = field(default=(), compare=False)
    source: str = field(default="<memory>", compare=False)
    geometry: Geometry = field(default=NO_GEOMETRY, compare=False)
    actuators: tuple[Actuator, ...] | None = field(default=None, compare=False)
    """Actuators of the joints, as data; None if the description format has none, as URDF and SDF."""
    contact_filter: ContactFilter | None = field(default=None, compare=False)
    """Which collision shapes may touch; None if the description format does not say, as URDF and SDF."""
    stated_configurations: tuple[NamedConfiguration, ...] | None = field(default=None, compare=False)
    """Configurations that the description names, by joints; None if its format has none, as URDF and SDF."""
    sensors: tuple[StatedSensor, ...] | None = field(default=None, compare=False)
    """Sensors, fixed tendons, constraints and compensated weights, as data; None but for MJCF."""
    tendons: tuple[StatedTendon, ...] | None = field(default=None, compare=False)
    equalities: tuple[StatedEquality, ...] | None = field(default=None, compare=False)
    gravity_compensation: tuple[StatedGravityCompensation, ...] | None = field(default=None, compare=False)
    stated_initial: NamedConfiguration | None = field(default=None, compare=False)
    """Configuration in which the description places the robot, by joints; None for one that is not MJCF."""

    def __post_init__(self) -> None:
        if self.floating and self.base_pose != IDENTITY:
            raise ArgumentError(
                "base_pose is the pose of a fixed base; a floating base has its pose in q: position q[:3], "
                "quaternion (x, y, z, w) q[3:7]"
            )

    # -- names and sizes ---------------------------------------------------------------------

    @cached_property
    def coordinate_joints(self) -> tuple[Joint, ...]:
        """Joints with coordinates of their own: they move and follow no other joint."""
        return tuple(joint for joint in self.joints if joint.moves and joint.mimic is None)

    @cached_property
    def ball_joints(self) -> tuple[Joint, ...]:
        """Joints whose position is a quaternion."""
        return tuple(joint for joint in self.joints if joint.type == "ball")

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints with coordinates, in order; without ball joints, name k belongs to ``v[k]``,
        after the 6 of a floating base."""
        return tuple(joint.name for joint in self.coordinate_joints)

    @cached_property
    def coordinate_names(self) -> tuple[str, ...]:
        """Names of the entries of v, after the 6 of a floating base: those of the joints, and of a ball joint
        three, with the axes ``.x``, ``.y`` and ``.z`` of its child."""
        return tuple(
            name
            for joint in self.coordinate_joints
            for name in ([f"{joint.name}.{axis}" for axis in "xyz"] if joint.type == "ball" else [joint.name])
        )

    @cached_property
    def position_names(self) -> tuple[str, ...]:
        """Names of the entries of q, after the 7 of a floating base: as `coordinate_names`, and of a ball
        joint four, with the components ``.qx``, ``.qy``, ``.qz`` and ``.qw`` of its quaternion."""
        return tuple(
            name
            for joint in self.coordinate_joints
            for name in (
                [f"{joint.name}.q{part}" for part in "xyzw"] if joint.type == "ball" else [joint.name]
            )
        )

    @cached_property
    def ball_places(self) -> tuple[int, ...]:
        """Index in q at which the quaternion of each ball joint begins."""
        return tuple(self.position_index(joint.name) for joint in self.ball_joints)

    @cached_property
    def quaternions(self) -> tuple[int, ...]:
        """Index in q at which each quaternion begins: that of a floating base, then those of ball joints."""
        return (3,) * self.floating + self.ball_places

    @cached_property
    def frames(self) -> tuple[Frame, ...]:
        """One frame per link, in depth-first order, then the added frames."""
        return tuple(Frame(link.name, link.name) for link in self.links) + self.extra_frames

    @cached_property
    def frame_names(self) -> tuple[str, ...]:
        """Names of all frames, in the order in which `forward_kinematics` stacks them."""
        return tuple(frame.name for frame in self.frames)

    @cached_property
    def root(self) -> str:
        """Name of the root link, whose frame is the base frame."""
        return self.links[0].name

    @cached_property
    def floating(self) -> bool:
        """True if the base moves freely."""
        return self.base == "floating"

    @cached_property
    def nq(self) -> int:
        """Length of a configuration `q`."""
        return sum(joint.n_positions for joint in self.coordinate_joints) + (7 if self.floating else 0)

    @cached_property
    def nv(self) -> int:
        """Length of a velocity `v`, an acceleration `a` and a torque `tau`."""
        return sum(joint.n_rates for joint in self.coordinate_joints) + (6 if self.floating else 0)

    @cached_property
    def total_mass(self) -> float:
        """Sum of the masses of the links [kg]."""
        return float(sum(link.inertial.mass for link in self.links if link.inertial is not None))

    def joint(self, name: str) -> Joint:
        """Return the joint of that name (of any type); UnknownNameError if there is none."""
        return self._named("joint", name, self._joint_by_name)

    def link(self, name: str) -> Link:
        """Return the link of that name; UnknownNameError if there is none."""
        return self._named("link", name, self._link_by_name)

    def frame_index(self, name: str) -> int:
        """Return the index of the frame in `frame_names`; UnknownNameError if there is none."""
        return self._named("frame", name, self._frame_index)

    @checks_types
    def coordinate_index(self, joint: str) -> int:
        """Return the index in `v` of the joint's coordinate, of a ball joint the first of three.

        Without ball joints before it, the index in `q` is the same, or one higher with a floating base
        (`position_index`).
        """
        if joint in self._first_indices:
            return self._first_indices[joint][1]
        found = self.joint(joint)
        why = "it is locked" if found.locked_at is not None else "it is fixed"
        if found.mimic is not None:
            why = f"it follows {shown(found.mimic.joint)}"
        raise UnknownNameError(f"joint {shown(joint)} of {self.name} has no coordinate: {why}")

    @checks_types
    def position_index(self, joint: str) -> int:
        """Return the index in `q` of the joint's position, of a ball joint the first of four.

        Raises UnknownNameError as `coordinate_index` does."""
        if joint not in self._first_indices:
            self.coordinate_index(joint)
        return self._first_indices[joint][0]

    @cached_property
    def configurations(self) -> Mapping[str, Floats]:
        """Named configurations q (nq,) of the description, such as keyframes of MJCF; read-only arrays."""
        return self._named_configurations()

    @cached_property
    def initial_configuration(self) -> Floats:
        """Configuration q (nq,) in which MJCF places the robot (`qpos0`), else the neutral one; read-only."""
        return self._initial_configuration()

    @door("dynx.model.named_configurations:initial_configuration")
    def _initial_configuration(self) -> Floats:
        raise NotImplementedError

    @door("dynx.model.named_configurations:named_configurations")
    def _named_configurations(self) -> Mapping[str, Floats]:
        raise NotImplementedError

    # -- limits ------------------------------------------------------------------------------

    @cached_property
    def lower(self) -> Floats:
        """Lower position limits (nq,); -inf for a continuous joint, a ball joint and a floating base."""
        return self._position_limits[0]

    @cached_property
    def upper(self) -> Floats:
        """Upper position limits (nq,)."""
        return self._position_limits[1]

    @cached_property
    def velocity_limit(self) -> Floats:
        """Largest speed of each coordinate (nv,) [rad/s or m/s], inf for no limit."""
        base = [np.inf] * (6 if self.floating else 0)
        joints = self.coordinate_joints
        return np.array(base + [each.limits.velocity for each in joints for _ in range(each.n_rates)])

    @cached_property
    def effort_limit(self) -> Floats:
        """Largest effort of each coordinate (nv,) [N m or N], inf for no limit."""
        base = [np.inf] * (6 if self.floating else 0)
        joints = self.coordinate_joints
        return np.array(base + [each.limits.effort for each in joints for _ in range(each.n_rates)])

    def inertial(self, link: str) -> Inertial:
        """Return the inertial of a link; a link without one has no mass."""
        return self.link(link).inertial or Inertial()

    @cached_property
    def _position_limits(self) -> tuple[Floats, Floats]:
        """Lower and upper limits, each (nq,): each joint's own, narrowed by those of joints that mimic it.

        If the lower limit in the file exceeds the upper one, the two are exchanged (the reader adds a note).
        If the limits of a follower leave no range for its driver, the driver's own limits apply. The entries
        of a quaternion have none: the angle of a ball joint is limited (`Limits`).
        """
        lower, upper = np.full(self.nq, -np.inf), np.full(self.nq, np.inf)
        index = {name: first for name, (first, _) in self._first_indices.items()}
        for joint in self.coordinate_joints:
            if joint.type == "ball":
                continue
            k = index[joint.name]
            lower[k] = min(joint.limits.lower, joint.limits.upper)
            upper[k] = max(joint.limits.lower, joint.limits.upper)
        for joint in self.joints:
            if joint.mimic is None or joint.mimic.multiplier == 0.0:
                continue
            k = index[joint.mimic.joint]
            ends = sorted(
                (limit - joint.mimic.offset) / joint.mimic.multiplier
                for limit in (joint.limits.lower, joint.limits.upper)
            )
            low, high = max(lower[k], ends[0]), min(upper[k], ends[1])
            if low <= high:
                lower[k], upper[k] = low, high
        # Adding 0.0 turns -0.0 into 0.0: NumPy's generator rejects the range from 0.0 to -0.0.
        return lower + 0.0, upper + 0.0

    @cached_property
    def _first_indices(self) -> dict[str, tuple[int, int]]:
        """Index in q and in v at which each joint with coordinates begins."""
        found, in_q, in_v = {}, 7 if self.floating else 0, 6 if self.floating else 0
        for joint in self.coordinate_joints:
            found[joint.name] = in_q, in_v
            in_q, in_v = in_q + joint.n_positions, in_v + joint.n_rates
        return found

    @cached_property
    def _joint_by_name(self) -> dict[str, Joint]:
        return {joint.name: joint for joint in self.joints}

    @cached_property
    def _link_by_name(self) -> dict[str, Link]:
        return {link.name: link for link in self.links}

    @cached_property
    def _frame_index(self) -> dict[str, int]:
        return {name: index for index, name in enumerate(self.frame_names)}

    def _named(self, kind: str, name: str, known: Mapping[str, Part]) -> Part:
        try:
            return known[name]
        except (KeyError, TypeError):
            from dynx.model.unknown_names import unknown_name_message

            message = unknown_name_message(self.name, self.links, self.joints, kind, name, known)
            raise UnknownNameError(message) from None


@dataclass(frozen=True)
class Description:
    """Content of a file: parts in the order of the file, not yet checked to form a tree."""

    name: str | None
    links: list[Link]
    joints: list[Joint]
    frames: list[Frame]
    notes: list[Note]
    geometry: Geometry = NO_GEOMETRY
    unread: Note | None = None
    """The first ignored element that may hold links or joints; it explains why the parts form no tree."""
    base: Base | None = None
    """The base that the file states; None for a format that leaves it open."""
    gravity: Vector = STANDARD_GRAVITY
    base_pose: Pose = IDENTITY
    actuators: tuple[Actuator, ...] | None = None
    contact_filter: ContactFilter | None = None
    configurations: tuple[NamedConfiguration, ...] | None = None
    sensors: tuple[StatedSensor, ...] | None = None
    tendons: tuple[StatedTendon, ...] | None = None
    equalities: tuple[StatedEquality, ...] | None = None
    gravity_compensation: tuple[StatedGravityCompensation, ...] | None = None
    initial: NamedConfiguration | None = None


def checked_base(base: str) -> Literal["fixed", "floating"]:
    """Return `base`; raise ArgumentError unless it is ``"fixed"`` or ``"floating"``."""
    if base == "fixed":
        return "fixed"
    if base == "floating":
        return "floating"
    raise ArgumentError(f"base is {shown(base)}; wanted 'fixed' or 'floating'")
