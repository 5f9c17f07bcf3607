"""Robots of a scene: a model, its state at the start, and its materials."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types, is_listed
from dynx.errors import ArgumentError, ShapeError, shown
from dynx.model import Model, Pose
from dynx.model.configuration import checked_q, neutral
from dynx.model.elements import checked_pose
from dynx.model.model import refuse_other_than_model
from dynx.model.numbers import checked_array
from dynx.model.xml.values import name_fault
from dynx.rbd.kinematics import body_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import quat_from_rotation
from dynx.steppers.material import DEFAULT_MATERIAL, Material, checked_material
from dynx.world.motors import Motor, combine

WORLD = "world"
"""Name of the fixed world in constraints."""


def checked_pairs(what: str, given: object, second: type, wanted: str) -> tuple[tuple[str, Any], ...]:
    """Return the entries of a mapping, or of a sequence of pairs, from a name to a `second`.

    Raises ArgumentError for anything else; `wanted` describes a pair.
    """
    pairs = given.items() if isinstance(given, Mapping) else given
    if not is_listed(pairs) or not isinstance(pairs, Collection) or isinstance(pairs, np.ndarray):
        raise ArgumentError(f"{what} is {shown(given)}; wanted a sequence of pairs of {wanted}")
    found = []
    for k, pair in enumerate(pairs):
        if not (isinstance(pair, tuple | list) and len(pair) == 2):
            raise ArgumentError(f"{what}[{k}] is {shown(pair)}; wanted {wanted}")
        if not (isinstance(pair[0], str) and isinstance(pair[1], second)):
            raise ArgumentError(f"{what}[{k}] is {shown(tuple(pair))}; wanted {wanted}")
        found.append((pair[0], pair[1]))
    return tuple(found)


def checked_name(what: str, name: object) -> str:
    """Return the name of a robot, body or group; raise ArgumentError for an invalid one."""
    if not isinstance(name, str):
        raise ArgumentError(f"the name of a {what} is {shown(name)}; wanted a str")
    fault = name_fault(name)
    if fault is not None:
        raise ArgumentError(f"the name of a {what} {fault}; wanted a text of visible characters")
    if "/" in name or name == WORLD:
        raise ArgumentError(
            f"the name of a {what} is {shown(name)}; wanted one other than {WORLD!r} and without '/', which "
            "joins the names of a robot and its link"
        )
    return name


def split_name(name: str) -> tuple[str, str | None]:
    """Return the robot or body of a name, and the link where it is ``robot/link``."""
    owner, slash, link = name.partition("/")
    return owner, link if slash else None


class LinkFrames:
    """The frames of a model, its links and added frames: the body of the mechanism that each is fixed to, and
    its pose there. KeyError for another name."""

    def __init__(self, model: Model) -> None:
        self._mechanism = model.mechanism
        frames = model.mechanism.frames
        self._at = {frame.name: (frame.body, homogeneous(frame.R, frame.p)) for frame in frames}

    def __getitem__(self, link: str) -> tuple[int, Floats]:
        body, T = self._at[link]
        return body, np.asarray(T, dtype=np.float64)

    def pose(self, q: Floats, link: str) -> Floats:
        """Return T_world_link (4, 4) at the configuration `q` (nq,) of the model."""
        poses = body_poses(self._mechanism, self._mechanism.tree_q(q))
        body, T = self[link]
        return np.asarray(homogeneous(*poses[body]) @ T)


@dataclass(frozen=True)
class SceneRobot:
    """A robot: its `model`, and its configuration `q` (nq,) and velocity `v` (nv,) at the start.

    None means the neutral configuration for `q` and zero for `v`; after construction both are tuples. A fixed
    base is at `model.base_pose`, a floating one where `q` places it; the method `at` changes either.
    `materials` are the materials of single links, by name; all other links have `material`. Links of one
    robot collide with one another only with `self_collision`, and never where a joint connects them. `motors`
    act in each step of a world, unless the step is given other motors for this robot.

    Raises ArgumentError for a name, model, material, motor or flag of a wrong kind and for two motors on one
    joint; ShapeError, DTypeError or NotFiniteError for `q` and `v`, ArgumentError for a quaternion not of
    unit norm; UnknownNameError for a link in `materials`.
    """

    name: str
    model: Model
    q: tuple[float, ...] | None = None
    v: tuple[float, ...] | None = None
    material: Material = DEFAULT_MATERIAL
    materials: tuple[tuple[str, Material], ...] = ()
    self_collision: bool = False
    motors: tuple[Motor, ...] = ()

    if TYPE_CHECKING:
        # Type checkers see what is accepted; the fields hold what is made of it.
        def __init__(
            self,
            name: str,
            model: Model,
            q: ArrayLike | None = None,
            v: ArrayLike | None = None,
            material: Material = DEFAULT_MATERIAL,
            materials: Mapping[str, Material] | Iterable[tuple[str, Material]] = (),
            self_collision: bool = False,
            motors: Motor | Iterable[Motor] = (),
        ) -> None: ...

    def __post_init__(self) -> None:
        checked_name("robot", self.name)
        refuse_other_than_model(self.model)
        what = f"robot {shown(self.name)}"
        q = checked_q(self.model, neutral(self.model) if self.q is None else self.q, f"q of {what}")
        zero: ArrayLike = [0.0] * self.model.nv
        v = checked_array(f"v of {what}", zero if self.v is None else self.v, self.model.nv)
        if q.ndim != 1 or v.ndim != 1:
            raise ShapeError(f"q and v of {what} have shapes {q.shape} and {v.shape}; wanted one state")
        checked_material(f"material of {what}", self.material)
        if not isinstance(self.self_collision, bool):
            raise ArgumentError(f"self_collision of {what} is {shown(self.self_collision)}; wanted a bool")
        motors = (self.motors,) if isinstance(self.motors, Motor) else self.motors
        if not is_listed(motors):
            raise ArgumentError(f"motors of {what} is {shown(motors)}; wanted motors")
        motors = tuple(motors)
        for motor in motors:
            if not isinstance(motor, Motor):
                raise ArgumentError(f"motors of {what} holds {shown(motor)}; wanted a Motor")
        combine(self.model, motors)
        object.__setattr__(self, "motors", motors)
        materials = dict(
            checked_pairs(f"materials of {what}", self.materials, Material, "a link and a Material")
        )
        for link, material in materials.items():
            self.model.link(link)
            checked_material(f"material of {shown(link)} of {what}", material)
        object.__setattr__(self, "q", tuple(q.tolist()))
        object.__setattr__(self, "v", tuple(v.tolist()))
        object.__setattr__(self, "materials", tuple(sorted(materials.items())))

    def at(self, pose: Pose | ArrayLike) -> SceneRobot:
        """Return this robot with its base, fixed or floating, at a pose in the world."""
        placed = checked_pose(f"pose of robot {shown(self.name)}", pose)
        if not self.model.floating:
            return replace(self, model=self.model.with_base_pose(placed))
        quat = quat_from_rotation(placed.matrix[:3, :3]).tolist()
        return replace(self, q=(*placed.xyz, *quat, *np.array(self.q)[7:].tolist()))

    @checks_types
    def material_of(self, link: str) -> Material:
        """Return the material of a link; UnknownNameError for an unknown one."""
        self.model.link(link)
        return dict(self.materials).get(link, self.material)
