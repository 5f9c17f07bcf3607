"""Keys and types of a scene's document, from which its JSON Schema is generated.

Lengths are in m, angles in rad, masses in kg. A pose is x, y, z, alone or followed by roll, pitch, yaw or by
the quaternion qx, qy, qz, qw. Keys with a default may be left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Vector = list[float]
Numbers = float | list[float]


@dataclass
class MaterialDocument:
    """A material; see `dynx.world.Material`."""

    friction: float = 0.5
    torsional_friction: float = 0.0
    rolling_friction: float = 0.0
    restitution: float = 0.0
    rgba: Vector = field(default_factory=lambda: [0.7, 0.7, 0.7, 1.0])


@dataclass
class ShapeDocument:
    """One shape; exactly one of the keys before `scale` is given.

    `box` has three edge lengths, `cylinder` and `capsule` radius and length, `mesh` a file beside the scene,
    scaled by `scale`, `heights` the rows of a height field of the extent `size` along x and y.
    """

    box: Vector | None = None
    sphere: float | None = None
    cylinder: Vector | None = None
    capsule: Vector | None = None
    plane: Literal[True] | None = None
    mesh: str | None = None
    heights: list[Vector] | None = None
    scale: Vector | None = None
    size: Vector | None = None
    pose: Vector | None = None


@dataclass
class MotorDocument:
    """A motor on the joints named, or on all; see `dynx.world.PositionMotor` and its siblings."""

    kind: Literal["position", "velocity", "pd", "torque"]
    target: Numbers | None = None
    velocity: Numbers | None = None
    torque: Numbers | None = None
    kp: Numbers | None = None
    kd: Numbers | None = None
    max_force: Numbers | None = None
    joints: list[str] | None = None


@dataclass
class RobotDocument:
    """A robot: `robot` is the name of one that dynx knows, a file beside the scene, or
    ``package://pybullet_data/FILE``; `urdf` is the text of its description,
    whose meshes are looked for in `mesh_folders`.

    `q` is a list (nq) or the positions of joints by name; `pose` is that of the base, fixed or floating.
    """

    name: str
    robot: str | None = None
    urdf: str | None = None
    mesh_folders: list[str] = field(default_factory=list)
    base: Literal["fixed", "floating"] = "fixed"
    pose: Vector | None = None
    lock: dict[str, float] = field(default_factory=dict)
    q: list[float] | dict[str, float] | None = None
    v: list[float] | dict[str, float] | None = None
    self_collision: bool = False
    material: MaterialDocument | None = None
    materials: dict[str, MaterialDocument] = field(default_factory=dict)
    motors: list[MotorDocument] = field(default_factory=list)


@dataclass
class BodyDocument:
    """A body of one shape or several; without `mass` it is fixed in the world."""

    name: str
    shape: ShapeDocument | None = None
    shapes: list[ShapeDocument] = field(default_factory=list)
    pose: Vector | None = None
    mass: float | None = None
    inertia: list[Vector] | None = None
    center_of_mass: Vector | None = None
    twist: Vector | None = None
    material: MaterialDocument | None = None


@dataclass
class ConstraintDocument:
    """A weld, with the pose of the frame of `b` in that of `a`, or a point-to-point constraint."""

    kind: Literal["weld", "point"]
    a: str
    b: str
    pose: Vector | None = None
    point_a: Vector | None = None
    point_b: Vector | None = None


@dataclass
class SceneDocument:
    """A scene; see `dynx.world.Scene`."""

    schema: Literal["dynx.scene/1"]
    name: str = "scene"
    gravity: Vector = field(default_factory=lambda: [0.0, 0.0, -9.81])
    robots: list[RobotDocument] = field(default_factory=list)
    bodies: list[BodyDocument] = field(default_factory=list)
    constraints: list[ConstraintDocument] = field(default_factory=list)
    ignored: list[list[str]] = field(default_factory=list)
    groups: dict[str, list[str]] = field(default_factory=dict)
