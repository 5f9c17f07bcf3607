"""Drawn parameters of a robot or a scene, and what they change.

`VariedRobot`: masses, payload and friction of the joints of a task of one robot, and the delay of actions.
`VariedScene`: masses, payload, friction of joints and of contacts in a world.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dynx.compiled.parametric import ScaledLinks
from dynx.control.array_dynamics import ArrayDynamics
from dynx.envs.randomization import Parameter, Randomization, parameters_of, require_name
from dynx.envs.task import RobotTask
from dynx.errors import UnknownNameError, UnsupportedFeatureError, nearest, shown
from dynx.model import Inertial, Model, Pose
from dynx.model.elements import Joint
from dynx.sim.plants.model_error import Payload, plant_model
from dynx.spatial.scalar import Array, Floats
from dynx.steppers.material import Material
from dynx.world.scene import Scene, SceneBody, SceneRobot

MASS_FIELDS = ("mass_scale", "payload")
ROBOT_FIELDS = (*MASS_FIELDS, "joint_damping", "joint_friction", "delay")

SLIP_SPEED = 0.01
"""Least speed [rad/s or m/s] from which dry friction has its full torque."""

STEPS_TO_STOP = 2.0
"""Least number of steps in which dry friction stops a joint that moves alone: with fewer the joint would
change its direction from step to step."""

JOINT_FIELDS = ("joint_damping", "joint_friction")
SCENE_FIELDS = ("mass_scale", "payload", *JOINT_FIELDS, "friction_scale")


class VariedRobot:
    """The parameters of one task that episodes draw, and what they change; on floats or on symbols.

    `values` (k,) has the values of `parameters`, in order. Dry friction is proportional to the velocity below
    a small speed, so a loaded joint creeps where a real one sticks.
    """

    def __init__(self, task: RobotTask, randomization: Randomization) -> None:
        """Raises UnknownNameError for a link, frame or joint that the robot does not have,
        UnsupportedFeatureError for a parameter of contacts."""
        if randomization.friction_scale is not None:
            raise UnsupportedFeatureError(
                f"{type(task).__name__} has no contacts, so friction_scale changes nothing; the friction of "
                "its joints is joint_friction"
            )
        self._task, model = task, task.model
        self._model = model
        self._payload = randomization.payload_frame
        if self._payload is not None:
            model.frame_index(self._payload)
        self.parameters: tuple[Parameter, ...] = parameters_of(
            randomization, ROBOT_FIELDS, self._required, task.step_dt
        )
        """Parameters that change the motion."""
        scales = self._columns("mass_scale")
        massive = [
            link.name for link in model.links if link.inertial is not None and link.inertial.mass > 0.0
        ]
        self._links: dict[str, int] = (
            dict.fromkeys(massive, scales[None]) if None in scales else {str(k): c for k, c in scales.items()}
        )
        self._array_code = ScaledLinks(model, tuple(self._links), self._payload)
        bounds = {each.field: each.distribution.bounds for each in self.parameters}
        self.delayed_actions = math.ceil(
            np.round(bounds.get("delay", (0.0, 0.0))[1] / task.step_dt) / task.substeps
        )
        """Number of actions before the present one that may still act."""
        self._stopping = (
            STEPS_TO_STOP * task.step_dt * _mobilities(model) if "joint_friction" in bounds else 0.0
        )

    @property
    def changes_masses(self) -> bool:
        """True if masses or a payload are drawn."""
        return any(each.field in MASS_FIELDS for each in self.parameters)

    def model(self, values: Array) -> Model:
        """Return the robot with the drawn masses and payload."""
        scale = {link: float(values[column]) for link, column in self._links.items()}
        payload = None
        if self._payload is not None:
            mass, *center = self._payload_values(values)
            payload = Payload(self._payload, float(mass), tuple(map(float, center)))
        return plant_model(self._model, payload, scale)

    def forward_dynamics(self, values: Array, q: Array, v: Array, tau: Array) -> Array:
        """Return the acceleration (nv,) of the robot with the drawn masses and payload, on plain symbols."""
        factors = [values[column] for column in self._links.values()]
        return self._array_code.forward_dynamics(factors, self._payload_values(values), q, v, tau)

    def parametric_values(self, values: Array, defaults: Array) -> Array:
        """Return the parameters of `dynx.compiled.parametric` for `link_names` and `payload_frame`."""
        scaled = np.array(defaults)
        for number, column in enumerate(self._links.values()):
            scaled[10 * number : 10 * (number + 1)] *= values[column]
        if self._payload is not None:
            scaled[-4:] = self._payload_values(values)
        return scaled

    @property
    def link_names(self) -> tuple[str, ...]:
        """Links whose masses are drawn."""
        return tuple(self._links)

    @property
    def payload_frame(self) -> str | None:
        """Frame that carries the payload."""
        return self._payload

    def joint_torque(self, values: Array, v: Array) -> Any:
        """Return the torque (nv,) of damping and dry friction of the joints, to be added to the task's."""
        damping, friction = (
            self._of_joints("joint_damping", values),
            self._of_joints("joint_friction", values),
        )
        if friction is None:
            return 0.0 if damping is None else -damping * v
        speed = np.maximum(SLIP_SPEED, self._stopping * friction)
        torque = -friction * np.clip(v / speed, -1.0, 1.0)
        return torque if damping is None else torque - damping * v

    def acting_actions(self, values: Array, action: Array, earlier: Sequence[Array]) -> list[Array]:
        """Return the action that acts in each step of the integrator, from the present one and from those
        before (`delayed_actions`, ...), the latest first."""
        task, column = self._task, self._columns("delay").get(None)
        acting = []
        for step in range(task.substeps):
            chosen = action
            for age in range(len(earlier) if column is not None else 0):
                passed = (step + age * task.substeps + 0.5) * task.step_dt
                chosen = np.where(values[column] > passed, earlier[age], chosen)
            acting.append(chosen)
        return acting

    def _required(self, field: str, part: str) -> str:
        if field == "mass_scale":
            self._model.link(part)
        elif field in ("joint_damping", "joint_friction"):
            require_name("joint that moves", part, self._model.joint_names)
        return part

    def _columns(self, field: str) -> dict[str | None, int]:
        return {each.part: k for k, each in enumerate(self.parameters) if each.field == field}

    def _payload_values(self, values: Array) -> list[Any]:
        return [values[column] for column in self._columns("payload").values()]

    def _of_joints(self, field: str, values: Array) -> Any:
        """Return a parameter of the joints (nv,), or None if it is not drawn."""
        columns, names = self._columns(field), self._model.joint_names
        if not columns:
            return None
        base = [0.0] * (6 if self._model.floating else 0)
        shared = columns.get(None)
        found = [columns.get(name, shared) for name in names]
        return np.stack([*base, *(0.0 * values[0] if column is None else values[column] for column in found)])


def _mobilities(model: Model) -> Array:
    """Return the acceleration of each coordinate (nv,) by a unit torque, in the neutral configuration."""
    M = np.asarray(ArrayDynamics(model).mass_matrix(model.neutral()), dtype=np.float64)
    return np.array(np.diag(np.linalg.pinv(M)))


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
