"""Robot model used by every backend: an immutable tree of links, joints and frames."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.files.notebook import html_grid
from dynx.model import configuration, locking, topology
from dynx.model.elements import IDENTITY, Frame, Inertial, Joint, Link, Note, Pose, Vector
from dynx.model.geometry import Geometry
from dynx.model.mechanism import Mechanism, build_mechanism
from dynx.model.number_bounds import refuse_unbounded_numbers
from dynx.model.urdf.writer import write_urdf
from dynx.registry import view
from dynx.spatial.extended import longdouble
from dynx.spatial.scalar import Floats

Base = Literal["fixed", "floating"]
Part = TypeVar("Part")
STANDARD_GRAVITY: Vector = (0.0, 0.0, -9.81)
NO_GEOMETRY = Geometry({})


@dataclass(frozen=True, eq=False)
class Model:
    """A robot: links and joints in depth-first order, its base, and gravity.

    Create one with `dynx.load` or `Model.build`. Coordinates (`q`, `v`) list the moving joints in the order
    of `joint_names`: depth-first from the root, children in the order of the document. With a floating base,
    ``q[:3]`` is the position of the base frame in the world [m], ``q[3:7]`` its unit quaternion (x, y, z, w),
    and ``v[:3]``, ``v[3:6]`` its linear [m/s] and angular [rad/s] velocity, both expressed in the base frame.
    A fixed base has the pose `base_pose` in the world.

    `geometry` holds the visual and collision shapes of the links. It affects no dynamics without contacts, so
    models that differ in it alone are equal.

    Models are immutable; they compare by content (`==`), hash and pickle.
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

    def __post_init__(self) -> None:
        if self.floating and self.base_pose != IDENTITY:
            raise ArgumentError(
                "base_pose is the pose of a fixed base; a floating base has its pose in q: position q[:3], "
                "quaternion (x, y, z, w) q[3:7]"
            )

    @classmethod
    def build(
        cls,
        name: str,
        links: Iterable[Link],
        joints: Iterable[Joint],
        *,
        base: Base = "fixed",
        gravity: ArrayLike = STANDARD_GRAVITY,
        base_pose: Pose | ArrayLike = IDENTITY,
        lock: Mapping[str, float] | None = None,
        notes: Iterable[Note] = (),
        source: str = "<memory>",
        geometry: Geometry = NO_GEOMETRY,
    ) -> Model:
        """Check that links and joints form one tree, order them, lock joints, and create the model.

        Raises DescriptionError unless they form a tree, UnknownNameError for a joint in `lock` that is
        unknown or fixed.
        """
        notes = list(notes)
        ordered_links, ordered_joints = topology.depth_first(list(links), list(joints), source)
        ordered_joints = locking.lock_joints(ordered_joints, lock or {})
        ordered_joints = topology.resolve_mimics(ordered_joints, notes, source)
        refuse_unbounded_numbers(ordered_links, ordered_joints, source)
        notes += _missing_inertial_notes(ordered_links, ordered_joints)
        return cls(
            name=name,
            links=tuple(ordered_links),
            joints=tuple(ordered_joints),
            base=configuration.checked_base(base),
            gravity=configuration.checked_gravity(gravity),
            base_pose=configuration.checked_pose("base_pose", base_pose),
            notes=tuple(notes),
            source=source,
            geometry=geometry.for_links(link.name for link in ordered_links),
        )

    # -- names and sizes ---------------------------------------------------------------------

    @cached_property
    def coordinate_joints(self) -> tuple[Joint, ...]:
        """Joints with a coordinate of their own: they move and follow no other joint."""
        return tuple(joint for joint in self.joints if joint.moves and joint.mimic is None)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the coordinates, in order; name k belongs to ``v[k]``, after the 6 of a floating base."""
        return tuple(joint.name for joint in self.coordinate_joints)

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
        return len(self.coordinate_joints) + (7 if self.floating else 0)

    @cached_property
    def nv(self) -> int:
        """Length of a velocity `v`, an acceleration `a` and a torque `tau`."""
        return len(self.coordinate_joints) + (6 if self.floating else 0)

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

    def coordinate_index(self, joint: str) -> int:
        """Return the index of the joint's coordinate in `v` (one higher in `q` with a floating base)."""
        offset = 6 if self.floating else 0
        if joint in self.joint_names:
            return offset + self.joint_names.index(joint)
        found = self.joint(joint)
        why = "it is locked" if found.locked_at is not None else "it is fixed"
        if found.mimic is not None:
            why = f"it follows {shown(found.mimic.joint)}"
        raise UnknownNameError(f"joint {shown(joint)} of {self.name} has no coordinate: {why}")

    # -- limits ------------------------------------------------------------------------------

    @cached_property
    def lower(self) -> Floats:
        """Lower position limits (nq,); -inf for a continuous joint and for a floating base."""
        return configuration.position_limits(self)[0]

    @cached_property
    def upper(self) -> Floats:
        """Upper position limits (nq,)."""
        return configuration.position_limits(self)[1]

    @cached_property
    def velocity_limit(self) -> Floats:
        """Largest speed of each coordinate (nv,) [rad/s or m/s], inf for no limit."""
        base = [np.inf] * (6 if self.floating else 0)
        return np.array(base + [joint.limits.velocity for joint in self.coordinate_joints])

    @cached_property
    def effort_limit(self) -> Floats:
        """Largest effort of each coordinate (nv,) [N m or N], inf for no limit."""
        base = [np.inf] * (6 if self.floating else 0)
        return np.array(base + [joint.limits.effort for joint in self.coordinate_joints])

    # -- configuration arithmetic ------------------------------------------------------------

    neutral = configuration.neutral
    random = configuration.random
    integrate = configuration.integrate
    difference = configuration.difference
    clip = configuration.clip

    # -- other forms -------------------------------------------------------------------------

    @cached_property
    def mechanism(self) -> Mechanism:
        """The moving bodies in float64, on which the algorithms of `dynx.rbd` work."""
        return build_mechanism(self)

    to_urdf = write_urdf

    @cached_property
    def extended_mechanism(self) -> Mechanism:
        """`mechanism` with its inertias merged in extended precision (`dynx.spatial.extended`)."""
        return build_mechanism(self, longdouble)

    def with_base(self, base: Base) -> Model:
        """Return the same robot with that kind of base; `base_pose` is kept for a fixed base only, because a
        floating one has its pose in q."""
        base_pose = IDENTITY if base == "floating" else self.base_pose
        return replace(self, base=configuration.checked_base(base), base_pose=base_pose)

    def with_base_pose(self, base_pose: Pose | ArrayLike) -> Model:
        """Return the same robot with its fixed base at another pose in the world.

        `base_pose` is the pose of the root link: a `Pose`, or a matrix T_world_base (4, 4). Raises
        ArgumentError for a floating base, whose pose is in q.
        """
        return replace(self, base_pose=configuration.checked_pose("base_pose", base_pose))

    def with_gravity(self, gravity: ArrayLike) -> Model:
        """Return the same robot with another gravity (3,) [m/s^2]."""
        return replace(self, gravity=configuration.checked_gravity(gravity))

    def with_frame(self, name: str, link: str, placement: Pose | ArrayLike = IDENTITY) -> Model:
        """Return the same robot with one more named frame, fixed to `link` (a tool tip, say).

        `placement` is the pose of the frame in the link: a `Pose`, or a matrix T_link_frame (4, 4).
        """
        self.link(link)
        if not isinstance(name, str) or not name:
            raise ArgumentError(f"a frame's name is {shown(name)}; wanted a str that is not empty")
        placement = configuration.checked_pose("placement", placement)
        if name in self._frame_index:
            raise ArgumentError(f"frame {shown(name)} exists already in {self.name}")
        return replace(self, extra_frames=(*self.extra_frames, Frame(name, link, placement)))

    def inertial(self, link: str) -> Inertial:
        """Return the inertial of a link; a link without one has no mass."""
        return self.link(link).inertial or Inertial()

    def view(self, **options: Any) -> Any:
        """Show the robot in the browser; return the `dynx.viewer.Viewer`, which takes the options.

        Raises NotInstalledError without the extra ``viewer``.
        """
        return view(self, **options)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Model) and self._content == other._content

    def __hash__(self) -> int:
        return self._hash

    def __repr__(self) -> str:
        return f"<Model {self.name}: {self.base} base, nq {self.nq}, nv {self.nv}, {len(self.links)} links>"

    def _repr_html_(self) -> str:
        rows = (
            (
                joint.name,
                joint.type,
                joint.parent,
                joint.child,
                *(f"{x:.4g}" for x in (joint.limits.lower, joint.limits.upper)),
                *(f"{x:.4g}" for x in (joint.limits.velocity, joint.limits.effort)),
            )
            for joint in self.coordinate_joints
        )
        head = ("joint", "type", "parent", "child", "lower", "upper", "velocity", "effort")
        return html_grid(f"{repr(self)[1:-1]}, {self.total_mass:.6g} kg", head, rows)

    def __getstate__(self) -> dict[str, Any]:
        fields = self.__dataclass_fields__
        return {name: value for name, value in self.__dict__.items() if name in fields}

    @cached_property
    def _content(self) -> tuple[object, ...]:
        return (
            self.name,
            self.links,
            self.joints,
            self.base,
            self.gravity,
            self.extra_frames,
            self.base_pose,
        )

    @cached_property
    def _hash(self) -> int:
        return hash(self._content)

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
            raise UnknownNameError(self._unknown_name_message(kind, name, known)) from None

    def _unknown_name_message(self, kind: str, name: object, known: Mapping[str, object]) -> str:
        message = f"no {kind} {shown(name)} in {self.name}"
        if not isinstance(name, str):
            return f"{message}: a name is a str, not {type(name).__name__}"
        if kind != "joint" and name in self._joint_by_name:
            child = self._joint_by_name[name].child
            return f"{message}: that is a joint; the {kind} it moves is {shown(child)}"
        if kind == "joint" and name in self._link_by_name:
            above = [joint.name for joint in self.joints if joint.child == name]
            moved = f"; the joint that moves it is {shown(above[0])}" if above else ", the root"
            return f"{message}: that is a link{moved}"
        return message + nearest(name, known)


def refuse_other_than_model(model: object) -> None:
    """Raise ArgumentError for anything but a `Model`, such as a robot's name."""
    if not isinstance(model, Model):
        example = shown(model) if isinstance(model, str) else "..."
        raise ArgumentError(
            f"model is of type {type(model).__name__}; wanted a Model, such as dynx.load({example})"
        )


def _missing_inertial_notes(links: Iterable[Link], joints: Iterable[Joint]) -> list[Note]:
    """Return a note for each moving link without an inertial; some engines give it a mass of 1 kg."""
    moved = {joint.child: joint.name for joint in joints if joint.moves}
    return [
        Note(
            f"link {shown(link.name)} has no <inertial>, so no mass, but {shown(moved[link.name])} moves it",
            link.line,
        )
        for link in links
        if link.inertial is None and link.name in moved
    ]
