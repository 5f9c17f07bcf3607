"""Drawn parameters of a scene: masses, payload, friction of joints and of contacts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dynx.envs.randomization import Parameter, Randomization, parameters_of, require_name
from dynx.errors import UnknownNameError, nearest, shown
from dynx.model import Inertial, Model, Pose
from dynx.model.elements import Joint
from dynx.sim.plants.model_error import plant_model
from dynx.spatial.scalar import Floats
from dynx.world import Material, Scene, SceneBody, SceneRobot

JOINT_FIELDS = ("joint_damping", "joint_friction")
SCENE_FIELDS = ("mass_scale", "payload", *JOINT_FIELDS, "friction_scale")


class VariedScene:
    """The parameters of a scene that episodes draw, and the scene with their values.

    Parts are named as in the scene, ``robot/link`` or a body; in a scene with one robot the link alone will
    do, and likewise joints and frames.
    """

    def __init__(self, scene: Scene, randomization: Randomization, control_dt: float) -> None:
        """Raises UnknownNameError for a part that the scene does not have."""
        self._scene = scene
        self._robots = {robot.name: robot.model for robot in scene.robots}
        frame = randomization.payload_frame
        self._payload = None if frame is None else self._full_name("frame", frame)
        self.parameters: tuple[Parameter, ...] = parameters_of(
            randomization, (*SCENE_FIELDS, "delay"), self._required, control_dt
        )
        """Parameters that change the motion; a delay is rounded to whole control steps."""
        self.changes_scene = any(each.field in SCENE_FIELDS for each in self.parameters)
        """True if episodes differ in more than noise and delay."""
        self.joint_friction = any(each.field == "joint_friction" for each in self.parameters)
        """True if the joints have dry friction."""

    def delayed_actions(self, values: Floats, control_dt: float) -> int:
        """Return the number of control steps by which actions act later."""
        delays = [x for each, x in zip(self.parameters, values, strict=True) if each.field == "delay"]
        return round(float(delays[0]) / control_dt) if delays else 0

    def scene(self, scene: Scene, values: Floats) -> Scene:
        """Return a scene of the task with drawn values (k,) of the parameters."""
        drawn = {(each.field, each.part): float(x) for each, x in zip(self.parameters, values, strict=True)}

        def value(field: str, part: str) -> float | None:
            return drawn.get((field, part), drawn.get((field, None)))

        def painted(material: Material, part: str) -> Material:
            factor = value("friction_scale", part)
            return material if factor is None else replace(material, friction=factor * material.friction)

        def of_robot(robot: SceneRobot) -> SceneRobot:
            links = [link.name for link in robot.model.links]
            scales = {name: value("mass_scale", f"{robot.name}/{name}") or 1.0 for name in links}
            model = plant_model(robot.model, None, scales)
            if self._payload is not None and self._payload.startswith(f"{robot.name}/"):
                numbers = [drawn["payload", name] for name in ("mass", "x", "y", "z")]
                model = with_point_mass(model, self._payload.partition("/")[2], numbers[0], numbers[1:])
            joints = [
                _with_friction(joint, *(value(field, f"{robot.name}/{joint.name}") for field in JOINT_FIELDS))
                for joint in robot.model.joints
            ]
            model = replace(model, joints=tuple(joints))
            materials = {name: painted(robot.material_of(name), f"{robot.name}/{name}") for name in links}
            return replace(robot, model=model, materials=tuple(materials.items()))

        def of_body(body: SceneBody) -> SceneBody:
            material, factor = painted(body.material, body.name), value("mass_scale", body.name)
            if body.mass is None or factor is None:
                return replace(body, material=material)
            inertia = None if body.inertia is None else (factor * np.array(body.inertia)).tolist()
            return replace(body, material=material, mass=factor * body.mass, inertia=inertia)

        return replace(
            scene,
            robots=tuple(map(of_robot, scene.robots)),
            bodies=tuple(map(of_body, scene.bodies)),
        )

    def _required(self, field: str, part: str) -> str:
        if field == "payload":
            return part
        if field in JOINT_FIELDS:
            return self._full_name("joint that moves", part)
        bodies = [body.name for body in self._scene.bodies if field != "mass_scale" or not body.fixed]
        return part if part in bodies else self._full_name("link", part, bodies)

    def _full_name(self, kind: str, name: str, bodies: Sequence[str] = ()) -> str:
        """Return ``robot/part`` for a name with or without its robot."""
        owner, separator, part = name.partition("/")
        if not separator and len(self._robots) == 1:
            ((owner, model),) = self._robots.items()
            return f"{owner}/{require_name(kind, name, [*_parts(kind, model), *bodies])}"
        known = [f"{each}/{part}" for each, model in self._robots.items() for part in _parts(kind, model)]
        if not part or name not in known:
            raise UnknownNameError(f"no {kind} {shown(name)}{nearest(name, [*known, *bodies])}")
        return name


def _parts(kind: str, model: Model) -> Sequence[str]:
    if kind == "frame":
        return model.frame_names
    return model.joint_names if kind == "joint that moves" else [link.name for link in model.links]


def _with_friction(joint: Joint, damping: float | None, friction: float | None) -> Joint:
    if not joint.moves or (damping is None and friction is None):
        return joint
    own = joint.dynamics
    dynamics = replace(
        own,
        damping=own.damping if damping is None else damping,
        friction=own.friction if friction is None else friction,
    )
    return replace(joint, dynamics=dynamics)


def with_point_mass(model: Model, frame: str, mass: float, center: Sequence[float]) -> Model:
    """Return the robot with a point mass [kg] at a place (3,) [m] of a frame, in the inertia of its link.

    The total has the centre of mass and the tensor of both (Steiner's theorem).
    """
    if mass == 0.0:
        return model
    place = model.frames[model.frame_index(frame)]
    T_link_frame = place.placement.matrix
    point = T_link_frame[:3, :3] @ np.asarray(center, dtype=np.float64) + T_link_frame[:3, 3]
    own = model.inertial(place.link)
    T_link_center = own.origin.matrix
    R, own_center = T_link_center[:3, :3], T_link_center[:3, 3]
    total = own.mass + mass
    common = (own.mass * own_center + mass * point) / total
    tensor = R @ own.tensor @ R.T + own.mass * _steiner(own_center - common) + mass * _steiner(point - common)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = tensor.tolist()
    x, y, z = common.tolist()
    inertial = Inertial(total, Pose((x, y, z)), xx, xy, xz, yy, yz, zz)
    links = [replace(each, inertial=inertial) if each.name == place.link else each for each in model.links]
    return replace(model, links=tuple(links))


def _steiner(offset: Floats) -> Floats:
    """Return the tensor (3, 3) of a unit point mass at an offset (3,)."""
    return np.asarray(offset @ offset * np.eye(3) - np.outer(offset, offset))
