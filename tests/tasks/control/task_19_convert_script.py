"""A PyBullet script, converted to another engine."""

import os
import re
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

from tests.tasks.motion import advance, arm_derivative
from tests.tasks.robots import pinocchio_model, two_link_arm
from tests.tasks.task import Array, Task, existing, read_table, require, require_close

COLUMNS = ("t", "shoulder", "elbow")
ROWS = 21
START = (2.8, -0.4)
VISCOUS = 0.4

SCRIPT = """\
import math
import pybullet as p

p.connect(p.DIRECT)
p.setGravity(0, 0, -9.81)
p.setTimeStep(0.001)
arm = p.loadURDF("arm.urdf", useFixedBase=True, flags=p.URDF_USE_INERTIA_FROM_FILE)
joints = [0, 1]
for joint, angle in zip(joints, [2.8, -0.4]):
    p.resetJointState(arm, joint, angle)
    p.changeDynamics(arm, joint, linearDamping=0, angularDamping=0, jointDamping=0.4)
p.setJointMotorControlArray(arm, joints, p.VELOCITY_CONTROL, forces=[0, 0])
print("t,shoulder,elbow")
for step in range(2001):
    if step % 100 == 0:
        q = [state[0] for state in p.getJointStates(arm, joints)]
        print(f"{step * 0.001:.1f},{q[0]:.6f},{q[1]:.6f}")
    torque = [3 * math.sin(3 * step * 0.001), -0.5]
    p.setJointMotorControlArray(arm, joints, p.TORQUE_CONTROL, forces=torque)
    p.stepSimulation()
"""


def description() -> str:
    """Return the arm, each link with an inertial element."""
    tip = (
        '  <link name="tip">\n    <inertial><mass value="0.2"/>'
        '<inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>\n  </link>\n'
    )
    return two_link_arm((1.0, 0.8), (0.4, 0.35), tip=tip)


@cache
def motion() -> Array:
    """Return time and angles every 100 ms, by a Runge-Kutta method; torques are held for a millisecond."""
    model = pinocchio_model(description())
    state, rows = np.array([*START, 0.0, 0.0]), []
    for step in range(100 * (ROWS - 1) + 1):
        time = step * 1e-3
        if step % 100 == 0:
            rows.append([time, *state[:2]])
        torque = np.array([3 * np.sin(3 * time), -0.5])
        state = advance(arm_derivative(model, torque, VISCOUS), state, 1e-3, 1)
    return np.array(rows)


def check(folder: Path) -> None:
    """Run the program in an empty folder and compare what it writes with a Runge-Kutta method."""
    program = existing(folder, "program.py").resolve()
    calls = re.search(r"^\s*(import|from)\s+pybullet\b", program.read_text(), re.MULTILINE)
    require(calls is None, "program.py still imports pybullet")
    with tempfile.TemporaryDirectory() as place:
        Path(place, "arm.urdf").write_text(description())
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        command = [sys.executable, str(program)]
        try:
            run = subprocess.run(
                command, cwd=place, env=environment, capture_output=True, text=True, timeout=120
            )
        except subprocess.TimeoutExpired:
            run = None
        require(run is not None, "program.py takes over two minutes")
        assert run is not None
        error = (run.stderr.strip().splitlines() or [""])[-1]
        require(run.returncode == 0, f"program.py fails: {error}")
        rows = read_table(Path(place), "answer.csv", COLUMNS, ROWS)
    require_close("answer.csv", rows, motion(), 1e-2)


TASK = Task(
    "Leave PyBullet",
    """
Your script script.py simulates an arm in PyBullet. Write program.py, which does the same experiment on
MuJoCo's physics instead: same robot, same start, same joint damping, same torques, each held for a
millisecond.
It reads arm.urdf in its working directory, takes no arguments, does not import pybullet, and writes the rows
that script.py prints to the file answer.csv. Angles must be right to 0.01 rad.

Write program.py. The check runs it.
""",
    check,
    {"script.py": lambda: SCRIPT, "arm.urdf": description},
)
