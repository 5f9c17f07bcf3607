"""Friction and payload from a log."""

from pathlib import Path

import numpy as np
import pinocchio as pin

from tests.tasks.robots import ball, pinocchio_model, two_link_arm
from tests.tasks.task import Array, Task, numbers, read_answer, require_close, table

COLUMNS = ("t", "q1", "q2", "v1", "v2", "a1", "a2", "tau1", "tau2")
VISCOUS, COULOMB, PAYLOAD = (0.9, 0.35), (1.4, 0.6), 0.65


def log() -> Array:
    """Return the rows of the log: torques by Pinocchio, friction and noise of 0.02 N m."""
    times = np.arange(1500) * 0.01
    waves = [(0.9, 1.3, 0.4, 2.9), (0.7, 2.1, 0.5, 3.7)]
    q = np.stack([a * np.sin(b * times) + c * np.sin(d * times) for a, b, c, d in waves], axis=1)
    v = np.stack([a * b * np.cos(b * times) + c * d * np.cos(d * times) for a, b, c, d in waves], axis=1)
    a = np.stack(
        [-a * b**2 * np.sin(b * times) - c * d**2 * np.sin(d * times) for a, b, c, d in waves], axis=1
    )
    model = pinocchio_model(two_link_arm(tip=ball("tip", PAYLOAD, 1e-3, "1 0 0 1")))
    data = model.createData()
    rigid = np.array([pin.rnea(model, data, *row) for row in zip(q, v, a, strict=True)])
    noise = np.random.default_rng(17).normal(0, 0.02, rigid.shape)
    torques = rigid + np.array(VISCOUS) * v + np.array(COULOMB) * np.sign(v) + noise
    return np.column_stack([times, q, v, a, torques])


def check(folder: Path) -> None:
    """Compare with the values that the log was made with."""
    answer = read_answer(folder, "viscous", "coulomb", "payload")
    require_close("viscous", numbers("viscous", answer["viscous"], 2), np.array(VISCOUS), 0.01)
    require_close("coulomb", numbers("coulomb", answer["coulomb"], 2), np.array(COULOMB), 0.02)
    require_close("payload", numbers("payload", answer["payload"]), np.array(PAYLOAD), 0.01)


TASK = Task(
    "Friction and payload from a log",
    f"""
The file arm.urdf describes an arm; log.csv is a measurement of the real one. Its columns are
{",".join(COLUMNS)}: time [s], angles, velocities and accelerations of shoulder and elbow (rad), and
the motors' torques [N m], which are noisy. Gravity is 9.81 m/s2 along -z.
The real arm held a small payload at link tip (a point mass). Its joints have viscous friction d v and Coulomb
friction c sign(v). What are d and c of each joint, and what is the payload's mass?

Write answer.json: {{"viscous": [shoulder, elbow] in N m s/rad to 0.01, "coulomb": [shoulder, elbow] in N m to
0.02, "payload": kg to 0.01}}.
""",
    check,
    {"arm.urdf": two_link_arm, "log.csv": lambda: table(COLUMNS, log())},
)
