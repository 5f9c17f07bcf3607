"""Drawn parameters of a robot or a scene, and what they change.

`VariedRobot`: masses, payload and joint dynamics of a task of one robot, and the delay of actions.
`VariedGround`: those of a robot on the ground in a kernel, and `WaitingActions`.
`VariedScene`: masses, payload, friction of joints and of contacts in a world.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from dynx.envs.randomization import AXES, Parameter, Randomization, parameters_of, require_name
from dynx.envs.task import DESCRIBED, JointOptions, RobotTask
from dynx.errors import UnknownNameError, UnsupportedFeatureError, nearest, shown
from dynx.model import Model
from dynx.model.ball_joints import refuse_ball_joints
from dynx.model.elements import JointCoefficients
from dynx.model.mechanism import Mechanism
from dynx.rbd.parameters import JOINT, POINT, SPRING, Parameters
from dynx.spatial.scalar import Array, Floats, sqrt
from dynx.steppers.layout import stop_positions

if TYPE_CHECKING:
    from dynx.rbd.contact_step import FramedShape, ServoJoints
    from dynx.steppers.material import Material
    from dynx.world import Scene, SceneBody, SceneRobot
    from dynx.world.motors import Motor

ROBOT_FIELDS = ("mass_scale", "payload", "joint_damping", "joint_friction", "delay")
JOINT_FIELDS = ("joint_damping", "joint_friction")
MOTOR_FIELDS = ("gain_scale", "motor_strength")
SCENE_FIELDS = ("mass_scale", "payload", *JOINT_FIELDS, "friction_scale", "gravity_scale")


class VariedRobot:
    """The parameters of one task that episodes draw, and what they change; on floats or on symbols.

    Joint dynamics that episodes do not draw are those of the description. `drawn` (k,) has the values of
    `drawn_parameters`, in order.
    """

    fields: ClassVar[tuple[str, ...]] = ROBOT_FIELDS

    def __init__(
        self, task: RobotTask, randomization: Randomization | None, joints: JointOptions = DESCRIBED
    ) -> None:
        """`randomization` is None where nothing is drawn.

        Raises UnknownNameError for a link, frame or joint that the robot does not have,
        UnsupportedFeatureError for a parameter of contacts.
        """
        if randomization is not None:
            self._refuse_other_fields(task, randomization)
        self._task, model = task, task.model
        refuse_ball_joints(model, "an environment of one robot")
        self.stops = joints.joint_limits and bool(np.isfinite(stop_positions(model)).any())
        """True if joints stop at limits."""
        self._model = model
        self.drawn_parameters: tuple[Parameter, ...] = (
            ()
            if randomization is None
            else parameters_of(randomization, self.fields, self._required, self._delay_step)
        )
        """Parameters that change the motion."""
        scales = self._columns("mass_scale")
        massive = [
            link.name for link in model.links if link.inertial is not None and link.inertial.mass > 0.0
        ]
        links: dict[str, int] = (
            dict.fromkeys(massive, scales[None]) if None in scales else {str(k): c for k, c in scales.items()}
        )
        bounds = {each.field: each.distribution.bounds for each in self.drawn_parameters}
        described = any(
            joints.has(name) and getattr(joint.dynamics, name) != 0.0
            for joint in model.joints
            for name in JOINT + SPRING
            if joint.moves
        )
        self.parameters = Parameters(
            model,
            scaled=tuple(links),
            point_payload=None if randomization is None else randomization.payload_frame,
            joint_dynamics=described or "joint_damping" in bounds or "joint_friction" in bounds,
        )
        """The parameters of the robot, of which some are drawn."""
        self._sources = [
            *links.values(),
            *self._columns("payload").values(),
            *(self._sources_of_joints(joints) if self.parameters.joint_dynamics else ()),
        ]
        """For each parameter the column of the drawn values, or the value of one that is not drawn."""
        self.delayed_actions = math.ceil(
            np.round(bounds.get("delay", (0.0, 0.0))[1] / self._delay_step)
            / round(task.control_dt / self._delay_step)
        )
        """Number of actions before the present one that may still act."""

    @property
    def _delay_step(self) -> float:
        """Time [s] to multiples of which delays are rounded."""
        return self._task.step_dt

    def _refuse_other_fields(self, task: RobotTask, randomization: Randomization) -> None:
        """Raise UnsupportedFeatureError for a parameter that the task does not have."""
        if randomization.friction_scale is not None:
            raise UnsupportedFeatureError(
                f"{type(task).__name__} has no contacts, so friction_scale changes nothing; the friction of "
                "its joints is joint_friction"
            )
        for field in (*MOTOR_FIELDS, "gravity_scale", "pushes"):
            if getattr(randomization, field) is not None:
                raise UnsupportedFeatureError(
                    f"{type(task).__name__} computes its torques itself: tasks in worlds have {field}"
                )

    def _sources_of_joints(self, joints: JointOptions) -> list[int | float]:
        """Return the source of each coefficient of the joints, in the order of the parameters."""
        of_joint, names = self.parameters.of_joint, self._model.joint_names
        columns = {name: self._columns(f"joint_{name}") for name in of_joint}
        found: list[int | float] = []
        for joint in self._model.joints:
            for name in of_joint if joint.moves else ():
                # One value for all joints is that of the joints with a coordinate, not of those that mimic.
                whole = columns[name].get(None) if joint.name in names else None
                column = columns[name].get(joint.name, whole)
                own = float(getattr(joint.dynamics, name)) if joints.has(name) else 0.0
                found.append(own if column is None else column)
        return found

    @property
    def nominal_joints(self) -> JointCoefficients | None:
        """Coefficients (nv,) of the coordinates with what is drawn left out; None if all are 0."""
        joints = self.parameters.joints(self.values(np.zeros(len(self.drawn_parameters))))
        return joints if joints is not None and joints.present else None

    @property
    def dry_joints(self) -> Floats:
        """1 for coordinates (nv,) with dry friction that is drawn or of the description, otherwise 0."""
        ones = np.ones(len(self.drawn_parameters))
        joints = self.parameters.joints(np.asarray(self.values(ones)))
        return np.zeros(self._model.nv) if joints is None else np.sign(joints.friction)

    def values(self, drawn: Array) -> Array:
        """Return the values (n,) of `parameters`."""
        return np.array([drawn[each] if isinstance(each, int) else each for each in self._sources])

    def acting_actions(self, drawn: Array, action: Array, earlier: Sequence[Array]) -> list[Array]:
        """Return the action that acts in each step of the integrator, from the present one and from those
        before (`delayed_actions`, ...), the latest first."""
        task, column = self._task, self._columns("delay").get(None)
        acting = []
        for step in range(task.substeps):
            chosen = action
            for age in range(len(earlier) if column is not None else 0):
                passed = (step + age * task.substeps + 0.5) * task.step_dt
                chosen = np.where(drawn[column] > passed, earlier[age], chosen)
            acting.append(chosen)
        return acting

    def _required(self, field: str, part: str) -> str:
        if field == "mass_scale":
            self._model.link(part)
        elif field in ("joint_damping", "joint_friction"):
            require_name("joint that moves", part, self._model.joint_names)
        return part

    def _columns(self, field: str) -> dict[str | None, int]:
        return {each.part: k for k, each in enumerate(self.drawn_parameters) if each.field == field}


class VariedGround(VariedRobot):
    """The parameters of a robot with motors on the ground that episodes draw, in a kernel."""

    fields = (*SCENE_FIELDS, *MOTOR_FIELDS, "delay")

    def __init__(
        self,
        task: RobotTask,
        randomization: Randomization | None,
        joints: JointOptions = DESCRIBED,
        touching: Sequence[FramedShape] = (),
    ) -> None:
        """`touching` are the shapes of the robot that may touch the ground."""
        self._touching = touching
        self.pushed = randomization is not None and randomization.pushes is not None
        """True if episodes have pushes."""
        super().__init__(task, randomization, joints)
        self.stops = False

    def _refuse_other_fields(self, task: RobotTask, randomization: Randomization) -> None:
        """A kernel has all parameters that worlds have."""

    @property
    def _delay_step(self) -> float:
        """Time [s] to multiples of which delays are rounded, as in worlds."""
        return self._task.control_dt

    def delays(self, values: Floats) -> NDArray[np.int64]:
        """Return the delays (n,) in control steps, of drawn values (n, k)."""
        column = self._columns("delay")[None]
        return np.rint(values[:, column] / self._task.control_dt).astype(np.int64)

    def draws(self, *fields: str) -> bool:
        """Check whether one of some parameters is drawn."""
        return any(self._columns(field) for field in fields)

    def joints(self, joints: ServoJoints, drawn: Array) -> ServoJoints:
        """Return motors and joint dynamics with drawn values (k,)."""
        gain, strength = (self._factor(field, drawn) for field in MOTOR_FIELDS)
        if self.draws(*JOINT_FIELDS):
            found = self.parameters.joints(self.values(drawn))
            assert found is not None
            base = len(found.damping) - len(joints.damping)
            joints = replace(joints, damping=found.damping[base:], friction=found.friction[base:])
        return replace(
            joints,
            kp=joints.kp * (gain * strength),
            kd=joints.kd * (gain * strength),
            max_torque=None if joints.max_torque is None else joints.max_torque * strength,
        )

    def friction(self, shape: FramedShape, drawn: Array) -> Any:
        """Return the coefficient of friction of a shape with the ground, with drawn values (k,)."""
        columns, friction = self._columns("friction_scale"), shape.friction
        if not columns:
            return friction
        if None in columns:
            return friction * drawn[columns[None]]
        factors = [drawn[columns[each]] for each in shape.parts if each in columns]
        return friction * sqrt(math.prod(factors[1:], start=factors[0])) if factors else friction

    def mechanism(self, mechanism: Mechanism, drawn: Array, *, masses: bool) -> Mechanism:
        """Return the mechanism with drawn values (k,); with `masses` it is the remainder of `parameters`."""
        if masses:
            mechanism = self.parameters.mechanism(mechanism, self.values(drawn))
        if self.draws("gravity_scale"):
            mechanism = replace(mechanism, gravity=mechanism.gravity * self._factor("gravity_scale", drawn))
        return mechanism

    def pushed_mechanism(self, mechanism: Mechanism, push: Array) -> Mechanism:
        """Return the mechanism while its links are pushed with an acceleration (2,) along x and y: pushes are
        proportional to masses, as gravity is."""
        return replace(mechanism, gravity=mechanism.gravity + np.array([*push, 0.0]))

    def _factor(self, field: str, drawn: Array) -> Any:
        column = self._columns(field).get(None)
        return 1.0 if column is None else drawn[column]

    def _required(self, field: str, part: str) -> str:
        own = part.rpartition("/")[2]
        if field != "friction_scale":
            return super()._required(field, own)
        known = sorted({name for shape in self._touching for name in shape.parts})
        return require_name("part that touches", own, known)


class WaitingActions:
    """Actions of `count` environments that act after delays of whole control steps.

    The first action of an episode acts from its start, because there is none before it.
    """

    def __init__(self, count: int, size: int, longest: int) -> None:
        """`longest` is the number of control steps of the longest delay."""
        self._actions = np.zeros((longest + 1, count, size))
        self._place, self._rows = 0, np.arange(count)

    def acting(self, actions: Floats, steps: NDArray[np.int64], delays: NDArray[np.int64]) -> Floats:
        """Return the actions (count, size) that act in a step with `actions` (count, size), from the numbers
        of the `steps` (count,) in their episodes and the `delays` (count,)."""
        self._actions[self._place] = actions
        age = np.minimum(delays, np.maximum(steps, 0))
        found: Floats = self._actions[(self._place - age) % len(self._actions), self._rows]
        return found

    def accept(self) -> None:
        """Note that the step was taken. Until then it may be replaced by another one."""
        self._place = (self._place + 1) % len(self._actions)


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
            randomization, (*SCENE_FIELDS, *MOTOR_FIELDS, "delay"), self._required, control_dt
        )
        """Parameters that change the motion; a delay is rounded to whole control steps."""
        self.changes_scene = any(each.field in SCENE_FIELDS for each in self.parameters)
        """True if episodes differ in more than noise and delay."""

    def delayed_actions(self, values: Floats, control_dt: float) -> int:
        """Return the number of control steps by which actions act later."""
        delays = [x for each, x in zip(self.parameters, values, strict=True) if each.field == "delay"]
        return round(float(delays[0]) / control_dt) if delays else 0

    def loads(self, loads: Mapping[str, Any], values: Floats) -> Mapping[str, Any]:
        """Return arguments of `World.step` whose motors have drawn values (k,) of the parameters."""
        drawn = {each.field: float(x) for each, x in zip(self.parameters, values, strict=True)}
        gain, strength = (drawn.get(field, 1.0) for field in MOTOR_FIELDS)
        if "motors" not in loads or (gain, strength) == (1.0, 1.0):
            return loads
        motors = {
            name: [
                _scaled(each, gain, strength) for each in (given if isinstance(given, Sequence) else [given])
            ]
            for name, given in loads["motors"].items()
        }
        return {**loads, "motors": motors}

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
            known = {
                f"{link}.scale": value("mass_scale", f"{robot.name}/{link}")
                for link in links
                if robot.model.inertial(link).mass > 0.0
            }
            for joint in robot.model.joints:
                for field in JOINT_FIELDS if joint.moves else ():
                    coefficient = field.removeprefix("joint_")
                    known[f"{joint.name}.{coefficient}"] = value(field, f"{robot.name}/{joint.name}")
            owner, _, frame = (self._payload or "").partition("/")
            if owner == robot.name:
                known |= {
                    f"{frame}.point.{name}": drawn["payload", part]
                    for name, part in zip(POINT, ("mass", *AXES), strict=True)
                }
            given = {name: x for name, x in known.items() if x is not None}
            parameters = Parameters(
                robot.model,
                scaled=tuple(link for link in links if f"{link}.scale" in given),
                point_payload=frame if owner == robot.name else None,
                joint_dynamics=any(field in JOINT_FIELDS for field, _ in drawn),
            )
            numbers = [
                given.get(name, x) for name, x in zip(parameters.names, parameters.defaults, strict=True)
            ]
            model = parameters.model_of(np.array(numbers))
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
            gravity=tuple(drawn.get(("gravity_scale", None), 1.0) * np.array(scene.gravity)),
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


def _scaled(motor: Motor, gain: float, strength: float) -> Motor:
    """Return a motor with gains times `gain`, whose torques and largest torque are then multiplied by
    `strength`."""
    factors = {"kp": gain * strength, "kd": gain * strength, "torque": strength, "max_force": strength}
    given = {name: getattr(motor, name, None) for name in factors}
    changed: dict[str, Any] = {
        name: (factors[name] * np.asarray(value, dtype=np.float64)).tolist()
        for name, value in given.items()
        if value is not None
    }
    return replace(motor, **changed)


def _parts(kind: str, model: Model) -> Sequence[str]:
    if kind == "frame":
        return model.frame_names
    return model.joint_names if kind == "joint that moves" else [link.name for link in model.links]
