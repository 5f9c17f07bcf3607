"""Robot model used by every backend: an immutable tree of links, joints and frames."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, shown
from dynx.model import configuration, topology
from dynx.model.elements import IDENTITY, Inertial, Joint, Link, Note, Pose, checked_pose
from dynx.model.geometry.links import ContactFilter, Geometry
from dynx.model.mechanism import Mechanism, build_mechanism
from dynx.model.numbers import checked_gravity
from dynx.model.package_search import StrPath
from dynx.model.topology import refuse_unbounded_numbers
from dynx.model.tree import NO_GEOMETRY, STANDARD_GRAVITY, Base, Tree, checked_base
from dynx.registry import door, explains_names
from dynx.spatial.scalar import Floats, longdouble

if TYPE_CHECKING:
    from dynx.model.stated_parts import Actuator


@explains_names
@checks_types
@dataclass(frozen=True, eq=False)
class Model(Tree):
    """A robot: links and joints in depth-first order, its base, and gravity.

    `dynx.load` and `Model.build` create a model. The coordinates (`q`, `v`) list the moving joints in the
    order of `joint_names`: depth-first from the root, children in the order of the document.

    - Floating base: ``q[:3]`` is the position of the base frame in the world [m], ``q[3:7]`` its unit
      quaternion (x, y, z, w), ``v[:3]`` its linear [m/s] and ``v[3:6]`` its angular velocity [rad/s], both in
      the axes of the base frame. A fixed base has the pose `base_pose` in the world
    - Ball joint: q has the attitude of the child in the joint's frame, as a unit quaternion (x, y, z, w).
      v has the angular velocity of the child relative to the parent, in the axes of the child

    `geometry` (visual and collision shapes), `contact_filter` (shapes that may touch), `configurations`,
    `actuators`, `sensors`, `tendons`, `equalities` and `gravity_compensation` do not affect the dynamics, and
    `==` ignores them. `actuator_forces` computes the torques of the actuators.

    Models are immutable. You can compare them by content (`==`), hash and pickle them.
    """

    @classmethod
    @checks_types
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
        actuators: Iterable[Actuator] | None = None,
        contact_filter: ContactFilter | None = None,
    ) -> Model:
        """Check that links and joints form one tree, order them, lock joints, and create the model.

        Raises DescriptionError unless they form a tree, UnknownNameError for a joint in `lock` that is
        unknown or fixed.
        """
        notes = list(notes)
        ordered_links, ordered_joints = topology.depth_first(list(links), list(joints), source)
        ordered_joints = topology.lock_joints(ordered_joints, lock or {})
        ordered_joints = topology.resolve_mimics(ordered_joints, notes, source)
        refuse_unbounded_numbers(ordered_links, ordered_joints, source)
        notes += missing_inertial_notes(ordered_links, ordered_joints)
        return cls(
            name=name,
            links=tuple(ordered_links),
            joints=tuple(ordered_joints),
            base=checked_base(base),
            gravity=checked_gravity(gravity),
            base_pose=checked_pose("base_pose", base_pose),
            notes=tuple(notes),
            source=source,
            geometry=geometry.for_links(link.name for link in ordered_links),
            actuators=None if actuators is None else tuple(actuators),
            contact_filter=contact_filter,
        )

    # -- configuration arithmetic ------------------------------------------------------------

    neutral = configuration.neutral
    random = configuration.random
    integrate = configuration.integrate
    difference = configuration.difference
    clip = configuration.clip

    @door("dynx.model.actuation:actuator_forces")
    def actuator_forces(self, ctrl: ArrayLike, q: ArrayLike, v: ArrayLike) -> Floats:
        """Return the generalised force tau (..., nv) of `actuators` for the commands `ctrl` (..., nu).

        It is MuJoCo's ``qfrc_actuator`` in the state q (..., nq), v (..., nv), in the coordinates of dynx.
        Each command has the unit of its actuator. Commands, forces of actuators, the sum of the forces on a
        tendon, and the efforts of joints are limited as in MuJoCo. The methods of your own task or controller
        may call this function in compiled code, too. Muscles, and actuators with a state of their own or on a
        site or body, are not among `actuators`: `notes` names them.

        Raises ArgumentError for a robot whose description is not in MJCF.
        """
        raise NotImplementedError

    # -- other forms -------------------------------------------------------------------------

    @cached_property
    def mechanism(self) -> Mechanism:
        """The moving bodies in float64, on which the algorithms of `dynx.rbd` work."""
        return build_mechanism(self)

    @door("dynx.model.urdf.writer:write_urdf")
    def to_urdf(self, *, geometry: bool = False) -> str:
        """Return the robot as URDF text in canonical form: one element a line, nothing that has its default.

        `dynx.load` of the text returns an equal model; equality ignores shapes, which `geometry` adds. Others
        ignore the extensions that state what URDF cannot: gravity, the base, locked joints, frames. Raises
        DescriptionError for a name, a number or a shape that URDF cannot express.
        """
        raise NotImplementedError

    @door("dynx.model.mjcf.writer:write_mjcf")
    def to_mjcf(self) -> str:
        """Return the robot as MJCF text, MuJoCo's format, with comments on what that cannot say.

        `dynx.load` of it returns the same robot. Raises DescriptionError for what MJCF cannot express."""
        raise NotImplementedError

    @door("dynx.model.sdf.writer:write_sdf")
    def to_sdf(self) -> str:
        """Return the robot as SDF text, Gazebo's format, as `to_mjcf` does."""
        raise NotImplementedError

    @door("dynx.loaded.order:order_of")
    def order_of(self, engine: str) -> Any:
        """Return the `dynx.loaded.EngineOrder`: the order of q and v in an engine that loads the file itself,
        such as ``"mujoco"``."""
        raise NotImplementedError

    @cached_property
    def extended_mechanism(self) -> Mechanism:
        """`mechanism` with its inertias merged in extended precision (`dynx.spatial.scalar`)."""
        return build_mechanism(self, longdouble)

    @checks_types
    def with_base(self, base: Base) -> Model:
        """Return the same robot with another kind of base.

        A fixed base keeps its `base_pose`; a floating base has its pose in q.
        """
        base_pose = IDENTITY if base == "floating" else self.base_pose
        return replace(self, base=checked_base(base), base_pose=base_pose)

    def with_base_pose(self, base_pose: Pose | ArrayLike) -> Model:
        """Return the same robot with its fixed base at another pose in the world.

        `base_pose` is the pose of the root link: a `Pose`, or a matrix T_world_base (4, 4). Raises
        ArgumentError for a floating base, whose pose is in q.
        """
        return replace(self, base_pose=checked_pose("base_pose", base_pose))

    def with_gravity(self, gravity: ArrayLike) -> Model:
        """Return the same robot with another gravity (3,) [m/s^2]."""
        return replace(self, gravity=checked_gravity(gravity))

    @door("dynx.model.replaced_inertials:with_inertials")
    def with_inertials(self, inertials: Mapping[str, Inertial]) -> Model:
        """Return the same robot with other inertials of the links named, such as identified ones.

        `Inertial.from_parameters` makes an inertial of the ten parameters of a link. Inertials that no body
        has are used as they are, with a note. Raises UnknownNameError for an unknown link.
        """
        raise NotImplementedError

    @door("dynx.model.added_frames:with_frame")
    def with_frame(self, name: str, link: str, placement: Pose | ArrayLike = IDENTITY) -> Model:
        """Return the same robot with one more named frame, fixed to `link` (a tool tip, say).

        `placement` is the pose of the frame in the link: a `Pose`, or a matrix T_link_frame (4, 4).
        """
        raise NotImplementedError

    @door("dynx.model.named_configurations:with_configuration")
    def with_configuration(self, name: str, q: ArrayLike) -> Model:
        """Return the same robot with one more named configuration `q` (nq,), which `configurations` returns.

        `to_mjcf` writes it as a keyframe. Raises ArgumentError for a name that is taken.
        """
        raise NotImplementedError

    @door("dynx.model.srdf:with_group_states")
    def with_group_states(self, srdf: StrPath | bytes) -> Model:
        """Return the same robot with the group states of an SRDF file or text as named configurations."""
        raise NotImplementedError

    @door("dynx.viewer.viewer:view")
    def view(self, **options: Any) -> Any:
        """Show the robot in the browser; return the `dynx.viewer.Viewer`, which takes the options.

        Raises NotInstalledError without the extra ``viewer``.
        """
        raise NotImplementedError

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Model) and self._content == other._content

    def __hash__(self) -> int:
        return self._hash

    def __repr__(self) -> str:
        return f"<Model {self.name}: {self.base} base, nq {self.nq}, nv {self.nv}, {len(self.links)} links>"

    @door("dynx.model.model_page:model_page")
    def _repr_html_(self) -> str:
        raise NotImplementedError

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


def refuse_other_than_model(model: object) -> None:
    """Raise ArgumentError for anything but a `Model`, such as a robot's name."""
    if not isinstance(model, Model):
        example = shown(model) if isinstance(model, str) else "..."
        raise ArgumentError(
            f"model is of type {type(model).__name__}; wanted a Model, such as dynx.load({example})"
        )


def missing_inertial_notes(links: Iterable[Link], joints: Iterable[Joint]) -> list[Note]:
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
