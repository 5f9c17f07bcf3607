"""Drawn parameters of a task of one robot: masses, payload, friction of the joints, delay of actions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from dynx.backends import Backend, backend
from dynx.compiled.parametric import ParametricDynamics, parametric
from dynx.compiled.scaled_links import ScaledLinks
from dynx.control.array_dynamics import ArrayDynamics
from dynx.control.dynamics import EngineDynamics
from dynx.envs.randomization import Parameter, Randomization, parameters_of, require_name
from dynx.envs.robot.array_task import ArrayTask
from dynx.envs.robot.step import ForwardDynamics
from dynx.errors import UnsupportedFeatureError
from dynx.model import Model
from dynx.sim.plants.model_error import Payload, plant_model
from dynx.spatial.scalar import Array, Floats

MASS_FIELDS = ("mass_scale", "payload")
ROBOT_FIELDS = (*MASS_FIELDS, "joint_damping", "joint_friction", "delay")

SLIP_SPEED = 0.01
"""Least speed [rad/s or m/s] from which dry friction has its full torque."""

STEPS_TO_STOP = 2.0
"""Least number of steps in which dry friction stops a joint that moves alone: with fewer the joint would
change its direction from step to step."""


class VariedRobot:
    """The parameters of one task that episodes draw, and what they change; on floats or on symbols.

    `values` (k,) has the values of `parameters`, in order. Dry friction is proportional to the velocity below
    a small speed, so a loaded joint creeps where a real one sticks.
    """

    def __init__(self, task: ArrayTask, randomization: Randomization) -> None:
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


COMPILED = "compiled"


class RobotVariation:
    """Forward dynamics of a robot with drawn parameters, and the actions that act after a delay.

    An engine loads the robot anew for each episode in which masses differ; the backend `compiled`, which
    would compile it anew, has a kernel with masses as inputs.
    """

    def __init__(self, robot: VariedRobot, nominal: Backend) -> None:
        self.robot = robot
        """The parameters and what they change."""
        self._nominal = nominal
        self._own: Backend | None = None
        self._parametric: ParametricDynamics | None = None
        if robot.changes_masses and nominal.name == COMPILED:
            self._parametric = parametric(
                nominal.model, links=robot.link_names, point_payload=robot.payload_frame
            )
        self._values: Floats = np.zeros(0)
        self._earlier: list[Array] = []

    def forward_dynamics(self, values: Floats) -> ForwardDynamics:
        """Return the acceleration of q, v, tau with these values (k,), which hold until the next call."""
        self._values = values
        rigid = self._rigid_dynamics(values)
        robot = self.robot
        return lambda q, v, tau: rigid(q, v, tau + robot.joint_torque(values, v))

    def _rigid_dynamics(self, values: Floats) -> Callable[..., Any]:
        if not self.robot.changes_masses:
            return EngineDynamics(self._nominal).forward_dynamics
        if self._parametric is not None:
            dynamics = self._parametric
            parameters = self.robot.parametric_values(values, dynamics.parameters.defaults)
            return lambda q, v, tau: dynamics.forward_dynamics(q, v, tau, parameters)
        self.close()
        self._own = backend(self._nominal.name, self.robot.model(values), validate=False)
        return EngineDynamics(self._own).forward_dynamics

    def acting_actions(self, action: Array, *, first: bool) -> list[Array]:
        """Return the action that acts in each step of the integrator; the `first` of an episode acts until
        a later one does."""
        if first:
            self._earlier = [action] * self.robot.delayed_actions
        acting = self.robot.acting_actions(self._values, action, self._earlier)
        self._earlier = [action, *self._earlier][: self.robot.delayed_actions]
        return acting

    def close(self) -> None:
        """Release the engine of the last episode."""
        if self._own is not None:
            self._own.close()
            self._own = None
