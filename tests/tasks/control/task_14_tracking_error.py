"""Tracking errors of two controllers with an unknown payload."""

from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin

from tests.tasks.motion import advance, arm_derivative
from tests.tasks.robots import ball, pinocchio_model, two_link_arm
from tests.tasks.task import Array, Task, numbers, read_answer, require_close

PAYLOAD = 1.0
PD_STIFFNESS, PD_DAMPING = (400.0, 200.0), (40.0, 20.0)
STIFFNESS, DAMPING = 100.0, 20.0
DURATION = 5.0
PERIOD = 1e-3


def known() -> str:
    """Return the arm that the controller knows."""
    return two_link_arm()


def real() -> str:
    """Return the arm with the payload."""
    return two_link_arm(tip=ball("tip", PAYLOAD, 1e-3, "1 0 0 1"))


def reference(time: float) -> tuple[Array, Array, Array]:
    """Return the angles, velocities and accelerations that the arm shall have."""
    q = np.array([0.8 * np.sin(2 * time), 0.6 * np.sin(3 * time)])
    v = np.array([1.6 * np.cos(2 * time), 1.8 * np.cos(3 * time)])
    return q, v, np.array([-4.0, -9.0]) * q


@cache
def root_mean_square_errors() -> dict[str, Array]:
    """Return the errors of each joint for both controllers: torques held for a period, RK4 in between."""
    model, plant = pinocchio_model(known()), pinocchio_model(real())
    data = model.createData()
    results = {}
    for name in ("pd", "computed_torque"):
        q, v, _ = reference(0.0)
        state, errors = np.concatenate([q, v]), []
        for index in range(round(DURATION / PERIOD) + 1):
            q_wanted, v_wanted, a_wanted = reference(index * PERIOD)
            error, error_rate = q_wanted - state[:2], v_wanted - state[2:]
            errors.append(error)
            if name == "pd":
                torque = np.array(PD_STIFFNESS) * error + np.array(PD_DAMPING) * error_rate
            else:
                a = a_wanted + STIFFNESS * error + DAMPING * error_rate
                torque = np.array(pin.rnea(model, data, state[:2], state[2:], a))
            state = advance(arm_derivative(plant, torque), state, PERIOD, 1)
        results[name] = np.sqrt(np.mean(np.square(errors), axis=0))
    return results


def check(folder: Path) -> None:
    """Compare with a simulation by Pinocchio's forward dynamics and a Runge-Kutta method."""
    answer = read_answer(folder, "pd", "computed_torque")
    for name, want in root_mean_square_errors().items():
        require_close(name, numbers(name, answer[name], 2), want, 0.03 * want)


TASK = Task(
    "Computed torque or PD with a payload?",
    f"""
The file arm.urdf describes an arm. The real arm holds a payload of {PAYLOAD} kg, a point mass at link tip,
of which the controllers do not know. There is no friction; gravity is 9.81 m/s2 along -z.
For {DURATION:.0f} s the arm shall follow
    shoulder = 0.8 sin(2 t),   elbow = 0.6 sin(3 t)   (rad, t in s),
and it starts there with the right velocity. Compare two controllers that run every millisecond and whose
torque is held in between:
- PD: torque = Kp e + Kd e', Kp = {PD_STIFFNESS} N m/rad, Kd = {PD_DAMPING} N m s/rad, no gravity term;
- computed torque from arm.urdf: the acceleration is the reference's plus
  {STIFFNESS:.0f} e + {DAMPING:.0f} e'.
Here e is the reference less the measured angle. Torques have no limit.

Write answer.json: {{"pd": [shoulder, elbow], "computed_torque": [shoulder, elbow]}}: the root mean square of
e over the {DURATION:.0f} s in rad, to 3 %.
""",
    check,
    {"arm.urdf": known},
)
